"""Rasters by rasterio, whatever their cells hold: opened with little memory, and where places lie in them."""

from __future__ import annotations

import math
import warnings
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pyproj
from pyproj.exceptions import CRSError, ProjError

from missions.errors import MissionsError
from missions.files import to_printable
from missions.geo import FloatArray

if TYPE_CHECKING:
    import rasterio
    from rasterio.windows import Window


@contextmanager
def open_raster(
    path: Path,
    drivers: Sequence[str],
    error: type[MissionsError],
    what: str,
    needs: str,
    *,
    zoom: int | None = None,
    **options: str,
) -> Iterator[Any]:
    """Open a raster that knows where it lies; nothing that it names is fetched, for it is read by these drivers alone.

    Args:
        path: The file.
        drivers: GDAL's names of formats that hold their own content.
        error: What to raise.
        what: What is expected, for messages.
        needs: What is said where nothing is installed to read it with.
        zoom: Of tiles; None where there are none.
        options: Of GDAL.

    Raises:
        MissionsError: of the type that is given: it cannot be read, or lies nowhere.
    """
    try:
        from rasterio import Env
        from rasterio.errors import NotGeoreferencedWarning, RasterioError, RasterioIOError
        from rasterio.io import DatasetReader
    except ImportError:
        raise error(f"{path}: {needs}") from None
    try:
        # A small cache: blocks are read once, and in order.
        with warnings.catch_warnings(), Env(GDAL_CACHEMAX=64, GDAL_NUM_THREADS="1", **options):
            warnings.simplefilter("ignore", NotGeoreferencedWarning)  # it is refused in our own words
            tiles = {} if zoom is None else {"ZOOM_LEVEL": zoom}
            with DatasetReader(str(path.absolute()), driver=list(drivers), **tiles) as dataset:
                yield dataset
    except (RasterioError, CRSError, ProjError, ValueError) as reason:
        text = to_printable(str(reason.__cause__ or reason)).replace(str(path.absolute()), path.name)
        text = text if len(text) <= 160 else f"{text[:160]}..."
        whole = "whole " if isinstance(reason, RasterioIOError) else ""
        raise error(f"{path}: content: expected a {whole}{what}: {text}") from reason


def check_georeference(path: Path, dataset: rasterio.DatasetReader, error: type[MissionsError], cells: str) -> None:
    """Refuse a raster that does not say where its cells lie.

    Raises:
        MissionsError: of the type that is given.
    """
    if dataset.crs is None:
        raise error(f"{path}: crs: expected a coordinate reference system in the file, found none")
    transform = dataset.transform
    if not all(map(math.isfinite, tuple(transform)[:6])) or abs(transform.determinant) < 1e-18:
        raise error(f"{path}: transform: expected where its {cells} lie, found no usable one")
    if transform.is_identity:
        raise error(f"{path}: transform: expected where its {cells} lie, found none")


def locate_cells(dataset: rasterio.DatasetReader, level: pyproj.CRS, places_deg: FloatArray) -> FloatArray:
    """Return (m, 2) rows and columns in a raster of (m, 2) latitude and longitude; middles of cells are whole numbers.

    Args:
        dataset: The raster.
        level: The reference system of its places.
        places_deg: Which places.
    """
    to_raster = pyproj.Transformer.from_crs("EPSG:4326", level.to_2d(), always_xy=True)
    x, y = (np.asarray(value) for value in to_raster.transform(places_deg[:, 1], places_deg[:, 0]))
    if level.is_geographic:
        # Around the antimeridian both ways of counting degrees are in use.
        there = dataset.transform
        middle = there.a * dataset.width / 2 + there.b * dataset.height / 2 + there.c
        x = x + 360.0 * np.round((middle - x) / 360.0)
    back = ~dataset.transform
    columns = back.a * x + back.b * y + back.c - 0.5
    rows = back.d * x + back.e * y + back.f - 0.5
    return np.column_stack((rows, columns)).astype(np.float64)


def find_window(dataset: rasterio.DatasetReader, at: FloatArray, beyond: int) -> Window | None:
    """Return the part of a raster that holds (m, 2) rows and columns, and so many cells more; None if it holds none."""
    from rasterio.windows import Window

    at = at[np.isfinite(at).all(axis=1)]
    if not len(at):
        return None
    low = np.maximum(np.floor(at.min(axis=0)).astype(int) - beyond, 0)
    high = np.minimum(np.ceil(at.max(axis=0)).astype(int) + beyond + 1, [dataset.height, dataset.width])
    if (high <= low).any():
        return None
    return Window(int(low[1]), int(low[0]), int(high[1] - low[1]), int(high[0] - low[0]))


def measure_cell_m(at: FloatArray, step_m: float) -> float:
    """Return how large a cell is over the ground: the smaller of its sides; not a number where it has none.

    Args:
        at: (easts, norths, 2) rows and columns of a lattice of places; its middle is looked at.
        step_m: Between these.
    """
    e, n = at.shape[0] // 2 - 1, at.shape[1] // 2 - 1
    along_e, along_n = (at[e + 1, n] - at[e, n]) / step_m, (at[e, n + 1] - at[e, n]) / step_m
    cells = np.array([along_e, along_n]).T  # row and column a metre east, a metre north
    if not np.isfinite(cells).all() or abs(np.linalg.det(cells)) < 1e-15:
        return math.nan
    return float(np.hypot(*np.linalg.inv(cells)).min())
