"""An event loop whose time jumps to the next deadline, so an hour of flight takes only its computing time.

It uses only asyncio's public classes, and without sockets every flight is identical to the last digit. The time of
looptime, in which many tests run, counts empty turns and rounds; flights do not need that.
"""

from __future__ import annotations

import asyncio
import selectors
from collections.abc import Callable, Coroutine
from typing import TypeVar

T = TypeVar("T")


class VirtualLoop(asyncio.SelectorEventLoop):
    """Skip waiting times; callbacks that are ready at the same time keep their order."""

    def __init__(self) -> None:
        """Begin at 0 s."""
        self._now_s = 0.0
        super().__init__(_JumpingSelector(self.advance))

    def time(self) -> float:
        """Seconds since the loop began."""
        return self._now_s

    def advance(self, seconds: float) -> None:
        """Advance time; all other tasks wait meanwhile."""
        self._now_s += seconds


class _JumpingSelector(selectors.DefaultSelector):
    """Wait for a file only if no deadline is set; otherwise poll, and advance time if nothing is ready."""

    def __init__(self, passes: Callable[[float], None]) -> None:
        super().__init__()
        self._passes = passes

    def select(self, timeout: float | None = None) -> list[tuple[selectors.SelectorKey, int]]:
        if timeout is None or timeout <= 0.0:
            ready: list[tuple[selectors.SelectorKey, int]] = super().select(timeout)
            return ready
        # Data sent to a socket of this process from within it has already arrived.
        if not (ready := super().select(0.0)):
            self._passes(timeout)
        return ready


def run_virtual(work: Callable[[], Coroutine[None, None, T]]) -> T:
    """Run work in virtual time, from 0 s on."""
    with asyncio.Runner(loop_factory=VirtualLoop) as runner:
        return runner.run(work())
