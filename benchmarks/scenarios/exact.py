"""Small days exactly: the plan whose last trip ends earliest, then with the least sum of ends, with its proof.

A column is a trip: a set of tasks (or none), where it begins, where it lands, and the shortest time for that. The best
plan is a choice of columns for each vehicle that share the tasks among them and can be flown one after the other: as
many of a vehicle's trips leave a depot as land there, but for its first and its last one. HiGHS chooses; where a
vehicle's trips fall apart into rings that its others never touch, that is forbidden and HiGHS chooses again.

Where no detour is shorter than the way itself, a task may as well be done twice: then only trips are columns to which
no further task can be added for nothing: 14 to 71 % of all in the gdb scenarios that were counted.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from benchmarks.scenarios.evaluate import TOLERANCE_S
from benchmarks.scenarios.model import DayInstance, DayPlan, Trip, way_of
from planner import highs
from planner.errors import InstanceError
from planner.stop_rules import Stopwatch

if TYPE_CHECKING:
    import highspy

MOST_COLUMNS = 200_000
"""Columns of all vehicles up to which an instance is taken."""


@dataclass(frozen=True, slots=True)
class _Column:
    vehicle: int
    begin: int
    """A depot's number; -1 for the vehicle's start."""
    end: int
    visits: tuple[int, ...]
    seconds: float


@dataclass(slots=True)
class _Program:
    """Rows of HiGHS as they are gathered: columns and weights of each, and its limits."""

    columns: list[_Column]
    stopwatch: Stopwatch = field(default_factory=Stopwatch)
    limit_s: float = np.inf
    lower: list[float] = field(default_factory=list)
    upper: list[float] = field(default_factory=list)
    rows: list[dict[int, float]] = field(default_factory=list)

    def add(self, weights: dict[int, float], lower: float, upper: float) -> None:
        self.rows.append(weights)
        self.lower.append(lower)
        self.upper.append(upper)


@dataclass(frozen=True, slots=True)
class _Choice:
    """What HiGHS found, and what nothing can fall below."""

    values: list[float] | None
    bound: float
    """Infinite where there is no choice."""


def solve_day_exact(instance: DayInstance) -> DayPlan | None:
    """Return the best plan that does every task, or None where there is none: both are certain.

    Raises:
        InstanceError: more than MOST_COLUMNS ways to make a trip.
    """
    columns = _columns(instance)
    program = _program(instance, columns)
    fleet = len(instance.vehicles)
    last, total = len(columns) + 3 * fleet, range(len(columns) + 2 * fleet, len(columns) + 3 * fleet)
    best = _solve_connected(instance, program, {last: 1.0}).values
    if best is None:
        return None
    program.add({last: 1.0}, -np.inf, best[last] + TOLERANCE_S)
    best = _solve_connected(instance, program, dict.fromkeys(total, 1.0)).values or best
    return _plan(instance, columns, best)


def least_last_end_s(instance: DayInstance, until_s: Sequence[float] = (), limit_s: float = np.inf) -> float:
    """Return what no plan's last end can fall below; infinite where no plan does every task.

    Without ``limit_s`` there is a plan that ends then.

    Args:
        instance: the problem.
        until_s: for each vehicle, until when it must have turned round after its last trip; empty for no such time.
        limit_s: seconds of search; then what is proven so far is returned.

    Raises:
        InstanceError: more than MOST_COLUMNS ways to make a trip.
    """
    columns = _columns(instance)
    program = _program(instance, columns, until_s, limit_s)
    return _solve_connected(instance, program, {len(columns) + 3 * len(instance.vehicles): 1.0}).bound


def _columns(instance: DayInstance) -> list[_Column]:
    depots = sorted(set(instance.depots))
    columns: list[_Column] = []
    kept: Callable[[_Trips], _Trips] = _widest if _metric(instance) else dict
    trips_from = {place: kept(_trips(instance, place, depots)) for place in depots}
    for vehicle, own in enumerate(instance.vehicles):
        if own.place not in trips_from:
            trips_from[own.place] = kept(_trips(instance, own.place, depots))
        from_depots = enumerate(trips_from[place] for place in depots)
        for begin, trips in [(-1, trips_from[own.place]), *from_depots]:
            columns += [
                _Column(vehicle, begin, end, visits, seconds)
                for (_, end), (seconds, visits) in trips.items()
                if visits or begin != end
            ]
        if len(columns) > MOST_COLUMNS:
            raise InstanceError(f"the tasks make more than {MOST_COLUMNS} trips, expected fewer")
    return columns


_Trips = dict[tuple[int, int], tuple[float, tuple[int, ...]]]


def _metric(instance: DayInstance) -> bool:
    """Return whether leaving a task out never makes a trip longer."""
    times = instance.times_s
    through = min((times[:, [middle]] + times[middle] - times).min() for middle in range(len(times)))
    direct = all(task.seconds >= max(times[task.a, task.b], times[task.b, task.a]) for task in instance.tasks)
    return bool(through >= -TOLERANCE_S) and direct


def _widest(trips: _Trips) -> _Trips:
    """Return the trips to which no task can be added for nothing."""
    every = [1 << task for task in range(max((done for done, _ in trips), default=0).bit_length())]

    def more(done: int, end: int, seconds: float) -> bool:
        return any(not done & task and trips.get((done | task, end), (np.inf,))[0] <= seconds for task in every)

    # A move may be flown more than once, a trip for tasks is not: moves stay.
    return {(done, end): trip for (done, end), trip in trips.items() if not done or not more(done, end, trip[0])}


def _trips(instance: DayInstance, place: int, depots: Sequence[int]) -> _Trips:
    """Return the shortest trip from a place for each set of tasks (as bits) and each depot's number."""
    times, most = instance.times_s, instance.capacity_s + TOLERANCE_S
    found: _Trips = {
        (0, number): (float(times[place, depot]), ())
        for number, depot in enumerate(depots)
        if times[place, depot] <= most
    }
    under_way: dict[tuple[int, int], tuple[float, tuple[int, ...]]] = {(0, -1): (0.0, ())}
    while under_way:
        longer: dict[tuple[int, int], tuple[float, tuple[int, ...]]] = {}
        for (done, _), (seconds, visits) in under_way.items():
            here = way_of(instance, visits[-1])[1] if visits else place
            for visit in range(2 * len(instance.tasks)):
                if done >> (visit >> 1) & 1:
                    continue
                begin, end = way_of(instance, visit)
                then = seconds + float(times[here, begin]) + instance.tasks[visit >> 1].seconds
                key = (done | 1 << (visit >> 1), visit)
                if then + min(times[end, depot] for depot in depots) <= most and (
                    key not in longer or then < longer[key][0]
                ):
                    longer[key] = (then, (*visits, visit))
        for (done, visit), (seconds, visits) in longer.items():
            for number, depot in enumerate(depots):
                whole = seconds + float(times[way_of(instance, visit)[1], depot])
                if whole <= most and ((done, number) not in found or whole < found[done, number][0]):
                    found[done, number] = (whole, visits)
        if len(found) > MOST_COLUMNS:
            raise InstanceError(f"the tasks make more than {MOST_COLUMNS} trips, expected fewer")
        under_way = longer
    return found


def _program(
    instance: DayInstance, columns: list[_Column], until_s: Sequence[float] = (), limit_s: float = np.inf
) -> _Program:
    """Return the rows: tasks, depots, ends.

    After the columns come whether each vehicle flies, as many unused, each vehicle's end, the last end, and where each
    vehicle lands last.
    """
    fleet, depots = len(instance.vehicles), len(set(instance.depots))
    flies, ends = len(columns), len(columns) + 2 * fleet
    last = len(columns) + 3 * fleet
    lands = last + 1
    program = _Program(columns, limit_s=limit_s)
    most = np.inf if _metric(instance) else 1.0
    for task in range(len(instance.tasks)):
        doing = [number for number, one in enumerate(columns) if any(visit >> 1 == task for visit in one.visits)]
        program.add(dict.fromkeys(doing, 1.0), 1.0, most)
    for vehicle, own in enumerate(instance.vehicles):
        mine = [number for number, one in enumerate(columns) if one.vehicle == vehicle]
        first = {number: 1.0 for number in mine if columns[number].begin < 0}
        program.add({**first, flies + vehicle: -1.0}, 0.0, 0.0)
        for depot in range(depots):
            row = {number: float((columns[number].begin == depot) - (columns[number].end == depot)) for number in mine}
            program.add({**row, lands + vehicle * depots + depot: 1.0}, 0.0, 0.0)
        # Whatever it does takes its time and a pause, but for the pause after the last trip.
        row = {number: columns[number].seconds + instance.turnaround_s for number in mine}
        if until_s:
            program.add(row, -np.inf, max(0.0, until_s[vehicle] - own.ready_s))
        program.add(
            {**row, flies + vehicle: own.ready_s - own.ended_s - instance.turnaround_s, ends + vehicle: -1.0},
            -own.ended_s, -own.ended_s,
        )  # fmt: skip
        program.add({ends + vehicle: 1.0, last: -1.0}, -np.inf, 0.0)
    return program


def _solve_connected(instance: DayInstance, program: _Program, cost: dict[int, float]) -> _Choice:
    """Return the best choice whose trips hang together for each vehicle."""
    bound = 0.0
    while True:
        found = _run(instance, program, cost)
        bound = max(bound, found.bound)
        rings = list(_rings(program.columns, found.values or ()))
        if not rings:
            return _Choice(found.values, bound)
        for vehicle, depots, used in rings:
            into = {
                number: 1.0
                for number, one in enumerate(program.columns)
                if one.vehicle == vehicle and one.end in depots and one.begin not in depots
            }
            for number in used:
                program.add({**into, number: -1.0 / len(program.columns)}, 0.0, np.inf)


def _rings(columns: Sequence[_Column], found: Sequence[float]) -> Iterable[tuple[int, set[int], list[int]]]:
    """Yield vehicles with depots and trips that their first trip never leads to."""
    taken = [number for number in range(len(columns)) if found and found[number] > 0.5]
    for vehicle in {columns[number].vehicle for number in taken}:
        mine = [number for number in taken if columns[number].vehicle == vehicle]
        seen = {-1}
        while more := {columns[number].end for number in mine if columns[number].begin in seen} - seen:
            seen |= more
        apart = [number for number in mine if columns[number].begin not in seen]
        if apart:
            yield vehicle, {columns[number].begin for number in apart}, apart


def _run(instance: DayInstance, program: _Program, cost: dict[int, float]) -> _Choice:
    """Return what HiGHS chooses."""
    fleet, depots, columns = len(instance.vehicles), len(set(instance.depots)), len(program.columns)
    # A way without a task may be flown as often as there are tasks.
    most = [1.0 if one.visits else float(len(instance.tasks)) for one in program.columns]
    most += [1.0] * (2 * fleet) + [np.inf] * (fleet + 1) + [1.0] * (fleet * depots)
    solver = highs.build_program(
        [cost.get(number, 0.0) for number in range(len(most))],
        most,
        (program.lower, program.upper),
        highs.build_row_matrix(program.rows),
        whole=[True] * (columns + 2 * fleet) + [False] * (fleet + 1) + [True] * (fleet * depots),
    )
    solver.setOptionValue("time_limit", max(0.0, program.limit_s - program.stopwatch.seconds))
    solver.run()
    return _solution(solver)


def _solution(solver: highspy.Highs) -> _Choice:
    import highspy

    status = solver.getModelStatus()
    if status == highspy.HighsModelStatus.kOptimal:
        return _Choice(list(solver.getSolution().col_value), solver.getInfo().objective_function_value)
    if status == highspy.HighsModelStatus.kTimeLimit:
        return _Choice(None, solver.getInfo().mip_dual_bound)
    return _Choice(None, np.inf)


def _plan(instance: DayInstance, columns: Sequence[_Column], found: Sequence[float]) -> DayPlan:
    depots = sorted(set(instance.depots))
    everybody: list[tuple[Trip, ...]] = []
    done: set[int] = set()
    for vehicle, own in enumerate(instance.vehicles):
        waiting = [
            one for number, one in enumerate(columns) for _ in range(round(found[number])) if one.vehicle == vehicle
        ]
        order = _chain_trips(waiting)
        trips: list[Trip] = []
        place = own.place
        for one in order:
            visits = tuple(visit for visit in one.visits if visit >> 1 not in done)
            done |= {visit >> 1 for visit in visits}
            if visits or place != depots[one.end]:
                trips.append(Trip(place, visits, depots[one.end]))
            place = depots[one.end]
        everybody.append(tuple(trips))
    return DayPlan(tuple(everybody))


def _chain_trips(waiting: list[_Column]) -> list[_Column]:
    """Return a vehicle's trips so that each begins where the one before landed (Hierholzer 1873)."""
    stack: list[tuple[int, _Column | None]] = [(-1, None)]
    order: list[_Column] = []
    while stack:
        place, arrived = stack[-1]
        onward = next((one for one in waiting if one.begin == place), None)
        if onward is None:
            stack.pop()
            if arrived is not None:
                order.append(arrived)
        else:
            waiting.remove(onward)
            stack.append((onward.end, onward))
    return order[::-1]
