"""Write KML, GPX and GeoJSON from the same `MapFeatures`, so that all have the same content, as far as each allows.

KML 2.2 has a folder for the line and one for each vehicle, in the vehicle's colour, and Google's track for flown paths:
time and place of every position, for the time slider of Google Earth. Icon images would have to be fetched, so the
viewer's own pin is coloured.

GPX 1.1 has routes for planned paths, tracks for flown paths and for the line itself, waypoints for places. A height is
above mean sea level; heights above ground are omitted.

GeoJSON (RFC 7946) is one collection, with each feature's data among its properties. Heights are above mean sea level,
as crews and GIS programs use them, whereas the RFC has the ellipsoid: `heights` states this for every feature. Times of
a track are `coordTimes`, as in other programs that convert tracks to GeoJSON.
"""

from __future__ import annotations

import json
import re
from functools import cache

from jinja2 import Environment, PackageLoader, StrictUndefined
from markupsafe import Markup

from missions.exports.map_features import MapFeatures, MapLine, MapPoint, Position, Reference, collect_facts

MODES = {Reference.SEA: "absolute", Reference.GROUND: "relativeToGround", Reference.NONE: "clampToGround"}
WIDTHS = {"segment": 2.0, "planned": 2.0, "flown": 4.0}
OPACITIES = {"segment": 0.8, "planned": 0.7, "flown": 1.0}
_UNFIT = re.compile("[^\t\n\r\x20-\ud7ff\ue000-\ufffd\U00010000-\U0010ffff]")
"""Characters that XML 1.0 does not allow."""


def format_kml(drawn: MapFeatures) -> str:
    """Return the text of a KML file."""
    folders = {owner: [one for one in drawn.things if one.vehicle == owner] for owner in (None, *drawn.vehicles)}
    template = _load_environment().get_template("map.kml")
    return template.render(drawn=drawn, folders=folders, widths=WIDTHS, opacities=OPACITIES)


def format_gpx(drawn: MapFeatures) -> str:
    """Return the text of a GPX file."""
    return _load_environment().get_template("map.gpx").render(drawn=drawn)


def format_geojson(drawn: MapFeatures) -> str:
    """Return the text of a GeoJSON file."""
    features = [_build_feature(drawn, one) for one in drawn.things]
    collection = {"type": "FeatureCollection", "name": drawn.title, "features": features}
    return json.dumps(collection, indent=1, allow_nan=False) + "\n"


def _build_feature(drawn: MapFeatures, one: MapLine | MapPoint) -> dict[str, object]:
    colour = {} if one.vehicle is None else {"stroke": drawn.colour_of(one.vehicle)}
    properties: dict[str, object] = {"name": one.name, **collect_facts(one), **colour}
    kind: str
    places: object
    if isinstance(one, MapPoint):
        kind, places = "Point", _to_coordinates(one.position)
        properties |= {} if one.time is None else {"time": one.time}
    else:
        lines = [list(map(_to_coordinates, piece.positions)) for piece in one.pieces]
        times = [piece.times for piece in one.pieces]
        kind, places = ("LineString", lines[0]) if len(lines) == 1 else ("MultiLineString", lines)
        if any(times):
            properties |= {"begin": times[0][0], "end": times[-1][-1]}
            properties["coordTimes"] = times[0] if len(times) == 1 else times
    return {"type": "Feature", "geometry": {"type": kind, "coordinates": places}, "properties": properties}


def _to_coordinates(position: Position) -> list[float]:
    lat_deg, lon_deg, height_m = position
    return [round(lon_deg, 7), round(lat_deg, 7), *([] if height_m is None else [round(height_m, 2)])]


@cache
def _load_environment() -> Environment:
    found = Environment(
        loader=PackageLoader("missions.exports"), autoescape=True, finalize=_to_xml_text, undefined=StrictUndefined,
        trim_blocks=True, lstrip_blocks=True,
    )  # fmt: skip
    found.filters |= {
        "abgr": _format_colour,
        "degrees": lambda value: f"{value:.7f}",
        "facts": collect_facts,
        "height": lambda position: f"{position[2] or 0.0:.2f}",  # 0 if unknown
        "mode": MODES.__getitem__,
        "words": _describe_facts,
    }
    found.tests |= {"point": lambda one: isinstance(one, MapPoint)}
    return found


def _to_xml_text(value: object) -> str:
    r"""Return a value without characters invalid in XML.

    >>> _to_xml_text("P41\x00-P42")
    'P41 -P42'
    """
    return value if isinstance(value, Markup) else _UNFIT.sub(" ", str(value))


def _format_colour(colour: str, opacity: float) -> str:
    """Return a colour in KML's order: opacity, blue, green, red.

    >>> _format_colour("#56b4e9", 1.0)
    'ffe9b456'
    """
    red, green, blue = colour[1:3], colour[3:5], colour[5:7]
    return f"{round(255 * opacity):02x}{blue}{green}{red}"


def _describe_facts(one: MapLine | MapPoint) -> str:
    return "; ".join(f"{key}: {value}" for key, value in one.facts.items() if value is not None)
