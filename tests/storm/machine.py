"""What a ground station's computer has, and what can be wrong with it: the disk of its log, and the solver."""

from __future__ import annotations

import asyncio
from dataclasses import replace

from benchmarks.virtual.in_process_solver import InProcessSolver
from executor.adapters.eventlog import DISK_S
from executor.core.interface.commands import Solve
from executor.core.interface.events import Event, SolveEnded
from executor.site.site_model import SiteModel
from missions import Pricing
from tests.stories.world import Sink

SETTLED = 60
"""Iterations without an improvement: the networks are small."""


class Disk(Sink):
    """The log: what is on the disk, and what only memory holds."""

    def __init__(self) -> None:
        super().__init__()
        self.kept: list[tuple[float, Event]] = []
        self.full = self.hangs = False
        self._memory: list[tuple[float, Event]] = []

    def write(self, event: Event, now_s: float) -> None:
        super().write(event, now_s)
        self._memory.append((now_s, event))
        if not self.full:
            self.kept += self._memory
            self._memory.clear()

    def lose(self) -> None:
        """Die with what only memory held."""
        self._memory.clear()

    async def settle(self) -> None:
        if self.hangs or self.full:
            await asyncio.sleep(DISK_S)


class Deputy(InProcessSolver):
    """The solver of a flight; or one that does not work."""

    def __init__(self, ground: SiteModel, takes_s: float) -> None:
        super().__init__(1, takes_s=takes_s, settled=SETTLED)
        self.mood = ""
        self._limit_s = ground.site.flight.solve_s

    async def solve(self, problem: Solve, pricing: Pricing) -> SolveEnded:
        self.asked.append(problem)
        mood = self.mood
        takes_s = {"hangs": self._limit_s + 5.0, "late": self._limit_s + 3.0, "fails": 0.1}.get(mood, self._takes_s)
        until_s = asyncio.get_running_loop().time() + takes_s
        while asyncio.get_running_loop().time() < until_s:
            if self._cancelled >= problem.revision and mood != "hangs":
                return SolveEnded(problem.revision, None, (), 0.0, "cancelled")
            await asyncio.sleep(min(0.5, takes_s))
        if mood in {"hangs", "fails"}:
            reason = "the solver did not answer" if mood == "hangs" else "the solver's process died"
            return SolveEnded(problem.revision, None, (), 0.0, reason)
        return replace(self._answer(problem, pricing), solve_s=takes_s)
