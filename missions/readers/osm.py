"""OpenStreetMap: its XML, and the JSON of Overpass; always WGS 84.

Ways with ``power`` line or minor_line are lines, by ``name`` or ``ref``; cables, and the bays and busbars of
substations, are left out. Nodes of such ways with ``power`` tower, pole or any other are poles, by ``ref``, else by
their number, as ``n123``. ``ele`` and ``height`` are used where all poles of all lines have them.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

from missions.errors import NetworkError
from missions.files import is_figure, printable
from missions.readers.attributes import figure_of
from missions.readers.choice import Choice
from missions.readers.drawing import Drawing, Line, Matter, Pole, Remark, Vertex, why_nothing

if TYPE_CHECKING:
    from lxml import etree

LINES = ("line", "minor_line")
INDOORS = ("bay", "busbar")
XML, JSON = "OpenStreetMap XML", "Overpass JSON"
FOOT_M = 0.3048
_METRES = re.compile(r"([0-9.]+) ?(m|ft|')?")


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
        if element.get("action") == "delete" or element.get("visible") == "false":
            continue  # of an editor that has not uploaded yet, or of a history
        if element.tag == "node":
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
        if element.get("type") == "node":
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
    figures = [figure_of(value) if isinstance(value, str) else value for value in (lat, lon)]
    lat_deg, lon_deg = figures
    if not is_figure(lat_deg) or not is_figure(lon_deg):
        raise NetworkError(f"{place}: expected lat and lon in degrees, got {lat!r} and {lon!r}")
    return _Node(float(lat_deg), float(lon_deg), tags)


def _tags(element: etree._Element) -> dict[str, str]:
    return {str(tag.get("k")): printable(str(tag.get("v"))) for tag in element.iterchildren("tag")}


def _drawn(content: _Content, source: str, what: str, choice: Choice) -> Drawing:
    choice.no_layers(source, what)
    choice.no_crs(source, what)
    drawing = choice.drawing(source, what)
    for remark in content.remarks:
        if "error" in remark.lower() or "timed out" in remark.lower():
            raise NetworkError(
                f"{source}: remark: expected a whole answer, the server gave up: {remark}; ask again with a longer "
                "[timeout:...] or for a smaller area"
            )
        drawing.found.append(Remark(Matter.WHOLE, source, f"the server remarks: {remark}"))
    used: dict[str, None] = {}
    for way, (references, tags) in content.ways.items():
        name, power = tags.get("name") or tags.get("ref") or f"way {way}", tags.get("power")
        if power == "cable" or (power in LINES and tags.get("line") in INDOORS):
            kind = "a cable" if power == "cable" else f"a {tags['line']} of a substation"
            drawing.found.append(Remark(Matter.LEFT_OUT, name, f"{kind}: left out"))
        if power not in LINES or tags.get("line") in INDOORS or not choice.takes({**tags, "id": way}):
            continue
        parts = _parts(references, content, name, drawing.found)
        if not parts:
            raise NetworkError(
                f"{source}: way {way}: expected at least two of its nodes in the file, found {len(references)} by "
                "number alone; ask Overpass for '(._;>;); out body;' or 'out geom'"
            )
        drawing.draw(Line(f"way {way}", name, tuple(tuple(_vertex(content, node) for node in part) for part in parts)))
        used |= dict.fromkeys(reference for part in parts for reference in part)
    _add_poles(drawing, content, used)
    if not drawing.lines and not choice.looked:
        raise NetworkError(
            f"{source}: ways: expected some with power = line or minor_line, found none{why_nothing(drawing.found)}"
        )
    return drawing


def _vertex(content: _Content, node: str) -> Vertex:
    return content.nodes[node].lat_deg, content.nodes[node].lon_deg, None


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


def _add_poles(drawing: Drawing, content: _Content, used: Iterable[str]) -> None:
    poles = [
        Pole(f"node {node}", content.nodes[node].tags.get("ref") or f"n{node}", content.nodes[node].lat_deg,
             content.nodes[node].lon_deg, _metres(content.nodes[node].tags.get("ele")),
             _metres(content.nodes[node].tags.get("height")))
        for node in used
        if "power" in content.nodes[node].tags
    ]  # fmt: skip
    for key, of in (("elevation_m", "ele"), ("height_m", "height")):
        known = sum(getattr(pole, key) is not None for pole in poles)
        if 0 < known < len(poles):
            text = f"{of} is known of {known} of {len(poles)} poles: not used"
            drawing.found.append(Remark(Matter.HEIGHTS, drawing.format, text))
            poles = [replace(pole, elevation_m=None) if of == "ele" else replace(pole, height_m=None) for pole in poles]
    drawing.poles += poles


def _metres(text: str | None) -> float | None:
    """Return a length as OpenStreetMap writes it: in metres unless it says otherwise."""
    match = _METRES.fullmatch(text or "")
    figure = figure_of(match[1]) if match else None
    if match is None or figure is None:
        return None
    return figure * FOOT_M if match[2] in {"ft", "'"} else figure
