"""Reject implausible values: the one place for the ranges of received fields, live and in logs.

A field outside its range becomes unknown; where a message is useless without it, the message is dropped. Autopilots
mark unknown values in many ways (INT32_MIN, 65535, -1, NaN), firmware has errors, and anybody may send anything.
"""

from __future__ import annotations

import math
import sys
from collections.abc import Mapping
from dataclasses import replace
from types import MappingProxyType
from typing import Any, TypeVar

from executor.core.interface import messages
from executor.core.interface.messages import NO_ITEM, Battery, Message, PictureTaken, Position

LOWEST_M, HIGHEST_M = -1000.0, 20_000.0
MAX_SPEED_M_S = 150.0
MIN_V, MAX_V = 1.0, 500.0
MIN_CELL_V, MAX_CELL_V = 0.5, 5.0
"""Range of a cell voltage; where cells are not measured, the first one of the list holds the whole pack, or as much as
fits."""
MAX_A, MAX_AH = 1000.0, 1000.0
MAX_TURN_DEG = 360.0
MAX_FIX = 8
"""The last GPS_FIX_TYPE, PPP."""
MAX_ERROR_M = 1000.0
"""Position error above which a receiver has no position."""
MAX_WIND_M_S = 150.0
"""Highest plausible wind: more than was ever measured near the ground is a filter that has not settled."""

M = TypeVar("M", bound=Message)


Ranges = tuple[tuple[str, float, float], ...]
"""Fields with their lowest and highest value, both included."""

_TURN = (-MAX_TURN_DEG, MAX_TURN_DEG)
_HEIGHT = (LOWEST_M, HIGHEST_M)
_SPEED = (-MAX_SPEED_M_S, MAX_SPEED_M_S)
_FINITE = (-sys.float_info.max, sys.float_info.max)
_ITEM = ("seq", 0, NO_ITEM - 1)
"""Range of an item index; ArduPilot reports one beyond the total after another station's upload of a shorter
mission."""
_PACK_RANGES: Ranges = (("remaining_pct", 0.0, 100.0), ("voltage_v", MIN_V, MAX_V), ("current_a", 0.0, MAX_A))
_POSITIONED = frozenset({Position, messages.Home})

_REQUIRED: Mapping[type, Ranges] = MappingProxyType({
    Position: (
        ("alt_msl_m", *_HEIGHT), ("alt_rel_m", *_HEIGHT), ("north_m_s", *_SPEED), ("east_m_s", *_SPEED),
        ("down_m_s", *_SPEED), ("boot_s", *_FINITE),
    ),
    messages.Home: (("alt_msl_m", *_HEIGHT),),
    messages.HeightTarget: (("below_m", *_HEIGHT),),
    messages.Attitude: (("roll_deg", *_TURN), ("pitch_deg", *_TURN)),
    messages.Gps: (("fix", 0, MAX_FIX),),
    messages.Wind: (("speed_m_s", 0.0, MAX_WIND_M_S), ("from_deg", 0.0, MAX_TURN_DEG)),
    messages.MissionCurrent: (_ITEM,),
    messages.MissionReached: (_ITEM,),
    messages.ParamValue: (("value", *_FINITE),),
    PictureTaken: (("sequence", 0, math.inf),),
    messages.GimbalAttitude: (("pitch_deg", *_TURN), ("yaw_deg", *_TURN)),
})  # fmt: skip
"""Fields without which a message is useless."""
_OPTIONAL: Mapping[type, Ranges] = MappingProxyType({
    Position: (("heading_deg", 0.0, MAX_TURN_DEG),),
    Battery: (*_PACK_RANGES, ("consumed_ah", 0.0, MAX_AH)),
    messages.SystemStatus: _PACK_RANGES,
    messages.Gps: (("accuracy_m", 0.0, MAX_ERROR_M),),
    PictureTaken: (
        ("alt_msl_m", *_HEIGHT), ("alt_rel_m", *_HEIGHT), ("roll_deg", *_TURN), ("pitch_deg", *_TURN),
        ("yaw_deg", *_TURN),
    ),
    messages.CameraStatus: (("free_mib", 0.0, math.inf),),
})  # fmt: skip
"""Fields that may be unknown."""


def filter_implausible(message: M) -> M | None:
    """Return a message with implausible fields set to unknown, the same object if none is; None if it is useless."""
    kind = type(message)
    if _find_wrong_fields(message, _REQUIRED.get(kind, ())):
        return None
    if kind in _POSITIONED and not _is_place(message):
        return None
    wrong: dict[str, Any] = dict.fromkeys(_find_wrong_fields(message, _OPTIONAL.get(kind, ())))
    if isinstance(message, Battery) and not all(MIN_CELL_V <= cell < MAX_CELL_V for cell in message.cells_v):
        wrong["cells_v"] = ()
    if isinstance(message, PictureTaken) and not _is_place(message):
        wrong |= {name: None for name in ("lat_deg", "lon_deg") if getattr(message, name) is not None}
    return replace(message, **wrong) if wrong else message


def _find_wrong_fields(said: Message, ranges: Ranges) -> list[str]:
    """Return the fields outside their ranges, NaN included."""
    return [
        name
        for name, least, most in ranges
        if (value := getattr(said, name)) is not None and not least <= value <= most
    ]


def _is_place(said: Any) -> bool:  # noqa: ANN401 - any message with a place
    if said.lat_deg is None or said.lon_deg is None:
        return False
    # Both autopilots send zeros before they have a position.
    return abs(said.lat_deg) <= 90.0 and abs(said.lon_deg) <= 180.0 and (said.lat_deg, said.lon_deg) != (0.0, 0.0)
