"""Read untrusted XML: KML, KMZ, GPX and OpenStreetMap, always WGS 84. No entity is expanded, nothing is fetched.

KML: a Point is a pole and a LineString a line, named by the Placemark. ``elevation_m`` and ``height_m`` come from
ExtendedData. Whether an altitude is that of ground, wire or top is unknown: an ``absolute`` one (above mean sea level)
is kept with its pole and never flown by; one relative to the ground, or clamped to it, is ignored and reported.

GPX, from hand-held receivers: waypoints are poles, routes and tracks are lines.

OpenStreetMap, its XML and the JSON of Overpass: ways with ``power`` line or minor_line are lines, named by ``name`` or
``ref``. Nodes of these ways with ``power`` tower, pole or similar are poles, named by ``ref``, else by number, as
``n123``. Other power features are left out, and so is what an editor has deleted.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from posixpath import normpath
from typing import TYPE_CHECKING
from urllib.parse import unquote

from missions.errors import NetworkError
from missions.files import is_figure, to_printable
from missions.readers.archives import Archive
from missions.readers.attributes import NODE, POWER_LINES, WAY, has_power_tag, normalise_attributes
from missions.readers.features import (
    EMPTY,
    Feature,
    GeometryKind,
    Position,
    add_features,
    add_line,
    add_points,
    is_wanted_line,
)
from missions.readers.raw_network import RawNetwork, ReadOptions, Remark, RemarkTopic, explain_empty_file, quote_names
from missions.readers.values import EAST_WEST, NORTH_SOUTH, degrees_of, parse_figure

if TYPE_CHECKING:
    from lxml import etree

MOST_BYTES = 100_000_000
UNDECLARED = "NS_ERR_UNDEFINED_NAMESPACE"
"""Error for a prefix, e.g. xsi: or gx:, without its xmlns, as editors write it; Google Earth and GDAL ignore it."""
_PAGE = re.compile(rb"(?:\xef\xbb\xbf)?\s*(?:<!--.*?-->\s*)?<(?:!doctype\s+html|html)\b", re.IGNORECASE | re.DOTALL)
_TITLE = re.compile(rb"<title>(.*?)</title>", re.IGNORECASE | re.DOTALL)
KML = "KML"
GEOMETRIES = ("Point", "LineString", "MultiGeometry", "Polygon", "LinearRing", "Track", "MultiTrack", "Model")
KML_ROOTS = ("kml", "Document", "Folder", "Placemark")
"""Valid root elements; programs omit the outermost."""
OVERLAYS = ("GroundOverlay", "PhotoOverlay", "Tour")
CLAMPED = "clampToGround"
MODES = {
    "absolute": "above sea level (absolute): kept, and not flown by",
    "relativeToGround": "above the ground (relativeToGround), of wire or top is not said: not used",
    CLAMPED: "on the ground (clampToGround): not used",
}
"""Description of each altitudeMode."""
GPX = "GPX"
OSM_XML, OVERPASS = "OpenStreetMap XML", "Overpass JSON"


def root_of(content: bytes) -> etree._Element:
    """Return the root of an XML document.

    Raises:
        NetworkError: it is not XML, is too large, or declares a document type, which no format here has and bombs need.
    """
    from lxml import etree

    if len(content) > MOST_BYTES:
        raise NetworkError(f"content: expected XML of at most {MOST_BYTES // 1_000_000} MB")
    if _PAGE.match(content[:4096]):
        title = _TITLE.search(content[:4096])
        named = "" if title is None else f": {to_printable(title[1].decode('utf-8', 'replace'))[:100]!r}"
        raise NetworkError(f"content: expected a map's data, got a page of HTML such as a server's{named}")
    try:
        root = _parse_root(content)
    except (etree.XMLSyntaxError, ValueError) as reason:
        line = getattr(reason, "lineno", None)
        place = f"line {line}" if line else "content"
        words = to_printable(getattr(reason, "msg", None) or str(reason)) or "it is empty"
        if "EntityRef: " in words:
            words = "a bare &, which XML writes as &amp;"
        elif "ntit" in words:  # of an unknown entity, or of too many
            words = (
                f"entities are not expanded ({words})" if words.startswith("Entity '") else "entities are not expanded"
            )
        raise NetworkError(f"{place}: expected XML: {words}") from reason
    if root.getroottree().docinfo.doctype:
        raise NetworkError("content: expected XML without a document type (DOCTYPE)")
    return root


def _parse_root(content: bytes) -> etree._Element:
    """Return the root; undeclared prefixes are ignored."""
    from lxml import etree

    options = {
        "resolve_entities": False, "load_dtd": False, "no_network": True, "huge_tree": False,
        "remove_comments": True, "remove_pis": True,
    }  # fmt: skip
    parser = etree.XMLParser(**options)
    try:
        return etree.fromstring(content, parser)
    except etree.XMLSyntaxError:
        if {error.type_name for error in parser.error_log} != {UNDECLARED}:
            raise
    root = etree.fromstring(content, etree.XMLParser(**options, recover=True))
    for element in root.iter():
        if isinstance(element.tag, str) and not element.tag.startswith("{"):
            element.tag = element.tag.rpartition(":")[2]
    return root


def tag_of(element: etree._Element) -> str:
    """Return the name of an element without its namespace; empty if it is not an element."""
    tag = element.tag
    return tag.rpartition("}")[2] if isinstance(tag, str) else ""


def read_child_text(element: etree._Element, tag: str) -> str:
    """Return the text of the first child with a name, in any namespace; empty if there is none."""
    return to_printable(element.findtext(f"{{*}}{tag}") or "")


def line_of(element: etree._Element) -> str:
    """Return the line of an element in its file."""
    return f"line {element.sourceline}"


def extract_kml(archive: Archive) -> list[etree._Element]:
    """Return the roots of the documents of a KMZ: doc.kml, which programs display, then all others.

    Raises:
        NetworkError: it cannot be read.
    """
    names = archive.list_by_suffix(".kml")
    every = sorted(names, key=lambda name: (name.lower() != "doc.kml", name.count("/"), names.index(name)))
    return [root_of(archive.read(name)) for name in every]


def links_of(roots: Iterable[etree._Element], inside: Collection[str] = ()) -> Iterator[etree._Element]:
    """Yield the links to other files, except to files of the same archive, which are read anyway."""
    for root in roots:
        for link in root.iter("{*}NetworkLink"):
            hrefs = [unquote((href.text or "").strip()) for href in link.iter("{*}href")]
            if not any(normpath(href) in inside for href in hrefs):
                yield link


def parse_kmz(archive: Archive, choice: ReadOptions) -> RawNetwork:
    """Return the content of all documents of an archive.

    Raises:
        NetworkError: as for `parse_kml`.
    """
    names = archive.list_by_suffix(".kml")
    drawing = parse_kml(extract_kml(archive), choice, inside=names)
    if len(names) > 1:
        text = f"{len(names)} KML files in the archive, all of them are read: {quote_names(names)}"
        drawing.found.insert(0, Remark(RemarkTopic.WHOLE, choice.source, text))
    return drawing


def parse_kml(roots: Sequence[etree._Element], choice: ReadOptions, *, inside: Collection[str] = ()) -> RawNetwork:
    """Return the content of KML documents.

    Args:
        roots: Roots of the documents.
        choice: The part to read.
        inside: Names of the archive's documents.

    Raises:
        NetworkError: one line that names the file, the place in it and what was expected.
    """
    choice.refuse_crs(KML)
    drawing, modes = choice.create_raw_network(KML), Counter[str]()
    for mark, said in iterate_placemarks(roots, choice):
        add_features(drawing, _read_placemark(mark, said, modes), choice)
    for link in links_of(roots, inside):
        text = "a link to another file: not followed"
        drawing.found.append(Remark(RemarkTopic.WHOLE, read_child_text(link, "name") or line_of(link), text))
    for root in roots:
        for overlay in root.iter(*(f"{{*}}{tag}" for tag in OVERLAYS)):
            drawing.leave_out(tag_of(overlay), read_child_text(overlay, "name") or line_of(overlay))
    for mode, count in modes.items():
        what = "position has an altitude" if count == 1 else "positions have an altitude"
        drawing.found.append(Remark(RemarkTopic.HEIGHTS, KML, f"{count} {what} {MODES.get(mode, f'{mode}: not used')}"))
    return drawing


def iterate_placemarks(
    roots: Iterable[etree._Element], choice: ReadOptions
) -> Iterator[tuple[etree._Element, Feature]]:
    """Yield every Placemark of the selected folders, and its attributes, without its geometry."""
    marks = list(_find_placemarks(roots, ""))
    wanted = choice.select_layers(list(dict.fromkeys(folder for _, folder in marks)), "folder")
    for mark, folder in marks:
        if folder in wanted:
            name = read_child_text(mark, "name")
            place = f"Placemark {name!r} ({line_of(mark)})" if name else f"Placemark in {line_of(mark)}"
            attributes = {**_read_extended_data(mark), "folder": folder, **({"name": name} if name else {})}
            yield mark, Feature(place, GeometryKind.OTHER, (), attributes, name=name, other=EMPTY)


def _find_placemarks(elements: Iterable[etree._Element], folder: str) -> Iterator[tuple[etree._Element, str]]:
    """Yield every Placemark with its folder's name; the document's own name does not count."""
    for child in elements:
        tag = tag_of(child)
        if tag == "Placemark":
            yield child, folder
        elif tag in KML_ROOTS:
            yield from _find_placemarks(child, read_child_text(child, "name") if tag == "Folder" else folder)


def _read_placemark(mark: etree._Element, said: Feature, modes: Counter[str]) -> Iterator[Feature]:
    """Yield a Placemark's points, its lines, and its other geometries."""
    place, parts = said.place, dict[str, list[list[Position]]](Point=[], LineString=[])
    geometries = list(geometries_of(mark))
    for geometry in geometries:
        tag = tag_of(geometry)
        if tag in parts:
            parts[tag].append(positions_of(geometry, place, modes))
            if tag == "LineString" and len(parts[tag][-1]) < 2:
                raise NetworkError(f"{place}: coordinates: expected a line of at least two positions")
        else:
            yield replace(said, other=tag)
    if not geometries:
        yield said
    for tag, kind in (("Point", GeometryKind.POINT), ("LineString", GeometryKind.LINE)):
        if parts[tag]:
            yield Feature(place, kind, parts[tag], said.attributes)


def geometries_of(element: etree._Element) -> Iterator[etree._Element]:
    """Yield the geometries of a Placemark one at a time."""
    for child in element.iterchildren(*(f"{{*}}{tag}" for tag in GEOMETRIES)):
        if tag_of(child) == "MultiGeometry":
            yield from geometries_of(child)
        else:
            yield child


def _read_extended_data(mark: etree._Element) -> dict[str, object]:
    found: dict[str, object] = {}
    for data in mark.iterchildren("{*}ExtendedData"):
        for element in data.iter("{*}Data", "{*}SimpleData"):
            text = read_child_text(element, "value") if tag_of(element) == "Data" else to_printable(element.text or "")
            found[to_printable(element.get("name") or "")] = text
    return found


def positions_of(geometry: etree._Element, place: str, modes: Counter[str]) -> list[Position]:
    """Return the positions of a geometry, and count the altitude modes.

    Raises:
        NetworkError: there is none, or one is invalid.
    """
    mode = read_child_text(geometry, "altitudeMode") or CLAMPED
    words = (geometry.findtext("{*}coordinates") or "").split()
    if not words:
        raise NetworkError(f"{place}: coordinates: expected longitude,latitude[,altitude], found none")
    positions: list[Position] = []
    for word in words:
        figures = [parse_figure(figure) for figure in word.split(",")]
        if len(figures) < 2 or not all(map(is_figure, figures[:2])):
            raise NetworkError(f"{place}: coordinates: expected longitude,latitude[,altitude], got {word[:60]!r}")
        lon_deg, lat_deg = float(figures[0] or 0.0), float(figures[1] or 0.0)
        altitude_m = figures[2] if len(figures) > 2 else None
        if altitude_m:
            modes[mode] += 1
        positions.append((lon_deg, lat_deg, altitude_m if altitude_m and mode == "absolute" else None))
    return positions


def parse_gpx(root: etree._Element, choice: ReadOptions) -> RawNetwork:
    """Return the content of a GPX document.

    Named points of a route are poles, too.

    Raises:
        NetworkError: one line that names the file, the place in it and what was expected.
    """
    choice.refuse_layers(GPX)
    choice.refuse_crs(GPX)
    drawing = choice.create_raw_network(GPX)
    for point in root.iterchildren("{*}wpt"):
        _add_pole(drawing, point, "")
    for line in root.iterchildren("{*}rte", "{*}trk"):
        name, tag = read_child_text(line, "name"), tag_of(line)
        place = f"{tag} {name!r} ({line_of(line)})" if name else f"{tag} in {line_of(line)}"
        feature = Feature(place, GeometryKind.LINE, (), {**_read_attributes(line), "kind": tag})
        if not is_wanted_line(drawing, feature, choice):
            continue
        if tag == "rte":
            points = list(line.iterchildren("{*}rtept"))
            parts: Sequence[Sequence[etree._Element]] = [points]
            for point in points:
                if read_child_text(point, "name"):
                    _add_pole(drawing, point, name)
        else:
            parts = [list(segment.iterchildren("{*}trkpt")) for segment in line.iterchildren("{*}trkseg")]
        # Receivers write a segment of no point, or of one, whenever they lose their fix.
        short, parts = sum(len(part) < 2 for part in parts), [part for part in parts if len(part) > 1]
        if short or not parts:
            text = f"{short} parts of fewer than two points: left out" if short else "a line without points: left out"
            drawing.found.append(Remark(RemarkTopic.LEFT_OUT, name or place, text))
        if parts:
            places = [[_read_point(point) for point in part] for part in parts]
            add_line(drawing, replace(feature, parts=places))
    if drawing.found and not drawing.lines and drawing.far is None:
        raise NetworkError(f"{drawing.found[0].asset}: expected a line of at least two points")
    return drawing


def _add_pole(drawing: RawNetwork, point: etree._Element, line: str) -> None:
    place = f"{tag_of(point)} in {line_of(point)}"
    attributes = {**_read_attributes(point), **({"line": line} if line else {})}
    add_points(drawing, Feature(place, GeometryKind.POINT, [[_read_point(point)]], attributes))


def _read_attributes(element: etree._Element) -> dict[str, object]:
    """Return the attributes of a point or a line, standard ones and extensions of the program that wrote it."""
    own = {key: read_child_text(element, key) for key in ("name", "type", "desc")}
    extensions = (
        leaf for more in element.iterchildren("{*}extensions") for leaf in more.iterdescendants("*") if not len(leaf)
    )
    return {**{tag_of(leaf): to_printable(leaf.text or "") for leaf in extensions}, **own}


def _read_point(point: etree._Element) -> Position:
    place, third_m = f"{tag_of(point)} in {line_of(point)}", parse_figure(read_child_text(point, "ele"))
    return _read_position(point.get("lat"), point.get("lon"), place, third_m)


def _read_position(lat: object, lon: object, place: str, third_m: float | None = None) -> Position:
    lat_deg, lon_deg = degrees_of(lat, NORTH_SOUTH), degrees_of(lon, EAST_WEST)
    if not is_figure(lat_deg) or not is_figure(lon_deg):
        raise NetworkError(f"{place}: expected lat and lon in degrees, got {lat!r} and {lon!r}")
    return lon_deg, lat_deg, third_m


@dataclass(slots=True)
class _Content:
    """Nodes and ways, by number."""

    positions: dict[str, Position] = field(default_factory=dict)
    """Positions of nodes."""
    tags: dict[str, Mapping[str, str]] = field(default_factory=dict)
    """Tags of nodes that have any."""
    ways: dict[str, tuple[tuple[str, ...], Mapping[str, str]]] = field(default_factory=dict)
    deleted: int = 0
    remarks: list[str] = field(default_factory=list)
    """Remarks of the server on its answer."""


def parse_osm_xml(root: etree._Element, choice: ReadOptions) -> RawNetwork:
    """Return the content of an OpenStreetMap file.

    Raises:
        NetworkError: one line that names the file, the place in it and what was expected.
    """
    content = _Content(remarks=[to_printable(remark.text or "") for remark in root.iterchildren("remark")])
    for element in root:
        tags = {str(tag.get("k")): tag.get("v") for tag in element.iterchildren("tag")}
        references = [reference.get("ref") for reference in element.iterchildren("nd")]
        said = {**element.attrib, "type": element.tag, "tags": tags, "nodes": references}
        _add_element(content, said, f"{element.tag} {element.get('id')} (line {element.sourceline})")
    return _build_osm_network(content, OSM_XML, choice)


def parse_overpass(document: Mapping[str, object], choice: ReadOptions) -> RawNetwork:
    """Return the content of an answer of Overpass: of ``out body`` with the nodes, or of ``out geom``.

    Raises:
        NetworkError: one line that names the file, the place in it and what was expected.
    """
    elements, remark = document.get("elements"), document.get("remark")
    content = _Content(remarks=[to_printable(str(remark))] if remark else [])
    if not isinstance(elements, list):
        raise NetworkError("elements: expected a list of nodes and ways")
    for index, element in enumerate(elements):
        _add_element(content, element, f"elements[{index}]")
    return _build_osm_network(content, OVERPASS, choice)


def _add_element(content: _Content, element: object, place: str) -> None:
    if not isinstance(element, dict) or not isinstance(element.get("tags", {}), dict):
        raise NetworkError(f"{place}: expected an object with type, id and tags")
    tags = {str(key): to_printable(str(value)) for key, value in element.get("tags", {}).items()}
    kind, number_ = element.get("type"), str(element.get("id"))
    if element.get("visible") in (False, "false") or element.get("action") == "delete":
        content.deleted += kind in {NODE, WAY}  # from an editor before its upload, or from a history
    elif kind == NODE:
        content.positions[number_] = _read_position(element.get("lat"), element.get("lon"), place)
        content.tags[number_] = tags
    elif kind == WAY:
        content.ways[number_] = (_read_references(element, number_, content, place), tags)


def _read_references(way: Mapping[str, object], number_: str, content: _Content, place: str) -> tuple[str, ...]:
    """Return the nodes of a way; those present only in its geometry are added."""
    geometry, references = way.get("geometry"), way.get("nodes")
    if geometry is not None and not isinstance(geometry, list):
        raise NetworkError(f"{place}.geometry: expected a list of places, got {geometry!r}")
    if references is None and geometry is not None:
        references = [f"{number_}/{index}" for index in range(len(geometry))]
    if not isinstance(references, list):
        raise NetworkError(f"{place}.nodes: expected a list of nodes, got {references!r}; ask Overpass for 'out geom'")
    found = tuple(map(str, references))
    for index, (reference, at) in enumerate(zip(found, geometry or (), strict=False)):
        if reference not in content.positions and at is not None:
            if not isinstance(at, dict):
                raise NetworkError(f"{place}.geometry[{index}]: expected lat and lon, got {at!r}")
            content.positions[reference] = _read_position(at.get("lat"), at.get("lon"), f"{place}.geometry[{index}]")
    return found


def _build_osm_network(content: _Content, what: str, choice: ReadOptions) -> RawNetwork:
    choice.refuse_layers(what)
    choice.refuse_crs(what)
    drawing = choice.create_raw_network(what)
    drawing.found += _check_server_remarks(content.remarks, choice.source)
    used = dict[str, None]()
    for way, (references, tags) in content.ways.items():
        if not has_power_tag(normalise_attributes(tags)):
            continue
        feature = Feature(f"way {way}", GeometryKind.LINE, (), {**tags, "id": way}, f"way/{way}")
        if not is_wanted_line(drawing, feature, choice):
            continue
        parts = _split_into_runs(
            references, content, tags.get("name") or tags.get("ref") or f"way {way}", drawing.found
        )
        if not parts:
            raise NetworkError(
                f"way {way}: expected at least two of its nodes in the file, found {len(references)} by "
                "number alone; ask Overpass for '(._;>;); out body;' or 'out geom'"
            )
        places = [[content.positions[node] for node in part] for part in parts]
        add_line(drawing, replace(feature, parts=places))
        used |= dict.fromkeys(reference for part in parts for reference in part)
    for node in used:
        tags, places = content.tags.get(node, {}), [[content.positions[node]]]
        if has_power_tag(normalise_attributes(tags)):
            add_points(drawing, Feature(f"node {node}", GeometryKind.POINT, places, tags, f"node/{node}"))
    if content.deleted:
        drawing.found.append(Remark(RemarkTopic.LEFT_OUT, what, f"{content.deleted} nodes and ways that are deleted"))
    if not drawing.lines and not choice.looked:
        power, why = " or ".join(POWER_LINES), explain_empty_file(drawing.remarks)
        raise NetworkError(f"ways: expected some with power = {power}, found none{why}")
    return drawing


def _check_server_remarks(remarks: Iterable[str], source: str) -> Iterator[Remark]:
    """Yield the remarks of a server on its answer.

    Raises:
        NetworkError: the query failed.
    """
    for remark in remarks:
        if "error" in remark.lower() or "timed out" in remark.lower():
            raise NetworkError(
                f"remark: expected a whole answer, the server gave up: {remark}; ask again with a longer "
                "[timeout:...] or for a smaller area"
            )
        yield Remark(RemarkTopic.WHOLE, source, f"the server remarks: {remark}")


def _split_into_runs(
    references: Iterable[str], content: _Content, name: str, found: list[Remark]
) -> list[tuple[str, ...]]:
    """Return the runs of nodes present in the file: an extract of a map omits some."""
    runs: list[list[str]] = [[]]
    missing = 0
    for reference in references:
        if reference in content.positions:
            runs[-1].append(reference)
        else:
            missing += 1
            runs.append([])
    whole = [tuple(run) for run in runs if len(run) > 1]
    if missing and whole:
        found.append(Remark(RemarkTopic.LEFT_OUT, name, f"{missing} nodes are not in the file: interrupted there"))
    return whole
