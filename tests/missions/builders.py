"""Small networks and flights with answers that can be worked out by hand."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from functools import cache

import numpy as np

from missions import (
    EncodedMission,
    FlightPath,
    FlightSetup,
    Inspection,
    Network,
    Phase,
    Pylon,
    Segment,
    Task,
    Waypoint,
    plan_flight_setup,
)
from missions.geo import LocalFrame
from missions.pricing import DEPOT_M
from missions.readers import default_network_path, read_network
from planner import Travel, Vehicle, build_instance

FRAME = LocalFrame(49.6, 15.6, 450.0)
"""A depot for tests."""
FLEET = ("uav1", "uav2", "uav3", "uav4")


def network_of(
    places_m: Sequence[tuple[float, float]],
    pairs: Sequence[tuple[int, int]],
    heights_m: Sequence[tuple[float, float]] | None = None,
) -> Network:
    """Return a network from east/north metres about FRAME; heights are (elevation, structure) of each pylon.

    Without heights its ground is flat.
    """
    lat_lon_deg = FRAME.many_to_wgs84_deg(np.array(places_m, dtype=np.float64).reshape(-1, 2))
    pylons = tuple(
        Pylon(f"p{index}", float(lat), float(lon), *((None, None) if heights_m is None else heights_m[index]))
        for index, (lat, lon) in enumerate(lat_lon_deg)
    )
    segments = tuple(Segment(n, a, b) for n, (a, b) in enumerate(pairs))
    return Network(pylons, segments, FRAME, "test network", flat=heights_m is None)


def line_east(pylons: int = 4) -> Network:
    """Return a line due east of the depot: pylons at 100, 200, 300 ... m, without heights."""
    places = [(100.0 * (index + 1), 0.0) for index in range(pylons)]
    return network_of(places, [(index, index + 1) for index in range(pylons - 1)])


def tall_line_east(pylons: int = 4) -> Network:
    """Return the same with pylons that are 30 m high."""
    places = [(100.0 * (index + 1), 0.0) for index in range(pylons)]
    return network_of(places, [(index, index + 1) for index in range(pylons - 1)], [(450.0, 30.0)] * pylons)


@cache
def default_setup(layer_m: float = 5.0) -> FlightSetup:
    """Return the flight setup of four vehicles over the default network's 700 m."""
    network = read_network(default_network_path(), radius_m=700.0)
    return plan_flight_setup(network, FLEET, Inspection(layer_m=layer_m))


def path_through(name: str, places_m: Sequence[tuple[float, float, float]]) -> FlightPath:
    """Return a path that climbs over its first place and passes the others: east, north, up about FRAME."""
    waypoints = []
    for index, (east, north, up) in enumerate(places_m):
        lat, lon = FRAME.to_wgs84_deg(east, north)
        waypoints.append(Waypoint(Phase.TRANSIT if index else Phase.TAKEOFF, lat, lon, up, 5.0))
    return FlightPath(name, tuple(waypoints))


def depot_vehicle(name: str, budget_pct: float, consumption: float = 1.0) -> Vehicle:
    """Return a vehicle that stands at the depot."""
    return Vehicle(name, DEPOT_M, budget_pct, consumption)


def whole_task(network: Network, vehicles: Sequence[Vehicle], travel: Travel) -> Task:
    """Return the problem of inspecting every segment of a network, by the paper's model."""
    return paper_task(network, range(len(network.segments)), vehicles, travel)


def paper_task(network: Network, segments: Iterable[int], vehicles: Sequence[Vehicle], travel: Travel) -> Task:
    """Return the problem of inspecting some segments of a network, by the paper's model."""
    ids = tuple(sorted(set(segments)))
    return Task(build_instance(network.ends_m[list(ids)], DEPOT_M, vehicles, travel), ids)


def arrival_seq(mission: EncodedMission, waypoint: int) -> int:
    """Return the item that is reached when a waypoint is: the last that serves it, behind its speed item."""
    return len(mission.waypoint_of) - 1 - mission.waypoint_of[::-1].index(waypoint)
