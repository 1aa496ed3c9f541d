"""Pads for take-off and landing, and routes around the air columns above them."""

from __future__ import annotations

import heapq
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType

import numpy as np

from missions.errors import SafetyError
from missions.geo import FloatArray
from missions.geometry import distances_between_m, place_distances_m
from missions.no_fly_areas import Area, AreaKind
from missions.shortest_ways import VisibilityGraph, build_obstacle, build_visibility_graph

COLUMN_MARGIN_M = 2.0
"""Added to the layer height for a column's radius: GPS error and corner cutting of both vehicles."""
SEARCH_RADIUS_M = 300.0
"""Greatest distance of a pad from the depot."""
MATRIX_ENTRIES = 1_000_000
PAD_SPACING_M = 12.0

_CORNERS = 12
# Corners lie outside the circle so that the sides stay 1 % clear of it.
_CORNER_RADIUS = 1.01 / math.cos(math.pi / _CORNERS)
# Wide enough for a path between any two columns: twice the corners' radius is 2.09.
_SPACING_IN_RADII = 2.2


@dataclass(frozen=True, slots=True)
class Pad:
    """One vehicle's launch and landing place."""

    vehicle: str
    east_m: float
    north_m: float
    alt_m: float
    """Altitude above mean sea level of the vehicle's home, to which its mission's heights are relative."""


def column_radius_m(layer_m: float) -> float:
    """Return the distance that other vehicles keep from the vertical above a pad."""
    return layer_m + COLUMN_MARGIN_M


def place_pads(
    vehicles: Sequence[str],
    tracks_m: FloatArray,
    *,
    layer_m: float,
    alt_m: float,
    pad_spacing_m: float = PAD_SPACING_M,
    stated: Sequence[Pad] = (),
    areas: Sequence[Area] = (),
    bases: Mapping[str, Pad] = MappingProxyType({}),
) -> tuple[Pad, ...]:
    """Choose a pad for each vehicle around its base, as far from every inspection track as possible.

    Pads are at least ``pad_spacing_m`` apart, and far enough for a path between the columns above them; no inspection
    track crosses a column. They lie in the smallest circle about the base that has room.

    Args:
        vehicles: Names in the fleet's order.
        tracks_m: (n, 2, 2) float64, both ends of every inspection leg.
        layer_m: Minimum distance between any two vehicles.
        alt_m: The ground's height above mean sea level, at the depot.
        pad_spacing_m: Minimum distance between two pads.
        stated: Fixed pads of some vehicles; the others keep their distance from these.
        areas: Areas without pads.
        bases: By vehicle name: the base of each vehicle that does not stand at the depot.

    Raises:
        SafetyError: there is no room for all pads of a base within ``SEARCH_RADIUS_M`` of it.
    """
    radius_m = column_radius_m(layer_m)
    spacing_m = max(pad_spacing_m, _SPACING_IN_RADII * radius_m)
    named = {pad.vehicle: pad for pad in stated}
    closed = build_visibility_graph(
        tuple(build_obstacle(area) for area in areas if area.kind is not AreaKind.HEIGHT_LIMIT)
    )
    stands: dict[tuple[float, float, float], list[str]] = {}
    for name in vehicles:
        base = bases.get(name, Pad(name, 0.0, 0.0, alt_m))
        stands.setdefault((base.east_m, base.north_m, base.alt_m), []).append(name)
    for (east_m, north_m, base_alt_m), own in stands.items():
        centre_m, others = np.array([east_m, north_m]), [name for name in own if name not in named]
        reach_m = min(SEARCH_RADIUS_M, spacing_m * (1.0 + math.sqrt(len(own))))
        while True:
            taken = [np.array([pad.east_m, pad.north_m]) for pad in named.values()]
            chosen = _choose_places(tracks_m, radius_m, spacing_m, reach_m, len(others), taken, closed, centre_m)
            if len(chosen) == len(others):
                break
            if reach_m >= SEARCH_RADIUS_M:
                raise SafetyError(
                    f"pads: expected room for {len(others)} pads {spacing_m:.1f} m apart and {radius_m:.1f} m clear of "
                    f"every line within {SEARCH_RADIUS_M:g} m of the {'base' if centre_m.any() else 'depot'}, found "
                    f"{len(chosen)}"
                )
            reach_m = min(SEARCH_RADIUS_M, 1.5 * reach_m)
        for name, (east, north) in zip(others, chosen, strict=True):
            named[name] = Pad(name, float(east), float(north), base_alt_m)
    return tuple(named[name] for name in vehicles)


def way_around_m(start_m: FloatArray, goal_m: FloatArray, centres_m: FloatArray, radius_m: float) -> FloatArray:
    """Return (w, 2) corners of a shortest path between two (2,) places that keeps ``radius_m`` from all centres.

    Centres nearer than that to the start or to the goal are ignored: they cannot be avoided. If the circles leave no
    path at all, which pads placed here never cause, the result is the straight path.

    Args:
        start_m: (2,) east and north.
        goal_m: (2,) east and north.
        centres_m: (c, 2) east and north.
        radius_m: Radius of the circles.
    """
    near_m = distances_between_m(centres_m, np.stack((start_m, goal_m))).min(axis=1)
    centres_m = centres_m[near_m >= radius_m]
    way_m = np.zeros((0, 2))
    met = np.zeros(len(centres_m), dtype=np.bool_)
    while True:
        # A shortest path around some circles that stays clear of all is a shortest path around all: most are never met.
        nodes = np.concatenate((start_m[np.newaxis], way_m, goal_m[np.newaxis]))
        legs_m = np.stack((nodes[:-1], nodes[1:]), axis=1)
        hit = (place_distances_m(legs_m, centres_m) < radius_m - 1e-9).any(axis=1) & ~met
        if not hit.any():
            return way_m
        met |= hit
        way_m = _way_m(start_m, goal_m, centres_m[met], radius_m)


def _way_m(start_m: FloatArray, goal_m: FloatArray, centres_m: FloatArray, radius_m: float) -> FloatArray:
    """Return (w, 2) corners of a shortest path around all of some circles; empty where there is no path."""
    angles = np.arange(_CORNERS) * (2.0 * math.pi / _CORNERS)
    ring = _CORNER_RADIUS * radius_m * np.column_stack((np.cos(angles), np.sin(angles)))
    corners = (centres_m[:, np.newaxis] + ring).reshape(-1, 2)
    outside = distances_between_m(corners, centres_m).min(axis=1) >= radius_m
    nodes = np.concatenate((start_m[np.newaxis], corners[outside], goal_m[np.newaxis]))
    return nodes[_find_shortest_way(nodes, centres_m, radius_m)]


def _choose_places(
    tracks_m: FloatArray, radius_m: float, spacing_m: float, reach_m: float, count: int, taken: Sequence[FloatArray],
    closed: VisibilityGraph, centre_m: FloatArray,
) -> list[FloatArray]:  # fmt: skip
    steps = math.ceil(4.0 * reach_m / spacing_m)
    axis = np.arange(-steps, steps + 1) * (spacing_m / 4.0)
    places = np.stack(np.meshgrid(axis, axis), axis=-1).reshape(-1, 2)
    distance_m = np.hypot(places[:, 0], places[:, 1])
    places = places + centre_m
    # In parts: for 254 vehicles and 5,000 segments all distances at once are gigabytes.
    parts = np.array_split(places, math.ceil(len(places) * len(tracks_m) / MATRIX_ENTRIES))
    clear_m = np.concatenate([place_distances_m(tracks_m, part).min(axis=1) for part in parts])
    allowed = (distance_m <= reach_m) & (clear_m >= radius_m) & ~closed.is_inside(places)
    places, clear_m, distance_m = places[allowed], clear_m[allowed], distance_m[allowed]
    chosen: list[FloatArray] = []
    # Of two equally clear places, prefer the one nearer to the depot; a metre of clearance is worth ten of distance.
    for index in np.argsort(0.1 * distance_m - clear_m, kind="stable"):
        if len(chosen) == count:
            break
        if all(math.hypot(*(places[index] - other)) >= spacing_m - 1e-9 for other in (*taken, *chosen)):
            chosen.append(places[index])
    return chosen


def _find_shortest_way(nodes: FloatArray, centres_m: FloatArray, radius_m: float) -> list[int]:
    """Return the inner nodes of a shortest path from the first to the last node (A*, visibility only where needed)."""
    goal = len(nodes) - 1
    to_goal_m = distances_between_m(nodes, nodes[[goal]])[:, 0]
    length_m = np.full(len(nodes), math.inf)
    before = np.full(len(nodes), -1)
    done = np.zeros(len(nodes), dtype=np.bool_)
    length_m[0] = 0.0
    queue = [(float(to_goal_m[0]), 0)]
    while queue:
        _, node = heapq.heappop(queue)
        if node == goal:
            break
        if done[node]:
            continue
        done[node] = True
        reach_m = length_m[node] + distances_between_m(nodes, nodes[[node]])[:, 0]
        nearer = np.flatnonzero(reach_m < length_m - 1e-9)
        # As in `way_around_m` for legs from one place, by squares and by component: this is the hot spot of path
        # search.
        along_e, along_n = (nodes[nearer] - nodes[node]).T
        off_e, off_n = (centres_m - nodes[node]).T[..., np.newaxis]
        share = (off_e * along_e + off_n * along_n) / np.maximum(along_e**2 + along_n**2, 1e-12)
        np.clip(share, 0.0, 1.0, out=share)
        apart = (off_e - share * along_e) ** 2 + (off_n - share * along_n) ** 2
        seen = nearer[~(apart < (radius_m - 1e-9) ** 2).any(axis=0)]
        length_m[seen], before[seen] = reach_m[seen], node
        for other in seen.tolist():
            heapq.heappush(queue, (float(reach_m[other] + to_goal_m[other]), other))
    way: list[int] = []
    node = int(before[goal])
    while node > 0:
        way.append(node)
        node = int(before[node])
    return way[::-1]
