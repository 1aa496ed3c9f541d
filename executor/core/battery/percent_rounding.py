"""PX4 says one percentage twice: BATTERY_STATUS rounds it, SYS_STATUS rounds it up, and more often.

Together they tell halves of a percent, twice as early.
"""

from __future__ import annotations

from dataclasses import dataclass

FRESH_S = 4.0
"""Two reports of BATTERY_STATUS at PX4's own interval."""


@dataclass(frozen=True, slots=True)
class PercentRounding:
    """What was said last, and when."""

    rounded: float = 0.0
    rounded_s: float = float("-inf")
    ceiled: float = 0.0
    ceiled_s: float = float("-inf")

    @property
    def percent(self) -> float:
        """What lies within both, or the newer one where they contradict each other.

        >>> PercentRounding(96.0, 1.0, 97.0, 1.5).percent
        96.25
        """
        if abs(self.rounded_s - self.ceiled_s) > FRESH_S:
            return self.rounded if self.rounded_s > self.ceiled_s else self.ceiled
        low, high = max(self.rounded - 0.5, self.ceiled - 1.0), min(self.rounded + 0.5, self.ceiled)
        if low < high:
            return (low + high) / 2
        return self.rounded if self.rounded_s >= self.ceiled_s else self.ceiled - 0.5
