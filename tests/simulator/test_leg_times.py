"""The simulated autopilots need as long for each leg of a mission as real ones, timed by their own clocks."""

from __future__ import annotations

import itertools
from dataclasses import replace

import pytest

from missions.items import MissionItem
from simulator.config import AutopilotKind
from simulator.leg_trajectories import Axis, LegLimits, SCurve, braking_speed_m_s, overlap_s
from simulator.physics import Vector
from tests.simulator.harness import Operator, land, numbered, speed, takeoff, waypoint

AP, PX4 = AutopilotKind.ARDUPILOT, AutopilotKind.PX4
HOME = waypoint(0, 0, 0.0)
PACE = LegLimits(8.0, 2.5, 1.5, 2.5, 2.0)


def stop(north_m: float, east_m: float, up_m: float = 20.0) -> MissionItem:
    """Return an inspection's end: a hold of a second, on PX4 from a metre before it."""
    return replace(waypoint(north_m, east_m, up_m, hold_s=1.0), param2=1.0)


def passing(north_m: float, east_m: float, up_m: float = 20.0) -> MissionItem:
    return replace(waypoint(north_m, east_m, up_m), param2=2.0)


def times_s(kind: AutopilotKind, *items: MissionItem, up_m: float = 20.0) -> list[float]:
    """Return the seconds of each item that moves, from when it becomes current until the next does or it disarms."""
    listed = numbered((HOME, takeoff(up_m), *items) if kind is AP else (takeoff(up_m), *items), 0)
    op = Operator(kind)
    op.fly(listed)
    began_s, times = op.now_s, list[float]()
    index = _index(op)
    while op.vehicle.frame.armed:
        op.run(0.05)
        if op.vehicle.frame.armed and _index(op) != index:
            times.append(op.now_s - began_s)
            index, began_s = _index(op), op.now_s
    return [*times, op.now_s - began_s]


def _index(op: Operator) -> object:
    return op.mission_current()["seq"]


@pytest.mark.parametrize(
    ("kind", "speed_m_s", "length_m", "real_s", "off_s"),
    [
        (AP, 5, 3, 6.24, 0.3), (AP, 5, 10, 8.28, 0.3), (AP, 5, 40, 13.84, 0.3), (AP, 5, 160, 37.78, 0.3),
        (AP, 3, 40, 18.12, 0.3), (AP, 8, 40, 12.40, 0.3), (AP, 8, 160, 27.10, 0.3), (AP, 1, 40, 43.40, 0.3),
        (PX4, 3, 3, 3.12, 0.6), (PX4, 3, 40, 16.00, 0.8), (PX4, 3, 20, 9.90, 0.6), (PX4, 8, 10, 5.77, 0.6),
        (PX4, 8, 40, 10.36, 0.6), (PX4, 8, 160, 25.29, 0.6), (PX4, 1, 40, 41.56, 1.7),
    ],
)  # fmt: skip
def test_a_leg_straight_on_from_stop_to_stop(
    kind: AutopilotKind, speed_m_s: float, length_m: float, real_s: float, off_s: float
) -> None:
    legs = (stop(60, 0), stop(60 + length_m, 0))
    assert times_s(kind, speed(speed_m_s), *legs, land(60, 0))[2] == pytest.approx(real_s, abs=off_s)


@pytest.mark.parametrize(
    ("kind", "north_m", "east_m", "real_s", "off_s"),
    [
        (AP, 40, 40, 14.14, 0.3), (AP, 0, 0, 14.74, 0.3),
        (PX4, 40, 40, 13.60, 0.8), (PX4, 0, 0, 14.30, 0.8),
    ],
)  # fmt: skip
def test_a_turn_on_the_spot_costs_time(
    kind: AutopilotKind, north_m: float, east_m: float, real_s: float, off_s: float
) -> None:
    legs = (stop(40, 0), stop(north_m, east_m))
    assert times_s(kind, speed(5), *legs, land(0, 0))[2] == pytest.approx(real_s, abs=off_s)


@pytest.mark.parametrize(
    ("kind", "speed_m_s", "rise_m", "real_s", "off_s"),
    [(AP, 8, 30, 18.3, 0.3), (AP, 8, -30, 25.3, 0.3), (PX4, 3, 30, 18.2, 1.3), (PX4, 3, -30, 25.0, 1.0)],
)
def test_what_climbs_or_sinks_steeply_takes_as_long_as_its_height(
    kind: AutopilotKind, speed_m_s: float, rise_m: float, real_s: float, off_s: float
) -> None:
    legs = (stop(40, 0, 40), stop(0, 0, 40 + rise_m))
    assert times_s(kind, speed(speed_m_s), *legs, land(0, 0), up_m=40)[2] == pytest.approx(real_s, abs=off_s)


@pytest.mark.parametrize(
    ("kind", "real_s", "off_s"),
    [(AP, (12.24, 9.56), 0.8), (PX4, (12.87, 9.0), 1.2)],
)
def test_a_corner_is_flown_through(kind: AutopilotKind, real_s: tuple[float, float], off_s: float) -> None:
    """On PX4 the leg after it was flown in 9 s where its line may be left by 2 m, and takes 11 s with one."""
    legs = (passing(60, 30, 17), replace(stop(90, 60, 25), param2=2.0))
    measured = times_s(kind, speed(8), *legs, land(0, 0), up_m=17)[1:3]
    assert measured == [pytest.approx(real, abs=off_s) for real in real_s]


@pytest.mark.parametrize(
    ("kind", "up_m", "rises_s", "lands_s", "off_s"),
    [
        (AP, 10, 10.3, 22.4, 0.4), (AP, 20, 14.3, 31.0, 0.8), (AP, 60, 30.4, 57.2, 0.8),
        (PX4, 10, 11.9, 15.9, 1.5), (PX4, 20, 18.2, 24.4, 1.5), (PX4, 60, 33.9, 56.7, 1.5),
    ],
)  # fmt: skip
def test_take_off_and_landing(kind: AutopilotKind, up_m: float, rises_s: float, lands_s: float, off_s: float) -> None:
    """To the next item, and from the last one until the motors are off."""
    measured = times_s(kind, speed(8), stop(40, 0, up_m), passing(0, 0, up_m), land(0, 0), up_m=up_m)
    assert measured[0] == pytest.approx(rises_s, abs=off_s)
    assert measured[-1] == pytest.approx(lands_s, abs=off_s)


def test_a_curve_goes_from_rest_to_rest_and_never_jumps() -> None:
    curve = SCurve.build(Vector(30.0, 40.0, 10.0), PACE)
    moments = [curve.state_at(step / 50) for step in range(round(curve.duration_s * 50) + 2)]
    assert moments[0].done_m == moments[0].speed_m_s == 0.0
    assert moments[-1].done_m == pytest.approx(curve.way.length_m)
    assert moments[-1].speed_m_s == pytest.approx(0.0, abs=0.01)
    for before, after in itertools.pairwise(moments):
        assert after.done_m - before.done_m == pytest.approx((before.speed_m_s + after.speed_m_s) / 100, abs=1e-3)


def test_the_sharper_the_corner_the_less_two_legs_overlap() -> None:
    one = SCurve.build(Vector(0.0, 60.0, 0.0), PACE)
    overlaps = [overlap_s(one, SCurve.build(way, PACE), PACE) for way in (
        Vector(0.0, 60.0, 0.0), Vector(42.4, 42.4, 0.0), Vector(60.0, 0.0, 0.0), Vector(0.0, -60.0, 0.0)
    )]  # fmt: skip
    assert overlaps == sorted(overlaps, reverse=True)
    assert overlaps[0] == pytest.approx(one.ramp_s)
    assert overlaps[-1] < 0.7 * one.ramp_s


def test_an_axis_reaches_its_speed_within_jerk_and_acceleration() -> None:
    axis = Axis(0.0)
    for _ in range(200):
        before = axis.accelerates_m_s2
        axis.plan_speed(8.0, 3.0, 4.0)
        axis.advance(0.02)
        assert abs(axis.accelerates_m_s2) <= 3.0 + 1e-6
        assert abs(axis.accelerates_m_s2 - before) <= 4.0 * 0.02 + 1e-6
    assert axis.speed_m_s == pytest.approx(8.0, abs=0.01)


def test_the_brakes_are_planned_with_the_time_that_jerk_takes() -> None:
    assert braking_speed_m_s(0.0, 3.0, 4.0) == 0.0
    assert braking_speed_m_s(22.67, 3.0, 4.0) == pytest.approx(8.0, abs=0.01)
    assert braking_speed_m_s(0.5, 3.0, 4.0, exit_m_s=4.0) == 4.0
