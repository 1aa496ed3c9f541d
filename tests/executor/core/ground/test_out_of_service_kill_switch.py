"""A kill switch on a vehicle that stands: only its words tell it, and nothing is started with it."""

from __future__ import annotations

import pytest

from executor.core.interface.commands import HandsOff, Level, Start
from executor.core.interface.events import Heard, StartEnded, UploadEnded
from executor.core.interface.intents import Action, Outcome
from executor.core.interface.messages import StatusText
from executor.core.state.vehicle_state import Stage
from tests.executor.builders import THREE, fleet_of
from tests.executor.core.stories import EVERYTHING, under_way
from tests.fakes.flight import Story

SAID = {"ardupilot": "RC: Motors Emergency Stopped", "px4": "Kill engaged"}
LINE = "uav4: its kill switch is on; no start until included"


def spare(autopilot: str = "ardupilot") -> Story:
    """Return a flight with uav4 standing by on its pad, while nobody asks before it flies."""
    return under_way(fleet_of({**THREE, "uav4": ()}, autopilot=autopilot, flight={"fly_again": "auto"}))


def killed(flight: Story, text: str) -> None:
    flight.happen(Heard("uav4", StatusText(2, text)))


@pytest.mark.parametrize("autopilot", ["ardupilot", "px4"])
def test_a_vehicle_with_its_kill_switch_on_gets_nothing_until_it_is_included(autopilot: str) -> None:
    flight = spare(autopilot)
    killed(flight, SAID[autopilot])
    killed(flight, SAID[autopilot])
    assert flight.said(Level.FAULT) == [LINE], "once"
    flight.crafts["uav2"].mute = True
    flight.run(lambda: bool(flight.solves()))
    assert "uav4" not in {offer.vehicle for offer in flight.solves()[0].survivors}
    assert flight.ask(Action.INCLUDE, "uav4", confirmed=True).outcome is Outcome.DONE
    assert not flight.vehicle("uav4").orders.excluded


def test_a_mission_that_is_on_its_way_to_it_then_starts_nothing() -> None:
    flight = spare()
    flight.upload_s = 5.0
    flight.crafts["uav2"].mute = True
    flight.run(lambda: flight.vehicle("uav4").assignment.pending is not None)
    killed(flight, SAID["ardupilot"])
    assert flight.given(HandsOff)[-1] == HandsOff("uav4")
    flight.run(lambda: any(isinstance(event, UploadEnded) and event.vehicle == "uav4" for _, event in flight.events))
    flight.finish()
    assert Start("uav4") not in flight.given(Start)
    assert set(flight.state.coverage.inspected) == EVERYTHING, "the others have its part"


def test_a_vehicle_that_does_not_arm_stays_and_the_others_get_its_segments() -> None:
    flight = spare()
    flight.crafts["uav2"].mute = True
    flight.start_s["uav4"] = 60.0
    flight.run(lambda: flight.stage("uav4") is Stage.STARTING)
    killed(flight, "Arm: Motors Emergency Stopped")
    assert flight.stage("uav4") is Stage.LANDED
    flight.finish()
    assert flight.given(Start).count(Start("uav4")) == 1
    assert set(flight.state.coverage.inspected) == EVERYTHING


def test_a_vehicle_stopped_right_after_arming_is_not_armed_again() -> None:
    """Its HEARTBEAT says armed as it says so: only the start that fails shows that the switch ended it."""
    flight = spare()
    flight.crafts["uav2"].mute = True
    flight.start_s["uav4"] = 60.0
    flight.run(lambda: flight.stage("uav4") is Stage.STARTING)
    reason = "is not armed in mission mode; it says: RC: Motors Emergency Stopped"
    flight.happen(StartEnded("uav4", accepted=False, reason=reason, armed=True))
    assert flight.said(Level.FAULT)[-1] == LINE
    flight.finish()
    assert flight.given(Start).count(Start("uav4")) == 1
    assert set(flight.state.coverage.inspected) == EVERYTHING


@pytest.mark.parametrize("text", ["Kill disengaged", "RC: Motor Emergency Stop released"])
def test_a_switch_that_is_let_go_of_stops_nothing(text: str) -> None:
    flight = spare()
    killed(flight, text)
    assert not flight.vehicle("uav4").orders.excluded


def test_one_in_flight_is_seen_by_what_it_does() -> None:
    flight = spare()
    flight.happen(Heard("uav2", StatusText(2, "Kill engaged")))
    assert flight.stage("uav2") is Stage.FLYING
    assert not flight.vehicle("uav2").orders.excluded
