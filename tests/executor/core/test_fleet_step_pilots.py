"""What becomes of a vehicle that a person has, look by look."""

from __future__ import annotations

from dataclasses import replace

import pytest

from executor.core.interface.commands import CancelSolve, HandsOff, Level, Resume, Say
from executor.core.interface.events import Tick
from executor.core.state.mission_ownership import MissionOwnership
from executor.core.state.vehicle_parts import HomingOrder, ModeCause, Takeover
from executor.core.state.vehicle_state import Stage
from tests.executor.builders import with_facts
from tests.executor.core.steps import (
    BATTERY_FAULT,
    HOLD,
    LOW,
    STILL,
    TAKEN,
    Row,
    beat,
    landed,
    offer_of,
    over_pad,
    plan_of,
)
from tests.executor.core.vehicles import FLEET, NOW_S, ON_PAD, OUT_THERE, RTL, flying, says

PILOTS = flying(stage=Stage.PILOT, heartbeat=beat(HOLD), cause=ModeCause.PERSON, taken=TAKEN, mode_since_s=NOW_S - 10.0)
RETURNED = with_facts(PILOTS, heartbeat=beat(), mode_since_s=NOW_S - 1.0)
DOWN_AGAIN = landed(stage=Stage.PILOT, taken=TAKEN, cause=ModeCause.PERSON)
TAKES = flying(heartbeat=beat(HOLD), cause=ModeCause.PERSON, mode_since_s=NOW_S - 5.0)
SOLVING = plan_of(solve_s=None)
FOREIGN = MissionOwnership(foreign_s=NOW_S - 3.0, words="none at all")
UNSEEN = with_facts(TAKES, mode_since_s=NOW_S - 5.0, unseen_until_s=NOW_S - 5.0, unseen_from_boot_s=NOW_S - 90.0)
ANSWERS = replace(FLEET.context, pilot_returns=True)


ROWS = [
    Row("with a pilot for a while", PILOTS, Tick(), [], {}, {}),
    Row(
        "with a pilot for longer than its work is kept",
        with_facts(PILOTS, taken=Takeover(NOW_S - 30.0)),
        Tick(),
        [Say(Level.WARNING, "uav1: with its pilot for 30 s; its segments are released to the others")],
        {"uav1": {"taken": Takeover(since_s=NOW_S - 30.0, given_away=True)}},
        {"urgent": True, "trigger": "uav1: with its pilot for 30 s", "trigger_s": NOW_S},
    ),
    Row(
        "with a pilot for just less than its work is kept",
        with_facts(PILOTS, taken=Takeover(NOW_S - 29.9)),
        Tick(),
        [],
        {},
        {},
    ),
    Row(
        "with a pilot for long, its work given away",
        with_facts(PILOTS, taken=Takeover(NOW_S - 90.0, given_away=True)),
        Tick(),
        [],
        {},
        {},
    ),
    Row("with a pilot, nobody knows since when", with_facts(PILOTS, taken=None), Tick(), [], {}, {}),
    Row(
        "back on its mission",
        RETURNED,
        Tick(),
        [Say(Level.FAULT, "uav1: its pilot has set mission mode again; use include to put it back in the plan")],
        {"uav1": {"taken": Takeover(since_s=NOW_S - 10.0, returned_s=NOW_S)}},
        {},
        {"recalled": False, "given_up": frozenset(range(6))},
    ),
    Row(
        "back on its mission after an abort",
        RETURNED,
        Tick(),
        [
            Say(
                Level.WARNING,
                "uav1: its pilot has set mission mode, but the flight was aborted; not commanded from here",
            )
        ],
        {"uav1": {"taken": Takeover(since_s=NOW_S - 10.0, returned_s=NOW_S)}},
        {},
        context=ANSWERS,
    ),
    Row(
        "back on its mission for less than a second", with_facts(RETURNED, mode_since_s=NOW_S - 0.9), Tick(), [], {}, {}
    ),
    Row("back on its mission, which is not ours", with_facts(RETURNED, carried=FOREIGN), Tick(), [], {}, {}),
    Row(
        "back on its mission with a fault",
        replace(RETURNED, fault=BATTERY_FAULT),
        Tick(),
        [
            Say(
                Level.WARNING,
                ("uav1: its pilot has set mission mode, but its segments were reassigned; not commanded from here"),
            )
        ],
        {"uav1": {"taken": Takeover(since_s=NOW_S - 10.0, returned_s=NOW_S)}},
        {},
    ),
    Row(
        "back on its mission where that is enough",
        RETURNED,
        Tick(),
        [Say(Level.INFO, "uav1: is back in the plan, from its pilot"), Resume(vehicle="uav1", speed_m_s=3.0)],
        {
            "uav1": {
                "stage": Stage.FLYING,
                "ordered_mode_s": NOW_S,
                "anchor": None,
                "ordered_modes": frozenset({3}),
                "cause": ModeCause.OURS,
                "taken": None,
            }
        },
        {},
        {"recalled": False, "given_up": frozenset(range(6))},
        context=ANSWERS,
    ),
    Row(
        "back on its mission where that is enough, its work given away",
        with_facts(RETURNED, taken=replace(TAKEN, given_away=True), excluded=True, anchor=LOW),
        Tick(),
        [Say(Level.INFO, "uav1: is back in the plan, from its pilot"), Resume(vehicle="uav1", speed_m_s=3.0)],
        {
            "uav1": {
                "stage": Stage.FLYING,
                "ordered_mode_s": NOW_S,
                "anchor": None,
                "excluded": False,
                "ordered_modes": frozenset({3}),
                "cause": ModeCause.OURS,
                "taken": None,
            }
        },
        {"trigger": "uav1: is back in the plan", "trigger_s": NOW_S, "ordered": True, "orphans_since_s": NOW_S},
        {"recalled": False, "given_up": frozenset(range(6)), "wait_until_s": NOW_S + 9.0},
        context=ANSWERS,
    ),
    Row(
        "back on its mission where that is enough, and beyond it",
        with_facts(RETURNED, waypoint=6),
        Tick(),
        [Say(Level.INFO, "uav1: is back in the plan, from its pilot")],
        {
            "uav1": {
                "stage": Stage.FLYING,
                "ordered_mode_s": NOW_S,
                "anchor": None,
                "ordered_modes": frozenset({3}),
                "cause": ModeCause.OURS,
                "taken": None,
            }
        },
        {},
        {"recalled": False, "given_up": frozenset(range(6))},
        context=ANSWERS,
    ),
    Row(
        "back on its mission for a while, past the time that its work is kept",
        with_facts(RETURNED, taken=Takeover(NOW_S - 40.0, returned_s=NOW_S - 20.0)),
        Tick(),
        [],
        {},
        {},
    ),
    Row(
        "taken again",
        with_facts(PILOTS, taken=replace(TAKEN, returned_s=NOW_S - 5.0)),
        Tick(),
        [Say(Level.WARNING, "uav1: taken over by its pilot again, mode HOLD")],
        {"uav1": {"taken": TAKEN}},
        {},
    ),
    Row(
        "on the ground again",
        DOWN_AGAIN,
        Tick(),
        [Say(Level.INFO, "uav1: landed by its pilot; stays on the ground until included")],
        {"uav1": {"stage": Stage.LANDED, "excluded": True, "taken": None}},
        {"urgent": True, "trigger": "uav1: landed by its pilot", "trigger_s": NOW_S},
    ),
    Row(
        "on the ground again, its work given away",
        with_facts(DOWN_AGAIN, taken=replace(TAKEN, given_away=True)),
        Tick(),
        [Say(Level.INFO, "uav1: landed by its pilot; stays on the ground until included")],
        {"uav1": {"stage": Stage.LANDED, "excluded": True, "taken": None}},
        {},
    ),
    Row(
        "on the ground again, nobody knows since when it was taken",
        with_facts(DOWN_AGAIN, taken=None),
        Tick(),
        [Say(Level.INFO, "uav1: landed by its pilot; stays on the ground until included")],
        {"uav1": {"stage": Stage.LANDED, "excluded": True}},
        {},
    ),
    Row(
        "on the ground again without having flown",
        with_facts(DOWN_AGAIN, took_off=False),
        Tick(),
        [Say(Level.INFO, "uav1: disarmed by its pilot on its pad; stays there until included")],
        {"uav1": {"stage": Stage.LANDED, "excluded": True, "taken": None}},
        {"urgent": True, "trigger": "uav1: landed by its pilot", "trigger_s": NOW_S},
    ),
    Row(
        "on the ground away from its pad",
        with_facts(DOWN_AGAIN, fix=STILL),
        Tick(),
        [
            Say(
                Level.FAULT,
                (f"uav1: is on the ground, landed or disarmed by its pilot, down at {OUT_THERE}, disarmed"),
            )
        ],
        {"uav1": {"stage": Stage.DOWN, "excluded": True, "taken": None, "place_told": True}},
        {"urgent": True, "trigger": "uav1: landed by its pilot", "trigger_s": NOW_S},
    ),
    Row(
        "disarmed high over its pad",
        with_facts(DOWN_AGAIN, fix=over_pad(5.1)),
        Tick(),
        [
            Say(
                Level.FAULT,
                f"uav1: disarmed with its pilot; last position {ON_PAD}, 5 m over its home, 0 s ago",
            )
        ],
        {"uav1": {"stage": Stage.DOWN, "excluded": True, "taken": None}},
        {"urgent": True, "trigger": "uav1: disarmed with its pilot", "trigger_s": NOW_S},
    ),
    Row(
        "killed low over its pad",
        with_facts(DOWN_AGAIN, fix=over_pad(2.1), alarm=("Kill engaged", NOW_S - 3.0), on_ground=False),
        Tick(),
        [
            Say(
                Level.FAULT,
                f"uav1: disarmed with its pilot; last position {ON_PAD}, 2 m over its home, 0 s ago",
            )
        ],
        {"uav1": {"stage": Stage.DOWN, "excluded": True, "taken": None}},
        {"urgent": True, "trigger": "uav1: disarmed with its pilot", "trigger_s": NOW_S},
    ),
    Row(
        "killed where it had landed",
        with_facts(DOWN_AGAIN, fix=over_pad(0.1), alarm=("Kill engaged", NOW_S - 3.0), on_ground=True),
        Tick(),
        [Say(Level.INFO, "uav1: landed by its pilot; stays on the ground until included")],
        {"uav1": {"stage": Stage.LANDED, "excluded": True, "taken": None}},
        {"urgent": True, "trigger": "uav1: landed by its pilot", "trigger_s": NOW_S},
    ),
    Row(
        "disarmed on a hill over its pad",
        with_facts(DOWN_AGAIN, fix=over_pad(5.0)),
        Tick(),
        [Say(Level.INFO, "uav1: landed by its pilot; stays on the ground until included")],
        {"uav1": {"stage": Stage.LANDED, "excluded": True, "taken": None}},
        {"urgent": True, "trigger": "uav1: landed by its pilot", "trigger_s": NOW_S},
    ),
    Row(
        "on the ground again without a position",
        with_facts(DOWN_AGAIN, fix=None),
        Tick(),
        [Say(Level.INFO, "uav1: landed by its pilot; stays on the ground until included")],
        {"uav1": {"stage": Stage.LANDED, "excluded": True, "taken": None}},
        {"urgent": True, "trigger": "uav1: landed by its pilot", "trigger_s": NOW_S},
    ),
    Row(
        "taken with everything under way",
        with_facts(TAKES, errand=HomingOrder(NOW_S), held_s=5.0, cleared_s=5.0),
        Tick(),
        [
            Say(
                Level.FAULT, "uav1: with its pilot, mode HOLD; not commanded from here; its segments are kept for 30 s"
            ),
            HandsOff("uav1"),
        ],
        {
            "uav1": {
                "stage": Stage.PILOT,
                "anchor": None,
                "held_s": None,
                "taken": Takeover(NOW_S - 5.0),
                "errand": None,
                "cleared_s": None,
            }
        },
        {},
    ),
    Row(
        "taken with nothing left to fly",
        with_facts(TAKES, waypoint=5),
        Tick(),
        [Say(Level.FAULT, "uav1: with its pilot, mode HOLD; not commanded from here"), HandsOff("uav1")],
        {"uav1": {"stage": Stage.PILOT, "anchor": None, "taken": Takeover(since_s=NOW_S - 5.0, given_away=True)}},
        {},
    ),
    Row(
        "taken in the midst of its start",
        replace(TAKES, stage=Stage.STARTING),
        Tick(),
        [
            Say(
                Level.FAULT, "uav1: with its pilot, mode HOLD; not commanded from here; its segments are kept for 30 s"
            ),
            HandsOff("uav1"),
        ],
        {"uav1": {"stage": Stage.PILOT, "anchor": None, "taken": Takeover(NOW_S - 5.0)}},
        {},
    ),
    Row(
        "taken with a fault",
        replace(TAKES, fault=BATTERY_FAULT, stage=Stage.RETURNING),
        Tick(),
        [Say(Level.FAULT, "uav1: with its pilot, mode HOLD; not commanded from here"), HandsOff("uav1")],
        {"uav1": {"stage": Stage.PILOT, "anchor": None, "taken": Takeover(since_s=NOW_S - 5.0, given_away=True)}},
        {},
    ),
    Row(
        "held for longer than a failsafe holds first",
        replace(with_facts(TAKES, mode_since_s=NOW_S - 15.0), fault=BATTERY_FAULT, stage=Stage.RETURNING),
        Tick(),
        [
            Say(
                Level.FAULT,
                "uav1: mode HOLD for 15 s, by its own failsafe or by its pilot since; not commanded from here",
            ),
            HandsOff("uav1"),
        ],
        {"uav1": {"stage": Stage.PILOT, "anchor": None, "taken": Takeover(since_s=NOW_S - 15.0, given_away=True)}},
        {},
    ),
    Row(
        "taken while a re-plan is solved that counts on it",
        TAKES,
        Tick(),
        [
            Say(
                Level.FAULT, "uav1: with its pilot, mode HOLD; not commanded from here; its segments are kept for 30 s"
            ),
            HandsOff("uav1"),
            CancelSolve(4),
        ],
        {"uav1": {"stage": Stage.PILOT, "anchor": None, "taken": Takeover(NOW_S - 5.0)}},
        {"urgent": True, "trigger": "uav3: gone", "trigger_s": NOW_S - 5.0, "replan": None, "ordered": True},
        {"replan": replace(SOLVING, ordered=True)},
    ),
    Row(
        "taken while a re-plan is solved that does not",
        TAKES,
        Tick(),
        [
            Say(
                Level.FAULT, "uav1: with its pilot, mode HOLD; not commanded from here; its segments are kept for 30 s"
            ),
            HandsOff("uav1"),
        ],
        {"uav1": {"stage": Stage.PILOT, "anchor": None, "taken": Takeover(NOW_S - 5.0)}},
        {},
        {"replan": plan_of(offer_of("uav2"), solve_s=None)},
    ),
    Row(
        "taken while a re-plan goes on board",
        TAKES,
        Tick(),
        [
            Say(
                Level.FAULT, "uav1: with its pilot, mode HOLD; not commanded from here; its segments are kept for 30 s"
            ),
            HandsOff("uav1"),
        ],
        {"uav1": {"stage": Stage.PILOT, "anchor": None, "taken": Takeover(NOW_S - 5.0)}},
        {},
        {"replan": plan_of()},
    ),
    Row(
        "taken by another station's mission",
        flying(carried=FOREIGN, mode_since_s=NOW_S - 50.0),
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
        {"uav1": {"stage": Stage.PILOT, "anchor": None, "cause": ModeCause.PERSON, "taken": Takeover(NOW_S - 3.0)}},
        {},
    ),
    Row(
        "taken in a silence for longer than a failsafe holds",
        UNSEEN,
        Tick(),
        [
            Say(
                Level.FAULT,
                (
                    "uav1: mode HOLD set while there was no link, by its pilot or a failsafe; not commanded from "
                    "here; its segments are kept for 30 s"
                ),
            ),
            HandsOff("uav1"),
        ],
        {"uav1": {"stage": Stage.PILOT, "anchor": None, "taken": Takeover(NOW_S - 5.0)}},
        {},
    ),
    Row(
        "taken in a silence for less",
        with_facts(UNSEEN, unseen_from_boot_s=NOW_S - 19.9),
        Tick(),
        [
            Say(
                Level.FAULT, "uav1: with its pilot, mode HOLD; not commanded from here; its segments are kept for 30 s"
            ),
            HandsOff("uav1"),
        ],
        {"uav1": {"stage": Stage.PILOT, "anchor": None, "taken": Takeover(NOW_S - 5.0)}},
        {},
    ),
    Row(
        "held by what may be its failsafe in a long silence",
        with_facts(UNSEEN, cause=ModeCause.FAILSAFE),
        Tick(),
        [
            Say(
                Level.FAULT,
                (
                    "uav1: mode HOLD set while there was no link, by its pilot or a failsafe; not commanded from "
                    "here; its segments are kept for 30 s"
                ),
            ),
            HandsOff("uav1"),
        ],
        {
            "uav1": {
                "stage": Stage.PILOT,
                "anchor": None,
                "cause": ModeCause.PERSON,
                "certain": True,
                "taken": Takeover(NOW_S - 5.0),
            }
        },
        {},
    ),
    Row(
        "a mode that a later text explains",
        with_facts(TAKES, mode_since_s=NOW_S - 0.5, heartbeat=beat(RTL), **says("Radio Failsafe", NOW_S)),
        Tick(),
        [],
        {"uav1": {"cause": ModeCause.FAILSAFE}},
        {},
    ),
    Row(
        "a mode that a text explains too late",
        with_facts(TAKES, mode_since_s=NOW_S - 4.1, heartbeat=beat(RTL), **says("Radio Failsafe", NOW_S)),
        Tick(),
        [
            Say(Level.FAULT, "uav1: with its pilot, mode RTL; not commanded from here; its segments are kept for 30 s"),
            HandsOff("uav1"),
        ],
        {"uav1": {"stage": Stage.PILOT, "anchor": None, "taken": Takeover(NOW_S - 4.1)}},
        {},
    ),
    Row(
        "a mode that nobody else can have chosen",
        with_facts(TAKES, mode_since_s=NOW_S - 0.5, heartbeat=beat(RTL), **says("Radio Failsafe", NOW_S), certain=True),
        Tick(),
        [],
        {},
        {},
    ),
]


@pytest.mark.parametrize("row", ROWS, ids=[row.what for row in ROWS])
def test_everything_that_comes_of_it(row: Row) -> None:
    assert row.shows() == row.expected()
