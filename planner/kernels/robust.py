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
)
from planner.kernels.chance import below, uniform
from planner.kernels.compiled import inner, kernel
from planner.kernels.insertion import cheapest_place
from planner.kernels.ruin import position_of, remove_strings
from planner.kernels.tours import copy_route, insert, measure, orient
from planner.kernels.window import (
    CLOCK,
    DESK,
    LOSS,
    REPAIRS,
    SAME_TIME_S,
    TIMING,
    Clock,
    Desk,
    Loss,
    Repairs,
    Timing,
    begin_loss,
    begin_repair,
    copy_all,
    copy_owners,
    energy,
    repair,
    repair_of,
    scan,
    set_clock,
)

UNKNOWN = 200
"""How much more effort a repair takes that follows none."""


class Walk(NamedTuple):
    """Where a search stands: a plan, when its visits end, a repair for each of its losses at each probe."""

    base: State
    clock: Clock
    repairs: Repairs
    """``k`` for each probe."""
    lacks: FloatArray
    """For each repair what it lacks, in percent of a battery."""
    order: IntArray
    """Work space: the repairs in the order in which they are looked at."""


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


WALK = nb.types.NamedTuple((STATE, CLOCK, REPAIRS, FLOATS, INTS), Walk)
LIMITS = nb.types.NamedTuple((nb.float64, nb.boolean, nb.boolean, nb.int64, nb.float64), Limits)


@kernel(nb.void(PROBLEM, TIMING, STATE, CLOCK))
def set_clocks(problem: Problem, timing: Timing, base: State, clock: Clock) -> None:
    """Set times and expenses of all routes."""
    for route in range(len(base.lengths)):
        set_clock(problem, timing, base, clock, route)


@kernel(FLOATS(STATE, CLOCK), counted=True)
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


@kernel(
    nb.types.UniTuple(nb.float64, 2)(PROBLEM, TIMING, STATE, CLOCK, nb.boolean, LOSS, REPAIRS, DESK, nb.int64, RANDOM),
    counted=True,
)
def earliest(
    problem: Problem, timing: Timing, base: State, clock: Clock, fly_again: bool, loss: Loss, repairs: Repairs,
    desk: Desk, effort: int, rng: RandomState,
) -> tuple[float, float]:  # fmt: skip
    """Return where a plan's window begins and the begin of the interval that breaks it, -1 if none does."""
    events_s = events_of(base, clock)
    repairs.known[:] = 0
    interval = scan(
        problem, timing, base, clock, events_s, len(events_s) - 2, 0, fly_again, loss, repairs, desk, effort, rng
    )[0]
    if interval < 0:
        return 0.0, -1.0
    return events_s[interval + 1], events_s[interval]


@inner(nb.void(FLOATS, INTS))
def order_lacks(lacks: FloatArray, order: IntArray) -> None:
    """Set ``order`` to the numbers of the repairs, those that lack most first."""
    for place in range(len(order)):
        hole = place
        while hole > 0 and lacks[order[hole - 1]] < lacks[place]:
            order[hole] = order[hole - 1]
            hole -= 1
        order[hole] = place


@kernel(nb.float64(PROBLEM, TIMING, WALK, WALK, LOSS, DESK, FLOATS, LIMITS, nb.float64, RANDOM))
def assess(
    problem: Problem, timing: Timing, here: Walk, there: Walk, loss: Loss, desk: Desk, probes_s: FloatArray,
    limits: Limits, most: float, rng: RandomState,
) -> float:  # fmt: skip
    """Set the repairs of ``there`` after those of ``here`` and return what all of them lack.

    It ends as soon as they lack more than ``most``. What lacked most comes first.
    """
    total = 0.0
    fleet = len(there.base.lengths)
    order_lacks(here.lacks, there.order)
    for place in range(len(there.order)):
        slot = there.order[place]
        at_s = probes_s[slot // fleet]
        lost = slot % fleet
        there.lacks[slot] = 0.0
        there.repairs.known[slot] = 0
        if at_s < 0.0 or there.clock.durations_s[lost] <= at_s + SAME_TIME_S:
            continue
        begin_loss(problem, timing, there.base, there.clock, lost, at_s, limits.fly_again, loss)
        known = here.repairs.known[slot] == 1
        begin_repair(loss, there.base, repair_of(here.repairs, slot), known, desk.current, desk, rng)
        effort = limits.effort if known else UNKNOWN * limits.effort
        there.lacks[slot] = repair(loss, repair_of(there.repairs, slot), desk, effort, rng)
        there.repairs.known[slot] = 1
        total += float(there.lacks[slot])
        if total > most:
            return total
    return total


@inner(nb.void(STATE, nb.int64, nb.int64, nb.int64))
def turn_back(base: State, route: int, begin: int, end: int) -> None:
    """Fly visits [begin, end) of a route the other way round; ``measure`` follows."""
    visits = base.visits[route]
    while begin < end:
        end -= 1
        visits[begin], visits[end] = visits[end] ^ 1, visits[begin] ^ 1
        begin += 1


@inner(nb.void(STATE, nb.int64, nb.int64, nb.int64, nb.int64, INTS))
def exchange_tails(base: State, one: int, begin: int, other: int, other_begin: int, spare: IntArray) -> None:
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


@inner(nb.void(STATE, nb.int64, nb.int64, nb.int64, nb.int64, nb.int64, INTS))
def shift_string(base: State, one: int, begin: int, count: int, other: int, place: int, spare: IntArray) -> None:
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


@inner(nb.int64(PROBLEM, STATE, nb.int64, nb.float64, RANDOM))
def insert_within_budget(problem: Problem, base: State, segment: int, blink: float, rng: RandomState) -> int:
    """Insert a segment where it adds least within the budgets; return the route, -1 if there is no place."""
    best = np.inf
    best_route = -1
    best_position = 0
    best_visit = 0
    for route in range(len(base.lengths)):
        added, position, visit = cheapest_place(problem, base, route, segment, blink, rng)
        if added < best and base.loads[route] + added <= problem.budget[route]:
            best = added
            best_route = route
            best_position = position
            best_visit = visit
    if best_route >= 0:
        insert(problem, base, best_route, best_position, best_visit)
    return best_route


@inner(nb.boolean(PROBLEM, STATE, DESK, RANDOM))
def reinsert(problem: Problem, base: State, desk: Desk, rng: RandomState) -> bool:
    """Take a few visits out and put them back within the budgets; return whether all found a place."""
    pending, touched = desk.pending, desk.touched
    removed = remove_strings(problem, base, pending, touched, below(rng, len(base.route_of)), 3.0, 4.0, rng)
    for place in range(removed - 1, 0, -1):
        other = below(rng, place + 1)
        pending[place], pending[other] = pending[other], pending[place]
    blink = 0.02 if uniform(rng) < 0.5 else 0.3
    for place in range(removed):
        route = insert_within_budget(problem, base, pending[place], blink, rng)
        if route < 0:
            return False
        touched[route] = 1
    return True


@inner(nb.boolean(PROBLEM, STATE, DESK, RANDOM))
def change(problem: Problem, base: State, desk: Desk, rng: RandomState) -> bool:
    """Change a plan at random, a little; return whether it is one still. Routes that are touched need ``measure``."""
    touched = desk.touched
    kind = uniform(rng)
    if kind < 0.4:
        return bool(reinsert(problem, base, desk, rng))
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
        shift_string(base, one, begin, count, other, place, desk.spare)
        touched[other] = 1
        return True
    if other == one:
        return False
    touched[other] = 1
    if uniform(rng) < 0.5:
        turn_back(base, other, 0, base.lengths[other])
        place = base.lengths[other] - place
    exchange_tails(base, one, begin, other, place, desk.spare)
    return True


@inner(nb.boolean(PROBLEM, TIMING, STATE, CLOCK, INTS, LIMITS, nb.float64))
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
    return good and energy(base) <= most


@inner(nb.void(STATE, CLOCK, STATE, CLOCK, nb.int64))
def copy_timed(source: State, clock: Clock, target: State, target_clock: Clock, route: int) -> None:
    """Copy a route with its clock; ``route_of`` is the caller's."""
    copy_route(source, target, route)
    length = source.lengths[route]
    for position in range(length):
        target_clock.ends_s[route, position] = clock.ends_s[route, position]
        target_clock.spent[route, position] = clock.spent[route, position]
    target_clock.durations_s[route] = clock.durations_s[route]


@inner(nb.float64(FLOATS))
def sum_of(lacks: FloatArray) -> float:
    """Return the sum."""
    total = 0.0
    for lack in lacks:
        total += lack
    return total


@inner(nb.void(WALK, WALK))
def take_repairs(there: Walk, here: Walk) -> None:
    """Copy the repairs that were looked at, and what all lack."""
    for slot in range(len(here.lacks)):
        here.lacks[slot] = there.lacks[slot]
        here.repairs.known[slot] = there.repairs.known[slot]
        if there.repairs.known[slot] == 1:
            copy_all(repair_of(there.repairs, slot), repair_of(here.repairs, slot))


@kernel(
    nb.int64(
        PROBLEM, TIMING, WALK, WALK, LOSS, DESK, DESK, FLOATS, LIMITS, FLOATS, nb.float64, nb.int64, RANDOM,
    )
)  # fmt: skip
def walk(
    problem: Problem, timing: Timing, here: Walk, there: Walk, loss: Loss, desk: Desk, own: Desk,
    probes_s: FloatArray, limits: Limits, temperature: FloatArray, cooling: float, iterations: int, rng: RandomState,
) -> int:  # fmt: skip
    """Anneal a plan until all its losses at the probes are repaired; return the number of iterations that took.

    Args:
        problem: the instance; its budgets hold for the plan.
        timing: its times.
        here: where the search stands, assessed; changed.
        there: work space, its plan the same as that of ``here``.
        loss: work space.
        desk: work space of the repairs.
        own: work space of the walk.
        probes_s: the probe times, -1 for none.
        limits: what plans must keep.
        temperature: (1,) float64; changed.
        cooling: factor on the temperature after each iteration.
        iterations: how many at most.
        rng: random state.
    """
    fleet = len(here.base.lengths)
    touched = own.touched
    lacks = sum_of(here.lacks)
    for iteration in range(iterations):
        if lacks <= 0.0:
            return iteration
        whole = change(problem, there.base, own, rng)
        directed = uniform(rng) < 0.5
        if whole:
            for route in range(fleet):
                if touched[route] == 1:
                    measure(problem, there.base, route)
                    if directed:
                        orient(problem, there.base, route, own.came_from)
        most = lacks - temperature[0] * math.log(1.0 - uniform(rng))
        accepted = False
        if whole and allowed(
            problem, timing, there.base, there.clock, touched, limits, energy(here.base) + limits.rise
        ):
            found = assess(problem, timing, here, there, loss, desk, probes_s, limits, most, rng)
            if found <= most:
                accepted = True
                lacks = found
                take_repairs(there, here)
        for route in range(fleet):
            if touched[route] == 1:
                touched[route] = 0
                if accepted:
                    copy_timed(there.base, there.clock, here.base, here.clock, route)
                else:
                    copy_timed(here.base, here.clock, there.base, there.clock, route)
        if accepted:
            copy_owners(there.base, here.base)
        else:
            copy_owners(here.base, there.base)
        temperature[0] *= cooling
    return iterations
