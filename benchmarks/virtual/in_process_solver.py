"""The solver of a flight in virtual time: in this process, with an end that is independent of clocks."""

from __future__ import annotations

import asyncio
from dataclasses import replace

from executor.adapters.solver import SETTLED, SolverSetup, solve_for_survivors
from executor.core.interface.commands import Solve
from executor.core.interface.events import SolveEnded
from missions import Pricing

NO_LIMIT_S = 3600.0
"""Real-time limit; a search ends when it finds no improvement."""


class InProcessSolver:
    """`ports.Solver`: the same problem always gets the same answer, after the same time."""

    def __init__(self, seed: int, *, takes_s: float, settled: int = SETTLED) -> None:
        """Solve with a seed.

        Args:
            seed: Seed of the search.
            takes_s: Flight time that a re-plan takes.
            settled: Iterations without an improvement after which a re-plan ends.
        """
        self.asked: list[Solve] = []
        """The problems, in order of arrival."""
        self._setup = SolverSetup(NO_LIMIT_S, seed)
        self._takes_s = takes_s
        self._settled = settled
        self._cancelled = -1

    async def solve(self, problem: Solve, pricing: Pricing) -> SolveEnded:
        """Wait, then answer; or report that it was cancelled meanwhile."""
        self.asked.append(problem)
        await asyncio.sleep(self._takes_s)
        if self._cancelled >= problem.revision:
            return SolveEnded(problem.revision, None, (), self._takes_s, "cancelled")
        return replace(self._answer(problem, pricing), solve_s=self._takes_s)

    def _answer(self, problem: Solve, pricing: Pricing) -> SolveEnded:
        return solve_for_survivors(self._setup, problem, pricing, lambda: False, settled=self._settled)

    def cancel(self, revision: int) -> None:
        """Cancel this and older problems."""
        self._cancelled = max(self._cancelled, revision)
