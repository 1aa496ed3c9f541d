"""Pieces of large instances: an order along a curve, routes cut from it, some vehicles and segments as an instance."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from planner.model import Instance, visit_of
from planner.moves import FloatArray

CURVE_BITS = 12
"""Fineness of the Hilbert curve: 4096 x 4096 cells."""
BISECTIONS = 20
"""Halvings of the interval in which the least common share of the budgets lies."""


def sort_along_curve(places_m: FloatArray) -> npt.NDArray[np.int64]:
    """Return (n,) int64, the numbers of the places (n, 2) in the order of a Hilbert curve through them.

    The conversion is that of Skilling (2004, doi 10.1063/1.1751381) for two dimensions.
    """
    low = places_m.min(axis=0)
    extent = max(float((places_m.max(axis=0) - low).max()), 1e-9)
    cells = ((places_m - low) / extent * (2**CURVE_BITS - 1)).astype(np.int64)
    x, y = cells[:, 0].copy(), cells[:, 1].copy()
    distance = np.zeros(len(cells), dtype=np.int64)
    for bit in reversed(range(CURVE_BITS)):
        side = 1 << bit
        right, upper = (x & side) > 0, (y & side) > 0
        distance += side * side * ((3 * right.astype(np.int64)) ^ upper.astype(np.int64))
        flip = ~upper & right
        x, y = np.where(flip, side - 1 - (x & (side - 1)), x), np.where(flip, side - 1 - (y & (side - 1)), y)
        x, y = np.where(upper, x, y), np.where(upper, y, x)
    return np.argsort(distance, kind="stable")


def split_into_routes(instance: Instance, order: npt.NDArray[np.int64], *, everybody: bool) -> list[tuple[int, ...]]:
    """Return routes for all vehicles: the order cut into pieces.

    Vehicles fly as far as their budgets go, or, if ``everybody`` is to share, to the least common share of them that
    does. What even the whole budgets do not carry is left out at the end of the order.
    """
    tour = _direct_visits(instance, order)
    low, high = 0.0, 1.0
    routes = _fill_routes(instance, tour, high)
    if not everybody or sum(map(len, routes)) < len(tour):
        return routes
    for _ in range(BISECTIONS):
        share = (low + high) / 2
        trial = _fill_routes(instance, tour, share)
        if sum(map(len, trial)) == len(tour):
            high, routes = share, trial
        else:
            low = share
    return routes


def build_part_instance(instance: Instance, vehicles: Sequence[int], segments: Sequence[int]) -> Instance:
    """Return some vehicles and segments of an instance as an instance, numbered anew in the order given."""
    visits = [visit_of(segment, reverse) for segment in segments for reverse in (False, True)]
    rows = np.ix_(vehicles, visits)
    fleet = list(vehicles)
    return Instance(
        vehicles=tuple(instance.vehicles[vehicle] for vehicle in vehicles),
        profile=tuple(instance.profile[vehicle] for vehicle in vehicles),
        moves=instance.moves.select_visits(visits),
        start_s=instance.start_s[rows],
        home_s=instance.home_s[rows],
        idle_s=instance.idle_s[fleet],
        start_pct=instance.start_pct[rows],
        home_pct=instance.home_pct[rows],
        idle_pct=instance.idle_pct[fleet],
        depot_s=instance.depot_s[rows],
        depot_pct=instance.depot_pct[rows],
        value=instance.value[list(segments)],
        end_m=instance.end_m[visits],
        landing_m=instance.landing_m,
        answer_s=instance.answer_s,
    )


def _direct_visits(instance: Instance, order: npt.NDArray[np.int64]) -> npt.NDArray[np.int64]:
    """Return (n,) int64, the visits in an order, each begun at the end that is nearer to where the last one ended."""
    tour = np.empty(len(order), dtype=np.int64)
    here = np.array([*instance.landing_m, 0.0])
    for place, segment in enumerate(order.tolist()):
        last = instance.end_m[2 * segment : 2 * segment + 2]
        # Visit v begins where visit v ^ 1 ends.
        away = np.abs(last - here).sum(axis=1)
        visit = 2 * segment + int(away[0] < away[1])
        tour[place] = visit
        here = instance.end_m[visit]
    return tour


def _fill_routes(instance: Instance, tour: npt.NDArray[np.int64], share: float) -> list[tuple[int, ...]]:
    """Return the tour cut into routes that take ``share`` of the budgets, one vehicle after the other."""
    sums = [
        np.concatenate([[0.0], np.cumsum(instance.moves.pct(profile, tour[:-1], tour[1:]))])
        for profile in range(instance.moves.profiles)
    ]
    routes: list[tuple[int, ...]] = []
    begin = 0
    for number, vehicle in enumerate(instance.vehicles):
        if begin == len(tour):
            routes.append(())
            continue
        along = vehicle.consumption * (sums[instance.profile[number]][begin:] - sums[instance.profile[number]][begin])
        energy = instance.start_pct[number, tour[begin]] + along + instance.home_pct[number, tour[begin:]]
        over = np.flatnonzero(energy > share * vehicle.budget_pct)
        end = begin + (int(over[0]) if len(over) > 0 else len(energy))
        routes.append(tuple(tour[begin:end].tolist()))
        begin = end
    return routes
