"""Plans chosen for how long they can be repaired: the largest re-plan window for a longest route of a given length.

A window is bought with time, so the length is given: ``1 + stretch`` times the longest route of the best MinMax plan.
Ordinary plans, in all orientations of their routes, are where the search begins; it then works on the window itself
(kernels/robust_walk.py): it aims a step below the earliest time so far, and when it has a plan all of whose losses
there can be repaired, the whole window of that plan is computed and the aim goes lower.

What a longer route buys is a Pareto front: the plans that no other beats in length, energy and window at once.
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
"""How much longer than the best MinMax plan's the longest route may be, as shares of it."""
SAME = 1e-9
"""Figures that differ by less than this share are equal."""


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
    check_fleet(instance)
    if not stretch >= 0:
        raise PlanError(f"the stretch is {stretch}, expected zero or more")
    for plan in initial:
        check_routes(instance, plan)
    # Only here, as in solve.py: it loads numba.
    from planner.robust_search import RobustSearch

    search = RobustSearch(
        instance, add_progress_report(stop, on_progress), Stopwatch(), seed=seed, all_vehicles=all_vehicles,
        starts=starts, fly_again=fly_again, params=params,
    )  # fmt: skip
    return search.run(stretch=stretch, longest_s=longest_s, initial=initial)


@dataclass(frozen=True, slots=True)
class ParetoPlan:
    """A plan that no other one found beats in all three figures."""

    plan: Plan
    longest_route_s: float
    energy_pct: float
    """Of all routes together."""
    window: ReplanWindow
    """Its ``earliest_s`` is the third figure."""


def find_pareto_front(  # noqa: PLR0913 - what is asked for, how long to search, and where
    instance: Instance,
    *,
    stop: StopRule,
    seed: int = 0,
    all_vehicles: bool = False,
    starts: int = 1,
    stretches: Sequence[float] = STRETCHES,
    fly_again: bool = True,
    params: SearchParams = DEFAULT_PARAMS,
    on_progress: Callable[[Progress], None] | None = None,
) -> tuple[ParetoPlan, ...]:
    """Return the plans found that no other one beats, the one with the shortest longest route first.

    Windows are searched for at each stretch in turn, in rounds that grow, each from the plans of those before. What
    competes are all plans that any of these searches looked at or was led by. None if no plan covers everything.

    Args:
        instance: the problem; budgets hold always.
        stop: over all searches.
        seed: of all randomness.
        all_vehicles: leave no vehicle without a visit.
        starts: searches side by side for each stretch.
        stretches: how much longer than the best MinMax plan's the longest route may be, as shares of it.
        fly_again: whether vehicles that have landed may fly again after a loss.
        params: what the searches are tuned by.
        on_progress: called whenever ``stop`` is asked.

    Raises:
        PlanError: there is one vehicle only.
    """
    check_fleet(instance)
    # Only here, as in solve.py: it loads numba.
    from planner.robust_search import RobustSearch, plan_from_routes

    watch, done, over = Stopwatch(), 0, False

    def ask_over_all(progress: Progress) -> StopVerdict:
        """Ask the stop rule with the iterations of all searches."""
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
                seed=seed + 100 * number, all_vehicles=all_vehicles, starts=starts, fly_again=fly_again, params=params,
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
    for plan in sorted((_evaluate_plan(instance, plan, fly_again=fly_again) for plan in plans), key=_sort_key):
        most = [figure + SAME * abs(figure) for figure in _sort_key(plan)]
        if not any(all(map(le, _sort_key(other), most)) for other in kept):
            kept.append(plan)
    return tuple(kept)


def _evaluate_plan(instance: Instance, plan: Plan, *, fly_again: bool) -> ParetoPlan:
    evaluation, window = evaluate(instance, plan, Cost.MINMAX), replan_window(instance, plan, fly_again=fly_again)
    return ParetoPlan(plan, evaluation.longest_route_s, sum(evaluation.energies_pct), window)


def _sort_key(plan: ParetoPlan) -> tuple[float, float, float]:
    return plan.longest_route_s, plan.energy_pct, plan.window.earliest_s
