"""Ways that rise and fall with the common surface, priced as they are flown.

Over hills a transit is no straight leg: over a ridge it costs its climb. The surface is asked on a grid, which plan
files keep, at a few places along each way.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from missions.geo import FloatArray, IntArray
from missions.grids import Grid
from missions.surface import Surface

STEP_M = 20.0
"""Between the nodes of the grid; more in large areas."""
MOST_NODES = 10_000
UNEVEN_M = 3.0
"""A way that is nowhere farther than this from its straight one is priced as that."""
PIECE_M = 60.0
"""About as long as legs over uneven ground are."""
PIECES = (3, 6, 12, 24)
"""In how many pieces ways are looked at, by their length."""
FEW_PIECES = 6
MANY_WAYS = 400_000
"""More ways than these at once are looked at in few pieces."""
AT_ONCE = 50_000


@dataclass(frozen=True, slots=True, eq=False)
class Relief:
    """The height of the lowest layer over every place, as flights are priced by it."""

    grid: Grid

    def find_uneven(self, from_m: FloatArray, to_m: FloatArray, pieces: int) -> IntArray:
        """Return (k,) which of (n, 3) straight ways are not flown straight."""
        found = []
        for first in range(0, len(from_m), AT_ONCE):
            part = slice(first, first + AT_ONCE)
            begins_m, ends_m = from_m[part], to_m[part]
            ways_m = self.follow_surface(np.stack((begins_m, ends_m), axis=1), pieces)
            share = np.linspace(0.0, 1.0, pieces + 1)
            straight_m = begins_m[:, 2:] + share * (ends_m[:, 2:] - begins_m[:, 2:])
            found.append(first + np.flatnonzero(np.abs(ways_m[..., 2] - straight_m).max(axis=1) > UNEVEN_M))
        return np.concatenate(found) if found else np.zeros(0, dtype=np.int64)

    def follow_surface(self, ways_m: FloatArray, pieces: int) -> FloatArray:
        """Return (k, (w - 1) * pieces + 1, 3) ways through (k, w, 3) places that follow the surface between them."""
        share = (np.arange(pieces) / pieces)[:, np.newaxis]
        begins_m, ends_m = ways_m[:, :-1, np.newaxis], ways_m[:, 1:, np.newaxis]
        inner_m = (begins_m + share * (ends_m - begins_m)).reshape(len(ways_m), -1, 3)
        whole_m = np.concatenate((inner_m, ways_m[:, -1:]), axis=1)
        up_m = self.grid.interpolate_m(whole_m[..., :2].reshape(-1, 2)).reshape(whole_m.shape[:2])
        # Between the nodes the grid is a little off: by as much as at the ends, which are known.
        off_first_m, off_last_m = (ways_m[:, end, 2:] - up_m[:, end, np.newaxis] for end in (0, -1))
        along = np.linspace(0.0, 1.0, whole_m.shape[1])
        return np.concatenate(
            (whole_m[..., :2], (up_m + off_first_m + along * (off_last_m - off_first_m))[..., np.newaxis]), axis=2
        )


def build_relief(surface: Surface, low_m: FloatArray, high_m: FloatArray) -> Relief:
    """Return a surface on a grid between two (2,) corners."""
    step_m = max(STEP_M, math.sqrt(float((high_m - low_m).prod()) / MOST_NODES))
    counts = np.ceil((high_m - low_m) / step_m).astype(int) + 1
    grid = Grid((float(low_m[0]), float(low_m[1])), step_m, np.zeros(tuple(counts)))
    heights_m = surface.interpolate_m(grid.places_m.reshape(-1, 2)).reshape(tuple(counts))
    # As a plan file has it: what is read gives back the same figures.
    return Relief(Grid(grid.low_m, step_m, np.asarray(np.round(heights_m, 1), dtype=np.float64)))


def price_uneven_ways(
    relief: Relief, from_m: FloatArray, to_m: FloatArray, straight: tuple[FloatArray, FloatArray],
    along: Callable[[IntArray, FloatArray], tuple[FloatArray, FloatArray]],
) -> tuple[FloatArray, FloatArray]:  # fmt: skip
    """Return seconds and energies of ways of which some follow the surface; arguments as of `detours.price_detours`."""
    shape = straight[0].shape
    flat_from, flat_to = (np.broadcast_to(places, (*shape, 3)).reshape(-1, 3) for places in (from_m, to_m))
    seconds, pct = straight[0].flatten(), straight[1].flatten()
    most = PIECES[-1] if len(flat_from) <= MANY_WAYS else FEW_PIECES
    lengths_m = np.hypot(*(flat_to[:, :2] - flat_from[:, :2]).T)
    shortest_m = 0.0
    for pieces in PIECES:
        longest_m = PIECE_M * pieces if pieces < most else math.inf
        own = np.flatnonzero((lengths_m > shortest_m) & (lengths_m <= longest_m))
        which = own[relief.find_uneven(flat_from[own], flat_to[own], pieces)]
        for first in range(0, len(which), AT_ONCE):
            part = which[first : first + AT_ONCE]
            ways_m = relief.follow_surface(np.stack((flat_from[part], flat_to[part]), axis=1), pieces)
            seconds[part], pct[part] = along(part, ways_m)
        if pieces == most:
            break
        shortest_m = longest_m
    return seconds.reshape(shape), pct.reshape(shape)
