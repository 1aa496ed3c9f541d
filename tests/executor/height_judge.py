"""Holds exported missions against the ground and the lines as they are: with its own geometry, from the files alone.

It knows nothing of the program: a .plan is read as any ground station would, and true pylons are given.
"""

from __future__ import annotations

import json
import math
from collections.abc import Iterator, Sequence
from itertools import pairwise
from pathlib import Path

from tests.executor.height_files import LAT_DEG, LON_DEG, METRES_PER_DEG, TruePylon

TAKEOFF, WAYPOINT, LAND = 22, 16, 21
STEP_M = 1.0
BESIDE_M = 9.5
"""A little less than the program promises: its places are another projection's."""
NEAR_M = 40.0
Place = tuple[float, float, float]


def flown(path: Path) -> Iterator[tuple[int, Place, Place]]:
    """Yield what is done on each leg of a .plan, with its start and end in metres: east, north, above sea level."""
    mission = json.loads(path.read_text(encoding="utf-8"))["mission"]
    home = mission["plannedHomePosition"]
    here: Place = (*_local(home[0], home[1]), home[2])
    for item in mission["items"]:
        if item["command"] not in {TAKEOFF, WAYPOINT, LAND}:
            continue
        lat_deg, lon_deg, alt_m = item["params"][4:]
        place = here[:2] if lat_deg == 0.0 and lon_deg == 0.0 else _local(lat_deg, lon_deg)
        there: Place = (*place, home[2] + alt_m)
        yield item["command"], here, there
        here = there


def _local(lat_deg: float, lon_deg: float) -> tuple[float, float]:
    north_m = (lat_deg - LAT_DEG) * METRES_PER_DEG
    return (lon_deg - LON_DEG) * METRES_PER_DEG * math.cos(math.radians(LAT_DEG)), north_m


def too_low(path: Path, lines: Sequence[Sequence[TruePylon]], margin_m: float) -> list[str]:
    """Return where a mission is too low: less than the margin over a line that it is beside, or in the ground."""
    found = []
    spans = [
        (a, b, _local(a.lat_deg, a.lon_deg), _local(b.lat_deg, b.lon_deg)) for line in lines for a, b in pairwise(line)
    ]
    for command, start, end in flown(path):
        length_m = math.dist(start, end)
        for step in range(math.ceil(length_m / STEP_M) + 1):
            share = min(1.0, step * STEP_M / length_m) if length_m > 0 else 0.0
            east_m, north_m, alt_m = (s + share * (e - s) for s, e in zip(start, end, strict=True))
            for a, b, a_m, b_m in spans:
                away_m, along = _beside((east_m, north_m), a_m, b_m)
                top_m = a.ground_m + a.height_m + along * (b.ground_m + b.height_m - a.ground_m - a.height_m)
                if away_m < BESIDE_M and alt_m < top_m + margin_m - 0.1:
                    found.append(f"{path.name}: {alt_m - top_m:.1f} m over the line {a.id} to {b.id}")
                ground_m = a.ground_m + along * (b.ground_m - a.ground_m)
                if command == WAYPOINT and away_m < NEAR_M and alt_m < ground_m + 5.0:
                    found.append(f"{path.name}: {alt_m - ground_m:.1f} m over the ground at {a.id} to {b.id}")
    return found


def _beside(place: tuple[float, float], a: tuple[float, float], b: tuple[float, float]) -> tuple[float, float]:
    """Return the distance of a place from a span over the ground, and where on it that is."""
    along = (b[0] - a[0], b[1] - a[1])
    square = along[0] ** 2 + along[1] ** 2
    share = max(0.0, min(1.0, ((place[0] - a[0]) * along[0] + (place[1] - a[1]) * along[1]) / square))
    return math.hypot(place[0] - a[0] - share * along[0], place[1] - a[1] - share * along[1]), share
