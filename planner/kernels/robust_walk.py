"""Search on the re-plan window itself: a plan, and beside it the repairs of its critical losses, annealed together.

A few *probe* times stand for the window: the search looks for a plan all of whose losses at those times can be
repaired. What the repairs lack gives plateaus a slope. A repair is never made anew: it follows the one of the plan
that the search stands at, which differs by a few visits.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from planner.kernels.arrays import Floats, Ints, IntTable, Problem, RandomState, State, Table
from planner.kernels.compiled import inner, kernel
from planner.kernels.loss_problem import SAME_TIME_S, Loss, LossClock, LossTiming, begin_loss, set_clock
from planner.kernels.plan_changes import change_plan
from planner.kernels.random_numbers import draw_integer, draw_uniform
from planner.kernels.repair import RepairWorkspace, begin_repair, repair, total_energy
from planner.kernels.tours import copy_all, copy_owners, copy_route, measure, orient_visits
from planner.kernels.window_scan import Repairs, repair_of, scan_losses

UNKNOWN = 200
"""How much more effort a repair takes that follows none."""
NOBODY, GROUND = -2, -1
"""In place of a visit."""
SAME = 2
"""In place of 1, for known: as the repair that it would have followed."""


class RobustWalk(NamedTuple):
    """Where a search stands: a plan, when its visits end, a repair for each of its losses at each probe."""

    base: State
    clock: LossClock
    repairs: Repairs
    """``k`` for each probe."""
    lacks: Floats
    """For each repair what it lacks, in percent of a battery."""
    opened: IntTable
    """(repairs, n): which segments were open to each repair."""
    begun: IntTable
    """(repairs, k): the visit that each survivor finishes first, NOBODY for the lost vehicle, GROUND for one landed."""
    left: Table
    """(repairs, k): what each survivor may spend after it."""
    order: Ints
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


@kernel()
def set_clocks(problem: Problem, timing: LossTiming, base: State, clock: LossClock) -> None:
    """Set times and expenses of all routes."""
    for route in range(len(base.lengths)):
        set_clock(problem, timing, base, clock, route)


@kernel(counted=True)
def events_of(timing: LossTiming, base: State, clock: LossClock) -> Floats:
    """Return 0 and the times at which a visit ends or a vehicle lands, or will once survivors answer, ascending."""
    times = np.empty(1 + 2 * (len(base.lengths) + base.lengths.sum()))
    times[0] = 0.0
    count = 1
    for route in range(len(base.lengths)):
        times[count] = clock.durations_s[route]
        times[count + 1] = max(0.0, clock.durations_s[route] - timing.answer_s)
        count += 2
        for position in range(base.lengths[route]):
            times[count] = clock.ends_s[route, position]
            times[count + 1] = max(0.0, clock.ends_s[route, position] - timing.answer_s)
            count += 2
    times.sort()
    kept = 1
    for place in range(1, count):
        if times[place] > times[kept - 1] + SAME_TIME_S:
            times[kept] = times[place]
            kept += 1
    return times[:kept].copy()


@kernel(counted=True)
def find_window_begin(
    problem: Problem, timing: LossTiming, base: State, clock: LossClock, fly_again: bool, loss: Loss, repairs: Repairs,
    desk: RepairWorkspace, effort: int, rng: RandomState,
) -> tuple[float, float]:  # fmt: skip
    """Return where a plan's window begins and the begin of the interval that breaks it, -1 if none does."""
    events_s = events_of(timing, base, clock)
    repairs.known[:] = 0
    interval = scan_losses(
        problem, timing, base, clock, events_s, len(events_s) - 2, 0, fly_again, loss, repairs, desk, effort, rng
    )[0]
    if interval < 0:
        return 0.0, -1.0
    return events_s[interval + 1], events_s[interval]


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
    return good and total_energy(base) <= most


@inner()
def copy_timed(source: State, clock: LossClock, target: State, target_clock: LossClock, route: int) -> None:
    """Copy a route with its clock; ``route_of`` is the caller's."""
    copy_route(source, target, route)
    length = source.lengths[route]
    for position in range(length):
        target_clock.ends_s[route, position] = clock.ends_s[route, position]
        target_clock.spent[route, position] = clock.spent[route, position]
    target_clock.durations_s[route] = clock.durations_s[route]


@inner()
def sum_of(lacks: Floats) -> float:
    """Return the sum."""
    total = 0.0
    for lack in lacks:
        total += lack
    return total


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
            problem, timing, there.base, there.clock, touched, limits, total_energy(here.base) + limits.rise
        ):
            found = assess_repairs(problem, timing, here, there, loss, desk, probes_s, limits, most, rng)
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
