"""Days of sorties: arrays, start times, the bases of each vehicle's sorties, and the best position for a segment.

The search only decides which visits a sortie has, which vehicle flies it and in which order a vehicle flies its
sorties. Start times follow: at every moment the sortie that can take off soonest does (``schedule_sorties``). Start and
landing bases are a shortest path over the bases between sorties (``choose_bases``). A segment is inserted next to a
near one, or into a new sortie, wherever it costs least (``put_all_segments``).
"""

from __future__ import annotations

from typing import Annotated, NamedTuple

from planner.kernels.arrays import Floats, Ints, IntTable, Quad, RandomState, Table
from planner.kernels.compiling import inner, kernel
from planner.kernels.tours import draw_integer, draw_uniform, find_position

NEVER = 1e18
"""Duration of a move that does not exist, or a time that never comes, seconds."""
TOLERANCE = 1e-9
"""Amount by which a sortie may exceed its budget: sums depend on the order of addition."""

BLINK = 0.01
"""Share of positions skipped at random (Christiaens, Vanden Berghe 2020)."""


class SortieProblem(NamedTuple):
    """An instance for the kernels: ``n`` segments, ``k`` vehicles, ``d`` bases, ``p`` profiles, ``t`` days."""

    move: Quad
    """(p, 2n, 2n, 2): seconds and percent from the end of visit i to the end of visit j."""
    out: Quad
    """(k, d, 2n, 2)"""
    home: Quad
    """(k, 2n, d, 2)"""
    profile: Ints
    """(k,)"""
    consumption: Floats
    """(k,): factor on the percent of ``move``."""
    budget: Floats
    """(k,)"""
    able: IntTable
    """(k, n): 1 if the vehicle can inspect the segment, else 0."""
    lands: IntTable
    """(k, d): 1 if the vehicle may land at the base, else 0."""
    transfer: Table
    """(d, d)"""
    turnaround: Floats
    """(d,)"""
    recharge: Floats
    """(d,): NEVER if packs are only charged overnight."""
    packs: Ints
    """(d,): -1 if packs are unlimited."""
    days: Table
    """(t, 3): start, end, total seconds of the days before."""
    windows: Quad
    """(k, t, w, 2): flight windows of a vehicle per day; empty ones end before they begin."""
    near: IntTable
    """(n, m): nearest segments of each segment, excluding the segment itself."""
    place: Ints
    """(k,): the vehicle's current base."""
    ready: Floats
    """(k,)"""
    stock: Ints
    """(d,): number of packs on the first day."""
    charged: Table
    """(d, s): charge completion time of each pack."""
    taken_off: Floats
    """(d,): time of the last take-off."""
    stagger: float
    finish: float
    """Search weight of a second of the last landing, counted in day time only."""
    flight: float
    """Search weight of a second of flight."""
    swap: float
    """Search weight of a sortie."""
    late: float
    """Search weight of a segment whose sortie does not fit into any day."""
    objective: int
    """Primary objective: 0 the last landing, 1 flight time, 2 the number of sorties."""


class SortieState(NamedTuple):
    """The sorties that the search changes: at most ``r`` sorties of at most ``c`` visits."""

    visits: Annotated[IntTable, "r c"]
    size: Annotated[Ints, "r"]
    """Number of visits; 0 for a free row."""
    owner: Annotated[Ints, "r"]
    base: Annotated[Ints, "r"]
    land: Annotated[Ints, "r"]
    between: Annotated[Table, "r 2"]
    """Seconds and percent from the end of the first visit to the end of the last."""
    whole: Annotated[Table, "r 2"]
    """Seconds and percent of the whole sortie."""
    start: Annotated[Floats, "r"]
    """Start time; NEVER if the days end before."""
    order: Annotated[IntTable, "k r"]
    """Rows of each vehicle in flight order."""
    counts: Annotated[Ints, "k"]
    where: Annotated[Ints, "n"]
    """Row of a segment; -1 for none."""
    bias: Annotated[Table, "k d"]
    """Penalty in seconds for a vehicle using a base."""
    ends: Annotated[Floats, "k"]
    """Last landing of each vehicle, in day time only."""
    sums: Annotated[Floats, "5"]
    """Segments that do not fit into any day, last landing, flight time, number of sorties, guide of the search."""


class SortieWorkspace(NamedTuple):
    """Work space."""

    touched: Annotated[Ints, "k"]
    """Zeros between two uses."""
    removed: Annotated[Ints, "n"]
    keys: Annotated[Floats, "n"]
    pool: Annotated[Table, "d s"]
    """Charge completion times of the packs at a base."""
    pooled: Annotated[Ints, "d"]
    last: Annotated[Floats, "d"]
    """Time of the last take-off."""
    next: Annotated[Ints, "k"]
    """Number of the next sortie."""
    at: Annotated[Ints, "k"]
    ready: Annotated[Floats, "k"]
    cost: Annotated[Table, "r+1 d"]
    """Cost of a vehicle's sorties up to one that lands at a base."""
    begun: Annotated[IntTable, "r+1 d"]
    """Base where that sortie begins."""
    came: Annotated[IntTable, "r+1 d"]
    """Base where the previous sortie landed."""


@inner()
def measure_row(problem: SortieProblem, state: SortieState, row: int) -> None:
    """Set the seconds and percent between a sortie's first and last visit."""
    vehicle = state.owner[row]
    move = problem.move[problem.profile[vehicle]]
    seconds = pct = 0.0
    for position in range(1, state.size[row]):
        before, after = state.visits[row, position - 1], state.visits[row, position]
        seconds += move[before, after, 0]
        pct += move[before, after, 1]
    state.between[row, 0] = seconds
    state.between[row, 1] = problem.consumption[vehicle] * pct


@inner()
def may_fly_visits(problem: SortieProblem, state: SortieState, vehicle: int, row: int, begin: int, end: int) -> bool:
    """Return whether a vehicle can inspect the segments at positions [begin, end) of a sortie."""
    able = True
    for position in range(begin, end):
        able = able and problem.able[vehicle, state.visits[row, position] >> 1] == 1
    return able


@inner()
def set_row_figures(problem: SortieProblem, state: SortieState, row: int) -> bool:
    """Set the figures of a whole sortie; return whether it is within the budget."""
    vehicle = state.owner[row]
    first, last = state.visits[row, 0], state.visits[row, state.size[row] - 1]
    base, land = state.base[row], state.land[row]
    for figure in range(2):
        state.whole[row, figure] = (
            problem.out[vehicle, base, first, figure] + state.between[row, figure]
            + problem.home[vehicle, last, land, figure]
        )  # fmt: skip
    return bool(state.whole[row, 1] <= problem.budget[vehicle] + TOLERANCE)


@inner()
def choose_bases(problem: SortieProblem, state: SortieState, memory: SortieWorkspace, vehicle: int) -> bool:
    """Choose the bases of a vehicle's sorties by least time plus penalties; return whether any path exists."""
    count, bases = state.counts[vehicle], len(problem.turnaround)
    budget = problem.budget[vehicle] + TOLERANCE
    for base in range(bases):
        memory.cost[0, base] = NEVER
    memory.cost[0, problem.place[vehicle]] = 0.0
    for number in range(count):
        row = state.order[vehicle, number]
        first, last = state.visits[row, 0], state.visits[row, state.size[row] - 1]
        for land in range(bases):
            memory.cost[number + 1, land] = NEVER
        for base in range(bases):
            if problem.lands[vehicle, base] == 0:
                continue
            reached, came = NEVER, -1
            for before in range(bases):
                then = memory.cost[number, before] + problem.transfer[before, base]
                if then < reached:
                    reached, came = then, before
            if came < 0:
                continue
            reached += problem.out[vehicle, base, first, 0] + state.bias[vehicle, base]
            pct = problem.out[vehicle, base, first, 1] + state.between[row, 1]
            for land in range(bases):
                if problem.lands[vehicle, land] == 0 or pct + problem.home[vehicle, last, land, 1] > budget:
                    continue
                # The last turnaround delays no further sortie.
                after = problem.turnaround[land] if number < count - 1 else 0.0
                then = reached + problem.home[vehicle, last, land, 0] + after
                if then < memory.cost[number + 1, land]:
                    memory.cost[number + 1, land] = then
                    memory.begun[number + 1, land] = base
                    memory.came[number + 1, land] = came
    least, land = NEVER, -1
    for base in range(bases):
        if memory.cost[count, base] < least:
            least, land = memory.cost[count, base], base
    if land < 0:
        return False
    for number in range(count, 0, -1):
        row = state.order[vehicle, number - 1]
        state.base[row] = memory.begun[number, land]
        state.land[row] = land
        land = memory.came[number, land]
        set_row_figures(problem, state, row)
    return True


@inner()
def open_day(problem: SortieProblem, memory: SortieWorkspace, day: int) -> None:
    """Make a day's packs available at the bases."""
    for base in range(len(problem.turnaround)):
        if day == 0:
            memory.pooled[base] = problem.stock[base]
            for pack in range(problem.stock[base]):
                memory.pool[base, pack] = problem.charged[base, pack]
        else:
            memory.pooled[base] = max(0, problem.packs[base])
            for pack in range(problem.packs[base]):
                memory.pool[base, pack] = problem.days[day, 0]


@inner()
def find_soonest_pack(memory: SortieWorkspace, base: int) -> int:
    """Return the number of the pack that is charged first; -1 for none."""
    best, least = -1, NEVER
    for pack in range(memory.pooled[base]):
        if memory.pool[base, pack] < least:
            best, least = pack, memory.pool[base, pack]
    return best


@inner()
def soonest_start_s(
    problem: SortieProblem, state: SortieState, memory: SortieWorkspace, vehicle: int, day: int
) -> float:
    """Return the earliest start of a vehicle's next sortie on a day; NEVER if it cannot start."""
    row = state.order[vehicle, memory.next[vehicle]]
    base = state.base[row]
    begin = max(memory.ready[vehicle] + problem.transfer[memory.at[vehicle], base], problem.days[day, 0])
    begin = max(begin, memory.last[base] + problem.stagger)
    if problem.packs[base] >= 0:
        pack = find_soonest_pack(memory, base)
        if pack < 0:
            return NEVER
        begin = max(begin, memory.pool[base, pack])
    for window in range(problem.windows.shape[2]):
        then = max(begin, problem.windows[vehicle, day, window, 0])
        if then + state.whole[row, 0] <= problem.windows[vehicle, day, window, 1]:
            return float(then)
    return NEVER


@inner()
def schedule_next_sortie(
    problem: SortieProblem, state: SortieState, memory: SortieWorkspace, vehicle: int, begin: float, day: int
) -> None:
    """Start a vehicle's next sortie."""
    row = state.order[vehicle, memory.next[vehicle]]
    base, land = state.base[row], state.land[row]
    state.start[row] = begin
    memory.last[base] = begin
    if problem.packs[base] >= 0:
        pack = find_soonest_pack(memory, base)
        memory.pooled[base] -= 1
        memory.pool[base, pack] = memory.pool[base, memory.pooled[base]]
    end = begin + state.whole[row, 0]
    if problem.packs[land] >= 0 and problem.recharge[land] < NEVER:
        memory.pool[land, memory.pooled[land]] = end + problem.recharge[land]
        memory.pooled[land] += 1
    memory.at[vehicle] = land
    memory.ready[vehicle] = end + problem.turnaround[land]
    memory.next[vehicle] += 1
    state.ends[vehicle] = problem.days[day, 2] + end - problem.days[day, 0]


@kernel()
def schedule_sorties(problem: SortieProblem, state: SortieState, memory: SortieWorkspace) -> None:
    """Schedule all sorties as early as possible, the soonest first; set the figures."""
    fleet = len(state.counts)
    sums = state.sums
    sums[:] = 0.0
    waiting = 0
    for vehicle in range(fleet):
        memory.next[vehicle] = 0
        memory.at[vehicle] = problem.place[vehicle]
        memory.ready[vehicle] = problem.ready[vehicle]
        state.ends[vehicle] = 0.0
        waiting += state.counts[vehicle]
    for base in range(len(problem.turnaround)):
        memory.last[base] = problem.taken_off[base]
    sums[3] = waiting
    for day in range(len(problem.days)):
        if waiting == 0:
            break
        open_day(problem, memory, day)
        while waiting > 0:
            soonest, chosen = NEVER, -1
            for vehicle in range(fleet):
                if memory.next[vehicle] < state.counts[vehicle]:
                    begin = soonest_start_s(problem, state, memory, vehicle, day)
                    if begin < soonest:
                        soonest, chosen = begin, vehicle
            if chosen < 0:
                break
            schedule_next_sortie(problem, state, memory, chosen, soonest, day)
            waiting -= 1
    late_s = 0.0
    for vehicle in range(fleet):
        sums[1] = max(sums[1], state.ends[vehicle])
        for number in range(state.counts[vehicle]):
            row = state.order[vehicle, number]
            sums[2] += state.whole[row, 0]
            if number >= memory.next[vehicle]:
                state.start[row] = NEVER
                sums[0] += state.size[row]
                late_s += state.whole[row, 0] + problem.turnaround[state.land[row]]
    busy = sums[2]
    for vehicle in range(fleet):
        for number in range(state.counts[vehicle]):
            busy += problem.turnaround[state.land[state.order[vehicle, number]]]
    sums[4] = problem.finish * sums[1] + problem.flight * busy + problem.swap * sums[3]
    sums[4] += 3.0 * late_s + problem.late * sums[0]


@inner()
def insertion_cost(
    problem: SortieProblem, state: SortieState, row: int, position: int, visit: int, figure: int
) -> float:
    """Return the seconds (0) or percent (1) that a visit adds to a sortie at a position."""
    vehicle, size = state.owner[row], state.size[row]
    move = problem.move[problem.profile[vehicle]]
    scale = problem.consumption[vehicle] if figure == 1 else 1.0
    visits = state.visits[row]
    more = 0.0
    if position == 0:
        base = state.base[row]
        more += problem.out[vehicle, base, visit, figure] - problem.out[vehicle, base, visits[0], figure]
    else:
        more += scale * move[visits[position - 1], visit, figure]
    if position == size:
        land = state.land[row]
        more += problem.home[vehicle, visit, land, figure] - problem.home[vehicle, visits[size - 1], land, figure]
    else:
        more += scale * move[visit, visits[position], figure]
    if 0 < position < size:
        more -= scale * move[visits[position - 1], visits[position], figure]
    return float(more)


@inner()
def weigh_seconds(problem: SortieProblem, state: SortieState, vehicle: int, seconds: float, last: float) -> float:
    """Return the weighted cost of a vehicle's additional seconds."""
    return float(problem.finish * max(0.0, state.ends[vehicle] + seconds - last) + (problem.flight + 1e-6) * seconds)


@inner()
def find_place_beside(
    problem: SortieProblem, state: SortieState, segment: int, last: float, rng: RandomState
) -> tuple[float, float, int, int, int]:
    """Return the least-cost position next to a near segment: weight, seconds, row, position, visit."""
    best, seconds, chosen, place, way = NEVER, 0.0, -1, 0, 0
    for rank in range(problem.near.shape[1]):
        other = problem.near[segment, rank]
        row = state.where[other]
        if row < 0 or draw_uniform(rng) < BLINK:
            continue
        vehicle = state.owner[row]
        if problem.able[vehicle, segment] == 0 or state.size[row] == state.visits.shape[1]:
            continue
        room = problem.budget[vehicle] + TOLERANCE - state.whole[row, 1]
        position = find_position(state.visits[row], other)
        for at in range(position, position + 2):
            for visit in range(2 * segment, 2 * segment + 2):
                more = insertion_cost(problem, state, row, at, visit, 0)
                worse = weigh_seconds(problem, state, vehicle, more, last)
                if worse < best and insertion_cost(problem, state, row, at, visit, 1) <= room:
                    best, seconds, chosen, place, way = worse, more, row, at, visit
    return best, seconds, chosen, place, way


@inner()
def find_own_sortie(
    problem: SortieProblem, state: SortieState, segment: int, last: float, rng: RandomState
) -> tuple[float, float, int, int, int, int, int]:
    """Return the least-cost new sortie: weight, seconds, vehicle, number, visit, start base, landing base."""
    best, lasts, chosen, number, way, begins, lands = NEVER, 0.0, -1, 0, 0, 0, 0
    bases = len(problem.turnaround)
    for vehicle in range(len(state.counts)):
        if problem.able[vehicle, segment] == 0:
            continue
        count = state.counts[vehicle]
        for choice in range(2):
            at = count if choice == 0 else draw_integer(rng, count + 1)
            if choice == 1 and at == count:
                continue
            here = problem.place[vehicle] if at == 0 else state.land[state.order[vehicle, at - 1]]
            onward = -1 if at == count else state.base[state.order[vehicle, at]]
            for base in range(bases):
                there = problem.transfer[here, base] + state.bias[vehicle, base]
                if problem.lands[vehicle, base] == 0 or there >= NEVER:
                    continue
                for land in range(bases):
                    if problem.lands[vehicle, land] == 0:
                        continue
                    more = there + problem.turnaround[land]
                    if onward >= 0:
                        more += problem.transfer[land, onward] - problem.transfer[here, onward]
                        if problem.transfer[land, onward] >= NEVER:
                            continue
                    for visit in range(2 * segment, 2 * segment + 2):
                        seconds = problem.out[vehicle, base, visit, 0] + problem.home[vehicle, visit, land, 0]
                        pct = problem.out[vehicle, base, visit, 1] + problem.home[vehicle, visit, land, 1]
                        worse = problem.swap + weigh_seconds(problem, state, vehicle, more + seconds, last)
                        if worse < best and pct <= problem.budget[vehicle] + TOLERANCE:
                            best, lasts, chosen, number, way = worse, more + seconds, vehicle, at, visit
                            begins, lands = base, land
    return best, lasts, chosen, number, way, begins, lands


@inner()
def enter_sortie(state: SortieState, vehicle: int, number: int, row: int) -> None:
    """Insert a row into a vehicle's sorties, before the current `number`-th one."""
    for later in range(state.counts[vehicle], number, -1):
        state.order[vehicle, later] = state.order[vehicle, later - 1]
    state.order[vehicle, number] = row
    state.counts[vehicle] += 1


@inner()
def put_segment(
    problem: SortieProblem, state: SortieState, memory: SortieWorkspace, segment: int, last: float, rng: RandomState
) -> bool:
    """Insert a segment where it costs least; return whether a position exists."""
    worse, seconds, row, position, visit = find_place_beside(problem, state, segment, last, rng)
    other, lasts, vehicle, number, way, base, land = find_own_sortie(problem, state, segment, last, rng)
    if row < 0 and vehicle < 0:
        return False
    if worse <= other:
        size = state.size[row]
        for later in range(size, position, -1):
            state.visits[row, later] = state.visits[row, later - 1]
        state.visits[row, position] = visit
        state.size[row] = size + 1
        vehicle = state.owner[row]
    else:
        seconds = lasts
        row = 0
        while state.size[row] > 0:
            row += 1
        state.size[row] = 1
        state.visits[row, 0] = way
        state.owner[row], state.base[row], state.land[row] = vehicle, base, land
        enter_sortie(state, vehicle, number, row)
    state.where[segment] = row
    measure_row(problem, state, row)
    set_row_figures(problem, state, row)
    state.ends[vehicle] += seconds
    memory.touched[vehicle] = 1
    return True


@kernel()
def put_all_segments(
    problem: SortieProblem,
    state: SortieState,
    memory: SortieWorkspace,
    segments: Ints,
    count: int,
    rng: RandomState,
) -> int:
    """Insert segments into sorties one after the other; return how many had no position."""
    left = 0
    for number in range(count):
        last = 0.0
        for vehicle in range(len(state.ends)):
            last = max(last, state.ends[vehicle])
        if not put_segment(problem, state, memory, segments[number], last, rng):
            left += 1
    return left


@kernel()
def choose_bases_of_touched(problem: SortieProblem, state: SortieState, memory: SortieWorkspace) -> bool:
    """Choose bases for all touched vehicles; return whether each has a path."""
    for vehicle in range(len(state.counts)):
        if memory.touched[vehicle] == 1 and not choose_bases(problem, state, memory, vehicle):
            return False
    return True


@kernel()
def measure_given_sorties(problem: SortieProblem, state: SortieState, memory: SortieWorkspace) -> bool:
    """Set the figures of given sorties and choose their bases; return whether each vehicle may and can fly its own."""
    for vehicle in range(len(state.counts)):
        for number in range(state.counts[vehicle]):
            row = state.order[vehicle, number]
            if not may_fly_visits(problem, state, vehicle, row, 0, state.size[row]):
                return False
            measure_row(problem, state, row)
        if not choose_bases(problem, state, memory, vehicle):
            return False
    return True
