"""Where a segment fits best: one at a time, or all that are open by regret."""

from __future__ import annotations

import math

import numpy as np

from planner.kernels.arrays import Floats, Ints, Problem, RandomState, SearchWorkspace, State, Weights
from planner.kernels.compiled import inner, kernel
from planner.kernels.random_numbers import draw_integer, draw_uniform
from planner.kernels.tours import insert

NEVER = 2**40
"""More places than any route has."""


@inner(inline=True)
def draw_blink_gap(blink: float, rng: RandomState) -> int:
    """Return how many places are seen before the next one that is overlooked: one draw instead of one a place."""
    if blink <= 0.0:
        return NEVER
    return int(math.log(1.0 - draw_uniform(rng)) / math.log(1.0 - blink))


@kernel(inline=True)
def find_cheapest_place(
    problem: Problem, state: State, route: int, segment: int, blink: float, rng: RandomState
) -> tuple[float, int, int]:
    """Return (added energy, position, visit) of the cheapest place for a segment in a route.

    Each position is overlooked with probability ``blink`` < 1; (inf, 0, 0) if all were.
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
    """Return ``base`` to a whole power of at least 1, by squaring: some times faster than the general power."""
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
    """Return whether a route is empty as its vehicle's twin's is: whatever is put here can be put there."""
    twin = problem.twin[route]
    return bool(twin >= 0 and state.lengths[route] == 0 and state.lengths[twin] == 0)


@inner(inline=True)
def objective_increase(
    problem: Problem, weights: Weights, state: State, route: int, added: float, peak: float
) -> float:
    """Return what the objective gains when a route's load grows by ``added``; ``peak`` is the largest load now."""
    load = state.loads[route]
    gain = weights.total * added
    over = load + added - problem.budget[route]
    if over > 0.0:
        gain += weights.excess * min(added, over)
    if weights.peak > 0.0:
        gain += weights.peak * max(0.0, load + added - peak)
    if weights.norm > 0.0:
        # The sum of powers instead of its root: the same order among routes, and no need of the other loads.
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
    """Insert a segment where the objective gains least, budgets and slack permitting; return the route, or -1.

    Routes that are not ``touched`` are as they were when the memory's versions were counted; the cheapest place in
    one of them is looked up if it was looked for before, and overlooked with probability ``blink`` as a whole.
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
    """Sort ``pending`` by its ``keys``, at least as many, which are sorted with it."""
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
    """Insert ``segments`` (m,) int64, first those that would lose most by waiting, as far as budgets allow."""
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
            # With one route left the prize is at stake: it comes before any ordinary regret.
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
