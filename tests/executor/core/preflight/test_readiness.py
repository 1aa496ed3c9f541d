"""What keeps a vehicle on the ground, and in which words."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import pytest

from executor.core.battery.account import BatteryState
from executor.core.context import Context, RelaunchPolicy
from executor.core.preflight.readiness import find_obstacles
from executor.core.state.vehicle_parts import ModeCause
from executor.core.state.vehicle_state import Stage, VehicleState
from tests.executor.builders import with_facts
from tests.executor.core.steps import BATTERY_FAULT, CREW, TAKEN, beat, flight_of, landed, over_pad
from tests.executor.core.vehicles import FLEET, NOW_S, pack

READY = with_facts(landed(stage=Stage.LANDED), cleared_s=NOW_S - 1.0)
ONCE = replace(CREW, fly_again=RelaunchPolicy.NEVER)
NOT_ON_BASE = "it is not on the ground at its base, it is {}"
UNCLEARED = "it is not cleared for take-off"
AT_FAULT = f"it is out of the plan already: {BATTERY_FAULT.reason}"
REBOOTED = "its autopilot has rebooted since its checks"


def kept_by(one: VehicleState, context: Context = CREW, **flight: Any) -> list[str]:
    """Return in words what keeps a vehicle on the ground."""
    return [words for _, words in find_obstacles(context, flight_of(one, **flight), one, NOW_S).values()]


REASONS: list[tuple[str, Callable[[], list[str]], list[str]]] = [
    ("cleared on its pad it may take off", lambda: kept_by(READY), []),
    ("uncleared", lambda: kept_by(with_facts(READY, cleared_s=None)), [UNCLEARED]),
    ("a clearance of two minutes", lambda: kept_by(with_facts(READY, cleared_s=NOW_S - 120.0)), []),
    ("an older clearance", lambda: kept_by(with_facts(READY, cleared_s=NOW_S - 120.1)), [UNCLEARED]),
    ("a simulation needs no clearance", lambda: kept_by(with_facts(READY, cleared_s=None), FLEET.context), []),
    ("aborted", lambda: kept_by(READY, recalled=True), ["the flight was aborted"]),
    (
        "armed",
        lambda: kept_by(with_facts(READY, heartbeat=beat())),
        ["it is not on the ground with its motors off, it is landed"],
    ),
    ("down away from its base", lambda: kept_by(replace(READY, stage=Stage.DOWN)), [NOT_ON_BASE.format("down")]),
    (
        "in the air",
        lambda: kept_by(replace(READY, stage=Stage.FLYING)),
        ["it is not on the ground with its motors off, it is flying", NOT_ON_BASE.format("flying")],
    ),
    ("with its pilot", lambda: kept_by(with_facts(READY, taken=TAKEN)), ["it is with its pilot"]),
    (
        "armed by a person",
        lambda: kept_by(with_facts(READY, heartbeat=beat(), cause=ModeCause.PERSON))[1:],
        ["it is with its pilot"],
    ),
    ("never received", lambda: kept_by(with_facts(READY, heard_s=None)), ["no message was ever received from it"]),
    ("a stale link", lambda: kept_by(with_facts(READY, heard_s=NOW_S - 4.0)), ["no message from it for 4 s"]),
    ("tilted", lambda: kept_by(with_facts(READY, tilted_since_s=NOW_S)), ["it is tilted, it may have tipped over"]),
    (
        "a fault",
        lambda: kept_by(replace(READY, fault=BATTERY_FAULT)),
        [f"it is out of the plan already: {BATTERY_FAULT.reason}"],
    ),
    ("excluded", lambda: kept_by(with_facts(READY, excluded=True)), ["it is out of the plan already"]),
    ("a declined mission", lambda: kept_by(with_facts(READY, stubborn=True)), ["it did not accept its last mission"]),
    (
        "one flight for each vehicle",
        lambda: kept_by(READY, ONCE),
        ["it has landed, and no vehicle takes off twice in this flight"],
    ),
    ("one flight, not flown yet", lambda: kept_by(replace(READY, stage=Stage.GROUND), ONCE), []),
    ("a turnaround", lambda: kept_by(with_facts(READY, asked_s=NOW_S)), ["its turnaround is under way already"]),
    (
        "an upload",
        lambda: kept_by(with_facts(READY, pending=3)),
        ["mission upload in progress; try again in a moment"],
    ),
    (
        "beside its pad",
        lambda: kept_by(with_facts(READY, fix=over_pad(north_m=-15.1))),
        ["it is not on its pad, where its climb and landing are planned"],
    ),
    (
        "a low battery",
        lambda: kept_by(with_facts(READY, battery=pack(19.9))),
        ["its battery is 20 %; expected more than its reserve of 15 %"],
    ),
    (
        "an unknown battery",
        lambda: kept_by(with_facts(READY, battery=BatteryState())),
        ["its battery is unknown; expected more than its reserve of 15 %"],
    ),
    ("rebooted since its clearance", lambda: kept_by(with_facts(READY, rebooted_s=NOW_S)), [REBOOTED]),
    ("rebooted before its clearance", lambda: kept_by(with_facts(READY, rebooted_s=NOW_S - 2.0)), []),
    ("rebooted before its checks", lambda: kept_by(with_facts(READY, rebooted_s=NOW_S, ready_s=NOW_S)), []),
    (
        "its clock fell back",
        lambda: kept_by(with_facts(READY, behind_s=5.0, fell_back_s=NOW_S)),
        ["its clock fell back: its autopilot may have rebooted since its checks"],
    ),
    (
        "several reasons, the most important first",
        lambda: kept_by(with_facts(READY, tilted_since_s=NOW_S, cleared_s=None), recalled=True),
        ["the flight was aborted", "it is tilted, it may have tipped over", UNCLEARED],
    ),
]


@pytest.mark.parametrize(("given", "found", "expected"), REASONS, ids=[given for given, _, _ in REASONS])
def test_each_reason_keeps_a_vehicle_on_the_ground(
    given: str, found: Callable[[], list[str]], expected: list[str]
) -> None:
    del given
    assert found() == expected
