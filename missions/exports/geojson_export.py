"""GeoJSON (RFC 7946): one collection, with what is known of each feature among its properties.

Heights are above mean sea level, as crews and GIS programs use them, where the RFC has the ellipsoid: `heights` says
so for every feature. Times of a track are `coordTimes`, as other programs that make GeoJSON of tracks call them.
"""

from __future__ import annotations

import json
from collections.abc import Mapping

from missions.exports.map_features import MapFeatures, MapLine, MapPoint, Position, collect_facts


def format_geojson(drawn: MapFeatures) -> str:
    """Return the text of a GeoJSON file."""
    features = [
        *(_build_line_feature(drawn, way) for way in drawn.ways),
        *(_build_point_feature(drawn, spot) for spot in drawn.spots),
    ]
    collection = {"type": "FeatureCollection", "name": drawn.title, "features": features}
    return json.dumps(collection, indent=1, allow_nan=False) + "\n"


def _build_line_feature(drawn: MapFeatures, way: MapLine) -> dict[str, object]:
    lines = [[_to_coordinates(position) for position in piece.positions] for piece in way.pieces]
    times = [list(piece.times) for piece in way.pieces]
    properties = _build_properties(drawn, way)
    if any(times):
        properties |= {"begin": times[0][0], "end": times[-1][-1]}
        properties["coordTimes"] = times[0] if len(times) == 1 else times
    geometry = {"type": "LineString", "coordinates": lines[0]} if len(lines) == 1 else {
        "type": "MultiLineString", "coordinates": lines
    }  # fmt: skip
    return _build_feature(geometry, properties)


def _build_point_feature(drawn: MapFeatures, spot: MapPoint) -> dict[str, object]:
    properties = _build_properties(drawn, spot)
    if spot.time is not None:
        properties["time"] = spot.time
    return _build_feature({"type": "Point", "coordinates": _to_coordinates(spot.position)}, properties)


def _build_properties(drawn: MapFeatures, one: MapLine | MapPoint) -> dict[str, object]:
    colour = {} if one.vehicle is None else {"stroke": drawn.colour_of(one.vehicle)}
    return {"name": one.name, **collect_facts(one), **colour}


def _to_coordinates(position: Position) -> list[float]:
    lat_deg, lon_deg, height_m = position
    return [round(lon_deg, 7), round(lat_deg, 7), *([] if height_m is None else [round(height_m, 2)])]


def _build_feature(geometry: Mapping[str, object], properties: Mapping[str, object]) -> dict[str, object]:
    return {"type": "Feature", "geometry": geometry, "properties": properties}
