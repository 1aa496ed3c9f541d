"""Pictures of the ground whose every pixel says where it is: written by GDAL, and as tiles by Pillow."""

from __future__ import annotations

import io
import math
import sqlite3
from collections.abc import Callable, Mapping
from pathlib import Path

import numpy as np
import numpy.typing as npt
import pyproj
import rasterio
from PIL import Image
from rasterio import Affine

from missions import LocalFrame

HALF_M = math.pi * 6378137.0
Colours = npt.NDArray[np.uint8]
STRIPE_M = 400.0


def colours_at(frame: LocalFrame, lat_deg: npt.NDArray[np.float64], lon_deg: npt.NDArray[np.float64]) -> Colours:
    """Return what is painted at places: red rises to the east and green to the north, over 400 m about the depot."""
    places_m = frame.many_to_local_m(np.column_stack((lat_deg.ravel(), lon_deg.ravel())))
    shares = np.clip(places_m / (2.0 * STRIPE_M) + 0.5, 0.0, 1.0)
    made = np.full((len(shares), 3), 40, dtype=np.uint8)
    made[:, :2] = np.rint(250.0 * shares).astype(np.uint8)
    return made.reshape(*lat_deg.shape, 3)


def write_tiff(
    path: Path,
    frame: LocalFrame,
    *,
    crs: str = "EPSG:32633",
    cell: float = 4.0,
    size: int = 400,
    change: Callable[[Colours], npt.NDArray[np.generic]] = lambda made: made,
    **profile: object,
) -> Path:
    """Write a picture about the depot; `change` makes other bands of its (rows, columns, 3)."""
    to_crs = pyproj.Transformer.from_crs("EPSG:4326", crs, always_xy=True)
    x, y = to_crs.transform(frame.lon_deg, frame.lat_deg)
    left, top = x - cell * size / 2, y + cell * size / 2
    columns, rows = np.meshgrid(np.arange(size) + 0.5, np.arange(size) + 0.5)
    lon_deg, lat_deg = to_crs.transform(left + cell * columns, top - cell * rows, direction="INVERSE")
    bands = change(colours_at(frame, lat_deg, lon_deg))
    tags = profile.pop("tags", {})
    overviews = profile.pop("overviews", [])
    options = {
        "driver": "GTiff", "width": size, "height": size, "count": bands.shape[2], "dtype": bands.dtype.name,
        "crs": crs, "transform": Affine(cell, 0.0, left, 0.0, -cell, top), **profile,
    }  # fmt: skip
    with rasterio.open(path, "w", **options) as dataset:
        dataset.write(np.moveaxis(bands, 2, 0))
        if isinstance(tags, dict):
            dataset.update_tags(**tags)
        if isinstance(overviews, list) and overviews:
            dataset.build_overviews(overviews)
    return path


def tile_of(frame: LocalFrame, zoom: int, column: int, row: int, side: int = 256) -> Colours:
    """Return the pixels of a tile, counted from the north."""
    tile_m = 2 * HALF_M / 2**zoom
    across, down = np.meshgrid((np.arange(side) + 0.5) / side, (np.arange(side) + 0.5) / side)
    back = pyproj.Transformer.from_crs("EPSG:3857", "EPSG:4326", always_xy=True)
    lon_deg, lat_deg = back.transform((column + across) * tile_m - HALF_M, HALF_M - (row + down) * tile_m)
    return colours_at(frame, lat_deg, lon_deg)


def encoded(pixels: Colours, kind: str = "PNG") -> bytes:
    """Return a picture's file."""
    file = io.BytesIO()
    Image.fromarray(pixels).save(file, kind, **({"lossless": True} if kind == "WEBP" else {}))
    return file.getvalue()


def write_mbtiles(
    path: Path,
    frame: LocalFrame,
    *,
    zooms: tuple[int, ...] = (15,),
    around: int = 1,
    side: int = 256,
    kind: str = "PNG",
    facts: Mapping[str, str] | None = None,
    spoil: Callable[[bytes], bytes] = lambda data: data,
) -> Path:
    """Write tiles about the depot at some zooms."""
    with sqlite3.connect(path) as database:
        database.execute("CREATE TABLE metadata (name text, value text)")
        database.execute(
            "CREATE TABLE tiles (zoom_level integer, tile_column integer, tile_row integer, tile_data blob)"
        )
        known = {"name": "test", "format": kind.lower()} if facts is None else facts
        database.executemany("INSERT INTO metadata VALUES (?, ?)", list(known.items()))
        for zoom in zooms:
            column = int((frame.lon_deg + 180.0) / 360.0 * 2**zoom)
            lat_rad = math.radians(frame.lat_deg)
            row = int((1.0 - math.asinh(math.tan(lat_rad)) / math.pi) / 2.0 * 2**zoom)
            for right in range(-around, around + 1):
                for down in range(-around, around + 1):
                    data = spoil(encoded(tile_of(frame, zoom, column + right, row + down, side), kind))
                    at = (zoom, column + right, 2**zoom - 1 - row - down, data)
                    database.execute("INSERT INTO tiles VALUES (?, ?, ?, ?)", at)
    database.close()
    return path
