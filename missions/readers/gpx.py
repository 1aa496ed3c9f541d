"""GPX, of hand-held receivers: waypoints are poles, routes and tracks are lines; always WGS 84."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from missions.errors import NetworkError
from missions.files import is_figure
from missions.readers.attributes import figure_of
from missions.readers.choice import Choice
from missions.readers.drawing import Drawing, Line, Matter, Pole, Remark, Vertex
from missions.readers.xmltree import children, line_of, tag_of, text_of

if TYPE_CHECKING:
    from lxml import etree

FORMAT = "GPX"


def draw_gpx(root: etree._Element, source: str, choice: Choice) -> Drawing:
    """Return what a GPX document shows.

    Points of a route that have a name are poles, too.

    Raises:
        NetworkError: one line that names the file, the place in it and what was expected.
    """
    choice.no_layers(source, FORMAT)
    choice.no_crs(source, FORMAT)
    drawing = choice.drawing(source, FORMAT)
    for point in children(root, "wpt"):
        _add_pole(drawing, point, "")
    for line in children(root, "rte", "trk"):
        name, tag = text_of(line, "name"), tag_of(line)
        place = f"{tag} {name!r} ({line_of(line)})" if name else f"{tag} in {line_of(line)}"
        attributes = {"name": name, "type": text_of(line, "type"), "desc": text_of(line, "desc"), "kind": tag}
        if not choice.takes(attributes):
            continue
        if tag == "rte":
            points = list(children(line, "rtept"))
            parts: Sequence[Sequence[etree._Element]] = [points]
            for point in points:
                if text_of(point, "name"):
                    _add_pole(drawing, point, name)
        else:
            parts = [list(children(segment, "trkpt")) for segment in children(line, "trkseg")]
        # Receivers write a segment of no point, or of one, whenever they lose their fix.
        short, parts = sum(len(part) < 2 for part in parts), [part for part in parts if len(part) > 1]
        if short or not parts:
            text = f"{short} parts of fewer than two points: left out" if short else "a line without points: left out"
            drawing.found.append(Remark(Matter.LEFT_OUT, name or place, text))
        if parts:
            drawing.draw(Line(place, name, tuple(tuple(_vertex(point, source) for point in part) for part in parts)))
    if drawing.found and not drawing.lines:
        raise NetworkError(f"{source}: {drawing.found[0].asset}: expected a line of at least two points")
    return drawing


def _add_pole(drawing: Drawing, point: etree._Element, line: str) -> None:
    lat_deg, lon_deg, third_m = _vertex(point, drawing.source)
    place = f"{tag_of(point)} in {line_of(point)}"
    drawing.poles.append(Pole(place, text_of(point, "name"), lat_deg, lon_deg, third_m=third_m, line=line))


def _vertex(point: etree._Element, source: str) -> Vertex:
    figures = [figure_of(point.get(key) or "") for key in ("lat", "lon")]
    if not all(map(is_figure, figures)):
        got = f"{point.get('lat')!r} and {point.get('lon')!r}"
        raise NetworkError(f"{source}: {tag_of(point)} in {line_of(point)}: expected lat and lon in degrees, got {got}")
    height_m = figure_of(text_of(point, "ele") or "")
    return float(figures[0] or 0.0), float(figures[1] or 0.0), height_m if is_figure(height_m) else None
