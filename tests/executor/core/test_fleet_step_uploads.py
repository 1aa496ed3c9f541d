"""What became of each upload of a re-plan."""

from __future__ import annotations

from dataclasses import replace

import pytest

from executor.core.interface.commands import Disarm, Level, Say, SendHome, Start
from executor.core.interface.events import UploadEnded
from executor.core.state.fleet_state import ReplanRecord
from executor.core.state.inspection_proof import PositionSample, join_run
from executor.core.state.mission_ownership import MissionOwnership
from executor.core.state.vehicle_parts import FlownSortie
from executor.core.state.vehicle_state import (
    Fault,
    FaultCode,
    FaultKind,
    Stage,
    apply_onboard_mission,
    build_onboard_mission,
)
from tests.executor.builders import with_facts
from tests.executor.core.steps import CREW, HOMEWARD, LOW, SENT_HOME, Row, beat, new_mission, plan_of
from tests.executor.core.vehicles import DISARMED, FLEET, NOW_S, flying

UNDER_WAY = plan_of(missions={"uav1": new_mission(4, 6)}, pending=frozenset({"uav1"}))
BOTH = replace(UNDER_WAY, pending=frozenset({"uav1", "uav2"}))
FRESH = replace(UNDER_WAY, missions={"uav1": new_mission(4, fresh=True)})
GETS = flying(pending=4)
STANDS = flying(stage=Stage.GROUND, heartbeat=DISARMED, took_off=False, fix=LOW, pending=4, anchor=None)
STARTING = with_facts(STANDS, stage=Stage.STARTING, heartbeat=beat())
NEW = build_onboard_mission(
    FLEET.context, "uav1", 4, UNDER_WAY.missions["uav1"].path, UNDER_WAY.missions["uav1"].visits
)
ANEW = build_onboard_mission(FLEET.context, "uav1", 4, FRESH.missions["uav1"].path, FRESH.missions["uav1"].visits)
HOMEWARD_ONLY = replace(UNDER_WAY, missions={"uav1": new_mission()})
HOME_BOARD = build_onboard_mission(FLEET.context, "uav1", 4, new_mission().path, (0,))
ON_BOARD = ReplanRecord(4, "uav3: gone", True, (), 0.5, NOW_S - 5.0, NOW_S, 3.0)


def ended(*, accepted: bool = True, mixed: bool = False, revision: int = 4) -> UploadEnded:
    return UploadEnded("uav1", revision, accepted, mixed, "" if accepted else "no room")


ROWS = [
    Row("an upload of no re-plan", GETS, ended(), [], {}, {}),
    Row("an upload of an older re-plan", GETS, ended(revision=3), [], {}, {}, {"replan": UNDER_WAY}),
    Row(
        "an upload that was let go",
        GETS,
        ended(),
        [],
        {},
        {},
        {"replan": replace(UNDER_WAY, pending=frozenset({"uav2"}))},
    ),
    Row(
        "an upload that is the last",
        GETS,
        ended(),
        [
            Say(Level.INFO, "uav1: new mission on board, 3 segments to go"),
            Say(Level.INFO, "re-plan 4 is on board after 5.0 s"),
        ],
        {"uav1": {"board": NEW, "pending": None, "carried": MissionOwnership(ours_s=NOW_S)}},
        {"orphans_since_s": None, "replan": None, "records": (ON_BOARD,)},
        {"replan": UNDER_WAY, "orphans_since_s": NOW_S - 9.0},
    ),
    Row(
        "an upload while another is under way",
        GETS,
        ended(),
        [Say(Level.INFO, "uav1: new mission on board, 3 segments to go")],
        {"uav1": {"board": NEW, "pending": None, "carried": MissionOwnership(ours_s=NOW_S)}},
        {"replan": replace(UNDER_WAY, pending=frozenset({"uav2"}))},
        {"replan": BOTH},
    ),
    Row(
        "an upload after which one segment is left",
        with_facts(GETS, waypoint=5),
        ended(),
        [
            Say(Level.INFO, "uav1: new mission on board, 1 segment to go"),
            Say(Level.INFO, "re-plan 4 is on board after 5.0 s"),
        ],
        {"uav1": {"board": NEW, "pending": None, "carried": MissionOwnership(ours_s=NOW_S)}},
        {"replan": None, "records": (ON_BOARD,)},
        {"replan": UNDER_WAY},
    ),
    Row(
        "an upload that only brings it home",
        with_facts(GETS, waypoint=3),
        ended(),
        [
            Say(Level.INFO, "uav1: new mission on board, no segment left, returning"),
            Say(Level.INFO, "re-plan 4 is on board after 5.0 s"),
        ],
        {"uav1": {"board": HOME_BOARD, "pending": None, "carried": MissionOwnership(ours_s=NOW_S)}},
        {"replan": None, "records": (ON_BOARD,)},
        {"replan": HOMEWARD_ONLY},
    ),
    Row(
        "an upload that is refused",
        GETS,
        ended(accepted=False),
        [Say(Level.WARNING, "uav1: upload of its new mission failed (no room); re-planning without it")],
        {"uav1": {"pending": None, "stubborn": True}},
        {
            "urgent": True,
            "trigger": "uav1: no room",
            "trigger_s": NOW_S,
            "replan": replace(UNDER_WAY, pending=frozenset({"uav2"}), failed=("uav1",)),
        },
        {"replan": BOTH},
    ),
    Row(
        "an upload that is refused and is the last",
        GETS,
        ended(accepted=False),
        [
            Say(Level.WARNING, "uav1: upload of its new mission failed (no room); re-planning without it"),
            Say(Level.INFO, "re-plan 4 ended; not uploaded to uav1"),
        ],
        {"uav1": {"pending": None, "stubborn": True}},
        {"urgent": True, "trigger": "uav1: no room", "trigger_s": NOW_S, "replan": None, "records": (ON_BOARD,)},
        {"replan": UNDER_WAY},
    ),
    Row(
        "an upload that nobody hears",
        GETS,
        ended(accepted=False),
        [],
        {"uav1": {"pending": None}},
        {
            "urgent": True,
            "trigger": "uav3: gone",
            "trigger_s": NOW_S - 5.0,
            "replan": replace(UNDER_WAY, pending=frozenset({"uav2"}), failed=("uav1",)),
        },
        {"replan": BOTH, "silent_since_s": NOW_S - 9.0},
    ),
    Row(
        "an upload to who has turned home meanwhile",
        with_facts(GETS, **HOMEWARD),
        ended(accepted=False),
        [],
        {"uav1": {"pending": None}},
        {
            "urgent": True,
            "trigger": "uav3: gone",
            "trigger_s": NOW_S - 5.0,
            "replan": replace(UNDER_WAY, pending=frozenset({"uav2"}), failed=("uav1",)),
        },
        {"replan": BOTH},
    ),
    Row(
        "an upload that leaves a mixture on who has turned home harms nobody",
        with_facts(GETS, **HOMEWARD),
        ended(accepted=False, mixed=True),
        [],
        {"uav1": {"pending": None}},
        {
            "urgent": True,
            "trigger": UNDER_WAY.solve.trigger,
            "trigger_s": UNDER_WAY.begun_s,
            "replan": replace(UNDER_WAY, pending=frozenset({"uav2"}), failed=("uav1",)),
        },
        {"replan": BOTH},
    ),
    Row(
        "an upload that leaves a mixture",
        GETS,
        ended(accepted=False, mixed=True),
        [
            Say(Level.WARNING, "uav1: upload of its new mission failed (no room); re-planning without it"),
            Say(
                Level.FAULT,
                (
                    "uav1: interruption, its mission on board is a mix of two; RTL commanded; 2 segments assigned "
                    "to no vehicle"
                ),
            ),
            SendHome("uav1"),
        ],
        {
            "uav1": SENT_HOME
            | {
                "fault": Fault(
                    FaultKind.INTERRUPTION, "its mission on board is a mix of two", NOW_S, FaultCode.MISSION_MIXED
                ),
                "pending": None,
                "stubborn": True,
            }
        },
        {
            "urgent": True,
            "trigger": "uav1: no room; uav1: interruption, its mission on board is a mix of two",
            "trigger_s": NOW_S,
            "replan": replace(UNDER_WAY, pending=frozenset({"uav2"}), failed=("uav1",)),
        },
        {"replan": BOTH},
    ),
    Row(
        "an upload that is accepted after all",
        GETS,
        ended(mixed=True),
        [Say(Level.INFO, "uav1: new mission on board, 3 segments to go")],
        {"uav1": {"board": NEW, "pending": None, "carried": MissionOwnership(ours_s=NOW_S)}},
        {"replan": replace(UNDER_WAY, pending=frozenset({"uav2"}))},
        {"replan": BOTH},
    ),
    Row(
        "a fresh mission is flown",
        STANDS,
        ended(),
        [Say(Level.INFO, "uav1: new mission on board, 1 segment to go"), Start("uav1")],
        {
            "uav1": {
                "stage": Stage.STARTING,
                "ordered_mode_s": NOW_S,
                "armed_once": False,
                "board": ANEW,
                "waypoint": 0,
                "pending": None,
                "began_pct": 90.0,
                "sorties": (FlownSortie(1, "", NOW_S, 90.0, None),),
                "ordered_modes": frozenset({3, 4}),
                "carried": MissionOwnership(ours_s=NOW_S),
            }
        },
        {"replan": replace(FRESH, pending=frozenset({"uav2"}))},
        {"replan": replace(FRESH, pending=BOTH.pending)},
    ),
    Row(
        "a fresh mission is flown by a crew's word",
        with_facts(STANDS, cleared_s=NOW_S - 120.0),
        ended(),
        [
            Say(Level.INFO, "uav1: new mission on board, 1 segment to go"),
            Start("uav1"),
            Say(Level.INFO, "re-plan 4 is on board after 5.0 s"),
        ],
        {
            "uav1": {
                "stage": Stage.STARTING,
                "ordered_mode_s": NOW_S,
                "armed_once": False,
                "board": ANEW,
                "waypoint": 0,
                "pending": None,
                "began_pct": 90.0,
                "sorties": (FlownSortie(1, "", NOW_S, 90.0, None),),
                "ordered_modes": frozenset({3, 4}),
                "carried": MissionOwnership(ours_s=NOW_S),
            }
        },
        {"replan": None, "records": (ON_BOARD,)},
        {"replan": FRESH},
        context=CREW,
    ),
    Row(
        "a fresh mission for which the word is too old",
        with_facts(STANDS, cleared_s=NOW_S - 120.1),
        ended(),
        [
            Say(Level.INFO, "uav1: new mission on board, 1 segment to go"),
            Say(Level.WARNING, "uav1: stays on the ground: take-off clearance expired"),
            Say(Level.INFO, "re-plan 4 is on board after 5.0 s"),
        ],
        {"uav1": {"board": ANEW, "waypoint": 0, "pending": None, "carried": MissionOwnership(ours_s=NOW_S)}},
        {"replan": None, "records": (ON_BOARD,)},
        {"replan": FRESH},
        context=CREW,
    ),
    Row(
        "a fresh mission without a word",
        STANDS,
        ended(),
        [
            Say(Level.INFO, "uav1: new mission on board, 1 segment to go"),
            Say(Level.WARNING, "uav1: stays on the ground: take-off clearance expired"),
            Say(Level.INFO, "re-plan 4 is on board after 5.0 s"),
        ],
        {"uav1": {"board": ANEW, "waypoint": 0, "pending": None, "carried": MissionOwnership(ours_s=NOW_S)}},
        {"replan": None, "records": (ON_BOARD,)},
        {"replan": FRESH},
        context=CREW,
    ),
    Row(
        "a fresh mission that is refused",
        STANDS,
        ended(accepted=False, mixed=True),
        [
            Say(Level.WARNING, "uav1: upload of its new mission failed (no room); re-planning without it"),
            Say(Level.INFO, "re-plan 4 ended; not uploaded to uav1"),
        ],
        {"uav1": {"pending": None, "stubborn": True}},
        {"urgent": True, "trigger": "uav1: no room", "trigger_s": NOW_S, "replan": None, "records": (ON_BOARD,)},
        {"replan": FRESH},
    ),
    Row(
        "a start goes on after an upload",
        STARTING,
        ended(),
        [Say(Level.INFO, "uav1: new mission on board, 3 segments to go"), Start("uav1")],
        {
            "uav1": {
                "ordered_mode_s": NOW_S,
                "armed_once": False,
                "board": NEW,
                "waypoint": 0,
                "pending": None,
                "began_pct": 90.0,
                "sorties": (FlownSortie(1, "", NOW_S, 90.0, None),),
                "ordered_modes": frozenset({3, 4}),
                "carried": MissionOwnership(ours_s=NOW_S),
            }
        },
        {"replan": replace(UNDER_WAY, pending=frozenset({"uav2"}))},
        {"replan": BOTH},
    ),
    Row(
        "a start goes on after an upload that was refused",
        STARTING,
        ended(accepted=False),
        [Say(Level.WARNING, "uav1: upload of its new mission failed (no room); re-planning without it"), Start("uav1")],
        {
            "uav1": {
                "ordered_mode_s": NOW_S,
                "armed_once": False,
                "waypoint": 0,
                "pending": None,
                "stubborn": True,
                "began_pct": 90.0,
                "sorties": (FlownSortie(1, "", NOW_S, 90.0, None),),
                "ordered_modes": frozenset({3, 4}),
                "carried": MissionOwnership(ours_s=NOW_S),
            }
        },
        {
            "urgent": True,
            "trigger": "uav1: no room",
            "trigger_s": NOW_S,
            "replan": replace(UNDER_WAY, pending=frozenset({"uav2"}), failed=("uav1",)),
        },
        {"replan": BOTH},
    ),
    Row(
        "a start does not go on with a mixture",
        STARTING,
        ended(accepted=False, mixed=True),
        [
            Say(Level.WARNING, "uav1: upload of its new mission failed (no room); re-planning without it"),
            Say(
                Level.FAULT,
                (
                    "uav1: interruption, its mission on board is a mix of two; disarm commanded; 2 segments "
                    "assigned to no vehicle"
                ),
            ),
            Disarm(vehicle="uav1", force=False),
        ],
        {
            "uav1": {
                "stage": Stage.RETURNING,
                "ordered_mode_s": NOW_S,
                "fault": Fault(
                    FaultKind.INTERRUPTION, "its mission on board is a mix of two", NOW_S, FaultCode.MISSION_MIXED
                ),
                "pending": None,
                "stubborn": True,
                "left_s": NOW_S,
            }
        },
        {
            "urgent": True,
            "trigger": "uav1: no room; uav1: interruption, its mission on board is a mix of two",
            "trigger_s": NOW_S,
            "replan": replace(UNDER_WAY, pending=frozenset({"uav2"}), failed=("uav1",)),
        },
        {"replan": BOTH},
    ),
    Row(
        "a start that has become a flight",
        with_facts(STARTING, took_off=True, failures=2),
        ended(),
        [Say(Level.INFO, "uav1: new mission on board, 3 segments to go"), Say(Level.INFO, "uav1: flies its mission")],
        {
            "uav1": {
                "stage": Stage.FLYING,
                "ordered_mode_s": NOW_S,
                "board": NEW,
                "pending": None,
                "failures": 0,
                "carried": MissionOwnership(ours_s=NOW_S),
            }
        },
        {"replan": replace(UNDER_WAY, pending=frozenset({"uav2"}))},
        {"replan": BOTH},
    ),
]


@pytest.mark.parametrize("row", ROWS, ids=[row.what for row in ROWS])
def test_everything_that_comes_of_it(row: Row) -> None:
    assert row.shows() == row.expected()


RUN = join_run(NEW.tracks[0], PositionSample(NOW_S, (0.0, 0.0), 5.0), 5.0)


def test_what_was_begun_of_a_visit_that_is_not_there_any_more_is_over() -> None:
    """An upload may take longer than was reckoned: its vehicle may have begun a visit that it has no more."""
    begun = with_facts(GETS, run=RUN, run_visit=1, owed=(1, "flown too far from the line"))
    carries = apply_onboard_mission(begun, HOME_BOARD, NOW_S).assignment
    assert (carries.run, carries.run_visit, carries.owed) == (None, None, None)
    kept = apply_onboard_mission(with_facts(begun, run_visit=0, owed=(0, "why")), HOME_BOARD, NOW_S).assignment
    assert (kept.run, kept.run_visit, kept.owed) == (begun.assignment.run, 0, (0, "why"))
