"""The search for days of sorties: ruin and recreate with annealing; times and bases are recomputed for each trial."""

from __future__ import annotations

import math

from planner.kernels.arrays import Floats, RandomState
from planner.kernels.compiling import inner, kernel
from planner.kernels.sortie_schedule import (
    SortieProblem,
    SortieState,
    SortieWorkspace,
    choose_bases_of_touched,
    enter_sortie,
    may_fly_visits,
    measure_row,
    put_all_segments,
    schedule_sorties,
    set_row_figures,
)
from planner.kernels.tours import draw_integer, draw_uniform, find_position, reverse_visits, sort_by_key

MOST_REMOVED = 12
"""Maximum number of segments removed at a time, whole sorties excepted."""
SAME = 1e-7
"""Tolerance for equal figures, seconds."""


@kernel()
def copy_sorties(source: SortieState, target: SortieState) -> None:
    """Copy ``source`` to ``target``."""
    for row in range(len(source.size)):
        if target.size[row] > 0 and source.size[row] == 0:
            target.size[row] = 0
    for vehicle in range(len(source.counts)):
        target.counts[vehicle] = source.counts[vehicle]
        target.ends[vehicle] = source.ends[vehicle]
        for base in range(source.bias.shape[1]):
            target.bias[vehicle, base] = source.bias[vehicle, base]
        for number in range(source.counts[vehicle]):
            row = source.order[vehicle, number]
            target.order[vehicle, number] = row
            target.size[row] = source.size[row]
            target.owner[row] = source.owner[row]
            target.base[row] = source.base[row]
            target.land[row] = source.land[row]
            target.start[row] = source.start[row]
            for figure in range(2):
                target.between[row, figure] = source.between[row, figure]
                target.whole[row, figure] = source.whole[row, figure]
            for position in range(source.size[row]):
                target.visits[row, position] = source.visits[row, position]
    for segment in range(len(source.where)):
        target.where[segment] = source.where[segment]
    for entry in range(len(source.sums)):
        target.sums[entry] = source.sums[entry]


@inner()
def cut_sortie(
    problem: SortieProblem, state: SortieState, memory: SortieWorkspace, row: int, begin: int, end: int, count: int
) -> int:
    """Remove positions [begin, end) of a sortie, and the sortie if it becomes empty; return the new count."""
    vehicle, size = state.owner[row], state.size[row]
    for position in range(begin, end):
        segment = state.visits[row, position] >> 1
        memory.removed[count] = segment
        state.where[segment] = -1
        count += 1
    for position in range(end, size):
        state.visits[row, position - (end - begin)] = state.visits[row, position]
    state.size[row] = size - (end - begin)
    before = state.whole[row, 0]
    memory.touched[vehicle] = 1
    if state.size[row] == 0:
        number = 0
        while state.order[vehicle, number] != row:
            number += 1
        for later in range(number + 1, state.counts[vehicle]):
            state.order[vehicle, later - 1] = state.order[vehicle, later]
        state.counts[vehicle] -= 1
        state.ends[vehicle] -= before + problem.turnaround[state.land[row]]
        return count
    measure_row(problem, state, row)
    set_row_figures(problem, state, row)
    state.ends[vehicle] += state.whole[row, 0] - before
    return count


@inner()
def ruin_sorties(problem: SortieProblem, state: SortieState, memory: SortieWorkspace, rng: RandomState) -> int:
    """Remove segments near a random one: single ones, strings, or a whole sortie; return how many."""
    segments = len(state.where)
    wanted = 1 + draw_integer(rng, min(MOST_REMOVED, segments))
    kind = draw_uniform(rng)
    seed = draw_integer(rng, segments)
    count = 0
    for rank in range(-1, problem.near.shape[1]):
        if count >= wanted:
            break
        if rank >= 0 and draw_uniform(rng) < 0.2:
            continue
        segment = seed if rank < 0 else problem.near[seed, rank]
        row = state.where[segment]
        if row < 0:
            continue
        position = find_position(state.visits[row], segment)
        size = state.size[row]
        if kind < 0.35:
            count = cut_sortie(problem, state, memory, row, position, position + 1, count)
        elif kind < 0.9:
            string = min(1 + draw_integer(rng, 6), size)
            begin = max(0, min(position - draw_integer(rng, string), size - string))
            count = cut_sortie(problem, state, memory, row, begin, begin + string, count)
        else:
            count = cut_sortie(problem, state, memory, row, 0, size, count)
    return count


@inner()
def arrange_segments(problem: SortieProblem, memory: SortieWorkspace, count: int, rng: RandomState) -> None:
    """Order the removed segments: at random, farthest from the bases first, or nearest first."""
    removed, keys = memory.removed, memory.keys
    kind = draw_uniform(rng)
    for number in range(count):
        keys[number] = draw_uniform(rng)
        if kind > 0.5:
            far = 1e18
            for base in range(problem.out.shape[1]):
                far = min(far, problem.out[0, base, 2 * removed[number], 0])
            keys[number] = -far if kind < 0.8 else far
    sort_by_key(removed[:count], keys)


@inner()
def reverse_part(problem: SortieProblem, state: SortieState, memory: SortieWorkspace, rng: RandomState) -> None:
    """Reverse a part of a sortie."""
    vehicle = draw_integer(rng, len(state.counts))
    if state.counts[vehicle] == 0:
        return
    row = state.order[vehicle, draw_integer(rng, state.counts[vehicle])]
    low, high = draw_integer(rng, state.size[row]), draw_integer(rng, state.size[row])
    reverse_visits(state.visits[row], min(low, high), max(low, high) + 1)
    measure_row(problem, state, row)
    memory.touched[vehicle] = 1


@inner()
def move_sortie(problem: SortieProblem, state: SortieState, memory: SortieWorkspace, rng: RandomState) -> bool:
    """Move a whole sortie in the order of its vehicle or to another vehicle; return whether it may fly it."""
    giver, taker = draw_integer(rng, len(state.counts)), draw_integer(rng, len(state.counts))
    if state.counts[giver] == 0:
        return False
    number = draw_integer(rng, state.counts[giver])
    row = state.order[giver, number]
    if not may_fly_visits(problem, state, taker, row, 0, state.size[row]):
        return False
    for later in range(number + 1, state.counts[giver]):
        state.order[giver, later - 1] = state.order[giver, later]
    state.counts[giver] -= 1
    enter_sortie(state, taker, draw_integer(rng, state.counts[taker] + 1), row)
    state.owner[row] = taker
    measure_row(problem, state, row)
    memory.touched[giver] = 1
    memory.touched[taker] = 1
    return True


@inner()
def move_visits(state: SortieState, row: int, begin: int, end: int, other: int, to: int, turned: bool) -> None:
    """Move positions [begin, end) of a sortie into another before position ``to``, reversed if ``turned``."""
    length = end - begin
    for position in range(state.size[other] - 1, to - 1, -1):
        state.visits[other, position + length] = state.visits[other, position]
    for number in range(length):
        visit = state.visits[row, end - 1 - number] ^ 1 if turned else state.visits[row, begin + number]
        state.visits[other, to + number] = visit
        state.where[visit >> 1] = other
    for position in range(end, state.size[row]):
        state.visits[row, position - length] = state.visits[row, position]
    state.size[other] += length
    state.size[row] -= length


@inner()
def split_sortie(problem: SortieProblem, state: SortieState, memory: SortieWorkspace, rng: RandomState) -> bool:
    """Split the first or last part of a sortie into a new one of any vehicle; return whether it may fly it.

    Segments that move one at a time would never leave: the first one would pay for the whole flight there.
    """
    giver, taker = draw_integer(rng, len(state.counts)), draw_integer(rng, len(state.counts))
    if state.counts[giver] == 0:
        return False
    row = state.order[giver, draw_integer(rng, state.counts[giver])]
    size = state.size[row]
    if size < 2:
        return False
    at = 1 + draw_integer(rng, size - 1)
    begin, end = (at, size) if draw_uniform(rng) < 0.5 else (0, at)
    if not may_fly_visits(problem, state, taker, row, begin, end):
        return False
    new = 0
    while state.size[new] > 0:
        new += 1
    state.owner[new] = taker
    move_visits(state, row, begin, end, new, 0, False)
    enter_sortie(state, taker, draw_integer(rng, state.counts[taker] + 1), new)
    measure_row(problem, state, row)
    measure_row(problem, state, new)
    memory.touched[giver] = 1
    memory.touched[taker] = 1
    return True


@inner()
def move_end(problem: SortieProblem, state: SortieState, memory: SortieWorkspace, rng: RandomState) -> bool:
    """Move the end of a sortie next to a near segment of another one in one step; return whether that is allowed."""
    segment = draw_integer(rng, len(state.where))
    near = problem.near[segment, draw_integer(rng, problem.near.shape[1])]
    row, other = state.where[segment], state.where[near]
    if row < 0 or other < 0 or row == other:
        return False
    taker = state.owner[other]
    at = find_position(state.visits[row], segment)
    to = find_position(state.visits[other], near) + draw_integer(rng, 2)
    begin, end = (at, state.size[row]) if draw_uniform(rng) < 0.5 else (0, at + 1)
    length = end - begin
    if length == state.size[row] or state.size[other] + length > state.visits.shape[1]:
        return False
    if not may_fly_visits(problem, state, taker, row, begin, end):
        return False
    move_visits(state, row, begin, end, other, to, draw_uniform(rng) < 0.5)
    measure_row(problem, state, row)
    measure_row(problem, state, other)
    memory.touched[state.owner[row]] = 1
    memory.touched[taker] = 1
    return True


@inner()
def toggle_shunned_base(state: SortieState, memory: SortieWorkspace, most: float, rng: RandomState) -> None:
    """Add or remove a vehicle's penalty for a base."""
    vehicle, base = draw_integer(rng, len(state.counts)), draw_integer(rng, state.bias.shape[1])
    state.bias[vehicle, base] = 0.0 if draw_uniform(rng) < 0.5 else most * draw_uniform(rng)
    memory.touched[vehicle] = 1


@kernel()
def has_better_sums(problem: SortieProblem, sums: Floats, other: Floats) -> bool:
    """Return whether figures are better than others: first fewer segments without a day, then the objective."""
    for rank in range(5):
        entry = 0 if rank == 0 else (1 + problem.objective if rank == 1 else rank - 1)
        if abs(sums[entry] - other[entry]) > SAME:
            return bool(sums[entry] < other[entry])
    return False


@kernel()
def anneal_sorties(
    problem: SortieProblem, current: SortieState, trial: SortieState, best: SortieState, temperature: Floats,
    cooling: float, most: float, iterations: int, rng: RandomState, memory: SortieWorkspace,
) -> int:  # fmt: skip
    """Try ``iterations`` changes of ``current``; keep the best in ``best``.

    ``trial`` equals ``current`` before and after; ``most`` is the maximum sortie length. Returns the last iteration
    that found a new best, counted from 1; 0 if none did.
    """
    fleet = len(current.counts)
    improved = 0
    for iteration in range(iterations):
        kind = draw_uniform(rng)
        complete = True
        if kind < 0.06:
            reverse_part(problem, trial, memory, rng)
        elif kind < 0.16:
            complete = move_sortie(problem, trial, memory, rng)
        elif kind < 0.2:
            toggle_shunned_base(trial, memory, most, rng)
        elif kind < 0.24:
            complete = split_sortie(problem, trial, memory, rng)
        elif kind < 0.34:
            complete = move_end(problem, trial, memory, rng)
        else:
            count = ruin_sorties(problem, trial, memory, rng)
            arrange_segments(problem, memory, count, rng)
            complete = put_all_segments(problem, trial, memory, memory.removed, count, rng) == 0
        accepted = complete and choose_bases_of_touched(problem, trial, memory)
        if accepted:
            schedule_sorties(problem, trial, memory)
            limit = current.sums[4] - temperature[0] * math.log(max(draw_uniform(rng), 1e-300))
            accepted = trial.sums[4] < limit
        for vehicle in range(fleet):
            memory.touched[vehicle] = 0
        if accepted:
            copy_sorties(trial, current)
            if has_better_sums(problem, current.sums, best.sums):
                improved = iteration + 1
                copy_sorties(current, best)
        else:
            copy_sorties(current, trial)
        temperature[0] *= cooling
    return improved
