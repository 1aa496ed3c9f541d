"""Decide from a vehicle's reports whether its mission is ours, or another station has uploaded its own.

MISSION_CURRENT arrives at least once a second. Both autopilots report the number of items on board; PX4 adds a checksum
of them as `mission_id`. ArduPilot sends "Flight plan received" after every upload, to the uploader alone, and, while it
flies its mission, "Auto mission changed, restarted command" to all, with every item stored. A shorter mission leaves it
at an index beyond the new end.

A text is one packet, and anybody can send it: the mission on board is read before it is believed, and nothing new is
uploaded meanwhile.
"""

from __future__ import annotations

import re
from dataclasses import dataclass, replace

from executor.core.context import Scene
from executor.core.interface.events import Match
from executor.core.interface.messages import NO_ITEM, MissionCurrent
from executor.core.lines import custody

AGREEMENT_S = 0.9
"""Time for which reports must agree; they arrive twice a second."""
UPLOAD_SETTLE_S = 5.0
"""Time after our upload in which a report or a text may still describe the mission before it."""
READBACK_INTERVAL_S = 5.0
"""Shortest interval between two read-backs of the mission on board."""
READBACK_TIMEOUT_S = 20.0
"""Longest read-back; a vehicle that is storing a mission does not answer, nor does an aborted dialogue."""
_UPLOAD_TEXT = re.compile(r"^(flight plan received|auto mission changed)", re.IGNORECASE)


@dataclass(frozen=True, slots=True)
class MissionOwnership:
    """The evidence of which mission is on board, beside what we uploaded."""

    ours_s: float = float("-inf")
    """When our mission was uploaded."""
    id: int | None = None
    """Its `mission_id`, once reported."""
    foreign_s: float | None = None
    """Since when a foreign mission is on board; None if none is."""
    words: str = ""
    """The evidence for it, in words."""
    told_s: float | None = None
    """When a text announced a new mission that has not been read back yet."""
    asked_s: float | None = None
    """When a read-back was started."""
    read_s: float = float("-inf")
    """When the last one ended."""
    by_items: bool = False
    """Whether a read-back showed other items: then a matching count is no sign that they are ours again."""

    def may_be_foreign(self) -> bool:
        """Return whether the mission on board may be foreign."""
        return self.foreign_s is not None or self.told_s is not None

    def is_reading_due(self, now_s: float) -> bool:
        """Return whether the mission on board should be read back now."""
        if self.told_s is None or now_s - self.read_s < READBACK_INTERVAL_S:
            return False
        return self.asked_s is None or now_s - self.asked_s >= READBACK_TIMEOUT_S

    def is_surely_foreign(self, now_s: float) -> bool:
        """Return whether a foreign mission is on board for certain."""
        return self.foreign_s is not None and now_s - self.foreign_s >= AGREEMENT_S


def compute_expected_total(context: Scene, name: str, items: int) -> int:
    """Return the total that a vehicle reports for a mission of that many items."""
    return items - 1 if context.vehicles[name].dialect.current_counts_home else items


def apply_mission_report(
    carried: MissionOwnership, message: MissionCurrent, expected: int, now_s: float
) -> MissionOwnership:
    """Apply a mission report of a vehicle that should carry `expected` items of ours."""
    total, number = message.total, message.mission_id
    if total == NO_ITEM:  # PX4 without a mission
        return _mark_foreign(carried, custody.NO_MISSION, now_s)
    if total and total != expected:
        return _mark_foreign(carried, custody.OTHER_TOTAL.format(items=total, ours=expected), now_s)
    if number and number != carried.id:
        # The first report after an upload may describe the old mission.
        if carried.id is None or now_s - carried.ours_s < UPLOAD_SETTLE_S:
            return replace(carried, id=number, foreign_s=None, words="")
        return _mark_foreign(carried, custody.OTHER_ITEMS, now_s)
    if carried.foreign_s is None or (not number and carried.by_items):
        return carried
    return replace(carried, foreign_s=None, words="", by_items=False)


def note_mission_text(carried: MissionOwnership, text: str, now_s: float) -> MissionOwnership:
    """Apply a text of a vehicle to which we are uploading nothing."""
    if not _UPLOAD_TEXT.search(text) or now_s - carried.ours_s < UPLOAD_SETTLE_S or carried.told_s is not None:
        return carried
    return replace(carried, told_s=now_s)


def apply_mission_readback(carried: MissionOwnership, match: Match | None, now_s: float) -> MissionOwnership:
    """Compare a read-back with our mission; None if it could not be read."""
    known = replace(carried, told_s=None, asked_s=None, read_s=now_s)
    if match is None:
        return replace(_mark_foreign(known, custody.UNREADABLE, now_s), by_items=True)
    if match.whole:
        return replace(known, foreign_s=None, words="", by_items=False)
    words = custody.READ_BACK_DIFFERS.format(alike=match.alike)
    return replace(_mark_foreign(known, words, now_s), words=words, by_items=True)


def _mark_foreign(carried: MissionOwnership, words: str, now_s: float) -> MissionOwnership:
    if carried.foreign_s is not None:
        return carried
    return replace(carried, foreign_s=now_s, words=words)
