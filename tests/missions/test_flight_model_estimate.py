"""Estimates of whole flights against sums done by hand."""

from __future__ import annotations

from dataclasses import replace

import pytest

from missions import FlightModel, FlightPath, Performance, Phase, Ramp, Waypoint, estimate
from planner import SteadyWind
from tests.missions.builders import FRAME

EVEN = Ramp(2.5, 1e9)
"""As good as without a jerk: a ramp to 5 m/s takes 2 s."""
PERFORMANCE = Performance(
    EVEN, EVEN, climb_m_s=2.0, descent_m_s=1.0, turn_s=0.0, turn_power=2.0, corner_s=0.0, corner_power=1.0,
    settle_s=0.5, accept_m=0.0, hold_s=1.0, spool_s=3.0, take_off_m_s=1.0,
    take_off_below_m=4.0, land_m_s=0.5, land_below_m=5.0, land_fast_m_s=2.0, touch_s=2.0, home_m_s=5.0, home_wait_s=4.0,
)  # fmt: skip
STILL = SteadyWind(0.0, 0.0, (0.0, 10.0), (0.1, 0.1))
MODEL = FlightModel(PERFORMANCE, STILL, transit_speed_m_s=5.0, inspection_speed_m_s=1.0)


def waypoint(phase: Phase, east: float, north: float, up: float, speed: float, *, hold: bool = False) -> Waypoint:
    lat, lon = FRAME.to_wgs84_deg(east, north)
    return Waypoint(phase, lat, lon, up, speed, hold)


OUT_AND_HOME = FlightPath(
    "uav1",
    (
        waypoint(Phase.TAKEOFF, 0, 0, 20, 1.0),
        waypoint(Phase.TRANSIT, 100, 0, 20, 5.0, hold=True),
        waypoint(Phase.INSPECT, 150, 0, 20, 1.0, hold=True),
        waypoint(Phase.RETURN, 0, 0, 20, 5.0),
        waypoint(Phase.LAND, 0, 0, 0, 1.0),
    ),
)
SECONDS = [
    3.0 + 4.0 / 1.0 + 16.0 / 2.0,  # spool, climb
    100.0 / 5.0 + 5.0 / 2.5 + 1.5,  # a stop with its hold
    50.0 / 1.0 + 1.0 / 2.5 + 1.5,
    150.0 / 5.0 + 5.0 / 2.5 + 0.5,  # a stop without one
    15.0 / 2.0 + 5.0 / 0.5 + 2.0,  # fast, slow, and until the motors stop
]


def test_a_flight_is_the_sum_of_its_legs() -> None:
    figures = estimate(OUT_AND_HOME, MODEL)
    climb_pct = 20.0 * 0.04 * 0.1  # four percent more for each m/s of climb
    energies = [0.1 * seconds for seconds in SECONDS]
    energies[0] += climb_pct
    assert [leg.duration_s for leg in figures.legs] == pytest.approx(SECONDS, abs=1e-3)
    assert [leg.energy_pct for leg in figures.legs] == pytest.approx(energies, abs=1e-3)
    assert figures.duration_s == pytest.approx(sum(SECONDS), abs=1e-3)
    assert figures.energy_pct == pytest.approx(sum(energies), abs=1e-3)
    assert estimate(OUT_AND_HOME, MODEL, consumption=1.5).energy_pct == pytest.approx(1.5 * sum(energies), abs=2e-3)


def test_wind_costs_what_its_air_speed_does() -> None:
    """A tenth of a percent a second for each m/s of air speed, the air moving east at 3 m/s."""
    windy = replace(MODEL, power=SteadyWind(3.0, 0.0, (0.0, 10.0), (1e-9, 1.0)))
    figures = estimate(OUT_AND_HOME, windy)
    assert [leg.duration_s for leg in figures.legs] == pytest.approx(SECONDS, abs=1e-3)
    # Out at 5 - 3 = 2 for 18 s; 4 s of ramps, over which the air speed is 3, 0.5, 2 (Simpson), 1.5 s of hover at 3.
    assert figures.legs[1].energy_pct == pytest.approx(
        18.0 * 0.2 + 4.0 * (0.3 + 4 * 0.05 + 0.2) / 6 + 1.5 * 0.3, abs=1e-3
    )
    # Home at 8, through 3, 5.5 and 8.
    assert figures.legs[3].energy_pct == pytest.approx(
        28.0 * 0.8 + 4.0 * (0.3 + 4 * 0.55 + 0.8) / 6 + 0.5 * 0.3, abs=1e-3
    )


def transit(*places: tuple[float, float], model: FlightModel = MODEL) -> float:
    points = [waypoint(Phase.TAKEOFF, 0, 0, 20, 2.0)]
    points += [waypoint(Phase.TRANSIT, east, north, 20, 5.0) for east, north in places]
    return sum(leg.duration_s for leg in estimate(FlightPath("uav1", tuple(points)), model).legs[1:])


def test_a_corner_that_is_passed_takes_more_the_sharper_it_is() -> None:
    passing = replace(MODEL, performance=replace(PERFORMANCE, corner_s=4.0))
    straight = transit((100, 0))
    assert transit((50, 0), (100, 0), model=passing) == pytest.approx(straight, abs=1e-3)
    # At 5 m/s, of 4 s at 8 m/s: a right angle has the sine of 45 degrees, an about-turn all.
    assert transit((50, 0), (50, 50), model=passing) == pytest.approx(straight + 4.0 * 0.5**0.5 * 5.0 / 8.0, abs=1e-3)
    assert transit((50, 0), (0, 0), model=passing) == pytest.approx(straight + 4.0 * 5.0 / 8.0, abs=1e-3)


def test_a_stop_may_count_before_the_end() -> None:
    early = replace(MODEL, performance=replace(PERFORMANCE, accept_m=2.0))
    # The last 2 m are flown while it brakes at 2.5 m/s2.
    braked_s = (2.0 * 2.0 / 2.5) ** 0.5
    assert transit((100, 0), model=early) == pytest.approx(transit((100, 0)) - braked_s, abs=1e-3)
    # Once a way, however many legs it has.
    assert transit((50, 0), (100, 0), model=early) == pytest.approx(transit((100, 0)) - braked_s, abs=1e-3)


def test_a_stop_that_counts_before_it_brakes() -> None:
    early = replace(MODEL, performance=replace(PERFORMANCE, accept_m=8.0))
    # It brakes from 5 m/s in 2 s over 5 m, and flies 3 m before that at speed.
    assert transit((100, 0), model=early) == pytest.approx(transit((100, 0)) - 2.0 - 3.0 / 5.0, abs=1e-3)


def test_a_trajectory_that_waits_takes_its_share_of_the_way_and_a_waypoint_that_is_passed_its_moment() -> None:
    waiting = replace(MODEL, performance=replace(PERFORMANCE, waits=0.1))
    assert transit((100, 0), model=waiting) == pytest.approx(1.1 * (transit((100, 0)) - 0.5) + 0.5, abs=1e-3)
    passing = replace(MODEL, performance=replace(PERFORMANCE, pass_s=0.25))
    assert transit((50, 0), (100, 0), model=passing) == pytest.approx(transit((100, 0)) + 0.25, abs=1e-3)


def test_a_leg_too_short_for_its_speed_is_two_ramps() -> None:
    # 2 m from rest to rest at 2.5 m/s2: 2 sqrt(2 / 2.5).
    assert transit((2, 0)) == pytest.approx(2 * (2 / 2.5) ** 0.5 + 0.5, abs=1e-3)


def test_a_bounded_jerk_rounds_the_ramps() -> None:
    # To 5 m/s at 2.5 m/s2 and 1 m/s3: the acceleration is not reached, 2 sqrt(5) s each, of which half is lost.
    gentle = replace(MODEL, performance=replace(PERFORMANCE, level=Ramp(2.5, 1.0)))
    assert transit((100, 0), model=gentle) == pytest.approx(20.0 + 2 * 5**0.5 + 0.5, abs=1e-3)
    # At 1 m/s2 it is: 5 + 1 s each.
    gentler = replace(MODEL, performance=replace(PERFORMANCE, level=Ramp(1.0, 1.0)))
    assert transit((100, 0), model=gentler) == pytest.approx(20.0 + 6.0 + 0.5, abs=1e-3)
    # 6 m: the peak is 2 m/s, with ramps of 3 s.
    assert transit((6, 0), model=gentler) == pytest.approx(6.0 + 0.5, abs=1e-3)


def test_the_jerk_may_be_built_up_too() -> None:
    """As ArduPilot does: to 5 m/s at 2.5 m/s2 and 1 m/s3 with 0.3 s for the jerk, 4.77 s; to 10 m/s 6.8 s."""
    smooth = replace(MODEL, performance=replace(PERFORMANCE, level=Ramp(2.5, 1.0, 0.3)))
    peak = 0.5 * ((0.09 + 20.0) ** 0.5 - 0.3)
    assert transit((100, 0), model=smooth) == pytest.approx(20.0 + 2 * (0.3 + peak) + 0.5, abs=1e-3)
    # A metre: the peak q of the jerk's time follows from 2 q (0.3 + q)^2 = 1, and the leg takes four (0.3 + q).
    q = 0.606
    assert 2 * q * (0.3 + q) ** 2 == pytest.approx(1.0, abs=6e-3)
    assert transit((1, 0), model=smooth) == pytest.approx(4 * (0.3 + q) + 0.5, abs=2e-2)


def test_after_a_stop_a_turn_takes_its_time() -> None:
    turning = replace(MODEL, performance=replace(PERFORMANCE, turn_s=2.0))
    home = (FlightPath("uav1", OUT_AND_HOME.waypoints[:4]), FlightPath("uav1", OUT_AND_HOME.waypoints[:3]))
    more = [estimate(path, turning).duration_s - estimate(path, MODEL).duration_s for path in home]
    # After the climb nobody knows where it faces: as a right angle; straight on; and back.
    assert more == pytest.approx([1.0 + 2.0, 1.0], abs=1e-3)


def test_a_steep_leg_takes_as_long_as_its_height() -> None:
    points = (waypoint(Phase.TAKEOFF, 0, 0, 20, 2.0), waypoint(Phase.TRANSIT, 10, 0, 60, 5.0, hold=True))
    figures = estimate(FlightPath("uav1", points), MODEL)
    # 40 m up at 2 m/s and a ramp at each end, a stop with its hold.
    assert figures.legs[1].duration_s == pytest.approx(40 / 2.0 + 2.0 / 2.5 + 1.5, abs=1e-3)


def test_a_vehicle_on_the_ground_takes_nothing() -> None:
    assert estimate(FlightPath("uav1", ()), MODEL).duration_s == 0.0


@pytest.mark.parametrize(("there_m", "arrives_m_s"), [(100.0, 5.0), (1.6, 2.0)])
def test_a_faster_approach_takes_a_longer_turn(there_m: float, arrives_m_s: float) -> None:
    """After 100 m it brakes from 5 m/s, after 1.6 m from the 2 m/s of its middle."""
    turning = replace(MODEL, performance=replace(PERFORMANCE, turn_s=4.0, turn_speed_power=2.0))
    there_and_back = FlightPath("uav1", (
        waypoint(Phase.TAKEOFF, 0, 0, 20, 2.0),
        waypoint(Phase.TRANSIT, there_m, 0, 20, 5.0, hold=True),
        waypoint(Phase.RETURN, 0, 0, 20, 5.0),
        waypoint(Phase.LAND, 0, 0, 0, 1.0),
    ))  # fmt: skip
    slow, quick = (estimate(there_and_back, model).legs[2].duration_s for model in (turning, MODEL))
    assert slow - quick == pytest.approx(4.0 * (arrives_m_s / 8.0) ** 2, abs=1e-3)
