"""Compute distances between places and straight legs, and between legs.

Arrays hold metres: places (m, d), legs (n, 2, d) from begin to end, with d = 2 for horizontal or d = 3 for spatial
distances. A leg without length is a place.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence

import numpy as np

from missions.geo import BoolArray, FloatArray, IndexArray

SHORTEST_M2 = 1e-12
"""Squared length below which a leg is a place."""
MOST_PAIRS = 300_000
"""Pairs computed at once: fast, with little memory."""


def find_nearest_on_legs(
    places_m: FloatArray, begins_m: FloatArray, along_m: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return (m, n) distances of places from legs, and the nearest position on each leg as a share from 0 to 1.

    Args:
        places_m: (m, d).
        begins_m: (n, d), where the legs begin.
        along_m: (n, d), vectors from there to their ends.
    """
    return find_nearest_along(places_m[:, np.newaxis] - begins_m, along_m)


def find_nearest_along(offsets_m: FloatArray, along_m: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return distances of places from legs, and the nearest position on each leg as a share from 0 to 1.

    Args:
        offsets_m: (..., d) vectors from the legs' begins to the places.
        along_m: (..., d) vectors from there to the legs' ends.
    """
    square = np.maximum((along_m**2).sum(axis=-1), SHORTEST_M2)
    share = np.clip((offsets_m * along_m).sum(axis=-1) / square, 0.0, 1.0)
    apart = offsets_m - share[..., np.newaxis] * along_m
    if apart.shape[-1] == 2:
        return np.hypot(apart[..., 0], apart[..., 1]), share
    return np.sqrt((apart**2).sum(axis=-1)), share


def pair_with_ranges(firsts: IndexArray, lasts: IndexArray) -> Iterator[tuple[IndexArray, IndexArray]]:
    """Yield each row's number paired with every index of its range in order, `MOST_PAIRS` or a row at a time.

    Args:
        firsts: (n,) first index of each row's range.
        lasts: (n,) end of each range, exclusive.
    """
    counts = np.maximum(lasts - firsts, 0)
    ends = np.cumsum(counts)
    begin = 0
    while begin < len(counts):
        before = ends[begin] - counts[begin]
        end = max(begin + 1, int(np.searchsorted(ends, before + MOST_PAIRS, side="right")))
        own = counts[begin:end]
        shifts = firsts[begin:end] - (np.cumsum(own) - own)
        yield np.repeat(np.arange(begin, end), own), np.arange(int(own.sum())) + np.repeat(shifts, own)
        begin = end


def distances_between_m(places_m: FloatArray, others_m: FloatArray) -> FloatArray:
    """Return (m, n) float64 distances of (m, 2) places from (n, 2) others."""
    off_m = places_m[:, np.newaxis] - others_m
    return np.asarray(np.hypot(off_m[..., 0], off_m[..., 1]))


def place_distances_m(legs_m: FloatArray, places_m: FloatArray) -> FloatArray:
    """Return (m, n) float64 distances of (m, d) places from (n, 2, d) legs."""
    return find_nearest_on_legs(places_m, legs_m[:, 0], legs_m[:, 1] - legs_m[:, 0])[0]


def sample_leg(leg_m: FloatArray, step_m: float) -> FloatArray:
    """Return (m, d) places on a (2, d) leg, its ends included, at most a step apart."""
    steps = max(1, math.ceil(float(np.linalg.norm(leg_m[1] - leg_m[0])) / step_m))
    share = np.linspace(0.0, 1.0, steps + 1)[:, np.newaxis]
    return np.asarray(leg_m[0] + share * (leg_m[1] - leg_m[0]), dtype=np.float64)


def distances_from_chord_m(places_m: FloatArray) -> FloatArray:
    """Return (m - 2,) distances of the inner of (m, d) places from the leg between the first and the last."""
    return place_distances_m(places_m[np.newaxis, [0, -1]], places_m[1:-1])[:, 0]


def find_bends(
    places_m: FloatArray, within_m: float, measure: Callable[[FloatArray], FloatArray] = distances_from_chord_m
) -> list[int]:
    """Return the indices of the inner places at which a drawn line bends by more than a distance.

    Args:
        places_m: (m, ...) along the line.
        within_m: The distance.
        measure: Returns the distances of the inner places of a part from the straight line between its ends.
    """
    kept: list[int] = []
    open_: list[tuple[int, int]] = [(0, len(places_m) - 1)]
    while open_:
        first, last = open_.pop()
        if last - first < 2:
            continue
        away_m = measure(places_m[first : last + 1])
        farthest = int(away_m.argmax())
        if away_m[farthest] > within_m:
            kept.append(first + 1 + farthest)
            open_ += [(first, first + 1 + farthest), (first + 1 + farthest, last)]
    return sorted(kept)


def leg_distances_m(legs_a: FloatArray, legs_b: FloatArray) -> FloatArray:
    """Return (m, n) float64 least distances between (m, 2, d) and (n, 2, d) legs.

    The minimum is at an end of one of the legs, or where the common perpendicular meets both inside.
    """
    shape = len(legs_a), len(legs_b), legs_a.shape[2]
    candidates = [
        place_distances_m(legs_b, legs_a[:, 0]), place_distances_m(legs_b, legs_a[:, 1]),
        place_distances_m(legs_a, legs_b[:, 0]).T, place_distances_m(legs_a, legs_b[:, 1]).T,
    ]  # fmt: skip
    along_a = np.broadcast_to((legs_a[:, 1] - legs_a[:, 0])[:, np.newaxis], shape)
    along_b = np.broadcast_to((legs_b[:, 1] - legs_b[:, 0])[np.newaxis], shape)
    offset = legs_a[:, 0][:, np.newaxis] - legs_b[:, 0][np.newaxis]
    aa, bb, ab = ((u * v).sum(axis=2) for u, v in ((along_a, along_a), (along_b, along_b), (along_a, along_b)))
    ao, bo = (along_a * offset).sum(axis=2), (along_b * offset).sum(axis=2)
    determinant = aa * bb - ab * ab
    # Parallel legs have no single perpendicular: their ends decide.
    crossing = determinant > 1e-9 * aa * bb
    safe = np.where(crossing, determinant, 1.0)
    share_a, share_b = (ab * bo - bb * ao) / safe, (aa * bo - ab * ao) / safe
    inside = crossing & (share_a > 0) & (share_a < 1) & (share_b > 0) & (share_b < 1)
    apart = offset + share_a[..., np.newaxis] * along_a - share_b[..., np.newaxis] * along_b
    candidates.append(np.where(inside, np.sqrt((apart**2).sum(axis=2)), math.inf))
    return np.asarray(np.min(candidates, axis=0), dtype=np.float64)


def find_crossings(ends_m: FloatArray, nodes: IndexArray) -> Iterator[tuple[int, int, tuple[float, float]]]:
    """Yield pairs of (n, 2, 2) legs that cross between their ends, and where; nodes (n, 2) identify shared ends."""
    if not len(ends_m):
        return
    lows, highs, along = ends_m.min(axis=1), ends_m.max(axis=1), ends_m[:, 1] - ends_m[:, 0]
    axis = int(np.argmax(np.ptp(ends_m.reshape(-1, 2), axis=0)))
    order = np.argsort(lows[:, axis], kind="stable")
    last = np.searchsorted(lows[order, axis], highs[order, axis], side="right")
    for rows, places in pair_with_ranges(np.arange(1, len(order) + 1), last):
        one, rest = order[rows], order[places]
        meets = ((lows[rest] <= highs[one]) & (highs[rest] >= lows[one])).all(axis=1)
        one, rest = one[meets], rest[meets]
        apart = (nodes[one][:, :, np.newaxis] != nodes[rest][:, np.newaxis]).all(axis=(1, 2))
        one, rest = one[apart], rest[apart]
        from_m, way_m, ways_m = ends_m[rest, 0] - ends_m[one, 0], along[one], along[rest]
        turned = way_m[:, 0] * ways_m[:, 1] - way_m[:, 1] * ways_m[:, 0]
        with np.errstate(divide="ignore", invalid="ignore"):
            mine = (from_m[:, 0] * ways_m[:, 1] - from_m[:, 1] * ways_m[:, 0]) / turned
            theirs = (from_m[:, 0] * way_m[:, 1] - from_m[:, 1] * way_m[:, 0]) / turned
        for number in np.flatnonzero((mine > 0) & (mine < 1) & (theirs > 0) & (theirs < 1)):
            east_m, north_m = (ends_m[one[number], 0] + mine[number] * way_m[number]).tolist()
            first, second = sorted((int(one[number]), int(rest[number])))
            yield first, second, (east_m, north_m)


def wall_distances_m(bottoms_m: FloatArray, heights_m: FloatArray, legs_m: FloatArray) -> FloatArray:
    """Return (m, n) float64 least distances between m walls and (n, 2, 3) legs.

    The minimum is at an edge of the wall, at an end of the leg in front of the wall's face, or the leg crosses the
    face.

    Args:
        bottoms_m: (m, 2, 3), the walls' bottom edges.
        heights_m: (m,), their heights above that; a wall without height or length is a leg.
        legs_m: (n, 2, 3).
    """
    tops_m = bottoms_m + np.array([0.0, 0.0, 1.0]) * heights_m[:, np.newaxis, np.newaxis]
    sides_m = [np.stack((bottoms_m[:, end], tops_m[:, end]), axis=1) for end in (0, 1)]
    least_m = np.min([leg_distances_m(edges_m, legs_m) for edges_m in (bottoms_m, tops_m, *sides_m)], axis=0)
    along_m = bottoms_m[:, 1, :2] - bottoms_m[:, 0, :2]
    squares = np.maximum((along_m**2).sum(axis=1), SHORTEST_M2)[:, np.newaxis]
    lengths_m = np.sqrt(squares)
    rise_m = (bottoms_m[:, 1, 2] - bottoms_m[:, 0, 2])[:, np.newaxis]

    def beside(places_m: FloatArray) -> tuple[FloatArray, BoolArray]:
        """Return (m, n) offsets of (m, n, 3) places to the left of the walls' faces, and whether they face them."""
        off_m = places_m - bottoms_m[:, np.newaxis, 0]
        share = (off_m[..., :2] * along_m[:, np.newaxis]).sum(axis=2) / squares
        left_m = (off_m[..., 1] * along_m[:, :1] - off_m[..., 0] * along_m[:, 1:]) / lengths_m
        over_m = off_m[..., 2] - share * rise_m
        within = (share >= 0) & (share <= 1) & (over_m >= 0) & (over_m <= heights_m[:, np.newaxis])
        return left_m, within & (squares > SHORTEST_M2)

    ends_m = [np.broadcast_to(legs_m[:, end], (len(bottoms_m), len(legs_m), 3)) for end in (0, 1)]
    (begin_m, begins), (end_m, ends) = (beside(places_m) for places_m in ends_m)
    for left_m, within in ((begin_m, begins), (end_m, ends)):
        least_m = np.where(within, np.minimum(least_m, np.abs(left_m)), least_m)
    through = begin_m * end_m < 0
    share = begin_m / np.where(through, begin_m - end_m, 1.0)
    _, pierced = beside(ends_m[0] + share[..., np.newaxis] * (ends_m[1] - ends_m[0]))
    return np.asarray(np.where(through & pierced, 0.0, least_m), dtype=np.float64)


def locate_on_leg(
    begin_m: tuple[float, float], end_m: tuple[float, float], place_m: tuple[float, float]
) -> tuple[float, float]:
    """Return the position of a place along a leg in metres, possibly outside it, and its distance from the leg."""
    length = math.dist(begin_m, end_m)
    if length**2 < SHORTEST_M2:
        return 0.0, math.dist(begin_m, place_m)
    east, north = (end_m[0] - begin_m[0]) / length, (end_m[1] - begin_m[1]) / length
    de, dn = place_m[0] - begin_m[0], place_m[1] - begin_m[1]
    along = de * east + dn * north
    nearest = min(max(along, 0.0), length)
    return along, math.hypot(de - nearest * east, dn - nearest * north)


def parallelogram_area_m2(a: tuple[float, float], b: tuple[float, float], c: tuple[float, float]) -> float:
    """Return twice the area of a triangle; above 0 if it turns left."""
    return (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])


def is_in_triangles(places_m: FloatArray, corners_m: FloatArray) -> BoolArray:
    """Return (m, n) whether (m, 2) places are in triangles of (n, 3, 2) corners; degenerate ones contain none."""
    sides_m = np.roll(corners_m, -1, axis=1) - corners_m
    off_m = places_m[:, np.newaxis, np.newaxis] - corners_m
    left = sides_m[..., 0] * off_m[..., 1] - sides_m[..., 1] * off_m[..., 0]
    wide = np.abs(sides_m[:, 0, 0] * sides_m[:, 1, 1] - sides_m[:, 0, 1] * sides_m[:, 1, 0]) > SHORTEST_M2
    return np.asarray(wide & ((left >= 0).all(axis=2) | (left <= 0).all(axis=2)))


def is_enclosed(places_m: FloatArray, begins_m: FloatArray, ends_m: FloatArray) -> BoolArray:
    """Return (m,) whether outlines enclose (m, 2) places, by counting their (n, 2) sides crossed by a ray to the east.

    Holes are not enclosed.
    """
    north = places_m[:, 1:]
    low, high = begins_m[:, 1] <= north, ends_m[:, 1] <= north
    rise = ends_m[:, 1] - begins_m[:, 1]
    share = (north - begins_m[:, 1]) / np.where(rise == 0, 1.0, rise)
    east = begins_m[:, 0] + share * (ends_m[:, 0] - begins_m[:, 0])
    return np.asarray(((low != high) & (east > places_m[:, :1])).sum(axis=1) % 2 == 1)


def build_convex_hull(ordered: Sequence[tuple[float, float]], least: float = 0.0) -> tuple[tuple[float, float], ...]:
    """Return the corners of the convex hull of sorted places, counter-clockwise (the monotone chain).

    A corner whose triangle with its neighbours is not larger than ``least`` is left out.
    """
    if len(ordered) < 3:
        return tuple(ordered)
    return (*_build_chain(ordered, least), *_build_chain(ordered[::-1], least))


def _build_chain(ordered: Sequence[tuple[float, float]], least: float) -> list[tuple[float, float]]:
    chain: list[tuple[float, float]] = []
    for corner in ordered:
        while len(chain) >= 2 and parallelogram_area_m2(chain[-2], chain[-1], corner) <= least:
            chain.pop()
        chain.append(corner)
    return chain[:-1]
