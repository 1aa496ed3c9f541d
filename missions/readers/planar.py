"""Spans and places in a plane of metres: what lies beside what, and what crosses what."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from missions.geo import FloatArray, IndexArray
from missions.geometry import find_nearest_on_legs, place_distances_m


class PlaceIndex:
    """PlaceIndex that are looked up by where they are."""

    def __init__(self, places_m: FloatArray) -> None:
        """Sort (n, 2) places along the longer side of what they cover."""
        self._axis = int(np.argmax(np.ptp(places_m, axis=0))) if len(places_m) else 0
        self._order = np.argsort(places_m[:, self._axis], kind="stable")
        self._sorted_m = places_m[self._order]

    def find_beside(
        self, a_m: FloatArray, b_m: FloatArray, within_m: float
    ) -> tuple[IndexArray, FloatArray, FloatArray]:
        """Return the places near a span: their numbers, how far along it (0 to 1), and how far from it."""
        low, high = sorted((float(a_m[self._axis]), float(b_m[self._axis])))
        first, last = np.searchsorted(self._sorted_m[:, self._axis], (low - within_m, high + within_m))
        distances_m, shares = find_nearest_on_legs(self._sorted_m[first:last], a_m[np.newaxis], (b_m - a_m)[np.newaxis])
        near = np.flatnonzero(distances_m[:, 0] <= within_m)
        return self._order[first:last][near], shares[near, 0], distances_m[near, 0]


def find_crossings(ends_m: FloatArray, nodes: IndexArray) -> Iterator[tuple[int, int, tuple[float, float]]]:
    """Yield pairs of (n, 2, 2) spans that cross between their ends, and where; nodes (n, 2) tell who shares an end."""
    if not len(ends_m):
        return
    lows, highs = ends_m.min(axis=1), ends_m.max(axis=1)
    axis = int(np.argmax(np.ptp(ends_m.reshape(-1, 2), axis=0)))
    order = np.argsort(lows[:, axis], kind="stable")
    ends_m, nodes, lows, highs = ends_m[order], nodes[order], lows[order], highs[order]
    other = 1 - axis
    last = np.searchsorted(lows[:, axis], highs[:, axis], side="right")
    for index in range(len(order)):
        rest = np.arange(index + 1, last[index])
        rest = rest[(lows[rest, other] <= highs[index, other]) & (highs[rest, other] >= lows[index, other])]
        if rest.size:
            rest = rest[~np.isin(nodes[rest], nodes[index]).any(axis=1)]
        if rest.size:
            yield from _find_crossings_of(ends_m, index, rest, order)


def _find_crossings_of(
    ends_m: FloatArray, index: int, rest: IndexArray, order: IndexArray
) -> Iterator[tuple[int, int, tuple[float, float]]]:
    a_m, way_m = ends_m[index, 0], ends_m[index, 1] - ends_m[index, 0]
    from_m, ways_m = ends_m[rest, 0] - a_m, ends_m[rest, 1] - ends_m[rest, 0]
    turned = way_m[0] * ways_m[:, 1] - way_m[1] * ways_m[:, 0]
    with np.errstate(divide="ignore", invalid="ignore"):
        mine = (from_m[:, 0] * ways_m[:, 1] - from_m[:, 1] * ways_m[:, 0]) / turned
        theirs = (from_m[:, 0] * way_m[1] - from_m[:, 1] * way_m[0]) / turned
        meet = (mine > 0) & (mine < 1) & (theirs > 0) & (theirs < 1)
    for number in np.flatnonzero(meet):
        east_m, north_m = (a_m + mine[number] * way_m).tolist()
        pair = sorted((int(order[index]), int(order[rest[number]])))
        yield pair[0], pair[1], (east_m, north_m)


def find_nearest_span(place_m: FloatArray, ends_m: FloatArray, but: Sequence[int] = ()) -> tuple[int, float]:
    """Return the nearest of (n, 2, 2) spans to a place and how far away it is; ``but`` are not looked at."""
    distances_m = place_distances_m(ends_m, place_m[np.newaxis])[0]
    distances_m[list(but)] = np.inf
    nearest = int(np.argmin(distances_m))
    return nearest, float(distances_m[nearest])
