"""What PX4 says by events."""

from __future__ import annotations

import json
import os
import struct
from pathlib import Path

import pytest

from executor.core.interface.messages import Actor, ModeChange, OwnFailsafe
from executor.core.telemetry.mode_evidence import EVENTS, compute_event_id, has_failsafe_action, parse_px4_event

MISSION = 4 << 24 | 4 << 16
PX4_BUILD = os.environ.get("FAULTLINE_PX4_BUILD")
EITHER = (
    {"check_failure_detector_motor"},
    {"check_motor_overcurrent", "check_motor_undercurrent", "commander_rc_loss_hold_no_failsafe"},
)
"""Of what PX4 up to 1.17 has, and what 1.18 has."""

NUMBERS = {
    "commander_failsafe_enter": 9751178,
    "commander_failsafe_enter_hold": 13704694,
    "commander_failsafe_enter_generic": 14605264,
    "commander_rc_override": 1746622,
    "check_battery_critical": 2627595,
    "check_gf_violation_custom_gf": 143019,
    "check_failure_detector_roll": 8538897,
    "mission_finished_loiter": 4678390,
}
"""Of PX4 1.17's own list."""


@pytest.mark.parametrize(("name", "number"), NUMBERS.items())
def test_a_number_is_the_hash_of_a_name(name: str, number: int) -> None:
    assert compute_event_id(name) == 1 << 24 | number


@pytest.mark.skipif(PX4_BUILD is None, reason="FAULTLINE_PX4_BUILD: expected PX4's build directory, with events")
def test_every_event_that_is_read_is_one_of_px4s_own_with_its_number_and_its_arguments() -> None:
    known = json.loads(Path(str(PX4_BUILD), "events", "all_events.json").read_text())
    groups = known["components"]["1"]["event_groups"].values()
    theirs = {event["name"]: (int(number), event) for group in groups for number, event in group["events"].items()}
    assert EVENTS.keys() - theirs.keys() in EITHER
    there = EVENTS.keys() & theirs.keys()
    assert {name: compute_event_id(name) & 0xFFFFFF for name in there} == {name: theirs[name][0] for name in there}
    kinds = {
        name: [one["type"].removeprefix("px4::") for one in theirs[name][1].get("arguments", ())]
        for name in EVENTS
        if name.startswith("commander_failsafe_enter")
    }
    assert kinds == {
        "commander_failsafe_enter": ["uint32_t", "failsafe_action_t", "failsafe_cause_t"],
        "commander_failsafe_enter_hold": ["uint32_t", "failsafe_action_t", "uint16_t", "failsafe_cause_t"],
        "commander_failsafe_enter_generic": ["uint32_t", "failsafe_action_t"],
        "commander_failsafe_enter_generic_hold": ["uint32_t", "failsafe_action_t", "uint16_t"],
        "commander_failsafe_enter_autopilot_disengaged": ["uint32_t", "failsafe_action_t"],
    }


def said(name: str, layout: str = "", *arguments: int) -> OwnFailsafe | ModeChange | None:
    return parse_px4_event(compute_event_id(name), struct.pack("<" + layout, *arguments))


@pytest.mark.parametrize(
    ("found", "kind", "words"),
    [
        (
            said("commander_failsafe_enter", "IBB", MISSION, 6, 4),
            "battery", "failsafe: critical battery level, switching to RTL",
        ),
        (
            said("commander_failsafe_enter", "IBB", MISSION, 7, 1),
            "rc", "failsafe: manual control lost, switching to Land",
        ),
        (
            said("commander_failsafe_enter_hold", "IBHB", MISSION, 6, 5, 2),
            "ground station", "failsafe: ground station lost, switching to RTL in 5 s",
        ),
        (said("commander_failsafe_enter_generic", "IB", MISSION, 8), "other", "failsafe: switching to Descend"),
        (
            said("commander_failsafe_enter_generic_hold", "IBH", MISSION, 6, 300),
            "other", "failsafe: switching to RTL in 300 s",
        ),
        # 1.14's first had nothing but a delay.
        (said("commander_failsafe_enter_generic_hold", "H", 5), "other", "failsafe activated"),
        (said("commander_failsafe_enter_generic"), "other", "failsafe activated"),
        (said("check_battery_critical", "IB", 255, 3), "battery", "critical battery"),
        (said("check_gf_violation_custom_gf", "IB", 255, 3), "fence", "geofence violation"),
        (said("check_failure_detector_roll", "IB", 255, 3), "attitude", "failure detector: roll"),
        (said("commander_rc_loss_hold_no_failsafe"), "rc", "manual control lost, switching to Hold"),
        (said("commander_disarmed_by", "B", 10), "attitude", "disarmed by its failure detector"),
    ],
)  # fmt: skip
def test_what_failed(found: object, kind: str, words: str) -> None:
    assert isinstance(found, OwnFailsafe)
    assert (found.what, found.words, has_failsafe_action(found)) == (kind, words, True)


@pytest.mark.parametrize(
    ("name", "by"),
    [
        ("commander_rc_override", Actor.PILOT),
        ("failsafe_rc_override", Actor.PILOT),
        ("mission_finished_loiter", Actor.MISSION),
        ("mission_finished", Actor.MISSION),
    ],
)
def test_the_source_of_a_mode(name: str, by: Actor) -> None:
    assert said(name) == ModeChange(None, by)


@pytest.mark.parametrize(
    ("number", "arguments"),
    [
        (compute_event_id("commander_failsafe_enter"), struct.pack("<IBB", MISSION, 1, 3)),  # it only warns
        (compute_event_id("commander_disarmed_by"), b"\x06"),  # its landing does
        (compute_event_id("commander_failsafe_enter") & 0xFFFFFF, b""),  # another component's
        (compute_event_id("check_modes_local_pos"), b""),  # on the ground it is always so
        (0, b""),
    ],
)
def test_what_says_nothing_of_it(number: int, arguments: bytes) -> None:
    assert parse_px4_event(number, arguments) is None
