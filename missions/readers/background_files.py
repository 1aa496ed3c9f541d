"""Read map backgrounds from GeoTIFF and MBTiles: imagery below the line, in the local metres of a frame.

Files may have any size: only the area around the line is read, at display resolution, from overviews or coarser tiles,
and resampled to the local plane.
"""

from __future__ import annotations

import math
import sqlite3
from dataclasses import dataclass
from html import unescape
from pathlib import Path
from re import sub
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt
import pyproj

from missions.errors import BackgroundError
from missions.files import to_printable
from missions.geo import FloatArray, LocalFrame
from missions.readers.archives import explaining_errors
from missions.readers.elevation_rasters import (
    check_georeference,
    find_window,
    locate_cells,
    measure_cell_m,
    open_raster,
)
from missions.readers.layer_files import SQLITE_MAGIC, open_sqlite

if TYPE_CHECKING:
    import rasterio
    from rasterio.windows import Window

Pixels = npt.NDArray[np.uint8]
Corner = tuple[float, float]
"""East and north in metres."""
NEEDS = "a GeoTIFF needs the extra maps: pip install rasterio pillow"
FORMATS = {
    b"II*\x00": "GTiff", b"MM\x00*": "GTiff", b"II+\x00": "GTiff", b"MM\x00+": "GTiff", SQLITE_MAGIC: "MBTiles",
}  # fmt: skip
"""GDAL's format names, by file signature."""
ZOOMS = 25
FINER = 1.3
"""Linear oversampling: pixels read per pixel displayed, at most."""
ALONG_M = 100.0
BEYOND_PIXELS = 2
MOST_READ = 2_000_000_000
"""Most pixels read from a window without overviews: a minute."""
TAGS = ("TIFFTAG_COPYRIGHT", "COPYRIGHT", "ATTRIBUTION", "attribution", "TIFFTAG_ARTIST", "description")
"""Metadata keys of the attribution; web maps use markup in it."""
DARK_PCT, BRIGHT_PCT = 1.0, 99.0
"""Percentiles that become black and white in pictures of more than 8 bits."""


@dataclass(frozen=True, slots=True, eq=False)
class Background:
    """Pixels on a square grid in the local plane."""

    pixels: Pixels
    """(rows, columns, 4): red, green, blue and opacity; the first row is the northernmost."""
    low_m: Corner
    """South-western corner: outer edges, not pixel centres."""
    high_m: Corner
    attribution: str = ""
    """Attribution from the file, on one line."""


@dataclass(frozen=True, slots=True)
class PictureArea:
    """The area of a picture to read."""

    frame: LocalFrame
    low_m: Corner
    high_m: Corner
    most_pixels: float

    def sample_places_deg(self) -> FloatArray:
        """Return (n, 2) latitude and longitude of places all over the area, its edges included."""
        easts, norths = (np.linspace(low, high, 33) for low, high in zip(self.low_m, self.high_m, strict=True))
        return self.frame.many_to_wgs84_deg(np.stack(np.meshgrid(easts, norths), axis=-1).reshape(-1, 2))


def choose_grid_size(low_m: Corner, high_m: Corner, most_pixels: float, least_step_m: float) -> tuple[int, int]:
    """Return rows and columns of a square grid over an area: as many as allowed, none finer than a step."""
    width_m, height_m = high_m[0] - low_m[0], high_m[1] - low_m[1]
    step_m = max(least_step_m, (width_m * height_m / most_pixels) ** 0.5, max(width_m, height_m) / 16_000)
    return max(2, round(height_m / step_m)), max(2, round(width_m / step_m))


def strip_markup(text: str) -> str:
    """Return a text without markup, on one line, truncated to fit a picture.

    >>> strip_markup('&copy; <a href="https://example.org">Survey</a>')
    '© Survey'
    """
    return to_printable(unescape(sub(r"<[^<>]*>", "", text)))[:200]


def read_background(path: Path, wanted: PictureArea) -> Background:
    """Return a file's picture of an area.

    Raises:
        BackgroundError: one line that names the file, the place in it and what was expected.
    """
    if not path.is_file():
        raise BackgroundError(f"{path}: file: expected a GeoTIFF or MBTiles; there is none")
    with path.open("rb") as file:
        head = file.read(16)
    driver = next((driver for begin, driver in FORMATS.items() if head.startswith(begin)), None)
    if driver is None:
        raise BackgroundError(f"{path}: content: expected a GeoTIFF or MBTiles, it begins like neither")
    zooms = _list_zooms(path) if driver == "MBTiles" else [None]
    what = "GeoTIFF" if driver == "GTiff" else "MBTiles of pictures (png, jpg or webp)"
    for zoom in zooms:
        with open_raster(path, (driver,), BackgroundError, what, NEEDS, zoom=zoom) as dataset:
            found = _read(path, dataset, wanted, may_be_coarser=zoom != zooms[-1])
            if found is not None:
                return found
    raise BackgroundError(f"{path}: area: expected a picture of the line's surroundings, it lies elsewhere")


def _list_zooms(path: Path) -> list[int | None]:
    """Return the tile zooms, the finest first."""
    zooms: list[int | None] = []
    words, reasons = f"{path}: content: expected MBTiles", (sqlite3.Error, sqlite3.Warning, OSError)
    with explaining_errors(words, *reasons, error=BackgroundError), open_sqlite(path) as database:
        next_zoom = "SELECT max(zoom_level) FROM tiles WHERE zoom_level < ?"
        while isinstance(zoom := database.execute(next_zoom, (zooms[-1] if zooms else ZOOMS,)).fetchone()[0], int):
            zooms.append(zoom)
    if not zooms:
        raise BackgroundError(f"{path}: tiles: expected zoom levels from 0 to {ZOOMS - 1}, found none")
    return zooms


def _read(
    path: Path, dataset: rasterio.DatasetReader, wanted: PictureArea, *, may_be_coarser: bool
) -> Background | None:
    """Return the area; None if it lies elsewhere, or coarser tiles show as much."""
    check_georeference(path, dataset, BackgroundError, "pixels")
    _check_bands(path, dataset)
    crs = pyproj.CRS.from_user_input(dataset.crs.to_wkt())
    window = find_window(dataset, locate_cells(dataset, crs, wanted.sample_places_deg()), BEYOND_PIXELS)
    if window is None:
        return None
    # Pixels of the file per output pixel, on a side.
    few = max(1.0, math.sqrt(window.width * window.height / wanted.most_pixels) / FINER)
    overviews = max([1, *dataset.overviews(1)])
    if window.width * window.height > MOST_READ * min(overviews, few) ** 2:
        raise BackgroundError(
            f"{path}: overviews: expected some in a picture of {dataset.width} by {dataset.height} pixels: gdaladdo "
            "makes them"
        )
    if may_be_coarser and few >= 2.0:
        return None
    shape = (max(1, round(window.height / few)), max(1, round(window.width / few)))
    # Approximate size of a pixel of the file on the ground, at the centre of the area.
    middle_m = np.mean([wanted.low_m, wanted.high_m], axis=0)
    lattice_m = middle_m + ALONG_M * np.array([(0.0, 0.0), (0.0, 1.0), (1.0, 0.0), (1.0, 1.0)])
    at = locate_cells(dataset, crs, wanted.frame.many_to_wgs84_deg(lattice_m))
    pixel_m = measure_cell_m(at.reshape(2, 2, 2), ALONG_M)
    if not math.isfinite(pixel_m):
        raise BackgroundError(f"{path}: crs: expected one that has places around the line")
    step_m = few * pixel_m
    made = _warp_to_plane(dataset, window, shape, wanted, step_m)
    if not made[3].any():
        raise BackgroundError(
            f"{path}: area: expected a picture of the line's surroundings, it shows none of them: empty, or damaged"
        )
    tags = dataset.tags()
    attribution = next((strip_markup(str(tags[tag])) for tag in TAGS if tags.get(tag)), "")
    return Background(np.moveaxis(made, 0, -1).copy(), wanted.low_m, wanted.high_m, attribution)


def _warp_to_plane(
    dataset: rasterio.DatasetReader, window: Window, shape: tuple[int, int], wanted: PictureArea, step_m: float
) -> Pixels:
    """Return (4, rows, columns) pixels of a window resampled to the local plane, no finer than a step."""
    from rasterio import Affine
    from rasterio.enums import Resampling
    from rasterio.warp import reproject

    own, across, down = dataset.transform, window.width / shape[1], window.height / shape[0]
    x, y = dataset.xy(window.row_off, window.col_off, offset="ul")
    rows, columns = choose_grid_size(wanted.low_m, wanted.high_m, wanted.most_pixels, step_m)
    made = np.zeros((4, rows, columns), dtype=np.uint8)
    frame, (west, south), (east, north) = wanted.frame, wanted.low_m, wanted.high_m
    reproject(
        np.moveaxis(_read_pixels(dataset, window, shape), -1, 0), made, resampling=Resampling.bilinear,
        src_crs=dataset.crs, src_transform=Affine(own.a * across, own.b * down, x, own.d * across, own.e * down, y),
        dst_crs=f"+proj=aeqd +lat_0={frame.lat_deg!r} +lon_0={frame.lon_deg!r} +datum=WGS84",
        dst_transform=Affine((east - west) / columns, 0.0, west, 0.0, (south - north) / rows, north),
    )  # fmt: skip
    return made


def _check_bands(path: Path, dataset: rasterio.DatasetReader) -> None:
    if dataset.count not in {1, 2, 3, 4}:
        raise BackgroundError(f"{path}: bands: expected one of grey, or three of colours, got {dataset.count}")
    kind = np.dtype(dataset.dtypes[0])
    if kind not in {np.dtype(np.uint8), np.dtype(np.uint16)}:
        raise BackgroundError(
            f"{path}: band 1: expected a picture of 8 or 16 bits, got {kind}: is it a raster of heights?"
        )


def _read_pixels(dataset: rasterio.DatasetReader, window: Window, shape: tuple[int, int]) -> Pixels:
    """Return (rows, columns, 4) pixels of a window."""
    from rasterio.enums import ColorInterp, Resampling

    palette = ColorInterp.palette in dataset.colorinterp
    way = Resampling.nearest if palette else Resampling.average
    read = dataset.read(window=window, out_shape=(dataset.count, *shape), resampling=way)
    known = dataset.dataset_mask(window=window, out_shape=shape, resampling=Resampling.nearest)
    if palette:
        colours = dataset.colormap(1)
        table = np.array([colours.get(value, (0, 0, 0, 0)) for value in range(256)], dtype=np.uint8)
        made = table[read[0].astype(np.uint8)]
    else:
        shown = read[[0, 0, 0]] if dataset.count < 3 else read[:3]
        made = np.empty((*shape, 4), dtype=np.uint8)
        made[..., :3] = np.moveaxis(_to_8_bits(shown, known > 0), 0, -1)
        made[..., 3] = 255
    made[..., 3] = np.minimum(made[..., 3], known)
    return np.asarray(made, dtype=np.uint8)


def _to_8_bits(read: np.ndarray[Any, np.dtype[Any]], known: np.ndarray[Any, np.dtype[np.bool_]]) -> Pixels:
    if read.dtype == np.uint8 or not known.any():
        return read.astype(np.uint8)
    dark, bright = np.percentile(read[:, known], [DARK_PCT, BRIGHT_PCT])
    stretched = (read.astype(np.float32) - dark) * (255.0 / max(1.0, bright - dark))
    return np.asarray(np.clip(stretched, 0, 255), dtype=np.uint8)
