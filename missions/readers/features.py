"""Layers of features, as a GeoPackage and shapefiles have them: points are poles, lines are lines."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from enum import StrEnum

from missions.errors import NetworkError
from missions.files import MOST_FIGURE
from missions.readers.attributes import LINES, heights_of, name_of
from missions.readers.choice import Choice, quoted_names
from missions.readers.crs import ToWgs84
from missions.readers.drawing import Attributes, Depot, Drawing, Line, Matter, Pole, Remark

Position = tuple[float, float, float | None]
"""Easting or longitude first, then northing or latitude, and the third coordinate where there is one."""
POLE_NAMES = ("name", "ref", "id")


class Kind(StrEnum):
    """What a layer or a feature is made of."""

    POINT = "point"
    LINE = "line"
    OTHER = "other"


@dataclass(frozen=True, slots=True)
class Layer:
    """One layer of a file, before it is read."""

    name: str
    kind: Kind
    count: int

    @property
    def words(self) -> str:
        """The layer for people."""
        return f"{self.name!r} ({self.count} {self.kind.value}s)"


@dataclass(frozen=True, slots=True)
class Feature:
    """One feature: a point, or a line of several parts."""

    place: str
    kind: Kind
    parts: Sequence[Sequence[Position]]
    attributes: Attributes


def wanted_layers(layers: Sequence[Layer], source: str, choice: Choice) -> list[Layer]:
    """Return the layers to read: those asked for, or else those of points and lines if they are one of each at most.

    Raises:
        NetworkError: one is not there, or it is not clear which are meant.
    """
    useful = [layer for layer in layers if layer.kind is not Kind.OTHER]
    if not useful:
        others = f" but {quoted_names(layer.name for layer in layers)}" if layers else ""
        raise NetworkError(f"{source}: layers: expected one of lines, found none of lines or points{others}")
    names = choice.chosen_layers(source, [layer.name for layer in useful])
    wanted = [layer for layer in useful if layer.name in names]
    for kind in (Kind.POINT, Kind.LINE):
        if not choice.layers and sum(layer.kind is kind for layer in wanted) > 1:
            words = ", ".join(layer.words for layer in useful[:12])
            raise NetworkError(f"{source}: layer: expected it to say which of these are meant: {words}")
    return wanted


def add_features(drawing: Drawing, features: Iterable[Feature], system: ToWgs84, choice: Choice) -> None:
    """Add the features of a layer to what is drawn.

    Raises:
        NetworkError: one line that names the file, the feature and what was expected.
    """
    left_out = 0
    for feature in features:
        place = f"{drawing.source}: {feature.place}"
        for x, y, _ in (position for part in feature.parts for position in part):
            if not (abs(x) <= MOST_FIGURE and abs(y) <= MOST_FIGURE):
                raise NetworkError(f"{place}: position: expected finite coordinates, got {x}, {y}")
        if feature.kind is Kind.POINT:
            _add_points(drawing, feature, system)
        elif feature.kind is Kind.LINE:
            if choice.takes(feature.attributes):
                _add_line(drawing, feature, system)
        else:
            left_out += 1
    if left_out:
        drawing.found.append(Remark(Matter.LEFT_OUT, drawing.source, f"{left_out} features are no points or lines"))


def _add_points(drawing: Drawing, feature: Feature, system: ToWgs84) -> None:
    place = f"{drawing.source}: {feature.place}"
    heights = heights_of(feature.attributes, place)
    for part in feature.parts:
        for x, y, third_m in part:
            ((lat_deg, lon_deg),) = system.lat_lon_deg([x], [y], place)
            if str(feature.attributes.get("role", "")) == "depot":
                drawing.depot = drawing.depot or Depot(feature.place, lat_deg, lon_deg, heights[0])
                continue
            name, line = _name(feature), name_of(feature.attributes, LINES)
            drawing.poles.append(Pole(feature.place, name, lat_deg, lon_deg, *heights, third_m or None, line))


def _name(feature: Feature) -> str:
    return name_of(feature.attributes, POLE_NAMES) or name_of(feature.attributes)


def _add_line(drawing: Drawing, feature: Feature, system: ToWgs84) -> None:
    place = f"{drawing.source}: {feature.place}"
    parts = []
    for part in feature.parts:
        if len(part) < 2:
            raise NetworkError(f"{place}: expected a line of at least two positions, found {len(part)}")
        at = system.lat_lon_deg([x for x, _, _ in part], [y for _, y, _ in part], place)
        parts.append(tuple((*one, third_m or None) for one, (_, _, third_m) in zip(at, part, strict=True)))
    if not parts:
        drawing.found.append(Remark(Matter.LEFT_OUT, _name(feature) or feature.place, "a line without geometry"))
        return
    drawing.draw(Line(feature.place, _name(feature), tuple(parts)))
