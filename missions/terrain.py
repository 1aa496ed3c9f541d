"""Compute the heights that the ground requires of flights between the lines, and where the ground is known.

Legs are straight, so all of them lie in the convex hull of the inspected segments and the pads. The ground must be
known everywhere in it, or no flight takes place. The flight floor is the lowest function above ground plus margin whose
slope stays within a bound; the flight roof keeps flights below the ceiling where the ground falls away.

This module does not read rasters. Cells keep their original positions. A place is located among them by a lattice of
places transformed once, a kilometre apart; between them rows and columns are linear to a few hundredths of a metre.
"""

from __future__ import annotations

import hashlib
import math
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field, replace
from typing import Annotated

import numpy as np
import numpy.typing as npt
from numpy.lib.stride_tricks import sliding_window_view
from pydantic import Field

from missions.errors import ElevationError
from missions.geo import BoolArray, FloatArray, IndexArray, LocalFrame
from missions.geometry import build_convex_hull
from missions.network import Network
from missions.validation import Above0, Figure, Pair, array_of

AROUND_M = 60.0
"""Margin around the hull: paths lead around pads, and legs end a few metres off their lines."""
DETOUR_M = 1000.0
"""Greatest distance outside the hull of a path around an area."""
PADS_M = 200.0
"""Greatest distance of vehicles from the depot, or their base; pads are unknown until the vehicles report them."""
NODES_M = 10.0
"""Spacing of the floor's nodes; larger in large areas."""
MOST_NODES = 1_000_000
UNKNOWN_M = -1e5
"""Ground height beyond the area: sets no constraint."""
ROW_PLACES = 400_000
DIRECTIONS = ((1, 0), (0, 1), (1, 1), (1, -1), (2, 1), (1, 2), (2, -1), (1, -2))
"""Steps between nodes, in both directions: a cone made of them is at most 2.7 % flatter than a round one."""
NodeRow = Annotated[tuple[Figure, ...], Field(min_length=2)]
"""From south to north."""
Heights = npt.NDArray[np.float32]
EDGE = 0.5
"""In cells: a raster covers the ground to the outer edges of its cells, half a cell beyond their centres."""
AT_ONCE = 1_000_000
"""Places looked up together: some 100 MB."""


def interpolate_nodes(values: FloatArray, at: FloatArray) -> FloatArray:
    """Return (m, ...) values of (easts, norths, ...) nodes at (m, 2) places in node units; extrapolate linearly."""
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
    """(rows, columns) above mean sea level at the cell centres; NaN where unknown."""
    highest_m: Heights
    """The same array, or the highest of each group where cells were combined."""
    low_m: tuple[float, float]
    """East and north of the lattice's first node."""
    step_m: float
    """Spacing of the lattice nodes."""
    lattice: FloatArray
    """(easts, norths, 2) float64: row and column at its nodes; whole numbers are cell centres."""
    cell_m: float
    """Cell size over the ground."""

    def to_rows_columns(self, places_m: FloatArray) -> FloatArray:
        """Return (m, 2) rows and columns of (m, 2) places."""
        return interpolate_nodes(self.lattice, (places_m - np.array(self.low_m)) / self.step_m)

    def find_cells_around(self, places_m: FloatArray) -> tuple[IndexArray, IndexArray, FloatArray]:
        """Return (m, 4) rows and columns of the cells around places, and (m, 4) their interpolation weights.

        Weights are NaN where a place is outside the raster.
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
        """Return (m,) the best of the cells around places; NaN where a place is outside the raster."""
        rows, columns, shares = self.find_cells_around(places_m)
        found_m = best.reduce(cells_m[rows, columns], axis=1).astype(np.float64)
        return np.where(np.isnan(shares[:, 0]), np.nan, found_m)

    def is_near_edge(self, places_m: FloatArray) -> BoolArray:
        """Return (m,) whether places lie within a cell of the raster's edge; the next raster covers what is beyond."""
        at = self.to_rows_columns(places_m)
        return np.asarray(((at < 1.0) | (at > np.array(self.heights_m.shape) - 2.0)).any(axis=1))


@dataclass(frozen=True, slots=True, eq=False)
class Elevation:
    """Heights above mean sea level over an area, in the local metres of a frame."""

    frame: LocalFrame
    """Frame of east and north."""
    tiles: tuple[Tile, ...]
    """Smallest cells first; a tile fills the gaps of those before it."""
    source: str
    """The files, for messages."""
    vertical: str
    """Vertical reference of the rasters' heights, for messages."""
    uncertainty_m: float
    """Error that 90 % of the heights stay within."""
    remarks: tuple[str, ...] = ()
    """Findings from reading the rasters, for messages."""
    digest: str = field(init=False, repr=False)
    """Digest of all cells: equal digests mean the same ground."""

    def __post_init__(self) -> None:
        whole = hashlib.sha256(f"{self.frame.lat_deg} {self.frame.lon_deg} {self.uncertainty_m}".encode())
        for tile in self.tiles:
            for part in (tile.heights_m, tile.highest_m, tile.lattice):
                whole.update(np.ascontiguousarray(part).data)
        object.__setattr__(self, "digest", whole.hexdigest()[:16])

    @property
    def cell_m(self) -> float:
        """Size of the smallest cells."""
        return self.tiles[0].cell_m

    def interpolate_m(self, places_m: FloatArray) -> FloatArray:
        """Return (m,) interpolated ground heights at (m, 2) places; NaN where unknown."""

        def between(tile: Tile, places_m: FloatArray) -> FloatArray:
            rows, columns, shares = tile.find_cells_around(places_m)
            return np.asarray((tile.heights_m[rows, columns] * shares).sum(axis=1), dtype=np.float64)

        return self._look_up(places_m, between, lambda known, other: np.where(np.isnan(known), other, known))

    def highest_m(self, places_m: FloatArray) -> FloatArray:
        """Return (m,) upper bounds of the ground at (m, 2) places: the highest of the cells around."""
        return self._look_up(places_m, lambda tile, at_m: tile.reduce_around(tile.highest_m, at_m, np.maximum), np.fmax)

    def lowest_m(self, places_m: FloatArray) -> FloatArray:
        """Return (m,) lower bounds of the ground at (m, 2) places: the lowest of the cells around."""
        return self._look_up(places_m, lambda tile, at_m: tile.reduce_around(tile.heights_m, at_m, np.minimum), np.fmin)

    def grid_m(self, easts_m: FloatArray, norths_m: FloatArray) -> FloatArray:
        """Return (norths, easts) interpolated heights on a regular grid, for drawing."""
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
        if len(places_m) > AT_ONCE:
            parts = np.array_split(places_m, math.ceil(len(places_m) / AT_ONCE))
            return np.concatenate([self._look_up(part, look, joined) for part in parts])
        found = np.full(len(places_m), np.nan)
        wanted = np.arange(len(places_m))
        for tile in self.tiles:
            found[wanted] = joined(found[wanted], look(tile, places_m[wanted]))
            # At a seam the cells around a place belong to two rasters.
            wanted = wanted[np.isnan(found[wanted]) | tile.is_near_edge(places_m[wanted])]
            if not len(wanted):
                break
        return found


@dataclass(frozen=True, slots=True, eq=False)
class Grid:
    """Heights at nodes."""

    low_m: Pair
    """East and north of the first node."""
    step_m: Above0
    """Spacing of the nodes."""
    heights_m: Annotated[FloatArray, array_of(Annotated[tuple[NodeRow, ...], Field(min_length=2)])]
    """(easts, norths) float64."""

    def interpolate_m(self, places_m: FloatArray) -> FloatArray:
        """Return (m,) heights at (m, 2) places; beyond the grid, those of its edge."""
        at = (places_m - np.array(self.low_m)) / self.step_m
        return interpolate_nodes(self.heights_m, np.clip(at, 0.0, np.array(self.heights_m.shape) - 1))

    @property
    def slope(self) -> float:
        """Steepest slope between nodes; it occurs at a node, in one of the cells around it."""
        up_e, up_n = np.diff(self.heights_m, axis=0) ** 2, np.diff(self.heights_m, axis=1) ** 2
        corners = (up_e[:, north] + up_n[east] for north in (slice(None, -1), slice(1, None)) for east in (
            slice(None, -1), slice(1, None)))  # fmt: skip
        return math.sqrt(max((float(one.max(initial=0.0)) for one in corners), default=0.0)) / self.step_m

    @property
    def places_m(self) -> FloatArray:
        """(easts, norths, 2) float64: positions of its nodes."""
        axes = (self.low_m[axis] + self.step_m * np.arange(self.heights_m.shape[axis]) for axis in (0, 1))
        return np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1)


GROUND_MARGIN_M = 20.0
"""Default distance of flights above ground."""


@dataclass(frozen=True, slots=True, eq=False)
class Terrain:
    """The ground, and the distance of flights from it."""

    elevation: Elevation
    margin_m: float = GROUND_MARGIN_M
    """Above ground, in addition to its uncertainty."""
    line_margin_m: float | None = None
    """Above the tops of lines; None: a share of the inspection height, as without terrain."""

    @property
    def kept_m(self) -> float:
        """Least height of every leg above the raster's ground."""
        return self.margin_m + self.elevation.uncertainty_m


@dataclass(frozen=True, slots=True, eq=False)
class KnownGround:
    """The ground under the flight area, as heights over the depot's."""

    corners_m: FloatArray
    """(k, 2) float64: corners of the area, convex, counter-clockwise."""
    highest: Grid
    """Upper bound of the raster's ground; `UNKNOWN_M` outside the area."""
    lowest: Grid
    """Lower bound of the ground; minus `UNKNOWN_M` outside."""
    kept_m: float
    """Least height of every leg above ground."""

    @property
    def bottom(self) -> tuple[float, FloatArray]:
        """Height of the lowest ground, and its (2,) place."""
        grid = self.lowest
        at = np.unravel_index(int(grid.heights_m.argmin()), grid.heights_m.shape)
        return float(grid.heights_m[at]), np.array(grid.low_m) + grid.step_m * np.array(at)

    def build_floor(self, over_m: float, slope: float) -> Grid:
        """Return the lowest heights at least ``over_m`` above ground that do not exceed a slope."""
        return limit_slope(replace(self.highest, heights_m=self.highest.heights_m + over_m), slope, np.maximum)

    def build_roof(self, over_m: float, slope: float) -> Grid:
        """Return the highest heights at most ``over_m`` above ground that do not exceed a slope."""
        return limit_slope(replace(self.lowest, heights_m=self.lowest.heights_m + over_m), -slope, np.minimum)


def flight_area_m(places_m: FloatArray) -> FloatArray:
    """Return (k, 2) corners of the area that flights between places may be over."""
    aside = AROUND_M * np.array([(1, 1), (1, -1), (-1, 1), (-1, -1)])
    depot = PADS_M * np.array([(1, 0), (0.7, 0.7), (0, 1), (-0.7, 0.7), (-1, 0), (-0.7, -0.7), (0, -1), (0.7, -0.7)])
    return hull_m(np.concatenate(((places_m[:, np.newaxis] + aside).reshape(-1, 2), depot)))


def around_bases_m(bases_m: Iterable[tuple[float, float]]) -> FloatArray:
    """Return (m, 2) places around bases that enclose the pads of their vehicles."""
    off_m = PADS_M - AROUND_M
    around = [(east + e, north + n) for east, north in bases_m for e in (-off_m, off_m) for n in (-off_m, off_m)]
    return np.array(around, dtype=np.float64).reshape(-1, 2)


def reading_box_m(
    network: Network, beside_m: float = AROUND_M, bases_m: Iterable[tuple[float, float]] = ()
) -> tuple[tuple[float, float], tuple[float, float]]:
    """Return the south-western and north-eastern corners of the area to read from rasters.

    Args:
        network: Network to fly over.
        beside_m: Margin around it.
        bases_m: Take-off places.
    """
    corners_m = flight_area_m(np.concatenate((network.positions_m, around_bases_m(bases_m))))
    margin_m = beside_m + 4.0 * _node_step_m(corners_m)
    low_m, high_m = corners_m.min(axis=0) - margin_m, corners_m.max(axis=0) + margin_m
    return (float(low_m[0]), float(low_m[1])), (float(high_m[0]), float(high_m[1]))


def _node_step_m(corners_m: FloatArray) -> float:
    sides_m = np.ptp(corners_m, axis=0)
    return max(NODES_M, math.sqrt(float(sides_m.prod()) / MOST_NODES))


def build_known_ground(terrain: Terrain, places_m: FloatArray, frame: LocalFrame, network: Network) -> KnownGround:
    """Return the ground that flights between places may be over.

    Args:
        terrain: The ground.
        places_m: (m, 2) ends of legs.
        frame: Frame of the depot that heights refer to.
        network: Names places in messages.

    Raises:
        ElevationError: a part of it is not known; one line with its place.
    """
    corners = flight_area_m(places_m)
    low_m, high_m = corners.min(axis=0), corners.max(axis=0)
    step_m = _node_step_m(corners)
    low_m = low_m - 2.0 * step_m
    counts = np.ceil((high_m - low_m) / step_m).astype(int) + 4
    # Samples are at most half a raster cell apart, so that no cell is missed.
    looks = max(1, math.ceil(step_m / (0.5 * terrain.elevation.cell_m)))
    easts_m = low_m[0] + step_m / looks * np.arange((counts[0] - 1) * looks + 1)
    sides = (
        (np.maximum, UNKNOWN_M, terrain.elevation.highest_m), (np.minimum, -UNKNOWN_M, terrain.elevation.lowest_m)
    )  # fmt: skip
    cells_m = [np.empty(tuple(counts - 1)) for _ in sides]
    rows = max(1, ROW_PLACES // (len(easts_m) * looks))
    for first in range(0, counts[1] - 1, rows):
        last = min(counts[1] - 1, first + rows)
        norths_m = low_m[1] + step_m / looks * np.arange(first * looks, last * looks + 1)
        looked_m = np.stack(np.meshgrid(easts_m, norths_m, indexing="ij"), axis=-1)
        flat_m = looked_m.reshape(-1, 2)
        area = is_inside_convex(corners, flat_m, beyond_m=1.5 * step_m)
        for own_m, (best, beyond_m, look) in zip(cells_m, sides, strict=True):
            up_m = np.full(len(flat_m), beyond_m)
            up_m[area] = look(flat_m[area]) - frame.alt_m
            holes = np.isnan(up_m)
            if holes.any():
                raise build_unknown_ground_error(terrain.elevation, flat_m[holes][0], frame, network)
            own_m[:, first:last] = _reduce_blocks(up_m.reshape(looked_m.shape[:2]), looks, best)
    start = (float(low_m[0]), float(low_m[1]))
    # A node holds the best of the cells around it, so that interpolation between nodes stays a bound for every cell.
    highest, lowest = (
        Grid(start, step_m, _reduce_blocks(np.pad(own_m, 1, constant_values=beyond_m), 1, best))
        for own_m, (best, beyond_m, _) in zip(cells_m, sides, strict=True)
    )
    return KnownGround(corners, highest, lowest, terrain.kept_m)


def build_unknown_ground_error(
    elevation: Elevation, place_m: FloatArray, frame: LocalFrame, network: Network
) -> ElevationError:
    """Return the error that reports where the ground is not known."""
    return ElevationError(
        f"{elevation.source}: no-data: expected the ground's height everywhere between the lines and the pads, none "
        f"{describe_ground_place(place_m, frame, network)}"
    )


def describe_ground_place(place_m: FloatArray, frame: LocalFrame, network: Network) -> str:
    """Return a description of a place: "at 46.60123, 10.40021, 120 m from pylon 'P17'"."""
    lat_deg, lon_deg = frame.to_wgs84_deg(float(place_m[0]), float(place_m[1]))
    away_m = np.hypot(*(network.positions_m - place_m).T)
    nearest = int(away_m.argmin())
    return f"at {lat_deg:.5f}, {lon_deg:.5f}, {away_m[nearest]:.0f} m from pylon {network.pylons[nearest].id!r}"


def _reduce_blocks(looked_m: FloatArray, looks: int, best: np.ufunc) -> FloatArray:
    """Return the best of the samples in each square block, its edges included."""
    blocks = sliding_window_view(looked_m, (looks + 1, looks + 1))[::looks, ::looks]
    return np.asarray(best.reduce(blocks, axis=(2, 3)), dtype=np.float64)


def limit_slope(grid: Grid, slope: float, best: np.ufunc) -> Grid:
    """Return the nearest grid whose slope stays within a bound.

    At every node it is the best value left there by the cones of all others: steps of 1, 2, 4 ... nodes in sequence,
    each taken or not, make up every distance along a direction.

    Args:
        grid: The heights.
        slope: Above 0 for cones down from peaks; below 0 for cones up from pits.
        best: `np.maximum` for an upper bound of the heights; `np.minimum` for a lower bound.
    """
    heights_m = grid.heights_m.copy()
    finite = heights_m[np.isfinite(heights_m)]
    relief_m = float(np.ptp(finite)) if finite.size else 0.0
    reach = min(max(heights_m.shape), math.ceil(relief_m / max(abs(slope) * grid.step_m, 1e-9)))
    stride = 1
    while stride <= max(reach, 1):
        for east, north in DIRECTIONS:
            drop_m = slope * grid.step_m * stride * math.hypot(east, north)
            # A step to the south is a step to the north in the flipped grid.
            seen_m, by_e, by_n = heights_m[:, :: 1 if north >= 0 else -1], east * stride, abs(north) * stride
            here, there = seen_m[: -by_e or None, : -by_n or None], seen_m[by_e:, by_n:]
            ahead = here - drop_m
            best(here, there - drop_m, out=here)
            best(there, ahead, out=there)
        stride *= 2
    return Grid(grid.low_m, grid.step_m, heights_m)


def hull_m(places_m: FloatArray) -> FloatArray:
    """Return (k, 2) corners of the convex hull of (m, 2) places, counter-clockwise."""
    return np.array(build_convex_hull(sorted(set(map(tuple, places_m.tolist())))), dtype=np.float64)


def is_inside_convex(corners_m: FloatArray, places_m: FloatArray, beyond_m: float = 0.0) -> BoolArray:
    """Return (m,) whether (m, 2) places are in a convex polygon, or within ``beyond_m`` of each of its sides."""
    found = np.ones(len(places_m), dtype=np.bool_)
    for corner, following in zip(corners_m, np.roll(corners_m, -1, axis=0), strict=True):
        along = following - corner
        out_m = (along[1] * (places_m[:, 0] - corner[0]) - along[0] * (places_m[:, 1] - corner[1])) / math.hypot(*along)
        found &= out_m <= beyond_m
    return found
