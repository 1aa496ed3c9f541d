"""PX4's "Failsafe activated" has no reason: its event does, and the flight reports that."""

from __future__ import annotations

import pytest

from executor.core.interface.commands import Level
from executor.core.interface.events import Heard
from executor.core.interface.messages import OwnFailsafe, StatusText
from executor.core.state.vehicle_state import FaultKind
from executor.core.telemetry.mode_evidence import compute_event_id, parse_px4_event
from tests.executor.builders import fleet_of
from tests.executor.core.stories import under_way

RTL = 5 << 24 | 4 << 16


def enters() -> OwnFailsafe:
    said = parse_px4_event(compute_event_id("commander_failsafe_enter"), b"\0\0\0\0\x06\x04")
    assert isinstance(said, OwnFailsafe)
    return said


ENTERS = enters()
TEXT = StatusText(2, "Failsafe activated")


@pytest.mark.parametrize(
    ("said", "kind", "words"),
    [
        ([TEXT], FaultKind.INTERRUPTION, "RTL by its own failsafe; it says: Failsafe activated"),
        ([TEXT, ENTERS], FaultKind.BATTERY, "it says: failsafe: critical battery level, switching to RTL"),
        ([ENTERS, TEXT], FaultKind.BATTERY, "it says: failsafe: critical battery level, switching to RTL"),
    ],
)
def test_what_failed_is_declared_by_its_name(said: list[StatusText | OwnFailsafe], kind: FaultKind, words: str) -> None:
    flight = under_way(fleet_of(autopilot="px4"))
    for one in said:
        flight.happen(Heard("uav2", one))
    flight.crafts["uav2"].mode, flight.crafts["uav2"].failsafe = RTL, True
    flight.run(lambda: flight.vehicle("uav2").fault is not None)
    fault = flight.vehicle("uav2").fault
    assert fault is not None
    assert (fault.kind, fault.reason) == (kind, words)
    assert "with its pilot" not in " ".join(flight.said(Level.FAULT))


def test_an_event_alone_is_no_fault() -> None:
    """Anybody can send one: what it says must show somewhere else as well."""
    flight = under_way(fleet_of(autopilot="px4"))
    flight.happen(Heard("uav2", ENTERS))
    flight.pass_s(10.0)
    assert flight.vehicle("uav2").fault is None
