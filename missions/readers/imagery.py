"""GeoTIFF pictures, such as orthophotos: a window is read with no more pixels than are shown, from overviews."""

from __future__ import annotations

import math
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pyproj
from pyproj.exceptions import CRSError, ProjError

from missions.background import Pixels
from missions.errors import BackgroundError
from missions.files import to_printable
from missions.readers.picture_window import PictureArea, PictureWindow, project_degrees, strip_markup

if TYPE_CHECKING:
    import rasterio
    from rasterio.windows import Window

NEEDS = "a GeoTIFF needs the extra maps: pip install rasterio pillow"
FINER = 1.3
"""A picture is read with so many more pixels than are shown at the most, on a side."""
ALONG_M = 100.0
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
    with _open_picture(path) as dataset:
        crs = _read_system(path, dataset)
        window = _find_window(path, dataset, crs, wanted)
        few = _decimation(path, dataset, window, wanted)
        shape = (max(1, round(window.height / few)), max(1, round(window.width / few)))
        pixels = _read_pixels(dataset, window, shape)
        back = ~dataset.transform
        across, down = shape[1] / window.width, shape[0] / window.height
        to_pixels = (
            back.a * across, back.b * across, (back.c - window.col_off) * across,
            back.d * down, back.e * down, (back.f - window.row_off) * down,
        )  # fmt: skip
        tags = dataset.tags()
        attribution = next((strip_markup(str(tags[tag])) for tag in TAGS if tags.get(tag)), "")
        return PictureWindow(pixels, crs, to_pixels, few * _step_m(path, dataset, crs, wanted), attribution)


@contextmanager
def _open_picture(path: Path) -> Iterator[Any]:
    try:
        import rasterio
        from rasterio.errors import NotGeoreferencedWarning, RasterioError
        from rasterio.io import DatasetReader
    except ImportError:
        raise BackgroundError(f"{path}: {NEEDS}") from None
    # A small cache, and one driver: a raster that names others could fetch them from anywhere.
    options = {"GDAL_CACHEMAX": 64, "GDAL_NUM_THREADS": "1"}
    try:
        with warnings.catch_warnings(), rasterio.Env(**options):
            warnings.simplefilter("ignore", NotGeoreferencedWarning)  # it is refused in our own words
            with DatasetReader(str(path.absolute()), driver=["GTiff"]) as dataset:
                yield dataset
    except (RasterioError, CRSError, ProjError, ValueError) as error:
        text = to_printable(str(error.__cause__ or error)).replace(str(path.absolute()), path.name)[:160]
        raise BackgroundError(f"{path}: content: expected a whole GeoTIFF: {text}") from error


def _read_system(path: Path, dataset: rasterio.DatasetReader) -> pyproj.CRS:
    if dataset.crs is None:
        raise BackgroundError(f"{path}: crs: expected a coordinate reference system in the file, found none")
    transform = dataset.transform
    if transform.is_identity or not all(map(math.isfinite, tuple(transform)[:6])) or abs(transform.determinant) < 1e-18:
        raise BackgroundError(f"{path}: transform: expected where its pixels lie, found no usable one")
    crs = pyproj.CRS.from_user_input(dataset.crs.to_wkt())
    if dataset.count not in {1, 2, 3, 4}:
        raise BackgroundError(f"{path}: bands: expected one of grey, or three of colours, got {dataset.count}")
    kind = np.dtype(dataset.dtypes[0])
    if kind not in {np.dtype(np.uint8), np.dtype(np.uint16)}:
        raise BackgroundError(
            f"{path}: band 1: expected a picture of 8 or 16 bits, got {kind}: is it a raster of heights?"
        )
    return crs


def _find_window(path: Path, dataset: rasterio.DatasetReader, crs: pyproj.CRS, wanted: PictureArea) -> Window:
    from rasterio.windows import Window

    x, y = project_degrees(crs, wanted.sample_places_deg())
    back = ~dataset.transform
    columns, rows = back.a * x + back.b * y + back.c, back.d * x + back.e * y + back.f
    known = np.isfinite(columns) & np.isfinite(rows)
    if known.any():
        left, right = (int(v) for v in np.clip([columns[known].min() - 2, columns[known].max() + 2], 0, dataset.width))
        top, bottom = (int(v) for v in np.clip([rows[known].min() - 2, rows[known].max() + 2], 0, dataset.height))
        if right > left and bottom > top:
            return Window(left, top, right - left, bottom - top)
    raise BackgroundError(f"{path}: area: expected a picture of the line's surroundings, it lies elsewhere")


def _step_m(path: Path, dataset: rasterio.DatasetReader, crs: pyproj.CRS, wanted: PictureArea) -> float:
    """Return about how large a pixel of the file is over the ground, in the middle of the area."""
    middle_m = np.mean([wanted.low_m, wanted.high_m], axis=0)
    along_m = middle_m + np.array([[0.0, 0.0], [0.0, ALONG_M]])
    x, y = project_degrees(crs, wanted.frame.many_to_wgs84_deg(along_m))
    back = ~dataset.transform
    pixels = math.hypot(
        back.a * (x[1] - x[0]) + back.b * (y[1] - y[0]), back.d * (x[1] - x[0]) + back.e * (y[1] - y[0])
    )
    if not math.isfinite(pixels) or pixels <= 0.0:
        raise BackgroundError(f"{path}: crs: expected one that has places around the line")
    return ALONG_M / pixels


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
