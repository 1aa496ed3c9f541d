"""Segments flown during a gap, inferred from clock, place and battery."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import pytest

from executor.core.battery.account import BatteryState
from executor.core.resume import link_blackout
from executor.core.resume.link_blackout import InferredCoverage
from executor.core.state import inspection_proof
from executor.core.state.inspection_proof import InspectionRun, PositionSample, _RunStatistics
from executor.core.state.legs import remaining_leg_share
from executor.core.state.vehicle_parts import LastKnown
from tests.executor.core.steps import HOLD, Changes, beat, over_pad, rounded
from tests.executor.core.vehicles import DISARMED, FLEET, NOW_S, RTL, at, flying, mission, pack

CONTEXT = FLEET.context
BOARD = mission()
RUN = inspection_proof.join_run(BOARD.tracks[0], PositionSample(5.0, (150.0, -5.0), 3.0), 3.0)
SLANTED = replace(BOARD, places_m=((10.0, 20.0), (70.0, 100.0), (70.0, 100.5), *BOARD.places_m[3:]))
THERE = replace(at(), place_m=(250.0, -5.0))


def before(away_s: float, east_m: float = 150.0, **given: Any) -> LastKnown:
    """Return where it was, so long ago, on its way along the first segment."""
    fix = replace(at(age_s=away_s), place_m=(east_m, -5.0))
    return replace(LastKnown(fix, 2, RUN, 0, 90.0), **given)


def flew(away_s: float, *, waypoint: int = 3, was: Changes | None = None, **given: Any) -> InferredCoverage:
    """Return what is inferred of a vehicle in the midst of its second segment."""
    one = flying(**{"fix": THERE, "before": before(away_s, **was or {}), "waypoint": waypoint, **given})
    return link_blackout.infer_coverage(CONTEXT, one, BOARD, waypoint)


def stands(away_s: float, used_pct: float = 4.0, failsafe_s: float | None = None, **given: Any) -> InferredCoverage:
    """Return what is inferred of a vehicle that is on its pad again."""
    context = replace(CONTEXT, vehicles={"uav1": replace(CONTEXT.vehicles["uav1"], failsafe_s=failsafe_s)})
    told: Changes = {
        "heartbeat": DISARMED,
        "fix": over_pad(),
        "before": before(away_s),
        "battery": pack(90.0 - used_pct),
    }
    return link_blackout.infer_coverage(context, flying(**told | given), BOARD, 5)


ROWS: list[tuple[str, Callable[[], object], object]] = [
    (
        "it is where it leads",
        lambda: flew(36.0),
        InferredCoverage(
            segments=(0,),
            joins=1,
            run=InspectionRun(
                furthest_m=50.0,
                recent=((NOW_S, 50.0),),
                pace=_RunStatistics(began_s=NOW_S - 16.667, began_m=0.0, fastest_m_s=3.0, samples=1),
            ),
        ),
    ),
    (
        "it took too long, or was too quick",
        lambda: [flew(away_s).why_not for away_s in (22.0, 25.0, 27.0, 30.0, 30.7, 31.2, 42.0, 45.0, 47.0, 50.0)],
        [
            "it took 22 s, expected 38 s",
            "it took 25 s, expected 38 s",
            "it took 27 s, expected 38 s",
            # One of its two segments flown just too fast.
            "it took 30 s, expected 38 s",
            "it took 31 s, expected 38 s",
            "",
            "",
            "",
            "it took 47 s, expected 38 s",
            "it took 50 s, expected 38 s",
        ],
    ),
    (
        "its clock was reset",
        lambda: [flew(away_s).why_not for away_s in (0.0, -5.0)],
        ["its clock was reset", "its clock was reset"],
    ),
    (
        "unknown position before and after",
        lambda: [flew(36.0, before=None), flew(36.0, fix=None), flew(36.0, was={"waypoint": 6})],
        [InferredCoverage(), InferredCoverage(), InferredCoverage()],
    ),
    (
        "it is no longer on its mission",
        lambda: [flew(36.0, heartbeat=heartbeat).why_not for heartbeat in (beat(HOLD), None)],
        ["it is no longer on its mission", "it is not on its pad"],
    ),
    ("its mission went back", lambda: flew(36.0, waypoint=1).why_not, "its mission went back"),
    (
        "it is off its track",
        lambda: [
            flew(36.0, fix=replace(at(), place_m=(250.0, -5.0 + beside_m))).why_not
            for beside_m in (CONTEXT.corridor_m - 0.1, CONTEXT.corridor_m + 0.1)
        ],
        ["", "it is 10 m off its track"],
    ),
    (
        "remaining part of a leg",
        lambda: [
            remaining_leg_share(board, waypoint, fix)
            for board, waypoint, fix in (
                (BOARD, 0, over_pad(6.0)),
                (BOARD, 0, over_pad(30.0)),
                (BOARD, 5, over_pad(6.0)),
                (BOARD, 5, over_pad(0.0)),
                (BOARD, 2, at()),
                (SLANTED, 1, replace(at(), place_m=(40.0, 60.0))),
                (SLANTED, 2, at(up_m=15.0)),
            )
        ],
        [0.6, 1.0, 0.4, 0.0, 0.647951, 0.5, 1.0],
    ),
    (
        "distance beside a slanted leg",
        lambda: [
            link_blackout._lateral_offset_m(SLANTED, waypoint, place_m)
            for waypoint, place_m in (
                (1, (54.0, 58.0)),
                (1, (2.0, 10.0)),
                (1, (94.0, 148.0)),
                (2, (70.0, 103.0)),
                (0, (13.0, 24.0)),
            )
        ],
        [12.4, 12.8062, 53.6656, 2.5, 5.0],
    ),
    (
        "it was not inspecting",
        lambda: flew(36.0, was={"run": None}),
        InferredCoverage(
            joins=1,
            run=InspectionRun(
                furthest_m=50.0,
                recent=((NOW_S, 50.0),),
                pace=_RunStatistics(began_s=NOW_S - 16.667, began_m=0.0, fastest_m_s=3.0, samples=1),
            ),
        ),
    ),
    (
        "it inspected another one",
        lambda: flew(36.0, was={"run_visit": 1}),
        InferredCoverage(
            joins=1,
            run=InspectionRun(
                furthest_m=50.0,
                recent=((NOW_S, 50.0),),
                pace=_RunStatistics(began_s=NOW_S - 16.667, began_m=0.0, fastest_m_s=3.0, samples=1),
            ),
        ),
    ),
    (
        "it is on its first segment still",
        lambda: [
            flew(10.0, waypoint=2, fix=replace(at(), place_m=(180.0, -5.0)), was=was) for was in ({}, {"run": None})
        ],
        [
            InferredCoverage(
                joins=0,
                run=InspectionRun(
                    furthest_m=80.0,
                    recent=((NOW_S, 80.0),),
                    pace=_RunStatistics(began_s=NOW_S - 26.667, began_m=0.0, fastest_m_s=3.0, samples=1),
                ),
            ),
            InferredCoverage(),
        ],
    ),
    (
        "it is on its way home",
        lambda: flew(57.0, waypoint=4, fix=replace(at(), place_m=(268.0, -3.0))),
        InferredCoverage(segments=(0, 1)),
    ),
    (
        "it was on its way to the line",
        lambda: flew(
            40.0,
            waypoint=2,
            fix=replace(at(), place_m=(170.0, -5.0)),
            was={"waypoint": 1, "run": None, "fix": replace(at(age_s=40.0), place_m=(0.0, 9.0))},
        ),
        InferredCoverage(
            joins=0,
            run=InspectionRun(
                furthest_m=70.0,
                recent=((NOW_S, 70.0),),
                pace=_RunStatistics(began_s=NOW_S - 23.333, began_m=0.0, fastest_m_s=3.0, samples=1),
            ),
        ),
    ),
    (
        "it was climbing",
        lambda: flew(
            48.0,
            waypoint=2,
            fix=replace(at(), place_m=(150.0, -5.0)),
            was={"waypoint": 0, "run": None, "fix": over_pad(5.0, age_s=48.0)},
        ),
        InferredCoverage(
            joins=0,
            run=InspectionRun(
                furthest_m=50.0,
                recent=((NOW_S, 50.0),),
                pace=_RunStatistics(began_s=NOW_S - 16.667, began_m=0.0, fastest_m_s=3.0, samples=1),
            ),
        ),
    ),
    ("it is on its pad", lambda: stands(160.0), InferredCoverage(segments=(0, 1))),
    (
        "it is on its pad too early",
        lambda: [stands(away_s).why_not for away_s in (130.0, 140.0, 145.0, 150.0)],
        ["", "", "", ""],
    ),
    (
        "it is on its pad and used too much, or too little",
        lambda: [stands(160.0, used_pct).why_not for used_pct in (1.0, 1.6, 2.0, 5.0, 5.6, 6.0, 9.0)],
        [
            "it used 1 %, expected 5 %",
            "it used 2 %, expected 5 %",
            "it used 2 %, expected 5 %",
            "",
            "",
            "",
            "it used 9 %, expected 5 %",
        ],
    ),
    (
        "it is on its pad and its consumption is not known",
        lambda: [
            stands(160.0, battery=BatteryState()).why_not,
            stands(160.0, before=before(160.0, remaining_pct=None)).why_not,
        ],
        ["its consumption is not known", "its consumption is not known"],
    ),
    (
        "it is not on its pad",
        lambda: [stands(160.0, fix=over_pad(north_m=-north_m)).why_not for north_m in (15.0, 15.1)],
        ["", "it is not on its pad"],
    ),
    (
        "it returned without a command",
        lambda: [stands(160.0, heartbeat=heartbeat).why_not for heartbeat in (beat(RTL, armed=False), None)],
        ["it returned without a command", "it returned without a command"],
    ),
    (
        "its failsafe may have brought it home",
        lambda: [stands(160.0, failsafe_s=failsafe_s).why_not for failsafe_s in (160.0, 160.1)],
        ["its own failsafe may have returned it", ""],
    ),
]


@pytest.mark.parametrize(("what", "found", "expected"), ROWS, ids=[row[0] for row in ROWS])
def test_everything_that_comes_of_it(what: str, found: Callable[[], object], expected: object) -> None:
    assert rounded(found()) == expected
