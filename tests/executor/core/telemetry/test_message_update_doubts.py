"""What one packet says and the next one refutes: a HEARTBEAT that is not the vehicle's own ends nothing."""

from __future__ import annotations

from dataclasses import replace

import pytest

from executor.core.interface.commands import Level
from executor.core.interface.events import Heard
from executor.core.interface.messages import Heartbeat, StatusText
from executor.core.state.vehicle_state import FaultKind, Stage
from tests.executor.core.stories import EVERYTHING, under_way
from tests.fakes.flight import Story


def disarmed(flight: Story, name: str) -> Heard:
    return Heard(name, replace(flight.crafts[name].heartbeat(), armed=False))


def test_one_heartbeat_that_says_disarmed_ends_nothing() -> None:
    flight = under_way()
    for name in flight.crafts:
        flight.happen(disarmed(flight, name))
    flight.pass_s(0.4)
    assert {flight.stage(name) for name in flight.crafts} == {Stage.FLYING}
    assert flight.said(Level.WARNING) == [
        f"{name}: HEARTBEAT reports disarmed, but it is flying: sent by another station?" for name in flight.crafts
    ]
    flight.finish()
    assert set(flight.state.coverage.inspected) == EVERYTHING
    assert flight.said(Level.FAULT) == []


def test_a_flood_of_them_between_its_own_ends_nothing() -> None:
    flight = under_way()
    for _ in range(100):
        flight.happen(disarmed(flight, "uav2"))
        flight.happen(disarmed(flight, "uav2"))
        flight.step()
    assert flight.vehicle("uav2").fault is None
    assert len(flight.said(Level.WARNING)) == 1


def test_a_flood_of_them_ends_nothing_though_one_of_its_own_is_lost() -> None:
    flight = under_way()
    flight.run(lambda: flight.now_s - (flight.vehicle("uav2").link.heartbeat_s or 0.0) == 0.0)
    for number in range(100):
        flight.crafts["uav2"].stopped = {Heartbeat} if number % 10 < 3 else set()
        flight.happen(disarmed(flight, "uav2"))
        flight.step()
    assert flight.vehicle("uav2").fault is None
    assert len(flight.said(Level.WARNING)) == 1


def test_what_none_of_its_own_refutes_is_believed() -> None:
    """Its motors were stopped in the air: after three seconds that is known."""
    flight = under_way()
    flight.crafts["uav2"].armed = False
    since_s = flight.now_s
    found_s = flight.run(lambda: flight.vehicle("uav2").fault is not None)
    assert found_s - since_s < 4.5
    assert flight.stage("uav2") is Stage.DOWN


def test_a_reported_reason_counts_at_once() -> None:
    flight = under_way()
    flight.happen(Heard("uav2", StatusText(2, "Crash: Disarming: AngErr=90>30, Accel=0.1<3.0")))
    flight.happen(disarmed(flight, "uav2"))
    flight.pass_s(0.4)
    fault = flight.vehicle("uav2").fault
    assert fault is not None
    assert fault.kind is FaultKind.INTERRUPTION


@pytest.mark.parametrize(("on_pad", "end"), [(True, Stage.DOWN), (False, Stage.LANDED)])
def test_a_vehicle_assumed_on_the_ground_that_flies_is_supervised(on_pad: bool, end: Stage) -> None:
    """However that came about, it is watched until it is down: where it lands, or at home."""
    flight = under_way()
    craft = flight.crafts["uav2"]
    place, up_m = craft.place_m, craft.up_m
    if on_pad:
        craft.place_m = flight.context.vehicles["uav2"].pad_m
    craft.up_m, craft.armed = 0.0, False
    flight.run(lambda: flight.stage("uav2") in {Stage.DOWN, Stage.LANDED})
    craft.place_m, craft.up_m, craft.armed = place, up_m, True
    flight.pass_s(3.0)
    assert any("but is airborne, last position" in line for line in flight.said(Level.FAULT))
    assert flight.stage("uav2") is Stage.RETURNING
    flight.finish()
    assert flight.stage("uav2") is end
    assert set(flight.state.coverage.inspected) == EVERYTHING
