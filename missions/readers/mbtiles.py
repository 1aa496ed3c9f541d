"""MBTiles 1.3: pictures in the tiles of web maps, in an SQLite file."""

from __future__ import annotations

import io
import math
import sqlite3
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pyproj

from missions.background import PictureArea, PictureWindow, Pixels, strip_markup
from missions.errors import BackgroundError
from missions.files import to_printable
from missions.readers.geopackage import open_sqlite

WEB = pyproj.CRS("EPSG:3857")
"""The grid of web maps."""
HALF_M = math.pi * 6378137.0
"""Half of the world's width in the metres of web maps."""
PICTURES = frozenset({"png", "jpg", "jpeg", "webp", ""})
MOST_ZOOM = 24
SIDES = (64, 1024)
MORE = 2.5
"""So many times the pixels that are shown may be read."""
TILES = (
    "SELECT tile_column, tile_row, tile_data FROM tiles WHERE zoom_level = ? AND tile_column BETWEEN ? AND ? "
    "AND tile_row BETWEEN ? AND ? LIMIT ?"
)
ALL = -1


@dataclass(frozen=True, slots=True)
class _TileRange:
    """Tiles of one zoom, counted from north and west."""

    zoom: int
    left: int
    top: int
    right: int
    bottom: int

    @property
    def bounds(self) -> tuple[int, int, int, int, int]:
        """Zoom, columns and rows as the file counts them: from the south."""
        most = 2**self.zoom - 1
        return self.zoom, self.left, self.right, most - self.bottom, most - self.top

    @property
    def count(self) -> int:
        """How many there are."""
        return (self.right - self.left + 1) * (self.bottom - self.top + 1)


def read_mbtiles(path: Path, wanted: PictureArea) -> PictureWindow:
    """Return the tiles of an area, of the zoom that fits what is shown.

    Raises:
        BackgroundError: one line that names the file, the tile and what was expected.
    """
    try:
        with open_sqlite(path) as database:
            return _read(path, database, wanted)
    except (sqlite3.Error, sqlite3.Warning, UnicodeDecodeError, OSError) as error:
        raise BackgroundError(f"{path}: content: expected MBTiles: {to_printable(str(error))}") from error


def _read(path: Path, database: sqlite3.Connection, wanted: PictureArea) -> PictureWindow:
    from rasterio import Affine

    facts = {str(name): str(value) for name, value in database.execute("SELECT name, value FROM metadata")}
    kind = facts.get("format", "").lower()
    if kind not in PICTURES:
        raise BackgroundError(
            f"{path}: metadata.format: expected pictures (png, jpg or webp), got {to_printable(kind)!r}"
        )
    tiles, side = _select_zoom(path, database, wanted)
    shape = ((tiles.bottom - tiles.top + 1) * side, (tiles.right - tiles.left + 1) * side, 4)
    mosaic: Pixels = np.zeros(shape, dtype=np.uint8)
    for column, row, data in database.execute(TILES, (*tiles.bounds, ALL)):
        right, down = column - tiles.left, 2**tiles.zoom - 1 - row - tiles.top
        tile = _decode_tile(path, f"tile {tiles.zoom}/{column}/{row}", data, side)
        mosaic[down * side : (down + 1) * side, right * side : (right + 1) * side] = tile
    tile_m = 2.0 * HALF_M / 2**tiles.zoom
    pixel_m = tile_m / side
    transform = Affine(pixel_m, 0.0, tiles.left * tile_m - HALF_M, 0.0, -pixel_m, HALF_M - tiles.top * tile_m)
    step_m = pixel_m * math.cos(math.radians(wanted.frame.lat_deg))
    # Whom the tiles are by comes with the markup that web maps put there.
    attribution = strip_markup(facts.get("attribution", "") or facts.get("description", ""))
    return PictureWindow(mosaic, WEB, transform, step_m, attribution)


def _select_zoom(path: Path, database: sqlite3.Connection, wanted: PictureArea) -> tuple[_TileRange, int]:
    """Return the tiles of the finest zoom that is not much finer than what is shown, and how wide a tile is."""
    ((lowest, highest),) = database.execute("SELECT min(zoom_level), max(zoom_level) FROM tiles")
    if not (isinstance(lowest, int) and isinstance(highest, int) and 0 <= lowest <= highest <= MOST_ZOOM):
        raise BackgroundError(f"{path}: tiles: expected zoom levels from 0 to {MOST_ZOOM}, got {lowest} to {highest}")
    for zoom in range(highest, lowest - 1, -1):
        tiles = _build_tile_range(wanted, zoom)
        if SIDES[0] ** 2 * tiles.count > MORE * wanted.most_pixels and zoom > lowest:
            continue
        for column, row, data in database.execute(TILES, (*tiles.bounds, 1)):
            side = len(_decode_tile(path, f"tile {zoom}/{column}/{row}", data, 0))
            if side**2 * tiles.count <= MORE * max(wanted.most_pixels, 16 * side**2):
                return tiles, side
    raise BackgroundError(f"{path}: tiles: expected some of the line's surroundings, found none")


def _build_tile_range(wanted: PictureArea, zoom: int) -> _TileRange:
    places_deg = wanted.sample_places_deg()
    x, y = pyproj.Transformer.from_crs("EPSG:4326", WEB, always_xy=True).transform(places_deg[:, 1], places_deg[:, 0])
    most = 2**zoom - 1
    columns = np.clip(np.floor((x + HALF_M) / (2 * HALF_M) * 2**zoom), 0, most)
    rows = np.clip(np.floor((HALF_M - y) / (2 * HALF_M) * 2**zoom), 0, most)
    return _TileRange(zoom, int(columns.min()), int(rows.min()), int(columns.max()), int(rows.max()))


def _decode_tile(path: Path, place: str, data: object, side: int) -> Pixels:
    """Return a tile's pixels: of the first tile's size, whatever its own is; square, in any case."""
    from PIL import Image

    try:
        with Image.open(io.BytesIO(data if isinstance(data, bytes) else b""), formats=("PNG", "JPEG", "WEBP")) as image:
            width, height = image.size
            if not (width == height and SIDES[0] <= width <= SIDES[1]):
                raise BackgroundError(
                    f"{path}: {place}: expected a square of {SIDES[0]} to {SIDES[1]} pixels, got {width} by {height}"
                )
            pixels = image.convert("RGBA")
            if side and width != side:
                pixels = pixels.resize((side, side))
            return np.asarray(pixels, dtype=np.uint8)
    except (OSError, ValueError, SyntaxError, Image.DecompressionBombError) as error:
        raise BackgroundError(
            f"{path}: {place}: expected a picture (PNG, JPEG or WebP): {_describe_error(error)}"
        ) from error


def _describe_error(error: Exception) -> str:
    text = to_printable(str(error))
    return "it is none" if "cannot identify" in text else text[:160]
