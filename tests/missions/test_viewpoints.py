"""Pylons seen from several sides: at the heights that were asked for, and nowhere near a line on the way."""

from __future__ import annotations

import itertools
import random
from collections.abc import Sequence
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from hypothesis import Phase as Phase_
from hypothesis import given, settings
from hypothesis import strategies as st

from missions import (
    FlightPath,
    FlightSetup,
    Inspection,
    Phase,
    check_clearance,
    dialect_for,
    estimate,
    plan_flight_setup,
)
from missions.cameras import Camera, CameraTasks
from missions.errors import SafetyError
from missions.flight_model import FlightModel
from missions.geo import FloatArray
from missions.inspection_height import build_airway, build_first_paths, check_inspection_airspace, segment_distances_m
from missions.network import Network
from missions.readers import default_network_path, read_network
from missions.routes import build_flight_path
from missions.viewpoints import ViewpointRequest, add_viewpoints, build_pylon_tasks, extra_time_s
from missions.waypoints import legs_m
from planner import SteadyWind
from tests.missions.builders import FLEET, line_east, network_of, tall_line_east

POWER = SteadyWind(0.0, 0.0, (0.0, 100.0), (0.05, 0.05))
RGB = Camera("rgb", 100, gimbal=True)
BESIDE_M = 10.0
"""Nobody below the tops is nearer to a line: half of a wide cross-arm, and GPS."""
LOWEST_M = 5.0
BOTH_SIDES = (60.0, 120.0, -120.0, -60.0)


def wish(pylon: int, **changes: object) -> ViewpointRequest:
    figures: dict[str, object] = {
        "pylon": pylon, "camera": "rgb", "bearings_deg": BOTH_SIDES, "distance_m": 14.0, "hover_s": 2.0,
        "pitch_deg": None, "aim_deg": 20.0,
    }  # fmt: skip
    return ViewpointRequest(**{**figures, **changes})  # type: ignore[arg-type]


def looked_at(
    network: Network, wishes: Sequence[ViewpointRequest], names: Sequence[str] = FLEET, camera: Camera = RGB
) -> tuple[FlightSetup, list[str]]:
    """Return what flights of a fleet that carries a camera are made by, and what is flown higher than asked."""
    asked = Inspection(same_distance=True, flat=network.flat)
    wider, wished = add_viewpoints(network, wishes, asked.standoff_m)
    setup = plan_flight_setup(wider, names, asked)
    looks, higher = build_pylon_tasks(setup, wished)
    carriers = {name: frozenset({camera.name}) for name in names}
    return replace(setup, looks=CameraTasks({camera.name: camera}, carriers, {}, looks)), higher


@cache
def hills() -> Network:
    return read_network(default_network_path(), radius_m=500.0)


def sampled_m(setup: FlightSetup, path: FlightPath) -> FloatArray:
    """Return (m, 3) places every half metre on all legs but take-off and landing."""
    legs = legs_m(path, setup.frame, setup.frame.up_m(setup.pad_of(path.vehicle).alt_m))
    found = []
    for leg, point in zip(legs, path.waypoints, strict=True):
        if point.phase not in {Phase.TAKEOFF, Phase.LAND}:
            steps = max(2, int(2 * np.linalg.norm(leg[1] - leg[0])) + 1)
            found.append(leg[0] + np.linspace(0.0, 1.0, steps)[:, np.newaxis] * (leg[1] - leg[0]))
    return np.concatenate(found)


def too_near(setup: FlightSetup, real: Network, places_m: FloatArray) -> int:
    """Return how many places are below, or hardly over, the top of a line within `BESIDE_M`: by sums of its own."""
    count = 0
    for segment in real.segments:
        a, b = (real.pylons[end] for end in (segment.a, segment.b))
        (east, north), (to_east, to_north) = real.ends_m[segment.id].tolist()
        along = np.array([to_east - east, to_north - north])
        off = places_m[:, :2] - (east, north)
        share = np.clip(off @ along / (along @ along), 0.0, 1.0)
        away = np.hypot(*(off - share[:, np.newaxis] * along).T)
        tops = [float((one.elevation_m or 0.0) + (one.height_m or 0.0)) - setup.frame.alt_m for one in (a, b)]
        over = places_m[:, 2] - (tops[0] + share * (tops[1] - tops[0]))
        count += int(((away < BESIDE_M - 0.02) & (over < 0.6 * setup.inspection.height_m)).sum())
    return count


def stops_of(path: FlightPath) -> list[float]:
    """Return the heights over its home of all places where a path takes pictures."""
    return [point.alt_rel_m for point in path.waypoints if point.captures]


def test_viewpoints_lie_at_the_heights_that_were_asked_for() -> None:
    setup, higher = looked_at(tall_line_east(), [wish(1, heights_m=(2.0, -8.0))])
    assert not higher
    [segment] = setup.looks.pylons
    for name in ("uav1", "uav3"):
        path = build_first_paths(setup, {name: (2 * segment,)})[name]
        # A second bearing begins at the height at which the first one ended.
        assert stops_of(path) == pytest.approx([32, 22, 22, 32, 32, 22, 22, 32], abs=0.02)
        assert [point.hover_s for point in path.waypoints if point.captures] == [2.0] * 8


def test_a_way_to_the_other_side_leads_over_the_line_and_not_through_it() -> None:
    setup, _ = looked_at(tall_line_east(), [wish(1, heights_m=(-8.0,))])
    [segment] = setup.looks.pylons
    path = build_first_paths(setup, {"uav1": (2 * segment,)})["uav1"]
    around = [round(point.alt_rel_m) for point in path.waypoints if point.visit is not None]
    # Over the first viewpoint, down; along the line; up, across, down; along the line.
    assert around == [45, 22, 22, 45, 45, 22, 22]
    assert too_near(setup, tall_line_east(), sampled_m(setup, path)) == 0


@pytest.mark.parametrize("reverse", [0, 1])
def test_the_camera_looks_at_what_was_asked_from_wherever_the_vehicle_is(reverse: int) -> None:
    wishes = [wish(1, heights_m=(0.0, -10.0), target_m=-10.0)]
    setup, _ = looked_at(tall_line_east(), wishes)
    [segment] = setup.looks.pylons
    low = build_first_paths(setup, {"uav1": (2 * segment + reverse,)})["uav1"]
    pitches = [point.captures[0].pitch_deg for point in low.waypoints if point.captures]
    assert sorted(set(pitches), key=lambda one: one or 0) == [-36, 0]  # 10 m above at 14 m, and level
    high = build_flight_path(setup, "uav3", (2 * segment + reverse,))
    [pitch] = {point.captures[0].pitch_deg for point in high.waypoints if point.captures}
    up_m = setup.layers.offset_m("uav3") + 15.0 + 10.0
    assert pitch == round(-np.degrees(np.arctan2(up_m, 14.0)))


def test_viewpoints_next_to_another_line_are_flown_over_it_and_reported() -> None:
    crossing = [*[(100.0 * number, 0.0) for number in (1, 2, 3)], (200.0, 100.0)]
    network = network_of(crossing, [(0, 1), (1, 2), (1, 3)], [(450.0, 30.0)] * 4)
    setup, higher = looked_at(network, [wish(1, bearings_deg=(45.0, 135.0, -45.0, -135.0), heights_m=(-8.0,))])
    assert [line.split(",")[0] for line in higher] == [
        "pylon p1: the viewpoint at -45 deg",
        "pylon p1: the viewpoint at 45 deg",
    ][::-1] or len(higher) == 4
    [segment] = setup.looks.pylons
    path = build_first_paths(setup, {"uav1": (2 * segment,)})["uav1"]
    assert too_near(setup, network, sampled_m(setup, path)) == 0
    assert all("below the top of segment" in line for line in higher)


def test_a_viewpoint_in_the_ground_is_flown_as_low_as_the_ground_lets_it() -> None:
    setup, higher = looked_at(tall_line_east(), [wish(1, heights_m=(-28.0,))])
    [segment] = setup.looks.pylons
    path = build_first_paths(setup, {"uav1": (2 * segment,)})["uav1"]
    assert stops_of(path) == pytest.approx([LOWEST_M] * 4, abs=0.2)
    assert higher[0] == (
        "pylon p1: the viewpoint at 60 deg, -28 m from the top, is flown 3 m higher: it would come within 1.9 m of the "
        "ground at segment 0, 5 m over it expected"
    )


def test_a_vehicle_that_cannot_descend_inspects_from_its_layer_and_reports_it() -> None:
    """uav2 shares the pylon with uav1: its air is taken."""
    wishes = [wish(1, heights_m=(-8.0,)), wish(1, camera="ir", heights_m=(-8.0,))]
    setup, _ = looked_at(tall_line_east(), wishes)
    setup = replace(setup, looks=replace(setup.looks, cameras={"rgb": RGB, "ir": replace(RGB, name="ir")}))
    first, second = setup.looks.pylons
    routes = {"uav1": (2 * first,), "uav2": (2 * second,)}
    paths = build_first_paths(setup, routes)
    assert segment_distances_m(setup, paths["uav1"], routes["uav1"]) == {first: 15.0}
    assert segment_distances_m(setup, paths["uav2"], routes["uav2"]) == {
        second: pytest.approx(15.0 + setup.layers.offset_m("uav2") + 23.0, abs=0.02)
    }
    assert check_inspection_airspace(setup, [build_airway(setup, path) for path in paths.values()]) == []


@pytest.mark.parametrize("reverse", [0, 1])
def test_viewpoints_above_each_other_are_one_stop_from_a_layer(reverse: int) -> None:
    setup, _ = looked_at(tall_line_east(), [wish(1, heights_m=(2.0, -8.0))])
    [segment] = setup.looks.pylons
    path = build_flight_path(setup, "uav3", (2 * segment + reverse,))
    points = [point.captures[0].points for point in path.waypoints if point.captures]
    assert points == [(0, 1), (2, 3), (4, 5), (6, 7)][:: -1 if reverse else 1]


def test_viewpoints_that_are_flown_higher_together_are_one_stop() -> None:
    setup, higher = looked_at(tall_line_east(), [wish(1, heights_m=(-8.0, -28.0, -29.0))])
    [segment] = setup.looks.pylons
    path = build_first_paths(setup, {"uav1": (2 * segment,)})["uav1"]
    stops = [point.captures[0].points for point in path.waypoints if point.captures]
    assert stops == [(0,), (1, 2), (3, 4), (5,), (6,), (7, 8), (9, 10), (11,)]
    assert len(higher) == 8  # each of them is named


def test_heights_over_an_unknown_top_are_refused() -> None:
    with pytest.raises(SafetyError, match="pylon 'p1': expected elevation_m and height_m"):
        add_viewpoints(line_east(3), [wish(1, heights_m=(0.0,))], 5.0)


@pytest.mark.parametrize("autopilot", ["ardupilot", "px4"])
@pytest.mark.parametrize("heights_m", [(), (-8.0,), (3.0, -8.0, -15.0)])
@pytest.mark.parametrize("low", [True, False], ids=["low", "from its layer"])
def test_a_pylon_takes_what_its_flight_takes(autopilot: str, heights_m: tuple[float, ...], low: bool) -> None:
    setup, _ = looked_at(tall_line_east(), [wish(1, heights_m=heights_m, hover_s=4.0)])
    [(segment, look)] = setup.looks.pylons.items()
    performance = dialect_for(autopilot).performance
    model = FlightModel(performance, POWER, setup.inspection.transit_speed_m_s, setup.inspection.speed_m_s)
    path = build_flight_path(setup, "uav1", (2 * segment,), {segment} if low else ())
    comes_down = low and bool(heights_m)
    legs = estimate(path, model).legs
    number = next(index for index, point in enumerate(path.waypoints) if point.visit is not None)
    at_home = next(index for index, point in enumerate(path.waypoints) if point.phase is Phase.RETURN)
    if comes_down:
        at_home += 1  # it goes up to the surface first
    # What the turn from the way there takes is a part of that, and not of the pylon.
    flown_s = sum(leg.duration_s for leg in legs[number + 1 : at_home]) - turned_s(setup, path, number, model)
    ends = [np.array(look.points[end].place_m) for end in (0, -1)]
    straight = np.array([float(np.hypot(*(ends[1] - ends[0])))])
    tracks_s = float(performance.legs_s(straight, np.zeros(1), np.array([3.0]), np.full(1, 2.0))[0])
    tracks_s += performance.settle_s + performance.hold_s
    # The first stop's own hold, longer than that of any stop, is the leg's that ends there where it need not come down.
    hover_s = 0.0 if comes_down else 4.0 - performance.hold_s
    assert extra_time_s(look, performance, 3.0, in_layer=not low) + tracks_s - hover_s == pytest.approx(
        flown_s, rel=0.02, abs=1.0
    )


def turned_s(setup: FlightSetup, path: FlightPath, number: int, model: FlightModel) -> float:
    """Return what turning at a waypoint takes before the leg that follows."""
    legs = legs_m(path, setup.frame)
    before, after = (legs[index, 1, :2] - legs[index, 0, :2] for index in (number, number + 1))
    arrives = model.performance.arrival_speed_m_s(
        np.array(0.0 if np.hypot(*after) < 1e-6 else np.hypot(*before)), path.waypoints[number].speed_m_s
    )
    return float(model.performance.turns_s(before, after, arrives))


@settings(derandomize=True, deadline=None, max_examples=15, phases=[Phase_.explicit, Phase_.generate])
@given(seed=st.integers(0, 2**32 - 1))
def test_no_viewpoint_comes_near_a_line_or_another_vehicle(seed: int) -> None:
    network, rng = hills(), random.Random(seed)
    wishes = [
        wish(
            pylon,
            bearings_deg=tuple(map(float, rng.sample(range(-180, 180, 15), rng.randint(2, 5)))),
            heights_m=tuple(rng.sample([10.0, 2.0, -5.0, -12.0, -40.0], rng.randint(0, 3))),
            distance_m=rng.choice([8.0, 12.0, 25.0]),
        )
        for pylon in rng.sample(range(len(network.pylons)), 8)
    ]
    setup, _ = looked_at(network, wishes)
    segments = rng.sample(range(len(setup.network.segments)), len(setup.network.segments))
    cuts = sorted(rng.sample(range(len(segments)), 3))
    parts = [segments[begin:end] for begin, end in itertools.pairwise([0, *cuts, len(segments)])]
    routes = {name: tuple(2 * segment for segment in part) for name, part in zip(FLEET, parts, strict=True)}
    paths = build_first_paths(setup, routes)
    assert check_inspection_airspace(setup, [build_airway(setup, path) for path in paths.values()]) == []
    assert check_clearance(setup, paths.values()) == []
    for path in paths.values():
        assert too_near(setup, network, sampled_m(setup, path)) == 0
