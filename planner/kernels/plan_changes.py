"""Small changes of a whole plan, most of them where the losses that a search looks at leave something else of it."""

from __future__ import annotations

import numpy as np

from planner.kernels.arrays import Ints, Problem, RandomState, State
from planner.kernels.compiled import inner
from planner.kernels.insertion import find_cheapest_place
from planner.kernels.loss_problem import LossClock
from planner.kernels.random_numbers import draw_integer, draw_uniform
from planner.kernels.repair import RepairWorkspace
from planner.kernels.ruin import position_of, remove_strings
from planner.kernels.tours import insert

TRIES = 6
"""How often such a place is looked for."""


@inner()
def reverse_visits(base: State, route: int, begin: int, end: int) -> None:
    """Fly visits [begin, end) of a route the other way round; ``measure`` follows."""
    visits = base.visits[route]
    while begin < end:
        end -= 1
        visits[begin], visits[end] = visits[end] ^ 1, visits[begin] ^ 1
        begin += 1


@inner()
def exchange_tails(base: State, one: int, begin: int, other: int, other_begin: int, spare: Ints) -> None:
    """Exchange what two routes do from a position of each on; ``measure`` follows."""
    kept = base.lengths[one] - begin
    count = base.lengths[other] - other_begin
    for place in range(kept):
        spare[place] = base.visits[one, begin + place]
    for place in range(count):
        base.visits[one, begin + place] = base.visits[other, other_begin + place]
    for place in range(kept):
        base.visits[other, other_begin + place] = spare[place]
    base.lengths[one] = begin + count
    base.lengths[other] = other_begin + kept


@inner()
def shift_string(base: State, one: int, begin: int, count: int, other: int, place: int, spare: Ints) -> None:
    """Move ``count`` visits of a route before position ``place`` of another one, or of what is left of itself."""
    for position in range(count):
        spare[position] = base.visits[one, begin + position]
    for position in range(begin, base.lengths[one] - count):
        base.visits[one, position] = base.visits[one, position + count]
    base.lengths[one] -= count
    for position in range(base.lengths[other] - 1, place - 1, -1):
        base.visits[other, position + count] = base.visits[other, position]
    for position in range(count):
        base.visits[other, place + position] = spare[position]
    base.lengths[other] += count


@inner()
def insert_within_budget(problem: Problem, base: State, segment: int, blink: float, rng: RandomState) -> int:
    """Insert a segment where it adds least within the budgets; return the route, -1 if there is no place."""
    best = np.inf
    best_route = -1
    best_position = 0
    best_visit = 0
    for route in range(len(base.lengths)):
        added, position, visit = find_cheapest_place(problem, base, route, segment, blink, rng)
        if added < best and base.loads[route] + added <= problem.budget[route]:
            best = added
            best_route = route
            best_position = position
            best_visit = visit
    if best_route >= 0:
        insert(problem, base, best_route, best_position, best_visit)
    return best_route


@inner()
def choose_segment(base: State, clock: LossClock, until_s: float, early: float, rng: RandomState) -> int:
    """Return a segment at random, ``early`` of all times one whose visit begins before a time."""
    segment = draw_integer(rng, len(base.route_of))
    if draw_uniform(rng) >= early:
        return segment
    for _ in range(TRIES):
        route = base.route_of[segment]
        position = position_of(base, route, segment)
        if position == 0 or clock.ends_s[route, position - 1] <= until_s:
            break
        segment = draw_integer(rng, len(base.route_of))
    return segment


@inner()
def reinsert_neighbours(problem: Problem, base: State, desk: RepairWorkspace, segment: int, rng: RandomState) -> bool:
    """Take a few visits about one out and put them back within the budgets; return whether all found a place."""
    pending, touched = desk.pending, desk.touched
    removed = remove_strings(problem, base, pending, touched, segment, 3.0, 4.0, rng)
    for place in range(removed - 1, 0, -1):
        other = draw_integer(rng, place + 1)
        pending[place], pending[other] = pending[other], pending[place]
    blink = 0.02 if draw_uniform(rng) < 0.5 else 0.3
    for place in range(removed):
        route = insert_within_budget(problem, base, pending[place], blink, rng)
        if route < 0:
            return False
        touched[route] = 1
    return True


@inner()
def change_plan(
    problem: Problem,
    base: State,
    clock: LossClock,
    until_s: float,
    early: float,
    desk: RepairWorkspace,
    rng: RandomState,
) -> bool:
    """Change a plan at random, a little; return whether it is one still. Routes that are touched need ``measure``."""
    touched = desk.touched
    kind = draw_uniform(rng)
    segment = choose_segment(base, clock, until_s, early, rng)
    if kind < 0.4:
        return bool(reinsert_neighbours(problem, base, desk, segment, rng))
    one = base.route_of[segment]
    begin = position_of(base, one, segment)
    length = base.lengths[one]
    touched[one] = 1
    if kind < 0.5:
        reverse_visits(base, one, 0, length)
        return True
    if kind < 0.65:
        reverse_visits(base, one, begin, begin + 1 + draw_integer(rng, length - begin))
        return True
    near = problem.near[segment, draw_integer(rng, min(12, problem.near.shape[1]))]
    other = base.route_of[near]
    place = position_of(base, other, near) + draw_integer(rng, 2)
    if kind < 0.9:
        count = 1 + draw_integer(rng, min(4, length - begin))
        if other == one:
            if begin <= place <= begin + count:
                return False
            if place > begin:
                place -= count
        if draw_uniform(rng) < 0.5:
            reverse_visits(base, one, begin, begin + count)
        shift_string(base, one, begin, count, other, place, desk.spare)
        touched[other] = 1
        return True
    if other == one:
        return False
    touched[other] = 1
    if draw_uniform(rng) < 0.5:
        reverse_visits(base, other, 0, base.lengths[other])
        place = base.lengths[other] - place
    exchange_tails(base, one, begin, other, place, desk.spare)
    return True
