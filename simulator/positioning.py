"""What a vehicle knows of its place: its receiver's fix, and what its estimator makes of it without one."""

from __future__ import annotations

import math

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
