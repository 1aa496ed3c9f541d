"""Losses of two vehicles, one after the other or at once: what the second one leaves, and whether a re-plan covers it.

After the first loss the survivors go on as planned until its re-plan is on board, ``answer_s`` later; then they fly the
re-plan. A second loss is one of a state before that moment, or of one after it. Each of these states is a plan like any
other, so a ``LossScan`` checks its losses.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from functools import partial
from itertools import pairwise

from planner.errors import PlanError
from planner.evaluate import Cost, CriticalLoss, LossRow, RepairStatus
from planner.fleet_state import FleetAfterLosses, build_state_before_losses, event_times_s, merge_routes
from planner.loss_scan import LossScan
from planner.model import Instance, Plan, segment_of
from planner.replan import SAME_TIME_S, RemainingProblem, build_remaining_problem, replan
from planner.stop_rules import Iterations

OTHER_COSTS = (Cost.MINSUM, Cost.MINCOMB, Cost.MINMAX)
"""Costs by which other re-plans of a first loss are searched for, if the one at hand does not survive a second loss."""
OTHER_SHARE = 0.2
"""Share of the effort for each of them."""


class SecondLosses:
    """The second losses of a plan; call ``find_replan`` for its first losses, those at the end first."""

    def __init__(
        self, first: LossScan, instance: Instance, plan: Plan, *, effort: int, seed: int, fly_again: bool
    ) -> None:
        self._first = first
        self._instance = instance
        self._plan = plan
        self._state = build_state_before_losses(instance, plan)
        self._effort = effort
        self._seed = seed
        self._fly_again = fly_again
        self._scans: dict[tuple[int, int], tuple[object, _StateScan]] = {}
        """The latest scan for each vehicle lost first, and each of its delays; -1 before its re-plan is on board."""

    def find_replan(self, first: LossRow) -> Plan | CriticalLoss:
        """Return a re-plan of a first loss after which every second one has a re-plan, or a second one without.

        The re-plan of ``first`` is tried, and others if it does not survive every second loss.
        """
        left = self._build_left(first, 0.0)
        broken = self._get_waiting_scan(first, left).find_broken(first.from_s)
        if broken is not None:
            return broken
        for plan in self._iterate_replans(first, left):
            after = self._find_broken_after(first, left, plan)
            if after is None:
                if plan is not first.plan:
                    self._first.keep(first.vehicle, left, plan)
                return plan
            broken = broken or after
        if broken is None:
            raise PlanError(f"the first loss, of vehicle {first.vehicle}, has no re-plan")
        return broken

    def is_impossible(self, first: CriticalLoss) -> bool:
        """Return whether it is certain that a first loss and some second one at the same time have no re-plan."""
        return self._get_waiting_scan(first, self._build_left(first, 0.0)).is_impossible(first.from_s)

    def _build_left(self, first: CriticalLoss, later_s: float) -> RemainingProblem:
        return build_remaining_problem(
            self._instance, self._plan, first.vehicle, first.from_s + later_s, fly_again=self._fly_again
        )

    def _get_waiting_scan(self, first: CriticalLoss, left: RemainingProblem) -> _StateScan:
        """Return the scan of the state between a first loss and its answer: routes as planned, its segments open."""

        def build_state() -> FleetAfterLosses:
            kept = [survivor.vehicle for survivor in left.survivors]
            flown = [visit for one in kept for visit in self._plan.routes[one].visits]
            accounted = {segment_of(visit) for visit in (*flown, *left.completed)}
            missing = [segment for segment in range(self._instance.segments) if segment not in accounted]
            return self._state.drop_vehicles(kept, missing)

        return self._get_scan((first.vehicle, -1), left.completed, build_state, first.to_s + self._instance.answer_s)

    def _get_scan(
        self, slot: tuple[int, int], key: object, build_state: Callable[[], FleetAfterLosses], until_s: float = math.inf
    ) -> _StateScan:
        """Return the scan of a state; the one of the following interval goes on if its state is the same."""
        known = self._scans.get(slot)
        if known is None or known[0] != key:
            scan = _StateScan(build_state(), until_s, effort=self._effort, seed=self._seed, fly_again=self._fly_again)
            known = self._scans[slot] = (key, scan)
        return known[1]

    def _iterate_replans(self, first: LossRow, left: RemainingProblem) -> Iterator[Plan]:
        """Yield the given re-plan of a first loss, then others."""
        if first.plan is not None:
            yield first.plan
        for cost in OTHER_COSTS:
            stop = Iterations(int(OTHER_SHARE * self._effort))
            result = replan(left.instance, warm=first.plan or left.warm, cost=cost, stop=stop, seed=self._seed)
            if result.feasible:
                yield result.plan

    def _find_broken_after(self, first: CriticalLoss, left: RemainingProblem, plan: Plan) -> CriticalLoss | None:
        """Return a loss without a re-plan of the state in which a re-plan is flown."""
        for number, later_s in enumerate(self._list_delays(first, left, plan)):
            delayed = self._build_left(first, later_s)
            routes, again = merge_routes(delayed, plan)
            key = (routes, [(vehicle, survivor.free_s) for vehicle, survivor in again.items()])
            scan = self._get_scan((first.vehicle, number), key, partial(self._state.apply_plan, delayed, plan))
            broken = scan.find_broken(delayed.at_s + self._instance.answer_s)
            if broken is not None:
                return broken
        return None

    def _list_delays(self, first: CriticalLoss, left: RemainingProblem, plan: Plan) -> list[float]:
        """Return times of a first loss, after the start of its interval, that stand for all others in it.

        Only vehicles that take off from the ground for the re-plan depend on that time: all their times move with it.
        What a second loss leaves depends on the order of their times and those of the others. So one time is enough
        between two at which that order changes.
        """
        ready_s = first.from_s + self._instance.answer_s
        moving = {one for one, survivor in merge_routes(left, plan)[1].items() if survivor.free_s <= ready_s}
        if not moving:
            return [0.0]
        state = self._state.apply_plan(left, plan)
        times_s: dict[bool, set[float]] = {True: {ready_s}, False: set()}
        for place, vehicle in enumerate(state.fleet):
            end_s = float(state.progress_of(place).time_s[-1])
            own_s = {*state.visit_ends_s(place).tolist(), end_s}
            times_s[vehicle in moving] |= own_s | {time_s - self._instance.answer_s for time_s in own_s}
        length_s = first.to_s - first.from_s
        changes_s = {still_s - moved_s for still_s in times_s[False] for moved_s in times_s[True]}
        bounds_s = [0.0, *sorted(change_s for change_s in changes_s if 0 < change_s < length_s), length_s]
        return [(low_s + high_s) / 2 for low_s, high_s in pairwise(bounds_s) if high_s > low_s + SAME_TIME_S]


class _StateScan:
    """The losses of one state, checked from its end backwards as far as needed."""

    def __init__(self, state: FleetAfterLosses, until_s: float, *, effort: int, seed: int, fly_again: bool) -> None:
        self._state = state
        self._events_s = event_times_s(state.instance, state.plan)
        self._scan: LossScan | None = None
        self._rows: Iterator[LossRow] = iter(())
        self._row: LossRow | None = None
        # With nothing left to do every loss is harmless.
        if state.instance.segments > 0:
            self._scan = LossScan(state.instance, state.plan, self._events_s, seed=seed, fly_again=fly_again)
            self._rows = self._scan.iterate_rows(effort, until_s)

    def find_broken(self, from_s: float) -> CriticalLoss | None:
        """Return the last loss without a re-plan that ends after a given time; None if there is none."""
        row = self._row or next(self._rows, None)
        while row is not None and row.to_s > from_s + SAME_TIME_S and row.verdict is RepairStatus.FEASIBLE:
            row = next(self._rows, None)
        self._row = row
        if row is None or row.to_s <= from_s + SAME_TIME_S:
            return None
        return CriticalLoss(self._state.fleet[row.vehicle], max(from_s, row.from_s), row.to_s)

    def is_impossible(self, at_s: float) -> bool:
        """Return whether it is certain that a loss at a given time has no re-plan."""
        interval = sum(event_s <= at_s + SAME_TIME_S for event_s in self._events_s) - 1
        if self._scan is None or interval + 1 >= len(self._events_s):
            return False
        return self._scan.has_impossible_loss(interval)
