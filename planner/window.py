"""The re-plan window: how early a plan may lose any one of its vehicles and still be finished by the others.

Nothing changes between two completions, so a plan has a finite number of losses to evaluate: each interval between
completions, each vehicle still flying in it. The window is the longest suffix of intervals in which every loss has a
re-plan that was found and checked. Whether a loss can be repaired is not monotone in time, so the intervals are scanned
from the end and the first loss without a re-plan ends the window.

With two losses, t* is the earliest end of an interval from which every pair is absorbed: a first vehicle that flies at
any t1 >= t*, and a second one that flies at any t2 >= t1, both chosen freely, vehicles and times. At t2 = t1, or t2 <
t1 + answer_s, the second loss comes before the re-plan of the first is on board: the others fly on as planned, and one
re-plan covers what both leave. Else they fly the re-plan of the first, the one that was found here, and another re-plan
covers what the second leaves. That may be a vehicle that took off for the first re-plan, and after the end of the
longest route of the plan. Every re-plan leaves each vehicle within its budget.

The moments are again finite. What a pair leaves depends on which visits have ended at t1, t2 and ``answer_s`` after
them, and on no other time: energy does not depend on when a move begins. t1 counts by the intervals of the plan, t2 by
those of the routes flown then. Only vehicles that take off from the ground for the first re-plan do so later if t1 is
later in its interval; there one t1 stands for all with the same order of their times and the others'
(``second_loss.py``).
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import groupby, takewhile

from planner.errors import PlanError
from planner.evaluate import (
    Cost,
    CriticalLoss,
    LossRow,
    RepairStatus,
    ReplanWindow,
    evaluate,
)
from planner.fleet_state import event_times_s
from planner.model import Instance, Plan
from planner.replan import SAME_TIME_S, RemainingProblem, build_remaining_problem
from planner.solve import check_routes

EFFORT = 10_000
"""Default iterations of ruin and recreate for one loss: some 50 ms if there is no re-plan."""


def replan_window(
    instance: Instance, plan: Plan, *, effort: int = EFFORT, seed: int = 0, fly_again: bool = True, losses: int = 1,
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
        losses: number of vehicles that may be lost, 1 or 2; the certified time of 2 includes pairs lost at once.
        prove: decide losses of many open segments by column generation, some seconds each; needs HiGHS, of the extra
            `proofs`. Of two losses, the first.

    Raises:
        PlanError: the plan does not match the instance, or no vehicle is left after the losses.
        InstanceError: too many segments for a proof, or HiGHS is not installed.
    """
    check_routes(instance, plan)
    check_fleet(instance, losses)
    if prove:
        from planner.columns import check_can_prove

        check_can_prove(instance.segments)
    evaluation = evaluate(instance, plan, Cost.MINMAX)
    longest_s, events = evaluation.longest_route_s, event_times_s(instance, plan)
    if plan.uncovered or evaluation.violations:
        flying = evaluation.durations_s.index(longest_s)
        return ReplanWindow(
            longest_s, longest_s, longest_s, CriticalLoss(flying, events[-2] if longest_s else 0, longest_s), losses
        )
    if instance.segments == 0:
        return ReplanWindow(0.0, 0.0, longest_s, None, losses)
    scan = _WindowScan(
        instance, plan, events, effort=effort, seed=seed, fly_again=fly_again, losses=losses, prove=prove
    )
    broken, then = scan.find_broken()
    if broken is None:
        return ReplanWindow(0.0, 0.0, longest_s, None, losses)
    return ReplanWindow(
        earliest_s=broken.to_s,
        certified_earliest_s=scan.find_last_impossible_s(broken),
        longest_route_s=longest_s,
        breaking=CriticalLoss(broken.vehicle, broken.from_s, broken.to_s),
        losses=losses,
        then=then,
    )


def find_broken_loss(
    instance: Instance, plan: Plan, *, effort: int, seed: int, fly_again: bool, losses: int
) -> CriticalLoss | None:
    """Return the loss that ends a complete plan's window, or the first of two that do; None for a full window."""
    events = event_times_s(instance, plan)
    scan = _WindowScan(instance, plan, events, effort=effort, seed=seed, fly_again=fly_again, losses=losses)
    return scan.find_broken()[0]


class _WindowScan:
    """The losses of a plan, and with two losses the second ones after each of them."""

    def __init__(
        self, instance: Instance, plan: Plan, events_s: Sequence[float], *, effort: int, seed: int, fly_again: bool,
        losses: int, prove: bool = False,
    ) -> None:  # fmt: skip
        # Imported here, as in solve.py: it loads numba.
        from planner.loss_scan import LossScan

        self._events_s, self._effort = events_s, effort
        self._first = LossScan(instance, plan, events_s, seed=seed, fly_again=fly_again, prove=prove)
        self._second = None
        if losses > 1:
            from planner.second_loss import SecondLosses

            self._second = SecondLosses(self._first, instance, plan, effort=effort, seed=seed, fly_again=fly_again)

    def find_broken(self) -> tuple[LossRow | None, CriticalLoss | None]:
        """Return the last loss without a re-plan, or the last one with a second one that has none, and that one."""
        for _, interval in groupby(self._first.iterate_rows(self._effort), key=lambda row: row.from_s):
            rows = []
            for row in interval:
                if row.verdict is not RepairStatus.FEASIBLE:
                    return row, None
                rows.append(row)
            if self._second is None:
                continue
            for row in rows:
                if isinstance(then := self._second.find_replan(row), CriticalLoss):
                    return row, then
        return None, None

    def find_last_impossible_s(self, broken: LossRow) -> float:
        """Return the end of the last interval, not after a broken one, that is proven not to be in the window."""
        alone_s = self._first.last_impossible_s(broken)
        if self._second is None:
            return alone_s
        for interval in range(len(self._events_s) - 2, -1, -1):
            from_s, to_s = self._events_s[interval : interval + 2]
            if to_s <= alone_s:
                break
            flying = () if from_s > broken.from_s else self._first.find_flying_vehicles(interval)
            if any(self._second.is_impossible(CriticalLoss(vehicle, from_s, to_s)) for vehicle in flying):
                return to_s
        return alone_s


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


def check_fleet(instance: Instance, losses: int = 1) -> None:
    """Check that a vehicle is left after one loss or two.

    Raises:
        PlanError: none is left, or it is another number of losses.
    """
    if losses not in {1, 2}:
        raise PlanError(f"the number of losses is {losses}, expected 1 or 2")
    if losses == 2 and len(instance.vehicles) < 3:
        raise PlanError(f"{len(instance.vehicles)} vehicles, expected 3 or more: no vehicle is left when two are lost")
    if len(instance.vehicles) == 1:
        raise PlanError(f"{instance.vehicles[0].name} is the only vehicle: nobody is left when it is lost")
