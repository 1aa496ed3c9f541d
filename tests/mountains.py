"""Synthetic mountains, and the rasters that know them: ridges, a gorge, steps, holes. What is true stays here."""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pyproj
import rasterio
from affine import Affine

from missions.geo import FloatArray

LAT_DEG, LON_DEG = 46.60, 10.40
NODATA = -32767.0


@dataclass(frozen=True)
class Mountain:
    """Ground as a function of the place, in metres about its middle."""

    seed: int = 0
    base_m: float = 900.0
    relief_m: float = 120.0
    gorge_m: float = 60.0
    step_m: float = 25.0

    def at_m(self, east_m: FloatArray, north_m: FloatArray) -> FloatArray:
        rng = np.random.default_rng(self.seed)
        up_m = np.full(np.broadcast(east_m, north_m).shape, self.base_m)
        for _ in range(4):  # ridges
            angle, phase = rng.uniform(0, math.pi), rng.uniform(0, 2 * math.pi)
            across = east_m * math.cos(angle) + north_m * math.sin(angle)
            up_m = up_m + self.relief_m / 4 * (1 - np.abs(np.sin(across / rng.uniform(250, 600) + phase)))
        angle = rng.uniform(0, math.pi)
        aside = east_m * math.sin(angle) - north_m * math.cos(angle) - rng.uniform(-300, 300)
        up_m = up_m - self.gorge_m * np.exp(-((aside / 60.0) ** 2))
        along = east_m * math.cos(angle) + north_m * math.sin(angle)
        return np.asarray(up_m + self.step_m * np.floor(along / 700.0), dtype=np.float64)


def write_raster(
    path: Path,
    mountain: Mountain,
    *,
    crs: str = "EPSG:4326",
    bounds_m: tuple[float, float, float, float] = (-4000.0, -4000.0, 4000.0, 4000.0),
    cell: float = 1 / 3600,
    holes_m: tuple[tuple[float, float, float], ...] = (),
    nodata: float | None = NODATA,
    dtype: str = "float32",
    shift_m: float = 0.0,
    **options: object,
) -> Path:
    """Write what a raster knows of a mountain.

    Args:
        path: The file.
        mountain: The ground.
        crs: Of the raster.
        bounds_m: West, south, east and north, metres about the middle.
        cell: In the units of the crs.
        holes_m: East, north and radius of what it does not know.
        nodata: What it writes there.
        dtype: Of its cells.
        shift_m: Added to all heights: those of another reference.
        options: For rasterio.
    """
    about = pyproj.Proj(proj="aeqd", lat_0=LAT_DEG, lon_0=LON_DEG, ellps="WGS84")
    system = pyproj.CRS(crs)
    level = system.sub_crs_list[0] if system.is_compound else system
    to_raster = pyproj.Transformer.from_crs("EPSG:4326", level.to_2d(), always_xy=True)
    west, south, east, north = bounds_m
    corners = [about(e, n, inverse=True) for e in (west, east) for n in (south, north)]
    x, y = to_raster.transform([c[0] for c in corners], [c[1] for c in corners])
    left, top = math.floor(min(x) / cell) * cell, math.ceil(max(y) / cell) * cell
    columns, rows = math.ceil((max(x) - left) / cell), math.ceil((top - min(y)) / cell)
    xs, ys = np.meshgrid(left + (np.arange(columns) + 0.5) * cell, top - (np.arange(rows) + 0.5) * cell)
    lon, lat = to_raster.transform(xs, ys, direction="INVERSE")
    east_m, north_m = about(lon, lat)
    up_m = mountain.at_m(np.asarray(east_m), np.asarray(north_m)) + shift_m
    for hole_e, hole_n, radius_m in holes_m:
        up_m[np.hypot(east_m - hole_e, north_m - hole_n) < radius_m] = NODATA if nodata is None else nodata
    if np.dtype(dtype).kind in "iu":
        up_m = np.round(up_m)
    with rasterio.open(
        path, "w", driver=options.pop("driver", "GTiff"), width=columns, height=rows, count=1, dtype=dtype, crs=crs,
        transform=Affine(cell, 0.0, left, 0.0, -cell, top), nodata=nodata, **options,
    ) as dataset:  # fmt: skip
        dataset.write(up_m.astype(dtype), 1)
    return path
