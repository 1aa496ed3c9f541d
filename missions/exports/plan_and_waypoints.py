"""Write QGroundControl's .plan and the older .waypoints (QGC WPL 110).

Home is outside the items in a .plan and, by convention of ArduPilot's tools, line 0 of a .waypoints file. So a mission
with a home slot (ArduPilot) keeps its home through both formats, and one without (PX4) has none. In a .plan, JSON null
stands for NaN. Frames are written with their plain numbers (3 for 6, 0 for 5), which both formats use.
"""

from __future__ import annotations

import json
import math
from collections.abc import Sequence

from missions.autopilots.dialect import Dialect
from missions.errors import MissionFileError
from missions.items import PLAIN_FRAMES, Command, Frame, MissionItem

# MAV_TYPE_QUADROTOR.
_QUADROTOR = 2
_ALTITUDE_MODE_RELATIVE = 1
_WPL_HEADER = "QGC WPL 110"


def format_qgc_plan(
    items: Sequence[MissionItem],
    dialect: Dialect,
    home: tuple[float, float, float],
    *,
    fence: Sequence[MissionItem] = (),
    rally: Sequence[MissionItem] = (),
) -> str:
    """Return the text of a .plan file; its upload replaces all three lists on board, even with empty ones.

    Args:
        items: As encoded for the autopilot; a home slot is left out, because QGroundControl adds it at upload.
        dialect: Dialect of the items.
        home: Latitude and longitude in degrees, height above mean sea level in metres.
        fence: Corners of one inclusion polygon.
        rally: Rally points.

    Raises:
        MissionFileError: a figure is not finite; only NaN as a parameter is allowed, as null.
    """
    flown = items[1:] if dialect.home_item else items
    _check_finite(flown, home, nan_is_null=True)
    speeds = [item.param2 for item in flown if item.command == Command.DO_CHANGE_SPEED]
    polygon = {"version": 1, "inclusion": True, "polygon": [_degrees(corner) for corner in fence]}
    document = {
        "fileType": "Plan",
        "version": 1,
        "groundStation": "QGroundControl",
        "geoFence": {"version": 2, "circles": [], "polygons": [polygon] if fence else []},
        "rallyPoints": {"version": 2, "points": [[*_degrees(point), point.z] for point in rally]},
        "mission": {
            "version": 2,
            "firmwareType": dialect.number,
            "vehicleType": _QUADROTOR,
            "cruiseSpeed": max(speeds, default=5.0),
            "hoverSpeed": max(speeds, default=5.0),
            "plannedHomePosition": list(home),
            "items": [_build_simple_item(number, item) for number, item in enumerate(flown, start=1)],
        },
    }
    return json.dumps(document, indent=1, allow_nan=False) + "\n"


def format_qgc_waypoints(items: Sequence[MissionItem], dialect: Dialect, home: tuple[float, float, float]) -> str:
    """Return the text of a .waypoints file; with a home slot, line 0 is the given home.

    Raises:
        MissionFileError: a figure is not finite, e.g. a PX4 heading left to the vehicle: the format cannot express it.
    """
    _check_finite(items, home, nan_is_null=False)
    lines = [_WPL_HEADER]
    for item in items:
        lat_deg, lon_deg, z = item.x / 1e7, item.y / 1e7, item.z
        if dialect.home_item and item.seq == 0:
            lat_deg, lon_deg, z = home
        frame = PLAIN_FRAMES.get(item.frame, item.frame)
        numbers = (item.param1, item.param2, item.param3, item.param4)
        lines.append("\t".join([
            str(item.seq), str(int(item.current)), str(frame), str(int(item.command)), *map(repr, numbers),
            f"{lat_deg:.7f}", f"{lon_deg:.7f}", repr(z), str(int(item.autocontinue)),
        ]))  # fmt: skip
    return "\n".join(lines) + "\n"


def _check_finite(items: Sequence[MissionItem], home: tuple[float, float, float], *, nan_is_null: bool) -> None:
    if not all(map(math.isfinite, home)):
        raise MissionFileError(f"home: expected a finite place and height, got {home}")
    for item in items:
        params = (item.param1, item.param2, item.param3, item.param4)
        figures = {**{f"param{number}": one for number, one in enumerate(params, 1)}, "height": item.z}
        for key, figure in figures.items():
            if not math.isfinite(figure) and not (nan_is_null and key != "height" and math.isnan(figure)):
                raise MissionFileError(f"item {item.seq}: {key}: expected a finite number, got {figure}")


def _degrees(item: MissionItem) -> list[float]:
    return [item.x / 1e7, item.y / 1e7]


def _build_simple_item(number: int, item: MissionItem) -> dict[str, object]:
    params = [item.param1, item.param2, item.param3, item.param4]
    entry: dict[str, object] = {
        "type": "SimpleItem",
        "autoContinue": item.autocontinue,
        "command": int(item.command),
        "doJumpId": number,
        "frame": PLAIN_FRAMES.get(item.frame, int(item.frame)),
        "params": [
            *(None if math.isnan(value) else value for value in params), item.x / 1e7, item.y / 1e7, item.z
        ],
    }  # fmt: skip
    if item.frame in (Frame.GLOBAL_RELATIVE_ALT, Frame.GLOBAL_RELATIVE_ALT_INT):
        entry |= {"AltitudeMode": _ALTITUDE_MODE_RELATIVE, "Altitude": item.z, "AMSLAltAboveTerrain": None}
    return entry
