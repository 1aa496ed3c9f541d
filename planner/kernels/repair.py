"""Repairs of a loss: states that visit exactly the open segments.

A repair's *excess* is the energy that its routes lack, in percent of a battery.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from planner.kernels.arrays import Floats, Ints, IntTable, Problem, RandomState, State, Weights
from planner.kernels.compiled import inner
from planner.kernels.insertion import find_cheapest_place, insert_by_regret, sort_by_key
from planner.kernels.loss_problem import Loss
from planner.kernels.random_numbers import draw_integer, draw_uniform
from planner.kernels.ruin import remove_strings
from planner.kernels.tours import copy_all, copy_owners, copy_route, insert, measure, orient_visits, total_excess

EXCESS_WEIGHT = 1.5
"""What a percent beyond a budget costs a repair besides itself."""
HOT = 0.5
"""Temperature at the begin of a long repair, in mean routes of one segment alone."""
WARM = 0.05
"""The same of a short repair: it stays near where it begins."""
COLD = 0.005
"""Temperature at the end."""
LONG = 200
"""Iterations from which on a repair is long."""


class RepairWorkspace(NamedTuple):
    """Work space of a repair."""

    opened: Ints
    """(n,): the open segments."""
    missing: Ints
    """(n,): those that no route visits yet."""
    pending: Ints
    """(n,): those taken out."""
    keys: Floats
    """(n,)"""
    touched: Ints
    """(k,): zeros between two uses."""
    came_from: IntTable
    """(n, 2)"""
    spare: Ints
    """(n,): visits on their way from one route to another."""
    current: State
    trial: State
    other: State


@inner()
def insert_over_budget(problem: Problem, state: State, segment: int, blink: float, rng: RandomState) -> int:
    """Insert a segment where energy and what it lacks grow least, whatever the budgets; return the route.

    Where nobody flies it is -1 and nothing is inserted.
    """
    best = np.inf
    best_route = -1
    best_position = 0
    best_visit = 0
    for route in range(len(state.lengths)):
        budget = problem.budget[route]
        if budget < 0.0:
            continue
        added, position, visit = find_cheapest_place(problem, state, route, segment, blink, rng)
        if added == np.inf:  # all places were overlooked
            added, position, visit = find_cheapest_place(problem, state, route, segment, 0.0, rng)
        load = state.loads[route]
        gain = added
        if load + added > budget:
            gain += EXCESS_WEIGHT * min(added, load + added - budget)
        if gain < best:
            best = gain
            best_route = route
            best_position = position
            best_visit = visit
    if best_route >= 0:
        insert(problem, state, best_route, best_position, best_visit)
    return best_route


@inner()
def begin_repair(
    loss: Loss, base: State, earlier: State, follow: bool, state: State, desk: RepairWorkspace, rng: RandomState
) -> None:
    """Set ``state`` to a first repair: survivors keep their tails, what is open is inserted by regret.

    With ``follow`` they keep the visits of an ``earlier`` repair instead, of this loss at another time or of a plan
    that differs a little, after the visits of their own that it knows nothing of because they were to end before it.
    """
    problem = loss.problem
    segments = len(state.route_of)
    for segment in range(segments):
        state.route_of[segment] = -1
    for route in range(len(state.lengths)):
        count = 0
        if problem.budget[route] >= 0.0:
            for position in range(loss.done[route] + 1, base.lengths[route]):
                visit = base.visits[route, position]
                if follow and earlier.route_of[visit >> 1] >= 0:
                    break
                state.visits[route, count] = visit
                state.route_of[visit >> 1] = route
                count += 1
            if follow:
                for position in range(earlier.lengths[route]):
                    visit = earlier.visits[route, position]
                    if loss.is_open[visit >> 1] == 1 and state.route_of[visit >> 1] < 0:
                        state.visits[route, count] = visit
                        state.route_of[visit >> 1] = route
                        count += 1
        state.lengths[route] = count
        measure(problem, state, route)
    missing = desk.missing
    count = 0
    for segment in range(segments):
        if loss.is_open[segment] == 1 and state.route_of[segment] < 0:
            missing[count] = segment
            count += 1
    if count == 0:
        return
    weights = Weights(1.0, 0.0, 0.0, 1.0, 1.0, 2.0, 0.0, 0.0, 0.0)
    insert_by_regret(problem, weights, state, missing[:count], rng)
    for place in range(count):
        if state.route_of[missing[place]] < 0:
            insert_over_budget(problem, state, missing[place], 0.0, rng)


@inner()
def choose_ruin_seed(problem: Problem, state: State, opened: Ints, count: int, rng: RandomState) -> int:
    """Return the open segment around which to ruin: often one of a route that lacks energy."""
    if draw_uniform(rng) < 0.5:
        worst = -1
        most = 0.0
        for route in range(len(state.lengths)):
            over = (state.loads[route] - problem.budget[route]) * (0.5 + draw_uniform(rng))
            if state.lengths[route] > 0 and over > most:
                most = over
                worst = route
        if worst >= 0:
            return int(state.visits[worst, draw_integer(rng, state.lengths[worst])] >> 1)
    return int(opened[draw_integer(rng, count)])


@inner()
def shuffle_pending(problem: Problem, pending: Ints, count: int, keys: Floats, rng: RandomState) -> None:
    """Order ``count`` segments to be inserted: at random, the far ones first, or the near ones first."""
    kind = draw_integer(rng, 4)
    for place in range(count):
        if kind < 2:
            keys[place] = draw_uniform(rng)
        elif kind == 2:
            keys[place] = -problem.effort[pending[place]]
        else:
            keys[place] = problem.effort[pending[place]]
    sort_by_key(pending[:count], keys)


@inner()
def total_energy(state: State) -> float:
    """Return what all routes use."""
    total = 0.0
    for route in range(len(state.loads)):
        total += state.loads[route]
    return total


@inner()
def is_fleet_empty(problem: Problem) -> bool:
    """Return whether no vehicle is left to take a visit."""
    most = -1.0
    for route in range(len(problem.budget)):
        most = max(most, problem.budget[route])
    return most < 0.0


@inner()
def repair(loss: Loss, best: State, desk: RepairWorkspace, iterations: int, rng: RandomState) -> float:
    """Ruin and recreate until no route lacks energy, ``iterations`` at most; return what the best one lacks.

    Args:
        loss: the problem.
        best: set to the repair that lacks least.
        desk: work space; ``current`` is a first repair.
        iterations: how many at most.
        rng: random state.
    """
    problem, current, trial = loss.problem, desk.current, desk.trial
    pending, touched = desk.pending, desk.touched
    routes = len(current.lengths)
    copy_all(current, best)
    least = total_excess(problem, current)
    # Routes of one segment alone are the scale of what a repair gains or loses.
    alone = 0.0
    count = 0
    for segment in range(len(loss.is_open)):
        if loss.is_open[segment] == 1:
            desk.opened[count] = segment
            alone += problem.effort[segment]
            count += 1
    if count > 0 and is_fleet_empty(problem):
        return np.inf  # nothing could be inserted
    if least <= 0.0 or iterations <= 0 or count == 0:
        return least
    copy_all(current, trial)
    here = EXCESS_WEIGHT * least + total_energy(current)
    hot = HOT if iterations >= LONG else WARM
    temperature = hot * alone / count
    cooling = (COLD / hot) ** (1.0 / iterations)
    for _ in range(iterations):
        seed = choose_ruin_seed(problem, trial, desk.opened, count, rng)
        removed = remove_strings(problem, trial, pending, touched, seed, 6.0, 8.0, rng)
        shuffle_pending(problem, pending, removed, desk.keys, rng)
        for place in range(removed):
            touched[insert_over_budget(problem, trial, pending[place], 0.02, rng)] = 1
        for route in range(routes):
            if touched[route] == 1:
                measure(problem, trial, route)
                orient_visits(problem, trial, route, desk.came_from)
        lacks = total_excess(problem, trial)
        there = EXCESS_WEIGHT * lacks + total_energy(trial)
        if lacks < least:
            least = lacks
            copy_all(trial, best)
            if lacks <= 0.0:
                for route in range(routes):
                    touched[route] = 0
                return 0.0
        accepted = there < here - temperature * math.log(1.0 - draw_uniform(rng))
        for route in range(routes):
            if touched[route] == 1:
                touched[route] = 0
                if accepted:
                    copy_route(trial, current, route)
                else:
                    copy_route(current, trial, route)
        if accepted:
            copy_owners(trial, current)
            here = there
        else:
            copy_owners(current, trial)
        temperature *= cooling
    return least
