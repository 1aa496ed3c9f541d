"""A power line and a site for a fleet of any size with a given flight time."""

from __future__ import annotations

import math
import socket
from pathlib import Path

import numpy as np

from benchmarks.synthetic import generate_network
from executor.simulated.simulated_fleet import SIMULATED_CEILING_M, build_vehicle_tables, find_free_ports

SPEED_M_S = 3.0
"""Speed along the line; the default of a site."""
SPAN_M = 275.0
"""Mean length of a generated span."""
SPARE = 1.5
"""Factor by which routes exceed the flight time, so that no vehicle returns early."""
CAPACITY_AH = 1e4
"""Battery that lasts for any flight."""
DEPOT = {"lat_deg": 49.6, "lon_deg": 15.6, "alt_m": 400.0}


def write_network(path: Path, vehicles: int, minutes: float, seed: int) -> None:
    """Write a generated network that keeps a fleet busy for this time, as a graph file."""
    route_s = SPARE * 60.0 * minutes
    segments = max(2 * vehicles, math.ceil(vehicles * route_s * SPEED_M_S / SPAN_M))
    ends_m = np.round(generate_network(segments, seed), 2)
    pylons = {place: index for index, place in enumerate(dict.fromkeys(map(tuple, ends_m.reshape(-1, 2).tolist())), 1)}
    beside: dict[int, list[int]] = {index: [] for index in pylons.values()}
    for a, b in ends_m.tolist():
        one, other = pylons[tuple(a)], pylons[tuple(b)]
        beside[one].append(other)
        beside[other].append(one)
    places = " ".join(f"{east_m} {north_m} 0;" for east_m, north_m in pylons)
    neighbours = " ".join(" ".join(map(str, others)) + ";" for others in beside.values())
    text = f'pylons_position = "{places}"\nconnections_indexes = "{neighbours}"\n'
    path.write_text(text, encoding="utf-8")


def _free_page_port() -> int:
    """Return an unused TCP port of this computer."""
    with socket.create_server(("127.0.0.1", 0)) as one:
        return int(one.getsockname()[1])


def site_of(network: str, vehicles: int, speedup: float) -> dict[str, object]:
    """Return the content of a site file with vehicles on free ports of this computer, and its page."""
    return {
        "depot": DEPOT,
        "network": {"file": network},
        # Fifty layers; a simulation needs no permit for them.
        "inspection": {"ceiling_m": SIMULATED_CEILING_M},
        "energy": {"capacity_ah": CAPACITY_AH},
        "flight": {"speedup": speedup, "fly_again": "auto"},
        "web": {"port": _free_page_port()},
        "vehicle": build_vehicle_tables(find_free_ports(vehicles), "ardupilot"),
    }
