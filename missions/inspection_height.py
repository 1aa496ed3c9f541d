"""Who may inspect at the asked distance, below its own layer, without meeting anybody there whatever the timing.

A vehicle that comes down to the line has the air between the line and its own layer for itself, along the whole of what
it inspects there: it comes down at one end, goes up at the other, and its RTL begins with a climb from any place
between. That air is a wall. Nobody below that layer may cross it, on a mission or straight home, and walls keep away
from each other; who flies above it is a layer away as ever. So nothing here depends on when anybody flies: a vehicle
may be late, silent or lost.

Where the layers follow hills, returns are stacked above all layers (`Layers.return_up_m`) and cross no wall.

Where vehicles share pylons it depends on who flies what, in which order and direction, who need stay in its layer:
routes of which the sum or the longest is about the same differ much in who comes when. So they are rearranged. Where
two may meet over the line one has the air there, and the other inspects from its layer, unless the first has left
before it comes: then it is let down on its way. Nothing is promised by that: who is late finds the other still there.
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
"""`build_flight_path`, or what answers like it."""
NOBODY: frozenset[str] = frozenset()
ROUNDING_M = 1e-3
"""Tolerance; coordinates of waypoints are rounded to less."""
AT_ONCE = 200_000
"""Pairs of legs compared in one step: 50 MB."""
MOST_VISITS = 300
"""Most visits of all routes together; more would take longer than a plan may."""
MOST_PRICED = 3000
MOST_FLOWN = 300
"""Most flight paths tried in all: one to two seconds."""
Visit = tuple[str, int]
"""Vehicle, and position in its route."""
Visits = dict[str, tuple[int, ...]]


@dataclass(frozen=True, slots=True, eq=False)
class Airway:
    """What one vehicle may fly: the legs of a mission, or of what is left of it."""

    vehicle: str
    legs_m: FloatArray
    """(n, 2, 3) float64."""
    below_m: FloatArray
    """(n, 2) float64: depth below the vehicle's own layer at both ends of a leg."""
    for_now: bool = False
    """Whether it is flown only until the vehicle has its new mission, before the vehicles below it have theirs."""

    @property
    def over_ground_m(self) -> FloatArray:
        """(n, 2, 2) float64: the legs seen from above."""
        return self.legs_m[:, :, :2]

    @property
    def walls_m(self) -> FloatArray:
        """(n,) float64: how high a leg's wall reaches over it; 0 where it is flown in the vehicle's layer."""
        return np.asarray(self.below_m.max(axis=1, initial=0.0))

    def to_layer(self) -> Airway:
        """Return the same flown in the vehicle's layer: as it is on its way home, wherever that began."""
        legs_m = self.legs_m.copy()
        legs_m[:, :, 2] += self.below_m
        return replace(self, legs_m=legs_m, below_m=np.zeros_like(self.below_m))

    @property
    def has_wall(self) -> BoolArray:
        """(n,) whether a leg has a wall, or leads between a line and the layer."""
        return np.asarray(self.walls_m > 0)


def build_airway(setup: FlightSetup, path: FlightPath, first: int = 0) -> Airway:
    """Return what a vehicle may fly of a path.

    Args:
        setup: Heights and pads.
        path: Its flight.
        first: The waypoint that it flies to: legs before that are over.
    """
    if first >= len(path.waypoints):
        return Airway(path.vehicle, np.zeros((0, 2, 3)), np.zeros((0, 2)))
    legs = legs_m(path, setup.frame, setup.frame.up_m(setup.pad_of(path.vehicle).alt_m))
    below_m = np.array([0.0, *(point.below_m for point in path.waypoints)])
    return Airway(path.vehicle, legs[first:], np.column_stack((below_m[:-1], below_m[1:]))[first:])


def build_first_paths(
    setup: FlightSetup, routes: Routes, stays: Collection[str] = NOBODY, made_by: PathMaker = build_flight_path
) -> dict[str, FlightPath]:
    """Return the whole flight of every vehicle that has something to do.

    Args:
        setup: Heights and pads.
        routes: Visits of the setup's network, by the vehicle's name.
        stays: Vehicles that inspect in their layers: nobody knows that they leave the line when they are lost.
        made_by: What makes the path of a vehicle's visits; who tries many routes keeps those that it has made.
    """
    paths = {name: made_by(setup, name, visits) for name, visits in routes.items() if visits}
    if not setup.inspection.same_distance:
        return paths
    low = select_low_segments(setup, routes, [build_airway(setup, path) for path in paths.values()], stays)
    return {name: made_by(setup, name, routes[name], low[name]) if low[name] else path for name, path in paths.items()}


def find_low_segments(path: FlightPath, visits: Sequence[int]) -> frozenset[int]:
    """Return which segments of its visits a path inspects below its vehicle's layer."""
    return frozenset(segment_of(visits[visit]) for visit in _find_low_visits(path))


def _find_low_visits(path: FlightPath) -> frozenset[int]:
    return frozenset(
        point.visit
        for point in path.waypoints
        if point.visit is not None and point.below_m > 0 and (point.phase is Phase.INSPECT or point.captures)
    )


def visit_distances_m(setup: FlightSetup, path: FlightPath, visits: Sequence[int]) -> tuple[float, ...]:
    """Return at which distance a path makes each of its visits; one from too high by what it is too high."""
    low, offset_m = _find_low_visits(path), setup.layers.offset_m(path.vehicle)
    return tuple(
        setup.inspection.height_m + (0.0 if number in low else offset_m + _viewpoint_depth_m(setup, segment_of(visit)))
        for number, visit in enumerate(visits)
    )


def segment_distances_m(setup: FlightSetup, path: FlightPath, visits: Sequence[int]) -> dict[int, float]:
    """Return at which distance a path inspects each segment of its visits, the last time if it comes there twice."""
    return dict(zip(map(segment_of, visits), visit_distances_m(setup, path, visits), strict=True))


def _viewpoint_depth_m(setup: FlightSetup, segment: int) -> float:
    """Return how far below the common surface the lowest viewpoint of a pylon lies; 0 for a span."""
    look = setup.looks.pylons.get(segment)
    return 0.0 if look is None else look.deepest_m


def must_leave_layer(setup: FlightSetup, vehicle: str, segment: int) -> bool:
    """Return whether a vehicle has to leave its layer to inspect a segment as asked."""
    return setup.layers.offset_m(vehicle) + _viewpoint_depth_m(setup, segment) > 0


def select_low_segments(
    setup: FlightSetup,
    routes: Routes,
    taken: Sequence[Airway],
    stays: Collection[str] = NOBODY,
    begins_m: Mapping[str, tuple[float, float]] | None = None,
) -> dict[str, frozenset[int]]:
    """Return which segments of its route each vehicle may inspect below its layer.

    The lowest layer is at the asked height itself: who has it needs none, but to viewpoints below it. Of what is
    inspected in one go it is one stretch, the longest: so nobody goes up and down more often than it is priced with.

    Args:
        setup: Heights and pads.
        routes: New visits, by the vehicle's name.
        taken: All that anybody may fly: the new routes in their layers, and what was on board before, or still is.
        stays: Vehicles that inspect in their layers.
        begins_m: Where vehicles are below their layer when their route begins, east and north, by name.
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
    """Return (n, 2, 2) where a segment is inspected, seen from above: its track, or from viewpoint to viewpoint."""
    look = setup.looks.pylons.get(segment)
    if look is None:
        return setup.tracks_m[[segment]]
    places_m = np.array([point.place_m for point in look.points])
    return np.stack((places_m[:-1], places_m[1:]), axis=1)


def check_inspection_airspace(setup: FlightSetup, taken: Sequence[Airway]) -> list[str]:
    """Return in words who comes too near to the air in which another goes down to the line; empty if nobody does.

    Args:
        setup: Heights and pads.
        taken: All that anybody may fly. Legs of one vehicle do not meet each other.
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
    """Return what a vehicle's ways lead around: the walls, among what others may fly, that reach above its layer."""
    order, radius_m = setup.layers.vehicles, column_radius_m(setup.inspection.layer_m)
    found: dict[tuple[tuple[float, float], ...], None] = {}
    for one in taken:
        if order.index(one.vehicle) > order.index(vehicle):
            for begin, end in one.over_ground_m[one.has_wall].round(2).tolist():
                found[tuple(dict.fromkeys((tuple(begin), tuple(end))))] = None
    return tuple(Obstacle((line,), radius_m, is_line=True) for line in found)


class OccupiedAirspace:
    """The air that is not free for a vehicle which comes down to the line."""

    def __init__(self, setup: FlightSetup, taken: Sequence[Airway]) -> None:
        self._setup, self._taken = setup, taken
        self._new_walls: list[tuple[str, FloatArray]] = []

    def add_walls(self, vehicle: str, tracks_m: FloatArray) -> None:
        """Take note of new walls."""
        self._new_walls.append((vehicle, tracks_m))

    def find_closed_tracks(self, vehicle: str, tracks_m: FloatArray, radius_m: float) -> BoolArray:
        """Return (n,) which of (n, 2, 2) tracks a vehicle must not come down to."""
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
    """Return (n,) which of (n, 2, 2) tracks come nearer than a radius to any of (m, 2, 2) legs, seen from above."""
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
    """Return (n,) which of (n, 2, 2) tracks a straight way home from anywhere on (m, 2, 2) legs comes too near to."""
    met = np.zeros(len(tracks_m), dtype=np.bool_)
    pads_m = np.broadcast_to(pad_m, (len(legs_m), 2))
    for end in (0, 1):
        met |= find_near_tracks(tracks_m, np.stack((legs_m[:, end], pads_m), axis=1), radius_m)
    corners_m = np.stack((legs_m[:, 0], legs_m[:, 1], pads_m), axis=1)
    return np.asarray(met | is_in_triangles(tracks_m[:, 0], corners_m).any(axis=1))


def _find_nearest_airway(setup: FlightSetup, owner: Airway, other: Airway) -> tuple[float, str]:
    """Return how near another vehicle comes to a vehicle's walls, and on which of its ways."""
    walls = owner.has_wall
    bottoms_m, tops_m = owner.legs_m[walls], owner.walls_m[walls]
    upright = np.hypot(*(bottoms_m[:, 1, :2] - bottoms_m[:, 0, :2]).T) < SAME_PLACE_M
    # A way up or down is all of its wall itself.
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
    """Return of what is inspected in one go the longest free stretch of each, as positions among the visits."""
    lengths_m = setup.network.lengths_m
    chosen: list[int] = []
    for chain, follows in _iterate_chains(setup, visits, begin_m):
        runs = [list(run) for is_free, run in itertools.groupby(chain, lambda number: bool(free[number])) if is_free]
        if follows:  # it is down already: what is not the beginning would be one way up and down more
            runs = [run for run in runs if run[0] == chain[0]]
        if runs:
            chosen += max(runs, key=lambda run: sum(lengths_m[segment_of(visits[number])] for number in run))
    return chosen


def _iterate_chains(
    setup: FlightSetup, visits: Sequence[int], begin_m: tuple[float, float] | None
) -> Iterator[tuple[list[int], bool]]:
    """Yield what is inspected in one go, and whether that goes on from where the vehicle is down already.

    A pylon is always begun, and left, from the layer.
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


class RouteTimetable:
    """When routes come where, if everybody flies as planned; what was reckoned for one stays for the next."""

    def __init__(self, setup: FlightSetup, models: Mapping[str, FlightModel], ahead_s: float) -> None:
        self._setup, self._models, self._ahead_s = setup, models, ahead_s
        self._build_path, self._leg_ends_s = cache(build_flight_path), cache(self._estimate_leg_ends_s)

    def find_layer_visits(self, routes: Routes) -> list[Visit]:
        """Return what is inspected from layers."""
        paths = build_first_paths(self._setup, routes, made_by=self._build_path)
        ends_s = {name: self._leg_ends_s(path) for name, path in paths.items()}
        high = []
        for name, path in paths.items():
            low = find_low_segments(path, routes[name])
            for number, segment in enumerate(map(segment_of, routes[name])):
                if segment in low or not must_leave_layer(self._setup, name, segment):
                    continue
                # What is flown to is not replaced: the first part of a route is flown as it was uploaded.
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
