"""What a vehicle says of the mission that it carries: whether it is ours, or another station has put its own on board.

MISSION_CURRENT comes at least once a second. Both autopilots send how many items they carry; PX4 adds a checksum of
them as `mission_id`. ArduPilot says "Flight plan received" after every upload, to its sender alone, and while it flies
its mission "Auto mission changed, restarted command" with every item that it stores, to everybody. A shorter mission
leaves it at an index beyond the new end.
"""

from __future__ import annotations

import re
from dataclasses import dataclass, replace

from executor.core.context import Scene
from executor.core.messages import MissionCurrent
from executor.core.plausible import NO_ITEM

SURE_S = 0.9
"""Two reports must agree; they come twice a second."""
SETTLES_S = 5.0
"""So long after an upload of ours a report, or a text, may be of before it."""
_RECEIVED = re.compile(r"^(flight plan received|auto mission changed)", re.IGNORECASE)


@dataclass(frozen=True, slots=True)
class Carried:
    """What is known of the mission on board besides what was put there."""

    ours_s: float = float("-inf")
    """When a mission of ours came on board."""
    id: int | None = None
    """Its `mission_id`, once the vehicle has said it."""
    foreign_s: float | None = None
    """Since when it carries another one; None if it does not."""
    words: str = ""
    """How that is known."""

    def sure(self, now_s: float) -> bool:
        """Return whether it carries another mission for certain."""
        return self.foreign_s is not None and now_s - self.foreign_s >= SURE_S


def items_expected(context: Scene, name: str, items: int) -> int:
    """Return the total that a vehicle reports for a mission of so many items."""
    return items - 1 if context.vehicles[name].dialect.current_counts_home else items


def reported(carried: Carried, message: MissionCurrent, expected: int, now_s: float) -> Carried:
    """Take what a vehicle says of its mission, where that should be `expected` items of ours."""
    total, number = message.total, message.mission_id
    if total == NO_ITEM:  # PX4 without a mission
        return _foreign(carried, "none at all", now_s)
    if total and total != expected:
        return _foreign(carried, f"{total} items where ours has {expected}", now_s)
    if number and number != carried.id:
        # What it says first after an upload may be of before it.
        if carried.id is None or now_s - carried.ours_s < SETTLES_S:
            return replace(carried, id=number, foreign_s=None, words="")
        return _foreign(carried, "as many items as ours, and others", now_s)
    if carried.foreign_s is None or (not number and carried.words == RECEIVED):
        return carried
    return replace(carried, foreign_s=None, words="")


RECEIVED = "it says that it has received one"


def texted(carried: Carried, text: str, now_s: float) -> Carried:
    """Take a text of a vehicle that is being sent nothing from here."""
    if not _RECEIVED.search(text) or now_s - carried.ours_s < SETTLES_S:
        return carried
    return _foreign(carried, RECEIVED, now_s)


def _foreign(carried: Carried, words: str, now_s: float) -> Carried:
    if carried.foreign_s is not None:
        return carried
    return replace(carried, foreign_s=now_s, words=words)
