"""MAVLink's messages about a vehicle, field by field, to ours: the one table for the link and for telemetry logs.

A reader takes anything with the message's fields by their MAVLink names: a frame of pymavlink, or the fields that
`tlog_kinds` unpacks. Whatever a vehicle marks as unknown becomes None.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from operator import attrgetter
from types import MappingProxyType
from typing import Any

from executor.adapters.mavlink.frame_layout import V2, payload_of
from executor.core.interface.messages import (
    Attitude,
    Battery,
    EstimatorStatus,
    FenceStatus,
    Gps,
    Heartbeat,
    HeightTarget,
    Home,
    LandedState,
    MissionCurrent,
    MissionReached,
    Position,
    Radio,
    RcChannels,
    SystemStatus,
    Wind,
)
from executor.core.interface.recorded_log import MODE_COMMANDS
from missions import PX4, MissionItem

Frame = Any
"""A message's fields by their MAVLink names; pymavlink's classes are generated and untyped."""
GCS_TYPE, NO_AUTOPILOT, ARMED = 6, 8, 128
"""MAV_TYPE, MAV_AUTOPILOT and MAV_MODE_FLAG of a HEARTBEAT."""
PREARM_CHECK = 0x10000000
POS_HORIZ_ABS, CONST_POS_MODE = 16, 128
"""Of EKF_STATUS_FLAGS and ESTIMATOR_STATUS_FLAGS."""
NO_SATELLITES = 255
"""Of satellites_visible: nobody knows."""
NO_CHANNEL = 65535
"""Of RC_CHANNELS and RC_CHANNELS_RAW."""
_CHANNELS, _RAW_CHANNELS = (attrgetter(*(f"chan{number}_raw" for number in range(1, most + 1))) for most in (18, 8))
DO_SET_MODE, SET_MODE = 176, 11
"""The command, and the number of the older message."""
MOST_MODES = 128
ACCEPTED = frozenset({0, 5})
"""MAV_RESULT: accepted, in progress."""


def read_heartbeat(frame: Frame) -> Heartbeat | None:
    """Read an autopilot's HEARTBEAT; None of a ground station, a camera or a gimbal."""
    if frame.type == GCS_TYPE or frame.autopilot == NO_AUTOPILOT:
        return None
    armed = bool(frame.base_mode & ARMED)
    return Heartbeat(frame.autopilot, frame.custom_mode, armed, frame.system_status, frame.type)


def read_channels(frame: Frame) -> RcChannels:
    """Read RC_CHANNELS, or RC_CHANNELS_RAW, which has the first eight and is not listened to on a link."""
    values = _CHANNELS(frame)[: frame.chancount] if hasattr(frame, "chancount") else _RAW_CHANNELS(frame)
    return RcChannels(tuple(0 if value == NO_CHANNEL else value for value in values))


def _to_percent(value: float) -> float | None:
    return value if 0 <= value <= 100 else None


def _read_position(frame: Frame) -> Position:
    return Position(
        boot_s=frame.time_boot_ms / 1e3,
        lat_deg=frame.lat / 1e7,
        lon_deg=frame.lon / 1e7,
        alt_msl_m=frame.alt / 1e3,
        alt_rel_m=frame.relative_alt / 1e3,
        north_m_s=frame.vx / 100,
        east_m_s=frame.vy / 100,
        down_m_s=frame.vz / 100,
        heading_deg=None if frame.hdg == 65535 else frame.hdg / 100,
    )


def _read_battery(frame: Frame) -> Battery:
    cells = [cell for cell in frame.voltages if cell != 65535]
    cells += [cell for cell in getattr(frame, "voltages_ext", ()) if cell not in {0, 65535}]
    return Battery(
        battery=frame.id,
        remaining_pct=_to_percent(frame.battery_remaining),
        voltage_v=sum(cells) / 1e3 if cells else None,
        current_a=None if frame.current_battery < 0 else frame.current_battery / 100,
        consumed_ah=None if frame.current_consumed < 0 else frame.current_consumed / 1e3,
        charge_state=getattr(frame, "charge_state", 0),
        faults=getattr(frame, "fault_bitmask", 0),
        cells_v=tuple(cell / 1e3 for cell in cells) if len(cells) > 1 else (),
    )


def _read_attitude(frame: Frame) -> Attitude:
    return Attitude(math.degrees(frame.roll), math.degrees(frame.pitch))


def _read_gps(frame: Frame, receiver: int = 0) -> Gps:
    satellites, off_mm = frame.satellites_visible, getattr(frame, "h_acc", 0)
    return Gps(
        frame.fix_type,
        None if satellites == NO_SATELLITES else satellites,
        accuracy_m=off_mm / 1e3 or None,
        measured_s=frame.time_usec / 1e6 or None,
        receiver=receiver,
    )


def _read_estimator(frame: Frame) -> EstimatorStatus:
    """Read flags that both autopilots number alike, as far as these two go."""
    return EstimatorStatus(frame.flags & (POS_HORIZ_ABS | CONST_POS_MODE) == POS_HORIZ_ABS)


def _read_wind(frame: Frame) -> Wind:
    return Wind(frame.speed, frame.direction % 360)


def _read_wind_cov(frame: Frame) -> Wind:
    """Read where the air moves to, north and east, as where it comes from."""
    north_m_s, east_m_s = frame.wind_x, frame.wind_y
    from_deg = math.degrees(math.atan2(-east_m_s, -north_m_s)) % 360
    return Wind(math.hypot(north_m_s, east_m_s), from_deg)


def _read_fence_status(frame: Frame) -> FenceStatus | None:
    return FenceStatus(bool(frame.breach_status)) if frame.breach_status in {0, 1} else None


def _read_mission_current(frame: Frame) -> MissionCurrent:
    number = frame.mission_id if hasattr(frame, "mission_id") else _read_mission_id(frame.get_msgbuf())
    return MissionCurrent(frame.seq, getattr(frame, "total", 0) or None, number or None)


def _read_mission_id(frame: bytes | None) -> int | None:
    """Read the uint32 behind what pymavlink knows of MISSION_CURRENT; MAVLink 2 leaves zeros at the end out."""
    if not frame or frame[0] != V2:
        return None
    return int.from_bytes(payload_of(frame, 10)[6:], "little") or None


def _read_system_status(frame: Frame) -> SystemStatus:
    enabled, healthy = frame.onboard_control_sensors_enabled, frame.onboard_control_sensors_health
    present = bool(frame.onboard_control_sensors_present & PREARM_CHECK)
    return SystemStatus(
        # PX4 reports 65535 V and -1 % without a battery, ArduPilot 0 V and -1 % in its first seconds.
        remaining_pct=_to_percent(frame.battery_remaining),
        voltage_v=None if frame.voltage_battery in {0, 65535} else frame.voltage_battery / 1e3,
        unhealthy=enabled & ~healthy,
        prearm_ok=bool(healthy & PREARM_CHECK) if present else None,
        current_a=None if frame.current_battery == -1 else max(0.0, frame.current_battery / 100),
    )


def _read_radio(frame: Frame) -> Radio:
    values = (frame.rssi, frame.remrssi, frame.noise, frame.remnoise)
    rssi, remote, noise, remote_noise = (None if value == 255 else value for value in values)
    return Radio(rssi, remote, noise, remote_noise, frame.txbuf if frame.txbuf <= 100 else None)


def read_mode_order(frame: Frame, autopilot: int | None) -> tuple[int, int | None] | None:
    """Read COMMAND_LONG, COMMAND_INT or SET_MODE: the command, and the mode if it names one; None of other commands.

    Args:
        frame: What was sent.
        autopilot: MAV_AUTOPILOT of whom it is for.
    """
    if not hasattr(frame, "command"):
        return DO_SET_MODE, frame.custom_mode
    main, sub = frame.param2, frame.param3
    if frame.command != DO_SET_MODE or not all(0 <= one < MOST_MODES for one in (main, sub)):
        return (frame.command, None) if frame.command in MODE_COMMANDS else None
    return DO_SET_MODE, int(main) << 16 | int(sub) << 24 if autopilot == PX4.number else int(main)


def read_accepted_order(ack: Frame) -> int | None:
    """Read COMMAND_ACK: the command that is followed, if that changes a mode. ArduPilot 3 names the older message."""
    command: int = DO_SET_MODE if ack.command == SET_MODE else ack.command
    return command if command in MODE_COMMANDS and ack.result in ACCEPTED else None


def read_mission_item(frame: Frame) -> MissionItem:
    """Read MISSION_ITEM_INT, or MISSION_ITEM, whose places are degrees."""
    x, y = (round(at * 1e7) if isinstance(at, float) else at for at in (frame.x, frame.y))
    return MissionItem(
        frame.seq, frame.frame, frame.command, frame.param1, frame.param2, frame.param3, frame.param4,
        x, y, frame.z, bool(frame.current), bool(frame.autocontinue),
    )  # fmt: skip


READERS: Mapping[str, Any] = MappingProxyType({
    "RADIO_STATUS": _read_radio,
    "HEARTBEAT": read_heartbeat,
    "GLOBAL_POSITION_INT": _read_position,
    "BATTERY_STATUS": _read_battery,
    "SYS_STATUS": _read_system_status,
    "EXTENDED_SYS_STATE": lambda frame: LandedState({1: True, 2: False, 3: False, 4: False}.get(frame.landed_state)),
    "ATTITUDE": _read_attitude,
    "NAV_CONTROLLER_OUTPUT": lambda frame: HeightTarget(frame.alt_error),
    "GPS_RAW_INT": _read_gps,
    "GPS2_RAW": lambda frame: _read_gps(frame, 1),
    "EKF_STATUS_REPORT": _read_estimator,
    "ESTIMATOR_STATUS": _read_estimator,
    "WIND_COV": _read_wind_cov,
    "WIND": _read_wind,
    "FENCE_STATUS": _read_fence_status,
    "HOME_POSITION": lambda frame: Home(frame.latitude / 1e7, frame.longitude / 1e7, frame.altitude / 1e3),
    "MISSION_CURRENT": _read_mission_current,
    "MISSION_ITEM_REACHED": lambda frame: MissionReached(frame.seq),
    "RC_CHANNELS": read_channels,
})  # fmt: skip
"""By MAVLink's name of the message."""
