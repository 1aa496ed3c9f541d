"""The re-plan window: how early a plan may lose any one of its vehicles and still be finished by the others.

Between two completions nothing changes, so a plan has finitely many losses to look at: each interval between
completions, each vehicle still flying in it. The window is the longest suffix of intervals in which every loss has a
re-plan that was found and checked. Whether a loss can be repaired is not monotone in time, so the intervals are gone
through from the end and the first loss without a re-plan ends the window.

Plans are also chosen for it: the largest window for a longest route of a given length. A window is bought with time, so
the length is given: ``1 + stretch`` times the longest route of the best MinMax plan. Ordinary plans, in all
orientations of their routes, are where the search begins; it then works on the window itself (kernels/robust_walk.py):
it aims a step below the earliest time so far, and when it has a plan all of whose losses there can be repaired, the
whole window of that plan is computed and the aim goes lower.

What a longer route buys is a Pareto front: the plans that no other beats in length, energy and window at once.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import takewhile

from planner.errors import PlanError
from planner.evaluate import (
    Cost,
    CriticalLoss,
    LossRow,
    RepairStatus,
    ReplanWindow,
    WindowResult,
    completion_times_s,
    evaluate,
    route_duration_s,
)
from planner.model import Instance, Plan
from planner.params import DEFAULT_PARAMS, SearchParams
from planner.replan import SAME_TIME_S, RemainingProblem, build_remaining_problem
from planner.solve import check_tails
from planner.stop_rules import (
    Iterations,
    Progress,
    StopRule,
    StopVerdict,
    Stopwatch,
    add_progress_report,
    combine_stop_rules,
)

EFFORT = 10_000
"""Iterations of ruin and recreate for one loss, as a default: some 50 ms where there is no re-plan."""


def replan_window(
    instance: Instance, plan: Plan, *, effort: int = EFFORT, seed: int = 0, fly_again: bool = True
) -> ReplanWindow:
    """Return the re-plan window of a plan.

    The same arguments give the same window on every machine. Only a plan that covers everything within its budgets
    has one; the window of any other is empty, and that is certain.

    Args:
        instance: of the plan.
        plan: to be flown as it is until a vehicle is lost.
        effort: iterations of ruin and recreate for each loss that is not repaired at once.
        seed: of all randomness.
        fly_again: whether vehicles on the ground or on their way home may fly (again).

    Raises:
        PlanError: the plan is not one for the instance, or has one vehicle only.
    """
    check_tails(instance, [route.visits for route in plan.routes])
    check_fleet(instance)
    evaluation = evaluate(instance, plan, Cost.MINMAX)
    longest_s, events = evaluation.longest_route_s, event_times_s(instance, plan)
    if plan.uncovered or evaluation.violations:
        flying = evaluation.durations_s.index(longest_s)
        return ReplanWindow(
            longest_s, longest_s, longest_s, CriticalLoss(flying, events[-2] if longest_s else 0, longest_s)
        )
    # Only here, as in solve.py: it loads numba.
    from planner.loss_scan import LossScan

    if instance.segments == 0:
        return ReplanWindow(0.0, 0.0, longest_s, None)
    losses = LossScan(instance, plan, events, seed=seed, fly_again=fly_again)
    broken = next((row for row in losses.iterate_rows(effort) if row.verdict is not RepairStatus.FEASIBLE), None)
    if broken is None:
        return ReplanWindow(0.0, 0.0, longest_s, None)
    return ReplanWindow(
        earliest_s=broken.to_s,
        certified_earliest_s=losses.last_impossible_s(broken),
        longest_route_s=longest_s,
        breaking=CriticalLoss(broken.vehicle, broken.from_s, broken.to_s),
    )


def iterate_losses(
    instance: Instance, plan: Plan, *, effort: int = EFFORT, seed: int = 0, fly_again: bool = True
) -> Iterator[LossRow]:
    """Return all losses of a plan, those at the end first: each interval with each vehicle flying in it.

    A row is computed when it is asked for.

    Args:
        instance: of the plan.
        plan: to be flown as it is until a vehicle is lost; what it leaves uncovered is open in every loss.
        effort: iterations of ruin and recreate for each loss that is not repaired at once.
        seed: of all randomness.
        fly_again: whether vehicles on the ground or on their way home may fly (again).

    Raises:
        PlanError: the plan is not one for the instance, or has one vehicle only.
    """
    check_tails(instance, [route.visits for route in plan.routes])
    check_fleet(instance)
    if instance.segments == 0:
        return iter(())
    from planner.loss_scan import LossScan

    return LossScan(instance, plan, event_times_s(instance, plan), seed=seed, fly_again=fly_again).iterate_rows(effort)


def find_repairs_at(
    instance: Instance, plan: Plan, at_s: float, *, effort: int = EFFORT, seed: int = 0, fly_again: bool = True
) -> tuple[tuple[RemainingProblem, Plan], ...]:
    """Return what the loss of each vehicle that flies ``at_s`` leaves, with a re-plan, as far as found.

    At ``earliest_s`` that is all of them. It goes through the intervals from the end, as ``replan_window`` does with
    the same effort and seed, so it finds what that has found.

    Raises:
        PlanError: the plan is not one for the instance, or has one vehicle only.
    """
    rows = iterate_losses(instance, plan, effort=effort, seed=seed, fly_again=fly_again)
    after = (row for row in rows if row.from_s <= at_s + SAME_TIME_S)
    here = takewhile(lambda row: row.to_s > at_s + SAME_TIME_S, after)
    return tuple(
        (build_remaining_problem(instance, plan, row.vehicle, row.from_s, fly_again=fly_again), row.plan)
        for row in here
        if row.plan is not None
    )


def event_times_s(instance: Instance, plan: Plan) -> tuple[float, ...]:
    """Return 0 and the times at which a visit ends or a vehicle lands, ascending; the last is the longest route's end.

    Between two of them nothing changes, whichever vehicle is lost. Where survivors fly on as planned for a while,
    losses that much before such a time count as well.
    """
    times = [
        time_s for route in plan.routes
        for time_s in (*completion_times_s(instance, route), route_duration_s(instance, route))
    ]  # fmt: skip
    return merge_times(times, instance.answer_s)


def merge_times(times_s: Iterable[float], answer_s: float) -> tuple[float, ...]:
    """Return 0, some times and what lies ``answer_s`` before them, ascending, those that are the same once."""
    events = [0.0]
    for time_s in sorted(time_s for after_s in times_s for time_s in (after_s, after_s - answer_s)):
        if time_s > events[-1] + SAME_TIME_S:
            events.append(float(time_s))
    return tuple(events)


def check_fleet(instance: Instance) -> None:
    """Check that somebody is left after a loss.

    Raises:
        PlanError: there is one vehicle only.
    """
    if len(instance.vehicles) == 1:
        raise PlanError(f"{instance.vehicles[0].name} is the only vehicle: nobody is left when it is lost")


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
        check_tails(instance, [route.visits for route in plan.routes])
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
