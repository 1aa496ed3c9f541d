"""OpenStreetMap: its XML, and the JSON of Overpass; always WGS 84.

Ways with ``power`` line or minor_line are lines, by ``name`` or ``ref``. Nodes of such ways with ``power`` tower, pole
or the like are poles, by ``ref``, else by their number, as ``n123``. What else has to do with power is left out
(`meaning`), and so is what an editor has deleted.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

from missions.errors import NetworkError
from missions.files import is_figure, printable
from missions.readers.attributes import NODE, WAY, by_plain_name
from missions.readers.choice import Choice
from missions.readers.crs import wgs84
from missions.readers.drawing import Drawing, Matter, Remark, why_nothing
from missions.readers.features import Feature, Kind, Position, add_line, add_points, takes_line
from missions.readers.meaning import POWER_LINES, speaks_of_power
from missions.readers.values import EAST_WEST, NORTH_SOUTH, degrees_of

if TYPE_CHECKING:
    from lxml import etree

XML, JSON = "OpenStreetMap XML", "Overpass JSON"


@dataclass(frozen=True, slots=True)
class _Node:
    lat_deg: float
    lon_deg: float
    tags: Mapping[str, str]


@dataclass(slots=True)
class _Content:
    """Nodes and ways, by their numbers."""

    nodes: dict[str, _Node] = field(default_factory=dict)
    ways: dict[str, tuple[tuple[str, ...], Mapping[str, str]]] = field(default_factory=dict)
    deleted: int = 0
    remarks: list[str] = field(default_factory=list)
    """What the server says of its answer."""


def draw_osm_xml(root: etree._Element, source: str, choice: Choice) -> Drawing:
    """Return what an OpenStreetMap file shows.

    Raises:
        NetworkError: one line that names the file, the place in it and what was expected.
    """
    content = _Content()
    for element in root:
        if element.tag == "remark":
            content.remarks.append(printable(element.text or ""))
        elif element.get("action") == "delete" or element.get("visible") == "false":
            content.deleted += element.tag in {NODE, WAY}  # of an editor that has not uploaded yet, or of a history
        elif element.tag == "node":
            name = f"node {element.get('id')} (line {element.sourceline})"
            node = _node(element.get("lat"), element.get("lon"), _tags(element), f"{source}: {name}")
            content.nodes[str(element.get("id"))] = node
        elif element.tag == "way":
            references = tuple(str(reference.get("ref")) for reference in element.iterchildren("nd"))
            content.ways[str(element.get("id"))] = (references, _tags(element))
    return _drawn(content, source, XML, choice)


def draw_overpass(document: Mapping[str, object], source: str, choice: Choice) -> Drawing:
    """Return what an answer of Overpass shows: of ``out body`` with the nodes, or of ``out geom``.

    Raises:
        NetworkError: one line that names the file, the place in it and what was expected.
    """
    elements, content = document.get("elements"), _Content()
    if document.get("remark"):
        content.remarks.append(printable(str(document["remark"])))
    if not isinstance(elements, list):
        raise NetworkError(f"{source}: elements: expected a list of nodes and ways")
    for index, element in enumerate(elements):
        place = f"{source}: elements[{index}]"
        if not isinstance(element, dict) or not isinstance(element.get("tags", {}), dict):
            raise NetworkError(f"{place}: expected an object with type, id and tags")
        tags = {str(key): printable(str(value)) for key, value in element.get("tags", {}).items()}
        number_ = str(element.get("id"))
        if element.get("visible") is False or element.get("action") == "delete":
            content.deleted += element.get("type") in {NODE, WAY}
        elif element.get("type") == "node":
            content.nodes[number_] = _node(element.get("lat"), element.get("lon"), tags, place)
        elif element.get("type") == "way":
            content.ways[number_] = (_references(element, number_, content, place), tags)
    return _drawn(content, source, JSON, choice)


def _references(way: Mapping[str, object], number_: str, content: _Content, place: str) -> tuple[str, ...]:
    """Return the nodes of a way; those that only its geometry has are added."""
    geometry, references = way.get("geometry"), way.get("nodes")
    if geometry is not None and not isinstance(geometry, list):
        raise NetworkError(f"{place}.geometry: expected a list of places, got {geometry!r}")
    if references is None and geometry is not None:
        references = [f"{number_}/{index}" for index in range(len(geometry))]
    if not isinstance(references, list):
        raise NetworkError(f"{place}.nodes: expected a list of nodes, got {references!r}; ask Overpass for 'out geom'")
    found = tuple(map(str, references))
    for index, (reference, at) in enumerate(zip(found, geometry or (), strict=False)):
        if reference not in content.nodes and at is not None:
            if not isinstance(at, dict):
                raise NetworkError(f"{place}.geometry[{index}]: expected lat and lon, got {at!r}")
            content.nodes[reference] = _node(at.get("lat"), at.get("lon"), {}, f"{place}.geometry[{index}]")
    return found


def _node(lat: object, lon: object, tags: Mapping[str, str], place: str) -> _Node:
    lat_deg, lon_deg = degrees_of(lat, NORTH_SOUTH), degrees_of(lon, EAST_WEST)
    if not is_figure(lat_deg) or not is_figure(lon_deg):
        raise NetworkError(f"{place}: expected lat and lon in degrees, got {lat!r} and {lon!r}")
    return _Node(lat_deg, lon_deg, tags)


def _tags(element: etree._Element) -> dict[str, str]:
    return {str(tag.get("k")): printable(str(tag.get("v"))) for tag in element.iterchildren("tag")}


def _drawn(content: _Content, source: str, what: str, choice: Choice) -> Drawing:
    choice.no_layers(source, what)
    choice.no_crs(source, what)
    drawing = choice.drawing(source, what)
    drawing.found += _of_server(content.remarks, source)
    used = dict[str, None]()
    for way, (references, tags) in content.ways.items():
        if not speaks_of_power(by_plain_name(tags)):
            continue
        feature = Feature(f"way {way}", Kind.LINE, (), {**tags, "id": way}, f"way/{way}")
        if not takes_line(drawing, feature, choice):
            continue
        parts = _parts(references, content, tags.get("name") or tags.get("ref") or f"way {way}", drawing.found)
        if not parts:
            raise NetworkError(
                f"{source}: way {way}: expected at least two of its nodes in the file, found {len(references)} by "
                "number alone; ask Overpass for '(._;>;); out body;' or 'out geom'"
            )
        places = [[_position(content, node) for node in part] for part in parts]
        add_line(drawing, replace(feature, parts=places), wgs84(source))
        used |= dict.fromkeys(reference for part in parts for reference in part)
    for node in used:
        if speaks_of_power(by_plain_name(content.nodes[node].tags)):
            place = f"node {node}"
            own = Feature(place, Kind.POINT, [[_position(content, node)]], content.nodes[node].tags, f"node/{node}")
            add_points(drawing, own, wgs84(source))
    if content.deleted:
        drawing.found.append(Remark(Matter.LEFT_OUT, what, f"{content.deleted} nodes and ways that are deleted"))
    if not drawing.lines and not choice.looked:
        power, why = " or ".join(POWER_LINES), why_nothing(drawing.remarks)
        raise NetworkError(f"{source}: ways: expected some with power = {power}, found none{why}")
    return drawing


def _of_server(remarks: Iterable[str], source: str) -> Iterator[Remark]:
    """Yield what a server says of its answer.

    Raises:
        NetworkError: it gave up.
    """
    for remark in remarks:
        if "error" in remark.lower() or "timed out" in remark.lower():
            raise NetworkError(
                f"{source}: remark: expected a whole answer, the server gave up: {remark}; ask again with a longer "
                "[timeout:...] or for a smaller area"
            )
        yield Remark(Matter.WHOLE, source, f"the server remarks: {remark}")


def _position(content: _Content, node: str) -> Position:
    return content.nodes[node].lon_deg, content.nodes[node].lat_deg, None


def _parts(references: Iterable[str], content: _Content, name: str, found: list[Remark]) -> list[tuple[str, ...]]:
    """Return the runs of nodes that the file has: a cut of a map leaves some out."""
    runs: list[list[str]] = [[]]
    missing = 0
    for reference in references:
        if reference in content.nodes:
            runs[-1].append(reference)
        else:
            missing += 1
            runs.append([])
    whole = [tuple(run) for run in runs if len(run) > 1]
    if missing and whole:
        found.append(Remark(Matter.LEFT_OUT, name, f"{missing} nodes are not in the file: interrupted there"))
    return whole
