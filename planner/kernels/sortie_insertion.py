"""Putting segments into sorties where they cost least: beside a near one, or as a sortie of their own."""

from __future__ import annotations

from planner.kernels.arrays import Ints, RandomState
from planner.kernels.compiled import inner, kernel
from planner.kernels.random_numbers import draw_integer, draw_uniform
from planner.kernels.sortie_schedule import (
    NEVER,
    TOLERANCE,
    SortieProblem,
    SortieState,
    SortieWorkspace,
    choose_bases,
    measure_row,
    set_row_figures,
)

BLINK = 0.01
"""Share of places that are overlooked (Christiaens, Vanden Berghe 2020)."""


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
    """Return what seconds of a vehicle's weigh."""
    return float(problem.finish * max(0.0, state.ends[vehicle] + seconds - last) + (problem.flight + 1e-6) * seconds)


@inner()
def find_place_beside(
    problem: SortieProblem, state: SortieState, segment: int, last: float, rng: RandomState
) -> tuple[float, float, int, int, int]:
    """Return the least weight of a place beside a near segment, its seconds, the row, the position, the visit."""
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
        position = 0
        while state.visits[row, position] >> 1 != other:
            position += 1
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
    """Return the least weight of a sortie of its own: seconds, vehicle, number, visit, base, where it lands."""
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
    """Make a row one of a vehicle's sorties, before the one that is its `number`-th now."""
    for later in range(state.counts[vehicle], number, -1):
        state.order[vehicle, later] = state.order[vehicle, later - 1]
    state.order[vehicle, number] = row
    state.counts[vehicle] += 1


@inner()
def put_segment(
    problem: SortieProblem, state: SortieState, memory: SortieWorkspace, segment: int, last: float, rng: RandomState
) -> bool:
    """Put a segment where it costs least; return whether there is a place."""
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
    """Put segments into sorties one after the other; return how many had no place."""
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
    """Choose bases for all vehicles that were touched; return whether each has a way."""
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
            for position in range(state.size[row]):
                if problem.able[vehicle, state.visits[row, position] >> 1] == 0:
                    return False
            measure_row(problem, state, row)
        if not choose_bases(problem, state, memory, vehicle):
            return False
    return True
