"""Taking visits out: strings of neighbouring visits from routes that pass near one place.

The removals of 'Slack Induction by String Removals' (Christiaens, Vanden Berghe, Transportation Science 54(2) 2020),
with its parameters: about ten visits an iteration, strings of at most ten, half of them with a preserved middle.
"""

from __future__ import annotations

from planner.kernels.arrays import Ints, Problem, RandomState, State
from planner.kernels.compiled import inner
from planner.kernels.random_numbers import draw_integer, draw_uniform
from planner.kernels.tours import measure


@inner()
def cut_visits(
    state: State, route: int, begin: int, end: int, spare_begin: int, spare_end: int, removed: Ints, count: int
) -> int:
    """Remove visits [begin, end) of a route but not [spare_begin, spare_end); return the new count of ``removed``.

    Legs and load are left as they were: ``measure`` follows.
    """
    visits = state.visits[route]
    kept = begin
    for position in range(begin, state.lengths[route]):
        visit = visits[position]
        if position >= end or spare_begin <= position < spare_end:
            visits[kept] = visit
            kept += 1
        else:
            state.route_of[visit >> 1] = -1
            removed[count] = visit >> 1
            count += 1
    state.lengths[route] = kept
    return count


@inner()
def position_of(state: State, route: int, segment: int) -> int:
    """Return where a route visits a segment that it does visit."""
    visits = state.visits[route]
    position = 0
    while visits[position] >> 1 != segment:
        position += 1
    return position


@inner()
def remove_strings(
    problem: Problem, state: State, removed: Ints, touched: Ints, seed: int,
    mean_removed: float, longest: float, rng: RandomState,
) -> int:  # fmt: skip
    """Remove strings from routes that come near segment ``seed``.

    Args:
        problem: the instance.
        state: changed; the routes that lose visits are measured again.
        removed: (n,) int64, its first entries are set to the segments taken out.
        touched: (k,) int64, set to 1 for routes that lose visits.
        seed: where to begin.
        mean_removed: how many to remove on average.
        longest: no string is longer.
        rng: random state.

    Returns:
        How many segments were removed.
    """
    visited = 0
    used = 0
    for route in range(len(state.lengths)):
        visited += state.lengths[route]
        used += int(state.lengths[route] > 0)
    if visited == 0:
        return 0
    limit = min(longest, visited / used)
    strings = int(1.0 + draw_uniform(rng) * (4.0 * mean_removed / (1.0 + limit) - 1.0))
    count = 0
    for rank in range(problem.near.shape[1]):
        if strings <= 0:
            break
        segment = problem.near[seed, rank]
        route = state.route_of[segment]
        if route < 0 or touched[route] == 1:
            continue
        length = state.lengths[route]
        size = int(1.0 + draw_uniform(rng) * min(float(length), limit))
        size = min(size, length)
        spared = 0
        if 1 < size < length and draw_uniform(rng) < 0.5:
            spared = 1
            while size + spared < length and draw_uniform(rng) < 0.01:
                spared += 1
        span = size + spared
        position = position_of(state, route, segment)
        lowest = max(0, position - span + 1)
        highest = min(position, length - span)
        begin = lowest + draw_integer(rng, highest - lowest + 1)
        spare_begin = begin + 1 + draw_integer(rng, max(1, size - 1))
        count = cut_visits(state, route, begin, begin + span, spare_begin, spare_begin + spared, removed, count)
        touched[route] = 1
        measure(problem, state, route)
        strings -= 1
    return count
