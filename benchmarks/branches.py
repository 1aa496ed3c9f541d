"""Flights that begin as one and branch: their common part is flown once.

A flight in virtual time is one process without a second thread. Just before a fault the process is forked: the child
gets the fault and flies to its own end, the parent continues without it. Ten losses in the last quarter of a plan take
the time of three flights.
"""

from __future__ import annotations

import asyncio
import multiprocessing
import os
from asyncio.events import _set_running_loop
from collections.abc import Callable, Mapping, Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from multiprocessing.connection import Connection
from typing import Generic, TypeVar

from benchmarks.errors import FlightNotFlown
from benchmarks.virtual_flight import FlightObservers, VirtualFlight, fly_virtual
from executor.site.site_model import SiteModel
from missions import PlanFile
from simulator.fault_kinds import parse_fault
from simulator.fleet import SimulatedVehicle

AHEAD_S = 0.5
"""Lead before the fault, which then triggers at its own time."""
R = TypeVar("R")


@dataclass(frozen=True, slots=True)
class Branch:
    """A fault of one of the flights."""

    vehicle: str
    at_s: float
    """Time since the vehicle began its mission."""
    spec: str
    """Fault as for ``--fault``."""


def fly_branches(
    ground: SiteModel, plan: PlanFile, branches: Sequence[Branch], judged: Callable[[VirtualFlight, int], R], *,
    jobs: int = 1, seed: int = 0,
) -> list[R]:  # fmt: skip
    """Fly a plan once for each fault and return each flight's result, in the order of the faults.

    Args:
        ground: The site.
        plan: Over all of its segments.
        branches: One fault for each flight.
        judged: Returns the result of a flight; receives its number.
        jobs: Parallel flights besides the common one.
        seed: Seed of the links, the same for all.

    Raises:
        FlightNotFlown: a flight did not end.
    """
    if not branches:
        return []
    if not hasattr(os, "fork"):
        return [
            judged(fly_virtual(ground, plan, faults=[one.spec], seed=seed), number)
            for number, one in enumerate(branches)
        ]
    trunk: _Trunk[R] = _Trunk(branches, jobs)
    try:
        flight = fly_virtual(ground, plan, seed=seed, onlookers=FlightObservers(lived=trunk.fork_near_faults))
        found = [judged(flight, number) for number in trunk.list_own_flights()]
    except BaseException:
        trunk.end(None)
        raise
    trunk.end(found)
    return trunk.gather_results(found)


class _Trunk(Generic[R]):
    """The flights' common part, and in a child its own flight."""

    def __init__(self, branches: Sequence[Branch], jobs: int) -> None:
        self._branches = branches
        self._jobs = jobs
        self._waiting = sorted(range(len(branches)), key=lambda number: branches[number].at_s)
        self._children: dict[int, tuple[int, Connection]] = {}
        """By number: process and pipe."""
        self._found: dict[int, R] = {}
        self._answer: Connection | None = None
        """In a child: pipe for its answer."""
        self.own = -1
        """Number of this flight; the last one is the parent's own.

        A fault that never triggers, as its vehicle has landed, changes nothing: such flights are the parent's too.
        """

    def fork_near_faults(self, vehicles: Mapping[str, SimulatedVehicle]) -> None:
        """Fork before a fault that is due soon."""
        for number in tuple(self._waiting):
            branch = self._branches[number]
            mission_s = vehicles[branch.vehicle].autopilot.mission_s
            if self.own >= 0 or mission_s is None or mission_s < branch.at_s - AHEAD_S:
                continue
            self._waiting.remove(number)
            if not self._waiting or self._fork(number):
                self.own = number
                vehicles[branch.vehicle].schedule_injection(parse_fault(branch.spec))

    def _fork(self, number: int) -> bool:
        """Return whether this is the child that flies on with a fault."""
        while len(self._children) >= self._jobs:
            self._gather(next(iter(self._children)))
        reads, writes = multiprocessing.Pipe(duplex=False)
        loop = asyncio.get_running_loop()
        process = os.fork()
        if process == 0:
            _set_running_loop(loop)  # asyncio reports no running loop in a child
            reads.close()
            self._answer = writes
            return True
        writes.close()
        self._children[number] = (process, reads)
        return False

    def _gather(self, number: int) -> None:
        process, reads = self._children.pop(number)
        with ExitStack() as stack:
            stack.callback(os.waitpid, process, 0)
            stack.enter_context(reads)
            try:
                self._found[number] = reads.recv()
            except EOFError as error:
                spec = self._branches[number].spec
                raise FlightNotFlown(f"a flight in virtual time: {spec}: its process ended without one") from error

    def list_own_flights(self) -> list[int]:
        """Return the numbers of the flights that this one represents."""
        return ([self.own] if self.own >= 0 else []) + (self._waiting if self._answer is None else [])

    def end(self, found: list[R] | None) -> None:
        """End a child, with its answer; a failed parent waits for its children."""
        if self._answer is not None:
            if found is not None:
                with self._answer as pipe:
                    pipe.send(found[0])
            os._exit(0)

    def gather_results(self, own: list[R]) -> list[R]:
        """Return the results of all flights once the last one has ended."""
        for number in list(self._children):
            self._gather(number)
        self._found.update(zip(self.list_own_flights(), own, strict=True))
        return [self._found[number] for number in range(len(self._branches))]
