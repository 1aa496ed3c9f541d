"""Export to other programs: missions for QGroundControl; line, routes and flown tracks as KML, GeoJSON and GPX.

Each map format is written from the same plain `MapFeatures`, so that all have the same content, as far as each allows.
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
from missions.exports.plan_and_waypoints import format_qgc_plan, format_qgc_waypoints
