"""What a vehicle's answer leads to."""

from __future__ import annotations

import math

import pytest

from executor.core.interface.commands import Level, Say, SendHome
from executor.core.interface.events import OrderEnded, ReturnEnded, Tick
from executor.core.interface.intents import Action, Outcome
from executor.core.state.vehicle_parts import HomingOrder
from executor.core.state.vehicle_state import Stage
from tests.executor.builders import with_facts
from tests.executor.core.steps import (
    HOLD,
    HOMEWARD,
    SECOND,
    STILL,
    TOLD_HOME,
    Row,
    beat,
    wished,
)
from tests.executor.core.vehicles import NOW_S, OUT_THERE, flying

HOLDS = flying(held_s=NOW_S - 9.0, heartbeat=beat(HOLD), hold_asked_s=NOW_S - 9.0)
COMES = flying(**HOMEWARD | {"heartbeat": beat()}, errand=HomingOrder(NOW_S - 9.0, told=True))
LIES = flying(stage=Stage.DOWN, fix=STILL)
SENT_ON = flying(held_s=NOW_S - 90.0, mode_since_s=NOW_S - 20.1, ordered_mode_s=NOW_S - 90.0)
HELD_LATE = flying(
    heartbeat=beat(HOLD), hold_asked_s=NOW_S - 120.0, ordered_mode_s=NOW_S - 120.0, mode_since_s=NOW_S - 0.5
)


def answer(
    action: Action, *, accepted: bool = True, reason: str = "", lost: bool = False, refused: bool = False
) -> OrderEnded:
    return OrderEnded("uav1", action, accepted, reason, lost, refused)


def returns(*, accepted: bool = True, reason: str = "", lost: bool = False, refused: bool = False) -> ReturnEnded:
    return ReturnEnded("uav1", accepted, reason, lost, refused)


ROWS = [
    Row(
        "it holds",
        HOLDS,
        answer(Action.HOLD),
        [Say(Level.INFO, "uav1: holds")],
        {},
        {"intents": {"wish": wished(Action.HOLD, ended_s=NOW_S, outcome=Outcome.DONE, text="it holds")}},
        {"intents": {"wish": wished(Action.HOLD, "uav1")}},
    ),
    Row(
        "it holds, with a remark",
        HOLDS,
        answer(Action.HOLD, reason="in BRAKE"),
        [Say(Level.WARNING, "uav1: holds; in BRAKE")],
        {},
        {"intents": {"wish": wished(Action.HOLD, ended_s=NOW_S, outcome=Outcome.DONE, text="it holds; in BRAKE")}},
        {"intents": {"wish": wished(Action.HOLD, "uav1")}},
    ),
    Row(
        "it holds, and others are asked for more",
        HOLDS,
        answer(Action.HOLD),
        [Say(Level.INFO, "uav1: holds")],
        {},
        {},
        {"intents": {"wish": wished(Action.HOLD, "uav2"), "b": wished(Action.RETURN, "uav1")}},
    ),
    Row(
        "it did not hold",
        HOLDS,
        answer(Action.HOLD, accepted=False, reason="no answer"),
        [Say(Level.WARNING, "uav1: did not follow the order: hold (no answer)")],
        {"uav1": {"ordered_mode_s": NOW_S}},
        {"intents": {"wish": wished(Action.HOLD, ended_s=NOW_S, outcome=Outcome.FAILED, text="uav1: no answer")}},
        {"intents": {"wish": wished(Action.HOLD, "uav1")}},
    ),
    Row(
        "it did not hold and was sent on since",
        flying(),
        answer(Action.HOLD, accepted=False, reason="no answer"),
        [Say(Level.WARNING, "uav1: did not follow the order: hold (no answer)")],
        {},
        {},
    ),
    Row(
        "it goes on",
        HOLDS,
        answer(Action.RESUME),
        [Say(Level.INFO, "uav1: flies on")],
        {"uav1": {"ordered_mode_s": NOW_S, "anchor": None, "held_s": None, "hold_asked_s": -math.inf}},
        {"intents": {"wish": wished(Action.RESUME, ended_s=NOW_S, outcome=Outcome.DONE, text="it flies on")}},
        {"intents": {"wish": wished(Action.RESUME, "uav1")}},
    ),
    Row("it goes on that did not hold", flying(), answer(Action.RESUME), [Say(Level.INFO, "uav1: flies on")], {}, {}),
    Row(
        "it does not go on",
        HOLDS,
        answer(Action.RESUME, accepted=False, reason="no answer"),
        [Say(Level.WARNING, "uav1: did not follow the order: resume (no answer)")],
        {},
        {"intents": {"wish": wished(Action.RESUME, ended_s=NOW_S, outcome=Outcome.FAILED, text="uav1: no answer")}},
        {"intents": {"wish": wished(Action.RESUME, "uav1")}},
    ),
    Row(
        "it lands",
        COMES,
        answer(Action.LAND),
        [Say(Level.INFO, "uav1: lands")],
        {"uav1": {"errand": None}},
        {
            "intents": {
                "wish": wished(Action.LAND, ended_s=NOW_S, outcome=Outcome.DONE, text="it lands"),
                "b": wished(Action.RETURN, ended_s=NOW_S, outcome=Outcome.DONE, text="it returns"),
                "c": wished(Action.HOLD, "uav1"),
            }
        },
        {
            "intents": {
                "wish": wished(Action.LAND, "uav1"),
                "b": wished(Action.RETURN, "uav1"),
                "c": wished(Action.HOLD, "uav1"),
            }
        },
    ),
    Row(
        "it does not land",
        COMES,
        answer(Action.LAND, accepted=False, reason="no", refused=True),
        [Say(Level.WARNING, "uav1: did not follow the order: land (no)")],
        {"uav1": {"errand": HomingOrder(NOW_S - 9.0, not_before_s=NOW_S + 5.0)}},
        {"intents": {"wish": wished(Action.LAND, ended_s=NOW_S, outcome=Outcome.FAILED, text="uav1: no")}},
        {"intents": {"wish": wished(Action.LAND, "uav1")}},
    ),
    Row(
        "its motors are off",
        LIES,
        answer(Action.DISARM),
        [Say(Level.WARNING, f"uav1: disarmed; down at {OUT_THERE}, disarmed")],
        {},
        {"intents": {"wish": wished(Action.DISARM, ended_s=NOW_S, outcome=Outcome.DONE, text="its motors are off")}},
        {"intents": {"wish": wished(Action.DISARM, "uav1")}},
    ),
    Row(
        "its motors are off before it flew",
        flying(stage=Stage.RETURNING),
        answer(Action.DISARM),
        [Say(Level.INFO, "uav1: disarmed")],
        {},
        {},
    ),
    Row(
        "its motors run on where it lies",
        LIES,
        answer(Action.DISARM, accepted=False, reason="no"),
        [Say(Level.WARNING, "uav1: did not follow the order: disarm (no)")],
        {},
        {"intents": {"wish": wished(Action.DISARM, ended_s=NOW_S, outcome=Outcome.FAILED, text="uav1: no")}},
        {"intents": {"wish": wished(Action.DISARM, "uav1")}},
    ),
    Row(
        "its motors run on where it is not any more",
        flying(stage=Stage.RETURNING),
        answer(Action.DISARM, accepted=False, reason="no"),
        [Say(Level.WARNING, "uav1: did not follow the order: disarm (no)"), SendHome("uav1")],
        {"uav1": TOLD_HOME},
        {},
    ),
    Row(
        "it returns",
        COMES,
        returns(),
        [Say(Level.INFO, "uav1: returns")],
        {"uav1": {"errand": None}},
        {"intents": {"wish": wished(Action.RETURN, ended_s=NOW_S, outcome=Outcome.DONE, text="it returns")}},
        {"intents": {"wish": wished(Action.RETURN, "uav1")}},
    ),
    Row(
        "it returns, of two",
        COMES,
        returns(),
        [Say(Level.INFO, "uav1: returns")],
        {"uav1": {"errand": None}},
        {"intents": {"wish": wished(Action.ABORT, "uav2")}},
        {"intents": {"wish": wished(Action.ABORT, "uav1", "uav2")}},
    ),
    Row(
        "it returns, after another did not",
        COMES,
        returns(),
        [Say(Level.INFO, "uav1: returns")],
        {"uav1": {"errand": None}},
        {"intents": {"wish": wished(Action.ABORT, ended_s=5.0, outcome=Outcome.FAILED)}},
        {"intents": {"wish": wished(Action.ABORT, "uav1", outcome=Outcome.FAILED, ended_s=5.0)}},
    ),
    Row(
        "it returns, out of the plan",
        COMES,
        returns(reason="late"),
        [Say(Level.INFO, "uav1: returns")],
        {"uav1": {"errand": None}},
        {
            "intents": {
                "wish": wished(
                    Action.EXCLUDE, ended_s=NOW_S, outcome=Outcome.DONE, text="it is out of the plan and returns; late"
                )
            }
        },
        {"intents": {"wish": wished(Action.EXCLUDE, "uav1")}},
    ),
    Row(
        "it refuses to return",
        COMES,
        returns(accepted=False, reason="no", refused=True),
        [Say(Level.WARNING, "uav1: refused RTL (no)")],
        {"uav1": {"errand": HomingOrder(NOW_S - 9.0, not_before_s=NOW_S + 5.0)}},
        {"intents": {"wish": wished(Action.RETURN, ended_s=NOW_S, outcome=Outcome.FAILED, text="uav1: no")}},
        {"intents": {"wish": wished(Action.RETURN, "uav1")}},
    ),
    Row(
        "its answer is lost",
        COMES,
        returns(accepted=False, reason="nothing", lost=True),
        [Say(Level.WARNING, "uav1: did not acknowledge RTL (nothing)")],
        {"uav1": {"errand": HomingOrder(NOW_S - 9.0)}},
        {"intents": {"wish": wished(Action.RETURN, ended_s=NOW_S, outcome=Outcome.FAILED, text="uav1: nothing")}},
        {"intents": {"wish": wished(Action.RETURN, "uav1")}},
    ),
    Row(
        "it acknowledged and does not return",
        COMES,
        returns(accepted=False, reason="flies on"),
        [
            Say(Level.WARNING, "uav1: did not acknowledge RTL (flies on)"),
            Say(Level.WARNING, "uav1: acknowledged the order but does not follow it; not commanded again"),
        ],
        {"uav1": {"errand": None}},
        {},
    ),
    Row(
        "it acknowledged and is not heard",
        with_facts(COMES, heartbeat_s=NOW_S - 5.0),
        returns(accepted=False, reason="flies on"),
        [Say(Level.WARNING, "uav1: did not acknowledge RTL (flies on)")],
        {"uav1": {"errand": None}},
        {},
    ),
    Row(
        "it acknowledged and was just heard",
        with_facts(COMES, heartbeat_s=NOW_S - 4.9),
        returns(accepted=False, reason="flies on"),
        [
            Say(Level.WARNING, "uav1: did not acknowledge RTL (flies on)"),
            Say(Level.WARNING, "uav1: acknowledged the order but does not follow it; not commanded again"),
        ],
        {"uav1": {"errand": None}},
        {},
    ),
    Row(
        "it acknowledged and was never heard",
        with_facts(COMES, heartbeat_s=None),
        returns(accepted=False, reason="flies on"),
        [Say(Level.WARNING, "uav1: did not acknowledge RTL (flies on)")],
        {"uav1": {"errand": None}},
        {},
    ),
    Row(
        "it answers what it was not told",
        with_facts(COMES, errand=HomingOrder(NOW_S)),
        returns(accepted=False, reason="no", refused=True),
        [Say(Level.WARNING, "uav1: refused RTL (no)")],
        {},
        {},
    ),
    Row("somebody else has sent on who held", SENT_ON, Tick(), [], {"uav1": {"anchor": None, "held_s": None}}, {}),
    Row("who held flies on since a moment", with_facts(SENT_ON, mode_since_s=NOW_S - 20.0), Tick(), [], {}, {}),
    Row("who was just told to hold flies on", with_facts(SENT_ON, ordered_mode_s=NOW_S - 20.0), Tick(), [], {}, {}),
    Row(
        "who held and is not heard may hold",
        with_facts(SENT_ON, stale=True, heard_s=NOW_S - 4.0, spoke_s=NOW_S - 4.0),
        Tick(),
        [],
        {},
        {},
        beside=(SECOND,),
    ),
    Row("who holds late holds", HELD_LATE, Tick(), [], {"uav1": {"held_s": NOW_S}}, {}),
    Row("who holds later does so by itself", with_facts(HELD_LATE, hold_asked_s=NOW_S - 120.1), Tick(), [], {}, {}),
    Row("who was told to hold and flies does not hold", with_facts(HELD_LATE, heartbeat=beat()), Tick(), [], {}, {}),
]


@pytest.mark.parametrize("row", ROWS, ids=[row.what for row in ROWS])
def test_everything_that_comes_of_it(row: Row) -> None:
    assert row.shows() == row.expected()
