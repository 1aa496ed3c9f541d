"""KML 2.2 with Google's track for what was flown: time and place of every position, for the slider of Google Earth.

A folder for the line and one for each vehicle, in the vehicle's colour. Pictures of icons would have to be fetched, so
the viewer's own pin is coloured.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from missions.exports.drawn import Drawn, DrawnKind, DrawnPlace, DrawnWay, Piece, Position, Reference, drawn_facts
from missions.exports.xmltext import add, degrees, document, of_vehicle, up_m_words, xml_root

if TYPE_CHECKING:
    from lxml import etree

KML = "http://www.opengis.net/kml/2.2"
GX = "http://www.google.com/kml/ext/2.2"
_GX = f"{{{GX}}}"
MODES = {Reference.SEA: "absolute", Reference.GROUND: "relativeToGround", Reference.NONE: "clampToGround"}
WIDTHS = {DrawnKind.SEGMENT: 2.0, DrawnKind.PLANNED: 2.0, DrawnKind.FLOWN: 4.0}
OPACITIES = {DrawnKind.SEGMENT: 0.8, DrawnKind.PLANNED: 0.7, DrawnKind.FLOWN: 1.0}
LINE, EVENT, PLACE = "#ffffff", "#ff2d2d", "#ffffff"


def kml_text(drawn: Drawn) -> str:
    """Return the text of a KML file."""
    root = xml_root("kml", {None: KML, "gx": GX})
    whole = add(root, "Document")
    add(whole, "name", drawn.title)
    add(whole, "open", 1)
    _add_styles(whole, drawn)
    for vehicle in (None, *drawn.vehicles):
        things = list(of_vehicle(drawn, vehicle))
        if things:
            folder = add(whole, "Folder")
            add(folder, "name", vehicle or "line")
            for one in things:
                _add_placemark(folder, drawn, one)
    return document(root)


def _add_styles(whole: etree._Element, drawn: Drawn) -> None:
    _add_style(whole, DrawnKind.SEGMENT.value, LINE, DrawnKind.SEGMENT)
    _add_style(whole, DrawnKind.DEPOT.value, PLACE, None)
    _add_style(whole, DrawnKind.EVENT.value, EVENT, None)
    for number, vehicle in enumerate(drawn.vehicles):
        for kind in (DrawnKind.PLANNED, DrawnKind.FLOWN, DrawnKind.PAD):
            _add_style(whole, f"{kind.value}-{number}", drawn.colour_of(vehicle), kind if kind in WIDTHS else None)


def _add_style(whole: etree._Element, name: str, colour: str, kind: DrawnKind | None) -> None:
    style = add(whole, "Style", id=name)
    icon = add(style, "IconStyle")
    add(icon, "color", _colour(colour, 1.0))
    add(icon, "scale", 0.8)
    if kind is not None:
        line = add(style, "LineStyle")
        add(line, "color", _colour(colour, OPACITIES[kind]))
        add(line, "width", WIDTHS[kind])


def _colour(colour: str, opacity: float) -> str:
    """Return a colour as KML has it: opacity, blue, green, red.

    >>> _colour("#56b4e9", 1.0)
    'ffe9b456'
    """
    red, green, blue = colour[1:3], colour[3:5], colour[5:7]
    return f"{round(255 * opacity):02x}{blue}{green}{red}"


def _style_of(drawn: Drawn, one: DrawnWay | DrawnPlace) -> str:
    shared = one.vehicle is None or one.kind is DrawnKind.EVENT
    return f"#{one.kind.value}" if shared else f"#{one.kind.value}-{drawn.vehicles.index(one.vehicle or '')}"


def _add_placemark(folder: etree._Element, drawn: Drawn, one: DrawnWay | DrawnPlace) -> None:
    mark = add(folder, "Placemark")
    add(mark, "name", one.name)
    if isinstance(one, DrawnPlace) and one.time is not None:
        add(add(mark, "TimeStamp"), "when", one.time)
    add(mark, "styleUrl", _style_of(drawn, one))
    data = add(mark, "ExtendedData")
    for key, value in drawn_facts(one).items():
        add(add(data, "Data", name=key), "value", value)
    if isinstance(one, DrawnPlace):
        _add_point(mark, one)
    elif any(piece.times for piece in one.pieces):
        _add_track(mark, one)
    else:
        _add_line(mark, one)


def _add_point(mark: etree._Element, spot: DrawnPlace) -> None:
    point = add(mark, "Point")
    add(point, "altitudeMode", MODES[spot.reference])
    add(point, "coordinates", _tuple(spot.position))


def _add_line(mark: etree._Element, way: DrawnWay) -> None:
    place = mark if len(way.pieces) == 1 else add(mark, "MultiGeometry")
    for piece in way.pieces:
        line = add(place, "LineString")
        add(line, "tessellate", int(way.reference is Reference.NONE))
        add(line, "altitudeMode", MODES[way.reference])
        add(line, "coordinates", " ".join(map(_tuple, piece.positions)))


def _add_track(mark: etree._Element, way: DrawnWay) -> None:
    several = len(way.pieces) > 1
    place = add(mark, f"{_GX}MultiTrack") if several else mark
    if several:
        add(place, f"{_GX}interpolate", 0)  # nothing is known of the gaps
    for piece in way.pieces:
        _add_piece(place, piece, MODES[way.reference])


def _add_piece(place: etree._Element, piece: Piece, mode: str) -> None:
    track = add(place, f"{_GX}Track")
    add(track, f"{{{KML}}}altitudeMode", mode)
    for time in piece.times:
        add(track, f"{{{KML}}}when", time)
    for position in piece.positions:
        add(track, f"{_GX}coord", f"{degrees(position[1])} {degrees(position[0])} {up_m_words(position)}")


def _tuple(position: Position) -> str:
    return f"{degrees(position[1])},{degrees(position[0])},{up_m_words(position)}"
