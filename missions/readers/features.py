"""Convert a file's features to poles and lines, the same way for every format.

Points become poles and lines become lines, unless their attributes say otherwise; positions become WGS 84.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from enum import StrEnum
from functools import cached_property
from math import isnan

import pyproj
from pyproj.exceptions import CRSError, ProjError

from missions.errors import NetworkError
from missions.files import MOST_FIGURE, is_figure, to_printable
from missions.readers.archives import explaining_errors
from missions.readers.attributes import (
    LINES,
    LOOSE,
    NAMES,
    NODE,
    POLES,
    WAY,
    PlainAttributes,
    PowerFeature,
    classify_line,
    classify_point,
    flatten_attributes,
    has_all_tags,
    heights_of,
    name_of,
    normalise_attributes,
    osm_id_of,
    osm_name_of,
    read_loose_metres,
)
from missions.readers.raw_network import Line, Pole, RawNetwork, ReadOptions, Vertex, quote_names
from missions.readers.values import NO_HEIGHT_M, Attributes

WGS84 = "EPSG:4326"
Position = tuple[float, float, float | None]
"""Easting or longitude first, then northing or latitude, and the third coordinate if there is one."""
POLE_NAMES = ("name", "ref", "id")
EMPTY, OTHER = "empty feature", "feature of another geometry"


@dataclass(frozen=True, slots=True)
class Wgs84Transform:
    """Transform from a reference system; longitude or easting comes first, whatever the system's own axis order."""

    words: str
    """Name of the system."""
    transformer: pyproj.Transformer | None
    """None for the identity."""

    def lat_lon_deg(
        self, xs: Sequence[float], ys: Sequence[float], places: Sequence[str] | str
    ) -> list[tuple[float, float]]:
        """Return latitude and longitude of many places.

        Raises:
            NetworkError: one is outside the valid area of this system.
        """
        if self.transformer is None:
            return list(zip(ys, xs, strict=True))
        with explaining_errors(f"crs: expected coordinates of {self.words}", ProjError):
            lons, lats = self.transformer.transform(xs, ys)
        found = list(zip(map(float, lats), map(float, lons), strict=True))
        for index, (lat_deg, lon_deg) in enumerate(found):
            if not math.isfinite(lat_deg) or not math.isfinite(lon_deg):
                where = places if isinstance(places, str) else places[index]
                raise NetworkError(
                    f"{where}: position: expected a place of {self.words}, got {xs[index]:g}, {ys[index]:g}"
                )
        return found


IDENTITY = Wgs84Transform("WGS 84", None)
"""For files that are always WGS 84."""


def build_wgs84_transform(said: object, place: str = "") -> Wgs84Transform:
    """Return the transform from a reference system to WGS 84.

    Args:
        said: Name or definition: 'EPSG:5514', well-known text.
        place: Prefix of the key in messages: the layer.

    Raises:
        NetworkError: it is unknown, or does not have two horizontal axes.
    """
    try:
        system = pyproj.CRS.from_user_input(said)
    except CRSError as error:
        text = to_printable(str(said))
        text = text if len(text) <= 60 else f"{text[:60]}..."
        raise NetworkError(
            f"{place}crs: expected a coordinate reference system such as 'EPSG:32633', got {text!r}"
        ) from error
    if system.is_compound:  # with heights, which are ignored
        system = system.sub_crs_list[0]
    if not (system.is_projected or system.is_geographic):
        raise NetworkError(f"{place}crs: expected a map grid or degrees, got {system.name!r}")
    code = system.to_authority(min_confidence=70)
    name = to_printable(system.name)
    words = name if code is None else f"{name} ({':'.join(code)})"
    if code is not None and ":".join(code) in {WGS84, "OGC:CRS84"}:
        return IDENTITY
    return Wgs84Transform(words, pyproj.Transformer.from_crs(system, WGS84, always_xy=True))


class GeometryKind(StrEnum):
    """Geometry type of a layer or a feature."""

    POINT = "point"
    LINE = "line"
    OTHER = "other"


@dataclass(frozen=True)
class Feature:
    """One feature: points, or a line of several parts, evaluated only if it is selected."""

    place: str
    kind: GeometryKind
    parts: Iterable[Sequence[Position]]
    attributes: Attributes
    id: object = None
    """Id stored outside the attributes, as in GeoJSON and OpenStreetMap."""
    name: str = ""
    """Name that overrides the attributes."""
    other: str = OTHER
    """Its type if it is neither point nor line."""
    pole_names: Sequence[str] = POLE_NAMES
    """Attributes that hold a pole's name, in order of preference."""

    @cached_property
    def known(self) -> PlainAttributes:
        """Its attributes by their normalised names, with nested ones."""
        return normalise_attributes(flatten_attributes(self.attributes))

    @cached_property
    def osm_id(self) -> tuple[str, str] | None:
        """OpenStreetMap element type and number; None if it is not from OpenStreetMap."""
        return osm_id_of(self.known, self.id, NODE if self.kind is GeometryKind.POINT else WAY)

    @property
    def is_of_map(self) -> bool:
        """Whether all tags of OpenStreetMap are present."""
        return self.osm_id is not None and has_all_tags(self.attributes)

    @property
    def title(self) -> str:
        """Its name; empty if it has none."""
        if self.name:
            return self.name
        if self.osm_id is not None:
            return osm_name_of(self.known, self.osm_id)
        is_point = self.kind is GeometryKind.POINT
        return name_of(self.known, (*self.pole_names, *(POLES if is_point else NAMES))) or name_of({"id": self.id})


@dataclass(frozen=True, slots=True)
class SourceLayer:
    """One layer of a file, before it is read."""

    name: str
    kind: GeometryKind
    count: int
    features: Iterable[Feature]
    """Read only if the layer is selected."""
    system: str
    """Name or definition of its reference system; empty if the file has none."""
    place: str
    """Where the file states it, for messages."""


def add_layers(drawing: RawNetwork, layers: Sequence[SourceLayer], choice: ReadOptions) -> None:
    """Add the selected layers, each in its own reference system.

    Raises:
        NetworkError: one line that names the file, the layer and feature and what was expected.
    """
    # The requested ones, or else those of points and lines if there is at most one of each.
    useful = [layer for layer in layers if layer.kind is not GeometryKind.OTHER]
    if not useful:
        others = f" but {quote_names(layer.name for layer in layers)}" if layers else ""
        raise NetworkError(f"layers: expected one of lines, found none of lines or points{others}")
    names = choice.select_layers([layer.name for layer in useful])
    wanted = [layer for layer in useful if layer.name in names]
    for kind in (GeometryKind.POINT, GeometryKind.LINE):
        if not choice.layers and sum(layer.kind is kind for layer in wanted) > 1:
            words = ", ".join(f"{layer.name!r} ({layer.count} {layer.kind.value}s)" for layer in useful[:12])
            raise NetworkError(f"layer: expected it to say which of these are meant: {words}")
    systems = []
    for layer in wanted:
        system = _find_system(layer, choice.crs)
        systems.append(system.words)
        add_features(drawing, layer.features, choice, system)
    drawing.crs = ", ".join(dict.fromkeys(systems))


def _find_system(layer: SourceLayer, asked: str | None) -> Wgs84Transform:
    place = f"{layer.place}: "
    if not layer.system and asked is None:
        raise NetworkError(f"{place}crs: expected a reference system, none is in the file; crs says it")
    system = build_wgs84_transform(layer.system or asked, place)
    if layer.system and asked is not None and build_wgs84_transform(asked, place).words != system.words:
        raise NetworkError(f"{place}crs: expected none, the file says {system.words}; got {asked!r}")
    return system


def add_features(
    drawing: RawNetwork,
    features: Iterable[Feature],
    choice: ReadOptions,
    system: Wgs84Transform = IDENTITY,
) -> None:
    """Add features to a drawing.

    Args:
        drawing: The drawing to add to.
        features: Features of a layer, or of a whole file.
        choice: The selection.
        system: Reference system of their positions.

    Raises:
        NetworkError: one line that names the file, the feature and what was expected.
    """
    for feature in features:
        if feature.kind is GeometryKind.POINT:
            add_points(drawing, feature, system)
        elif feature.kind is GeometryKind.OTHER:
            drawing.leave_out(feature.other, feature.title or feature.place)
        elif is_wanted_line(drawing, feature, choice):
            add_line(drawing, feature, system)


def is_wanted_line(drawing: RawNetwork, feature: Feature, choice: ReadOptions) -> bool:
    """Return whether a line is overhead, in use and selected; a line that is not flown is noted.

    A disused line is accepted if a filter refers to the attribute that marks it as disused.
    """
    meaning, key = classify_line(feature.known, of_map=feature.is_of_map)
    if meaning is not PowerFeature.SPAN and not (meaning is PowerFeature.DISUSED and choice.has_comparison_of(key)):
        drawing.leave_out(meaning.value, feature.title or feature.place)
        return False
    return choice.is_wanted(flatten_attributes(feature.attributes))


def add_points(drawing: RawNetwork, feature: Feature, system: Wgs84Transform = IDENTITY) -> None:
    """Add the poles of a feature, or the depot; points that are not poles are noted.

    Raises:
        NetworkError: one line that names the file, the feature and what was expected.
    """
    place, known, name, of_map = feature.place, feature.known, feature.title, feature.is_of_map
    is_depot = str(known.get("role", "")).strip().lower() == "depot"
    meaning, _ = classify_point(known, of_map=of_map)
    # Programs write a point without a place with NaN coordinates.
    positions = [at for at in itertools.chain.from_iterable(feature.parts) if not (isnan(at[0]) and isnan(at[1]))]
    is_pole = meaning is PowerFeature.POLE and not is_depot
    if not is_depot and not (is_pole and positions):
        drawing.leave_out(meaning.value if positions else EMPTY, name or place)
    heights = heights_of(known, place) if is_pole or is_depot else (None, None)
    for lat_deg, lon_deg, third_m in _place_positions(positions, system, place):
        pole = Pole(place, name, lat_deg, lon_deg, *heights, third_m, name_of(known, LINES))
        if is_depot:
            drawing.depot = drawing.depot or pole
        elif is_pole:
            _add_pole(drawing, pole, known, of_map=of_map or "power" in known)
        else:
            drawing.others.append(pole)


def _add_pole(drawing: RawNetwork, pole: Pole, known: PlainAttributes, *, of_map: bool) -> None:
    """Add a pole; heights only hinted at by an attribute count if all poles of the file have them."""
    hints = {key: read_loose_metres(known, key, of_map=of_map) for key in LOOSE if getattr(pole, key) is None}
    found = {key: value_m for key, (value_m, _) in hints.items() if value_m is not None}
    elevation_m, height_m = found.get("elevation_m", pole.elevation_m), found.get("height_m", pole.height_m)
    hinted = {key: hints[key][1] for key in found}
    drawing.poles.append(replace(pole, elevation_m=elevation_m, height_m=height_m, hinted=hinted) if found else pole)


def read_third_coordinate(value: object) -> float | None:
    """Return a third coordinate; None if it is missing or implausible."""
    return float(value) if is_figure(value) and value and value > NO_HEIGHT_M else None


def _place_positions(positions: Sequence[Position], system: Wgs84Transform, place: str) -> tuple[Vertex, ...]:
    for x, y, _ in positions:
        if not (abs(x) <= MOST_FIGURE and abs(y) <= MOST_FIGURE):
            raise NetworkError(f"{place}: position: expected finite coordinates, got {x}, {y}")
    at = system.lat_lon_deg([x for x, _, _ in positions], [y for _, y, _ in positions], place)
    return tuple((*one, read_third_coordinate(third_m)) for one, (_, _, third_m) in zip(at, positions, strict=True))


def add_line(drawing: RawNetwork, feature: Feature, system: Wgs84Transform = IDENTITY) -> None:
    """Add a line.

    Raises:
        NetworkError: one line that names the file, the feature and what was expected.
    """
    place, parts = feature.place, []
    for part in feature.parts:
        if len(part) < 2:
            raise NetworkError(f"{place}: expected a line of at least two positions, found {len(part)}")
        parts.append(_place_positions(part, system, place))
    if parts:
        drawing.add_line(Line(place, feature.title, tuple(parts)))
    else:
        drawing.leave_out(EMPTY, feature.title or place)
