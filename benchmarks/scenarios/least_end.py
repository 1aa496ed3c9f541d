"""A proven lower bound of the last end of a small day.

A column is a trip: a set of tasks (or none), its begin, its landing, and the shortest time for them. The best plan
chooses columns for each vehicle so that all tasks are shared out and the trips can be flown in sequence: as many of a
vehicle's trips leave a depot as land there, but for its first and its last one. HiGHS chooses; a choice in which a
vehicle's trips form separate rings is forbidden, and HiGHS chooses again.

No detour is shorter than the direct path, so a task may be done twice: only trips to which no further task can be added
for free are columns: 14 to 71 % of all in the gdb scenarios that were counted.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field

import numpy as np

from benchmarks import highs
from benchmarks.row_matrix import build_row_matrix
from benchmarks.scenarios.day import TOLERANCE_S
from planner import InstanceError, Stopwatch
from planner.sorties import SortieInstance

MOST_COLUMNS = 200_000
"""Maximum number of columns of all vehicles."""


@dataclass(frozen=True, slots=True)
class _Column:
    vehicle: int
    begin: int
    """A depot's number; -1 for the vehicle's start."""
    end: int
    tasks: int
    """Set of tasks as bits."""
    seconds: float


@dataclass(slots=True)
class _Program:
    """Rows for HiGHS: columns, weights and limits of each."""

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


def least_last_end_s(instance: SortieInstance, until_s: Sequence[float] = (), limit_s: float = np.inf) -> float:
    """Return a lower bound of any plan's last end; infinite if no plan does every task.

    Without ``limit_s`` there is a plan that ends then.

    Args:
        instance: of ``build_day_instance``.
        until_s: for each vehicle, time by which it must have turned round after its last trip; empty for none.
        limit_s: seconds of search; then the bound proven so far is returned.

    Raises:
        InstanceError: more than MOST_COLUMNS possible trips.
    """
    program = _program(instance, _columns(instance), until_s, limit_s)
    bound = 0.0
    while True:
        values, least = _run(instance, program)
        bound = max(bound, least)
        rings = list(_rings(program.columns, values))
        if not rings:
            return bound
        for vehicle, depots, used in rings:
            into = {
                number: 1.0
                for number, one in enumerate(program.columns)
                if one.vehicle == vehicle and one.end in depots and one.begin not in depots
            }
            for number in used:
                program.add({**into, number: -1.0 / len(program.columns)}, 0.0, np.inf)


_Trips = dict[tuple[int, int], float]
"""Seconds of the shortest trip by its set of tasks, as bits, and its landing base, or its last visit."""


def _columns(instance: SortieInstance) -> list[_Column]:
    columns: list[_Column] = []
    depots = _depots(instance)
    trips_from = {base: _trips(instance, base) for base in {*depots, *(own.base for own in instance.vehicles)}}
    for vehicle, own in enumerate(instance.vehicles):
        for begin, base in [(-1, own.base), *((depot, depot) for depot in depots)]:
            columns += [
                _Column(vehicle, begin, end, tasks, seconds) for (tasks, end), seconds in trips_from[base].items()
            ]
        if len(columns) > MOST_COLUMNS:
            raise InstanceError(f"the tasks make more than {MOST_COLUMNS} trips, expected fewer")
    return columns


def _depots(instance: SortieInstance) -> list[int]:
    return [base for base in range(len(instance.bases)) if np.isfinite(instance.home_s[0, :, base]).any()]


def _trips(instance: SortieInstance, base: int) -> _Trips:
    """Return the shortest trips from a base to which no task can be added for free; moves have no task."""
    depots, visits = _depots(instance), range(2 * instance.segments)
    most_s = instance.vehicles[0].budget_pct + TOLERANCE_S
    move_s = instance.moves.seconds(0, np.arange(len(visits))[:, np.newaxis], np.arange(len(visits)))
    home_s = instance.home_s[0]
    found: _Trips = {}
    under_way: _Trips = {(1 << (visit >> 1), visit): float(instance.out_s[0, base, visit]) for visit in visits}
    while under_way:
        longer: _Trips = {}
        for (tasks, last), seconds in under_way.items():
            if seconds + home_s[last].min() > most_s:
                continue
            for depot in depots:
                whole_s = seconds + float(home_s[last, depot])
                if whole_s <= min(most_s, found.get((tasks, depot), np.inf)):
                    found[tasks, depot] = whole_s
            for visit in visits:
                key = (tasks | 1 << (visit >> 1), visit)
                if not tasks >> (visit >> 1) & 1:
                    longer[key] = min(longer.get(key, np.inf), seconds + float(move_s[last, visit]))
        if len(found) > MOST_COLUMNS:
            raise InstanceError(f"the tasks make more than {MOST_COLUMNS} trips, expected fewer")
        under_way = longer
    every = [1 << task for task in range(instance.segments)]
    trips = {
        (tasks, depot): seconds for (tasks, depot), seconds in found.items()
        if not any(not tasks & one and found.get((tasks | one, depot), np.inf) <= seconds for one in every)
    }  # fmt: skip
    # A move may be flown more than once, a trip for tasks is not: moves stay.
    moves = ((depot, float(instance.transfer_s[base, depot])) for depot in depots if depot != base)
    turnaround_s = instance.bases[0].turnaround_s
    return trips | {(0, depot): seconds - turnaround_s for depot, seconds in moves if seconds < np.inf}


def _program(instance: SortieInstance, columns: list[_Column], until_s: Sequence[float], limit_s: float) -> _Program:
    """Return the rows: tasks, depots, ends.

    After the columns come whether each vehicle flies, each vehicle's end, the last end, and each vehicle's last
    landing.
    """
    fleet, depots = len(instance.vehicles), _depots(instance)
    flies, ends = len(columns), len(columns) + fleet
    last = ends + fleet
    lands = last + 1
    turnaround_s = instance.bases[0].turnaround_s
    program = _Program(columns, limit_s=limit_s)
    for task in range(instance.segments):
        doing = [number for number, one in enumerate(columns) if one.tasks >> task & 1]
        program.add(dict.fromkeys(doing, 1.0), 1.0, np.inf)
    for vehicle, own in enumerate(instance.vehicles):
        mine = [number for number, one in enumerate(columns) if one.vehicle == vehicle]
        first = {number: 1.0 for number in mine if columns[number].begin < 0}
        program.add({**first, flies + vehicle: -1.0}, 0.0, 0.0)
        for place, depot in enumerate(depots):
            row = {number: float((columns[number].begin == depot) - (columns[number].end == depot)) for number in mine}
            program.add({**row, lands + vehicle * len(depots) + place: 1.0}, 0.0, 0.0)
        # All work takes its time and a pause, except after the last trip.
        row = {number: columns[number].seconds + turnaround_s for number in mine}
        if until_s:
            program.add(row, -np.inf, max(0.0, until_s[vehicle] - own.ready_s))
        program.add({**row, flies + vehicle: own.ready_s - turnaround_s, ends + vehicle: -1.0}, 0.0, 0.0)
        program.add({ends + vehicle: 1.0, last: -1.0}, -np.inf, 0.0)
    return program


def _rings(columns: Sequence[_Column], found: Sequence[float]) -> Iterable[tuple[int, set[int], list[int]]]:
    """Yield vehicles with depots and trips that are unreachable from their first trip."""
    taken = [number for number in range(len(columns)) if found and found[number] > 0.5]
    for vehicle in {columns[number].vehicle for number in taken}:
        mine = [number for number in taken if columns[number].vehicle == vehicle]
        seen = {-1}
        while more := {columns[number].end for number in mine if columns[number].begin in seen} - seen:
            seen |= more
        apart = [number for number in mine if columns[number].begin not in seen]
        if apart:
            yield vehicle, {columns[number].begin for number in apart}, apart


def _run(instance: SortieInstance, program: _Program) -> tuple[list[float], float]:
    """Return the choice of HiGHS, empty without one, and the lower bound of all choices."""
    import highspy

    fleet, depots, columns = len(instance.vehicles), len(_depots(instance)), len(program.columns)
    # A trip without a task may be flown as often as there are tasks.
    most = [1.0 if one.tasks else float(instance.segments) for one in program.columns]
    most += [1.0] * fleet + [np.inf] * (fleet + 1) + [1.0] * (fleet * depots)
    last = columns + 2 * fleet
    solver = highs.build_program(
        [float(number == last) for number in range(len(most))],
        most,
        (program.lower, program.upper),
        build_row_matrix(program.rows, len(most)),
        whole=[True] * (columns + fleet) + [False] * (fleet + 1) + [True] * (fleet * depots),
    )
    solver.setOptionValue("time_limit", max(0.0, program.limit_s - program.stopwatch.seconds))
    solver.run()
    status = solver.getModelStatus()
    if status == highspy.HighsModelStatus.kOptimal:
        return list(solver.getSolution().col_value), solver.getInfo().objective_function_value
    return [], solver.getInfo().mip_dual_bound if status == highspy.HighsModelStatus.kTimeLimit else np.inf
