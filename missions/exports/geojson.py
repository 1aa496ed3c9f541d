"""GeoJSON (RFC 7946): one collection, with what is known of each feature among its properties.

Heights are above mean sea level, as crews and GIS programs use them, where the RFC has the ellipsoid: `heights` says
so for every feature. Times of a track are `coordTimes`, as other programs that make GeoJSON of tracks call them.
"""

from __future__ import annotations

import json
from collections.abc import Mapping

from missions.exports.drawn import Drawn, DrawnPlace, DrawnWay, Position, drawn_facts


def geojson_text(drawn: Drawn) -> str:
    """Return the text of a GeoJSON file."""
    features = [*(_way(drawn, way) for way in drawn.ways), *(_spot(drawn, spot) for spot in drawn.spots)]
    collection = {"type": "FeatureCollection", "name": drawn.title, "features": features}
    return json.dumps(collection, indent=1, allow_nan=False) + "\n"


def _way(drawn: Drawn, way: DrawnWay) -> dict[str, object]:
    lines = [[_coordinates(position) for position in piece.positions] for piece in way.pieces]
    times = [list(piece.times) for piece in way.pieces]
    properties = _properties(drawn, way)
    if any(times):
        properties |= {"begin": times[0][0], "end": times[-1][-1]}
        properties["coordTimes"] = times[0] if len(times) == 1 else times
    geometry = {"type": "LineString", "coordinates": lines[0]} if len(lines) == 1 else {
        "type": "MultiLineString", "coordinates": lines
    }  # fmt: skip
    return _feature(geometry, properties)


def _spot(drawn: Drawn, spot: DrawnPlace) -> dict[str, object]:
    properties = _properties(drawn, spot)
    if spot.time is not None:
        properties["time"] = spot.time
    return _feature({"type": "Point", "coordinates": _coordinates(spot.position)}, properties)


def _properties(drawn: Drawn, one: DrawnWay | DrawnPlace) -> dict[str, object]:
    colour = {} if one.vehicle is None else {"stroke": drawn.colour_of(one.vehicle)}
    return {"name": one.name, **drawn_facts(one), **colour}


def _coordinates(position: Position) -> list[float]:
    lat_deg, lon_deg, height_m = position
    return [round(lon_deg, 7), round(lat_deg, 7), *([] if height_m is None else [round(height_m, 2)])]


def _feature(geometry: Mapping[str, object], properties: Mapping[str, object]) -> dict[str, object]:
    return {"type": "Feature", "geometry": geometry, "properties": properties}
