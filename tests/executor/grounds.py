"""Ground to look at: hills as a function of the place, and farmland from above."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from executor.site.ground_view import GroundView, compute_hillshade, compute_shown_area
from missions.geo import FloatArray
from missions.readers.background_files import Background, choose_grid_size


@dataclass(frozen=True)
class Hills:
    """Two hills and a valley; a plane if `slope` is given alone."""

    base_m: float = 430.0
    hill_m: float = 120.0
    cell_m: float = 10.0
    slope: tuple[float, float] = (0.0, 0.0)
    """Metres up for a metre east, and north."""
    unknown_east_m: float = np.inf
    """East of this nobody knows anything."""

    def at_m(self, east_m: FloatArray, north_m: FloatArray) -> FloatArray:
        first = self.hill_m * np.exp(-((east_m + 300) ** 2 + (north_m - 200) ** 2) / 500.0**2)
        second = 0.7 * self.hill_m * np.exp(-((east_m - 700) ** 2 + (north_m + 500) ** 2) / 400.0**2)
        valley = -0.2 * self.hill_m * np.exp(-(((east_m + 0.6 * north_m) - 250) ** 2) / 150.0**2)
        up_m = self.base_m + first + second + valley + self.slope[0] * east_m + self.slope[1] * north_m
        return np.asarray(np.where(east_m > self.unknown_east_m, np.nan, up_m), dtype=np.float64)

    def grid_m(self, easts_m: FloatArray, norths_m: FloatArray) -> FloatArray:
        return self.at_m(*np.meshgrid(easts_m, norths_m))


def farmland(low_m: tuple[float, float], high_m: tuple[float, float], *, seed: int = 3) -> Background:
    """Return fields, woods and a road, from above."""
    rng = np.random.default_rng(seed)
    rows, columns = choose_grid_size(low_m, high_m, 400_000, 1.0)
    east_m, north_m = np.meshgrid(
        np.linspace(low_m[0], high_m[0], columns), np.linspace(high_m[1], low_m[1], rows)
    )  # fmt: skip
    seeds = rng.uniform(low_m, high_m, (90, 2))
    nearest = np.argmin([(east_m - e) ** 2 + (north_m - n) ** 2 for e, n in seeds], axis=0)
    palette = np.array([(104, 118, 62), (150, 139, 88), (52, 78, 40), (126, 134, 76), (171, 152, 104), (88, 110, 58)])
    colours = palette[rng.integers(0, len(palette), 90)][nearest].astype(np.float64)
    colours += rng.normal(0.0, 7.0, (rows, columns, 1))
    road = np.abs(north_m + 120.0 * np.sin(east_m / 300.0) + 60.0) < 5.0
    colours[road] = (196, 192, 184)
    pixels: npt.NDArray[np.uint8] = np.full((rows, columns, 4), 255, dtype=np.uint8)
    pixels[..., :3] = np.clip(colours, 0, 255).astype(np.uint8)
    return Background(pixels, low_m, high_m)


def ground_about(places_m: FloatArray, *, photo: bool = True, hills: Hills | None = None) -> GroundView:
    """Return the ground around places."""
    low_m, high_m = compute_shown_area(places_m)
    background = farmland(low_m, high_m) if photo else None
    by = "© Land survey 2026" if photo else ""
    relief = None if hills is None else compute_hillshade(hills, low_m, high_m)
    return GroundView(low_m, high_m, background, relief, by)
