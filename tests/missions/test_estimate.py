"""Estimates of real flights against sums done by hand."""

from __future__ import annotations

from dataclasses import replace

import pytest

from missions import FlightPath, Motion, Phase, Waypoint, estimate
from planner import SteadyWind, Travel
from tests.missions.builders import FRAME

TRAVEL = Travel(transit_speed_m_s=5.0, inspection_speed_m_s=1.0, transit_pct_per_s=0.1, inspection_pct_per_s=0.2)
MOTION = Motion(climb_m_s=2.0, descent_m_s=1.0, acceleration_m_s2=2.5, hold_s=1.0)


def waypoint(phase: Phase, east: float, north: float, up: float, speed: float, *, hold: bool = False) -> Waypoint:
    lat, lon = FRAME.to_wgs84_deg(east, north)
    return Waypoint(phase, lat, lon, up, speed, hold)


def test_a_flight_is_the_sum_of_its_legs() -> None:
    path = FlightPath(
        "uav1",
        (
            waypoint(Phase.TAKEOFF, 0, 0, 20, 2.0),
            waypoint(Phase.TRANSIT, 100, 0, 20, 5.0, hold=True),
            waypoint(Phase.INSPECT, 150, 0, 20, 1.0, hold=True),
            waypoint(Phase.RETURN, 0, 0, 20, 5.0),
            waypoint(Phase.LAND, 0, 0, 0, 1.0),
        ),
    )
    figures = estimate(path, TRAVEL, MOTION)
    # Climb 20 / 2 and a ramp at each end of 2 / 5; transit 100 / 5 + 5 / 2.5 and 1 s; 50 / 1 + 1 / 2.5 and 1 s;
    # 150 / 5 + 5 / 2.5; 20 / 1 + 1 / 2.5.
    seconds = [10.8, 23.0, 51.4, 32.0, 20.4]
    energies = [10.8 * 0.2, 22.0 * 0.1 + 1 * 0.2, 51.4 * 0.2, 32.0 * 0.1, 20.4 * 0.2]
    assert [leg.duration_s for leg in figures.legs] == pytest.approx(seconds, abs=1e-3)
    assert [leg.energy_pct for leg in figures.legs] == pytest.approx(energies, abs=1e-3)
    assert figures.duration_s == pytest.approx(sum(seconds), abs=1e-3)
    assert figures.energy_pct == pytest.approx(sum(energies), abs=1e-3)
    assert estimate(path, TRAVEL, MOTION, consumption=1.5).energy_pct == pytest.approx(1.5 * sum(energies), abs=2e-3)


def transit(*places: tuple[float, float]) -> float:
    points = [waypoint(Phase.TAKEOFF, 0, 0, 20, 2.0)]
    points += [waypoint(Phase.TRANSIT, east, north, 20, 5.0) for east, north in places]
    return sum(leg.duration_s for leg in estimate(FlightPath("uav1", tuple(points)), TRAVEL, MOTION).legs[1:])


def test_wind_costs_what_its_air_speed_does() -> None:
    wind = SteadyWind(
        3.0, 0.0, (0.0, 10.0), (0.0 + 1e-9, 1.0)
    )  # a tenth of a percent a second for each m/s of air speed
    path = FlightPath(
        "uav1",
        (
            waypoint(Phase.TAKEOFF, 0, 0, 20, 2.0),
            waypoint(Phase.TRANSIT, 100, 0, 20, 5.0, hold=True),
            waypoint(Phase.INSPECT, 150, 0, 20, 1.0, hold=True),
            waypoint(Phase.RETURN, 0, 0, 20, 5.0),
            waypoint(Phase.LAND, 0, 0, 0, 1.0),
        ),
    )
    figures = estimate(path, replace(TRAVEL, wind=wind), MOTION)
    assert figures.duration_s == pytest.approx(estimate(path, TRAVEL, MOTION).duration_s)
    # Out 5 - 3, inspecting 1 - 3, home -5 - 3; in hover the wind itself.
    energies = [10.8 * 0.3, 22.0 * 0.2 + 0.3, 50.4 * 0.2 + 0.3, 32.0 * 0.8, 20.4 * 0.3]
    assert [leg.energy_pct for leg in figures.legs] == pytest.approx(energies, abs=1e-3)


def test_a_gentle_corner_is_flown_through_and_a_sharp_one_is_a_stop() -> None:
    straight = transit((100, 0))
    assert transit((50, 0), (100, 0)) == pytest.approx(straight, abs=1e-3)
    # 100 m around a right angle: one more stop, two ramps of 5 / 5 s.
    assert transit((50, 0), (50, 50)) == pytest.approx(straight + 2.0, abs=1e-3)


def test_a_leg_too_short_for_its_speed_is_a_triangle() -> None:
    # 2 m from rest to rest at 2.5 m/s2: 2 sqrt(2 / 2.5).
    assert transit((2, 0)) == pytest.approx(2 * (2 / 2.5) ** 0.5, abs=1e-3)


def test_a_steep_leg_takes_as_long_as_its_height() -> None:
    points = (waypoint(Phase.TAKEOFF, 0, 0, 20, 2.0), waypoint(Phase.TRANSIT, 10, 0, 60, 5.0, hold=True))
    figures = estimate(FlightPath("uav1", points), TRAVEL, MOTION)
    assert figures.legs[1].duration_s == pytest.approx(40 / 2.0 + 1.0, abs=1e-3)


def test_a_vehicle_on_the_ground_takes_nothing() -> None:
    assert estimate(FlightPath("uav1", ()), TRAVEL, MOTION).duration_s == 0.0
