"""What a wish for the plan leads to: every order, every line, and everything that changes by it."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import pytest

from executor.core import fleet
from executor.core.commands import CancelSolve, Disarm, Level, Resume, Say, SendHome
from executor.core.events import ReturnAllOrdered
from executor.core.intents import Action, IntentReason, Outcome
from executor.core.parts import Cause, Errand, TakenOver, Watch
from executor.core.state import Briefing, Offer, Question
from executor.core.vehicle import Fault, FaultCode, FaultKind, Stage, VehicleState
from tests.executor.builders import with_facts
from tests.executor.core.faults.test_watchpoints import DISARMED, FLEET, NOW_S, flying
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
    flight_of,
    landed,
    noted,
    plan_of,
    wish,
    wished,
)

PILOTS = flying(stage=Stage.PILOT, heartbeat=beat(HOLD), cause=Cause.PERSON, taken=TAKEN)
GIVES_BACK = with_facts(PILOTS, heartbeat=beat(), taken=replace(TAKEN, returned_s=NOW_S - 5.0))
STARTS = flying(stage=Stage.STARTING, heartbeat=DISARMED, took_off=False, armed_once=False, fix=LOW, waypoint=0)
BUSY = flying(held_s=NOW_S - 9.0, errand=Errand(NOW_S - 9.0), owed=(0, "why"), cleared_s=NOW_S - 9.0)
BEFORE_LAUNCH = Briefing(question=Question("take-off", "go?", ()))
SOLVING = plan_of(solve_s=None)


def again(**given: Any) -> VehicleState:
    """Return a vehicle on its pad of which all that a flight leaves is still known."""
    left = {
        "fault": BATTERY_FAULT, "stubborn": True, "lands": True, "held_s": 5.0, "watches": (("mode", Watch(5.0)),),
        "alarm": ("crash", 5.0), "failures": 2, "armed_once": True, "taken": TAKEN, "excluded": True,
    }  # fmt: skip
    return landed(stage=Stage.LANDED, **{**left, **given})


ROWS = [
    Row(
        "out of the plan in the air",
        BUSY,
        wish(Action.EXCLUDE),
        [
            Say(Level.WARNING, "page asks: exclude uav1; taken out of the plan, RTL commanded"),
            Say(
                Level.FAULT,
                ("uav1: operator, excluded by the operator's word; RTL commanded; 2 segments to be reassigned"),
            ),
            SendHome("uav1"),
        ],
        {
            "uav1": SENT_HOME
            | {
                "fault": Fault(
                    FaultKind.OPERATOR, "excluded by the operator's word", NOW_S, FaultCode.OPERATOR_EXCLUDE
                ),
                "held_s": None,
                "excluded": True,
                "cleared_s": None,
                "owed": None,
            }
        },
        {
            "urgent": True,
            "trigger": "uav1: operator, excluded by the operator's word",
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
                ("uav1: operator, excluded by the operator's word; RTL commanded; 1 segment left without a vehicle"),
            ),
            SendHome("uav1"),
        ],
        {
            "uav1": SENT_HOME
            | {
                "fault": Fault(
                    FaultKind.OPERATOR, "excluded by the operator's word", NOW_S, FaultCode.OPERATOR_EXCLUDE
                ),
                "excluded": True,
            }
        },
        {
            "urgent": True,
            "trigger": "uav1: operator, excluded by the operator's word",
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
                ("uav1: operator, excluded by the operator's word; RTL commanded; 1 segment left without a vehicle"),
            ),
            SendHome("uav1"),
        ],
        {
            "uav1": SENT_HOME
            | {
                "fault": Fault(
                    FaultKind.OPERATOR, "excluded by the operator's word", NOW_S, FaultCode.OPERATOR_EXCLUDE
                ),
                "excluded": True,
            }
        },
        {
            "urgent": True,
            "trigger": "uav1: operator, excluded by the operator's word",
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
                ("uav1: operator, excluded by the operator's word; RTL commanded; 1 segment left without a vehicle"),
            ),
            SendHome("uav1"),
        ],
        {
            "uav1": SENT_HOME
            | {
                "fault": Fault(
                    FaultKind.OPERATOR, "excluded by the operator's word", NOW_S, FaultCode.OPERATOR_EXCLUDE
                ),
                "excluded": True,
            }
        },
        {
            "urgent": True,
            "trigger": "uav1: operator, excluded by the operator's word",
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
            Say(Level.FAULT, "uav1: operator, excluded by the operator's word; 2 segments to be reassigned"),
            SendHome("uav1"),
        ],
        {
            "uav1": {
                "stage": Stage.LANDED,
                "ordered_mode_s": NOW_S,
                "anchor": None,
                "fault": Fault(
                    FaultKind.OPERATOR, "excluded by the operator's word", NOW_S, FaultCode.OPERATOR_EXCLUDE
                ),
                "excluded": True,
                "left_s": NOW_S,
            }
        },
        {
            "urgent": True,
            "trigger": "uav1: operator, excluded by the operator's word",
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
        {"uav1": {"excluded": True, "taken": TakenOver(since_s=NOW_S - 10.0, given_away=True)}},
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
                ("uav1: operator, excluded by the operator's word; returning or landing by itself, not commanded"),
            ),
        ],
        {
            "uav1": {
                "ordered_mode_s": NOW_S,
                "anchor": None,
                "fault": Fault(
                    FaultKind.OPERATOR, "excluded by the operator's word", NOW_S, FaultCode.OPERATOR_EXCLUDE
                ),
                "excluded": True,
                "errand": Errand(NOW_S),
                "left_s": NOW_S,
            }
        },
        {
            "urgent": True,
            "trigger": "uav1: operator, excluded by the operator's word",
            "trigger_s": NOW_S,
            "intents": {"wish": noted(Action.EXCLUDE, Outcome.DONE, "taken out of the plan", ended_s=NOW_S)},
        },
    ),
    Row(
        "back in the plan on the ground",
        again(),
        wish(Action.INCLUDE, confirmed=True),
        [Say(Level.INFO, "page asks: include uav1; it is back in the plan; re-planning with it")],
        {
            "uav1": {
                "stage": Stage.GROUND,
                "armed_once": False,
                "fault": None,
                "stubborn": False,
                "failures": 0,
                "alarm": ("", -math.inf),
                "held_s": None,
                "excluded": False,
                "lands": False,
                "taken": None,
                "cleared_s": NOW_S,
            }
        },
        {
            "given_up": frozenset(),
            "urgent": True,
            "trigger": "uav1: is back with 90 % in its battery",
            "trigger_s": NOW_S,
            "considered": frozenset({"uav2"}),
            "intents": {
                "wish": noted(
                    Action.INCLUDE,
                    Outcome.DONE,
                    "it is back in the plan; re-planning with it",
                    ended_s=NOW_S,
                    confirmed=True,
                )
            },
            "mended": (("uav1", BATTERY_FAULT),),
            "offers_over": False,
        },
        {"considered": frozenset({"uav1", "uav2"}), "given_up": frozenset({4}), "offers_over": True},
    ),
    Row(
        "back in the plan on the ground, well",
        again(fault=None),
        wish(Action.INCLUDE, confirmed=True),
        [Say(Level.INFO, "page asks: include uav1; it is back in the plan; re-planning with it")],
        {
            "uav1": {
                "stage": Stage.GROUND,
                "armed_once": False,
                "stubborn": False,
                "failures": 0,
                "alarm": ("", -math.inf),
                "held_s": None,
                "excluded": False,
                "lands": False,
                "taken": None,
                "cleared_s": NOW_S,
            }
        },
        {
            "urgent": True,
            "trigger": "uav1: is back with 90 % in its battery",
            "trigger_s": NOW_S,
            "intents": {
                "wish": noted(
                    Action.INCLUDE,
                    Outcome.DONE,
                    "it is back in the plan; re-planning with it",
                    ended_s=NOW_S,
                    confirmed=True,
                )
            },
        },
        {"offer": Offer(("uav1",), (4,), 5.0)},
    ),
    Row(
        "back in the plan, one of two that were offered",
        again(fault=None),
        wish(Action.INCLUDE, confirmed=True),
        [Say(Level.INFO, "page asks: include uav1; it is back in the plan; re-planning with it")],
        {
            "uav1": {
                "stage": Stage.GROUND,
                "armed_once": False,
                "stubborn": False,
                "failures": 0,
                "alarm": ("", -math.inf),
                "held_s": None,
                "excluded": False,
                "lands": False,
                "taken": None,
                "cleared_s": NOW_S,
            }
        },
        {
            "urgent": True,
            "trigger": "uav1: is back with 90 % in its battery",
            "trigger_s": NOW_S,
            "wait_until_s": NOW_S + 15.0,
            "intents": {
                "wish": noted(
                    Action.INCLUDE,
                    Outcome.DONE,
                    "it is back in the plan; re-planning with it",
                    ended_s=NOW_S,
                    confirmed=True,
                )
            },
        },
        {"offer": Offer(("uav1", "uav2"), (4,), 5.0)},
    ),
    Row(
        "back in the plan, one of two, while there is a longer wait",
        again(fault=None),
        wish(Action.INCLUDE, confirmed=True),
        [Say(Level.INFO, "page asks: include uav1; it is back in the plan; re-planning with it")],
        {
            "uav1": {
                "stage": Stage.GROUND,
                "armed_once": False,
                "stubborn": False,
                "failures": 0,
                "alarm": ("", -math.inf),
                "held_s": None,
                "excluded": False,
                "lands": False,
                "taken": None,
                "cleared_s": NOW_S,
            }
        },
        {
            "urgent": True,
            "trigger": "uav1: is back with 90 % in its battery",
            "trigger_s": NOW_S,
            "intents": {
                "wish": noted(
                    Action.INCLUDE,
                    Outcome.DONE,
                    "it is back in the plan; re-planning with it",
                    ended_s=NOW_S,
                    confirmed=True,
                )
            },
        },
        {"offer": Offer(("uav1", "uav2"), (4,), 5.0), "wait_until_s": NOW_S + 60.0},
    ),
    Row(
        "back in the plan with nothing to do",
        again(fault=None),
        wish(Action.INCLUDE, confirmed=True),
        [
            Say(
                Level.INFO,
                (
                    "page asks: include uav1; it is back in the plan; no segment is left over, a re-plan would "
                    "share the others"
                ),
            )
        ],
        {
            "uav1": {
                "stage": Stage.GROUND,
                "armed_once": False,
                "stubborn": False,
                "failures": 0,
                "alarm": ("", -math.inf),
                "held_s": None,
                "excluded": False,
                "lands": False,
                "taken": None,
                "cleared_s": NOW_S,
            }
        },
        {
            "urgent": True,
            "trigger": "uav1: is back with 90 % in its battery",
            "trigger_s": NOW_S,
            "intents": {
                "wish": noted(
                    Action.INCLUDE,
                    Outcome.DONE,
                    "it is back in the plan; no segment is left over, a re-plan would share the others",
                    ended_s=NOW_S,
                    confirmed=True,
                )
            },
        },
        {"inspected": dict.fromkeys(range(6), "uav2")},
    ),
    Row(
        "back in the plan from its pilot",
        GIVES_BACK,
        wish(Action.INCLUDE),
        [
            Say(Level.INFO, "page asks: include uav1; it is back in the plan"),
            Say(Level.INFO, "uav1: is back in the plan, from its pilot"),
            Resume(vehicle="uav1", speed_m_s=3.0),
        ],
        {
            "uav1": {
                "stage": Stage.FLYING,
                "ordered_mode_s": NOW_S,
                "anchor": None,
                "ordered_modes": frozenset({3}),
                "cause": Cause.OURS,
                "taken": None,
            }
        },
        {"intents": {"wish": noted(Action.INCLUDE, Outcome.DONE, "it is back in the plan", ended_s=NOW_S)}},
    ),
    Row(
        "back in the plan from its pilot, its work given away",
        with_facts(GIVES_BACK, taken=replace(TAKEN, returned_s=NOW_S - 5.0, given_away=True)),
        wish(Action.INCLUDE),
        [
            Say(Level.INFO, "page asks: include uav1; it is back in the plan"),
            Say(Level.INFO, "uav1: is back in the plan, from its pilot"),
            Resume(vehicle="uav1", speed_m_s=3.0),
        ],
        {
            "uav1": {
                "stage": Stage.FLYING,
                "ordered_mode_s": NOW_S,
                "anchor": None,
                "ordered_modes": frozenset({3}),
                "cause": Cause.OURS,
                "taken": None,
            }
        },
        {
            "trigger": "uav1: is back in the plan",
            "trigger_s": NOW_S,
            "intents": {"wish": noted(Action.INCLUDE, Outcome.DONE, "it is back in the plan", ended_s=NOW_S)},
            "ordered": True,
        },
    ),
    Row(
        "motors off",
        flying(stage=Stage.DOWN),
        wish(Action.DISARM, confirmed=True),
        [Say(Level.WARNING, "page asks: disarm uav1; forced disarm commanded"), Disarm(vehicle="uav1", force=True)],
        {},
        {
            "intents": {
                "wish": noted(Action.DISARM, Outcome.ACCEPTED, "forced disarm commanded", "uav1", confirmed=True)
            }
        },
    ),
    Row(
        "a re-plan",
        flying(),
        wish(Action.REPLAN, None),
        [Say(Level.INFO, "page asks: replan; all open segments are re-planned")],
        {},
        {
            "given_up": frozenset(),
            "trigger": "page asks for it",
            "trigger_s": NOW_S,
            "intents": {"wish": noted(Action.REPLAN, Outcome.ACCEPTED, "all open segments are re-planned", name=None)},
            "ordered": True,
        },
        {"given_up": frozenset({4})},
    ),
    Row(
        "everybody home",
        flying(),
        wish(Action.ABORT, None),
        [
            Say(Level.WARNING, "page asks: abort; all vehicles ordered to return"),
            CancelSolve(4),
            SendHome("uav1"),
            SendHome("uav2"),
        ],
        {"uav1": SENT_HOME | {"excluded": True}, "uav2": SENT_HOME | {"excluded": True}},
        {
            "replan": None,
            "recalled": True,
            "intents": {
                "wish": noted(
                    Action.ABORT, Outcome.ACCEPTED, "all vehicles ordered to return", "uav1", "uav2", name=None
                )
            },
        },
        {"replan": SOLVING},
        beside=(SECOND,),
    ),
    Row(
        "everybody home, with a re-plan on its way on board",
        flying(),
        wish(Action.ABORT, None),
        [Say(Level.WARNING, "page asks: abort; all vehicles ordered to return"), SendHome("uav1")],
        {"uav1": SENT_HOME | {"excluded": True}},
        {
            "replan": None,
            "recalled": True,
            "intents": {
                "wish": noted(Action.ABORT, Outcome.ACCEPTED, "all vehicles ordered to return", "uav1", name=None)
            },
            "offer": None,
        },
        {"replan": plan_of(pending=frozenset({"uav1"})), "offer": Offer(("uav3",), (4,), 5.0)},
    ),
    Row(
        "everybody home but who is with a pilot",
        replace(SECOND, name="uav1"),
        wish(Action.ABORT, None),
        [
            Say(Level.WARNING, "page asks: abort; all vehicles ordered to return"),
            SendHome("uav1"),
            Say(Level.WARNING, "uav2: is with its pilot; RTL not commanded"),
            Say(Level.WARNING, "uav3: is with its pilot; RTL not commanded"),
        ],
        {"uav1": SENT_HOME | {"excluded": True}},
        {
            "recalled": True,
            "intents": {
                "wish": noted(Action.ABORT, Outcome.ACCEPTED, "all vehicles ordered to return", "uav1", name=None)
            },
        },
        beside=(
            replace(PILOTS, name="uav2"),
            flying(name="uav3", cause=Cause.PERSON, heartbeat=beat(HOLD))
            if False
            else replace(flying(cause=Cause.PERSON, heartbeat=beat(HOLD)), name="uav3"),
        ),
    ),
    Row(
        "everybody home at the end of the site's work",
        STARTS,
        ReturnAllOrdered(),
        [
            Say(Level.WARNING, "flight aborted by the operator, all vehicles return"),
            SendHome("uav1"),
            Say(Level.WARNING, "uav2: is with its pilot; RTL not commanded"),
        ],
        {"uav1": {"stage": Stage.LANDED, "ordered_mode_s": NOW_S, "anchor": None, "excluded": True, "left_s": NOW_S}},
        {"launched_s": NOW_S, "recalled": True},
        {"launched_s": None},
        beside=(replace(PILOTS, name="uav2"), replace(flying(**HOMEWARD), name="uav3")),
    ),
    Row(
        "an answer to the question before the flight",
        STARTS,
        wish(Action.TAKE_OFF, None),
        [Say(Level.INFO, "page asks: take-off; yes")],
        {},
        {
            "intents": {"wish": noted(Action.TAKE_OFF, Outcome.DONE, "yes", ended_s=NOW_S, name=None)},
            "briefing": Briefing(answered="take-off"),
        },
        {"launched_s": None, "briefing": BEFORE_LAUNCH},
    ),
    Row(
        "an answer to another question",
        STARTS,
        wish(Action.PREPARE, None),
        [Say(Level.WARNING, "page asks: prepare; refused: that question is not open now")],
        {},
        {
            "intents": {
                "wish": noted(
                    Action.PREPARE,
                    Outcome.REFUSED,
                    "that question is not open now",
                    code=IntentReason.NOT_ASKED,
                    ended_s=NOW_S,
                    name=None,
                )
            }
        },
        {"launched_s": None, "briefing": BEFORE_LAUNCH},
    ),
    Row(
        "a wish that was taken before",
        flying(),
        wish(Action.HOLD),
        [],
        {},
        {},
        {"intents": {"wish": wished(Action.RETURN)}},
    ),
    Row(
        "a wish that is refused",
        flying(),
        wish(Action.RESUME),
        [Say(Level.WARNING, "page asks: resume uav1; refused: it is not on hold, it is flying")],
        {},
        {
            "intents": {
                "wish": noted(
                    Action.RESUME,
                    Outcome.REFUSED,
                    "it is not on hold, it is flying",
                    code=IntentReason.NOT_ON_HOLD,
                    ended_s=NOW_S,
                )
            }
        },
    ),
]


@pytest.mark.parametrize("row", ROWS, ids=[row.what for row in ROWS])
def test_everything_that_comes_of_it(row: Row) -> None:
    assert row.shows() == row.expected()


@pytest.mark.parametrize(("ended", "gone"), [(3, "3"), (499, "499"), (None, "0")])
def test_of_five_hundred_wishes_the_oldest_that_has_ended_is_forgotten(ended: int | None, gone: str) -> None:
    under_way = {str(number): wished(Action.HOLD, "uav1") for number in range(500)}
    many = {name: replace(one, ended_s=5.0 if name == str(ended) else None) for name, one in under_way.items()}
    state, _ = fleet.step(FLEET.context, flight_of(flying(), intents=many), wish(Action.HOLD), NOW_S)
    assert list(many.keys() - state.crew.intents.keys()) == [gone]
    less = {name: one for name, one in many.items() if name != "7"}
    state, _ = fleet.step(FLEET.context, flight_of(flying(), intents=less), wish(Action.HOLD), NOW_S)
    assert list(less.keys() - state.crew.intents.keys()) == []
