"""Random flights over random networks among random areas keep out of them, and cost what they were priced at.

What judges is shapely: the distance of every leg from every area, by nothing that ways are found with.
"""

from __future__ import annotations

import itertools
import math
import random
from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cache

import numpy as np
import pytest
import shapely
from shapely.geometry import LineString, Point, Polygon
from shapely.geometry.base import BaseGeometry

from missions import (
    FlightPath,
    FlightSetup,
    Inspection,
    Phase,
    build_flight_path,
    continue_path,
    dialect_for,
    estimate,
    plan_flight_setup,
)
from missions.area_rules import apply_areas, check_areas
from missions.errors import SafetyError
from missions.flight_model import FlightModel
from missions.geo import LocalFrame
from missions.no_fly_areas import Area, AreaKind
from missions.pads import column_radius_m
from missions.pricing import Pricing, build_priced_instance
from missions.shortest_ways import Obstacle, build_visibility_graph
from planner import Cost, Plan, Route, SteadyWind, evaluate
from tests.missions.builders import depot_vehicle, network_of

NAMES = ("uav1", "uav2", "uav3")
ROUNDING_M = 0.02
WORLDS = 20
FLIGHTS = 10
"""In each world: 200 plans in all, and as many re-plans."""
POWER = SteadyWind(0.0, 0.0, (0.0, 100.0), (0.05, 0.05))


def star(
    dice: random.Random, middle_m: tuple[float, float], corners: int, most_m: float
) -> tuple[tuple[float, float], ...]:
    """Return an outline that does not cross itself, with corners that point inwards as well."""
    angles = [2 * math.pi * (number + dice.uniform(0.1, 0.9)) / corners for number in range(corners)]
    radii = [most_m * dice.uniform(0.35, 1.0) for _ in angles]
    ring = tuple((middle_m[0] + radius * math.cos(angle), middle_m[1] + radius * math.sin(angle))
                 for angle, radius in zip(angles, radii, strict=True))  # fmt: skip
    return ring[::-1] if dice.random() < 0.5 else ring


def area(dice: random.Random, number: int) -> Area:
    """Return a polygon, one with a hole, or a corridor, away from the depot."""
    bearing, away_m = dice.uniform(0, 2 * math.pi), dice.uniform(120, 600)
    middle_m, size_m = (away_m * math.cos(bearing), away_m * math.sin(bearing)), dice.uniform(20, 110)
    name, margin_m = f"area {number}", dice.choice([2.0, 5.0, 10.0, 25.0])
    if dice.random() < 0.25:
        line = tuple((middle_m[0] + dice.uniform(-200, 200), middle_m[1] + dice.uniform(-200, 200)) for _ in range(4))
        return Area(name, AreaKind.CORRIDOR, (line,), margin_m, dice.uniform(5, 40))
    outline = star(dice, middle_m, dice.randint(3, 12), size_m)
    return Area(name, AreaKind.NO_FLY, (outline,), margin_m)


def shape(one: Area) -> BaseGeometry:
    """Return an area as shapely has it, as wide as it is and without its margin."""
    if one.is_line:
        return LineString(one.rings_m[0]).buffer(one.width_m / 2, quad_segs=64)
    return Polygon(one.rings_m[0], one.rings_m[1:])


@dataclass(frozen=True)
class World:
    """A network among areas."""

    setup: FlightSetup
    reachable: list[int]


@cache
def world(seed: int) -> World:
    """Return a world with a depot that is not in an area."""
    dice = random.Random(seed)
    while True:
        places: list[tuple[float, float]] = []
        for arm in range(dice.randint(3, 5)):
            bearing, here = 2 * math.pi * arm / 5 + dice.uniform(-0.3, 0.3), (0.0, 0.0)
            for step in range(dice.randint(4, 7)):
                bearing += dice.uniform(-0.4, 0.4)
                length = 60.0 if step == 0 else dice.uniform(80, 200)
                here = (here[0] + length * math.cos(bearing), here[1] + length * math.sin(bearing))
                places.append(here)
            places.append((math.nan, math.nan))
        pairs = [(a, a + 1) for a in range(len(places) - 1) if not math.isnan(places[a][0] + places[a + 1][0])]
        number = {old: new for new, old in enumerate(sorted({end for pair in pairs for end in pair}))}
        network = network_of([places[old] for old in number], [(number[a], number[b]) for a, b in pairs])
        areas = [area(dice, count) for count in range(dice.randint(4, 12))]
        try:
            setup = plan_flight_setup(network, NAMES, Inspection(), areas=areas)
            setup = apply_areas(setup, areas)
        except SafetyError:
            continue  # the depot is enclosed
        never = {one.segment for one in setup.unreachable}
        reachable = [one for one in range(len(pairs)) if one not in never]
        if never and len(reachable) >= 6:
            return World(setup, reachable)


def straight(setup: FlightSetup) -> FlightSetup:
    """Return the same setup without areas."""
    return replace(setup, areas=(), kept_out=(), unreachable=())


def pricing(setup: FlightSetup) -> Pricing:
    own = setup.inspection
    model = FlightModel(dialect_for("px4").performance, POWER, own.transit_speed_m_s, own.speed_m_s)
    pads_m = tuple((pad.east_m, pad.north_m) for pad in setup.pads)
    return Pricing(
        setup.tracks_up_m, {name: setup.base_of(name) for name in NAMES}, dict.fromkeys(NAMES, model), pads_m,
        column_radius_m(setup.layers.layer_m), kept_out=setup.kept_out,
    )  # fmt: skip


def least_m(frame: LocalFrame, path: FlightPath, one: Area) -> float:
    """Return how near a flight comes to an area, over the ground; 0 inside."""
    places = [frame.to_local_m(point.lat_deg, point.lon_deg) for point in path.waypoints]
    return float(shapely.distance(LineString(places), shape(one)))


def random_visits(dice: random.Random, reachable: list[int]) -> list[int]:
    return [2 * segment + dice.randint(0, 1) for segment in dice.sample(reachable, dice.randint(2, 6))]


@pytest.mark.parametrize("seed", range(WORLDS))
def test_random_plans_and_re_plans_keep_out_of_all_areas(seed: int) -> None:
    found, dice = world(seed), random.Random(1000 + seed)
    setup = found.setup
    for flight in range(FLIGHTS):
        name = NAMES[flight % len(NAMES)]
        visits = random_visits(dice, found.reachable)
        path, direct = build_flight_path(setup, name, visits), build_flight_path(straight(setup), name, visits)
        keep = dice.randint(1, len(path.waypoints) - 1)
        again = continue_path(setup, path, keep, random_visits(dice, found.reachable))
        for flown in (path, again):
            for one in setup.areas:
                assert least_m(setup.frame, flown, one) >= one.margin_m - ROUNDING_M, (one.name, flown.vehicle)
        assert check_areas(setup, [path, again]) == []
        assert bool(check_areas(setup, [direct])) is any(
            least_m(setup.frame, direct, one) < one.margin_m - 0.2 for one in setup.areas
        )


def turning_ways(dice: random.Random, found: World, path: FlightPath) -> Iterator[tuple[FlightPath, LineString]]:
    """Yield new missions for who is somewhere on its way home, and what it flies from there on.

    It flies on after its place was known, and then straight to its new mission, or back to the line on which that goes
    on from the end of the leg that it was on: autopilots do either.
    """
    places = [np.array(found.setup.frame.to_local_m(point.lat_deg, point.lon_deg)) for point in path.waypoints]
    for keep, point in enumerate(path.waypoints):
        if point.phase is not Phase.RETURN:
            continue
        begin, end = places[keep - 1], places[keep]
        known, turned = sorted((dice.random(), dice.random()))
        known_m, turned_m = (begin + share * (end - begin) for share in (known, turned))
        visits = random_visits(dice, found.reachable)
        again = continue_path(found.setup, path, keep, visits, turn_m=(float(known_m[0]), float(known_m[1])))
        new = [np.array(found.setup.frame.to_local_m(point.lat_deg, point.lon_deg)) for point in again.waypoints[keep:]]
        line_m = end + dice.random() * (new[0] - end)
        yield again, LineString([known_m, turned_m, *new])
        yield again, LineString([known_m, turned_m, line_m, *new])


@pytest.mark.parametrize("seed", range(WORLDS))
def test_a_recall_anywhere_on_the_return_avoids_areas_and_columns(seed: int) -> None:
    found, dice = world(seed), random.Random(3000 + seed)
    setup = found.setup
    for flight in range(FLIGHTS):
        name = NAMES[flight % len(NAMES)]
        path = build_flight_path(setup, name, random_visits(dice, found.reachable))
        for again, flown in turning_ways(dice, found, path):
            for one in setup.areas:
                assert shapely.distance(flown, shape(one)) >= one.margin_m - ROUNDING_M, (one.name, name)
            for pad in setup.pads:
                if pad.vehicle != name:
                    away_m = flown.distance(Point(pad.east_m, pad.north_m))
                    assert away_m >= column_radius_m(setup.layers.layer_m) - ROUNDING_M, (pad.vehicle, name)
            assert check_areas(setup, [again]) == []


def test_every_other_of_these_flights_would_have_met_an_area() -> None:
    met = 0
    for seed in range(WORLDS):
        found, dice = world(seed), random.Random(1000 + seed)
        for _ in range(FLIGHTS):
            direct = build_flight_path(straight(found.setup), "uav1", random_visits(dice, found.reachable))
            met += any(least_m(found.setup.frame, direct, one) < one.margin_m for one in found.setup.areas)
    assert met >= WORLDS * FLIGHTS / 2


@pytest.mark.parametrize("seed", range(WORLDS))
def test_what_ways_around_cost_is_what_the_planner_counts_with(seed: int) -> None:
    found, dice = world(seed), random.Random(2000 + seed)
    priced = pricing(found.setup)
    visits = random_visits(dice, found.reachable)
    instance = build_priced_instance(priced, [depot_vehicle(name, 80.0) for name in NAMES])
    plan = Plan((Route(0, tuple(visits)), Route(1, ()), Route(2, ())))
    priced_s = evaluate(instance, plan, Cost.MINMAX).durations_s[0]
    flown = estimate(build_flight_path(found.setup, "uav1", visits), priced.models["uav1"])
    assert priced_s == pytest.approx(flown.duration_s, rel=1e-5)


@pytest.mark.parametrize("seed", range(WORLDS))
def test_what_is_called_unreachable_is_and_nothing_else(seed: int) -> None:
    found = world(seed)
    setup = found.setup
    for segment, track in enumerate(setup.tracks_m):
        near = [one for one in setup.areas if LineString(track).distance(shape(one)) < one.margin_m - 0.2]
        clear = all(LineString(track).distance(shape(one)) > one.margin_m + 0.2 for one in setup.areas)
        why = next((one.why for one in setup.unreachable if one.segment == segment), None)
        if near:
            assert why is not None
            assert near[0].name in why or len(near) > 1
        elif clear and why is not None:
            assert why == "no path leads to it around the areas"


@pytest.mark.parametrize("seed", range(40))
def test_no_way_is_longer_than_one_along_finely_rounded_corners(seed: int) -> None:
    dice = random.Random(seed)
    outlines = [star(dice, (dice.uniform(-300, 300), dice.uniform(-300, 300)), 7, 120.0) for _ in range(4)]
    keep_m = 15.0
    graph = build_visibility_graph(tuple(Obstacle((ring,), keep_m) for ring in outlines))
    closed = shapely.union_all([Polygon(ring).buffer(keep_m, quad_segs=16) for ring in outlines])
    start, goal = np.array([-500.0, dice.uniform(-200, 200)]), np.array([500.0, dice.uniform(-200, 200)])
    (way,) = graph.ways_m(start[np.newaxis], goal[np.newaxis])
    assert way is not None
    length_m = LineString([start, *way, goal]).length
    corners = [start, *shapely.get_coordinates(closed), goal]
    shrunk = closed.buffer(-0.02)
    shapely.prepare(shrunk)
    # The definition, slow and obvious: over all corners of the rounded outlines, by relaxation.
    count = len(corners)
    pairs = np.array(list(itertools.combinations(range(count), 2)))
    lines = shapely.linestrings(np.array(corners)[pairs])
    seen = ~shapely.intersects(shrunk, lines)
    best = np.full((count, count), math.inf)
    for (one, other), line in zip(pairs[seen], lines[seen], strict=True):
        best[one, other] = best[other, one] = line.length
    reach = best[0].copy()
    for _ in range(count):
        shorter = np.minimum(reach, (reach[:, np.newaxis] + best).min(axis=0))
        if np.array_equal(shorter, reach):
            break
        reach = shorter
    # Corners are cut into legs of 30 degrees, 1 % outside.
    assert reach[-1] - 0.1 <= length_m <= 1.02 * reach[-1] + 1.0


def test_a_start_inside_an_area_leaves_it_by_the_shortest_path() -> None:
    square = ((0.0, 0.0), (100.0, 0.0), (100.0, 100.0), (0.0, 100.0))
    graph = build_visibility_graph((Obstacle((square,), 10.0),))
    (way,) = graph.ways_m(np.array([[90.0, 40.0]]), np.array([[-200.0, 50.0]]))
    assert way is not None
    assert way[0] == pytest.approx([110.12, 40.0])
    assert LineString([*way, (-200.0, 50.0)]).distance(Polygon(square)) >= 10.0


def test_a_place_that_is_enclosed_is_not_reached() -> None:
    ring = ((0.0, 0.0), (100.0, 0.0), (100.0, 100.0), (0.0, 100.0))
    hole = ((30.0, 30.0), (70.0, 30.0), (70.0, 70.0), (30.0, 70.0))
    graph = build_visibility_graph((Obstacle((ring, hole), 5.0),))
    starts, goals = np.array([[-50.0, 50.0], [40.0, 40.0]]), np.array([[50.0, 50.0], [60.0, 60.0]])
    assert [None if way is None else len(way) for way in graph.ways_m(starts, goals)] == [None, 0]
