"""What a wish to take a vehicle out of the plan leads to: every order, every line, and everything that changes."""

from __future__ import annotations

from dataclasses import replace

import pytest

from executor.core.interface.commands import Level, Say, SendHome
from executor.core.interface.intents import Action, Outcome
from executor.core.state.vehicle_parts import HomingOrder, ModeCause, Takeover
from executor.core.state.vehicle_state import Fault, FaultCode, FaultKind, Stage
from tests.executor.builders import with_facts
from tests.executor.core.steps import (
    BATTERY_FAULT,
    HOLD,
    HOMEWARD,
    LOW,
    SECOND,
    SENT_HOME,
    TAKEN,
    Row,
    beat,
    landed,
    noted,
    wish,
)
from tests.executor.core.vehicles import DISARMED, NOW_S, flying

PILOTS = flying(stage=Stage.PILOT, heartbeat=beat(HOLD), cause=ModeCause.PERSON, taken=TAKEN)
STARTS = flying(stage=Stage.STARTING, heartbeat=DISARMED, took_off=False, armed_once=False, fix=LOW, waypoint=0)
BUSY = flying(held_s=NOW_S - 9.0, errand=HomingOrder(NOW_S - 9.0), owed=(0, "why"), cleared_s=NOW_S - 9.0)

ROWS = [
    Row(
        "out of the plan in the air",
        BUSY,
        wish(Action.EXCLUDE),
        [
            Say(Level.WARNING, "page asks: exclude uav1; taken out of the plan, RTL commanded"),
            Say(
                Level.FAULT,
                ("uav1: operator, excluded by the operator; RTL commanded; 2 segments to be reassigned"),
            ),
            SendHome("uav1"),
        ],
        {
            "uav1": SENT_HOME
            | {
                "fault": Fault(FaultKind.OPERATOR, "excluded by the operator", NOW_S, FaultCode.OPERATOR_EXCLUDE),
                "held_s": None,
                "excluded": True,
                "cleared_s": None,
                "owed": None,
            }
        },
        {
            "urgent": True,
            "trigger": "uav1: operator, excluded by the operator",
            "trigger_s": NOW_S,
            "intents": {
                "wish": noted(Action.EXCLUDE, Outcome.ACCEPTED, "taken out of the plan, RTL commanded", "uav1")
            },
        },
        beside=(SECOND,),
    ),
    Row(
        "out of the plan in the air, the last one",
        flying(waypoint=3),
        wish(Action.EXCLUDE),
        [
            Say(Level.WARNING, "page asks: exclude uav1; taken out of the plan, RTL commanded"),
            Say(
                Level.FAULT,
                ("uav1: operator, excluded by the operator; RTL commanded; 1 segment assigned to no vehicle"),
            ),
            SendHome("uav1"),
        ],
        {
            "uav1": SENT_HOME
            | {
                "fault": Fault(FaultKind.OPERATOR, "excluded by the operator", NOW_S, FaultCode.OPERATOR_EXCLUDE),
                "excluded": True,
            }
        },
        {
            "urgent": True,
            "trigger": "uav1: operator, excluded by the operator",
            "trigger_s": NOW_S,
            "intents": {
                "wish": noted(Action.EXCLUDE, Outcome.ACCEPTED, "taken out of the plan, RTL commanded", "uav1")
            },
        },
        {"given_up": frozenset({2, 3, 4, 5})},
    ),
    Row(
        "out of the plan in the air, with others who cannot",
        flying(waypoint=3),
        wish(Action.EXCLUDE),
        [
            Say(
                Level.WARNING,
                (
                    "page asks: exclude uav1; taken out of the plan, RTL commanded; no other vehicle is left "
                    "to inspect 4 segments"
                ),
            ),
            Say(
                Level.FAULT,
                ("uav1: operator, excluded by the operator; RTL commanded; 1 segment assigned to no vehicle"),
            ),
            SendHome("uav1"),
        ],
        {
            "uav1": SENT_HOME
            | {
                "fault": Fault(FaultKind.OPERATOR, "excluded by the operator", NOW_S, FaultCode.OPERATOR_EXCLUDE),
                "excluded": True,
            }
        },
        {
            "urgent": True,
            "trigger": "uav1: operator, excluded by the operator",
            "trigger_s": NOW_S,
            "intents": {
                "wish": noted(
                    Action.EXCLUDE,
                    Outcome.ACCEPTED,
                    "taken out of the plan, RTL commanded; no other vehicle is left to inspect 4 segments",
                    "uav1",
                )
            },
        },
        beside=(replace(SECOND, fault=BATTERY_FAULT), with_facts(SECOND, name="uav3", excluded=True)),
    ),
    Row(
        "out of the plan in the air, with one who returns",
        flying(waypoint=3),
        wish(Action.EXCLUDE),
        [
            Say(
                Level.WARNING,
                (
                    "page asks: exclude uav1; taken out of the plan, RTL commanded; no other vehicle is left "
                    "to inspect 6 segments"
                ),
            ),
            Say(
                Level.FAULT,
                ("uav1: operator, excluded by the operator; RTL commanded; 1 segment assigned to no vehicle"),
            ),
            SendHome("uav1"),
        ],
        {
            "uav1": SENT_HOME
            | {
                "fault": Fault(FaultKind.OPERATOR, "excluded by the operator", NOW_S, FaultCode.OPERATOR_EXCLUDE),
                "excluded": True,
            }
        },
        {
            "urgent": True,
            "trigger": "uav1: operator, excluded by the operator",
            "trigger_s": NOW_S,
            "intents": {
                "wish": noted(
                    Action.EXCLUDE,
                    Outcome.ACCEPTED,
                    "taken out of the plan, RTL commanded; no other vehicle is left to inspect 6 segments",
                    "uav1",
                )
            },
        },
        beside=(replace(SECOND, stage=Stage.RETURNING), replace(SECOND, name="uav3", stage=Stage.LOST)),
    ),
    Row(
        "out of the plan before the take-off",
        STARTS,
        wish(Action.EXCLUDE),
        [
            Say(Level.WARNING, "page asks: exclude uav1; taken out of the plan, RTL commanded"),
            Say(Level.FAULT, "uav1: operator, excluded by the operator; 2 segments to be reassigned"),
            SendHome("uav1"),
        ],
        {
            "uav1": {
                "stage": Stage.LANDED,
                "ordered_mode_s": NOW_S,
                "anchor": None,
                "fault": Fault(FaultKind.OPERATOR, "excluded by the operator", NOW_S, FaultCode.OPERATOR_EXCLUDE),
                "excluded": True,
                "left_s": NOW_S,
            }
        },
        {
            "urgent": True,
            "trigger": "uav1: operator, excluded by the operator",
            "trigger_s": NOW_S,
            "intents": {
                "wish": noted(Action.EXCLUDE, Outcome.ACCEPTED, "taken out of the plan, RTL commanded", "uav1")
            },
        },
        beside=(SECOND,),
    ),
    Row(
        "out of the plan on the ground",
        landed(stage=Stage.LANDED, cleared_s=NOW_S - 5.0),
        wish(Action.EXCLUDE),
        [Say(Level.INFO, "page asks: exclude uav1; it stays on the ground")],
        {"uav1": {"excluded": True, "cleared_s": None}},
        {"intents": {"wish": noted(Action.EXCLUDE, Outcome.DONE, "it stays on the ground", ended_s=NOW_S)}},
    ),
    Row(
        "out of the plan before its start",
        landed(stage=Stage.GROUND, cleared_s=NOW_S - 5.0),
        wish(Action.EXCLUDE),
        [Say(Level.INFO, "page asks: exclude uav1; it stays on the ground")],
        {"uav1": {"excluded": True, "cleared_s": None}},
        {"intents": {"wish": noted(Action.EXCLUDE, Outcome.DONE, "it stays on the ground", ended_s=NOW_S)}},
    ),
    Row(
        "out of the plan where it lies",
        flying(stage=Stage.DOWN, cleared_s=NOW_S - 5.0),
        wish(Action.EXCLUDE),
        [Say(Level.INFO, "page asks: exclude uav1; it stays on the ground")],
        {"uav1": {"excluded": True, "cleared_s": None}},
        {"intents": {"wish": noted(Action.EXCLUDE, Outcome.DONE, "it stays on the ground", ended_s=NOW_S)}},
    ),
    Row(
        "out of the plan with its pilot",
        PILOTS,
        wish(Action.EXCLUDE),
        [Say(Level.INFO, "page asks: exclude uav1; it stays with its pilot; its segments are to be reassigned")],
        {"uav1": {"excluded": True, "taken": Takeover(since_s=NOW_S - 10.0, given_away=True)}},
        {
            "urgent": True,
            "trigger": "uav1: excluded, with its pilot",
            "trigger_s": NOW_S,
            "intents": {
                "wish": noted(
                    Action.EXCLUDE,
                    Outcome.DONE,
                    "it stays with its pilot; its segments are to be reassigned",
                    ended_s=NOW_S,
                )
            },
        },
    ),
    Row(
        "out of the plan with its pilot, not knowing since when",
        with_facts(PILOTS, taken=None),
        wish(Action.EXCLUDE),
        [Say(Level.INFO, "page asks: exclude uav1; it stays with its pilot; its segments are to be reassigned")],
        {"uav1": {"excluded": True}},
        {
            "urgent": True,
            "trigger": "uav1: excluded, with its pilot",
            "trigger_s": NOW_S,
            "intents": {
                "wish": noted(
                    Action.EXCLUDE,
                    Outcome.DONE,
                    "it stays with its pilot; its segments are to be reassigned",
                    ended_s=NOW_S,
                )
            },
        },
    ),
    Row(
        "out of the plan on the way home",
        flying(**HOMEWARD),
        wish(Action.EXCLUDE),
        [
            Say(Level.WARNING, "page asks: exclude uav1; taken out of the plan"),
            Say(
                Level.FAULT,
                ("uav1: operator, excluded by the operator; returning or landing by itself, not commanded"),
            ),
        ],
        {
            "uav1": {
                "ordered_mode_s": NOW_S,
                "anchor": None,
                "fault": Fault(FaultKind.OPERATOR, "excluded by the operator", NOW_S, FaultCode.OPERATOR_EXCLUDE),
                "excluded": True,
                "errand": HomingOrder(NOW_S),
                "left_s": NOW_S,
            }
        },
        {
            "urgent": True,
            "trigger": "uav1: operator, excluded by the operator",
            "trigger_s": NOW_S,
            "intents": {"wish": noted(Action.EXCLUDE, Outcome.DONE, "taken out of the plan", ended_s=NOW_S)},
        },
    ),
]


@pytest.mark.parametrize("row", ROWS, ids=[row.what for row in ROWS])
def test_everything_that_comes_of_it(row: Row) -> None:
    assert row.shows() == row.expected()
