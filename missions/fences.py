"""Build the fence of one vehicle around its plan and RTL, and encode it.

A fence is convex. So a straight RTL from anywhere inside stays inside, whatever caused it, and a fence that covers two
missions is the hull of both. Every simplification only makes it larger.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from missions import geometry
from missions.geo import BoolArray, FloatArray, LocalFrame
from missions.items import Frame, MissionItem, PlaceCommand
from missions.waypoints import FlightPath

Corner = tuple[float, float]
"""Local east and north, metres."""

MOST_CORNERS = 24
"""Most corners of a fence; ArduPilot took 70 items in all (measured), smaller boards fewer."""
ROUND = 8
"""Corners of the circumscribed polygon that approximates the margin around a point."""
COVERED_M = 0.05
"""Tolerance: positions in 1e-7 degrees lose 1 cm."""
READ_BACK_E7 = 100
"""Read-back tolerance, one metre: PX4 compares lists in float32 degrees and keeps the old one if they are equal."""


@dataclass(frozen=True, slots=True)
class Fence:
    """The area where one vehicle may fly."""

    corners_m: tuple[Corner, ...]
    """Corners of a convex polygon, counter-clockwise."""
    top_m: float
    """Ceiling above its own home."""

    def distance_outside_m(self, place_m: Corner) -> float:
        """Return the distance of a place outside the fence; 0 inside."""
        if _is_inside_convex(self.corners_m, place_m, 0.0):
            return 0.0
        return min(geometry.locate_on_leg(one, other, place_m)[1] for one, other in _iterate_edges(self.corners_m))

    def is_covering(self, other: Fence) -> bool:
        """Return whether this fence contains the other."""
        inside = all(_is_inside_convex(self.corners_m, corner, COVERED_M) for corner in other.corners_m)
        return inside and other.top_m <= self.top_m + COVERED_M

    def merge_with(self, other: Fence) -> Fence:
        """Return the smallest fence of its kind that covers both."""
        corners = simplify_polygon(build_fence_hull((*self.corners_m, *other.corners_m)))
        return Fence(corners, max(self.top_m, other.top_m))


def build_fence(places_m: Iterable[Corner], margin_m: float, top_m: float) -> Fence:
    """Return the fence of a vehicle that flies straight from place to place, with a straight RTL from anywhere.

    Args:
        places_m: Every place of its missions, its pad included.
        margin_m: Minimum distance of the fence from its paths.
        top_m: Its height above the vehicle's home.
    """
    reach_m = margin_m / math.cos(math.pi / ROUND)
    turns = [2.0 * math.pi * (number + 0.5) / ROUND for number in range(ROUND)]
    around = [
        (east_m + reach_m * math.cos(turn), north_m + reach_m * math.sin(turn))
        for east_m, north_m in build_fence_hull(tuple(places_m))
        for turn in turns
    ]
    corners = simplify_polygon(build_fence_hull(around))
    return Fence(corners, top_m)


def flown_places(pad_m: Corner, path: FlightPath | None, frame: LocalFrame) -> list[Corner]:
    """Return every place that a fence must enclose: the pad, and the places of a flight."""
    waypoints = () if path is None else path.waypoints
    return [pad_m, *(frame.to_local_m(point.lat_deg, point.lon_deg) for point in waypoints)]


def build_fence_hull(places_m: Sequence[Corner]) -> tuple[Corner, ...]:
    """Return the convex hull, counter-clockwise and without corners on a straight edge, to a millimetre.

    >>> build_fence_hull([(0.0, 0.0), (2.0, 0.0), (1.0, 0.1), (2.0, 2.0), (0.0, 2.0)])
    ((0.0, 0.0), (2.0, 0.0), (2.0, 2.0), (0.0, 2.0))
    """
    ordered = sorted({(round(east_m, 3), round(north_m, 3)) for east_m, north_m in places_m})
    return geometry.build_convex_hull(ordered, 1e-9)


def simplify_polygon(corners_m: Sequence[Corner], most: int = MOST_CORNERS) -> tuple[Corner, ...]:
    """Return a larger convex polygon with few corners: edges are removed by extending their neighbours."""
    corners = list(corners_m)
    while len(corners) > max(most, 4):
        ways = [way for index in range(len(corners)) if (way := _find_edge_removal(corners, index)) is not None]
        if not ways:
            break
        _, index, corner = min(ways)
        after = (index + 1) % len(corners)
        corners[index] = corner
        del corners[after]
    return tuple(corners)


def build_fence_items(fence: Fence, frame: LocalFrame) -> tuple[MissionItem, ...]:
    """Return a fence as items to upload."""
    placed = [_to_e7(frame, corner) for corner in fence.corners_m]
    return tuple(
        MissionItem(seq, Frame.GLOBAL, PlaceCommand.INCLUSION_VERTEX, float(len(placed)), x=x, y=y)
        for seq, (x, y) in enumerate(placed)
    )


def build_rally_items(places_m: Iterable[Corner], frame: LocalFrame) -> tuple[MissionItem, ...]:
    """Return rally points at the height of the vehicle's home, as items to upload."""
    return tuple(
        MissionItem(seq, Frame.GLOBAL_RELATIVE_ALT, PlaceCommand.RALLY_POINT, x=x, y=y)
        for seq, place in enumerate(places_m)
        for x, y in (_to_e7(frame, place),)
    )


def find_list_differences(sent: Sequence[MissionItem], read_back: Sequence[MissionItem]) -> tuple[str, ...]:
    """Return messages on how fence or rally points on board differ from those sent; empty if they are equivalent.

    Frames are not compared: ArduPilot answers 0, PX4 the number for integer coordinates. Nor are flags, which have no
    meaning here.
    """
    if len(sent) != len(read_back):
        return (f"{len(sent)} items sent, {len(read_back)} read back",)
    return tuple(
        f"item {ours.seq}: {key} sent {was:g}, read back {now:g}"
        for ours, theirs in zip(sent, read_back, strict=True)
        for key, was, now, least in (
            ("command", ours.command, theirs.command, 0.0),
            ("param1", ours.param1, theirs.param1, 0.01),
            ("x", ours.x, theirs.x, READ_BACK_E7),
            ("y", ours.y, theirs.y, READ_BACK_E7),
            # ArduPilot stores the heights of rally points in whole metres.
            ("z", ours.z, theirs.z, 1.01 if ours.command == PlaceCommand.RALLY_POINT else math.inf),
        )
        if abs(was - now) > least
    )


@dataclass(frozen=True, slots=True)
class FenceOutline:
    """One shape of a fence uploaded by another ground station."""

    keeps_out: bool
    corners_m: tuple[Corner, ...]
    """Corners of a polygon, or the centre of a circle."""
    radius_m: float | None = None
    """Radius of a circle."""

    def is_allowed(self, places_m: FloatArray) -> BoolArray:
        """Return (m,) whether this shape allows a vehicle at (m, 2) places."""
        corners_m = np.array(self.corners_m)
        if self.radius_m is None:
            inside = geometry.is_enclosed(places_m, corners_m, np.roll(corners_m, -1, axis=0))
        else:
            inside = geometry.distances_between_m(places_m, corners_m)[:, 0] <= self.radius_m
        return np.asarray(inside != self.keeps_out)


def parse_outlines(items: Sequence[MissionItem], frame: LocalFrame) -> tuple[FenceOutline, ...]:
    """Return the shapes of a fence on board; other items, e.g. a return point, are ignored."""
    shapes, index = list[FenceOutline](), 0
    while index < len(items):
        item, size = items[index], 1
        keeps_out = item.command in {PlaceCommand.EXCLUSION_VERTEX, PlaceCommand.EXCLUSION_CIRCLE}
        if item.command in {PlaceCommand.INCLUSION_VERTEX, PlaceCommand.EXCLUSION_VERTEX}:
            size = max(1, int(item.param1))
            ring = items[index : index + size]
            shapes.append(FenceOutline(keeps_out, tuple(_to_local(frame, one) for one in ring)))
        elif item.command in {PlaceCommand.INCLUSION_CIRCLE, PlaceCommand.EXCLUSION_CIRCLE}:
            shapes.append(FenceOutline(keeps_out, (_to_local(frame, item),), item.param1))
        index += size
    return tuple(shapes)


def find_first_outside(shapes: Sequence[FenceOutline], way_m: Sequence[Corner], step_m: float = 2.0) -> Corner | None:
    """Return the first place on a path of straight legs that is outside a fence on board; None if there is none.

    Both autopilots require a vehicle inside every inclusion and outside every exclusion.
    """
    for leg in itertools.pairwise(way_m):
        places_m = geometry.sample_leg(np.array(leg), step_m)
        outside = places_m[~np.all([np.ones(len(places_m)), *(shape.is_allowed(places_m) for shape in shapes)], axis=0)]
        if len(outside):
            return float(outside[0, 0]), float(outside[0, 1])
    return None


def number_items(items: Iterable[MissionItem]) -> tuple[MissionItem, ...]:
    """Return items read from a vehicle, renumbered to send them back."""
    return tuple(replace(item, seq=seq, current=False) for seq, item in enumerate(items))


def _iterate_edges(corners: Sequence[Corner]) -> Iterable[tuple[Corner, Corner]]:
    return zip(corners, (*corners[1:], corners[0]), strict=True)


def _is_inside_convex(corners: Sequence[Corner], place: Corner, slack_m: float) -> bool:
    return all(
        geometry.parallelogram_area_m2(one, other, place) >= -slack_m * math.dist(one, other)
        for one, other in _iterate_edges(corners)
    )


def _find_edge_removal(corners: Sequence[Corner], index: int) -> tuple[float, int, Corner] | None:
    """Return the area added by removing the edge from a corner, and the corner that replaces both its ends."""
    count = len(corners)
    before, one = corners[index - 1], corners[index]
    other, after = corners[(index + 1) % count], corners[(index + 2) % count]
    ahead = (one[0] - before[0], one[1] - before[1])
    onward = (after[0] - other[0], after[1] - other[1])
    turn = ahead[0] * onward[1] - ahead[1] * onward[0]
    if turn <= 1e-9:
        return None  # its neighbours meet on the other side, or nowhere
    share = ((after[0] - before[0]) * onward[1] - (after[1] - before[1]) * onward[0]) / turn
    corner = (before[0] + share * ahead[0], before[1] + share * ahead[1])
    return abs(geometry.parallelogram_area_m2(one, corner, other)), index, corner


def _to_e7(frame: LocalFrame, corner: Corner) -> tuple[int, int]:
    lat_deg, lon_deg = frame.to_wgs84_deg(*corner)
    return round(lat_deg * 1e7), round(lon_deg * 1e7)


def _to_local(frame: LocalFrame, item: MissionItem) -> Corner:
    return frame.to_local_m(item.x / 1e7, item.y / 1e7)
