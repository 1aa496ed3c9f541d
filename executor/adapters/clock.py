"""The system clock: monotonic to decide, UTC only to label."""

from __future__ import annotations

import time
from dataclasses import dataclass, field


@dataclass(frozen=True, slots=True)
class SystemClock:
    """The flight's time: 0 at construction, `speedup` seconds in a real one."""

    speedup: float = 1.0
    began_monotonic: float = field(default_factory=time.monotonic)
    began_unix_s: float = field(default_factory=time.time)

    def now_s(self) -> float:
        """Seconds of the flight since construction."""
        return (time.monotonic() - self.began_monotonic) * self.speedup

    def label_usec(self) -> int:
        """Microseconds since 1970 at which this moment would lie had the flight been flown at speed 1."""
        return round((self.began_unix_s + self.now_s()) * 1e6)

    def unix_s(self) -> float:
        """Seconds since 1970 as this computer knows them now: they jump when its clock is set."""
        return time.time()
