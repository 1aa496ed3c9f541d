"""The judgement of vehicles that returned during our absence."""

from __future__ import annotations

from dataclasses import replace

import pytest

from executor.core.interface.commands import Level, Say
from executor.core.interface.events import Tick
from executor.core.state import inspection_proof
from executor.core.state.fleet_state import GroundStationAbsence
from executor.core.state.inspection_proof import PositionSample
from executor.core.state.vehicle_parts import HomingOrder, ModeCause, PositionFix
from executor.core.state.vehicle_state import Fault, FaultCode, FaultKind, Stage
from tests.executor.builders import with_facts
from tests.executor.core.steps import (
    BATTERY_FAULT,
    HOLD,
    HOMEWARD,
    LEAVES,
    Row,
    beat,
    landed,
    over_pad,
)
from tests.executor.core.vehicles import FLEET, NOW_S, ON_PAD, RTL, flying, mission

WITH_FAILSAFE = replace(
    FLEET.context, vehicles={**FLEET.context.vehicles, "uav1": replace(FLEET.context.vehicles["uav1"], failsafe_s=5.0)}
)
RUN = inspection_proof.join_run(mission().tracks[0], PositionSample(5.0, (150.0, -5.0), 3.0), 3.0)
CAME_HOME = flying(
    heartbeat=beat(RTL), cause=ModeCause.FAILSAFE, mode_since_s=NOW_S - 10.0,
    watches=(("mode", NOW_S - 3.0),),
    run=RUN,
)  # fmt: skip
AWAY = GroundStationAbsence(NOW_S - 2.0, 20.0, restarted=False)

ROWS = [
    Row(
        "who came home as we were away is well",
        CAME_HOME,
        Tick(),
        [Say(Level.WARNING, "uav1: ended its mission while the ground station was offline; returning")],
        {
            "uav1": {
                "stage": Stage.RETURNING,
                "anchor": None,
                "run": None,
                "errand": HomingOrder(NOW_S),
                "left_s": NOW_S,
            }
        },
        {"urgent": True, "trigger": "uav1: ended its mission while the ground station was offline", "trigger_s": NOW_S},
        {"absences": (AWAY,)},
        context=WITH_FAILSAFE,
    ),
    Row(
        "who came home as we were away for less than that is not",
        CAME_HOME,
        Tick(),
        [
            Say(
                Level.FAULT,
                ("uav1: interruption, RTL by its own failsafe; returning or landing by itself, not commanded"),
            )
        ],
        {
            "uav1": LEAVES
            | {
                "run": None,
                "fault": Fault(FaultKind.INTERRUPTION, "RTL by its own failsafe", NOW_S, FaultCode.MODE_CHANGED),
                "errand": HomingOrder(NOW_S),
            }
        },
        {"urgent": True, "trigger": "uav1: interruption, RTL by its own failsafe", "trigger_s": NOW_S},
        {"absences": (replace(AWAY, pause_s=3.9),)},
        context=WITH_FAILSAFE,
    ),
    Row(
        "who came home long after we were away is not",
        CAME_HOME,
        Tick(),
        [
            Say(
                Level.FAULT,
                ("uav1: interruption, RTL by its own failsafe; returning or landing by itself, not commanded"),
            )
        ],
        {
            "uav1": LEAVES
            | {
                "run": None,
                "fault": Fault(FaultKind.INTERRUPTION, "RTL by its own failsafe", NOW_S, FaultCode.MODE_CHANGED),
                "errand": HomingOrder(NOW_S),
            }
        },
        {"urgent": True, "trigger": "uav1: interruption, RTL by its own failsafe", "trigger_s": NOW_S},
        {"absences": (replace(AWAY, until_s=NOW_S - 30.1),)},
        context=WITH_FAILSAFE,
    ),
    Row(
        "who came home before we were away is not",
        CAME_HOME,
        Tick(),
        [
            Say(
                Level.FAULT,
                ("uav1: interruption, RTL by its own failsafe; returning or landing by itself, not commanded"),
            )
        ],
        {
            "uav1": LEAVES
            | {
                "run": None,
                "fault": Fault(FaultKind.INTERRUPTION, "RTL by its own failsafe", NOW_S, FaultCode.MODE_CHANGED),
                "errand": HomingOrder(NOW_S),
            }
        },
        {"urgent": True, "trigger": "uav1: interruption, RTL by its own failsafe", "trigger_s": NOW_S},
        {"absences": (replace(AWAY, pause_s=7.9),)},
        context=WITH_FAILSAFE,
    ),
    Row(
        "who has no failsafe is not",
        CAME_HOME,
        Tick(),
        [
            Say(
                Level.FAULT,
                ("uav1: interruption, RTL by its own failsafe; returning or landing by itself, not commanded"),
            )
        ],
        {
            "uav1": LEAVES
            | {
                "run": None,
                "fault": Fault(FaultKind.INTERRUPTION, "RTL by its own failsafe", NOW_S, FaultCode.MODE_CHANGED),
                "errand": HomingOrder(NOW_S),
            }
        },
        {"urgent": True, "trigger": "uav1: interruption, RTL by its own failsafe", "trigger_s": NOW_S},
        {"absences": (AWAY,)},
    ),
    Row(
        "who was not away is not",
        CAME_HOME,
        Tick(),
        [
            Say(
                Level.FAULT,
                ("uav1: interruption, RTL by its own failsafe; returning or landing by itself, not commanded"),
            )
        ],
        {
            "uav1": LEAVES
            | {
                "run": None,
                "fault": Fault(FaultKind.INTERRUPTION, "RTL by its own failsafe", NOW_S, FaultCode.MODE_CHANGED),
                "errand": HomingOrder(NOW_S),
            }
        },
        {"urgent": True, "trigger": "uav1: interruption, RTL by its own failsafe", "trigger_s": NOW_S},
    ),
    Row(
        "who held as we were away comes home",
        with_facts(CAME_HOME, heartbeat=beat(HOLD, status=5)),
        Tick(),
        [Say(Level.WARNING, "uav1: ended its mission while the ground station was offline; returning")],
        {
            "uav1": {
                "stage": Stage.RETURNING,
                "anchor": None,
                "run": None,
                "errand": HomingOrder(NOW_S),
                "left_s": NOW_S,
            }
        },
        {"urgent": True, "trigger": "uav1: ended its mission while the ground station was offline", "trigger_s": NOW_S},
        {"absences": (AWAY,)},
        context=WITH_FAILSAFE,
    ),
    Row(
        "what a fall over the pad is, after a fault",
        landed(stage=Stage.RETURNING, fault=BATTERY_FAULT, fix=over_pad(5.1, age_s=1.0), disarmed_s=NOW_S - 1.4),
        Tick(),
        [
            Say(
                Level.FAULT,
                (f"uav1: came down outside a landing; last position {ON_PAD}, 5 m over its home, 1 s ago"),
            )
        ],
        {
            "uav1": {
                "stage": Stage.DOWN,
                "anchor": PositionFix(
                    at_s=NOW_S - 1.0,
                    boot_s=NOW_S - 1.0,
                    place_m=(-38.50000000000001, 15.400000000000002),
                    alt_rel_m=5.1,
                    alt_msl_m=455.1,
                    velocity_m_s=(0.0, 0.0, 0.0),
                ),
            }
        },
        {},
    ),
    Row(
        "what a landing on a hill over the pad is, after a fault",
        landed(stage=Stage.RETURNING, fault=BATTERY_FAULT, fix=over_pad(5.0, age_s=1.0), disarmed_s=NOW_S - 1.4),
        Tick(),
        [],
        {},
        {},
    ),
    Row(
        "who comes home with a fault that shows again and was just seen",
        flying(
            **HOMEWARD | {"heartbeat": beat(RTL, status=8)}, fault=BATTERY_FAULT, errand=HomingOrder(NOW_S, told=True)
        ),
        Tick(),
        [],
        {},
        {},
    ),
]


@pytest.mark.parametrize("row", ROWS, ids=[row.what for row in ROWS])
def test_everything_that_comes_of_it(row: Row) -> None:
    assert row.shows() == row.expected()
