"""When a flight is over."""

from __future__ import annotations

import pytest

from executor.core.interface.commands import Finish, Level, Say
from executor.core.interface.events import Tick
from executor.core.state.fleet_state import TakeoffOffer
from executor.core.state.vehicle_parts import ModeCause
from executor.core.state.vehicle_state import Stage
from tests.executor.builders import with_facts
from tests.executor.core.steps import (
    CREW,
    HOLD,
    HOMEWARD,
    TAKEN,
    Row,
    beat,
    landed,
    plan_of,
)
from tests.executor.core.vehicles import NOW_S, flying, pack

DONE = {"inspected": dict.fromkeys(range(6), "uav2")}
STANDS = landed(stage=Stage.LANDED)

ROWS = [
    Row(
        "all is inspected, and everybody has landed",
        STANDS,
        Tick(),
        [Finish("all segments inspected")],
        {},
        {"finished": True},
        {"recalled": False, "finished": False, "inspected": DONE["inspected"]},
    ),
    Row(
        "something is left that was given up",
        STANDS,
        Tick(),
        [Finish("5 segments not inspected")],
        {},
        {"finished": True},
        {"recalled": False, "finished": False, "given_up": frozenset(range(6)), "inspected": {0: "uav1"}},
    ),
    Row(
        "something is left, and the flight was aborted",
        STANDS,
        Tick(),
        [Finish("6 segments not inspected")],
        {},
        {"finished": True},
        {"finished": False},
    ),
    Row(
        "something is left, and somebody is asked for it",
        STANDS,
        Tick(),
        [
            Say(
                Level.FAULT,
                (
                    "uav1 can take over 6 segments (segment 0, segment 1, segment 2, segment 3, segment 4, "
                    "segment 5). Is its pad clear of people? Use include for each that may take off"
                ),
            )
        ],
        {},
        {
            "offer": TakeoffOffer(vehicles=("uav1",), segments=(0, 1, 2, 3, 4, 5), since_s=NOW_S),
            "offer_wanted_s": NOW_S,
        },
        {"recalled": False, "finished": False, "given_up": frozenset(range(6))},
        context=CREW,
    ),
    Row(
        "something is left, and nobody can",
        with_facts(STANDS, battery=pack(10.0)),
        Tick(),
        [Finish("6 segments not inspected")],
        {},
        {"finished": True},
        {"recalled": False, "finished": False, "given_up": frozenset(range(6))},
        context=CREW,
    ),
    Row(
        "a re-plan goes on",
        STANDS,
        Tick(),
        [],
        {},
        {},
        {
            "recalled": False,
            "finished": False,
            "replan": plan_of(pending=frozenset({"uav1"})),
            "inspected": DONE["inspected"],
        },
    ),
    Row("it has not begun", STANDS, Tick(), [], {}, {}, {"launched_s": None, "finished": False}),
    Row("it is over already", STANDS, Tick(), [], {}, {}),
    Row("somebody flies", flying(), Tick(), [], {}, {}, {"finished": False}),
    Row("somebody starts", flying(stage=Stage.STARTING), Tick(), [], {}, {}, {"finished": False}),
    Row("somebody comes home", flying(**HOMEWARD), Tick(), [], {}, {}, {"finished": False}),
    Row(
        "somebody is with a pilot",
        flying(stage=Stage.PILOT, taken=TAKEN, heartbeat=beat(HOLD), cause=ModeCause.PERSON),
        Tick(),
        [],
        {},
        {},
        {"finished": False},
    ),
    Row(
        "somebody is lost",
        flying(stage=Stage.LOST),
        Tick(),
        [Finish("6 segments not inspected")],
        {},
        {"finished": True},
        {"finished": False},
    ),
]


@pytest.mark.parametrize("row", ROWS, ids=[row.what for row in ROWS])
def test_everything_that_comes_of_it(row: Row) -> None:
    assert row.shows() == row.expected()
