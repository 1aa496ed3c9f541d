"""Problems to solve: instances of city files and of power lines, with names of their visits."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import numpy.typing as npt

from benchmarks.tsplib import is_tsplib, read_tsplib
from missions import Network, default_network_path, read_network
from missions.geo import FloatArray
from planner import Instance, Route, Travel, Vehicle, build_instance, is_reversed, segment_of
from planner.moves import Dynamics

LENGTHS = Travel(1.0, 1.0, 1.0, 1.0)
"""One unit of length is one second and one percent: a plan's cost is the length of its tours."""
PAPER_S = Travel(5.0, 1.0, 1.0, 1.0)
"""The paper's model, 5 m/s in transit and 1 m/s along the line; a second is a percent."""
AUTHORS_S = Travel(5.0, 1.0, 1.0, 1.0, Dynamics())
"""The matrix of the authors' public solver, in seconds; a second is a percent."""


@dataclass(frozen=True, slots=True, eq=False)
class NamedProblem:
    """An instance, and the names of its visits."""

    name: str
    instance: Instance
    cities: tuple[int, ...] | None
    """For a city file: city number of each of the instance's segments; None for a power line."""

    def visits(self, route: Route) -> list[int] | list[dict[str, int | bool]]:
        """Return a route as numbers of cities, or as segments of the network with their direction."""
        if self.cities is not None:
            return [self.cities[segment_of(visit)] for visit in route.visits]
        return [{"segment": segment_of(visit), "reversed": is_reversed(visit)} for visit in route.visits]


def read_problem(
    path: Path | None, *, radius_m: float | None, vehicles: int, budget: float | None, dynamics: bool
) -> NamedProblem:
    """Read a problem: a TSPLIB file, a network file, or the project's own network without a file.

    Raises:
        BenchError: the city file cannot be used.
        missions.MissionsError: the network cannot be used.
    """
    if path is not None and is_tsplib(path):
        return cities_problem(path, vehicles, budget)
    network = network_of(path, radius_m)
    instance = line_instance(network.ends_m, vehicles, AUTHORS_S if dynamics else PAPER_S, budget)
    return NamedProblem(Path(network.source).stem, instance, None)


def cities_problem(path: Path, vehicles: int, budget: float | None = None) -> NamedProblem:
    """Return the cities of a TSPLIB file as segments of zero length, the first one as the depot.

    Raises:
        BenchError: the file cannot be used.
    """
    cities = read_tsplib(path)
    ends = np.repeat(cities.places[1:, np.newaxis, :], 2, axis=1)
    depot = (float(cities.places[0, 0]), float(cities.places[0, 1]))
    return NamedProblem(cities.name, _instance(ends, depot, vehicles, LENGTHS, budget), cities.numbers[1:])


def network_of(path: Path | None, radius_m: float | None) -> Network:
    """Read a network file, or the project's own; a graph file, which has no position, gets that one's.

    Raises:
        missions.MissionsError: the network cannot be used.
    """
    own = default_network_path()
    if path is None:
        return read_network(own, radius_m=radius_m)
    text = path.read_bytes().lstrip() if path.is_file() else b""
    if text.startswith(b"{"):
        return read_network(path, radius_m=radius_m)
    frame = read_network(own).frame
    return read_network(path, depot=(frame.lat_deg, frame.lon_deg, frame.alt_m), radius_m=radius_m)


def line_instance(ends_m: npt.ArrayLike, vehicles: int, travel: Travel, budget_pct: float | None = None) -> Instance:
    """Return segments about a depot at (0, 0) with equal vehicles; without a budget it is unlimited."""
    return _instance(np.asarray(ends_m, dtype=np.float64), (0.0, 0.0), vehicles, travel, budget_pct)


def with_budget(instance: Instance, budget_pct: float) -> Instance:
    """Return the instance with another budget for every vehicle."""
    fleet = tuple(replace(vehicle, budget_pct=budget_pct) for vehicle in instance.vehicles)
    return replace(instance, vehicles=fleet)


def _instance(
    ends_m: FloatArray, depot_m: tuple[float, float], vehicles: int, travel: Travel, budget_pct: float | None
) -> Instance:
    fleet = [Vehicle(f"uav{number}", depot_m, 0.0) for number in range(1, vehicles + 1)]
    instance = build_instance(ends_m, depot_m, fleet, travel)
    return with_budget(instance, _ample_budget_pct(instance) if budget_pct is None else budget_pct)


def _ample_budget_pct(instance: Instance) -> float:
    """Return twice the cost of flying to each segment and back one by one: no good route comes near it."""
    there_and_back = (instance.start_pct[0] + instance.home_pct[0]).reshape(-1, 2).min(axis=1)
    return 2.0 * float(there_and_back.sum()) + 1.0
