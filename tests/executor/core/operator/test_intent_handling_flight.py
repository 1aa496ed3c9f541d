"""What a wish for the flight leads to: every order, every line, and everything that changes by it."""

from __future__ import annotations

from dataclasses import replace

import pytest

from executor.core import fleet_step
from executor.core.interface.commands import CancelSolve, Disarm, Level, Say, SendHome
from executor.core.interface.events import ReturnAllOrdered
from executor.core.interface.intents import Action, IntentReason, Outcome
from executor.core.state.fleet_state import Briefing, Question, TakeoffOffer
from executor.core.state.vehicle_parts import ModeCause
from executor.core.state.vehicle_state import Stage
from tests.executor.core.steps import (
    HOLD,
    HOMEWARD,
    LOW,
    SECOND,
    SENT_HOME,
    TAKEN,
    Row,
    beat,
    flight_of,
    noted,
    plan_of,
    wish,
    wished,
)
from tests.executor.core.vehicles import DISARMED, FLEET, NOW_S, flying

PILOTS = flying(stage=Stage.PILOT, heartbeat=beat(HOLD), cause=ModeCause.PERSON, taken=TAKEN)
STARTS = flying(stage=Stage.STARTING, heartbeat=DISARMED, took_off=False, armed_once=False, fix=LOW, waypoint=0)
BEFORE_LAUNCH = Briefing(question=Question("take-off", "go?", ()))
SOLVING = plan_of(solve_s=None)

ROWS = [
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
            "trigger": "requested by page",
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
        {"replan": plan_of(pending=frozenset({"uav1"})), "offer": TakeoffOffer(("uav3",), (4,), 5.0)},
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
            flying(name="uav3", cause=ModeCause.PERSON, heartbeat=beat(HOLD))
            if False
            else replace(flying(cause=ModeCause.PERSON, heartbeat=beat(HOLD)), name="uav3"),
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
        [Say(Level.WARNING, "page asks: prepare; refused: that question is not pending")],
        {},
        {
            "intents": {
                "wish": noted(
                    Action.PREPARE,
                    Outcome.REFUSED,
                    "that question is not pending",
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
    state, _ = fleet_step.step(FLEET.context, flight_of(flying(), intents=many), wish(Action.HOLD), NOW_S)
    assert list(many.keys() - state.crew.intents.keys()) == [gone]
    less = {name: one for name, one in many.items() if name != "7"}
    state, _ = fleet_step.step(FLEET.context, flight_of(flying(), intents=less), wish(Action.HOLD), NOW_S)
    assert list(less.keys() - state.crew.intents.keys()) == []
