"""GPX 1.1: routes for what is planned, tracks for what was flown and for the line itself, waypoints for places.

A height is one above mean sea level; where heights are counted from the ground there is none.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from missions.exports.drawn import Drawn, DrawnKind, DrawnPlace, DrawnWay, Position, Reference
from missions.exports.xmltext import add, degrees, document, up_m_words, xml_root

if TYPE_CHECKING:
    from lxml import etree

GPX = "http://www.topografix.com/GPX/1/1"


def gpx_text(drawn: Drawn) -> str:
    """Return the text of a GPX file."""
    root = xml_root("gpx", {None: GPX}, version="1.1", creator="faultline")
    add(add(root, "metadata"), "name", drawn.title)
    for spot in drawn.spots:
        _add_spot(root, spot)
    for way in drawn.ways:
        if way.kind is DrawnKind.PLANNED:
            _add_route(root, way)
    for way in drawn.ways:
        if way.kind is not DrawnKind.PLANNED:
            _add_track(root, way)
    return document(root)


def _add_position(parent: etree._Element, tag: str, position: Position, reference: Reference) -> etree._Element:
    point = add(parent, tag, lat=degrees(position[0]), lon=degrees(position[1]))
    if reference is Reference.SEA and position[2] is not None:
        add(point, "ele", up_m_words(position))
    return point


def _add_spot(root: etree._Element, spot: DrawnPlace) -> None:
    point = _add_position(root, "wpt", spot.position, spot.reference)
    if spot.time is not None:
        add(point, "time", spot.time)
    _add_head(point, spot)


def _add_head(parent: etree._Element, drawn: DrawnPlace | DrawnWay) -> None:
    add(parent, "name", drawn.name)
    words = "; ".join(f"{key}: {value}" for key, value in drawn.facts.items() if value is not None)
    if words:
        add(parent, "desc", words)
    add(parent, "type", drawn.kind.value)


def _add_route(root: etree._Element, way: DrawnWay) -> None:
    for piece in way.pieces:
        route = add(root, "rte")
        _add_head(route, way)
        for position in piece.positions:
            _add_position(route, "rtept", position, way.reference)


def _add_track(root: etree._Element, way: DrawnWay) -> None:
    track = add(root, "trk")
    _add_head(track, way)
    for piece in way.pieces:
        segment = add(track, "trkseg")
        for index, position in enumerate(piece.positions):
            point = _add_position(segment, "trkpt", position, way.reference)
            if piece.times:
                add(point, "time", piece.times[index])
