"""From the places of a flight to mission items, in the autopilot's dialect."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

from missions.autopilots.dialect import Dialect
from missions.camera_items import build_begin_items, build_end_items, heading_deg
from missions.errors import EncodeError
from missions.items import Command, Frame, MissionItem
from missions.waypoints import FlightPath, Phase, Waypoint

GROUND_SPEED = 1.0
"""param1 of DO_CHANGE_SPEED."""
THROTTLE_UNCHANGED = -1.0
"""param3 of DO_CHANGE_SPEED."""


@dataclass(frozen=True, slots=True)
class EncodedMission:
    """One vehicle's items, and which place each of them serves."""

    vehicle: str
    items: tuple[MissionItem, ...]
    waypoint_of: tuple[int | None, ...]
    """By seq: index into the path's waypoints; a speed item serves the leg that it is for; None for home."""


def encode(path: FlightPath, dialect: Dialect) -> EncodedMission:
    """Return the items of a flight.

    Items of the first waypoints do not depend on those that follow. A speed item stands only where the speed changes.
    Latitude and longitude are rounded to 1e-7 degrees, heights to centimetres.

    Raises:
        EncodeError: there is nothing to fly, the path does not start with a take-off, a figure is not a number, or
            the autopilot cannot hold that many items.
    """
    if not path.waypoints:
        raise EncodeError(f"{path.vehicle}: expected a path with waypoints; a vehicle on the ground has no mission")
    if path.waypoints[0].phase is not Phase.TAKEOFF:
        raise EncodeError(f"{path.vehicle}: waypoints[0]: expected a take-off, got {path.waypoints[0].phase.value}")
    items: list[MissionItem] = []
    waypoint_of: list[int | None] = []
    if dialect.home_item:
        items.append(_build_home_item(path.waypoints[0]))
        waypoint_of.append(None)
    speed_m_s: float | None = None
    for index, point in enumerate(path.waypoints):
        _check(path.vehicle, index, point)
        if point.phase not in (Phase.TAKEOFF, Phase.LAND) and point.speed_m_s != speed_m_s:
            speed_m_s = point.speed_m_s
            items.append(_build_speed_item(len(items), speed_m_s, dialect))
            waypoint_of.append(index)
        for item in build_begin_items(point, dialect):
            items.append(replace(item, seq=len(items)))
            waypoint_of.append(index)
        items.append(_build_place_item(len(items), point, dialect))
        waypoint_of.append(index)
        for item in build_end_items(point, dialect):
            # It comes when the leg is over: who is there flies to the next waypoint.
            items.append(replace(item, seq=len(items)))
            waypoint_of.append(min(index + 1, len(path.waypoints) - 1))
    if len(items) > dialect.max_items:
        raise EncodeError(
            f"{path.vehicle}: expected at most {dialect.max_items} items for {dialect.name}, got {len(items)}"
        )
    return flag_current(EncodedMission(path.vehicle, tuple(items), tuple(waypoint_of)), dialect.flag_first)


def flag_current(mission: EncodedMission, seq: int | None) -> EncodedMission:
    """Return the mission with ``current`` set on one item only, or on none.

    Raises:
        EncodeError: the mission has no such item.
    """
    if seq is not None and not 0 <= seq < len(mission.items):
        raise EncodeError(f"{mission.vehicle}: current item {seq}: expected 0 to {len(mission.items) - 1}")
    items = tuple(replace(item, current=item.seq == seq) for item in mission.items)
    return replace(mission, items=items)


def _build_home_item(takeoff: Waypoint) -> MissionItem:
    return MissionItem(
        seq=0, frame=Frame.GLOBAL, command=Command.NAV_WAYPOINT, x=_to_e7(takeoff.lat_deg), y=_to_e7(takeoff.lon_deg)
    )


def _build_speed_item(seq: int, speed_m_s: float, dialect: Dialect) -> MissionItem:
    return MissionItem(
        seq=seq,
        frame=dialect.command_frame,
        command=Command.DO_CHANGE_SPEED,
        param1=GROUND_SPEED,
        param2=speed_m_s,
        param3=THROTTLE_UNCHANGED,
    )


def _build_place_item(seq: int, point: Waypoint, dialect: Dialect) -> MissionItem:
    command, param1, param2 = Command.NAV_WAYPOINT, 0.0, dialect.pass_radius_m
    if point.phase is Phase.TAKEOFF:
        command, param2 = Command.NAV_TAKEOFF, 0.0
    elif point.phase is Phase.LAND:
        command, param2 = Command.NAV_LAND, 0.0
    elif point.hold:
        # Whole seconds: ArduPilot keeps no others.
        param1, param2 = max(dialect.performance.hold_s, float(math.ceil(point.hover_s))), dialect.stop_radius_m
    has_position = command is not Command.NAV_TAKEOFF or dialect.takeoff_with_position
    return MissionItem(
        seq=seq,
        frame=dialect.position_frame,
        command=command,
        param1=param1,
        param2=param2,
        param4=heading_deg(point, dialect),
        x=_to_e7(point.lat_deg) if has_position else 0,
        y=_to_e7(point.lon_deg) if has_position else 0,
        z=round(point.alt_rel_m, 2),
    )


def _to_e7(angle_deg: float) -> int:
    return round(angle_deg * 1e7)


def _check(vehicle: str, index: int, point: Waypoint) -> None:
    for key in ("lat_deg", "lon_deg", "alt_rel_m", "speed_m_s"):
        value = getattr(point, key)
        if not math.isfinite(value):
            raise EncodeError(f"{vehicle}: waypoints[{index}].{key}: expected a finite number, got {value}")
    if point.speed_m_s <= 0:
        raise EncodeError(f"{vehicle}: waypoints[{index}].speed_m_s: expected more than 0, got {point.speed_m_s}")
