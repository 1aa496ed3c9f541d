"""GeoJSON networks (RFC 7946: longitude first, WGS 84).

- A Point with property ``role: "depot"`` is the depot; its height is ``elevation_m``.
- Every other Point is a pylon: ``id``, and optionally ``elevation_m`` (ground above mean sea level) and ``height_m``
  (the structure).
- A LineString is a line; each of its vertices is a pylon, matched by position, and each step a segment. In a file
  without any pylon's Point the vertices themselves are the pylons, of unknown height.
- A feature of any other or no geometry with properties ``a`` and ``b`` is one segment between two pylons by their ids;
  a LineString with both is taken that way too.

A third coordinate is metres above the ellipsoid by the RFC, tens of metres off mean sea level: it is never used.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field

from missions.errors import NetworkError
from missions.fields import is_figure, printable
from missions.files import parse_json
from missions.geo import LocalFrame, distance_m
from missions.network import Network, Pylon, Segment

MATCH_M = 0.5
"""A line's vertex this near to a pylon's point is that pylon."""


@dataclass(frozen=True, slots=True)
class _Feature:
    place: str
    kind: str | None
    coordinates: object
    properties: Mapping[str, object]


@dataclass(slots=True)
class _Pylons:
    """Pylons by id and by place: a grid of cells about as large as the matching distance."""

    pylons: list[Pylon] = field(default_factory=list)
    by_id: dict[str, int] = field(default_factory=dict)
    by_cell: dict[tuple[int, int], list[int]] = field(default_factory=dict)

    def add(self, pylon: Pylon) -> None:
        self.by_id[pylon.id] = len(self.pylons)
        self.by_cell.setdefault(_cell(pylon.lat_deg, pylon.lon_deg), []).append(len(self.pylons))
        self.pylons.append(pylon)

    def nearest(self, lat_deg: float, lon_deg: float) -> int | None:
        row, column = _cell(lat_deg, lon_deg)
        around = (
            index
            for cell in ((row + i, column + j) for i in (-1, 0, 1) for j in (-1, 0, 1))
            for index in self.by_cell.get(cell, ())
        )
        distances = [
            (distance_m(lat_deg, lon_deg, self.pylons[index].lat_deg, self.pylons[index].lon_deg), index)
            for index in around
        ]
        least_m, index = min(distances, default=(math.inf, -1))
        return index if least_m <= MATCH_M else None


def _cell(lat_deg: float, lon_deg: float) -> tuple[int, int]:
    # 2e-5 degrees are 2.2 m of latitude, and more than MATCH_M of longitude up to 77 degrees.
    return math.floor(lat_deg / 2e-5), math.floor(lon_deg / 2e-5)


def parse_geojson(text: str, *, source: str, frame: LocalFrame | None) -> Network:
    """Return the network of a FeatureCollection.

    Args:
        text: The file's content.
        source: Its name, for messages.
        frame: The depot's, if the caller knows it; otherwise the file must hold one.

    Raises:
        NetworkError: one line that names the file, the place in it and what was expected.
    """
    features = list(_features(text, source))
    pylons = _Pylons()
    for feature in features:
        if feature.kind == "Point":
            if feature.properties.get("role") == "depot":
                frame = frame or _depot(feature)
            else:
                _add_pylon(pylons, feature)
    if frame is None:
        raise NetworkError(f"{source}: depot: expected a Point with property role 'depot', or a depot in the site file")
    segments: list[Segment] = []
    lines_only = not pylons.pylons
    for feature in features:
        if "a" in feature.properties and "b" in feature.properties:
            a, b = (_named_pylon(pylons, feature, key) for key in ("a", "b"))
            segments.append(
                Segment(len(segments), a, b, _label(feature, f"{pylons.pylons[a].id}-{pylons.pylons[b].id}"))
            )
        elif feature.kind == "LineString":
            for a, b, label in _steps(pylons, feature, lines_only=lines_only):
                segments.append(Segment(len(segments), a, b, label))
    return Network(tuple(pylons.pylons), tuple(segments), frame, source)


def _features(text: str, source: str) -> Iterator[_Feature]:
    document = parse_json(text, source, NetworkError)
    if not isinstance(document, dict):
        raise NetworkError(f"{source}: content: expected a JSON object")
    features = document.get("features")
    if document.get("type") != "FeatureCollection" or not isinstance(features, list):
        raise NetworkError(f"{source}: type: expected a FeatureCollection with a list of features")
    for index, feature in enumerate(features):
        place = f"{source}: features[{index}]"
        if not isinstance(feature, dict) or feature.get("type") != "Feature":
            raise NetworkError(f"{place}: expected an object of type Feature")
        properties, geometry = feature.get("properties") or {}, feature.get("geometry") or {}
        if not isinstance(properties, dict) or not isinstance(geometry, dict):
            raise NetworkError(f"{place}: expected properties and geometry to be objects or null")
        kind = geometry.get("type")
        if kind not in ("Point", "LineString", None):
            raise NetworkError(f"{place}.geometry.type: expected Point or LineString, got {kind!r}")
        yield _Feature(place, kind, geometry.get("coordinates"), properties)


def _lat_lon_deg(coordinates: object, place: str) -> tuple[float, float]:
    if not isinstance(coordinates, Sequence) or len(coordinates) < 2 or not all(map(is_figure, coordinates)):
        raise NetworkError(f"{place}: expected finite numbers [longitude, latitude], got {coordinates!r}")
    return float(coordinates[1]), float(coordinates[0])


def _metres(feature: _Feature, key: str) -> float | None:
    value = feature.properties.get(key)
    if value is not None and not is_figure(value):
        raise NetworkError(f"{feature.place}.properties.{key}: expected metres as a finite number, got {value!r}")
    return value


def _depot(feature: _Feature) -> LocalFrame:
    lat_deg, lon_deg = _lat_lon_deg(feature.coordinates, f"{feature.place}.geometry.coordinates")
    try:
        return LocalFrame(lat_deg, lon_deg, _metres(feature, "elevation_m") or 0.0)
    except ValueError as error:
        raise NetworkError(f"{feature.place}: depot: {error}") from error


def _add_pylon(pylons: _Pylons, feature: _Feature) -> None:
    name = feature.properties.get("id")
    if not isinstance(name, str | int) or isinstance(name, bool) or not printable(str(name)):
        raise NetworkError(f"{feature.place}.properties.id: expected the pylon's name, got {name!r}")
    if printable(str(name)) in pylons.by_id:
        raise NetworkError(f"{feature.place}.properties.id: expected a name that no other pylon has, got {name!r}")
    lat_deg, lon_deg = _lat_lon_deg(feature.coordinates, f"{feature.place}.geometry.coordinates")
    pylons.add(
        Pylon(printable(str(name)), lat_deg, lon_deg, _metres(feature, "elevation_m"), _metres(feature, "height_m"))
    )


def _named_pylon(pylons: _Pylons, feature: _Feature, key: str) -> int:
    name = printable(str(feature.properties[key]))
    if name not in pylons.by_id:
        raise NetworkError(f"{feature.place}.properties.{key}: expected the id of a pylon, got unknown {name!r}")
    return pylons.by_id[name]


def _label(feature: _Feature, otherwise: str) -> str:
    name = feature.properties.get("id", feature.properties.get("name"))
    return otherwise if name is None else printable(str(name))


def _steps(pylons: _Pylons, feature: _Feature, *, lines_only: bool) -> Iterator[tuple[int, int, str]]:
    if not isinstance(feature.coordinates, Sequence) or len(feature.coordinates) < 2:
        raise NetworkError(f"{feature.place}.geometry.coordinates: expected a line of at least two positions")
    indices: list[int] = []
    for number, position in enumerate(feature.coordinates):
        place = f"{feature.place}.geometry.coordinates[{number}]"
        lat_deg, lon_deg = _lat_lon_deg(position, place)
        index = pylons.nearest(lat_deg, lon_deg)
        if index is None and lines_only:
            index = len(pylons.pylons)
            pylons.add(Pylon(f"P{index + 1}", lat_deg, lon_deg))
        if index is None:
            raise NetworkError(f"{place}: expected a pylon's Point within {MATCH_M:g} m of {lat_deg}, {lon_deg}")
        indices.append(index)
    for number, (a, b) in enumerate(itertools.pairwise(indices), start=1):
        yield a, b, _label(feature, "line") + f".{number}"
