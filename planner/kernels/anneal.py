"""The inner loop of the improvement search: ruin, recreate, accept by simulated annealing, keep the best."""

from __future__ import annotations

import math

from planner.kernels.arrays import Floats, Ints, Problem, RandomState, SearchWorkspace, State, Weights
from planner.kernels.compiling import inner, kernel
from planner.kernels.tours import (
    copy_all,
    copy_route,
    draw_integer,
    draw_uniform,
    insert_cheapest,
    max_load,
    measure,
    orient_visits,
    raise_to_power,
    remove_strings,
    sort_pending,
    total_excess,
)


@kernel()
def uncovered_value(problem: Problem, state: State) -> tuple[float, float]:
    """Return the value and the prizes of the uncovered segments."""
    value = 0.0
    prizes = 0.0
    for segment in range(len(state.route_of)):
        if state.route_of[segment] < 0:
            value += problem.value[segment]
            prizes += problem.prize[segment]
    return value, prizes


@kernel()
def compute_objective(problem: Problem, weights: Weights, state: State) -> float:
    """Return the objective of the routes, excluding uncovered segments."""
    total = 0.0
    powers = 0.0
    empty = 0
    for route in range(len(state.lengths)):
        load = state.loads[route]
        total += load
        if weights.norm > 0.0:
            powers += raise_to_power(load / weights.scale, weights.power)
        empty += int(state.lengths[route] == 0)
    value = weights.total * total + weights.empty * empty
    if weights.excess > 0.0:
        value += weights.excess * total_excess(problem, state)
    if weights.peak > 0.0:
        value += weights.peak * max_load(state.loads)
    if weights.norm > 0.0:
        value += weights.norm * weights.scale * powers ** (1.0 / weights.power)
    return value


@inner()
def choose_seed(state: State, waiting: Ints, rng: RandomState, balance: bool) -> int:
    """Return the segment to ruin around: often an uncovered one, or one of the longest route."""
    if len(waiting) > 0 and draw_uniform(rng) < 0.5:
        return int(waiting[draw_integer(rng, len(waiting))])
    if balance and draw_uniform(rng) < 0.5:
        route = 0
        for other in range(1, len(state.loads)):
            if state.loads[other] > state.loads[route]:
                route = other
        if state.lengths[route] > 0:
            return int(state.visits[route, draw_integer(rng, state.lengths[route])] >> 1)
    return draw_integer(rng, len(state.route_of))


@inner()
def gather_waiting(state: State, waiting: Ints, out: int, most: int, rng: RandomState) -> int:
    """Fill ``waiting`` with at most ``most`` of the ``out`` uncovered segments; return how many."""
    if out == 0:
        return 0
    count = 0
    for segment in range(len(state.route_of)):
        if state.route_of[segment] < 0:
            waiting[count] = segment
            count += 1
    for place in range(min(count, most)):
        other = place + draw_integer(rng, count - place)
        waiting[place], waiting[other] = waiting[other], waiting[place]
    return min(count, most)


@inner()
def keep_best(problem: Problem, truth: Weights, trial: State, best: State, key: Floats, value: float) -> bool:
    """Copy ``trial``, which leaves out ``value``, to ``best`` if it is within budget and better; return whether it was.

    Better means less value left out, then a lower ``truth``. ``key`` (2,) holds both figures of the best.
    """
    same_value = abs(value - key[0]) <= 1e-9 * (1.0 + key[0])
    if not same_value and value > key[0]:
        return False
    cost = compute_objective(problem, truth, trial)
    if (same_value and cost >= key[1] - 1e-9 * (1.0 + abs(key[1]))) or total_excess(problem, trial) > 0.0:
        return False
    key[0] = value
    key[1] = cost
    copy_all(trial, best)
    return True


@inner()
def copy_changes(source: State, target: State, touched: Ints, moved: Ints) -> None:
    """Copy the ``touched`` routes and the owners of the ``moved`` segments; everything else is already equal."""
    for route in range(len(touched)):
        if touched[route] == 1:
            copy_route(source, target, route)
    for place in range(len(moved)):
        target.route_of[moved[place]] = source.route_of[moved[place]]


@kernel()
def anneal(
    problem: Problem, weights: Weights, truth: Weights, current: State, trial: State, best: State,
    key: Floats, temperature: Floats, cooling: float, iterations: int, rng: RandomState,
    memory: SearchWorkspace,
) -> int:  # fmt: skip
    """Run ``iterations`` of ruin and recreate; two calls of half as many give exactly the same result.

    Args:
        problem: the instance.
        weights: the objective that guides acceptance and insertion.
        truth: the objective that selects the best state.
        current: the current state of the search; changed.
        trial: equal to ``current``; work space.
        best: the best state found; changed.
        key: (2,) float64, left-out value and ``truth`` of ``best``; changed.
        temperature: (1,) float64 of the annealing; changed.
        cooling: factor on the temperature after each iteration.
        iterations: number of iterations.
        rng: random state.
        memory: work space of this annealing; changed.

    Returns:
        The last iteration, counted from 1, that found a new best; 0 if none did.
    """
    mean_removed = 10.0
    longest_string = 10.0
    blink = 0.01
    waiting_tried = 20
    segments = len(current.route_of)
    routes = len(current.lengths)
    waiting = memory.waiting
    pending = memory.pending
    keys = memory.keys
    touched = memory.touched
    out = 0
    for segment in range(segments):
        out += int(current.route_of[segment] < 0)
    here = compute_objective(problem, weights, current) + weights.prize * uncovered_value(problem, current)[1]
    improved = 0
    for iteration in range(1, iterations + 1):
        waits = gather_waiting(trial, waiting, out, waiting_tried, rng)
        seed = choose_seed(trial, waiting[:waits], rng, weights.norm > 0.0)
        taken = remove_strings(problem, trial, pending, touched, seed, mean_removed, longest_string, rng)
        still_out = out + taken
        for place in range(waits):
            pending[taken] = waiting[place]
            taken += 1
        # The shares are those of Christiaens and Vanden Berghe (2020); value replaces their demand.
        sort_pending(problem, pending[:taken], keys, 4, 4, 2, 1, rng)
        for place in range(taken):
            route = insert_cheapest(problem, weights, trial, pending[place], blink, touched, memory, rng)
            if route >= 0:
                touched[route] = 1
                still_out -= 1
        for route in range(routes):
            if touched[route] == 1:
                measure(problem, trial, route)
                orient_visits(problem, trial, route, memory.came_from)
        value = 0.0
        there = compute_objective(problem, weights, trial)
        if still_out > 0:
            value, prizes = uncovered_value(problem, trial)
            there += weights.prize * prizes
        if keep_best(problem, truth, trial, best, key, value):
            improved = iteration
        accepted = there < here - temperature[0] * math.log(1.0 - draw_uniform(rng))
        if accepted:
            copy_changes(trial, current, touched, pending[:taken])
        else:
            copy_changes(current, trial, touched, pending[:taken])
        for route in range(routes):
            memory.versions[route] += touched[route] * int(accepted)
            touched[route] = 0
        if accepted:
            here = there
            out = still_out
        temperature[0] *= cooling
    return improved
