"""Heights on a regular grid of local metres, straight between its nodes, and the cones over and under them."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Annotated

import numpy as np
from pydantic import Field

from missions.geo import BoolArray, FloatArray
from missions.geometry import build_convex_hull
from missions.validation import Above0, Figure, Pair, array_of

DIRECTIONS = ((1, 0), (0, 1), (1, 1), (1, -1), (2, 1), (1, 2), (2, -1), (1, -2))
"""Steps from node to node, and back: a cone made of them is 2.7 % flatter than a round one at most."""


Heights = Annotated[tuple[Figure, ...], Field(min_length=2)]
"""From south to north."""


@dataclass(frozen=True, slots=True, eq=False)
class Grid:
    """Heights at nodes."""

    low_m: Pair
    """East and north of the first node."""
    step_m: Above0
    """Between nodes."""
    heights_m: Annotated[FloatArray, array_of(Annotated[tuple[Heights, ...], Field(min_length=2)])]
    """(easts, norths) float64."""

    def interpolate_m(self, places_m: FloatArray) -> FloatArray:
        """Return (m,) heights at (m, 2) places; beyond the grid those of its edge."""
        most = np.array(self.heights_m.shape) - 1
        at = np.clip((places_m - np.array(self.low_m)) / self.step_m, 0.0, most)
        node = np.minimum(at.astype(np.intp), np.maximum(most - 1, 0))
        share_e, share_n = (at - node).T
        (e, n), (last_e, last_n) = node.T, np.minimum(node + 1, most).T
        south = self.heights_m[e, n] + share_e * (self.heights_m[last_e, n] - self.heights_m[e, n])
        north = self.heights_m[e, last_n] + share_e * (self.heights_m[last_e, last_n] - self.heights_m[e, last_n])
        return np.asarray(south + share_n * (north - south), dtype=np.float64)

    @property
    def slope(self) -> float:
        """The steepest of what lies between the nodes: it is so at one of them, of one of the cells around it."""
        up_e, up_n = np.diff(self.heights_m, axis=0) ** 2, np.diff(self.heights_m, axis=1) ** 2
        corners = (up_e[:, north] + up_n[east] for north in (slice(None, -1), slice(1, None)) for east in (
            slice(None, -1), slice(1, None)))  # fmt: skip
        return math.sqrt(max((float(one.max(initial=0.0)) for one in corners), default=0.0)) / self.step_m

    @property
    def places_m(self) -> FloatArray:
        """(easts, norths, 2) float64: where its nodes are."""
        axes = (self.low_m[axis] + self.step_m * np.arange(self.heights_m.shape[axis]) for axis in (0, 1))
        return np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1)


def limit_slope_above(grid: Grid, slope: float) -> Grid:
    """Return the lowest grid that is nowhere below another, and rises and falls by no more than a slope."""
    return _apply_cones(grid, slope, np.maximum)


def limit_slope_below(grid: Grid, slope: float) -> Grid:
    """Return the highest grid that is nowhere above another, and rises and falls by no more than a slope."""
    return _apply_cones(grid, -slope, np.minimum)


def _apply_cones(grid: Grid, slope: float, better: Callable[..., FloatArray]) -> Grid:
    """Take at every node the best of what cones from all others leave there.

    Steps of 1, 2, 4 ... nodes one after another, each taken or not, make every distance along a direction.
    """
    heights_m = grid.heights_m.copy()
    finite = heights_m[np.isfinite(heights_m)]
    relief_m = float(np.ptp(finite)) if finite.size else 0.0
    reach = min(max(heights_m.shape), math.ceil(relief_m / max(abs(slope) * grid.step_m, 1e-9)))
    stride = 1
    while stride <= max(reach, 1):
        for east, north in DIRECTIONS:
            drop_m = slope * grid.step_m * stride * math.hypot(east, north)
            _apply_step(heights_m, east * stride, north * stride, drop_m, better)
        stride *= 2
    return Grid(grid.low_m, grid.step_m, heights_m)


def _apply_step(heights_m: FloatArray, east: int, north: int, drop_m: float, better: Callable[..., FloatArray]) -> None:
    here_e, there_e = _shift_slices(heights_m.shape[0], east)
    here_n, there_n = _shift_slices(heights_m.shape[1], north)
    here, there = heights_m[here_e, here_n], heights_m[there_e, there_n]
    if not here.size:
        return
    ahead = here - drop_m
    better(here, there - drop_m, out=here)
    better(there, ahead, out=there)


def _shift_slices(count: int, by: int) -> tuple[slice, slice]:
    """Return where steps of ``by`` begin and where they end along an axis."""
    if by >= 0:
        return slice(0, max(count - by, 0)), slice(by, None)
    return slice(-by, None), slice(0, max(count + by, 0))


def hull_m(places_m: FloatArray) -> FloatArray:
    """Return (k, 2) the corners of the convex hull of (m, 2) places, counter-clockwise."""
    return np.array(build_convex_hull(sorted(set(map(tuple, places_m.tolist())))), dtype=np.float64)


def is_inside_convex(corners_m: FloatArray, places_m: FloatArray, beyond_m: float = 0.0) -> BoolArray:
    """Return (m,) which of (m, 2) places are in a convex polygon, or no farther than so from each of its sides."""
    found = np.ones(len(places_m), dtype=np.bool_)
    for corner, following in zip(corners_m, np.roll(corners_m, -1, axis=0), strict=True):
        along = following - corner
        out_m = (along[1] * (places_m[:, 0] - corner[0]) - along[0] * (places_m[:, 1] - corner[1])) / math.hypot(*along)
        found &= out_m <= beyond_m
    return found
