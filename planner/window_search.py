"""Search for plans that stay repairable: the largest re-plan window for a longest route of a given length.

A larger window costs time, so the length is given: ``1 + stretch`` times the longest route of the best MinMax plan. The
search begins with ordinary plans, in all orientations of their routes; it then works on the window itself
(kernels/robust_walk.py): it aims a step below the earliest time so far, and when it has a plan whose losses there can
all be repaired, it computes the whole window of that plan and lowers the aim.

The benefit of a longer route is a Pareto front: the plans that no other plan beats in length, energy and window at
once.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from operator import le

from planner.errors import PlanError
from planner.evaluate import Cost, ReplanWindow, WindowResult, evaluate
from planner.model import Instance, Plan
from planner.params import DEFAULT_PARAMS, SearchParams
from planner.solve import check_routes
from planner.stop_rules import (
    Iterations,
    Progress,
    StopRule,
    StopVerdict,
    Stopwatch,
    add_progress_report,
    combine_stop_rules,
)
from planner.window import check_fleet, replan_window

STRETCHES = (0.0, 0.05, 0.1, 0.2)
"""Values by which the longest route may exceed that of the best MinMax plan, as shares of it."""
SAME = 1e-9
"""Relative tolerance for equal figures."""


def solve_window(  # noqa: PLR0913 - problem, search length and start
    instance: Instance,
    *,
    stretch: float,
    stop: StopRule,
    seed: int = 0,
    all_vehicles: bool = False,
    longest_s: float | None = None,
    initial: Sequence[Plan] = (),
    starts: int = 1,
    fly_again: bool = True,
    losses: int = 1,
    params: SearchParams = DEFAULT_PARAMS,
    on_progress: Callable[[Progress], None] | None = None,
) -> WindowResult:
    """Return the plan with the earliest t* found whose longest route is within the allowed length.

    Of plans with equal t* it is the one with the shorter longest route. So the plan is never worse, neither in seconds
    nor in percent of its longest route, than one in ``initial`` whose longest route is no longer.

    The same seed, starts and number of iterations give the same plan. An iteration is one evaluated plan, by the
    searches for initial plans or on the window itself; the value in ``Progress`` is t* in seconds.

    Args:
        instance: the problem; its budgets always apply.
        stretch: how much longer than the best MinMax plan's the longest route may be, as a share of it.
        stop: checked every second or more often, with two losses every few seconds.
        seed: seed of all randomness.
        all_vehicles: leave no vehicle without a visit.
        longest_s: the longest route of the best MinMax plan, if known; else a search finds one.
        initial: initial plans in addition to those that the search finds.
        starts: parallel searches, one thread each; they share their best plans from time to time.
        fly_again: whether landed vehicles may fly again after a loss.
        losses: number of vehicles that may be lost, 1 or 2. With 2 the walks work on pairs lost at once; a plan counts
            by its window against all pairs.
        params: tuning of the searches. The plan depends on it.
        on_progress: called whenever ``stop`` is checked.

    Raises:
        PlanError: no vehicle is left after the losses, the stretch is negative, or a plan in ``initial`` does not match
            the instance.
    """
    check_fleet(instance, losses)
    if not stretch >= 0:
        raise PlanError(f"the stretch is {stretch}, expected zero or more")
    for plan in initial:
        check_routes(instance, plan)
    # Imported here, as in solve.py: it loads numba.
    from planner.robust_search import RobustSearch

    search = RobustSearch(
        instance, add_progress_report(stop, on_progress), Stopwatch(), seed=seed, all_vehicles=all_vehicles,
        starts=starts, fly_again=fly_again, losses=losses, params=params,
    )  # fmt: skip
    return search.run(stretch=stretch, longest_s=longest_s, initial=initial, rivals=initial)


@dataclass(frozen=True, slots=True)
class ParetoPlan:
    """A plan that no other plan found beats in all three figures."""

    plan: Plan
    longest_route_s: float
    energy_pct: float
    """Energy of all routes together."""
    window: ReplanWindow
    """The window; its ``earliest_s`` is the third figure."""


def find_pareto_front(  # noqa: PLR0913 - problem, search length and stretches
    instance: Instance,
    *,
    stop: StopRule,
    seed: int = 0,
    all_vehicles: bool = False,
    starts: int = 1,
    stretches: Sequence[float] = STRETCHES,
    fly_again: bool = True,
    losses: int = 1,
    params: SearchParams = DEFAULT_PARAMS,
    on_progress: Callable[[Progress], None] | None = None,
) -> tuple[ParetoPlan, ...]:
    """Return the plans found that no other one beats, the one with the shortest longest route first.

    Windows are searched at each stretch in turn, in rounds that grow, each from the plans of those before. All plans
    that these searches evaluated or started from compete. Empty if no plan covers everything.

    Args:
        instance: the problem; its budgets always apply.
        stop: the stop rule over all searches.
        seed: seed of all randomness.
        all_vehicles: leave no vehicle without a visit.
        starts: parallel searches for each stretch.
        stretches: how much longer than the best MinMax plan's the longest route may be, as shares of it.
        fly_again: whether landed vehicles may fly again after a loss.
        losses: number of vehicles that may be lost, 1 or 2. With 2 the walks work on pairs lost at once; a plan counts
            by its window against all pairs.
        params: tuning of the searches.
        on_progress: called whenever ``stop`` is checked.

    Raises:
        PlanError: no vehicle is left after the losses.
    """
    check_fleet(instance, losses)
    # Imported here, as in solve.py: it loads numba.
    from planner.robust_search import RobustSearch, plan_from_routes

    watch, done, over = Stopwatch(), 0, False

    def ask_over_all(progress: Progress) -> StopVerdict:
        """Check the stop rule with the iterations of all searches."""
        nonlocal over
        verdict = stop(replace(progress, iterations=done + progress.iterations))
        over = over or verdict.allowed <= 0
        return verdict

    plans: dict[Plan, None] = {}
    length = params.window.front_round
    number = 0
    full = False
    while not (over or full):
        full = number > 0
        for stretch in sorted(stretches):
            search = RobustSearch(
                instance, add_progress_report(combine_stop_rules(Iterations(length), ask_over_all), on_progress), watch,
                seed=seed + 100 * number, all_vehicles=all_vehicles, starts=starts, fly_again=fly_again,
                losses=losses, params=params,
            )  # fmt: skip
            done += search.run(stretch=stretch, longest_s=None, initial=tuple(plans)).iterations
            full = full and search.earliest_s <= 0
            plans.update(dict.fromkeys(plan_from_routes(found.routes) for found in search.archive))
            if over:
                break
        length += length // 2
        number += 1
    kept: list[ParetoPlan] = []
    # Of equal plans the first is kept.
    for plan in sorted(
        (_evaluate_plan(instance, plan, fly_again=fly_again, losses=losses) for plan in plans), key=_sort_key
    ):
        most = [figure + SAME * abs(figure) for figure in _sort_key(plan)]
        if not any(all(map(le, _sort_key(other), most)) for other in kept):
            kept.append(plan)
    return tuple(kept)


def _evaluate_plan(instance: Instance, plan: Plan, *, fly_again: bool, losses: int) -> ParetoPlan:
    evaluation = evaluate(instance, plan, Cost.MINMAX)
    window = replan_window(instance, plan, fly_again=fly_again, losses=losses)
    return ParetoPlan(plan, evaluation.longest_route_s, sum(evaluation.energies_pct), window)


def _sort_key(plan: ParetoPlan) -> tuple[float, float, float]:
    return plan.longest_route_s, plan.energy_pct, plan.window.earliest_s
