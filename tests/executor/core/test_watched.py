"""Watching vehicles that somebody else flies, message by message."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import pytest

from executor.core.events import Heard, Tick
from executor.core.faults import passive
from executor.core.faults.passive import Declared, Degraded, Finding, Watched
from executor.core.messages import FlightMessage, MissionCurrent
from executor.core.parts import Watch
from executor.core.state import Absence
from executor.core.vehicle import Fault, FaultCode, FaultKind, Stage, VehicleState
from tests.executor.builders import with_facts
from tests.executor.core.faults.test_watchpoints import DISARMED, FLEET, NOW_S, RTL, at, flying
from tests.executor.core.steps import (
    BATTERY_FAULT,
    FAILS,
    HOMEWARD,
    LOW,
    SECOND,
    TERMINATED,
    beat,
    changes,
    differences,
    flight_of,
    landed,
    rounded,
)

SCENE = FLEET.context
IDLE = flying(stage=Stage.GROUND, heartbeat=DISARMED, armed_once=False)


def watched(*vehicles: VehicleState, **given: Any) -> Watched:
    told = {name: given.pop(name) for name in ("open", "warned_s") if name in given}
    state = flight_of(*vehicles, **given)
    there = {one.name: one for one in vehicles}
    return replace(Watched(replace(state, vehicles=there)), **told)


def seen(before: Watched, of: tuple[Watched, tuple[Finding, ...]]) -> tuple[object, ...]:
    """Return what was found, what changed of each vehicle and of the flight, and what is open."""
    after, found = of
    return (found, *differences(before.fleet, after.fleet), changes(before, replace(after, fleet=before.fleet)))


def heard(one: VehicleState, message: FlightMessage, **given: Any) -> tuple[object, ...]:
    before = watched(one, **given)
    return seen(before, passive.passive_step(SCENE, before, Heard("uav1", message), NOW_S))


def ticked(*vehicles: VehicleState, **given: Any) -> tuple[object, ...]:
    before = watched(*vehicles, **given)
    return seen(before, passive.passive_step(SCENE, before, Tick(), NOW_S))


LOST = flying(
    stage=Stage.LOST,
    fault=Fault(FaultKind.LINK, "why", 5.0, FaultCode.LINK_LOST),
    heard_s=NOW_S - 50.0,
    spoke_s=NOW_S - 50.0,
)
ONCE = Degraded("uav1", FaultKind.LINK, "silence", "no message for 4.0 s", NOW_S - 9.0)


ROWS: list[tuple[str, Callable[[], object], object]] = [
    ("it is there", lambda: passive.watch_begun(("a", "b")).fleet.vehicles["b"], VehicleState(name="b")),
    (
        "another one is there",
        lambda: sorted(passive.with_vehicle(passive.watch_begun(("a",)), "b").fleet.vehicles),
        ["a", "b"],
    ),
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
                watches=(("mode", Watch(5.0)),),
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
        lambda: heard(replace(LOST, watches=(("link", Watch(5.0)),)), beat()),
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
                    "stage": Stage.RETURNING,
                    "heard_s": NOW_S,
                    "spoke_s": NOW_S,
                    "heartbeat": beat(RTL),
                    "mode_since_s": NOW_S,
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
        "one with a fault is on the ground",
        lambda: heard(flying(**HOMEWARD, fault=BATTERY_FAULT, took_off=False), beat(RTL, armed=False)),
        (
            (),
            {
                "uav1": {
                    "stage": Stage.LANDED,
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
        "one with a fault is on the ground, in its mission's mode",
        lambda: heard(flying(fault=BATTERY_FAULT, took_off=False), beat(armed=False)),
        (
            (),
            {
                "uav1": {
                    "stage": Stage.LANDED,
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
        "one on its mission says that it is disarmed",
        lambda: heard(flying(took_off=False), beat(armed=False)),
        (
            (),
            {"uav1": {"spoke_s": NOW_S, "heartbeat": beat(armed=False), "disarmed_s": NOW_S, "beat_boot_s": NOW_S}},
            {},
            {},
        ),
    ),
    (
        "a look at one that flies well",
        lambda: ticked(flying(), warned_s=NOW_S - 1.5),
        ((), {}, {}, {"warned_s": NOW_S}),
    ),
    (
        "a look so soon after another finds no warning",
        lambda: ticked(flying(heard_s=NOW_S - 2.9), SECOND, warned_s=NOW_S - 1.4),
        ((), {}, {}, {}),
    ),
    (
        "a look at one that falls silent",
        lambda: ticked(flying(heard_s=NOW_S - 3.0, spoke_s=NOW_S - 3.0), SECOND, warned_s=NOW_S - 1.4),
        (
            (),
            {},
            {},
            {
                "open": {
                    ("uav1", "silent"): replace(ONCE, reason="silent", evidence="no message for 3.0 s", from_s=NOW_S)
                },
                "warned_s": NOW_S,
            },
        ),
    ),
    (
        "a look at one that falls silent on its way home",
        lambda: ticked(flying(**HOMEWARD, heard_s=NOW_S - 3.0), SECOND, warned_s=NOW_S - 1.4),
        ((), {}, {}, {}),
    ),
    (
        "a look at one that is lost",
        lambda: ticked(flying(heard_s=NOW_S - 10.0), SECOND),
        (
            (
                Declared(
                    vehicle="uav1",
                    kind=FaultKind.LINK,
                    reason="link",
                    evidence="link lost for 10.0 s, time-out 10 s",
                    at_s=NOW_S,
                ),
            ),
            {
                "uav1": {
                    "stage": Stage.LOST,
                    "fault": Fault(FaultKind.LINK, "link lost for 10.0 s, time-out 10 s", NOW_S, FaultCode.LINK_LOST),
                }
            },
            {},
            {
                "open": {
                    ("uav1", "silent"): replace(ONCE, reason="silent", evidence="no message for 10.0 s", from_s=NOW_S)
                },
                "warned_s": NOW_S,
            },
        ),
    ),
    (
        "a look at one that was lost before",
        lambda: ticked(LOST, SECOND, open={("uav1", "silence"): ONCE}),
        ((), {}, {}, {"warned_s": NOW_S}),
    ),
    (
        "a look at both that are lost",
        lambda: ticked(flying(heard_s=NOW_S - 10.0), with_facts(SECOND, heard_s=NOW_S - 10.0)),
        (
            (),
            {},
            {"silent_since_s": NOW_S - 10.0},
            {
                "open": {
                    ("uav1", "silent"): replace(ONCE, reason="silent", evidence="no message for 10.0 s", from_s=NOW_S),
                    ("uav2", "silent"): Degraded(
                        vehicle="uav2",
                        kind=FaultKind.LINK,
                        reason="silent",
                        evidence="no message for 10.0 s",
                        from_s=NOW_S,
                    ),
                },
                "warned_s": NOW_S,
            },
        ),
    ),
    (
        "a look at both that are lost for long",
        lambda: ticked(
            flying(heard_s=NOW_S - 60.0), with_facts(SECOND, heard_s=NOW_S - 60.0), silent_since_s=NOW_S - 60.0
        ),
        (
            (
                Declared(
                    vehicle="uav1",
                    kind=FaultKind.LINK,
                    reason="link",
                    evidence="link lost for 60.0 s, time-out 10 s",
                    at_s=NOW_S,
                ),
                Declared(
                    vehicle="uav2",
                    kind=FaultKind.LINK,
                    reason="link",
                    evidence="link lost for 60.0 s, time-out 10 s",
                    at_s=NOW_S,
                ),
            ),
            {
                "uav1": {
                    "stage": Stage.LOST,
                    "fault": Fault(FaultKind.LINK, "link lost for 60.0 s, time-out 10 s", NOW_S, FaultCode.LINK_LOST),
                },
                "uav2": {
                    "stage": Stage.LOST,
                    "fault": Fault(FaultKind.LINK, "link lost for 60.0 s, time-out 10 s", NOW_S, FaultCode.LINK_LOST),
                },
            },
            {"silence_told_s": NOW_S},
            {
                "open": {
                    ("uav1", "silent"): replace(ONCE, reason="silent", evidence="no message for 60.0 s", from_s=NOW_S),
                    ("uav2", "silent"): Degraded(
                        vehicle="uav2",
                        kind=FaultKind.LINK,
                        reason="silent",
                        evidence="no message for 60.0 s",
                        from_s=NOW_S,
                    ),
                },
                "warned_s": NOW_S,
            },
        ),
    ),
    (
        "a look at both that are lost for less",
        lambda: ticked(
            flying(heard_s=NOW_S - 59.9), with_facts(SECOND, heard_s=NOW_S - 59.9), silent_since_s=NOW_S - 59.9
        ),
        (
            (),
            {},
            {},
            {
                "open": {
                    ("uav1", "silent"): replace(ONCE, reason="silent", evidence="no message for 59.9 s", from_s=NOW_S),
                    ("uav2", "silent"): Degraded(
                        vehicle="uav2",
                        kind=FaultKind.LINK,
                        reason="silent",
                        evidence="no message for 59.9 s",
                        from_s=NOW_S,
                    ),
                },
                "warned_s": NOW_S,
            },
        ),
    ),
    (
        "a look at the only one that is silent",
        lambda: ticked(flying(heard_s=NOW_S - 10.0)),
        (
            (
                Declared(
                    vehicle="uav1",
                    kind=FaultKind.LINK,
                    reason="link",
                    evidence="link lost for 10.0 s, time-out 10 s",
                    at_s=NOW_S,
                ),
            ),
            {
                "uav1": {
                    "stage": Stage.LOST,
                    "fault": Fault(FaultKind.LINK, "link lost for 10.0 s, time-out 10 s", NOW_S, FaultCode.LINK_LOST),
                }
            },
            {},
            {
                "open": {
                    ("uav1", "silent"): replace(ONCE, reason="silent", evidence="no message for 10.0 s", from_s=NOW_S)
                },
                "warned_s": NOW_S,
            },
        ),
    ),
    (
        "a look at one that fails",
        lambda: ticked(FAILS),
        (
            (
                Declared(
                    vehicle="uav1",
                    kind=FaultKind.INTERRUPTION,
                    reason="terminated",
                    evidence="reports that its flight is terminated",
                    at_s=NOW_S,
                ),
            ),
            {"uav1": {"stage": Stage.RETURNING, "fault": TERMINATED}},
            {},
            {"warned_s": NOW_S},
        ),
    ),
    (
        "a look at one that fails and is not armed",
        lambda: ticked(with_facts(FAILS, heartbeat=beat(armed=False, status=8))),
        (
            (
                Declared(
                    vehicle="uav1",
                    kind=FaultKind.INTERRUPTION,
                    reason="off-pad",
                    evidence="disarmed 300 m from its pad, 20 m high",
                    at_s=NOW_S,
                ),
            ),
            {
                "uav1": {
                    "stage": Stage.LANDED,
                    "fault": Fault(
                        FaultKind.INTERRUPTION, "disarmed 300 m from its pad, 20 m high", NOW_S, FaultCode.DISARMED
                    ),
                }
            },
            {},
            {"warned_s": NOW_S},
        ),
    ),
    (
        "a look at one that fails again",
        lambda: ticked(replace(FAILS, fault=BATTERY_FAULT, stage=Stage.RETURNING)),
        ((), {}, {}, {"warned_s": NOW_S}),
    ),
    (
        "a look at one with a fault that is lost",
        lambda: ticked(flying(**HOMEWARD, fault=BATTERY_FAULT, heard_s=NOW_S - 10.0), SECOND),
        (
            (),
            {"uav1": {"stage": Stage.LOST}},
            {},
            {
                "open": {
                    ("uav1", "silent"): replace(ONCE, reason="silent", evidence="no message for 10.0 s", from_s=NOW_S)
                },
                "warned_s": NOW_S,
            },
        ),
    ),
    (
        "a look at one that was lost and is lost again",
        lambda: ticked(
            flying(
                stage=Stage.RETURNING,
                fault=Fault(FaultKind.LINK, "why", 5.0, FaultCode.LINK_LOST),
                heard_s=NOW_S - 10.0,
            ),
            SECOND,
        ),
        (
            (
                Declared(
                    vehicle="uav1",
                    kind=FaultKind.LINK,
                    reason="link",
                    evidence="link lost for 10.0 s, time-out 10 s",
                    at_s=NOW_S,
                ),
            ),
            {"uav1": {"stage": Stage.LOST}},
            {},
            {
                "open": {
                    ("uav1", "silent"): replace(ONCE, reason="silent", evidence="no message for 10.0 s", from_s=NOW_S)
                },
                "warned_s": NOW_S,
            },
        ),
    ),
    (
        "a look at one that has landed",
        lambda: ticked(landed(fault=None)),
        ((), {"uav1": {"stage": Stage.LANDED}}, {}, {"warned_s": NOW_S}),
    ),
    (
        "a look at one that has landed before",
        lambda: ticked(landed(stage=Stage.LANDED)),
        ((), {}, {}, {"warned_s": NOW_S}),
    ),
    (
        "a look at one on the ground ends what was not well",
        lambda: ticked(landed(stage=Stage.LANDED), open={("uav1", "silence"): ONCE}),
        ((replace(ONCE, to_s=NOW_S),), {}, {}, {"open": {}, "warned_s": NOW_S}),
    ),
    (
        "a look after a pause of our own",
        lambda: ticked(flying(heard_s=NOW_S - 9.0), SECOND, tick_s=NOW_S - 9.0),
        (
            (),
            {"uav1": {"heard_s": NOW_S, "excused_s": NOW_S}, "uav2": {"excused_s": NOW_S}},
            {"absences": (Absence(until_s=NOW_S, pause_s=9.0, restarted=False),)},
            {"warned_s": NOW_S},
        ),
    ),
    (
        "a warning begins",
        lambda: ticked(flying(fix=at(age_s=5.0))),
        (
            (),
            {},
            {},
            {
                "open": {
                    ("uav1", "positions"): Degraded(
                        vehicle="uav1",
                        kind=FaultKind.INTERRUPTION,
                        reason="positions",
                        evidence="no position for 5 s, while other messages come",
                        from_s=NOW_S,
                    )
                },
                "warned_s": NOW_S,
            },
        ),
    ),
    (
        "a warning lasts",
        lambda: ticked(flying(fix=at(age_s=5.0)), open={("uav1", "positions"): replace(ONCE, reason="positions")}),
        ((), {}, {}, {"warned_s": NOW_S}),
    ),
    (
        "a warning ends",
        lambda: ticked(
            flying(),
            SECOND,
            open={
                ("uav1", "positions"): replace(ONCE, reason="positions"),
                ("uav2", "silence"): replace(ONCE, vehicle="uav2"),
            },
        ),
        (
            (replace(ONCE, reason="positions", to_s=NOW_S), replace(ONCE, vehicle="uav2", to_s=NOW_S)),
            {},
            {},
            {"open": {}, "warned_s": NOW_S},
        ),
    ),
    (
        "what was not well at the end",
        lambda: passive.closed(watched(flying(), open={("uav1", "silence"): ONCE}), NOW_S),
        (replace(ONCE, to_s=NOW_S),),
    ),
    (
        "something was heard",
        lambda: seen(
            watched(flying(heard_s=5.0)), (passive.passive_heard(watched(flying(heard_s=5.0)), "uav1", 6.0), ())
        ),
        ((), {"uav1": {"heard_s": 6.0}}, {}, {}),
    ),
    (
        "something was heard before",
        lambda: [
            seen(watched(flying(heard_s=5.0)), (passive.passive_heard(watched(flying(heard_s=5.0)), "uav1", at_s), ()))
            for at_s in (5.0, 4.0)
        ],
        [((), {}, {}, {}), ((), {}, {}, {})],
    ),
    (
        "something was heard for the first time",
        lambda: seen(
            watched(flying(heard_s=None)), (passive.passive_heard(watched(flying(heard_s=None)), "uav1", 6.0), ())
        ),
        ((), {"uav1": {"heard_s": 6.0}}, {}, {}),
    ),
    (
        "a HEARTBEAT without news",
        lambda: [
            seen(
                watched(flying(heard_s=5.0)),
                (passive.passive_heard(watched(flying(heard_s=5.0)), "uav1", at_s, at_s), ()),
            )
            for at_s in (6.0, 4.0)
        ],
        [((), {"uav1": {"heard_s": 6.0, "heartbeat_s": 6.0}}, {}, {}), ((), {"uav1": {"heartbeat_s": 4.0}}, {}, {})],
    ),
]


@pytest.mark.parametrize(("what", "found", "expected"), ROWS, ids=[row[0] for row in ROWS])
def test_everything_that_comes_of_it(what: str, found: Callable[[], object], expected: object) -> None:
    assert rounded(found()) == expected
