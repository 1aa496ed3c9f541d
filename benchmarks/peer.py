"""PyVRP as another solver for comparison, if installed: the extra bench.

A segment is a mutually exclusive group of two clients, one for each direction; distances are whole numbers, and the
budget is each vehicle's longest distance. It minimises the sum: it has no min-max objective.
"""

from __future__ import annotations

import time
import warnings
from dataclasses import dataclass
from importlib.util import find_spec

import numpy as np
import numpy.typing as npt

from planner import Cost, Instance, Plan, Route, evaluate

SCALE = 100
"""Factor from distances in seconds to whole numbers."""


@dataclass(frozen=True, slots=True)
class PeerPlan:
    """Result of the other solver."""

    plan: Plan | None
    """None if it found nothing valid by our own definition."""
    value: float | None
    """c-MinSum of that plan, by our own definition."""


class _ProcessorTime:
    """PyVRP's stop by the processor time that this program spends: a busy computer makes no answer worse."""

    def __init__(self, seconds: float) -> None:
        self._until_s = time.process_time() + seconds

    def __call__(self, best_cost: float) -> bool:
        """Return whether to stop."""
        del best_cost
        return time.process_time() >= self._until_s


def pyvrp_installed() -> bool:
    """Return whether PyVRP is available."""
    return find_spec("pyvrp") is not None


def solve_pyvrp(instance: Instance, *, seconds: float, seed: int, scale: float = SCALE) -> PeerPlan:
    """Return PyVRP's plan for the least sum within the budgets; each vehicle starts at its own depot.

    Seconds are those of the processor.
    """
    import pyvrp

    clients, fleet = 2 * instance.segments, len(instance.vehicles)
    first = fleet + 1  # location 0 is the common landing, then come the starts, then the visits
    locations = [pyvrp.Location(0, 0) for _ in range(first + clients)]
    groups = [pyvrp.ClientGroup([2 * segment, 2 * segment + 1]) for segment in range(instance.segments)]
    visits = [pyvrp.Client(first + visit, required=False, group=visit // 2) for visit in range(clients)]
    alike = _group_equal_vehicles(instance)
    matrices = [_distances(instance, vehicles[0], scale) for vehicles in alike]
    types = [
        pyvrp.VehicleType(
            len(vehicles), start_depot=vehicles[0] + 1, end_depot=0,
            max_distance=int(instance.vehicles[vehicles[0]].budget_pct * scale), profile=number,
        )
        for number, vehicles in enumerate(alike)
    ]  # fmt: skip
    depots = [pyvrp.Depot(place) for place in range(first)]
    data = pyvrp.ProblemData(
        locations, visits, depots, types, matrices, [np.zeros_like(one) for one in matrices], groups
    )
    with warnings.catch_warnings():
        # It warns when it finds no plan within the budgets: here that is a valid answer.
        warnings.simplefilter("ignore", pyvrp.exceptions.PenaltyBoundWarning)
        found = pyvrp.solve(data, _ProcessorTime(seconds), seed=seed, collect_stats=False, display=False).best
    if not found.is_feasible():
        return PeerPlan(None, None)
    routes: list[tuple[int, ...]] = [()] * fleet
    for route in found.routes():
        vehicle = alike[route.vehicle_type()].pop()
        routes[vehicle] = tuple(stop.idx for stop in route.schedule() if stop.is_client())
    plan = Plan(tuple(Route(vehicle, visits) for vehicle, visits in enumerate(routes)))
    evaluation = evaluate(instance, plan, Cost.MINSUM)
    return PeerPlan(None, None) if evaluation.violations else PeerPlan(plan, evaluation.value)


def _group_equal_vehicles(instance: Instance) -> list[list[int]]:
    """Return groups of interchangeable vehicles."""
    kinds: dict[tuple[object, ...], list[int]] = {}
    for number, vehicle in enumerate(instance.vehicles):
        rows = instance.start_pct[number].tobytes(), instance.home_pct[number].tobytes()
        own = (instance.profile[number], vehicle.consumption, vehicle.budget_pct, *rows)
        kinds.setdefault(own, []).append(number)
    return list(kinds.values())


def _distances(instance: Instance, vehicle: int, scale: float) -> npt.NDArray[np.int64]:
    """Return (1 + k + 2n, 1 + k + 2n) int64: one vehicle's distances of all places; only its own start is usable."""
    fleet, every = len(instance.vehicles), np.arange(2 * instance.segments)
    first = fleet + 1
    whole = np.zeros((first + len(every), first + len(every)))
    consumption = instance.vehicles[vehicle].consumption
    moves = instance.moves.pct(instance.profile[vehicle], every[:, np.newaxis], every[np.newaxis])
    whole[first:, first:] = consumption * moves
    whole[1:first, first:] = instance.start_pct[vehicle]
    whole[0, first:] = instance.start_pct[vehicle]
    whole[first:, 0] = instance.home_pct[vehicle]
    whole[first:, 1:first] = instance.home_pct[vehicle][:, np.newaxis]
    np.fill_diagonal(whole, 0.0)
    return np.asarray(np.rint(whole * scale), dtype=np.int64)
