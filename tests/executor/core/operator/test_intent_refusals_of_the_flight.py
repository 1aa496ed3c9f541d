"""Intents for the whole flight, and their refusals."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import pytest

from executor.core.battery.account import BatteryState
from executor.core.interface.intents import Action, Intent
from executor.core.operator import intent_refusals
from executor.core.state.fleet_state import Briefing, Question, TakeoffOffer
from executor.core.state.vehicle_parts import ModeCause
from executor.core.state.vehicle_state import Stage, VehicleState
from tests.executor.builders import with_facts
from tests.executor.core.steps import BATTERY_FAULT, HOLD, TAKEN, beat, flight_of, landed, plan_of, rounded
from tests.executor.core.vehicles import DISARMED, FLEET, NOW_S, flying
from tests.missions.builders import network_of

CONTEXT = FLEET.context
SLANTED = replace(
    CONTEXT,
    setup=replace(CONTEXT.setup, network=network_of([(100.0, 50.0), (160.0, 130.0), (400.0, 130.0)], [(0, 1), (1, 2)])),
)
PILOTS = flying(stage=Stage.PILOT, heartbeat=beat(HOLD), cause=ModeCause.PERSON, taken=replace(TAKEN, returned_s=5.0))
STANDS = landed(stage=Stage.LANDED)


def refused(action: Action, name: str | None, *vehicles: VehicleState, **given: Any) -> str:
    intent = Intent("wish", action, name, "page", False)
    why = intent_refusals.find_refusal(CONTEXT, flight_of(*vehicles, **given), intent, NOW_S)
    return "" if why is None else why[1]


ROWS: list[tuple[str, Callable[[], object], object]] = [
    (
        "a re-plan",
        lambda: [
            refused(Action.REPLAN, None, *vehicles, **given)
            for vehicles, given in (
                ((flying(),), {}),
                ((flying(),), {"recalled": True}),
                ((flying(),), {"replan": plan_of()}),
                ((flying(),), {"ordered": True}),
                ((flying(held_s=5.0),), {}),
                ((flying(waypoint=4),), {"inspected": dict.fromkeys(range(6), "uav2")}),
                ((flying(waypoint=4),), {"inspected": dict.fromkeys(range(5), "uav2"), "given_up": frozenset({5})}),
                ((flying(),), {"inspected": dict.fromkeys(range(2, 6), "uav2")}),
                ((flying(),), {}),
            )
        ],
        [
            "",
            "the flight was aborted",
            "a re-plan is under way",
            "a re-plan is under way",
            "no vehicle can take a new route now",
            "nothing is left to re-plan",
            "",
            "",
            "",
        ],
    ),
    (
        "proof of what counts by evidence alone",
        lambda: [
            refused(Action.PROVE, None, *vehicles, **given)
            for vehicles, given in (
                ((flying(),), {"inferred": frozenset({1})}),
                ((flying(),), {"inspected": {1: "uav2"}, "inferred": frozenset({1})}),
                ((flying(waypoint=4),), {"inspected": dict.fromkeys(range(6), "uav2"), "inferred": frozenset({1})}),
                ((flying(),), {"inspected": {1: "uav2"}, "inferred": frozenset({1}), "replan": plan_of()}),
                ((flying(held_s=5.0),), {"inspected": {1: "uav2"}, "inferred": frozenset({1})}),
            )
        ],
        [
            "every counted segment is already proven by positions",
            "",
            "",
            "a re-plan is under way",
            "no vehicle can take a new route now",
        ],
    ),
    (
        "an abort",
        lambda: [
            refused(Action.ABORT, None, *vehicles, **given)
            for vehicles, given in (
                ((flying(),), {}),
                ((flying(stage=Stage.STARTING),), {}),
                ((flying(stage=Stage.RETURNING),), {}),
                ((), {}),
                ((), {"offer": TakeoffOffer(("uav1",), (0,), 5.0)}),
            )
        ],
        ["", "", "no vehicle is on a mission", "no vehicle is on a mission", ""],
    ),
    (
        "intents for the whole fleet",
        lambda: [
            refused(action, "uav1", flying(), launched_s=launched_s)
            for action in (Action.REPLAN, Action.ABORT, Action.PREPARE, Action.TAKE_OFF)
            for launched_s in (5.0, None)
        ],
        [
            "replan is for the whole fleet; expected no vehicle",
            "the flight has not begun",
            "abort is for the whole fleet; expected no vehicle",
            "the flight has not begun",
            "the flight has begun",
            "prepare is for the whole fleet; expected no vehicle",
            "the flight has begun",
            "take-off is for the whole fleet; expected no vehicle",
        ],
    ),
    (
        "answers to what is asked",
        lambda: [
            refused(action, None, launched_s=launched_s, briefing=Briefing(question=question))
            for action in (Action.PREPARE, Action.TAKE_OFF)
            for launched_s in (None, 5.0)
            for question in (None, Question("prepare", "go?", ()))
        ],
        [
            "that question is not pending",
            "",
            "the flight has begun",
            "the flight has begun",
            "that question is not pending",
            "that question is not pending",
            "the flight has begun",
            "the flight has begun",
        ],
    ),
    (
        "an unknown vehicle",
        lambda: [refused(Action.HOLD, name, flying()) for name in (None, "uav9")],
        [
            "hold needs a vehicle: one of uav1, uav2, uav3",
            "there is no vehicle 'uav9': expected one of uav1, uav2, uav3",
        ],
    ),
    (
        "a flight that has not begun, or is over",
        lambda: [
            refused(Action.HOLD, "uav1", flying(), **given) for given in ({"launched_s": None}, {"finished": True})
        ],
        ["the flight has not begun", "the flight is over"],
    ),
    (
        "back from its pilot",
        lambda: [
            refused(Action.INCLUDE, "uav1", one, **given)
            for one, given in (
                (PILOTS, {}),
                (PILOTS, {"recalled": True}),
                (replace(PILOTS, fault=BATTERY_FAULT), {}),
                (with_facts(PILOTS, taken=TAKEN), {}),
                (with_facts(PILOTS, taken=None), {}),
            )
        ],
        [
            "",
            "the flight was aborted",
            "it is out of the plan: why",
            "it is with its pilot: the pilot must set mission mode first",
            "it is with its pilot: the pilot must set mission mode first",
        ],
    ),
    (
        "back in the plan that is in it",
        lambda: [
            refused(Action.INCLUDE, "uav1", with_facts(STANDS, **one), **given)
            for one, given in (
                ({}, {}),
                ({}, {"inspected": dict.fromkeys(range(6), "uav2")}),
                ({"excluded": True}, {"inspected": dict.fromkeys(range(6), "uav2")}),
                ({"stubborn": True}, {"inspected": dict.fromkeys(range(6), "uav2")}),
                ({"fault": BATTERY_FAULT}, {"inspected": dict.fromkeys(range(6), "uav2")}),
                ({"battery": BatteryState()}, {}),
                ({"cleared_s": 5.0}, {}),
                ({}, {"recalled": True}),
            )
        ],
        [
            "",
            "it is in the plan already, and no segment is left over",
            "",
            "",
            "",
            "its battery is unknown; expected more than its reserve of 15 %",
            "it is cleared for take-off already",
            "the flight was aborted",
        ],
    ),
    (
        "least distance from slanted lines for a landing",
        lambda: [
            intent_refusals._distance_to_line_m(SLANTED, place_m)
            for place_m in (
                (114.0, 102.0),
                (100.0, 40.0),
                (160.0, 140.0),
                (300.0, 100.0),
                (410.0, 130.0),
                (148.0, 114.0),
            )
        ],
        [20.0, 10.0, 10.0, 30.0, 10.0, 0.0],
    ),
    (
        "a motor that is to stop",
        lambda: [
            refused(Action.DISARM, "uav1", flying(stage=stage, heartbeat=heartbeat, heard_s=heard_s))
            for stage, heartbeat, heard_s in (
                (Stage.DOWN, beat(), NOW_S),
                (Stage.DOWN, DISARMED, NOW_S),
                (Stage.DOWN, beat(), NOW_S - 3.0),
                (Stage.DOWN, beat(), None),
                (Stage.LANDED, beat(), NOW_S),
            )
        ],
        [
            "",
            "its motors are off already",
            "no message from it for 3 s",
            "no message was ever received from it",
            "it is not down, it is landed",
        ],
    ),
]


@pytest.mark.parametrize(("what", "found", "expected"), ROWS, ids=[row[0] for row in ROWS])
def test_everything_that_comes_of_it(what: str, found: Callable[[], object], expected: object) -> None:
    assert rounded(found()) == expected
