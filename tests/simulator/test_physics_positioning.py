"""A simulated vehicle without GPS: what it says of its fix, of its estimate and of its place."""

from __future__ import annotations

import pytest

from simulator.config import AutopilotKind
from simulator.physics import ABSOLUTE_S, AIDED, ALONE, DRIFT_M_S2, FAILSAFE_S, Positioning
from tests.simulator.harness import Operator, land, takeoff, waypoint
from tests.simulator.harness import numbered as in_order
from tests.simulator.test_autopilot_people import flying, texts
from tests.simulator.test_fleet_vehicle import KINDS


def test_it_drifts_from_the_moment_of_the_loss_on() -> None:
    known = Positioning()
    assert known.off_m(9.0) == 0.0
    known.lose(10.0, 0.0)
    assert known.off_m(70.0) == pytest.approx(0.5 * DRIFT_M_S2 * 60.0**2)
    assert known.off_m_s(70.0) == pytest.approx(DRIFT_M_S2 * 60.0)
    assert [known.flags(10.0 + seconds) for seconds in (0.0, ABSOLUTE_S - 0.1, ABSOLUTE_S)] == [AIDED, AIDED, ALONE]


def test_its_failsafe_acts_once() -> None:
    known = Positioning()
    known.lose(10.0, 0.0)
    assert [known.acts(10.0 + seconds) for seconds in (FAILSAFE_S - 0.1, FAILSAFE_S, FAILSAFE_S + 0.1)] == [
        False, True, False,
    ]  # fmt: skip


def test_a_loss_may_be_over_before_the_failsafe_acts() -> None:
    known = Positioning()
    known.lose(10.0, 3.0)
    assert known.without_s(12.9) > 0.0
    assert (known.without_s(13.0), known.off_m(13.0), known.acts(20.0)) == (0.0, 0.0, False)


@KINDS
def test_a_vehicle_without_gps_says_so_and_lands(kind: AutopilotKind) -> None:
    flight = flying(kind, "uav1:gps@40s")
    flight.run_until(lambda: "failsafe gps" in flight.what())
    flight.run(2.0)
    if gps := flight.heard("GPS_RAW_INT"):
        assert gps[-1].fix_type == 1
    assert any("EKF Failsafe" in text or "switching to Descend" in text for text in texts(flight))


@KINDS
def test_px4_reckons_on_the_ground_after_a_flight_without_gps(kind: AutopilotKind) -> None:
    name, number = ("ESTIMATOR_STATUS", 230) if kind is AutopilotKind.PX4 else ("EKF_STATUS_REPORT", 193)
    flight, home = Operator(kind), [] if kind is AutopilotKind.PX4 else [waypoint(0.0, 0.0)]
    flight.fly(in_order([*home, takeoff(10.0), land()], 0))
    flight.run(8.0)
    flight.vehicle.positioning.lose(flight.now_s, FAILSAFE_S + 1.0)
    flight.run_until(lambda: not flight.vehicle.frame.armed)
    flight.run(1.0)
    assert flight.telemetry("GPS_RAW_INT", 24)["fix_type"] == flight.vehicle.FIX
    assert flight.telemetry(name, number)["flags"] == (ALONE if kind is AutopilotKind.PX4 else AIDED)
    flight.vehicle.reboot()
    flight.run(20.0)
    assert flight.telemetry(name, number)["flags"] == AIDED


def test_px4_that_kept_its_gps_knows_where_it_stands() -> None:
    flight = Operator(AutopilotKind.PX4)
    flight.fly(in_order([takeoff(10.0), land()], 0))
    flight.run_until(lambda: flight.vehicle.frame.armed and not flight.vehicle.frame.body.on_ground)
    flight.run_until(lambda: not flight.vehicle.frame.armed)
    assert flight.telemetry("ESTIMATOR_STATUS", 230)["flags"] == AIDED
