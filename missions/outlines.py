"""Outlines made fit to be flown around: cut to what is near, with few corners, and none that cross themselves."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from missions.areas import Ring
from missions.geo import FloatArray
from missions.geometry import find_bends

SHORTEST_M = 0.01
"""Corners nearer to each other are one."""
LOOKED_UP_TO = 3000
"""Corners up to which it is looked whether an outline crosses itself: nobody draws more by hand."""
AT_ONCE = 1_000_000


def remove_double_corners(ring: Ring, *, closed: bool) -> Ring:
    """Return an outline, or a line, without corners that are where the one before is."""
    kept: list[tuple[float, float]] = []
    for corner in ring:
        if not kept or math.dist(kept[-1], corner) > SHORTEST_M:
            kept.append(corner)
    if closed and len(kept) > 1 and math.dist(kept[0], kept[-1]) <= SHORTEST_M:
        kept.pop()
    return tuple(kept)


def area_inside_m2(ring: Ring) -> float:
    """Return what an outline encloses."""
    corners = np.array(ring)
    after = np.roll(corners, -1, axis=0)
    return abs(float((corners[:, 0] * after[:, 1] - corners[:, 1] * after[:, 0]).sum())) / 2


def is_self_crossing(ring: Ring) -> bool:
    """Return whether two sides of an outline cross each other."""
    begins = np.array(ring)
    count = len(begins)
    if count > LOOKED_UP_TO:
        return False
    along = np.roll(begins, -1, axis=0) - begins
    step = max(1, AT_ONCE // count)
    for first in range(0, count, step):
        part = np.arange(first, min(first + step, count))
        off = begins - begins[part, np.newaxis]
        own, other = along[part, np.newaxis], along[np.newaxis]
        ours = own[..., 0] * off[..., 1] - own[..., 1] * off[..., 0]
        ours_end = ours + own[..., 0] * other[..., 1] - own[..., 1] * other[..., 0]
        theirs = other[..., 1] * off[..., 0] - other[..., 0] * off[..., 1]
        theirs_end = theirs + other[..., 0] * own[..., 1] - other[..., 1] * own[..., 0]
        if ((ours * ours_end < 0) & (theirs * theirs_end < 0)).any():
            return True
    return False


def clip_outline(ring: Ring, low: tuple[float, float], high: tuple[float, float]) -> Ring:
    """Return what of an outline is in a box (Sutherland, Hodgman); nothing where they do not meet."""
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
    """Return an outline, or a line, with fewer corners, nowhere farther than a tolerance from it (Douglas, Peucker)."""
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
