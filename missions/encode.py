"""Encode the waypoints of a flight, and the camera actions on its legs, as mission items in the autopilot's dialect.

Camera items that start with a leg precede the leg's own item, after the speed; items that end it follow right after.
All of them are derived from the one waypoint, so a list that keeps a waypoint keeps them too. Only commands and
parameters are used that both autopilots store and return unchanged: ArduPilot keeps whole degrees, PX4 returns no
CONDITION_DELAY and no region of interest (mavlink_mission.cpp). Delays are encoded as the waypoint's hold; for PX4 a
region of interest is the heading of the waypoint and the pitch of the gimbal.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace

from missions.autopilots.dialect import Dialect
from missions.cameras import FIRST_COMPONENT, Trigger
from missions.errors import EncodeError
from missions.items import Command, Frame, MissionItem
from missions.waypoints import FlightPath, Phase, Waypoint

GROUND_SPEED = 1.0
"""param1 of DO_CHANGE_SPEED."""
THROTTLE_UNCHANGED = -1.0
"""param3 of DO_CHANGE_SPEED."""
AT_ONCE = 1.0
"""param3 of DO_SET_CAM_TRIGG_DIST: take the first picture at once."""
HORIZON, FROM_NORTH = 4 | 8, 16
"""GIMBAL_MANAGER_FLAGS: roll and pitch from the horizon; yaw from the nose, or from north."""
ONE, SHOOT = 1.0, 1
EVERY_STREAM = 0.0
"""param1 of VIDEO_START_CAPTURE: all streams; ArduPilot does not store the camera id."""
ENDLESS = 0.0
"""param3 of IMAGE_START_CAPTURE: until stopped."""


@dataclass(frozen=True, slots=True)
class EncodedMission:
    """One vehicle's items, and the waypoint of each."""

    vehicle: str
    items: tuple[MissionItem, ...]
    waypoint_of: tuple[int | None, ...]
    """Waypoint index by seq; a speed item has that of its leg; None for home."""


def encode(path: FlightPath, dialect: Dialect) -> EncodedMission:
    """Return the items of a flight.

    Items of the first waypoints do not depend on later ones. A speed item is added only where the speed changes.
    Latitude and longitude are rounded to 1e-7 degrees, heights to centimetres.

    Raises:
        EncodeError: there is nothing to fly, the path does not start with a take-off, a figure is NaN or infinite, or
            the autopilot cannot hold that many items.
    """
    if not path.waypoints:
        raise EncodeError(f"{path.vehicle}: expected a path with waypoints; a vehicle on the ground has no mission")
    if path.waypoints[0].phase is not Phase.TAKEOFF:
        raise EncodeError(f"{path.vehicle}: waypoints[0]: expected a take-off, got {path.waypoints[0].phase.value}")
    items: list[MissionItem] = []
    waypoint_of: list[int | None] = []

    def add(item: MissionItem, serves: int | None) -> None:
        items.append(replace(item, seq=len(items)))
        waypoint_of.append(serves)

    if dialect.home_item:
        pad = path.waypoints[0]
        add(MissionItem(0, Frame.GLOBAL, Command.NAV_WAYPOINT, x=_to_e7(pad.lat_deg), y=_to_e7(pad.lon_deg)), None)
    speed_m_s: float | None = None
    for index, point in enumerate(path.waypoints):
        _check(path.vehicle, index, point)
        if point.phase not in (Phase.TAKEOFF, Phase.LAND) and point.speed_m_s != speed_m_s:
            speed_m_s = point.speed_m_s
            change = (GROUND_SPEED, speed_m_s, THROTTLE_UNCHANGED)
            add(_build_command_item(dialect, Command.DO_CHANGE_SPEED, *change), index)
        for item in (*build_begin_items(point, dialect), _build_place_item(point, dialect)):
            add(item, index)
        for item in build_end_items(point, dialect):
            # It is executed when the leg is complete: the vehicle then flies to the next waypoint.
            add(item, min(index + 1, len(path.waypoints) - 1))
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


def _build_place_item(point: Waypoint, dialect: Dialect) -> MissionItem:
    command, param1, param2 = Command.NAV_WAYPOINT, 0.0, dialect.pass_radius_m
    if point.phase is Phase.TAKEOFF:
        command, param2 = Command.NAV_TAKEOFF, 0.0
    elif point.phase is Phase.LAND:
        command, param2 = Command.NAV_LAND, 0.0
    elif point.hold:
        # Whole seconds: ArduPilot stores no fractions.
        param1, param2 = max(dialect.performance.hold_s, float(math.ceil(point.hover_s))), dialect.stop_radius_m
    has_position = command is not Command.NAV_TAKEOFF or dialect.takeoff_with_position
    return MissionItem(
        seq=0,
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


def build_begin_items(point: Waypoint, dialect: Dialect) -> Iterator[MissionItem]:
    """Yield the items that start with the leg to a waypoint, not numbered yet."""
    pointed: set[tuple[int, int, bool]] = set()
    for capture in point.captures:
        region = capture.region
        if region is not None and dialect.keeps_region:
            x, y, z = _to_e7(region.lat_deg), _to_e7(region.lon_deg), round(region.alt_rel_m, 2)
            yield MissionItem(0, dialect.position_frame, Command.DO_SET_ROI_LOCATION, x=x, y=y, z=z)
        elif capture.pitch_deg is not None and capture.yaw_deg is not None:
            pointing = (capture.pitch_deg, capture.yaw_deg, capture.from_north)
            if pointing not in pointed:
                pointed.add(pointing)
                yield _build_gimbal_item(*pointing, dialect)
        match capture.trigger:
            case Trigger.DISTANCE:
                # A gimbal turns with the vehicle, which faces along the leg only after departure.
                first = AT_ONCE if capture.pitch_deg is None else 0.0
                yield _build_command_item(dialect, Command.DO_SET_CAM_TRIGG_DIST, capture.every_m, 0.0, first)
            case Trigger.INTERVAL:
                every_s = capture.every_m / point.speed_m_s
                yield _build_command_item(dialect, Command.IMAGE_START_CAPTURE, capture.camera_id, every_s, ENDLESS)
            case Trigger.VIDEO:
                yield _build_command_item(dialect, Command.VIDEO_START_CAPTURE, EVERY_STREAM)
            case Trigger.ONCE:
                pass


def build_end_items(point: Waypoint, dialect: Dialect) -> Iterator[MissionItem]:
    """Yield the items that end with the leg to a waypoint, not numbered yet."""
    for capture in point.captures:
        match capture.trigger:
            case Trigger.DISTANCE:
                yield _build_command_item(dialect, Command.DO_SET_CAM_TRIGG_DIST)
            case Trigger.INTERVAL:
                yield _build_command_item(dialect, Command.IMAGE_STOP_CAPTURE, capture.camera_id)
            case Trigger.VIDEO:
                yield _build_command_item(dialect, Command.VIDEO_STOP_CAPTURE, EVERY_STREAM)
            case Trigger.ONCE if capture.camera_id >= FIRST_COMPONENT:
                yield _build_command_item(dialect, Command.IMAGE_START_CAPTURE, capture.camera_id, 0.0, ONE)
            case Trigger.ONCE:  # PX4 triggers hard-wired cameras by this command only
                yield MissionItem(0, dialect.command_frame, Command.DO_DIGICAM_CONTROL, x=SHOOT)
        if capture.region is not None and dialect.keeps_region:
            yield _build_command_item(dialect, Command.DO_SET_ROI_NONE)


def heading_deg(point: Waypoint, dialect: Dialect) -> float:
    """Return the heading of a waypoint's item: to a region of interest, where no other item sets it."""
    for capture in point.captures:
        if capture.region is not None and capture.yaw_deg is not None and not dialect.keeps_region:
            return float(capture.yaw_deg % 360)
    return dialect.no_yaw


def _build_gimbal_item(pitch_deg: int, yaw_deg: int, from_north: bool, dialect: Dialect) -> MissionItem:
    return MissionItem(
        0, dialect.command_frame, Command.DO_GIMBAL_MANAGER_PITCHYAW, float(pitch_deg), float(yaw_deg),
        dialect.gimbal_rate, dialect.gimbal_rate, x=HORIZON | (FROM_NORTH if from_north else 0),
    )  # fmt: skip


def _build_command_item(dialect: Dialect, command: Command, *params: float) -> MissionItem:
    one, two, three = (*map(float, params), *(0.0 for _ in range(3 - len(params))))
    return MissionItem(0, dialect.command_frame, command, one, two, three)
