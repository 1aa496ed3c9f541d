"""Kernels of the paper's GRASP: greedy randomised construction, four neighbourhoods, tabu search over them."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from planner.kernels.anneal import compute_objective
from planner.kernels.arrays import Floats, Ints, Problem, RandomState, State, Weights
from planner.kernels.compiling import kernel
from planner.kernels.tours import copy_route, draw_integer, draw_uniform, insert, measure


class GraspWalk(NamedTuple):
    """State of one run of the local search between two rounds."""

    current: State
    """The current solution."""
    trial: State
    """Equal to ``current`` between two neighbours; work space."""
    best: State
    """The best solution of the run."""
    cost: Floats
    """(1,): cost of ``best``."""
    scores: Ints
    """(4,): relative frequency with which each neighbourhood is drawn."""
    counts: Ints
    """(3,): number of solutions entered in the tabu list, of rounds, and of rounds since the last improvement."""
    tabu: Ints
    """(m,): fingerprints of the last m solutions."""


@kernel(counted=True)
def penalised_cost(problem: Problem, weights: Weights, route: int, load: float) -> float:
    """Return the cost of a route with this load: the load plus its weighted excess over the budget."""
    return float(load + weights.excess * max(0.0, load - problem.budget[route]))


@kernel(counted=True)
def added_energy(problem: Problem, state: State, route: int, position: int, visit: int) -> float:
    """Return the energy that inserting a visit adds to a route."""
    length = state.lengths[route]
    visits = state.visits[route]
    consumption = problem.consumption[route]
    move = problem.move[problem.profile[route]]
    added = -state.legs[route, position]
    added += problem.start[route, visit] if position == 0 else consumption * move[visits[position - 1], visit]
    added += problem.home[route, visit] if position == length else consumption * move[visit, visits[position]]
    return float(added)


@kernel(counted=True)
def load_of(problem: Problem, state: State, route: int) -> float:
    """Return the load of a route with at least one visit, computed from its visits."""
    length = state.lengths[route]
    visits = state.visits[route]
    move = problem.move[problem.profile[route]]
    moved = 0.0
    for position in range(1, length):
        moved += move[visits[position - 1], visits[position]]
    first, last = visits[0], visits[length - 1]
    return float(problem.start[route, first] + problem.consumption[route] * moved + problem.home[route, last])


@kernel(counted=True)
def choose_giving_route(state: State, rng: RandomState) -> int:
    """Return a random route with at least two visits; if there is none, one with a visit."""
    least = 1
    for route in range(len(state.lengths)):
        if state.lengths[route] >= 2:
            least = 2
    route = draw_integer(rng, len(state.lengths))
    while state.lengths[route] < least:
        route = draw_integer(rng, len(state.lengths))
    return route


@kernel(counted=True)
def remove_visit(problem: Problem, state: State, route: int, position: int) -> int:
    """Remove a visit from a route and return it."""
    visits = state.visits[route]
    visit = visits[position]
    state.lengths[route] -= 1
    for place in range(position, state.lengths[route]):
        visits[place] = visits[place + 1]
    measure(problem, state, route)
    return int(visit)


@kernel(counted=True)
def shift_at_random(problem: Problem, state: State, rng: RandomState) -> tuple[int, int]:
    """Move a random visit to a random position of any route, in the better direction.

    Returns:
        The changed routes, as for the other neighbourhoods.
    """
    one = choose_giving_route(state, rng)
    position = draw_integer(rng, state.lengths[one])
    visit = remove_visit(problem, state, one, position)
    routes = len(state.lengths)
    if routes == 1 or (state.lengths[one] > 0 and draw_uniform(rng) < 0.5):
        other = one
        place = draw_integer(rng, state.lengths[one])
        place = min(place + int(place >= position), state.lengths[one])
    else:
        other = draw_integer(rng, routes - 1)
        other += int(other >= one)
        place = draw_integer(rng, state.lengths[other] + 1)
    ahead = added_energy(problem, state, other, place, visit)
    turned = added_energy(problem, state, other, place, visit ^ 1)
    insert(problem, state, other, place, visit ^ int(turned < ahead))
    return one, other


@kernel(counted=True)
def shift_best(problem: Problem, weights: Weights, state: State, rng: RandomState) -> tuple[int, int]:
    """Move a random visit to the best position found behind another visit, in either direction.

    The score of a position is the cost of its route with the visit, plus the cost without the visit of the route that
    holds the best position so far; if both are the same route, it counts twice. The first direction that makes a
    position the best is kept. So the result depends on the search order and favours short routes, as in the authors'
    solver.
    """
    one = choose_giving_route(state, rng)
    best_route = one
    best_place = draw_integer(rng, state.lengths[one])
    visit = remove_visit(problem, state, one, best_place)
    best_visit = visit
    best = np.inf
    for route in range(len(state.lengths)):
        for place in range(1, state.lengths[route] + 1):
            if route == best_route and place == best_place:
                continue
            beside = penalised_cost(problem, weights, best_route, state.loads[best_route])
            same = route == best_route
            for turned in range(2):
                load = state.loads[route] + added_energy(problem, state, route, place, visit ^ turned)
                cost = penalised_cost(problem, weights, route, load)
                cost += cost if same else beside
                if cost < best:
                    best = cost
                    best_route = route
                    best_place = place
                    best_visit = visit ^ turned
                    break
    insert(problem, state, best_route, best_place, best_visit)
    return one, best_route


@kernel(counted=True)
def swap_visits(state: State, one: int, position: int, other: int, place: int) -> None:
    """Exchange two visits; the caller updates legs and loads."""
    visits = state.visits
    visits[one, position], visits[other, place] = visits[other, place], visits[one, position]


@kernel(counted=True)
def swap_best(problem: Problem, weights: Weights, state: State, rng: RandomState) -> tuple[int, int]:
    """Exchange a random visit with the most promising other visit, each in either direction.

    The score of a partner is the joint cost of both routes, one route twice, with all exchanges tried earlier still
    applied: the authors' solver does this, and it makes the choice rather random.
    """
    one = choose_giving_route(state, rng)
    position = draw_integer(rng, state.lengths[one])
    visits = state.visits
    best = np.inf
    best_route = one
    best_place = position
    best_turns = 0
    for route in range(len(state.lengths)):
        for place in range(state.lengths[route]):
            if route == one and place == position:
                continue
            swap_visits(state, one, position, route, place)
            for turns in range(4):
                visits[one, position] ^= turns & 1
                visits[route, place] ^= turns >> 1
                cost = penalised_cost(problem, weights, one, load_of(problem, state, one))
                cost += penalised_cost(problem, weights, route, load_of(problem, state, route))
                visits[one, position] ^= turns & 1
                visits[route, place] ^= turns >> 1
                if cost < best:
                    best = cost
                    best_route = route
                    best_place = place
                    best_turns = turns
    for route in range(len(state.lengths) - 1, -1, -1):
        for place in range(state.lengths[route] - 1, -1, -1):
            if route != one or place != position:
                swap_visits(state, one, position, route, place)
    swap_visits(state, one, position, best_route, best_place)
    visits[one, position] ^= best_turns & 1
    visits[best_route, best_place] ^= best_turns >> 1
    measure(problem, state, one)
    measure(problem, state, best_route)
    return one, best_route


@kernel(counted=True)
def turn_at_random(problem: Problem, state: State, rng: RandomState) -> tuple[int, int]:
    """Reverse a random visit."""
    one = draw_integer(rng, len(state.lengths))
    while state.lengths[one] == 0:
        one = draw_integer(rng, len(state.lengths))
    state.visits[one, draw_integer(rng, state.lengths[one])] ^= 1
    measure(problem, state, one)
    return one, one


@kernel(counted=True)
def construct(problem: Problem, weights: Weights, state: State, never: float, rng: RandomState) -> None:
    """Insert all segments into the empty routes of ``state``, each drawn from a restricted candidate list.

    The list holds the quarter of all insertions with the cheapest resulting routes, the budget being soft. An insertion
    that adds ``never`` or more is excluded.
    """
    segments = len(state.route_of)
    routes = len(state.lengths)
    most = 2 * segments * (segments + routes)
    costs = np.empty(most)
    choices = np.empty((most, 3), dtype=np.int64)
    for _ in range(segments):
        count = 0
        for segment in range(segments):
            if state.route_of[segment] >= 0:
                continue
            for route in range(routes):
                for place in range(state.lengths[route] + 1):
                    for visit in range(2 * segment, 2 * segment + 2):
                        added = added_energy(problem, state, route, place, visit)
                        if added >= never:
                            continue
                        load = state.loads[route] + added
                        costs[count] = penalised_cost(problem, weights, route, load)
                        choices[count, 0] = route
                        choices[count, 1] = place
                        choices[count, 2] = visit
                        count += 1
        if count == 0:
            return
        rank = draw_integer(rng, count // 4 + 1)
        chosen = np.argpartition(costs[:count], rank)[rank]
        insert(problem, state, choices[chosen, 0], choices[chosen, 1], choices[chosen, 2])


@kernel(counted=True)
def fingerprint(state: State) -> int:
    """Return a hash of the solution; collisions are very unlikely."""
    print_of = 0
    for route in range(len(state.lengths)):
        for position in range(state.lengths[route]):
            print_of = (16_777_619 * print_of + state.visits[route, position] + 1) % 2**38
        print_of = 16_777_619 * print_of % 2**38
    return print_of


@kernel(counted=True)
def is_trial_tabu(walk: GraspWalk) -> bool:
    """Return whether ``trial`` is in the tabu list."""
    trial = fingerprint(walk.trial)
    tabu = False
    for entry in range(min(walk.counts[0], len(walk.tabu))):
        tabu = tabu or walk.tabu[entry] == trial
    return tabu


@kernel(counted=True)
def forbid_current(walk: GraspWalk) -> None:
    """Add ``current`` to the tabu list; if the list is full, replace the oldest entry."""
    walk.tabu[walk.counts[0] % len(walk.tabu)] = fingerprint(walk.current)
    walk.counts[0] += 1


@kernel(counted=True)
def draw_neighbourhood(scores: Ints, rng: RandomState) -> int:
    """Draw a neighbourhood with a probability proportional to its score."""
    number = draw_integer(rng, scores.sum())
    kind = 0
    while number >= scores[kind]:
        number -= scores[kind]
        kind += 1
    return kind


@kernel(counted=True)
def improve_by_neighbours(
    problem: Problem, weights: Weights, walk: GraspWalk, draws: int, rng: RandomState
) -> tuple[int, int]:
    """Move ``current`` to the first drawn neighbour that is not tabu, then to each one better than the last.

    Returns:
        The neighbourhood that led to the final solution, -1 if all neighbours were tabu; and the last one drawn.
    """
    lowest = np.inf
    winner = -1
    kind = -1
    for _ in range(draws):
        kind = draw_neighbourhood(walk.scores, rng)
        if kind == 0:
            one, other = shift_at_random(problem, walk.trial, rng)
        elif kind == 1:
            one, other = shift_best(problem, weights, walk.trial, rng)
        elif kind == 2:
            one, other = swap_best(problem, weights, walk.trial, rng)
        else:
            one, other = turn_at_random(problem, walk.trial, rng)
        cost = compute_objective(problem, weights, walk.trial)
        if cost < lowest and not is_trial_tabu(walk):
            lowest = cost
            winner = kind
            source, target = walk.trial, walk.current
        else:
            source, target = walk.current, walk.trial
        copy_route(source, target, one)
        copy_route(source, target, other)
    return winner, kind


@kernel(counted=True)
def improve(problem: Problem, weights: Weights, walk: GraspWalk, rounds: int, patience: int, rng: RandomState) -> int:
    """Run rounds of the local search; return how many ran, fewer than ``rounds`` if ``patience`` ended the run.

    Args:
        problem: the instance.
        weights: the cost function.
        walk: the run; changed.
        rounds: maximum number of rounds.
        patience: rounds without improvement that end the run.
        rng: random state.
    """
    first_score = 5
    score_of_round = 1
    score_of_best = 5
    rounds_of_scores = 20
    for done in range(rounds):
        if walk.counts[2] >= patience:
            return done
        if walk.counts[1] % rounds_of_scores == 0:
            walk.scores[:] = first_score
        walk.counts[1] += 1
        walk.counts[2] += 1
        winner, last = improve_by_neighbours(problem, weights, walk, len(walk.current.route_of), rng)
        if winner >= 0:
            forbid_current(walk)
            walk.scores[winner] += score_of_round
            cost = compute_objective(problem, weights, walk.current)
            if cost < walk.cost[0]:
                walk.cost[0] = cost
                walk.scores[last] += score_of_best
                walk.counts[2] = 0
                for route in range(len(walk.current.lengths)):
                    copy_route(walk.current, walk.best, route)
        walk.scores[0] += score_of_round
    return rounds
