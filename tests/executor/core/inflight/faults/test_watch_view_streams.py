"""A stream stops while the others continue: it is reported, requested again, and a fault by its own name."""

from __future__ import annotations

import re

import pytest

from executor.core.inflight.faults.watch_view import LEAST_GONE_S
from executor.core.interface.commands import AskStreams, Level
from executor.core.interface.events import Heard
from executor.core.interface.intents import Action
from executor.core.interface.messages import Battery, Heartbeat, LandedState, MissionCurrent, Position
from executor.core.state.vehicle_state import FaultKind, Stage
from tests.executor.core.stories import EVERYTHING, under_way

HANGS = r"uav2: has not moved for 2[0-2] s on its return, \d+\.\d{5}, \d+\.\d{5} \(.*\), \d+ m over its home"
STREAMS = {
    Position: ("no position", FaultKind.INTERRUPTION, 20.0),
    Heartbeat: ("no HEARTBEAT", FaultKind.INTERRUPTION, 20.0),
    MissionCurrent: ("no report of its current waypoint", FaultKind.INTERRUPTION, 20.0),
    Battery: ("no battery report", FaultKind.BATTERY, 60.0),
}
BY_NAME = pytest.mark.parametrize("kind", STREAMS, ids=lambda kind: str(kind.__name__))


@BY_NAME
def test_what_stops_is_reported_and_asked_for_and_then_a_fault_by_its_name(kind: type) -> None:
    words, fault_kind, gone_s = STREAMS[kind]
    flight = under_way()
    flight.crafts["uav2"].stopped.add(kind)
    stopped_s = flight.now_s
    found_s = flight.run(lambda: flight.vehicle("uav2").fault is not None)
    assert found_s - stopped_s == pytest.approx(gone_s, abs=1.5)
    fault = flight.vehicle("uav2").fault
    assert fault is not None
    assert fault.kind is fault_kind
    assert fault.reason.startswith(f"{words} for ")
    assert any(line.startswith(f"uav2: {words} for ") for line in flight.said(Level.WARNING))
    assert 3 <= flight.crafts["uav2"].asked_again <= 9
    flight.pass_s(2.0)
    assert flight.sent_home() == ["uav2"]
    flight.finish()
    assert set(flight.state.coverage.inspected) == EVERYTHING


@BY_NAME
def test_what_comes_again_in_time_is_no_fault(kind: type) -> None:
    flight = under_way()
    flight.crafts["uav2"].stopped.add(kind)
    flight.pass_s(12.0)
    flight.crafts["uav2"].stopped.clear()
    flight.finish()
    assert set(flight.state.coverage.inspected) == EVERYTHING
    assert flight.said(Level.FAULT) == []
    assert flight.given(AskStreams)


def test_a_silence_of_everything_is_a_matter_of_the_link() -> None:
    flight = under_way()
    flight.crafts["uav2"].mute = True
    flight.run(lambda: flight.stage("uav2") is Stage.LOST)
    assert flight.given(AskStreams) == []


def test_a_silence_in_which_a_stream_would_be_due_is_no_fault_of_that_stream() -> None:
    flight = under_way()
    craft = flight.crafts["uav2"]
    craft.stopped.add(Position)
    flight.pass_s(LEAST_GONE_S - 1.0)
    craft.mute = True
    flight.pass_s(1.6)
    assert flight.vehicle("uav2").fault is None
    craft.mute = False
    flight.run(lambda: flight.vehicle("uav2").fault is not None, limit_s=3.0)
    assert any("no position" in line for line in flight.said(Level.FAULT))


def test_what_came_last_before_a_silence_is_not_missed_while_others_come() -> None:
    flight = under_way()
    flight.crafts["uav2"].stopped.add(Heartbeat)
    flight.pass_s(1.0)
    flight.crafts["uav2"].mute = True
    flight.run(lambda: flight.stage("uav2") is Stage.LOST)
    assert [line for line in flight.said(Level.WARNING) if "no HEARTBEAT" in line] == []


def test_without_positions_its_use_accuses_no_battery() -> None:
    """What the flight should cost is known by the speed alone."""
    flight = under_way()
    flight.crafts["uav2"].stopped.add(Position)
    flight.crafts["uav2"].consumption = 3.0
    flight.run(lambda: flight.vehicle("uav2").fault is not None)
    fault = flight.vehicle("uav2").fault
    assert fault is not None
    assert fault.reason.startswith("no position")


def test_a_landing_without_heartbeats_is_seen_by_its_place() -> None:
    flight = under_way()
    flight.crafts["uav2"].stopped.add(Heartbeat)
    flight.finish()
    assert flight.stage("uav2") is Stage.DOWN
    assert any(line.startswith("uav2: does not move, ") for line in flight.said(Level.FAULT))


def test_a_vehicle_without_position_and_heartbeat_is_lost() -> None:
    flight = under_way()
    flight.crafts["uav2"].stopped |= {Heartbeat, Position}
    stopped_s = flight.now_s
    found_s = flight.run(lambda: flight.stage("uav2") is Stage.LOST)
    assert found_s - stopped_s == pytest.approx(60.0, abs=1.5)
    assert any("neither HEARTBEAT nor position for 60 s" in line for line in flight.said(Level.WARNING))
    flight.crafts["uav2"].stopped.clear()
    flight.finish()
    assert flight.stage("uav2") is Stage.LANDED


@pytest.mark.parametrize(("on_ground", "down_s"), [(None, 30.0), (True, 5.0), (False, 150.0)])
def test_a_vehicle_stuck_in_its_return_is_reported_before_it_counts_as_down(
    on_ground: bool | None, down_s: float
) -> None:
    flight = under_way()
    flight.ask(Action.RETURN, "uav2")
    flight.pass_s(3.0)
    flight.crafts["uav2"].stuck = True
    flight.happen(Heard("uav2", LandedState(on_ground)))
    since_s = flight.now_s
    found_s = flight.run(lambda: flight.stage("uav2") is Stage.DOWN)
    assert found_s - since_s == pytest.approx(down_s, abs=3.0)
    lines = [line for line in flight.said() if "has not moved for" in line]
    assert len(lines) == (down_s > 20.0)
    assert all(re.fullmatch(HANGS, line) for line in lines), lines
