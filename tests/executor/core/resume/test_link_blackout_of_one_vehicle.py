"""A link gap of one vehicle: segments flown in it count by the rule of a resumed flight."""

from __future__ import annotations

from collections.abc import Callable

import pytest

from executor.core.interface.commands import Level
from executor.core.interface.intents import Action, Outcome
from executor.core.interface.messages import Battery, Heartbeat, MissionCurrent, Position
from executor.core.state.vehicle_state import FaultKind, Stage
from tests.executor.builders import fleet_of
from tests.executor.core.stories import EVERYTHING, under_way
from tests.fakes.flight import Craft, Story

PATIENT = {"link_timeout_s": 60.0}
"""A site that waits for a silent vehicle."""
MEANWHILE = "during the outage, inferred from its clock and position"


def patient(autopilot: str = "ardupilot", **tables: object) -> Story:
    """Return a flight with uav2 in the midst of its first segment, in which nobody is given up for a minute."""
    return under_way(fleet_of(autopilot=autopilot, faults=PATIENT, **tables))  # type: ignore[arg-type]


def silent(flight: Story, long_s: float, name: str = "uav2") -> None:
    """Let nothing of a vehicle be heard for a while."""
    flight.crafts[name].mute = True
    flight.pass_s(long_s)
    flight.crafts[name].mute = False


def of_uav2(flight: Story) -> frozenset[int]:
    """Return what counts of it by evidence alone."""
    return flight.state.coverage.inferred


@pytest.mark.parametrize("autopilot", ["ardupilot", "px4"])
def test_a_silence_that_ends_where_its_mission_leads_costs_nothing(autopilot: str) -> None:
    flight = patient(autopilot)
    silent(flight, 30.0)
    flight.finish()
    assert set(flight.state.coverage.inspected) == EVERYTHING
    assert (of_uav2(flight), flight.solves()) == (frozenset({2, 3}), [])
    assert flight.vehicle("uav2").assignment.runs_broken == ()
    assert [line for line in flight.said(Level.INFO) if MEANWHILE in line] == [f"uav2: flew segment 2 {MEANWHILE}"]


def test_a_gap_of_some_seconds_in_a_segment_breaks_no_proof() -> None:
    flight = patient()
    silent(flight, 7.0)
    flight.finish()
    assert (of_uav2(flight), flight.solves()) == (frozenset({2}), [])
    assert set(flight.state.coverage.inspected) == EVERYTHING


def test_a_gap_in_its_positions_alone_is_judged_alike() -> None:
    flight = patient()
    flight.crafts["uav2"].stopped = {Position}
    flight.pass_s(8.0)
    flight.crafts["uav2"].stopped = set()
    flight.finish()
    assert (of_uav2(flight), flight.solves()) == (frozenset({2}), [])
    assert flight.vehicle("uav2").assignment.before is None


def test_what_is_flown_again_from_end_to_end_is_not_called_inferred() -> None:
    """Its gap fits, and the rest of the segment is flown too fast."""
    flight = patient()
    silent(flight, 7.0)
    flight.run(lambda: of_uav2(flight) == frozenset({2}))
    flight.crafts["uav2"].speed = 2.0
    flight.run(lambda: bool(flight.vehicle("uav2").assignment.runs_broken))
    flight.crafts["uav2"].speed = 1.0
    assert of_uav2(flight) == frozenset()
    flight.finish()
    assert (set(flight.state.coverage.flown), of_uav2(flight)) == (EVERYTHING, frozenset())


def test_what_is_heard_without_a_gap_needs_no_evidence() -> None:
    flight = patient()
    silent(flight, 4.0)
    flight.finish()
    assert (of_uav2(flight), flight.solves()) == (frozenset(), [])


def test_a_vehicle_that_landed_during_the_gap_flew_its_mission() -> None:
    flight = under_way(fleet_of(faults={"link_timeout_s": 300.0}))
    silent(flight, 160.0)
    assert not flight.crafts["uav2"].armed
    flight.finish()
    assert set(flight.state.coverage.inspected) == EVERYTHING
    assert {2, 3} <= of_uav2(flight)
    assert flight.solves() == []


def fast(craft: Craft) -> None:
    craft.speed = 1.6


def slow(craft: Craft) -> None:
    craft.speed = 0.5


def beside(craft: Craft) -> None:
    craft.aside_m = 30.0


NOT_SO: list[tuple[str, Callable[[Craft], None], Callable[[Craft], None]]] = [
    ("it took", fast, lambda craft: setattr(craft, "speed", 1.0)),
    ("it took", slow, lambda craft: setattr(craft, "speed", 1.0)),
    ("off its track", beside, lambda _: None),
]


@pytest.mark.parametrize(("why", "begins", "ends"), NOT_SO, ids=["fast", "slow", "beside"])
def test_what_does_not_fit_is_flown_again(
    why: str, begins: Callable[[Craft], None], ends: Callable[[Craft], None]
) -> None:
    flight = patient()
    begins(flight.crafts["uav2"])
    silent(flight, 30.0)
    ends(flight.crafts["uav2"])
    flight.pass_s(8.0)
    flight.crafts["uav2"].aside_m = 0.0
    assert of_uav2(flight) == frozenset()
    warned = [line for line in flight.said(Level.WARNING) if line.startswith("uav2: flight during the outage")]
    assert len(warned) == 1
    assert why in warned[0]
    flight.finish()
    assert [segment for segment, _ in flight.vehicle("uav2").assignment.runs_broken][:1] == [2]
    assert set(flight.state.coverage.inspected) == EVERYTHING
    assert flight.solves()


def test_a_third_of_a_segment_flown_too_fast_in_a_gap_is_flown_again() -> None:
    """What one segment flown too fast wins in whole is no measure for a part of it."""
    flight = patient()
    flight.crafts["uav2"].speed = 2.0
    silent(flight, 6.0)
    flight.crafts["uav2"].speed = 1.0
    flight.finish()
    assert 2 not in of_uav2(flight)
    assert flight.vehicle("uav2").assignment.runs_broken[0][0] == 2
    assert set(flight.state.coverage.inspected) == EVERYTHING


def test_another_mode_during_the_gap_proves_nothing() -> None:
    """Its positions get lost, its HEARTBEAT does not: for a second it was not on its mission."""
    flight = patient("px4")
    craft, modes = flight.crafts["uav2"], flight.context.vehicles["uav2"].dialect.modes
    craft.stopped = {Position}
    flight.pass_s(3.0)
    craft.mode = modes.hold.custom_mode
    flight.run(lambda: flight.vehicle("uav2").telemetry.heartbeat == craft.heartbeat())
    craft.mode = modes.mission.custom_mode
    flight.pass_s(4.0)
    craft.stopped = set()
    flight.pass_s(6.0)
    assert flight.stage("uav2") is Stage.FLYING
    assert of_uav2(flight) == frozenset()
    assert "uav2: flight during the outage is not counted: its mode changed in the meantime" in flight.said(
        Level.WARNING
    )


def test_a_vehicle_taken_by_its_pilot_in_the_meantime_proves_nothing_and_is_not_commanded() -> None:
    flight = patient()
    flight.crafts["uav2"].mute = True
    flight.pass_s(20.0)
    flight.crafts["uav2"].mode = 5  # LOITER, which no failsafe of ArduPilot leads to
    flight.pass_s(2.0)
    flight.crafts["uav2"].mute = False
    flight.pass_s(5.0)
    assert flight.stage("uav2") is Stage.PILOT
    assert of_uav2(flight) == frozenset()
    assert flight.vehicle("uav2").assignment.before is None
    assert "uav2" not in flight.sent_home()


def test_a_vehicle_with_another_mission_proves_nothing() -> None:
    flight = patient()
    flight.crafts["uav2"].mute = True
    flight.pass_s(20.0)
    flight.crafts["uav2"].foreign = 3
    flight.crafts["uav2"].mute = False
    flight.pass_s(6.0)
    assert of_uav2(flight) == frozenset()
    assert flight.stage("uav2") is Stage.PILOT


def test_a_missing_mission_item_proves_nothing() -> None:
    flight = patient()
    flight.crafts["uav2"].mute = True
    flight.pass_s(20.0)
    flight.crafts["uav2"].mute = False
    flight.crafts["uav2"].stopped = {MissionCurrent}
    flight.pass_s(7.0)
    assert (of_uav2(flight), flight.vehicle("uav2").assignment.before) == (frozenset(), None)
    assert [segment for segment, _ in flight.vehicle("uav2").assignment.runs_broken] == [2]


def test_its_work_is_not_given_away_before_it_has_said_what_it_did() -> None:
    """Another fault makes the re-plan urgent in the very moment in which the silent one is heard again."""
    flight = patient()
    flight.crafts["uav2"].mute = True
    flight.pass_s(30.0)
    flight.crafts["uav2"].mute = False
    flight.crafts["uav2"].stopped = {Heartbeat, Battery}
    flight.pass_s(1.0)
    assert flight.vehicle("uav2").assignment.before is not None
    flight.crafts["uav3"].battery_pct -= 20.0
    flight.run(lambda: bool(flight.solves()))
    fault = flight.vehicle("uav3").fault
    assert fault is not None
    assert fault.kind is FaultKind.BATTERY
    assert 2 not in flight.solves()[0].open_segments
    flight.crafts["uav2"].stopped = set()
    flight.finish()
    assert set(flight.state.coverage.inspected) == EVERYTHING


@pytest.mark.parametrize("long_s", [7.0, 30.0])
def test_a_site_may_ask_for_proof_instead(long_s: float) -> None:
    flight = patient(flight={"inferred": "fly"})
    silent(flight, long_s)
    flight.finish()
    assert of_uav2(flight) == frozenset()
    assert flight.solves()
    assert set(flight.state.coverage.inspected) == EVERYTHING
    assert flight.vehicle("uav2").assignment.runs_broken[0][0] == 2


def test_an_operator_may_ask_for_proof_in_flight() -> None:
    flight = patient()
    assert flight.ask(Action.PROVE).text == "every counted segment is already proven by positions"
    silent(flight, 30.0)
    flight.run(lambda: 3 in flight.state.coverage.inspected)
    flight.pass_s(3.0)
    record = flight.ask(Action.PROVE)
    assert (record.outcome, record.text) == (Outcome.ACCEPTED, "re-flying segments 2, 3 for proof")
    assert of_uav2(flight) == frozenset()
    flight.run(lambda: bool(flight.solves()))
    assert {2, 3} <= set(flight.solves()[0].open_segments)
    flight.finish()
    assert flight.outcome(record).outcome is Outcome.DONE
    assert (set(flight.state.coverage.inspected), of_uav2(flight)) == (EVERYTHING, frozenset())
    assert set(flight.state.coverage.flown) == EVERYTHING, "each is proven by positions"
