"""Search on the re-plan window itself: a plan, and beside it the repairs of its critical losses, annealed together.

A few *probe* times stand for the window: the search looks for a plan all of whose losses at those times can be
repaired. What the repairs lack gives plateaus a slope. A repair is never made anew: it follows the one of the plan
that the search stands at, which differs by a few visits.

The plan is changed a little at a time, mostly where the losses that are looked at leave something else of it.
"""

from __future__ import annotations

import math
from typing import Annotated, NamedTuple

from planner.kernels.arrays import Floats, Ints, IntTable, Problem, RandomState, State, Table
from planner.kernels.compiling import inner, kernel
from planner.kernels.repair import (
    SAME_TIME_S,
    Loss,
    LossClock,
    LossTiming,
    Repairs,
    RepairWorkspace,
    begin_loss,
    begin_repair,
    insert_at_least_cost,
    repair,
    repair_of,
    set_clock,
    sum_of,
)
from planner.kernels.tours import (
    copy_all,
    copy_owners,
    copy_route,
    draw_integer,
    draw_uniform,
    find_position,
    measure,
    orient_visits,
    remove_strings,
    reverse_visits,
)

UNKNOWN = 200
"""How much more effort a repair takes that follows none."""
NOBODY, GROUND = -2, -1
"""In place of a visit."""
SAME = 2
"""In place of 1, for known: as the repair that it would have followed."""
TRIES = 6
"""How often a place early in the plan is looked for."""


class RobustWalk(NamedTuple):
    """Where a search stands: a plan, when its visits end, a repair for each of its losses at each probe."""

    base: State
    clock: LossClock
    repairs: Repairs
    """``k`` for each probe."""
    lacks: Annotated[Floats, "losses"]
    """For each repair what it lacks, in percent of a battery."""
    opened: Annotated[IntTable, "losses n"]
    """Which segments were open to each repair."""
    begun: Annotated[IntTable, "losses k"]
    """The visit that each survivor finishes first, NOBODY for the lost vehicle, GROUND for one landed."""
    left: Annotated[Table, "losses k"]
    """What each survivor may spend after it."""
    order: Annotated[Ints, "losses"]
    """Work space: the repairs in the order in which they are looked at."""


class WalkLimits(NamedTuple):
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
    early: float
    """How often a change is made where the losses that are looked at leave something else of the plan."""
    polish: float
    """How often a repair that lacks something is worked on although its loss leaves what it left before."""


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
def choose_segment(base: State, clock: LossClock, until_s: float, early: float, rng: RandomState) -> int:
    """Return a segment at random, ``early`` of all times one whose visit begins before a time."""
    segment = draw_integer(rng, len(base.route_of))
    if draw_uniform(rng) >= early:
        return segment
    for _ in range(TRIES):
        route = base.route_of[segment]
        position = find_position(base.visits[route], segment)
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
        route = insert_at_least_cost(problem, base, pending[place], blink, True, rng)
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
    begin = find_position(base.visits[one], segment)
    length = base.lengths[one]
    touched[one] = 1
    if kind < 0.5:
        reverse_visits(base.visits[one], 0, length)
        return True
    if kind < 0.65:
        reverse_visits(base.visits[one], begin, begin + 1 + draw_integer(rng, length - begin))
        return True
    near = problem.near[segment, draw_integer(rng, min(12, problem.near.shape[1]))]
    other = base.route_of[near]
    place = find_position(base.visits[other], near) + draw_integer(rng, 2)
    if kind < 0.9:
        count = 1 + draw_integer(rng, min(4, length - begin))
        if other == one:
            if begin <= place <= begin + count:
                return False
            if place > begin:
                place -= count
        if draw_uniform(rng) < 0.5:
            reverse_visits(base.visits[one], begin, begin + count)
        shift_string(base, one, begin, count, other, place, desk.spare)
        touched[other] = 1
        return True
    if other == one:
        return False
    touched[other] = 1
    if draw_uniform(rng) < 0.5:
        reverse_visits(base.visits[other], 0, base.lengths[other])
        place = base.lengths[other] - place
    exchange_tails(base, one, begin, other, place, desk.spare)
    return True


@inner()
def sort_lacks(lacks: Floats, order: Ints) -> None:
    """Set ``order`` to the numbers of the repairs, those that lack most first."""
    for place in range(len(order)):
        hole = place
        while hole > 0 and lacks[order[hole - 1]] < lacks[place]:
            order[hole] = order[hole - 1]
            hole -= 1
        order[hole] = place


@inner()
def describe_loss(loss: Loss, there: RobustWalk, slot: int, lost: int) -> None:
    """Note what a loss leaves: two repairs of which the same is noted are repairs of the same."""
    for segment in range(len(loss.is_open)):
        there.opened[slot, segment] = loss.is_open[segment]
    base = there.base
    for route in range(len(base.lengths)):
        there.left[slot, route] = loss.problem.budget[route]
        if route == lost:
            there.begun[slot, route] = NOBODY
        elif loss.done[route] < base.lengths[route]:
            there.begun[slot, route] = base.visits[route, loss.done[route]]
        else:
            there.begun[slot, route] = GROUND


@inner()
def is_alike(here: RobustWalk, there: RobustWalk, slot: int) -> bool:
    """Return whether a loss leaves the same of both plans."""
    for route in range(len(here.base.lengths)):
        if here.begun[slot, route] != there.begun[slot, route] or here.left[slot, route] != there.left[slot, route]:
            return False
    alike = True
    for segment in range(len(here.base.route_of)):
        alike = alike and here.opened[slot, segment] == there.opened[slot, segment]
    return alike


@kernel()
def assess_repairs(
    problem: Problem, timing: LossTiming, here: RobustWalk, there: RobustWalk, loss: Loss, desk: RepairWorkspace,
    probes_s: Floats, limits: WalkLimits, most: float, rng: RandomState,
) -> float:  # fmt: skip
    """Set the repairs of ``there`` after those of ``here`` and return what all of them lack.

    It ends as soon as they lack more than ``most``. What lacked most comes first.
    """
    total = 0.0
    fleet = len(there.base.lengths)
    sort_lacks(here.lacks, there.order)
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
        describe_loss(loss, there, slot, lost)
        if known and is_alike(here, there, slot) and (here.lacks[slot] <= 0.0 or draw_uniform(rng) >= limits.polish):
            there.lacks[slot] = here.lacks[slot]
            there.repairs.known[slot] = SAME
        else:
            begin_repair(loss, there.base, repair_of(here.repairs, slot), known, desk.current, desk, rng)
            effort = limits.effort if known else UNKNOWN * limits.effort
            there.lacks[slot] = repair(loss, repair_of(there.repairs, slot), desk, effort, rng)
            there.repairs.known[slot] = 1
        total += float(there.lacks[slot])
        if total > most:
            return total
    return total


@inner()
def check_limits(
    problem: Problem,
    timing: LossTiming,
    base: State,
    clock: LossClock,
    touched: Ints,
    limits: WalkLimits,
    most: float,
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
    return good and sum_of(base.loads) <= most


@kernel()
def take_repairs(there: RobustWalk, here: RobustWalk) -> None:
    """Copy the repairs that were looked at, and what all lack."""
    for slot in range(len(here.lacks)):
        here.lacks[slot] = there.lacks[slot]
        if there.repairs.known[slot] == SAME:
            continue
        here.repairs.known[slot] = there.repairs.known[slot]
        if there.repairs.known[slot] == 1:
            copy_all(repair_of(there.repairs, slot), repair_of(here.repairs, slot))
            for segment in range(len(here.base.route_of)):
                here.opened[slot, segment] = there.opened[slot, segment]
            for route in range(len(here.base.lengths)):
                here.begun[slot, route] = there.begun[slot, route]
                here.left[slot, route] = there.left[slot, route]


@kernel()
def anneal_plan(
    problem: Problem, timing: LossTiming, here: RobustWalk, there: RobustWalk, loss: Loss, desk: RepairWorkspace,
    own: RepairWorkspace,
    probes_s: Floats, limits: WalkLimits, temperature: Floats, cooling: float, iterations: int,
    rng: RandomState,
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
        until_s = probes_s[draw_integer(rng, len(probes_s))]
        whole = change_plan(problem, there.base, there.clock, max(until_s, probes_s[0]), limits.early, own, rng)
        directed = draw_uniform(rng) < 0.5
        if whole:
            for route in range(fleet):
                if touched[route] == 1:
                    measure(problem, there.base, route)
                    if directed:
                        orient_visits(problem, there.base, route, own.came_from)
        most = lacks - temperature[0] * math.log(1.0 - draw_uniform(rng))
        accepted = False
        if whole and check_limits(
            problem, timing, there.base, there.clock, touched, limits, sum_of(here.base.loads) + limits.rise
        ):
            found = assess_repairs(problem, timing, here, there, loss, desk, probes_s, limits, most, rng)
            if found <= most:
                accepted = True
                lacks = found
                take_repairs(there, here)
        for route in range(fleet):
            if touched[route] == 1:
                touched[route] = 0
                source, target = (there, here) if accepted else (here, there)
                copy_route(source.base, target.base, route)
                set_clock(problem, timing, target.base, target.clock, route)
        if accepted:
            copy_owners(there.base, here.base)
        else:
            copy_owners(here.base, there.base)
        temperature[0] *= cooling
    return iterations
