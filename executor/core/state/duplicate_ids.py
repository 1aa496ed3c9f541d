"""Whether two vehicles answer as one system, by what they say: a router may merge both into one address.

Each has a clock since its own boot and a place of its own. Positions that go to and fro between two that each go on by
themselves are those of two vehicles. One that reboots changes over once, and what comes twice, over two
radios of which one is late, is a copy.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

CLOCK_S = 1.0
"""A vehicle's clock goes on as time does, but for what frames take on their way."""
APART_M, FASTEST_M_S = 50.0, 40.0
"""No vehicle is farther from where it was than it flies, and a glitch."""
ENOUGH, WITHIN_S = 4, 10.0
"""So many times back in time, or away and back, each sooner than this after the last one."""
COPIES = 24
"""Positions that are remembered, to know a copy that comes seconds late."""
METRES_A_DEGREE = 111_320.0


@dataclass(frozen=True, slots=True)
class ReportedPosition:
    """A position as it came."""

    at_s: float
    boot_s: float
    lat_deg: float
    lon_deg: float


@dataclass(frozen=True, slots=True)
class DuplicateIdWatch:
    """What positions of one system say of how many vehicles it is."""

    one: ReportedPosition | None = None
    """The last one."""
    other: ReportedPosition | None = None
    """The last one of another clock, or of another place."""
    swaps: int = 0
    swapped_s: float = float("-inf")
    recent: tuple[tuple[float, float, float], ...] = ()

    @property
    def are_two(self) -> bool:
        """Return whether two vehicles speak."""
        return self.swaps >= ENOUGH


def add_reported_position(known: DuplicateIdWatch, told: ReportedPosition) -> DuplicateIdWatch:
    """Take a position."""
    if known.one is None or _is_continuation(known.one, told):
        return replace(known, one=told, recent=_append_position(known, told))
    if (told.boot_s, told.lat_deg, told.lon_deg) in known.recent:
        return known
    # What only comes late, however unevenly, never goes back in time.
    late = known.one.boot_s - told.boot_s <= CLOCK_S and _is_near(known.one, told)
    if late or known.other is None or not _is_continuation(known.other, told):
        return replace(known, one=told, other=known.one, recent=_append_position(known, told))
    swaps = known.swaps + 1 if told.at_s - known.swapped_s <= WITHIN_S else 1
    return DuplicateIdWatch(told, known.one, swaps, told.at_s, _append_position(known, told))


def _append_position(known: DuplicateIdWatch, told: ReportedPosition) -> tuple[tuple[float, float, float], ...]:
    return (*known.recent[-COPIES:], (told.boot_s, told.lat_deg, told.lon_deg))


def _is_continuation(before: ReportedPosition, told: ReportedPosition) -> bool:
    elapsed_s = told.at_s - before.at_s
    return abs(told.boot_s - before.boot_s - elapsed_s) <= CLOCK_S and _is_near(before, told)


def _is_near(before: ReportedPosition, told: ReportedPosition) -> bool:
    elapsed_s = told.at_s - before.at_s
    north_m = (told.lat_deg - before.lat_deg) * METRES_A_DEGREE
    east_m = (told.lon_deg - before.lon_deg) * METRES_A_DEGREE * math.cos(math.radians(before.lat_deg))
    return math.hypot(north_m, east_m) <= APART_M + FASTEST_M_S * max(0.0, elapsed_s)
