"""Necessary conditions: prove that a fleet cannot inspect everything within its budgets."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import numpy.typing as npt

from planner.evaluate import BUDGET_TOLERANCE_PCT
from planner.model import TABLES_UP_TO, Instance
from planner.moves import FloatArray

BoolArray = npt.NDArray[np.bool_]
MATRIX_UP_TO = 1_500
"""Maximum number of segments for bounds over all moves: memory grows with the square."""
ASCENT = 300
"""Iterations of the ascent to a spanning-tree bound."""


def explain_infeasibility(instance: Instance, *, ascent: int = 1) -> str | None:
    """Return why no plan covers everything within the budgets, or None if these conditions do not decide.

    Each vehicle must be able to return, each segment must be within some vehicle's reach, and the total energy of all
    vehicles must not be less than a spanning-tree bound on what any plan needs; a vehicle that can inspect nothing adds
    nothing to the total.

    Args:
        instance: the problem.
        ascent: iterations of that bound; with ``ASCENT`` it is good, and takes some milliseconds for 50 segments.
    """
    if instance.segments == 0:
        return None
    fleet = len(instance.vehicles)
    budget = np.array([vehicle.budget_pct for vehicle in instance.vehicles]) + BUDGET_TOLERANCE_PCT
    start = instance.start_pct.reshape(fleet, -1, 2)
    home = instance.home_pct.reshape(fleet, -1, 2)
    # Any route includes the start of its first visit and the return of its last; they need not be the same visit.
    shortest = start.min(axis=(1, 2)) + home.min(axis=(1, 2))
    useful = shortest <= budget
    for vehicle, stranded in zip(instance.vehicles, np.minimum(instance.idle_pct, shortest) > budget, strict=True):
        if stranded:
            return f"{vehicle.name} cannot get home with {vehicle.budget_pct:.3f} %"
    if instance.segments > MATRIX_UP_TO:
        return None
    reach = (start + home).min(axis=2) <= budget[:, np.newaxis]
    if not reach.any(axis=0).all():
        # With dynamics a route over other visits may be cheaper than the direct one: it avoids extra turns.
        reach = (_least_route_pct(instance) <= budget[:, np.newaxis]).reshape(fleet, -1)
    lost = np.flatnonzero(~reach.any(axis=0))
    if len(lost) > 0:
        return f"segment {int(lost[0])} is out of every vehicle's reach"
    if instance.segments > TABLES_UP_TO:
        return None  # this bound needs a table of all moves
    available = float(budget[useful].sum())
    needed = compute_tree_bound_pct(
        instance, useful, starts=instance.start_pct[useful], homes=instance.home_pct[useful],
        idle=instance.idle_pct[useful], enough=available, ascent=ascent,
    )  # fmt: skip
    if needed > available * (1 + 1e-12):
        return f"everything takes {needed:.3f} % or more, the fleet has {available:.3f} %"
    return None


def _least_route_pct(instance: Instance) -> FloatArray:
    """Return (k, n) float64, a lower bound on the energy of any route of a vehicle that visits a segment."""
    fleet, visits = len(instance.vehicles), 2 * instance.segments
    ways = np.empty((fleet, visits))
    tables = instance.moves.tabulate().table_pct
    for vehicle in range(fleet):
        moves = instance.vehicles[vehicle].consumption * tables[instance.profile[vehicle]]
        into = _shortest_pct(instance.start_pct[vehicle], moves)
        ways[vehicle] = into + _shortest_pct(instance.home_pct[vehicle], moves.T)
    least: FloatArray = ways.reshape(fleet, -1, 2).min(axis=2)
    return least


def _shortest_pct(direct: FloatArray, moves: FloatArray) -> FloatArray:
    """Return (2n,) float64, the energy of the shortest paths to all visits (Bellman and Ford)."""
    shortest = direct
    while True:
        shorter: FloatArray = np.minimum(shortest, (shortest[:, np.newaxis] + moves).min(axis=0))
        if not (shorter < shortest - 1e-12).any():
            return shorter
        shortest = shorter


def compute_tree_bound_pct(
    instance: Instance, useful: BoolArray, *, starts: FloatArray, homes: FloatArray, idle: FloatArray, enough: float,
    once: int | None = None, ascent: int = ASCENT,
) -> float:  # fmt: skip
    """Return the spanning-tree bound for the ``useful`` vehicles; their rows cover all visits.

    Args:
        instance: the problem.
        useful: mask of the vehicles that the bound includes.
        starts: (r, 2n), energy from the vehicle's start to the end of a visit.
        homes: (r, 2n), energy from the end of a visit to the landing place.
        idle: (r,), energy of an unused vehicle.
        enough: stop when the bound exceeds this.
        once: the only vehicle that starts at most once; None if all do.
        ascent: maximum number of iterations.
    """
    # Imported here because it loads numba, which the quick conditions do not need.
    from planner.kernels.proofs import compute_tree_bound

    visits = 2 * instance.segments
    moves = _least_moves_pct(instance, useful)
    segment = np.arange(visits) >> 1
    moves[segment[:, np.newaxis] == segment[np.newaxis]] = np.inf
    entry = np.minimum(moves.min(axis=0), starts.min(axis=0)).reshape(-1, 2).min(axis=1)
    back = np.arange(visits) ^ 1
    # A visit begins at the end point with its own number and ends at the other end point of its segment.
    onward = moves[back] - entry[segment]
    every = range(len(starts))
    bound = compute_tree_bound(
        np.array(np.minimum(onward, onward.T), order="C"),
        np.array(starts - entry[segment], order="C"),
        np.array(homes[:, back], order="C"),
        np.array(idle, dtype=np.float64),
        np.array([once is None or vehicle == once for vehicle in every], dtype=np.int64),
        enough - float(entry.sum()),
        ascent,
    )
    return float(bound + entry.sum()) - 1e-9 * abs(enough)


def bound_window_by_trees_s(instance: Instance) -> float:
    """Return a lower bound of the begin of any plan's re-plan window, from spanning trees.

    If a vehicle is lost at t, its completed work is one open path of at most t, and the others cover the rest within
    their budgets, some in two flights. So t is at least what such paths and flights need beyond those budgets, divided
    by the lost vehicle's maximum consumption per second. Some vehicle flies when a window begins: the bound is the
    least over all vehicles.
    """
    kinds: dict[tuple[object, ...], float] = {}
    for lost, vehicle in enumerate(instance.vehicles):
        kind = (replace(vehicle, name=""), instance.profile[lost], instance.start_pct[lost].tobytes())
        if kind not in kinds:
            kinds[kind] = _bound_loss_by_trees_s(instance, lost)
    return min(kinds.values(), default=0.0)


def _bound_loss_by_trees_s(instance: Instance, lost: int) -> float:
    fleet = len(instance.vehicles)
    consumption = np.array([vehicle.consumption for vehicle in instance.vehicles])[:, np.newaxis]
    again = consumption * instance.depot_pct
    homes = instance.home_pct.copy()
    homes[lost] = 0.0  # its path is open
    others = sum(
        max(0.0, vehicle.budget_pct) + BUDGET_TOLERANCE_PCT
        for number, vehicle in enumerate(instance.vehicles)
        if number != lost
    )
    needed = compute_tree_bound_pct(
        instance, np.ones(fleet, dtype=np.bool_), starts=np.minimum(instance.start_pct, again), homes=homes,
        idle=np.zeros(fleet), enough=2.0 * others, once=lost,
    )  # fmt: skip
    return max(0.0, (needed - others) / _find_most_pct_per_s(instance, lost))


def _find_most_pct_per_s(instance: Instance, vehicle: int) -> float:
    moves, profile = instance.moves.tabulate(), instance.profile[vehicle]
    seconds = np.concatenate([instance.start_s[vehicle], moves.table_s[profile].ravel()])
    used_pct = np.concatenate([
        instance.start_pct[vehicle], instance.vehicles[vehicle].consumption * moves.table_pct[profile].ravel()
    ])  # fmt: skip
    timed = seconds > 0
    return float((used_pct[timed] / seconds[timed]).max(initial=0.0)) or 1.0


def _least_moves_pct(instance: Instance, useful: BoolArray) -> FloatArray:
    """Return (2n, 2n) float64, the least energy from visit to visit over the useful vehicles."""
    tables = instance.moves.tabulate().table_pct
    least = np.full(tables.shape[1:], np.inf)
    for profile, moves in enumerate(tables):
        factors = [
            vehicle.consumption
            for vehicle, own, used in zip(instance.vehicles, instance.profile, useful, strict=True)
            if used and own == profile
        ]
        if factors:
            np.minimum(least, min(factors) * moves, out=least)
    return least
