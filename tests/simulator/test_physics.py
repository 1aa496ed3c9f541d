"""Motion: nothing jumps, limits hold, legs are straight, stops are stops."""

from __future__ import annotations

import math

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from simulator.ardupilot import LIMITS as ARDUPILOT_LIMITS
from simulator.autopilot import STEP_S
from simulator.guidance import Climb, GoalFollower, Hover, Leg, corner_speed_m_s, distance_m
from simulator.physics import Body, Home, Place, Velocity
from simulator.px4_guided import LIMITS as PX4_LIMITS

SPEEDS = st.floats(-15, 15)


@settings(deadline=None)
@given(st.lists(st.tuples(SPEEDS, SPEEDS, SPEEDS), min_size=1, max_size=40))
def test_positions_never_jump_and_limits_hold(wishes: list[tuple[float, float, float]]) -> None:
    body, limits = Body(), PX4_LIMITS
    body.up_m = 100.0
    for wish in wishes:
        place, speed = body.place, (body.v_east_m_s, body.v_north_m_s)
        body.fly(Velocity(*wish), limits, STEP_S)
        change = math.hypot(body.v_east_m_s - speed[0], body.v_north_m_s - speed[1])
        assert change <= max(limits.accelerate_m_s2, limits.brake_m_s2) * STEP_S + 1e-9
        assert -limits.descend_m_s - 1e-9 <= body.v_up_m_s <= limits.climb_m_s + 1e-9
        fastest = 15 * math.sqrt(2) + limits.climb_m_s
        assert distance_m(place, body.place) <= fastest * STEP_S + 1e-9


@settings(deadline=None, max_examples=30)
@given(st.floats(-200, 200), st.floats(-200, 200), st.floats(-15, 15), st.floats(0.5, 12))
def test_a_leg_ends_at_rest_on_its_end_and_stays_on_its_line(
    east_m: float, north_m: float, rise_m: float, speed_m_s: float
) -> None:
    body = Body()
    origin = Place(0.0, 0.0, 30.0)
    body.up_m = 30.0
    target = Place(east_m, north_m, 30.0 + rise_m)
    pilot = GoalFollower(body, ARDUPILOT_LIMITS)
    pilot.fly([Leg(origin, target, speed_m_s, accept_m=0.0)])
    length = math.hypot(east_m, north_m)
    for _ in range(round(60 * 15 / STEP_S)):
        pilot.step(STEP_S)
        if pilot.goal is None:
            break
        assert body.ground_speed_m_s <= speed_m_s + 0.1
        if length > 1:
            off_m = abs(body.east_m * north_m - body.north_m * east_m) / length
            assert off_m < 0.05
    assert pilot.goal is None
    assert distance_m(body.place, target) < 0.31


@pytest.mark.parametrize("limits", [ARDUPILOT_LIMITS, PX4_LIMITS])
@pytest.mark.parametrize("up_m", [5.0, 25.0, 60.0])
def test_a_climb_does_not_overshoot(limits: object, up_m: float) -> None:
    body = Body()
    pilot = GoalFollower(body, PX4_LIMITS if limits is PX4_LIMITS else ARDUPILOT_LIMITS)
    pilot.fly([Climb(Place(0, 0, up_m), 2.5), Hover(Place(0, 0, up_m))])
    highest_m = 0.0
    for _ in range(round(90 / STEP_S)):
        pilot.step(STEP_S)
        highest_m = max(highest_m, body.up_m)
    assert highest_m < up_m + 0.05
    assert body.up_m == pytest.approx(up_m, abs=0.02)


def test_a_hover_brakes_without_coming_back_far() -> None:
    body = Body()
    body.up_m, body.v_east_m_s = 30.0, 10.0
    pilot = GoalFollower(body, ARDUPILOT_LIMITS)
    pilot.hold()
    farthest_m = 0.0
    for _ in range(round(30 / STEP_S)):
        pilot.step(STEP_S)
        farthest_m = max(farthest_m, body.east_m)
    assert farthest_m < 10.0**2 / (2 * 0.7 * ARDUPILOT_LIMITS.brake_m_s2) + 1
    assert body.east_m == pytest.approx(farthest_m, abs=1.0)
    assert body.ground_speed_m_s < 0.01


@pytest.mark.parametrize(("turn_deg", "low", "high"), [(0, 5.0, 5.0), (90, 3.0, 3.6), (179.99, 0.0, 0.1)])
def test_a_corner_is_flown_as_fast_as_it_allows(turn_deg: float, low: float, high: float) -> None:
    leg = Leg(Place(0, 0, 0), Place(100, 0, 0), 5.0, accept_m=2.0)
    angle = math.radians(turn_deg)
    after = Place(100 + 100 * math.cos(angle), 100 * math.sin(angle), 0)
    assert low <= corner_speed_m_s(leg, after, ARDUPILOT_LIMITS, 2.0) <= high


@settings(deadline=None)
@given(st.floats(-70, 70), st.floats(-179, 179), st.floats(-3000, 3000), st.floats(-3000, 3000))
def test_the_flat_step_agrees_in_both_directions(lat: float, lon: float, east_m: float, north_m: float) -> None:
    home = Home(lat, lon, 300.0)
    place = home.place_of(*home.lat_lon_e7(east_m, north_m), 0.0)
    assert place.east_m == pytest.approx(east_m, abs=0.01)
    assert place.north_m == pytest.approx(north_m, abs=0.01)


def test_a_degree_is_as_long_as_on_the_ellipsoid() -> None:
    home = Home(50.0, 13.0, 0.0)
    # Published lengths of a degree at 50 degrees north: 111 229 m and 71 696 m.
    assert home.place_of(round(51e7), round(13e7), 0).north_m == pytest.approx(111229, abs=5)
    assert home.place_of(round(50e7), round(14e7), 0).east_m == pytest.approx(71696, abs=5)


def test_a_fall_is_hard_from_a_height_and_soft_from_a_step() -> None:
    for height_m, hard in ((20.0, True), (0.15, False)):
        body = Body()
        body.up_m = height_m
        impact = 0.0
        for _ in range(100):
            impact = max(impact, body.fall(STEP_S))
        assert (impact > 2.0) is hard
        assert body.up_m == 0.0
