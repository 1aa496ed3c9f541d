"""Inspection at the requested distance where no other vehicle can be, at any timing."""

from __future__ import annotations

import itertools
import random
from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from missions import (
    FlightPath,
    FlightSetup,
    Inspection,
    Phase,
    build_flight_path,
    check_separation,
    continue_path,
    dialect_for,
    estimate,
    plan_flight_setup,
)
from missions.flight_model import FlightModel
from missions.geo import FloatArray
from missions.geometry import leg_distances_m, wall_distances_m
from missions.inspection_height import (
    Airway,
    build_airway,
    build_first_paths,
    check_inspection_airspace,
    find_low_segments,
    select_low_segments,
)
from missions.pads import column_radius_m
from missions.pricing import Pricing, build_priced_instance
from missions.readers import default_network_path, read_network
from missions.waypoints import legs_m
from planner import Cost, Plan, Route, SteadyWind, evaluate, segment_of
from tests.missions.builders import FLEET, depot_vehicle, line_east, network_of

POWER = SteadyWind(0.0, 0.0, (0.0, 100.0), (0.05, 0.05))
LAYER_M = 5.0


@cache
def hills() -> FlightSetup:
    """Return four vehicles over the default network's 700 m, whose ground rises and falls."""
    network = read_network(default_network_path(), radius_m=700.0)
    return plan_flight_setup(network, FLEET, Inspection(same_distance=True))


@cache
def plain() -> FlightSetup:
    """Return four vehicles over flat ground: a cross of four lines, each of six spans of 100 m."""
    ways = [(1.0, 0.0), (0.0, 1.0), (-1.0, 0.0), (0.0, -1.0)]
    places = [(east * 100.0 * far, north * 100.0 * far) for east, north in ways for far in range(1, 8)]
    pairs = [(7 * way + span, 7 * way + span + 1) for way in range(4) for span in range(6)]
    return plan_flight_setup(network_of(places, pairs), FLEET, Inspection(same_distance=True))


SETUPS = pytest.mark.parametrize("chosen", [hills, plain], ids=["hills", "plain"])


def priced(setup: FlightSetup, autopilot: str, layered: Mapping[str, frozenset[int]]) -> Pricing:
    own = setup.inspection
    model = FlightModel(dialect_for(autopilot).performance, POWER, own.transit_speed_m_s, own.speed_m_s)
    names = setup.layers.vehicles
    return Pricing(
        setup.tracks_up_m, {name: setup.base_of(name) for name in names}, dict.fromkeys(names, model),
        tuple((pad.east_m, pad.north_m) for pad in setup.pads), column_radius_m(setup.layers.layer_m),
        steps_m=setup.steps_m, layered=layered,
    )  # fmt: skip


def dealt(setup: FlightSetup, rng: random.Random, *, near: bool) -> dict[str, tuple[int, ...]]:
    """Return routes over all segments: any for anybody, or in the order of the network, which is along its lines."""
    visits = [2 * segment for segment in range(len(setup.network.segments))]
    if not near:
        rng.shuffle(visits)
        visits = [visit + rng.randrange(2) for visit in visits]
    cuts = sorted(rng.sample(range(1, len(visits)), len(FLEET) - 1))
    parts = [tuple(visits[begin:end]) for begin, end in itertools.pairwise([0, *cuts, len(visits)])]
    rng.shuffle(parts)
    return dict(zip(FLEET, parts, strict=True))


def inspections_m(setup: FlightSetup, path: FlightPath, visits: Sequence[int]) -> dict[int, FloatArray]:
    """Return the (2, 3) leg on which a path inspects each segment."""
    legs = legs_m(path, setup.frame, setup.frame.up_m(setup.pad_of(path.vehicle).alt_m))
    return {
        segment_of(visits[point.visit]): leg
        for point, leg in zip(path.waypoints, legs, strict=True)
        if point.phase is Phase.INSPECT and point.visit is not None
    }


def asked_m(setup: FlightSetup, segment: int) -> FloatArray:
    """Return the heights of both ends of a segment's inspection as they are asked for."""
    return np.sort(setup.layers.track_heights_m[segment])


def places_m(setup: FlightSetup, path: FlightPath, rng: random.Random, count: int = 60) -> FloatArray:
    """Return (n, 3) places where a vehicle may be: on its mission, and on the way from there up to its layer."""
    legs = legs_m(path, setup.frame, setup.frame.up_m(setup.pad_of(path.vehicle).alt_m))
    found = []
    for _ in range(count):
        number = rng.randrange(len(legs))
        place = legs[number, 0] + rng.random() * (legs[number, 1] - legs[number, 0])
        if path.waypoints[number].below_m and path.waypoints[number].phase is Phase.INSPECT:
            place = place + np.array([0.0, 0.0, rng.random() * path.waypoints[number].below_m])
        found.append(place)
    return np.array(found)


@SETUPS
@settings(derandomize=True, deadline=None, max_examples=12)
@given(seed=st.integers(0, 2**32 - 1), near=st.booleans())
def test_a_descending_vehicle_meets_no_other_at_any_timing(chosen: object, seed: int, near: bool) -> None:
    setup, rng = (hills if chosen is hills else plain)(), random.Random(seed)
    routes = dealt(setup, rng, near=near)
    paths = build_first_paths(setup, routes)
    for name, path in paths.items():
        low = find_low_segments(path, routes[name])
        for segment, leg in inspections_m(setup, path, routes[name]).items():
            higher_m = 0.0 if segment in low else setup.layers.offset_m(name)
            assert np.sort(leg[:, 2]) == pytest.approx(asked_m(setup, segment) + higher_m, abs=0.02)
    assert check_separation(list(paths.values()), LAYER_M) == []
    assert check_inspection_airspace(setup, [build_airway(setup, path) for path in paths.values()]) == []
    stands = {name: places_m(setup, path, rng) for name, path in paths.items()}
    for one, other in itertools.combinations(stands.values(), 2):
        apart_m = np.sqrt(((one[:, np.newaxis] - other) ** 2).sum(axis=2))
        assert apart_m.min() >= LAYER_M - 0.01


def test_routes_that_share_nothing_are_all_inspected_as_asked() -> None:
    setup = plain()
    routes = {name: tuple(range(12 * way, 12 * way + 12, 2)) for way, name in enumerate(FLEET)}
    paths = build_first_paths(setup, routes)
    for name, path in paths.items():
        for segment, leg in inspections_m(setup, path, routes[name]).items():
            assert np.sort(leg[:, 2]) == pytest.approx(asked_m(setup, segment), abs=0.02), (name, segment)


def test_without_same_distance_every_vehicle_stays_in_its_layer() -> None:
    network = line_east(5)
    usual = plan_flight_setup(network, FLEET[:2], Inspection())
    routes = {"uav1": (0, 2), "uav2": (4, 6)}
    assert build_first_paths(usual, routes) == {
        name: build_flight_path(usual, name, visits) for name, visits in routes.items()
    }
    assert usual.steps_m == {}


def test_a_shared_pylon_keeps_the_higher_one_in_its_layer_there() -> None:
    setup = plan_flight_setup(line_east(7), FLEET[:2], Inspection(same_distance=True))
    routes = {"uav1": (0, 2, 4), "uav2": (10, 8, 6)}
    low = {name: find_low_segments(path, routes[name]) for name, path in build_first_paths(setup, routes).items()}
    # The lowest layer is at the asked height itself; the third span of uav2 ends where the last of uav1 does. What is
    # farther out is above nobody's way.
    assert low == {"uav1": frozenset(), "uav2": frozenset({4, 5})}


def test_a_vehicle_without_a_failsafe_return_does_not_descend_to_the_line() -> None:
    setup = plan_flight_setup(line_east(7), FLEET[:2], Inspection(same_distance=True))
    routes = {"uav1": (0, 2), "uav2": (10, 8)}
    paths = build_first_paths(setup, routes, {"uav2"})
    assert find_low_segments(paths["uav2"], routes["uav2"]) == frozenset()


def test_a_return_does_not_cross_a_vehicle_on_the_line() -> None:
    """Over flat ground returns are straight and in the own layer: the lower one's would cross the other's part."""
    setup = plan_flight_setup(line_east(9), FLEET[:2], Inspection(same_distance=True))
    inner_is_high = {"uav1": (12, 14), "uav2": (4, 6)}
    low = build_first_paths(setup, inner_is_high)["uav2"]
    assert find_low_segments(low, inner_is_high["uav2"]) == frozenset()
    inner_is_low = {"uav1": (4, 6), "uav2": (12, 14)}
    low = build_first_paths(setup, inner_is_low)["uav2"]
    assert find_low_segments(low, inner_is_low["uav2"]) == frozenset({6, 7})


def test_what_comes_too_near_to_the_line_is_found() -> None:
    setup = plan_flight_setup(line_east(9), FLEET[:2], Inspection(same_distance=True))
    down = build_airway(setup, build_flight_path(setup, "uav2", (4, 6), frozenset({2, 3})))
    over = build_airway(setup, build_flight_path(setup, "uav1", (12,)))
    (line,) = check_inspection_airspace(setup, [down, over])
    assert line == "uav1 on its mission comes within 4.50 m of where uav2 goes down to the line, 5 m expected"
    beside = build_airway(setup, build_flight_path(setup, "uav1", (0,)))
    assert check_inspection_airspace(setup, [down, beside]) == []


@SETUPS
@pytest.mark.parametrize("autopilot", ["ardupilot", "px4"])
def test_ways_up_and_down_are_priced_as_they_are_flown(chosen: object, autopilot: str) -> None:
    setup = (hills if chosen is hills else plain)()
    routes = dealt(setup, random.Random(4), near=False)
    paths = build_first_paths(setup, routes)
    low = {name: find_low_segments(path, routes[name]) for name, path in paths.items()}
    assert any(low.values())
    layered = {name: frozenset(map(segment_of, routes[name])) - low[name] for name in FLEET}
    model = priced(setup, autopilot, layered)
    plan = Plan(tuple(Route(number, routes[name]) for number, name in enumerate(FLEET)))
    fleet = [depot_vehicle(name, 80.0) for name in FLEET]
    found = evaluate(build_priced_instance(model, fleet), plan, Cost.MINMAX)
    in_layers = evaluate(build_priced_instance(replace(model, steps_m={}), fleet), plan, Cost.MINMAX)
    as_asked = evaluate(build_priced_instance(priced(setup, autopilot, {}), fleet), plan, Cost.MINMAX)
    for number, name in enumerate(FLEET):
        takes = estimate(paths[name], model.models[name])
        if chosen is plain:
            assert found.durations_s[number] == pytest.approx(takes.duration_s, rel=1e-5)
            assert found.energies_pct[number] == pytest.approx(takes.energy_pct, rel=1e-5)
        # Over hills transits rise and fall, which prices know only where a raster knows the ground: in layers, too.
        high = estimate(build_flight_path(setup, name, routes[name]), model.models[name])
        more_s = found.durations_s[number] - in_layers.durations_s[number]
        assert more_s == pytest.approx(takes.duration_s - high.duration_s, abs=1.0)
        # What is planned with, before anybody knows who stays in its layer, is never less.
        assert as_asked.durations_s[number] >= found.durations_s[number] - 1e-6


def test_what_follows_in_flight_continues_from_the_line() -> None:
    """A re-plan goes up from where the last kept inspection ended, or on along the line without going up."""
    setup = plain()
    path = build_flight_path(setup, "uav3", (0, 2, 4), frozenset({0, 1, 2}))
    end = next(index for index, point in enumerate(path.waypoints) if point.visit == 0 and point.phase is Phase.INSPECT)
    on = continue_path(setup, path, end + 1, (2,), frozenset({1}))
    assert [point.phase for point in on.waypoints[end + 1 :]] == [
        Phase.INSPECT, Phase.RETURN, *[Phase.RETURN] * (len(on.waypoints) - end - 4), Phase.LAND,
    ]  # fmt: skip
    up = continue_path(setup, path, end + 1, (14,), frozenset())
    first = up.waypoints[end + 1]
    assert (first.phase, first.hold, first.below_m) == (Phase.TRANSIT, True, 0.0)
    assert first.alt_rel_m - path.waypoints[end].alt_rel_m == pytest.approx(setup.layers.offset_m("uav3"))
    assert first.lat_deg == pytest.approx(path.waypoints[end].lat_deg, abs=1e-7)
    assert first.lon_deg == pytest.approx(path.waypoints[end].lon_deg, abs=1e-7)


def test_only_one_stretch_of_what_is_inspected_in_one_go_is_below_the_layer() -> None:
    """Who is down already goes on, or goes up once: nobody goes up and down more often than is reckoned with."""
    # Up a hill: returns are above all layers, so that nobody's way home is in the way.
    places = [(100.0 * (index + 1), 0.0) for index in range(9)]
    rising = network_of(places, list(itertools.pairwise(range(9))), [(450.0 + 2 * index, 20.0) for index in range(9)])
    setup = plan_flight_setup(rising, FLEET[:2], Inspection(same_distance=True))
    route = {"uav2": (0, 2, 4, 6, 8, 10, 12)}
    # uav1 crosses at the fourth pylon.
    legs = np.array([[[400.0, -300.0, 15.0], [400.0, 300.0, 15.0]]])
    crossing = Airway("uav1", legs, np.zeros((1, 2)))
    assert select_low_segments(setup, route, [crossing])["uav2"] == frozenset({4, 5, 6})
    begins = {"uav2": (float(setup.tracks_m[0, 0, 0]), float(setup.tracks_m[0, 0, 1]))}
    assert select_low_segments(setup, route, [crossing], begins_m=begins)["uav2"] == frozenset({0, 1})


COORDINATES = st.one_of(st.integers(-3, 3).map(float), st.floats(-30.0, 30.0, allow_subnormal=False))
SPACE = st.tuples(COORDINATES, COORDINATES, COORDINATES)


@settings(derandomize=True, deadline=None, max_examples=150)
@given(SPACE, SPACE, st.floats(0.0, 20.0), SPACE, SPACE)
def test_a_wall_is_as_near_as_the_nearest_of_many_lines_on_it(
    begin: tuple[float, ...], end: tuple[float, ...], height_m: float, first: tuple[float, ...], last: tuple[float, ...]
) -> None:
    bottom, leg = np.array([[begin, end]]), np.array([[first, last]])
    found = float(wall_distances_m(bottom, np.array([height_m]), leg)[0, 0])
    lines = bottom + np.linspace(0.0, height_m, 201)[:, np.newaxis, np.newaxis] * np.array([0.0, 0.0, 1.0])
    sampled = float(leg_distances_m(lines, leg).min())
    assert sampled - height_m / 400 - 1e-6 <= found <= sampled + 1e-6
