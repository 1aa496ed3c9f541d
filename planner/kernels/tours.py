"""Operations on routes: their energy, changes to them, removal of visits, and the best position for a segment.

The random state is a single number held by the caller (xorshift64, Marsaglia 2003). Only shifts and xors are used: the
same bits with and without compilation, and no overflow warnings.

Visits are removed in strings of neighbours from routes that pass near one place: the removals of 'Slack Induction by
String Removals' (Christiaens, Vanden Berghe, Transportation Science 54(2) 2020), with its parameters: about ten visits
per iteration, strings of at most ten, half of them with a preserved middle.
"""

from __future__ import annotations

import math

import numpy as np

from planner.kernels.arrays import Floats, Ints, IntTable, Problem, RandomState, SearchWorkspace, State, Weights
from planner.kernels.compiling import inner, kernel


@kernel()
def measure(problem: Problem, state: State, route: int) -> None:
    """Set the legs and the load of a route from its visits, and the owner of their segments."""
    length = state.lengths[route]
    legs = state.legs[route]
    visits = state.visits[route]
    if length == 0:
        legs[0] = problem.idle[route]
        state.loads[route] = legs[0]
        return
    move = problem.move[problem.profile[route]]
    legs[0] = problem.start[route, visits[0]]
    load = legs[0]
    state.route_of[visits[0] >> 1] = route
    for position in range(1, length):
        legs[position] = problem.consumption[route] * move[visits[position - 1], visits[position]]
        load += legs[position]
        state.route_of[visits[position] >> 1] = route
    legs[length] = problem.home[route, visits[length - 1]]
    state.loads[route] = load + legs[length]


@kernel()
def insert(problem: Problem, state: State, route: int, position: int, visit: int) -> None:
    """Insert a visit into a route and update legs and load."""
    length = state.lengths[route]
    visits = state.visits[route]
    legs = state.legs[route]
    consumption = problem.consumption[route]
    move = problem.move[problem.profile[route]]
    before = legs[position]
    for place in range(length, position, -1):
        visits[place] = visits[place - 1]
        legs[place + 1] = legs[place]
    visits[position] = visit
    if position == 0:
        legs[0] = problem.start[route, visit]
    else:
        legs[position] = consumption * move[visits[position - 1], visit]
    if position == length:
        legs[position + 1] = problem.home[route, visit]
    else:
        legs[position + 1] = consumption * move[visit, visits[position + 1]]
    state.lengths[route] = length + 1
    state.loads[route] += legs[position] + legs[position + 1] - before
    state.route_of[visit >> 1] = route


@kernel()
def copy_route(source: State, target: State, route: int) -> None:
    """Copy one route; the caller copies ``route_of``."""
    length = source.lengths[route]
    target.lengths[route] = length
    target.loads[route] = source.loads[route]
    for position in range(length):
        target.visits[route, position] = source.visits[route, position]
        target.legs[route, position] = source.legs[route, position]
    target.legs[route, length] = source.legs[route, length]


@inner()
def copy_owners(source: State, target: State) -> None:
    """Copy the owner of every segment."""
    for segment in range(len(source.route_of)):
        target.route_of[segment] = source.route_of[segment]


@kernel()
def copy_all(source: State, target: State) -> None:
    """Copy all routes."""
    for route in range(len(source.lengths)):
        copy_route(source, target, route)
    copy_owners(source, target)


@inner()
def total_excess(problem: Problem, state: State) -> float:
    """Return the total energy by which routes with a visit exceed their budgets."""
    total = 0.0
    for route in range(len(state.lengths)):
        if state.lengths[route] > 0:
            total += max(0.0, state.loads[route] - problem.budget[route])
    return total


@kernel()
def orient_visits(problem: Problem, state: State, route: int, came_from: IntTable) -> None:
    """Set the optimal direction of each visit in a route; the order is kept.

    A two-state dynamic program (Vidal 2017, doi 10.1287/opre.2017.1595). ``came_from`` is (n, 2) int64 of work space.
    """
    length = state.lengths[route]
    if length == 0:
        return
    visits = state.visits[route]
    consumption = problem.consumption[route]
    move = problem.move[problem.profile[route]]
    first = visits[0] & ~1
    forward = problem.start[route, first]
    backward = problem.start[route, first + 1]
    for position in range(1, length):
        before = visits[position - 1] & ~1
        visit = visits[position] & ~1
        forward_forward = forward + consumption * move[before, visit]
        backward_forward = backward + consumption * move[before + 1, visit]
        forward_backward = forward + consumption * move[before, visit + 1]
        backward_backward = backward + consumption * move[before + 1, visit + 1]
        came_from[position, 0] = int(backward_forward < forward_forward)
        came_from[position, 1] = int(backward_backward < forward_backward)
        forward = min(forward_forward, backward_forward)
        backward = min(forward_backward, backward_backward)
    last = visits[length - 1] & ~1
    forward += problem.home[route, last]
    backward += problem.home[route, last + 1]
    if min(forward, backward) >= state.loads[route]:
        return
    direction = int(backward < forward)
    for position in range(length - 1, -1, -1):
        visits[position] = (visits[position] & ~1) + direction
        if position > 0:
            direction = came_from[position, direction]
    measure(problem, state, route)


@kernel(inline=True)
def draw_uniform(rng: RandomState) -> float:
    """Return a number in [0, 1); ``rng`` is (1,) uint64 and non-zero."""
    x = rng[0]
    x ^= x << np.uint64(13)
    x ^= x >> np.uint64(7)
    x ^= x << np.uint64(17)
    rng[0] = x
    return float(x >> np.uint64(11)) * 2.0**-53


@kernel(inline=True)
def draw_integer(rng: RandomState, limit: int) -> int:
    """Return an integer in [0, limit)."""
    return int(draw_uniform(rng) * limit)


@inner()
def cut_visits(
    state: State, route: int, begin: int, end: int, spare_begin: int, spare_end: int, removed: Ints, count: int
) -> int:
    """Remove visits [begin, end) of a route but not [spare_begin, spare_end); return the new count of ``removed``.

    Legs and load are not updated: call ``measure`` afterwards.
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
def find_position(visits: Ints, segment: int) -> int:
    """Return the position of a segment's visit; it must be in ``visits``."""
    position = 0
    while visits[position] >> 1 != segment:
        position += 1
    return position


@inner()
def reverse_visits(visits: Ints, begin: int, end: int) -> None:
    """Reverse visits [begin, end); the caller measures the route again."""
    while begin < end:
        end -= 1
        visits[begin], visits[end] = visits[end] ^ 1, visits[begin] ^ 1
        begin += 1


@inner()
def remove_strings(
    problem: Problem, state: State, removed: Ints, touched: Ints, seed: int,
    mean_removed: float, longest: float, rng: RandomState,
) -> int:  # fmt: skip
    """Remove strings from routes that come near segment ``seed``.

    Args:
        problem: the instance.
        state: changed; the routes that lose visits are measured again.
        removed: (n,) int64, its first entries are set to the removed segments.
        touched: (k,) int64, set to 1 for routes that lose visits.
        seed: the first segment.
        mean_removed: mean number of removals.
        longest: maximum string length.
        rng: random state.

    Returns:
        Number of removed segments.
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
        position = find_position(state.visits[route], segment)
        lowest = max(0, position - span + 1)
        highest = min(position, length - span)
        begin = lowest + draw_integer(rng, highest - lowest + 1)
        spare_begin = begin + 1 + draw_integer(rng, max(1, size - 1))
        count = cut_visits(state, route, begin, begin + span, spare_begin, spare_begin + spared, removed, count)
        touched[route] = 1
        measure(problem, state, route)
        strings -= 1
    return count


NEVER = 2**40
"""A number larger than the positions of any route."""


@inner(inline=True)
def draw_blink_gap(blink: float, rng: RandomState) -> int:
    """Return the number of positions before the next skipped one: one draw instead of one per position."""
    if blink <= 0.0:
        return NEVER
    return int(math.log(1.0 - draw_uniform(rng)) / math.log(1.0 - blink))


@kernel(inline=True)
def find_cheapest_place(
    problem: Problem, state: State, route: int, segment: int, blink: float, rng: RandomState
) -> tuple[float, int, int]:
    """Return (added energy, position, visit) of the cheapest position for a segment in a route.

    Each position is skipped with probability ``blink`` < 1; (inf, 0, 0) if all were.
    """
    length = state.lengths[route]
    consumption = problem.consumption[route]
    profile = problem.profile[route]
    forward = 2 * segment
    backward = forward + 1
    best = np.inf
    best_position = 0
    best_visit = 0
    hidden = draw_blink_gap(blink, rng)
    ahead = problem.start[route, forward]
    astern = problem.start[route, backward]
    for position in range(length + 1):
        added = ahead - state.legs[route, position]
        added_backward = astern - state.legs[route, position]
        if position == length:
            added += problem.home[route, forward]
            added_backward += problem.home[route, backward]
        else:
            after = state.visits[route, position]
            added += consumption * problem.move[profile, forward, after]
            added_backward += consumption * problem.move[profile, backward, after]
            ahead = consumption * problem.move_into[profile, forward, after]
            astern = consumption * problem.move_into[profile, backward, after]
        if position == hidden:
            hidden += 1 + draw_blink_gap(blink, rng)
            continue
        if added < best:
            best = added
            best_position = position
            best_visit = forward
        if added_backward < best:
            best = added_backward
            best_position = position
            best_visit = backward
    return best, best_position, best_visit


@inner(inline=True)
def max_load(loads: Floats) -> float:
    """Return the largest load."""
    peak = float(loads[0])
    for route in range(1, len(loads)):
        peak = max(peak, loads[route])
    return peak


@inner(inline=True)
def raise_to_power(base: float, power: float) -> float:
    """Return ``base`` to a whole power of at least 1, by squaring: several times as fast as the general power."""
    result = 1.0
    exponent = int(power)
    while exponent > 0:
        if exponent & 1:
            result *= base
        base *= base
        exponent >>= 1
    return result


@inner(inline=True)
def is_redundant_route(problem: Problem, state: State, route: int) -> bool:
    """Return whether a route and its twin's are both empty: an insertion here is equivalent to one there."""
    twin = problem.twin[route]
    return bool(twin >= 0 and state.lengths[route] == 0 and state.lengths[twin] == 0)


@inner(inline=True)
def objective_increase(
    problem: Problem, weights: Weights, state: State, route: int, added: float, peak: float
) -> float:
    """Return the objective's increase when a route's load grows by ``added``; ``peak`` is the largest load now."""
    load = state.loads[route]
    gain = weights.total * added
    over = load + added - problem.budget[route]
    if over > 0.0:
        gain += weights.excess * min(added, over)
    if weights.peak > 0.0:
        gain += weights.peak * max(0.0, load + added - peak)
    if weights.norm > 0.0:
        # The sum of powers instead of its root: the same order among routes, without the other loads.
        powers = raise_to_power((load + added) / weights.scale, weights.power) - raise_to_power(
            load / weights.scale, weights.power
        )
        gain += weights.norm * weights.scale / weights.power * powers
    if state.lengths[route] == 0:
        gain -= weights.empty
    return gain


@inner(inline=True)
def insert_cheapest(
    problem: Problem, weights: Weights, state: State, segment: int, blink: float, touched: Ints,
    memory: SearchWorkspace,
    rng: RandomState,
) -> int:  # fmt: skip
    """Insert a segment where the objective grows least, within budgets and slack; return the route, or -1.

    Routes that are not ``touched`` are unchanged since the versions in ``memory``: their cheapest position is read from
    it if known, and each of these routes is skipped as a whole with probability ``blink``.
    """
    peak = max_load(state.loads) if weights.peak > 0.0 else 0.0
    best = np.inf
    best_route = -1
    best_position = 0
    best_visit = 0
    for route in range(len(state.lengths)):
        if is_redundant_route(problem, state, route):
            continue
        known = touched[route] == 0
        if known and draw_uniform(rng) < blink:
            continue
        if known and memory.version[segment, route] == memory.versions[route]:
            added = memory.added[segment, route]
            position = memory.place[segment, route] >> 1
            visit = 2 * segment + (memory.place[segment, route] & 1)
        else:
            added, position, visit = find_cheapest_place(problem, state, route, segment, 0.0 if known else blink, rng)
            if known:
                memory.version[segment, route] = memory.versions[route]
                memory.added[segment, route] = added
                memory.place[segment, route] = 2 * position + (visit & 1)
        if state.loads[route] + added > problem.budget[route] * (1.0 + weights.slack):
            continue
        gain = objective_increase(problem, weights, state, route, added, peak)
        if gain < best:
            best = gain
            best_route = route
            best_position = position
            best_visit = visit
    if best_route >= 0:
        insert(problem, state, best_route, best_position, best_visit)
    return best_route


@inner()
def sort_by_key(pending: Ints, keys: Floats) -> None:
    """Sort ``pending`` by its ``keys``, at least as long; sorts ``keys`` too."""
    for place in range(1, len(pending)):
        segment = pending[place]
        key = keys[place]
        hole = place
        while hole > 0 and keys[hole - 1] > key:
            keys[hole] = keys[hole - 1]
            pending[hole] = pending[hole - 1]
            hole -= 1
        keys[hole] = key
        pending[hole] = segment


@inner()
def sort_pending(
    problem: Problem, pending: Ints, keys: Floats, random: int, valuable: int, far: int, near: int, rng: RandomState
) -> None:
    """Sort ``pending`` for insertion: at random, valuable first, far first or near first, with these shares.

    ``keys`` is work space, at least as long.
    """
    kind = draw_integer(rng, random + valuable + far + near)
    for place in range(len(pending)):
        segment = pending[place]
        if kind < random:
            keys[place] = draw_uniform(rng)
        elif kind < random + valuable:
            keys[place] = -problem.prize[segment]
        elif kind < random + valuable + far:
            keys[place] = -problem.effort[segment]
        else:
            keys[place] = problem.effort[segment]
    sort_by_key(pending, keys)


@kernel(counted=True)
def insert_by_regret(problem: Problem, weights: Weights, state: State, segments: Ints, rng: RandomState) -> None:
    """Insert ``segments`` (m,) int64, largest regret first, as far as budgets allow."""
    routes = len(state.lengths)
    added = np.empty((len(segments), routes))
    for place in range(len(segments)):
        for route in range(routes):
            added[place, route] = find_cheapest_place(problem, state, route, segments[place], 0.0, rng)[0]
    waiting = np.ones(len(segments), dtype=np.bool_)
    while True:
        peak = max_load(state.loads)
        chosen = -1
        chosen_route = -1
        largest = -np.inf
        for place in range(len(segments)):
            if not waiting[place]:
                continue
            best = np.inf
            second = np.inf
            best_route = -1
            for route in range(routes):
                if state.loads[route] + added[place, route] > problem.budget[route] or is_redundant_route(
                    problem, state, route
                ):
                    continue
                gain = objective_increase(problem, weights, state, route, added[place, route], peak)
                if gain < best:
                    second = best
                    best = gain
                    best_route = route
                elif gain < second:
                    second = gain
            if best_route < 0:
                continue
            # With one route left the prize is at stake, which exceeds any ordinary regret.
            regret = min(second, weights.prize * problem.prize[segments[place]]) - best
            if regret > largest:
                largest = regret
                chosen = place
                chosen_route = best_route
        if chosen < 0:
            return
        place_found = find_cheapest_place(problem, state, chosen_route, segments[chosen], 0.0, rng)
        insert(problem, state, chosen_route, place_found[1], place_found[2])
        waiting[chosen] = False
        for place in range(len(segments)):
            if waiting[place]:
                added[place, chosen_route] = find_cheapest_place(
                    problem, state, chosen_route, segments[place], 0.0, rng
                )[0]
