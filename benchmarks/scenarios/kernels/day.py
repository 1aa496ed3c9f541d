"""A day of several trips: its arrays, and the best division of a vehicle's visits into trips.

The search only orders visits. Where a vehicle lands between two of them, where it begins again and in which direction
each task is flown follows from the order: a shortest path over the boundaries between visits, with a few gates (depots
that suit both sides) at each (after Prins, Computers and Operations Research 31(12) 2004, 'split').
"""

from __future__ import annotations

from typing import NamedTuple

import numba as nb

from planner.kernels.arrays import FLOATS, INT_TABLE, INTS, TABLE, FloatArray, IntArray
from planner.kernels.compiled import inner, kernel

NEVER = 1e18
"""Seconds of a way that there is not."""
TOLERANCE_S = 1e-9
"""By which a trip may be longer than allowed: sums depend on their order."""


class DayProblem(NamedTuple):
    """An instance for the kernels: ``n`` tasks, ``k`` vehicles, ``d`` depots; places are depots, then starts."""

    into: FloatArray
    """(2n, 2n): from the end of visit i to the end of visit j."""
    out: FloatArray
    """(d + k, 2n): from a place to the end of a visit."""
    home: FloatArray
    """(2n, d): from the end of a visit to a depot."""
    nearest: IntArray
    """(2n,): the depot nearest to the end of a visit."""
    hop: FloatArray
    """(d + k, d): trips without a task from a place to a depot, with the pauses between and after them; 0 to itself."""
    base: IntArray
    """(d + k,): the depot nearest to a place, itself for a depot."""
    first: IntArray
    """(n, g): depots from which a task is begun best."""
    gates: IntArray
    """(n, n, g): depots to land at between a task and the next one."""
    near: IntArray
    """(n, m): the tasks nearest to a task, itself first."""
    able: IntArray
    """(k, n): whether a vehicle can do a task at all, 0 or 1."""
    ready: FloatArray
    """(k,): when a vehicle may begin its next trip."""
    ended: FloatArray
    """(k,): the end of its trips so far."""
    capacity: float
    """The longest trip."""
    pause: float
    """Between two trips."""
    share: float
    """What a second of all vehicles' ends weighs against one of the last end, in the search."""
    haste: float
    """The same of the times at which tasks are brought home, of all of them."""


class DayState(NamedTuple):
    """Visits in order, and the trips that they are divided into. ``k`` vehicles of at most ``n`` visits."""

    visits: IntArray
    """(k, n)"""
    lengths: IntArray
    """(k,)"""
    trips: IntArray
    """(k,): how many."""
    begins: IntArray
    """(k, n + 1): position of a trip's first visit; after the last trip the number of visits."""
    place: IntArray
    """(k, n): where a trip begins."""
    depot: IntArray
    """(k, n): where it lands."""
    load: FloatArray
    """(k, n): how long it takes."""
    ends: FloatArray
    """(k,): when the vehicle's last trip ends."""
    waits: FloatArray
    """(k,): the sum of the times at which its tasks are brought home."""


class DayMemory(NamedTuple):
    """Work space."""

    touched: IntArray
    """(k,): zeros."""
    removed: IntArray
    """(n,)"""
    gate: IntArray
    """(n + 1, g + 1): places at each boundary between visits."""
    reached: FloatArray
    """(n + 1, g + 1): the earliest start from there."""
    since: IntArray
    """(n + 1, g + 1): the boundary where the trip that lands there began."""
    by: IntArray
    """(n + 1, g + 1): the number of the gate where it began."""
    over: IntArray
    """(n + 1, g + 1): the number of the gate where it landed, if the vehicle then moved here."""
    turned: IntArray
    """(n, 2): the direction of the visit before, for each direction of a visit."""


DAY = nb.types.NamedTuple(
    (TABLE, TABLE, TABLE, INTS, TABLE, INTS, INT_TABLE, nb.types.Array(nb.int64, 3, "C"), INT_TABLE, INT_TABLE)
    + (FLOATS,) * 2 + (nb.float64,) * 4,
    DayProblem,
)  # fmt: skip
DAY_STATE = nb.types.NamedTuple(
    (INT_TABLE, INTS, INTS, INT_TABLE, INT_TABLE, INT_TABLE, TABLE, FLOATS, FLOATS), DayState
)
DAY_MEMORY = nb.types.NamedTuple((INTS, INTS, INT_TABLE, TABLE, INT_TABLE, INT_TABLE, INT_TABLE, INT_TABLE), DayMemory)


@inner(nb.void(DAY, DAY_STATE, DAY_MEMORY, nb.int64))
def open_gates(problem: DayProblem, state: DayState, memory: DayMemory, vehicle: int) -> None:
    """Set the places at each boundary of a vehicle's visits; reached are its start and what it can move to."""
    visits, length = state.visits[vehicle], state.lengths[vehicle]
    depots = problem.home.shape[1]
    count = problem.first.shape[1]
    start = depots + vehicle
    ready = problem.ready[vehicle]
    for boundary in range(length):
        task = visits[boundary] >> 1
        for gate in range(count):
            memory.reached[boundary, gate] = NEVER
            memory.over[boundary, gate] = gate
            if boundary == 0:
                depot = problem.first[task, gate]
                memory.gate[0, gate] = depot
                memory.reached[0, gate] = ready + problem.hop[start, depot]
            else:
                memory.gate[boundary, gate] = problem.gates[visits[boundary - 1] >> 1, task, gate]
        memory.reached[boundary, count] = NEVER
    memory.gate[0, count] = start
    memory.reached[0, count] = ready


@inner(nb.void(DAY, DAY_MEMORY, nb.int64))
def move_on(problem: DayProblem, memory: DayMemory, boundary: int) -> None:
    """Let a vehicle move between the depots of a boundary by trips without a task, where that is sooner."""
    count = problem.first.shape[1]
    reached, gate, over = memory.reached[boundary], memory.gate[boundary], memory.over[boundary]
    for landed in range(count):
        if reached[landed] >= NEVER or over[landed] != landed:
            continue
        for onward in range(count):
            then = reached[landed] + problem.hop[gate[landed], gate[onward]]
            if then < reached[onward] - TOLERANCE_S:
                reached[onward] = then
                over[onward] = landed


@inner(nb.float64(DAY, DAY_STATE, DAY_MEMORY, nb.int64))
def reach(problem: DayProblem, state: DayState, memory: DayMemory, vehicle: int) -> float:
    """Fill the memory with the earliest starts from all gates; return the end of the last trip, NEVER if none."""
    visits, length = state.visits[vehicle], state.lengths[vehicle]
    count = problem.first.shape[1]
    longest = problem.capacity + TOLERANCE_S
    open_gates(problem, state, memory, vehicle)
    best = NEVER
    for boundary in range(length):
        if boundary > 0:
            move_on(problem, memory, boundary)
        for gate in range(count + int(boundary == 0)):
            begun = memory.reached[boundary, gate]
            if begun >= best:
                continue
            place = memory.gate[boundary, gate]
            task = visits[boundary] & -2
            along = problem.out[place, task]
            back = problem.out[place, task + 1]
            after = boundary + 1
            while min(along, back) <= longest:
                if after == length:
                    lasts = min(
                        along + problem.home[task, problem.nearest[task]],
                        back + problem.home[task + 1, problem.nearest[task + 1]],
                    )
                    if lasts <= longest and begun + lasts < best:
                        best = begun + lasts
                        memory.since[length, 0] = boundary
                        memory.by[length, 0] = gate
                    break
                for number in range(count):
                    depot = memory.gate[after, number]
                    lasts = min(along + problem.home[task, depot], back + problem.home[task + 1, depot])
                    if lasts <= longest and begun + lasts + problem.pause < memory.reached[after, number]:
                        memory.reached[after, number] = begun + lasts + problem.pause
                        memory.since[after, number] = boundary
                        memory.by[after, number] = gate
                follower = visits[after] & -2
                onward = min(along + problem.into[task, follower], back + problem.into[task + 1, follower])
                back = min(along + problem.into[task, follower + 1], back + problem.into[task + 1, follower + 1])
                along = onward
                task = follower
                after += 1
    return best


@inner(nb.float64(DAY, DAY_STATE, DAY_MEMORY, nb.int64, nb.int64, nb.int64, nb.int64, nb.int64))
def turn_trip(
    problem: DayProblem, state: DayState, memory: DayMemory, vehicle: int, begin: int, end: int, place: int, depot: int
) -> float:
    """Turn visits [begin, end) as is best for a trip from a place to a depot, the nearest for -1; return its time."""
    visits, turned = state.visits[vehicle], memory.turned
    task = visits[begin] & -2
    along, back = problem.out[place, task], problem.out[place, task + 1]
    for position in range(begin + 1, end):
        follower = visits[position] & -2
        first, second = along + problem.into[task, follower], back + problem.into[task + 1, follower]
        third, fourth = along + problem.into[task, follower + 1], back + problem.into[task + 1, follower + 1]
        turned[position, 0] = int(second < first)
        turned[position, 1] = int(fourth < third)
        along, back = min(first, second), min(third, fourth)
        task = follower
    if depot >= 0:
        along += problem.home[task, depot]
        back += problem.home[task + 1, depot]
    else:
        along += problem.home[task, problem.nearest[task]]
        back += problem.home[task + 1, problem.nearest[task + 1]]
    direction = int(back < along)
    for position in range(end - 1, begin - 1, -1):
        visits[position] = (visits[position] & -2) + direction
        if position > begin:
            direction = turned[position, direction]
    return float(min(along, back))


@kernel(nb.void(DAY, DAY_STATE, DAY_MEMORY, nb.int64))
def divide(problem: DayProblem, state: DayState, memory: DayMemory, vehicle: int) -> None:
    """Divide a vehicle's visits into trips so that the last ends as early as can be; turn each visit.

    The end is NEVER, and trips are not to be used, where no division keeps every trip within its time.
    """
    length = state.lengths[vehicle]
    begins, places, landings = state.begins[vehicle], state.place[vehicle], state.depot[vehicle]
    state.trips[vehicle] = 0
    begins[0] = 0
    state.ends[vehicle] = problem.ended[vehicle]
    state.waits[vehicle] = 0.0
    if length == 0:
        return
    state.ends[vehicle] = reach(problem, state, memory, vehicle)
    if state.ends[vehicle] >= NEVER:
        return
    count = 0
    boundary, gate, depot = length, 0, -1
    while boundary > 0:  # from the last trip to the first
        landed = memory.over[boundary, gate] if boundary < length else gate
        if boundary < length:
            depot = memory.gate[boundary, landed]
        begin = memory.since[boundary, landed]
        gate = memory.by[boundary, landed]
        begins[count] = begin
        places[count] = memory.gate[begin, gate]
        landings[count] = depot
        boundary = begin
        count += 1
    for trip in range(count // 2):
        other = count - 1 - trip
        begins[trip], begins[other] = begins[other], begins[trip]
        places[trip], places[other] = places[other], places[trip]
        landings[trip], landings[other] = landings[other], landings[trip]
    begins[count] = length
    state.trips[vehicle] = count
    landed = problem.home.shape[1] + vehicle
    now = problem.ready[vehicle]
    for trip in range(count):
        state.load[vehicle, trip] = turn_trip(
            problem, state, memory, vehicle, begins[trip], begins[trip + 1], places[trip], landings[trip]
        )
        if places[trip] != landed:
            now += problem.hop[landed, places[trip]]
        landed = landings[trip]
        now += state.load[vehicle, trip] + problem.pause
        state.waits[vehicle] += (begins[trip + 1] - begins[trip]) * now
    landings[count - 1] = problem.nearest[state.visits[vehicle, length - 1]]


@kernel(nb.float64(DAY, DAY_STATE))
def guide(problem: DayProblem, state: DayState) -> float:
    """Return what the search minimises: the last end, and a share of all ends."""
    last = 0.0
    total = 0.0
    waits = 0.0
    for vehicle in range(len(state.ends)):
        last = max(last, state.ends[vehicle])
        total += state.ends[vehicle]
        waits += state.waits[vehicle]
    return float(last + problem.share * total + problem.haste * waits)
