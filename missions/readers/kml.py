"""KML and KMZ: Placemarks with Point, LineString or MultiGeometry, in folders; always WGS 84.

A Point is a pole and a LineString a line, by the Placemark's name. ``elevation_m`` and ``height_m`` are taken from
ExtendedData. An altitude is one of ground, wire or top, nobody knows: one that is ``absolute`` (above mean sea level)
is kept with its pole and never flown by; one that is relative to the ground, or clamped to it, is not used, and said.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Collection, Iterable, Iterator, Sequence
from posixpath import normpath
from typing import TYPE_CHECKING
from urllib.parse import unquote

from missions.errors import NetworkError
from missions.files import is_figure, to_printable
from missions.readers.archives import Archive
from missions.readers.features import EMPTY, Feature, GeometryKind, Position, add_features
from missions.readers.raw_network import RawNetwork, Remark, RemarkTopic
from missions.readers.read_options import ReadOptions, quote_names
from missions.readers.values import parse_figure
from missions.readers.xml_tree import iterate_children, line_of, read_child_text, root_of, tag_of

if TYPE_CHECKING:
    from lxml import etree

FORMAT = "KML"
GEOMETRIES = ("Point", "LineString", "MultiGeometry", "Polygon", "LinearRing", "Track", "MultiTrack", "Model")
ROOTS = ("kml", "Document", "Folder", "Placemark")
"""Elements that a file may begin with; programs leave out the outermost."""
OVERLAYS = ("GroundOverlay", "PhotoOverlay", "Tour")
CLAMPED = "clampToGround"
MODES = {
    "absolute": "above sea level (absolute): kept, and not flown by",
    "relativeToGround": "above the ground (relativeToGround), of wire or top is not said: not used",
    CLAMPED: "on the ground (clampToGround): not used",
}
"""What is said of each altitudeMode."""


def extract_kml(archive: Archive) -> tuple[bytes, ...]:
    """Return the documents of a KMZ: doc.kml, which programs show, and then all others.

    Raises:
        NetworkError: it cannot be read.
    """
    names = archive.list_by_suffix(".kml")
    every = sorted(names, key=lambda name: (name.lower() != "doc.kml", name.count("/"), names.index(name)))
    return tuple(archive.read(name) for name in every)


def links_of(roots: Iterable[etree._Element], inside: Collection[str] = ()) -> Iterator[etree._Element]:
    """Yield the links to other files, but for those to files of the same archive, which are read anyway."""
    for root in roots:
        for link in root.iter("{*}NetworkLink"):
            hrefs = [unquote((href.text or "").strip()) for href in link.iter("{*}href")]
            if not any(normpath(href) in inside for href in hrefs):
                yield link


def parse_kmz(archive: Archive, source: str, choice: ReadOptions) -> RawNetwork:
    """Return what all documents of an archive show.

    Raises:
        NetworkError: as `parse_kml`.
    """
    names, documents = archive.list_by_suffix(".kml"), extract_kml(archive)
    drawing = parse_kml([root_of(content, source) for content in documents], source, choice, inside=names)
    if len(names) > 1:
        text = f"{len(names)} KML files in the archive, all of them are read: {quote_names(names)}"
        drawing.found.insert(0, Remark(RemarkTopic.WHOLE, source, text))
    return drawing


def parse_kml(
    roots: Sequence[etree._Element], source: str, choice: ReadOptions, *, inside: Collection[str] = ()
) -> RawNetwork:
    """Return what KML documents show.

    Args:
        roots: Of the documents.
        source: The file's name, for messages.
        choice: What of it is wanted.
        inside: The names of the archive's documents.

    Raises:
        NetworkError: one line that names the file, the place in it and what was expected.
    """
    choice.refuse_crs(source, FORMAT)
    drawing, modes = choice.create_raw_network(source, FORMAT), Counter[str]()
    marks = list(placemarks_of(roots, ""))
    wanted = choice.select_layers(source, list(dict.fromkeys(folder for _, folder in marks)), "folder")
    for mark, folder in marks:
        if folder in wanted:
            add_features(drawing, _read_placemark(source, mark, folder, modes), choice)
    for link in links_of(roots, inside):
        text = "a link to another file: not followed"
        drawing.found.append(Remark(RemarkTopic.WHOLE, read_child_text(link, "name") or line_of(link), text))
    for root in roots:
        for overlay in root.iter(*(f"{{*}}{tag}" for tag in OVERLAYS)):
            drawing.leave_out(tag_of(overlay), read_child_text(overlay, "name") or line_of(overlay))
    for mode, count in modes.items():
        what = "position has an altitude" if count == 1 else "positions have an altitude"
        drawing.found.append(
            Remark(RemarkTopic.HEIGHTS, FORMAT, f"{count} {what} {MODES.get(mode, f'{mode}: not used')}")
        )
    return drawing


def placemarks_of(elements: Iterable[etree._Element], folder: str) -> Iterator[tuple[etree._Element, str]]:
    """Yield every Placemark with its folder's name; the document's own name is none."""
    for child in elements:
        tag = tag_of(child)
        if tag == "Placemark":
            yield child, folder
        elif tag in ROOTS:
            yield from placemarks_of(child, read_child_text(child, "name") if tag == "Folder" else folder)


def _read_placemark(source: str, mark: etree._Element, folder: str, modes: Counter[str]) -> Iterator[Feature]:
    """Yield what a Placemark has: its points, its lines, and what is neither."""
    name = read_child_text(mark, "name")
    place = f"Placemark {name!r} ({line_of(mark)})" if name else f"Placemark in {line_of(mark)}"
    attributes = {**attributes_of(mark), "folder": folder, **({"name": name} if name else {})}
    parts: dict[str, list[list[Position]]] = {"Point": [], "LineString": []}
    geometries = list(geometries_of(mark))
    for geometry in geometries:
        tag = tag_of(geometry)
        if tag in parts:
            parts[tag].append(positions_of(geometry, f"{source}: {place}", modes))
        else:
            yield Feature(place, GeometryKind.OTHER, (), attributes, name=name, other=tag)
    if not geometries:
        yield Feature(place, GeometryKind.OTHER, (), attributes, name=name, other=EMPTY)
    for tag, kind in (("Point", GeometryKind.POINT), ("LineString", GeometryKind.LINE)):
        if parts[tag]:
            yield Feature(place, kind, parts[tag], attributes)


def geometries_of(element: etree._Element) -> Iterator[etree._Element]:
    """Yield the geometries of a Placemark, one by one."""
    for child in iterate_children(element, *GEOMETRIES):
        if tag_of(child) == "MultiGeometry":
            yield from geometries_of(child)
        else:
            yield child


def attributes_of(mark: etree._Element) -> dict[str, object]:
    """Return what a Placemark's ExtendedData says."""
    found: dict[str, object] = {}
    for data in iterate_children(mark, "ExtendedData"):
        for element in data.iter("{*}Data", "{*}SimpleData"):
            text = read_child_text(element, "value") if tag_of(element) == "Data" else to_printable(element.text or "")
            found[to_printable(element.get("name") or "")] = text
    return found


def positions_of(geometry: etree._Element, place: str, modes: Counter[str]) -> list[Position]:
    """Return the positions of a geometry, and count the modes of those with an altitude.

    Raises:
        NetworkError: there is none, or one is no place.
    """
    mode = read_child_text(geometry, "altitudeMode") or CLAMPED
    coordinates = next(iterate_children(geometry, "coordinates"), None)
    words = ((coordinates.text or "") if coordinates is not None else "").split()
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
