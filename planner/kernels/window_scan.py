"""All losses of a plan from its end on, each with its latest repair."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from planner.kernels.arrays import Cube, Floats, IntCube, Ints, IntTable, Problem, RandomState, State, Table
from planner.kernels.compiled import inner, kernel
from planner.kernels.loss_problem import SAME_TIME_S, Loss, LossClock, LossTiming, begin_loss
from planner.kernels.repair import RepairWorkspace, begin_repair, repair
from planner.kernels.tours import copy_all


class Repairs(NamedTuple):
    """For each vehicle the latest repair of its loss; ``k`` states beside each other."""

    visits: IntCube
    """(k, k, n)"""
    legs: Cube
    """(k, k, n + 1)"""
    lengths: IntTable
    """(k, k)"""
    loads: Table
    """(k, k)"""
    route_of: IntTable
    """(k, n)"""
    known: Ints
    """(k,): 1 where there is one."""


@inner()
def repair_of(repairs: Repairs, lost: int) -> State:
    """Return the repair of a vehicle's loss, as views."""
    return State(
        repairs.visits[lost], repairs.legs[lost], repairs.lengths[lost], repairs.loads[lost], repairs.route_of[lost]
    )


@kernel()
def try_loss(
    problem: Problem, timing: LossTiming, base: State, clock: LossClock, lost: int, at_s: float, fly_again: bool,
    loss: Loss, repairs: Repairs, desk: RepairWorkspace, effort: int, rng: RandomState,
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


@inner()
def scan_losses(
    problem: Problem, timing: LossTiming, base: State, clock: LossClock, events_s: Floats, interval: int,
    first: int, fly_again: bool, loss: Loss, repairs: Repairs, desk: RepairWorkspace, effort: int, rng: RandomState,
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
