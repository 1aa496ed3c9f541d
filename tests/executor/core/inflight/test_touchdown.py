"""What counts as a landing, and which party controls a descending vehicle."""

from __future__ import annotations

import pytest

from executor.core.interface.commands import LandNow, Level, Start
from executor.core.interface.events import Heard, StartEnded
from executor.core.interface.intents import Action
from executor.core.interface.messages import Battery, Heartbeat, StatusText
from executor.core.state.vehicle_state import Stage
from missions import Phase
from tests.executor.builders import fleet_of, with_facts
from tests.executor.core.stories import EVERYTHING, FLEET, under_way
from tests.fakes.flight import Story

FENCE = StatusText(5, "Circle fence breached")


def returning() -> Story:
    """Return a flight in which uav2 comes home."""
    flight = under_way()
    flight.ask(Action.RETURN, "uav2")
    flight.pass_s(3.0)
    assert flight.stage("uav2") is Stage.RETURNING
    return flight


def descending(autopilot: str) -> Story:
    """Return a flight in which uav2 comes down on its pad."""
    flight = under_way(fleet_of(autopilot=autopilot))

    def lands() -> bool:
        craft = flight.crafts["uav2"]
        return craft.path is not None and craft.path.waypoints[craft.leg].phase is Phase.LAND and craft.up_m < 12.0

    flight.run(lands)
    flight.pass_s(1.2)
    return flight


def modes(flight: Story) -> tuple[int, int, int]:
    """Return the numbers of hold, return and land."""
    ours = flight.context.vehicles["uav2"].dialect.modes
    return ours.hold.custom_mode, ours.return_home.custom_mode, ours.land.custom_mode


def test_motors_off_over_the_pad_is_no_landing() -> None:
    flight = returning()
    craft = flight.crafts["uav2"]
    craft.place_m, craft.up_m, craft.armed = flight.context.vehicles["uav2"].pad_m, 25.0, False
    flight.run(lambda: flight.stage("uav2") is Stage.DOWN)
    assert any("25 m over its home" in line for line in flight.said(Level.FAULT))
    assert not any(line.startswith("uav2: landed") for line in flight.said())


@pytest.mark.parametrize(("sinks_m_s", "end"), [(9.0, Stage.DOWN), (1.0, Stage.LANDED)])
def test_a_fall_is_no_landing(sinks_m_s: float, end: Stage) -> None:
    flight = returning()
    craft = flight.crafts["uav2"]
    craft.place_m, craft.up_m, craft.stuck = flight.context.vehicles["uav2"].pad_m, 12.0, True
    while craft.up_m > 0.0:
        craft.up_m = max(0.0, craft.up_m - 0.4 * sinks_m_s)
        flight.step()
        craft.velocity_m_s = (0.0, 0.0, -sinks_m_s)
        flight.happen(Heard("uav2", craft.position(flight.now_s + 0.1)))
    craft.armed = False
    flight.run(lambda: flight.stage("uav2") in {Stage.DOWN, Stage.LANDED})
    assert flight.stage("uav2") is end


def test_a_start_is_not_tried_again_by_guess() -> None:
    """It had armed, and its heartbeats do not come: it may fly, or its autopilot may have started anew."""
    flight = Story(FLEET.context, dict(FLEET.boards))
    flight.start_results = {"uav2": [StartEnded("uav2", False, "mission: no acknowledgement", armed=True)]}
    flight.start_s = {"uav2": 8.0}
    flight.launch()
    flight.pass_s(1.2)
    flight.crafts["uav2"].stopped.add(Heartbeat)
    flight.pass_s(12.0)
    assert flight.given(Start).count(Start("uav2")) == 1
    assert flight.vehicle("uav2").fault is not None


def test_a_start_that_was_refused_before_it_armed_is_tried_again() -> None:
    flight = Story(FLEET.context, dict(FLEET.boards))
    flight.start_results = {"uav2": [StartEnded("uav2", False, "arm: temporarily rejected")]}
    flight.launch()
    flight.pass_s(12.0)
    assert flight.given(Start).count(Start("uav2")) == 2
    assert flight.stage("uav2") is Stage.FLYING


def test_a_vehicle_hovering_over_its_pad_is_commanded_to_land() -> None:
    flight = descending("ardupilot")
    flight.crafts["uav2"].stuck = True
    flight.ask(Action.RETURN, "uav2")
    assert flight.given(LandNow) == []
    flight.run(lambda: LandNow("uav2") in flight.given(LandNow), limit_s=20.0)
    flight.crafts["uav2"].stuck = False
    flight.finish()
    assert flight.stage("uav2") is Stage.LANDED


def test_a_failsafe_rtl_stopped_by_a_person_is_that_persons() -> None:
    flight = under_way()
    hold, rtl, land = modes(flight)
    flight.happen(Heard("uav2", FENCE))
    flight.crafts["uav2"].mode = rtl
    flight.run(lambda: flight.stage("uav2") is Stage.RETURNING)
    flight.pass_s(2.0)
    flight.crafts["uav2"].mode = hold
    flight.run(lambda: flight.stage("uav2") is Stage.PILOT, limit_s=4.0)
    flight.crafts["uav2"].mode = land
    flight.pass_s(3.0)
    assert flight.stage("uav2") is Stage.PILOT, "the text is of before"
    assert flight.sent_home() == []
    assert flight.given(LandNow) == []


@pytest.mark.parametrize("autopilot", ["ardupilot", "px4"])
def test_a_hold_in_the_descent_is_a_pilots(autopilot: str) -> None:
    flight = descending(autopilot)
    flight.crafts["uav2"].mode = modes(flight)[0]
    flight.run(lambda: flight.stage("uav2") is Stage.PILOT, limit_s=4.0)
    assert flight.sent_home() == []


@pytest.mark.parametrize("after_s", [0.4, 0.8, 1.2])
def test_a_silence_of_everything_is_not_called_a_missing_heartbeat(after_s: float) -> None:
    flight = under_way()
    flight.pass_s(after_s)
    flight.crafts["uav2"].mute = True
    flight.pass_s(8.0)
    assert [line for line in flight.said() if "other messages come" in line] == []


def test_a_vehicle_never_in_the_air_has_not_landed() -> None:
    flight = Story(FLEET.context, dict(FLEET.boards))
    flight.start_results = {"uav2": [StartEnded("uav2", False, "mission: denied", armed=True)] * 3}
    flight.launch()
    flight.crafts["uav2"].armed = True
    flight.run(lambda: flight.vehicle("uav2").fault is not None)
    flight.finish()
    assert not any(line.startswith("uav2: landed") for line in flight.said())
    assert set(flight.state.coverage.inspected) == EVERYTHING


def test_a_vehicle_on_its_pad_after_a_restart_is_not_reported_as_landed() -> None:
    flight = under_way()
    flight.ask(Action.EXCLUDE, "uav2")
    craft = flight.crafts["uav2"]
    craft.mute = True
    flight.pass_s(5.0)
    craft.place_m, craft.up_m, craft.armed = flight.context.vehicles["uav2"].pad_m, 0.0, False
    for number in range(20):
        flight.happen(Heard("uav2", craft.position(1.0 + 0.4 * number)))
        flight.happen(Heard("uav2", craft.heartbeat()))
        flight.step()
    assert flight.stage("uav2") is Stage.LANDED
    assert [line for line in flight.said() if "on its pad" in line] == [
        "uav2: is disarmed on its pad with 98 %; its autopilot has rebooted"
    ]
    assert not any(line.startswith("uav2: landed") for line in flight.said())


@pytest.mark.parametrize(("reports", "says"), [(True, "uav2: landed with 9"), (False, "uav2: landed")])
def test_a_battery_that_says_nothing_any_more_is_not_quoted(reports: bool, says: str) -> None:
    flight = returning()
    if not reports:
        flight.crafts["uav2"].stopped.add(Battery)
    flight.run(lambda: flight.stage("uav2") is Stage.LANDED)
    [line] = [line for line in flight.said() if line.startswith("uav2: landed")]
    assert line.startswith(says)
    assert ("%" in line) is reports


def test_a_vehicle_without_messages_may_have_been_in_the_air() -> None:
    flight = returning()
    craft = flight.crafts["uav2"]
    craft.place_m, craft.up_m, craft.armed = flight.context.vehicles["uav2"].pad_m, 0.0, False
    flight.state = flight.state.put(with_facts(flight.vehicle("uav2"), took_off=False, errand=None))
    flight.run(lambda: flight.stage("uav2") is Stage.LANDED)
    assert "uav2: disarmed; its take-off was not observed" in flight.said(Level.INFO)
