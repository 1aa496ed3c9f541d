"""What Google Earth, GIS programs and handhelds read: the line, routes and flown tracks as KML, GeoJSON and GPX.

Each format is written from the same plain `Drawn`, so that what is in one is in all of them, as far as it can say it.
"""

from missions.exports.drawn import Drawn, DrawnKind, DrawnPlace, DrawnWay, Fact, Piece, Reference
from missions.exports.geojson import geojson_text
from missions.exports.gpx import gpx_text
from missions.exports.kml import kml_text
from missions.exports.plan import drawn_line, drawn_pads, drawn_plan, drawn_route

__all__ = [
    "Drawn",
    "DrawnKind",
    "DrawnPlace",
    "DrawnWay",
    "Fact",
    "Piece",
    "Reference",
    "drawn_line",
    "drawn_pads",
    "drawn_plan",
    "drawn_route",
    "geojson_text",
    "gpx_text",
    "kml_text",
]
