"""The shape of the ground as it is shown: shaded, with contour lines, and its heights to be asked for."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Protocol

import numpy as np
import numpy.typing as npt

from missions.geo import FloatArray
from missions.readers.background_files import Corner, choose_grid_size

MOST_CELLS = 1_000_000
LEAST_CELL_M = 1.0
MOST_LINE_CELLS = 90_000
"""Lines of a finer grid are no better to look at, and many to send."""
SUN_DEG, SUN_UP_DEG = 315.0, 45.0
"""From the north-west, as maps have it: lit from below, hills look like hollows."""
GENTLE = 0.35
"""Slopes are shown as if the steeper ones of an area were at least so steep."""
MOST_EXAGGERATION = 6.0
LINES = 14
"""About so many contour lines lie between the lowest and the highest place."""
MOST_LINES = 300
STEPS_M = (0.5, 1.0, 2.0, 5.0, 10.0, 20.0, 50.0, 100.0, 200.0, 500.0)
BOLD = 5
"""Every fifth contour line is drawn bold, with its height."""


class Heights(Protocol):
    """What knows the ground's heights."""

    @property
    def cell_m(self) -> float:
        """The size of the smallest cells."""
        ...

    def grid_m(self, easts_m: FloatArray, norths_m: FloatArray) -> FloatArray:
        """Return (norths, easts) heights above mean sea level; not a number where nobody knows."""
        ...


@dataclass(frozen=True, slots=True)
class Contour:
    """One line of one height."""

    height_m: float
    places_m: tuple[tuple[float, float], ...]
    """East and north."""
    bold: bool


@dataclass(frozen=True, slots=True, eq=False)
class Hillshade:
    """The ground of an area, on a grid of square cells."""

    heights_m: npt.NDArray[np.float32]
    """(rows, columns) above mean sea level in the middles of cells, the northernmost row first."""
    shade: npt.NDArray[np.uint8]
    """(rows, columns, 2): how light, and how opaque: nothing where heights are not known."""
    low_m: Corner
    """South-western corner: outer edges of cells."""
    high_m: Corner
    interval_m: float
    contours: tuple[Contour, ...]


def compute_hillshade(
    known: Heights, low_m: Corner, high_m: Corner, contour_m: float | None = None
) -> Hillshade | None:
    """Return the ground of an area; None where no height of it is known."""
    rows, columns = choose_grid_size(low_m, high_m, MOST_CELLS, max(known.cell_m, LEAST_CELL_M))
    easts_m, norths_m = (
        _compute_cell_middles(low_m[0], high_m[0], columns),
        _compute_cell_middles(low_m[1], high_m[1], rows)[::-1],
    )
    heights_m = known.grid_m(easts_m, norths_m).astype(np.float32)
    if not np.isfinite(heights_m).any():
        return None
    step_m = ((high_m[0] - low_m[0]) / columns, (high_m[1] - low_m[1]) / rows)
    low, high = float(np.nanmin(heights_m)), float(np.nanmax(heights_m))
    interval_m = max(interval_for(high - low) if contour_m is None else contour_m, (high - low) / MOST_LINES)
    few = max(1, math.ceil(math.sqrt(heights_m.size / MOST_LINE_CELLS)))
    contours = _trace_contours(easts_m[::few], norths_m[::few], heights_m[::few, ::few], interval_m)
    return Hillshade(heights_m, shade_heights(heights_m, step_m), low_m, high_m, interval_m, contours)


def interval_for(relief_m: float) -> float:
    """Return the height between contour lines that suits an area whose heights differ by so much.

    >>> interval_for(6.0), interval_for(140.0), interval_for(2600.0)
    (0.5, 10.0, 200.0)
    """
    return next((step for step in STEPS_M if relief_m / step <= LINES), STEPS_M[-1])


def shade_heights(heights_m: npt.NDArray[np.float32], step_m: tuple[float, float]) -> npt.NDArray[np.uint8]:
    """Return (rows, columns, 2): how light every cell of a grid is, its northernmost row first, and how opaque.

    Args:
        heights_m: Of the ground.
        step_m: Width and height of a cell.
    """
    north, east = np.gradient(heights_m.astype(np.float64), -step_m[1], step_m[0])
    slope = np.hypot(north, east)
    steep = float(np.nanpercentile(slope, 90)) if np.isfinite(slope).any() else 0.0
    more = min(MOST_EXAGGERATION, max(1.0, GENTLE / steep)) if steep > 0.0 else 1.0
    from_rad, up_rad = math.radians(SUN_DEG), math.radians(SUN_UP_DEG)
    # The sun's direction against the normal of the ground, both of length 1.
    towards = more * (east * math.sin(from_rad) + north * math.cos(from_rad))
    light = (math.sin(up_rad) - math.cos(up_rad) * towards) / np.sqrt(1.0 + (more * slope) ** 2)
    known = np.isfinite(light)
    made = np.zeros((*heights_m.shape, 2), dtype=np.uint8)
    made[..., 0] = np.where(known, np.clip(light, 0.0, 1.0) * 255.0, 0.0)
    made[..., 1] = np.where(known, 255, 0)
    return made


def _trace_contours(
    easts_m: FloatArray, norths_m: FloatArray, heights_m: npt.NDArray[np.float32], interval_m: float
) -> tuple[Contour, ...]:
    from contourpy import LineType, contour_generator

    if min(heights_m.shape) < 2:
        return ()
    generator = contour_generator(
        easts_m, norths_m, np.ma.masked_invalid(heights_m), name="serial", line_type=LineType.Separate
    )
    first, last = math.ceil(np.nanmin(heights_m) / interval_m), math.floor(np.nanmax(heights_m) / interval_m)
    found = []
    for number in range(first, last + 1):
        for line in generator.lines(number * interval_m):
            places = tuple((round(float(e), 1), round(float(n), 1)) for e, n in np.asarray(line))
            found.append(Contour(round(number * interval_m, 2), places, number % BOLD == 0))
    return tuple(found)


def _compute_cell_middles(low: float, high: float, count: int) -> FloatArray:
    step = (high - low) / count
    return np.asarray(low + step * (np.arange(count) + 0.5), dtype=np.float64)
