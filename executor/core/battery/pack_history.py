"""What a pack's earlier flights say of it: its capacity and its resistance, before it has flown again.

A pack that is labelled is known before it is under load. What its voltage said of its capacity over its last flights
counts as the more that the chemistries allow, so that nobody flies less for a curve that is not its own; a site that
names the chemistry leaves nothing open.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from statistics import median, stdev

RECENT = 5
"""Flights that say what a pack is now: it ages."""
LEAST_SHARE_SD = 0.03
"""Of a capacity by voltages: 10 mV of a cell are a percent, or more."""
OHM_SHARE_SD = 0.2
"""Of a resistance on another day: a pack of 10 degrees has half as much again as one of 25."""
FULL = 0.95
"""Of a capacity: a pack that has more is as it should be."""
LEAST_PCT = 1.0


@dataclass(frozen=True, slots=True)
class PackFlightRecord:
    """One flight of a pack; None where its log did not say."""

    capacity_ah: float | None
    """The most that its voltage allows."""
    ohm: float | None
    set_ah: float | None
    """What its autopilot counted by."""


@dataclass(frozen=True, slots=True)
class PackHistory:
    """A labelled pack."""

    label: str
    flights: int = 0
    capacity_ah: tuple[float, float] | None = None
    """Mean and standard deviation."""
    ohm: tuple[float, float] | None = None
    """The same of the whole pack."""
    set_ah: float | None = None
    """What its autopilot counted by last."""

    def share_of(self, capacity_ah: float | None) -> float:
        """Return how much of a capacity it has; 1 where nothing says that it has less."""
        if self.capacity_ah is None or not capacity_ah:
            return 1.0
        share = self.capacity_ah[0] / capacity_ah
        return share if share < FULL else 1.0

    def budget_pct(self, asked_pct: float, reserve_pct: float, planned_ah: float) -> float:
        """Return what a route may use of it, in percent of the capacity that is planned with."""
        return max(LEAST_PCT, min(asked_pct, 100.0 * self.share_of(planned_ah) - reserve_pct))

    def empty_reading_pct(self, planned_ah: float, *, counts: bool) -> float:
        """Return how much its autopilot will report when it is empty.

        Args:
            planned_ah: Capacity that is planned with; taken where no flight says what its autopilot counts by.
            counts: Whether an autopilot of which that is not known counts charge at all.
        """
        counted_ah = self.set_ah or (planned_ah if counts else None)
        return 100.0 * (1.0 - self.share_of(counted_ah))


def build_pack_history(label: str, flown: Sequence[PackFlightRecord]) -> PackHistory:
    """Return what a pack's flights say, given in their order."""
    last = flown[-RECENT:]
    capacities = [one.capacity_ah for one in last if one.capacity_ah is not None]
    ohms = [one.ohm for one in last if one.ohm is not None and one.ohm > 0]
    sets = [one.set_ah for one in last if one.set_ah]
    return PackHistory(
        label,
        len(flown),
        _estimate_mean_sd(capacities, LEAST_SHARE_SD),
        _estimate_mean_sd(ohms, OHM_SHARE_SD),
        sets[-1] if sets else None,
    )


def _estimate_mean_sd(values: Sequence[float], least_share: float) -> tuple[float, float] | None:
    if not values:
        return None
    middle = median(values)
    scatter = stdev(values) / math.sqrt(len(values)) if len(values) > 1 else 0.0
    return middle, max(scatter, least_share * middle)
