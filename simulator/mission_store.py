"""Missions of both autopilots: their side of the protocol, item positions, fences."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from enum import Enum

from missions.items import PAYLOAD, Command, Frame, MissionItem, MissionKind
from missions.items import PlaceCommand as Item
from simulator import messages
from simulator.physics import Home, Place

DEGREES_E7 = 1e-7


class UploadFault(Enum):
    """Effect of an injected fault on uploads."""

    NONE = "none"
    REFUSE = "refuse"
    HALF = "half"


@dataclass(frozen=True, slots=True)
class StoreStep:
    """The store's answers, and the changes on board."""

    send: tuple[messages.Outbound, ...] = ()
    texts: tuple[tuple[int, str], ...] = ()
    """(severity, text)."""
    stored: bool = False
    """ArduPilot: an item was just replaced in place."""
    cleared: bool = False
    """The mission was cleared by a command."""
    truncated: bool = False
    """ArduPilot: an announced upload removed the items beyond its length."""
    swapped: bool = False
    """PX4: the whole list was just replaced."""
    current: int | None = None
    """PX4: item that the new list flags as current."""
    fenced: bool = False
    """The fence was just replaced."""


@dataclass(slots=True)
class Transfer:
    """An upload or a download under way."""

    partner: messages.Peer
    count: int
    heard_s: float
    """Time of the partner's last step in the transfer."""
    asked_s: float
    """Time of the vehicle's last request."""
    next: int = 0
    items: list[MissionItem] = field(default_factory=list)
    """PX4's second buffer, and both autopilots' for fences and rally points."""
    kind: int = MissionKind.MISSION
    rest: tuple[MissionItem, ...] = ()
    """Items after the transferred ones that stay, in a partial upload."""

    def is_stalled(self, fault: UploadFault) -> bool:
        """Return whether an injected fault stops the vehicle's requests."""
        return fault is UploadFault.HALF and self.next >= self.count // 2


class Uploading:
    """Upload state that both autopilots' stores report."""

    _upload: Transfer | None = None

    @property
    def upload(self) -> Transfer | None:
        """Upload whose items it is requesting."""
        return self._upload

    @property
    def is_receiving(self) -> bool:
        """Whether it is requesting items."""
        return self.upload is not None

    @property
    def upload_link(self) -> int:
        """Link on which it requests items: the one that announced them."""
        return 0 if self.upload is None else self.upload.partner.link


def has_place(item: MissionItem) -> bool:
    """Return whether the item has coordinates; zeros mean the present position."""
    return item.command in {Command.NAV_WAYPOINT, Command.NAV_LAND, Command.NAV_TAKEOFF} and (item.x, item.y) != (0, 0)


CarryOut = Callable[[int, Sequence[float]], object]
"""Execute an item for the payload."""
DONE_IN_PASSING = frozenset({Command.DO_CHANGE_SPEED, *PAYLOAD})
"""Items that do not move the vehicle."""


def params_of(item: MissionItem) -> tuple[float, ...]:
    """Return all seven parameters of an item without a place."""
    return (item.param1, item.param2, item.param3, item.param4, float(item.x), float(item.y), item.z)


def is_relative(item: MissionItem) -> bool:
    """Return whether the height is relative to home."""
    return item.frame in {Frame.GLOBAL_RELATIVE_ALT, Frame.GLOBAL_RELATIVE_ALT_INT}


def acknowledge(
    partner: messages.Peer,
    result: messages.MissionResult,
    kind: int = MissionKind.MISSION,
    texts: tuple[tuple[int, str], ...] = (),
    *,
    opaque_id: int = 0,
) -> StoreStep:
    """Return a step that answers with MISSION_ACK, and sends texts to all."""
    ack = messages.build_message(
        "MISSION_ACK", target_system=partner.sysid, target_component=partner.compid, type=int(result),
        mission_type=kind, opaque_id=opaque_id,
    )  # fmt: skip
    return StoreStep((ack,), texts)


def build_mission_count(
    partner: messages.Peer, count: int, opaque_id: int = 0, mission_type: int = MissionKind.MISSION
) -> messages.Outbound:
    """Return a MISSION_COUNT."""
    return messages.build_message(
        "MISSION_COUNT", target_system=partner.sysid, target_component=partner.compid, count=count,
        mission_type=mission_type, opaque_id=opaque_id,
    )  # fmt: skip


def build_mission_request(
    name: str, partner: messages.Peer, seq: int, mission_type: int = MissionKind.MISSION
) -> messages.Outbound:
    """Return a MISSION_REQUEST or MISSION_REQUEST_INT."""
    return messages.build_message(
        name, target_system=partner.sysid, target_component=partner.compid, seq=seq, mission_type=mission_type
    )


def build_mission_item(
    partner: messages.Peer, item: MissionItem, *, integer: bool, mission_type: int = MissionKind.MISSION
) -> messages.Outbound:
    """Return a MISSION_ITEM_INT, or the older MISSION_ITEM in degrees."""
    placed = item.frame != Frame.MISSION
    x: int | float = item.x
    y: int | float = item.y
    if not integer and placed:
        x, y = item.x * DEGREES_E7, item.y * DEGREES_E7
    return messages.build_message(
        "MISSION_ITEM_INT" if integer else "MISSION_ITEM",
        target_system=partner.sysid, target_component=partner.compid, seq=item.seq, frame=item.frame,
        command=item.command, current=int(item.current), autocontinue=int(item.autocontinue), param1=item.param1,
        param2=item.param2, param3=item.param3, param4=item.param4, x=x, y=y, z=item.z,
        mission_type=mission_type,
    )  # fmt: skip


def place_of(item: MissionItem, home: Home, here: Place) -> Place:
    """Return an item's position; without coordinates it is the vehicle's, at the item's height."""
    up_m = item.z if is_relative(item) else item.z - home.alt_m
    return home.place_of(item.x, item.y, up_m) if has_place(item) else Place(here.east_m, here.north_m, up_m)


def mission_length_m(items: Iterable[MissionItem], home: Home) -> float:
    """Return the length of the whole flight that a list describes, from the pad to its end."""
    here = Place(0.0, 0.0, 0.0)
    length = 0.0
    for item in items:
        stops: list[Place] = []
        if item.command in {Command.NAV_TAKEOFF, Command.NAV_WAYPOINT}:
            stops = [place_of(item, home, here)]
        elif item.command == Command.NAV_RETURN_TO_LAUNCH:
            stops = [Place(0.0, 0.0, here.up_m), Place(0.0, 0.0, 0.0)]
        elif item.command == Command.NAV_LAND:
            over = place_of(item, home, here)
            stops = [Place(over.east_m, over.north_m, here.up_m), Place(over.east_m, over.north_m, 0.0)]
        for stop in stops:
            length += math.dist(here, stop)
            here = stop
    return length


Corner = tuple[float, float]


@dataclass(frozen=True, slots=True)
class FenceShape:
    """A polygon, or a circle about its only corner."""

    keeps_out: bool
    corners: tuple[Corner, ...]
    radius_m: float | None

    def is_allowed(self, east_m: float, north_m: float) -> bool:
        """Return whether a vehicle may be at a position."""
        if self.radius_m is not None:
            return (math.dist(self.corners[0], (east_m, north_m)) <= self.radius_m) is not self.keeps_out
        return _is_within(self.corners, east_m, north_m) is not self.keeps_out


def build_fence_shapes(items: Sequence[MissionItem], home: Home) -> tuple[FenceShape, ...]:
    """Return the shapes of a fence on board."""
    shapes, index = list[FenceShape](), 0
    while index < len(items):
        item, size = items[index], 1
        keeps_out = item.command in {Item.EXCLUSION_VERTEX, Item.EXCLUSION_CIRCLE}
        if item.command in {Item.INCLUSION_VERTEX, Item.EXCLUSION_VERTEX}:
            size = max(1, int(item.param1))
            ring = items[index : index + size]
            shapes.append(FenceShape(keeps_out, tuple(home.east_north_m(one.x, one.y) for one in ring), None))
        elif item.command in {Item.INCLUSION_CIRCLE, Item.EXCLUSION_CIRCLE}:
            shapes.append(FenceShape(keeps_out, (home.east_north_m(item.x, item.y),), item.param1))
        index += size
    return tuple(shapes)


def is_inside(shapes: Sequence[FenceShape], place: Place) -> bool:
    """Return whether a place is inside a fence."""
    return all(shape.is_allowed(place.east_m, place.north_m) for shape in shapes)


def distance_outside_m(shapes: Sequence[FenceShape], place: Place) -> float:
    """Return how far a place is outside the breached polygon, the farthest of several; 0 inside."""
    here = (place.east_m, place.north_m)
    left = [one for one in shapes if one.radius_m is None and not one.keeps_out and not one.is_allowed(*here)]
    return max((min(_edge_distance_m(here, a, b) for a, b in _iterate_edges(one.corners)) for one in left), default=0.0)


def _iterate_edges(corners: tuple[Corner, ...]) -> Iterator[tuple[Corner, Corner]]:
    yield from zip(corners, (*corners[1:], corners[0]), strict=True)


def _edge_distance_m(here: Corner, one: Corner, other: Corner) -> float:
    along = (other[0] - one[0], other[1] - one[1])
    length = along[0] ** 2 + along[1] ** 2
    share = ((here[0] - one[0]) * along[0] + (here[1] - one[1]) * along[1]) / length if length else 0.0
    share = min(1.0, max(0.0, share))
    return math.dist(here, (one[0] + share * along[0], one[1] + share * along[1]))


def _is_within(corners: Sequence[Corner], east_m: float, north_m: float) -> bool:
    inside = False
    for (east_a, north_a), (east_b, north_b) in _iterate_edges(tuple(corners)):
        if (north_a > north_m) is not (north_b > north_m):
            inside ^= east_m < east_a + (north_m - north_a) / (north_b - north_a) * (east_b - east_a)
    return inside


def find_return_destination(
    rally: Sequence[MissionItem], home: Home, here: Place, farthest_m: float = math.inf
) -> Place:
    """Return the end of an RTL: over the nearest of home and the rally points within range."""
    spots = [Place(*home.east_north_m(item.x, item.y), 0.0) for item in rally]
    near = [one for one in spots if math.hypot(one.east_m - here.east_m, one.north_m - here.north_m) <= farthest_m]
    at_home = Place(0.0, 0.0, 0.0)
    return min((at_home, *near), key=lambda one: math.hypot(one.east_m - here.east_m, one.north_m - here.north_m))
