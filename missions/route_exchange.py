"""Who flies what, in which order and direction, where vehicles share pylons: so that nobody need stay in its layer.

Where two may meet over the line one has the air there, and the other inspects from its layer (`asked`), unless the
first has left before it comes: then it is let down on its way. Routes of which the sum or the longest is about the same
differ much in who comes when. Nothing is promised by it: who is late finds the other still there.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field

import numpy as np

from missions.estimate import estimate
from missions.flight_model import FlightModel
from missions.geo import FloatArray
from missions.inspection_height import (
    OccupiedAirspace,
    Routes,
    build_airway,
    build_first_paths,
    find_low_segments,
    inspection_ways_m,
    must_leave_layer,
)
from missions.pads import column_radius_m
from missions.routes import build_flight_path
from missions.setup import FlightSetup
from missions.waypoints import FlightPath
from planner import is_reversed, segment_of, visit_of

MOST_VISITS = 300
"""Of all routes together: for more it would take longer than a plan may."""
MOST_PRICED = 3000
MOST_FLOWN = 300
"""Of the routes that are tried, all together: what a second or two is enough for."""

Visit = tuple[str, int]
"""Whose, and its position in its route."""
Visits = dict[str, tuple[int, ...]]


def rearrange_routes(
    setup: FlightSetup,
    routes: Routes,
    models: Mapping[str, FlightModel],
    ahead_s: float,
    cost_of: Callable[[Routes], float],
    may: Callable[[Routes], bool],
) -> dict[str, tuple[int, ...]]:
    """Return routes by which less is inspected from layers.

    Routes are turned around and exchanged, and what would be inspected from a layer is flown at another time or by
    another vehicle: one change after another, each time the cheapest one by which less is inspected from layers.

    Args:
        setup: Heights and pads.
        routes: Visits of the setup's network, by the vehicle's name.
        models: How each of them flies.
        ahead_s: How long before it begins a part of the line a vehicle must be let down to it.
        cost_of: What routes cost; infinity for those that are too dear, or that nobody can fly.
        may: Whether routes that cost little enough are as good in everything else.
    """
    best = {name: tuple(visits) for name, visits in routes.items()}
    if sum(map(len, best.values())) > MOST_VISITS:
        return best
    timetable = RouteTimetable(setup, models, ahead_s)
    high = timetable.find_layer_visits(best)
    priced, flown, going_on = 0, 0, True
    while high and going_on:
        going_on = False
        near = list(itertools.islice(_iterate_neighbours(best, high), MOST_PRICED - priced))
        priced += len(near)
        costs = [cost_of(other) for other in near]
        for number in sorted(range(len(near)), key=costs.__getitem__)[: MOST_FLOWN - flown]:
            if math.isinf(costs[number]):
                break
            flown += 1
            found = timetable.find_layer_visits(near[number])
            if len(found) < len(high) and may(near[number]):
                best, high, going_on = near[number], found, True
                break
    return best


def _iterate_neighbours(routes: Visits, high: list[Visit]) -> Iterator[Visits]:
    """Yield routes that differ by one change; nobody who flies stays on the ground then."""
    for name, visits in routes.items():
        if visits:
            yield {**routes, name: _reverse_visits(visits)}
    for one, other in itertools.combinations(routes, 2):
        for own, others in itertools.product(
            {routes[one], _reverse_visits(routes[one])}, {routes[other], _reverse_visits(routes[other])}
        ):
            yield {**routes, one: others, other: own}
    for name, position in high:
        yield from _iterate_moved_visit(routes, name, position)


def _iterate_moved_visit(routes: Visits, name: str, position: int) -> Iterator[Visits]:
    """Yield routes in which one visit stands at another place."""
    visits, moved = routes[name], routes[name][position : position + 1]
    left = (*visits[:position], *visits[position + 1 :])
    for other, theirs in routes.items():
        rest = left if other == name else theirs
        if left and rest:
            for place, visit in itertools.product(
                range(len(rest) + 1), {one[0] for one in (moved, _reverse_visits(moved))}
            ):
                yield {**routes, name: left, other: (*rest[:place], visit, *rest[place:])}
    for end in range(len(visits)):
        first, last = sorted((end, position))
        yield {**routes, name: (*visits[:first], *_reverse_visits(visits[first : last + 1]), *visits[last + 1 :])}


def _reverse_visits(visits: tuple[int, ...]) -> tuple[int, ...]:
    return tuple(visit_of(segment_of(visit), not is_reversed(visit)) for visit in reversed(visits))


@dataclass(frozen=True, slots=True, eq=False)
class RouteTimetable:
    """When routes come where, if everybody flies as planned; what was reckoned for one stays for the next."""

    setup: FlightSetup
    models: Mapping[str, FlightModel]
    ahead_s: float
    _paths: dict[object, FlightPath] = field(default_factory=dict)
    _ends_s: dict[int, FloatArray] = field(default_factory=dict)
    """By the path's identity."""

    def find_layer_visits(self, routes: Routes) -> list[Visit]:
        """Return what is inspected from layers."""
        paths = build_first_paths(self.setup, routes, made_by=self._path_of)
        ends_s = {name: self._leg_ends_s(path) for name, path in paths.items()}
        high = []
        for name, path in paths.items():
            low = find_low_segments(path, routes[name])
            for number, segment in enumerate(map(segment_of, routes[name])):
                if segment in low or not must_leave_layer(self.setup, name, segment):
                    continue
                # What is flown to is not replaced: the first part of a route is flown as it was uploaded.
                at_s = ends_s[name][_find_last_waypoint(path, number - 1)] - self.ahead_s if number else 0.0
                if number == 0 or _is_closed(self.setup, name, segment, paths, ends_s, at_s):
                    high.append((name, number))
        return high

    def _path_of(
        self, setup: FlightSetup, name: str, visits: tuple[int, ...], low: frozenset[int] = frozenset()
    ) -> FlightPath:
        key = (name, visits, low)
        if key not in self._paths:
            self._paths[key] = build_flight_path(setup, name, visits, low)
        return self._paths[key]

    def _leg_ends_s(self, path: FlightPath) -> FloatArray:
        if id(path) not in self._ends_s:
            legs = estimate(path, self.models[path.vehicle]).legs
            self._ends_s[id(path)] = np.cumsum([leg.duration_s for leg in legs], dtype=np.float64)
        return self._ends_s[id(path)]


def _find_last_waypoint(path: FlightPath, visit: int) -> int:
    """Return the waypoint at the end of a visit."""
    return max(number for number, point in enumerate(path.waypoints) if point.visit == visit)


def _is_closed(
    setup: FlightSetup, name: str, segment: int, paths: Mapping[str, FlightPath], ends_s: Mapping[str, FloatArray],
    at_s: float,
) -> bool:  # fmt: skip
    """Return whether anybody may still be where a vehicle would come down to a segment, from a time on."""
    left = [
        build_airway(setup, path, int(np.searchsorted(ends_s[other], at_s)))
        for other, path in paths.items()
        if other != name
    ]
    radius_m = column_radius_m(setup.inspection.layer_m)
    return bool(
        OccupiedAirspace(setup, left).find_closed_tracks(name, inspection_ways_m(setup, segment), radius_m).any()
    )
