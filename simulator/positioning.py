"""What a vehicle knows of its place: its receiver's fix, what its estimator makes of it, and how it swings about it.

PX4's trajectory waits for a vehicle beside or behind it, so that this swing costs it time. In logs of PX4's own
simulator the vehicle is 0.12 to 0.17 m off along its line and 0.25 to 0.5 m across (one standard deviation), and climbs
and inspections last as much longer as a swing of 0.2 m each way makes them here; its estimate itself is off by 0.16 m.
"""

from __future__ import annotations

import math
import random

FAILSAFE_S = 4.0
"""After so long without a fix its failsafe acts."""
ABSOLUTE_S = 10.0
"""So long its estimator takes itself to know where on the earth it is."""
DRIFT_M_S2 = 0.2
"""What it takes for acceleration where there is none: 360 m in a minute."""
AIDED, ALONE = 831, 167
"""Flags of EKF_STATUS_REPORT and ESTIMATOR_STATUS: as recorded in flight, and in constant position mode."""
GPS_BIT = 0x20
"""MAV_SYS_STATUS_SENSOR_GPS."""


class Positioning:
    """A receiver that may lose its fix."""

    def __init__(self) -> None:
        self.lost_s: float | None = None
        """Since when it has none."""
        self._back_s = math.inf
        self._acted = False

    def lose(self, now_s: float, for_s: float) -> None:
        """Lose the fix, for good if `for_s` is 0."""
        self.lost_s, self._back_s, self._acted = now_s, now_s + for_s if for_s else math.inf, False

    def without_s(self, now_s: float) -> float:
        """Return for how long it has no fix; 0 while it has one."""
        if self.lost_s is not None and now_s >= self._back_s:
            self.lost_s = None
        return 0.0 if self.lost_s is None else now_s - self.lost_s

    def acts(self, now_s: float) -> bool:
        """Return, once, that the failsafe acts now."""
        if self._acted or self.without_s(now_s) < FAILSAFE_S:
            return False
        self._acted = True
        return True

    def off_m(self, now_s: float) -> float:
        """Return how far east of its place it takes itself to be."""
        return 0.5 * DRIFT_M_S2 * self.without_s(now_s) ** 2

    def off_m_s(self, now_s: float) -> float:
        """Return how much faster to the east it takes itself to fly."""
        return DRIFT_M_S2 * self.without_s(now_s)

    def flags(self, now_s: float) -> int:
        """Return what its estimator says of itself."""
        return AIDED if self.without_s(now_s) < ABSOLUTE_S else ALONE


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
