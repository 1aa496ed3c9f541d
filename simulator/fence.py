"""Whether a simulated vehicle is inside its fence, as both autopilots reckon it, and where its own way home ends."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from missions.items import MissionItem
from missions.items import PlaceCommand as Item
from simulator.physics import Home, Place

Corner = tuple[float, float]


@dataclass(frozen=True, slots=True)
class FenceShape:
    """A polygon, or a circle about its one corner."""

    keeps_out: bool
    corners: tuple[Corner, ...]
    radius_m: float | None

    def is_allowed(self, east_m: float, north_m: float) -> bool:
        """Return whether a vehicle may be there."""
        if self.radius_m is not None:
            return (math.dist(self.corners[0], (east_m, north_m)) <= self.radius_m) is not self.keeps_out
        return _is_within(self.corners, east_m, north_m) is not self.keeps_out


def build_fence_shapes(items: Sequence[MissionItem], home: Home) -> tuple[FenceShape, ...]:
    """Return what a fence on board means."""
    shapes, index = list[FenceShape](), 0
    while index < len(items):
        item, size = items[index], 1
        keeps_out = item.command in {Item.EXCLUSION_VERTEX, Item.EXCLUSION_CIRCLE}
        if item.command in {Item.INCLUSION_VERTEX, Item.EXCLUSION_VERTEX}:
            size = max(1, int(item.param1))
            ring = items[index : index + size]
            shapes.append(FenceShape(keeps_out, tuple(home.east_north_m(one.x, one.y) for one in ring), None))
        elif item.command in {Item.INCLUSION_CIRCLE, Item.EXCLUSION_CIRCLE}:
            shapes.append(FenceShape(keeps_out, (home.east_north_m(item.x, item.y),), item.param1))
        index += size
    return tuple(shapes)


def is_inside(shapes: Sequence[FenceShape], place: Place) -> bool:
    """Return whether a place is inside a fence."""
    return all(shape.is_allowed(place.east_m, place.north_m) for shape in shapes)


def distance_outside_m(shapes: Sequence[FenceShape], place: Place) -> float:
    """Return how far outside the polygon that it left a place is, the farthest of several; 0 inside."""
    here = (place.east_m, place.north_m)
    left = [one for one in shapes if one.radius_m is None and not one.keeps_out and not one.is_allowed(*here)]
    return max((min(_edge_distance_m(here, a, b) for a, b in _iterate_edges(one.corners)) for one in left), default=0.0)


def _iterate_edges(corners: tuple[Corner, ...]) -> Iterator[tuple[Corner, Corner]]:
    yield from zip(corners, (*corners[1:], corners[0]), strict=True)


def _edge_distance_m(here: Corner, one: Corner, other: Corner) -> float:
    along = (other[0] - one[0], other[1] - one[1])
    length = along[0] ** 2 + along[1] ** 2
    share = ((here[0] - one[0]) * along[0] + (here[1] - one[1]) * along[1]) / length if length else 0.0
    share = min(1.0, max(0.0, share))
    return math.dist(here, (one[0] + share * along[0], one[1] + share * along[1]))


def _is_within(corners: Sequence[Corner], east_m: float, north_m: float) -> bool:
    inside = False
    for (east_a, north_a), (east_b, north_b) in _iterate_edges(tuple(corners)):
        if (north_a > north_m) is not (north_b > north_m):
            inside ^= east_m < east_a + (north_m - north_a) / (north_b - north_a) * (east_b - east_a)
    return inside


def find_return_destination(
    rally: Sequence[MissionItem], home: Home, here: Place, farthest_m: float = math.inf
) -> Place:
    """Return where a return ends: over the nearest of home and the rally points that are not too far away."""
    spots = [Place(*home.east_north_m(item.x, item.y), 0.0) for item in rally]
    near = [one for one in spots if math.hypot(one.east_m - here.east_m, one.north_m - here.north_m) <= farthest_m]
    at_home = Place(0.0, 0.0, 0.0)
    return min((at_home, *near), key=lambda one: math.hypot(one.east_m - here.east_m, one.north_m - here.north_m))
