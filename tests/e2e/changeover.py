"""What the survivors of a loss did while their missions changed, read from the telemetry logs of a run.

``python -m tests.e2e.changeover RUN`` prints it. Like the judge it knows none of the program's rules: the missions are
the items that were sent, the leg under way is what the vehicle says of itself.
"""

from __future__ import annotations

import json
import math
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from tests.e2e.flights import log_lines
from tests.e2e.judge import depot_of
from tests.e2e.tlog import messages

AFTER_S = 5.0
"""Of the flight on the new mission that are looked at as well."""
ENDS_M = 6.0
"""So near to its ends a vehicle gathers speed, or slows down, on every segment."""
GROUND_STATION = 255
PLACES = (16, 21, 22)
"""MAV_CMD_NAV_WAYPOINT, _LAND and _TAKEOFF."""
CHANGE_SPEED = 178

Place = tuple[float, float]


@dataclass(frozen=True)
class Moment:
    """One position in flight, with the leg that it belongs to."""

    t_s: float
    """By the flight's clock."""
    speed_m_s: float
    """Over ground."""
    aside_m: float
    """From the leg under way, or from the one before where that is nearer: corners are cut."""
    on_segment: bool
    """Whether it is on an inspection leg, and not at its ends."""


@dataclass(frozen=True)
class Change:
    """One survivor's change of mission."""

    vehicle: str
    declared_s: float
    """When the loss was declared, by the flight's clock."""
    on_board_s: float
    """When its new mission was on board and read back."""
    during: tuple[Moment, ...]
    """From the declaration until `AFTER_S` after that."""
    otherwise: tuple[Moment, ...]
    """All others of its flight."""

    @property
    def took_s(self) -> float:
        """From the declaration to the new mission."""
        return self.on_board_s - self.declared_s

    @property
    def speeds_m_s(self) -> tuple[float, float] | None:
        """Least and greatest on a segment meanwhile; None if it was on none."""
        return _extremes([one.speed_m_s for one in self.during if one.on_segment])

    @property
    def usual_speeds_m_s(self) -> tuple[float, float] | None:
        """Least and greatest on its other segments."""
        return _extremes([one.speed_m_s for one in self.otherwise if one.on_segment])

    @property
    def least_m_s(self) -> float:
        """The least speed meanwhile, wherever it was."""
        return min(one.speed_m_s for one in self.during)

    @property
    def aside_m(self) -> float:
        """The greatest distance from the leg meanwhile."""
        return max(one.aside_m for one in self.during)


def changes_of(run: Path) -> list[Change]:
    """Return what every survivor did that was given a new mission in flight by the first re-plan."""
    head = json.loads((run / "events.jsonl").open(encoding="utf-8").readline())
    lines = log_lines(run)
    declared_s = next(line["t_s"] for line in lines if line.get("level") == "fault")
    done = {
        line["event"]["vehicle"]: line["t_s"]
        for line in lines
        if line.get("event", {}).get("kind") == "UploadEnded"
        and line["event"]["revision"] == 1
        and line["event"]["accepted"]
    }
    inspection_m_s = json.loads((run / "report.json").read_text())["inspection_speed_m_s"]
    found = []
    for vehicle, on_board_s in done.items():
        moments = list(_moments(run / f"{vehicle}.tlog", head["began_unix_s"], depot_of(run), inspection_m_s))
        during = [one for one in moments if declared_s <= one.t_s <= on_board_s + AFTER_S]
        otherwise = [one for one in moments if not declared_s <= one.t_s <= on_board_s + AFTER_S]
        if during:
            found.append(Change(vehicle, declared_s, on_board_s, tuple(during), tuple(otherwise)))
    return found


class _Course:
    """What a vehicle flies, by the items that it was sent and the one that it says it flies to."""

    def __init__(self, depot_deg: Place, inspection_m_s: float) -> None:
        self.items: dict[int, Any] = {}
        self.current: int | None = None
        self.flying = False
        self._depot_deg = depot_deg
        self._inspection_m_s = inspection_m_s
        self._target: tuple[int, Place] | None = None
        self._turned_m: Place | None = None
        """Where it was when its target was replaced by another place: it flies on from there."""

    def moment(self, at: Any, t_s: float) -> Moment | None:
        """Return what a position says; None where it flies no leg between two places."""
        places = [seq for seq in sorted(self.items) if self.items[seq].command in PLACES and self.items[seq].x != 0]
        ahead = [seq for seq in places if self.current is not None and seq >= self.current]
        behind = places[: len(places) - len(ahead)]
        if not self.flying or not ahead or not behind:
            return None
        here, way = _local(at.lat, at.lon, self._depot_deg), [self._place(seq) for seq in (*behind, ahead[0])]
        if self._target is None or self._target[0] != ahead[0]:
            self._turned_m = None
        elif self._target[1] != way[-1]:
            self._turned_m = here
        self._target = (ahead[0], way[-1])
        along, aside, length = _beside(here, self._turned_m or way[-2], way[-1])
        if len(way) > 2:
            aside = min(aside, _beside(here, way[-3], way[-2])[1])
        on_segment = self._slow(ahead[0]) and ENDS_M <= along <= length - ENDS_M
        return Moment(t_s, math.hypot(at.vx, at.vy) / 100.0, aside, on_segment)

    def _place(self, seq: int) -> Place:
        return _local(self.items[seq].x, self.items[seq].y, self._depot_deg)

    def _slow(self, target: int) -> bool:
        changes = [seq for seq in self.items if seq <= target and self.items[seq].command == CHANGE_SPEED]
        return bool(changes) and abs(self.items[max(changes)].param2 - self._inspection_m_s) < 0.01


def _moments(log: Path, began_unix_s: float, depot_deg: Place, inspection_m_s: float) -> Iterator[Moment]:
    course = _Course(depot_deg, inspection_m_s)
    names = ("MISSION_COUNT", "MISSION_ITEM_INT", "MISSION_CURRENT", "HEARTBEAT", "GLOBAL_POSITION_INT")
    for stamp_s, message in messages(log, *names):
        ours = message.get_srcSystem() == GROUND_STATION
        match message.get_type():
            case "MISSION_COUNT" if ours:
                # The old items stand until each is replaced.
                course.items = {seq: item for seq, item in course.items.items() if seq < message.count}
            case "MISSION_ITEM_INT" if ours:
                course.items[message.seq] = message
            case "MISSION_CURRENT" if not ours:
                course.current = message.seq
            case "HEARTBEAT" if not ours and message.get_srcComponent() == 1:
                course.flying = bool(message.base_mode & 128)
            case "GLOBAL_POSITION_INT":
                moment = course.moment(message, stamp_s - began_unix_s)
                if moment is not None:
                    yield moment


def _local(lat_e7: int, lon_e7: int, depot_deg: Place) -> Place:
    """East and north of the depot in metres, by a flat-earth formula."""
    north_m = math.radians(lat_e7 / 1e7 - depot_deg[0]) * 6371000.0
    return math.radians(lon_e7 / 1e7 - depot_deg[1]) * 6371000.0 * math.cos(math.radians(depot_deg[0])), north_m


def _beside(here: Place, begin: Place, end: Place) -> tuple[float, float, float]:
    """How far along a leg a place lies, how far from it, and how long the leg is."""
    length = math.dist(begin, end)
    if length == 0.0:
        return 0.0, math.dist(here, begin), 0.0
    east, north = (end[0] - begin[0]) / length, (end[1] - begin[1]) / length
    along = (here[0] - begin[0]) * east + (here[1] - begin[1]) * north
    nearest = min(max(along, 0.0), length)
    return along, math.dist(here, (begin[0] + nearest * east, begin[1] + nearest * north)), length


def _extremes(values: list[float]) -> tuple[float, float] | None:
    return (min(values), max(values)) if values else None


def _words(speeds: tuple[float, float] | None) -> str:
    return "-" if speeds is None else f"{speeds[0]:.2f} to {speeds[1]:.2f}"


def table(changes: list[Change]) -> str:
    """Return the figures as rows of a Markdown table."""
    head = "| vehicle | new mission after (s) | speed on segments meanwhile (m/s) | otherwise (m/s) |"
    rows = [f"{head} least speed meanwhile (m/s) | farthest from its leg (m) |", "|---" + 5 * "| ---: " + "|"]
    rows += [
        f"| {one.vehicle} | {one.took_s:.2f} | {_words(one.speeds_m_s)} | {_words(one.usual_speeds_m_s)} "
        f"| {one.least_m_s:.2f} | {one.aside_m:.2f} |"
        for one in changes
    ]
    return "\n".join(rows)


if __name__ == "__main__":
    print(table(changes_of(Path(sys.argv[1]))))
