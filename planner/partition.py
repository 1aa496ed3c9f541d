"""Which routes make the best plan: set partitioning over all routes of a small instance, solved by HiGHS."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from planner import highs
from planner.cost import Cost
from planner.model import Instance
from planner.moves import FloatArray
from planner.subset_routes import SubsetRoutes, build_membership_matrix, compute_vehicle_kinds

if TYPE_CHECKING:
    import highspy

SAME = 1e-7
"""Costs that differ by this share are the same."""
PEAK = -1
"""The kind of the column that is no route but the largest load."""


@dataclass(frozen=True, slots=True)
class Partition:
    """The program; ``m`` columns, one for each route of each kind of vehicle, and ``r`` rows."""

    fleet: tuple[tuple[int, ...], ...]
    """For each kind of vehicle, those that are of it: they share their columns."""
    kind: npt.NDArray[np.int64]
    """(m,) int64: whose route a column is, or PEAK."""
    chosen: npt.NDArray[np.int64]
    """(m,) int64: the set of segments that the route inspects."""
    cost: FloatArray
    """(m,) float64: of the column."""
    matrix: FloatArray
    """(m, r) float64: the columns."""
    lower: FloatArray
    """(r,) float64: least sum of each row."""
    upper: FloatArray
    """(r,) float64: largest."""


@dataclass(frozen=True, slots=True)
class Proof:
    """What is known of the best plan."""

    bound: float | None
    """No plan costs less; None where not even the relaxation was solved."""
    parts: tuple[int, ...] | None
    """A set of segments for each vehicle, cheaper together than the plan that was known; None without such."""
    nodes: int
    """Of the branch and bound."""


def build_partition(
    instance: Instance,
    subsets: Sequence[SubsetRoutes],
    cost: Cost,
    *,
    ceiling: float,
    grounded: float,
    value: FloatArray,
    least_value: float,
) -> Partition:
    """Return the program whose solutions are the plans that are worth looking at.

    Args:
        instance: the problem.
        subsets: the routes of each vehicle.
        cost: what to minimise.
        ceiling: the cost of a plan that is known.
        grounded: what a vehicle without a visit costs besides its way home.
        value: (n,) float64, of each segment.
        least_value: the value that a plan must inspect; infinite for everything.
    """
    fleet = _group_vehicles_by_kind(instance)
    most = ceiling * (1 + SAME) if cost.function.is_longest_only else np.inf
    routes = [_find_affordable_routes(instance, subsets[vehicles[0]], vehicles[0], most) for vehicles in fleet]
    price = [np.where(chosen > 0, 0.0, grounded) for chosen, _ in routes]
    if not cost.function.is_longest_only:
        price = [
            paid
            + energy
            + cost.function.excess * np.maximum(0.0, energy - instance.vehicles[vehicles[0]].budget_pct) * (chosen == 0)
            for paid, (chosen, energy), vehicles in zip(price, routes, fleet, strict=True)
        ]
    of_peak = cost.function.peak_weight(len(subsets))
    lower, upper = _build_row_limits(len(value), fleet, least_value)
    return Partition(
        fleet=fleet,
        kind=np.concatenate([*(np.full(len(own[0]), kind) for kind, own in enumerate(routes)), [PEAK]]),
        chosen=np.concatenate([*(own[0] for own in routes), [0]]),
        cost=np.concatenate([*price, [of_peak]]),
        matrix=_build_matrix(routes, value, len(subsets)),
        lower=lower,
        upper=upper,
    )


def extract_segment_sets(problem: Partition, columns: npt.NDArray[np.int64]) -> tuple[int, ...]:
    """Return a set of segments for each vehicle from the columns that a solution takes, as often as it does."""
    parts = [0] * sum(len(vehicles) for vehicles in problem.fleet)
    for kind, vehicles in enumerate(problem.fleet):
        own = problem.chosen[columns[problem.kind[columns] == kind]]
        for vehicle, chosen in zip(vehicles, own[own > 0], strict=False):
            parts[vehicle] = int(chosen)
    return tuple(parts)


def prove_optimum(problem: Partition, ceiling: float, ask: Callable[[int], bool]) -> Proof:
    """Return what HiGHS finds out about plans that cost less than ``ceiling``.

    Args:
        problem: the program.
        ceiling: the cost of a plan that is known.
        ask: called again and again with the number of nodes so far; whether to stop.
    """
    import highspy

    every = np.arange(len(problem.cost))
    relaxed = _solve_program(problem, every, ask, integer=False)
    if relaxed.getModelStatus() != highspy.HighsModelStatus.kOptimal:
        return Proof(None, None, 0)
    least = relaxed.getInfo().objective_function_value
    reduced = np.array(relaxed.getSolution().col_dual)
    # The largest load is no choice: it stays.
    kept = every[(least + reduced <= ceiling + SAME * (1 + ceiling)) | (problem.kind == PEAK)]
    branched = _solve_program(problem, kept, ask, integer=True)
    info = branched.getInfo()
    nodes = max(0, int(info.mip_node_count))
    bound = min(ceiling, max(least, info.mip_dual_bound)) if np.isfinite(info.mip_dual_bound) else least
    solution = np.array(branched.getSolution().col_value)
    if len(solution) == 0 or not info.objective_function_value < ceiling - SAME * (1 + ceiling):
        return Proof(bound, None, nodes)
    taken = kept[(solution > 0.5) & (problem.kind[kept] != PEAK)]
    return Proof(bound, extract_segment_sets(problem, taken), nodes)


def _group_vehicles_by_kind(instance: Instance) -> tuple[tuple[int, ...], ...]:
    """Return the vehicles of each kind. One with a way home even without a visit is a kind of its own."""
    groups: dict[tuple[object, ...], list[int]] = {}
    for vehicle, kind in enumerate(compute_vehicle_kinds(instance)):
        key = (kind, vehicle if instance.idle_pct[vehicle] > 0 else None)
        groups.setdefault(key, []).append(vehicle)
    return tuple(tuple(group) for group in groups.values())


def _find_affordable_routes(
    instance: Instance, own: SubsetRoutes, vehicle: int, most: float
) -> tuple[npt.NDArray[np.int64], FloatArray]:
    """Return the sets of segments that a vehicle can inspect for at most ``most``, and the energy of each."""
    energy = own.energy_pct.copy()
    energy[energy > most] = np.inf
    # Without a visit it is what it is, even if the vehicle cannot get home.
    energy[0] = instance.idle_pct[vehicle]
    chosen = np.flatnonzero(np.isfinite(energy))
    return chosen, energy[chosen]


def _build_matrix(
    routes: Sequence[tuple[npt.NDArray[np.int64], FloatArray]], value: FloatArray, vehicles: int
) -> FloatArray:
    """Return (m, r) float64, the columns of all routes and of the largest load.

    Rows: each segment; each kind of vehicle; the value; the load of the route that visits a segment, of vehicles
    without a visit, and on average.
    """
    segments, fleet = len(value), len(routes)
    blocks = []
    for kind, (chosen, energy) in enumerate(routes):
        inside = build_membership_matrix(chosen, segments)
        own = np.zeros((len(chosen), fleet))
        own[:, kind] = 1.0
        load = energy[:, np.newaxis]
        idle = own * load * (chosen == 0)[:, np.newaxis]
        blocks.append(np.hstack([inside, own, (inside @ value)[:, np.newaxis], inside * load, idle, load]))
    peak = [*[0.0] * (segments + fleet + 1), *[-1.0] * (segments + fleet), -float(vehicles)]
    return np.vstack([*blocks, [peak]])


def _build_row_limits(
    segments: int, fleet: Sequence[Sequence[int]], least_value: float
) -> tuple[FloatArray, FloatArray]:
    """Return the limits of all rows: everything is inspected, or as much as ``least_value`` says."""
    counts = [float(len(vehicles)) for vehicles in fleet]
    loads = segments + len(fleet) + 1
    everything = np.isinf(least_value)
    least = [1.0 if everything else -np.inf] * segments
    worth = -np.inf if everything else least_value * (1 - SAME)
    return (
        np.array([*least, *counts, worth, *[-np.inf] * loads]),
        np.array([*[1.0] * segments, *counts, np.inf, *[0.0] * loads]),
    )


def _solve_program(
    problem: Partition, columns: npt.NDArray[np.int64], ask: Callable[[int], bool], *, integer: bool
) -> highspy.Highs:
    """Return HiGHS after it has solved the program with some of its columns, or ``ask`` has stopped it."""
    stopped = ask(0)
    matrix = problem.matrix[columns]
    where, rows = matrix.nonzero()
    solver = highs.build_program(
        problem.cost[columns],
        np.full(len(columns), np.inf),
        (problem.lower, problem.upper),
        (np.searchsorted(where, np.arange(len(columns) + 1)), rows, matrix[where, rows]),
        whole=[kind != PEAK for kind in problem.kind[columns]] if integer else (),
    )

    def on_event(event: highspy.highs.HighsCallbackEvent) -> None:
        nonlocal stopped
        stopped = stopped or ask(max(0, int(event.data_out.mip_node_count)) if integer else 0)
        if stopped:
            event.interrupt()

    (solver.cbMipInterrupt if integer else solver.cbSimplexInterrupt).subscribe(on_event)
    if not stopped:
        solver.run()
    return solver
