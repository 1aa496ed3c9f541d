"""What no vehicle can say: the one place for the ranges of what is heard, live and in logs.

A field that is outside of its range is unknown; where a message says nothing without it, the message is. Autopilots
mark the unknown in many ways (INT32_MIN, 65535, -1, NaN), firmware has mistakes, and anybody may send anything.
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


Ranges = tuple[tuple[str, float, float], ...]
"""A field with the least and the most that it can be, both included."""

_TURN = (-MOST_TURN_DEG, MOST_TURN_DEG)
_HEIGHT = (LOWEST_M, HIGHEST_M)
_SPEED = (-FASTEST_M_S, FASTEST_M_S)
_FINITE = (-sys.float_info.max, sys.float_info.max)
_ITEM = ("seq", 0, NO_ITEM - 1)
"""An index beyond the total is what ArduPilot says when another station has given it a shorter mission."""
_OF_A_PACK: Ranges = (("remaining_pct", 0.0, 100.0), ("voltage_v", LEAST_V, MOST_V), ("current_a", 0.0, MOST_A))
_PLACED = frozenset({Position, messages.Home})

_NEEDED: Mapping[type, Ranges] = MappingProxyType({
    Position: (
        ("alt_msl_m", *_HEIGHT), ("alt_rel_m", *_HEIGHT), ("north_m_s", *_SPEED), ("east_m_s", *_SPEED),
        ("down_m_s", *_SPEED), ("boot_s", *_FINITE),
    ),
    messages.Home: (("alt_msl_m", *_HEIGHT),),
    messages.HeightTarget: (("below_m", *_HEIGHT),),
    messages.Attitude: (("roll_deg", *_TURN), ("pitch_deg", *_TURN)),
    messages.Gps: (("fix", 0, MOST_FIX),),
    messages.Wind: (("speed_m_s", 0.0, MOST_WIND_M_S), ("from_deg", 0.0, MOST_TURN_DEG)),
    messages.MissionCurrent: (_ITEM,),
    messages.MissionReached: (_ITEM,),
    messages.ParamValue: (("value", *_FINITE),),
    PictureTaken: (("sequence", 0, math.inf),),
    messages.GimbalAttitude: (("pitch_deg", *_TURN), ("yaw_deg", *_TURN)),
})  # fmt: skip
"""Without these a message says nothing."""
_SPARE: Mapping[type, Ranges] = MappingProxyType({
    Position: (("heading_deg", 0.0, MOST_TURN_DEG),),
    Battery: (*_OF_A_PACK, ("consumed_ah", 0.0, MOST_AH)),
    messages.SystemStatus: _OF_A_PACK,
    messages.Gps: (("accuracy_m", 0.0, MOST_OFF_M),),
    PictureTaken: (
        ("alt_msl_m", *_HEIGHT), ("alt_rel_m", *_HEIGHT), ("roll_deg", *_TURN), ("pitch_deg", *_TURN),
        ("yaw_deg", *_TURN),
    ),
    messages.CameraStatus: (("free_mib", 0.0, math.inf),),
})  # fmt: skip
"""These may be unknown."""


def filter_implausible(message: M) -> M | None:
    """Return a message with what cannot be made unknown, the same object if it all can be; None if nothing is left."""
    kind = type(message)
    if _find_wrong_fields(message, _NEEDED.get(kind, ())):
        return None
    if kind in _PLACED and not _is_place(message):
        return None
    wrong: dict[str, Any] = dict.fromkeys(_find_wrong_fields(message, _SPARE.get(kind, ())))
    if isinstance(message, Battery) and not all(LEAST_CELL_V <= cell < MOST_CELL_V for cell in message.cells_v):
        wrong["cells_v"] = ()
    if isinstance(message, PictureTaken) and not _is_place(message):
        wrong |= {name: None for name in ("lat_deg", "lon_deg") if getattr(message, name) is not None}
    return replace(message, **wrong) if wrong else message


def _find_wrong_fields(said: Message, ranges: Ranges) -> list[str]:
    """Return the fields that are outside of their ranges; what is no number is."""
    return [
        name
        for name, least, most in ranges
        if (value := getattr(said, name)) is not None and not least <= value <= most
    ]


def _is_place(said: Any) -> bool:  # noqa: ANN401 - any message with a place
    if said.lat_deg is None or said.lon_deg is None:
        return False
    # Before there is a place both autopilots send zeros.
    return abs(said.lat_deg) <= 90.0 and abs(said.lon_deg) <= 180.0 and (said.lat_deg, said.lon_deg) != (0.0, 0.0)
