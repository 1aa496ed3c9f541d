"""Lines, tracks and places on the earth, as all formats are written from them."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from enum import Enum
from types import MappingProxyType

from missions.errors import MissionFileError

Position = tuple[float, float, float | None]
"""Latitude and longitude in degrees, WGS 84, and height in metres as a `Reference` counts it; None: not known."""
Fact = str | float | int | bool | None
NO_FACTS: Mapping[str, Fact] = MappingProxyType({})

COLOURS = ("#56b4e9", "#e69f00", "#009e73", "#f0e442", "#0072b2", "#d55e00", "#cc79a7", "#f5f5f5")
"""Of vehicles, in the order of their layers: Okabe and Ito's, which stand off imagery; also for the colour-blind."""


class MapFeatureKind(Enum):
    """What something is; the word that the formats carry."""

    SEGMENT = "segment"
    PLANNED = "planned"
    FLOWN = "flown"
    DEPOT = "depot"
    PAD = "pad"
    EVENT = "event"


class Reference(Enum):
    """What heights are counted from."""

    SEA = "above mean sea level"
    GROUND = "above the ground, which is taken to be flat"
    NONE = "not known"


@dataclass(frozen=True, slots=True)
class MapLinePiece:
    """Positions without a gap between them."""

    positions: tuple[Position, ...]
    times: tuple[str, ...] = ()
    """ISO 8601 in UTC, one for each position; empty where it is a plan."""


@dataclass(frozen=True, slots=True)
class MapLine:
    """A line on the earth."""

    kind: MapFeatureKind
    name: str
    pieces: tuple[MapLinePiece, ...]
    reference: Reference
    vehicle: str | None = None
    facts: Mapping[str, Fact] = field(default_factory=lambda: NO_FACTS)
    """What else is known of it, by keys that are the same in every format."""


@dataclass(frozen=True, slots=True)
class MapPoint:
    """A place on the earth."""

    kind: MapFeatureKind
    name: str
    position: Position
    reference: Reference
    vehicle: str | None = None
    time: str | None = None
    """ISO 8601 in UTC."""
    facts: Mapping[str, Fact] = field(default_factory=lambda: NO_FACTS)


@dataclass(frozen=True, slots=True)
class MapFeatures:
    """Everything that one file shows."""

    title: str
    vehicles: tuple[str, ...]
    """In the order of their colours."""
    ways: Sequence[MapLine]
    spots: Sequence[MapPoint]

    def __post_init__(self) -> None:
        """Check that all formats can hold what is drawn.

        Raises:
            MissionFileError: a place or a figure is not finite.
        """
        things: list[MapLine | MapPoint] = [*self.ways, *self.spots]
        for one in things:
            for figure in _figures(one):
                if isinstance(figure, float) and not math.isfinite(figure):
                    raise MissionFileError(f"{self.title}: {one.name}: expected finite figures, got {figure}")

    def colour_of(self, vehicle: str) -> str:
        """Return a vehicle's colour."""
        return COLOURS[self.vehicles.index(vehicle) % len(COLOURS)]


def _figures(one: MapLine | MapPoint) -> Iterator[Fact]:
    """Yield all that is written of something as a number."""
    yield from one.facts.values()
    pieces = [(one.position,)] if isinstance(one, MapPoint) else [piece.positions for piece in one.pieces]
    for positions in pieces:
        for position in positions:
            yield from position


def collect_facts(one: MapLine | MapPoint) -> dict[str, Fact]:
    """Return all that is known of something beside its name and its place, without what is not known."""
    facts = {"kind": one.kind.value, "vehicle": one.vehicle, **one.facts, "heights": one.reference.value}
    return {key: value for key, value in facts.items() if value is not None}
