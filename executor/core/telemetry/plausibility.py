"""What no vehicle can say: the one place for the ranges of what is heard, live and in logs.

A field that is outside of its range is unknown; where a message says nothing without it, the message is. Autopilots
mark the unknown in many ways (INT32_MIN, 65535, -1, NaN), firmware has mistakes, and anybody may send anything.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from typing import Any, TypeVar

from executor.core.interface.messages import (
    NO_ITEM,
    Attitude,
    Battery,
    CameraStatus,
    GimbalAttitude,
    Gps,
    HeightTarget,
    Home,
    Message,
    MissionCurrent,
    MissionReached,
    ParamValue,
    PictureTaken,
    Position,
    SystemStatus,
    Wind,
)

LOWEST_M, HIGHEST_M = -1000.0, 20_000.0
FASTEST_M_S = 150.0
LEAST_V, MOST_V = 1.0, 500.0
LEAST_CELL_V, MOST_CELL_V = 0.5, 5.0
"""Where cells are not told apart, the first place of their list holds the whole pack, or as much as fits."""
MOST_A, MOST_AH = 1000.0, 1000.0
MOST_TURN_DEG = 360.0
MOST_FIX = 8
"""GPS_FIX_TYPE_PPP is the last."""
MOST_OFF_M = 1000.0
"""A receiver that says more has no place."""
MOST_WIND_M_S = 150.0
"""More than was ever measured on the ground is no wind but a filter that has not settled."""

M = TypeVar("M", bound=Message)


def filter_implausible(message: M) -> M | None:
    """Return a message with what cannot be made unknown, the same object if it all can be; None if nothing is left."""
    judge = _JUDGES.get(type(message))
    return message if judge is None else judge(message)


def _is_within(value: float | None, least: float, most: float) -> bool:
    """Return whether a value lies in a range, bounds included; what is no number does not."""
    return value is None or least <= value <= most


def _is_place(lat_deg: float, lon_deg: float, *heights_m: float) -> bool:
    # Before there is a place both autopilots send zeros.
    return (
        abs(lat_deg) <= 90.0
        and abs(lon_deg) <= 180.0
        and (lat_deg, lon_deg) != (0.0, 0.0)
        and all(LOWEST_M <= height <= HIGHEST_M for height in heights_m)
    )


def _filter_position(said: Position) -> Position | None:
    speeds = (said.north_m_s, said.east_m_s, said.down_m_s)
    if not (
        _is_place(said.lat_deg, said.lon_deg, said.alt_msl_m, said.alt_rel_m)
        and all(abs(speed) <= FASTEST_M_S for speed in speeds)
        and math.isfinite(said.boot_s)
    ):
        return None
    return said if _is_within(said.heading_deg, 0.0, MOST_TURN_DEG) else replace(said, heading_deg=None)


def _filter_home(said: Home) -> Home | None:
    return said if _is_place(said.lat_deg, said.lon_deg, said.alt_msl_m) else None


def _target(said: HeightTarget) -> HeightTarget | None:
    return said if LOWEST_M <= said.below_m <= HIGHEST_M else None


def _filter_battery(said: Battery) -> Battery:
    wrong = _find_wrong_fields(said, (*_OF_A_PACK, ("consumed_ah", 0.0, MOST_AH)))
    if not all(LEAST_CELL_V <= cell < MOST_CELL_V for cell in said.cells_v):
        wrong["cells_v"] = ()
    return replace(said, **wrong) if wrong else said


def _filter_status(said: SystemStatus) -> SystemStatus:
    wrong = _find_wrong_fields(said, _OF_A_PACK)
    return replace(said, **wrong) if wrong else said


_OF_A_PACK = (("remaining_pct", 0.0, 100.0), ("voltage_v", LEAST_V, MOST_V), ("current_a", 0.0, MOST_A))


def _find_wrong_fields(
    said: Battery | SystemStatus | Gps, ranges: tuple[tuple[str, float, float], ...]
) -> dict[str, Any]:
    """Return the fields that are outside of their ranges, as unknown."""
    return {name: None for name, least, most in ranges if not _is_within(getattr(said, name), least, most)}


def _filter_attitude(said: Attitude) -> Attitude | None:
    return said if abs(said.roll_deg) <= MOST_TURN_DEG and abs(said.pitch_deg) <= MOST_TURN_DEG else None


def _filter_gps(said: Gps) -> Gps | None:
    if not 0 <= said.fix <= MOST_FIX:
        return None
    return replace(said, **wrong) if (wrong := _find_wrong_fields(said, (("accuracy_m", 0.0, MOST_OFF_M),))) else said


def _filter_wind(said: Wind) -> Wind | None:
    return said if 0.0 <= said.speed_m_s <= MOST_WIND_M_S and 0.0 <= said.from_deg <= MOST_TURN_DEG else None


def _filter_picture(said: PictureTaken) -> PictureTaken | None:
    if said.sequence < 0:
        return None
    lost: dict[str, Any] = {}
    place = (said.lat_deg, said.lon_deg)
    if said.lat_deg is None or said.lon_deg is None or not _is_place(said.lat_deg, said.lon_deg):
        lost |= {"lat_deg": None, "lon_deg": None} if place != (None, None) else {}
    for key in ("alt_msl_m", "alt_rel_m"):
        if not _is_within(getattr(said, key), LOWEST_M, HIGHEST_M):
            lost[key] = None
    for key in ("roll_deg", "pitch_deg", "yaw_deg"):
        if not _is_within(getattr(said, key), -MOST_TURN_DEG, MOST_TURN_DEG):
            lost[key] = None
    return replace(said, **lost) if lost else said


def _filter_camera(said: CameraStatus) -> CameraStatus:
    wrong = said.free_mib is not None and not said.free_mib >= 0.0
    return replace(said, free_mib=None) if wrong else said


def _filter_gimbal(said: GimbalAttitude) -> GimbalAttitude | None:
    known = abs(said.pitch_deg) <= MOST_TURN_DEG and abs(said.yaw_deg) <= MOST_TURN_DEG
    return said if known else None


def _filter_current_item(said: MissionCurrent) -> MissionCurrent | None:
    # An index beyond the total is what ArduPilot says when another station has given it a shorter mission.
    return said if 0 <= said.seq < NO_ITEM else None


def _filter_reached_item(said: MissionReached) -> MissionReached | None:
    return said if 0 <= said.seq < NO_ITEM else None


def _filter_parameter(said: ParamValue) -> ParamValue | None:
    return said if math.isfinite(said.value) else None


_JUDGES: dict[type, Callable[[Any], Any]] = {
    Position: _filter_position,
    Home: _filter_home,
    HeightTarget: _target,
    Battery: _filter_battery,
    SystemStatus: _filter_status,
    Attitude: _filter_attitude,
    Gps: _filter_gps,
    Wind: _filter_wind,
    MissionCurrent: _filter_current_item,
    MissionReached: _filter_reached_item,
    ParamValue: _filter_parameter,
    PictureTaken: _filter_picture,
    CameraStatus: _filter_camera,
    GimbalAttitude: _filter_gimbal,
}
