"""Simulated PX4 behaves as the real one was measured."""

from __future__ import annotations

import math

import pytest

from missions.items import Command, Frame, MissionItem
from simulator.config import AutopilotKind
from simulator.messages import MavCommand, MissionClearAll, MissionCount, MissionSetCurrent, RadioStatus
from simulator.px4 import Px4
from tests.simulator.harness import (
    OTHER,
    PX4_LAND,
    PX4_LOITER,
    PX4_MISSION,
    PX4_RTL,
    Operator,
    land,
    numbered,
    on_wire,
    rtl,
    speed,
    takeoff,
    waypoint,
)


def operator(*, heartbeats: bool = True, **changes: object) -> Operator:
    return Operator(AutopilotKind.PX4, changes, heartbeats=heartbeats)


def mission(*items: MissionItem, current: int | None = 0) -> tuple[MissionItem, ...]:
    return numbered((takeoff(), *items), current)


def cruising(*items: MissionItem, **changes: object) -> Operator:
    """Return a vehicle on its first leg at about its full speed: its trajectory waits for it now and then."""
    op = Operator(AutopilotKind.PX4, changes)
    op.fly(mission(*items))
    op.run_until(lambda: op.vehicle.frame.body.ground_speed_m_s > 4.6)
    return op


def speed_now(op: Operator) -> float:
    return op.vehicle.frame.body.ground_speed_m_s


# Start and reports.


def test_it_streams_unasked() -> None:
    op = operator()
    op.run(10)
    for name, count in (("HEARTBEAT", 10), ("SYS_STATUS", 10), ("BATTERY_STATUS", 5), ("GLOBAL_POSITION_INT", 40)):
        assert count <= len(op.sent(name)) <= count + 1
    assert op.command(MavCommand.SET_MESSAGE_INTERVAL, 147, 200_000) == 0
    op.run(10)
    assert len(op.sent("BATTERY_STATUS", 10.01)) == 50
    assert op.command(MavCommand.SET_MESSAGE_INTERVAL, 147, 0) == 0
    op.run(10)
    assert len(op.sent("BATTERY_STATUS", 20.01)) == 5


def test_a_full_radio_makes_its_streams_rarer_until_it_is_forgotten() -> None:
    op = operator()

    def count(seconds: float) -> int:
        before = len(op.sent("GLOBAL_POSITION_INT"))
        op.run(seconds)
        return len(op.sent("GLOBAL_POSITION_INT")) - before

    op.run(2)
    for _ in range(5):
        op.send(RadioStatus(20))
    op.run(1)
    assert count(3) == pytest.approx(3 * 4 * 0.8**5, abs=1)
    for _ in range(3):
        op.send(RadioStatus(40))
    for _ in range(60):
        op.send(RadioStatus(60))
    assert count(4) == pytest.approx(16, abs=1)
    for _ in range(200):
        op.send(RadioStatus(20))
    op.run(0.3)
    assert count(4) <= 1, "not below 1 %"
    op.run(30)
    assert count(4) == 16, "it hears nothing of its radio any more"


def test_its_streams_keep_to_the_rate_of_its_link() -> None:
    op = operator(rate_bytes_s=300.0)
    asked_bytes_s = op.vehicle.streams.bytes_s
    op.run(60)
    assert asked_bytes_s > 600.0
    assert len(op.sent("GLOBAL_POSITION_INT")) == pytest.approx(60 * 4 * 300.0 / asked_bytes_s, rel=0.1)
    assert len(op.sent("HEARTBEAT")) >= 60


def test_mission_start_arms_and_takes_off() -> None:
    op = operator()
    op.fly(mission(waypoint(100, 0)))
    assert op.vehicle.frame.armed
    assert op.texts()[:2] == ["Armed by mission start\t", "Executing Mission\t"]
    op.run(20)
    assert op.vehicle.frame.body.up_m > 20
    assert op.sent("HEARTBEAT")[-1]["base_mode"] == 157
    assert op.sent("HEARTBEAT")[-1]["custom_mode"] == PX4_MISSION


def test_arm_then_mission_mode_works_too() -> None:
    op = operator()
    op.run(4)
    op.upload(mission(waypoint(100, 0)))
    assert op.arm() == 0
    assert op.mode(PX4_MISSION) == 0
    op.run(20)
    assert op.vehicle.frame.body.up_m > 20


def test_mission_start_right_after_the_ack_is_denied() -> None:
    op = operator()
    op.run(4)
    op.upload(mission(waypoint(100, 0)))
    assert op.command(MavCommand.MISSION_START) == 2
    assert op.texts()[-1] == "Mission start denied! No valid mission\t"
    op.run(1)
    assert op.command(MavCommand.MISSION_START) == 0


def test_mission_mode_without_a_mission_is_refused_once_it_is_armed() -> None:
    op = operator()
    op.run(4)
    assert op.mode(PX4_MISSION) == 0
    assert op.mode(PX4_LOITER) == 0
    assert op.arm() == 0
    assert op.mode(PX4_MISSION) == 1
    assert op.vehicle.mode == PX4_LOITER


def test_a_mode_is_acknowledged_before_it_is_refused() -> None:
    op = operator()
    op.run(4)
    op.arm()
    op.mode(PX4_MISSION)
    assert [ack["result"] for ack in op.sent("COMMAND_ACK")[-2:]] == [0, 1]


def test_without_a_ground_station_it_does_not_arm() -> None:
    op = operator(heartbeats=False)
    op.run(4)
    assert op.arm() == 1
    op.heartbeats = True
    op.run(1)
    assert op.arm() == 0


def test_224_and_193_are_unsupported() -> None:
    op = operator()
    assert op.command(MavCommand.DO_SET_MISSION_CURRENT, 1) == 3
    assert op.command(MavCommand.DO_PAUSE_CONTINUE, 0) == 3


def test_reached_repeats_ten_times_and_the_takeoff_is_overwritten_by_the_speed_item() -> None:
    op = cruising(speed(5), waypoint(200, 0), waypoint(200, 100), rtl())
    seqs = [fields["seq"] for fields in op.sent("MISSION_ITEM_REACHED")]
    assert set(seqs) == {1}
    op.run_until(lambda: op.mission_current()["seq"] == 3)
    seqs = [fields["seq"] for fields in op.sent("MISSION_ITEM_REACHED")]
    assert seqs.count(1) == 11
    assert seqs.count(0) == 0


def test_total_is_the_full_count_and_a_new_index_is_reported_at_once() -> None:
    op = cruising(speed(5), waypoint(60, 0), waypoint(60, 100), rtl())
    current = op.mission_current()
    assert (current["seq"], current["total"], current["mission_state"], current["mission_mode"]) == (2, 5, 3, 1)
    op.run_until(lambda: isinstance(op.vehicle, Px4) and op.vehicle.mission.index == 3)
    changed_s = op.now_s
    op.run(0.1)
    assert op.sent("MISSION_CURRENT", changed_s - 0.06)[-1]["seq"] == 3


def test_the_last_rtl_item_finishes_the_mission_and_returns() -> None:
    op = cruising(speed(5), waypoint(60, 0), rtl())
    op.run_until(lambda: op.vehicle.mode == PX4_RTL)
    assert "Mission finished, loitering\t" in op.texts()
    assert "Returning to launch\t" in op.texts()
    current = op.mission_current()
    assert (current["seq"], current["mission_state"], current["mission_mode"]) == (3, 5, 2)
    op.run_until(lambda: not op.vehicle.frame.armed)
    assert op.vehicle.mode == PX4_MISSION  # what was chosen last, of the modes to arm in
    texts = op.texts()
    wanted = ["RTL: land at destination\t", "Landing detected\t", "Disarmed by landing\t"]
    assert [text for text in texts if text in wanted] == wanted
    assert op.happenings() == ["armed", "mission_started", "took_off", "descends", "landed", "disarmed"]


def test_a_long_text_comes_in_two_parts() -> None:
    op = cruising(speed(5), waypoint(60, 0), rtl())
    op.run_until(lambda: op.vehicle.mode == PX4_RTL)
    op.run(1)
    parts = [fields for fields in op.sent("STATUSTEXT") if fields["id"] != 0]
    assert [fields["chunk_seq"] for fields in parts] == [0, 1]
    assert any(
        text.startswith("RTL: start return at 3") and text.endswith("above destination)\t") for text in op.texts()
    )


def test_a_mission_without_an_end_of_its_own_loiters() -> None:
    op = cruising(speed(5), waypoint(60, 0))
    op.run_until(lambda: op.vehicle.mode == PX4_LOITER)
    op.run(10)
    assert op.vehicle.frame.body.north_m == pytest.approx(60, abs=0.5)
    op.upload(mission(waypoint(0, 100)))
    op.run(5)
    assert op.vehicle.mode == PX4_LOITER
    assert speed_now(op) < 0.1


def test_a_land_item_lands_at_its_place() -> None:
    op = operator()
    op.fly(mission(speed(5), waypoint(60, 0), land(30, 30)))
    op.run_until(lambda: not op.vehicle.frame.armed)
    body = op.vehicle.frame.body
    assert (body.north_m, body.east_m) == pytest.approx((30, 30), abs=0.5)
    assert op.mission_current()["mission_state"] == 5


def test_without_a_takeoff_item_it_climbs_first() -> None:
    op = operator()
    op.fly(numbered((waypoint(60, 0, 2.5),), 0))
    op.run_until(lambda: op.vehicle.frame.body.up_m > 1.6)
    assert op.vehicle.frame.body.ground_speed_m_s < 0.1
    op.run_until(lambda: op.vehicle.frame.body.north_m > 55)


# A new mission while it flies.


def test_with_the_same_next_waypoint_the_speed_stays() -> None:
    op = cruising(speed(5), waypoint(400, 0), waypoint(400, 400))
    assert op.upload(mission(speed(5), waypoint(400, 0), waypoint(400, 200), current=1)) == 0
    for _ in range(60):
        op.run(0.05)
        assert speed_now(op) > 4.4
    assert op.vehicle.mode == PX4_MISSION


def test_without_a_flag_the_old_number_is_kept_and_clamped() -> None:
    op = cruising(speed(5), waypoint(30, 0), waypoint(400, 0), waypoint(400, 400))
    op.run_until(lambda: op.mission_current()["seq"] == 3)
    op.upload(mission(speed(5), waypoint(1, 1), waypoint(0, 300), waypoint(0, 400), current=None))
    assert op.mission_current()["seq"] == 3
    op.run(8)
    assert op.vehicle.frame.body.v_east_m_s > 2
    op.upload(mission(waypoint(300, 0), current=None))
    assert op.mission_current()["seq"] == 1


def test_with_a_flag_it_goes_there_at_once() -> None:
    op = cruising(speed(5), waypoint(400, 0), waypoint(400, 400))
    op.upload(mission(speed(5), waypoint(400, 0), waypoint(0, 400), current=3))
    assert op.mission_current()["seq"] == 3
    op.run(8)
    assert op.vehicle.frame.body.v_east_m_s > 2


def test_an_upload_takes_effect_at_its_last_item_only() -> None:
    op = cruising(speed(5), waypoint(400, 0))
    renewed = mission(speed(5), waypoint(0, 400), current=2)
    op.send(MissionCount(len(renewed), 0))
    for item in renewed[:-1]:
        op.send(on_wire(item))
    op.run(3)
    assert op.vehicle.frame.body.v_north_m_s > 4.4
    op.send(on_wire(renewed[-1]))
    op.run(6)
    assert op.vehicle.frame.body.v_east_m_s > 2


def test_a_takeoff_item_in_the_air_is_flown_as_a_waypoint() -> None:
    op = cruising(speed(5), waypoint(200, 0))
    op.run(10)
    op.upload(mission(speed(5), waypoint(0, 300), current=0))
    op.run(5)
    assert op.vehicle.frame.body.v_north_m_s < -2
    op.run_until(lambda: op.mission_current()["seq"] == 2)
    assert abs(op.vehicle.frame.body.north_m) < 5


def test_the_cruise_speed_survives_an_upload_and_not_a_hold() -> None:
    op = cruising(speed(8), waypoint(900, 0))
    op.run(5)
    op.upload(numbered((waypoint(900, 0), waypoint(900, 90)), 0))
    op.run(5)
    assert speed_now(op) == pytest.approx(8, rel=0.1)
    op.mode(PX4_LOITER)
    op.run(9)
    assert speed_now(op) < 0.1
    op.mode(PX4_MISSION)
    op.run(15)
    assert speed_now(op) == pytest.approx(5, rel=0.1)
    assert op.command(MavCommand.DO_CHANGE_SPEED, 1, 3, -1) == 0
    op.run(6)
    assert speed_now(op) == pytest.approx(3, rel=0.1), "at once, on the leg under way"


@pytest.mark.parametrize("mode", [PX4_LOITER, PX4_RTL])
def test_in_hold_or_rtl_an_upload_changes_list_and_index_only(mode: int) -> None:
    op = cruising(speed(5), waypoint(400, 0))
    op.mode(mode)
    op.upload(mission(speed(5), waypoint(0, 400), current=2))
    op.run(5)
    assert op.vehicle.mode == mode
    assert op.mission_current()["seq"] == 2


def test_an_infeasible_list_is_acknowledged_and_loiters_and_a_good_one_does_not_resume() -> None:
    op = cruising(speed(5), waypoint(400, 0))
    vtol = MissionItem(0, Frame.GLOBAL_RELATIVE_ALT, 85, z=10.0)
    assert op.upload(numbered((waypoint(400, 0), vtol), 0)) == 0
    assert op.vehicle.mode == PX4_LOITER
    assert op.texts()[-1] == "No valid mission available, loitering\t"
    assert op.mission_current()["mission_state"] == 1
    op.upload(mission(speed(5), waypoint(400, 0), current=2))
    op.run(2)
    assert op.vehicle.mode == PX4_LOITER
    assert op.mode(PX4_MISSION) == 0
    op.run(5)
    assert speed_now(op) > 4


def test_trap_the_next_flight_begins_where_the_last_one_ended() -> None:
    op = operator()
    op.fly(mission(waypoint(60, 0), rtl()))
    op.run_until(lambda: not op.vehicle.frame.armed)
    op.upload(mission(speed(5), *(waypoint(100, 20.0 * number) for number in range(8)), current=None))
    assert op.mission_current()["seq"] == 2
    op.run(1)
    op.arm()
    op.mode(PX4_MISSION)
    op.run(2)
    assert op.mission_current()["seq"] == 2


def test_mission_start_begins_at_the_item_that_it_names() -> None:
    op = operator()
    op.fly(mission(waypoint(60, 0), rtl()))
    op.run_until(lambda: not op.vehicle.frame.armed)
    op.run(1)
    assert op.command(MavCommand.MISSION_START, 0) == 0
    op.run(1)
    assert op.mission_current()["seq"] == 0
    op.run_until(lambda: op.vehicle.frame.body.north_m > 50)


def test_a_mission_flown_to_its_end_starts_again_when_it_is_armed_again() -> None:
    op = operator()
    op.fly(mission(speed(5), waypoint(60, 0), land(30, 30)))
    op.run_until(lambda: not op.vehicle.frame.armed)
    op.run(1)
    assert op.arm() == 0
    assert op.mode(PX4_MISSION) == 0
    op.run(1)
    op.run_until(lambda: op.vehicle.frame.body.north_m > 25)  # from its new home, where it landed
    assert "No valid mission available, loitering\t" not in op.texts()


def test_set_current_acts_at_once() -> None:
    op = cruising(speed(5), waypoint(400, 0), waypoint(0, 400))
    op.send(MissionSetCurrent(3))
    assert op.mission_current()["seq"] == 3
    op.run(8)
    assert op.vehicle.frame.body.v_east_m_s > 2


def test_clear_in_flight_holds() -> None:
    op = cruising(speed(5), waypoint(400, 0))
    op.send(MissionClearAll(0))
    assert op.vehicle.mode == PX4_LOITER
    op.run(6)
    assert speed_now(op) < 0.1


@pytest.mark.parametrize(("uploaded", "state"), [(False, 4), (True, 3)])
def test_a_pause_says_paused_only_if_an_item_was_reached_since_the_upload(*, uploaded: bool, state: int) -> None:
    op = cruising(speed(5), waypoint(400, 0))
    if uploaded:
        assert op.upload(numbered((takeoff(), speed(5), waypoint(400, 50)))) == 0
        op.run(2)
    op.mission_current()
    op.mode(PX4_LOITER)
    current = op.mission_current()
    assert (current["mission_state"], current["mission_mode"]) == (state, 2)


def test_an_items_own_radius_counts() -> None:
    op = operator()
    near = MissionItem(
        0, 3, Command.NAV_WAYPOINT, param1=1.0, param2=0.5, x=waypoint(60, 0).x, y=waypoint(60, 0).y, z=25
    )
    op.fly(mission(near, waypoint(60, 60)))
    nearest_m = math.inf
    while op.mission_current()["seq"] in {0, 1}:
        op.run(0.05)
        nearest_m = min(nearest_m, abs(op.vehicle.frame.body.north_m - 60))
    assert nearest_m < 0.5


# Battery.


def test_the_two_percentages_are_rounded_differently() -> None:
    op = operator()
    op.run(4)
    op.vehicle.frame.battery.charge_pct = 80.4
    assert op.telemetry("SYS_STATUS", 1)["battery_remaining"] == 81
    assert op.telemetry("BATTERY_STATUS", 147)["battery_remaining"] == 80


def test_battery_status_is_filled_as_measured() -> None:
    op = operator()
    op.run(4)
    status = op.telemetry("BATTERY_STATUS", 147)
    voltages = status["voltages"]
    assert isinstance(voltages, tuple)
    assert voltages == (16800, *(65535,) * 9)
    assert (status["type"], status["battery_function"], status["energy_consumed"]) == (1, 1, -1)


def test_no_current_sensor_is_minus_100_and_not_minus_1() -> None:
    op = operator(current_sensor=False)
    op.run(4)
    assert op.telemetry("BATTERY_STATUS", 147)["current_battery"] == -100


def test_thresholds_set_the_charge_state_and_the_texts_and_default_only_warns() -> None:
    op = cruising(speed(5), waypoint(900, 0))
    for charge_pct, state, text in (
        (14, 2, "Low battery\t"),
        (6, 3, "Critical battery\t"),
        (4, 4, "Emergency battery level\t"),
    ):
        op.vehicle.frame.battery.charge_pct = charge_pct
        op.run(0.1)
        assert op.telemetry("BATTERY_STATUS", 147)["charge_state"] == state
        assert op.texts()[-1] == text
    assert op.vehicle.mode == PX4_MISSION


def test_critical_holds_five_seconds_then_returns_and_emergency_lands_on_the_spot() -> None:
    op = cruising(speed(5), waypoint(900, 0), parameters={"COM_LOW_BAT_ACT": 3})
    op.vehicle.frame.battery.charge_pct = 6.9
    op.run(0.1)
    assert op.vehicle.mode == PX4_LOITER
    op.run(4.8)
    assert op.vehicle.mode == PX4_LOITER
    op.run(0.3)
    assert op.vehicle.mode == PX4_RTL
    # The mission's own state knows no failsafe: the HEARTBEAT's mode is what counts.
    assert op.mission_current()["mission_state"] == 4
    op.vehicle.frame.battery.charge_pct = 4.9
    op.run(0.1)
    assert op.vehicle.mode == PX4_LAND


# Silence of the ground station.


def test_it_loiters_after_12_s_and_returns_after_17_s() -> None:
    op = cruising(speed(5), waypoint(900, 0))
    op.heartbeats = False
    lost_s = op.vehicle.gcs_heard_s
    assert lost_s is not None
    op.run_until(lambda: op.vehicle.mode == PX4_LOITER)
    assert op.now_s - lost_s == pytest.approx(12, abs=0.2)
    op.run_until(lambda: op.vehicle.mode == PX4_RTL)
    assert op.now_s - lost_s == pytest.approx(17, abs=0.2)


def test_the_return_is_not_cancelled_when_heartbeats_come_back_and_mission_resumes_at_the_index() -> None:
    op = cruising(speed(5), waypoint(900, 0))
    op.heartbeats = False
    op.run(19)
    op.heartbeats = True
    op.run(3)
    assert op.vehicle.mode == PX4_RTL
    seq = op.mission_current()["seq"]
    assert op.mode(PX4_MISSION) == 0
    op.run(7)
    assert op.mission_current()["seq"] == seq
    assert op.vehicle.frame.body.v_north_m_s > 3


def test_a_mode_during_the_hold_cancels_the_return() -> None:
    op = cruising(speed(5), waypoint(900, 0))
    op.heartbeats = False
    op.run(14)
    op.heartbeats = True
    op.run(1)
    op.mode(PX4_MISSION)
    op.run(10)
    assert op.vehicle.mode == PX4_MISSION


@pytest.mark.parametrize(("action", "mode"), [(0, PX4_MISSION), (1, PX4_LOITER), (3, PX4_LAND)])
def test_other_actions(action: int, mode: int) -> None:
    op = cruising(speed(5), waypoint(900, 0), parameters={"NAV_DLL_ACT": action})
    op.heartbeats = False
    op.run(25)
    assert op.vehicle.mode == mode


def test_texts_are_withheld_without_a_listener_and_telemetry_is_not() -> None:
    op = cruising(speed(5), waypoint(900, 0))
    op.heartbeats = False
    op.run(13)
    silent_s = op.now_s
    op.run(10)
    assert op.texts(silent_s) == []
    assert len(op.sent("GLOBAL_POSITION_INT", silent_s)) >= 40
    op.heartbeats = True
    op.run(1.5)
    assert any(text.startswith("RTL: start return") for text in op.texts(silent_s))


def test_any_ground_stations_heartbeat_counts() -> None:
    op = cruising(speed(5), waypoint(900, 0))
    op.heartbeats = False
    for _ in range(25):
        op.run(1)
        op.beat(OTHER)
    assert op.vehicle.mode == PX4_MISSION


# The way home.


@pytest.mark.parametrize(("parameters", "height_m"), [({"RTL_CONE_ANG": 0, "RTL_RETURN_ALT": 40}, 40), ({}, 60)])
def test_rtl_height(parameters: dict[str, float], height_m: float) -> None:
    op = cruising(speed(5), waypoint(300, 0), parameters=parameters)
    op.run(30)
    op.mode(PX4_RTL)
    op.run_until(lambda: op.vehicle.frame.body.v_north_m_s < -3)
    assert op.vehicle.frame.body.up_m == pytest.approx(height_m, abs=0.3)


def test_inside_the_cone_it_climbs_less() -> None:
    op = cruising(speed(5), waypoint(300, 0))
    op.run_until(lambda: op.vehicle.frame.body.north_m > 50)
    op.mode(PX4_RTL)
    op.run_until(lambda: op.vehicle.frame.body.v_north_m_s < -3)
    assert 47 < op.vehicle.frame.body.up_m < 57


def test_unknown_modes_are_accepted_and_change_nothing_and_unknown_auto_modes_are_refused() -> None:
    op = operator()
    assert op.command(MavCommand.DO_SET_MODE, 1, 99, 0) == 0
    assert op.command(MavCommand.DO_SET_MODE, 1, float("nan"), 0) == 0
    assert op.command(MavCommand.DO_SET_MODE, 1, 4, 77) == 1
    assert op.texts()[-1] == "Unsupported auto mode\t"
    assert op.vehicle.mode == PX4_LOITER
