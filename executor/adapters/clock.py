"""The time of a flight: the system clock, a simulated fleet's time that is faster, and the event loop that goes by it.

A steady clock is there to decide, UTC only to label. What a fleet says is taken in turns by the event loop, so that
nothing else waits for all of it.
"""

from __future__ import annotations

import asyncio
import os
import selectors
import sys
import time
from collections.abc import Callable, Coroutine, Iterator
from concurrent import futures
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import Any, ParamSpec, Self, TypeVar, cast

from simulator import common_time


def steady_s() -> float:
    """Return seconds of a clock that nobody sets, and that runs on while the computer is suspended.

    The vehicles fly on then. Linux's CLOCK_MONOTONIC stands still meanwhile, and CLOCK_BOOTTIME does not; elsewhere
    the monotonic clock is all there is.
    """
    if sys.platform == "linux":
        return time.clock_gettime(time.CLOCK_BOOTTIME)
    return time.monotonic()


@dataclass(frozen=True, slots=True)
class SystemClock:
    """The flight's time: 0 at construction, `speedup` seconds in one of its steady clock."""

    speedup: float = 1.0
    began_steady_s: float = field(default_factory=steady_s)
    began_unix_s: float = field(default_factory=time.time)
    steady: Callable[[], float] = steady_s
    """This computer's, or the time of a simulated fleet that cannot always keep up with it."""
    set_since: tuple[float, float] = field(default_factory=lambda: (time.time(), steady_s()))
    """This computer's two clocks at construction."""

    @classmethod
    def start_on(cls, speedup: float, steady: Callable[[], float]) -> Self:
        """Return the clock of a flight that begins, on a steady clock of its own."""
        return cls(speedup, steady(), steady=steady)

    @classmethod
    def resume(
        cls,
        speedup: float,
        began_unix_s: float,
        last_s: float,
        set_s: float = 0.0,
        steady: Callable[[], float] = steady_s,
        date_unix_s: float | None = None,
    ) -> Self:
        """Return the clock of a flight that goes on in a new process, maybe on another computer.

        It goes on from where the time of day says that it is, which is the only clock that outlives a process and a
        computer; if that was set back, from where the flight was last.

        Args:
            speedup: Of the flight.
            began_unix_s: Seconds since 1970 at which its time was 0.
            last_s: The last time that is on record.
            set_s: By how much the time of day is known to have been set since the flight began.
            steady: The steady clock of the flight.
            date_unix_s: What the time of day is on the clock of the simulated fleet, which nobody sets.
        """
        date_unix_s = time.time() - set_s if date_unix_s is None else date_unix_s
        now_s = max(last_s, (date_unix_s - began_unix_s) * speedup)
        return cls(speedup, steady() - now_s / speedup, began_unix_s, steady)

    def now_s(self) -> float:
        """Seconds of the flight since construction."""
        return (self.steady() - self.began_steady_s) * self.speedup

    def steady_unix_s(self) -> float:
        """Seconds since 1970 by the time of day at construction and the steady clock since."""
        return self.began_unix_s + self.now_s() / self.speedup

    def clock_step_s(self) -> float:
        """Seconds by which the time of day was set, or drifted, since construction."""
        unix_s, own_s = self.set_since
        return (time.time() - unix_s) - (steady_s() - own_s)

    def label_usec(self) -> int:
        """Microseconds since 1970 at which this moment would lie had the flight been flown at speed 1."""
        return round((self.began_unix_s + self.now_s()) * 1e6)

    def unix_s(self) -> float:
        """Seconds since 1970 as this computer knows them now: they jump when its clock is set."""
        return time.time()


GREETS_REAL_S = 1.0
"""Who does not greet within this is no fleet of ours."""
BUSY_REAL_S = 0.25
"""What never comes to rest goes on all the same after this: a flood of frames slows a flight, and does not end it."""


@dataclass(eq=False, repr=False)
class FleetTime(asyncio.Protocol):
    """Seconds of a steady clock: the computer's, or as many as the fleet has lived through, as long as one is there.

    The fleet's next moment begins when everything that it said before has been taken in; that is then acknowledged, and
    the fleet lives at most `AHEAD_S` beyond it. So a process that the computer keeps waiting keeps the other waiting,
    and neither sees the other late.
    """

    _speedup: float
    """Of the flight; a fleet with another one keeps its own time."""
    _own_s: Callable[[], float]
    """The computer's own steady clock."""
    _monotonic_s: Callable[[], float] = time.monotonic
    """Real seconds, to see how long a partner has been silent."""
    _transport: asyncio.Transport | None = None
    _lines: common_time.LineBuffer = field(default_factory=common_time.LineBuffer)
    _turn: common_time.ReplyWait | None = None
    _came: asyncio.Event = field(default_factory=asyncio.Event)
    _behind_s: float = 0.0
    """Of our time behind the computer's clock, while alone."""
    _base_s: float = 0.0
    _base_lived_s: float = 0.0
    _lived_s: float = 0.0
    """What we live in, in the fleet's time."""
    _told_s: float = 0.0
    """How far the fleet has lived."""
    _heard_at_s: float = 0.0
    _taken_s: float = 0.0
    """What was acknowledged last."""
    _together: bool = False
    _dated: tuple[float, float] | None = None
    """A moment of our time, and its date on the fleet's clock."""

    @property
    def is_synchronised(self) -> bool:
        """Whether the fleet's time is ours at the moment."""
        return self._together

    def steady_s(self) -> float:
        """Return seconds of a clock that never goes back."""
        if self._together:
            return self._base_s + (self._lived_s - self._base_lived_s) / self._speedup
        return self._own_s() - self._behind_s

    @property
    def is_connected(self) -> bool:
        """Whether a fleet has greeted and is still there, be it stopped."""
        return self._turn is not None

    def date_unix_s(self) -> float | None:
        """Return the date on the fleet's clock, which follows its own time; None without a fleet."""
        if self._dated is None or not self._together:
            return None
        at_s, unix_s = self._dated
        return unix_s + self.steady_s() - at_s

    async def connect(self, port: int) -> bool:
        """Ask the fleet behind this port for a common time; returns whether there is one."""
        try:
            async with asyncio.timeout(GREETS_REAL_S):
                await asyncio.get_running_loop().create_connection(lambda: self, common_time.HERE, port)
                await self._came.wait()
        except (OSError, TimeoutError):
            self.disconnect()
        return self._turn is not None

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        """Wait for the greeting."""
        self._came.clear()
        self._transport, self._lines = cast("asyncio.Transport", transport), common_time.LineBuffer()

    def data_received(self, data: bytes) -> None:
        """Hear how far the fleet has lived."""
        for line in self._lines.take(data):
            if self._turn is None:
                greeting = common_time.parse_greeting(line)
                if greeting is None or greeting.speedup != self._speedup:
                    self.disconnect()
                    return
                self._handle_greeting(greeting)
            elif (told_s := common_time.parse_time_line(line)) is not None and told_s > self._told_s:
                if not self._together:
                    self._synchronise(told_s)
                if self._told_s == self._lived_s:
                    self._heard_at_s = self._monotonic_s()
                self._told_s = told_s
                self._turn.end()
        # It lived on without us, and what it said meanwhile is late already: it is heard as late as it was.
        if self._together and self._told_s - self._lived_s > 2 * common_time.AHEAD_S:
            self._lived_s = self._told_s

    def _handle_greeting(self, greeting: common_time.Greeting) -> None:
        self._turn = common_time.ReplyWait(greeting.pid)
        if self._transport is not None:
            self._transport.write(common_time.Greeting(os.getpid(), self._speedup).to_line())
        self._synchronise(greeting.lived_s)
        self._dated = (self._base_s, greeting.unix_s)
        self._came.set()

    def _synchronise(self, lived_s: float) -> None:
        self._base_s = self.steady_s()
        self._base_lived_s = self._lived_s = self._told_s = self._taken_s = lived_s
        self._together = True

    def _fall_back_to_own_time(self) -> None:
        if self._together:
            self._behind_s = self._own_s() - self.steady_s()
            self._together = False

    def note_idle(self) -> bool:
        """Take note that everything that was heard is dealt with; returns whether time has gone on by that."""
        if self._told_s > self._lived_s:
            self._lived_s = self._told_s
            return True
        if self._taken_s < self._lived_s and self._transport is not None and self._turn is not None:
            self._taken_s = self._lived_s
            self._transport.write(common_time.format_time_line(self._taken_s))
            self._turn.begin(self._monotonic_s())
        return False

    def note_busy(self) -> None:
        """Take note that there is still something to be dealt with."""
        if self._told_s > self._lived_s and self._monotonic_s() - self._heard_at_s >= BUSY_REAL_S:
            self._lived_s = self._told_s
            self.note_idle()

    def note_silence(self) -> None:
        """Take note that nothing was heard for a while: the fleet may be stopped, or gone."""
        if self._turn is not None and self._turn.is_gone(self._monotonic_s()):
            self._fall_back_to_own_time()

    def disconnect(self) -> None:
        """Go on alone."""
        self._fall_back_to_own_time()
        self._turn = None
        if self._transport is not None:
            self._transport.abort()
            self._transport = None

    def connection_lost(self, exc: Exception | None) -> None:  # noqa: ARG002 - asyncio's signature
        """Go on alone."""
        self._fall_back_to_own_time()
        self._turn = self._transport = None
        self._came.set()


T = TypeVar("T")
P = ParamSpec("P")
ReadyFiles = list[tuple[selectors.SelectorKey, int]]

AT_ONCE = 8
"""Files that are ready and taken in one round of the loop: some 5 ms, each with a few messages. Fifty vehicles that
speak at the same moment would otherwise keep deadlines, heartbeats and the page waiting for all fifty."""

THREADS = 16
THREADS_END_S = 5.0
"""Real seconds that the threads beside a flight may take to end: a disk or a name server may never answer."""


class BoundedThreadPool(futures.ThreadPoolExecutor):
    """The threads beside an event loop, whose end is not waited for longer than `THREADS_END_S`."""

    def __init__(self) -> None:
        super().__init__(THREADS, thread_name_prefix="beside")
        self._begun: set[futures.Future[Any]] = set()

    def submit(self, fn: Callable[P, T], /, *args: P.args, **kwargs: P.kwargs) -> futures.Future[T]:
        """Do something in a thread."""
        future = super().submit(fn, *args, **kwargs)
        self._begun.add(future)
        future.add_done_callback(self._begun.discard)
        return future

    def shutdown(self, wait: bool = True, *, cancel_futures: bool = False) -> None:
        """Take no more, and wait a while for what was begun."""
        super().shutdown(wait=False, cancel_futures=cancel_futures)
        if wait:
            futures.wait(tuple(self._begun), THREADS_END_S)


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


class _PacedSelector(FairSelector):
    """Waits for what somebody else's time brings, not for the computer's."""

    def __init__(self) -> None:
        super().__init__()
        self.pace: FleetTime | None = None

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
        ready = super().select(common_time.LOOK_REAL_S)
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
    def follow_pacemaker(self, pace: FleetTime) -> Iterator[None]:
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
