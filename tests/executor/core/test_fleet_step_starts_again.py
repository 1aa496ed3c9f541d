"""A vehicle that has not taken off is started again, or not."""

from __future__ import annotations

from dataclasses import replace

import pytest

from executor.core.interface.commands import Disarm, LandNow, Level, Say, Start
from executor.core.interface.events import StartEnded
from executor.core.state.vehicle_parts import HomingOrder, ModeCause
from executor.core.state.vehicle_state import Fault, FaultCode, FaultKind, Stage
from tests.executor.builders import with_facts
from tests.executor.core.steps import CREW, HOLD, LAND, LOW, Row, beat, over_pad
from tests.executor.core.vehicles import DISARMED, NOW_S, flying

READY = flying(
    stage=Stage.GROUND, heartbeat=DISARMED, took_off=False, armed_once=False, waypoint=0, fix=LOW, anchor=None
)
STARTS = replace(READY, stage=Stage.STARTING)
ARMED = with_facts(STARTS, heartbeat=beat(), armed_once=True)


def ended(*, accepted: bool = False, armed: bool = False) -> StartEnded:
    return StartEnded("uav1", accepted, "" if accepted else "arm: denied", armed)


ROWS = [
    Row(
        "who has disarmed again is not started again where a crew is",
        with_facts(STARTS, armed_once=True),
        ended(),
        [
            Say(
                Level.FAULT,
                (
                    "uav1: interruption, did not start: arm: denied, and it has disarmed; 2 segments assigned "
                    "to no vehicle"
                ),
            )
        ],
        {
            "uav1": {
                "stage": Stage.LANDED,
                "ordered_mode_s": NOW_S,
                "fault": Fault(
                    FaultKind.INTERRUPTION,
                    "did not start: arm: denied, and it has disarmed",
                    NOW_S,
                    FaultCode.NOT_STARTED,
                ),
                "left_s": NOW_S,
            }
        },
        {
            "urgent": True,
            "trigger": "uav1: interruption, did not start: arm: denied, and it has disarmed",
            "trigger_s": NOW_S,
        },
        {"launched_s": NOW_S - 5.0},
        context=CREW,
    ),
    Row(
        "who acknowledged that it arms and is not is not started again where a crew is",
        STARTS,
        ended(armed=True),
        [
            Say(
                Level.FAULT,
                (
                    "uav1: interruption, did not start: arm: denied, and it has disarmed; 2 segments assigned "
                    "to no vehicle"
                ),
            )
        ],
        {
            "uav1": {
                "stage": Stage.LANDED,
                "ordered_mode_s": NOW_S,
                "fault": Fault(
                    FaultKind.INTERRUPTION,
                    "did not start: arm: denied, and it has disarmed",
                    NOW_S,
                    FaultCode.NOT_STARTED,
                ),
                "left_s": NOW_S,
            }
        },
        {
            "urgent": True,
            "trigger": "uav1: interruption, did not start: arm: denied, and it has disarmed",
            "trigger_s": NOW_S,
        },
        {"launched_s": NOW_S - 5.0},
        context=CREW,
    ),
    Row(
        "who stands armed is started again where a crew is",
        ARMED,
        ended(),
        [Say(Level.WARNING, "uav1: did not start (arm: denied); trying again"), Start("uav1")],
        {"uav1": {"ordered_mode_s": NOW_S, "failures": 1}},
        {},
        {"launched_s": NOW_S - 5.0},
        context=CREW,
    ),
    Row(
        "who has disarmed again and stands there is started again for a simulation",
        with_facts(STARTS, armed_once=True),
        ended(),
        [Say(Level.WARNING, "uav1: did not start (arm: denied); trying again"), Start("uav1")],
        {"uav1": {"ordered_mode_s": NOW_S, "failures": 1}},
        {},
    ),
    Row(
        "who acknowledged that it arms and is not heard is not",
        with_facts(STARTS, heartbeat_s=NOW_S - 3.5),
        ended(armed=True),
        [
            Say(
                Level.FAULT,
                (
                    "uav1: did not start: arm: denied, and no HEARTBEAT since; last position 49.60014, "
                    "15.59947 (GPS not reported), 0 m over its home, 0 s ago; 2 segments assigned to no vehicle"
                ),
            )
        ],
        {
            "uav1": {
                "stage": Stage.LOST,
                "ordered_mode_s": NOW_S,
                "fault": Fault(
                    FaultKind.LINK,
                    "did not start: arm: denied, and no HEARTBEAT since",
                    NOW_S,
                    FaultCode.NOT_STARTED,
                ),
                "left_s": NOW_S,
            }
        },
        {
            "urgent": True,
            "trigger": "uav1: did not start: arm: denied, and no HEARTBEAT since",
            "trigger_s": NOW_S,
        },
    ),
    Row(
        "who acknowledged that it arms and is heard just so is",
        with_facts(STARTS, heartbeat_s=NOW_S - 3.4),
        ended(armed=True),
        [Say(Level.WARNING, "uav1: did not start (arm: denied); trying again"), Start("uav1")],
        {"uav1": {"ordered_mode_s": NOW_S, "failures": 1}},
        {},
    ),
    Row(
        "who armed and has said no heartbeat is not",
        with_facts(ARMED, heartbeat_s=None),
        ended(),
        [
            Say(
                Level.FAULT,
                ("uav1: interruption, did not start: arm: denied; disarm commanded; 2 segments assigned to no vehicle"),
            ),
            Disarm(vehicle="uav1", force=False),
        ],
        {
            "uav1": {
                "stage": Stage.RETURNING,
                "ordered_mode_s": NOW_S,
                "fault": Fault(FaultKind.INTERRUPTION, "did not start: arm: denied", NOW_S, FaultCode.NOT_STARTED),
                "left_s": NOW_S,
            }
        },
        {"urgent": True, "trigger": "uav1: interruption, did not start: arm: denied", "trigger_s": NOW_S},
    ),
    Row(
        "who armed and has no position is not",
        with_facts(ARMED, fix=None),
        ended(),
        [
            Say(
                Level.FAULT,
                ("uav1: interruption, did not start: arm: denied; disarm commanded; 2 segments assigned to no vehicle"),
            ),
            Disarm(vehicle="uav1", force=False),
        ],
        {
            "uav1": {
                "stage": Stage.RETURNING,
                "ordered_mode_s": NOW_S,
                "fault": Fault(FaultKind.INTERRUPTION, "did not start: arm: denied", NOW_S, FaultCode.NOT_STARTED),
                "left_s": NOW_S,
            }
        },
        {"urgent": True, "trigger": "uav1: interruption, did not start: arm: denied", "trigger_s": NOW_S},
    ),
    Row(
        "who armed and whose position is old is not",
        with_facts(ARMED, fix=over_pad(age_s=3.1)),
        ended(),
        [
            Say(
                Level.FAULT,
                ("uav1: interruption, did not start: arm: denied; disarm commanded; 2 segments assigned to no vehicle"),
            ),
            Disarm(vehicle="uav1", force=False),
        ],
        {
            "uav1": {
                "stage": Stage.RETURNING,
                "ordered_mode_s": NOW_S,
                "fault": Fault(FaultKind.INTERRUPTION, "did not start: arm: denied", NOW_S, FaultCode.NOT_STARTED),
                "left_s": NOW_S,
            }
        },
        {"urgent": True, "trigger": "uav1: interruption, did not start: arm: denied", "trigger_s": NOW_S},
    ),
    Row(
        "who armed and whose position is just fresh is",
        with_facts(ARMED, fix=over_pad(age_s=3.0)),
        ended(),
        [Say(Level.WARNING, "uav1: did not start (arm: denied); trying again"), Start("uav1")],
        {"uav1": {"ordered_mode_s": NOW_S, "failures": 1}},
        {},
    ),
    Row(
        "who has taken off is not",
        with_facts(ARMED, took_off=True, fix=over_pad(8.0)),
        ended(),
        [
            Say(
                Level.FAULT,
                (
                    "uav1: interruption, did not start: arm: denied; over its pad, landing commanded; 2 "
                    "segments assigned to no vehicle"
                ),
            ),
            LandNow("uav1"),
        ],
        {
            "uav1": {
                "stage": Stage.RETURNING,
                "ordered_mode_s": NOW_S,
                "fault": Fault(FaultKind.INTERRUPTION, "did not start: arm: denied", NOW_S, FaultCode.NOT_STARTED),
                "ordered_modes": frozenset({9}),
                "errand": HomingOrder(NOW_S, told=True),
                "left_s": NOW_S,
            }
        },
        {"urgent": True, "trigger": "uav1: interruption, did not start: arm: denied", "trigger_s": NOW_S},
    ),
    Row(
        "who lands by itself is not",
        with_facts(ARMED, heartbeat=beat(LAND)),
        ended(),
        [
            Say(
                Level.FAULT,
                ("uav1: interruption, did not start: arm: denied; disarm commanded; 2 segments assigned to no vehicle"),
            ),
            Disarm(vehicle="uav1", force=False),
        ],
        {
            "uav1": {
                "stage": Stage.RETURNING,
                "ordered_mode_s": NOW_S,
                "fault": Fault(FaultKind.INTERRUPTION, "did not start: arm: denied", NOW_S, FaultCode.NOT_STARTED),
                "left_s": NOW_S,
            }
        },
        {"urgent": True, "trigger": "uav1: interruption, did not start: arm: denied", "trigger_s": NOW_S},
    ),
    Row(
        "who is in another's hands is not",
        with_facts(ARMED, heartbeat=beat(HOLD), cause=ModeCause.PERSON),
        ended(),
        [
            Say(
                Level.FAULT,
                (
                    "uav1: interruption, did not start: arm: denied; with its pilot, not commanded; 2 segments "
                    "assigned to no vehicle"
                ),
            )
        ],
        {
            "uav1": {
                "stage": Stage.PILOT,
                "ordered_mode_s": NOW_S,
                "fault": Fault(FaultKind.INTERRUPTION, "did not start: arm: denied", NOW_S, FaultCode.NOT_STARTED),
                "left_s": NOW_S,
            }
        },
        {"urgent": True, "trigger": "uav1: interruption, did not start: arm: denied", "trigger_s": NOW_S},
    ),
    Row(
        "who is held by its failsafe is not",
        with_facts(ARMED, heartbeat=beat(HOLD), cause=ModeCause.FAILSAFE),
        ended(),
        [
            Say(
                Level.FAULT,
                ("uav1: interruption, did not start: arm: denied; disarm commanded; 2 segments assigned to no vehicle"),
            ),
            Disarm(vehicle="uav1", force=False),
        ],
        {
            "uav1": {
                "stage": Stage.RETURNING,
                "ordered_mode_s": NOW_S,
                "fault": Fault(FaultKind.INTERRUPTION, "did not start: arm: denied", NOW_S, FaultCode.NOT_STARTED),
                "left_s": NOW_S,
            }
        },
        {"urgent": True, "trigger": "uav1: interruption, did not start: arm: denied", "trigger_s": NOW_S},
    ),
]


@pytest.mark.parametrize("row", ROWS, ids=[row.what for row in ROWS])
def test_everything_that_comes_of_it(row: Row) -> None:
    assert row.shows() == row.expected()
