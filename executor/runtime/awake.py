"""The time in which this program was able to do its work: its own time-outs count in no other.

A computer with too much to do lets a program wait. What a vehicle answered meanwhile lies unread, and by
the clock every patience is spent. So a beat goes beside the dialogues, and of a beat that comes late only
`MOST_REAL_S` counts.
"""

from __future__ import annotations

import asyncio
import inspect
from collections.abc import Callable, Coroutine, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from functools import wraps
from typing import Any, ParamSpec, TypeVar
from weakref import WeakKeyDictionary

from executor.core.interface.ports import Clock

BEAT_REAL_S = 0.1
LEAST_WAIT_S = 1e-6
"""Of a time-out what is less is nothing: it is the last digit of a sum."""
MOST_REAL_S = 0.25
"""Of the time between two beats so much counts; a program that is as late as this all the time is not slow yet."""

T = TypeVar("T")
P = ParamSpec("P")


@dataclass(slots=True)
class _Beat:
    """The beat of one event loop, for as long as somebody needs it."""

    loop: asyncio.AbstractEventLoop
    clock: Clock
    users: int = 0
    at_s: float = 0.0
    """Of the last beat, in real seconds of the clock."""
    lost_s: float = 0.0
    """Before it, in which this program was not able to do anything."""
    next: asyncio.TimerHandle | None = None

    def begin(self) -> None:
        self.users += 1
        if self.users == 1:
            self.at_s = self._now_s()
            self.next = self.loop.call_later(BEAT_REAL_S, self._beat)

    def end(self) -> None:
        self.users -= 1
        if self.users == 0 and self.next is not None:
            self.lost_s = self.total_lost_real_s()
            self.next.cancel()

    def total_lost_real_s(self) -> float:
        """Return how many real seconds this program has lost so far."""
        return self.lost_s + max(0.0, self._now_s() - self.at_s - MOST_REAL_S)

    def _now_s(self) -> float:
        return self.clock.now_s() / self.clock.speedup

    def _beat(self) -> None:
        self.lost_s, self.at_s = self.total_lost_real_s(), self._now_s()
        self.next = self.loop.call_later(BEAT_REAL_S, self._beat)


_BEATS: WeakKeyDictionary[asyncio.AbstractEventLoop, _Beat] = WeakKeyDictionary()


@dataclass(frozen=True, slots=True)
class AwakeClock:
    """A clock that stands still while this program cannot do anything; it never goes back."""

    clock: Clock
    beat: _Beat = field(repr=False)

    @property
    def speedup(self) -> float:
        """Seconds of the flight in a real second."""
        return self.clock.speedup

    def now_s(self) -> float:
        """Seconds of the flight in which this program was able to do its work."""
        return self.clock.now_s() - self.beat.total_lost_real_s() * self.clock.speedup


@contextmanager
def awake(clock: Clock) -> Iterator[AwakeClock]:
    """Return the clock of this program's own time-outs, to be used inside the block."""
    if isinstance(clock, AwakeClock):
        yield clock
        return
    loop = asyncio.get_running_loop()
    beat = _BEATS.get(loop)
    if beat is None or (beat.users == 0 and beat.clock is not clock):
        beat = _BEATS[loop] = _Beat(loop, clock)
    beat.begin()
    try:
        yield AwakeClock(clock, beat)
    finally:
        beat.end()


def underlying(clock: Clock) -> Clock:
    """Return the flight's clock of one that is maybe that of this program's work."""
    return clock.clock if isinstance(clock, AwakeClock) else clock


def times_slower(clock: Clock, began_s: float, able_began_s: float) -> float:
    """Return how many times as long something took as this program was able to work on it; 1 on a computer at rest.

    Args:
        clock: Of the program's work.
        began_s: When it began on the flight's clock.
        able_began_s: The same on this one.
    """
    took_s, able_s = underlying(clock).now_s() - began_s, clock.now_s() - able_began_s
    return max(1.0, took_s / able_s) if able_s > 0.0 else 1.0


def count_awake_time(work: Callable[P, Coroutine[Any, Any, T]]) -> Callable[P, Coroutine[Any, Any, T]]:
    """Have a procedure count its time-outs by the time in which this program was able to do its work."""
    signature = inspect.signature(work)

    @wraps(work)
    async def done(*args: P.args, **kwargs: P.kwargs) -> T:
        given = signature.bind(*args, **kwargs)
        with awake(given.arguments["clock"]) as able:
            given.arguments["clock"] = able
            return await work(*given.args, **given.kwargs)

    return done


SLOW_SHARE = 0.3
"""A program that loses more than this of its time is too slow for its flight."""
LOOKS_S = 10.0
SAYS_AGAIN_S = 60.0


class Lateness:
    """What a flight loses of its time, from tick to tick, and when that is worth a line."""

    def __init__(self, able: AwakeClock, clock: Clock) -> None:
        """Begin to look at two clocks: that of the program's work, and the flight's."""
        self._able, self._clock = able, clock
        self._behind_s = self._looked_behind_s = clock.now_s() - able.now_s()
        self._looked_s, self._said_s = clock.now_s(), float("-inf")

    def take_lost_s(self) -> float:
        """Return how much was lost since this was asked last."""
        before_s, self._behind_s = self._behind_s, self._clock.now_s() - self._able.now_s()
        return round(max(0.0, self._behind_s - before_s), 3)

    def to_be_said(self) -> str:
        """Return that this computer is too slow, now and then; empty if it is not."""
        now_s = self._clock.now_s()
        passed_s = now_s - self._looked_s
        if passed_s < LOOKS_S:
            return ""
        lost_s, self._looked_s = self._behind_s - self._looked_behind_s, now_s
        self._looked_behind_s = self._behind_s
        if lost_s < SLOW_SHARE * passed_s or now_s - self._said_s < SAYS_AGAIN_S:
            return ""
        self._said_s = now_s
        return (
            f"this computer is too busy: the ground station lost {lost_s:.0f} of the last {passed_s:.0f} s; "
            "its time-outs wait that long"
        )
