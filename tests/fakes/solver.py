"""A solver whose answers are known beforehand."""

from __future__ import annotations

import asyncio
from collections.abc import Callable

from executor.core.interface.commands import Solve
from executor.core.interface.events import NewRoute, SolveEnded
from missions import Pricing

Answer = Callable[[Solve], SolveEnded]


def share_out(problem: Solve) -> SolveEnded:
    """Deal the open segments out in their order, each to whoever has the fewest so far; nobody's battery is asked."""
    visits: dict[str, list[int]] = {offer.vehicle: [] for offer in problem.survivors}
    for segment in problem.open_segments:
        fewest = min(visits, key=lambda name: len(visits[name]))
        visits[fewest].append(2 * segment)
    routes = tuple(NewRoute(name, tuple(given)) for name, given in visits.items())
    return SolveEnded(problem.revision, routes, (), 0.25, "dealt out")


def leave_out(*segments: int) -> Answer:
    """Return a solver that finds no way to these segments, and deals the rest out."""

    def answer(problem: Solve) -> SolveEnded:
        done = share_out(problem)
        kept = tuple(
            NewRoute(route.vehicle, tuple(visit for visit in route.visits if visit >> 1 not in segments))
            for route in done.routes or ()
        )
        left = tuple(segment for segment in problem.open_segments if segment in segments)
        return SolveEnded(problem.revision, kept, left, 0.25, "left some out")

    return answer


def fail(problem: Solve) -> SolveEnded:
    """Die."""
    return SolveEnded(problem.revision, None, (), 0.0, "the solver's process died")


class FakeSolver:
    """`ports.Solver` that takes its time and can be cancelled."""

    def __init__(self, answer: Answer = share_out, *, takes_s: float = 0.3) -> None:
        """Answer by a rule, after real seconds of the loop's clock."""
        self.asked: list[Solve] = []
        self.cancelled: list[int] = []
        self._answer = answer
        self._takes_s = takes_s
        self._news = asyncio.Event()

    async def solve(self, problem: Solve, pricing: Pricing) -> SolveEnded:
        """Answer, or say that it was cancelled."""
        self.asked.append(problem)
        try:
            async with asyncio.timeout(self._takes_s):
                while problem.revision not in self.cancelled:
                    self._news.clear()
                    await self._news.wait()
        except TimeoutError:
            return self._answer(problem)
        return SolveEnded(problem.revision, None, (), self._takes_s, "cancelled")

    def cancel(self, revision: int) -> None:
        """Give a problem up."""
        self.cancelled.append(revision)
        self._news.set()
