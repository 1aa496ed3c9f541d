"""Parameters that differ from the flight's, in the checks between two sorties."""

from __future__ import annotations

from dataclasses import replace

import pytest

from executor.core.ground import turnaround
from executor.core.interface.commands import Command, Examine, Level, Say
from executor.core.interface.events import Examined
from executor.core.state.vehicle_state import Stage
from tests.executor.builders import with_facts
from tests.executor.core.steps import CREW, LOW, flight_of
from tests.executor.core.vehicles import DISARMED, NOW_S, flying

CHANGED = "RTL_ALT 300 -> 1500 cm: keeps its RTL above the others' layers"
SEEN = Examined("uav1", ready=True, reason="", remaining_pct=90.0, changed=(CHANGED,))
STANDS = flying(stage=Stage.LANDED, heartbeat=DISARMED, fix=LOW, waypoint=0, anchor=None)
REFUSED = (
    f"uav1: not cleared for take-off: its parameters differ from those set for the flight: {CHANGED}; "
    "repeat `swap` when fixed"
)


def answered(event: Examined, rebooted_s: float | None) -> tuple[bool, tuple[Command, ...]]:
    vehicle = with_facts(STANDS, asked_s=NOW_S - 20.0, rebooted_s=rebooted_s)
    state, commands = turnaround.apply_examination(CREW, flight_of(vehicle), event, NOW_S)
    return state.vehicles["uav1"].turn.asked_s is not None, commands


def test_what_it_lost_at_a_boot_is_set_again() -> None:
    text = f"uav1: parameters set again after reboot: {CHANGED}"
    assert answered(SEEN, NOW_S - 15.0) == (True, (Say(Level.INFO, text), Examine("uav1", sets=True)))


@pytest.mark.parametrize(
    ("event", "rebooted_s"),
    [(SEEN, None), (replace(SEEN, sets=True), NOW_S - 15.0)],
    ids=["somebody changed it without a boot", "it does not take it"],
)
def test_else_it_stays_on_the_ground(event: Examined, rebooted_s: float | None) -> None:
    assert answered(event, rebooted_s) == (False, (Say(Level.WARNING, REFUSED),))


def test_no_parameter_is_set_on_a_vehicle_that_is_not_ready() -> None:
    waits, commands = answered(replace(SEEN, ready=False, reason="it is armed"), NOW_S - 15.0)
    assert not waits
    [line] = commands
    assert isinstance(line, Say)
    assert line.text == "uav1: not cleared for take-off: it is armed; repeat `swap` when fixed"
