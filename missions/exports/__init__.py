"""What Google Earth, GIS programs and handhelds read: the line, routes and flown tracks as KML, GeoJSON and GPX.

Each format is written from the same plain `MapFeatures`, so that all hold the same, as far as each format can say it.
"""

from missions.exports.map_features import (
    Fact,
    MapFeatureKind,
    MapFeatures,
    MapLine,
    MapLinePiece,
    MapPoint,
    Reference,
    build_pad_points,
    build_plan_features,
    build_route_line,
    build_segment_lines,
)
from missions.exports.map_formats import format_geojson, format_gpx, format_kml
