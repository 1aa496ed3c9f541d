"""No-fly areas and height limits, and their outlines.

An area is defined by its outlines in local metres. All flights keep ``keep_m`` from them: a place that is nearer,
horizontally, is in the area. Outlines are prepared for path finding: clipped to the vicinity, with few corners, and
without self-intersections.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass
from enum import Enum

import numpy as np

from missions.errors import SafetyError
from missions.geo import FloatArray
from missions.geometry import find_bends, find_crossings
from missions.validation import Above0, Figure, From0, Id, Pair, Printable, Text

Ring = tuple[Pair, ...]
"""East and north of corners in metres; an outline closes from the last to the first corner, which is not repeated."""
END_CORNERS = 6
"""Corners of the half circle at the end of a corridor's leg."""
MOST_LIMIT_M = 10_000.0
UNKNOWN_GROUND = "beyond the ground that the rasters know"
"""Name of the closed border around known ground."""
SHORTEST_M = 0.01
"""Distance below which corners are merged."""
LOOKED_UP_TO = 3000
"""Most corners for which self-intersection is checked; outlines drawn by hand have fewer."""


class AreaKind(Enum):
    """Kind of restriction; the value is its name in site files and plan files."""

    NO_FLY = "no-fly"
    """No flight at any height."""
    CORRIDOR = "corridor"
    """No flight on both sides of a line along which others fly."""
    HEIGHT_LIMIT = "height-limit"
    """No flight above a height."""


@dataclass(frozen=True, slots=True)
class Area:
    """One area, or one part of an area of several."""

    name: Text
    """Name."""
    kind: AreaKind
    rings_m: tuple[Ring, ...]
    """Outline, followed by those of holes; for a corridor, its centre line."""
    margin_m: Above0
    """Distance that flights keep from it."""
    width_m: From0 = 0.0
    """Width of a corridor, side to side."""
    eased_m: From0 = 0.0
    """Simplification error of its outlines, which is added to the margin."""
    max_agl_m: Figure | None = None
    """Height limit above ground."""
    max_amsl_m: Figure | None = None
    """Height limit above mean sea level."""

    def __post_init__(self) -> None:
        """Check that the fields are consistent.

        Raises:
            SafetyError: an outline has too few corners, or a limit is missing.
        """
        least = 2 if self.kind is AreaKind.CORRIDOR else 3
        if not self.rings_m or any(len(ring) < least for ring in self.rings_m):
            raise SafetyError(f"area {self.name!r}: expected at least {least} places")
        if not 0 < self.margin_m <= MOST_LIMIT_M or (self.kind is AreaKind.CORRIDOR) is not (self.width_m > 0):
            raise SafetyError(f"area {self.name!r}: expected a margin_m above 0, and a width_m for a corridor alone")
        limited = self.max_agl_m is not None or self.max_amsl_m is not None
        if limited is not (self.kind is AreaKind.HEIGHT_LIMIT):
            raise SafetyError(f"area {self.name!r}: expected max_agl_m or max_amsl_m for a height limit alone")

    @property
    def is_line(self) -> bool:
        """Whether the obstacle is a line, with nothing inside."""
        return self.kind is AreaKind.CORRIDOR

    @property
    def keep_m(self) -> float:
        """Distance that all flights keep from the outlines, or from the centre line."""
        return self.margin_m + self.width_m / 2 + self.eased_m

    def polygons_m(self) -> tuple[Ring, ...]:
        """Return closed polygons that cover the area itself, without its margin and ignoring holes.

        A corridor has one for each of its legs, with round ends.
        """
        if not self.is_line:
            return self.rings_m[:1]
        return tuple(
            _build_capsule(begin_m, end_m, self.width_m / 2)
            for line in self.rings_m
            for begin_m, end_m in itertools.pairwise(line)
        )

    def edges_m(self) -> FloatArray:
        """(e, 2, 2) float64: begin and end of all straight edges of the outlines, or of the line."""
        edges = [
            (ring[index], ring[(index + 1) % len(ring)])
            for ring in self.rings_m
            for index in range(len(ring) - self.is_line)
        ]
        return np.array(edges, dtype=np.float64)


@dataclass(frozen=True, slots=True)
class AreaRestriction:
    """An area, and the vehicles that must keep out of it."""

    area: Area
    vehicles: tuple[str, ...]
    """Restricted vehicles: all, or for a height limit those whose layers are above it."""
    highest_m: Figure | None = None
    """For a height limit: height of the highest of these vehicles, in the limit's reference."""


@dataclass(frozen=True, slots=True)
class Unreachable:
    """A segment that no flight can inspect."""

    segment: Id
    """Segment id in the network."""
    why: Printable
    """Reason, to follow the name: "lies in area 'airfield'"."""
    name: Printable = ""
    """Name in the network file."""


def _build_capsule(begin_m: tuple[float, float], end_m: tuple[float, float], radius_m: float) -> Ring:
    """Return the polygon around a leg, with sides tangent to the round ends from outside."""
    toward = math.atan2(end_m[1] - begin_m[1], end_m[0] - begin_m[0])
    step, corners = math.pi / END_CORNERS, []
    out_m = radius_m / math.cos(step / 2)
    for (east_m, north_m), first in ((end_m, toward - math.pi / 2), (begin_m, toward + math.pi / 2)):
        for number in range(END_CORNERS):
            angle = first + (number + 0.5) * step
            corners.append((east_m + out_m * math.cos(angle), north_m + out_m * math.sin(angle)))
    return tuple(corners)


def remove_double_corners(ring: Ring, *, closed: bool) -> Ring:
    """Return an outline, or a line, without consecutive duplicate corners."""
    kept: list[tuple[float, float]] = []
    for corner in ring:
        if not kept or math.dist(kept[-1], corner) > SHORTEST_M:
            kept.append(corner)
    if closed and len(kept) > 1 and math.dist(kept[0], kept[-1]) <= SHORTEST_M:
        kept.pop()
    return tuple(kept)


def area_inside_m2(ring: Ring) -> float:
    """Return the area enclosed by an outline."""
    corners = np.array(ring)
    after = np.roll(corners, -1, axis=0)
    return abs(float((corners[:, 0] * after[:, 1] - corners[:, 1] * after[:, 0]).sum())) / 2


def is_self_crossing(ring: Ring) -> bool:
    """Return whether two sides of an outline cross each other."""
    if len(ring) > LOOKED_UP_TO:
        return False
    corners, numbers = np.array(ring), np.arange(len(ring))
    sides_m = np.stack((corners, np.roll(corners, -1, axis=0)), axis=1)
    return next(find_crossings(sides_m, np.column_stack((numbers, np.roll(numbers, -1)))), None) is not None


def clip_outline(ring: Ring, low: tuple[float, float], high: tuple[float, float]) -> Ring:
    """Return the part of an outline in a box (Sutherland, Hodgman); empty where they do not overlap."""
    corners: Sequence[tuple[float, float]] = ring
    for axis, bound, sign in ((0, low[0], 1.0), (0, high[0], -1.0), (1, low[1], 1.0), (1, high[1], -1.0)):
        kept: list[tuple[float, float]] = []
        for index, corner in enumerate(corners):
            before = corners[index - 1]
            within, was = (sign * (one[axis] - bound) >= 0 for one in (corner, before))
            if within is not was:
                share = (bound - before[axis]) / (corner[axis] - before[axis])
                kept.append((before[0] + share * (corner[0] - before[0]), before[1] + share * (corner[1] - before[1])))
            if within:
                kept.append(corner)
        corners = kept
    return remove_double_corners(tuple(corners), closed=True)


def simplify_outline(ring: Ring, tolerance_m: float, *, closed: bool) -> Ring:
    """Return an outline, or a line, with fewer corners, within a tolerance (Douglas, Peucker)."""
    corners = np.array(ring)
    if tolerance_m <= 0 or len(corners) <= 4:
        return ring
    if not closed:
        return _to_ring(corners[_select_corners(corners, tolerance_m)])
    far = int(np.hypot(*(corners - corners[0]).T).argmax())
    there, back = corners[: far + 1], np.concatenate((corners[far:], corners[:1]))
    kept = np.concatenate(
        (there[_select_corners(there, tolerance_m)][:-1], back[_select_corners(back, tolerance_m)][:-1])
    )
    return _to_ring(kept) if len(kept) >= 3 else ring


def _select_corners(corners: FloatArray, tolerance_m: float) -> list[int]:
    return sorted({0, *find_bends(corners, tolerance_m), len(corners) - 1})


def _to_ring(corners: FloatArray) -> Ring:
    return tuple((float(east), float(north)) for east, north in corners)
