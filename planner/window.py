"""The re-plan window: how early a plan may lose any one of its vehicles and still be finished by the others.

Nothing changes between two completions, so a plan has a finite number of losses to evaluate: each interval between
completions, each vehicle still flying in it. The window is the longest suffix of intervals in which every loss has a
re-plan that was found and checked. Whether a loss can be repaired is not monotone in time, so the intervals are scanned
from the end and the first loss without a re-plan ends the window.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from itertools import takewhile

from planner.errors import PlanError
from planner.evaluate import (
    Cost,
    CriticalLoss,
    LossRow,
    RepairStatus,
    ReplanWindow,
    completion_times_s,
    evaluate,
    route_duration_s,
)
from planner.model import Instance, Plan
from planner.replan import SAME_TIME_S, RemainingProblem, build_remaining_problem
from planner.solve import check_routes

EFFORT = 10_000
"""Default iterations of ruin and recreate for one loss: some 50 ms if there is no re-plan."""


def replan_window(
    instance: Instance, plan: Plan, *, effort: int = EFFORT, seed: int = 0, fly_again: bool = True,
    prove: bool = False,
) -> ReplanWindow:  # fmt: skip
    """Return the re-plan window of a plan.

    The same arguments give the same window on every machine. Only a plan that covers everything within its budgets has
    one; the window of any other is empty, and that is certain.

    Args:
        instance: the instance of the plan.
        plan: the plan, flown as it is until a vehicle is lost.
        effort: iterations of ruin and recreate for each loss that is not repaired at once.
        seed: seed of all randomness.
        fly_again: whether vehicles that are on the ground or returning may fly (again).
        prove: decide losses of many open segments by column generation, some seconds each; needs HiGHS, of the extra
            `proofs`.

    Raises:
        PlanError: the plan does not match the instance, or has only one vehicle.
        InstanceError: too many segments for a proof, or HiGHS is not installed.
    """
    check_routes(instance, plan)
    check_fleet(instance)
    if prove:
        from planner.columns import check_can_prove

        check_can_prove(instance.segments)
    evaluation = evaluate(instance, plan, Cost.MINMAX)
    longest_s, events = evaluation.longest_route_s, event_times_s(instance, plan)
    if plan.uncovered or evaluation.violations:
        flying = evaluation.durations_s.index(longest_s)
        return ReplanWindow(
            longest_s, longest_s, longest_s, CriticalLoss(flying, events[-2] if longest_s else 0, longest_s)
        )
    # Imported here, as in solve.py: it loads numba.
    from planner.loss_scan import LossScan

    if instance.segments == 0:
        return ReplanWindow(0.0, 0.0, longest_s, None)
    losses = LossScan(instance, plan, events, seed=seed, fly_again=fly_again, prove=prove)
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

    Rows are computed on demand.

    Args:
        instance: the instance of the plan.
        plan: the plan, flown as it is until a vehicle is lost; its uncovered segments are open in every loss.
        effort: iterations of ruin and recreate for each loss that is not repaired at once.
        seed: seed of all randomness.
        fly_again: whether vehicles that are on the ground or returning may fly (again).

    Raises:
        PlanError: the plan does not match the instance, or has only one vehicle.
    """
    check_routes(instance, plan)
    check_fleet(instance)
    if instance.segments == 0:
        return iter(())
    from planner.loss_scan import LossScan

    return LossScan(instance, plan, event_times_s(instance, plan), seed=seed, fly_again=fly_again).iterate_rows(effort)


def find_repairs_at(
    instance: Instance, plan: Plan, at_s: float, *, effort: int = EFFORT, seed: int = 0, fly_again: bool = True
) -> tuple[tuple[RemainingProblem, Plan], ...]:
    """Return, for each vehicle that flies ``at_s``, the problem after its loss, with a re-plan if found.

    At ``earliest_s`` all have one. It scans the intervals from the end, as ``replan_window`` does with the same effort
    and seed, so it finds the same re-plans.

    Raises:
        PlanError: the plan does not match the instance, or has only one vehicle.
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

    Nothing changes between two of them, whichever vehicle is lost. If survivors continue as planned for ``answer_s``,
    times that much earlier are included too.
    """
    times = [
        time_s for route in plan.routes
        for time_s in (*completion_times_s(instance, route), route_duration_s(instance, route))
    ]  # fmt: skip
    return merge_times(times, instance.answer_s)


def merge_times(times_s: Iterable[float], answer_s: float) -> tuple[float, ...]:
    """Return 0, the given times and those ``answer_s`` before them, ascending, without duplicates."""
    events = [0.0]
    for time_s in sorted(time_s for after_s in times_s for time_s in (after_s, after_s - answer_s)):
        if time_s > events[-1] + SAME_TIME_S:
            events.append(float(time_s))
    return tuple(events)


def check_fleet(instance: Instance) -> None:
    """Check that a vehicle is left after a loss.

    Raises:
        PlanError: there is only one vehicle.
    """
    if len(instance.vehicles) == 1:
        raise PlanError(f"{instance.vehicles[0].name} is the only vehicle: nobody is left when it is lost")
