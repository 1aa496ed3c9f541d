"""The ground of an area, as rasters of heights know it: what is asked of it, not how it was read.

Cells stay where their raster has them. A place is found among them by a lattice of places that were transformed once,
a kilometre apart, between which rows and columns are straight to a few hundredths of a metre.
"""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

from missions.geo import BoolArray, FloatArray, IndexArray, LocalFrame

Heights = npt.NDArray[np.float32]
EDGE = 0.5
"""A raster knows the ground to the outer edges of its cells: half a cell beyond their middles."""
AT_ONCE = 1_000_000
"""Places that are looked up together: some 100 MB."""


def interpolate_nodes(values: FloatArray, at: FloatArray) -> FloatArray:
    """Return (m, ...) what (easts, norths, ...) nodes have at (m, 2) places, counted in nodes; beyond, straight on."""
    node = np.clip(np.floor(at).astype(np.intp), 0, np.array(values.shape[:2]) - 2)
    share_e, share_n = (at - node).T.reshape(2, -1, *(1 for _ in values.shape[2:]))
    e, n = node.T
    south = values[e, n] + share_e * (values[e + 1, n] - values[e, n])
    north = values[e, n + 1] + share_e * (values[e + 1, n + 1] - values[e, n + 1])
    return np.asarray(south + share_n * (north - south), dtype=np.float64)


@dataclass(frozen=True, slots=True, eq=False)
class Tile:
    """Cells of one raster."""

    heights_m: Heights
    """(rows, columns) above mean sea level at the middles of the cells; not a number where nobody knows."""
    highest_m: Heights
    """The same array, or where cells were combined the highest of each."""
    low_m: tuple[float, float]
    """East and north of the lattice's first node."""
    step_m: float
    """Between nodes of the lattice."""
    lattice: FloatArray
    """(easts, norths, 2) float64: row and column at its nodes; whole numbers are the middles of cells."""
    cell_m: float
    """How large a cell is over the ground."""

    def to_rows_columns(self, places_m: FloatArray) -> FloatArray:
        """Return (m, 2) rows and columns of (m, 2) places."""
        return interpolate_nodes(self.lattice, (places_m - np.array(self.low_m)) / self.step_m)

    def find_cells_around(self, places_m: FloatArray) -> tuple[IndexArray, IndexArray, FloatArray]:
        """Return (m, 4) rows and columns of the cells around places, and (m, 4) their shares in what lies between.

        Where a place is outside of the raster the shares are not numbers.
        """
        at = self.to_rows_columns(places_m)
        most = np.array(self.heights_m.shape) - 1
        outside = ((at < -EDGE) | (at > most + EDGE)).any(axis=1)
        first = np.clip(np.floor(np.nan_to_num(at)).astype(np.intp), 0, np.maximum(most - 1, 0))
        share = np.clip(at - first, 0.0, 1.0)
        share[outside] = np.nan
        second = np.minimum(first + 1, most)
        rows = np.stack((first[:, 0], first[:, 0], second[:, 0], second[:, 0]), axis=1)
        columns = np.stack((first[:, 1], second[:, 1], first[:, 1], second[:, 1]), axis=1)
        down, right = share.T
        shares = np.stack(((1 - down) * (1 - right), (1 - down) * right, down * (1 - right), down * right), axis=1)
        return rows, columns, shares

    def reduce_around(self, cells_m: Heights, places_m: FloatArray, best: np.ufunc) -> FloatArray:
        """Return (m,) the best of the cells around places; not a number where a place is outside of the raster."""
        rows, columns, shares = self.find_cells_around(places_m)
        found_m = best.reduce(cells_m[rows, columns], axis=1).astype(np.float64)
        return np.where(np.isnan(shares[:, 0]), np.nan, found_m)

    def is_near_edge(self, places_m: FloatArray) -> BoolArray:
        """Return (m,) which places have the raster's edge within a cell: the next raster knows what is beyond."""
        at = self.to_rows_columns(places_m)
        return np.asarray(((at < 1.0) | (at > np.array(self.heights_m.shape) - 2.0)).any(axis=1))


@dataclass(frozen=True, slots=True, eq=False)
class Elevation:
    """Heights above mean sea level over an area, in the local metres of a frame."""

    frame: LocalFrame
    """Whose east and north places are given in."""
    tiles: tuple[Tile, ...]
    """Those of the smallest cells first: what they do not know, the next may."""
    source: str
    """The files, for messages."""
    vertical: str
    """What the rasters' heights were counted from, for messages."""
    uncertainty_m: float
    """Nine of ten heights are nearer than this to the truth."""
    remarks: tuple[str, ...] = ()
    """What was found when it was read, in words."""
    digest: str = field(init=False, repr=False)
    """Of all cells: two of the same digest are the same ground."""

    def __post_init__(self) -> None:
        """Take the digest."""
        whole = hashlib.sha256(f"{self.frame.lat_deg} {self.frame.lon_deg} {self.uncertainty_m}".encode())
        for tile in self.tiles:
            for part in (tile.heights_m, tile.highest_m, tile.lattice):
                whole.update(np.ascontiguousarray(part).data)
        object.__setattr__(self, "digest", whole.hexdigest()[:16])

    @property
    def cell_m(self) -> float:
        """The size of the smallest cells."""
        return self.tiles[0].cell_m

    def interpolate_m(self, places_m: FloatArray) -> FloatArray:
        """Return (m,) the ground's heights at (m, 2) places, between the cells; not a number where nobody knows."""

        def between(tile: Tile, places_m: FloatArray) -> FloatArray:
            rows, columns, shares = tile.find_cells_around(places_m)
            return np.asarray((tile.heights_m[rows, columns] * shares).sum(axis=1), dtype=np.float64)

        return self._look_up(places_m, between, lambda known, other: np.where(np.isnan(known), other, known))

    def highest_m(self, places_m: FloatArray) -> FloatArray:
        """Return (m,) heights that the ground at (m, 2) places is not above: of the highest of the cells around."""
        return self._look_up(places_m, lambda tile, at_m: tile.reduce_around(tile.highest_m, at_m, np.maximum), np.fmax)

    def lowest_m(self, places_m: FloatArray) -> FloatArray:
        """Return (m,) heights that the ground at (m, 2) places is not below: of the lowest of the cells around."""
        return self._look_up(places_m, lambda tile, at_m: tile.reduce_around(tile.heights_m, at_m, np.minimum), np.fmin)

    def grid_m(self, easts_m: FloatArray, norths_m: FloatArray) -> FloatArray:
        """Return (norths, easts) heights between the cells on a regular grid, for who draws it."""
        rows = [
            self.interpolate_m(np.column_stack((easts_m, np.full(len(easts_m), north)))) for north in norths_m.tolist()
        ]
        return np.array(rows, dtype=np.float64).reshape(len(norths_m), len(easts_m))

    def _look_up(
        self,
        places_m: FloatArray,
        look: Callable[[Tile, FloatArray], FloatArray],
        joined: Callable[[FloatArray, FloatArray], FloatArray],
    ) -> FloatArray:
        parts = [
            self._look_up_part(places_m[first : first + AT_ONCE], look, joined)
            for first in range(0, len(places_m), AT_ONCE)
        ]
        return np.concatenate(parts) if parts else np.zeros(0)

    def _look_up_part(
        self,
        places_m: FloatArray,
        look: Callable[[Tile, FloatArray], FloatArray],
        joined: Callable[[FloatArray, FloatArray], FloatArray],
    ) -> FloatArray:
        found = np.full(len(places_m), np.nan)
        wanted = np.arange(len(places_m))
        for tile in self.tiles:
            found[wanted] = joined(found[wanted], look(tile, places_m[wanted]))
            # At a seam the cells around a place are of two rasters.
            wanted = wanted[np.isnan(found[wanted]) | tile.is_near_edge(places_m[wanted])]
            if not len(wanted):
                break
        return found


def find_bounds(places_m: FloatArray, margin_m: float) -> tuple[tuple[float, float], tuple[float, float]]:
    """Return the south-western and north-eastern corners of a box around (m, 2) places."""
    low, high = places_m.min(axis=0) - margin_m, places_m.max(axis=0) + margin_m
    return (float(low[0]), float(low[1])), (float(high[0]), float(high[1]))


def sort_tiles(tiles: Sequence[Tile]) -> tuple[Tile, ...]:
    """Return tiles as an elevation has them."""
    return tuple(sorted(tiles, key=lambda tile: tile.cell_m))
