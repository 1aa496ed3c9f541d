"""Plans chosen for how long they can be repaired: the largest re-plan window for a longest route of a given length.

A window is bought with time, so the length is given: ``1 + stretch`` times the longest route of the best MinMax plan.
Ordinary plans, in all orientations of their routes, are where the search begins; it then works on the window itself
(kernels/robust_walk.py): it aims a step below the earliest time so far, and when it has a plan all of whose losses
there can be repaired, the whole window of that plan is computed and the aim goes lower.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

from planner.errors import PlanError
from planner.model import Instance, Plan
from planner.params import DEFAULT_PARAMS, SearchParams
from planner.solve import check_tails
from planner.stop_rules import Progress, StopRule, Stopwatch, add_progress_report
from planner.window import WindowResult


def solve_window(  # noqa: PLR0913 - what is asked for, how long to search, and from where
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
    params: SearchParams = DEFAULT_PARAMS,
    on_progress: Callable[[Progress], None] | None = None,
) -> WindowResult:
    """Return the plan with the earliest t* found whose longest route is not longer than allowed.

    The same seed, starts and number of iterations give the same plan. An iteration is one plan looked at, whether by
    the searches for the plans to begin with or on the window itself; the value in ``Progress`` is t* in seconds.

    Args:
        instance: the problem; budgets hold always.
        stretch: how much longer than the best MinMax plan's the longest route may be, as a share of it.
        stop: asked every second or more often.
        seed: of all randomness.
        all_vehicles: leave no vehicle without a visit.
        longest_s: the longest route of the best MinMax plan, where it is known; else one is searched for.
        initial: plans to begin with, besides those that are searched for.
        starts: searches side by side, each in a thread of its own; they share what is best now and then.
        fly_again: whether vehicles that have landed may fly again after a loss.
        params: what the searches are tuned by. Part of what decides the plan.
        on_progress: called whenever ``stop`` is asked.

    Raises:
        PlanError: there is one vehicle only, the stretch is negative, or a plan in ``initial`` is not one for the
            instance.
    """
    if len(instance.vehicles) == 1:
        raise PlanError(f"{instance.vehicles[0].name} is the only vehicle: nobody is left when it is lost")
    if not stretch >= 0:
        raise PlanError(f"the stretch is {stretch}, expected zero or more")
    for plan in initial:
        check_tails(instance, [route.visits for route in plan.routes])
    # Only here, as in solve.py: it loads numba.
    from planner.robust_search import RobustSearch

    search = RobustSearch(
        instance, add_progress_report(stop, on_progress), Stopwatch(), seed=seed, all_vehicles=all_vehicles,
        starts=starts, fly_again=fly_again, params=params,
    )  # fmt: skip
    return search.run(stretch=stretch, longest_s=longest_s, initial=initial)
