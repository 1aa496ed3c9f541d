"""Networks of thousands of segments: a first plan along a curve, then a few neighbouring routes at a time.

There is no table of all moves, and no iteration evaluates all routes: a *region* is the set of routes near some
segment, and the ordinary search improves it as a separate instance. A round improves as many regions as there are
starts, in threads; they share no route, so the order in which threads end makes no difference.
"""

from __future__ import annotations

from collections.abc import Sequence
from concurrent.futures import Executor
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from planner.bounds import explain_infeasibility
from planner.evaluate import BUDGET_TOLERANCE_PCT, Cost, Result, cost_of, evaluate, route_energy_pct
from planner.model import BARRED_PCT, Instance, Plan, Route, build_part_instance, renumber_visits, segment_of
from planner.moves import FloatArray
from planner.params import DEFAULT_PARAMS, SearchParams
from planner.plan_search import PlanSearch
from planner.search import Search, run_in_threads
from planner.stop_rules import Iterations, StopRule, Stopwatch

CURVE_BITS = 12
"""Resolution of the Hilbert curve: 4096 x 4096 cells."""
BISECTIONS = 20
"""Halvings of the interval that contains the least common share of the budgets."""


@dataclass(frozen=True, slots=True)
class _Region:
    """A group of vehicles and the segments to distribute among them."""

    vehicles: tuple[int, ...]
    segments: tuple[int, ...]
    cost: Cost


class LargeSearch(Search):
    """One search on a large instance; call only ``run``."""

    def __init__(
        self,
        instance: Instance,
        *,
        cost: Cost,
        seed: int,
        initial: Plan | None,
        all_vehicles: bool,
        watch: Stopwatch,
        starts: int = 1,
        params: SearchParams = DEFAULT_PARAMS,
    ) -> None:
        super().__init__(watch, batch=params.large.spell, starts=starts, impossible=explain_infeasibility(instance))
        self._instance = instance
        self._cost = cost
        self._balances = cost.function.peak > 0 and not cost.function.is_longest_only
        self._all_vehicles = all_vehicles
        self._starts = starts
        self._params = params.large
        self._of_regions = replace(params, annealing=replace(params.annealing, hot=params.large.hot))
        self._chance = np.random.default_rng(seed)
        self._middle_m = (instance.end_m[::2, :2] + instance.end_m[1::2, :2]) / 2
        self._budgets = np.array([vehicle.budget_pct for vehicle in instance.vehicles])
        self._routes: list[tuple[int, ...]] = self._build_first_routes(initial)
        self._energies = np.zeros(len(instance.vehicles))
        self._route_of = np.full(instance.segments, -1, dtype=np.int64)
        self._record_routes(range(len(self._routes)))

    def run(self, stop: StopRule) -> Result:
        """Improve the plan until ``stop`` ends the search."""
        reason = self._run_rounds(stop)
        plan = Plan(
            tuple(Route(vehicle, visits) for vehicle, visits in enumerate(self._routes)),
            tuple(int(segment) for segment in self._find_open_segments()),
        )
        return self._build_result(plan, evaluate(self._instance, plan, self._cost), reason)

    def _build_first_routes(self, initial: Plan | None) -> list[tuple[int, ...]]:
        if initial is None:
            everybody = self._cost.function.is_longest_only or self._all_vehicles
            return split_into_routes(self._instance, sort_along_curve(self._middle_m), everybody=everybody)
        routes = [route.visits for route in initial.routes]
        for vehicle, visits in enumerate(routes):
            if visits and route_energy_pct(self._instance, Route(vehicle, visits)) > self._budgets[vehicle]:
                region = _Region((vehicle,), tuple(segment_of(visit) for visit in visits), Cost.MINSUM)
                routes[vehicle] = self._search_region(region, [visits], seed=0, iterations=0)[0]
        return routes

    def _advance(self, iterations: int, threads: Executor | None = None) -> None:
        regions = self._choose_regions()
        shares = [iterations // len(regions) + int(place < iterations % len(regions)) for place in range(len(regions))]
        seeds = self._chance.integers(0, 2**62, len(regions)).tolist()
        before = self._objective_key()

        def improved(place: int) -> list[tuple[int, ...]]:
            tours = [self._routes[vehicle] for vehicle in regions[place].vehicles]
            return self._search_region(regions[place], tours, seed=seeds[place], iterations=shares[place])

        for region, routes in zip(regions, run_in_threads(threads, improved, range(len(regions))), strict=True):
            # With MinComb, keep the change only if a longer longest route does not outweigh the saving.
            old, cost = [self._routes[vehicle] for vehicle in region.vehicles], self._objective_key()
            self._set_routes(region, routes)
            if self._balances and not self._all_vehicles and self._objective_key() > cost:
                self._set_routes(region, old)
        self._iterations += iterations
        if self._objective_key() < before:
            self._improved_at = self._iterations

    def _search_region(
        self, region: _Region, routes: Sequence[tuple[int, ...]], *, seed: int, iterations: int
    ) -> list[tuple[int, ...]]:
        """Return better routes for a region's vehicles, or the same."""
        number = {segment: place for place, segment in enumerate(region.segments)}
        search = PlanSearch(
            build_part_instance(self._instance, region.vehicles, region.segments),
            cost=region.cost,
            seed=seed,
            initial=Plan(tuple(Route(place, renumber_visits(visits, number)) for place, visits in enumerate(routes))),
            all_vehicles=self._all_vehicles,
            watch=Stopwatch(),
            params=self._of_regions,
        )
        plan = search.run(Iterations(iterations)).plan
        return [renumber_visits(route.visits, region.segments) for route in plan.routes]

    def _set_routes(self, region: _Region, routes: Sequence[tuple[int, ...]]) -> None:
        for vehicle, visits in zip(region.vehicles, routes, strict=True):
            self._routes[vehicle] = visits
        self._route_of[list(region.segments)] = -1
        self._record_routes(region.vehicles)

    def _record_routes(self, vehicles: Sequence[int]) -> None:
        for vehicle in vehicles:
            visits = self._routes[vehicle]
            self._energies[vehicle] = route_energy_pct(self._instance, Route(vehicle, visits))
            self._route_of[[segment_of(visit) for visit in visits]] = vehicle

    def _choose_regions(self) -> list[_Region]:
        """Return disjoint regions, at least one and at most as many as there are starts."""
        taken = np.zeros(len(self._routes), dtype=np.bool_)
        claimed = np.zeros(self._instance.segments, dtype=np.bool_)
        regions: list[_Region] = []
        for place in range(self._starts):
            longest = place == 0 and self._cost.function.peak > 0 and self._chance.random() < 0.5
            seed = self._choose_seed_segment(longest=longest)
            if regions and (claimed[seed] or (self._route_of[seed] >= 0 and taken[self._route_of[seed]])):
                continue
            region = self._build_region(seed, taken, claimed, longest=longest)
            taken[list(region.vehicles)] = True
            claimed[list(region.segments)] = True
            regions.append(region)
        return regions

    def _choose_seed_segment(self, *, longest: bool) -> int:
        """Return the middle of the next region: near an uncovered segment, in the longest route, or anywhere."""
        left = self._find_open_segments()
        if len(left) > 0 and self._chance.random() < 0.5:
            return int(self._chance.choice(left))
        visits = self._routes[int(self._energies.argmax())]
        if longest and visits:
            return segment_of(int(self._chance.choice(visits)))
        return int(self._chance.integers(self._instance.segments))

    def _build_region(
        self, seed: int, taken: npt.NDArray[np.bool_], claimed: npt.NDArray[np.bool_], *, longest: bool
    ) -> _Region:
        """Return the free routes and the open segments nearest to a segment."""
        away = np.hypot(*(self._middle_m - self._middle_m[seed]).T)
        near = np.argsort(away, kind="stable")
        # The vehicle that the middle is locked to usually has its route elsewhere.
        keeper = self._instance.locked.get(seed, -1)
        vehicles = [keeper] if keeper >= 0 and not taken[keeper] else []
        segments = [segment_of(visit) for vehicle in vehicles for visit in self._routes[vehicle]]
        for segment in near.tolist():
            full = len(segments) >= self._params.region
            if (full and len(vehicles) > 1) or len(vehicles) >= self._params.region_routes:
                break
            vehicle = int(self._route_of[segment])
            # A second route may be far away: the open segments up to there would be nearly the whole network.
            if vehicle < 0 and not claimed[segment] and not full:
                segments.append(segment)
            elif vehicle >= 0 and not taken[vehicle] and vehicle not in vehicles:
                vehicles.append(vehicle)
                segments += [segment_of(visit) for visit in self._routes[vehicle]]
        idle = [vehicle for vehicle, visits in enumerate(self._routes) if not visits and not taken[vehicle]]
        if idle:
            vehicles.append(idle[int(self._chance.integers(len(idle)))])
        cost = Cost.MINSUM if self._balances and not longest else self._cost
        return _Region(tuple(sorted(vehicles)), tuple(sorted(set(segments))), cost)

    def _find_open_segments(self) -> npt.NDArray[np.int64]:
        return np.flatnonzero(self._route_of < 0)

    def _objective_key(self) -> tuple[float, float]:
        """Return the uncovered value, then the cost: less is better."""
        left = float(self._instance.value[self._route_of < 0].sum())
        return left, cost_of(self._instance, self._energies.tolist(), self._cost)

    def _rate_best(self) -> tuple[float, int, bool]:
        uncovered = len(self._find_open_segments())
        within = bool(np.all(self._energies <= self._budgets + BUDGET_TOLERANCE_PCT))
        return self._objective_key()[1], uncovered, within and not uncovered


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

    Each vehicle flies as far as its budget allows, or, with ``everybody``, to the least common share of the budgets
    that covers all. What exceeds the full budgets is left out at the end of the order, as are segments locked to one
    vehicle.
    """
    tour = _direct_visits(instance, order[~np.isin(order, list(instance.locked))])
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


def _direct_visits(instance: Instance, order: npt.NDArray[np.int64]) -> npt.NDArray[np.int64]:
    """Return (n,) int64, the visits in order, each begun at the end nearer to the end of the previous one.

    A visit that is barred in that direction is flown from the other end.
    """
    never = instance.start_pct.min(axis=0) >= BARRED_PCT
    tour = np.empty(len(order), dtype=np.int64)
    here = np.array([*instance.landing_m, 0.0])
    for place, segment in enumerate(order.tolist()):
        last = instance.end_m[2 * segment : 2 * segment + 2]
        # Visit v begins where visit v ^ 1 ends.
        away = np.abs(last - here).sum(axis=1)
        visit = 2 * segment + int(away[0] < away[1])
        visit ^= int(never[visit])
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
