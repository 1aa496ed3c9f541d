"""Read rasters with rasterio: open them with little memory, locate places in them, and read ground heights.

Height formats are GeoTIFF and COG, SRTM .hgt, DTED and ASCII grids; only the area around the flights is read. Heights
are returned above mean sea level. Their vertical reference comes from the file, its product, or the site; ellipsoidal
heights are converted if PROJ has a geoid on this computer. The rasters that a run stores with its plan are in numpy's
own format, readable without a raster library.
"""

from __future__ import annotations

import io
import json
import math
import re
import warnings
import zipfile
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from functools import lru_cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pyproj
from pyproj.exceptions import CRSError, ProjError

from missions.errors import ElevationError, MissionsError
from missions.files import stamp_file, to_printable, write_whole
from missions.geo import FloatArray, LocalFrame
from missions.terrain import Elevation, Heights, Tile

if TYPE_CHECKING:
    import rasterio
    from rasterio.windows import Window

NEEDS = "a raster needs the extra terrain: pip install rasterio"
KEPT_SUFFIX = ".npz"
DRIVERS = ("GTiff", "SRTMHGT", "DTED", "AAIGrid")
"""GDAL drivers of self-contained formats: a raster that refers to others could fetch them from anywhere."""
SUFFIXES = frozenset({".tif", ".tiff", ".hgt", ".dt0", ".dt1", ".dt2", ".asc", KEPT_SUFFIX})
"""File suffixes read from a folder."""
MOST_FILES = 500
MOST_CELLS = 9_000_000
"""Most cells kept of one raster; with more, blocks of cells are combined to their highest."""
LEAST_CELL_M = 5.0
"""Least cell size; smaller cells are combined: no vehicle flies close enough to the ground to need more."""
STRIP_CELLS = 2_000_000
LATTICE_M = 1000.0
LATTICE_NODES = 400
BEYOND_CELLS = 3
"""Cells read around the area, for the cells around its outermost places."""
LOWEST_M, HIGHEST_M = -500.0, 9000.0
"""Plausible range of ground heights: the Dead Sea's shore and Mount Everest."""
EGM2008, EGM96, ELLIPSOID = "egm2008", "egm96", "ellipsoid"
VERTICALS = {EGM2008: "EGM2008", EGM96: "EGM96", ELLIPSOID: "the ellipsoid"}
"""Vertical references by the site's keyword, and their display names."""
CODES = {"EPSG:3855": EGM2008, "EPSG:5773": EGM96, "EPSG:5171": EGM96}
BETWEEN_GEOIDS_M = 1.0
"""EGM96, EGM2008 and national levelled heights differ by less than this nearly everywhere."""
UNITS_M = {"": 1.0, "m": 1.0, "metre": 1.0, "meter": 1.0, "metres": 1.0, "meters": 1.0, "ft": 0.3048, "foot": 0.3048,
           "feet": 0.3048, "us-ft": 1200 / 3937, "us survey foot": 1200 / 3937}  # fmt: skip
GRIDS = ("us_nga_egm96_15.tif", "egm96_15.gtx", "us_nga_egm08_25.tif", "egm08_25.gtx")
"""Geoid grids for the conversion of heights; the first available is used."""
FORMAT = "faultline-terrain/1"
MOST_BYTES = 1_000_000_000
"""Greatest unpacked size of an archive: twice what reading keeps of the largest area."""
SAME_DEG = 1e-9
UNREADABLE = (OSError, ValueError, KeyError, TypeError, EOFError, zipfile.BadZipFile, NotImplementedError, RuntimeError)


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
    """Open a georeferenced raster; nothing that it refers to is fetched, because only these drivers may read it.

    Args:
        path: The file.
        drivers: GDAL's names of self-contained formats.
        error: Type to raise.
        what: The expected content, for messages.
        needs: Message if no library is installed to read it.
        zoom: Tile zoom; None where there are no tiles.
        options: GDAL options.

    Raises:
        MissionsError: of the given type: it cannot be read, or is not georeferenced.
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
            warnings.simplefilter("ignore", NotGeoreferencedWarning)  # refused with our own message
            tiles = {} if zoom is None else {"ZOOM_LEVEL": zoom}
            with DatasetReader(str(path.absolute()), driver=list(drivers), **tiles) as dataset:
                yield dataset
    except (RasterioError, CRSError, ProjError, ValueError) as reason:
        text = to_printable(str(reason.__cause__ or reason)).replace(str(path.absolute()), path.name)
        text = text if len(text) <= 160 else f"{text[:160]}..."
        whole = "whole " if isinstance(reason, RasterioIOError) else ""
        raise error(f"{path}: content: expected a {whole}{what}: {text}") from reason


def check_georeference(path: Path, dataset: rasterio.DatasetReader, error: type[MissionsError], cells: str) -> None:
    """Refuse a raster without georeference.

    Raises:
        MissionsError: of the given type.
    """
    if dataset.crs is None:
        raise error(f"{path}: crs: expected a coordinate reference system in the file, found none")
    transform = dataset.transform
    if not all(map(math.isfinite, tuple(transform)[:6])) or abs(transform.determinant) < 1e-18:
        raise error(f"{path}: transform: expected where its {cells} lie, found no usable one")
    if transform.is_identity:
        raise error(f"{path}: transform: expected where its {cells} lie, found none")


def locate_cells(dataset: rasterio.DatasetReader, level: pyproj.CRS, places_deg: FloatArray) -> FloatArray:
    """Return (m, 2) rows and columns in a raster of (m, 2) latitude and longitude; cell centres are whole numbers.

    Args:
        dataset: The raster.
        level: The horizontal reference system.
        places_deg: The places.
    """
    to_raster = pyproj.Transformer.from_crs("EPSG:4326", level.to_2d(), always_xy=True)
    x, y = (np.asarray(value) for value in to_raster.transform(places_deg[:, 1], places_deg[:, 0]))
    if level.is_geographic:
        # Around the antimeridian both conventions for degrees are in use.
        there = dataset.transform
        middle = there.a * dataset.width / 2 + there.b * dataset.height / 2 + there.c
        x = x + 360.0 * np.round((middle - x) / 360.0)
    back = ~dataset.transform
    columns = back.a * x + back.b * y + back.c - 0.5
    rows = back.d * x + back.e * y + back.f - 0.5
    return np.column_stack((rows, columns)).astype(np.float64)


def find_window(dataset: rasterio.DatasetReader, at: FloatArray, beyond: int) -> Window | None:
    """Return the part of a raster with (m, 2) rows and columns, plus a margin of cells; None if it holds none."""
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
    """Return the cell size over the ground: its smaller side; NaN if it has none.

    Args:
        at: (easts, norths, 2) rows and columns of a lattice of places; its centre is evaluated.
        step_m: Spacing of the lattice.
    """
    e, n = at.shape[0] // 2 - 1, at.shape[1] // 2 - 1
    along_e, along_n = (at[e + 1, n] - at[e, n]) / step_m, (at[e, n + 1] - at[e, n]) / step_m
    cells = np.array([along_e, along_n]).T  # row and column per metre east and north
    if not np.isfinite(cells).all() or abs(np.linalg.det(cells)) < 1e-15:
        return math.nan
    return float(np.hypot(*np.linalg.inv(cells)).min())


@dataclass(frozen=True, slots=True)
class RasterProduct:
    """A publicly available raster, recognized by its file name."""

    words: str
    name: re.Pattern[str]
    vertical: str
    uncertainty_m: float
    """Linear error at 90 %, by its specification."""


PRODUCTS = (
    # Copernicus DEM product handbook: absolute vertical accuracy < 4 m, 90 % linear error, of both resolutions.
    RasterProduct("Copernicus GLO-30", re.compile(r"Copernicus_DSM_(COG_)?10_", re.IGNORECASE), EGM2008, 4.0),
    RasterProduct("Copernicus GLO-90", re.compile(r"Copernicus_DSM_(COG_)?30_", re.IGNORECASE), EGM2008, 4.0),
    # The mission's specification: 16 m absolute; measured values are better, by continent 6 to 9 m.
    RasterProduct("SRTM", re.compile(r"^[NS]\d{2}[EW]\d{3}.*\.hgt$|^srtm_", re.IGNORECASE), EGM96, 16.0),
)


@dataclass(frozen=True, slots=True)
class RasterOptions:
    """How to read rasters."""

    frame: LocalFrame
    """Frame of the area's metres."""
    low_m: tuple[float, float]
    """South-western corner of the area."""
    high_m: tuple[float, float]
    vertical: str = "file"
    """Vertical reference if the files do not state it, or state it wrongly."""
    uncertainty_m: float | None = None
    """Error that 90 % of the heights stay within; None: the product's."""


@dataclass(frozen=True, slots=True)
class _RasterPart:
    tile: Tile
    vertical: str
    uncertainty_m: float
    remarks: tuple[str, ...] = ()


def read_elevation(paths: Sequence[Path], reading: RasterOptions) -> Elevation:
    """Read rasters over an area; the last result is cached until its files change.

    Args:
        paths: Files, or folders of them.
        reading: The area, and data missing in the files.

    Raises:
        ElevationError: one line that names the file, the place in it and what was expected.
    """
    files = _list_files(paths)
    if len(files) == 1 and files[0].suffix == KEPT_SUFFIX:
        return read_kept_ground(files[0], reading.frame)
    return _read_all(paths[0], tuple(files), tuple(stamp_file(one) for one in files), reading)


@lru_cache(maxsize=1)
def _read_all(
    asked: Path, files: tuple[Path, ...], _: tuple[tuple[int, int] | None, ...], reading: RasterOptions
) -> Elevation:
    found = [part for path in files if (part := _read(path, reading)) is not None]
    names = files[0].name if len(files) == 1 else f"{len(files)} rasters"
    if not found:
        south, west = reading.frame.to_wgs84_deg(*reading.low_m)
        north, east = reading.frame.to_wgs84_deg(*reading.high_m)
        raise ElevationError(
            f"{asked}: area: expected heights between {south:.4f}, {west:.4f} and {north:.4f}, {east:.4f}, but "
            f"{names if len(files) > 1 else 'the raster'} {'know' if len(files) > 1 else 'knows'} none of it"
        )
    return Elevation(
        frame=LocalFrame(reading.frame.lat_deg, reading.frame.lon_deg),
        tiles=tuple(sorted((one.tile for one in found), key=lambda tile: tile.cell_m)),
        source=names,
        vertical=", ".join(dict.fromkeys(one.vertical for one in found)),
        uncertainty_m=max(one.uncertainty_m for one in found),
        remarks=tuple(dict.fromkeys(remark for one in found for remark in one.remarks)),
    )


def _list_files(paths: Sequence[Path]) -> list[Path]:
    files: list[Path] = []
    for path in paths:
        if not path.exists():
            raise ElevationError(f"{path}: file: expected a raster of heights, or a folder of them; there is none")
        if path.is_dir():
            own = sorted(one for one in path.iterdir() if one.suffix.lower() in SUFFIXES and one.is_file())
            if not own:
                raise ElevationError(f"{path}: folder: expected rasters ({', '.join(sorted(SUFFIXES))}), found none")
            files += own
        elif not path.is_file():
            raise ElevationError(f"{path}: file: expected a raster of heights: it is a device or a pipe")
        else:
            files.append(path)
    if len(files) > MOST_FILES:
        raise ElevationError(f"{paths[0]}: files: expected at most {MOST_FILES} rasters, found {len(files)}")
    kept = [path for path in files if path.suffix == KEPT_SUFFIX]
    if kept and len(files) > 1:
        raise ElevationError(f"{kept[0]}: file: expected only the raster that the run has kept")
    return files


def _read(path: Path, reading: RasterOptions) -> _RasterPart | None:
    """Return a file's part of the area; None if it has none."""
    # Do not search for sidecar files.
    with open_raster(
        path, DRIVERS, ElevationError, "raster of heights", NEEDS, GDAL_DISABLE_READDIR_ON_OPEN="EMPTY_DIR"
    ) as dataset:
        _check_kind(path, dataset)
        product = next((one for one in PRODUCTS if one.name.search(path.name)), None)
        level, vertical_crs = _read_systems(path, dataset)
        vertical, more_m = _determine_vertical(path, vertical_crs, product, reading)
        known_m = reading.uncertainty_m
        if known_m is None and product is None:
            raise ElevationError(
                f"{path}: uncertainty_m: expected the raster's own, in metres: only those of GLO-30 and SRTM are known"
            )
        uncertainty_m = more_m + (product.uncertainty_m if known_m is None and product is not None else known_m or 0.0)
        unit_m = _unit_m(path, dataset, vertical_crs)
        tile = _build_tile(path, dataset, level, reading, unit_m)
        if tile is None:
            return None
        words = VERTICALS.get(vertical, vertical)
        if vertical == ELLIPSOID:
            tile, off_m = convert_to_sea_level(path, tile, reading.frame)
            uncertainty_m += off_m
        remarks = []
        if more_m:
            remarks.append(
                f"{words} and the vehicles' sea level (EGM96) are taken for one: {more_m:g} m more uncertain"
            )
        return _RasterPart(tile, words, uncertainty_m, tuple(remarks))


def _check_kind(path: Path, dataset: rasterio.DatasetReader) -> None:
    if dataset.count != 1:
        raise ElevationError(f"{path}: bands: expected one, of heights, found {dataset.count}: is it a picture?")
    kind = np.dtype(dataset.dtypes[0])
    if kind.kind not in "iuf" or kind.itemsize < 2:
        raise ElevationError(
            f"{path}: band 1: expected heights as whole numbers of 16 bits or more, or floats, got {kind}"
        )
    check_georeference(path, dataset, ElevationError, "cells")


def _read_systems(path: Path, dataset: rasterio.DatasetReader) -> tuple[pyproj.CRS, pyproj.CRS | None]:
    """Return the horizontal and the vertical reference system; the latter only if stated in the file."""
    system = pyproj.CRS.from_user_input(dataset.crs.to_wkt())
    parts = system.sub_crs_list if system.is_compound else [system]
    level = parts[0]
    base = level.source_crs if level.is_bound else level
    if base is None or not (base.is_projected or base.is_geographic):
        raise ElevationError(f"{path}: crs: expected a map grid or degrees, got {to_printable(system.name)!r}")
    if len(parts) > 1:
        return level, parts[1]
    return level, (level if len(level.axis_info) == 3 else None)


def _determine_vertical(
    path: Path, said: pyproj.CRS | None, product: RasterProduct | None, reading: RasterOptions
) -> tuple[str, float]:
    """Return the vertical reference of the heights, and the uncertainty that it adds."""
    if reading.vertical != "file":
        vertical = reading.vertical
    elif said is not None and (not said.is_vertical or "ellips" in said.name.lower()):
        vertical = ELLIPSOID  # by its name, or by three axes over an ellipsoid
    elif said is not None:
        vertical = CODES.get(":".join(said.to_authority(min_confidence=70) or ()), to_printable(said.name))
    elif product is not None:
        vertical = product.vertical
    else:
        raise ElevationError(
            f"{path}: vertical: expected what its heights are counted from, but the file does not say: "
            f"[terrain] vertical says so, one of {', '.join(VERTICALS)}"
        )
    return vertical, 0.0 if vertical == EGM96 else BETWEEN_GEOIDS_M


def _unit_m(path: Path, dataset: rasterio.DatasetReader, vertical: pyproj.CRS | None) -> float:
    said = (dataset.units[0] or "").strip().lower()
    if said not in UNITS_M:
        raise ElevationError(f"{path}: band 1: expected heights in metres or feet, got {to_printable(said)!r}")
    if said == "" and vertical is not None:
        return float(vertical.axis_info[-1].unit_conversion_factor)
    return UNITS_M[said]


def _build_tile(
    path: Path, dataset: rasterio.DatasetReader, level: pyproj.CRS, reading: RasterOptions, unit_m: float
) -> Tile | None:
    low_m, high_m = np.array(reading.low_m), np.array(reading.high_m)
    step_m = max(LATTICE_M, float((high_m - low_m).max()) / LATTICE_NODES)
    low_m = low_m - step_m
    counts = np.ceil((high_m - low_m) / step_m).astype(int) + 2
    nodes = np.stack(
        np.meshgrid(*(low_m[axis] + step_m * np.arange(counts[axis]) for axis in (0, 1)), indexing="ij"), axis=-1
    )
    places_deg = reading.frame.many_to_wgs84_deg(nodes.reshape(-1, 2))
    at = locate_cells(dataset, level, places_deg).reshape(nodes.shape)
    inner = at[1:-1, 1:-1] if min(at.shape[:2]) > 2 and np.isfinite(at[1:-1, 1:-1]).all() else at
    window = find_window(dataset, inner.reshape(-1, 2), BEYOND_CELLS)
    if window is None:
        return None
    cell_m = measure_cell_m(at, step_m)
    if not math.isfinite(cell_m) or cell_m <= 0:
        raise ElevationError(f"{path}: crs: expected cells that have places around the network, found none")
    few = max(1, math.ceil(math.sqrt(window.width * window.height / MOST_CELLS)), round(LEAST_CELL_M / cell_m))
    mean_m, most_m = _read_heights(path, dataset, window, few, unit_m)
    lattice = (at - np.array([window.row_off, window.col_off]) + 0.5) / few - 0.5
    return Tile(mean_m, most_m, (float(low_m[0]), float(low_m[1])), step_m, lattice, cell_m * few)


def _read_heights(
    path: Path, dataset: rasterio.DatasetReader, window: Window, few: int, unit_m: float
) -> tuple[Heights, Heights]:
    """Return the mean and the highest height of each square block of cells; the same array if nothing is combined.

    If one cell of a block is unknown, the block is unknown.
    """
    from rasterio.windows import Window

    rows, columns = math.ceil(window.height / few), math.ceil(window.width / few)
    mean_m = np.empty((rows, columns), dtype=np.float32)
    most_m = mean_m if few == 1 else np.empty((rows, columns), dtype=np.float32)
    scale, offset = dataset.scales[0], dataset.offsets[0]
    at_once = max(1, STRIP_CELLS // (window.width * few))
    for first in range(0, rows, at_once):
        last = min(rows, first + at_once)
        top = first * few
        part = Window(
            window.col_off, window.row_off + top, window.width, min(window.height, last * few) - top
        )  # fmt: skip
        read = dataset.read(1, window=part, masked=True)
        values = np.ma.getdata(read).astype(np.float32) * np.float32(scale * unit_m) + np.float32(offset * unit_m)
        values[np.ma.getmaskarray(read) | ~np.isfinite(values)] = np.nan
        _check_values(path, dataset, part, values)
        # Tenths of a metre, rounded up: far below any raster's accuracy, and compact when stored.
        values = np.ceil(values * np.float32(10.0)) / np.float32(10.0)
        if few > 1:
            height, width = (last - first) * few, columns * few
            values = np.pad(values, ((0, height - values.shape[0]), (0, width - values.shape[1])), mode="edge")
            blocks = values.reshape(last - first, few, columns, few)
            most_m[first:last] = blocks.max(axis=(1, 3))
            values = blocks.mean(axis=(1, 3))
        mean_m[first:last] = values
    return mean_m, most_m


def _check_values(path: Path, dataset: rasterio.DatasetReader, part: Window, values: Heights) -> None:
    wrong = (values < LOWEST_M) | (values > HIGHEST_M)
    if not wrong.any():
        return
    row, column = (int(value) for value in np.argwhere(wrong)[0])
    raise ElevationError(
        f"{path}: row {part.row_off + row}, column {part.col_off + column}: expected metres above sea level from "
        f"{LOWEST_M:g} to {HIGHEST_M:g}, got {values[row, column]:g}: is it a no-data value that the file does not "
        f"declare (its own is {'none' if dataset.nodata is None else format(dataset.nodata, 'g')})?"
    )


def convert_to_sea_level(path: Path, tile: Tile, frame: LocalFrame) -> tuple[Tile, float]:
    """Return a tile with ellipsoidal heights converted to sea level, and the error of the conversion.

    The geoid is smooth over kilometres: it is bilinear between the lattice's nodes, and the largest error is returned.

    Raises:
        ElevationError: there is no geoid on this computer, and none is fetched.
    """
    easts, norths = (tile.low_m[axis] + tile.step_m * np.arange(tile.lattice.shape[axis]) for axis in (0, 1))
    nodes_m = np.stack(np.meshgrid(easts, norths, indexing="ij"), axis=-1).reshape(-1, 2)
    geoid_m = _undulations_m(path, frame.many_to_wgs84_deg(nodes_m))
    at = tile.lattice.reshape(-1, 2)
    rows, columns = tile.heights_m.shape
    design = np.column_stack((np.ones(len(at)), at, at**2, at.prod(axis=1)))
    scale = np.abs(design).max(axis=0)
    terms = np.linalg.lstsq(design / scale, geoid_m, rcond=None)[0] / scale
    off_m = float(np.abs(design @ terms - geoid_m).max())
    r, c = np.arange(rows)[:, np.newaxis], np.arange(columns)[np.newaxis]
    over_m = terms[0] + terms[1] * r + terms[2] * c + terms[3] * r**2 + terms[4] * c**2 + terms[5] * r * c
    same = tile.highest_m is tile.heights_m
    heights_m = _subtract_geoid(tile.heights_m, over_m)
    highest_m = heights_m if same else _subtract_geoid(tile.highest_m, over_m)
    return replace(tile, heights_m=heights_m, highest_m=highest_m), off_m


def _subtract_geoid(heights_m: Heights, over_m: FloatArray) -> Heights:
    return np.asarray(np.ceil((heights_m - over_m) * 10.0) / 10.0, dtype=np.float32)


def _undulations_m(path: Path, places_deg: FloatArray) -> FloatArray:
    """Return (m,) geoid heights over the ellipsoid at (m, 2) latitudes and longitudes."""
    for grid in GRIDS:
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")
                shift = pyproj.Transformer.from_pipeline(
                    "+proj=pipeline +step +proj=unitconvert +xy_in=deg +xy_out=rad "
                    f"+step +proj=vgridshift +grids={grid} +multiplier=1"
                )
                up_m = shift.transform(places_deg[:, 1], places_deg[:, 0], np.zeros(len(places_deg)))[2]
        except ProjError:
            continue
        if np.isfinite(up_m).all():
            return np.asarray(up_m, dtype=np.float64)
    raise ElevationError(
        f"{path}: vertical: expected heights above mean sea level, but these are over the ellipsoid, and no geoid to "
        f"convert them by is installed: `pyproj sync --file {GRIDS[0]}` brings it where there is a network"
    )


def write_kept_ground(path: Path, elevation: Elevation) -> None:
    """Write the ground data, so that it can be read again without the rasters.

    Raises:
        OSError: it cannot be written.
    """
    about = {
        "format": FORMAT,
        "lat_deg": elevation.frame.lat_deg,
        "lon_deg": elevation.frame.lon_deg,
        "source": elevation.source,
        "vertical": elevation.vertical,
        "uncertainty_m": elevation.uncertainty_m,
        "remarks": list(elevation.remarks),
        "tiles": [
            {
                "low_m": tile.low_m,
                "step_m": tile.step_m,
                "cell_m": tile.cell_m,
                "same": tile.highest_m is tile.heights_m,
            }
            for tile in elevation.tiles
        ],
    }
    parts: dict[str, np.ndarray] = {"about": np.array(json.dumps(about))}
    for number, tile in enumerate(elevation.tiles):
        parts[f"heights_{number}"] = tile.heights_m
        parts[f"lattice_{number}"] = tile.lattice
        if tile.highest_m is not tile.heights_m:
            parts[f"highest_{number}"] = tile.highest_m
    content = io.BytesIO()
    np.savez_compressed(content, allow_pickle=False, **parts)
    write_whole(path, content.getvalue())


def read_kept_ground(path: Path, frame: LocalFrame) -> Elevation:
    """Read the ground data of a run.

    Args:
        path: The file.
        frame: The site's frame, which must be the stored one.

    Raises:
        ElevationError: it is damaged, or belongs to another depot.
    """
    try:
        with zipfile.ZipFile(path) as archive:
            if sum(member.file_size for member in archive.infolist()) > MOST_BYTES:
                raise ElevationError(f"{path}: content: expected it to unpack to at most {MOST_BYTES // 1_000_000} MB")
        with np.load(path, allow_pickle=False) as parts:
            about = json.loads(str(parts["about"]))
            if about["format"] != FORMAT:
                raise ValueError(f"format: expected {FORMAT!r}")
            tiles = tuple(_load_tile(parts, number, row) for number, row in enumerate(about["tiles"]))
            found = Elevation(
                frame=LocalFrame(float(about["lat_deg"]), float(about["lon_deg"])),
                tiles=tiles,
                source=str(about["source"]),
                vertical=str(about["vertical"]),
                uncertainty_m=float(about["uncertainty_m"]),
                remarks=tuple(str(one) for one in about["remarks"]),
            )
    except UNREADABLE as error:
        raise ElevationError(f"{path}: content: expected the ground that a run has kept, whole: {error}") from error
    off_deg = max(abs(found.frame.lat_deg - frame.lat_deg), abs(found.frame.lon_deg - frame.lon_deg))
    if off_deg > SAME_DEG:
        raise ElevationError(
            f"{path}: depot: expected the ground around {frame.lat_deg:.6f}, {frame.lon_deg:.6f}, got that around "
            f"{found.frame.lat_deg:.6f}, {found.frame.lon_deg:.6f}"
        )
    return found


def _load_tile(parts: np.lib.npyio.NpzFile, number: int, row: dict[str, object]) -> Tile:
    heights_m, lattice = parts[f"heights_{number}"].astype(np.float32), parts[f"lattice_{number}"].astype(np.float64)
    highest_m = heights_m if row["same"] else parts[f"highest_{number}"].astype(np.float32)
    if heights_m.ndim != 2 or heights_m.shape != highest_m.shape or not heights_m.size:
        raise ValueError(f"heights_{number}: expected rows and columns")
    if lattice.ndim != 3 or lattice.shape[2] != 2 or min(lattice.shape[:2]) < 2:
        raise ValueError(f"lattice_{number}: expected rows and columns of cells")
    low_m = row["low_m"]
    if not isinstance(low_m, list):
        raise TypeError("low_m: expected a list")
    return Tile(
        heights_m, highest_m, (float(low_m[0]), float(low_m[1])), float(str(row["step_m"])), lattice,
        float(str(row["cell_m"])),
    )  # fmt: skip
