"""Intents of an operator in flight: the orders, the vehicle's answers, and the refusals with their reasons."""

from __future__ import annotations

import pytest

from executor.analysis.report import build_report
from executor.core.fleet_view import build_fleet_view
from executor.core.interface.commands import Hold, LandNow, Level, Resume, SendHome
from executor.core.interface.events import Heard, IntentReceived, OrderEnded
from executor.core.interface.intents import Action, Intent, IntentRecord, Outcome
from executor.core.interface.messages import StatusText
from executor.core.state.vehicle_state import FaultKind, Stage
from missions import Phase
from tests.executor.builders import THREE, fleet_of
from tests.executor.core.stories import EVERYTHING, story, under_way
from tests.fakes.flight import Story

AUTOPILOTS = ("ardupilot", "px4")


def ends(flight: Story, record: IntentRecord) -> IntentRecord:
    """Live until an intent has come to its end."""
    flight.run(lambda: flight.outcome(record).outcome is not Outcome.ACCEPTED)
    return flight.outcome(record)


@pytest.mark.parametrize("autopilot", AUTOPILOTS)
def test_a_vehicle_holds_and_resumes_where_it_stopped(autopilot: str) -> None:
    """It neither repeats nor skips a part of its segment, and nobody takes it for stuck, or for gone astray."""
    flight = under_way(fleet_of(autopilot=autopilot))
    held = flight.ask(Action.HOLD, "uav2")
    assert held.outcome is Outcome.ACCEPTED
    assert ends(flight, held).text == "it holds"
    place_m = flight.crafts["uav2"].place_m
    flight.pass_s(200.0)
    assert flight.crafts["uav2"].place_m == place_m
    assert flight.said(Level.FAULT) == []
    assert flight.stage("uav2") is Stage.FLYING
    record = ends(flight, flight.ask(Action.RESUME, "uav2"))
    assert (record.outcome, record.text) == (Outcome.DONE, "it flies on")
    [resumed] = flight.given(Resume)
    assert resumed == Resume("uav2", 3.0), "at the speed of its inspection"
    flight.finish()
    assert set(flight.state.coverage.inspected) == EVERYTHING
    assert flight.vehicle("uav2").assignment.runs_broken == ()
    assert flight.solves() == []


def test_a_held_vehicle_is_given_nothing_and_keeps_its_segments() -> None:
    flight = under_way()
    ends(flight, flight.ask(Action.HOLD, "uav2"))
    flight.crafts["uav3"].mute = True
    flight.run(lambda: bool(flight.state.replanning.records))
    assert [offer.vehicle for offer in flight.solves()[0].survivors] == ["uav1"]
    assert set(flight.solves()[0].open_segments).isdisjoint({2, 3})
    ends(flight, flight.ask(Action.RESUME, "uav2"))
    flight.finish()
    assert set(flight.state.coverage.inspected) == EVERYTHING


def test_a_vehicle_that_holds_during_a_re_plan_gets_no_new_segments() -> None:
    flight = under_way()
    flight.solve_s = 5.0
    flight.crafts["uav3"].mute = True
    flight.run(lambda: flight.state.replanning.replan is not None)
    flight.ask(Action.HOLD, "uav2")
    flight.run(lambda: bool(flight.state.replanning.records))
    assert any("came too late for uav2" in line for line in flight.said())
    assert [upload.vehicle for upload in flight.uploads()] == ["uav1"]


def test_a_battery_that_fails_while_it_holds_is_a_fault_all_the_same() -> None:
    flight = under_way()
    ends(flight, flight.ask(Action.HOLD, "uav2"))
    flight.crafts["uav2"].battery_pct -= 40.0
    flight.run(lambda: flight.stage("uav2") is Stage.RETURNING)
    fault = flight.vehicle("uav2").fault
    assert fault is not None
    assert fault.kind is FaultKind.BATTERY
    assert flight.ask(Action.RESUME, "uav2").outcome is Outcome.REFUSED


def test_a_failsafe_out_of_a_hold_is_a_fault_and_it_can_be_included_again() -> None:
    flight = under_way()
    ends(flight, flight.ask(Action.HOLD, "uav2"))
    flight.happen(Heard("uav2", StatusText(4, "GCS Failsafe")))
    flight.crafts["uav2"].go_home()
    flight.run(lambda: flight.stage("uav2") is Stage.RETURNING)
    assert "uav2: interruption, RTL by its own failsafe; it says: GCS Failsafe" in flight.said(Level.FAULT)[0]
    assert flight.sent_home() == []
    flight.run(lambda: flight.stage("uav2") is Stage.LANDED)
    assert flight.ask(Action.INCLUDE, "uav2", confirmed=True).outcome is Outcome.DONE


def test_a_hold_ends_when_another_party_resumes_the_mission() -> None:
    flight = under_way()
    ends(flight, flight.ask(Action.HOLD, "uav2"))
    flight.pass_s(10.0)
    flight.crafts["uav2"].go_to(flight.context.vehicles["uav2"].dialect.modes.mission.custom_mode)
    flight.run(lambda: flight.vehicle("uav2").orders.held_s is None)
    flight.finish()
    assert set(flight.state.coverage.inspected) == EVERYTHING


def test_an_order_that_is_not_answered_has_failed() -> None:
    flight = under_way()
    flight.crafts["uav2"].mute = True
    record = ends(flight, flight.ask(Action.HOLD, "uav2"))
    assert (record.outcome, record.text) == (Outcome.FAILED, "uav2: no acknowledgement")
    assert flight.stage("uav2") is Stage.FLYING
    assert "uav2: did not follow the order: hold (no acknowledgement)" in flight.said(Level.WARNING)


@pytest.mark.parametrize("late_s", [6.0, 60.0])
def test_a_hold_that_is_followed_late_is_no_fault(late_s: float) -> None:
    flight = under_way()
    record = flight.ask(Action.HOLD, "uav2")
    flight._due.clear()
    flight.happen(OrderEnded("uav2", Action.HOLD, accepted=False, reason="does not report the new mode"))
    assert flight.outcome(record).outcome is Outcome.FAILED
    flight.pass_s(late_s)
    flight.crafts["uav2"].go_to(flight.context.vehicles["uav2"].dialect.modes.hold.custom_mode)
    flight.pass_s(60.0)
    assert flight.said(Level.FAULT) == []
    ends(flight, flight.ask(Action.RESUME, "uav2"))
    flight.finish()
    assert set(flight.state.coverage.inspected) == EVERYTHING


def test_a_hold_that_was_never_heard_is_forgotten() -> None:
    flight = under_way()
    flight.ask(Action.HOLD, "uav2")
    flight._due.clear()
    flight.happen(OrderEnded("uav2", Action.HOLD, accepted=False, reason="denied"))
    flight.run(lambda: flight.vehicle("uav2").orders.held_s is None)
    flight.finish()
    assert set(flight.state.coverage.inspected) == EVERYTHING


def test_an_order_that_a_fault_overtakes_has_failed() -> None:
    flight = under_way()
    record = flight.ask(Action.HOLD, "uav2")
    flight.crafts["uav2"].armed = False
    flight.happen(IntentReceived(Intent("again", Action.HOLD, "uav2", "page")))
    assert flight.state.crew.intents["again"].text == "it holds already"
    flight._due.clear()
    assert ends(flight, record).text.startswith("superseded: uav2 is ")


def test_a_returned_vehicle_stays_on_the_ground() -> None:
    flight = under_way()
    record = flight.ask(Action.RETURN, "uav2")
    assert ends(flight, record).text == "it returns"
    flight.finish()
    assert set(flight.state.coverage.inspected) == EVERYTHING
    assert flight.stage("uav2") is Stage.LANDED
    assert flight.vehicle("uav2").fault is None
    assert all(offer.vehicle != "uav2" for solve in flight.solves() for offer in solve.survivors)
    assert flight.solves()[0].trigger == "uav2: returns by the operator's order"


def test_an_excluded_vehicle_is_out_of_the_plan_by_the_operator() -> None:
    flight = under_way()
    record = ends(flight, flight.ask(Action.EXCLUDE, "uav2"))
    assert record.outcome is Outcome.DONE
    fault = flight.vehicle("uav2").fault
    assert fault is not None
    assert (fault.kind, fault.reason) == (FaultKind.OPERATOR, "excluded by the operator")
    flight.finish()
    assert set(flight.state.coverage.inspected) == EVERYTHING
    assert flight.sent_home() == ["uav2"]


def test_excluding_the_last_one_warns() -> None:
    flight = under_way()
    for name in ("uav1", "uav3"):
        flight.ask(Action.EXCLUDE, name)
    record = flight.ask(Action.EXCLUDE, "uav2")
    assert "no other vehicle is left to inspect" in record.text
    flight.finish()
    assert set(flight.state.coverage.inspected) != EVERYTHING


def test_a_spare_that_is_excluded_is_given_nothing() -> None:
    flight = under_way(fleet_of({**THREE, "uav4": ()}))
    assert flight.ask(Action.EXCLUDE, "uav4").outcome is Outcome.DONE
    flight.ask(Action.EXCLUDE, "uav2")
    flight.finish()
    assert all(offer.vehicle != "uav4" for solve in flight.solves() for offer in solve.survivors)


def test_a_vehicle_that_has_not_armed_does_not_take_off() -> None:
    flight = story()
    assert flight.stage("uav2") is Stage.STARTING
    record = flight.ask(Action.EXCLUDE, "uav2")
    assert flight.stage("uav2") is Stage.LANDED
    assert flight.sent_home() == ["uav2"]
    assert ends(flight, record).outcome is Outcome.DONE


def test_a_fresh_battery_brings_a_vehicle_back() -> None:
    flight = under_way()
    flight.ask(Action.RETURN, "uav2")
    flight.ask(Action.HOLD, "uav1")
    flight.run(lambda: flight.stage("uav2") is Stage.LANDED)
    flight.ask(Action.EXCLUDE, "uav3")
    flight.run(lambda: flight.stage("uav3") is Stage.LANDED)
    assert flight.ask(Action.INCLUDE, "uav1").text == "it is not on the ground with its motors off, it is flying"
    flight.crafts["uav2"].battery_pct = 18.0
    flight.pass_s(3.0)
    assert "its battery is 18 %" in flight.ask(Action.INCLUDE, "uav2").text
    flight.crafts["uav2"].battery_pct = 100.0
    flight.crafts["uav3"].battery_pct = 100.0
    flight.pass_s(3.0)
    for name in ("uav2", "uav3"):
        assert "Is its pad clear" in flight.ask(Action.INCLUDE, name).question
        assert flight.ask(Action.INCLUDE, name, confirmed=True).outcome is Outcome.DONE
    assert flight.vehicle("uav3").fault is None
    assert [name for name, _ in flight.state.replanning.mended] == ["uav3"]
    flight.run(lambda: flight.stage("uav2") is Stage.FLYING or flight.stage("uav3") is Stage.FLYING)
    ends(flight, flight.ask(Action.RESUME, "uav1"))
    flight.finish()
    assert set(flight.state.coverage.inspected) == EVERYTHING


def test_no_vehicle_lands_at_the_line() -> None:
    flight = under_way()
    record = flight.ask(Action.LAND, "uav2")
    assert record.outcome is Outcome.REFUSED
    assert record.text == "it is 5 m from the line, too near to land safely; use return"
    assert flight.given(LandNow) == []


def test_a_vehicle_away_from_the_line_lands_where_it_is() -> None:
    flight = under_way()
    flight.crafts["uav2"].place_m = (flight.crafts["uav2"].place_m[0], 60.0)
    flight.crafts["uav2"].go_to(-1)
    flight.pass_s(0.4)
    record = ends(flight, flight.ask(Action.LAND, "uav2"))
    assert (record.outcome, record.text) == (Outcome.DONE, "it lands")
    flight.run(lambda: flight.stage("uav2") is Stage.LANDED)
    assert flight.sent_home() == []
    flight.finish()
    assert set(flight.state.coverage.inspected) == EVERYTHING
    assert flight.crafts["uav2"].place_m[1] == 60.0


def test_everything_is_planned_again_on_demand() -> None:
    flight = under_way()
    record = flight.ask(Action.REPLAN)
    assert record.outcome is Outcome.ACCEPTED
    assert flight.ask(Action.REPLAN).text == "a re-plan is under way"
    assert ends(flight, record).text == "re-plan 1 is on board"
    assert flight.solves()[0].trigger == "requested by page"
    flight.finish()
    assert set(flight.state.coverage.inspected) == EVERYTHING


def test_a_re_plan_of_nothing_is_refused() -> None:
    flight = story()
    flight.run(lambda: set(flight.state.coverage.inspected) == EVERYTHING)
    assert flight.ask(Action.REPLAN).outcome is Outcome.REFUSED
    flight.finish()
    assert flight.ask(Action.REPLAN).text == "the flight is over"


def test_every_vehicle_returns() -> None:
    flight = under_way()
    ends(flight, flight.ask(Action.HOLD, "uav1"))
    record = flight.ask(Action.ABORT)
    assert sorted(flight.sent_home()) == ["uav1", "uav2", "uav3"]
    assert flight.ask(Action.REPLAN).text == "the flight was aborted"
    assert flight.ask(Action.ABORT).text == "no vehicle is on a mission"
    assert ends(flight, record).text == "all vehicles return"
    flight.finish()
    assert {flight.stage(name) for name in THREE} == {Stage.LANDED}
    assert flight.solves() == []


def test_the_same_wish_twice_is_one() -> None:
    flight = under_way()
    first = flight.ask(Action.HOLD, "uav2", "one")
    assert flight.ask(Action.HOLD, "uav2", "one") == first
    assert flight.ask(Action.ABORT, None, "one") == first
    assert flight.given(Hold) == [Hold("uav2")]
    assert flight.given(SendHome) == []


@pytest.mark.parametrize(
    ("action", "vehicle", "why"),
    [
        (Action.HOLD, "uav9", "there is no vehicle 'uav9': expected one of uav1, uav2, uav3"),
        (Action.HOLD, None, "hold needs a vehicle: one of uav1, uav2, uav3"),
        (Action.ABORT, "uav1", "abort is for the whole fleet; expected no vehicle"),
        (Action.RESUME, "uav1", "it is not on hold, it is flying"),
        (Action.INCLUDE, "uav1", "it is not on the ground with its motors off, it is flying"),
    ],
)
def test_what_makes_no_sense_is_refused(action: Action, vehicle: str | None, why: str) -> None:
    flight = under_way()
    before = len(flight.commands)
    record = flight.ask(action, vehicle)
    assert (record.outcome, record.text) == (Outcome.REFUSED, why)
    assert flight.said()[-1].endswith(f"refused: {why}")
    assert len(flight.commands) == before + 1


def test_no_vehicle_holds_below_its_layer() -> None:
    flight = story()
    assert flight.ask(Action.HOLD, "uav2").text == "it is not on its mission, it is starting"
    flight.run(lambda: flight.stage("uav2") is Stage.FLYING)
    leg = flight.vehicle("uav2").leg
    assert leg is not None
    assert leg.phase is Phase.TAKEOFF
    assert flight.ask(Action.HOLD, "uav2").text.startswith("it is climbing from its pad")


def test_a_mission_that_is_being_put_on_board_is_not_interrupted() -> None:
    flight = under_way()
    flight.upload_s = 30.0
    flight.ask(Action.EXCLUDE, "uav3")
    flight.run(lambda: flight.vehicle("uav2").assignment.pending is not None)
    assert flight.ask(Action.HOLD, "uav2").text.startswith("mission upload in progress")


def test_before_the_launch_and_of_the_silent_nothing_is_wanted() -> None:
    flight = Story(fleet_of().context, dict.fromkeys(THREE))
    assert flight.ask(Action.HOLD, "uav1").text == "the flight has not begun"
    flight = under_way()
    flight.crafts["uav2"].mute = True
    flight.pass_s(5.0)
    assert flight.ask(Action.HOLD, "uav2").text == "no message from it for 5 s"


def test_a_late_answer_to_an_order_that_was_given_up_changes_nothing() -> None:
    flight = under_way()
    flight.happen(OrderEnded("uav2", Action.RESUME, accepted=True, reason=""))
    assert flight.vehicle("uav2").orders.held_s is None
    flight.finish()
    assert set(flight.state.coverage.inspected) == EVERYTHING


def test_the_view_says_what_is() -> None:
    flight = under_way()
    ends(flight, flight.ask(Action.HOLD, "uav2"))
    flight.ask(Action.RESUME, "uav1")
    flight.ask(Action.EXCLUDE, "uav3")
    view = build_fleet_view(flight.context, flight.state, flight.now_s)
    one, two, three = view.vehicles
    assert [vehicle.state for vehicle in view.vehicles] == ["flying", "holding", "returning"]
    assert (two.progress.segment, two.progress.phase, two.progress.total) == (2, "inspect", 2)
    assert two.progress.segment_share is not None
    assert 0.5 < two.progress.segment_share < 0.75
    assert (three.fault_kind, three.excluded) == ("operator", True)
    assert one.position is not None
    assert one.battery.measured_pct is not None
    assert one.battery.predicted_pct is not None
    assert one.battery.predicted_band_pct is not None
    assert abs(one.battery.measured_pct - one.battery.predicted_pct) < 1.0 + 3 * one.battery.predicted_band_pct
    assert one.battery.landing_pct is not None
    assert one.battery.landing_pct < one.battery.measured_pct
    assert one.loss is None
    assert view.said[-1].level == "fault"
    assert [intent.outcome for intent in view.intents][:2] == ["done", "refused"]
    assert view.replan is None
    flight.run(lambda: flight.state.replanning.replan is not None)
    again = build_fleet_view(flight.context, flight.state, flight.now_s)
    assert again.replan is not None
    assert again.replan.solving


def test_the_report_keeps_the_faults_of_included_vehicles() -> None:
    flight = under_way()
    flight.ask(Action.EXCLUDE, "uav3")
    flight.run(lambda: flight.stage("uav3") is Stage.LANDED)
    flight.ask(Action.INCLUDE, "uav3")
    report = build_report(flight.context, flight.state, flight.now_s)
    assert [(fault.vehicle, fault.kind) for fault in report.faults] == [("uav3", FaultKind.OPERATOR)]
