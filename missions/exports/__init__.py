"""What Google Earth, GIS programs and handhelds read: the line, routes and flown tracks as KML, GeoJSON and GPX.

Each format is written from the same plain `MapFeatures`, so that what is in one is in all of them, as far as it can say it.
"""

from missions.exports.drawn import Fact, MapFeatureKind, MapFeatures, MapLine, MapLinePiece, MapPoint, Reference
from missions.exports.geojson import format_geojson
from missions.exports.gpx import format_gpx
from missions.exports.kml import format_kml
from missions.exports.plan import build_pad_points, build_plan_features, build_route_line, build_segment_lines

__all__ = [
    "Fact",
    "MapFeatureKind",
    "MapFeatures",
    "MapLine",
    "MapLinePiece",
    "MapPoint",
    "Reference",
    "build_pad_points",
    "build_plan_features",
    "build_route_line",
    "build_segment_lines",
    "format_geojson",
    "format_gpx",
    "format_kml",
]
