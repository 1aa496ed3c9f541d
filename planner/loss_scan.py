"""Scan all losses of one plan from the end: the seam between the window and its kernels."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Iterator, Mapping, Sequence

import numpy as np

from planner.bounds import ASCENT, explain_infeasibility
from planner.evaluate import (
    BUDGET_TOLERANCE_PCT,
    LossRow,
    RepairStatus,
    completion_times_s,
    route_duration_s,
    route_energy_pct,
)
from planner.exact import find_covering_plan
from planner.kernels.arrays import FloatArray, IntArray, Problem, State, allocate
from planner.kernels.repair import (
    SAME_TIME_S,
    Loss,
    LossClock,
    LossTiming,
    Repairs,
    RepairWorkspace,
    set_clock,
    try_loss,
)
from planner.model import BARRED_PCT, Instance, Plan, Route, renumber_visits, segment_of
from planner.plan_search import build_kernel_problem, build_random_state, build_state
from planner.replan import RemainingProblem, build_remaining_problem

EXACT_UP_TO = 13
"""Maximum number of open segments for an exact decision on a loss: some 20 ms."""
PROOF_STEPS = 300
"""Maximum number of pricings for the proof of a loss: some seconds for 40 open segments."""
QUICK = 20
"""Divisor of the effort for the first attempt at a loss; its certificates are checked before the rest is spent."""


class LossScan:
    """The losses of a plan; each re-plan begins with the one of the following interval."""

    def __init__(
        self, instance: Instance, plan: Plan, events_s: Sequence[float], *, seed: int, fly_again: bool,
        prove: bool = False,
    ) -> None:  # fmt: skip
        self._instance = instance
        self._plan = plan
        self._events_s = events_s
        self._fly_again = fly_again
        self._prove = prove
        self._rng = build_random_state(seed)
        self._problem = build_kernel_problem(instance)
        self._timing = timing_of(instance)
        self._base = build_state(self._problem, [route.visits for route in plan.routes])
        self._clock = clock_of(self._problem, self._timing, self._base)
        self._loss = loss_of(self._problem, instance.locked, list_losses(len(plan.routes)))
        self._repairs = build_empty_repairs(self._problem, len(plan.routes))
        self._desk = allocate(RepairWorkspace, k=len(plan.routes), n=instance.segments)
        self._ends_s = [completion_times_s(instance, route) for route in plan.routes]
        self._durations_s = [route_duration_s(instance, route) for route in plan.routes]
        self._energies_pct = [route_energy_pct(instance, route) for route in plan.routes]

    def iterate_rows(self, effort: int, until_s: float = math.inf) -> Iterator[LossRow]:
        """Yield all losses in intervals that begin before ``until_s``, each computed on demand."""
        for interval in range(len(self._events_s) - 2, -1, -1):
            if self._events_s[interval] >= until_s - SAME_TIME_S:
                continue
            for vehicle in self.find_flying_vehicles(interval):
                yield self._build_row(interval, vehicle, effort)

    def find_flying_vehicles(self, interval: int) -> list[int]:
        """Return the vehicles that are in the air in an interval, or about to start."""
        from_s = self._events_s[interval]
        return [vehicle for vehicle, end_s in enumerate(self._durations_s) if end_s > from_s + SAME_TIME_S]

    def last_impossible_s(self, broken: LossRow) -> float:
        """Return the end of the last interval, at or before a broken one, with a loss that is proven irreparable.

        Returns 0 if none is known.
        """
        for interval in range(len(self._events_s) - 2, -1, -1):
            if self._events_s[interval] <= broken.from_s and self.has_impossible_loss(interval):
                return self._events_s[interval + 1]
        return 0.0

    def has_impossible_loss(self, interval: int) -> bool:
        """Return whether some loss in an interval is proven irreparable."""
        return any(self._decide_loss(interval, vehicle) is True for vehicle in self.find_flying_vehicles(interval))

    def _build_row(self, interval: int, vehicle: int, effort: int) -> LossRow:
        from_s, to_s = self._events_s[interval : interval + 2]
        routes = self._try_repair(interval, vehicle, effort // QUICK)
        if routes is None:
            settled = self._decide_loss(interval, vehicle)
            if isinstance(settled, Plan):
                return LossRow(vehicle, from_s, to_s, RepairStatus.FEASIBLE, settled)
            if settled:
                return LossRow(vehicle, from_s, to_s, RepairStatus.IMPOSSIBLE, None)
            routes = self._try_repair(interval, vehicle, effort)
        if routes is None:
            return LossRow(vehicle, from_s, to_s, RepairStatus.NOT_FOUND, None)
        return LossRow(vehicle, from_s, to_s, RepairStatus.FEASIBLE, _build_reduced_plan(routes, vehicle))

    def _decide_loss(self, interval: int, vehicle: int) -> Plan | bool:
        """Return a re-plan, or whether it is certain that there is none."""
        at_s = self._events_s[interval]
        left = build_remaining_problem(self._instance, self._plan, vehicle, at_s, fly_again=self._fly_again)
        if explain_infeasibility(left.instance, ascent=ASCENT) is not None:
            return True
        if len(left.open_segments) <= EXACT_UP_TO:
            plan = find_covering_plan(left.instance)
        elif self._prove:
            # Imported here: only a proof needs the extra.
            from planner.proofs import decide_cover

            verdict = decide_cover(left.instance, known=[left.warm], go_on=count_steps(PROOF_STEPS))
            plan = verdict if isinstance(verdict, Plan) else None
            if verdict is True:
                return False
        else:
            return False
        if plan is None:
            return True
        self.keep(vehicle, left, plan)
        return plan

    def keep(self, vehicle: int, left: RemainingProblem, plan: Plan) -> None:
        """Store a re-plan as the known one of a loss, as a start for the previous interval."""
        repairs = self._repairs
        repairs.known[vehicle] = 1
        repairs.lengths[vehicle] = 0
        repairs.route_of[vehicle] = -1
        for survivor, route in zip(left.survivors, plan.routes, strict=True):
            visits = [left.original_visit(visit) for visit in route.visits]
            repairs.visits[vehicle, survivor.vehicle, : len(visits)] = visits
            repairs.lengths[vehicle, survivor.vehicle] = len(visits)
            repairs.route_of[vehicle, [segment_of(visit) for visit in visits]] = survivor.vehicle

    def _try_repair(self, interval: int, vehicle: int, effort: int) -> list[list[int]] | None:
        """Return the new routes of all vehicles, in the plan's numbering; None if no re-plan was found."""
        lacks = try_loss(
            self._problem, self._timing, self._base, self._clock, vehicle, self._events_s[interval], self._fly_again,
            self._loss, self._repairs, self._desk, effort, self._rng,
        )  # fmt: skip
        if lacks > 0:
            return None
        routes = [
            [int(visit) for visit in self._repairs.visits[vehicle, route, :length]]
            for route, length in enumerate(self._repairs.lengths[vehicle])
        ]
        return routes if self._is_valid_repair(self._events_s[interval], vehicle, routes) else None

    def _is_valid_repair(self, at_s: float, lost: int, routes: list[list[int]]) -> bool:
        """Return whether new routes visit all open segments once and exceed no budget, by the reference definition."""
        accounted = [segment_of(visit) for visits in routes for visit in visits]
        for route in self._plan.routes:
            until_s = at_s if route.vehicle == lost else at_s + self._instance.answer_s
            done = sum(1 for end_s in self._ends_s[route.vehicle] if end_s <= until_s + SAME_TIME_S)
            kept = route.visits[: done if route.vehicle == lost else done + 1]
            accounted.extend(segment_of(visit) for visit in kept)
            if route.vehicle != lost and routes[route.vehicle]:
                used = self._survivor_energy_pct(lost, route, kept, done, routes[route.vehicle])
                if used > self._instance.vehicles[route.vehicle].budget_pct + BUDGET_TOLERANCE_PCT:
                    return False
        return not routes[lost] and sorted(accounted) == list(range(self._instance.segments))

    def _survivor_energy_pct(
        self, lost: int, route: Route, kept: tuple[int, ...], done: int, visits: list[int]
    ) -> float:
        """Return a survivor's total energy: on one route if it has visits left, else on two."""
        vehicle, instance = route.vehicle, self._instance
        lifted = sum(instance.locked.get(segment_of(visit)) == lost for visit in visits)
        visits_pct = -BARRED_PCT * lifted * instance.vehicles[vehicle].consumption
        if done < len(route.visits) or not (route.visits or instance.vehicles[vehicle].airborne):
            return visits_pct + route_energy_pct(instance, Route(vehicle, (*kept, *visits)))
        if not self._fly_again:
            return math.inf
        first = instance.vehicles[vehicle].consumption * float(instance.depot_pct[vehicle, visits[0]])
        own_first = float(instance.start_pct[vehicle, visits[0]])
        flown = first - own_first + route_energy_pct(instance, Route(vehicle, tuple(visits)))
        return self._energies_pct[vehicle] + visits_pct + flown


def count_steps(limit: int) -> Callable[[float], bool]:
    """Return a report for a proof that ends it after a number of steps."""
    steps = iter(range(limit))
    return lambda _: next(steps, None) is not None


def timing_of(instance: Instance) -> LossTiming:
    """Return the times and the moves from the landing place as kernel arrays."""
    consumption = np.array([vehicle.consumption for vehicle in instance.vehicles])[:, np.newaxis]
    return LossTiming(
        move_s=np.ascontiguousarray(instance.moves.tabulate().table_s),
        start_s=_to_contiguous(instance.start_s),
        home_s=_to_contiguous(instance.home_s),
        idle_s=np.array(instance.idle_s, dtype=np.float64),
        depot=_to_contiguous(consumption * instance.depot_pct),
        airborne=np.array([vehicle.airborne for vehicle in instance.vehicles], dtype=np.int64),
        answer_s=instance.answer_s,
    )


def clock_of(problem: Problem, timing: LossTiming, base: State) -> LossClock:
    """Return the end times of a measured state's visits."""
    clock = allocate(LossClock, k=len(base.lengths), n=len(base.route_of))
    for route in range(len(base.lengths)):
        set_clock(problem, timing, base, clock, route)
    return clock


def list_losses(fleet: int, most: int = 1) -> IntArray:
    """Return (losses, k) int64: every set of 1 to ``most`` vehicles as a row, with 1 for its members."""
    sets = (lost for count in range(1, most + 1) for lost in itertools.combinations(range(fleet), count))
    return np.array([[int(vehicle in lost) for vehicle in range(fleet)] for lost in sets], dtype=np.int64)


def loss_of(problem: Problem, locked: Mapping[int, int], who: IntArray) -> Loss:
    """Return arrays for the problem after a loss.

    Args:
        problem: the instance.
        locked: that of the instance.
        who: the losses, as ``list_losses`` gives them.
    """
    keeper = np.full(len(problem.value) if locked else 0, -1, dtype=np.int64)
    keeper[list(locked)] = list(locked.values())
    own = problem._replace(
        start=problem.start.copy(),
        idle=problem.idle.copy(),
        budget=problem.budget.copy(),
        move=problem.move.copy() if locked else problem.move,
        move_into=problem.move_into.copy() if locked else problem.move_into,
        twin=np.full(len(problem.budget), -1, dtype=np.int64),  # equal on the ground, not after the loss
    )
    is_open, done = (np.zeros(len(figures), dtype=np.int64) for figures in (problem.value, problem.budget))
    return Loss(own, is_open, done, keeper, who, np.zeros(len(problem.budget), dtype=np.int64), BARRED_PCT)


def build_empty_repairs(problem: Problem, losses: int) -> Repairs:
    """Return arrays for the repairs of a number of losses, none of them known."""
    repairs = allocate(Repairs, losses=losses, k=len(problem.budget), n=len(problem.value))
    repairs.route_of[:] = -1
    return repairs


def _to_contiguous(rows: FloatArray) -> FloatArray:
    return np.array(rows, dtype=np.float64, order="C")


def _build_reduced_plan(routes: list[list[int]], lost: int) -> Plan:
    """Return new routes as a plan in the numbering of the reduced instance."""
    number = {opened: place for place, opened in enumerate(sorted(segment_of(v) for visits in routes for v in visits))}
    survivors = [visits for vehicle, visits in enumerate(routes) if vehicle != lost]
    return Plan(tuple(Route(place, renumber_visits(visits, number)) for place, visits in enumerate(survivors)))
