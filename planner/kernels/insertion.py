"""Where a segment fits best: one at a time, or all that are open by regret."""

from __future__ import annotations

import numba as nb
import numpy as np

from planner.kernels.arrays import (
    FLOATS,
    INTS,
    PROBLEM,
    RANDOM,
    STATE,
    WEIGHTS,
    FloatArray,
    IntArray,
    Problem,
    RandomState,
    State,
    Weights,
)
from planner.kernels.chance import uniform
from planner.kernels.tours import insert

_PLACE = nb.types.Tuple((nb.float64, nb.int64, nb.int64))


@nb.njit(_PLACE(PROBLEM, STATE, nb.int64, nb.int64, nb.float64, RANDOM), cache=True)
def cheapest_place(
    problem: Problem, state: State, route: int, segment: int, blink: float, rng: RandomState
) -> tuple[float, int, int]:
    """Return (added energy, position, visit) of the cheapest place for a segment in a route.

    Each place is overlooked with probability ``blink``; (inf, 0, 0) if all were.
    """
    length = state.lengths[route]
    visits = state.visits[route]
    legs = state.legs[route]
    consumption = problem.consumption[route]
    profile = problem.profile[route]
    best = np.inf
    best_position = 0
    best_visit = 0
    for visit in range(2 * segment, 2 * segment + 2):
        into = problem.move_into[profile, visit]
        out = problem.move[profile, visit]
        for position in range(length + 1):
            if blink > 0.0 and uniform(rng) < blink:
                continue
            if position == 0:
                added = problem.start[route, visit] - legs[0]
            else:
                added = consumption * into[visits[position - 1]] - legs[position]
            if position == length:
                added += problem.home[route, visit]
            else:
                added += consumption * out[visits[position]]
            if added < best:
                best = added
                best_position = position
                best_visit = visit
    return best, best_position, best_visit


@nb.njit(nb.float64(FLOATS), cache=True)
def peak_of(loads: FloatArray) -> float:
    """Return the largest load."""
    peak = float(loads[0])
    for route in range(1, len(loads)):
        peak = max(peak, loads[route])
    return peak


@nb.njit(nb.float64(PROBLEM, WEIGHTS, STATE, nb.int64, nb.float64, nb.float64), cache=True)
def increase(problem: Problem, weights: Weights, state: State, route: int, added: float, peak: float) -> float:
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
        powers = ((load + added) / weights.scale) ** weights.power - (load / weights.scale) ** weights.power
        gain += weights.norm * weights.scale / weights.power * powers
    if state.lengths[route] == 0:
        gain -= weights.empty
    return gain


@nb.njit(nb.int64(PROBLEM, WEIGHTS, STATE, nb.int64, nb.float64, RANDOM), cache=True)
def insert_cheapest(
    problem: Problem, weights: Weights, state: State, segment: int, blink: float, rng: RandomState
) -> int:
    """Insert a segment where the objective gains least, budgets and slack permitting; return the route, or -1."""
    peak = peak_of(state.loads)
    best = np.inf
    best_route = -1
    best_position = 0
    best_visit = 0
    for route in range(len(state.lengths)):
        added, position, visit = cheapest_place(problem, state, route, segment, blink, rng)
        if state.loads[route] + added > problem.budget[route] * (1.0 + weights.slack):
            continue
        gain = increase(problem, weights, state, route, added, peak)
        if gain < best:
            best = gain
            best_route = route
            best_position = position
            best_visit = visit
    if best_route >= 0:
        insert(problem, state, best_route, best_position, best_visit)
    return best_route


@nb.njit(nb.void(PROBLEM, WEIGHTS, STATE, INTS, RANDOM), cache=True)
def insert_by_regret(problem: Problem, weights: Weights, state: State, segments: IntArray, rng: RandomState) -> None:
    """Insert ``segments`` (m,) int64, first those that would lose most by waiting, as far as budgets allow."""
    routes = len(state.lengths)
    added = np.empty((len(segments), routes))
    for place in range(len(segments)):
        for route in range(routes):
            added[place, route] = cheapest_place(problem, state, route, segments[place], 0.0, rng)[0]
    waiting = np.ones(len(segments), dtype=np.bool_)
    while True:
        peak = peak_of(state.loads)
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
                if state.loads[route] + added[place, route] > problem.budget[route]:
                    continue
                gain = increase(problem, weights, state, route, added[place, route], peak)
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
        place_found = cheapest_place(problem, state, chosen_route, segments[chosen], 0.0, rng)
        insert(problem, state, chosen_route, place_found[1], place_found[2])
        waiting[chosen] = False
        for place in range(len(segments)):
            if waiting[place]:
                added[place, chosen_route] = cheapest_place(problem, state, chosen_route, segments[place], 0.0, rng)[0]
