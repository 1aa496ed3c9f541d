"""ArduPilot's lists as files, after AP_Filesystem_Mission.cpp.

Measured on Copter 4.7-dev: a file closed without its header changes nothing; a part of a list takes effect at once, and
restarts the leg once; the items after it stay.
"""

from __future__ import annotations

import struct
from collections.abc import Sequence
from dataclasses import dataclass

from missions.items import MissionItem

NAMES = ("@MISSION/mission.dat", "@MISSION/fence.dat", "@MISSION/rally.dat")
"""By MAV_MISSION_TYPE."""
FILE_BYTES = 1 << 20
"""Reported size, whatever the content."""
MAGIC, KEEP_REST = 0x763D, 1
HEADER = struct.Struct("<HHHHH")
"""Magic, kind of list, options, first item, number of items."""
ITEM = struct.Struct("<4fiifHHBBBBBB")


@dataclass(frozen=True, slots=True)
class FilePart:
    """Contents of a closed mission file, to store on board."""

    first: int
    items: tuple[MissionItem, ...]
    keeps_rest: bool


def read_part(data: bytes) -> FilePart | None:
    """Return the contents of a file; None if a part of it was not written."""
    if len(data) < HEADER.size:
        return None
    magic, _, options, first, count = HEADER.unpack_from(data)
    body = data[HEADER.size :]
    rows = [body[at : at + ITEM.size] for at in range(0, len(body) - ITEM.size + 1, ITEM.size)]
    if magic != MAGIC or len(rows) != count or not all(map(any, rows)):
        return None
    return FilePart(first, tuple(map(_read_item, rows)), bool(options & KEEP_REST))


def _read_item(row: bytes) -> MissionItem:
    one, two, three, four, x, y, z, seq, command, _, _, frame, current, goes_on, _ = ITEM.unpack(row)
    return MissionItem(seq, frame, command, one, two, three, four, x, y, z, bool(current), bool(goes_on))


def build_file(kind: int, items: Sequence[MissionItem]) -> bytes:
    """Return the file of a list; `kind` is MAV_MISSION_TYPE."""
    return HEADER.pack(MAGIC, kind, 0, 0, len(items)) + b"".join(
        ITEM.pack(
            item.param1, item.param2, item.param3, item.param4, item.x, item.y, item.z, item.seq, item.command, 0, 0,
            item.frame, item.current, item.autocontinue, kind,
        )
        for item in items
    )  # fmt: skip
