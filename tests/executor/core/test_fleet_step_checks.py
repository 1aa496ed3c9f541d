"""What a look at a vehicle leads to: every order, every line, and everything that changes by it."""

from __future__ import annotations

import pytest

from executor.core.interface.commands import AskStreams, HandsOff, Level, Say, SendHome
from executor.core.interface.events import Tick
from executor.core.interface.messages import Attitude
from executor.core.state.mission_ownership import MissionOwnership
from executor.core.state.vehicle_parts import HomingOrder, ModeCause, Takeover
from executor.core.state.vehicle_state import Fault, FaultCode, FaultKind, Stage
from tests.executor.core.steps import BATTERY_FAULT, HOLD, HOMEWARD, LOW, SECOND, SENT_HOME, STILL, Row, beat, over_pad
from tests.executor.core.vehicles import DISARMED, NOW_S, OUT_THERE, RTL, at, flying

EMERGENCY_HOMEWARD = HOMEWARD | {"heartbeat": beat(RTL, status=6)}
ROWS = [
    Row("who flies its mission well is left to it", flying(), Tick(), [], {}, {}),
    Row(
        "before the launch nobody on the ground is looked at",
        flying(stage=Stage.DOWN, heartbeat=DISARMED, fix=STILL, disarmed_s=NOW_S - 3.0),
        Tick(),
        [],
        {},
        {},
        {"launched_s": None},
    ),
    Row(
        "who lies still is said where",
        flying(stage=Stage.DOWN, heartbeat=DISARMED, fix=STILL, disarmed_s=NOW_S - 3.0),
        Tick(),
        [Say(Level.FAULT, f"uav1: down at {OUT_THERE}, disarmed")],
        {"uav1": {"place_told": True}},
        {},
    ),
    Row(
        "who was said to lie is not said again",
        flying(stage=Stage.DOWN, heartbeat=DISARMED, fix=STILL, disarmed_s=NOW_S - 3.0, place_told=True),
        Tick(),
        [],
        {},
        {},
    ),
    Row(
        "who lies armed is not said to be at rest",
        flying(stage=Stage.DOWN, fix=STILL, anchor=STILL, disarmed_s=NOW_S - 3.0),
        Tick(),
        [],
        {},
        {},
    ),
    Row(
        "who was thought to be down but flies comes home",
        flying(stage=Stage.DOWN, anchor=STILL),
        Tick(),
        [
            Say(
                Level.FAULT,
                (f"uav1: reported down but is airborne, last position {OUT_THERE}, 20 m over its home, 0 s ago"),
            ),
            SendHome("uav1"),
        ],
        {"uav1": SENT_HOME},
        {},
    ),
    Row(
        "who was taken to have landed and flies comes home",
        flying(stage=Stage.LANDED),
        Tick(),
        [
            Say(
                Level.FAULT,
                (f"uav1: reported landed but is airborne, last position {OUT_THERE}, 20 m over its home, 0 s ago"),
            ),
            SendHome("uav1"),
        ],
        {"uav1": SENT_HOME},
        {},
    ),
    Row(
        "who was taken to have landed and is low is not",
        flying(stage=Stage.LANDED, fix=over_pad(5.0)),
        Tick(),
        [],
        {},
        {},
    ),
    Row(
        "who is armed on the ground by somebody is kept clear of",
        flying(stage=Stage.GROUND, fix=LOW, took_off=False, cause=ModeCause.PERSON, mode_since_s=NOW_S - 1.0),
        Tick(),
        [
            Say(Level.FAULT, "uav1: armed on the ground by another source, mode MISSION: keep clear"),
            HandsOff("uav1"),
        ],
        {"uav1": {"stage": Stage.PILOT, "anchor": None, "taken": Takeover(since_s=NOW_S - 1.0, given_away=True)}},
        {},
    ),
    Row(
        "who is armed on the ground by somebody a moment ago is waited for",
        flying(stage=Stage.GROUND, fix=LOW, took_off=False, cause=ModeCause.PERSON, mode_since_s=NOW_S - 0.9),
        Tick(),
        [],
        {},
        {},
    ),
    Row(
        "who is lost is not looked at",
        flying(stage=Stage.LOST, heard_s=NOW_S - 50.0),
        Tick(),
        [],
        {},
        {},
        {"given_up": frozenset(range(6))},
    ),
    Row(
        "who says nothing for three seconds is said to be silent",
        flying(heard_s=NOW_S - 3.0),
        Tick(),
        [Say(Level.WARNING, "uav1: no message for 3.0 s")],
        {"uav1": {"stale": True}},
        {},
        beside=(SECOND,),
    ),
    Row("who has no position is left to its mission", flying(fix=None), Tick(), [], {}, {}),
    Row(
        "a person's mode is not spoken into for a second",
        flying(heartbeat=beat(HOLD), cause=ModeCause.PERSON, mode_since_s=NOW_S - 0.9),
        Tick(),
        [],
        {},
        {},
    ),
    Row(
        "a person's mode is a pilot's",
        flying(heartbeat=beat(HOLD), cause=ModeCause.PERSON, mode_since_s=NOW_S - 1.0),
        Tick(),
        [
            Say(
                Level.FAULT, "uav1: with its pilot, mode HOLD; not commanded from here; its segments are kept for 30 s"
            ),
            HandsOff("uav1"),
        ],
        {"uav1": {"stage": Stage.PILOT, "anchor": None, "taken": Takeover(NOW_S - 1.0)}},
        {},
    ),
    Row(
        "a person's mode is a pilot's on the way home too",
        flying(
            **HOMEWARD | {"heartbeat": beat(HOLD)},
            cause=ModeCause.PERSON,
            mode_since_s=NOW_S - 1.0,
            errand=HomingOrder(NOW_S - 9.0, told=True),
        ),
        Tick(),
        [Say(Level.FAULT, "uav1: with its pilot, mode HOLD; not commanded from here"), HandsOff("uav1")],
        {
            "uav1": {
                "stage": Stage.PILOT,
                "anchor": None,
                "taken": Takeover(since_s=NOW_S - 1.0, given_away=True),
                "errand": None,
            }
        },
        {},
    ),
    Row(
        "another station's mission is a pilot's",
        flying(carried=MissionOwnership(foreign_s=NOW_S - 1.0, words="none at all")),
        Tick(),
        [
            Say(
                Level.FAULT,
                (
                    "uav1: has a foreign mission on board (none at all): another station's; it may leave "
                    "its layer; not commanded from here; its segments are kept for 30 s"
                ),
            ),
            HandsOff("uav1"),
        ],
        {"uav1": {"stage": Stage.PILOT, "anchor": None, "cause": ModeCause.PERSON, "taken": Takeover(NOW_S - 1.0)}},
        {},
    ),
    Row(
        "another station's mission is looked at twice",
        flying(carried=MissionOwnership(foreign_s=NOW_S - 0.8, words="none at all")),
        Tick(),
        [],
        {},
        {},
    ),
    Row(
        "another station's mission says nothing of who returns",
        flying(**HOMEWARD, carried=MissionOwnership(foreign_s=NOW_S - 1.0, words="none at all")),
        Tick(),
        [],
        {},
        {},
    ),
    Row(
        "who leans lies",
        flying(tilted_since_s=NOW_S - 3.0, attitude=Attitude(80.0, -90.0)),
        Tick(),
        [Say(Level.FAULT, f"uav1: down, leans by 90 degrees, down at {OUT_THERE}, armed: keep away")],
        {
            "uav1": {
                "stage": Stage.DOWN,
                "ordered_mode_s": NOW_S,
                "anchor": None,
                "fault": Fault(
                    FaultKind.DOWN,
                    f"leans by 90 degrees, down at {OUT_THERE}, armed: keep away",
                    NOW_S,
                    FaultCode.DOWN,
                ),
                "place_told": True,
                "left_s": NOW_S,
            }
        },
        {
            "urgent": True,
            "trigger": f"uav1: down, leans by 90 degrees, down at {OUT_THERE}, armed: keep away",
            "trigger_s": NOW_S,
        },
    ),
    Row(
        "who leans for less may right itself",
        flying(tilted_since_s=NOW_S - 2.9, attitude=Attitude(80.0, -90.0)),
        Tick(),
        [],
        {},
        {},
    ),
    Row(
        "who leans and is out of the plan is said where",
        flying(
            **HOMEWARD,
            fault=BATTERY_FAULT,
            tilted_since_s=NOW_S - 3.0,
            attitude=Attitude(80.0, -90.0),
            errand=HomingOrder(NOW_S),
        ),
        Tick(),
        [Say(Level.FAULT, f"uav1: leans by 90 degrees, down at {OUT_THERE}, armed: keep away")],
        {"uav1": {"stage": Stage.DOWN, "errand": None, "place_told": True}},
        {},
    ),
    Row(
        "what a vehicle says of its emergency does not hide that it lies",
        flying(
            **EMERGENCY_HOMEWARD,
            fault=BATTERY_FAULT,
            tilted_since_s=NOW_S - 3.0,
            attitude=Attitude(80.0, -90.0),
            errand=HomingOrder(NOW_S),
        ),
        Tick(),
        [Say(Level.FAULT, f"uav1: leans by 90 degrees, down at {OUT_THERE}, armed: keep away")],
        {"uav1": {"stage": Stage.DOWN, "errand": None, "place_told": True}},
        {},
    ),
    Row(
        "nor that it is silent",
        flying(
            **EMERGENCY_HOMEWARD,
            fault=BATTERY_FAULT,
            heard_s=NOW_S - 10.0,
            errand=HomingOrder(NOW_S - 20.0),
            stale=True,
        ),
        Tick(),
        [
            Say(
                Level.WARNING,
                (f"uav1: link lost for 10.0 s, time-out 10 s; last position {OUT_THERE}, 20 m over its home, 0 s ago"),
            )
        ],
        {"uav1": {"stage": Stage.LOST, "errand": None}},
        {},
        beside=(SECOND,),
    ),
    Row(
        "who falls silent on its way home is lost",
        flying(**HOMEWARD, fault=BATTERY_FAULT, heard_s=NOW_S - 10.0, errand=HomingOrder(NOW_S - 20.0), stale=True),
        Tick(),
        [
            Say(
                Level.WARNING,
                (f"uav1: link lost for 10.0 s, time-out 10 s; last position {OUT_THERE}, 20 m over its home, 0 s ago"),
            )
        ],
        {"uav1": {"stage": Stage.LOST, "errand": None}},
        {},
        beside=(SECOND,),
    ),
    Row(
        "who falls silent with a pilot's mode is lost, not taken",
        flying(
            heartbeat=beat(HOLD), cause=ModeCause.PERSON, mode_since_s=NOW_S - 12.0, heard_s=NOW_S - 10.0, stale=True
        ),
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
        "who is to come home and was not told is told",
        flying(**HOMEWARD | {"heartbeat": beat()}, errand=HomingOrder(NOW_S - 1.0)),
        Tick(),
        [SendHome("uav1")],
        {
            "uav1": {
                "ordered_mode_s": NOW_S,
                "ordered_modes": frozenset({6, 9}),
                "errand": HomingOrder(NOW_S - 1.0, told=True),
            }
        },
        {},
    ),
    Row(
        "who flies its mission is to be told nothing",
        flying(errand=HomingOrder(NOW_S - 9.0)),
        Tick(),
        [],
        {"uav1": {"errand": None}},
        {},
    ),
    Row(
        "who is told already is not told again",
        flying(**HOMEWARD | {"heartbeat": beat()}, errand=HomingOrder(NOW_S - 1.0, told=True)),
        Tick(),
        [],
        {},
        {},
    ),
    Row("a broken inspection that may be flown still is not said", flying(owed=(0, "why")), Tick(), [], {}, {}),
    Row(
        "a broken inspection that is behind is said",
        flying(owed=(0, "why"), waypoint=3),
        Tick(),
        [Say(Level.WARNING, "uav1: segment 0 is not proven: why")],
        {"uav1": {"owed": None}},
        {},
    ),
    Row(
        "a broken inspection that another vehicle made good is not said",
        flying(owed=(0, "why"), runs_broken=((0, "why"),), waypoint=3),
        Tick(),
        [],
        {"uav1": {"owed": None}},
        {},
        {"inspected": {0: "uav2"}},
    ),
    Row(
        "a broken inspection that it made good itself is forgotten",
        flying(owed=(0, "why"), runs_broken=((1, "other"), (0, "why")), waypoint=3),
        Tick(),
        [],
        {"uav1": {"owed": None, "runs_broken": ((1, "other"),)}},
        {},
        {"inspected": {0: "uav1"}},
    ),
    Row(
        "a broken inspection of who turns home is said",
        flying(**HOMEWARD, owed=(0, "why")),
        Tick(),
        [Say(Level.WARNING, "uav1: segment 0 is not proven: why")],
        {"uav1": {"owed": None}},
        {},
    ),
    Row(
        "a broken inspection of who is with its pilot may be flown still",
        flying(stage=Stage.PILOT, taken=Takeover(NOW_S), heartbeat=beat(HOLD), cause=ModeCause.PERSON, owed=(0, "why")),
        Tick(),
        [],
        {},
        {},
    ),
    Row(
        "streams that do not come are asked for",
        flying(fix=at(age_s=5.0)),
        Tick(),
        [Say(Level.WARNING, "uav1: no position for 5 s, while other messages come"), AskStreams("uav1")],
        {"uav1": {"streams_asked_s": NOW_S}},
        {"told": {"uav1": (("positions", NOW_S),)}},
    ),
    Row(
        "streams of a pilot's are not asked for",
        flying(
            fix=at(age_s=5.0), stage=Stage.PILOT, taken=Takeover(NOW_S), heartbeat=beat(HOLD), cause=ModeCause.PERSON
        ),
        Tick(),
        [Say(Level.WARNING, "uav1: no position for 5 s, while other messages come")],
        {},
        {"told": {"uav1": (("positions", NOW_S),)}},
    ),
    Row(
        "streams of who may be a pilot's are not asked for",
        flying(fix=at(age_s=5.0), heartbeat=beat(HOLD), cause=ModeCause.PERSON, mode_since_s=NOW_S - 0.5),
        Tick(),
        [Say(Level.WARNING, "uav1: no position for 5 s, while other messages come")],
        {},
        {"told": {"uav1": (("positions", NOW_S),)}},
    ),
]


@pytest.mark.parametrize("row", ROWS, ids=[row.what for row in ROWS])
def test_everything_that_comes_of_it(row: Row) -> None:
    assert row.shows() == row.expected()
