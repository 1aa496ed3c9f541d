"""From a day's instance to the kernels' arrays, and from their state to a plan."""

from __future__ import annotations

import numpy as np

from benchmarks.scenarios.kernels.day import NEVER, TOLERANCE_S, DayMemory, DayProblem, DayState
from benchmarks.scenarios.model import DayInstance, DayPlan, Trip
from planner.kernels.arrays import FloatArray, IntArray

GATES = 6
"""Depots that are looked at between two visits."""
NEAR = 60
"""Neighbours of a task that are kept."""


def day_problem(instance: DayInstance, share: float, haste: float) -> DayProblem:
    """Return the kernels' view; ``share`` is what the sum of all ends weighs against the last one in the search."""
    times = np.where(np.isfinite(instance.times_s), np.minimum(instance.times_s, NEVER), NEVER)
    ends = np.array([(task.a, task.b) for task in instance.tasks], dtype=np.int64).reshape(-1, 2)
    first, last = ends.reshape(-1), ends[:, ::-1].reshape(-1)
    own_s = np.repeat([task.seconds for task in instance.tasks], 2)
    depots = np.array(sorted(set(instance.depots)), dtype=np.int64)
    starts = np.array([own.place for own in instance.vehicles], dtype=np.int64)
    places = np.concatenate((depots, starts))
    out, home = times[np.ix_(places, first)] + own_s, times[np.ix_(last, depots)]
    into = times[np.ix_(last, first)] + own_s
    nearest = home.argmin(axis=1)
    hop = _hops(times[np.ix_(places, depots)], places, depots, instance)
    round_trip = out + home[np.arange(len(first)), nearest]
    least = round_trip.reshape(len(places), -1, 2).min(axis=2)
    fits = least <= instance.capacity_s + TOLERANCE_S
    reachable = hop[len(depots) :] < NEVER
    able = fits[len(depots) :] | ((reachable.astype(np.int64) @ fits[: len(depots)].astype(np.int64)) > 0)
    kept = min(GATES, len(depots))
    begun = np.ascontiguousarray(least[: len(depots)].argsort(axis=0, kind="stable")[:kept].T)
    between = times[np.ix_(last, first)].reshape(len(ends), 2, len(ends), 2).min(axis=(1, 3))
    np.fill_diagonal(between, -1.0)  # each task is the nearest to itself
    return DayProblem(
        into=into,
        out=np.ascontiguousarray(out),
        home=np.ascontiguousarray(home),
        nearest=nearest,
        hop=hop,
        base=np.concatenate((np.arange(len(depots)), times[np.ix_(starts, depots)].argmin(axis=1))),
        first=begun,
        gates=_gates(out[: len(depots)], home, begun, nearest),
        near=np.ascontiguousarray(between.argsort(axis=1, kind="stable")[:, :NEAR]),
        able=np.ascontiguousarray(able.astype(np.int64)),
        ready=np.array([own.ready_s for own in instance.vehicles], dtype=np.float64),
        ended=np.array([own.ended_s for own in instance.vehicles], dtype=np.float64),
        capacity=instance.capacity_s,
        pause=instance.turnaround_s,
        share=share,
        haste=haste,
    )


def _hops(times: FloatArray, places: IntArray, depots: IntArray, instance: DayInstance) -> FloatArray:
    """Return the least time of trips without a task from each place to each depot, with a pause after each."""
    hops = np.where(times <= instance.capacity_s + TOLERANCE_S, times + instance.turnaround_s, NEVER)
    hops[places[:, np.newaxis] == depots] = 0.0
    for middle in range(len(depots)):
        np.minimum(hops, hops[:, middle, np.newaxis] + hops[middle], out=hops)
    return np.minimum(hops, NEVER)


def _gates(out: FloatArray, home: FloatArray, begun: IntArray, nearest: IntArray) -> IntArray:
    """Return depots between each task and each next one: those on the way, the nearest to each side."""
    depots, tasks, kept = len(out), len(begun), begun.shape[1]
    if kept == depots:
        return np.tile(np.arange(depots), (tasks, tasks, 1))
    landing = home.reshape(tasks, 2, depots).min(axis=1)
    begin = out.reshape(depots, tasks, 2).min(axis=2).T
    detour = landing[:, np.newaxis] + begin[np.newaxis]
    # Where a task can be done at all it can be from the depot that begins it best to the nearest one.
    rows = np.arange(tasks)
    detour[rows, :, nearest[::2]] = -1.0
    detour[rows, :, nearest[1::2]] = -1.0
    detour[:, rows, begun[:, 0]] = -1.0
    return np.ascontiguousarray(detour.argsort(axis=2, kind="stable")[:, :, :kept])


def day_state(problem: DayProblem) -> DayState:
    """Return a state without a visit."""
    fleet, tasks = problem.able.shape
    return DayState(
        visits=np.zeros((fleet, tasks), dtype=np.int64),
        lengths=np.zeros(fleet, dtype=np.int64),
        trips=np.zeros(fleet, dtype=np.int64),
        begins=np.zeros((fleet, tasks + 2), dtype=np.int64),
        place=np.zeros((fleet, tasks + 1), dtype=np.int64),
        depot=np.zeros((fleet, tasks + 1), dtype=np.int64),
        load=np.zeros((fleet, tasks + 1)),
        ends=problem.ended.copy(),
        waits=np.zeros(fleet),
    )


def copy_day(state: DayState) -> DayState:
    """Return a copy that shares nothing."""
    return DayState._make(array.copy() for array in state)


def day_memory(problem: DayProblem) -> DayMemory:
    """Return work space."""
    fleet, tasks = problem.able.shape
    boundaries = (tasks + 1, problem.first.shape[1] + 1)
    return DayMemory(
        touched=np.zeros(fleet, dtype=np.int64),
        removed=np.zeros(tasks, dtype=np.int64),
        gate=np.zeros(boundaries, dtype=np.int64),
        reached=np.zeros(boundaries),
        since=np.zeros(boundaries, dtype=np.int64),
        by=np.zeros(boundaries, dtype=np.int64),
        over=np.zeros(boundaries, dtype=np.int64),
        turned=np.zeros((tasks, 2), dtype=np.int64),
    )


def day_plan(instance: DayInstance, problem: DayProblem, state: DayState) -> DayPlan:
    """Return a state as a plan, moves between depots as trips without a visit."""
    depots = sorted(set(instance.depots))
    taken = {int(visit) >> 1 for own, length in zip(state.visits, state.lengths, strict=True) for visit in own[:length]}
    everybody = []
    for number, own in enumerate(instance.vehicles):
        trips: list[Trip] = []
        place = own.place
        at = depots.index(place) if place in depots else len(depots) + number
        for trip in range(int(state.trips[number])):
            begin = int(state.place[number, trip])
            if begin < len(depots) and depots[begin] != place:
                trips += _moves(instance, problem, at, begin)
                place = depots[begin]
            first, last = (int(position) for position in state.begins[number, trip : trip + 2])
            at = int(state.depot[number, trip])
            visits = tuple(int(visit) for visit in state.visits[number, first:last])
            trips.append(Trip(place, visits, depots[at]))
            place = depots[at]
        everybody.append(tuple(trips))
    return DayPlan(tuple(everybody), tuple(task for task in range(len(instance.tasks)) if task not in taken))


def _moves(instance: DayInstance, problem: DayProblem, begin: int, end: int) -> list[Trip]:
    """Return the trips without a task that lead from a place to a depot soonest."""
    depots = sorted(set(instance.depots))
    here = depots[begin] if begin < len(depots) else instance.vehicles[begin - len(depots)].place
    direct = instance.times_s[here, depots[end]]
    if (
        direct <= instance.capacity_s + TOLERANCE_S
        and direct + instance.turnaround_s <= problem.hop[begin, end] + TOLERANCE_S
    ):
        return [Trip(here, (), depots[end])]
    through = problem.hop[begin] + problem.hop[:, end][: len(depots)]
    through[end] = NEVER
    if begin < len(depots):
        through[begin] = NEVER
    middle = int(through.argmin())
    return _moves(instance, problem, begin, middle) + _moves(instance, problem, middle, end)
