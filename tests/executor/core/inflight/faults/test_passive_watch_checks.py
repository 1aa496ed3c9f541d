"""Watching vehicles flown by other parties, check by check."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import pytest

from executor.core.inflight.faults import passive_watch
from executor.core.inflight.faults.passive_watch import DeclaredFault, Degradation, VehicleReports
from executor.core.interface.events import Tick
from executor.core.state.fleet_state import GroundStationAbsence
from executor.core.state.vehicle_state import Fault, FaultCode, FaultKind, Stage, VehicleState
from tests.executor.builders import with_facts
from tests.executor.core.inflight.faults.passive_flights import LOST, seen, watched
from tests.executor.core.steps import (
    BATTERY_FAULT,
    FAILS,
    HOMEWARD,
    SECOND,
    TERMINATED,
    beat,
    landed,
    rounded,
)
from tests.executor.core.vehicles import FLEET, NOW_S, at, flying

SCENE = FLEET.context


def ticked(*vehicles: VehicleState, **given: Any) -> tuple[object, ...]:
    before = watched(*vehicles, **given)
    return seen(before, passive_watch.step_watch(SCENE, before, Tick(), NOW_S))


ONCE = Degradation("uav1", FaultKind.LINK, "silence", "no message for 4.0 s", NOW_S - 9.0)

TOLD = {name: VehicleReports(mode_s=0.0) for name in ("uav1", "uav2")}
LINK_TOLD = VehicleReports(declared=frozenset({"link"}), mode_s=0.0)
DOWN_TOLD = VehicleReports(declared=frozenset({"down"}), mode_s=0.0)


ROWS: list[tuple[str, Callable[[], object], object]] = [
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
                DeclaredFault(
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
                "told": TOLD | {"uav1": LINK_TOLD},
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
                    ("uav2", "silent"): Degradation(
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
                DeclaredFault(
                    vehicle="uav1",
                    kind=FaultKind.LINK,
                    reason="link",
                    evidence="link lost for 60.0 s, time-out 10 s",
                    at_s=NOW_S,
                ),
                DeclaredFault(
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
                    ("uav2", "silent"): Degradation(
                        vehicle="uav2",
                        kind=FaultKind.LINK,
                        reason="silent",
                        evidence="no message for 60.0 s",
                        from_s=NOW_S,
                    ),
                },
                "warned_s": NOW_S,
                "told": {"uav1": LINK_TOLD, "uav2": LINK_TOLD},
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
                    ("uav2", "silent"): Degradation(
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
                DeclaredFault(
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
                "told": {"uav1": LINK_TOLD},
            },
        ),
    ),
    (
        "a look at one that fails",
        lambda: ticked(FAILS),
        (
            (
                DeclaredFault(
                    vehicle="uav1",
                    kind=FaultKind.INTERRUPTION,
                    reason="terminated",
                    evidence="reports that its flight is terminated",
                    at_s=NOW_S,
                ),
            ),
            {"uav1": {"fault": TERMINATED}},
            {},
            {"warned_s": NOW_S, "told": {"uav1": DOWN_TOLD}},
        ),
    ),
    (
        "a look at one that fails and is not armed",
        lambda: ticked(with_facts(FAILS, heartbeat=beat(armed=False, status=8))),
        (
            (
                DeclaredFault(
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
            {"warned_s": NOW_S, "told": {"uav1": DOWN_TOLD}},
        ),
    ),
    (
        "a look at one that fails in another way",
        lambda: ticked(replace(FAILS, fault=BATTERY_FAULT)),
        (
            (
                DeclaredFault(
                    vehicle="uav1",
                    kind=FaultKind.INTERRUPTION,
                    reason="terminated",
                    evidence="reports that its flight is terminated",
                    at_s=NOW_S,
                ),
            ),
            {},
            {},
            {"warned_s": NOW_S, "told": {"uav1": DOWN_TOLD}},
        ),
    ),
    (
        "a look at one that fails in a way that was told",
        lambda: ticked(replace(FAILS, fault=TERMINATED), told={"uav1": DOWN_TOLD}),
        ((), {}, {}, {"warned_s": NOW_S}),
    ),
    (
        "a look at one with a fault that is lost",
        lambda: ticked(flying(**HOMEWARD, fault=BATTERY_FAULT, heard_s=NOW_S - 10.0), SECOND),
        (
            (
                DeclaredFault(
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
                "told": TOLD | {"uav1": LINK_TOLD},
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
                DeclaredFault(
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
                "told": TOLD | {"uav1": LINK_TOLD},
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
            {"absences": (GroundStationAbsence(until_s=NOW_S, pause_s=9.0, restarted=False),)},
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
                    ("uav1", "positions"): Degradation(
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
]


@pytest.mark.parametrize(("what", "found", "expected"), ROWS, ids=[row[0] for row in ROWS])
def test_everything_that_comes_of_it(what: str, found: Callable[[], object], expected: object) -> None:
    assert rounded(found()) == expected
