"""Watching vehicles flown by other parties, message by message."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import pytest

from executor.core.inflight.faults import passive_watch
from executor.core.inflight.faults.passive_watch import Degradation
from executor.core.interface.events import Heard
from executor.core.interface.messages import FlightMessage, MissionCurrent
from executor.core.state.vehicle_state import FaultKind, Stage, VehicleState
from tests.executor.core.inflight.faults.passive_flights import LOST, seen, watched
from tests.executor.core.steps import (
    BATTERY_FAULT,
    HOMEWARD,
    LOW,
    beat,
    landed,
    rounded,
)
from tests.executor.core.vehicles import DISARMED, FLEET, NOW_S, RTL, flying

SCENE = FLEET.context
IDLE = flying(stage=Stage.GROUND, heartbeat=DISARMED, armed_once=False)


def heard(one: VehicleState, message: FlightMessage, **given: Any) -> tuple[object, ...]:
    before = watched(one, **given)
    return seen(before, passive_watch.step_watch(SCENE, before, Heard("uav1", message), NOW_S))


ONCE = Degradation("uav1", FaultKind.LINK, "silence", "no message for 4.0 s", NOW_S - 9.0)

ROWS: list[tuple[str, Callable[[], object], object]] = [
    ("no vehicle present", lambda: dict(passive_watch.PassiveWatch().fleet.vehicles), {}),
    (
        "it arms",
        lambda: heard(IDLE, beat(), launched_s=None),
        (
            (),
            {
                "uav1": {
                    "stage": Stage.FLYING,
                    "spoke_s": NOW_S,
                    "heartbeat": beat(),
                    "armed_once": True,
                    "anchor": None,
                    "took_off": False,
                    "beat_boot_s": NOW_S,
                }
            },
            {"launched_s": NOW_S},
            {},
        ),
    ),
    (
        "it arms again",
        lambda: heard(
            landed(
                stage=Stage.LANDED,
                fault=BATTERY_FAULT,
                flew_mission=True,
                watches=(("mode", 5.0),),
                alarm=("crash", 5.0),
                anchor=LOW,
            ),
            beat(),
        ),
        (
            (),
            {
                "uav1": {
                    "stage": Stage.FLYING,
                    "spoke_s": NOW_S,
                    "heartbeat": beat(),
                    "anchor": None,
                    "fault": None,
                    "took_off": False,
                    "alarm": ("", -math.inf),
                    "flew_mission": False,
                    "beat_boot_s": NOW_S,
                }
            },
            {},
            {},
        ),
    ),
    (
        "it stands",
        lambda: heard(IDLE, beat(armed=False), launched_s=None),
        ((), {"uav1": {"spoke_s": NOW_S, "heartbeat": beat(armed=False), "beat_boot_s": NOW_S}}, {}, {}),
    ),
    (
        "it flies on",
        lambda: heard(flying(), beat()),
        ((), {"uav1": {"spoke_s": NOW_S, "flew_mission": True, "beat_boot_s": NOW_S}}, {}, {}),
    ),
    (
        "it says another thing",
        lambda: heard(IDLE, MissionCurrent(3, None, None)),
        ((), {"uav1": {"spoke_s": NOW_S, "item": (3, None)}}, {}, {}),
    ),
    (
        "a lost one flies on",
        lambda: heard(replace(LOST, watches=(("link", 5.0),)), beat()),
        (
            (),
            {
                "uav1": {
                    "stage": Stage.FLYING,
                    "heard_s": NOW_S,
                    "spoke_s": NOW_S,
                    "anchor": None,
                    "fault": None,
                    "flew_mission": True,
                    "regained_s": NOW_S,
                    "unseen_until_s": NOW_S,
                    "beat_boot_s": NOW_S,
                }
            },
            {},
            {},
        ),
    ),
    (
        "a lost one comes home",
        lambda: heard(LOST, beat(RTL)),
        (
            (),
            {
                "uav1": {
                    "stage": Stage.FLYING,
                    "fault": None,
                    "anchor": None,
                    "heard_s": NOW_S,
                    "spoke_s": NOW_S,
                    "heartbeat": beat(RTL),
                    "mode_since_s": NOW_S,
                    "mode_before_s": NOW_S,
                    "mode_before": 3,
                    "regained_s": NOW_S,
                    "unseen_until_s": NOW_S,
                    "beat_boot_s": NOW_S,
                }
            },
            {},
            {},
        ),
    ),
    (
        "a lost one is on the ground",
        lambda: heard(LOST, beat(armed=False)),
        (
            (),
            {
                "uav1": {
                    "stage": Stage.FLYING,
                    "heard_s": NOW_S,
                    "spoke_s": NOW_S,
                    "anchor": None,
                    "fault": None,
                    "regained_s": NOW_S,
                    "doubted": (beat(armed=False), NOW_S),
                }
            },
            {},
            {},
        ),
    ),
    (
        "a vehicle at fault reports itself disarmed",
        lambda: heard(flying(**HOMEWARD, fault=BATTERY_FAULT, took_off=False), beat(RTL, armed=False)),
        (
            (),
            {
                "uav1": {
                    "spoke_s": NOW_S,
                    "heartbeat": beat(RTL, armed=False),
                    "disarmed_s": NOW_S,
                    "beat_boot_s": NOW_S,
                }
            },
            {},
            {},
        ),
    ),
    (
        "a vehicle at fault reports itself disarmed, in mission mode",
        lambda: heard(flying(fault=BATTERY_FAULT, took_off=False), beat(armed=False)),
        (
            (),
            {
                "uav1": {
                    "spoke_s": NOW_S,
                    "heartbeat": beat(armed=False),
                    "disarmed_s": NOW_S,
                    "beat_boot_s": NOW_S,
                }
            },
            {},
            {},
        ),
    ),
    (
        "a vehicle on its mission reports itself disarmed",
        lambda: heard(flying(took_off=False), beat(armed=False)),
        (
            (),
            {"uav1": {"spoke_s": NOW_S, "heartbeat": beat(armed=False), "disarmed_s": NOW_S, "beat_boot_s": NOW_S}},
            {},
            {},
        ),
    ),
    (
        "degradations at the end of a log",
        lambda: passive_watch.close_degradations(watched(flying(), open={("uav1", "silence"): ONCE}), NOW_S),
        (replace(ONCE, to_s=NOW_S),),
    ),
    (
        "something was heard",
        lambda: seen(
            watched(flying(heard_s=5.0)), (passive_watch.record_contact(watched(flying(heard_s=5.0)), "uav1", 6.0), ())
        ),
        ((), {"uav1": {"heard_s": 6.0}}, {}, {}),
    ),
    (
        "something was heard before",
        lambda: [
            seen(
                watched(flying(heard_s=5.0)),
                (passive_watch.record_contact(watched(flying(heard_s=5.0)), "uav1", at_s), ()),
            )
            for at_s in (5.0, 4.0)
        ],
        [((), {}, {}, {}), ((), {}, {}, {})],
    ),
    (
        "something was heard for the first time",
        lambda: seen(
            watched(flying(heard_s=None)),
            (passive_watch.record_contact(watched(flying(heard_s=None)), "uav1", 6.0), ()),
        ),
        ((), {"uav1": {"heard_s": 6.0}}, {}, {}),
    ),
    (
        "a HEARTBEAT without news",
        lambda: [
            seen(
                watched(flying(heard_s=5.0)),
                (passive_watch.record_contact(watched(flying(heard_s=5.0)), "uav1", at_s, at_s), ()),
            )
            for at_s in (6.0, 4.0)
        ],
        [((), {"uav1": {"heard_s": 6.0, "heartbeat_s": 6.0}}, {}, {}), ((), {"uav1": {"heartbeat_s": 4.0}}, {}, {})],
    ),
]


@pytest.mark.parametrize(("what", "found", "expected"), ROWS, ids=[row[0] for row in ROWS])
def test_everything_that_comes_of_it(what: str, found: Callable[[], object], expected: object) -> None:
    assert rounded(found()) == expected
