"""The problem after a loss, its repairs, and all losses of a plan, scanned from the end.

A loss changes where survivors start, what they may still spend, and which segments are open. ``begin_loss`` writes that
to separate arrays in the numbering of the full instance, so open segments are not copied. ``planner.replan`` defines
the state after a loss.

A repair is a state that visits exactly the open segments. Its *excess* is the energy that its routes lack, in percent
of a battery.
"""

from __future__ import annotations

import math
from typing import Annotated, NamedTuple

import numpy as np

from planner.kernels.arrays import Cube, Floats, IntCube, Ints, IntTable, Problem, RandomState, State, Table, Weights
from planner.kernels.compiling import inner, kernel
from planner.kernels.tours import (
    copy_all,
    copy_owners,
    copy_route,
    draw_integer,
    draw_uniform,
    find_cheapest_place,
    insert,
    insert_by_regret,
    measure,
    orient_visits,
    remove_strings,
    sort_pending,
    total_excess,
)

SAME_TIME_S = 1e-9
"""Time tolerance, as in replan.py: a visit that ends within it after the loss counts as ended."""
EXCESS_WEIGHT = 1.5
"""Additional cost in a repair of each percent beyond a budget."""
HOT = 0.5
"""Start temperature of a long repair, in mean energies of a single-segment route."""
WARM = 0.05
"""Start temperature of a short repair, in the same unit: the repair stays close to its first state."""
COLD = 0.005
"""End temperature."""
LONG = 200
"""Iterations from which a repair counts as long."""


class LossTiming(NamedTuple):
    """The data that a loss needs in addition to the energies of ``Problem``."""

    move_s: Cube
    """(p, 2n, 2n): duration of the moves, seconds."""
    start_s: Table
    """(k, 2n)"""
    home_s: Table
    """(k, 2n)"""
    idle_s: Floats
    """(k,)"""
    depot: Table
    """(k, 2n): energy from the landing place to the end of a visit, with the vehicle's own consumption."""
    airborne: Ints
    """(k,): 1 for vehicles that are airborne when the plan starts."""
    answer_s: float
    """Seconds that survivors continue as planned after a loss."""


class LossClock(NamedTuple):
    """End times and energies of a plan's visits."""

    ends_s: Annotated[Table, "k n"]
    """End time of visit p of each route."""
    spent: Annotated[Table, "k n"]
    """Energy that the vehicle has spent by then."""
    durations_s: Annotated[Floats, "k"]
    """Duration of each route up to the landing."""


class Loss(NamedTuple):
    """The problem after a loss, of one vehicle or of several at the same time."""

    problem: Problem
    """A problem with its own ``start``, ``idle`` and ``budget``; a budget below 0 marks a vehicle that does not fly."""
    is_open: Annotated[Ints, "n"]
    """1 for segments that must be visited."""
    done: Annotated[Ints, "k"]
    """Number of completed visits of the plan for each vehicle."""
    keeper: Ints
    """(n,): vehicle that a segment is locked to, -1 for none; (0,) if no segment is locked."""
    who: IntTable
    """(losses, k): the losses, a row each: 1 for the vehicles that are lost together."""
    lifted: Ints
    """(k,): 1 for vehicles whose locks ``problem`` has lifted; with locks, ``problem`` has its own moves."""
    barred_pct: float
    """Additional cost of a visit that a vehicle must not make."""


@kernel()
def set_clock(problem: Problem, timing: LossTiming, base: State, clock: LossClock, route: int) -> None:
    """Set end times and energies of a measured route."""
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


@inner()
def switch_lifted_locks(problem: Problem, loss: Loss, lost: Ints) -> None:
    """Lift the locks of the lost vehicles and restore those of the ones lost before."""
    own = loss.problem
    for segment in range(len(loss.keeper)):
        keeper = loss.keeper[segment]
        if keeper < 0 or loss.lifted[keeper] == lost[keeper]:
            continue
        more = loss.barred_pct * (loss.lifted[keeper] - lost[keeper])
        for profile in range(len(own.move)):
            if profile != problem.profile[keeper]:
                for visit in range(2 * segment, 2 * segment + 2):
                    for other in range(len(own.move[profile])):
                        own.move[profile, other, visit] += more
                        own.move_into[profile, visit, other] += more
    for vehicle in range(len(lost)):
        loss.lifted[vehicle] = lost[vehicle]


@inner()
def is_possible_loss(clock: LossClock, loss: Loss, number: int, at_s: float) -> bool:
    """Return whether all vehicles of a loss still fly at a given time."""
    for vehicle in range(len(clock.durations_s)):
        if loss.who[number, vehicle] == 1 and clock.durations_s[vehicle] <= at_s + SAME_TIME_S:
            return False
    return True


@inner()
def begin_loss(
    problem: Problem,
    timing: LossTiming,
    base: State,
    clock: LossClock,
    number: int,
    at_s: float,
    fly_again: bool,
    loss: Loss,
) -> None:
    """Set ``loss`` to the problem that loss ``number`` at a given time leaves of the plan ``base``."""
    lost = loss.who[number]
    switch_lifted_locks(problem, loss, lost)
    for segment in range(len(base.route_of)):
        loss.is_open[segment] = int(base.route_of[segment] < 0)
    for route in range(len(base.lengths)):
        length = base.lengths[route]
        until_s = at_s if lost[route] == 1 else at_s + timing.answer_s
        done = 0
        while done < length and clock.ends_s[route, done] <= until_s + SAME_TIME_S:
            done += 1
        loss.done[route] = done
        loss.problem.idle[route] = 0.0
        first_open = done
        if lost[route] == 1:
            loss.problem.budget[route] = -1.0
        elif done < length:
            visit = base.visits[route, done]
            loss.problem.budget[route] = max(0.0, problem.budget[route] - clock.spent[route, done])
            move = loss.problem.move[problem.profile[route], visit]
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
            for segment in range(len(loss.keeper)):
                keeper = loss.keeper[segment]
                if keeper >= 0 and lost[keeper] == 1:
                    loss.problem.start[route, 2 * segment] -= loss.barred_pct * problem.consumption[route]
                    loss.problem.start[route, 2 * segment + 1] -= loss.barred_pct * problem.consumption[route]
        for position in range(first_open, length):
            loss.is_open[base.visits[route, position] >> 1] = 1


class RepairWorkspace(NamedTuple):
    """Work space of a repair."""

    opened: Annotated[Ints, "n"]
    """The open segments."""
    missing: Annotated[Ints, "n"]
    """Segments that no route visits yet."""
    pending: Annotated[Ints, "n"]
    """Segments that were removed."""
    keys: Annotated[Floats, "n"]
    touched: Annotated[Ints, "k"]
    """Zeros between two uses."""
    came_from: Annotated[IntTable, "n 2"]
    spare: Annotated[Ints, "n"]
    """Visits in transfer from one route to another."""
    current: State
    trial: State
    other: State


@inner()
def insert_at_least_cost(
    problem: Problem, state: State, segment: int, blink: float, within: bool, rng: RandomState
) -> int:
    """Insert a segment where energy plus missing energy grows least; return the route, -1 if no position exists.

    With ``within``, only within the budgets; otherwise into any vehicle that flies.
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
        if added == np.inf and not within:  # all positions were skipped by blinks
            added, position, visit = find_cheapest_place(problem, state, route, segment, 0.0, rng)
        over = state.loads[route] + added - budget
        gain = added
        if over > 0.0:
            if within:
                continue
            gain += EXCESS_WEIGHT * min(added, over)
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
    """Set ``state`` to a first repair: survivors keep their tails, open segments are inserted by regret.

    With ``follow`` they keep the visits of an ``earlier`` repair instead, made for this loss at another time or for a
    slightly different plan. These come after their own visits that the earlier repair does not hold because they were
    due to end before it.
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
            insert_at_least_cost(problem, state, missing[place], 0.0, False, rng)


@inner()
def choose_ruin_seed(problem: Problem, state: State, opened: Ints, count: int, rng: RandomState) -> int:
    """Return the open segment to ruin around: often one of a route that lacks energy."""
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
def sum_of(figures: Floats) -> float:
    """Return the sum."""
    total = 0.0
    for figure in figures:
        total += figure
    return total


@inner()
def is_fleet_empty(problem: Problem) -> bool:
    """Return whether no vehicle is left that can take a visit."""
    most = -1.0
    for route in range(len(problem.budget)):
        most = max(most, problem.budget[route])
    return most < 0.0


@inner()
def repair(loss: Loss, best: State, desk: RepairWorkspace, iterations: int, rng: RandomState) -> float:
    """Ruin and recreate until no route lacks energy, at most ``iterations`` times; return what the best repair lacks.

    Args:
        loss: the problem.
        best: set to the repair that lacks least.
        desk: work space; ``current`` is a first repair.
        iterations: maximum number of iterations.
        rng: random state.
    """
    problem, current, trial = loss.problem, desk.current, desk.trial
    pending, touched = desk.pending, desk.touched
    routes = len(current.lengths)
    copy_all(current, best)
    least = total_excess(problem, current)
    # Energies of single-segment routes set the scale of a repair's gains and losses.
    alone = 0.0
    count = 0
    for segment in range(len(loss.is_open)):
        if loss.is_open[segment] == 1:
            desk.opened[count] = segment
            alone += problem.effort[segment]
            count += 1
    if count > 0 and is_fleet_empty(problem):
        return np.inf  # no segment could be inserted
    if least <= 0.0 or iterations <= 0 or count == 0:
        return least
    copy_all(current, trial)
    here = EXCESS_WEIGHT * least + sum_of(current.loads)
    hot = HOT if iterations >= LONG else WARM
    temperature = hot * alone / count
    cooling = (COLD / hot) ** (1.0 / iterations)
    for _ in range(iterations):
        seed = choose_ruin_seed(problem, trial, desk.opened, count, rng)
        removed = remove_strings(problem, trial, pending, touched, seed, 6.0, 8.0, rng)
        sort_pending(problem, pending[:removed], desk.keys, 2, 0, 1, 1, rng)
        for place in range(removed):
            touched[insert_at_least_cost(problem, trial, pending[place], 0.02, False, rng)] = 1
        for route in range(routes):
            if touched[route] == 1:
                measure(problem, trial, route)
                orient_visits(problem, trial, route, desk.came_from)
        lacks = total_excess(problem, trial)
        there = EXCESS_WEIGHT * lacks + sum_of(trial.loads)
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


class Repairs(NamedTuple):
    """The latest repair of each loss: states stored side by side."""

    visits: Annotated[IntCube, "losses k n"]
    legs: Annotated[Cube, "losses k n+1"]
    lengths: Annotated[IntTable, "losses k"]
    loads: Annotated[Table, "losses k"]
    route_of: Annotated[IntTable, "losses n"]
    known: Annotated[Ints, "losses"]
    """1 where a repair exists."""


@inner()
def repair_of(repairs: Repairs, number: int) -> State:
    """Return the repair of a loss, as views."""
    return State(
        repairs.visits[number], repairs.legs[number], repairs.lengths[number], repairs.loads[number],
        repairs.route_of[number],
    )  # fmt: skip


@kernel()
def try_loss(
    problem: Problem, timing: LossTiming, base: State, clock: LossClock, number: int, at_s: float, fly_again: bool,
    loss: Loss, repairs: Repairs, desk: RepairWorkspace, effort: int, rng: RandomState,
) -> float:  # fmt: skip
    """Search for a repair of a loss, from the known one and from the survivors' tails; return what the best lacks.

    The result is stored in ``repairs``. ``loss`` and ``desk`` are work space; ``effort`` is the number of iterations
    from each start.
    """
    begin_loss(problem, timing, base, clock, number, at_s, fly_again, loss)
    best = repair_of(repairs, number)
    least = np.inf
    if repairs.known[number] == 1:
        begin_repair(loss, base, best, True, desk.current, desk, rng)
        least = repair(loss, best, desk, effort, rng)
        if least <= 0.0:
            return least
    begin_repair(loss, base, best, False, desk.current, desk, rng)
    if repairs.known[number] == 0:
        repairs.known[number] = 1
        return repair(loss, best, desk, effort, rng)
    # ``best`` holds the best repair so far, so this one is built in ``other``.
    lacks = repair(loss, desk.other, desk, effort, rng)
    if lacks < least:
        copy_all(desk.other, best)
    return min(lacks, least)


@kernel()
def find_broken_interval(
    problem: Problem, timing: LossTiming, base: State, clock: LossClock, events_s: Floats, fly_again: bool,
    loss: Loss, repairs: Repairs, desk: RepairWorkspace, effort: int, rng: RandomState,
) -> int:  # fmt: skip
    """Return the last interval between events that has a loss without a repair, -1 if there is none.

    Args:
        problem: the instance.
        timing: its times.
        base: the plan, measured.
        clock: its clock.
        events_s: (e,) ascending.
        fly_again: whether landed vehicles may fly again.
        loss: work space.
        repairs: the known repairs; changed.
        desk: work space.
        effort: iterations per loss.
        rng: random state.
    """
    for interval in range(len(events_s) - 2, -1, -1):
        at_s = events_s[interval]
        for number in range(len(loss.who)):
            if is_possible_loss(clock, loss, number, at_s):
                lacks = try_loss(
                    problem, timing, base, clock, number, at_s, fly_again, loss, repairs, desk, effort, rng
                )
                if lacks > 0.0:
                    return interval
    return -1
