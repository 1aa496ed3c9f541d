"""All links lost: a dead ground radio ends no flight, and regained vehicles continue from where they are."""

from __future__ import annotations

from dataclasses import replace

import pytest

from executor.core.interface.commands import Finish, Level
from executor.core.interface.intents import Action
from executor.core.resume import link_blackout
from executor.core.state.vehicle_state import FaultKind, Stage
from tests.executor.builders import THREE, fleet_of
from tests.executor.core.stories import EVERYTHING, FLEET, TIMEOUT_S, story, under_way
from tests.fakes.flight import Story
from tests.fakes.solver import leave_out, share_out

RTL = 6


def silenced(flight: Story, *, mute: bool = True) -> None:
    for craft in flight.crafts.values():
        craft.mute = mute


@pytest.mark.parametrize("long_s", [20.0, 70.0, 200.0])
def test_a_radio_that_was_gone_costs_nothing(long_s: float) -> None:
    """They fly on and land; what they flew unseen counts, by their clocks and where they are."""
    flight = under_way()
    silenced(flight)
    flight.pass_s(long_s)
    assert not flight.over
    silenced(flight, mute=False)
    flight.finish()
    assert set(flight.state.coverage.inspected) == EVERYTHING
    assert flight.said(Level.FAULT) == ([] if long_s < 60.0 else [flight.said(Level.FAULT)[0]])
    assert {flight.stage(name) for name in THREE} == {Stage.LANDED}
    assert flight.given(Finish) == [Finish("all segments inspected")]


def test_an_abort_without_links_is_reported() -> None:
    flight = under_way()
    silenced(flight)
    flight.run(lambda: flight.state.listening.silent_since_s is not None)
    assert flight.ask(Action.ABORT).text == "no link to any vehicle; RTL will be commanded as soon as a link is back"
    silenced(flight, mute=False)
    flight.run(lambda: sorted(flight.sent_home()) == list(THREE))
    flight.finish()


def test_what_was_flown_unseen_is_marked_as_inferred() -> None:
    flight = under_way()
    silenced(flight)
    flight.pass_s(200.0)
    silenced(flight, mute=False)
    flight.finish()
    assert flight.state.coverage.inferred
    assert [absence.deaf for absence in flight.state.listening.absences] == [True]
    assert any("during the outage, inferred from its clock" in line for line in flight.said(Level.INFO))


def test_a_vehicle_that_returned_by_its_failsafe_is_not_at_fault() -> None:
    flight = under_way()
    silenced(flight)
    for craft in flight.crafts.values():
        craft.mode = RTL
    flight.pass_s(70.0)
    silenced(flight, mute=False)
    flight.pass_s(10.0)
    assert [vehicle.fault for vehicle in flight.state.vehicles.values()] == [None] * 3
    assert not any("nobody is left" in line for line in flight.said())
    flight.finish()
    assert set(flight.state.coverage.inspected) == EVERYTHING


def test_an_upload_during_the_link_gap_is_no_refusal() -> None:
    flight = under_way()
    flight.upload_s = 6.0
    flight.crafts["uav2"].mute = True
    flight.run(lambda: bool(flight.uploads()))
    silenced(flight)
    flight.pass_s(20.0)
    silenced(flight, mute=False)
    flight.crafts["uav2"].mute = True
    flight.finish()
    assert not any(vehicle.assignment.stubborn for vehicle in flight.state.vehicles.values())
    assert set(flight.state.coverage.inspected) == EVERYTHING


def test_a_vehicle_without_messages_is_lost_once_its_battery_is_empty() -> None:
    flight = under_way()
    silenced(flight)
    silent_s = flight.now_s
    lasts_s = min(link_blackout.max_remaining_flight_s(FLEET.context, flight.vehicle(name)) for name in THREE)
    found_s = flight.run(lambda: Stage.LOST in {flight.stage(name) for name in THREE}, limit_s=2.0 * lasts_s)
    assert found_s - silent_s == pytest.approx(lasts_s, abs=2.0)
    flight.run(lambda: flight.over, limit_s=lasts_s)
    assert {flight.stage(name) for name in THREE} == {Stage.LOST}
    assert flight.given(Finish) == [Finish("5 segments not inspected")]
    aloft = "in the air at last contact: uav1, uav2, uav3"
    line = (
        f"no message from any vehicle for 60 s; {aloft}. The flight stays open and resumes with the first link regained"
    )
    assert line in flight.said(Level.FAULT)


def test_the_last_one_that_is_heard_ends_no_flight_by_its_silence() -> None:
    flight = story(fleet_of({"uav1": (0, 2)}))
    flight.run(lambda: flight.inspecting("uav1", 0))
    flight.crafts["uav1"].mute = True
    flight.pass_s(100.0)
    assert (flight.over, flight.stage("uav1"), flight.vehicle("uav1").fault) == (False, Stage.FLYING, None)
    assert "no link to any vehicle: suspecting the ground radio; re-planning suspended" in flight.said()
    flight.crafts["uav1"].mute = False
    flight.finish()
    assert {0, 1} <= set(flight.state.coverage.inspected)


def test_a_link_without_messages_is_not_regained() -> None:
    flight = under_way()
    silenced(flight)
    flight.pass_s(30.0)
    flight.crafts["uav1"].mute = flight.crafts["uav3"].mute = False
    flight.run(lambda: flight.stage("uav2") is Stage.LOST)
    fault = flight.vehicle("uav2").fault
    assert fault is not None
    assert fault.kind is FaultKind.LINK
    assert "uav2: link regained" not in flight.said()
    assert {"uav1: link regained", "uav3: link regained"} <= set(flight.said())


def test_what_was_left_over_in_a_silence_is_planned_when_it_ends() -> None:
    flight = under_way()
    flight.answer = leave_out(2, 3)
    flight.crafts["uav2"].mute = True
    flight.pass_s(6.0)
    flight.crafts["uav3"].mute = True
    flight.run(lambda: bool(flight.state.coverage.given_up))
    flight.answer = share_out
    flight.crafts["uav3"].mute = False
    flight.finish()
    assert set(flight.state.coverage.inspected) == EVERYTHING
    assert flight.state.replanning.records[-1].trigger == "uav3: link regained"


def test_a_vehicle_with_a_stale_link_gets_no_segments() -> None:
    """Silent for 7 s and lost after 10: a plan that counts on it would be made twice."""
    flight = under_way()
    flight.crafts["uav2"].mute = True
    flight.pass_s(3.6)
    flight.crafts["uav3"].mute = True
    flight.run(lambda: flight.stage("uav2") is Stage.LOST)
    flight.pass_s(1.0)
    assert [[offer.vehicle for offer in solve.survivors] for solve in flight.solves()] == [["uav1"]]
    flight.pass_s(TIMEOUT_S)
    assert flight.stage("uav3") is Stage.LOST


@pytest.mark.parametrize(("failsafe_s", "counts"), [(None, True), (20.0, False)])
def test_a_landing_during_the_blackout_proves_the_mission_only_without_another_cause(
    failsafe_s: float | None, counts: bool
) -> None:
    """PX4 is in its mission mode again once it has disarmed, however it came home."""
    ready = fleet_of({"uav1": (0, 2)})
    setup = replace(ready.context.vehicles["uav1"], failsafe_s=failsafe_s)
    flight = story(replace(ready, context=replace(ready.context, vehicles={"uav1": setup})))
    flight.run(lambda: flight.inspecting("uav1", 0))
    flight.crafts["uav1"].mute = True
    flight.run(lambda: not flight.crafts["uav1"].armed)
    flight.pass_s(10.0)
    flight.crafts["uav1"].mute = False
    flight.pass_s(3.0)
    assert ({0, 1} <= set(flight.state.coverage.inspected)) is counts


@pytest.mark.parametrize(("long_s", "stage"), [(60.0, Stage.PILOT), (8.0, Stage.RETURNING)])
def test_a_vehicle_found_on_hold_after_a_long_link_gap_is_left_alone(long_s: float, stage: Stage) -> None:
    """A failsafe holds for some seconds before it returns: who still holds after a minute is held by somebody."""
    flight = under_way(fleet_of(autopilot="px4"))
    silenced(flight)
    hold = flight.context.vehicles["uav2"].dialect.modes.hold.custom_mode
    flight.crafts["uav2"].mode, flight.crafts["uav2"].failsafe = hold, True
    flight.pass_s(long_s)
    silenced(flight, mute=False)
    flight.pass_s(4.0)
    assert flight.stage("uav2") is stage
    assert ("uav2" in flight.sent_home()) is False
    flight.pass_s(30.0)
    assert ("uav2" in flight.sent_home()) is (stage is Stage.RETURNING)
