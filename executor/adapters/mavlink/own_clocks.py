"""How much time really passed where a recorder's clock leaps: by the clocks of the vehicles themselves.

A telemetry log is stamped by the computer that wrote it, whose clock is set in flight: by satellites, by a network, by
hand, from 1970 to today, or an hour back. What the vehicles send has their own time since their boot. After a leap both
go on alike, apart by as much as the clock was set; after a silence of the link they agree as before, at the latest when
what was held back has come.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

BACK_USEC = 1_000_000
"""Frames of several links are out of order by less."""
AHEAD_USEC = 2_000_000
"""A shorter pause is one of any link, and costs nothing."""
SET_USEC = 1_500_000
"""A clock that is off by less was not set."""
STEADY_USEC = 500_000
"""By so much both may differ after it was set; frames that were held back catch up by more."""
SEEN_USEC, LOOKS_USEC = 2_500_000, 10_000_000
"""For so long both must go on alike where the leap itself is short, and for so long is looked ahead."""
SHORT_USEC = 60_000_000
LONGEST_PAUSE_USEC = 86_400_000_000
"""Where no vehicle's clock says anything a longer pause of a recorder is a clock that was set."""


@dataclass(frozen=True, slots=True)
class BootTime:
    """A vehicle's own time, and the log's beside it, in microseconds."""

    boot_usec: int
    stamp_usec: int


def was_set_by_usec(pairs: Sequence[tuple[BootTime, BootTime]], stamp_usec: int, before_usec: int) -> int:
    """Return by how much a clock was set between two stamps; 0 where it was not.

    Args:
        pairs: Of each report after the leap, in their order: its vehicle's last report before it, and itself.
        stamp_usec: Of the first record after it.
        before_usec: Of the last record before it.
    """
    leap_usec = stamp_usec - before_usec
    off = [
        (after.stamp_usec - before.stamp_usec) - (after.boot_usec - before.boot_usec)
        for before, after in pairs
        if after.boot_usec >= before.boot_usec  # else it rebooted, and says nothing of the time between
    ]
    if not off:
        return leap_usec if not -BACK_USEC <= leap_usec < LONGEST_PAUSE_USEC else 0
    seen_usec = pairs[-1][1].stamp_usec - stamp_usec
    alike = max(off) - min(off) <= STEADY_USEC and (seen_usec >= SEEN_USEC or abs(leap_usec) >= SHORT_USEC)
    if alike and abs(off[-1]) >= SET_USEC:
        return off[-1]
    return leap_usec if leap_usec < -BACK_USEC else 0
