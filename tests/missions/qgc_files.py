"""A reader of what is exported for QGroundControl and Mission Planner, written from the formats alone."""

from __future__ import annotations

import json
import math
from typing import Any

from missions import MissionItem


def read_qgc_plan(text: str) -> tuple[tuple[MissionItem, ...], tuple[float, ...]]:
    """Return the items of a .plan file, numbered from 0, and its home: degrees, degrees, metres above sea level."""
    mission = json.loads(text)["mission"]
    return tuple(map(_read_item, range(len(mission["items"])), mission["items"])), tuple(mission["plannedHomePosition"])


def _read_item(seq: int, item: dict[str, Any]) -> MissionItem:
    assert item["type"] == "SimpleItem"
    assert item["doJumpId"] == seq + 1
    values = item["params"]
    param1, param2, param3, param4 = (math.nan if value is None else float(value) for value in values[:4])
    lat_deg, lon_deg, z = values[4:]
    return MissionItem(
        seq, item["frame"], item["command"], param1, param2, param3, param4,
        x=round(lat_deg * 1e7), y=round(lon_deg * 1e7), z=z,
        autocontinue=item["autoContinue"],
    )  # fmt: skip


def read_waypoints(text: str) -> tuple[MissionItem, ...]:
    """Return the items of a .waypoints file, its home line included if it has one."""
    header, *lines = text.splitlines()
    assert header == "QGC WPL 110"
    return tuple(map(_read_line, range(len(lines)), lines))


def _read_line(number: int, line: str) -> MissionItem:
    seq, current, frame, command, *figures, autocontinue = line.split("\t")
    assert int(seq) == number
    param1, param2, param3, param4, lat_deg, lon_deg, z = map(float, figures)
    return MissionItem(
        number, int(frame), int(command), param1, param2, param3, param4,
        x=round(lat_deg * 1e7), y=round(lon_deg * 1e7), z=z,
        current=current == "1", autocontinue=autocontinue == "1",
    )  # fmt: skip
