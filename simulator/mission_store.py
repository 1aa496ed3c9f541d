"""What both autopilots share of the vehicle's side of the mission protocol."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from enum import Enum

from missions.items import PAYLOAD, Command, Frame, MissionItem
from simulator.enums import MissionResult
from simulator.messages import (
    MISSION_TYPE_MISSION,
    ItemReceived,
    Outbound,
    Peer,
    build_message,
)

DEGREES_E7 = 1e-7


class UploadFault(Enum):
    """What an injected fault does to uploads."""

    NONE = "none"
    REFUSE = "refuse"
    HALF = "half"


@dataclass(frozen=True, slots=True)
class StoreStep:
    """What the store answers, and what changed on board."""

    send: tuple[Outbound, ...] = ()
    texts: tuple[tuple[int, str], ...] = ()
    """(severity, text)."""
    stored: bool = False
    """ArduPilot: an item has just been replaced, in place."""
    cleared: bool = False
    """The mission is empty now because somebody said so."""
    truncated: bool = False
    """ArduPilot: an upload was announced, and what lies beyond its length is gone."""
    swapped: bool = False
    """PX4: the whole list has just been replaced."""
    current: int | None = None
    """PX4: the item that the new list flags as the one to fly."""
    fenced: bool = False
    """The fence on board has just been replaced."""


@dataclass(slots=True)
class Transfer:
    """An upload or a download under way."""

    partner: Peer
    count: int
    heard_s: float
    """When the partner last did what moves the transfer on."""
    asked_s: float
    """When the vehicle last asked."""
    next: int = 0
    items: list[MissionItem] = field(default_factory=list)
    """PX4's second buffer, and both autopilots' for what is no mission."""
    kind: int = MISSION_TYPE_MISSION
    """MAV_MISSION_TYPE."""

    def is_stalled(self, fault: UploadFault) -> bool:
        """Return whether an injected fault keeps the vehicle from asking on."""
        return fault is UploadFault.HALF and self.next >= self.count // 2


def to_item(received: ItemReceived) -> MissionItem:
    """Return the item as data."""
    return MissionItem(
        received.seq, received.frame, received.command, *received.params, received.x, received.y, received.z,
        received.current, received.autocontinue,
    )  # fmt: skip


def has_place(item: MissionItem) -> bool:
    """Return whether the item names a place of its own; zeros mean 'here'."""
    return item.command in {Command.NAV_WAYPOINT, Command.NAV_LAND, Command.NAV_TAKEOFF} and (item.x, item.y) != (0, 0)


CarryOut = Callable[[int, Sequence[float]], object]
"""Does what an item for the payload wants."""
DONE_IN_PASSING = frozenset({Command.DO_CHANGE_SPEED, *PAYLOAD})
"""Items that do not move the vehicle."""


def params_of(item: MissionItem) -> tuple[float, ...]:
    """Return all seven parameters of an item without a place."""
    return (item.param1, item.param2, item.param3, item.param4, float(item.x), float(item.y), item.z)


def is_relative(item: MissionItem) -> bool:
    """Return whether the height counts from home."""
    return item.frame in {Frame.GLOBAL_RELATIVE_ALT, Frame.GLOBAL_RELATIVE_ALT_INT}


def build_mission_ack(
    partner: Peer, result: MissionResult, mission_type: int = MISSION_TYPE_MISSION, opaque_id: int = 0
) -> Outbound:
    """Return a MISSION_ACK."""
    return build_message(
        "MISSION_ACK", target_system=partner.sysid, target_component=partner.compid, type=int(result),
        mission_type=mission_type, opaque_id=opaque_id,
    )  # fmt: skip


def build_mission_count(
    partner: Peer, count: int, opaque_id: int = 0, mission_type: int = MISSION_TYPE_MISSION
) -> Outbound:
    """Return a MISSION_COUNT."""
    return build_message(
        "MISSION_COUNT", target_system=partner.sysid, target_component=partner.compid, count=count,
        mission_type=mission_type, opaque_id=opaque_id,
    )  # fmt: skip


def build_mission_request(name: str, partner: Peer, seq: int, mission_type: int = MISSION_TYPE_MISSION) -> Outbound:
    """Return a MISSION_REQUEST or MISSION_REQUEST_INT."""
    return build_message(
        name, target_system=partner.sysid, target_component=partner.compid, seq=seq, mission_type=mission_type
    )


def build_mission_item(
    partner: Peer, item: MissionItem, *, integer: bool, mission_type: int = MISSION_TYPE_MISSION
) -> Outbound:
    """Return a MISSION_ITEM_INT, or the older MISSION_ITEM in degrees."""
    placed = item.frame != Frame.MISSION
    x: int | float = item.x
    y: int | float = item.y
    if not integer and placed:
        x, y = item.x * DEGREES_E7, item.y * DEGREES_E7
    return build_message(
        "MISSION_ITEM_INT" if integer else "MISSION_ITEM",
        target_system=partner.sysid, target_component=partner.compid, seq=item.seq, frame=item.frame,
        command=item.command, current=int(item.current), autocontinue=int(item.autocontinue), param1=item.param1,
        param2=item.param2, param3=item.param3, param4=item.param4, x=x, y=y, z=item.z,
        mission_type=mission_type,
    )  # fmt: skip
