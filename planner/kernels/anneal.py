"""The inside of the improvement loop: ruin, recreate, accept by simulated annealing, keep the best."""

from __future__ import annotations

import math

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
from planner.kernels.chance import below, uniform
from planner.kernels.insertion import insert_cheapest, peak_of
from planner.kernels.ruin import remove_strings
from planner.kernels.tours import copy_route, measure, orient


@nb.njit(nb.types.UniTuple(nb.float64, 2)(PROBLEM, STATE), cache=True)
def left_out(problem: Problem, state: State) -> tuple[float, float]:
    """Return the value and the prizes of the segments that no route visits."""
    value = 0.0
    prizes = 0.0
    for segment in range(len(state.route_of)):
        if state.route_of[segment] < 0:
            value += problem.value[segment]
            prizes += problem.prize[segment]
    return value, prizes


@nb.njit(nb.float64(PROBLEM, STATE), cache=True)
def excess(problem: Problem, state: State) -> float:
    """Return what routes with a visit spend beyond their budgets."""
    total = 0.0
    for route in range(len(state.lengths)):
        if state.lengths[route] > 0:
            total += max(0.0, state.loads[route] - problem.budget[route])
    return total


@nb.njit(nb.float64(PROBLEM, WEIGHTS, STATE), cache=True)
def objective(problem: Problem, weights: Weights, state: State) -> float:
    """Return the objective of the routes, without what is left out."""
    total = 0.0
    powers = 0.0
    empty = 0
    for route in range(len(state.lengths)):
        load = state.loads[route]
        total += load
        if weights.norm > 0.0:
            powers += (load / weights.scale) ** weights.power
        empty += int(state.lengths[route] == 0)
    value = weights.total * total + weights.empty * empty
    if weights.excess > 0.0:
        value += weights.excess * excess(problem, state)
    if weights.peak > 0.0:
        value += weights.peak * peak_of(state.loads)
    if weights.norm > 0.0:
        value += weights.norm * weights.scale * powers ** (1.0 / weights.power)
    return value


@nb.njit(nb.int64(STATE, INTS, RANDOM, nb.boolean), cache=True)
def choose_seed(state: State, waiting: IntArray, rng: RandomState, balance: bool) -> int:
    """Return the segment around which to ruin: often one that is left out, or one of the longest route."""
    if len(waiting) > 0 and uniform(rng) < 0.5:
        return int(waiting[below(rng, len(waiting))])
    if balance and uniform(rng) < 0.5:
        route = int(np.argmax(state.loads))
        if state.lengths[route] > 0:
            return int(state.visits[route, below(rng, state.lengths[route])] >> 1)
    return below(rng, len(state.route_of))


@nb.njit(nb.void(PROBLEM, INTS, FLOATS, RANDOM), cache=True)
def order_pending(problem: Problem, pending: IntArray, keys: FloatArray, rng: RandomState) -> None:
    """Sort ``pending`` for insertion: 4 in 11 at random, 4 valuable first, 2 far first, 1 near first.

    The shares are those of Christiaens and Vanden Berghe (2020); the value stands for their demand. ``keys`` is work
    space, at least as long.
    """
    kind = below(rng, 11)
    for place in range(len(pending)):
        segment = pending[place]
        if kind < 4:
            keys[place] = uniform(rng)
        elif kind < 8:
            keys[place] = -problem.prize[segment]
        elif kind < 10:
            keys[place] = -problem.effort[segment]
        else:
            keys[place] = problem.effort[segment]
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


@nb.njit(nb.int64(STATE, INTS, nb.int64, RANDOM), cache=True)
def gather_waiting(state: State, waiting: IntArray, most: int, rng: RandomState) -> int:
    """Set the first entries of ``waiting`` to at most ``most`` segments that are left out; return how many."""
    count = 0
    for segment in range(len(state.route_of)):
        if state.route_of[segment] < 0:
            waiting[count] = segment
            count += 1
    for place in range(min(count, most)):
        other = place + below(rng, count - place)
        waiting[place], waiting[other] = waiting[other], waiting[place]
    return min(count, most)


@nb.njit(nb.boolean(PROBLEM, WEIGHTS, STATE, STATE, FLOATS), cache=True)
def keep_best(problem: Problem, truth: Weights, trial: State, best: State, key: FloatArray) -> bool:
    """Copy ``trial`` to ``best`` if it is within the budgets and better; return whether it was.

    Better is: less value left out, then a lower ``truth``. ``key`` (2,) holds both of the best.
    """
    if excess(problem, trial) > 0.0:
        return False
    value = left_out(problem, trial)[0]
    cost = objective(problem, truth, trial)
    same_value = abs(value - key[0]) <= 1e-9 * (1.0 + key[0])
    if (same_value and cost < key[1] - 1e-9 * (1.0 + abs(key[1]))) or (not same_value and value < key[0]):
        key[0] = value
        key[1] = cost
        for route in range(len(trial.lengths)):
            copy_route(trial, best, route)
        best.route_of[:] = trial.route_of
        return True
    return False


@nb.njit(
    nb.int64(PROBLEM, WEIGHTS, WEIGHTS, STATE, STATE, STATE, FLOATS, FLOATS, nb.float64, nb.int64, RANDOM), cache=True
)
def anneal(
    problem: Problem, weights: Weights, truth: Weights, current: State, trial: State, best: State,
    key: FloatArray, temperature: FloatArray, cooling: float, iterations: int, rng: RandomState,
) -> int:  # fmt: skip
    """Run ``iterations`` of ruin and recreate; two calls of half as many do exactly the same.

    Args:
        problem: the instance.
        weights: the objective that guides acceptance and insertion.
        truth: the objective that the best is chosen by.
        current: where the search stands; changed.
        trial: the same as ``current``; work space.
        best: the best state found; changed.
        key: (2,) float64, left-out value and ``truth`` of ``best``; changed.
        temperature: (1,) float64 of the annealing; changed.
        cooling: factor on the temperature after each iteration.
        iterations: how many.
        rng: random state.

    Returns:
        The number of the last iteration, counted from 1, that found a new best; 0 if none did.
    """
    mean_removed = 10.0
    longest_string = 10.0
    blink = 0.01
    waiting_tried = 20
    segments = len(current.route_of)
    routes = len(current.lengths)
    waiting = np.empty(segments, dtype=np.int64)
    pending = np.empty(segments, dtype=np.int64)
    keys = np.empty(segments)
    touched = np.zeros(routes, dtype=np.int64)
    came_from = np.zeros((segments, 2), dtype=np.int64)
    here = objective(problem, weights, current) + weights.prize * left_out(problem, current)[1]
    improved = 0
    for iteration in range(1, iterations + 1):
        waits = gather_waiting(trial, waiting, waiting_tried, rng)
        seed = choose_seed(trial, waiting[:waits], rng, weights.norm > 0.0)
        removed = remove_strings(problem, trial, pending, touched, seed, mean_removed, longest_string, rng)
        pending[removed : removed + waits] = waiting[:waits]
        order_pending(problem, pending[: removed + waits], keys, rng)
        for place in range(removed + waits):
            route = insert_cheapest(problem, weights, trial, pending[place], blink, rng)
            if route >= 0:
                touched[route] = 1
        for route in range(routes):
            if touched[route] == 1:
                measure(problem, trial, route)
                orient(problem, trial, route, came_from)
        there = objective(problem, weights, trial) + weights.prize * left_out(problem, trial)[1]
        if keep_best(problem, truth, trial, best, key):
            improved = iteration
        accepted = there < here - temperature[0] * math.log(1.0 - uniform(rng))
        for route in range(routes):
            if touched[route] == 1:
                touched[route] = 0
                if accepted:
                    copy_route(trial, current, route)
                else:
                    copy_route(current, trial, route)
        if accepted:
            current.route_of[:] = trial.route_of
            here = there
        else:
            trial.route_of[:] = current.route_of
        temperature[0] *= cooling
    return improved
