"""Convert WGS 84 to local metres and back: the only module that converts degrees to metres.

The local plane is the azimuthal equidistant projection about the depot: distance and direction from the depot are the
geodesic ones. Across that direction it stretches: a kilometre comes out 4 mm too long 30 km away, 16 cm at 200 km.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache
from typing import Annotated

import numpy as np
import numpy.typing as npt
import pyproj
from pydantic import Field
from pyproj.exceptions import CRSError

from missions.validation import Figure

FloatArray = npt.NDArray[np.float64]
BoolArray = npt.NDArray[np.bool_]
IntArray = npt.NDArray[np.int64]
IndexArray = npt.NDArray[np.intp]

MAX_LATITUDE_DEG = 89.0
"""Greatest latitude; nearer to a pole, east and north change within kilometres."""

_GEOD = pyproj.Geod(ellps="WGS84")


def wrap_lon_deg(lon_deg: float) -> float:
    """Return the same meridian in [-180, 180)."""
    # Leave valid values unchanged: the conversion loses digits.
    if -180.0 <= lon_deg < 180.0:
        return lon_deg
    wrapped = (lon_deg + 180.0) % 360.0 - 180.0
    # For a tiny negative sum the modulo rounds up to 360 itself.
    return wrapped if wrapped < 180.0 else -180.0


def distance_m(lat_a_deg: float, lon_a_deg: float, lat_b_deg: float, lon_b_deg: float) -> float:
    """Return the length of the geodesic between two places."""
    return float(_GEOD.inv(lon_a_deg, lat_a_deg, lon_b_deg, lat_b_deg)[2])


@lru_cache(maxsize=64)
def _build_projection(lat_deg: float, lon_deg: float) -> pyproj.Proj:
    return pyproj.Proj(proj="aeqd", lat_0=lat_deg, lon_0=lon_deg, ellps="WGS84")


@dataclass(frozen=True, slots=True)
class LocalFrame:
    """East, north and up in metres about a depot."""

    lat_deg: Annotated[Figure, Field(ge=-MAX_LATITUDE_DEG, le=MAX_LATITUDE_DEG)]
    lon_deg: Figure
    """Kept in [-180, 180)."""
    alt_m: Figure = 0.0
    """Height of the depot above mean sea level; up is measured from it."""

    def __post_init__(self) -> None:
        """Check the depot.

        Raises:
            ValueError: a value is NaN or infinite, or within a degree of a pole, where there is no usable east.
        """
        if not all(math.isfinite(value) for value in (self.lat_deg, self.lon_deg, self.alt_m)):
            raise ValueError("a depot needs finite lat_deg, lon_deg and alt_m")
        if abs(self.lat_deg) > MAX_LATITUDE_DEG:
            raise ValueError(
                f"latitude {self.lat_deg} is out of range: expected -{MAX_LATITUDE_DEG} to {MAX_LATITUDE_DEG}"
            )
        object.__setattr__(self, "lon_deg", wrap_lon_deg(self.lon_deg))

    def to_local_m(self, lat_deg: float, lon_deg: float) -> tuple[float, float]:
        """Return east and north of a place in metres."""
        east, north = _build_projection(self.lat_deg, self.lon_deg)(lon_deg, lat_deg)
        return float(east), float(north)

    def to_wgs84_deg(self, east_m: float, north_m: float) -> tuple[float, float]:
        """Return latitude and longitude, the latter in [-180, 180), of a local place."""
        lon, lat = _build_projection(self.lat_deg, self.lon_deg)(east_m, north_m, inverse=True)
        return float(lat), wrap_lon_deg(float(lon))

    def many_to_local_m(self, lat_lon_deg: FloatArray) -> FloatArray:
        """Return ``(n, 2)`` east and north in metres for ``(n, 2)`` latitude and longitude."""
        east, north = _build_projection(self.lat_deg, self.lon_deg)(lat_lon_deg[:, 1], lat_lon_deg[:, 0])
        return np.column_stack((east, north)).astype(np.float64)

    def many_to_wgs84_deg(self, east_north_m: FloatArray) -> FloatArray:
        """Return ``(n, 2)`` latitude and longitude for ``(n, 2)`` east and north in metres."""
        lon, lat = _build_projection(self.lat_deg, self.lon_deg)(east_north_m[:, 0], east_north_m[:, 1], inverse=True)
        return np.column_stack((lat, [wrap_lon_deg(value) for value in np.asarray(lon).tolist()])).astype(np.float64)

    def up_m(self, alt_m: float) -> float:
        """Return the height over the depot, given the height above mean sea level."""
        return alt_m - self.alt_m


def grid_offsets_to_wgs84_deg(frame: LocalFrame, offsets_m: FloatArray, crs: str) -> FloatArray:
    """Return ``(n, 2)`` latitude and longitude of offsets from the depot in the metres of a map grid.

    Grid metres differ from metres on the ground by the grid's scale and are rotated by its convergence: up to 0.04 %
    and 1 to 2 degrees in a UTM zone.

    Raises:
        ValueError: ``crs`` is unknown or is not a grid in metres.
    """
    try:
        grid = pyproj.CRS.from_user_input(crs)
    except CRSError as error:
        raise ValueError(f"unknown coordinate reference system {crs!r}: expected one such as 'EPSG:32633'") from error
    if not grid.is_projected or grid.axis_info[0].unit_name != "metre":
        raise ValueError(f"coordinate reference system {crs!r} is not a map grid in metres")
    to_grid = pyproj.Transformer.from_crs("EPSG:4326", grid, always_xy=True)
    east_0, north_0 = to_grid.transform(frame.lon_deg, frame.lat_deg)
    lon, lat = to_grid.transform(offsets_m[:, 0] + east_0, offsets_m[:, 1] + north_0, direction="INVERSE")
    return np.column_stack((lat, lon)).astype(np.float64)
