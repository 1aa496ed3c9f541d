"""Flight time: the system clock, a simulated fleet's faster time, and the event loop that runs on either.

Decisions use a steady clock; UTC only labels records. The event loop handles the fleet's messages in turns, so that a
burst of them does not block anything else.
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
    """Return seconds of a clock that is never set and runs on while the computer is suspended.

    Vehicles keep flying during a suspend. Linux's CLOCK_MONOTONIC stops meanwhile, CLOCK_BOOTTIME does not; other
    systems have only the monotonic clock.
    """
    if sys.platform == "linux":
        return time.clock_gettime(time.CLOCK_BOOTTIME)
    return time.monotonic()


@dataclass(frozen=True, slots=True)
class SystemClock:
    """Flight time: 0 at construction, then `speedup` seconds per second of a steady clock."""

    speedup: float = 1.0
    began_steady_s: float = field(default_factory=steady_s)
    began_unix_s: float = field(default_factory=time.time)
    steady: Callable[[], float] = steady_s
    """Steady clock: this computer's, or the time of a simulated fleet that cannot always keep up with it."""
    set_since: tuple[float, float] = field(default_factory=lambda: (time.time(), steady_s()))
    """UTC and steady time of this computer at construction."""

    @classmethod
    def start_on(cls, speedup: float, steady: Callable[[], float]) -> Self:
        """Return the clock of a new flight, on the given steady clock."""
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
        """Return the clock of a flight that resumes in a new process, possibly on another computer.

        It continues from the time of day, the only clock that outlives a process and a computer; if that was set back,
        from the last recorded time of the flight.

        Args:
            speedup: Speed-up of the flight.
            began_unix_s: Unix time at which the flight time was 0.
            last_s: Last recorded flight time.
            set_s: Known clock steps since the flight began, in seconds.
            steady: Steady clock of the flight.
            date_unix_s: Unix time by the simulated fleet's clock, which is never set.
        """
        date_unix_s = time.time() - set_s if date_unix_s is None else date_unix_s
        now_s = max(last_s, (date_unix_s - began_unix_s) * speedup)
        return cls(speedup, steady() - now_s / speedup, began_unix_s, steady)

    def now_s(self) -> float:
        """Return the flight time in seconds."""
        return (self.steady() - self.began_steady_s) * self.speedup

    def steady_unix_s(self) -> float:
        """Return Unix time: the time of day at construction plus the steady clock's time since."""
        return self.began_unix_s + self.now_s() / self.speedup

    def clock_step_s(self) -> float:
        """Return by how many seconds the time of day was set, or drifted, since construction."""
        unix_s, own_s = self.set_since
        return (time.time() - unix_s) - (steady_s() - own_s)

    def label_usec(self) -> int:
        """Return this moment in microseconds since 1970, as if the flight ran at speed 1."""
        return round((self.began_unix_s + self.now_s()) * 1e6)

    def unix_s(self) -> float:
        """Return Unix time by this computer's clock; it jumps when the clock is set."""
        return time.time()


GREETS_REAL_S = 1.0
"""Real seconds to wait for a fleet's greeting; without it, the port is not a simulated fleet's."""
BUSY_REAL_S = 0.25
"""Most real seconds to process without rest before time moves on; a flood of frames slows a flight, but does not end
it."""


@dataclass(eq=False, repr=False)
class FleetTime(asyncio.Protocol):
    """Steady clock: the fleet's time while a fleet is connected, else the computer's.

    The fleet's next moment begins when all its earlier messages have been processed and acknowledged; the fleet then
    runs at most `AHEAD_S` ahead. So when the computer delays one process, the other waits, and neither sees the other
    as late.
    """

    _speedup: float
    """Speed-up of the flight; a fleet with a different one keeps its own time."""
    _own_s: Callable[[], float]
    """Steady clock of the computer."""
    _monotonic_s: Callable[[], float] = time.monotonic
    """Real seconds, to measure how long the fleet has been silent."""
    _transport: asyncio.Transport | None = None
    _lines: common_time.LineBuffer = field(default_factory=common_time.LineBuffer)
    _turn: common_time.ReplyWait | None = None
    _came: asyncio.Event = field(default_factory=asyncio.Event)
    _behind_s: float = 0.0
    """Lag of our time behind the computer's clock, while not connected."""
    _base_s: float = 0.0
    _base_lived_s: float = 0.0
    _lived_s: float = 0.0
    """Our time, on the fleet's clock."""
    _told_s: float = 0.0
    """Time that the fleet has reached."""
    _heard_at_s: float = 0.0
    _taken_s: float = 0.0
    """Time acknowledged last."""
    _together: bool = False
    _dated: tuple[float, float] | None = None
    """A moment of our time, and its date on the fleet's clock."""

    @property
    def is_synchronised(self) -> bool:
        """Return whether our time follows the fleet's at the moment."""
        return self._together

    def steady_s(self) -> float:
        """Return seconds of a clock that never goes back."""
        if self._together:
            return self._base_s + (self._lived_s - self._base_lived_s) / self._speedup
        return self._own_s() - self._behind_s

    @property
    def is_connected(self) -> bool:
        """Return whether a fleet is connected, even if stopped."""
        return self._turn is not None

    def date_unix_s(self) -> float | None:
        """Return the date on the fleet's clock, which follows its own time; None without a fleet."""
        if self._dated is None or not self._together:
            return None
        at_s, unix_s = self._dated
        return unix_s + self.steady_s() - at_s

    async def connect(self, port: int) -> bool:
        """Request a common time from the fleet behind this port; return whether it agreed."""
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
        """Read the time that the fleet has reached."""
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
        # It ran on without us, so its messages are late already: keep that delay.
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
        """Note that everything received is processed; return whether time moved on."""
        if self._told_s > self._lived_s:
            self._lived_s = self._told_s
            return True
        if self._taken_s < self._lived_s and self._transport is not None and self._turn is not None:
            self._taken_s = self._lived_s
            self._transport.write(common_time.format_time_line(self._taken_s))
            self._turn.begin(self._monotonic_s())
        return False

    def note_busy(self) -> None:
        """Note that received data is still unprocessed."""
        if self._told_s > self._lived_s and self._monotonic_s() - self._heard_at_s >= BUSY_REAL_S:
            self._lived_s = self._told_s
            self.note_idle()

    def note_silence(self) -> None:
        """Note that nothing was received for a while: the fleet may be stopped or gone."""
        if self._turn is not None and self._turn.is_gone(self._monotonic_s()):
            self._fall_back_to_own_time()

    def disconnect(self) -> None:
        """Continue without a fleet."""
        self._fall_back_to_own_time()
        self._turn = None
        if self._transport is not None:
            self._transport.abort()
            self._transport = None

    def connection_lost(self, exc: Exception | None) -> None:  # noqa: ARG002 - asyncio's signature
        """Continue without a fleet."""
        self._fall_back_to_own_time()
        self._turn = self._transport = None
        self._came.set()


T = TypeVar("T")
P = ParamSpec("P")
ReadyFiles = list[tuple[selectors.SelectorKey, int]]

AT_ONCE = 8
"""Most ready files handled per round of the loop: about 5 ms, each with a few messages. Without it, fifty vehicles that
send at the same moment would delay deadlines, heartbeats and the page."""

THREADS = 16
THREADS_END_S = 5.0
"""Longest real seconds to wait for a flight's threads at its end; a disk or a name server may never answer."""


class BoundedThreadPool(futures.ThreadPoolExecutor):
    """Thread pool of an event loop; ending it takes at most `THREADS_END_S`."""

    def __init__(self) -> None:
        super().__init__(THREADS, thread_name_prefix="beside")
        self._begun: set[futures.Future[Any]] = set()

    def submit(self, fn: Callable[P, T], /, *args: P.args, **kwargs: P.kwargs) -> futures.Future[T]:
        """Run a function in a thread."""
        future = super().submit(fn, *args, **kwargs)
        self._begun.add(future)
        future.add_done_callback(self._begun.discard)
        return future

    def shutdown(self, wait: bool = True, *, cancel_futures: bool = False) -> None:
        """Accept no more work, and wait a limited time for running work."""
        super().shutdown(wait=False, cancel_futures=cancel_futures)
        if wait:
            futures.wait(tuple(self._begun), THREADS_END_S)


class FairSelector(selectors.DefaultSelector):
    """Selector that returns at most `AT_ONCE` files per round, those that have waited longest first.

    asyncio handles everything that is ready before it checks its deadlines again. Files left out here are still ready
    in the next round.
    """

    def __init__(self) -> None:
        super().__init__()
        self._rounds = 0
        self._served: dict[int, int] = {}
        """Round in which each file was handled last."""

    def select(self, timeout: float | None = None) -> ReadyFiles:
        """Return ready files, at most `AT_ONCE`."""
        ready = super().select(timeout)
        self._rounds += 1
        if len(ready) > AT_ONCE:
            ready = sorted(ready, key=lambda event: self._served.get(event[0].fd, 0))[:AT_ONCE]
        for key, _ in ready:
            self._served[key.fd] = self._rounds
        return ready


class _PacedSelector(FairSelector):
    """Selector that waits on a pacemaker's time instead of the computer's."""

    def __init__(self) -> None:
        super().__init__()
        self.pace: FleetTime | None = None

    def select(self, timeout: float | None = None) -> ReadyFiles:
        """Return ready files; none if only the pacemaker's time has advanced."""
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
    """Event loop that handles files in turns and whose deadlines may follow a pacemaker."""

    def __init__(self) -> None:
        self._selects = _PacedSelector()
        self._shift_s = 0.0
        super().__init__(self._selects)

    def time(self) -> float:
        """Return the time that deadlines refer to."""
        pace = self._selects.pace
        return super().time() if pace is None else pace.steady_s() + self._shift_s

    @contextmanager
    def follow_pacemaker(self, pace: FleetTime) -> Iterator[None]:
        """Follow this pacemaker's time inside the block."""
        self._shift_s = super().time() - pace.steady_s()
        self._selects.pace = pace
        try:
            yield
        finally:
            self._selects.pace = None


def run_on_fair_loop(
    work: Coroutine[None, None, T], loop: Callable[[], asyncio.AbstractEventLoop] = FairEventLoop
) -> T:
    """Run a coroutine as `asyncio.run` does, on a fair loop whose shutdown is bounded."""
    with asyncio.Runner(loop_factory=loop) as runner:
        runner.get_loop().set_default_executor(BoundedThreadPool())
        return runner.run(work)
