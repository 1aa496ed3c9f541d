"""Pictures of the ground: GeoTIFF and MBTiles, of any size; only what lies around the line, no finer than it is shown.

What is read is laid square into the local plane: places of a coarse grid are transformed, between them is straight.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
from pyproj.exceptions import ProjError

from missions.background import Background, Pixels, choose_grid_size
from missions.errors import BackgroundError
from missions.geo import FloatArray
from missions.readers import imagery, mbtiles
from missions.readers.geopackage import MAGIC
from missions.readers.picture_window import PictureArea, PictureWindow, project_degrees

LATTICE_PIXELS = 32
"""Between places that are transformed: over 10 km of a map grid what lies between is off by centimetres."""
STRIP_ROWS = 256
TIFF = (b"II*\x00", b"MM\x00*", b"II+\x00", b"MM\x00+")


def read_background(path: Path, wanted: PictureArea) -> Background:
    """Return what a file shows of an area.

    Raises:
        BackgroundError: one line that names the file, the place in it and what was expected.
    """
    if not path.is_file():
        raise BackgroundError(f"{path}: file: expected a GeoTIFF or MBTiles; there is none")
    with path.open("rb") as file:
        head = file.read(16)
    if head.startswith(TIFF):
        read = imagery.read_imagery(path, wanted)
    elif head.startswith(MAGIC):
        read = mbtiles.read_mbtiles(path, wanted)
    else:
        raise BackgroundError(f"{path}: content: expected a GeoTIFF or MBTiles, it begins like neither")
    return _warp_to_plane(path, read, wanted)


def _warp_to_plane(path: Path, read: PictureWindow, wanted: PictureArea) -> Background:
    """Return pixels laid into the local plane, strip by strip."""
    rows, columns = choose_grid_size(wanted.low_m, wanted.high_m, wanted.most_pixels, read.step_m)
    try:
        lattice = _build_lattice(read, wanted, rows, columns)
    except ProjError as error:
        raise BackgroundError(f"{path}: crs: expected one that has places around the line: {error}") from error
    if not np.isfinite(lattice).all():
        raise BackgroundError(f"{path}: crs: expected one that has places all around the line")
    made = np.zeros((rows, columns, 4), dtype=np.uint8)
    for first in range(0, rows, STRIP_ROWS):
        last = min(rows, first + STRIP_ROWS)
        made[first:last] = _sample_colours(read.pixels, _interpolate_lattice(lattice, rows, columns, first, last))
    if not made[..., 3].any():
        raise BackgroundError(f"{path}: area: expected a picture of the line's surroundings, it shows none of them")
    return Background(made, wanted.low_m, wanted.high_m, read.attribution)


def _build_lattice(read: PictureWindow, wanted: PictureArea, rows: int, columns: int) -> FloatArray:
    """Return (n, m, 2) row and column in the file's pixels, at corners of the local plane a few pixels apart."""
    counts = [max(2, size // LATTICE_PIXELS + 2) for size in (rows, columns)]
    norths = np.linspace(wanted.high_m[1], wanted.low_m[1], counts[0])
    easts = np.linspace(wanted.low_m[0], wanted.high_m[0], counts[1])
    places_deg = wanted.frame.many_to_wgs84_deg(np.stack(np.meshgrid(easts, norths), axis=-1).reshape(-1, 2))
    x, y = project_degrees(read.crs, places_deg)
    a, b, c, d, e, f = read.to_pixels
    at = np.column_stack((d * x + e * y + f, a * x + b * y + c))
    return np.asarray(at.reshape(*counts, 2), dtype=np.float64)


def _interpolate_lattice(lattice: FloatArray, rows: int, columns: int, first: int, last: int) -> FloatArray:
    """Return (last - first, columns, 2) rows and columns of the file at middles of pixels of the local plane."""
    down = (np.arange(first, last) + 0.5) / rows * (lattice.shape[0] - 1)
    right = (np.arange(columns) + 0.5) / columns * (lattice.shape[1] - 1)
    i, j = (
        np.minimum(down.astype(np.intp), lattice.shape[0] - 2),
        np.minimum(right.astype(np.intp), lattice.shape[1] - 2),
    )
    share_down, share_right = (down - i)[:, np.newaxis, np.newaxis], (right - j)[np.newaxis, :, np.newaxis]
    lines = lattice[i] * (1 - share_down) + lattice[i + 1] * share_down
    return np.asarray(lines[:, j] * (1 - share_right) + lines[:, j + 1] * share_right, dtype=np.float64)


def _sample_colours(pixels: Pixels, at: FloatArray) -> Pixels:
    """Return colours between the middles of the nearest four pixels; nothing where the file has none."""
    height, width = pixels.shape[:2]
    inside = (at[..., 0] >= 0) & (at[..., 0] <= height) & (at[..., 1] >= 0) & (at[..., 1] <= width)
    row = np.clip(at[..., 0] - 0.5, 0, height - 1).astype(np.float32)
    column = np.clip(at[..., 1] - 0.5, 0, width - 1).astype(np.float32)
    top, left = row.astype(np.intp), column.astype(np.intp)
    below, beside = np.minimum(top + 1, height - 1), np.minimum(left + 1, width - 1)
    down, right = (row - top)[..., np.newaxis], (column - left)[..., np.newaxis]
    upper = pixels[top, left] * (1 - right) + pixels[top, beside] * right
    lower = pixels[below, left] * (1 - right) + pixels[below, beside] * right
    found = np.rint(upper * (1 - down) + lower * down).astype(np.uint8)
    found[~inside] = 0
    return np.asarray(found, dtype=np.uint8)
