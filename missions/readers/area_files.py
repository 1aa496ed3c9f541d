"""Read areas from GeoJSON, KML and KMZ files: polygons, and lines that others fly along.

Features that a network's reader leaves out with a remark are refused here: an area that is not understood could be
flown through.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

from missions.errors import AreaError
from missions.files import decode_text
from missions.readers import geojson, xml_files
from missions.readers.archives import Archive, naming_file, read_first_bytes, read_limited
from missions.readers.attributes import name_of, read_metres
from missions.readers.features import EMPTY, Feature
from missions.readers.raw_network import MOST_VERTICES, Comparison, ReadOptions
from missions.readers.xml_files import read_child_text, root_of, tag_of

if TYPE_CHECKING:
    from lxml import etree

FORMATS = "GeoJSON, KML or KMZ"
NAMES = ("name", "ref", "id", "label", "title")
FIGURES = ("margin_m", "width_m", "max_agl_m", "max_amsl_m")
"""Properties of a feature, named like the site file's keys."""

LatLon = tuple[float, float]


@dataclass(frozen=True, slots=True)
class FileArea:
    """An area as in its file."""

    place: str
    """File and feature, for messages."""
    name: str
    """Empty if the file has none."""
    rings_deg: tuple[tuple[LatLon, ...], ...]
    """Latitude and longitude of the outline, not closed, followed by those of holes; or of a line."""
    is_line: bool
    figures: Mapping[str, float]
    """Values of `FIGURES` that the feature has."""


def read_areas(path: Path, *, layers: Sequence[str] = (), where: Sequence[Comparison] = ()) -> tuple[FileArea, ...]:
    """Return the areas of a file; each part of a multi-part area separately.

    Args:
        path: The file.
        layers: KML folders to read; all if none is given.
        where: Only features that fulfil this.

    Raises:
        AreaError: one line that names the file, the feature and what was expected.
    """
    choice = ReadOptions(str(path), tuple(layers), tuple(where))
    with naming_file(path, AreaError):
        found = tuple(replace(area, place=f"{path}: {area.place}") for area in _read(path, choice))
        choice.check_where()
        for attribute, value in choice.uncompared:
            raise AreaError(f"where: expected numbers of {attribute!r} to compare, got {value!r}")
        if not found:
            raise AreaError("areas: expected at least one polygon or line, found none")
        if sum(len(ring) for area in found for ring in area.rings_deg) > MOST_VERTICES:
            raise AreaError(f"areas: expected at most {MOST_VERTICES} positions; where, layer, or a cut choose")
    return found


def check_outline(rings_deg: Iterable[Sequence[LatLon]], place: str, *, is_line: bool) -> None:
    """Refuse an invalid outline or line.

    Raises:
        AreaError: one line that names the place and what was expected.
    """
    for ring in rings_deg:
        for lat_deg, lon_deg in ring:
            if not (abs(lat_deg) <= 90 and abs(lon_deg) <= 180):
                raise AreaError(
                    f"{place}: expected latitudes up to 90 and longitudes up to 180, got {lat_deg:g}, {lon_deg:g}; are "
                    "they swapped?"
                )
        least = 2 if is_line else 3
        if len(set(ring)) < least:
            what = "a line of at least 2 places" if is_line else "an outline of at least 3 corners"
            raise AreaError(f"{place}: expected {what}, got {len(set(ring))}")


def _read(path: Path, choice: ReadOptions) -> Iterator[FileArea]:
    read_first_bytes(path)  # raises if the file cannot be read
    content = read_limited(path)
    if content.startswith(b"PK"):
        archive = Archive(content)
        if not archive.list_by_suffix(".kml"):
            raise AreaError(f"content: expected {FORMATS}, found an archive without a .kml")
        yield from _read_kml(xml_files.extract_kml(archive), choice, archive.list_by_suffix(".kml"))
        return
    if content.lstrip(b"\xef\xbb\xbf \t\r\n").startswith(b"<") or path.suffix.lower() in {".kml", ".kmz"}:
        yield from _read_kml([root_of(content)], choice)
        return
    text = decode_text(content, choice.source, AreaError).lstrip()
    if not text.startswith("{"):
        raise AreaError(f"content: expected {FORMATS}, found none")
    yield from _read_geojson(geojson.parse_features(text, choice.source), choice)


def _read_geojson(document: Mapping[str, object], choice: ReadOptions) -> Iterator[FileArea]:
    choice.refuse_layers(geojson.FORMAT)
    geojson.check_whole(document)
    system = geojson.system_of(document)
    for feature in geojson.features_of(document):
        if not choice.is_wanted(feature.attributes):
            continue
        name = name_of(feature.attributes, NAMES) or name_of({"id": feature.id})
        place = feature.place + (f" {name!r}" if name else "")
        at, kind = f"{place}: coordinates", feature.other
        if kind.removeprefix("Multi") not in {"Polygon", "LineString"}:
            got = "none" if kind == EMPTY else kind
            raise AreaError(f"{place}: geometry: expected a Polygon or a LineString, got {got}")
        is_line, figures = kind.endswith("LineString"), _read_figures(feature.attributes, place)
        for part in _expect_list(feature.coordinates, at) if kind.startswith("Multi") else [feature.coordinates]:
            rings = [part] if is_line else _expect_list(part, at)
            yield _build_area(
                place, name, [geojson.places_of(ring, at, system) for ring in rings], figures, is_line=is_line
            )


def _read_kml(roots: Sequence[etree._Element], choice: ReadOptions, inside: Sequence[str] = ()) -> Iterator[FileArea]:
    for root in roots:
        if tag_of(root) not in {"kml", *xml_files.KML_ROOTS}:
            raise AreaError(f"content: expected {FORMATS}, got XML with {tag_of(root)!r}")
    for link in xml_files.links_of(roots, inside):
        raise AreaError(f"NetworkLink {read_child_text(link, 'name')!r}: expected the areas themselves, got a link")
    for mark, said in xml_files.iterate_placemarks(roots, choice):
        if choice.is_wanted(said.attributes):
            yield from _read_placemark(mark, said)


def _read_placemark(mark: etree._Element, said: Feature) -> Iterator[FileArea]:
    place, figures = said.place, _read_figures(said.attributes, said.place)
    for geometry in list(xml_files.geometries_of(mark)) or [mark]:
        tag, lines = tag_of(geometry), [geometry]
        if tag == "Polygon":
            keys = "{*}outerBoundaryIs", "{*}innerBoundaryIs"
            sides = [side for key in keys for side in geometry.iterchildren(key)]
            lines = [ring for side in sides for ring in side.iterchildren("{*}LinearRing")]
            if not lines or tag_of(sides[0]) != "outerBoundaryIs":
                raise AreaError(f"{place}: outerBoundaryIs: expected a LinearRing, found none")
        elif tag not in {"LinearRing", "LineString"}:
            got = "none" if geometry is mark else tag
            raise AreaError(f"{place}: geometry: expected a Polygon or a LineString, got {got}")
        rings = [[(lat_deg, lon_deg) for lon_deg, lat_deg, _ in xml_files.positions_of(line, place, Counter())]
                 for line in lines]  # fmt: skip
        yield _build_area(place, said.name, rings, figures, is_line=tag == "LineString")


def _build_area(
    place: str, name: str, rings: Sequence[Sequence[LatLon]], figures: Mapping[str, float], *, is_line: bool
) -> FileArea:
    for ring in () if is_line else rings:
        if len(ring) < 4 or ring[0] != ring[-1]:
            raise AreaError(
                f"{place}: expected an outline of at least 3 corners that ends where it begins, "
                f"got {len(ring)} positions"
            )
    known = tuple(tuple(ring if is_line else ring[:-1]) for ring in rings)
    check_outline(known, place, is_line=is_line)
    return FileArea(place, name, known, is_line, figures)


def _read_figures(attributes: Mapping[str, object], place: str) -> dict[str, float]:
    found = {key: read_metres(attributes, (key,), place) for key in FIGURES}
    return {key: value for key, value in found.items() if value is not None}


def _expect_list(value: object, place: str) -> list[object]:
    if not isinstance(value, list) or not value:
        raise AreaError(f"{place}: expected a list of outlines, got {str(value)[:60]}")
    return value
