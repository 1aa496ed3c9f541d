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
from missions.files import is_figure, to_printable
from missions.readers.attributes import NODE, POWER_LINES, WAY, has_power_tag, normalise_attributes
from missions.readers.features import Feature, GeometryKind, Position, add_line, add_points, is_wanted_line
from missions.readers.raw_network import RawNetwork, ReadOptions, Remark, RemarkTopic, explain_empty_file
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


def parse_osm_xml(root: etree._Element, choice: ReadOptions) -> RawNetwork:
    """Return what an OpenStreetMap file shows.

    Raises:
        NetworkError: one line that names the file, the place in it and what was expected.
    """
    content = _Content()
    for element in root:
        if element.tag == "remark":
            content.remarks.append(to_printable(element.text or ""))
        elif element.get("action") == "delete" or element.get("visible") == "false":
            content.deleted += element.tag in {NODE, WAY}  # of an editor that has not uploaded yet, or of a history
        elif element.tag == "node":
            name = f"node {element.get('id')} (line {element.sourceline})"
            node = _build_node(element.get("lat"), element.get("lon"), _read_tags(element), name)
            content.nodes[str(element.get("id"))] = node
        elif element.tag == "way":
            references = tuple(str(reference.get("ref")) for reference in element.iterchildren("nd"))
            content.ways[str(element.get("id"))] = (references, _read_tags(element))
    return _build_raw_network(content, XML, choice)


def parse_overpass(document: Mapping[str, object], choice: ReadOptions) -> RawNetwork:
    """Return what an answer of Overpass shows: of ``out body`` with the nodes, or of ``out geom``.

    Raises:
        NetworkError: one line that names the file, the place in it and what was expected.
    """
    elements, content = document.get("elements"), _Content()
    if document.get("remark"):
        content.remarks.append(to_printable(str(document["remark"])))
    if not isinstance(elements, list):
        raise NetworkError("elements: expected a list of nodes and ways")
    for index, element in enumerate(elements):
        place = f"elements[{index}]"
        if not isinstance(element, dict) or not isinstance(element.get("tags", {}), dict):
            raise NetworkError(f"{place}: expected an object with type, id and tags")
        tags = {str(key): to_printable(str(value)) for key, value in element.get("tags", {}).items()}
        number_ = str(element.get("id"))
        if element.get("visible") is False or element.get("action") == "delete":
            content.deleted += element.get("type") in {NODE, WAY}
        elif element.get("type") == "node":
            content.nodes[number_] = _build_node(element.get("lat"), element.get("lon"), tags, place)
        elif element.get("type") == "way":
            content.ways[number_] = (_read_references(element, number_, content, place), tags)
    return _build_raw_network(content, JSON, choice)


def _read_references(way: Mapping[str, object], number_: str, content: _Content, place: str) -> tuple[str, ...]:
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
            content.nodes[reference] = _build_node(at.get("lat"), at.get("lon"), {}, f"{place}.geometry[{index}]")
    return found


def _build_node(lat: object, lon: object, tags: Mapping[str, str], place: str) -> _Node:
    lat_deg, lon_deg = degrees_of(lat, NORTH_SOUTH), degrees_of(lon, EAST_WEST)
    if not is_figure(lat_deg) or not is_figure(lon_deg):
        raise NetworkError(f"{place}: expected lat and lon in degrees, got {lat!r} and {lon!r}")
    return _Node(lat_deg, lon_deg, tags)


def _read_tags(element: etree._Element) -> dict[str, str]:
    return {str(tag.get("k")): to_printable(str(tag.get("v"))) for tag in element.iterchildren("tag")}


def _build_raw_network(content: _Content, what: str, choice: ReadOptions) -> RawNetwork:
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
        places = [[_position_of(content, node) for node in part] for part in parts]
        add_line(drawing, replace(feature, parts=places))
        used |= dict.fromkeys(reference for part in parts for reference in part)
    for node in used:
        if has_power_tag(normalise_attributes(content.nodes[node].tags)):
            place = f"node {node}"
            own = Feature(
                place, GeometryKind.POINT, [[_position_of(content, node)]], content.nodes[node].tags, f"node/{node}"
            )
            add_points(drawing, own)
    if content.deleted:
        drawing.found.append(Remark(RemarkTopic.LEFT_OUT, what, f"{content.deleted} nodes and ways that are deleted"))
    if not drawing.lines and not choice.looked:
        power, why = " or ".join(POWER_LINES), explain_empty_file(drawing.remarks)
        raise NetworkError(f"ways: expected some with power = {power}, found none{why}")
    return drawing


def _check_server_remarks(remarks: Iterable[str], source: str) -> Iterator[Remark]:
    """Yield what a server says of its answer.

    Raises:
        NetworkError: it gave up.
    """
    for remark in remarks:
        if "error" in remark.lower() or "timed out" in remark.lower():
            raise NetworkError(
                f"remark: expected a whole answer, the server gave up: {remark}; ask again with a longer "
                "[timeout:...] or for a smaller area"
            )
        yield Remark(RemarkTopic.WHOLE, source, f"the server remarks: {remark}")


def _position_of(content: _Content, node: str) -> Position:
    return content.nodes[node].lon_deg, content.nodes[node].lat_deg, None


def _split_into_runs(
    references: Iterable[str], content: _Content, name: str, found: list[Remark]
) -> list[tuple[str, ...]]:
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
        found.append(Remark(RemarkTopic.LEFT_OUT, name, f"{missing} nodes are not in the file: interrupted there"))
    return whole
