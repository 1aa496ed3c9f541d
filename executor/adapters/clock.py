"""The system clock: a steady one to decide, UTC only to label."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Self


def steady_s() -> float:
    """Return seconds of a clock that nobody sets, and that runs on while the computer is suspended.

    The vehicles fly on then. Linux's CLOCK_MONOTONIC stands still meanwhile, and CLOCK_BOOTTIME does not; elsewhere
    the monotonic clock is all there is.
    """
    return time.clock_gettime(time.CLOCK_BOOTTIME) if hasattr(time, "CLOCK_BOOTTIME") else time.monotonic()


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
