"""A picture of the ground, in the local metres of a frame: what lies below the line on maps."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

Pixels = npt.NDArray[np.uint8]
Corner = tuple[float, float]
"""East and north in metres."""


@dataclass(frozen=True, slots=True, eq=False)
class Background:
    """Pixels that lie square in the local plane."""

    pixels: Pixels
    """(rows, columns, 4): red, green, blue and opacity; the first row is the northernmost."""
    low_m: Corner
    """South-western corner: outer edges, not middles of pixels."""
    high_m: Corner
    attribution: str = ""
    """Whom the picture is by, as its file says it; on one line."""


def choose_grid_size(low_m: Corner, high_m: Corner, most_pixels: float, least_step_m: float) -> tuple[int, int]:
    """Return rows and columns of a square grid over an area: as many as are allowed, none finer than a step."""
    width_m, height_m = high_m[0] - low_m[0], high_m[1] - low_m[1]
    step_m = max(least_step_m, (width_m * height_m / most_pixels) ** 0.5, max(width_m, height_m) / 16_000)
    return max(2, round(height_m / step_m)), max(2, round(width_m / step_m))
