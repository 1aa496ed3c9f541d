"""What a longer route buys: the plans that no other beats in length, energy and window at once."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace

from planner.cost import Cost
from planner.errors import PlanError
from planner.evaluate import evaluate
from planner.model import Instance, Plan
from planner.params import DEFAULT_PARAMS, SearchParams
from planner.stop_rules import (
    Iterations,
    Progress,
    StopRule,
    StopVerdict,
    Stopwatch,
    add_progress_report,
    combine_stop_rules,
)
from planner.window import ReplanWindow, replan_window

STRETCHES = (0.0, 0.05, 0.1, 0.2)
"""How much longer than the best MinMax plan's the longest route may be, as shares of it."""
SAME = 1e-9
"""Figures that differ by less than this share are equal."""


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
    if len(instance.vehicles) == 1:
        raise PlanError(f"{instance.vehicles[0].name} is the only vehicle: nobody is left when it is lost")
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
    return _select_undominated(_evaluate_plan(instance, plan, fly_again=fly_again) for plan in plans)


def _evaluate_plan(instance: Instance, plan: Plan, *, fly_again: bool) -> ParetoPlan:
    evaluation, window = evaluate(instance, plan, Cost.MINMAX), replan_window(instance, plan, fly_again=fly_again)
    return ParetoPlan(plan, evaluation.longest_route_s, sum(evaluation.energies_pct), window)


def _select_undominated(plans: Iterable[ParetoPlan]) -> tuple[ParetoPlan, ...]:
    """Return the plans that no other one equals or beats in all figures; of equal ones the first."""
    kept: list[ParetoPlan] = []
    for plan in sorted(plans, key=_sort_key):
        if not any(_is_dominating(other, plan) for other in kept):
            kept.append(plan)
    return tuple(kept)


def _sort_key(plan: ParetoPlan) -> tuple[float, float, float]:
    return plan.longest_route_s, plan.energy_pct, plan.window.earliest_s


def _is_dominating(one: ParetoPlan, other: ParetoPlan) -> bool:
    pairs = zip(_sort_key(one), _sort_key(other), strict=True)
    return all(ours <= theirs + SAME * abs(theirs) for ours, theirs in pairs)
