"""The event loop of a flight: what a fleet says is taken in turns, so that nothing else waits for all of it."""

from __future__ import annotations

import asyncio
import selectors
from collections.abc import Callable, Coroutine, Iterator
from concurrent.futures import Future, ThreadPoolExecutor, wait
from contextlib import contextmanager
from typing import Any, ParamSpec, Protocol, TypeVar

from simulator.common_time import LOOK_REAL_S

T = TypeVar("T")
P = ParamSpec("P")
ReadyFiles = list[tuple[selectors.SelectorKey, int]]

AT_ONCE = 8
"""Files that are ready and taken in one round of the loop: some 5 ms, each with a few messages. Fifty vehicles that
speak at the same moment would otherwise keep deadlines, heartbeats and the page waiting for all fifty."""

THREADS = 16
THREADS_END_S = 5.0
"""Real seconds that the threads beside a flight may take to end: a disk or a name server may never answer."""


class BoundedThreadPool(ThreadPoolExecutor):
    """The threads beside an event loop, whose end is not waited for longer than `THREADS_END_S`."""

    def __init__(self) -> None:
        super().__init__(THREADS, thread_name_prefix="beside")
        self._begun: set[Future[Any]] = set()

    def submit(self, fn: Callable[P, T], /, *args: P.args, **kwargs: P.kwargs) -> Future[T]:
        """Do something in a thread."""
        future = super().submit(fn, *args, **kwargs)
        self._begun.add(future)
        future.add_done_callback(self._begun.discard)
        return future

    def shutdown(self, wait: bool = True, *, cancel_futures: bool = False) -> None:
        """Take no more, and wait a while for what was begun."""
        super().shutdown(wait=False, cancel_futures=cancel_futures)
        if wait:
            _wait_for_futures(tuple(self._begun))


def _wait_for_futures(begun: tuple[Future[Any], ...]) -> None:
    wait(begun, THREADS_END_S)


class FairSelector(selectors.DefaultSelector):
    """Hands on at most `AT_ONCE` files in a round, those first that have waited longest.

    asyncio goes through everything that was ready before it looks at its deadlines again. What is left here is still
    ready in the next round.
    """

    def __init__(self) -> None:
        super().__init__()
        self._rounds = 0
        self._served: dict[int, int] = {}
        """In which round a file had its last turn."""

    def select(self, timeout: float | None = None) -> ReadyFiles:
        """Return what is ready, `AT_ONCE` files at most."""
        ready = super().select(timeout)
        self._rounds += 1
        if len(ready) > AT_ONCE:
            ready = sorted(ready, key=lambda event: self._served.get(event[0].fd, 0))[:AT_ONCE]
        for key, _ in ready:
            self._served[key.fd] = self._rounds
        return ready


class Pacemaker(Protocol):
    """A time that somebody else makes, and that goes on when everything before it was dealt with."""

    @property
    def is_synchronised(self) -> bool:
        """Whether somebody makes it; without, it is the computer's."""
        ...

    def steady_s(self) -> float:
        """Return seconds that never go back."""
        ...

    def note_idle(self) -> bool:
        """Take note that nothing is left to be dealt with; returns whether time has gone on."""
        ...

    def note_busy(self) -> None:
        """Take note that something is."""
        ...

    def note_silence(self) -> None:
        """Take note that nothing came for `LOOK_REAL_S`."""
        ...


class _PacedSelector(FairSelector):
    """Waits for what somebody else's time brings, not for the computer's."""

    def __init__(self) -> None:
        super().__init__()
        self.pace: Pacemaker | None = None

    def select(self, timeout: float | None = None) -> ReadyFiles:
        """Return what is ready; nothing, if it is only later than it was."""
        pace = self.pace
        if pace is None or not pace.is_synchronised:
            return super().select(timeout)
        ready = super().select(0)
        if ready or (timeout is not None and timeout <= 0):
            pace.note_busy()
            return ready
        if pace.note_idle():
            return []
        ready = super().select(LOOK_REAL_S)
        if not ready:
            pace.note_silence()
        return ready


class FairEventLoop(asyncio.SelectorEventLoop):
    """An event loop that takes turns, and whose deadlines may go by somebody else's time."""

    def __init__(self) -> None:
        self._selects = _PacedSelector()
        self._shift_s = 0.0
        super().__init__(self._selects)

    def time(self) -> float:
        """Return the time that deadlines are in."""
        pace = self._selects.pace
        return super().time() if pace is None else pace.steady_s() + self._shift_s

    @contextmanager
    def follow_pacemaker(self, pace: Pacemaker) -> Iterator[None]:
        """Go by this time inside the block."""
        self._shift_s = super().time() - pace.steady_s()
        self._selects.pace = pace
        try:
            yield
        finally:
            self._selects.pace = None


def run_on_fair_loop(
    work: Coroutine[None, None, T], loop: Callable[[], asyncio.AbstractEventLoop] = FairEventLoop
) -> T:
    """Do what `asyncio.run` does, on a loop that takes turns and whose end is bounded."""
    with asyncio.Runner(loop_factory=loop) as runner:
        runner.get_loop().set_default_executor(BoundedThreadPool())
        return runner.run(work)
