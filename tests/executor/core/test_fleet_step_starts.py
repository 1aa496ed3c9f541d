"""The launch, and what became of each start."""

from __future__ import annotations

from dataclasses import replace

import pytest

from executor.core.interface.codes import Ending
from executor.core.interface.commands import Level, Say, Start
from executor.core.interface.events import Asked, LaunchOrdered, LossJudged, StartEnded
from executor.core.interface.messages import Heartbeat
from executor.core.state import inspection_proof
from executor.core.state.fleet_state import Briefing, LossOutlook, Question
from executor.core.state.inspection_proof import PositionSample
from executor.core.state.mission_ownership import MissionOwnership
from executor.core.state.vehicle_parts import FlownSortie, HomingOrder
from executor.core.state.vehicle_state import Fault, FaultCode, FaultKind, Stage
from tests.executor.builders import fleet_of, with_facts
from tests.executor.core.steps import CREW, LOW, Changes, Row, beat
from tests.executor.core.vehicles import DISARMED, NOW_S, flying, mission

READY = flying(
    stage=Stage.GROUND, heartbeat=DISARMED, took_off=False, armed_once=False, waypoint=0, fix=LOW, anchor=None
)
STARTS = replace(READY, stage=Stage.STARTING)
ARMED = with_facts(STARTS, heartbeat=beat(), armed_once=True)
RUN = inspection_proof.join_run(mission().tracks[0], PositionSample(5.0, (150.0, -5.0), 3.0), 3.0)
USED: Changes = {
    "run": RUN, "took_off": True, "anchor": LOW, "errand": HomingOrder(NOW_S), "owed": (0, "why"),
    "rebooted_s": 1.0, "away_once": True, "armed_once": True, "waypoint": 5, "carried": MissionOwnership(id=7),
}  # fmt: skip
BARE = with_facts(READY, name="uav2", board=None)
PX4 = fleet_of(autopilot="px4")


def ended(*, accepted: bool = False, armed: bool = False) -> StartEnded:
    return StartEnded("uav1", accepted, "" if accepted else "arm: denied", armed)


LEFT = Say(Level.INFO, "planned for the next flight: segments 2, 3, 4, 5")
ROWS = [
    Row(
        "a launch",
        with_facts(READY, **USED | {"rebooted_s": None}),
        LaunchOrdered(),
        [Start("uav1"), Start("uav2"), Start("uav3")],
        {
            "uav1": {
                "stage": Stage.STARTING,
                "ordered_mode_s": NOW_S,
                "armed_once": False,
                "anchor": None,
                "waypoint": 0,
                "run": None,
                "took_off": False,
                "excused_s": NOW_S,
                "began_pct": 90.0,
                "sorties": (FlownSortie(1, "", NOW_S, 90.0, None),),
                "ordered_modes": frozenset({3, 4}),
                "errand": None,
                "away_once": False,
                "carried": MissionOwnership(ours_s=NOW_S),
                "owed": None,
            },
            "uav2": {
                "stage": Stage.STARTING,
                "ordered_mode_s": NOW_S,
                "ordered_modes": frozenset({3, 4}),
                "carried": MissionOwnership(ours_s=NOW_S),
                "sorties": (FlownSortie(1, "", NOW_S, None, None),),
            },
            "uav3": {
                "stage": Stage.STARTING,
                "ordered_mode_s": NOW_S,
                "ordered_modes": frozenset({3, 4}),
                "carried": MissionOwnership(ours_s=NOW_S),
                "sorties": (FlownSortie(1, "", NOW_S, None, None),),
            },
        },
        {"launched_s": NOW_S},
        {"launched_s": None},
    ),
    Row(
        "a launch of an autopilot without a guided start",
        with_facts(READY, heartbeat=Heartbeat(12, 0, False, 3)),
        LaunchOrdered(),
        [Start("uav1"), Start("uav2"), Start("uav3")],
        {
            "uav1": {
                "stage": Stage.STARTING,
                "ordered_mode_s": NOW_S,
                "excused_s": NOW_S,
                "began_pct": 90.0,
                "sorties": (FlownSortie(1, "", NOW_S, 90.0, None),),
                "ordered_modes": frozenset({67371008}),
                "carried": MissionOwnership(ours_s=NOW_S),
            },
            "uav2": {
                "stage": Stage.STARTING,
                "ordered_mode_s": NOW_S,
                "ordered_modes": frozenset({67371008}),
                "carried": MissionOwnership(ours_s=NOW_S),
                "sorties": (FlownSortie(1, "", NOW_S, None, None),),
            },
            "uav3": {
                "stage": Stage.STARTING,
                "ordered_mode_s": NOW_S,
                "ordered_modes": frozenset({67371008}),
                "carried": MissionOwnership(ours_s=NOW_S),
                "sorties": (FlownSortie(1, "", NOW_S, None, None),),
            },
        },
        {"launched_s": NOW_S},
        {"launched_s": None},
        context=PX4.context,
    ),
    Row(
        "a launch without one whose autopilot has rebooted since its checks",
        with_facts(READY, rebooted_s=NOW_S - 30.0),
        LaunchOrdered(),
        [
            Say(
                Level.WARNING,
                "uav1: not started: its autopilot has rebooted since its checks; `swap` when fixed",
            ),
            Start("uav2"),
            Start("uav3"),
        ],
        {
            "uav1": {"excused_s": NOW_S},
            "uav2": {
                "stage": Stage.STARTING,
                "ordered_mode_s": NOW_S,
                "ordered_modes": frozenset({3, 4}),
                "carried": MissionOwnership(ours_s=NOW_S),
                "sorties": (FlownSortie(1, "", NOW_S, None, None),),
            },
            "uav3": {
                "stage": Stage.STARTING,
                "ordered_mode_s": NOW_S,
                "ordered_modes": frozenset({3, 4}),
                "carried": MissionOwnership(ours_s=NOW_S),
                "sorties": (FlownSortie(1, "", NOW_S, None, None),),
            },
        },
        {"given_up": frozenset({0, 1}), "launched_s": NOW_S},
        {"launched_s": None},
    ),
    Row(
        "a launch without one that has no mission",
        READY,
        LaunchOrdered(),
        [Start("uav1"), Start("uav3"), Say(Level.INFO, "planned for the next flight: segments 2, 3")],
        {
            "uav1": {
                "stage": Stage.STARTING,
                "ordered_mode_s": NOW_S,
                "excused_s": NOW_S,
                "began_pct": 90.0,
                "sorties": (FlownSortie(1, "", NOW_S, 90.0, None),),
                "ordered_modes": frozenset({3, 4}),
                "carried": MissionOwnership(ours_s=NOW_S),
            },
            "uav2": {"excused_s": NOW_S},
            "uav3": {
                "stage": Stage.STARTING,
                "ordered_mode_s": NOW_S,
                "ordered_modes": frozenset({3, 4}),
                "carried": MissionOwnership(ours_s=NOW_S),
                "sorties": (FlownSortie(1, "", NOW_S, None, None),),
            },
        },
        {"left_over": frozenset({2, 3}), "launched_s": NOW_S},
        {"launched_s": None},
        beside=(BARE,),
    ),
    Row(
        "a launch of who was heard lately",
        with_facts(READY, heard_s=NOW_S - 14.9),
        LaunchOrdered(),
        [Start("uav1"), LEFT],
        {
            "uav1": {
                "stage": Stage.STARTING,
                "heard_s": NOW_S,
                "ordered_mode_s": NOW_S,
                "excused_s": NOW_S,
                "began_pct": 90.0,
                "sorties": (FlownSortie(1, "", NOW_S, 90.0, None),),
                "ordered_modes": frozenset({3, 4}),
                "carried": MissionOwnership(ours_s=NOW_S),
            },
            "uav2": {"excused_s": NOW_S},
            "uav3": {"excused_s": NOW_S},
        },
        {"left_over": frozenset({2, 3, 4, 5}), "launched_s": NOW_S},
        beside=(BARE, replace(BARE, name="uav3")),
    ),
    Row(
        "a launch of who was not heard lately",
        with_facts(READY, heard_s=NOW_S - 15.0),
        LaunchOrdered(),
        [Start("uav1"), LEFT],
        {
            "uav1": {
                "stage": Stage.STARTING,
                "ordered_mode_s": NOW_S,
                "began_pct": 90.0,
                "sorties": (FlownSortie(1, "", NOW_S, 90.0, None),),
                "ordered_modes": frozenset({3, 4}),
                "carried": MissionOwnership(ours_s=NOW_S),
            },
            "uav3": {"excused_s": NOW_S},
        },
        {"left_over": frozenset({2, 3, 4, 5}), "launched_s": NOW_S},
        beside=(with_facts(BARE, heard_s=None), replace(BARE, name="uav3")),
    ),
    Row(
        "a launch of who is armed already",
        with_facts(READY, heartbeat=beat()),
        LaunchOrdered(),
        [LEFT],
        {"uav1": {"excused_s": NOW_S}, "uav2": {"excused_s": NOW_S}, "uav3": {"excused_s": NOW_S}},
        {"given_up": frozenset({0, 1}), "left_over": frozenset({2, 3, 4, 5}), "launched_s": NOW_S},
        beside=(BARE, replace(BARE, name="uav3")),
    ),
    Row(
        "a launch answers its question",
        READY,
        LaunchOrdered(),
        [Start("uav1"), LEFT],
        {
            "uav1": {
                "stage": Stage.STARTING,
                "ordered_mode_s": NOW_S,
                "excused_s": NOW_S,
                "began_pct": 90.0,
                "sorties": (FlownSortie(1, "", NOW_S, 90.0, None),),
                "ordered_modes": frozenset({3, 4}),
                "carried": MissionOwnership(ours_s=NOW_S),
            },
            "uav2": {"excused_s": NOW_S},
            "uav3": {"excused_s": NOW_S},
        },
        {"left_over": frozenset({2, 3, 4, 5}), "launched_s": NOW_S, "briefing": Briefing()},
        {"given_up": frozenset({5}), "briefing": Briefing(question=Question("take-off", "go?", ()))},
        beside=(BARE, replace(BARE, name="uav3")),
    ),
    Row(
        "a start that is followed",
        with_facts(ARMED, failures=2, cleared_s=NOW_S - 9.0, anchor=LOW),
        ended(accepted=True),
        [Say(Level.INFO, "uav1: flies its mission")],
        {"uav1": {"stage": Stage.FLYING, "ordered_mode_s": NOW_S, "anchor": None, "failures": 0, "cleared_s": None}},
        {},
    ),
    Row(
        "a start that is followed after it was given up",
        replace(ARMED, stage=Stage.RETURNING),
        ended(accepted=True),
        [],
        {},
        {},
    ),
    Row("a start that fails after it was given up", replace(ARMED, stage=Stage.RETURNING), ended(), [], {}, {}),
    Row(
        "a start that fails is tried again",
        STARTS,
        ended(),
        [Say(Level.WARNING, "uav1: did not start (arm: denied); trying again"), Start("uav1")],
        {"uav1": {"ordered_mode_s": NOW_S, "failures": 1}},
        {},
    ),
    Row(
        "a second start that fails is tried again",
        with_facts(STARTS, failures=1),
        ended(),
        [Say(Level.WARNING, "uav1: did not start (arm: denied); trying again"), Start("uav1")],
        {"uav1": {"ordered_mode_s": NOW_S, "failures": 2}},
        {},
    ),
    Row(
        "a third start that fails is the last",
        with_facts(STARTS, failures=2),
        ended(),
        [Say(Level.FAULT, "uav1: interruption, did not start: arm: denied; 2 segments assigned to no vehicle")],
        {
            "uav1": {
                "stage": Stage.LANDED,
                "ordered_mode_s": NOW_S,
                "fault": Fault(FaultKind.INTERRUPTION, "did not start: arm: denied", NOW_S, FaultCode.NOT_STARTED),
                "left_s": NOW_S,
            }
        },
        {"urgent": True, "trigger": "uav1: interruption, did not start: arm: denied", "trigger_s": NOW_S},
    ),
    *(
        Row(
            f"{what} is not tried again",
            STARTS,
            replace(ended(), code=code),
            [Say(Level.FAULT, "uav1: interruption, did not start: arm: denied; 2 segments assigned to no vehicle")],
            {
                "uav1": {
                    "stage": Stage.LANDED,
                    "ordered_mode_s": NOW_S,
                    "fault": Fault(FaultKind.INTERRUPTION, "did not start: arm: denied", NOW_S, FaultCode.NOT_STARTED),
                    "left_s": NOW_S,
                }
            },
            {"urgent": True, "trigger": "uav1: interruption, did not start: arm: denied", "trigger_s": NOW_S},
        )
        for what, code in (
            ("a start that somebody else broke off", Ending.MODE_CHANGED),
            ("a start during which this computer stood still", Ending.STOOD_STILL),
        )
    ),
    Row(
        "a crew's yes is fresh enough for another try",
        STARTS,
        ended(),
        [Say(Level.WARNING, "uav1: did not start (arm: denied); trying again"), Start("uav1")],
        {"uav1": {"ordered_mode_s": NOW_S, "failures": 1}},
        {},
        {"launched_s": NOW_S - 44.9},
        context=CREW,
    ),
    Row(
        "a crew's yes is too old for another try",
        STARTS,
        ended(),
        [Say(Level.FAULT, "uav1: interruption, did not start: arm: denied; 2 segments assigned to no vehicle")],
        {
            "uav1": {
                "stage": Stage.LANDED,
                "ordered_mode_s": NOW_S,
                "fault": Fault(FaultKind.INTERRUPTION, "did not start: arm: denied", NOW_S, FaultCode.NOT_STARTED),
                "left_s": NOW_S,
            }
        },
        {"urgent": True, "trigger": "uav1: interruption, did not start: arm: denied", "trigger_s": NOW_S},
        {"launched_s": NOW_S - 45.0},
        context=CREW,
    ),
    Row(
        "a crew's later yes for one vehicle counts",
        with_facts(STARTS, cleared_s=NOW_S - 44.9),
        ended(),
        [Say(Level.WARNING, "uav1: did not start (arm: denied); trying again"), Start("uav1")],
        {"uav1": {"ordered_mode_s": NOW_S, "failures": 1}},
        {},
        {"launched_s": NOW_S - 160.0},
        context=CREW,
    ),
    Row(
        "a start without a launch",
        STARTS,
        ended(),
        [Say(Level.WARNING, "uav1: did not start (arm: denied); trying again"), Start("uav1")],
        {"uav1": {"ordered_mode_s": NOW_S, "failures": 1}},
        {},
        {"launched_s": None},
        context=CREW,
    ),
    Row(
        "a judgement of a loss",
        flying(),
        LossJudged("uav1", 3, (2, 4)),
        [],
        {},
        {"outlook": {"uav2": LossOutlook(5.0, uncovered=()), "uav1": LossOutlook(NOW_S, uncovered=(2, 4))}},
        {"revision": 3, "outlook": {"uav2": LossOutlook(5.0, ())}},
    ),
    Row(
        "a judgement of a loss under an older plan",
        flying(),
        LossJudged("uav1", 2, (2, 4)),
        [],
        {},
        {},
        {"revision": 3},
    ),
    Row(
        "a question to the crew",
        READY,
        Asked("take-off", "go?", ("one", "two")),
        [],
        {},
        {"briefing": Briefing(question=Question(id="take-off", text="go?", lines=("one", "two")))},
        {"briefing": Briefing(answered="prepare")},
    ),
]


@pytest.mark.parametrize("row", ROWS, ids=[row.what for row in ROWS])
def test_everything_that_comes_of_it(row: Row) -> None:
    assert row.shows() == row.expected()
