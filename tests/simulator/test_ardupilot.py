"""Simulated ArduPilot behaves as the real one was measured."""

from __future__ import annotations

import math

import pytest

from simulator.messages import MavCommand, MissionCount, MissionSetCurrent, RadioStatus, RequestDataStream
from tests.simulator.copter import HOME, cruising, mission, operator, speed_now
from tests.simulator.harness import (
    AUTO,
    BRAKE,
    GUIDED,
    LAND,
    LOITER,
    RTL,
    Operator,
    land,
    numbered,
    on_wire,
    rtl,
    speed,
    takeoff,
    waypoint,
)


def test_unasked_it_sends_only_heartbeat_timesync_and_text() -> None:
    op = operator()
    op.run(20)
    assert {message.name for _, message in op.log} <= {"HEARTBEAT", "TIMESYNC", "STATUSTEXT"}
    assert 20 <= len(op.sent("HEARTBEAT")) <= 21
    assert 2 <= len(op.sent("TIMESYNC")) <= 3


def test_set_message_interval_and_data_streams_are_followed() -> None:
    op = operator()
    assert op.command(MavCommand.SET_MESSAGE_INTERVAL, 33, 250_000) == 0
    op.run(10)
    assert len(op.sent("GLOBAL_POSITION_INT")) == 40
    assert op.command(MavCommand.SET_MESSAGE_INTERVAL, 33, -1) == 0
    op.run(10)
    assert len(op.sent("GLOBAL_POSITION_INT")) == 40
    op.send(RequestDataStream(0, 2, start=True))
    op.run(10)
    assert len(op.sent("SYS_STATUS")) == 20
    assert len(op.sent("MISSION_CURRENT")) == 20
    assert len(op.sent("EKF_STATUS_REPORT")) == 20


def test_a_full_radio_makes_every_interval_longer_and_an_empty_one_shorter_again() -> None:
    op = operator()
    op.command(MavCommand.SET_MESSAGE_INTERVAL, 33, 200_000)

    def count(seconds: float) -> int:
        before = len(op.sent("GLOBAL_POSITION_INT"))
        op.run(seconds)
        return len(op.sent("GLOBAL_POSITION_INT")) - before

    assert count(12) == 60
    for _ in range(10):
        op.send(RadioStatus(10))
    op.run(2)
    assert count(12) == 15, "0.2 s and ten times 60 ms"
    for _ in range(100):
        op.send(RadioStatus(10))
    op.run(3)
    assert count(22) == 10, "at most 2 s more"
    for _ in range(50):
        op.send(RadioStatus(96))
    op.run(3)
    assert count(12) == 60
    assert len(op.sent("HEARTBEAT")) == pytest.approx(op.now_s, abs=1.1)


def test_it_sends_a_quarter_while_it_asks_for_items() -> None:
    op = operator()
    op.command(MavCommand.SET_MESSAGE_INTERVAL, 33, 200_000)
    op.send(MissionCount(5, 0))
    op.run(1)
    before = len(op.sent("GLOBAL_POSITION_INT"))
    op.run(4)
    assert len(op.sent("GLOBAL_POSITION_INT")) - before == 5


def test_guided_arm_mission_start_works_and_arming_in_auto_is_refused() -> None:
    op = operator()
    op.run(4)
    op.upload(mission(waypoint(100, 0)))
    assert op.mode(AUTO) == 0
    assert op.arm() == 4
    assert op.texts()[-1] == "Arm: Mode not armable"
    assert op.mode(GUIDED) == 0
    assert op.arm() == 0
    assert op.command(MavCommand.MISSION_START) == 0
    assert op.vehicle.mode == AUTO
    op.run(15)
    assert op.vehicle.frame.body.up_m > 20


def test_it_cannot_be_armed_before_it_is_ready() -> None:
    op = operator(ready_after_s=42.0)
    op.run(41)
    op.mode(GUIDED)
    assert op.arm() == 4
    op.run(2)
    assert op.arm() == 0


def test_mission_start_does_not_arm_and_denies_parameters() -> None:
    op = operator()
    op.run(4)
    op.upload(mission(waypoint(100, 0)))
    assert op.command(MavCommand.MISSION_START, 1.0) == 2
    assert op.command(MavCommand.MISSION_START) == 0
    assert not op.vehicle.frame.armed


def test_auto_from_the_ground_needs_a_takeoff() -> None:
    op = operator()
    op.run(4)
    op.upload(numbered((HOME, waypoint(100, 0), rtl())))
    op.mode(GUIDED)
    op.arm()
    assert op.command(MavCommand.MISSION_START) == 4
    assert op.texts()[-1] == "Auto: Missing Takeoff Cmd"


def test_auto_without_a_mission_is_refused_once_it_is_armed() -> None:
    op = operator()
    op.run(4)
    assert op.mode(AUTO) == 0
    assert op.command(MavCommand.MISSION_START) == 0
    assert op.mode(GUIDED) == 0
    assert op.arm() == 0
    assert op.mode(AUTO) == 4
    assert op.command(MavCommand.MISSION_START) == 4


def test_the_first_seconds_after_boot_have_no_battery() -> None:
    op = operator()
    status = op.telemetry("SYS_STATUS", 1)
    assert (status["voltage_battery"], status["current_battery"], status["battery_remaining"]) == (0, -1, -1)
    op.run(3)
    status = op.telemetry("SYS_STATUS", 1)
    assert status["battery_remaining"] == 100


def test_a_do_item_overwrites_the_reached_waypoint() -> None:
    op = operator()
    op.fly(mission(speed(5), waypoint(60, 0), speed(2), waypoint(60, 40), waypoint(60, 80), rtl()))
    op.run_until(lambda: not op.vehicle.frame.armed)
    assert [fields["seq"] for fields in op.sent("MISSION_ITEM_REACHED")] == [2, 4, 5, 6, 7]


def test_total_leaves_home_out_and_the_end_is_index_0_state_5_auto_disarmed() -> None:
    op = operator()
    op.fly(mission(waypoint(60, 0), rtl()))
    current = op.mission_current()
    assert (current["seq"], current["total"], current["mission_state"], current["mission_mode"]) == (1, 3, 3, 1)
    op.run_until(lambda: not op.vehicle.frame.armed)
    op.run(1)
    current = op.mission_current()
    assert (current["seq"], current["total"], current["mission_state"], current["mission_mode"]) == (0, 3, 5, 1)
    assert op.vehicle.mode == AUTO
    assert op.happenings() == ["armed", "mission_started", "took_off", "descends", "landed", "disarmed"]


def test_leaving_auto_is_not_started_and_never_paused() -> None:
    op = cruising(speed(5), waypoint(300, 0))
    op.mode(BRAKE)
    current = op.mission_current()
    assert (current["seq"], current["mission_state"], current["mission_mode"]) == (3, 2, 0)


# A new mission while it flies in AUTO.


def test_a_speed_item_in_the_place_of_the_waypoint_flown_to_runs_the_index_ahead() -> None:
    """As measured: the index moves on to the old list's next waypoint, whose place a speed item takes next."""
    op = operator()
    op.fly(mission(waypoint(100, 0), speed(8), waypoint(200, 0), speed(3), waypoint(300, 0), rtl()))
    op.run_until(lambda: op.vehicle.frame.body.north_m > 20)
    assert op.mission_current()["seq"] == 2
    renewed = mission(speed(8), waypoint(100, 0), speed(3), waypoint(100, 50), speed(8), waypoint(100, 100), rtl())
    assert op.upload(renewed) == 0
    op.run(1)
    assert op.mission_current()["seq"] == 7


def test_each_stored_item_restarts_the_leg() -> None:
    op = cruising(speed(5), waypoint(400, 0), waypoint(400, 400))
    began_s = op.now_s
    renewed = mission(speed(5), waypoint(400, 0), *(waypoint(400, 20 * number) for number in range(1, 7)))
    assert len(renewed) == 10
    assert op.upload(renewed) == 0
    texts = op.texts(began_s)
    assert texts.count("Auto mission changed, restarted command") == 9
    assert texts.count("Mission: 3 WP") == 9
    assert op.mission_current()["seq"] == 3


def test_an_upload_dips_the_speed_and_it_recovers() -> None:
    op = cruising(speed(5), waypoint(400, 0), waypoint(400, 400))
    op.upload(mission(speed(5), waypoint(400, 0), waypoint(400, 300)))
    lowest = 5.0
    for _ in range(60):
        op.run(0.05)
        lowest = min(lowest, speed_now(op))
    assert 1.4 <= lowest <= 1.9
    op.run(4)
    assert speed_now(op) > 4.5


def test_a_slow_upload_makes_it_crawl() -> None:
    op = cruising(speed(5), waypoint(400, 0), waypoint(400, 400))
    assert (
        op.upload(mission(speed(5), waypoint(400, 0), *(waypoint(400, 9.0 * n) for n in range(1, 7))), pause_s=1) == 0
    )
    assert speed_now(op) == pytest.approx(0.8, abs=0.45)


def test_it_flies_to_the_old_waypoint_until_the_item_at_the_index_is_replaced() -> None:
    op = cruising(speed(5), waypoint(400, 0), waypoint(400, 400))
    renewed = mission(speed(5), waypoint(0, 400), waypoint(100, 400))
    op.send(MissionCount(len(renewed), 0))
    for item in renewed[:3]:
        op.send(on_wire(item))
    op.run(4)
    assert op.vehicle.frame.body.v_north_m_s > 1
    op.send(on_wire(renewed[3]))
    op.run(6)
    assert op.vehicle.frame.body.v_east_m_s > 1


def test_an_abandoned_upload_leaves_a_mixture_that_is_being_flown() -> None:
    op = cruising(speed(5), waypoint(200, 0), waypoint(200, 200), waypoint(0, 200))
    op.send(MissionCount(6, 0))
    renewed = mission(speed(5), waypoint(150, 0), waypoint(150, 150))
    for item in renewed[:4]:
        op.send(on_wire(item))
    op.run(10)
    assert "Mission upload timeout" in op.texts()
    op.run_until(lambda: op.vehicle.frame.body.north_m > 198, 200)  # the old item 4 after the new item 3
    assert op.vehicle.frame.body.east_m > 100


def test_a_mission_shorter_than_the_index_ends_with_the_stale_next_leg() -> None:
    op = cruising(speed(5), waypoint(10, 0), waypoint(200, 0), waypoint(200, 100), waypoint(200, 200))
    op.run_until(lambda: op.mission_current()["seq"] == 4)
    assert op.upload(numbered((HOME, takeoff()))) == 0
    assert op.mission_current()["seq"] == 4
    op.run_until(lambda: op.mission_current()["mission_state"] == 5, 200)
    assert op.vehicle.frame.body.north_m == pytest.approx(200, abs=5)
    op.run(60)
    place = op.vehicle.frame.body.place
    assert (place.north_m, place.east_m) == pytest.approx((200, 100), abs=1)
    assert op.vehicle.mode == AUTO


def test_rtl_at_the_index_returns_at_once() -> None:
    op = cruising(speed(5), waypoint(300, 0), waypoint(300, 300))
    op.run(20)
    assert op.upload(mission(speed(5), rtl())) == 0
    op.run(8)
    assert op.vehicle.frame.body.v_north_m_s < -2
    assert op.mission_current()["seq"] == 3


def test_an_upload_during_takeoff_has_no_effect_on_it() -> None:
    op = operator()
    op.fly(mission(speed(5), waypoint(100, 0)))
    op.run(6)
    began_s = op.now_s
    assert op.upload(mission(speed(5), waypoint(0, 100))) == 0
    assert "Auto mission changed, restarted command" not in op.texts(began_s)
    op.run_until(lambda: speed_now(op) > 3)
    assert op.vehicle.frame.body.v_east_m_s > 2.9


def test_an_upload_during_rtl_has_no_effect() -> None:
    op = cruising(speed(5), waypoint(300, 0))
    op.mode(RTL)
    op.upload(mission(speed(5), waypoint(0, 100)))
    op.run_until(lambda: not op.vehicle.frame.armed)
    assert math.hypot(op.vehicle.frame.body.north_m, op.vehicle.frame.body.east_m) < 0.5


@pytest.mark.parametrize("by_message", [True, False])
def test_set_current_acts_at_once(by_message: bool) -> None:
    op = cruising(speed(5), waypoint(300, 0), waypoint(0, 300))
    if by_message:
        op.send(MissionSetCurrent(4))
    else:
        assert op.command(MavCommand.DO_SET_MISSION_CURRENT, 4) == 0
    assert op.mission_current()["seq"] == 4
    op.run(8)
    assert op.vehicle.frame.body.v_east_m_s > 2


def test_a_bad_index_is_denied_by_command_and_silent_by_message() -> None:
    op = cruising(speed(5), waypoint(300, 0))
    assert op.command(MavCommand.DO_SET_MISSION_CURRENT, 99) == 2
    assert op.send(MissionSetCurrent(99)) == []
    assert op.mission_current()["seq"] == 3


def test_setting_a_waypoint_skips_the_speed_before_it_and_setting_the_do_item_does_not() -> None:
    op = cruising(speed(5), waypoint(300, 0), speed(2), waypoint(300, 300))
    op.command(MavCommand.DO_SET_MISSION_CURRENT, 5)
    op.run(10)
    assert speed_now(op) == pytest.approx(5, abs=0.1)
    op.command(MavCommand.DO_SET_MISSION_CURRENT, 4)
    assert op.mission_current()["seq"] == 5
    op.run(10)
    assert speed_now(op) == pytest.approx(2, abs=0.1)


def test_index_0_acts_as_1_and_a_takeoff_in_the_air_finishes_at_once() -> None:
    op = cruising(speed(5), waypoint(100, 0), waypoint(100, 300))
    op.run_until(lambda: op.mission_current()["seq"] == 4)
    op.run(10)
    op.command(MavCommand.DO_SET_MISSION_CURRENT, 0)
    op.run(0.2)
    assert op.mission_current()["seq"] == 3


def test_after_a_completed_mission_only_mission_start_flies_again() -> None:
    op = cruising(speed(5), waypoint(30, 0))
    op.run_until(lambda: op.mission_current()["mission_state"] == 5)
    op.upload(numbered((HOME, waypoint(0, 200))))
    op.command(MavCommand.DO_SET_MISSION_CURRENT, 1)
    assert op.mode(AUTO) == 0
    op.run(5)
    assert speed_now(op) < 0.3
    assert op.command(MavCommand.MISSION_START) == 0
    op.run(5)
    assert op.vehicle.frame.body.v_east_m_s > 2


def test_way_a_brake_clear_upload_auto_starts_at_item_1() -> None:
    op = cruising(speed(5), waypoint(300, 0), waypoint(300, 300))
    op.mode(BRAKE)
    op.run(4)
    assert speed_now(op) < 0.2
    op.upload(numbered((HOME, speed(3), waypoint(0, 300))))
    op.command(MavCommand.DO_SET_MISSION_CURRENT, 1)
    assert op.mode(AUTO) == 0
    op.run(10)
    assert op.vehicle.frame.body.v_east_m_s == pytest.approx(3 * math.sin(math.atan2(300, 70)), abs=0.3)


def test_way_b_stay_in_auto_upload_and_set_index_1() -> None:
    op = cruising(speed(5), waypoint(300, 0), waypoint(300, 300))
    op.upload(numbered((HOME, speed(3), waypoint(0, 300))))
    assert op.command(MavCommand.DO_SET_MISSION_CURRENT, 1) == 0
    op.run(12)
    assert speed_now(op) == pytest.approx(3, abs=0.1)
    assert op.vehicle.frame.body.v_east_m_s > 2


def test_loiter_is_no_pause_it_sinks_at_2_5_m_s() -> None:
    op = cruising(speed(5), waypoint(300, 0))
    op.mode(LOITER)
    op.run(4)
    height_m = op.vehicle.frame.body.up_m
    op.run(2)
    assert height_m - op.vehicle.frame.body.up_m == pytest.approx(5, abs=0.1)


def test_brake_stops_and_keeps_its_height() -> None:
    op = cruising(speed(5), waypoint(300, 0))
    op.mode(BRAKE)
    op.run(10)
    assert speed_now(op) < 0.05
    assert op.vehicle.frame.body.up_m == pytest.approx(25, abs=0.1)


# Speed.


def test_the_speed_is_lost_at_every_mode_change() -> None:
    op = cruising(speed(5), waypoint(600, 0))
    op.mode(BRAKE)
    op.run(4)
    op.mode(AUTO)
    op.run(10)
    assert speed_now(op) == pytest.approx(10, abs=0.1)
    assert op.command(MavCommand.DO_CHANGE_SPEED, 1, 3) == 0
    op.run(6)
    assert speed_now(op) == pytest.approx(3, abs=0.1), "at once, on the leg under way"


def leg_time_s(op: Operator, index: int) -> float:
    op.run_until(lambda: op.mission_current()["seq"] == index)
    return op.run_until(lambda: op.mission_current()["seq"] != index)


@pytest.mark.parametrize(("length_m", "measured_s"), [(40, 9.6), (60, 42.0), (100, 82.0)])
def test_a_slow_down_at_a_pass_through_corner_comes_late_or_never(length_m: float, measured_s: float) -> None:
    op = operator()
    op.fly(mission(speed(5), waypoint(100, 0), speed(1), waypoint(100, length_m), waypoint(100, 500)))
    assert leg_time_s(op, 5) == pytest.approx(measured_s, rel=0.2)


def test_with_a_hold_before_it_the_slow_leg_is_exact() -> None:
    op = operator()
    op.fly(mission(speed(5), waypoint(100, 0, hold_s=1), speed(1), waypoint(100, 60), waypoint(100, 500)))
    assert 60 / leg_time_s(op, 5) == pytest.approx(0.97, abs=0.04)


def test_a_hold_is_waited_for() -> None:
    op = operator()
    op.fly(mission(speed(5), waypoint(100, 0, hold_s=7), waypoint(100, 60)))
    op.run_until(lambda: op.vehicle.frame.body.north_m > 99.5)
    assert op.run_until(lambda: op.mission_current()["seq"] != 3) > 6.9


# Battery.


def test_rtl_goes_home_at_rtl_alt_or_higher_and_lands_on_its_pad() -> None:
    op = cruising(speed(5), waypoint(300, 0), parameters={"RTL_ALT": 4000.0})
    op.run(20)
    op.mode(RTL)
    highest_m, flown_home = 0.0, []
    while op.vehicle.frame.armed:
        op.run(0.5)
        body = op.vehicle.frame.body
        highest_m = max(highest_m, body.up_m)
        if math.hypot(body.north_m, body.east_m) > 1 and body.v_north_m_s < -1:
            flown_home.append(body.up_m)
    assert highest_m == pytest.approx(40, abs=0.2)
    assert min(flown_home) > 39.5
    assert math.hypot(op.vehicle.frame.body.north_m, op.vehicle.frame.body.east_m) < 0.3


def test_rtl_from_above_keeps_its_height() -> None:
    op = cruising(speed(5), waypoint(300, 0), parameters={"RTL_ALT": 1500.0})
    op.run(20)
    op.mode(RTL)
    op.run(12)
    assert op.vehicle.frame.body.up_m == pytest.approx(25, abs=0.2)


def test_it_lands_slowly_below_ten_metres() -> None:
    op = cruising(speed(5), waypoint(300, 0))
    op.mode(LAND)
    op.run_until(lambda: op.vehicle.frame.body.up_m < 15)
    assert op.vehicle.frame.body.v_up_m_s == pytest.approx(-1.5, abs=0.05)
    op.run_until(lambda: op.vehicle.frame.body.up_m < 8)
    assert op.vehicle.frame.body.v_up_m_s == pytest.approx(-0.5, abs=0.05)


def test_a_land_item_lands_at_its_place() -> None:
    op = operator()
    op.fly(mission(speed(5), waypoint(60, 0), land(30, 30)))
    op.run_until(lambda: not op.vehicle.frame.armed)
    body = op.vehicle.frame.body
    assert (body.north_m, body.east_m) == pytest.approx((30, 30), abs=0.5)


def test_after_its_own_landing_the_list_starts_again_with_the_motors_off() -> None:
    op = operator()
    op.fly(mission(speed(5), waypoint(60, 0), land(30, 30)))
    op.run_until(lambda: not op.vehicle.frame.armed)
    op.run(20)
    assert not op.vehicle.frame.armed
    current = op.mission_current()
    assert (current["seq"], current["mission_state"]) == (1, 3)
    assert op.texts()[-1] == "Mission: 1 Takeoff"


def test_a_list_that_begins_with_a_command_is_gone_through_after_the_landing() -> None:
    op = operator()
    op.fly(numbered((HOME, speed(5), takeoff(), waypoint(40, 0), land())))
    op.run_until(lambda: not op.vehicle.frame.armed)
    assert op.mission_current()["seq"] == 2
    assert op.texts()[-2:] == ["Mission: 1 ChangeSpeed", "Mission: 2 Takeoff"]


def test_a_pause_keeps_the_item_and_says_paused() -> None:
    op = cruising(speed(5), waypoint(400, 0), rtl())
    assert op.command(MavCommand.DO_PAUSE_CONTINUE, 0) == 0
    op.run(6)
    assert speed_now(op) < 0.1
    assert (op.mission_current()["seq"], op.mission_current()["mission_state"]) == (3, 4)
    said = len(op.texts())
    assert op.command(MavCommand.DO_PAUSE_CONTINUE, 1) == 0
    op.run(6)
    assert speed_now(op) > 4
    assert (op.mission_current()["mission_state"], len(op.texts())) == (3, said)
    assert op.mode(RTL) == 0
    assert op.command(MavCommand.DO_PAUSE_CONTINUE, 0) == 4
    assert op.texts()[-1] == "Failed to pause"


def test_a_landed_vehicle_flies_again_from_the_beginning() -> None:
    op = operator()
    op.fly(mission(speed(5), waypoint(60, 0), rtl()))
    op.run_until(lambda: not op.vehicle.frame.armed)
    op.mode(GUIDED)
    assert op.arm() == 0
    assert op.command(MavCommand.MISSION_START) == 0
    op.run_until(lambda: op.vehicle.frame.body.north_m > 50)


def test_armed_on_the_ground_it_disarms_by_itself() -> None:
    op = operator()
    op.run(4)
    op.mode(GUIDED)
    op.arm()
    op.run(9.5)
    assert op.vehicle.frame.armed
    op.run(1)
    assert not op.vehicle.frame.armed


def test_pause_and_continue_in_auto() -> None:
    op = cruising(speed(5), waypoint(600, 0))
    assert op.command(MavCommand.DO_PAUSE_CONTINUE, 0) == 0
    op.run(5)
    assert speed_now(op) < 0.1
    assert op.command(MavCommand.DO_PAUSE_CONTINUE, 1) == 0
    op.run(5)
    assert speed_now(op) > 4


def test_it_says_what_it_is() -> None:
    op = operator()
    assert op.command(MavCommand.DO_SEND_BANNER) == 0
    assert op.texts()[-2:] == ["ArduCopter V4.7.0-dev (00000000)", "Frame: QUAD/X"]


def test_unknown_modes_and_commands_are_refused() -> None:
    op = operator()
    assert op.mode(99) == 4
    assert op.command(31000) == 3
    assert op.command(MavCommand.DO_SET_MODE, float("nan"), float("nan")) == 4
    assert op.command(MavCommand.REQUEST_MESSAGE, 300) == 4
