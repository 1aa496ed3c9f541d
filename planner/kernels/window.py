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


INT_CUBE = nb.types.Array(nb.int64, 3, "C")
TIMING = nb.types.NamedTuple((CUBE, TABLE, TABLE, FLOATS, TABLE, INTS), Timing)
CLOCK = nb.types.NamedTuple((TABLE, TABLE, FLOATS), Clock)
LOSS = nb.types.NamedTuple((PROBLEM, INTS, INTS), Loss)
REPAIRS = nb.types.NamedTuple((INT_CUBE, CUBE, INT_TABLE, TABLE, INT_TABLE, INTS), Repairs)


@nb.njit(nb.void(PROBLEM, TIMING, STATE, CLOCK, nb.int64), cache=True, nogil=True)
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


@nb.njit(nb.void(PROBLEM, TIMING, STATE, CLOCK, nb.int64, nb.float64, nb.boolean, LOSS), cache=True, nogil=True)
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
            loss.problem.start[route] = problem.consumption[route] * problem.move[problem.profile[route], visit]
            loss.problem.idle[route] = problem.home[route, visit]
            first_open = done + 1
        else:
            left = max(0.0, problem.budget[route] - base.loads[route])
            loss.problem.budget[route] = left if fly_again else -1.0
            if length == 0 and timing.airborne[route] == 0:
                loss.problem.start[route] = problem.start[route]
            else:
                loss.problem.start[route] = timing.depot[route]
        for position in range(first_open, length):
            loss.is_open[base.visits[route, position] >> 1] = 1


@nb.njit(nb.float64(PROBLEM, STATE), cache=True, nogil=True)
def lacking(problem: Problem, state: State) -> float:
    """Return the energy that the routes of a repair lack, in percent of a battery."""
    total = 0.0
    for route in range(len(state.lengths)):
        if state.lengths[route] > 0:
            total += max(0.0, state.loads[route] - problem.budget[route])
    return total


@nb.njit(nb.int64(PROBLEM, STATE, nb.int64, nb.float64, RANDOM), cache=True, nogil=True)
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


@nb.njit(nb.void(LOSS, STATE, STATE, nb.boolean, STATE, RANDOM), cache=True, nogil=True)
def begin_repair(loss: Loss, base: State, earlier: State, follow: bool, state: State, rng: RandomState) -> None:
    """Set ``state`` to a first repair: survivors keep their tails, what is open is inserted by regret.

    With ``follow`` they keep the visits of an ``earlier`` repair instead, of this loss at another time or of a plan
    that differs a little, after the visits of their own that it knows nothing of because they were to end before it.
    """
    problem = loss.problem
    segments = len(state.route_of)
    state.route_of[:] = -1
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
    missing = np.empty(segments, dtype=np.int64)
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


@nb.njit(nb.int64(PROBLEM, STATE, INTS, RANDOM), cache=True, nogil=True)
def ruin_about(problem: Problem, state: State, opened: IntArray, rng: RandomState) -> int:
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
    return int(opened[below(rng, len(opened))])


@nb.njit(nb.void(PROBLEM, INTS, RANDOM), cache=True, nogil=True)
def shuffle_pending(problem: Problem, pending: IntArray, rng: RandomState) -> None:
    """Order what is to be inserted: at random, the far ones first, or the near ones first."""
    kind = below(rng, 4)
    keys = np.empty(len(pending))
    for place in range(len(pending)):
        if kind < 2:
            keys[place] = uniform(rng)
        elif kind == 2:
            keys[place] = -problem.effort[pending[place]]
        else:
            keys[place] = problem.effort[pending[place]]
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


@nb.njit(nb.void(STATE, STATE), cache=True, nogil=True)
def copy_all(source: State, target: State) -> None:
    """Copy all routes."""
    for route in range(len(source.lengths)):
        copy_route(source, target, route)
    target.route_of[:] = source.route_of


@nb.njit(nb.float64(LOSS, STATE, STATE, STATE, nb.int64, RANDOM), cache=True, nogil=True)
def repair(loss: Loss, current: State, trial: State, best: State, iterations: int, rng: RandomState) -> float:
    """Ruin and recreate until no route lacks energy, ``iterations`` at most; return what the best one lacks.

    Args:
        loss: the problem.
        current: a first repair; changed.
        trial: work space.
        best: set to the repair that lacks least.
        iterations: how many at most.
        rng: random state.
    """
    problem = loss.problem
    routes = len(current.lengths)
    copy_all(current, best)
    least = lacking(problem, current)
    opened = np.flatnonzero(loss.is_open).astype(np.int64)
    if len(opened) > 0 and problem.budget.max() < 0.0:
        return np.inf  # nobody flies: nothing could be inserted
    if least <= 0.0 or iterations <= 0 or len(opened) == 0:
        return least
    copy_all(current, trial)
    pending = np.empty(len(current.route_of), dtype=np.int64)
    touched = np.zeros(routes, dtype=np.int64)
    came_from = np.zeros((len(current.route_of), 2), dtype=np.int64)
    here = EXCESS_WEIGHT * least + current.loads.sum()
    # Routes of one segment alone are the scale of what a repair gains or loses.
    alone = 0.0
    for segment in opened:
        alone += problem.effort[segment]
    hot = HOT if iterations >= LONG else WARM
    temperature = hot * alone / len(opened)
    cooling = (COLD / hot) ** (1.0 / iterations)
    for _ in range(iterations):
        seed = ruin_about(problem, trial, opened, rng)
        removed = remove_strings(problem, trial, pending, touched, seed, 6.0, 8.0, rng)
        shuffle_pending(problem, pending[:removed], rng)
        for place in range(removed):
            touched[insert_anyway(problem, trial, pending[place], 0.02, rng)] = 1
        for route in range(routes):
            if touched[route] == 1:
                measure(problem, trial, route)
                orient(problem, trial, route, came_from)
        lacks = lacking(problem, trial)
        there = EXCESS_WEIGHT * lacks + trial.loads.sum()
        if lacks < least:
            least = lacks
            copy_all(trial, best)
            if lacks <= 0.0:
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
            current.route_of[:] = trial.route_of
            here = there
        else:
            trial.route_of[:] = current.route_of
        temperature *= cooling
    return least


@nb.njit(STATE(REPAIRS, nb.int64), cache=True, nogil=True)
def repair_of(repairs: Repairs, lost: int) -> State:
    """Return the repair of a vehicle's loss, as views."""
    return State(
        repairs.visits[lost], repairs.legs[lost], repairs.lengths[lost], repairs.loads[lost], repairs.route_of[lost]
    )


@nb.njit(
    nb.float64(PROBLEM, TIMING, STATE, CLOCK, nb.int64, nb.float64, nb.boolean, LOSS, REPAIRS, STATE, STATE,
               nb.int64, RANDOM), cache=True, nogil=True,
)  # fmt: skip
def try_loss(
    problem: Problem, timing: Timing, base: State, clock: Clock, lost: int, at_s: float, fly_again: bool, loss: Loss,
    repairs: Repairs, current: State, trial: State, effort: int, rng: RandomState,
) -> float:  # fmt: skip
    """Look for a repair of a loss, from the known one and from the survivors' tails; return what the best lacks.

    It is left in ``repairs``. ``loss``, ``current`` and ``trial`` are work space; ``effort`` are the iterations from
    either beginning, half of them from the known repair where there is one.
    """
    begin_loss(problem, timing, base, clock, lost, at_s, fly_again, loss)
    best = repair_of(repairs, lost)
    least = np.inf
    if repairs.known[lost] == 1:
        begin_repair(loss, base, best, True, current, rng)
        least = repair(loss, current, trial, best, effort, rng)
        if least <= 0.0:
            return least
    begin_repair(loss, base, best, False, current, rng)
    if repairs.known[lost] == 0:
        repairs.known[lost] = 1
        return repair(loss, current, trial, best, effort, rng)
    # The best repair so far is in ``best``: this one is worked on beside it.
    other = State(
        np.empty_like(best.visits),
        np.empty_like(best.legs),
        np.empty_like(best.lengths),
        np.empty_like(best.loads),
        np.empty_like(best.route_of),
    )
    lacks = repair(loss, current, trial, other, effort, rng)
    if lacks < least:
        copy_all(other, best)
    return min(lacks, least)


@nb.njit(
    nb.types.UniTuple(nb.int64, 2)(PROBLEM, TIMING, STATE, CLOCK, FLOATS, nb.int64, nb.int64, nb.boolean, LOSS, REPAIRS,
                                   STATE, STATE, nb.int64, RANDOM), cache=True, nogil=True,
)  # fmt: skip
def scan(
    problem: Problem, timing: Timing, base: State, clock: Clock, events_s: FloatArray, interval: int, first: int,
    fly_again: bool, loss: Loss, repairs: Repairs, current: State, trial: State, effort: int, rng: RandomState,
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
        current: work space.
        trial: work space.
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
                problem, timing, base, clock, lost, events_s[here], fly_again, loss, repairs, current, trial, effort,
                rng,
            )  # fmt: skip
            if lacks > 0.0:
                return here, lost
    return -1, 0
