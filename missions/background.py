"""A picture of the ground, in the local metres of a frame: what lies below the line on maps, and how it is read."""

from __future__ import annotations

from dataclasses import dataclass
from html import unescape
from re import sub

import numpy as np
import numpy.typing as npt

from missions.files import to_printable
from missions.geo import FloatArray, LocalFrame

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


@dataclass(frozen=True, slots=True)
class PictureArea:
    """What of a picture is wanted."""

    frame: LocalFrame
    low_m: Corner
    high_m: Corner
    most_pixels: float

    def sample_places_deg(self) -> FloatArray:
        """Return (n, 2) latitude and longitude of places all over the area, its edges included."""
        easts, norths = (np.linspace(low, high, 33) for low, high in zip(self.low_m, self.high_m, strict=True))
        return self.frame.many_to_wgs84_deg(np.stack(np.meshgrid(easts, norths), axis=-1).reshape(-1, 2))


def choose_grid_size(low_m: Corner, high_m: Corner, most_pixels: float, least_step_m: float) -> tuple[int, int]:
    """Return rows and columns of a square grid over an area: as many as are allowed, none finer than a step."""
    width_m, height_m = high_m[0] - low_m[0], high_m[1] - low_m[1]
    step_m = max(least_step_m, (width_m * height_m / most_pixels) ** 0.5, max(width_m, height_m) / 16_000)
    return max(2, round(height_m / step_m)), max(2, round(width_m / step_m))


def strip_markup(text: str) -> str:
    """Return a text without markup, on one line, no longer than a picture has room for.

    >>> strip_markup('&copy; <a href="https://example.org">Survey</a>')
    '© Survey'
    """
    return to_printable(unescape(sub(r"<[^<>]*>", "", text)))[:200]
