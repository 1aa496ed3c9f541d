"""What a loss leaves, in the numbering of the whole instance: nothing is copied for what is left open.

A loss changes where survivors start, what they may still spend, and which segments are open; ``begin_loss`` writes
that into arrays of its own. ``planner.replan`` is the definition of the state after a loss.
"""

from __future__ import annotations

from typing import NamedTuple

from planner.kernels.arrays import Cube, Floats, Ints, Problem, State, Table
from planner.kernels.compiled import inner, kernel

SAME_TIME_S = 1e-9
"""As in replan.py: a visit that ends this little after the loss has ended."""


class LossTiming(NamedTuple):
    """What a loss needs besides the energies of ``Problem``."""

    move_s: Cube
    """(p, 2n, 2n): seconds of the moves."""
    start_s: Table
    """(k, 2n)"""
    home_s: Table
    """(k, 2n)"""
    idle_s: Floats
    """(k,)"""
    depot: Table
    """(k, 2n): energy from the landing place to the end of a visit, with the vehicle's own consumption."""
    airborne: Ints
    """(k,): 1 for vehicles that are in the air when the plan starts."""
    answer_s: float
    """How long after a loss survivors fly on as planned."""


class LossClock(NamedTuple):
    """When and at what expense the visits of a plan end."""

    ends_s: Table
    """(k, n): when visit p of a route ends."""
    spent: Table
    """(k, n): what its vehicle has spent by then."""
    durations_s: Floats
    """(k,): landing place reached."""


class Loss(NamedTuple):
    """The problem that a loss leaves."""

    problem: Problem
    """With ``start``, ``idle`` and ``budget`` of its own; a budget below 0 is that of a vehicle that does not fly."""
    is_open: Ints
    """(n,): 1 for segments to be visited."""
    done: Ints
    """(k,): how many visits of the plan have ended."""


@kernel()
def set_clock(problem: Problem, timing: LossTiming, base: State, clock: LossClock, route: int) -> None:
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


@inner()
def begin_loss(
    problem: Problem,
    timing: LossTiming,
    base: State,
    clock: LossClock,
    lost: int,
    at_s: float,
    fly_again: bool,
    loss: Loss,
) -> None:
    """Set ``loss`` to what the loss of a vehicle at a time leaves of the plan ``base``."""
    for segment in range(len(base.route_of)):
        loss.is_open[segment] = int(base.route_of[segment] < 0)
    for route in range(len(base.lengths)):
        length = base.lengths[route]
        until_s = at_s if route == lost else at_s + timing.answer_s
        done = 0
        while done < length and clock.ends_s[route, done] <= until_s + SAME_TIME_S:
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
