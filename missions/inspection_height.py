"""Choose the vehicles that may inspect below their own layers, at the requested distance, safely at any timing.

A vehicle that descends to the line reserves the air between the line and its own layer, along everything it inspects
there: it descends at one end, climbs at the other, and its RTL begins with a climb from any place between. That air is
a wall. No vehicle of a layer below may cross it, in a mission or on a straight RTL, and walls keep their distance from
each other; a vehicle above it is at least one layer away. So nothing here depends on timing: a vehicle may be late,
silent or lost.

Where the layers follow hills, RTL heights are stacked above all layers (`Layers.return_up_m`) and cross no wall.

Where vehicles share pylons, the assignment, order and direction of segments decide which vehicles must stay in their
layers: routes with about the same sum or maximum differ a lot in when each vehicle passes. So routes are rearranged.
Where two could meet over the line, one reserves the air there and the other inspects from its layer, unless the first
has left before it arrives: then it is cleared to descend during the flight. This is not guaranteed: a late vehicle
finds the other still there.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache

import numpy as np

from missions.flight_model import SAME_PLACE_M, FlightModel, estimate
from missions.geo import BoolArray, FloatArray
from missions.geometry import is_in_triangles, leg_distances_m, wall_distances_m
from missions.pads import column_radius_m
from missions.routes import build_flight_path
from missions.setup import FlightSetup
from missions.shortest_ways import Obstacle
from missions.waypoints import FlightPath, Phase, legs_m
from planner import is_reversed, segment_of, visit_of

Routes = Mapping[str, Sequence[int]]
PathMaker = Callable[..., FlightPath]
"""Signature of `build_flight_path`."""
NOBODY: frozenset[str] = frozenset()
ROUNDING_M = 1e-3
"""Tolerance; waypoint coordinates are rounded to less."""
AT_ONCE = 200_000
"""Pairs of legs compared in one step: 50 MB."""
MOST_VISITS = 300
"""Most visits of all routes together; more would exceed the time for planning."""
MOST_PRICED = 3000
MOST_FLOWN = 300
"""Most flight paths tried in all: one to two seconds."""
Visit = tuple[str, int]
"""Vehicle, and position in its route."""
Visits = dict[str, tuple[int, ...]]


@dataclass(frozen=True, slots=True, eq=False)
class Airway:
    """Legs that one vehicle may fly: of a mission, or of its remainder."""

    vehicle: str
    legs_m: FloatArray
    """(n, 2, 3) float64."""
    below_m: FloatArray
    """(n, 2) float64: depth below the vehicle's own layer at both ends of a leg."""
    for_now: bool = False
    """Whether it is flown only until the vehicle has its new mission, before the vehicles below it have theirs."""

    @property
    def over_ground_m(self) -> FloatArray:
        """(n, 2, 2) float64: horizontal legs."""
        return self.legs_m[:, :, :2]

    @property
    def walls_m(self) -> FloatArray:
        """(n,) float64: height of each leg's wall above it; 0 where it is flown in the vehicle's layer."""
        return np.asarray(self.below_m.max(axis=1, initial=0.0))

    def to_layer(self) -> Airway:
        """Return the same legs flown in the vehicle's layer, as during RTL from any place."""
        legs_m = self.legs_m.copy()
        legs_m[:, :, 2] += self.below_m
        return replace(self, legs_m=legs_m, below_m=np.zeros_like(self.below_m))

    @property
    def has_wall(self) -> BoolArray:
        """(n,) whether a leg has a wall, or connects a line and the layer."""
        return np.asarray(self.walls_m > 0)


def build_airway(setup: FlightSetup, path: FlightPath, first: int = 0) -> Airway:
    """Return the legs that a vehicle may fly of a path.

    Args:
        setup: Heights and pads.
        path: Its flight.
        first: Index of its current waypoint: earlier legs are complete.
    """
    if first >= len(path.waypoints):
        return Airway(path.vehicle, np.zeros((0, 2, 3)), np.zeros((0, 2)))
    legs = legs_m(path, setup.frame, setup.frame.up_m(setup.pad_of(path.vehicle).alt_m))
    below_m = np.array([0.0, *(point.below_m for point in path.waypoints)])
    return Airway(path.vehicle, legs[first:], np.column_stack((below_m[:-1], below_m[1:]))[first:])


def build_first_paths(
    setup: FlightSetup, routes: Routes, stays: Collection[str] = NOBODY, made_by: PathMaker = build_flight_path
) -> dict[str, FlightPath]:
    """Return the whole flight of every vehicle with a route.

    Args:
        setup: Heights and pads.
        routes: Visits of the setup's network, by vehicle name.
        stays: Vehicles that inspect in their layers, because after a link loss nothing ensures that they leave the
            line.
        made_by: Builds the path of a vehicle's visits; callers that try many routes pass one with a cache.
    """
    paths = {name: made_by(setup, name, visits) for name, visits in routes.items() if visits}
    if not setup.inspection.same_distance:
        return paths
    low = select_low_segments(setup, routes, [build_airway(setup, path) for path in paths.values()], stays)
    return {name: made_by(setup, name, routes[name], low[name]) if low[name] else path for name, path in paths.items()}


def find_low_segments(path: FlightPath, visits: Sequence[int]) -> frozenset[int]:
    """Return the segments of its visits that a path inspects below its vehicle's layer."""
    return frozenset(segment_of(visits[visit]) for visit in _find_low_visits(path))


def _find_low_visits(path: FlightPath) -> frozenset[int]:
    return frozenset(
        point.visit
        for point in path.waypoints
        if point.visit is not None and point.below_m > 0 and (point.phase is Phase.INSPECT or point.captures)
    )


def visit_distances_m(setup: FlightSetup, path: FlightPath, visits: Sequence[int]) -> tuple[float, ...]:
    """Return the distance of each of a path's visits, increased by the excess height where it is too high."""
    low, offset_m = _find_low_visits(path), setup.layers.offset_m(path.vehicle)
    return tuple(
        setup.inspection.height_m + (0.0 if number in low else offset_m + _viewpoint_depth_m(setup, segment_of(visit)))
        for number, visit in enumerate(visits)
    )


def segment_distances_m(setup: FlightSetup, path: FlightPath, visits: Sequence[int]) -> dict[int, float]:
    """Return the distance at which a path inspects each segment of its visits; the last one if it is visited twice."""
    return dict(zip(map(segment_of, visits), visit_distances_m(setup, path, visits), strict=True))


def _viewpoint_depth_m(setup: FlightSetup, segment: int) -> float:
    """Return the depth below the common surface of a pylon's lowest viewpoint; 0 for a span."""
    look = setup.looks.pylons.get(segment)
    return 0.0 if look is None else look.deepest_m


def must_leave_layer(setup: FlightSetup, vehicle: str, segment: int) -> bool:
    """Return whether a vehicle must leave its layer to inspect a segment as requested."""
    return setup.layers.offset_m(vehicle) + _viewpoint_depth_m(setup, segment) > 0


def select_low_segments(
    setup: FlightSetup,
    routes: Routes,
    taken: Sequence[Airway],
    stays: Collection[str] = NOBODY,
    begins_m: Mapping[str, tuple[float, float]] | None = None,
) -> dict[str, frozenset[int]]:
    """Return the segments of its route that each vehicle may inspect below its layer.

    The lowest layer is at the requested height itself: its vehicle needs to descend only to viewpoints below it. Of
    each continuous inspection only the longest free stretch is used, so that no vehicle climbs and descends more often
    than priced.

    Args:
        setup: Heights and pads.
        routes: New visits, by vehicle name.
        taken: Everything that any vehicle may fly: the new routes in their layers, and previous missions, possibly
            still on board.
        stays: Vehicles that inspect in their layers.
        begins_m: By name: east and north of vehicles that are below their layer when their route begins.
    """
    order = setup.layers.vehicles
    radius_m = column_radius_m(setup.inspection.layer_m)
    closed = OccupiedAirspace(setup, taken)
    low: dict[str, frozenset[int]] = {name: frozenset() for name in routes}
    for name in order:
        visits = list(routes.get(name, ()))
        down = [number for number, visit in enumerate(visits) if must_leave_layer(setup, name, segment_of(visit))]
        if name in stays or not down:
            continue
        parts_m = [inspection_ways_m(setup, segment_of(visits[number])) for number in down]
        met = closed.find_closed_tracks(name, np.concatenate(parts_m), radius_m)
        ends = np.cumsum([len(part_m) for part_m in parts_m])[:-1]
        free = np.zeros(len(visits), dtype=np.bool_)
        free[down] = [not part.any() for part in np.split(met, ends)]
        chosen = _find_free_stretches(setup, visits, free, None if begins_m is None else begins_m.get(name))
        low[name] = frozenset(segment_of(visits[number]) for number in chosen)
        if chosen:
            closed.add_walls(name, np.concatenate([inspection_ways_m(setup, segment) for segment in sorted(low[name])]))
    return low


def inspection_ways_m(setup: FlightSetup, segment: int) -> FloatArray:
    """Return (n, 2, 2) horizontal legs of a segment's inspection: its track, or from viewpoint to viewpoint."""
    look = setup.looks.pylons.get(segment)
    if look is None:
        return setup.tracks_m[[segment]]
    places_m = np.array([point.place_m for point in look.points])
    return np.stack((places_m[:-1], places_m[1:]), axis=1)


def check_inspection_airspace(setup: FlightSetup, taken: Sequence[Airway]) -> list[str]:
    """Return messages on vehicles too near to the air in which another descends to the line; empty if there are none.

    Args:
        setup: Heights and pads.
        taken: Everything that any vehicle may fly. Legs of one vehicle are not checked against each other.
    """
    keep_m = setup.inspection.layer_m - ROUNDING_M
    found = []
    for owner, other in itertools.permutations(taken, 2):
        if owner.vehicle == other.vehicle or not owner.has_wall.any():
            continue
        near_m, words = _find_nearest_airway(setup, owner, other)
        if near_m < keep_m:
            found.append(
                f"{other.vehicle} {words} comes within {near_m:.2f} m of where {owner.vehicle} goes down to the line, "
                f"{setup.inspection.layer_m:g} m expected"
            )
    return found


def build_wall_obstacles(setup: FlightSetup, vehicle: str, taken: Sequence[Airway]) -> tuple[Obstacle, ...]:
    """Return the obstacles for a vehicle's paths: those of the other vehicles' walls that reach above its layer."""
    order, radius_m = setup.layers.vehicles, column_radius_m(setup.inspection.layer_m)
    found: dict[tuple[tuple[float, float], ...], None] = {}
    for one in taken:
        if order.index(one.vehicle) > order.index(vehicle):
            for begin, end in one.over_ground_m[one.has_wall].round(2).tolist():
                found[tuple(dict.fromkeys((tuple(begin), tuple(end))))] = None
    return tuple(Obstacle((line,), radius_m, is_line=True) for line in found)


class OccupiedAirspace:
    """The air that is not free for a vehicle that descends to the line."""

    def __init__(self, setup: FlightSetup, taken: Sequence[Airway]) -> None:
        self._setup, self._taken = setup, taken
        self._new_walls: list[tuple[str, FloatArray]] = []

    def add_walls(self, vehicle: str, tracks_m: FloatArray) -> None:
        """Add new walls."""
        self._new_walls.append((vehicle, tracks_m))

    def find_closed_tracks(self, vehicle: str, tracks_m: FloatArray, radius_m: float) -> BoolArray:
        """Return (n,) whether a vehicle must not descend to each of (n, 2, 2) tracks."""
        layers, met = self._setup.layers, np.zeros(len(tracks_m), dtype=np.bool_)
        pads_m = {
            pad.vehicle: np.array([pad.east_m, pad.north_m]) for pad in self._setup.pads if pad.vehicle != vehicle
        }
        near = [np.broadcast_to(pad_m, (1, 2, 2)) for pad_m in pads_m.values()]
        near += [walls_m for name, walls_m in self._new_walls if name != vehicle]
        for one in self._taken:
            flies_above = layers.vehicles.index(one.vehicle) > layers.vehicles.index(vehicle)
            if one.vehicle == vehicle or (flies_above and one.for_now):
                continue
            near.append(one.over_ground_m[one.has_wall] if flies_above else one.over_ground_m)
            if not flies_above and layers.returns_in_layers:
                met |= find_tracks_near_returns(tracks_m, one.over_ground_m, pads_m[one.vehicle], radius_m)
        for taken_m in near:
            met |= find_near_tracks(tracks_m, taken_m, radius_m)
        return met


def find_near_tracks(tracks_m: FloatArray, legs_m: FloatArray, radius_m: float) -> BoolArray:
    """Return (n,) whether (n, 2, 2) tracks come within a radius of any of (m, 2, 2) legs, horizontally."""
    met = np.zeros(len(tracks_m), dtype=np.bool_)
    if not len(tracks_m) or not len(legs_m):
        return met
    low_m, high_m = tracks_m.min(axis=(0, 1)) - radius_m, tracks_m.max(axis=(0, 1)) + radius_m
    beside = ((legs_m.max(axis=1) >= low_m) & (legs_m.min(axis=1) <= high_m)).all(axis=1)
    legs_m, step = legs_m[beside], max(1, AT_ONCE // len(tracks_m))
    for first in range(0, len(legs_m), step):
        met |= (leg_distances_m(tracks_m, legs_m[first : first + step]) < radius_m).any(axis=1)
    return met


def find_tracks_near_returns(tracks_m: FloatArray, legs_m: FloatArray, pad_m: FloatArray, radius_m: float) -> BoolArray:
    """Return (n,) whether a straight RTL from anywhere on (m, 2, 2) legs comes too near to (n, 2, 2) tracks."""
    met = np.zeros(len(tracks_m), dtype=np.bool_)
    pads_m = np.broadcast_to(pad_m, (len(legs_m), 2))
    for end in (0, 1):
        met |= find_near_tracks(tracks_m, np.stack((legs_m[:, end], pads_m), axis=1), radius_m)
    corners_m = np.stack((legs_m[:, 0], legs_m[:, 1], pads_m), axis=1)
    return np.asarray(met | is_in_triangles(tracks_m[:, 0], corners_m).any(axis=1))


def _find_nearest_airway(setup: FlightSetup, owner: Airway, other: Airway) -> tuple[float, str]:
    """Return how near another vehicle comes to a vehicle's walls, and on which kind of leg."""
    walls = owner.has_wall
    bottoms_m, tops_m = owner.legs_m[walls], owner.walls_m[walls]
    upright = np.hypot(*(bottoms_m[:, 1, :2] - bottoms_m[:, 0, :2]).T) < SAME_PLACE_M
    # A climb or descent is itself its whole wall.
    least = (math.inf, "")
    if len(other.legs_m):
        apart_m = wall_distances_m(bottoms_m, np.where(upright, 0.0, tops_m), other.legs_m).min()
        least = min(least, (float(apart_m), "on its mission"))
        if other.has_wall.any():
            level = leg_distances_m(bottoms_m[:, :, :2], other.over_ground_m[other.has_wall])
            least = min(least, (float(level.min()), "on the line"))
    order = setup.layers.vehicles
    lower = order.index(other.vehicle) < order.index(owner.vehicle)
    if lower and setup.layers.returns_in_layers and least[0] >= setup.inspection.layer_m:
        pad = setup.pad_of(other.vehicle)
        pad_m = np.array([pad.east_m, pad.north_m])
        keep_m = setup.inspection.layer_m - ROUNDING_M
        if find_tracks_near_returns(bottoms_m[:, :, :2], other.over_ground_m, pad_m, keep_m).any():
            return 0.0, "on its own way home"
    return least


def _find_free_stretches(
    setup: FlightSetup, visits: Sequence[int], free: BoolArray, begin_m: tuple[float, float] | None
) -> list[int]:
    """Return the longest free stretch of each continuous inspection, as positions among the visits."""
    lengths_m = setup.network.lengths_m
    chosen: list[int] = []
    for chain, follows in _iterate_chains(setup, visits, begin_m):
        runs = [list(run) for is_free, run in itertools.groupby(chain, lambda number: bool(free[number])) if is_free]
        if follows:  # already below: a stretch not at the beginning would add a climb and a descent
            runs = [run for run in runs if run[0] == chain[0]]
        if runs:
            chosen += max(runs, key=lambda run: sum(lengths_m[segment_of(visits[number])] for number in run))
    return chosen


def _iterate_chains(
    setup: FlightSetup, visits: Sequence[int], begin_m: tuple[float, float] | None
) -> Iterator[tuple[list[int], bool]]:
    """Yield each continuous inspection, and whether it starts with the vehicle already below its layer.

    A pylon inspection always begins and ends in the layer.
    """
    chain: list[int] = []
    follows, here_m = False, begin_m
    for number, visit in enumerate(visits):
        if segment_of(visit) in setup.looks.pylons:
            if chain:
                yield chain, follows
            yield [number], False
            chain, here_m = [], None
            continue
        first_m, last_m = setup.tracks_m[segment_of(visit)][:: -1 if is_reversed(visit) else 1].tolist()
        joined = here_m is not None and math.dist(here_m, first_m) <= SAME_PLACE_M
        if chain and not joined:
            yield chain, follows
            chain = []
        if not chain:
            follows = joined
        chain.append(number)
        here_m = (last_m[0], last_m[1])
    if chain:
        yield chain, follows


def rearrange_routes(
    setup: FlightSetup,
    routes: Routes,
    models: Mapping[str, FlightModel],
    ahead_s: float,
    cost_of: Callable[[Routes], float],
    may: Callable[[Routes], bool],
) -> dict[str, tuple[int, ...]]:
    """Return routes with fewer inspections from layers.

    Routes are reversed and exchanged, and segments inspected from a layer are moved to another time or another vehicle:
    one change at a time, always the cheapest one that reduces the inspections from layers.

    Args:
        setup: Heights and pads.
        routes: Visits of the setup's network, by vehicle name.
        models: Their flight models.
        ahead_s: How long before a part of the line begins a vehicle must be cleared to descend.
        cost_of: Returns the cost of routes; infinity for those that cost too much, or that no vehicle can fly.
        may: Returns whether routes of acceptable cost are as good in every other respect.
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
    """Yield routes that differ by one change; each vehicle with a route keeps at least one visit."""
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
    """Yield routes in which one visit is moved."""
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


class RouteTimetable:
    """Times at which routes reach each place if all vehicles fly as planned; results are cached."""

    def __init__(self, setup: FlightSetup, models: Mapping[str, FlightModel], ahead_s: float) -> None:
        self._setup, self._models, self._ahead_s = setup, models, ahead_s
        self._build_path, self._leg_ends_s = cache(build_flight_path), cache(self._estimate_leg_ends_s)

    def find_layer_visits(self, routes: Routes) -> list[Visit]:
        """Return the visits inspected from layers."""
        paths = build_first_paths(self._setup, routes, made_by=self._build_path)
        ends_s = {name: self._leg_ends_s(path) for name, path in paths.items()}
        high = []
        for name, path in paths.items():
            low = find_low_segments(path, routes[name])
            for number, segment in enumerate(map(segment_of, routes[name])):
                if segment in low or not must_leave_layer(self._setup, name, segment):
                    continue
                # A waypoint in progress is not replaced: the first part of a route is flown as uploaded.
                before = [at for at, point in enumerate(path.waypoints) if point.visit == number - 1]
                at_s = ends_s[name][before[-1]] - self._ahead_s if number else 0.0
                if number == 0 or _is_closed(self._setup, name, segment, paths, ends_s, at_s):
                    high.append((name, number))
        return high

    def _estimate_leg_ends_s(self, path: FlightPath) -> FloatArray:
        legs = estimate(path, self._models[path.vehicle]).legs
        return np.cumsum([leg.duration_s for leg in legs], dtype=np.float64)


def _is_closed(
    setup: FlightSetup, name: str, segment: int, paths: Mapping[str, FlightPath], ends_s: Mapping[str, FloatArray],
    at_s: float,
) -> bool:  # fmt: skip
    """Return whether a vehicle may still be where another would descend to a segment, from a time on."""
    left = [
        build_airway(setup, path, int(np.searchsorted(ends_s[other], at_s)))
        for other, path in paths.items()
        if other != name
    ]
    radius_m = column_radius_m(setup.inspection.layer_m)
    return bool(
        OccupiedAirspace(setup, left).find_closed_tracks(name, inspection_ways_m(setup, segment), radius_m).any()
    )
