"""Flights from launch to landing: losses with their reasons, starts and returns."""

from __future__ import annotations

from dataclasses import replace

import pytest

from executor.core import fleet_step
from executor.core.interface.commands import Disarm, Finish, LandNow, Level, SendHome, Start
from executor.core.interface.events import Heard, LaunchOrdered, ReturnAllOrdered, ReturnEnded, StartEnded, Tick
from executor.core.interface.intents import Action
from executor.core.interface.messages import StatusText
from executor.core.state.vehicle_state import TRANSITIONS, FaultKind, Stage, VehicleState, change_stage
from tests.executor.builders import THREE, fleet_of
from tests.executor.core.stories import EVERYTHING, FLEET, TIMEOUT_S, story, under_way
from tests.fakes.flight import Story

RTL, LAND, SMART_RTL = 6, 9, 21


@pytest.mark.parametrize("autopilot", ["ardupilot", "px4"])
def test_a_flight_without_a_fault(autopilot: str) -> None:
    flight = story(fleet_of(autopilot=autopilot))
    flight.finish()
    assert set(flight.state.coverage.inspected) == EVERYTHING
    assert {flight.stage(name) for name in THREE} == {Stage.LANDED}
    assert flight.given(Finish) == [Finish("all segments inspected")]
    assert flight.solves() == []
    assert flight.said(Level.WARNING) == []
    assert flight.state.progress.separation_m is not None
    assert flight.state.progress.separation_m >= 5.0


def test_nothing_flies_before_the_launch() -> None:
    flight = Story(FLEET.context, dict(FLEET.boards))
    flight.pass_s(5.0)
    assert flight.commands == []
    flight.launch()
    assert flight.given(Start) == [Start(name) for name in THREE]


def test_lines_are_kept_to_a_hundredth_of_a_second() -> None:
    state, _ = fleet_step.step(FLEET.context, under_way().state, ReturnAllOrdered(), 40.12345)
    assert state.crew.said[-1].at_s == 40.12


def test_a_silent_link_is_a_fault_at_its_time_out() -> None:
    flight = under_way()
    flight.crafts["uav2"].mute = True
    silent_s = flight.now_s
    found_s = flight.run(lambda: flight.stage("uav2") is Stage.LOST)
    assert TIMEOUT_S <= found_s - silent_s <= TIMEOUT_S + 0.4
    fault = flight.vehicle("uav2").fault
    assert fault is not None
    assert (fault.kind, fault.detected_s) == (FaultKind.LINK, found_s)
    flight.finish()
    assert set(flight.state.coverage.inspected) == EVERYTHING
    assert 2 not in [segment for segment, by in flight.state.coverage.inspected.items() if by == "uav2"]
    [record] = flight.state.replanning.records
    assert (record.feasible, record.uncovered, record.begun_s) == (True, (), found_s)
    assert record.ended_s - record.begun_s < 2.0


def test_silence_is_reported_before_it_is_a_fault() -> None:
    flight = under_way()
    flight.crafts["uav2"].mute = True
    flight.pass_s(5.0)
    assert flight.said(Level.WARNING) == ["uav2: no message for 3.2 s"]
    flight.crafts["uav2"].mute = False
    flight.finish()
    assert "uav2: link regained" in flight.said(Level.INFO)
    assert flight.said(Level.FAULT) == []


def test_all_silent_at_once_is_our_own_fault_first() -> None:
    flight = under_way()
    for craft in flight.crafts.values():
        craft.mute = True
    flight.pass_s(50.0)
    assert "all links lost: suspecting the ground radio; re-planning suspended" in flight.said()
    assert flight.said(Level.FAULT) == []
    assert flight.solves() == []


def test_a_restored_radio_loses_no_vehicle() -> None:
    """The first vehicle that is heard again must not make the others, a moment later, look lost."""
    flight = under_way()
    for craft in flight.crafts.values():
        craft.mute = True
    flight.pass_s(30.0)
    for name in ("uav1", "uav3", "uav2"):
        flight.crafts[name].mute = False
        flight.pass_s(2.0)
    assert "links regained" in flight.said(Level.INFO)
    assert flight.said(Level.FAULT) == []


def test_a_vehicle_without_messages_after_the_radio_is_back_is_lost() -> None:
    flight = under_way()
    for craft in flight.crafts.values():
        craft.mute = True
    flight.pass_s(30.0)
    flight.crafts["uav1"].mute = flight.crafts["uav3"].mute = False
    back_s = flight.now_s
    found_s = flight.run(lambda: flight.stage("uav2") is Stage.LOST)
    assert TIMEOUT_S - 0.4 <= found_s - back_s <= TIMEOUT_S + 0.4


def test_our_own_sleep_is_no_silence() -> None:
    flight = under_way()
    flight.sleep_s(30.0)
    flight.happen(Tick())
    assert flight.said(Level.WARNING) == ["the ground station stalled for 30.0 s"]
    flight.pass_s(TIMEOUT_S + 2.0)
    assert flight.said(Level.FAULT) == []


def test_a_regained_vehicle_is_given_rtl_and_never_its_mission() -> None:
    flight = under_way()
    lost = flight.crafts["uav2"]
    lost.mute = True
    flight.run(lambda: flight.stage("uav2") is Stage.LOST)
    flight.pass_s(3.0)
    lost.mute = False
    flight.step()
    assert flight.stage("uav2") is Stage.RETURNING
    assert flight.sent_home() == ["uav2"]
    before = dict(flight.state.coverage.inspected)
    flight.finish()
    assert flight.stage("uav2") is Stage.LANDED
    assert not {"uav2"} & {by for segment, by in flight.state.coverage.inspected.items() if segment not in before}
    assert all(offer.vehicle != "uav2" for problem in flight.solves() for offer in problem.survivors)
    assert flight.given(Start).count(Start("uav2")) == 1
    assert set(flight.state.coverage.inspected) == EVERYTHING


def back_and_refusing(answers: list[ReturnEnded]) -> Story:
    """Return a flight in which uav2 was lost, is heard again, and answers its return like this."""
    flight = under_way()
    flight.crafts["uav2"].mute = True
    flight.run(lambda: flight.stage("uav2") is Stage.LOST)
    flight.crafts["uav2"].mute = False
    flight.return_results["uav2"] = answers
    flight.pass_s(30.0)
    return flight


def test_a_return_that_was_refused_is_ordered_again() -> None:
    refused = ReturnEnded("uav2", accepted=False, reason="change of mode: denied", refused=True)
    flight = back_and_refusing([refused, refused])
    assert flight.sent_home() == ["uav2"] * 3


def test_a_return_that_got_lost_is_ordered_again() -> None:
    lost = ReturnEnded("uav2", accepted=False, reason="change of mode: no acknowledgement", lost=True)
    flight = back_and_refusing([lost])
    assert flight.sent_home() == ["uav2"] * 2


def test_a_return_that_was_acknowledged_is_never_ordered_again() -> None:
    """Whoever keeps it from following has his reasons: no timer works against a mode."""
    ignored = ReturnEnded("uav2", accepted=False, reason="does not report the new mode")
    flight = back_and_refusing([ignored])
    assert flight.sent_home() == ["uav2"]
    assert "uav2: acknowledged the order but does not follow it; not commanded again" in flight.said(Level.WARNING)


def lost_uav2(mode: int | None = None, *, landed: bool = False) -> Story:
    """Return a flight in which uav2 was silent for long enough, and what it did meanwhile."""
    flight = under_way()
    lost = flight.crafts["uav2"]
    lost.mute = True
    flight.run(lambda: flight.stage("uav2") is Stage.LOST)
    if landed:
        lost.armed, lost.up_m = False, 0.0
        lost.place_m = flight.context.vehicles["uav2"].pad_m
    if mode is not None:
        lost.mode = mode
    lost.mute = False
    return flight


def test_a_lost_vehicle_reporting_from_its_pad_has_landed() -> None:
    flight = lost_uav2(RTL, landed=True)
    flight.pass_s(3.0)
    assert flight.stage("uav2") is Stage.LANDED
    assert flight.sent_home() == [], "it is in no mode that could take off"


def test_a_lost_vehicle_reporting_from_the_ground_elsewhere_is_down() -> None:
    flight = under_way()
    flight.crafts["uav2"].mute = True
    flight.run(lambda: flight.stage("uav2") is Stage.LOST)
    flight.crafts["uav2"].armed, flight.crafts["uav2"].up_m, flight.crafts["uav2"].mute = False, 0.0, False
    flight.pass_s(3.0)
    assert flight.stage("uav2") is Stage.DOWN
    assert flight.said(Level.FAULT)[-1].startswith("uav2: link regained, down at 49.59")


def test_a_lost_vehicle_landed_in_mission_mode_is_given_rtl_and_stays_there() -> None:
    flight = lost_uav2(landed=True)
    flight.pass_s(12.0)
    assert flight.stage("uav2") is Stage.LANDED
    assert flight.sent_home() == ["uav2"]
    assert flight.given(Start).count(Start("uav2")) == 1
    flight.finish()
    assert set(flight.state.coverage.inspected) == EVERYTHING
    assert flight.vehicle("uav2").stage is Stage.LANDED


def test_what_a_lost_vehicle_says_before_its_first_heartbeat_decides_nothing() -> None:
    """The heartbeat on record is from before the silence: it may have landed, or come home, since."""
    flight = lost_uav2(landed=True)
    flight.happen(Heard("uav2", flight.crafts["uav2"].position(flight.now_s)))
    assert flight.stage("uav2") is Stage.LOST
    assert flight.sent_home() == []
    flight.happen(Heard("uav2", flight.crafts["uav2"].heartbeat()))
    assert flight.stage("uav2") is Stage.LANDED


@pytest.mark.parametrize("mode", [LAND, RTL, SMART_RTL])
def test_a_lost_vehicle_on_its_failsafe_rtl_is_left_alone(mode: int) -> None:
    flight = lost_uav2(mode)
    flight.run(lambda: flight.stage("uav2") is Stage.RETURNING)
    flight.pass_s(12.0)
    assert flight.sent_home() == []


@pytest.mark.parametrize(("mode", "name"), [(LAND, "LAND"), (RTL, "RTL"), (SMART_RTL, "SMART_RTL")])
def test_a_battery_failsafe_that_brings_it_home_or_down_is_not_overruled(mode: int, name: str) -> None:
    """A landing on the last of a battery must not become a flight home."""
    flight = under_way()
    flight.happen(Heard("uav2", StatusText(4, "Battery Failsafe")))
    flight.crafts["uav2"].mode = mode
    flight.run(lambda: flight.vehicle("uav2").fault is not None)
    fault = flight.vehicle("uav2").fault
    assert fault is not None
    assert (fault.kind, fault.reason) == (
        FaultKind.BATTERY, "it says: Battery Failsafe"
    )  # fmt: skip
    assert flight.sent_home() == []
    flight.pass_s(12.0)
    assert flight.sent_home() == []
    flight.crafts["uav2"].go_home()
    flight.finish()
    assert set(flight.state.coverage.inspected) == EVERYTHING


def test_a_vehicle_that_disarms_on_its_pad_instead_of_taking_off_is_planned_around() -> None:
    """It would start, disarm and be given its segments again and again."""
    flight = Story(FLEET.context, dict(FLEET.boards))
    flight.launch()
    stays = flight.crafts["uav2"]
    stays.goals_m = [(*stays.place_m, 0.0)] * len(stays.goals_m)
    flight.run(lambda: flight.stage("uav2") is Stage.FLYING and flight.vehicle("uav2").armed)
    stays.armed = False
    flight.finish()
    assert flight.said(Level.FAULT)[0].startswith("uav2: interruption, disarmed on its pad before it took off")
    assert flight.given(Start).count(Start("uav2")) == 1
    assert set(flight.state.coverage.inspected) == EVERYTHING


def test_a_start_that_fails_is_tried_again() -> None:
    flight = Story(FLEET.context, dict(FLEET.boards))
    denied = StartEnded("uav2", accepted=False, reason="arm: denied")
    flight.start_results["uav2"] = [denied, denied]
    flight.launch()
    flight.finish()
    assert flight.given(Start).count(Start("uav2")) == 3
    assert set(flight.state.coverage.inspected) == EVERYTHING
    assert flight.said(Level.WARNING) == ["uav2: did not start (arm: denied); trying again"] * 2


@pytest.mark.parametrize("airborne", [False, True])
def test_a_start_that_a_new_mission_breaks_off_is_gone_on_with(airborne: bool) -> None:
    """It waits until it may arm while another is lost; or it is in the air, and its confirmation is still to come."""
    flight = Story(FLEET.context, dict(FLEET.boards), start_s={"uav3": 300.0})
    flight.launch()
    if airborne:
        flight.pass_s(2.0)
        flight.crafts["uav3"].begin()
    flight.run(lambda: flight.inspecting("uav2", 2))
    assert flight.stage("uav3") is Stage.STARTING
    flight.crafts["uav2"].battery_pct -= 30.0
    flight.finish()
    assert [upload.vehicle for upload in flight.uploads()].count("uav3") == 1
    assert flight.given(Start).count(Start("uav3")) == (1 if airborne else 2)
    assert set(flight.state.coverage.inspected) == EVERYTHING
    assert flight.stage("uav3") is Stage.LANDED


def test_a_vehicle_that_never_starts_is_planned_around() -> None:
    flight = Story(FLEET.context, dict(FLEET.boards))
    flight.start_results["uav2"] = [StartEnded("uav2", accepted=False, reason="arm: denied")] * 3
    flight.launch()
    flight.finish()
    assert flight.vehicle("uav2").stage is Stage.LANDED
    assert set(flight.state.coverage.inspected) == EVERYTHING
    assert flight.sent_home() == []


def test_a_vehicle_that_armed_without_confirming_its_start_is_given_rtl() -> None:
    """It may be in the air: the confirmation got lost, not the order."""
    flight = Story(FLEET.context, dict(FLEET.boards))
    flight.start_results["uav2"] = [StartEnded("uav2", accepted=False, reason="is not in mission mode")] * 3
    flight.launch()
    flight.run(lambda: flight.stage("uav1") is Stage.FLYING)
    flight.crafts["uav2"].begin()
    flight.run(lambda: flight.vehicle("uav2").fault is not None)
    assert flight.stage("uav2") is Stage.RETURNING
    flight.finish()
    assert flight.given(LandNow) == [LandNow("uav2")], "it did take off, and is over its pad"
    assert flight.stage("uav2") is Stage.LANDED
    assert set(flight.state.coverage.inspected) == EVERYTHING


def test_an_armed_vehicle_that_stands_is_commanded_to_disarm() -> None:
    """Nobody sends a vehicle home that stands on the ground with its motors running."""
    flight = Story(FLEET.context, dict(FLEET.boards))
    flight.start_results["uav2"] = [StartEnded("uav2", accepted=False, reason="is not in mission mode")] * 3
    flight.launch()
    flight.crafts["uav2"].armed, flight.crafts["uav2"].mode = True, 4
    flight.run(lambda: flight.vehicle("uav2").fault is not None)
    assert flight.given(Disarm) == [Disarm("uav2", force=False)]
    flight.finish()
    assert flight.stage("uav2") is Stage.LANDED
    assert flight.sent_home() == []
    assert set(flight.state.coverage.inspected) == EVERYTHING


def test_a_battery_step_sends_the_vehicle_home() -> None:
    flight = under_way()
    flight.crafts["uav2"].battery_pct -= 30.0
    lost_s = flight.now_s
    found_s = flight.run(lambda: flight.stage("uav2") is Stage.RETURNING)
    assert found_s - lost_s < 5.0
    fault = flight.vehicle("uav2").fault
    assert fault is not None
    assert fault.kind is FaultKind.BATTERY
    flight.finish()
    assert flight.stage("uav2") is Stage.LANDED
    assert set(flight.state.coverage.inspected) == EVERYTHING


def test_the_first_reason_stands() -> None:
    flight = under_way()
    flight.crafts["uav2"].battery_pct -= 30.0
    flight.run(lambda: flight.stage("uav2") is Stage.RETURNING)
    flight.crafts["uav2"].mute = True
    flight.run(lambda: flight.stage("uav2") is Stage.LOST)
    fault = flight.vehicle("uav2").fault
    assert fault is not None
    assert fault.kind is FaultKind.BATTERY
    assert len([line for line in flight.said(Level.FAULT) if "uav2" in line]) == 1


def test_a_vehicle_that_goes_down_away_from_its_pad() -> None:
    flight = under_way()
    flight.crafts["uav2"].armed = False
    flight.run(lambda: flight.stage("uav2") is Stage.DOWN)
    fault = flight.vehicle("uav2").fault
    assert fault is not None
    assert fault.kind is FaultKind.INTERRUPTION
    assert fault.reason.startswith("disarmed ")
    assert "last position 49.59" in flight.said(Level.FAULT)[0]
    flight.pass_s(4.0)
    assert flight.said(Level.FAULT)[1].startswith("uav2: down at 49.59")
    assert flight.sent_home() == []
    flight.finish()
    assert set(flight.state.coverage.inspected) == EVERYTHING


def test_the_operator_aborts_the_flight() -> None:
    flight = under_way()
    flight.happen(ReturnAllOrdered())
    assert flight.sent_home() == list(THREE)
    flight.finish()
    assert {flight.stage(name) for name in THREE} == {Stage.LANDED}
    assert flight.solves() == []
    assert len(flight.state.coverage.inspected) < 6


def test_a_warning_text_is_shown_once() -> None:
    flight = story()
    for _ in range(3):
        flight.happen(Heard("uav1", StatusText(2, "Auto mission changed, restarted command")))
    flight.happen(Heard("uav1", StatusText(6, "EKF3 IMU0 is using GPS")))
    said = [line for line in flight.said() if "says" in line]
    assert said == ["uav1 says: Auto mission changed, restarted command"]


def test_every_stage_has_a_way_out() -> None:
    """Every stage in the air can become LOST and DOWN, and FLYING follows a start, or a pilot who gives it back."""
    for stage, then in TRANSITIONS.items():
        assert Stage.LOST in then or stage in {Stage.LOST, Stage.DOWN}
        assert Stage.DOWN in then or stage in {Stage.GROUND, Stage.LANDED, Stage.DOWN}
        assert stage not in then
    assert [stage for stage, then in TRANSITIONS.items() if Stage.FLYING in then] == [Stage.STARTING, Stage.PILOT]


def test_a_forbidden_transition_is_a_mistake_of_ours() -> None:
    lost = VehicleState("uav1", stage=Stage.LOST)
    with pytest.raises(ValueError, match="uav1: lost cannot become flying"):
        change_stage(lost, Stage.FLYING)
    assert change_stage(lost, Stage.LOST) is lost


def test_a_step_takes_no_state_of_another_flight() -> None:
    """`step` is a function: the same three arguments give the same answer, and nothing is changed in place."""
    state = fleet_step.build_initial_state(dict(FLEET.boards))
    kept = replace(state)
    first = fleet_step.step(FLEET.context, state, LaunchOrdered(), 5.0)
    second = fleet_step.step(FLEET.context, state, LaunchOrdered(), 5.0)
    assert first == second
    assert state == kept


def test_the_return_is_ordered_once_for_each_fault() -> None:
    flight = under_way()
    flight.crafts["uav2"].battery_pct -= 30.0
    flight.finish()
    assert flight.given(SendHome) == [SendHome("uav2")]


def test_a_vehicle_that_started_before_the_cancellation_is_not_shown_as_landed_with_motors_on() -> None:
    """Its start was on the way when the operator had it return: it arms on its pad, and disarms by itself later."""
    flight = Story(FLEET.context, dict(FLEET.boards), start_s={"uav2": 1.0})
    flight.launch()
    flight.ask(Action.RETURN, "uav2")
    assert flight.stage("uav2") is Stage.LANDED
    stands = flight.crafts["uav2"]
    stands.stuck = stands.armed = True
    flight.pass_s(3.0)
    assert flight.stage("uav2") is Stage.RETURNING
    assert "uav2: armed on its pad although the start was cancelled" in flight.said(Level.WARNING)
    stands.armed = False
    flight.finish()
    assert flight.stage("uav2") is Stage.LANDED
    assert set(flight.state.coverage.inspected) == EVERYTHING
