"""Define mission items exactly as on the wire (MISSION_ITEM_INT), as plain data.

Only the frames and commands that faultline uses are listed; a test checks the numbers against pymavlink's.
"""

from __future__ import annotations

import struct
import zlib
from collections.abc import Iterable
from dataclasses import dataclass
from enum import IntEnum


class Frame(IntEnum):
    """MAV_FRAME."""

    GLOBAL = 0
    MISSION = 2
    GLOBAL_RELATIVE_ALT = 3
    GLOBAL_INT = 5
    GLOBAL_RELATIVE_ALT_INT = 6


PLAIN_FRAMES: dict[int, int] = {
    Frame.GLOBAL_INT: Frame.GLOBAL,
    Frame.GLOBAL_RELATIVE_ALT_INT: Frame.GLOBAL_RELATIVE_ALT,
}
"""MISSION_ITEM_INT has two numbers for each of these frames; autopilots may return either."""


class MissionKind(IntEnum):
    """MAV_MISSION_TYPE: the three lists on a vehicle, each with its own transfer."""

    MISSION = 0
    FENCE = 1
    RALLY = 2


class PlaceCommand(IntEnum):
    """MAV_CMD of fence and rally point items."""

    FENCE_RETURN_POINT = 5000
    INCLUSION_VERTEX = 5001
    """param1: number of vertices of its polygon, which are consecutive."""
    EXCLUSION_VERTEX = 5002
    INCLUSION_CIRCLE = 5003
    """param1: its radius in metres."""
    EXCLUSION_CIRCLE = 5004
    RALLY_POINT = 5100


class Command(IntEnum):
    """MAV_CMD of mission items."""

    NAV_WAYPOINT = 16
    NAV_RETURN_TO_LAUNCH = 20
    NAV_LAND = 21
    NAV_TAKEOFF = 22
    DO_CHANGE_SPEED = 178
    DO_SET_ROI_LOCATION = 195
    DO_SET_ROI_NONE = 197
    DO_DIGICAM_CONTROL = 203
    DO_SET_CAM_TRIGG_DIST = 206
    DO_GIMBAL_MANAGER_PITCHYAW = 1000
    IMAGE_START_CAPTURE = 2000
    IMAGE_STOP_CAPTURE = 2001
    VIDEO_START_CAPTURE = 2500
    VIDEO_STOP_CAPTURE = 2501


PAYLOAD = frozenset({
    Command.DO_DIGICAM_CONTROL, Command.DO_SET_CAM_TRIGG_DIST, Command.DO_GIMBAL_MANAGER_PITCHYAW,
    Command.IMAGE_START_CAPTURE, Command.IMAGE_STOP_CAPTURE, Command.VIDEO_START_CAPTURE, Command.VIDEO_STOP_CAPTURE,
    Command.DO_SET_ROI_LOCATION, Command.DO_SET_ROI_NONE,
})  # fmt: skip
"""Commands for a camera or its gimbal, or that turn the vehicle for it."""


@dataclass(frozen=True, slots=True)
class MissionItem:
    """One item; ``param1`` to ``param4``, ``x``, ``y`` and ``z`` depend on the command."""

    seq: int
    frame: int
    command: int
    param1: float = 0.0
    param2: float = 0.0
    param3: float = 0.0
    param4: float = 0.0
    x: int = 0
    """Latitude in 1e-7 degrees for items with a place."""
    y: int = 0
    """Longitude in 1e-7 degrees for items with a place."""
    z: float = 0.0
    """Height in metres for items with a place."""
    current: bool = False
    autocontinue: bool = True


_CHECKED = struct.Struct("<BHB4fiif")


def compute_list_checksum(items: Iterable[MissionItem]) -> int:
    """Return PX4's checksum of a list: a CRC32 of all fields of every item except `current`.

    Unlike other CRC32s, it is not inverted before or after (crc32.c of NuttX); measured on v1.17.0.
    """
    crc = 0
    for item in items:
        said = (item.frame, item.command, item.autocontinue, item.param1, item.param2, item.param3, item.param4)
        crc = ~zlib.crc32(_CHECKED.pack(*said, item.x, item.y, item.z), ~crc & 0xFFFFFFFF) & 0xFFFFFFFF
    return crc
