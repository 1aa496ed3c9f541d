"""Search on the re-plan window itself: a plan, and beside it the repairs of its critical losses, annealed together.

A few *probe* times stand for the window: the search looks for a plan all of whose losses at those times can be
repaired. What the repairs lack gives plateaus a slope. A repair is never made anew: it follows the one of the plan
that the search stands at, which differs by a few visits.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numba as nb
import numpy as np

from planner.kernels.arrays import (
    FLOATS,
    INTS,
    PROBLEM,
    RANDOM,
    STATE,
    FloatArray,
    IntArray,
    Problem,
    RandomState,
    State,
    Weights,
)
from planner.kernels.chance import below, uniform
from planner.kernels.insertion import insert_cheapest
from planner.kernels.ruin import position_of, remove_strings
from planner.kernels.tours import copy_route, measure, orient
from planner.kernels.window import (
    CLOCK,
    LOSS,
    REPAIRS,
    SAME_TIME_S,
    TIMING,
    Clock,
    Loss,
    Repairs,
    Timing,
    begin_loss,
    begin_repair,
    copy_all,
    repair,
    repair_of,
    scan,
    set_clock,
)


class Walk(NamedTuple):
    """Where a search stands: a plan, when its visits end, a repair for each of its losses at each probe."""

    base: State
    clock: Clock
    repairs: Repairs
    """``k`` for each probe."""
    lacks: FloatArray
    """For each repair what it lacks, in percent of a battery."""


class Limits(NamedTuple):
    """What plans of a search must keep, and how it goes on."""

    longest_s: float
    """No route is longer."""
    all_vehicles: bool
    """Whether no vehicle may stay without a visit."""
    fly_again: bool
    """Whether vehicles that have landed may fly again after a loss."""
    effort: int
    """Iterations of ruin and recreate for a repair that follows another."""
    rise: float
    """A plan that uses this much more energy than the one before is not looked at."""


WALK = nb.types.NamedTuple((STATE, CLOCK, REPAIRS, FLOATS), Walk)
LIMITS = nb.types.NamedTuple((nb.float64, nb.boolean, nb.boolean, nb.int64, nb.float64), Limits)


@nb.njit(nb.void(PROBLEM, TIMING, STATE, CLOCK), cache=True, nogil=True)
def set_clocks(problem: Problem, timing: Timing, base: State, clock: Clock) -> None:
    """Set times and expenses of all routes."""
    for route in range(len(base.lengths)):
        set_clock(problem, timing, base, clock, route)


@nb.njit(FLOATS(STATE, CLOCK), cache=True, nogil=True)
def events_of(base: State, clock: Clock) -> FloatArray:
    """Return 0 and the times at which a visit ends or a vehicle lands, ascending."""
    times = np.empty(1 + len(base.lengths) + base.lengths.sum())
    times[0] = 0.0
    count = 1
    for route in range(len(base.lengths)):
        times[count] = clock.durations_s[route]
        count += 1
        for position in range(base.lengths[route]):
            times[count] = clock.ends_s[route, position]
            count += 1
    times.sort()
    kept = 1
    for place in range(1, count):
        if times[place] > times[kept - 1] + SAME_TIME_S:
            times[kept] = times[place]
            kept += 1
    return times[:kept].copy()


@nb.njit(
    nb.types.UniTuple(nb.float64, 2)(PROBLEM, TIMING, STATE, CLOCK, nb.boolean, LOSS, REPAIRS, STATE, STATE, nb.int64,
                                     RANDOM), cache=True, nogil=True,
)  # fmt: skip
def earliest(
    problem: Problem, timing: Timing, base: State, clock: Clock, fly_again: bool, loss: Loss, repairs: Repairs,
    current: State, trial: State, effort: int, rng: RandomState,
) -> tuple[float, float]:  # fmt: skip
    """Return where a plan's window begins and the begin of the interval that breaks it, -1 if none does."""
    events_s = events_of(base, clock)
    repairs.known[:] = 0
    interval = scan(
        problem, timing, base, clock, events_s, len(events_s) - 2, 0, fly_again, loss, repairs, current, trial, effort,
        rng,
    )[0]  # fmt: skip
    if interval < 0:
        return 0.0, -1.0
    return events_s[interval + 1], events_s[interval]


@nb.njit(
    nb.float64(PROBLEM, TIMING, WALK, WALK, LOSS, STATE, STATE, FLOATS, LIMITS, nb.float64, RANDOM),
    cache=True, nogil=True,
)  # fmt: skip
def assess(
    problem: Problem, timing: Timing, here: Walk, there: Walk, loss: Loss, current: State, trial: State,
    probes_s: FloatArray, limits: Limits, most: float, rng: RandomState,
) -> float:  # fmt: skip
    """Set the repairs of ``there`` after those of ``here`` and return what all of them lack.

    It ends as soon as they lack more than ``most``. What lacked most comes first.
    """
    total = 0.0
    fleet = len(there.base.lengths)
    for slot in np.argsort(-here.lacks):
        at_s = probes_s[slot // fleet]
        lost = slot % fleet
        there.lacks[slot] = 0.0
        there.repairs.known[slot] = 0
        if at_s < 0.0 or there.clock.durations_s[lost] <= at_s + SAME_TIME_S:
            continue
        begin_loss(problem, timing, there.base, there.clock, lost, at_s, limits.fly_again, loss)
        known = here.repairs.known[slot] == 1
        begin_repair(loss, there.base, repair_of(here.repairs, slot), known, current, rng)
        effort = limits.effort if known else 10 * limits.effort
        there.lacks[slot] = repair(loss, current, trial, repair_of(there.repairs, slot), effort, rng)
        there.repairs.known[slot] = 1
        total += float(there.lacks[slot])
        if total > most:
            return total
    return total


@nb.njit(nb.void(STATE, nb.int64, nb.int64, nb.int64), cache=True, nogil=True)
def turn_back(base: State, route: int, begin: int, end: int) -> None:
    """Fly visits [begin, end) of a route the other way round; ``measure`` follows."""
    visits = base.visits[route]
    while begin < end:
        end -= 1
        visits[begin], visits[end] = visits[end] ^ 1, visits[begin] ^ 1
        begin += 1


@nb.njit(nb.void(STATE, nb.int64, nb.int64, nb.int64, nb.int64), cache=True, nogil=True)
def exchange_tails(base: State, one: int, begin: int, other: int, other_begin: int) -> None:
    """Exchange what two routes do from a position of each on; ``measure`` follows."""
    kept = base.visits[one, begin : base.lengths[one]].copy()
    count = base.lengths[other] - other_begin
    base.visits[one, begin : begin + count] = base.visits[other, other_begin : base.lengths[other]]
    base.visits[other, other_begin : other_begin + len(kept)] = kept
    base.lengths[one] = begin + count
    base.lengths[other] = other_begin + len(kept)


@nb.njit(nb.void(STATE, nb.int64, nb.int64, nb.int64, nb.int64, nb.int64), cache=True, nogil=True)
def shift_string(base: State, one: int, begin: int, count: int, other: int, place: int) -> None:
    """Move ``count`` visits of a route before position ``place`` of another one, or of what is left of itself."""
    string = base.visits[one, begin : begin + count].copy()
    for position in range(begin, base.lengths[one] - count):
        base.visits[one, position] = base.visits[one, position + count]
    base.lengths[one] -= count
    for position in range(base.lengths[other] - 1, place - 1, -1):
        base.visits[other, position + count] = base.visits[other, position]
    base.visits[other, place : place + count] = string
    base.lengths[other] += count


@nb.njit(nb.boolean(PROBLEM, STATE, INTS, INTS, RANDOM), cache=True, nogil=True)
def reinsert(problem: Problem, base: State, pending: IntArray, touched: IntArray, rng: RandomState) -> bool:
    """Take a few visits out and put them back within the budgets; return whether all found a place."""
    removed = remove_strings(problem, base, pending, touched, below(rng, len(base.route_of)), 3.0, 4.0, rng)
    for place in range(removed - 1, 0, -1):
        other = below(rng, place + 1)
        pending[place], pending[other] = pending[other], pending[place]
    weights = Weights(1.0, 0.0, 0.0, 1.0, 1.0, 0.0, 0.0, 0.0, 0.0)
    blink = 0.02 if uniform(rng) < 0.5 else 0.3
    for place in range(removed):
        route = insert_cheapest(problem, weights, base, pending[place], blink, rng)
        if route < 0:
            return False
        touched[route] = 1
    return True


@nb.njit(nb.boolean(PROBLEM, STATE, INTS, INTS, RANDOM), cache=True, nogil=True)
def change(problem: Problem, base: State, pending: IntArray, touched: IntArray, rng: RandomState) -> bool:
    """Change a plan at random, a little; return whether it is one still. Routes in ``touched`` need ``measure``."""
    kind = uniform(rng)
    if kind < 0.4:
        return bool(reinsert(problem, base, pending, touched, rng))
    segment = below(rng, len(base.route_of))
    one = base.route_of[segment]
    begin = position_of(base, one, segment)
    length = base.lengths[one]
    touched[one] = 1
    if kind < 0.5:
        turn_back(base, one, 0, length)
        return True
    if kind < 0.65:
        turn_back(base, one, begin, begin + 1 + below(rng, length - begin))
        return True
    near = problem.near[segment, below(rng, min(12, problem.near.shape[1]))]
    other = base.route_of[near]
    place = position_of(base, other, near) + below(rng, 2)
    if kind < 0.9:
        count = 1 + below(rng, min(4, length - begin))
        if other == one:
            if begin <= place <= begin + count:
                return False
            if place > begin:
                place -= count
        if uniform(rng) < 0.5:
            turn_back(base, one, begin, begin + count)
        shift_string(base, one, begin, count, other, place)
        touched[other] = 1
        return True
    if other == one:
        return False
    touched[other] = 1
    if uniform(rng) < 0.5:
        turn_back(base, other, 0, base.lengths[other])
        place = base.lengths[other] - place
    exchange_tails(base, one, begin, other, place)
    return True


@nb.njit(nb.boolean(PROBLEM, TIMING, STATE, CLOCK, INTS, LIMITS, nb.float64), cache=True, nogil=True)
def allowed(
    problem: Problem, timing: Timing, base: State, clock: Clock, touched: IntArray, limits: Limits, most: float
) -> bool:
    """Measure the touched routes; return whether the plan keeps its limits and uses no more than ``most``."""
    good = True
    for route in range(len(base.lengths)):
        if touched[route] == 0:
            continue
        set_clock(problem, timing, base, clock, route)
        if base.lengths[route] == 0:
            good = good and not limits.all_vehicles
        elif base.loads[route] > problem.budget[route] or clock.durations_s[route] > limits.longest_s:
            good = False
    return good and base.loads.sum() <= most


@nb.njit(nb.void(STATE, CLOCK, STATE, CLOCK, nb.int64), cache=True, nogil=True)
def copy_timed(source: State, clock: Clock, target: State, target_clock: Clock, route: int) -> None:
    """Copy a route with its clock; ``route_of`` is the caller's."""
    copy_route(source, target, route)
    length = source.lengths[route]
    target_clock.ends_s[route, :length] = clock.ends_s[route, :length]
    target_clock.spent[route, :length] = clock.spent[route, :length]
    target_clock.durations_s[route] = clock.durations_s[route]


@nb.njit(
    nb.int64(PROBLEM, TIMING, WALK, WALK, LOSS, STATE, STATE, FLOATS, LIMITS, FLOATS, nb.float64, nb.int64, RANDOM),
    cache=True, nogil=True,
)  # fmt: skip
def walk(
    problem: Problem, timing: Timing, here: Walk, there: Walk, loss: Loss, current: State, trial: State,
    probes_s: FloatArray, limits: Limits, temperature: FloatArray, cooling: float, iterations: int, rng: RandomState,
) -> int:  # fmt: skip
    """Anneal a plan until all its losses at the probes are repaired; return the number of iterations that took.

    Args:
        problem: the instance; its budgets hold for the plan.
        timing: its times.
        here: where the search stands, assessed; changed.
        there: work space, its plan the same as that of ``here``.
        loss: work space.
        current: work space.
        trial: work space.
        probes_s: the probe times, -1 for none.
        limits: what plans must keep.
        temperature: (1,) float64; changed.
        cooling: factor on the temperature after each iteration.
        iterations: how many at most.
        rng: random state.
    """
    fleet = len(here.base.lengths)
    pending = np.empty(len(here.base.route_of), dtype=np.int64)
    touched = np.zeros(fleet, dtype=np.int64)
    came_from = np.zeros((len(here.base.route_of), 2), dtype=np.int64)
    value = here.lacks.sum()
    for iteration in range(iterations):
        if value <= 0.0:
            return iteration
        whole = change(problem, there.base, pending, touched, rng)
        directed = uniform(rng) < 0.5
        if whole:
            for route in range(fleet):
                if touched[route] == 1:
                    measure(problem, there.base, route)
                    if directed:
                        orient(problem, there.base, route, came_from)
        most = value - temperature[0] * math.log(1.0 - uniform(rng))
        accepted = False
        if whole and allowed(
            problem, timing, there.base, there.clock, touched, limits, here.base.loads.sum() + limits.rise
        ):
            lacks = assess(problem, timing, here, there, loss, current, trial, probes_s, limits, most, rng)
            if lacks <= most:
                accepted = True
                value = lacks
        if accepted:
            here.lacks[:] = there.lacks
            here.repairs.known[:] = there.repairs.known
            for slot in range(len(here.lacks)):
                if there.repairs.known[slot] == 1:
                    copy_all(repair_of(there.repairs, slot), repair_of(here.repairs, slot))
        for route in range(fleet):
            if touched[route] == 1:
                touched[route] = 0
                if accepted:
                    copy_timed(there.base, there.clock, here.base, here.clock, route)
                else:
                    copy_timed(here.base, here.clock, there.base, there.clock, route)
        if accepted:
            here.base.route_of[:] = there.base.route_of
        else:
            there.base.route_of[:] = here.base.route_of
        temperature[0] *= cooling
    return iterations
