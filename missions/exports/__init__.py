"""What Google Earth, GIS programs and handhelds read: the line, routes and flown tracks as KML, GeoJSON and GPX.

Each format is written from the same plain `MapFeatures`, so that all hold the same, as far as each format can say it.
"""

from missions.exports.geojson_export import format_geojson
from missions.exports.gpx_export import format_gpx
from missions.exports.kml_export import format_kml
from missions.exports.map_features import Fact, MapFeatureKind, MapFeatures, MapLine, MapLinePiece, MapPoint, Reference
from missions.exports.plan_features import build_pad_points, build_plan_features, build_route_line, build_segment_lines
