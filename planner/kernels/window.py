"""Losses and their repairs, in the numbering of the whole instance: nothing is copied for what is left open.

A loss changes where survivors start, what they may still spend, and which segments are open; ``begin_loss`` writes
that into arrays of its own. A repair is a ``State`` that visits exactly the open segments; its *excess* is the energy
that its routes lack. ``planner.replan.remaining`` is the definition of the state after a loss.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numba as nb
import numpy as np

from planner.kernels.arrays import (
    CUBE,
    FLOATS,
    INT_TABLE,
    INTS,
    PROBLEM,
    RANDOM,
    STATE,
    TABLE,
    FloatArray,
    IntArray,
    Problem,
    RandomState,
    State,
    Weights,
)
from planner.kernels.chance import below, uniform
from planner.kernels.compiled import inner, kernel
from planner.kernels.insertion import cheapest_place, insert_by_regret
from planner.kernels.ruin import remove_strings
from planner.kernels.tours import copy_route, insert, measure, orient

SAME_TIME_S = 1e-9
"""As in replan.py: a visit that ends this little after the loss has ended."""
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


class Timing(NamedTuple):
    """What a loss needs besides the energies of ``Problem``."""

    move_s: FloatArray
    """(p, 2n, 2n): seconds of the moves."""
    start_s: FloatArray
    """(k, 2n)"""
    home_s: FloatArray
    """(k, 2n)"""
    idle_s: FloatArray
    """(k,)"""
    depot: FloatArray
    """(k, 2n): energy from the landing place to the end of a visit, with the vehicle's own consumption."""
    airborne: IntArray
    """(k,): 1 for vehicles that are in the air when the plan starts."""


class Clock(NamedTuple):
    """When and at what expense the visits of a plan end."""

    ends_s: FloatArray
    """(k, n): when visit p of a route ends."""
    spent: FloatArray
    """(k, n): what its vehicle has spent by then."""
    durations_s: FloatArray
    """(k,): landing place reached."""


class Loss(NamedTuple):
    """The problem that a loss leaves."""

    problem: Problem
    """With ``start``, ``idle`` and ``budget`` of its own; a budget below 0 is that of a vehicle that does not fly."""
    is_open: IntArray
    """(n,): 1 for segments to be visited."""
    done: IntArray
    """(k,): how many visits of the plan have ended."""


class Repairs(NamedTuple):
    """For each vehicle the latest repair of its loss; ``k`` states beside each other."""

    visits: IntArray
    """(k, k, n)"""
    legs: FloatArray
    """(k, k, n + 1)"""
    lengths: IntArray
    """(k, k)"""
    loads: FloatArray
    """(k, k)"""
    route_of: IntArray
    """(k, n)"""
    known: IntArray
    """(k,): 1 where there is one."""


class Desk(NamedTuple):
    """Work space of a repair."""

    opened: IntArray
    """(n,): the open segments."""
    missing: IntArray
    """(n,): those that no route visits yet."""
    pending: IntArray
    """(n,): those taken out."""
    keys: FloatArray
    """(n,)"""
    touched: IntArray
    """(k,): zeros between two uses."""
    came_from: IntArray
    """(n, 2)"""
    spare: IntArray
    """(n,): visits on their way from one route to another."""
    current: State
    trial: State
    other: State


INT_CUBE = nb.types.Array(nb.int64, 3, "C")
TIMING = nb.types.NamedTuple((CUBE, TABLE, TABLE, FLOATS, TABLE, INTS), Timing)
CLOCK = nb.types.NamedTuple((TABLE, TABLE, FLOATS), Clock)
LOSS = nb.types.NamedTuple((PROBLEM, INTS, INTS), Loss)
DESK = nb.types.NamedTuple((INTS, INTS, INTS, FLOATS, INTS, INT_TABLE, INTS, STATE, STATE, STATE), Desk)
REPAIRS = nb.types.NamedTuple((INT_CUBE, CUBE, INT_TABLE, TABLE, INT_TABLE, INTS), Repairs)


@kernel(nb.void(PROBLEM, TIMING, STATE, CLOCK, nb.int64))
def set_clock(problem: Problem, timing: Timing, base: State, clock: Clock, route: int) -> None:
    """Set times and expenses of a route that is measured."""
    length = base.lengths[route]
    if length == 0:
        clock.durations_s[route] = timing.idle_s[route]
        return
    move_s = timing.move_s[problem.profile[route]]
    visits = base.visits[route]
    now_s = timing.start_s[route, visits[0]]
    spent = base.legs[route, 0]
    clock.ends_s[route, 0] = now_s
    clock.spent[route, 0] = spent
    for position in range(1, length):
        now_s += move_s[visits[position - 1], visits[position]]
        spent += base.legs[route, position]
        clock.ends_s[route, position] = now_s
        clock.spent[route, position] = spent
    clock.durations_s[route] = now_s + timing.home_s[route, visits[length - 1]]


@inner(nb.void(PROBLEM, TIMING, STATE, CLOCK, nb.int64, nb.float64, nb.boolean, LOSS))
def begin_loss(
    problem: Problem, timing: Timing, base: State, clock: Clock, lost: int, at_s: float, fly_again: bool, loss: Loss
) -> None:
    """Set ``loss`` to what the loss of a vehicle at a time leaves of the plan ``base``."""
    for segment in range(len(base.route_of)):
        loss.is_open[segment] = int(base.route_of[segment] < 0)
    for route in range(len(base.lengths)):
        length = base.lengths[route]
        done = 0
        while done < length and clock.ends_s[route, done] <= at_s + SAME_TIME_S:
            done += 1
        loss.done[route] = done
        loss.problem.idle[route] = 0.0
        first_open = done
        if route == lost:
            loss.problem.budget[route] = -1.0
        elif done < length:
            visit = base.visits[route, done]
            loss.problem.budget[route] = max(0.0, problem.budget[route] - clock.spent[route, done])
            move = problem.move[problem.profile[route], visit]
            for other in range(len(move)):
                loss.problem.start[route, other] = problem.consumption[route] * move[other]
            loss.problem.idle[route] = problem.home[route, visit]
            first_open = done + 1
        else:
            left = max(0.0, problem.budget[route] - base.loads[route])
            loss.problem.budget[route] = left if fly_again else -1.0
            start = problem.start if length == 0 and timing.airborne[route] == 0 else timing.depot
            for other in range(start.shape[1]):
                loss.problem.start[route, other] = start[route, other]
        for position in range(first_open, length):
            loss.is_open[base.visits[route, position] >> 1] = 1


@inner(nb.float64(PROBLEM, STATE))
def lacking(problem: Problem, state: State) -> float:
    """Return the energy that the routes of a repair lack, in percent of a battery."""
    total = 0.0
    for route in range(len(state.lengths)):
        if state.lengths[route] > 0:
            total += max(0.0, state.loads[route] - problem.budget[route])
    return total


@inner(nb.int64(PROBLEM, STATE, nb.int64, nb.float64, RANDOM))
def insert_anyway(problem: Problem, state: State, segment: int, blink: float, rng: RandomState) -> int:
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
        added, position, visit = cheapest_place(problem, state, route, segment, blink, rng)
        if added == np.inf:  # all places were overlooked
            added, position, visit = cheapest_place(problem, state, route, segment, 0.0, rng)
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


@inner(nb.void(LOSS, STATE, STATE, nb.boolean, STATE, DESK, RANDOM))
def begin_repair(
    loss: Loss, base: State, earlier: State, follow: bool, state: State, desk: Desk, rng: RandomState
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
            insert_anyway(problem, state, missing[place], 0.0, rng)


@inner(nb.int64(PROBLEM, STATE, INTS, nb.int64, RANDOM))
def ruin_about(problem: Problem, state: State, opened: IntArray, count: int, rng: RandomState) -> int:
    """Return the open segment around which to ruin: often one of a route that lacks energy."""
    if uniform(rng) < 0.5:
        worst = -1
        most = 0.0
        for route in range(len(state.lengths)):
            over = (state.loads[route] - problem.budget[route]) * (0.5 + uniform(rng))
            if state.lengths[route] > 0 and over > most:
                most = over
                worst = route
        if worst >= 0:
            return int(state.visits[worst, below(rng, state.lengths[worst])] >> 1)
    return int(opened[below(rng, count)])


@inner(nb.void(PROBLEM, INTS, nb.int64, FLOATS, RANDOM))
def shuffle_pending(problem: Problem, pending: IntArray, count: int, keys: FloatArray, rng: RandomState) -> None:
    """Order ``count`` segments to be inserted: at random, the far ones first, or the near ones first."""
    kind = below(rng, 4)
    for place in range(count):
        if kind < 2:
            keys[place] = uniform(rng)
        elif kind == 2:
            keys[place] = -problem.effort[pending[place]]
        else:
            keys[place] = problem.effort[pending[place]]
    for place in range(1, count):
        segment = pending[place]
        key = keys[place]
        hole = place
        while hole > 0 and keys[hole - 1] > key:
            keys[hole] = keys[hole - 1]
            pending[hole] = pending[hole - 1]
            hole -= 1
        keys[hole] = key
        pending[hole] = segment


@inner(nb.void(STATE, STATE))
def copy_owners(source: State, target: State) -> None:
    """Copy which route visits a segment."""
    for segment in range(len(source.route_of)):
        target.route_of[segment] = source.route_of[segment]


@inner(nb.void(STATE, STATE))
def copy_all(source: State, target: State) -> None:
    """Copy all routes."""
    for route in range(len(source.lengths)):
        copy_route(source, target, route)
    copy_owners(source, target)


@inner(nb.float64(STATE))
def energy(state: State) -> float:
    """Return what all routes use."""
    total = 0.0
    for route in range(len(state.loads)):
        total += state.loads[route]
    return total


@inner(nb.boolean(PROBLEM))
def nobody_flies(problem: Problem) -> bool:
    """Return whether no vehicle is left to take a visit."""
    most = -1.0
    for route in range(len(problem.budget)):
        most = max(most, problem.budget[route])
    return most < 0.0


@inner(nb.float64(LOSS, STATE, DESK, nb.int64, RANDOM))
def repair(loss: Loss, best: State, desk: Desk, iterations: int, rng: RandomState) -> float:
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
    least = lacking(problem, current)
    # Routes of one segment alone are the scale of what a repair gains or loses.
    alone = 0.0
    count = 0
    for segment in range(len(loss.is_open)):
        if loss.is_open[segment] == 1:
            desk.opened[count] = segment
            alone += problem.effort[segment]
            count += 1
    if count > 0 and nobody_flies(problem):
        return np.inf  # nothing could be inserted
    if least <= 0.0 or iterations <= 0 or count == 0:
        return least
    copy_all(current, trial)
    here = EXCESS_WEIGHT * least + energy(current)
    hot = HOT if iterations >= LONG else WARM
    temperature = hot * alone / count
    cooling = (COLD / hot) ** (1.0 / iterations)
    for _ in range(iterations):
        seed = ruin_about(problem, trial, desk.opened, count, rng)
        removed = remove_strings(problem, trial, pending, touched, seed, 6.0, 8.0, rng)
        shuffle_pending(problem, pending, removed, desk.keys, rng)
        for place in range(removed):
            touched[insert_anyway(problem, trial, pending[place], 0.02, rng)] = 1
        for route in range(routes):
            if touched[route] == 1:
                measure(problem, trial, route)
                orient(problem, trial, route, desk.came_from)
        lacks = lacking(problem, trial)
        there = EXCESS_WEIGHT * lacks + energy(trial)
        if lacks < least:
            least = lacks
            copy_all(trial, best)
            if lacks <= 0.0:
                for route in range(routes):
                    touched[route] = 0
                return 0.0
        accepted = there < here - temperature * math.log(1.0 - uniform(rng))
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


@inner(STATE(REPAIRS, nb.int64))
def repair_of(repairs: Repairs, lost: int) -> State:
    """Return the repair of a vehicle's loss, as views."""
    return State(
        repairs.visits[lost], repairs.legs[lost], repairs.lengths[lost], repairs.loads[lost], repairs.route_of[lost]
    )


@kernel(
    nb.float64(PROBLEM, TIMING, STATE, CLOCK, nb.int64, nb.float64, nb.boolean, LOSS, REPAIRS, DESK, nb.int64, RANDOM)
)
def try_loss(
    problem: Problem, timing: Timing, base: State, clock: Clock, lost: int, at_s: float, fly_again: bool, loss: Loss,
    repairs: Repairs, desk: Desk, effort: int, rng: RandomState,
) -> float:  # fmt: skip
    """Look for a repair of a loss, from the known one and from the survivors' tails; return what the best lacks.

    It is left in ``repairs``. ``loss`` and ``desk`` are work space; ``effort`` are the iterations from either
    beginning.
    """
    begin_loss(problem, timing, base, clock, lost, at_s, fly_again, loss)
    best = repair_of(repairs, lost)
    least = np.inf
    if repairs.known[lost] == 1:
        begin_repair(loss, base, best, True, desk.current, desk, rng)
        least = repair(loss, best, desk, effort, rng)
        if least <= 0.0:
            return least
    begin_repair(loss, base, best, False, desk.current, desk, rng)
    if repairs.known[lost] == 0:
        repairs.known[lost] = 1
        return repair(loss, best, desk, effort, rng)
    # The best repair so far is in ``best``: this one is worked on beside it.
    lacks = repair(loss, desk.other, desk, effort, rng)
    if lacks < least:
        copy_all(desk.other, best)
    return min(lacks, least)


@inner(
    nb.types.UniTuple(nb.int64, 2)(
        PROBLEM, TIMING, STATE, CLOCK, FLOATS, nb.int64, nb.int64, nb.boolean, LOSS, REPAIRS, DESK, nb.int64, RANDOM
    )
)
def scan(
    problem: Problem, timing: Timing, base: State, clock: Clock, events_s: FloatArray, interval: int, first: int,
    fly_again: bool, loss: Loss, repairs: Repairs, desk: Desk, effort: int, rng: RandomState,
) -> tuple[int, int]:  # fmt: skip
    """Go through the intervals between events from a late to early ones; stop at the first loss without a repair.

    Args:
        problem: the instance.
        timing: its times.
        base: the plan, measured.
        clock: its clock.
        events_s: (e,) ascending.
        interval: where to begin: the state from ``events_s[interval]`` on.
        first: the first vehicle to lose there.
        fly_again: whether vehicles that have landed may fly again.
        loss: work space.
        repairs: the known repairs; changed.
        desk: work space.
        effort: iterations for a loss.
        rng: random state.

    Returns:
        Interval and vehicle of the loss; (-1, 0) if there is none.
    """
    for here in range(interval, -1, -1):
        for lost in range(first if here == interval else 0, len(base.lengths)):
            if clock.durations_s[lost] <= events_s[here] + SAME_TIME_S:
                continue
            lacks = try_loss(
                problem, timing, base, clock, lost, events_s[here], fly_again, loss, repairs, desk, effort, rng
            )
            if lacks > 0.0:
                return here, lost
    return -1, 0
