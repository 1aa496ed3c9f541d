"""What is wanted of a picture of the ground, and what its file has of that."""

from __future__ import annotations

from dataclasses import dataclass
from html import unescape
from re import sub
from typing import TYPE_CHECKING

import numpy as np
import pyproj

from missions.background import Corner, Pixels
from missions.files import to_printable
from missions.geo import FloatArray, LocalFrame

if TYPE_CHECKING:
    from rasterio import Affine


@dataclass(frozen=True, slots=True)
class PictureArea:
    """What of a picture is wanted."""

    frame: LocalFrame
    low_m: Corner
    high_m: Corner
    most_pixels: float

    def sample_places_deg(self, count: int = 33) -> FloatArray:
        """Return (n, 2) latitude and longitude of places all over the area, its edges included."""
        easts, norths = (np.linspace(low, high, count) for low, high in zip(self.low_m, self.high_m, strict=True))
        return self.frame.many_to_wgs84_deg(np.stack(np.meshgrid(easts, norths), axis=-1).reshape(-1, 2))


@dataclass(frozen=True, slots=True, eq=False)
class PictureWindow:
    """Pixels as their file has them, of about the area that is wanted."""

    pixels: Pixels
    """(rows, columns, 4)"""
    crs: pyproj.CRS
    transform: Affine
    """From column and row, whole numbers at edges of pixels, to places in that system."""
    step_m: float
    """The side of a pixel over the ground, about."""
    attribution: str


def strip_markup(text: str) -> str:
    """Return a text without markup, on one line, no longer than a picture has room for.

    >>> plain('&copy; <a href="https://example.org">Survey</a>')
    '© Survey'
    """
    return to_printable(unescape(sub(r"<[^<>]*>", "", text)))[:200]
