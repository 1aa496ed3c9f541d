"""How a vehicle swings about where it is wanted: what it believes of its place wanders, and it runs after that.

PX4's trajectory waits for a vehicle beside or behind it, so that this swing costs it time. In logs of PX4's own
simulator the vehicle is 0.12 to 0.17 m off along its line and 0.25 to 0.5 m across (one standard deviation), and climbs
and inspections last as much longer as a swing of 0.2 m each way makes them here; its estimate itself is off by 0.16 m.
"""

from __future__ import annotations

import math
import random

PERIODS_S = (4.0, 7.0, 12.0)
"""The estimate's error is a stranger to itself after some 5 s."""
SPREAD = 0.15
"""By so much every period is another one for every vehicle."""


class PositionDrift:
    """A swing about zero, by east and north, the same for the same seed."""

    def __init__(self, off_m: float, seed: str) -> None:
        """Begin.

        Args:
            off_m: One standard deviation each way; 0 for a vehicle that is where it should be.
            seed: Whose.
        """
        rng = random.Random(seed)
        self._swing_m = off_m * math.sqrt(2.0 / len(PERIODS_S))
        self._waves = [
            [
                (2.0 * math.pi / (period_s * rng.uniform(1.0 - SPREAD, 1.0 + SPREAD)), rng.uniform(0.0, 2.0 * math.pi))
                for period_s in PERIODS_S
            ]
            for _ in range(2)
        ]

    def offset_m(self, now_s: float) -> tuple[float, float]:
        """Return how far off it is, east and north."""
        if not self._swing_m:
            return 0.0, 0.0
        east, north = (sum(math.sin(turn * now_s + phase) for turn, phase in waves) for waves in self._waves)
        return self._swing_m * east, self._swing_m * north
