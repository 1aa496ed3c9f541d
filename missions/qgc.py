"""QGroundControl's .plan and the older .waypoints (QGC WPL 110), out and in.

Home is outside the items in a .plan and, by the habit of ArduPilot's tools, line 0 of a .waypoints file. So a mission
with a home slot (ArduPilot) keeps its home on the way through both formats, and one without (PX4) has none. In a .plan
JSON null stands for NaN. Frames are written with their plain numbers (3 for 6, 0 for 5), which both formats use.
"""

from __future__ import annotations

import json
import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

from missions.autopilots.dialect import Dialect
from missions.errors import MissionFileError
from missions.files import is_number, parse_json
from missions.items import Command, Frame, MissionItem

# MAV_TYPE_QUADROTOR.
_QUADROTOR = 2
_PLAIN_FRAME: dict[int, int] = {
    Frame.GLOBAL_INT: Frame.GLOBAL,
    Frame.GLOBAL_RELATIVE_ALT_INT: Frame.GLOBAL_RELATIVE_ALT,
}
_ALTITUDE_MODE_RELATIVE = 1
_WPL_HEADER = "QGC WPL 110"
_WPL_COLUMNS = 12


@dataclass(frozen=True, slots=True)
class QgcPlan:
    """What a .plan file holds of a mission."""

    items: tuple[MissionItem, ...]
    """Numbered from 0, without home."""
    home: tuple[float, float, float]
    """Latitude and longitude in degrees, height above mean sea level in metres."""


def format_qgc_plan(
    items: Sequence[MissionItem],
    dialect: Dialect,
    home: tuple[float, float, float],
    *,
    fence: Sequence[MissionItem] = (),
    rally: Sequence[MissionItem] = (),
) -> str:
    """Return the text of a .plan file; its upload replaces all three lists on board, also by empty ones.

    Args:
        items: As encoded for the autopilot; a home slot is left out, for QGroundControl adds it at upload.
        dialect: Whose items they are.
        home: Latitude and longitude in degrees, height above mean sea level in metres.
        fence: Corners of one polygon to stay in.
        rally: Rally points.

    Raises:
        MissionFileError: a figure is not finite; NaN as a parameter is what the format has null for.
    """
    flown = items[1:] if dialect.home_item else items
    _check_finite(flown, home, nan_is_null=True)
    speeds = [item.param2 for item in flown if item.command == Command.DO_CHANGE_SPEED]
    document = {
        "fileType": "Plan",
        "version": 1,
        "groundStation": "QGroundControl",
        "geoFence": {"version": 2, "circles": [], "polygons": [_polygon(fence)] if fence else []},
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


def parse_qgc_plan(text: str, *, source: str = "plan") -> QgcPlan:
    """Return the items of a .plan file; the generated items of a survey or another transect pattern are taken as well.

    Raises:
        MissionFileError: one line that names the file, the key and what was expected.
    """
    document = parse_json(text, source, MissionFileError)
    if not isinstance(document, dict) or document.get("fileType") != "Plan":
        raise MissionFileError(f"{source}: fileType: expected 'Plan', as QGroundControl writes it")
    mission = document.get("mission")
    if not isinstance(mission, dict) or not isinstance(mission.get("items"), list):
        raise MissionFileError(f"{source}: mission.items: expected a list")
    home = mission.get("plannedHomePosition")
    if not isinstance(home, list) or len(home) != 3 or not all(map(is_number, home)):
        raise MissionFileError(f"{source}: mission.plannedHomePosition: expected [latitude, longitude, height]")
    simple = list(_flatten_items(mission["items"], f"{source}: mission.items"))
    items = tuple(_parse_item(seq, item, place) for seq, (item, place) in enumerate(simple))
    return QgcPlan(items, (float(home[0]), float(home[1]), float(home[2])))


def format_qgc_waypoints(items: Sequence[MissionItem], dialect: Dialect, home: tuple[float, float, float]) -> str:
    """Return the text of a .waypoints file; with a home slot, line 0 is the home given.

    Raises:
        MissionFileError: a figure is not finite, such as the heading that a PX4 vehicle is left to choose: the format
            has no word for it.
    """
    _check_finite(items, home, nan_is_null=False)
    lines = [_WPL_HEADER]
    for item in items:
        lat_deg, lon_deg, z = item.x / 1e7, item.y / 1e7, item.z
        if dialect.home_item and item.seq == 0:
            lat_deg, lon_deg, z = home
        frame = _PLAIN_FRAME.get(item.frame, item.frame)
        numbers = (item.param1, item.param2, item.param3, item.param4)
        lines.append("\t".join([
            str(item.seq), str(int(item.current)), str(frame), str(int(item.command)), *map(repr, numbers),
            f"{lat_deg:.7f}", f"{lon_deg:.7f}", repr(z), str(int(item.autocontinue)),
        ]))  # fmt: skip
    return "\n".join(lines) + "\n"


def parse_qgc_waypoints(text: str, *, source: str = "waypoints") -> tuple[MissionItem, ...]:
    """Return the items of a .waypoints file, its home line included if it has one.

    Raises:
        MissionFileError: one line that names the file, the line and what was expected.
    """
    lines = text.splitlines()
    if not lines or lines[0].strip() != _WPL_HEADER:
        raise MissionFileError(f"{source}: line 1: expected {_WPL_HEADER!r}")
    items: list[MissionItem] = []
    for number, line in enumerate(lines[1:], start=2):
        if line.strip():
            items.append(_parse_line(line, f"{source}: line {number}"))
            if items[-1].seq != len(items) - 1:
                raise MissionFileError(
                    f"{source}: line {number}: index: expected {len(items) - 1}, got {items[-1].seq}"
                )
    return tuple(items)


def _check_finite(items: Sequence[MissionItem], home: tuple[float, float, float], *, nan_is_null: bool) -> None:
    if not all(map(math.isfinite, home)):
        raise MissionFileError(f"home: expected a finite place and height, got {home}")
    for item in items:
        params = (item.param1, item.param2, item.param3, item.param4)
        figures = {**{f"param{number}": one for number, one in enumerate(params, 1)}, "height": item.z}
        for key, figure in figures.items():
            if not math.isfinite(figure) and not (nan_is_null and key != "height" and math.isnan(figure)):
                raise MissionFileError(f"item {item.seq}: {key}: expected a finite number, got {figure}")


def _polygon(corners: Sequence[MissionItem]) -> dict[str, object]:
    return {"version": 1, "inclusion": True, "polygon": [_degrees(corner) for corner in corners]}


def _degrees(item: MissionItem) -> list[float]:
    return [item.x / 1e7, item.y / 1e7]


def _build_simple_item(number: int, item: MissionItem) -> dict[str, object]:
    params = [item.param1, item.param2, item.param3, item.param4]
    entry: dict[str, object] = {
        "type": "SimpleItem",
        "autoContinue": item.autocontinue,
        "command": int(item.command),
        "doJumpId": number,
        "frame": _PLAIN_FRAME.get(item.frame, int(item.frame)),
        "params": [
            *(None if math.isnan(value) else value for value in params), item.x / 1e7, item.y / 1e7, item.z
        ],
    }  # fmt: skip
    if item.frame in (Frame.GLOBAL_RELATIVE_ALT, Frame.GLOBAL_RELATIVE_ALT_INT):
        entry |= {"AltitudeMode": _ALTITUDE_MODE_RELATIVE, "Altitude": item.z, "AMSLAltAboveTerrain": None}
    return entry


def _flatten_items(items: Sequence[object], place: str) -> Iterator[tuple[Mapping[str, object], str]]:
    for index, item in enumerate(items):
        here = f"{place}[{index}]"
        if not isinstance(item, dict):
            raise MissionFileError(f"{here}: expected an object")
        if item.get("type") == "SimpleItem":
            yield item, here
            continue
        transect = item.get("TransectStyleComplexItem")
        generated = transect.get("Items") if isinstance(transect, dict) else None
        if not isinstance(generated, list):
            kind = item.get("complexItemType", item.get("type"))
            raise MissionFileError(f"{here}.type: expected a SimpleItem or a pattern with its waypoints, got {kind!r}")
        yield from _flatten_items(generated, f"{here}.TransectStyleComplexItem.Items")


def _parse_item(seq: int, item: Mapping[str, object], place: str) -> MissionItem:
    params = item.get("params")
    if (
        not isinstance(params, list)
        or len(params) != 7
        or not all(value is None or is_number(value) for value in params)
    ):
        raise MissionFileError(f"{place}.params: expected seven numbers or nulls, got {params!r}")
    values = [math.nan if value is None else float(value) for value in params]
    lat_deg, lon_deg, z = (0.0 if math.isnan(value) else value for value in values[4:])
    return MissionItem(
        seq=seq,
        frame=_read_integer(item, "frame", place),
        command=_read_integer(item, "command", place),
        param1=values[0],
        param2=values[1],
        param3=values[2],
        param4=values[3],
        x=round(lat_deg * 1e7),
        y=round(lon_deg * 1e7),
        z=z,
        autocontinue=item.get("autoContinue", True) is not False,
    )


def _read_integer(item: Mapping[str, object], key: str, place: str) -> int:
    value = item.get(key)
    if not isinstance(value, int) or isinstance(value, bool):
        raise MissionFileError(f"{place}.{key}: expected a number, got {value!r}")
    return value


def _parse_line(line: str, place: str) -> MissionItem:
    words = line.split()
    if len(words) != _WPL_COLUMNS:
        raise MissionFileError(f"{place}: expected {_WPL_COLUMNS} columns, got {len(words)}")
    try:
        seq, current, frame, command = (int(word) for word in words[:4])
        values = [float(word) for word in words[4:11]]
        autocontinue = int(words[11])
    except ValueError as error:
        raise MissionFileError(f"{place}: expected numbers in all columns: {error}") from error
    if not all(map(math.isfinite, values[4:])):
        raise MissionFileError(f"{place}: expected finite latitude, longitude and height")
    item = MissionItem(seq, frame, command, values[0], values[1], values[2], values[3])
    return replace(
        item,
        x=round(values[4] * 1e7),
        y=round(values[5] * 1e7),
        z=values[6],
        current=bool(current),
        autocontinue=bool(autocontinue),
    )
