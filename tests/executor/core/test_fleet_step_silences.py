"""A flight without any link, and regained vehicles."""

from __future__ import annotations

import math
from dataclasses import replace

import pytest

from executor.core.interface.commands import AskStreams, Level, Say
from executor.core.interface.events import Tick
from executor.core.state import inspection_proof
from executor.core.state.fleet_state import GroundStationAbsence
from executor.core.state.inspection_proof import InspectionRun, PositionSample, _RunStatistics
from executor.core.state.vehicle_parts import HomingOrder, LastKnown, ModeCause
from executor.core.state.vehicle_state import Fault, FaultCode, FaultKind, Stage
from tests.executor.builders import with_facts
from tests.executor.core.steps import (
    LEAVES,
    LOW,
    SECOND,
    STILL,
    Row,
    beat,
)
from tests.executor.core.vehicles import DISARMED, NOW_S, OUT_THERE, RTL, at, flying, mission

RUN = inspection_proof.join_run(mission().tracks[0], PositionSample(5.0, (150.0, -5.0), 3.0), 3.0)
CAME_HOME = flying(
    heartbeat=beat(RTL), cause=ModeCause.FAILSAFE, mode_since_s=NOW_S - 10.0,
    watches=(("mode", NOW_S - 3.0),),
    run=RUN,
)  # fmt: skip
ALONE = flying(
    heard_s=NOW_S - 10.0, spoke_s=NOW_S - 10.0, heartbeat_s=NOW_S - 10.0, run=CAME_HOME.assignment.run, run_visit=0
)
WAS = LastKnown(at(age_s=70.0), 1, None, None, 95.0, NOW_S - 70.0)
BACK = flying(before=WAS, regained_s=NOW_S - 1.0, spoke_s=NOW_S, mode_since_s=NOW_S - 90.0)

ROWS = [
    Row(
        "nobody is heard",
        ALONE,
        Tick(),
        [
            Say(Level.WARNING, "no link to any vehicle: suspecting the ground radio; re-planning suspended"),
            Say(Level.WARNING, "uav1: no message for 10.0 s"),
        ],
        {
            "uav1": {
                "run": None,
                "stale": True,
                "before": LastKnown(
                    fix=replace(STILL, alt_rel_m=20.0, alt_msl_m=470.0, velocity_m_s=(3.0, 0.0, 0.0)),
                    waypoint=2,
                    run=InspectionRun(
                        furthest_m=50.0,
                        recent=((5.0, 50.0),),
                        pace=_RunStatistics(began_s=-11.6667, began_m=0.0, fastest_m_s=3.0, samples=1),
                    ),
                    run_visit=0,
                    remaining_pct=90.0,
                    until_s=NOW_S - 10.0,
                    factor=0.999998,
                ),
            }
        },
        {"silent_since_s": NOW_S - 10.0},
    ),
    Row(
        "nobody is heard for long enough to break an inspection",
        ALONE,
        Tick(),
        [Say(Level.WARNING, "uav1: no message for 10.0 s")],
        {
            "uav1": {
                "run": None,
                "stale": True,
                "before": LastKnown(
                    fix=replace(STILL, alt_rel_m=20.0, alt_msl_m=470.0, velocity_m_s=(3.0, 0.0, 0.0)),
                    waypoint=2,
                    run=InspectionRun(
                        furthest_m=50.0,
                        recent=((5.0, 50.0),),
                        pace=_RunStatistics(began_s=-11.6667, began_m=0.0, fastest_m_s=3.0, samples=1),
                    ),
                    run_visit=0,
                    remaining_pct=90.0,
                    until_s=NOW_S - 10.0,
                    factor=0.999998,
                ),
            }
        },
        {},
        {"silent_since_s": NOW_S - 10.0},
    ),
    Row(
        "nobody is heard for a minute",
        with_facts(ALONE, heard_s=NOW_S - 60.0, spoke_s=NOW_S - 60.0),
        Tick(),
        [
            Say(
                Level.FAULT,
                (
                    "no message from any vehicle for 60 s; in the air at last contact: uav1. The flight stays "
                    "open and resumes with the first link regained"
                ),
            ),
            Say(Level.WARNING, "uav1: no message for 60.0 s"),
        ],
        {
            "uav1": {
                "run": None,
                "stale": True,
                "before": LastKnown(
                    fix=replace(STILL, alt_rel_m=20.0, alt_msl_m=470.0, velocity_m_s=(3.0, 0.0, 0.0)),
                    waypoint=2,
                    run=InspectionRun(
                        furthest_m=50.0,
                        recent=((5.0, 50.0),),
                        pace=_RunStatistics(began_s=-11.6667, began_m=0.0, fastest_m_s=3.0, samples=1),
                    ),
                    run_visit=0,
                    remaining_pct=90.0,
                    until_s=NOW_S - 60.0,
                    factor=0.999998,
                ),
            }
        },
        {"silence_told_s": NOW_S},
        {"silent_since_s": NOW_S - 60.0},
    ),
    Row(
        "nobody was heard, and nobody can fly any more",
        with_facts(ALONE, heard_s=NOW_S - 9000.0, spoke_s=NOW_S - 9000.0),
        Tick(),
        [
            Say(Level.WARNING, "uav1: no message for 9000.0 s"),
            Say(
                Level.FAULT,
                (
                    "uav1: link lost for 9000.0 s, time-out 10 s; "
                    f"last position {OUT_THERE}, 20 m over its home, 0 s ago"
                ),
            ),
        ],
        {
            "uav1": {
                "stage": Stage.LOST,
                "ordered_mode_s": NOW_S,
                "anchor": None,
                "run": None,
                "stale": True,
                "fault": Fault(FaultKind.LINK, "link lost for 9000.0 s, time-out 10 s", NOW_S, FaultCode.LINK_LOST),
                "before": LastKnown(
                    fix=replace(STILL, alt_rel_m=20.0, alt_msl_m=470.0, velocity_m_s=(3.0, 0.0, 0.0)),
                    waypoint=2,
                    run=InspectionRun(
                        furthest_m=50.0,
                        recent=((5.0, 50.0),),
                        pace=_RunStatistics(began_s=-11.6667, began_m=0.0, fastest_m_s=3.0, samples=1),
                    ),
                    run_visit=0,
                    remaining_pct=90.0,
                    until_s=-8000.0,
                    factor=0.999998,
                ),
                "left_s": NOW_S,
            }
        },
        {"urgent": True, "trigger": "uav1: link lost for 9000.0 s, time-out 10 s", "trigger_s": NOW_S},
        {"silent_since_s": NOW_S - 9000.0, "silence_told_s": NOW_S - 10.0},
    ),
    Row(
        "somebody link regained",
        with_facts(ALONE, heard_s=NOW_S, spoke_s=NOW_S),
        Tick(),
        [Say(Level.INFO, "links regained")],
        {"uav1": {"excused_s": NOW_S}, "uav2": {"heard_s": NOW_S, "excused_s": NOW_S}},
        {
            "silent_since_s": None,
            "silence_told_s": None,
            "absences": (GroundStationAbsence(until_s=NOW_S, pause_s=60.0, restarted=False, deaf=True),),
        },
        {"silent_since_s": NOW_S - 60.0, "silence_told_s": NOW_S - 5.0},
        beside=(with_facts(SECOND, heard_s=NOW_S - 60.0),),
    ),
    Row(
        "who is heard again has not said where it is",
        with_facts(BACK, fix=at(age_s=70.0)),
        Tick(),
        [Say(Level.WARNING, "uav1: no position for 70 s, while other messages come"), AskStreams("uav1")],
        {"uav1": {"streams_asked_s": NOW_S}},
        {"told": {"uav1": (("positions", NOW_S),)}},
    ),
    Row(
        "who is heard again has not said where it is for five seconds",
        with_facts(BACK, fix=at(age_s=70.0), regained_s=NOW_S - 5.0),
        Tick(),
        [
            Say(Level.WARNING, "uav1: no position for 70 s, while other messages come"),
            AskStreams("uav1"),
            Say(Level.FAULT, "uav1: interruption, no position for 70 s, while other messages come"),
        ],
        {
            "uav1": LEAVES
            | {
                "fault": Fault(
                    FaultKind.INTERRUPTION,
                    "no position for 70 s, while other messages come",
                    NOW_S,
                    FaultCode.POSITION_LOST,
                ),
                "streams_asked_s": NOW_S,
                "before": None,
                "errand": HomingOrder(NOW_S),
            }
        },
        {
            "urgent": True,
            "trigger": "uav1: interruption, no position for 70 s, while other messages come",
            "trigger_s": NOW_S,
            "told": {"uav1": (("positions", NOW_S),)},
        },
    ),
    Row(
        "who is heard again has not said its mode",
        with_facts(BACK, heartbeat_s=NOW_S - 71.0),
        Tick(),
        [Say(Level.WARNING, "uav1: no HEARTBEAT for 71 s, while other messages come"), AskStreams("uav1")],
        {"uav1": {"streams_asked_s": NOW_S}},
        {"told": {"uav1": (("heartbeat", NOW_S),)}},
    ),
    Row(
        "who is heard again has not said its item",
        with_facts(BACK, item_s=NOW_S - 71.0),
        Tick(),
        [
            Say(Level.WARNING, "uav1: no report of its current waypoint for 71 s, while other messages come"),
            AskStreams("uav1"),
        ],
        {"uav1": {"streams_asked_s": NOW_S}},
        {"told": {"uav1": (("items", NOW_S),)}},
    ),
    Row(
        "who is heard again and stands has no item to say",
        with_facts(BACK, item_s=None, heartbeat=DISARMED, fix=LOW),
        Tick(),
        [
            Say(Level.WARNING, "uav1: flight during the outage is not counted: 70 s is too short for its leg of 179 s"),
            Say(
                Level.FAULT,
                (
                    "uav1: interruption, disarmed over its pad in mid-mission; last position 49.60014, "
                    "15.59947 (GPS not reported), 0 m over its home, 0 s ago"
                ),
            ),
        ],
        {
            "uav1": {
                "stage": Stage.DOWN,
                "ordered_mode_s": NOW_S,
                "anchor": None,
                "fault": Fault(
                    FaultKind.INTERRUPTION, "disarmed over its pad in mid-mission", NOW_S, FaultCode.DISARMED
                ),
                "before": None,
                "left_s": NOW_S,
            }
        },
        {"urgent": True, "trigger": "uav1: interruption, disarmed over its pad in mid-mission", "trigger_s": NOW_S},
    ),
    Row(
        "who is heard again is not heard yet",
        with_facts(BACK, before=replace(WAS, until_s=NOW_S)),
        Tick(),
        [],
        {},
        {},
    ),
    Row(
        "who is heard again was asked already",
        with_facts(BACK, before=replace(WAS, until_s=-math.inf)),
        Tick(),
        [],
        {"uav1": {"before": None}},
        {},
    ),
    Row("who is heard again has no position", with_facts(BACK, fix=None), Tick(), [], {"uav1": {"before": None}}, {}),
    Row(
        "who is heard again is at fault before it is taken up",
        with_facts(BACK, heard_s=NOW_S - 10.0, spoke_s=NOW_S - 10.0, stale=True, item_s=NOW_S - 71.0),
        Tick(),
        [
            Say(
                Level.FAULT,
                (f"uav1: link lost for 10.0 s, time-out 10 s; last position {OUT_THERE}, 20 m over its home, 0 s ago"),
            )
        ],
        {
            "uav1": {
                "stage": Stage.LOST,
                "ordered_mode_s": NOW_S,
                "anchor": None,
                "fault": Fault(FaultKind.LINK, "link lost for 10.0 s, time-out 10 s", NOW_S, FaultCode.LINK_LOST),
                "left_s": NOW_S,
            }
        },
        {"urgent": True, "trigger": "uav1: link lost for 10.0 s, time-out 10 s", "trigger_s": NOW_S},
        beside=(SECOND,),
    ),
    Row(
        "who is heard again is where it can be",
        with_facts(
            BACK,
            before=replace(
                WAS,
                fix=replace(at(age_s=40.0), place_m=(150.0, -5.0)),
                waypoint=2,
                run=CAME_HOME.assignment.run,
                run_visit=0,
            ),
            waypoint=3,
            fix=replace(at(), place_m=(250.0, -5.0)),
        ),
        Tick(),
        [Say(Level.INFO, "uav1: flew segment 0 during the outage, inferred from its clock and position")],
        {
            "uav1": {
                "run": InspectionRun(
                    furthest_m=50.0,
                    recent=((NOW_S, 50.0),),
                    pace=_RunStatistics(began_s=NOW_S - 16.667, began_m=0.0, fastest_m_s=3.0, samples=1),
                ),
                "run_visit": 1,
                "before": None,
            }
        },
        {"inspected": {0: "uav1"}, "inferred": frozenset({0, 1})},
    ),
    Row(
        "who is heard again is where it cannot be",
        with_facts(
            BACK,
            before=replace(
                WAS,
                fix=replace(at(age_s=60.0), place_m=(150.0, -5.0)),
                waypoint=2,
                run=CAME_HOME.assignment.run,
                run_visit=0,
            ),
            waypoint=3,
            fix=replace(at(), place_m=(250.0, -5.0)),
        ),
        Tick(),
        [Say(Level.WARNING, "uav1: flight during the outage is not counted: it took 60 s, expected 38 s")],
        {"uav1": {"before": None, "runs_broken": ((0, "no position for 60.0 s"),)}},
        {},
    ),
]


@pytest.mark.parametrize("row", ROWS, ids=[row.what for row in ROWS])
def test_everything_that_comes_of_it(row: Row) -> None:
    assert row.shows() == row.expected()
