"""Flights from the launch to the landing: what is decided, and when."""

from __future__ import annotations

from dataclasses import replace

import pytest

from executor.core import fleet
from executor.core.commands import CancelSolve, Finish, Level, SendHome, Start
from executor.core.events import Heard, LaunchOrdered, ReturnAllOrdered, SolveEnded, StartEnded, Tick, UploadEnded
from executor.core.messages import StatusText
from executor.core.vehicle import TRANSITIONS, FaultKind, Stage, VehicleState, moved_to
from tests.executor.builders import THREE, Fleet, fleet_of
from tests.fakes.flight import Story
from tests.fakes.solver import fail, leave_out, share_out

FLEET = fleet_of()
TIMEOUT_S = 10.0
EVERYTHING = set(range(6))


def story(ready: Fleet = FLEET) -> Story:
    """Return a flight that has been launched and heard."""
    flight = Story(ready.context, dict(ready.boards))
    flight.launch()
    return flight


def under_way(ready: Fleet = FLEET) -> Story:
    """Return a flight in which uav2 is in the midst of its first segment."""
    flight = story(ready)
    flight.run(lambda: flight.inspecting("uav2", 2))
    return flight


@pytest.mark.parametrize("autopilot", ["ardupilot", "px4"])
def test_a_flight_without_a_fault(autopilot: str) -> None:
    flight = story(fleet_of(autopilot=autopilot))
    flight.finish()
    assert set(flight.state.inspected) == EVERYTHING
    assert {flight.stage(name) for name in THREE} == {Stage.LANDED}
    assert flight.given(Finish) == [Finish("every segment is inspected")]
    assert flight.solves() == []
    assert flight.said(Level.WARNING) == []
    assert flight.state.separation is not None
    assert flight.state.separation.least_m >= 5.0


def test_nothing_flies_before_the_launch() -> None:
    flight = Story(FLEET.context, dict(FLEET.boards))
    flight.pass_s(5.0)
    assert flight.commands == []
    flight.launch()
    assert flight.given(Start) == [Start(name) for name in THREE]


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
    assert set(flight.state.inspected) == EVERYTHING
    assert 2 not in [segment for segment, by in flight.state.inspected.items() if by == "uav2"]
    [record] = flight.state.records
    assert (record.feasible, record.uncovered, record.begun_s) == (True, (), found_s)
    assert record.ended_s - record.begun_s < 2.0


def test_silence_is_said_before_it_is_a_fault() -> None:
    flight = under_way()
    flight.crafts["uav2"].mute = True
    flight.pass_s(5.0)
    assert flight.said(Level.WARNING) == ["uav2: nothing heard for 3.0 s"]
    flight.crafts["uav2"].mute = False
    flight.finish()
    assert "uav2: is heard again" in flight.said(Level.INFO)
    assert flight.said(Level.FAULT) == []


def test_all_silent_at_once_is_our_own_fault_first() -> None:
    flight = under_way()
    for craft in flight.crafts.values():
        craft.mute = True
    flight.pass_s(50.0)
    assert "all vehicles are silent at once: is it our own radio? Nothing is re-planned yet" in flight.said()
    assert flight.said(Level.FAULT) == []
    assert flight.solves() == []


def test_all_silent_for_too_long_are_lost() -> None:
    flight = under_way()
    for craft in flight.crafts.values():
        craft.mute = True
    silent_s = flight.now_s
    found_s = flight.run(lambda: flight.stage("uav1") is Stage.LOST)
    assert found_s - silent_s == pytest.approx(FLEET.context.limits.all_silent_s, abs=0.5)
    flight.finish()
    assert {flight.stage(name) for name in THREE} == {Stage.LOST}
    assert flight.given(Finish) == [Finish("5 segments are not inspected")]
    assert flight.said(Level.WARNING)[-1] == "nobody is left to inspect segments 1, 2, 3, 4, 5"


def test_a_spare_that_is_not_heard_either_saves_nobody() -> None:
    flight = under_way(fleet_of({**THREE, "uav4": ()}))
    for craft in flight.crafts.values():
        craft.mute = True
    flight.finish()
    assert flight.solves() == []
    assert "vehicles are heard again" not in flight.said()


def test_a_radio_that_comes_back_loses_nobody() -> None:
    """The first vehicle that is heard again must not make the others, a moment later, look lost."""
    flight = under_way()
    for craft in flight.crafts.values():
        craft.mute = True
    flight.pass_s(30.0)
    for name in ("uav1", "uav3", "uav2"):
        flight.crafts[name].mute = False
        flight.pass_s(2.0)
    assert "vehicles are heard again" in flight.said(Level.INFO)
    assert flight.said(Level.FAULT) == []


def test_who_stays_silent_when_the_radio_comes_back_is_lost_after_all() -> None:
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
    assert flight.said(Level.WARNING) == ["the ground station itself stood still for 30.0 s"]
    flight.pass_s(TIMEOUT_S + 2.0)
    assert flight.said(Level.FAULT) == []


def test_a_fault_while_solving_cancels_and_plans_anew() -> None:
    flight = under_way(fleet_of({**THREE, "uav4": (12, 14)}, pylons=9))
    flight.solve_s = 5.0
    flight.crafts["uav2"].mute = True
    flight.run(lambda: flight.state.replan is not None)
    flight.crafts["uav3"].battery_pct -= 30.0
    flight.run(lambda: len(flight.solves()) == 2)
    assert flight.given(CancelSolve) == [CancelSolve(1)]
    first, second = flight.solves()
    assert {offer.vehicle for offer in first.survivors} == {"uav1", "uav3", "uav4"}
    assert {offer.vehicle for offer in second.survivors} == {"uav1", "uav4"}
    assert set(second.open_segments) > set(first.open_segments) - set(flight.state.inspected) - {4}
    assert flight.sent_home() == ["uav3"]
    flight.finish()
    assert set(flight.state.inspected) == set(range(8))
    assert [record.revision for record in flight.state.records] == [2]


def test_an_answer_to_an_older_question_is_dropped() -> None:
    flight = under_way()
    flight.solve_s = 5.0
    flight.crafts["uav2"].mute = True
    flight.run(lambda: flight.state.replan is not None)
    before = flight.state
    flight.happen(SolveEnded(0, (), (0, 1), 0.1, "stale"))
    assert flight.state == before


def test_an_answer_that_comes_too_late_is_planned_anew() -> None:
    """uav3 passed what the solver had taken for its last kept waypoint: its path cannot be cut there any more."""
    flight = under_way()
    flight.crafts["uav2"].mute = True
    flight.solve_s = 60.0
    lost_s = flight.run(lambda: flight.stage("uav2") is Stage.LOST)
    assert len(flight.solves()) == 1
    flight.solve_s = 0.4
    flight.run(lambda: len(flight.solves()) == 2)
    late = [line for line in flight.said() if "came too late" in line]
    assert len(late) == 1
    assert late[0].endswith("planning anew")
    flight.finish()
    assert set(flight.state.inspected) == EVERYTHING
    [record] = flight.state.records
    assert record.begun_s == lost_s, "the need for it is as old as the fault"
    assert record.trigger.startswith("uav2: link")


def test_a_solver_that_dies_is_asked_again() -> None:
    flight = under_way()
    flight.answer = fail
    flight.crafts["uav2"].mute = True
    flight.run(lambda: "re-plan 1 failed: the solver's process died; trying again" in flight.said())
    failed_s = flight.now_s
    flight.answer = share_out
    again_s = flight.run(lambda: len(flight.solves()) == 2)
    assert again_s - failed_s == pytest.approx(5.0, abs=0.5)
    flight.finish()
    assert set(flight.state.inspected) == EVERYTHING


def refused(name: str, revision: int, *, mixed: bool = False) -> UploadEnded:
    return UploadEnded(name, revision, accepted=False, mixed=mixed, reason="mission refused: denied")


def test_a_survivor_that_refuses_its_mission_is_planned_around() -> None:
    flight = under_way()
    flight.upload_results["uav3"] = [refused("uav3", 1)]
    flight.crafts["uav2"].mute = True
    flight.finish()
    first, second = flight.solves()
    assert {offer.vehicle for offer in first.survivors} == {"uav1", "uav3"}
    assert {offer.vehicle for offer in second.survivors} == {"uav1"}
    assert flight.vehicle("uav3").fault is None, "it flies its own mission to the end"
    assert set(flight.state.inspected) == EVERYTHING
    assert {4, 5} <= {segment for segment, by in flight.state.inspected.items() if by == "uav3"}
    assert "uav3: could not be given its new mission (mission refused: denied); planning around it" in flight.said()


def test_a_vehicle_with_a_mixed_mission_is_sent_home() -> None:
    flight = under_way()
    flight.upload_results["uav3"] = [refused("uav3", 1, mixed=True)]
    flight.crafts["uav2"].mute = True
    flight.run(lambda: flight.stage("uav3") is Stage.RETURNING)
    fault = flight.vehicle("uav3").fault
    assert fault is not None
    assert (fault.kind, fault.reason) == (FaultKind.INTERRUPTION, "its mission is a mixture of two")
    assert flight.sent_home() == ["uav3"]
    flight.finish()
    assert set(flight.state.inspected) == EVERYTHING


def test_a_mixed_mission_on_the_ground_is_only_not_started() -> None:
    flight = under_way(fleet_of({**THREE, "uav4": ()}))
    flight.upload_results["uav4"] = [refused("uav4", 1, mixed=True)]
    flight.crafts["uav2"].mute = True
    flight.run(lambda: len(flight.solves()) == 2)
    assert flight.stage("uav4") is Stage.GROUND
    assert "uav4" not in {offer.vehicle for offer in flight.solves()[1].survivors}
    flight.finish()
    assert set(flight.state.inspected) == EVERYTHING
    assert Start("uav4") not in flight.given(Start)


def test_a_spare_on_the_ground_takes_over() -> None:
    flight = under_way(fleet_of({**THREE, "uav4": ()}))
    flight.crafts["uav2"].mute = True
    flight.finish()
    assert Start("uav4") in flight.given(Start)
    assert "uav4" in flight.state.inspected.values()
    assert set(flight.state.inspected) == EVERYTHING


def test_a_survivor_that_has_landed_flies_again() -> None:
    flight = story(fleet_of({"uav1": (0,), "uav2": (2, 4, 6, 8, 10)}))
    flight.run(lambda: flight.stage("uav1") is Stage.LANDED)
    flight.crafts["uav2"].mute = True
    flight.finish()
    assert flight.given(Start).count(Start("uav1")) == 2
    assert {2, 3, 4, 5} & {segment for segment, by in flight.state.inspected.items() if by == "uav1"}
    assert flight.stage("uav1") is Stage.LANDED


def test_a_survivor_that_has_landed_stays_where_it_may_not_fly_again() -> None:
    flight = story(fleet_of({"uav1": (0,), "uav2": (2, 4, 6, 8, 10)}, flight={"fly_again": False}))
    flight.run(lambda: flight.stage("uav1") is Stage.LANDED)
    flight.crafts["uav2"].mute = True
    flight.finish()
    assert flight.given(Start).count(Start("uav1")) == 1
    assert flight.solves() == []
    assert flight.said(Level.WARNING)[-1].startswith("nobody is left to inspect segment")


def test_a_lost_vehicle_that_comes_back_is_told_to_return_and_never_goes_on() -> None:
    flight = under_way()
    lost = flight.crafts["uav2"]
    lost.mute = True
    flight.run(lambda: flight.stage("uav2") is Stage.LOST)
    flight.pass_s(3.0)
    lost.mute = False
    flight.step()
    assert flight.stage("uav2") is Stage.RETURNING
    assert flight.sent_home() == ["uav2"]
    before = dict(flight.state.inspected)
    flight.finish()
    assert flight.stage("uav2") is Stage.LANDED
    assert not {"uav2"} & {by for segment, by in flight.state.inspected.items() if segment not in before}
    assert all(offer.vehicle != "uav2" for problem in flight.solves() for offer in problem.survivors)
    assert flight.given(Start).count(Start("uav2")) == 1
    assert set(flight.state.inspected) == EVERYTHING


def test_a_vehicle_that_does_not_obey_the_return_is_told_again() -> None:
    flight = under_way()
    flight.crafts["uav2"].mute = True
    flight.run(lambda: flight.stage("uav2") is Stage.LOST)
    flight.crafts["uav2"].mute = False
    flight.crafts["uav2"].stubborn = True
    flight.pass_s(12.0)
    assert flight.sent_home() == ["uav2"] * 3


def test_a_lost_vehicle_that_is_heard_on_the_ground_has_landed() -> None:
    flight = under_way()
    lost = flight.crafts["uav2"]
    lost.mute = True
    flight.run(lambda: flight.stage("uav2") is Stage.LOST)
    lost.armed, lost.up_m = False, 0.0
    lost.mute = False
    flight.pass_s(3.0)
    assert flight.stage("uav2") is Stage.LANDED


def test_a_start_that_fails_is_tried_again() -> None:
    flight = Story(FLEET.context, dict(FLEET.boards))
    denied = StartEnded("uav2", accepted=False, reason="arm: denied")
    flight.start_results["uav2"] = [denied, denied]
    flight.launch()
    flight.finish()
    assert flight.given(Start).count(Start("uav2")) == 3
    assert set(flight.state.inspected) == EVERYTHING
    assert flight.said(Level.WARNING) == ["uav2: did not start (arm: denied); trying again"] * 2


def test_a_vehicle_that_never_starts_is_planned_around() -> None:
    flight = Story(FLEET.context, dict(FLEET.boards))
    flight.start_results["uav2"] = [StartEnded("uav2", accepted=False, reason="arm: denied")] * 3
    flight.launch()
    flight.finish()
    assert flight.vehicle("uav2").stage is Stage.LANDED
    assert set(flight.state.inspected) == EVERYTHING
    assert flight.sent_home() == []


def test_a_vehicle_that_armed_and_did_not_confirm_its_start_is_told_to_return() -> None:
    """It may be in the air: the confirmation got lost, not the order."""
    flight = Story(FLEET.context, dict(FLEET.boards))
    flight.start_results["uav2"] = [StartEnded("uav2", accepted=False, reason="is not in mission mode")] * 3
    flight.launch()
    flight.run(lambda: flight.stage("uav1") is Stage.FLYING)
    flight.crafts["uav2"].begin()
    flight.run(lambda: flight.vehicle("uav2").fault is not None)
    assert flight.stage("uav2") is Stage.RETURNING
    assert flight.sent_home() == ["uav2"]
    flight.finish()
    assert flight.stage("uav2") is Stage.LANDED
    assert set(flight.state.inspected) == EVERYTHING


def test_what_the_budgets_do_not_cover_is_named() -> None:
    flight = under_way()
    flight.answer = leave_out(3)
    flight.crafts["uav2"].mute = True
    flight.finish()
    assert set(flight.state.inspected) == EVERYTHING - {3}
    assert "the budgets that are left do not cover segment 3" in flight.said(Level.WARNING)
    [record] = flight.state.records
    assert (record.feasible, record.uncovered) == (False, (3,))
    assert flight.given(Finish) == [Finish("1 segments are not inspected")]


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
    assert set(flight.state.inspected) == EVERYTHING


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
    flight.run(lambda: flight.stage("uav2") is Stage.LANDED)
    fault = flight.vehicle("uav2").fault
    assert fault is not None
    assert fault.kind is FaultKind.INTERRUPTION
    assert fault.reason.startswith("disarmed ")
    assert flight.sent_home() == []
    flight.finish()
    assert set(flight.state.inspected) == EVERYTHING


def test_a_segment_flown_too_fast_is_flown_again() -> None:
    flight = under_way()
    flight.crafts["uav2"].speed = 2.0
    flight.run(lambda: bool(flight.vehicle("uav2").runs_broken))
    flight.crafts["uav2"].speed = 1.0
    flight.finish()
    assert set(flight.state.inspected) == EVERYTHING
    assert any("uav2: inspection does not count: segment 2: flown at" in line for line in flight.said(Level.WARNING))
    assert flight.solves()[0].trigger == "not proven to be inspected: segment 2"
    assert flight.state.records[0].ended_s - flight.state.records[0].begun_s < 5.0


def test_a_segment_that_nobody_can_prove_is_left_in_the_end() -> None:
    flight = story()
    for craft in flight.crafts.values():
        craft.speed = 2.0
    flight.finish()
    assert set(flight.state.inspected) == set()
    assert "some segments could not be proven to be inspected; left for later" in flight.said(Level.WARNING)
    assert flight.given(Finish) == [Finish("6 segments are not inspected")]


def test_a_late_answer_to_an_unproven_segment_keeps_its_reason() -> None:
    flight = under_way()
    flight.crafts["uav2"].speed = 2.0
    flight.run(lambda: bool(flight.vehicle("uav2").runs_broken))
    flight.crafts["uav2"].speed = 1.0
    flight.solve_s = 60.0
    flight.run(lambda: len(flight.solves()) == 1)
    needed_s = flight.now_s
    flight.solve_s = 0.4
    flight.run(lambda: len(flight.solves()) == 2)
    assert [problem.trigger for problem in flight.solves()] == ["not proven to be inspected: segment 2"] * 2
    flight.run(lambda: bool(flight.state.records))
    assert flight.state.records[0].begun_s == needed_s


def test_the_operator_sends_everybody_home() -> None:
    flight = under_way()
    flight.happen(ReturnAllOrdered())
    assert flight.sent_home() == list(THREE)
    flight.finish()
    assert {flight.stage(name) for name in THREE} == {Stage.LANDED}
    assert flight.solves() == []
    assert len(flight.state.inspected) < 6


def test_the_operator_sends_everybody_home_while_it_is_solved() -> None:
    flight = under_way()
    flight.solve_s = 5.0
    flight.crafts["uav2"].mute = True
    flight.run(lambda: flight.state.replan is not None)
    flight.happen(ReturnAllOrdered())
    assert flight.given(CancelSolve) == [CancelSolve(1)]
    flight.finish()
    assert flight.uploads() == []


def test_a_vehicle_landing_when_the_plan_was_made_may_fly_what_was_left() -> None:
    flight = story(fleet_of({"uav1": (0,), "uav2": (2, 4, 6, 8, 10)}))
    flight.run(lambda: flight.stage("uav1") is Stage.FLYING and flight.vehicle("uav1").battery.used_pct > 0)
    board = flight.vehicle("uav1").board
    assert board is not None
    flight.run(lambda: flight.crafts["uav1"].leg == len(board.path.waypoints) - 1)
    flight.crafts["uav2"].mute = True
    flight.finish()
    assert {3, 4, 5} <= {segment for segment, by in flight.state.inspected.items() if by == "uav1"}


def test_a_warning_text_is_shown_once() -> None:
    flight = story()
    for _ in range(3):
        flight.happen(Heard("uav1", StatusText(2, "Auto mission changed, restarted command")))
    flight.happen(Heard("uav1", StatusText(6, "EKF3 IMU0 is using GPS")))
    said = [line for line in flight.said() if "says" in line]
    assert said == ["uav1 says: Auto mission changed, restarted command"]


def test_nobody_stands_still_in_a_stage_without_a_way_out() -> None:
    """Every stage but the ground's can become LANDED or LOST, and FLYING follows STARTING only."""
    for stage, then in TRANSITIONS.items():
        assert Stage.LOST in then or stage is Stage.LOST
        assert stage not in then
    assert [stage for stage, then in TRANSITIONS.items() if Stage.FLYING in then] == [Stage.STARTING]


def test_a_forbidden_transition_is_a_mistake_of_ours() -> None:
    lost = VehicleState("uav1", stage=Stage.LOST)
    with pytest.raises(ValueError, match="uav1: lost cannot become flying"):
        moved_to(lost, Stage.FLYING)
    assert moved_to(lost, Stage.LOST) is lost


def test_a_step_takes_no_state_of_another_flight() -> None:
    """`step` is a function: the same three arguments give the same answer, and nothing is changed in place."""
    state = fleet.initial(dict(FLEET.boards))
    kept = replace(state)
    first = fleet.step(FLEET.context, state, LaunchOrdered(), 5.0)
    second = fleet.step(FLEET.context, state, LaunchOrdered(), 5.0)
    assert first == second
    assert state == kept


def test_the_return_is_ordered_once_for_each_fault() -> None:
    flight = under_way()
    flight.crafts["uav2"].battery_pct -= 30.0
    flight.finish()
    assert flight.given(SendHome) == [SendHome("uav2")]
