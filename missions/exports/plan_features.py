"""A plan as lines and places: every vehicle's whole path with its heights, the line with the names of its assets, pads.

Paths are those that missions are made of (`asked.first_paths`): ways around pads, climbs and all.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping

from missions.exports.map_features import (
    NO_FACTS,
    Fact,
    MapFeatureKind,
    MapFeatures,
    MapLine,
    MapLinePiece,
    MapPoint,
    Position,
    Reference,
)
from missions.inspection_height import build_first_paths
from missions.network import Pylon
from missions.pads import Pad
from missions.plan_file import PlanFile
from missions.setup import FlightSetup
from missions.waypoints import FlightPath, Phase


def build_plan_features(content: PlanFile, setup: FlightSetup, title: str) -> MapFeatures:
    """Return a plan.

    Args:
        content: The plan file.
        setup: Heights and pads over its network, for its vehicles.
        title: What the drawing is called.
    """
    names = tuple(vehicle.name for vehicle in content.vehicles)
    ways = list(build_segment_lines(setup, {}))
    paths = build_first_paths(setup, {names[route.vehicle]: route.visits for route in content.plan.routes})
    for route, duration_s, energy_pct in zip(
        content.plan.routes, content.durations_s, content.energies_pct, strict=True
    ):
        name = names[route.vehicle]
        path = paths.get(name)
        if path is not None:
            facts = {
                "segments": len(route.visits),
                "duration_s": round(duration_s, 1),
                "energy_pct": round(energy_pct, 2),
            }
            ways.append(build_route_line(setup, path, f"{name} planned", facts))
    return MapFeatures(title, names, ways, tuple(build_pad_points(setup)))


def build_route_line(
    setup: FlightSetup,
    path: FlightPath,
    name: str,
    facts: Mapping[str, Fact] = NO_FACTS,
    *,
    reference: Reference | None = None,
) -> MapLine:
    """Return a vehicle's path, from its pad on where it begins there.

    Args:
        setup: Heights and pads.
        path: Where it flies.
        name: What people call it.
        facts: What else is known of it.
        reference: What its heights are counted from, where somebody knows better than `reference_of`.
    """
    pad, reference = setup.pad_of(path.vehicle), reference or choose_height_reference(setup)
    base_m = pad.alt_m if reference is Reference.SEA else 0.0
    positions: list[Position] = [(point.lat_deg, point.lon_deg, point.alt_rel_m + base_m) for point in path.waypoints]
    if path.waypoints[0].phase is Phase.TAKEOFF:
        positions.insert(0, _pad_position(setup, pad, reference))
    return MapLine(MapFeatureKind.PLANNED, name, (MapLinePiece(tuple(positions)),), reference, path.vehicle, facts)


def build_segment_lines(setup: FlightSetup, facts: Mapping[int, Mapping[str, Fact]]) -> Iterator[MapLine]:
    """Yield every segment by the name of its asset, along the tops of its pylons where they are known.

    Args:
        setup: With the network.
        facts: What else is known of segments, by their number.
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
    # A depot over flat ground may have no height above the sea that anybody gave.
    over = choose_height_reference(setup)
    yield MapPoint(MapFeatureKind.DEPOT, "depot", (lat_deg, lon_deg, alt_m if over is Reference.SEA else 0.0), over)
    for pad in setup.pads:
        yield MapPoint(
            MapFeatureKind.PAD, f"{pad.vehicle} pad", _pad_position(setup, pad, reference), reference, pad.vehicle
        )


def choose_height_reference(setup: FlightSetup) -> Reference:
    """Return what the heights of paths can be counted from: the sea only where the ground's heights are known."""
    return Reference.GROUND if setup.network.flat else Reference.SEA


def _pad_position(setup: FlightSetup, pad: Pad, reference: Reference) -> Position:
    lat_deg, lon_deg = setup.frame.to_wgs84_deg(pad.east_m, pad.north_m)
    return lat_deg, lon_deg, pad.alt_m if reference is Reference.SEA else 0.0


def _top_m(pylon: Pylon, *, flat: bool) -> float | None:
    """Return the height of a pylon's top, over the ground where that is claimed to be flat; None where nobody knows."""
    if flat or pylon.elevation_m is None:
        return pylon.height_m if flat else None
    return pylon.elevation_m + (pylon.height_m or 0.0)
