"""KML 2.2 with Google's track for what was flown: time and place of every position, for the slider of Google Earth.

A folder for the line and one for each vehicle, in the vehicle's colour. Pictures of icons would have to be fetched, so
the viewer's own pin is coloured.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from missions.exports.map_features import (
    MapFeatureKind,
    MapFeatures,
    MapLine,
    MapLinePiece,
    MapPoint,
    Position,
    Reference,
    collect_facts,
)
from missions.exports.xml_text import add_element, build_xml_root, format_degrees, format_document, format_height

if TYPE_CHECKING:
    from lxml import etree

KML = "http://www.opengis.net/kml/2.2"
GX = "http://www.google.com/kml/ext/2.2"
_GX = f"{{{GX}}}"
MODES = {Reference.SEA: "absolute", Reference.GROUND: "relativeToGround", Reference.NONE: "clampToGround"}
WIDTHS = {MapFeatureKind.SEGMENT: 2.0, MapFeatureKind.PLANNED: 2.0, MapFeatureKind.FLOWN: 4.0}
OPACITIES = {MapFeatureKind.SEGMENT: 0.8, MapFeatureKind.PLANNED: 0.7, MapFeatureKind.FLOWN: 1.0}
LINE, EVENT, PLACE = "#ffffff", "#ff2d2d", "#ffffff"


def format_kml(drawn: MapFeatures) -> str:
    """Return the text of a KML file."""
    root = build_xml_root("kml", {None: KML, "gx": GX})
    whole = add_element(root, "Document")
    add_element(whole, "name", drawn.title)
    add_element(whole, "open", 1)
    _add_styles(whole, drawn)
    things: list[MapLine | MapPoint] = [*drawn.ways, *drawn.spots]
    for vehicle in (None, *drawn.vehicles):
        own = [one for one in things if one.vehicle == vehicle]
        if own:
            folder = add_element(whole, "Folder")
            add_element(folder, "name", vehicle or "line")
            for one in own:
                _add_placemark(folder, drawn, one)
    return format_document(root)


def _add_styles(whole: etree._Element, drawn: MapFeatures) -> None:
    _add_style(whole, MapFeatureKind.SEGMENT.value, LINE, MapFeatureKind.SEGMENT)
    _add_style(whole, MapFeatureKind.DEPOT.value, PLACE, None)
    _add_style(whole, MapFeatureKind.EVENT.value, EVENT, None)
    for number, vehicle in enumerate(drawn.vehicles):
        for kind in (MapFeatureKind.PLANNED, MapFeatureKind.FLOWN, MapFeatureKind.PAD):
            _add_style(whole, f"{kind.value}-{number}", drawn.colour_of(vehicle), kind if kind in WIDTHS else None)


def _add_style(whole: etree._Element, name: str, colour: str, kind: MapFeatureKind | None) -> None:
    style = add_element(whole, "Style", id=name)
    icon = add_element(style, "IconStyle")
    add_element(icon, "color", _format_colour(colour, 1.0))
    add_element(icon, "scale", 0.8)
    if kind is not None:
        line = add_element(style, "LineStyle")
        add_element(line, "color", _format_colour(colour, OPACITIES[kind]))
        add_element(line, "width", WIDTHS[kind])


def _format_colour(colour: str, opacity: float) -> str:
    """Return a colour as KML has it: opacity, blue, green, red.

    >>> _format_colour("#56b4e9", 1.0)
    'ffe9b456'
    """
    red, green, blue = colour[1:3], colour[3:5], colour[5:7]
    return f"{round(255 * opacity):02x}{blue}{green}{red}"


def _style_of(drawn: MapFeatures, one: MapLine | MapPoint) -> str:
    shared = one.vehicle is None or one.kind is MapFeatureKind.EVENT
    return f"#{one.kind.value}" if shared else f"#{one.kind.value}-{drawn.vehicles.index(one.vehicle or '')}"


def _add_placemark(folder: etree._Element, drawn: MapFeatures, one: MapLine | MapPoint) -> None:
    mark = add_element(folder, "Placemark")
    add_element(mark, "name", one.name)
    if isinstance(one, MapPoint) and one.time is not None:
        add_element(add_element(mark, "TimeStamp"), "when", one.time)
    add_element(mark, "styleUrl", _style_of(drawn, one))
    data = add_element(mark, "ExtendedData")
    for key, value in collect_facts(one).items():
        add_element(add_element(data, "Data", name=key), "value", value)
    if isinstance(one, MapPoint):
        _add_point(mark, one)
    elif any(piece.times for piece in one.pieces):
        _add_track(mark, one)
    else:
        _add_line(mark, one)


def _add_point(mark: etree._Element, spot: MapPoint) -> None:
    point = add_element(mark, "Point")
    add_element(point, "altitudeMode", MODES[spot.reference])
    add_element(point, "coordinates", _format_position(spot.position))


def _add_line(mark: etree._Element, way: MapLine) -> None:
    place = mark if len(way.pieces) == 1 else add_element(mark, "MultiGeometry")
    for piece in way.pieces:
        line = add_element(place, "LineString")
        add_element(line, "tessellate", int(way.reference is Reference.NONE))
        add_element(line, "altitudeMode", MODES[way.reference])
        add_element(line, "coordinates", " ".join(map(_format_position, piece.positions)))


def _add_track(mark: etree._Element, way: MapLine) -> None:
    several = len(way.pieces) > 1
    place = add_element(mark, f"{_GX}MultiTrack") if several else mark
    if several:
        add_element(place, f"{_GX}interpolate", 0)  # nothing is known of the gaps
    for piece in way.pieces:
        _add_piece(place, piece, MODES[way.reference])


def _add_piece(place: etree._Element, piece: MapLinePiece, mode: str) -> None:
    track = add_element(place, f"{_GX}Track")
    add_element(track, f"{{{KML}}}altitudeMode", mode)
    for time in piece.times:
        add_element(track, f"{{{KML}}}when", time)
    for position in piece.positions:
        add_element(
            track,
            f"{_GX}coord",
            f"{format_degrees(position[1])} {format_degrees(position[0])} {format_height(position)}",
        )


def _format_position(position: Position) -> str:
    return f"{format_degrees(position[1])},{format_degrees(position[0])},{format_height(position)}"
