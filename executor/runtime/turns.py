"""The event loop of a flight: what a fleet says is taken in turns, so that nothing else waits for all of it."""

from __future__ import annotations

import asyncio
import selectors
from collections.abc import Coroutine
from typing import TypeVar

T = TypeVar("T")
Ready = list[tuple[selectors.SelectorKey, int]]

AT_ONCE = 8
"""Files that are ready and taken in one round of the loop: some 5 ms, each with a few messages. Fifty vehicles that
speak at the same moment would otherwise keep deadlines, heartbeats and the page waiting for all fifty."""


class InTurns(selectors.DefaultSelector):
    """Hands on at most `AT_ONCE` files in a round, those first that have waited longest.

    asyncio goes through everything that was ready before it looks at its deadlines again. What is left here is still
    ready in the next round.
    """

    def __init__(self) -> None:
        super().__init__()
        self._rounds = 0
        self._served: dict[int, int] = {}
        """In which round a file had its last turn."""

    def select(self, timeout: float | None = None) -> Ready:
        """Return what is ready, `AT_ONCE` files at most."""
        ready = super().select(timeout)
        self._rounds += 1
        if len(ready) > AT_ONCE:
            ready = sorted(ready, key=lambda event: self._served.get(event[0].fd, 0))[:AT_ONCE]
        for key, _ in ready:
            self._served[key.fd] = self._rounds
        return ready


def run(work: Coroutine[None, None, T]) -> T:
    """Do what `asyncio.run` does, on a loop that takes turns."""
    with asyncio.Runner(loop_factory=lambda: asyncio.SelectorEventLoop(InTurns())) as runner:
        return runner.run(work)
