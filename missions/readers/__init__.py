"""Read network files: select the reader of a file, and build the network.

A network written as GeoJSON reads back as the same network, whatever its original format.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from missions.errors import NetworkError
from missions.files import decode_text, to_printable
from missions.geo import LocalFrame, distance_m, grid_offsets_to_wgs84_deg
from missions.network import CUT, MAX_DISTANCE_M, Network, Pylon, part_within
from missions.readers import geojson, layer_files, table, xml_files
from missions.readers.archives import (
    Archive,
    decode_table,
    explaining_errors,
    naming_file,
    read_first_bytes,
    read_limited,
)
from missions.readers.network_build import MendingLimits, UnplacedNetwork, build_unplaced_network
from missions.readers.raw_network import (
    Comparison,
    NearFilter,
    Pole,
    RawNetwork,
    ReadOptions,
    Remark,
    RemarkTopic,
    Span,
    explain_empty_file,
)

BESIDE_SHP = (".shx", ".dbf", ".prj", ".cpg", ".sbn", ".sbx", ".qpj")
OTHERS = (".shp", ".kml", ".kmz", ".geojson", ".geojsonl", ".gpkg", ".gpx", ".osm", ".csv", ".xlsx", ".xls", ".zip")
"""Other members of an archive that may contain lines."""
FIRST = (RemarkTopic.WHOLE, RemarkTopic.FILTER)
"""Topics of findings that are listed first."""
SAME_DEPOT_M = 100.0
"""Greatest distance at which a site's depot without a height takes the height of the file's depot."""
GRAPH = "graph file"
"""Format of the public Set TSP solver: libconfig with two strings.

``pylons_position`` holds "x y z;" a line, ``connections_indexes`` the 1-based neighbours of each pylon, "1 3;" a line.
Every segment is normally listed from both of its ends; a pair is used once, from its lower to its higher pylon.
"""
OFFSETS = "depot: expected lat_deg, lon_deg and alt_m, for a graph file holds offsets only"
POSITIONS, NEIGHBOURS = "pylons_position", "connections_indexes"

# name = "..." with libconfig's concatenation of adjacent strings; group 2 holds all of them.
_SETTING = re.compile(r'^[ \t]*([A-Za-z*][-\w*]*)[ \t]*[:=]\s*((?:"(?:[^"\\]|\\.)*"\s*)+)', re.MULTILINE)
_STRING = re.compile(r'"((?:[^"\\]|\\.)*)"')
XML = (".kml", ".gpx", ".osm", ".xml")
"""XML suffixes, for any content: UTF-16 does not begin with a bracket."""
FORMATS = (
    "GeoJSON, KML, KMZ, GPX, OpenStreetMap XML, Overpass JSON, GeoPackage, a shapefile or a zip of them, CSV, XLSX"
)


@dataclass(frozen=True, slots=True)
class Selection:
    """The part of a file to read, and limits for mending it."""

    layers: tuple[str, ...] = ()
    where: tuple[Comparison, ...] = ()
    crs: str | None = None
    """Reference system for files without their own; for a graph file the map grid of its metres."""
    mending: MendingLimits = field(default_factory=MendingLimits)
    encoding: str | None = None
    """Encoding of a text table that is not UTF-8; None to detect it."""


@dataclass(frozen=True, slots=True)
class NetworkImport:
    """A network, and the findings of its import."""

    network: Network
    format: str
    crs: str
    has_depot: bool
    """Whether the depot is known; otherwise the network's is the centre of its poles."""
    lacks: str
    """Missing data on the depot that flights need, in a line; empty if none."""
    lines: Mapping[str, str]
    """Line name of each segment, by the segment's label; empty if there is none."""
    found: tuple[Remark, ...]
    """Findings: what was mended or left out, and what to check."""


def default_network_path() -> Path:
    """Return the path of the project's own network: a fictitious substation in open farmland with five lines."""
    return Path(__file__).resolve().parent.parent / "data" / "default_network.geojson"


def read_network(
    path: Path | str,
    *,
    depot: tuple[float, float, float | None] | None = None,
    crs: str | None = None,
    radius_m: float | None = None,
) -> Network:
    """Read a network file; its content decides the format.

    Args:
        path: The file.
        depot: Latitude and longitude in degrees and height above mean sea level in metres. Files without a depot need
            it; otherwise it overrides the file's own. Without a height, the file's own depot gives it; a file of flat
            ground needs none.
        crs: Reference system for files without their own, e.g. ``EPSG:32633``. The offsets of a graph file are metres
            of that grid, or without it metres east and north of the depot.
        radius_m: Keep only segments with both pylons nearer than this to the depot.

    Raises:
        NetworkError: one line that names the file, the place in it and what was expected.
    """
    return import_network(path, Selection(crs=crs), depot=depot, radius_m=radius_m).network


def import_network(
    path: Path | str,
    wanted: Selection | None = None,
    *,
    depot: tuple[float, float, float | None] | None = None,
    radius_m: float | None = None,
    anywhere: bool = False,
) -> NetworkImport:
    """Read a network file, and report how it was interpreted.

    Args:
        path: The file.
        wanted: The part to read.
        depot: As for `read_network`.
        radius_m: As for `read_network`.
        anywhere: Whether a depot may be missing: then it is the centre of the poles.

    Raises:
        NetworkError: one line that names the file, the place in it and what was expected.
    """
    path, wanted = Path(path), wanted or Selection()
    with naming_file(path):
        frame = _frame_of(depot)
        near = _build_near_filter(frame, radius_m)
        choice = ReadOptions(str(path), wanted.layers, wanted.where, wanted.crs, wanted.encoding, near, frame, anywhere)
        drawing = _read_raw_network(path, choice)
        choice.check_where()
        drawing.found += choice.remarks
        return _place_network(drawing, wanted.mending, depot, radius_m, anywhere=anywhere)


def _build_near_filter(frame: LocalFrame | None, radius_m: float | None) -> NearFilter | None:
    """Return a filter of what may be within a radius: all that may be in the network, so that names do not change."""
    return None if frame is None or radius_m is None or radius_m > MAX_DISTANCE_M else NearFilter(frame, MAX_DISTANCE_M)


def _parse_graph(text: str, choice: ReadOptions) -> RawNetwork:
    """Return the content of a graph file, which holds only offsets from a depot.

    z is the ground's height over the depot. In this format, a file whose z are all 0 is one of flat ground.

    Raises:
        NetworkError: one line that names the file, the place in it and what was expected.
    """
    choice.refuse_layers(f"a {GRAPH}")
    if choice.where:
        raise NetworkError(f"where: expected none for a {GRAPH}, whose lines have no attributes")
    drawing, frame = choice.create_raw_network(GRAPH, choice.crs or "metres about the depot"), choice.depot
    if frame is not None:  # heights refer to it, whether or not its height above sea level is known
        drawing.depot = Pole(GRAPH, "", frame.lat_deg, frame.lon_deg, frame.alt_m)
    elif not choice.anywhere or choice.crs is not None:
        raise NetworkError(OFFSETS)
    else:
        words = "offsets without a depot: shown about 0, 0, which is in the sea; a depot places them"
        drawing.found.append(Remark(RemarkTopic.FILE, GRAPH, words))
        frame = LocalFrame(0.0, 0.0)
    settings = {name: "".join(_STRING.findall(value)) for name, value in _SETTING.findall(text)}
    for key in (POSITIONS, NEIGHBOURS):
        if key not in settings:
            raise NetworkError(f"{key}: expected a string in quotes, found none")
    offsets_m = _parse_positions_m(settings[POSITIONS])
    drawing.spans = _parse_spans(settings[NEIGHBOURS], len(offsets_m))
    with explaining_errors("crs", ValueError):
        if choice.crs is None:
            lat_lon_deg = frame.many_to_wgs84_deg(offsets_m[:, :2])
        else:
            lat_lon_deg = grid_offsets_to_wgs84_deg(frame, offsets_m[:, :2], choice.crs)
    drawing.flat = not np.any(offsets_m[:, 2])
    places = np.column_stack((lat_lon_deg, offsets_m[:, 2]))
    for number, (lat_deg, lon_deg, up_m) in enumerate(places.tolist(), start=1):
        ground_m = None if drawing.flat else frame.alt_m + up_m
        drawing.poles.append(Pole(f"{POSITIONS}, row {number}", str(number), lat_deg, lon_deg, ground_m))
    return drawing


def _split_rows(value: str) -> list[list[str]]:
    rows = value.split(";")
    # The text after the last semicolon is not a row.
    return [row.split() for row in (rows[:-1] if not rows[-1].strip() else rows)]


def _parse_positions_m(value: str) -> np.ndarray[tuple[int, int], np.dtype[np.float64]]:
    positions: list[tuple[float, float, float]] = []
    for number, row in enumerate(_split_rows(value), start=1):
        place = f"{POSITIONS}, row {number}"
        try:
            east, north, up = (float(word) for word in row)
        except ValueError as error:
            raise NetworkError(f"{place}: expected three numbers 'x y z', got {' '.join(row)!r}") from error
        if not np.all(np.isfinite((east, north, up))):
            raise NetworkError(f"{place}: expected finite numbers, got {' '.join(row)!r}")
        positions.append((east, north, up))
    if not positions:
        raise NetworkError(f"{POSITIONS}: expected at least two rows 'x y z;', found none")
    return np.array(positions, dtype=np.float64)


def _parse_spans(value: str, pylons: int) -> list[Span]:
    rows = _split_rows(value)
    if len(rows) != pylons:
        raise NetworkError(f"{NEIGHBOURS}: expected {pylons} rows, one a pylon, found {len(rows)}")
    pairs: set[tuple[int, int]] = set()
    for number, row in enumerate(rows, start=1):
        place = f"{NEIGHBOURS}, row {number}"
        for word in row:
            if not word.isdecimal() or not 1 <= int(word) <= pylons:
                raise NetworkError(f"{place}: expected pylon numbers from 1 to {pylons}, got {word!r}")
            if int(word) == number:
                raise NetworkError(f"{place}: expected other pylons' numbers, got its own")
            pairs.add((min(number, int(word)), max(number, int(word))))
    return [Span(NEIGHBOURS, f"{a}-{b}", str(a), str(b)) for a, b in sorted(pairs)]


def read_station_points(path: Path | str) -> dict[str, tuple[float, float, float | None]]:
    """Return the points of a file by name: possible vehicle positions, with the ground height where known.

    Raises:
        NetworkError: it cannot be read.
    """
    with naming_file(Path(path)):
        drawing = _read_raw_network(Path(path), ReadOptions(str(path)))
    depot = drawing.depot
    found = {} if depot is None else {"depot": (depot.lat_deg, depot.lon_deg, depot.elevation_m)}
    return found | {
        pole.name or pole.place: (pole.lat_deg, pole.lon_deg, pole.elevation_m)
        for pole in (*drawing.others, *drawing.poles)
    }


def _read_raw_network(path: Path, choice: ReadOptions) -> RawNetwork:
    drawing = _read_by_content(path, choice)
    if choice.encoding is not None and drawing.format not in {table.CSV, layer_files.SHAPEFILE}:
        kind = drawing.format
        raise NetworkError(f"encoding: expected none for {kind}, only for CSV and shapefiles; got {choice.encoding!r}")
    return drawing


def _read_by_content(path: Path, choice: ReadOptions) -> RawNetwork:
    if path.suffix.lower() in BESIDE_SHP:
        raise NetworkError("file: expected the .shp, of which this is a part")
    if read_first_bytes(path) == layer_files.SQLITE_MAGIC:
        return layer_files.read_geopackage(path, choice)
    content = read_limited(path)
    if content.startswith(layer_files.SHAPEFILE_MAGIC):
        return layer_files.read_shapefile(path, choice)
    if content.startswith(b"PK"):
        return _read_archive(content, choice)
    if path.suffix.lower() in XML or content.lstrip(b"\xef\xbb\xbf \t\r\n").startswith(b"<"):
        return _read_xml(content, choice)
    text, remark = decode_table(content, choice.encoding)
    if text.lstrip().startswith("{"):
        return _read_json((decode_text(content, choice.source, NetworkError) if remark else text).lstrip(), choice)
    if "pylons_position" in text:
        return _parse_graph(decode_text(content, choice.source, NetworkError), choice)
    if table.is_pole_table(text) or path.suffix.lower() == ".csv":
        return table.parse_csv(text, choice, remark=remark)
    raise NetworkError(
        f"content: expected GeoJSON, or a graph file with pylons_position, or one of {FORMATS}; found none"
    )


def _read_archive(content: bytes, choice: ReadOptions) -> RawNetwork:
    archive = Archive(content)
    if "xl/workbook.xml" in archive.names:
        return table.parse_xlsx(archive, content, choice)
    if archive.list_by_suffix(".shp"):
        drawing, read = layer_files.read_zipped_shapes(archive, choice), ".shp"
    elif archive.list_by_suffix(".kml"):
        drawing, read = xml_files.parse_kmz(archive, choice), ".kml"
    else:
        others = ", ".join(map(repr, _list_other_files(archive, "")))
        raise NetworkError(
            "content: expected a KMZ, shapefiles or a workbook in the archive, found none"
            + (f" but {others}: unpack it" if others else "")
        )
    others = ", ".join(map(repr, _list_other_files(archive, read)))
    if others:
        drawing.found.append(Remark(RemarkTopic.WHOLE, choice.source, f"also in the archive, and not read: {others}"))
    return drawing


def _list_other_files(archive: Archive, read: str) -> Iterator[str]:
    """Yield the names of other members of an archive that may contain lines."""
    return (
        to_printable(name)
        for name in archive.names
        if name.lower().endswith(OTHERS) and not name.lower().endswith(read or "/")
    )


def _read_xml(content: bytes, choice: ReadOptions) -> RawNetwork:
    root = xml_files.root_of(content)
    tag = xml_files.tag_of(root)
    if tag in {"kml", *xml_files.KML_ROOTS}:
        return xml_files.parse_kml([root], choice)
    reader = {"gpx": xml_files.parse_gpx, "osm": xml_files.parse_osm_xml}.get(tag)
    if reader is None:
        says = to_printable(" ".join(str(text) for text in root.itertext()))[:200]
        words = f": a server's error: {says}" if re.search("exception|error", tag, re.IGNORECASE) else ""
        raise NetworkError(f"content: expected XML that is kml, gpx or osm, got {tag!r}{words}")
    return reader(root, choice)


def _read_json(text: str, choice: ReadOptions) -> RawNetwork:
    document = geojson.parse_features(text, choice.source)
    if "elements" in document and "features" not in document:
        return xml_files.parse_overpass(document, choice)
    return geojson.parse_geojson(document, choice)


def _place_network(
    drawing: RawNetwork,
    mending: MendingLimits,
    given: tuple[float, float, float | None] | None,
    radius_m: float | None,
    *,
    anywhere: bool,
) -> NetworkImport:
    """Return a network about its depot: the caller's, else the file's, else if allowed its centre."""
    frame, alt_known = _frame_of(given), given is not None and given[2] is not None
    if frame is None or not alt_known:
        frame, alt_known = _find_depot(drawing, frame)
    if frame is None and radius_m is not None:
        raise NetworkError("radius_m: expected a depot with it, the network's file has none")
    drawing.near = _build_near_filter(frame, radius_m)
    drawing.keep_near()
    if drawing.far is not None and not (drawing.lines or drawing.spans):
        raise _build_nothing_near_error(drawing, frame, radius_m)
    built = build_unplaced_network(drawing, mending)
    if not built.segments:
        poles = f": {len(drawing.poles)} points and no line" if drawing.poles else ""
        raise NetworkError(f"segments: expected at least one, found none{poles}{explain_empty_file(drawing.remarks)}")
    if frame is not None and radius_m is not None:
        # A country's network would be refused as too large; findings, too, count only if they concern the part.
        pylons, segments = part_within(built.pylons, built.segments, frame, radius_m)
        lines = {segment.label: built.lines.get(segment.label, "") for segment in segments}
        known = {pylon.id for pylon in built.pylons} | set(built.lines) | set(built.lines.values())
        gone = known - {pylon.id for pylon in pylons} - set(lines) - set(lines.values())
        built = UnplacedNetwork(
            pylons, segments, lines, tuple(one for one in built.found if (one.about or one.asset) not in gone)
        )
        if not built.segments:
            raise _build_nothing_near_error(drawing, frame, radius_m)
    has_depot, lacks = frame is not None, ""
    if frame is None:
        wanted = "depot: expected where the vehicles stand: [depot] in the site file, or a point with role = depot"
        lacks = OFFSETS if drawing.format == GRAPH else wanted
    elif not alt_known and any(pylon.elevation_m is not None for pylon in built.pylons):
        lacks = (
            "depot: expected its height above sea level, because the pylons have elevation_m: alt_m "
            "of the site's [depot], or elevation_m of the file's"
        )
    if lacks and not anywhere:
        raise NetworkError(lacks)
    frame = frame or _find_middle(built)
    network = Network(built.pylons, built.segments, frame, drawing.source, drawing.flat)
    found = sorted(built.found, key=lambda one: one.matter not in FIRST)
    return NetworkImport(network, drawing.format, drawing.crs, has_depot, lacks, built.lines, tuple(found))


def _build_nothing_near_error(drawing: RawNetwork, frame: LocalFrame | None, radius_m: float | None) -> NetworkError:
    hint = ""
    if frame is not None and drawing.far is not None and abs(drawing.far[1]) <= 90.0:
        swapped = distance_m(frame.lat_deg, frame.lon_deg, drawing.far[1], drawing.far[0]) <= MAX_DISTANCE_M
        hint = "; latitude and longitude look swapped (GeoJSON has longitude first)" if swapped else ""
    return NetworkError(f"radius_m: no segment lies within {radius_m:g} m of the depot{hint}")


def _find_depot(drawing: RawNetwork, known: LocalFrame | None) -> tuple[LocalFrame | None, bool]:
    """Return the file's depot, or a known one with the height of the file's depot if that is near.

    The flag tells whether its height is known.
    """
    depot = drawing.depot
    if depot is None:
        return known, False
    if known is not None:
        near = distance_m(known.lat_deg, known.lon_deg, depot.lat_deg, depot.lon_deg) <= SAME_DEPOT_M
        if near and depot.elevation_m is not None:
            return LocalFrame(known.lat_deg, known.lon_deg, depot.elevation_m), True
        return known, False
    with explaining_errors(f"{depot.place}: depot", ValueError):
        return LocalFrame(depot.lat_deg, depot.lon_deg, depot.elevation_m or 0.0), depot.elevation_m is not None


def _find_middle(built: UnplacedNetwork) -> LocalFrame:
    """Return the centre of the poles, for viewing only."""
    first = built.pylons[0]
    about = LocalFrame(first.lat_deg, first.lon_deg)
    places_m = [about.to_local_m(pylon.lat_deg, pylon.lon_deg) for pylon in built.pylons]
    for pylon, place_m in zip(built.pylons, places_m, strict=True):
        if not math.hypot(*place_m) <= MAX_DISTANCE_M:
            raise NetworkError(
                f"pylon {pylon.id!r}: position: expected within {MAX_DISTANCE_M / 1000:g} km of pylon "
                f"{first.id!r}, got {pylon.lat_deg:.6f}, {pylon.lon_deg:.6f}; are latitude and longitude swapped, or "
                f"is it another crs?{CUT}"
            )
    east_m, north_m = ([place_m[axis] for place_m in places_m] for axis in (0, 1))
    middle = about.to_wgs84_deg((min(east_m) + max(east_m)) / 2, (min(north_m) + max(north_m)) / 2)
    return LocalFrame(*middle)


def _frame_of(depot: tuple[float, float, float | None] | None) -> LocalFrame | None:
    if depot is None:
        return None
    with explaining_errors("depot", ValueError):
        return LocalFrame(depot[0], depot[1], depot[2] or 0.0)


def build_network_document(
    understood: NetworkImport, said: Mapping[int, Mapping[str, object]] | None = None
) -> dict[str, object]:
    """Return a FeatureCollection of the depot, if there is one, all pylons and all segments.

    A segment is a LineString with the ids of its pylons, so that it stays one segment whatever it passes.

    Args:
        understood: The network.
        said: Further properties of segments, by number.
    """
    features = list(_build_features(understood, said or {}))
    document: dict[str, object] = {"type": "FeatureCollection", "features": features}
    # The site may assert it as well; but what the file's format implies would be lost.
    return {**document, geojson.FLAT: True} if understood.network.flat else document


def _build_features(understood: NetworkImport, said: Mapping[int, Mapping[str, object]]) -> Iterator[dict[str, object]]:
    network = understood.network
    if understood.has_depot:
        lat_deg, lon_deg, alt_m = network.depot
        known = alt_m or any(pylon.elevation_m is not None for pylon in network.pylons)
        heights = {"elevation_m": alt_m} if known else {}
        yield _build_feature("Point", [lon_deg, lat_deg], {"role": "depot", **heights})
    for pylon in network.pylons:
        figures = {"elevation_m": pylon.elevation_m, "height_m": pylon.height_m}
        heights = {key: value for key, value in figures.items() if value is not None}
        yield _build_feature("Point", _to_coordinates(pylon), {"id": pylon.id, **heights})
    for segment in network.segments:
        a, b = network.pylons[segment.a], network.pylons[segment.b]
        line = understood.lines.get(segment.label, "")
        named: dict[str, object] = {"name": segment.label, "a": a.id, "b": b.id, **({"line": line} if line else {})}
        named |= said.get(segment.id, {})
        yield _build_feature("LineString", [_to_coordinates(a), _to_coordinates(b)], named)


def _to_coordinates(pylon: Pylon) -> list[float]:
    return [pylon.lon_deg, pylon.lat_deg, *([] if pylon.third_m is None else [pylon.third_m])]


def _build_feature(kind: str, coordinates: object, properties: Mapping[str, object]) -> dict[str, object]:
    return {"type": "Feature", "geometry": {"type": kind, "coordinates": coordinates}, "properties": properties}
