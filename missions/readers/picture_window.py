"""What is wanted of a picture of the ground, and what its file has of that."""

from __future__ import annotations

from dataclasses import dataclass
from html import unescape
from re import sub

import numpy as np
import pyproj

from missions.background import Corner, Pixels, choose_grid_size
from missions.files import to_printable
from missions.geo import FloatArray, LocalFrame


@dataclass(frozen=True, slots=True)
class PictureArea:
    """What of a picture is wanted."""

    frame: LocalFrame
    low_m: Corner
    high_m: Corner
    most_pixels: float

    @property
    def step_m(self) -> float:
        """The side of the finest pixels that are wanted."""
        rows, _ = choose_grid_size(self.low_m, self.high_m, self.most_pixels, 0.0)
        return (self.high_m[1] - self.low_m[1]) / rows

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
    to_pixels: tuple[float, float, float, float, float, float]
    """Column = a x + b y + c, row = d x + e y + f; whole numbers are edges of pixels."""
    step_m: float
    """The side of a pixel over the ground, about."""
    attribution: str


def project_degrees(crs: pyproj.CRS, places_deg: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return x and y, east before north, of (n, 2) latitude and longitude in a reference system."""
    transformer = pyproj.Transformer.from_crs("EPSG:4326", crs.to_2d(), always_xy=True)
    x, y = transformer.transform(places_deg[:, 1], places_deg[:, 0])
    return np.asarray(x, dtype=np.float64), np.asarray(y, dtype=np.float64)


def strip_markup(text: str) -> str:
    """Return a text without markup, on one line, no longer than a picture has room for.

    >>> plain('&copy; <a href="https://example.org">Survey</a>')
    '© Survey'
    """
    return to_printable(unescape(sub(r"<[^<>]*>", "", text)))[:200]
