"""Coordinates of other reference systems to WGS 84, and what the systems are called."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import pyproj
from pyproj.exceptions import CRSError, ProjError

from missions.errors import NetworkError
from missions.files import to_printable

WGS84 = "EPSG:4326"


@dataclass(frozen=True, slots=True)
class Wgs84Transform:
    """From one reference system; longitude or easting comes first, whatever the system's own order."""

    words: str
    """What the system is called."""
    place: str
    """Where it was said, for messages."""
    transformer: pyproj.Transformer | None
    """None where there is nothing to do."""

    def lat_lon_deg(
        self, xs: Sequence[float], ys: Sequence[float], places: Sequence[str] | str
    ) -> list[tuple[float, float]]:
        """Return latitude and longitude of many places.

        Raises:
            NetworkError: one has none in this system.
        """
        if self.transformer is None:
            return list(zip(ys, xs, strict=True))
        try:
            lons, lats = self.transformer.transform(xs, ys)
        except ProjError as error:
            raise NetworkError(f"{self.place}: crs: expected coordinates of {self.words}: {error}") from error
        found = list(zip(map(float, lats), map(float, lons), strict=True))
        for index, (lat_deg, lon_deg) in enumerate(found):
            if not math.isfinite(lat_deg) or not math.isfinite(lon_deg):
                where = places if isinstance(places, str) else places[index]
                raise NetworkError(
                    f"{where}: position: expected a place of {self.words}, got {xs[index]:g}, {ys[index]:g}"
                )
        return found


IDENTITY = Wgs84Transform("WGS 84", "", None)
"""Of files that have no other system."""


def build_wgs84_transform(said: object, place: str) -> Wgs84Transform:
    """Return the way from a reference system to WGS 84.

    Args:
        said: What names or defines it: 'EPSG:5514', well-known text.
        place: The file, for messages.

    Raises:
        NetworkError: it is unknown, or has no two horizontal axes.
    """
    try:
        system = pyproj.CRS.from_user_input(said)
    except CRSError as error:
        text = to_printable(str(said))
        text = text if len(text) <= 60 else f"{text[:60]}..."
        raise NetworkError(
            f"{place}: crs: expected a coordinate reference system such as 'EPSG:32633', got {text!r}"
        ) from error
    if system.is_compound:  # with heights, of which nothing is used
        system = system.sub_crs_list[0]
    if not (system.is_projected or system.is_geographic):
        raise NetworkError(f"{place}: crs: expected a map grid or degrees, got {system.name!r}")
    code = system.to_authority(min_confidence=70)
    name = to_printable(system.name)
    words = name if code is None else f"{name} ({':'.join(code)})"
    if code is not None and ":".join(code) in {WGS84, "OGC:CRS84"}:
        return IDENTITY
    return Wgs84Transform(words, place, pyproj.Transformer.from_crs(system, WGS84, always_xy=True))
