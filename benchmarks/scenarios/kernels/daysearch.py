"""The search for a day: ruin and recreate under annealing, each trial divided into trips anew."""

from __future__ import annotations

import math

import numba as nb

from benchmarks.scenarios.kernels.day import (
    DAY,
    DAY_MEMORY,
    DAY_STATE,
    TOLERANCE_S,
    DayMemory,
    DayProblem,
    DayState,
    divide,
    guide,
)
from benchmarks.scenarios.kernels.dayinsertion import insert_tasks
from planner.kernels.arrays import FLOATS, RANDOM, FloatArray, RandomState
from planner.kernels.compiled import inner, kernel
from planner.kernels.random_numbers import draw_integer, draw_uniform

MOST_REMOVED = 10
"""Tasks that are taken out at a time."""


@inner(nb.void(DAY_STATE, DAY_STATE, nb.int64))
def copy_vehicle(source: DayState, target: DayState, vehicle: int) -> None:
    """Make a vehicle's trips in ``target`` those in ``source``."""
    for position in range(source.lengths[vehicle]):
        target.visits[vehicle, position] = source.visits[vehicle, position]
    count = source.trips[vehicle]
    for trip in range(count):
        target.begins[vehicle, trip] = source.begins[vehicle, trip]
        target.place[vehicle, trip] = source.place[vehicle, trip]
        target.depot[vehicle, trip] = source.depot[vehicle, trip]
        target.load[vehicle, trip] = source.load[vehicle, trip]
    target.begins[vehicle, count] = source.begins[vehicle, count]
    target.trips[vehicle] = count
    target.lengths[vehicle] = source.lengths[vehicle]
    target.ends[vehicle] = source.ends[vehicle]
    target.waits[vehicle] = source.waits[vehicle]


@inner(nb.int64(DAY_STATE, DAY_MEMORY, nb.int64, nb.int64, nb.int64, nb.int64))
def cut_tasks(state: DayState, memory: DayMemory, vehicle: int, begin: int, end: int, count: int) -> int:
    """Take positions [begin, end) out of a vehicle's visits; return the new count of ``removed``."""
    visits = state.visits[vehicle]
    length = state.lengths[vehicle]
    for position in range(begin, end):
        memory.removed[count] = visits[position] >> 1
        count += 1
    for position in range(end, length):
        visits[position - (end - begin)] = visits[position]
    state.lengths[vehicle] = length - (end - begin)
    memory.touched[vehicle] = 1
    return count


@inner(nb.types.UniTuple(nb.int64, 2)(DAY_STATE, nb.int64))
def find(state: DayState, task: int) -> tuple[int, int]:
    """Return the vehicle and the position of a task, -1 twice if nobody has it."""
    for vehicle in range(len(state.lengths)):
        for position in range(state.lengths[vehicle]):
            if state.visits[vehicle, position] >> 1 == task:
                return vehicle, position
    return -1, -1


@inner(nb.int64(DAY, DAY_STATE, DAY_STATE, DAY_MEMORY, RANDOM))
def ruin(problem: DayProblem, current: DayState, state: DayState, memory: DayMemory, rng: RandomState) -> int:
    """Take tasks out near a random one, singly, in strings or by whole trips; return how many.

    ``current`` is the state before, with its trips.
    """
    tasks = problem.near.shape[0]
    wanted = 1 + draw_integer(rng, min(MOST_REMOVED, tasks))
    kind = draw_uniform(rng)
    seed = draw_integer(rng, tasks)
    count = 0
    for rank in range(problem.near.shape[1]):
        if count >= wanted:
            break
        if rank > 0 and draw_uniform(rng) < 0.2:
            continue
        task = problem.near[seed, rank]
        vehicle, position = find(state, task)
        if vehicle < 0:
            continue
        if kind < 0.35:
            count = cut_tasks(state, memory, vehicle, position, position + 1, count)
        elif kind < 0.65:
            size = min(1 + draw_integer(rng, 4), state.lengths[vehicle], wanted - count)
            begin = max(0, min(position - draw_integer(rng, size), state.lengths[vehicle] - size))
            count = cut_tasks(state, memory, vehicle, begin, begin + size, count)
        elif memory.touched[vehicle] == 0:
            trip = 0
            while current.begins[vehicle, trip + 1] <= position:
                trip += 1
            count = cut_tasks(
                state, memory, vehicle, current.begins[vehicle, trip], current.begins[vehicle, trip + 1], count
            )
    for vehicle in range(len(state.lengths)):
        if memory.touched[vehicle] == 1:
            divide(problem, state, memory, vehicle)
    return count


@inner(nb.void(DAY, DAY_MEMORY, nb.int64, RANDOM))
def arrange(problem: DayProblem, memory: DayMemory, count: int, rng: RandomState) -> None:
    """Put the removed tasks into a random order, or those far from home first, or the nearest."""
    removed = memory.removed
    for last in range(count - 1, 0, -1):
        other = draw_integer(rng, last + 1)
        removed[last], removed[other] = removed[other], removed[last]
    kind = draw_uniform(rng)
    if kind < 0.5:
        return
    sign = 1.0 if kind < 0.8 else -1.0
    for last in range(1, count):
        position = last
        while position > 0:
            one, other = removed[position - 1], removed[position]
            far = problem.home[2 * one, problem.nearest[2 * one]]
            farther = problem.home[2 * other, problem.nearest[2 * other]]
            if sign * far >= sign * farther:
                break
            removed[position - 1], removed[position] = other, one
            position -= 1


@inner(nb.void(DAY, DAY_STATE, DAY_MEMORY, RANDOM))
def reverse(problem: DayProblem, state: DayState, memory: DayMemory, rng: RandomState) -> None:
    """Turn a part of a vehicle's order round."""
    vehicle = draw_integer(rng, len(state.lengths))
    length = state.lengths[vehicle]
    if length < 2:
        return
    low, high = draw_integer(rng, length), draw_integer(rng, length)
    if low > high:
        low, high = high, low
    visits = state.visits[vehicle]
    while low < high:
        visits[low], visits[high] = visits[high], visits[low]
        low += 1
        high -= 1
    memory.touched[vehicle] = 1
    divide(problem, state, memory, vehicle)


@inner(nb.void(DAY, DAY_STATE, DAY_MEMORY, RANDOM))
def hand_on(problem: DayProblem, state: DayState, memory: DayMemory, rng: RandomState) -> None:
    """Put a whole trip elsewhere between the trips of this vehicle or another."""
    giver, taker = draw_integer(rng, len(state.lengths)), draw_integer(rng, len(state.lengths))
    if state.trips[giver] == 0:
        return
    trip = draw_integer(rng, state.trips[giver])
    begin, end = state.begins[giver, trip], state.begins[giver, trip + 1]
    to = state.begins[taker, draw_integer(rng, state.trips[taker] + 1)]
    count = cut_tasks(state, memory, giver, begin, end, 0)
    if giver == taker and to >= end:
        to -= end - begin
    to = min(to, state.lengths[taker])
    visits = state.visits[taker]
    for position in range(state.lengths[taker] - 1, to - 1, -1):
        visits[position + count] = visits[position]
    for number in range(count):
        visits[to + number] = 2 * memory.removed[number]
    state.lengths[taker] += count
    memory.touched[taker] = 1
    divide(problem, state, memory, giver)
    if taker != giver:
        divide(problem, state, memory, taker)


@kernel(nb.void(DAY_STATE, FLOATS))
def measure_day(state: DayState, key: FloatArray) -> None:
    """Set ``key`` (3,) to the last end, the sum of all ends, the sum of all waits: less is better, in this order."""
    key[:] = 0.0
    for vehicle in range(len(state.ends)):
        key[0] = max(key[0], state.ends[vehicle])
        key[1] += state.ends[vehicle]
        key[2] += state.waits[vehicle]


@inner(nb.boolean(FLOATS, FLOATS))
def less(key: FloatArray, other: FloatArray) -> bool:
    """Return whether a key is less than another, the first entry that differs decides."""
    for entry in range(len(key)):
        if abs(key[entry] - other[entry]) > TOLERANCE_S:
            return bool(key[entry] < other[entry])
    return False


@kernel(
    nb.int64(
        DAY, DAY_STATE, DAY_STATE, DAY_STATE, FLOATS, FLOATS, nb.float64, nb.int64, RANDOM, DAY_MEMORY, FLOATS,
    )
)  # fmt: skip
def anneal_day(
    problem: DayProblem, current: DayState, trial: DayState, best: DayState, key: FloatArray, temperature: FloatArray,
    cooling: float, iterations: int, rng: RandomState, memory: DayMemory, measured: FloatArray,
) -> int:  # fmt: skip
    """Try ``iterations`` changes of ``current``; keep the best in ``best`` and its ``key``.

    ``trial`` equals ``current`` before and after. Returns the last iteration that found a new best, counted from 1; 0
    if none did.
    """
    fleet = len(current.lengths)
    value = guide(problem, current)
    improved = 0
    for iteration in range(iterations):
        kind = draw_uniform(rng)
        complete = True
        if kind < 0.1:
            reverse(problem, trial, memory, rng)
        elif kind < 0.2:
            hand_on(problem, trial, memory, rng)
        else:
            count = ruin(problem, current, trial, memory, rng)
            arrange(problem, memory, count, rng)
            complete = insert_tasks(problem, trial, memory, memory.removed, count, rng)
        found = guide(problem, trial)
        accepted = complete and found < value - temperature[0] * math.log(max(draw_uniform(rng), 1e-300))
        if accepted:
            value = found
            measure_day(trial, measured)
            if less(measured, key):
                for entry in range(len(key)):
                    key[entry] = measured[entry]
                improved = iteration + 1
                for vehicle in range(fleet):
                    copy_vehicle(trial, best, vehicle)
        for vehicle in range(fleet):
            if memory.touched[vehicle] == 1:
                if accepted:
                    copy_vehicle(trial, current, vehicle)
                else:
                    copy_vehicle(current, trial, vehicle)
                memory.touched[vehicle] = 0
        temperature[0] *= cooling
    return improved
