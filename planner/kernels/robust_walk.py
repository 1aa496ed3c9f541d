"""Search for the re-plan window: anneals a plan together with the repairs of its critical losses.

A few *probe* times represent the window: the search looks for a plan whose losses at those times can all be repaired.
The energy that repairs lack gives plateaus a slope. A repair is never built from scratch: it follows the repair of the
current plan, which differs by a few visits.

Each step changes the plan a little, mostly in the part that affects the probed losses.
"""

from __future__ import annotations

import math
from typing import Annotated, NamedTuple

from planner.kernels.arrays import Floats, Ints, IntTable, Problem, RandomState, State, Table
from planner.kernels.compiling import inner, kernel
from planner.kernels.repair import (
    Loss,
    LossClock,
    LossTiming,
    Repairs,
    RepairWorkspace,
    begin_loss,
    begin_repair,
    insert_at_least_cost,
    is_possible_loss,
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
"""Factor on the effort of a repair that follows no other."""
NOBODY, GROUND = -2, -1
"""Markers that replace a visit in ``begun``."""
SAME = 2
"""Value of ``known`` (instead of 1) for a repair that is identical to the one it would follow."""
TRIES = 6
"""Attempts to find a position early in the plan."""


class RobustWalk(NamedTuple):
    """State of a search: a plan, the end times of its visits, a repair for each loss at each probe."""

    base: State
    clock: LossClock
    repairs: Repairs
    """One repair for each loss, at the first probe, then at the second, and so on."""
    lacks: Annotated[Floats, "losses"]
    """Energy that each repair lacks, in percent of a battery."""
    opened: Annotated[IntTable, "losses n"]
    """Segments that were open to each repair."""
    begun: Annotated[IntTable, "losses k"]
    """Visit that each survivor finishes first; NOBODY for a lost vehicle, GROUND for a landed one."""
    left: Annotated[Table, "losses k"]
    """Energy that each survivor may spend after that visit."""
    order: Annotated[Ints, "losses"]
    """Work space: the order in which repairs are evaluated."""


class WalkLimits(NamedTuple):
    """Limits on the plans of a search, and its settings."""

    longest_s: float
    """Maximum duration of a route."""
    all_vehicles: bool
    """Whether every vehicle must have a visit."""
    fly_again: bool
    """Whether landed vehicles may fly again after a loss."""
    effort: int
    """Iterations of ruin and recreate for a repair that follows another."""
    rise: float
    """Maximum energy increase from one plan to the next; plans beyond it are not evaluated."""
    early: float
    """Share of changes made in the part of the plan that affects the probed losses."""
    polish: float
    """Share of repairs with missing energy that are improved although their loss leaves the same problem as before."""
    base_pct: float
    """Counts for every loss without a repair, in addition to what its repair lacks."""
    most_pct: float
    """Maximum of what the repair of one loss lacks that counts."""


@inner()
def exchange_tails(base: State, one: int, begin: int, other: int, other_begin: int, spare: Ints) -> None:
    """Exchange the tails of two routes, each from its given position; call ``measure`` afterwards."""
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
    """Move ``count`` visits of a route before position ``place`` of another route, or of the rest of the same route."""
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
    """Return a random segment; with probability ``early`` one whose visit begins before ``until_s``."""
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
    """Remove a few visits near a segment and re-insert them within the budgets; return whether all fitted."""
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
    """Make a small random change to a plan; return whether it stays valid. Touched routes need ``measure``."""
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
    """Set ``order`` to the repair numbers, largest missing energy first."""
    for place in range(len(order)):
        hole = place
        while hole > 0 and lacks[order[hole - 1]] < lacks[place]:
            order[hole] = order[hole - 1]
            hole -= 1
        order[hole] = place


@inner()
def describe_loss(loss: Loss, there: RobustWalk, slot: int, number: int) -> None:
    """Record the state after a loss: two repairs with equal records solve the same problem."""
    for segment in range(len(loss.is_open)):
        there.opened[slot, segment] = loss.is_open[segment]
    base = there.base
    for route in range(len(base.lengths)):
        there.left[slot, route] = loss.problem.budget[route]
        if loss.who[number, route] == 1:
            there.begun[slot, route] = NOBODY
        elif loss.done[route] < base.lengths[route]:
            there.begun[slot, route] = base.visits[route, loss.done[route]]
        else:
            there.begun[slot, route] = GROUND


@inner()
def is_alike(here: RobustWalk, there: RobustWalk, slot: int) -> bool:
    """Return whether a loss leaves the same problem in both plans."""
    for route in range(len(here.base.lengths)):
        if here.begun[slot, route] != there.begun[slot, route] or here.left[slot, route] != there.left[slot, route]:
            return False
    alike = True
    for segment in range(len(here.base.route_of)):
        alike = alike and here.opened[slot, segment] == there.opened[slot, segment]
    return alike


@inner()
def weigh_lack(limits: WalkLimits, lacks: float) -> float:
    """Return what a loss contributes to the total that a walk minimises."""
    return 0.0 if lacks <= 0.0 else limits.base_pct + min(lacks, limits.most_pct)


@kernel()
def assess_repairs(
    problem: Problem, timing: LossTiming, here: RobustWalk, there: RobustWalk, loss: Loss, desk: RepairWorkspace,
    probes_s: Floats, limits: WalkLimits, most: float, rng: RandomState,
) -> float:  # fmt: skip
    """Compute the repairs of ``there`` from those of ``here``; return their total of ``weigh_lack``.

    Stops as soon as the total exceeds ``most``. The repairs that lacked most come first.
    """
    total = 0.0
    losses = len(loss.who)
    sort_lacks(here.lacks, there.order)
    for place in range(len(there.order)):
        slot = there.order[place]
        at_s = probes_s[slot // losses]
        number = slot % losses
        there.lacks[slot] = 0.0
        there.repairs.known[slot] = 0
        if at_s < 0.0 or not is_possible_loss(there.clock, loss, number, at_s):
            continue
        begin_loss(problem, timing, there.base, there.clock, number, at_s, limits.fly_again, loss)
        known = here.repairs.known[slot] == 1
        describe_loss(loss, there, slot, number)
        if known and is_alike(here, there, slot) and (here.lacks[slot] <= 0.0 or draw_uniform(rng) >= limits.polish):
            there.lacks[slot] = here.lacks[slot]
            there.repairs.known[slot] = SAME
        else:
            begin_repair(loss, there.base, repair_of(here.repairs, slot), known, desk.current, desk, rng)
            effort = limits.effort if known else UNKNOWN * limits.effort
            there.lacks[slot] = repair(loss, repair_of(there.repairs, slot), desk, effort, rng)
            there.repairs.known[slot] = 1
        total += weigh_lack(limits, there.lacks[slot])
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
    """Measure the touched routes; return whether the plan meets its limits and uses at most ``most``."""
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
    """Copy the evaluated repairs and the missing energy of all."""
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
    """Anneal a plan until all its losses at the probes are repaired; return the number of iterations used.

    Args:
        problem: the instance; its budgets apply to the plan.
        timing: its times.
        here: the current state, assessed; changed.
        there: work space with the same plan as ``here``.
        loss: work space.
        desk: work space of the repairs.
        own: work space of the walk.
        probes_s: the probe times, -1 for none.
        limits: the limits on plans.
        temperature: (1,) float64; changed.
        cooling: factor on the temperature after each iteration.
        iterations: maximum number of iterations.
        rng: random state.
    """
    fleet = len(here.base.lengths)
    touched = own.touched
    lacks = 0.0
    for missing in here.lacks:
        lacks += weigh_lack(limits, missing)
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
