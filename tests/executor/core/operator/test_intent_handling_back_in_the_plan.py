"""What a wish to have a vehicle back in the plan leads to: every order, every line, and everything that changes."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import pytest

from executor.core.interface.commands import Level, Resume, Say
from executor.core.interface.intents import Action, Outcome
from executor.core.state.fleet_state import TakeoffOffer
from executor.core.state.vehicle_parts import ModeCause
from executor.core.state.vehicle_state import Stage, VehicleState
from tests.executor.builders import with_facts
from tests.executor.core.steps import (
    BATTERY_FAULT,
    HOLD,
    TAKEN,
    Row,
    beat,
    landed,
    noted,
    wish,
)
from tests.executor.core.vehicles import NOW_S, flying

PILOTS = flying(stage=Stage.PILOT, heartbeat=beat(HOLD), cause=ModeCause.PERSON, taken=TAKEN)
GIVES_BACK = with_facts(PILOTS, heartbeat=beat(), taken=replace(TAKEN, returned_s=NOW_S - 5.0))


def again(**given: Any) -> VehicleState:
    """Return a vehicle on its pad of which all that a flight leaves is still known."""
    left = {
        "fault": BATTERY_FAULT, "stubborn": True, "lands": True, "held_s": 5.0,
        "watches": (("mode", 5.0),),
        "alarm": ("crash", 5.0), "failures": 2, "armed_once": True, "taken": TAKEN, "excluded": True,
    }  # fmt: skip
    return landed(stage=Stage.LANDED, **{**left, **given})


ROWS = [
    Row(
        "back in the plan on the ground",
        again(),
        wish(Action.INCLUDE, confirmed=True),
        [Say(Level.INFO, "page asks: include uav1; included; re-planning with it")],
        {
            "uav1": {
                "stage": Stage.GROUND,
                "armed_once": False,
                "fault": None,
                "stubborn": False,
                "failures": 0,
                "alarm": ("", -math.inf),
                "held_s": None,
                "excluded": False,
                "lands": False,
                "taken": None,
                "cleared_s": NOW_S,
            }
        },
        {
            "given_up": frozenset(),
            "urgent": True,
            "trigger": "uav1: back in service with 90 % in its battery",
            "trigger_s": NOW_S,
            "considered": frozenset({"uav2"}),
            "intents": {
                "wish": noted(
                    Action.INCLUDE,
                    Outcome.DONE,
                    "included; re-planning with it",
                    ended_s=NOW_S,
                    confirmed=True,
                )
            },
            "mended": (("uav1", BATTERY_FAULT),),
            "offers_over": False,
        },
        {"considered": frozenset({"uav1", "uav2"}), "given_up": frozenset({4}), "offers_over": True},
    ),
    Row(
        "back in the plan on the ground, well",
        again(fault=None),
        wish(Action.INCLUDE, confirmed=True),
        [Say(Level.INFO, "page asks: include uav1; included; re-planning with it")],
        {
            "uav1": {
                "stage": Stage.GROUND,
                "armed_once": False,
                "stubborn": False,
                "failures": 0,
                "alarm": ("", -math.inf),
                "held_s": None,
                "excluded": False,
                "lands": False,
                "taken": None,
                "cleared_s": NOW_S,
            }
        },
        {
            "urgent": True,
            "trigger": "uav1: back in service with 90 % in its battery",
            "trigger_s": NOW_S,
            "intents": {
                "wish": noted(
                    Action.INCLUDE,
                    Outcome.DONE,
                    "included; re-planning with it",
                    ended_s=NOW_S,
                    confirmed=True,
                )
            },
        },
        {"offer": TakeoffOffer(("uav1",), (4,), 5.0)},
    ),
    Row(
        "back in the plan, one of two that were offered",
        again(fault=None),
        wish(Action.INCLUDE, confirmed=True),
        [Say(Level.INFO, "page asks: include uav1; included; re-planning with it")],
        {
            "uav1": {
                "stage": Stage.GROUND,
                "armed_once": False,
                "stubborn": False,
                "failures": 0,
                "alarm": ("", -math.inf),
                "held_s": None,
                "excluded": False,
                "lands": False,
                "taken": None,
                "cleared_s": NOW_S,
            }
        },
        {
            "urgent": True,
            "trigger": "uav1: back in service with 90 % in its battery",
            "trigger_s": NOW_S,
            "wait_until_s": NOW_S + 15.0,
            "intents": {
                "wish": noted(
                    Action.INCLUDE,
                    Outcome.DONE,
                    "included; re-planning with it",
                    ended_s=NOW_S,
                    confirmed=True,
                )
            },
        },
        {"offer": TakeoffOffer(("uav1", "uav2"), (4,), 5.0)},
    ),
    Row(
        "back in the plan, one of two, while there is a longer wait",
        again(fault=None),
        wish(Action.INCLUDE, confirmed=True),
        [Say(Level.INFO, "page asks: include uav1; included; re-planning with it")],
        {
            "uav1": {
                "stage": Stage.GROUND,
                "armed_once": False,
                "stubborn": False,
                "failures": 0,
                "alarm": ("", -math.inf),
                "held_s": None,
                "excluded": False,
                "lands": False,
                "taken": None,
                "cleared_s": NOW_S,
            }
        },
        {
            "urgent": True,
            "trigger": "uav1: back in service with 90 % in its battery",
            "trigger_s": NOW_S,
            "intents": {
                "wish": noted(
                    Action.INCLUDE,
                    Outcome.DONE,
                    "included; re-planning with it",
                    ended_s=NOW_S,
                    confirmed=True,
                )
            },
        },
        {"offer": TakeoffOffer(("uav1", "uav2"), (4,), 5.0), "wait_until_s": NOW_S + 60.0},
    ),
    Row(
        "back in the plan with nothing to do",
        again(fault=None),
        wish(Action.INCLUDE, confirmed=True),
        [
            Say(
                Level.INFO,
                ("page asks: include uav1; included. Nothing is unassigned; use re-plan to redistribute"),
            )
        ],
        {
            "uav1": {
                "stage": Stage.GROUND,
                "armed_once": False,
                "stubborn": False,
                "failures": 0,
                "alarm": ("", -math.inf),
                "held_s": None,
                "excluded": False,
                "lands": False,
                "taken": None,
                "cleared_s": NOW_S,
            }
        },
        {
            "urgent": True,
            "trigger": "uav1: back in service with 90 % in its battery",
            "trigger_s": NOW_S,
            "intents": {
                "wish": noted(
                    Action.INCLUDE,
                    Outcome.DONE,
                    "included. Nothing is unassigned; use re-plan to redistribute",
                    ended_s=NOW_S,
                    confirmed=True,
                )
            },
        },
        {"inspected": dict.fromkeys(range(6), "uav2")},
    ),
    Row(
        "back in the plan from its pilot",
        GIVES_BACK,
        wish(Action.INCLUDE),
        [
            Say(Level.INFO, "page asks: include uav1; included"),
            Say(Level.INFO, "uav1: is back in the plan, from its pilot"),
            Resume(vehicle="uav1", speed_m_s=3.0),
        ],
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
        {"intents": {"wish": noted(Action.INCLUDE, Outcome.DONE, "included", ended_s=NOW_S)}},
    ),
    Row(
        "back in the plan from its pilot, its work given away",
        with_facts(GIVES_BACK, taken=replace(TAKEN, returned_s=NOW_S - 5.0, given_away=True)),
        wish(Action.INCLUDE),
        [
            Say(Level.INFO, "page asks: include uav1; included"),
            Say(Level.INFO, "uav1: is back in the plan, from its pilot"),
            Resume(vehicle="uav1", speed_m_s=3.0),
        ],
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
        {
            "trigger": "uav1: is back in the plan",
            "trigger_s": NOW_S,
            "intents": {"wish": noted(Action.INCLUDE, Outcome.DONE, "included", ended_s=NOW_S)},
            "ordered": True,
        },
    ),
]


@pytest.mark.parametrize("row", ROWS, ids=[row.what for row in ROWS])
def test_everything_that_comes_of_it(row: Row) -> None:
    assert row.shows() == row.expected()
