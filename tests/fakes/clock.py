"""Time for tests of what waits: the event loop's own, which looptime lets jump to the next deadline."""

from __future__ import annotations

import asyncio
from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class LoopClock:
    """A flight's clock that reads the running loop's time."""

    speedup: float = 1.0

    def now_s(self) -> float:
        """Seconds of the flight since the loop began."""
        return asyncio.get_running_loop().time() * self.speedup
