"""Compute the flight height of the lowest layer over the area: near a line, that line's own flight height.

Between lines it is the mean of the lowest and the highest function through the lines' heights whose slope nowhere
exceeds a bound (the two Lipschitz extensions of McShane and Whitney). The slope of the surface therefore has a proven
bound, it stays within the range of its input heights, and on a single line it matches the line's height exactly.

Over ground covered by a raster it also stays above the flight floor and, where possible, below the flight roof
(`terrain`), which are no steeper. On the lines it still matches the lines' height.

A steeper surface means that a slope next to a line raises the line's inspection less, but the layers must be farther
apart. The chosen slope minimizes the mean height of the vehicles above the requested height. Over hills a transit is
not a straight leg: crossing a ridge costs the climb. For pricing, the surface is sampled on a grid, which plan files
store, at a few places along each path.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from missions.geo import FloatArray, IndexArray, IntArray
from missions.geometry import distances_between_m, find_bends
from missions.inspection_defaults import Inspection
from missions.terrain import Grid, KnownGround

DATA_STEP_M = 20.0
"""Spacing of the points along a line that define the surface; coarser for very long networks."""
MAX_DATA = 1500
CHECK_STEP_M = 4.0
"""Spacing of the points at which legs are checked against the surface."""
CHECK_OVER_M = 2.0
"""The same over ground covered by a raster, where the surface is steeper."""
MAX_CHECKS = 12_000
FOLLOW_M = 0.5
"""Greatest height error of legs off the lines at the checked points."""
TRIANGLE_STEPS = 60
"""Steps along a triangle's longest side, in units of the check spacing: 2000 points in all."""
ROUNDING_M = 1e-3
"""Tolerance; waypoint coordinates are rounded to less."""
SLOPES = (0.02, 0.05, 0.08, 0.12, 0.16, 0.2, 0.3, 0.45, 0.7, 1.0)
"""Candidate slope bounds; a steep surface follows crossing lines better and costs more height between layers."""
MATRIX_ENTRIES = 2_000_000
"""Distances held in memory at a time: 16 MB."""
STEP_M = 20.0
"""Spacing of the grid nodes; larger in large areas."""
MOST_NODES = 10_000
UNEVEN_M = 3.0
"""A path that is nowhere farther than this from the straight one is priced as straight."""
PIECE_M = 60.0
"""Approximate length of legs over uneven ground."""
PIECES = (3, 6, 12, 24)
"""Numbers of pieces into which paths are split for checking, by length."""
FEW_PIECES = 6
MANY_WAYS = 400_000
"""Above this number of paths at once, each is checked in few pieces."""
AT_ONCE = 50_000
FOLLOW_OVER_M = 2.0
"""Greatest height error of legs over uneven ground; a closer fit needs more waypoints than autopilots hold."""
SLOPES_OVER = (0.12, 0.2, 0.3, 0.45, 0.7, 1.0)
STEEPER = 1.42
"""Between the nodes of a grid, where two cones meet, the slope is up to this many times theirs."""
TRIES = 4
SLACK_M = 1.0
"""Margin below the ceiling."""


@dataclass(frozen=True, slots=True, eq=False)
class Surface:
    """Heights over the depot's ground as a function of position."""

    points_m: FloatArray
    """(n, 2) float64: east and north of the points that define the surface."""
    heights_m: FloatArray
    """(n,) float64: their heights."""
    slope: float
    """Largest slope, in metres of height per metre."""
    floor: Grid | None = None
    """Lower bound of the surface; on the lines it does not exceed their height."""
    roof: Grid | None = None
    """Upper bound of the surface, except at lines and floor."""

    def interpolate_m(self, places_m: FloatArray) -> FloatArray:
        """Return (m,) heights over (m, 2) places."""
        blocks = _distances_m(places_m, self.points_m)
        pairs = [_extensions_m(block, self.heights_m, self.slope) for block in blocks]
        least_m, most_m = (np.concatenate([pair[of] for pair in pairs]) for of in (0, 1))
        middle_m = 0.5 * (most_m + least_m)
        if self.roof is not None:
            middle_m = np.minimum(middle_m, np.maximum(least_m, self.roof.interpolate_m(places_m)))
        if self.floor is not None:
            middle_m = np.maximum(middle_m, self.floor.interpolate_m(places_m))
        return np.asarray(middle_m, dtype=np.float64)

    def height_m(self, east_m: float, north_m: float) -> float:
        """Return the height over one place."""
        return float(self.interpolate_m(np.array([[east_m, north_m]]))[0])

    def is_near(self, corners_m: FloatArray, tolerance_m: float) -> bool:
        """Return whether a whole triangle of (3, 3) corners stays as near to the surface as legs do.

        A triangle too wide to check closely counts as not near, except over flat ground.
        """
        flat = self.floor is None and np.ptp(self.heights_m) <= ROUNDING_M
        length_m = float(np.hypot(*(np.roll(corners_m, 1, axis=0) - corners_m)[:, :2].T).max())
        steps = 1 if flat else math.ceil(length_m / (CHECK_STEP_M if self.floor is None else CHECK_OVER_M))
        if steps > TRIANGLE_STEPS:
            return False
        one, other = np.indices((steps + 1, steps + 1)).reshape(2, -1) / max(1, steps)
        within = one + other <= 1.0 + 1e-9
        shares = np.column_stack((1.0 - one - other, one, other))[within]
        places_m = shares @ corners_m
        off_m = np.abs(self.interpolate_m(places_m[:, :2]) - places_m[:, 2])
        return bool(off_m.max() <= tolerance_m + ROUNDING_M)

    def follow_m(self, start_m: FloatArray, goal_m: FloatArray, tolerance_m: float) -> FloatArray:
        """Return (w, 3) places between two (3,) places so that straight legs through them stay near the surface.

        Near means within ``tolerance_m`` at points every ``CHECK_STEP_M``, or ``CHECK_OVER_M`` over a floor; the two
        ends are not changed.
        """
        length_m = math.hypot(*(goal_m[:2] - start_m[:2]))
        steps = max(1, math.ceil(length_m / (CHECK_STEP_M if self.floor is None else CHECK_OVER_M)))
        share = np.linspace(0.0, 1.0, steps + 1)[:, np.newaxis]
        line = start_m + share * (goal_m - start_m)
        line[1:-1, 2] = self.interpolate_m(line[:, :2])[1:-1]
        return np.asarray(line[find_bends(line[:, 2], tolerance_m, _measure_off)], dtype=np.float64)


@dataclass(frozen=True, slots=True, eq=False)
class SurfaceFit:
    """A surface, and how well it fits its input lines."""

    surface: Surface
    error_m: float
    """Largest height difference between a line's flight track and the surface."""
    spacing_m: float
    """Layer spacing that keeps any two vehicles ``layer_m`` apart, wherever they are."""

    @property
    def tolerance_m(self) -> float:
        """Greatest height error of legs off the lines."""
        return max(FOLLOW_M if self.surface.floor is None else FOLLOW_OVER_M, self.error_m)


def build_flat_surface(height_m: float) -> Surface:
    """Return a surface of constant height."""
    return Surface(np.zeros((1, 2)), np.array([height_m]), 0.0)


def fit_surface(tracks_m: FloatArray, heights_m: FloatArray, layer_m: float) -> SurfaceFit:
    """Return the surface through straight tracks that needs the smallest layer spacing.

    Two vehicles on neighbouring layers at horizontal distance ``d`` are apart in height by the spacing, minus
    ``slope * d`` for the surface, minus each vehicle's own height error. For all ``d`` up to ``layer_m`` this leaves
    ``layer_m`` between them if the spacing is ``layer_m * sqrt(1 + slope^2)`` plus twice a leg's greatest height error,
    which includes ``slope * CHECK_STEP_M`` for places between two checked points.

    Args:
        tracks_m: (n, 2, 2) float64, east and north of both ends of every inspection leg.
        heights_m: (n, 2) float64, their heights.
        layer_m: Minimum distance between any two vehicles.
    """
    fits = []
    for surface, error_m in iterate_surfaces(tracks_m, heights_m):
        off_m = max(FOLLOW_M, error_m) + surface.slope * CHECK_STEP_M
        fits.append(SurfaceFit(surface, error_m, _spacing_m(layer_m, surface.slope, off_m)))
    return min(fits, key=lambda candidate: candidate.spacing_m)


def iterate_surfaces(
    tracks_m: FloatArray, heights_m: FloatArray, slopes: Sequence[float] = SLOPES
) -> Iterator[tuple[Surface, float]]:
    """Yield a surface and its largest error for each slope; distances, the costly part, are computed once."""
    length_m = float(np.hypot(*(tracks_m[:, 1] - tracks_m[:, 0]).T).sum())
    data = sample_tracks(tracks_m, heights_m, max(DATA_STEP_M, length_m / MAX_DATA))
    checks = sample_tracks(tracks_m, heights_m, max(CHECK_STEP_M, length_m / MAX_CHECKS))
    surfaces = [Surface(data[:, :2], data[:, 2], slope) for slope in slopes]
    errors_m = np.zeros(len(slopes))
    done = 0
    for distances_m in _distances_m(checks[:, :2], data[:, :2]):
        heights_m = checks[done : done + len(distances_m), 2]
        for index, slope in enumerate(slopes):
            off_m = np.abs(0.5 * sum(_extensions_m(distances_m, data[:, 2], slope)) - heights_m)
            errors_m[index] = max(errors_m[index], float(off_m.max()))
        done += len(distances_m)
    yield from zip(surfaces, errors_m.tolist(), strict=True)


def _distances_m(places_m: FloatArray, points_m: FloatArray) -> Iterator[FloatArray]:
    """Yield (r, n) distances of all places, a block of rows at a time."""
    rows = max(1, MATRIX_ENTRIES // len(points_m))
    for first in range(0, len(places_m), rows):
        yield distances_between_m(places_m[first : first + rows], points_m)


def _extensions_m(distances_m: FloatArray, heights_m: FloatArray, slope: float) -> tuple[FloatArray, FloatArray]:
    """Return (m,) lowest and highest heights that the slope allows."""
    rise_m = slope * distances_m
    return (heights_m - rise_m).max(axis=1), (heights_m + rise_m).min(axis=1)


def sample_tracks(tracks_m: FloatArray, heights_m: FloatArray, step_m: float) -> FloatArray:
    """Return (m, 3) places on the tracks, ends included, at most ``step_m`` apart."""
    ends = np.concatenate((tracks_m, heights_m[..., np.newaxis]), axis=2)
    pieces = []
    for start, goal in ends:
        steps = max(1, math.ceil(math.hypot(*(goal[:2] - start[:2])) / step_m))
        pieces.append(start + np.linspace(0.0, 1.0, steps + 1)[:, np.newaxis] * (goal - start))
    return np.asarray(np.concatenate(pieces), dtype=np.float64)


def _measure_off(heights_m: FloatArray) -> FloatArray:
    """Return the distance of the inner heights from a straight rise between the first and the last."""
    share = np.arange(1, len(heights_m) - 1) / (len(heights_m) - 1)
    return np.asarray(np.abs(heights_m[0] + share * (heights_m[-1] - heights_m[0]) - heights_m[1:-1]))


@dataclass(frozen=True, slots=True, eq=False)
class Relief:
    """The height of the lowest layer over every place, used to price flights."""

    grid: Grid

    def iterate_ways(self, from_m: FloatArray, to_m: FloatArray) -> Iterator[tuple[IntArray, FloatArray]]:
        """Yield the paths that are not straight, grouped by number of pieces.

        Args:
            from_m: (n, 3) float64, where paths begin.
            to_m: (n, 3) float64, where they end.

        Yields:
            (k,) their indices, and (k, w, 3) their places, both ends included.
        """
        most = PIECES[-1] if len(from_m) <= MANY_WAYS else FEW_PIECES
        lengths_m = np.hypot(*(to_m[:, :2] - from_m[:, :2]).T)
        shortest_m = 0.0
        for pieces in PIECES[: PIECES.index(most) + 1]:
            longest_m = PIECE_M * pieces if pieces < most else math.inf
            own = np.flatnonzero((lengths_m > shortest_m) & (lengths_m <= longest_m))
            for first in range(0, len(own), AT_ONCE):
                part = own[first : first + AT_ONCE]
                begins_m, ends_m = from_m[part], to_m[part]
                ways_m = self.follow_surface(np.stack((begins_m, ends_m), axis=1), pieces)
                share = np.linspace(0.0, 1.0, pieces + 1)
                straight_m = begins_m[:, 2:] + share * (ends_m[:, 2:] - begins_m[:, 2:])
                uneven = np.abs(ways_m[..., 2] - straight_m).max(axis=1) > UNEVEN_M
                if uneven.any():
                    yield part[uneven], ways_m[uneven]
            shortest_m = longest_m

    def follow_surface(self, ways_m: FloatArray, pieces: int) -> FloatArray:
        """Return (k, (w - 1) * pieces + 1, 3) paths through (k, w, 3) places that follow the surface between them."""
        share = (np.arange(pieces) / pieces)[:, np.newaxis]
        begins_m, ends_m = ways_m[:, :-1, np.newaxis], ways_m[:, 1:, np.newaxis]
        inner_m = (begins_m + share * (ends_m - begins_m)).reshape(len(ways_m), -1, 3)
        whole_m = np.concatenate((inner_m, ways_m[:, -1:]), axis=1)
        up_m = self.grid.interpolate_m(whole_m[..., :2].reshape(-1, 2)).reshape(whole_m.shape[:2])
        # Between nodes the grid has a small error, estimated from the error at the ends, which is known.
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
    # Rounded as in a plan file, so that a loaded plan gives the same figures.
    return Relief(Grid(grid.low_m, step_m, np.asarray(np.round(heights_m, 1), dtype=np.float64)))


def fit_overland_surface(
    known: KnownGround, inspection: Inspection, vehicles: int, tracks_m: FloatArray, pylon_m: FloatArray,
    ends: IndexArray,
) -> tuple[SurfaceFit, FloatArray]:  # fmt: skip
    """Return the surface over lines and ground, and (p,) the lowest vehicle's height over the depot at each pylon.

    Args:
        known: The ground.
        inspection: The layer distance, and the ceiling of the highest layer.
        vehicles: Number of vehicles.
        tracks_m: (n, 2, 2) ends of every inspection leg.
        pylon_m: (p,) requested heights over the depot at the pylons.
        ends: (n, 2) pylons at the ends of each leg.
    """
    errors_m = {surface.slope: error_m for surface, error_m in iterate_surfaces(tracks_m, pylon_m[ends], SLOPES_OVER)}
    lengths_m = np.hypot(*(tracks_m[:, 1] - tracks_m[:, 0]).T)
    best: tuple[float, float] | None = None
    for slope in SLOPES_OVER:
        off_m = _floor_error_m(errors_m[slope], slope)
        lifts_m = _lifts_m(known.build_floor(known.kept_m + off_m, slope), tracks_m, pylon_m, ends)
        lifted_m = float((lifts_m[ends].mean(axis=1) * lengths_m).sum() / lengths_m.sum())
        over_m = lifted_m + 0.5 * vehicles * _spacing_m(inspection.layer_m, STEEPER * slope, off_m)
        if best is None or over_m < best[0]:
            best = over_m, slope
    slope = best[1] if best is not None else SLOPES_OVER[0]
    return _fit_slope(known, inspection, vehicles, tracks_m, pylon_m, ends, slope, errors_m[slope])


def _fit_slope(
    known: KnownGround, inspection: Inspection, vehicles: int, tracks_m: FloatArray, asked_m: FloatArray,
    ends: IndexArray, slope: float, error_m: float,
) -> tuple[SurfaceFit, FloatArray]:  # fmt: skip
    """Return the surface for a slope; raised lines may fit it worse than before, and the floor depends on that."""
    lengths_m = np.hypot(*(tracks_m[:, 1] - tracks_m[:, 0]).T)
    step_m = max(CHECK_STEP_M, float(lengths_m.sum()) / MAX_CHECKS)
    for _ in range(TRIES):
        off_m = _floor_error_m(error_m, slope)
        floor = known.build_floor(known.kept_m + off_m, slope)
        pylon_m = asked_m + _lifts_m(floor, tracks_m, asked_m, ends)
        stack_m = (vehicles - 1) * _spacing_m(inspection.layer_m, STEEPER * slope, off_m)
        roof = known.build_roof(max(known.kept_m + off_m, inspection.ceiling_m - stack_m - off_m - SLACK_M), slope)
        surface = replace(next(iterate_surfaces(tracks_m, pylon_m[ends], (slope,)))[0], floor=floor, roof=roof)
        places = sample_tracks(tracks_m, pylon_m[ends], step_m)
        fitted_m = float(np.abs(surface.interpolate_m(places[:, :2]) - places[:, 2]).max())
        if fitted_m <= max(error_m, FOLLOW_OVER_M):
            break
        error_m = fitted_m
    steepest = max(slope, floor.slope, roof.slope)
    off_m = max(FOLLOW_OVER_M, fitted_m) + steepest * CHECK_OVER_M
    return SurfaceFit(surface, fitted_m, _spacing_m(inspection.layer_m, steepest, off_m)), pylon_m


def _floor_error_m(error_m: float, slope: float) -> float:
    return max(FOLLOW_OVER_M, error_m) + STEEPER * slope * CHECK_OVER_M


def _spacing_m(layer_m: float, slope: float, off_m: float) -> float:
    """Return the required layer spacing, see `fit_surface`."""
    return layer_m * math.hypot(1.0, slope) + 2.0 * off_m


def _lifts_m(floor: Grid, tracks_m: FloatArray, pylon_m: FloatArray, ends: IndexArray) -> FloatArray:
    """Return (p,) how much pylon heights must be raised to keep every inspection above the floor."""
    lifts_m = np.zeros(len(pylon_m))
    # Ends first: a slope next to a line's end then raises that end only.
    for shares in (np.array([0.0, 1.0]), None):
        shorts_m = _shortfalls_m(floor, tracks_m, (pylon_m + lifts_m)[ends], shares)
        more_m = np.zeros(len(pylon_m))
        for side in (0, 1):
            own_m = shorts_m[:, side] if shares is not None else shorts_m.max(axis=1)
            np.maximum.at(more_m, ends[:, side], own_m)
        lifts_m += more_m
    return lifts_m


def _shortfalls_m(floor: Grid, tracks_m: FloatArray, heights_m: FloatArray, shares: FloatArray | None) -> FloatArray:
    """Return (n, k) heights by which inspections are below the floor, 0 where they are not."""
    if shares is None:
        longest_m = float(np.hypot(*(tracks_m[:, 1] - tracks_m[:, 0]).T).max())
        step_m = max(CHECK_STEP_M, longest_m * len(tracks_m) / (25 * MAX_CHECKS))
        shares = np.linspace(0.0, 1.0, math.ceil(longest_m / step_m) + 1)
    places_m = tracks_m[:, :1] + shares[:, np.newaxis] * (tracks_m[:, 1:] - tracks_m[:, :1])
    flown_m = heights_m[:, :1] + shares * (heights_m[:, 1:] - heights_m[:, :1])
    under_m = floor.interpolate_m(places_m.reshape(-1, 2)).reshape(flown_m.shape) - flown_m
    return np.asarray(np.maximum(under_m, 0.0), dtype=np.float64)
