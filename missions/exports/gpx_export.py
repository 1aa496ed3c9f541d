"""GPX 1.1: routes for what is planned, tracks for what was flown and for the line itself, waypoints for places.

A height is one above mean sea level; where heights are counted from the ground there is none.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from missions.exports.map_features import MapFeatureKind, MapFeatures, MapLine, MapPoint, Position, Reference
from missions.exports.xml_text import add_element, build_xml_root, format_degrees, format_document, format_height

if TYPE_CHECKING:
    from lxml import etree

GPX = "http://www.topografix.com/GPX/1/1"


def format_gpx(drawn: MapFeatures) -> str:
    """Return the text of a GPX file."""
    root = build_xml_root("gpx", {None: GPX}, version="1.1", creator="faultline")
    add_element(add_element(root, "metadata"), "name", drawn.title)
    for spot in drawn.spots:
        _add_point(root, spot)
    for way in drawn.ways:
        if way.kind is MapFeatureKind.PLANNED:
            _add_route(root, way)
    for way in drawn.ways:
        if way.kind is not MapFeatureKind.PLANNED:
            _add_track(root, way)
    return format_document(root)


def _add_position(parent: etree._Element, tag: str, position: Position, reference: Reference) -> etree._Element:
    point = add_element(parent, tag, lat=format_degrees(position[0]), lon=format_degrees(position[1]))
    if reference is Reference.SEA and position[2] is not None:
        add_element(point, "ele", format_height(position))
    return point


def _add_point(root: etree._Element, spot: MapPoint) -> None:
    point = _add_position(root, "wpt", spot.position, spot.reference)
    if spot.time is not None:
        add_element(point, "time", spot.time)
    _add_head(point, spot)


def _add_head(parent: etree._Element, drawn: MapPoint | MapLine) -> None:
    add_element(parent, "name", drawn.name)
    words = "; ".join(f"{key}: {value}" for key, value in drawn.facts.items() if value is not None)
    if words:
        add_element(parent, "desc", words)
    add_element(parent, "type", drawn.kind.value)


def _add_route(root: etree._Element, way: MapLine) -> None:
    for piece in way.pieces:
        route = add_element(root, "rte")
        _add_head(route, way)
        for position in piece.positions:
            _add_position(route, "rtept", position, way.reference)


def _add_track(root: etree._Element, way: MapLine) -> None:
    track = add_element(root, "trk")
    _add_head(track, way)
    for piece in way.pieces:
        segment = add_element(track, "trkseg")
        for index, position in enumerate(piece.positions):
            point = _add_position(segment, "trkpt", position, way.reference)
            if piece.times:
                add_element(point, "time", piece.times[index])
