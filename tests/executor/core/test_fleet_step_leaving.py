"""What a fault leads to: every order, every line, and everything that changes by it."""

from __future__ import annotations

import pytest

from executor.core.interface.commands import LandNow, Level, Say, SendHome, Solve, Survivor
from executor.core.interface.events import Tick
from executor.core.state.fleet_state import Replan
from executor.core.state.vehicle_parts import HomingOrder, ModeCause, Takeover
from executor.core.state.vehicle_state import Fault, FaultCode, FaultKind, Stage
from tests.executor.builders import with_facts
from tests.executor.core.steps import (
    FAILS,
    LEAVES,
    LOW,
    SECOND,
    SENT_HOME,
    TERMINATED,
    URGENT,
    WHY,
    Row,
    beat,
    over_pad,
)
from tests.executor.core.vehicles import NOW_S, RTL, flying, volts

ROWS = [
    Row(
        "a fault after the flight was aborted",
        FAILS,
        Tick(),
        [
            Say(Level.FAULT, "uav1: interruption, reports that its flight is terminated; RTL commanded"),
            SendHome("uav1"),
        ],
        {"uav1": SENT_HOME | {"fault": TERMINATED}},
        URGENT,
    ),
    Row(
        "a fault of the battery",
        flying(volts=volts(low_since_s=NOW_S - 10.0)),
        Tick(),
        [
            Say(
                Level.FAULT,
                ("uav1: battery, 3.75 V a cell under load; RTL commanded; 2 segments assigned to no vehicle"),
            ),
            SendHome("uav1"),
            Say(Level.WARNING, "no vehicle in the air can take over segments 0, 1, 2, 3, 4, 5"),
        ],
        {
            "uav1": SENT_HOME
            | {"fault": Fault(FaultKind.BATTERY, "3.75 V a cell under load", NOW_S, FaultCode.CELL_WEAK)}
        },
        {
            "given_up": frozenset({0, 1, 2, 3, 4, 5}),
            "orphans_since_s": NOW_S,
            "trigger": "uav1: battery, 3.75 V a cell under load",
            "trigger_s": NOW_S,
        },
        {"recalled": False},
    ),
    Row(
        "a fault that leaves nothing",
        with_facts(FAILS, waypoint=5),
        Tick(),
        [
            Say(Level.FAULT, ("uav1: interruption, reports that its flight is terminated; landing, not commanded")),
            Say(Level.WARNING, "no vehicle in the air can take over segments 0, 1"),
        ],
        {"uav1": LEAVES | {"fault": TERMINATED, "errand": HomingOrder(NOW_S)}},
        WHY | {"given_up": frozenset({0, 1, 2, 3, 4, 5}), "orphans_since_s": NOW_S},
        {"recalled": False, "given_up": frozenset(range(2, 6))},
    ),
    Row(
        "a fault that leaves one segment to others",
        with_facts(FAILS, waypoint=3),
        Tick(),
        [
            Say(
                Level.FAULT,
                (
                    "uav1: interruption, reports that its flight is terminated; RTL commanded; 1 segment to be "
                    "reassigned"
                ),
            ),
            SendHome("uav1"),
        ],
        {"uav1": SENT_HOME | {"fault": TERMINATED}},
        URGENT | {"orphans_since_s": NOW_S},
        {"recalled": False, "finished": False, "wait_until_s": NOW_S + 9.0},
        beside=(SECOND,),
    ),
    Row(
        "a fault that leaves one segment to nobody",
        with_facts(FAILS, waypoint=3),
        Tick(),
        [
            Say(
                Level.FAULT,
                (
                    "uav1: interruption, reports that its flight is terminated; RTL commanded; 1 segment assigned "
                    "to no vehicle"
                ),
            ),
            SendHome("uav1"),
        ],
        {"uav1": SENT_HOME | {"fault": TERMINATED}},
        URGENT | {"orphans_since_s": NOW_S},
        {"recalled": False, "wait_until_s": NOW_S + 9.0},
        beside=(with_facts(SECOND, excluded=True),),
    ),
    Row(
        "a fault while another reason for a re-plan stands",
        FAILS,
        Tick(),
        [
            Say(Level.FAULT, "uav1: interruption, reports that its flight is terminated; RTL commanded"),
            SendHome("uav1"),
        ],
        {"uav1": SENT_HOME | {"fault": TERMINATED}},
        {"trigger": "an older reason; uav1: interruption, reports that its flight is terminated", "trigger_s": NOW_S},
        {"urgent": True, "trigger": "an older reason"},
    ),
    Row(
        "a fault over the pad is a landing",
        with_facts(FAILS, fix=over_pad(20.0), waypoint=1),
        Tick(),
        [
            Say(
                Level.FAULT,
                ("uav1: interruption, reports that its flight is terminated; over its pad, landing commanded"),
            ),
            LandNow("uav1"),
        ],
        {
            "uav1": LEAVES
            | {"fault": TERMINATED, "ordered_modes": frozenset({9}), "errand": HomingOrder(NOW_S, told=True)}
        },
        URGENT,
    ),
    Row(
        "a fault over the pad, where it lands by itself",
        with_facts(FAILS, fix=over_pad(20.0), anchor=None, waypoint=5),
        Tick(),
        [
            Say(
                Level.FAULT,
                ("uav1: interruption, reports that its flight is terminated; landing on its pad, not commanded"),
            )
        ],
        {
            "uav1": {
                "stage": Stage.RETURNING,
                "ordered_mode_s": NOW_S,
                "fault": TERMINATED,
                "errand": HomingOrder(NOW_S),
                "left_s": NOW_S,
            }
        },
        URGENT,
    ),
    Row(
        "a fault while it comes home by itself",
        flying(heartbeat=beat(RTL, status=8), cause=ModeCause.FAILSAFE),
        Tick(),
        [
            Say(
                Level.FAULT,
                (
                    "uav1: interruption, reports that its flight is terminated; returning or landing by "
                    "itself, not commanded"
                ),
            )
        ],
        {"uav1": LEAVES | {"fault": TERMINATED, "errand": HomingOrder(NOW_S)}},
        URGENT,
    ),
    Row(
        "a fault of who starts and stands",
        with_facts(FAILS, stage=Stage.STARTING, took_off=False, armed_once=True, fix=LOW),
        Tick(),
        [],
        {},
        {},
    ),
    Row(
        "a fault of who starts and has not armed",
        with_facts(
            FAILS,
            stage=Stage.STARTING,
            took_off=False,
            armed_once=False,
            fix=LOW,
            heartbeat=beat(armed=False, status=8),
        ),
        Tick(),
        [],
        {},
        {},
    ),
    Row(
        "a fault of who is with its pilot",
        with_facts(FAILS, stage=Stage.PILOT, taken=Takeover(NOW_S - 5.0), cause=ModeCause.PERSON),
        Tick(),
        [Say(Level.FAULT, "uav1: its pilot has set mission mode again; use include to put it back in the plan")],
        {"uav1": {"taken": Takeover(since_s=NOW_S - 5.0, returned_s=NOW_S)}},
        {},
        {"recalled": False, "given_up": frozenset(range(6))},
    ),
    Row(
        "a fault with something owed and ordered",
        with_facts(
            FAILS,
            owed=(0, "why"),
            pending=4,
            run_visit=0,
            held_s=NOW_S - 5.0,
            cleared_s=NOW_S - 5.0,
            errand=HomingOrder(NOW_S),
        ),
        Tick(),
        [
            Say(Level.FAULT, "uav1: interruption, reports that its flight is terminated; RTL commanded"),
            SendHome("uav1"),
        ],
        {"uav1": SENT_HOME | {"fault": TERMINATED, "pending": None, "held_s": None, "cleared_s": None, "owed": None}},
        URGENT,
    ),
    Row(
        "a fault while others fly",
        FAILS,
        Tick(),
        [
            Say(
                Level.FAULT,
                (
                    "uav1: interruption, reports that its flight is terminated; RTL commanded; 2 segments to "
                    "be reassigned"
                ),
            ),
            SendHome("uav1"),
            Say(
                Level.INFO,
                (
                    "re-plan 1: 4 open segments (uav1: interruption, reports that its flight is "
                    "terminated); planning for uav2"
                ),
            ),
            Solve(
                revision=1,
                open_segments=(0, 1, 3, 4, 5),
                survivors=(
                    Survivor(
                        vehicle="uav2",
                        start_m=(400.0, -5.0),
                        budget_pct=72.6232,
                        consumption=0.999998,
                        airborne=True,
                        tail=(6,),
                        kept=3,
                        most_pct=73.6232,
                        start_up_m=15.0,
                        facing_m=(100.0, 0.0),
                    ),
                ),
                trigger="uav1: interruption, reports that its flight is terminated",
            ),
        ],
        {"uav1": SENT_HOME | {"fault": TERMINATED}},
        WHY
        | {
            "revision": 1,
            "orphans_since_s": NOW_S,
            "replan": Replan(
                solve=Solve(
                    revision=1,
                    open_segments=(0, 1, 3, 4, 5),
                    survivors=(
                        Survivor(
                            vehicle="uav2",
                            start_m=(400.0, -5.0),
                            budget_pct=72.6232,
                            consumption=0.999998,
                            airborne=True,
                            tail=(6,),
                            kept=3,
                            most_pct=73.6232,
                            start_up_m=15.0,
                            facing_m=(100.0, 0.0),
                        ),
                    ),
                    trigger="uav1: interruption, reports that its flight is terminated",
                ),
                begun_s=NOW_S,
            ),
            "considered": frozenset({"uav2"}),
        },
        {"recalled": False, "finished": False},
        beside=(SECOND,),
    ),
]


@pytest.mark.parametrize("row", ROWS, ids=[row.what for row in ROWS])
def test_everything_that_comes_of_it(row: Row) -> None:
    assert row.shows() == row.expected()
