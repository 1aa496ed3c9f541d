"""The system clock: a steady one to decide, UTC only to label."""

from __future__ import annotations

import time
from dataclasses import dataclass, field
from typing import Self


def _steady_s() -> float:
    """Return seconds of a clock that nobody sets, and that runs on while the computer is suspended.

    The vehicles fly on then. Linux's CLOCK_MONOTONIC stands still meanwhile, and CLOCK_BOOTTIME does not; elsewhere
    the monotonic clock is all there is.
    """
    return time.clock_gettime(time.CLOCK_BOOTTIME) if hasattr(time, "CLOCK_BOOTTIME") else time.monotonic()


@dataclass(frozen=True, slots=True)
class SystemClock:
    """The flight's time: 0 at construction, `speedup` seconds in a real one."""

    speedup: float = 1.0
    began_steady_s: float = field(default_factory=_steady_s)
    began_unix_s: float = field(default_factory=time.time)

    @classmethod
    def again(cls, speedup: float, began_unix_s: float, last_s: float, set_s: float = 0.0) -> Self:
        """Return the clock of a flight that goes on in a new process, maybe on another computer.

        It goes on from where the time of day says that it is, which is the only clock that outlives a process and a
        computer; if that was set back, from where the flight was last.

        Args:
            speedup: Of the flight.
            began_unix_s: Seconds since 1970 at which its time was 0.
            last_s: The last time that is on record.
            set_s: By how much the time of day is known to have been set since the flight began.
        """
        now_s = max(last_s, (time.time() - set_s - began_unix_s) * speedup)
        return cls(speedup, _steady_s() - now_s / speedup, began_unix_s)

    def now_s(self) -> float:
        """Seconds of the flight since construction."""
        return (_steady_s() - self.began_steady_s) * self.speedup

    def dated_s(self) -> float:
        """Seconds since 1970 by the time of day at construction and the steady clock since."""
        return self.began_unix_s + self.now_s() / self.speedup

    def set_s(self) -> float:
        """Seconds by which the time of day was set, or drifted, since construction."""
        return time.time() - self.dated_s()

    def label_usec(self) -> int:
        """Microseconds since 1970 at which this moment would lie had the flight been flown at speed 1."""
        return round((self.began_unix_s + self.now_s()) * 1e6)

    def unix_s(self) -> float:
        """Seconds since 1970 as this computer knows them now: they jump when its clock is set."""
        return time.time()
