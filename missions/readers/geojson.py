"""Read GeoJSON networks (RFC 7946: longitude first, WGS 84; an older file may name another system in ``crs``).

- A Point with property ``role: "depot"`` is the depot; its height is ``elevation_m``, required if pylons have theirs.
- Every other Point is a pylon: ``id``, ``ref`` or ``name``, and ``elevation_m`` (ground above mean sea level) and
  ``height_m`` (the structure), known for all pylons or for none.
- A LineString or MultiLineString is a line, named by its ``name``, ``ref`` or ``id``; it is split into spans at pylons.
- A feature of any other or no geometry with properties ``a`` and ``b`` is one segment between two pylons by their ids;
  so is a LineString with both. ``line`` names its line.
- Polygons are left out, and so are features that are neither pole nor line by their attributes (see `attributes`).
- ``flat_ground: true`` next to ``features`` states that the ground is level with the depot.

By the RFC a third coordinate is metres above the ellipsoid, tens of metres off mean sea level, and no file states
whether it is that of ground, wire or top: it is kept with the pylon and never flown by. ``line_heights`` refuses a file
that has only this, and one whose ``elevation_m`` contradicts it.
"""

from __future__ import annotations

from collections.abc import Container, Iterator, Mapping
from dataclasses import dataclass, replace

from missions.errors import NetworkError
from missions.files import find_object, is_figure, parse_json, to_printable
from missions.readers.attributes import LINES, name_of
from missions.readers.features import (
    EMPTY,
    IDENTITY,
    Feature,
    GeometryKind,
    Position,
    Wgs84Transform,
    add_features,
    build_wgs84_transform,
    is_wanted_line,
    read_third_coordinate,
)
from missions.readers.raw_network import RawNetwork, ReadOptions, Span
from missions.readers.values import EAST_WEST, NORTH_SOUTH, degrees_of, is_blank

FORMAT = "GeoJSON"
FLAT = "flat_ground"
OWN_NAMES = ("id", "ref", "name")
LINE_NAMES = ("name", "ref", "id")
KINDS = {
    "Point": GeometryKind.POINT, "MultiPoint": GeometryKind.POINT, "LineString": GeometryKind.LINE,
    "MultiLineString": GeometryKind.LINE, "Polygon": GeometryKind.OTHER, "MultiPolygon": GeometryKind.OTHER,
    "GeometryCollection": GeometryKind.OTHER,
}  # fmt: skip


@dataclass(frozen=True)
class GeoFeature(Feature):
    """One feature as in the file; `other` is its geometry's type."""

    coordinates: object = None


def parse_geojson(document: Mapping[str, object], choice: ReadOptions) -> RawNetwork:
    """Return the content of a FeatureCollection.

    Args:
        document: The JSON object.
        choice: The part to read.

    Raises:
        NetworkError: one line that names the file, the place in it and what was expected.
    """
    choice.refuse_layers(FORMAT)
    choice.refuse_crs(FORMAT)
    check_whole(document)
    system = system_of(document)
    drawing = choice.create_raw_network(FORMAT, system.words, flat=document.get(FLAT) is True)
    every = list(features_of(document))
    meant = frozenset(end for one in every if _is_span(one) for end in _read_ends(one))
    every = [_call_by_id(one, meant) for one in every]
    drawing.spans += (_build_span(one) for one in every if _is_span(one) and is_wanted_line(drawing, one, choice))
    add_features(drawing, (one for one in every if not _is_span(one)), choice, system)
    _check_names(drawing, meant)
    return drawing


def parse_features(text: str, source: str) -> Mapping[str, object]:
    """Return the JSON object in a text; GeoJSON lines, one feature a line, become a collection.

    Raises:
        NetworkError: it is not a JSON object.
    """
    first, _, rest = text.strip().partition("\n")
    if rest and first.rstrip().endswith("}") and find_object(first).get("type") == "Feature":
        lines = [(number, line.strip()) for number, line in enumerate(text.split("\n"), 1)]
        features = [parse_json(line, f"{source}: line {number}", NetworkError) for number, line in lines if line]
        return {"type": "FeatureCollection", "features": features}
    document = parse_json(text.lstrip(), source, NetworkError)
    if not isinstance(document, dict):
        raise NetworkError("content: expected a JSON object")
    return document


def check_whole(document: Mapping[str, object]) -> None:
    """Refuse a partial answer, marked by its server as incomplete: ArcGIS, WFS and OGC API Features.

    Raises:
        NetworkError: it is partial.
    """
    inner = document.get("properties")
    for said in (document, inner if isinstance(inner, dict) else {}):
        if said.get("exceededTransferLimit") is True:
            raise NetworkError(
                "exceededTransferLimit: expected all features, the server sent a part: ask for the rest "
                "(resultOffset); without this key, the part is read as it is"
            )
    matched, returned = (document.get(key) for key in ("numberMatched", "numberReturned"))
    matched = document.get("totalFeatures") if matched is None else matched
    features = document.get("features")
    returned = len(features) if returned is None and isinstance(features, list) else returned
    known = is_figure(matched) and is_figure(returned)
    if is_figure(matched) and is_figure(returned) and matched > returned:
        raise NetworkError(
            f"numberMatched: expected all {matched:g} features, the server sent {returned:g}: ask for the "
            "rest (limit, count, the link 'next'); without this key, the part is read as it is"
        )
    links = document.get("links")
    for link in links if isinstance(links, list) and not known else ():
        if isinstance(link, dict) and link.get("rel") == "next":
            raise NetworkError(
                "links: expected all features, the server sent a part and a link to the next: ask for the "
                "rest; without this key, the part is read as it is"
            )


def system_of(document: Mapping[str, object]) -> Wgs84Transform:
    """Return the reference system named in the file, as before RFC 7946 and optionally by QGIS.

    Raises:
        NetworkError: it is unknown.
    """
    crs = document.get("crs")
    if crs is None:
        return IDENTITY
    properties = crs.get("properties") if isinstance(crs, dict) else None
    name = properties.get("name") if isinstance(properties, dict) else None
    if not isinstance(name, str):
        raise NetworkError(f"crs: expected a name such as 'urn:ogc:def:crs:EPSG::5514', got {crs!r}")
    return build_wgs84_transform(name)


def features_of(document: Mapping[str, object]) -> Iterator[GeoFeature]:
    """Yield the features of a FeatureCollection.

    Raises:
        NetworkError: one line that names the file, the place in it and what was expected.
    """
    if document.get("type") == "Feature":
        document = {"type": "FeatureCollection", "features": [document]}
    error = document.get("error")
    if isinstance(error, dict):
        raise NetworkError(f"content: expected features, got a server's error: {to_printable(str(error))[:200]}")
    features = document.get("features")
    if document.get("type") != "FeatureCollection" or not isinstance(features, list):
        raise NetworkError("type: expected a FeatureCollection with a list of features")
    for index, feature in enumerate(features):
        place = f"features[{index}]"
        if not isinstance(feature, dict) or feature.get("type") != "Feature":
            raise NetworkError(f"{place}: expected an object of type Feature")
        properties, geometry = feature.get("properties") or {}, feature.get("geometry") or {}
        if not isinstance(properties, dict) or not isinstance(geometry, dict):
            raise NetworkError(f"{place}: expected properties and geometry to be objects or null")
        kind = geometry.get("type")
        if kind not in (None, *KINDS):
            raise NetworkError(f"{place}.geometry.type: expected Point or LineString, got {kind!r}")
        coordinates = geometry.get("coordinates")
        yield GeoFeature(
            place, KINDS.get(kind or "", GeometryKind.OTHER), _read_parts(place, kind, coordinates), properties,
            feature.get("id"), other=kind or EMPTY, pole_names=OWN_NAMES, coordinates=coordinates,
        )  # fmt: skip


def _check_names(drawing: RawNetwork, meant: Container[str]) -> None:
    """Refuse a name shared by several pylons if a segment refers to it."""
    seen: set[str] = set()
    for pole in drawing.poles:
        if pole.name in seen and pole.name in meant:
            raise NetworkError(
                f"{pole.place}.properties.id: expected a name that no other pylon has, got {pole.name!r}"
            )
        seen.add(pole.name)


def _read_ends(feature: GeoFeature) -> tuple[str, str]:
    return name_of(feature.attributes, ("a",)), name_of(feature.attributes, ("b",))


def _is_span(feature: GeoFeature) -> bool:
    return feature.other != "Point" and all(_read_ends(feature))


def _build_span(feature: GeoFeature) -> Span:
    name = name_of(feature.attributes, LINE_NAMES) or name_of({"id": feature.id})
    return Span(f"{feature.place}.properties", name, *_read_ends(feature), name_of(feature.attributes, LINES))


def _call_by_id(feature: GeoFeature, meant: Container[str]) -> GeoFeature:
    """Return a feature; a pole to which a segment refers by its id gets that as its name."""
    own = name_of(feature.attributes, ("id",)) or name_of({"id": feature.id})
    return replace(feature, name=own) if feature.kind is GeometryKind.POINT and own in meant else feature


def _read_parts(place: str, kind: str | None, at: object) -> Iterator[list[Position]]:
    place = f"{place}.geometry.coordinates"
    if not at or (kind == "Point" and isinstance(at, list) and all(map(is_blank, at[:2]))):
        return
    if kind == "Point":
        yield [_read_position(at, place)]
    elif not isinstance(at, list):
        raise NetworkError(f"{place}: expected a list of lines, got {at!r}")
    elif kind == "MultiPoint":
        yield [_read_position(one, f"{place}[{number}]") for number, one in enumerate(at)]
    else:
        yield from (_read_positions(part, place) for part in (at if kind == "MultiLineString" else [at]))


def places_of(positions: object, place: str, system: Wgs84Transform) -> list[tuple[float, float]]:
    """Return latitude and longitude of all positions of a line or an outline.

    Raises:
        NetworkError: one line that names the file, the place in it and what was expected.
    """
    read = _read_positions(positions, place)
    return system.lat_lon_deg([x for x, _, _ in read], [y for _, y, _ in read], place)


def _read_positions(positions: object, place: str) -> list[Position]:
    if not isinstance(positions, list) or len(positions) < 2:
        raise NetworkError(f"{place}: expected a line of at least two positions")
    return [_read_position(position, f"{place}[{number}]") for number, position in enumerate(positions)]


def _read_position(coordinates: object, place: str) -> Position:
    """Return a position; values after longitude and latitude are not used for flight (RFC 7946, 3.1.1)."""
    own = coordinates if isinstance(coordinates, list) else []
    x, y = (degrees_of(own[i], letters) if i < len(own) else None for i, letters in enumerate((EAST_WEST, NORTH_SOUTH)))
    if not is_figure(x) or not is_figure(y):
        raise NetworkError(f"{place}: expected finite numbers [longitude, latitude], got {coordinates!r}")
    return x, y, read_third_coordinate(own[2]) if len(own) > 2 else None
