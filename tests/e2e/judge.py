"""An independent judge of recorded flights: reads the .tlog files with pymavlink and knows none of the program's rules.

It answers one question of its own: was this segment flown from one end to the other, near the line, slowly enough?
"""

from __future__ import annotations

import json
import math
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from tests.e2e.tlog import messages

Place = tuple[float, float]
BOOTED_S = 10.0
"""A clock that goes back by more than this began anew; frames overtake each other by less."""
APART_S = 1e5
"""Between the clocks of two boots: nothing is flown from one into the other."""


@dataclass(frozen=True)
class Segment:
    id: int
    a_m: Place
    b_m: Place


def segments_of(run: Path) -> dict[int, Segment]:
    """The segments of the first plan, in local metres."""
    plan = json.loads((run / "plan-000.json").read_text())
    return {
        entry["id"]: Segment(entry["id"], tuple(entry["a"][:2]), tuple(entry["b"][:2])) for entry in plan["segments"]
    }


def depot_of(run: Path) -> Place:
    depot = json.loads((run / "plan-000.json").read_text())["depot"]
    return depot["lat_deg"], depot["lon_deg"]


def logs_of(run: Path, name: str) -> list[Path]:
    """A vehicle's telemetry, part by part; each start of the ground station begins one."""
    parts = sorted(run.glob(f"{name}-*.tlog"), key=lambda part: int(part.stem.removeprefix(f"{name}-")))
    return [run / f"{name}.tlog", *parts]


def positions_of(logs: list[Path], depot_deg: Place) -> np.ndarray:
    """(n, 4): seconds by the vehicle's clock, east, north, height; by a flat-earth formula about the depot.

    A vehicle whose pack is changed boots anew, so that its clock begins again.
    """
    rows = []
    latitude = math.radians(depot_deg[0])
    north_m = 111132.954 - 559.822 * math.cos(2 * latitude) + 1.175 * math.cos(4 * latitude)
    east_m = 111412.84 * math.cos(latitude) - 93.5 * math.cos(3 * latitude)
    for _, message in (one for log in logs for one in messages(log, "GLOBAL_POSITION_INT")):
        rows.append((
            message.time_boot_ms / 1e3,
            (message.lon / 1e7 - depot_deg[1]) * east_m,
            (message.lat / 1e7 - depot_deg[0]) * north_m,
            message.relative_alt / 1e3,
        ))  # fmt: skip
    times = np.array(rows)
    times[1:, 0] += APART_S * np.cumsum(np.diff(times[:, 0]) < -BOOTED_S)
    keep = np.concatenate(([True], np.diff(np.maximum.accumulate(times[:, 0])) > 0))
    return times[keep]


def flown(segment: Segment, positions: np.ndarray, *, corridor_m: float = 12.0, speed_m_s: float = 3.0) -> bool:
    """Whether some unbroken stretch of the positions goes along the segment, at most 1.35 times as fast as asked."""
    return passes(segment, positions, corridor_m=corridor_m, speed_m_s=speed_m_s) > 0


def passes(segment: Segment, positions: np.ndarray, *, corridor_m: float = 12.0, speed_m_s: float = 3.0) -> int:
    """How often the positions do; who turns back on the way has not."""
    count = 0
    a, b = np.array(segment.a_m), np.array(segment.b_m)
    length = float(np.linalg.norm(b - a))
    unit = (b - a) / length
    relative = positions[:, 1:3] - a
    along = relative @ unit
    beside = np.abs(relative @ np.array([-unit[1], unit[0]]))
    inside = (beside <= corridor_m) & (along >= -corridor_m) & (along <= length + corridor_m)
    edges = np.flatnonzero(np.diff(np.concatenate(([False], inside, [False])).astype(int)))
    for begin, end in zip(edges[::2], edges[1::2], strict=True):
        stretch, times = along[begin:end], positions[begin:end, 0]
        if len(stretch) < 3 or np.diff(times).max() > 6.0:
            continue
        near, left = min(6.0, length / 3), None
        for at, time_s in zip(stretch.tolist(), times.tolist(), strict=True):
            side = -1 if at <= near else 1 if at >= length - near else 0
            if side == 0:
                continue
            # From the last moment at one end to the first at the other.
            if left is not None and left[0] == -side:
                count += time_s - left[2] >= abs(at - left[1]) / (1.35 * speed_m_s)
            left = (side, at, time_s)
    return count


def wrongly_counted(run: Path, report: dict[str, object], *, speed_m_s: float = 3.0) -> list[tuple[str, int]]:
    """Segments that the report counts for a vehicle whose log does not show them flown."""
    segments, depot = segments_of(run), depot_of(run)
    wrong = []
    for vehicle in report["vehicles"]:  # type: ignore[attr-defined]
        if not vehicle["segments"]:
            continue
        positions = positions_of(logs_of(run, vehicle["name"]), depot)
        wrong += [
            (vehicle["name"], one)
            for one in vehicle["segments"]
            if not flown(segments[one], positions, speed_m_s=speed_m_s)
        ]
    return wrong
