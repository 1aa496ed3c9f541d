"""The simulated ArduPilot's battery reports and its failsafes, each behaviour as it was measured."""

from __future__ import annotations

import pytest

from simulator.messages import ParamSet
from tests.simulator.copter import cruising, mission, operator, speed_now
from tests.simulator.harness import (
    AUTO,
    LAND,
    OTHER,
    RTL,
    speed,
    waypoint,
)


def test_battery_status_is_filled_as_measured() -> None:
    op = cruising(speed(5), waypoint(600, 0))
    op.run(60)
    status = op.telemetry("BATTERY_STATUS", 147)
    voltages = status["voltages"]
    assert isinstance(voltages, tuple)
    assert voltages[1:] == (65535,) * 9
    assert 15000 < voltages[0] < 16800
    assert (status["temperature"], status["time_remaining"], status["charge_state"]) == (32767, 0, 1)
    consumed, current, percent = status["current_consumed"], status["current_battery"], status["battery_remaining"]
    assert isinstance(consumed, int)
    assert isinstance(current, int)
    assert consumed > 50
    assert current > 300
    # A coulomb counter, cut off to whole percent.
    assert percent == int(100 * (5000 - consumed) / 5000)


def test_without_a_current_sensor_current_consumed_and_remaining_are_unknown() -> None:
    op = operator(current_sensor=False)
    op.run(5)
    status = op.telemetry("BATTERY_STATUS", 147)
    assert (status["current_battery"], status["current_consumed"], status["battery_remaining"]) == (-1, -1, -1)


def test_capacity_0_makes_the_percentage_unknown() -> None:
    op = operator()
    op.run(5)
    op.send(ParamSet("BATT_CAPACITY", 0.0, 6))
    assert op.telemetry("SYS_STATUS", 1)["battery_remaining"] == -1


LOW_VOLT = {"BATT_LOW_VOLT": 16.0, "BATT_FS_LOW_ACT": 2.0}


def test_low_voltage_must_last_ten_seconds_then_it_returns() -> None:
    op = cruising(speed(5), waypoint(600, 0), parameters=LOW_VOLT)
    op.vehicle.frame.battery.remove_charge(40)
    op.run(9.5)
    assert op.vehicle.mode == AUTO
    op.run(1)
    assert op.vehicle.mode == RTL
    assert any(text.startswith("Battery 1 is low 1") and text.endswith("mAh") for text in op.texts())
    assert "Battery Failsafe" in op.texts()
    assert op.sent("HEARTBEAT", op.now_s - 1.1)[-1]["system_status"] == 5
    assert op.telemetry("BATTERY_STATUS", 147)["charge_state"] == 2
    health = op.telemetry("SYS_STATUS", 1)["onboard_control_sensors_health"]
    assert isinstance(health, int)
    assert health & 0x02000000 == 0


def test_a_low_charge_acts_at_once_and_critical_lands() -> None:
    op = cruising(speed(5), waypoint(600, 0), parameters={"BATT_CRT_MAH": 2500.0, "BATT_FS_CRT_ACT": 1.0})
    op.vehicle.frame.battery.remove_charge(60)
    op.run(0.2)
    assert op.vehicle.mode == LAND
    assert any("Battery 1 is critical" in text for text in op.texts())
    assert op.telemetry("BATTERY_STATUS", 147)["charge_state"] == 3


def test_with_action_0_the_texts_come_and_the_mode_stays() -> None:
    op = cruising(speed(5), waypoint(600, 0), parameters={"BATT_LOW_VOLT": 16.0})
    op.vehicle.frame.battery.remove_charge(40)
    op.run(11)
    assert "Battery Failsafe" in op.texts()
    assert op.vehicle.mode == AUTO


def test_the_battery_failsafe_is_latched_and_auto_overrides_even_out_of_land() -> None:
    op = cruising(speed(5), waypoint(600, 0), parameters={"BATT_CRT_MAH": 2500.0, "BATT_FS_CRT_ACT": 1.0})
    op.vehicle.frame.battery.remove_charge(60)
    op.run(3)
    op.vehicle.frame.battery.charge_pct = 100.0
    assert op.mode(AUTO) == 0
    op.run(5)
    assert op.vehicle.mode == AUTO
    assert op.telemetry("BATTERY_STATUS", 147)["charge_state"] == 3


def test_an_empty_battery_is_a_crash() -> None:
    op = cruising(speed(5), waypoint(600, 0))
    op.vehicle.frame.battery.remove_charge(100)
    op.run(10)
    assert "crash" in op.happenings()


# Silence of the ground station.


def test_the_gcs_failsafe_returns_after_5_s_and_stays_in_rtl_when_it_clears() -> None:
    op = cruising(speed(5), waypoint(600, 0))
    op.heartbeats = False
    op.run(4.0)
    assert op.vehicle.mode == AUTO
    op.run(1.5)
    assert op.vehicle.mode == RTL
    assert op.texts()[-1] == "GCS Failsafe"
    assert op.sent("HEARTBEAT", op.now_s - 1.1)[-1]["system_status"] == 5
    op.heartbeats = True
    op.run(3)
    assert "GCS Failsafe Cleared" in op.texts()
    assert op.vehicle.mode == RTL
    seq = op.mission_current()["seq"]
    assert op.mode(AUTO) == 0
    assert op.mission_current()["seq"] == seq
    op.run(12)
    assert speed_now(op) == pytest.approx(10, abs=0.2)


def test_only_the_configured_ground_station_holds_the_failsafe() -> None:
    op = cruising(speed(5), waypoint(600, 0))
    op.heartbeats = False
    for _ in range(7):
        op.run(1)
        op.beat(OTHER)
    assert op.vehicle.mode == RTL


def test_without_the_failsafe_the_mission_continues_and_nothing_is_reported() -> None:
    op = cruising(speed(5), waypoint(600, 0), parameters={"FS_GCS_ENABLE": 0.0})
    op.heartbeats = False
    op.run(30)
    assert op.vehicle.mode == AUTO
    assert not any("GCS" in text for text in op.texts())


def test_a_ground_station_that_was_never_seen_is_not_missed() -> None:
    op = operator(heartbeats=False)
    op.fly(mission(speed(5), waypoint(300, 0)))
    op.run(30)
    assert op.vehicle.mode == AUTO


# The way home.
