"""Necessary conditions: when it is certain that a fleet cannot inspect everything within its budgets."""

from __future__ import annotations

import numpy as np

from planner.costs import TABLES_UP_TO
from planner.evaluate import BUDGET_TOLERANCE_PCT
from planner.model import Instance
from planner.moves import FloatArray


def why_impossible(instance: Instance) -> str | None:
    """Return why no plan covers everything within the budgets, or None where these conditions do not tell.

    Each vehicle must get home, each segment must be within some vehicle's reach, and the least energy that any
    plan needs must not be more than the fleet has.
    """
    if instance.segments == 0:
        return None
    fleet = len(instance.vehicles)
    budget = np.array([vehicle.budget_pct for vehicle in instance.vehicles]) + BUDGET_TOLERANCE_PCT
    start = instance.start_pct.reshape(fleet, -1, 2)
    home = instance.home_pct.reshape(fleet, -1, 2)
    shortest = np.minimum(instance.idle_pct, start.min(axis=(1, 2)) + home.min(axis=(1, 2)))
    for vehicle, stranded in zip(instance.vehicles, shortest > budget, strict=True):
        if stranded:
            return f"{vehicle.name} cannot get home with {vehicle.budget_pct:.3f} %"
    reach = start.min(axis=2) + home.min(axis=2) <= budget[:, np.newaxis]
    lost = np.flatnonzero(~reach.any(axis=0))
    if len(lost) > 0:
        return f"segment {int(lost[0])} is out of every vehicle's reach"
    if instance.segments > TABLES_UP_TO:
        return None  # the least total takes a table of all moves
    useful = reach.any(axis=1)
    needed, available = least_total_pct(instance, useful), float(budget[useful].sum())
    if needed > available:
        return f"everything takes {needed:.3f} % or more, the fleet has {available:.3f} %"
    return None


def least_total_pct(instance: Instance, useful: np.ndarray[tuple[int], np.dtype[np.bool_]]) -> float:
    """Return a lower bound on the energy of any plan that covers everything with the ``useful`` vehicles.

    Exactly one move leads into each segment. What all moves into it cost at least is paid in any case; the rest of
    the moves links starts and segments to one tree, so it is at least the minimum spanning tree. The ways home, or
    idle, come on top.
    """
    segments = instance.segments
    start = instance.start_pct[useful].reshape(-1, segments, 2).min(axis=(0, 2))
    between = _least_between_pct(instance, useful)
    np.fill_diagonal(between, np.inf)
    entry = np.minimum(start, between.min(axis=0))
    links = between - entry
    tree = _spanning_tree(start - entry, np.minimum(links, links.T))
    home = instance.home_pct[useful].min(axis=1)
    ways_home = np.minimum(home, instance.idle_pct[useful])
    return float(entry.sum() + tree + ways_home.sum() + (home - ways_home).min())


def _least_between_pct(instance: Instance, useful: np.ndarray[tuple[int], np.dtype[np.bool_]]) -> FloatArray:
    """Return (n, n) float64, the least energy from segment to segment over directions and useful vehicles."""
    segments, every = instance.segments, np.arange(2 * instance.segments)
    least = np.full((segments, segments), np.inf)
    for profile in range(instance.moves.profiles):
        factors = [
            vehicle.consumption
            for vehicle, own, used in zip(instance.vehicles, instance.profile, useful, strict=True)
            if used and own == profile
        ]
        if factors:
            moves = instance.moves.pct(profile, every[:, np.newaxis], every[np.newaxis])
            np.minimum(least, min(factors) * moves.reshape(segments, 2, segments, 2).min(axis=(1, 3)), out=least)
    return least


def _spanning_tree(roots: FloatArray, links: FloatArray) -> float:
    """Return the weight of the minimum spanning tree of a root, joined to i by ``roots[i]``, and all i (Prim)."""
    distance = roots.copy()
    total = 0.0
    for _ in range(len(roots)):
        nearest = int(distance.argmin())
        total += float(distance[nearest])
        distance = np.minimum(distance, links[nearest])
        links[:, nearest] = np.inf
        distance[nearest] = np.inf
    return total
