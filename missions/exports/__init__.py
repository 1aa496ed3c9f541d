"""What other programs read: missions for QGroundControl; line, routes and flown tracks as KML, GeoJSON and GPX.

Each format for maps is written from the same plain `MapFeatures`, so that all hold the same, as far as each can say it.
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
