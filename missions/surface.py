"""The height that the lowest vehicle flies at, over every place of the area: near a line the line's own flight height.

Between the lines it is the mean of the lowest and the highest function through the lines' heights whose slope nowhere
exceeds a bound (the two Lipschitz extensions of McShane and Whitney). So the slope of the surface has a proven bound,
it never leaves the range of the heights that it was made from, and on a lone line it is the line's height exactly.

Over ground that a raster knows it also keeps above the floor of the flights and, where it can, below their roof
(`terrain`), which are no steeper either: on the lines it is the lines' height all the same.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from missions.geo import FloatArray
from missions.grids import Grid

DATA_STEP_M = 20.0
"""Distance of the points along a line that carry the surface; coarser for very long networks."""
MAX_DATA = 1500
CHECK_STEP_M = 4.0
"""Distance of the points at which legs are held against the surface."""
CHECK_OVER_M = 2.0
"""The same over ground that a raster knows, where the surface is steeper."""
MAX_CHECKS = 12_000
FOLLOW_M = 0.5
"""Legs off the lines keep this near to the surface at the points that are checked."""
TRIANGLE_STEPS = 60
"""Of the distance of the checked points, along a triangle's longest side: 2000 points in all."""
ROUNDING_M = 1e-3
"""Coordinates of waypoints are rounded to less."""
SLOPES = (0.02, 0.05, 0.08, 0.12, 0.16, 0.2, 0.3, 0.45, 0.7, 1.0)
"""Bounds to choose from; a steep surface follows crossing lines better and costs more height between the layers."""
MATRIX_ENTRIES = 2_000_000
"""Distances held at a time: 16 MB."""


@dataclass(frozen=True, slots=True, eq=False)
class Surface:
    """Heights over the depot's ground as a function of the place."""

    points_m: FloatArray
    """(n, 2) float64: east and north of the places that carry it."""
    heights_m: FloatArray
    """(n,) float64: their heights."""
    slope: float
    """It rises or falls by at most this many metres a metre."""
    floor: Grid | None = None
    """It is nowhere below; on the lines it is not above them."""
    roof: Grid | None = None
    """It is not above, but where lines and floor are."""

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
        """Return whether all of a triangle of (3, 3) corners keeps as near to the surface as legs do.

        One that is too wide to be looked at closely counts as one that does not, but over flat ground.
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
        """Return (w, 3) places between two (3,) places so that straight legs through them keep near the surface.

        Near means ``tolerance_m`` at points every ``CHECK_STEP_M``, or ``CHECK_OVER_M`` over a floor; the two ends are
        taken as they are.
        """
        length_m = math.hypot(*(goal_m[:2] - start_m[:2]))
        steps = max(1, math.ceil(length_m / (CHECK_STEP_M if self.floor is None else CHECK_OVER_M)))
        share = np.linspace(0.0, 1.0, steps + 1)[:, np.newaxis]
        line = start_m + share * (goal_m - start_m)
        line[1:-1, 2] = self.interpolate_m(line[:, :2])[1:-1]
        kept = sorted(_select_corners(line[:, 2], tolerance_m))
        return np.asarray(line[kept], dtype=np.float64)


@dataclass(frozen=True, slots=True, eq=False)
class SurfaceFit:
    """A surface, and how well it fits the lines that it was made from."""

    surface: Surface
    error_m: float
    """Largest distance in height between a line's flight track and the surface."""
    spacing_m: float
    """Layers this far apart keep two vehicles ``layer_m`` apart, wherever each of them is."""


def build_flat_surface(height_m: float) -> Surface:
    """Return a surface of one height everywhere."""
    return Surface(np.zeros((1, 2)), np.array([height_m]), 0.0)


def fit_surface(tracks_m: FloatArray, heights_m: FloatArray, layer_m: float) -> SurfaceFit:
    """Return the surface through straight tracks that needs the least spacing between layers.

    Two vehicles on neighbouring layers, ``d`` apart over the ground, are apart in height by the spacing, less
    ``slope * d`` for the surface, less what each of them is off it. For all ``d`` up to ``layer_m`` this leaves
    ``layer_m`` between them if the spacing is ``layer_m * sqrt(1 + slope^2)`` and twice what a leg may be off; the
    latter adds ``slope * CHECK_STEP_M`` for what lies between two checked points.

    Args:
        tracks_m: (n, 2, 2) float64, east and north of both ends of every inspection leg.
        heights_m: (n, 2) float64, their heights.
        layer_m: The distance that any two vehicles must keep.
    """
    fits = []
    for surface, error_m in iterate_surfaces(tracks_m, heights_m):
        off_m = max(FOLLOW_M, error_m) + surface.slope * CHECK_STEP_M
        fits.append(SurfaceFit(surface, error_m, layer_m * math.hypot(1.0, surface.slope) + 2.0 * off_m))
    return min(fits, key=lambda candidate: candidate.spacing_m)


def iterate_surfaces(
    tracks_m: FloatArray, heights_m: FloatArray, slopes: Sequence[float] = SLOPES
) -> Iterator[tuple[Surface, float]]:
    """Yield a surface and its largest error for each slope; distances, the costly part, are taken once."""
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
    """Yield (r, n) distances of all places, some rows at a time."""
    rows = max(1, MATRIX_ENTRIES // len(points_m))
    for first in range(0, len(places_m), rows):
        offsets = places_m[first : first + rows, np.newaxis] - points_m
        yield np.hypot(offsets[..., 0], offsets[..., 1])


def _extensions_m(distances_m: FloatArray, heights_m: FloatArray, slope: float) -> tuple[FloatArray, FloatArray]:
    """Return (m,) the lowest and the highest heights that the slope allows."""
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


def _select_corners(heights_m: FloatArray, tolerance_m: float) -> list[int]:
    """Return the inner indices to keep so that straight pieces between them are within the tolerance everywhere."""
    kept: list[int] = []
    pieces = [(0, len(heights_m) - 1)]
    while pieces:
        first, last = pieces.pop()
        share = np.arange(last - first + 1) / max(1, last - first)
        off_m = np.abs(heights_m[first] + share * (heights_m[last] - heights_m[first]) - heights_m[first : last + 1])
        worst = int(np.argmax(off_m))
        if off_m[worst] > tolerance_m:
            kept.append(first + worst)
            pieces += [(first, first + worst), (first + worst, last)]
    return kept
