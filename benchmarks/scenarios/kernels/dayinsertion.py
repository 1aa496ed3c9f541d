"""Putting tasks into a day's trips where they cost least, by the trips as they were divided last."""

from __future__ import annotations

import numba as nb

from benchmarks.scenarios.kernels.day import (
    DAY,
    DAY_MEMORY,
    DAY_STATE,
    NEVER,
    TOLERANCE_S,
    DayMemory,
    DayProblem,
    DayState,
    divide,
)
from planner.kernels.arrays import INTS, RANDOM, IntArray, RandomState
from planner.kernels.compiled import inner, kernel
from planner.kernels.random_numbers import draw_uniform

BLINK = 0.01
"""Share of places that are overlooked (Christiaens, Vanden Berghe 2020)."""


@inner(nb.types.Tuple((nb.float64, nb.int64, nb.int64, nb.int64))(DAY, DAY_STATE, nb.int64, nb.int64, RANDOM))
def cheapest(
    problem: DayProblem, state: DayState, vehicle: int, task: int, rng: RandomState
) -> tuple[float, int, int, int]:
    """Return what a task adds to a vehicle's end at its best place, the position, the trip, the visit.

    The trip is -1 - t for a new trip before trip t. What a new trip adds is an estimate: ``divide`` knows.
    """
    visits, count = state.visits[vehicle], state.trips[vehicle]
    depots = problem.home.shape[1]
    longest = problem.capacity + TOLERANCE_S
    least, position, into, visit = NEVER, 0, -1, 2 * task
    for trip in range(count):
        begin, end = state.begins[vehicle, trip], state.begins[vehicle, trip + 1]
        place, depot = state.place[vehicle, trip], state.depot[vehicle, trip]
        room = longest - state.load[vehicle, trip]
        for before in range(begin, end + 1):
            if draw_uniform(rng) < BLINK:
                continue
            for way in range(2 * task, 2 * task + 2):
                if before == begin:
                    added = problem.out[place, way] - problem.out[place, visits[before]]
                else:
                    added = problem.into[visits[before - 1], way]
                    if before < end:
                        added -= problem.into[visits[before - 1], visits[before]]
                if before < end:
                    added += problem.into[way, visits[before]]
                elif trip == count - 1:
                    added += problem.home[way, problem.nearest[way]] - problem.home[visits[before - 1], depot]
                else:
                    added += problem.home[way, depot] - problem.home[visits[before - 1], depot]
                if added < least and added <= room:
                    least, position, into, visit = added, before, trip, way
    for trip in range(count + 1):  # a new one before it
        if draw_uniform(rng) < BLINK and least < NEVER:
            continue
        if trip < count:
            place = state.place[vehicle, trip]
        elif count > 0:
            place = state.depot[vehicle, count - 1]
        else:
            place = depots + vehicle
        for way in range(2 * task, 2 * task + 2):
            depot = problem.nearest[way] if trip == count else problem.base[place]
            lasts = problem.out[place, way] + problem.home[way, depot]
            if lasts > longest:
                lasts = 2.0 * problem.capacity + problem.pause  # another trip leads there
            added = lasts + problem.pause
            if count == 0:
                added = problem.ready[vehicle] + lasts - problem.ended[vehicle]
            if added < least:
                least, position, into, visit = added, state.begins[vehicle, trip], -1 - trip, way
    return least, position, into, visit


@inner(nb.void(DAY, DAY_STATE, nb.int64, nb.float64, nb.int64, nb.int64, nb.int64))
def put(problem: DayProblem, state: DayState, vehicle: int, added: float, position: int, into: int, visit: int) -> None:
    """Put a visit at a position, into a trip or a new one, as ``cheapest`` has it."""
    visits, begins = state.visits[vehicle], state.begins[vehicle]
    for later in range(state.lengths[vehicle], position, -1):
        visits[later] = visits[later - 1]
    visits[position] = visit
    state.lengths[vehicle] += 1
    count = state.trips[vehicle]
    if into >= 0:
        for trip in range(into + 1, count + 1):
            begins[trip] += 1
        state.load[vehicle, into] += added
        if into == count - 1 and position == begins[count] - 1:
            state.depot[vehicle, into] = problem.nearest[visit]
    else:
        new = -1 - into
        depots = problem.home.shape[1]
        place = depots + vehicle
        if new < count:
            place = state.place[vehicle, new]
        elif count > 0:
            place = state.depot[vehicle, count - 1]
        for trip in range(count, new, -1):
            begins[trip + 1] = begins[trip] + 1
            state.place[vehicle, trip] = state.place[vehicle, trip - 1]
            state.depot[vehicle, trip] = state.depot[vehicle, trip - 1]
            state.load[vehicle, trip] = state.load[vehicle, trip - 1]
        begins[new] = position
        begins[new + 1] = position + 1
        depot = problem.nearest[visit] if new == count else problem.base[place]
        state.place[vehicle, new] = place
        state.depot[vehicle, new] = depot
        state.load[vehicle, new] = problem.out[place, visit] + problem.home[visit, depot]
        state.trips[vehicle] += 1
    state.ends[vehicle] += added


@kernel(nb.boolean(DAY, DAY_STATE, DAY_MEMORY, INTS, nb.int64, RANDOM))
def insert_tasks(
    problem: DayProblem, state: DayState, memory: DayMemory, tasks: IntArray, count: int, rng: RandomState
) -> bool:
    """Put the first ``count`` tasks into the day one after the other, and divide what has changed.

    Trips must be those of ``divide``. Returns whether each task had a place.
    """
    fleet = len(state.lengths)
    for number in range(count):
        task = tasks[number]
        last = 0.0
        for vehicle in range(fleet):
            last = max(last, state.ends[vehicle])
        best, chosen, best_added, position, into, visit = NEVER, -1, 0.0, 0, 0, 0
        for vehicle in range(fleet):
            if problem.able[vehicle, task] == 0:
                continue
            added, where, trip, way = cheapest(problem, state, vehicle, task, rng)
            worse = max(0.0, state.ends[vehicle] + added - last) + problem.share * added
            if worse < best:
                best, chosen, best_added, position, into, visit = worse, vehicle, added, where, trip, way
        if chosen < 0:
            return False
        put(problem, state, chosen, best_added, position, into, visit)
        memory.touched[chosen] = 1
    for vehicle in range(fleet):
        if memory.touched[vehicle] == 1:
            divide(problem, state, memory, vehicle)
    return True
