"""An event loop whose time jumps to the next deadline, so that an hour of flight takes only its computing time.

Nothing but asyncio's public classes is used, and without sockets every flight is the same to the last digit. The time
of looptime, in which many tests run, counts empty turns and rounds; flights have no need of that.
"""

from __future__ import annotations

import asyncio
import selectors
from collections.abc import Callable, Coroutine
from typing import TypeVar

T = TypeVar("T")


class VirtualLoop(asyncio.SelectorEventLoop):
    """Where others would wait, time passes at once; what is ready at the same time keeps its order."""

    def __init__(self) -> None:
        """Begin at 0 s."""
        self._now_s = 0.0
        super().__init__(_JumpingSelector(self.advance))

    def time(self) -> float:
        """Seconds since the loop began."""
        return self._now_s

    def advance(self, seconds: float) -> None:
        """Let time pass; a task that calls this keeps all others waiting meanwhile."""
        self._now_s += seconds


class _JumpingSelector(selectors.DefaultSelector):
    """Waits for a file only when nothing is due ever; otherwise it looks, and where there is nothing time passes."""

    def __init__(self, passes: Callable[[float], None]) -> None:
        super().__init__()
        self._passes = passes

    def select(self, timeout: float | None = None) -> list[tuple[selectors.SelectorKey, int]]:
        if timeout is None or timeout <= 0.0:
            ready: list[tuple[selectors.SelectorKey, int]] = super().select(timeout)
            return ready
        # What somebody in this process has sent to a socket of it is there already.
        if not (ready := super().select(0.0)):
            self._passes(timeout)
        return ready


def run_virtual(work: Callable[[], Coroutine[None, None, T]]) -> T:
    """Do something in virtual time, from 0 s on."""
    with asyncio.Runner(loop_factory=VirtualLoop) as runner:
        return runner.run(work())
