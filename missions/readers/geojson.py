"""GeoJSON networks (RFC 7946: longitude first, WGS 84).

- A Point with property ``role: "depot"`` is the depot; its height is ``elevation_m``, which it must have where pylons
  have theirs.
- Every other Point is a pylon: ``id``, ``ref`` or ``name``, and ``elevation_m`` (ground above mean sea level) and
  ``height_m`` (the structure), which are known of all pylons or of none.
- A LineString is a line; each of its vertices is a pylon, matched by position, and each step a segment, named by the
  line's ``name``, ``ref`` or ``id``. In a file without any pylon's Point the vertices themselves are the pylons, of
  unknown height.
- A feature of any other or no geometry with properties ``a`` and ``b`` is one segment between two pylons by their ids;
  a LineString with both is taken that way too.

A third coordinate is metres above the ellipsoid by the RFC, tens of metres off mean sea level, and whether ground, wire
or top no file says: it is kept with the pylon and never flown by. ``heights`` refuses a file that has nothing better,
and one whose ``elevation_m`` it contradicts.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace

from missions.errors import NetworkError
from missions.files import is_figure, parse_json, printable
from missions.geo import LocalFrame, distance_m
from missions.network import Network, Pylon, Segment

MATCH_M = 0.5
"""A line's vertex this near to a pylon's point is that pylon."""
SAME_DEPOT_M = 100.0
"""A site's depot without a height takes that of the file's when it is this near."""


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

    def see_third(self, index: int, third_m: float | None) -> None:
        """Keep the third coordinate of a line's vertex with its pylon, whose own Point has none."""
        if third_m is not None and self.pylons[index].third_m is None:
            self.pylons[index] = replace(self.pylons[index], third_m=third_m)

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


def parse_geojson(text: str, *, source: str, frame: LocalFrame | None, alt_known: bool = True) -> Network:
    """Return the network of a FeatureCollection.

    Args:
        text: The file's content.
        source: Its name, for messages.
        frame: The depot's, if the caller knows it; otherwise the file must hold one.
        alt_known: Whether the caller knows the depot's height too; otherwise the file's own depot may say it.

    Raises:
        NetworkError: one line that names the file, the place in it and what was expected.
    """
    features = list(_features(text, source))
    pylons = _Pylons()
    for feature in features:
        if feature.kind == "Point":
            if feature.properties.get("role") != "depot":
                _add_pylon(pylons, feature)
            elif frame is None or not alt_known:
                frame, alt_known = _depot(feature, frame)
    if frame is None:
        raise NetworkError(f"{source}: depot: expected a Point with property role 'depot', or a depot in the site file")
    if not alt_known and any(pylon.elevation_m is not None for pylon in pylons.pylons):
        raise NetworkError(
            f"{source}: depot: expected its height above sea level, because the pylons have elevation_m: alt_m of the "
            "site's [depot], or elevation_m of the file's"
        )
    segments = _segments(pylons, features)
    return Network(tuple(pylons.pylons), tuple(segments), frame, source)


def _segments(pylons: _Pylons, features: Sequence[_Feature]) -> list[Segment]:
    """Return all segments, each with a label of its own; lines add their pylons where the file has no Points."""
    segments: list[Segment] = []
    labels: set[str] = set()
    lines_only = not pylons.pylons
    for feature in features:
        steps: Iterable[tuple[int, int, str]] = ()
        if "a" in feature.properties and "b" in feature.properties:
            a, b = (_named_pylon(pylons, feature, key) for key in ("a", "b"))
            steps = [(a, b, _name(feature) or "")]
        elif feature.kind == "LineString":
            steps = _steps(pylons, feature, lines_only=lines_only)
        for a, b, label in steps:
            between = f"{pylons.pylons[a].id}-{pylons.pylons[b].id}"
            # Two lines may have the same name; a crew must know which of them is meant.
            label = f"{label} ({between})" if label in labels else label or between
            labels.add(label)
            segments.append(Segment(len(segments), a, b, label))
    return segments


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


def _third_m(coordinates: object) -> float | None:
    third_m = coordinates[2] if isinstance(coordinates, Sequence) and len(coordinates) > 2 else None
    return float(third_m) if is_figure(third_m) else None


def _depot(feature: _Feature, known: LocalFrame | None) -> tuple[LocalFrame, bool]:
    """Return the file's depot, or one that is known with the height of the file's if that is there too.

    With it comes whether its height is known.
    """
    lat_deg, lon_deg = _lat_lon_deg(feature.coordinates, f"{feature.place}.geometry.coordinates")
    alt_m = _metres(feature, "elevation_m")
    if known is not None:
        near = alt_m is not None and distance_m(known.lat_deg, known.lon_deg, lat_deg, lon_deg) <= SAME_DEPOT_M
        return (LocalFrame(known.lat_deg, known.lon_deg, alt_m), True) if near and alt_m is not None else (known, False)
    try:
        return LocalFrame(lat_deg, lon_deg, alt_m or 0.0), alt_m is not None
    except ValueError as error:
        raise NetworkError(f"{feature.place}: depot: {error}") from error


def _add_pylon(pylons: _Pylons, feature: _Feature) -> None:
    name = next((feature.properties[key] for key in ("id", "ref", "name") if key in feature.properties), None)
    if not isinstance(name, str | int) or isinstance(name, bool) or not printable(str(name)):
        raise NetworkError(f"{feature.place}.properties.id: expected the pylon's name, got {name!r}")
    if printable(str(name)) in pylons.by_id:
        raise NetworkError(f"{feature.place}.properties.id: expected a name that no other pylon has, got {name!r}")
    lat_deg, lon_deg = _lat_lon_deg(feature.coordinates, f"{feature.place}.geometry.coordinates")
    elevation_m, height_m = _metres(feature, "elevation_m"), _metres(feature, "height_m")
    pylons.add(Pylon(printable(str(name)), lat_deg, lon_deg, elevation_m, height_m, _third_m(feature.coordinates)))


def _named_pylon(pylons: _Pylons, feature: _Feature, key: str) -> int:
    name = printable(str(feature.properties[key]))
    if name not in pylons.by_id:
        raise NetworkError(f"{feature.place}.properties.{key}: expected the id of a pylon, got unknown {name!r}")
    return pylons.by_id[name]


def _name(feature: _Feature) -> str | None:
    """Return what people call a line or a segment."""
    names = (feature.properties.get(key) for key in ("name", "ref", "id"))
    return next((printable(str(name)) for name in names if name not in {None, ""}), None)


def _steps(pylons: _Pylons, feature: _Feature, *, lines_only: bool) -> Iterator[tuple[int, int, str]]:
    if not isinstance(feature.coordinates, Sequence) or len(feature.coordinates) < 2:
        raise NetworkError(f"{feature.place}.geometry.coordinates: expected a line of at least two positions")
    indices: list[int] = []
    for number, position in enumerate(feature.coordinates):
        place = f"{feature.place}.geometry.coordinates[{number}]"
        lat_deg, lon_deg = _lat_lon_deg(position, place)
        index = pylons.nearest(lat_deg, lon_deg)
        if index is None:
            if not lines_only:
                raise NetworkError(f"{place}: expected a pylon's Point within {MATCH_M:g} m of {lat_deg}, {lon_deg}")
            index = len(pylons.pylons)
            pylons.add(Pylon(f"P{index + 1}", lat_deg, lon_deg))
        pylons.see_third(index, _third_m(position))
        indices.append(index)
    name = _name(feature)
    for number, (a, b) in enumerate(itertools.pairwise(indices), start=1):
        yield a, b, "" if name is None else f"{name}.{number}"
