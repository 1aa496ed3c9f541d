"""GPX, of hand-held receivers: waypoints are poles, routes and tracks are lines; always WGS 84."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

from missions.errors import NetworkError
from missions.files import is_figure, to_printable
from missions.readers.features import Feature, GeometryKind, Position, add_line, add_points, is_wanted_line
from missions.readers.raw_network import RawNetwork, Remark, RemarkTopic
from missions.readers.read_options import ReadOptions
from missions.readers.values import EAST_WEST, NORTH_SOUTH, degrees_of, parse_figure
from missions.readers.xml_tree import iterate_children, line_of, read_child_text, tag_of

if TYPE_CHECKING:
    from lxml import etree

FORMAT = "GPX"


def parse_gpx(root: etree._Element, source: str, choice: ReadOptions) -> RawNetwork:
    """Return what a GPX document shows.

    Points of a route that have a name are poles, too.

    Raises:
        NetworkError: one line that names the file, the place in it and what was expected.
    """
    choice.refuse_layers(source, FORMAT)
    choice.refuse_crs(source, FORMAT)
    drawing = choice.create_raw_network(source, FORMAT)
    for point in iterate_children(root, "wpt"):
        _add_pole(drawing, point, "")
    for line in iterate_children(root, "rte", "trk"):
        name, tag = read_child_text(line, "name"), tag_of(line)
        place = f"{tag} {name!r} ({line_of(line)})" if name else f"{tag} in {line_of(line)}"
        feature = Feature(place, GeometryKind.LINE, (), {**_read_attributes(line), "kind": tag})
        if not is_wanted_line(drawing, feature, choice):
            continue
        if tag == "rte":
            points = list(iterate_children(line, "rtept"))
            parts: Sequence[Sequence[etree._Element]] = [points]
            for point in points:
                if read_child_text(point, "name"):
                    _add_pole(drawing, point, name)
        else:
            parts = [list(iterate_children(segment, "trkpt")) for segment in iterate_children(line, "trkseg")]
        # Receivers write a segment of no point, or of one, whenever they lose their fix.
        short, parts = sum(len(part) < 2 for part in parts), [part for part in parts if len(part) > 1]
        if short or not parts:
            text = f"{short} parts of fewer than two points: left out" if short else "a line without points: left out"
            drawing.found.append(Remark(RemarkTopic.LEFT_OUT, name or place, text))
        if parts:
            places = [[_read_position(point, source) for point in part] for part in parts]
            add_line(drawing, replace(feature, parts=places))
    if drawing.found and not drawing.lines and drawing.far is None:
        raise NetworkError(f"{source}: {drawing.found[0].asset}: expected a line of at least two points")
    return drawing


def _add_pole(drawing: RawNetwork, point: etree._Element, line: str) -> None:
    place = f"{tag_of(point)} in {line_of(point)}"
    attributes = {**_read_attributes(point), **({"line": line} if line else {})}
    feature = Feature(place, GeometryKind.POINT, [[_read_position(point, drawing.source)]], attributes)
    add_points(drawing, feature)


def _read_attributes(element: etree._Element) -> dict[str, object]:
    """Return what is said of a point or a line, in its own words and in those of the program that wrote it."""
    own = {key: read_child_text(element, key) for key in ("name", "type", "desc")}
    extensions = (
        leaf for more in iterate_children(element, "extensions") for leaf in more.iterdescendants("*") if not len(leaf)
    )
    return {**{tag_of(leaf): to_printable(leaf.text or "") for leaf in extensions}, **own}


def _read_position(point: etree._Element, source: str) -> Position:
    lat_deg, lon_deg = degrees_of(point.get("lat"), NORTH_SOUTH), degrees_of(point.get("lon"), EAST_WEST)
    if not is_figure(lat_deg) or not is_figure(lon_deg):
        got = f"{point.get('lat')!r} and {point.get('lon')!r}"
        raise NetworkError(f"{source}: {tag_of(point)} in {line_of(point)}: expected lat and lon in degrees, got {got}")
    return lon_deg, lat_deg, parse_figure(read_child_text(point, "ele"))
