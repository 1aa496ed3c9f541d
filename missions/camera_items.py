"""From what cameras do along a leg to mission items.

Items that begin it stand before the leg's own, after the speed; items that end it right behind. All of them follow from
the one waypoint, so that a list which keeps a waypoint keeps them too. Only commands and parameters are used that both
autopilots store and give back as they were: ArduPilot keeps whole degrees, PX4 gives back no CONDITION_DELAY and no
region of interest (mavlink_mission.cpp). Delays are the hold of a waypoint; a region of interest is for PX4 the heading
of the waypoint and the pitch of the gimbal.
"""

from __future__ import annotations

from collections.abc import Iterator

from missions.autopilots.dialect import Dialect
from missions.cameras import FIRST_COMPONENT, Capture, Region, Trigger
from missions.items import Command, MissionItem
from missions.waypoints import Waypoint

AT_ONCE = 1.0
"""param3 of DO_SET_CAM_TRIGG_DIST: the first picture is taken where it begins."""
HORIZON, FROM_NORTH = 4 | 8, 16
"""GIMBAL_MANAGER_FLAGS: roll and pitch are from the horizon; yaw is from the nose, or from north."""
ONE, SHOOT = 1.0, 1
EVERY_STREAM = 0.0
"""param1 of VIDEO_START_CAPTURE: it names a stream; which camera it is, ArduPilot does not keep."""
ENDLESS = 0.0
"""param3 of IMAGE_START_CAPTURE: until it is stopped."""


def build_begin_items(point: Waypoint, dialect: Dialect) -> Iterator[MissionItem]:
    """Yield what begins with the leg to a waypoint, not numbered yet."""
    pointed: set[tuple[int, int, bool]] = set()
    for capture in point.captures:
        if capture.region is not None and dialect.keeps_region:
            yield _build_region_item(capture.region, dialect)
        elif capture.pitch_deg is not None and capture.yaw_deg is not None:
            pointing = (capture.pitch_deg, capture.yaw_deg, capture.from_north)
            if pointing not in pointed:
                pointed.add(pointing)
                yield _build_gimbal_item(*pointing, dialect)
        match capture.trigger:
            case Trigger.DISTANCE:
                # A gimbal turns with the vehicle, which faces the leg only once it has set out.
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
    """Yield what ends with the leg to a waypoint, not numbered yet."""
    for capture in point.captures:
        if capture.trigger is not Trigger.ONCE:
            yield _build_command_item(dialect, *_end_of(capture))
        elif capture.camera_id >= FIRST_COMPONENT:
            yield _build_command_item(dialect, Command.IMAGE_START_CAPTURE, capture.camera_id, 0.0, ONE)
        else:  # PX4 triggers what is wired to it by this command alone
            yield MissionItem(0, dialect.command_frame, Command.DO_DIGICAM_CONTROL, x=SHOOT)
        if capture.region is not None and dialect.keeps_region:
            yield _build_command_item(dialect, Command.DO_SET_ROI_NONE)


def heading_deg(point: Waypoint, dialect: Dialect) -> float:
    """Return the heading that the item of a waypoint asks for: to a region of interest, where no other item does."""
    for capture in point.captures:
        if capture.region is not None and capture.yaw_deg is not None and not dialect.keeps_region:
            return float(capture.yaw_deg % 360)
    return dialect.no_yaw


def _end_of(capture: Capture) -> tuple[Command, float]:
    match capture.trigger:
        case Trigger.DISTANCE:
            return Command.DO_SET_CAM_TRIGG_DIST, 0.0
        case Trigger.INTERVAL:
            return Command.IMAGE_STOP_CAPTURE, capture.camera_id
        case _:
            return Command.VIDEO_STOP_CAPTURE, EVERY_STREAM


def _build_gimbal_item(pitch_deg: int, yaw_deg: int, from_north: bool, dialect: Dialect) -> MissionItem:
    return MissionItem(
        0, dialect.command_frame, Command.DO_GIMBAL_MANAGER_PITCHYAW, float(pitch_deg), float(yaw_deg),
        dialect.gimbal_rate, dialect.gimbal_rate, x=HORIZON | (FROM_NORTH if from_north else 0),
    )  # fmt: skip


def _build_region_item(region: Region, dialect: Dialect) -> MissionItem:
    return MissionItem(
        0, dialect.position_frame, Command.DO_SET_ROI_LOCATION, x=round(region.lat_deg * 1e7),
        y=round(region.lon_deg * 1e7), z=round(region.alt_rel_m, 2),
    )  # fmt: skip


def _build_command_item(dialect: Dialect, command: Command, *params: float) -> MissionItem:
    one, two, three = (*map(float, params), *(0.0 for _ in range(3 - len(params))))
    return MissionItem(0, dialect.command_frame, command, one, two, three)
