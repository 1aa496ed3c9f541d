"""What becomes of a wish without an answer."""

from __future__ import annotations

from dataclasses import replace

import pytest

from executor.core.interface.events import Tick
from executor.core.interface.intents import Action, IntentReason, Outcome
from executor.core.state.fleet_state import ReplanRecord
from executor.core.state.vehicle_parts import HomingOrder
from executor.core.state.vehicle_state import Stage
from tests.executor.builders import with_facts
from tests.executor.core.steps import (
    BATTERY_FAULT,
    HOLD,
    HOMEWARD,
    SECOND,
    Row,
    beat,
    plan_of,
    wished,
)
from tests.executor.core.vehicles import NOW_S, flying

HELD_LATE = flying(
    heartbeat=beat(HOLD), hold_asked_s=NOW_S - 120.0, ordered_mode_s=NOW_S - 120.0, mode_since_s=NOW_S - 0.5
)
REPLANNED = ReplanRecord(4, "why", True, (), 0.5, NOW_S - 9.0, NOW_S - 5.0, 1.0)

ROWS = [
    Row(
        "who holds late on its way home only comes home",
        with_facts(HELD_LATE, stage=Stage.RETURNING, left_s=NOW_S, errand=HomingOrder(NOW_S, told=True)),
        Tick(),
        [],
        {},
        {},
    ),
    Row(
        "a wish is not answered",
        flying(),
        Tick(),
        [],
        {},
        {
            "intents": {
                "wish": wished(
                    Action.RETURN,
                    at_s=NOW_S - 90.1,
                    ended_s=NOW_S,
                    outcome=Outcome.FAILED,
                    text="uav1 did not answer",
                    code=IntentReason.UNANSWERED,
                )
            }
        },
        {"intents": {"wish": wished(Action.RETURN, "uav1", at_s=NOW_S - 90.1)}},
    ),
    Row(
        "a wish may be answered still",
        flying(),
        Tick(),
        [],
        {},
        {},
        {"intents": {"wish": wished(Action.RETURN, "uav1", at_s=NOW_S - 90.0)}},
    ),
    Row(
        "a wish of who is lost",
        flying(),
        Tick(),
        [],
        {},
        {
            "intents": {
                "wish": wished(
                    Action.RETURN,
                    ended_s=NOW_S,
                    outcome=Outcome.FAILED,
                    text="link to uav2 lost",
                    code=IntentReason.LINK_LOST,
                )
            }
        },
        {"intents": {"wish": wished(Action.RETURN, "uav1", "uav2")}},
        beside=(replace(SECOND, stage=Stage.LOST),),
    ),
    Row(
        "a hold of who does not fly its mission any more",
        flying(**HOMEWARD, fault=BATTERY_FAULT),
        Tick(),
        [],
        {},
        {
            "intents": {
                "wish": wished(
                    Action.HOLD,
                    ended_s=NOW_S,
                    outcome=Outcome.FAILED,
                    text="superseded: uav1 is returning: why",
                    code=IntentReason.OVERTAKEN,
                )
            }
        },
        {"intents": {"wish": wished(Action.HOLD, "uav1")}},
    ),
    Row(
        "a resumption of who does not fly its mission any more",
        flying(**HOMEWARD),
        Tick(),
        [],
        {},
        {
            "intents": {
                "wish": wished(
                    Action.RESUME,
                    ended_s=NOW_S,
                    outcome=Outcome.FAILED,
                    text="superseded: uav1 is returning",
                    code=IntentReason.OVERTAKEN,
                )
            }
        },
        {"intents": {"wish": wished(Action.RESUME, "uav1")}},
    ),
    Row(
        "a return of who returns is waited for",
        flying(**HOMEWARD),
        Tick(),
        [],
        {},
        {},
        {"intents": {"wish": wished(Action.RETURN, "uav1")}},
    ),
    Row(
        "a wish that has ended is not looked at",
        flying(**HOMEWARD),
        Tick(),
        [],
        {},
        {},
        {"intents": {"wish": wished(Action.HOLD, "uav1", outcome=Outcome.FAILED)}},
    ),
    Row(
        "a re-plan is on board",
        flying(),
        Tick(),
        [],
        {},
        {
            "orphans_since_s": NOW_S,
            "intents": {
                "wish": wished(Action.REPLAN, ended_s=NOW_S, outcome=Outcome.DONE, text="re-plan 4 is on board")
            },
        },
        {"intents": {"wish": wished(Action.REPLAN)}, "records": (REPLANNED,), "recalled": False},
    ),
    Row(
        "a re-plan is on board that leaves some over",
        flying(),
        Tick(),
        [],
        {},
        {
            "intents": {
                "wish": wished(
                    Action.REPLAN,
                    ended_s=NOW_S,
                    outcome=Outcome.DONE,
                    text="re-plan 4 is on board, 2 segments are left over",
                )
            }
        },
        {"intents": {"wish": wished(Action.REPLAN)}, "records": (replace(REPLANNED, uncovered=(1, 2)),)},
    ),
    Row(
        "a re-plan from before the wish",
        flying(),
        Tick(),
        [],
        {},
        {
            "intents": {
                "wish": wished(
                    Action.REPLAN,
                    ended_s=NOW_S,
                    outcome=Outcome.FAILED,
                    text="the flight was aborted",
                    code=IntentReason.ABORTED,
                )
            }
        },
        {"intents": {"wish": wished(Action.REPLAN)}, "records": (replace(REPLANNED, ended_s=NOW_S - 10.0),)},
    ),
    Row(
        "a re-plan while another goes on",
        flying(),
        Tick(),
        [],
        {},
        {},
        {"intents": {"wish": wished(Action.REPLAN)}, "records": (REPLANNED,), "replan": plan_of(), "recalled": False},
    ),
    Row(
        "a re-plan that is about to begin",
        flying(),
        Tick(),
        [],
        {},
        {"orphans_since_s": NOW_S},
        {"intents": {"wish": wished(Action.REPLAN)}, "recalled": False, "urgent": True, "wait_until_s": NOW_S + 1.0},
    ),
    Row(
        "a re-plan that was asked for is about to begin",
        flying(),
        Tick(),
        [],
        {},
        {"orphans_since_s": NOW_S},
        {"intents": {"wish": wished(Action.REPLAN)}, "recalled": False, "ordered": True, "wait_until_s": NOW_S + 1.0},
    ),
    Row(
        "a re-plan that nobody needs",
        flying(),
        Tick(),
        [],
        {},
        {
            "intents": {
                "wish": wished(
                    Action.REPLAN,
                    ended_s=NOW_S,
                    outcome=Outcome.FAILED,
                    text="nothing to plan, or no vehicle available",
                    code=IntentReason.NOTHING_TO_PLAN,
                )
            }
        },
        {"intents": {"wish": wished(Action.REPLAN)}, "recalled": False, "given_up": frozenset(range(6))},
    ),
]


@pytest.mark.parametrize("row", ROWS, ids=[row.what for row in ROWS])
def test_everything_that_comes_of_it(row: Row) -> None:
    assert row.shows() == row.expected()
