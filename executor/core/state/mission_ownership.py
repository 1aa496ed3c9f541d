"""What a vehicle says of the mission that it carries: whether it is ours, or another station has put its own on board.

MISSION_CURRENT comes at least once a second. Both autopilots send how many items they carry; PX4 adds a checksum of
them as `mission_id`. ArduPilot says "Flight plan received" after every upload, to its sender alone, and while it flies
its mission "Auto mission changed, restarted command" with every item that it stores, to everybody. A shorter mission
leaves it at an index beyond the new end.

A text is one packet, and anybody can send it: what it says is looked up on board before it is believed, and nothing new
is put on board meanwhile.
"""

from __future__ import annotations

import re
from dataclasses import dataclass, replace

from executor.core.context import Scene
from executor.core.interface.events import Match
from executor.core.interface.messages import NO_ITEM, MissionCurrent
from executor.core.lines import custody

SURE_S = 0.9
"""Two reports must agree; they come twice a second."""
SETTLES_S = 5.0
"""So long after an upload of ours a report, or a text, may be of before it."""
READ_AGAIN_S = 5.0
"""Between two readings of the mission on board."""
READS_S = 20.0
"""So long reading it may take: who stores a mission answers no question, nor does a dialogue that was broken off."""
_RECEIVED = re.compile(r"^(flight plan received|auto mission changed)", re.IGNORECASE)


@dataclass(frozen=True, slots=True)
class MissionOwnership:
    """What is known of the mission on board besides what was put there."""

    ours_s: float = float("-inf")
    """When a mission of ours came on board."""
    id: int | None = None
    """Its `mission_id`, once the vehicle has said it."""
    foreign_s: float | None = None
    """Since when a foreign mission is on board; None if none is."""
    words: str = ""
    """How that is known."""
    told_s: float | None = None
    """Since when a text says that it was given one, which nobody has looked up yet."""
    asked_s: float | None = None
    """Since when it is being read."""
    read_s: float = float("-inf")
    """When it was read last."""
    by_items: bool = False
    """Whether its items are others, by what was read: as many as ours are no sign that they are ours again."""

    def may_be_foreign(self) -> bool:
        """Return whether it may carry another mission."""
        return self.foreign_s is not None or self.told_s is not None

    def is_reading_due(self, now_s: float) -> bool:
        """Return whether it is time to look up what it carries."""
        if self.told_s is None or now_s - self.read_s < READ_AGAIN_S:
            return False
        return self.asked_s is None or now_s - self.asked_s >= READS_S

    def is_surely_foreign(self, now_s: float) -> bool:
        """Return whether a foreign mission is on board for certain."""
        return self.foreign_s is not None and now_s - self.foreign_s >= SURE_S


def compute_expected_total(context: Scene, name: str, items: int) -> int:
    """Return the total that a vehicle reports for a mission of so many items."""
    return items - 1 if context.vehicles[name].dialect.current_counts_home else items


def apply_mission_report(
    carried: MissionOwnership, message: MissionCurrent, expected: int, now_s: float
) -> MissionOwnership:
    """Take what a vehicle says of its mission, where that should be `expected` items of ours."""
    total, number = message.total, message.mission_id
    if total == NO_ITEM:  # PX4 without a mission
        return _mark_foreign(carried, custody.NO_MISSION, now_s)
    if total and total != expected:
        return _mark_foreign(carried, custody.OTHER_TOTAL.format(items=total, ours=expected), now_s)
    if number and number != carried.id:
        # What it says first after an upload may be of before it.
        if carried.id is None or now_s - carried.ours_s < SETTLES_S:
            return replace(carried, id=number, foreign_s=None, words="")
        return _mark_foreign(carried, custody.OTHER_ITEMS, now_s)
    if carried.foreign_s is None or (not number and carried.by_items):
        return carried
    return replace(carried, foreign_s=None, words="", by_items=False)


def note_mission_text(carried: MissionOwnership, text: str, now_s: float) -> MissionOwnership:
    """Take a text of a vehicle that is being sent nothing from here."""
    if not _RECEIVED.search(text) or now_s - carried.ours_s < SETTLES_S or carried.told_s is not None:
        return carried
    return replace(carried, told_s=now_s)


def apply_mission_readback(carried: MissionOwnership, match: Match | None, now_s: float) -> MissionOwnership:
    """Take what was read from it, against the mission that is ours; None if nothing could be read."""
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
