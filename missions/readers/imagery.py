"""GeoTIFF pictures, such as orthophotos: a window is read with no more pixels than are shown, from overviews."""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pyproj

from missions.background import PictureArea, PictureWindow, Pixels, strip_markup
from missions.errors import BackgroundError
from missions.readers.rasters import check_georeference, find_window, locate_cells, measure_cell_m, open_raster

if TYPE_CHECKING:
    import rasterio
    from rasterio.windows import Window

NEEDS = "a GeoTIFF needs the extra maps: pip install rasterio pillow"
FINER = 1.3
"""A picture is read with so many more pixels than are shown at the most, on a side."""
ALONG_M = 100.0
BEYOND_PIXELS = 2
MOST_READ = 2_000_000_000
"""Pixels of a window that are read where there are no overviews: a minute."""
TAGS = ("TIFFTAG_COPYRIGHT", "COPYRIGHT", "ATTRIBUTION", "attribution", "TIFFTAG_ARTIST")
"""Where files say whom they are by."""
DARK_PCT, BRIGHT_PCT = 1.0, 99.0
"""Of pictures of more than 8 bits: what becomes black and white."""


def read_imagery(path: Path, wanted: PictureArea) -> PictureWindow:
    """Return the pixels of an area.

    Raises:
        BackgroundError: one line that names the file, the band and what was expected.
    """
    from rasterio import Affine

    with open_raster(path, ("GTiff",), BackgroundError, "GeoTIFF", NEEDS) as dataset:
        check_georeference(path, dataset, BackgroundError, "pixels")
        _check_bands(path, dataset)
        crs = pyproj.CRS.from_user_input(dataset.crs.to_wkt())
        window = find_window(dataset, locate_cells(dataset, crs, wanted.sample_places_deg()), BEYOND_PIXELS)
        if window is None:
            raise BackgroundError(f"{path}: area: expected a picture of the line's surroundings, it lies elsewhere")
        few = _decimation(path, dataset, window, wanted)
        shape = (max(1, round(window.height / few)), max(1, round(window.width / few)))
        pixels = _read_pixels(dataset, window, shape)
        own, across, down = dataset.transform, window.width / shape[1], window.height / shape[0]
        x, y = dataset.xy(window.row_off, window.col_off, offset="ul")
        transform = Affine(own.a * across, own.b * down, x, own.d * across, own.e * down, y)
        tags = dataset.tags()
        attribution = next((strip_markup(str(tags[tag])) for tag in TAGS if tags.get(tag)), "")
        return PictureWindow(pixels, crs, transform, few * _pixel_m(path, dataset, crs, wanted), attribution)


def _check_bands(path: Path, dataset: rasterio.DatasetReader) -> None:
    if dataset.count not in {1, 2, 3, 4}:
        raise BackgroundError(f"{path}: bands: expected one of grey, or three of colours, got {dataset.count}")
    kind = np.dtype(dataset.dtypes[0])
    if kind not in {np.dtype(np.uint8), np.dtype(np.uint16)}:
        raise BackgroundError(
            f"{path}: band 1: expected a picture of 8 or 16 bits, got {kind}: is it a raster of heights?"
        )


def _pixel_m(path: Path, dataset: rasterio.DatasetReader, crs: pyproj.CRS, wanted: PictureArea) -> float:
    """Return about how large a pixel of the file is over the ground, in the middle of the area."""
    middle_m = np.mean([wanted.low_m, wanted.high_m], axis=0)
    lattice_m = middle_m + ALONG_M * np.array([(0.0, 0.0), (0.0, 1.0), (1.0, 0.0), (1.0, 1.0)])
    at = locate_cells(dataset, crs, wanted.frame.many_to_wgs84_deg(lattice_m))
    pixel_m = measure_cell_m(at.reshape(2, 2, 2), ALONG_M)
    if not math.isfinite(pixel_m):
        raise BackgroundError(f"{path}: crs: expected one that has places around the line")
    return pixel_m


def _decimation(path: Path, dataset: rasterio.DatasetReader, window: Window, wanted: PictureArea) -> float:
    """Return how many pixels of the file become one, on a side."""
    few = max(1.0, math.sqrt(window.width * window.height / wanted.most_pixels) / FINER)
    overviews = max([1, *dataset.overviews(1)])
    if window.width * window.height > MOST_READ * min(overviews, few) ** 2:
        raise BackgroundError(
            f"{path}: overviews: expected some in a picture of {dataset.width} by {dataset.height} pixels: gdaladdo "
            "makes them"
        )
    return few


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
