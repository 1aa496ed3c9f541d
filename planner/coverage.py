"""Search for plans that are likely to be finished: the largest probability that everything is inspected.

The measure is that of ``planner.risk``: vehicles fail at random in flight, and the survivors re-plan. The search has
three stages, each slower and more accurate than the one before:

1. A search for the re-plan window gives initial plans. Walks (kernels/robust_walk.py) then change them so that fewer of
   a sample of first losses are without a re-plan: one at each of some times, the quantiles of the time of the first
   failure. All plans of a cycle face the same losses, so their difference is not that of the sample.
2. At the end of a cycle every first loss of its plan is tried once, and weighted with its probability.
3. The best plans are flown ``CoverageParams.flights`` times with further losses, all with the same random numbers.

A plan that was chosen by random flights looks better in these than it is. The estimate of the result is therefore made
from other flights, by the same function as that of ``faultline risk``.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, fields

from planner.errors import InstanceError
from planner.evaluate import Result
from planner.model import Instance, Plan
from planner.params import DEFAULT_PARAMS, SearchParams
from planner.risk import COVERAGE_FLIGHTS, RiskEstimate, estimate_coverage
from planner.solve import check_routes
from planner.stop_rules import Progress, StopRule, Stopwatch, add_progress_report
from planner.window import check_fleet


@dataclass(frozen=True, slots=True)
class CoverageResult(Result):
    """The plan most likely to be finished; its value is MinMax."""

    chance: RiskEstimate = field(kw_only=True)
    """The estimate from flights that the search has not seen."""


def solve_coverage(  # noqa: PLR0913 - problem, search length and start
    instance: Instance,
    *,
    mtbf_h: float,
    stop: StopRule,
    seed: int = 0,
    all_vehicles: bool = False,
    initial: Sequence[Plan] = (),
    starts: int = 1,
    fly_again: bool = True,
    flights: int = COVERAGE_FLIGHTS,
    params: SearchParams = DEFAULT_PARAMS,
    on_progress: Callable[[Progress], None] | None = None,
) -> CoverageResult:
    """Return the plan found that most probably inspects everything, under random losses with re-plans.

    The same seed, starts and number of iterations give the same plan. The value in ``Progress`` is the probability that
    the first loss has no re-plan; before the walks begin, it is t* in seconds.

    Args:
        instance: the problem; its budgets always apply.
        mtbf_h: mean flight hours between failures of one vehicle.
        stop: checked every second or more often; the final flights come after it.
        seed: seed of all randomness; ``estimate_coverage`` with it gives ``chance``.
        all_vehicles: leave no vehicle without a visit.
        initial: initial plans in addition to those that the search finds.
        starts: parallel searches, one thread each; they share their best plans from time to time.
        fly_again: whether landed vehicles may fly again after a loss.
        flights: number of flights of the final estimate.
        params: tuning of the searches. The plan depends on it.
        on_progress: called whenever ``stop`` is checked.

    Raises:
        InstanceError: the mean time between failures is not more than zero.
        PlanError: there is only one vehicle, no plan inspects everything, or a plan in ``initial`` does not match the
            instance.
    """
    check_fleet(instance)
    if not (math.isfinite(mtbf_h) and mtbf_h > 0):
        raise InstanceError(f"mean time between failures is {mtbf_h} h, expected more than zero")
    for plan in initial:
        check_routes(instance, plan)
    # Imported here, as in solve.py: it loads numba.
    from planner.coverage_search import CoverageSearch

    search = CoverageSearch(
        instance, add_progress_report(stop, on_progress), Stopwatch(), seed=seed, all_vehicles=all_vehicles,
        starts=starts, fly_again=fly_again, params=params, mtbf_h=mtbf_h,
    )  # fmt: skip
    result = search.run_all(initial)
    chance = estimate_coverage(instance, result.plan, mtbf_h, flights=flights, seed=seed, fly_again=fly_again)
    return CoverageResult(**{one.name: getattr(result, one.name) for one in fields(Result)}, chance=chance)
