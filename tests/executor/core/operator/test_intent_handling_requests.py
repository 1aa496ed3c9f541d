"""What an order to one vehicle leads to: every order, every line, and everything that changes by it."""

from __future__ import annotations

from dataclasses import replace

import pytest

from executor.core.interface.commands import CancelSolve, Hold, LandNow, Level, Resume, Say, SendHome
from executor.core.interface.intents import Action, IntentReason, Outcome
from executor.core.state.vehicle_parts import HomingOrder, ModeCause
from executor.core.state.vehicle_state import Fault, FaultCode, FaultKind, Stage
from tests.executor.builders import with_facts
from tests.executor.core.steps import (
    BATTERY_FAULT,
    HOLD,
    HOMEWARD,
    LEAVES,
    LOW,
    SECOND,
    SENT_HOME,
    TAKEN,
    Row,
    beat,
    noted,
    over_pad,
    plan_of,
    wish,
)
from tests.executor.core.vehicles import DISARMED, NOW_S, flying

HOLDS = flying(held_s=NOW_S - 9.0, heartbeat=beat(HOLD), hold_asked_s=NOW_S - 9.0)
PILOTS = flying(stage=Stage.PILOT, heartbeat=beat(HOLD), cause=ModeCause.PERSON, taken=TAKEN)
STARTS = flying(stage=Stage.STARTING, heartbeat=DISARMED, took_off=False, armed_once=False, fix=LOW, waypoint=0)
BUSY = flying(held_s=NOW_S - 9.0, errand=HomingOrder(NOW_S - 9.0), owed=(0, "why"), cleared_s=NOW_S - 9.0)
SOLVING = plan_of(solve_s=None)


ROWS = [
    Row(
        "an order to hold",
        flying(anchor=LOW, cause=ModeCause.MISSION),
        wish(Action.HOLD),
        [Say(Level.INFO, "page asks: hold uav1; hold commanded"), Hold("uav1")],
        {
            "uav1": {
                "ordered_mode_s": NOW_S,
                "held_s": NOW_S,
                "hold_asked_s": NOW_S,
                "ordered_modes": frozenset({17}),
                "cause": ModeCause.OURS,
            }
        },
        {"intents": {"wish": noted(Action.HOLD, Outcome.ACCEPTED, "hold commanded", "uav1")}},
    ),
    Row(
        "an order to hold that takes it from its pilot",
        PILOTS,
        wish(Action.HOLD, confirmed=True),
        [Say(Level.INFO, "page asks: hold uav1; hold commanded"), Hold("uav1")],
        {
            "uav1": {
                "stage": Stage.FLYING,
                "ordered_mode_s": NOW_S,
                "held_s": NOW_S,
                "hold_asked_s": NOW_S,
                "ordered_modes": frozenset({17}),
                "cause": ModeCause.OURS,
                "taken": None,
            }
        },
        {"intents": {"wish": noted(Action.HOLD, Outcome.ACCEPTED, "hold commanded", "uav1", confirmed=True)}},
    ),
    Row(
        "an order to hold that may hurt",
        PILOTS,
        wish(Action.HOLD),
        [],
        {},
        {
            "intents": {
                "wish": noted(
                    Action.HOLD,
                    Outcome.REFUSED,
                    "needs confirmation",
                    code=IntentReason.UNCONFIRMED,
                    ended_s=NOW_S,
                    question="uav1 is with its pilot. Take control of it? Speak to the pilot first",
                )
            }
        },
    ),
    Row(
        "an order to go on",
        HOLDS,
        wish(Action.RESUME),
        [Say(Level.INFO, "page asks: resume uav1; resume commanded"), Resume(vehicle="uav1", speed_m_s=3.0)],
        {"uav1": {"ordered_mode_s": NOW_S, "ordered_modes": frozenset({3})}},
        {"intents": {"wish": noted(Action.RESUME, Outcome.ACCEPTED, "resume commanded", "uav1")}},
    ),
    Row(
        "an order to go on beyond the mission",
        with_facts(HOLDS, waypoint=6),
        wish(Action.RESUME),
        [Say(Level.INFO, "page asks: resume uav1; resume commanded"), Resume(vehicle="uav1", speed_m_s=0.0)],
        {"uav1": {"ordered_mode_s": NOW_S, "ordered_modes": frozenset({3})}},
        {"intents": {"wish": noted(Action.RESUME, Outcome.ACCEPTED, "resume commanded", "uav1")}},
    ),
    Row(
        "an order to return",
        BUSY,
        wish(Action.RETURN),
        [
            Say(
                Level.INFO,
                (
                    "page asks: return uav1; RTL commanded; it stays on the ground until included; its "
                    "segments are to be reassigned"
                ),
            ),
            SendHome("uav1"),
        ],
        {"uav1": SENT_HOME | {"held_s": None, "excluded": True, "cleared_s": None, "owed": None}},
        {
            "urgent": True,
            "trigger": "uav1: returns by the operator's order",
            "trigger_s": NOW_S,
            "intents": {
                "wish": noted(
                    Action.RETURN,
                    Outcome.ACCEPTED,
                    ("RTL commanded; it stays on the ground until included; its segments are to be reassigned"),
                    "uav1",
                )
            },
        },
        beside=(SECOND,),
    ),
    Row(
        "an order to return that takes it from its pilot",
        PILOTS,
        wish(Action.RETURN, confirmed=True),
        [
            Say(
                Level.INFO,
                (
                    "page asks: return uav1; RTL commanded; it stays on the ground until included; its "
                    "segments are to be reassigned"
                ),
            ),
            SendHome("uav1"),
        ],
        {
            "uav1": LEAVES
            | {
                "excluded": True,
                "ordered_modes": frozenset({6, 9}),
                "cause": ModeCause.OURS,
                "taken": None,
                "errand": HomingOrder(NOW_S, told=True, force=True),
            }
        },
        {
            "urgent": True,
            "trigger": "uav1: returns by the operator's order",
            "trigger_s": NOW_S,
            "intents": {
                "wish": noted(
                    Action.RETURN,
                    Outcome.ACCEPTED,
                    ("RTL commanded; it stays on the ground until included; its segments are to be reassigned"),
                    "uav1",
                    confirmed=True,
                )
            },
        },
    ),
    Row(
        "an order to return before the take-off",
        STARTS,
        wish(Action.RETURN),
        [
            Say(
                Level.INFO,
                (
                    "page asks: return uav1; RTL commanded; it stays on the ground until included; its "
                    "segments are to be reassigned"
                ),
            ),
            SendHome("uav1"),
        ],
        {"uav1": {"stage": Stage.LANDED, "ordered_mode_s": NOW_S, "anchor": None, "excluded": True, "left_s": NOW_S}},
        {
            "urgent": True,
            "trigger": "uav1: returns by the operator's order",
            "trigger_s": NOW_S,
            "intents": {
                "wish": noted(
                    Action.RETURN,
                    Outcome.ACCEPTED,
                    ("RTL commanded; it stays on the ground until included; its segments are to be reassigned"),
                    "uav1",
                )
            },
        },
    ),
    Row(
        "an order to return in the midst of a start",
        with_facts(STARTS, heartbeat=beat(), armed_once=True, took_off=True, fix=over_pad(10.0)),
        wish(Action.RETURN),
        [
            Say(
                Level.INFO,
                (
                    "page asks: return uav1; landing commanded; it stays on the ground until included; its "
                    "segments are to be reassigned"
                ),
            ),
            LandNow("uav1"),
        ],
        {"uav1": LEAVES | {"excluded": True, "ordered_modes": frozenset({9}), "errand": HomingOrder(NOW_S, told=True)}},
        {
            "urgent": True,
            "trigger": "uav1: returns by the operator's order",
            "trigger_s": NOW_S,
            "intents": {
                "wish": noted(
                    Action.RETURN,
                    Outcome.ACCEPTED,
                    ("landing commanded; it stays on the ground until included; its segments are to be reassigned"),
                    "uav1",
                )
            },
        },
    ),
    Row(
        "an order to return while a re-plan is solved that counted on it",
        flying(),
        wish(Action.RETURN),
        [
            Say(
                Level.INFO,
                (
                    "page asks: return uav1; RTL commanded; it stays on the ground until included; its "
                    "segments are to be reassigned"
                ),
            ),
            CancelSolve(4),
            SendHome("uav1"),
        ],
        {"uav1": SENT_HOME | {"excluded": True}},
        {
            "urgent": True,
            "trigger": "uav3: gone; uav1: returns by the operator's order",
            "trigger_s": NOW_S,
            "replan": None,
            "intents": {
                "wish": noted(
                    Action.RETURN,
                    Outcome.ACCEPTED,
                    ("RTL commanded; it stays on the ground until included; its segments are to be reassigned"),
                    "uav1",
                )
            },
        },
        {"replan": SOLVING},
    ),
    Row(
        "an order to return while a re-plan goes on board",
        flying(pending=4),
        wish(Action.RETURN),
        [
            Say(
                Level.INFO,
                (
                    "page asks: return uav1; RTL commanded; it stays on the ground until included; its "
                    "segments are to be reassigned"
                ),
            ),
            SendHome("uav1"),
        ],
        {"uav1": SENT_HOME | {"pending": None, "excluded": True}},
        {
            "urgent": True,
            "trigger": "uav1: returns by the operator's order",
            "trigger_s": NOW_S,
            "replan": replace(SOLVING, solve_s=0.5, pending=frozenset({"uav2"})),
            "intents": {
                "wish": noted(
                    Action.RETURN,
                    Outcome.ACCEPTED,
                    ("RTL commanded; it stays on the ground until included; its segments are to be reassigned"),
                    "uav1",
                )
            },
        },
        {"replan": plan_of(pending=frozenset({"uav1", "uav2"}))},
    ),
    Row(
        "an order to land",
        BUSY,
        wish(Action.LAND),
        [
            Say(
                Level.WARNING, "page asks: land uav1; landing commanded where it is; its segments are to be reassigned"
            ),
            LandNow("uav1"),
        ],
        {
            "uav1": LEAVES
            | {
                "fault": Fault(
                    FaultKind.OPERATOR, "lands where it was, by the operator's order", NOW_S, FaultCode.OPERATOR_LAND
                ),
                "held_s": None,
                "excluded": True,
                "lands": True,
                "ordered_modes": frozenset({9}),
                "errand": HomingOrder(NOW_S, land=True, told=True),
                "cleared_s": None,
                "owed": None,
            }
        },
        {
            "urgent": True,
            "trigger": "uav1: lands by the operator's order",
            "trigger_s": NOW_S,
            "intents": {
                "wish": noted(
                    Action.LAND,
                    Outcome.ACCEPTED,
                    "landing commanded where it is; its segments are to be reassigned",
                    "uav1",
                )
            },
        },
    ),
    Row(
        "an order to land on the way home",
        flying(**HOMEWARD, fault=BATTERY_FAULT, left_s=5.0) if False else flying(**HOMEWARD),
        wish(Action.LAND),
        [
            Say(
                Level.WARNING, "page asks: land uav1; landing commanded where it is; its segments are to be reassigned"
            ),
            LandNow("uav1"),
        ],
        {
            "uav1": {
                "ordered_mode_s": NOW_S,
                "anchor": None,
                "fault": Fault(
                    FaultKind.OPERATOR, "lands where it was, by the operator's order", NOW_S, FaultCode.OPERATOR_LAND
                ),
                "excluded": True,
                "lands": True,
                "ordered_modes": frozenset({9}),
                "errand": HomingOrder(NOW_S, land=True, told=True),
                "left_s": NOW_S,
            }
        },
        {
            "intents": {
                "wish": noted(
                    Action.LAND,
                    Outcome.ACCEPTED,
                    "landing commanded where it is; its segments are to be reassigned",
                    "uav1",
                )
            }
        },
    ),
    Row(
        "an order to land of one with a fault",
        flying(**HOMEWARD, fault=BATTERY_FAULT),
        wish(Action.LAND),
        [
            Say(
                Level.WARNING, "page asks: land uav1; landing commanded where it is; its segments are to be reassigned"
            ),
            LandNow("uav1"),
        ],
        {
            "uav1": {
                "ordered_mode_s": NOW_S,
                "anchor": None,
                "excluded": True,
                "lands": True,
                "ordered_modes": frozenset({9}),
                "errand": HomingOrder(NOW_S, land=True, told=True),
                "left_s": NOW_S,
            }
        },
        {
            "intents": {
                "wish": noted(
                    Action.LAND,
                    Outcome.ACCEPTED,
                    "landing commanded where it is; its segments are to be reassigned",
                    "uav1",
                )
            }
        },
    ),
    Row(
        "an order to land that takes it from its pilot",
        PILOTS,
        wish(Action.LAND, confirmed=True),
        [
            Say(
                Level.WARNING, "page asks: land uav1; landing commanded where it is; its segments are to be reassigned"
            ),
            LandNow("uav1"),
        ],
        {
            "uav1": LEAVES
            | {
                "fault": Fault(
                    FaultKind.OPERATOR, "lands where it was, by the operator's order", NOW_S, FaultCode.OPERATOR_LAND
                ),
                "excluded": True,
                "lands": True,
                "ordered_modes": frozenset({9}),
                "cause": ModeCause.OURS,
                "taken": None,
                "errand": HomingOrder(NOW_S, land=True, told=True, force=True),
            }
        },
        {
            "intents": {
                "wish": noted(
                    Action.LAND,
                    Outcome.ACCEPTED,
                    "landing commanded where it is; its segments are to be reassigned",
                    "uav1",
                    confirmed=True,
                )
            }
        },
    ),
    Row(
        "an order to land in the midst of a start",
        with_facts(STARTS, heartbeat=beat(), armed_once=True, took_off=True, fix=over_pad(10.0)),
        wish(Action.LAND),
        [Say(Level.WARNING, "page asks: land uav1; refused: it is not flying, it is starting")],
        {},
        {
            "intents": {
                "wish": noted(
                    Action.LAND,
                    Outcome.REFUSED,
                    "it is not flying, it is starting",
                    code=IntentReason.NOT_FLYING,
                    ended_s=NOW_S,
                )
            }
        },
    ),
]


@pytest.mark.parametrize("row", ROWS, ids=[row.what for row in ROWS])
def test_everything_that_comes_of_it(row: Row) -> None:
    assert row.shows() == row.expected()
