"""Build the lines, tracks and places that all map formats are written from, and those of a plan.

For a plan these are every vehicle's whole path with its heights, the line with the names of its assets, and pads. Paths
are those of the missions (`inspection_height.build_first_paths`), including detours around pads and climbs.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from enum import Enum
from types import MappingProxyType

from missions.errors import MissionFileError
from missions.inspection_height import build_first_paths
from missions.network import Pylon
from missions.pads import Pad
from missions.plan_file import PlanFile
from missions.setup import FlightSetup
from missions.waypoints import FlightPath, Phase

Position = tuple[float, float, float | None]
"""Latitude and longitude in degrees, WGS 84, and height in metres in a `Reference`; None: unknown."""
Fact = str | float | int | bool | None
NO_FACTS: Mapping[str, Fact] = MappingProxyType({})

COLOURS = ("#56b4e9", "#e69f00", "#009e73", "#f0e442", "#0072b2", "#d55e00", "#cc79a7", "#f5f5f5")
"""Vehicle colours in order of layers: Okabe and Ito's, which stand out on imagery and suit the colour-blind."""


class MapFeatureKind(Enum):
    """Type of a feature; the value is its keyword in the formats."""

    SEGMENT = "segment"
    PLANNED = "planned"
    FLOWN = "flown"
    DEPOT = "depot"
    PAD = "pad"
    EVENT = "event"


class Reference(Enum):
    """Reference of heights."""

    SEA = "above mean sea level"
    GROUND = "above the ground, which is taken to be flat"
    NONE = "not known"


@dataclass(frozen=True, slots=True)
class MapLinePiece:
    """Consecutive positions without a gap."""

    positions: tuple[Position, ...]
    times: tuple[str, ...] = ()
    """ISO 8601 times in UTC for each position; empty for a plan."""


@dataclass(frozen=True, slots=True)
class MapLine:
    """A line on the map."""

    kind: MapFeatureKind
    name: str
    pieces: tuple[MapLinePiece, ...]
    reference: Reference
    vehicle: str | None = None
    facts: Mapping[str, Fact] = field(default_factory=lambda: NO_FACTS)
    """Further properties, with the same keys in every format."""


@dataclass(frozen=True, slots=True)
class MapPoint:
    """A place on the map."""

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
    """Content of one file."""

    title: str
    vehicles: tuple[str, ...]
    """Vehicles in order of their colours."""
    ways: Sequence[MapLine]
    spots: Sequence[MapPoint]

    def __post_init__(self) -> None:
        """Check that all formats can represent the content.

        Raises:
            MissionFileError: a place or a figure is not finite.
        """
        for one in self.things:
            for figure in _figures(one):
                if isinstance(figure, float) and not math.isfinite(figure):
                    raise MissionFileError(f"{self.title}: {one.name}: expected finite figures, got {figure}")

    @property
    def things(self) -> list[MapLine | MapPoint]:
        """All features, lines first."""
        return [*self.ways, *self.spots]

    def colour_of(self, vehicle: str) -> str:
        """Return a vehicle's colour."""
        return COLOURS[self.vehicles.index(vehicle) % len(COLOURS)]


def _figures(one: MapLine | MapPoint) -> Iterator[Fact]:
    """Yield all numbers that are written for a feature."""
    yield from one.facts.values()
    pieces = [(one.position,)] if isinstance(one, MapPoint) else [piece.positions for piece in one.pieces]
    for positions in pieces:
        for position in positions:
            yield from position


def collect_facts(one: MapLine | MapPoint) -> dict[str, Fact]:
    """Return all known properties of a feature besides its name and its place."""
    facts = {"kind": one.kind.value, "vehicle": one.vehicle, **one.facts, "heights": one.reference.value}
    return {key: value for key, value in facts.items() if value is not None}


def build_plan_features(content: PlanFile, setup: FlightSetup, title: str) -> MapFeatures:
    """Return the features of a plan.

    Args:
        content: The plan file.
        setup: Heights and pads over its network, for its vehicles.
        title: Title of the map.
    """
    ways = list(build_segment_lines(setup, {}))
    paths = build_first_paths(setup, {route.vehicle: content.visits_of(route) for route in content.routes})
    for route in content.routes:
        name = route.vehicle
        path = paths.get(name)
        if path is not None:
            facts = {
                "segments": len(route.visits),
                "duration_s": round(route.duration_s, 1),
                "energy_pct": round(route.energy_pct, 2),
            }
            ways.append(build_route_line(setup, path, f"{name} planned", facts))
    return MapFeatures(title, content.names, ways, tuple(build_pad_points(setup)))


def build_route_line(
    setup: FlightSetup,
    path: FlightPath,
    name: str,
    facts: Mapping[str, Fact] = NO_FACTS,
    *,
    reference: Reference | None = None,
) -> MapLine:
    """Return a vehicle's path, including its pad if it begins there.

    Args:
        setup: Heights and pads.
        path: Its path.
        name: Display name.
        facts: Further properties.
        reference: Reference of its heights, to override `choose_height_reference`.
    """
    pad, reference = setup.pad_of(path.vehicle), reference or choose_height_reference(setup)
    base_m = pad.alt_m if reference is Reference.SEA else 0.0
    positions: list[Position] = [(point.lat_deg, point.lon_deg, point.alt_rel_m + base_m) for point in path.waypoints]
    if path.waypoints[0].phase is Phase.TAKEOFF:
        positions.insert(0, _pad_position(setup, pad, reference))
    return MapLine(MapFeatureKind.PLANNED, name, (MapLinePiece(tuple(positions)),), reference, path.vehicle, facts)


def build_segment_lines(setup: FlightSetup, facts: Mapping[int, Mapping[str, Fact]]) -> Iterator[MapLine]:
    """Yield every segment, named by its asset, along the tops of its pylons where known.

    Args:
        setup: Setup with the network.
        facts: Further properties of segments, by number.
    """
    network = setup.network
    for segment in network.segments:
        ends = (network.pylons[segment.a], network.pylons[segment.b])
        heights_m = [_top_m(pylon, flat=network.flat) for pylon in ends]
        known = all(height_m is not None for height_m in heights_m)
        reference = choose_height_reference(setup) if known else Reference.NONE
        positions = tuple(
            (pylon.lat_deg, pylon.lon_deg, height_m if known else None)
            for pylon, height_m in zip(ends, heights_m, strict=True)
        )
        name = network.segment_name(segment.id)
        told = {"asset": name, "pylon_a": ends[0].id, "pylon_b": ends[1].id, **facts.get(segment.id, {})}
        yield MapLine(MapFeatureKind.SEGMENT, name, (MapLinePiece(positions),), reference, None, told)


def build_pad_points(setup: FlightSetup, reference: Reference | None = None) -> Iterator[MapPoint]:
    """Yield the depot and every vehicle's pad."""
    reference = reference or choose_height_reference(setup)
    lat_deg, lon_deg, alt_m = setup.network.depot
    # The height of a depot over flat ground above sea level may be unknown.
    over = choose_height_reference(setup)
    yield MapPoint(MapFeatureKind.DEPOT, "depot", (lat_deg, lon_deg, alt_m if over is Reference.SEA else 0.0), over)
    for pad in setup.pads:
        yield MapPoint(
            MapFeatureKind.PAD, f"{pad.vehicle} pad", _pad_position(setup, pad, reference), reference, pad.vehicle
        )


def choose_height_reference(setup: FlightSetup) -> Reference:
    """Return the reference for path heights: sea level only where the ground heights are known."""
    return Reference.GROUND if setup.network.flat else Reference.SEA


def _pad_position(setup: FlightSetup, pad: Pad, reference: Reference) -> Position:
    lat_deg, lon_deg = setup.frame.to_wgs84_deg(pad.east_m, pad.north_m)
    return lat_deg, lon_deg, pad.alt_m if reference is Reference.SEA else 0.0


def _top_m(pylon: Pylon, *, flat: bool) -> float | None:
    """Return the height of a pylon's top, above ground if that is asserted to be flat; None if unknown."""
    if flat or pylon.elevation_m is None:
        return pylon.height_m if flat else None
    return pylon.elevation_m + (pylon.height_m or 0.0)
