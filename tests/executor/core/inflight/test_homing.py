"""The right command for a vehicle that should return."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import pytest

from executor.core.inflight import homing
from executor.core.interface.messages import Heartbeat
from executor.core.state.vehicle_parts import HomingOrder, ModeCause
from executor.core.state.vehicle_state import Fault, FaultCode, FaultKind
from tests.executor.builders import fleet_of, with_facts
from tests.executor.core.steps import HOLD, HOMEWARD, LAND, TAKEN, beat, over_pad, rounded
from tests.executor.core.vehicles import AUTO, DISARMED, FLEET, NOW_S, RTL, at, flying, says

CONTEXT = FLEET.context
COMES = flying(**{**HOMEWARD, "heartbeat": beat()}, errand=HomingOrder(NOW_S))


def advice(**given: Any) -> str:
    """Return what is to be done, and why."""
    return ": ".join(homing.advise_homing(CONTEXT, with_facts(COMES, **given), NOW_S))


SINKS = Fault(FaultKind.INTERRUPTION, "sinks", NOW_S - 1.0, FaultCode.SINKING)
WEAK = "leave: cannot hold height and RTL begins with a climb, not commanded: its pilot may land it"
SELF = "leave: returning or landing by itself, not commanded"
ROWS: list[tuple[str, Callable[[], object], object]] = [
    ("the way home", lambda: advice(waypoint=2), "return: "),
    (
        "a pilot's",
        lambda: [
            advice(taken=TAKEN),
            advice(cause=ModeCause.PERSON),
            advice(cause=ModeCause.PERSON, heartbeat=DISARMED),
        ],
        [
            "leave: with its pilot, not commanded",
            "leave: with its pilot, not commanded",
            "return: ",
        ],
    ),
    (
        "an order to land",
        lambda: [
            advice(errand=HomingOrder(NOW_S, land=True)),
            advice(errand=HomingOrder(NOW_S, land=True), heartbeat=beat(RTL)),
        ],
        ["land: ", "land: "],
    ),
    (
        "returning by itself",
        lambda: [advice(heartbeat=beat(mode)) for mode in (RTL, LAND, 21, HOLD)],
        [
            "leave: returning or landing by itself, not commanded",
            "leave: returning or landing by itself, not commanded",
            "leave: returning or landing by itself, not commanded",
            "return: ",
        ],
    ),
    (
        "returning by itself, and the order is forced",
        lambda: advice(heartbeat=beat(RTL), errand=HomingOrder(NOW_S, force=True)),
        "return: ",
    ),
    (
        "its failsafe acts",
        lambda: [
            advice(
                cause=ModeCause.FAILSAFE,
                heartbeat=beat(mode),
                mode_since_s=NOW_S - since_s,
                errand=HomingOrder(NOW_S, force=force),
            )
            for mode, since_s, force in ((4, 0.0, False), (HOLD, 14.9, False), (HOLD, 15.0, False), (HOLD, 14.9, True))
        ],
        [
            "leave: left to its own failsafe",
            "wait: holding in its own failsafe; waiting for it to act",
            "return: ",
            "return: ",
        ],
    ),
    (
        "its failsafe holds, and it is received again",
        lambda: [
            advice(cause=ModeCause.FAILSAFE, heartbeat=beat(HOLD), mode_since_s=NOW_S - 40.0, **{key: NOW_S - since_s})
            for key in ("regained_s", "excused_s")
            for since_s in (14.9, 15.0)
        ],
        ["wait: holding in its own failsafe; waiting for it to act", "return: "] * 2,
    ),
    (
        "its failsafe holds, without HEARTBEATs",
        lambda: [
            advice(cause=ModeCause.FAILSAFE, heartbeat=beat(HOLD), mode_since_s=NOW_S - 20.0, heartbeat_s=NOW_S - age_s)
            for age_s in (5.0, 5.1)
        ],
        ["return: ", "wait: holding in its own failsafe; waiting for it to act"],
    ),
    (
        "at an unknown position",
        lambda: [
            advice(fix=fix, errand=HomingOrder(NOW_S - since_s))
            for fix, since_s in ((None, 1.4), (None, 1.5), (at(age_s=3.0), 0.0), (at(age_s=3.1), 0.0))
        ],
        ["wait: ", "return: ", "return: ", "wait: "],
    ),
    (
        "over its pad",
        lambda: [advice(fix=over_pad(20.0, north_m=-north_m), waypoint=2, heartbeat=beat(4)) for north_m in (6.0, 6.1)],
        ["land: ", "return: "],
    ),
    (
        "over its pad on its mission",
        lambda: [
            advice(fix=fix, waypoint=waypoint, anchor=None)
            for fix in (over_pad(20.0), over_pad(20.0, climbs_m_s=-0.3), over_pad(20.0, climbs_m_s=-0.4))
            for waypoint in (1, 4, 5)
        ],
        [
            "land: ",
            "leave: landing on its pad, not commanded",
            "leave: landing on its pad, not commanded",
            "land: ",
            "leave: landing on its pad, not commanded",
            "leave: landing on its pad, not commanded",
            "leave: landing on its pad, not commanded",
            "leave: landing on its pad, not commanded",
            "leave: landing on its pad, not commanded",
        ],
    ),
    (
        "over its pad for longer",
        lambda: [advice(fix=over_pad(20.0), waypoint=5, anchor=over_pad(20.0, age_s=age_s)) for age_s in (9.9, 10.0)],
        ["leave: landing on its pad, not commanded", "land: "],
    ),
    (
        "landing on its mission away from its pad",
        lambda: [advice(waypoint=5, heartbeat=beat(mode)) for mode in (AUTO, 4)],
        ["leave: landing, not commanded", "return: "],
    ),
    (
        "kill switch just reported on",
        lambda: [
            advice(alarm=(text, NOW_S - since_s), errand=HomingOrder(NOW_S, force=force))
            for text, since_s, force in (
                ("RC: Motors Emergency Stopped", 4.9, False),
                ("RC: Motors Emergency Stopped", 5.0, False),
                ("Kill engaged", 0.0, False),
                ("Kill disengaged", 0.0, False),
                ("Kill engaged", 0.0, True),
            )
        ],
        [
            "wait: reports its kill switch on, not commanded",
            "return: ",
            "wait: reports its kill switch on, not commanded",
            "return: ",
            "return: ",
        ],
    ),
    ("beyond its mission", lambda: advice(waypoint=6), "return: "),
    (
        "unable to hold height",
        lambda: [
            advice(**{"fault": SINKS, "heartbeat": beat(AUTO), "sinks_s": NOW_S, "anchor": at(), **given})
            for given in (
                {},
                {"sinks_s": NOW_S - 9.9},
                {"sinks_s": NOW_S - 10.0},  # it holds its height again
                {"sinks_s": NOW_S - 10.0, "fix": at(up_m=5.0)},  # or lies
                {"sinks_s": NOW_S - 10.0, "anchor": at(age_s=10.0)},
                {"fix": at(age_s=3.1)},
                {"fix": over_pad(20.0)},
                {"errand": HomingOrder(NOW_S, land=True)},
                {"errand": HomingOrder(NOW_S, force=True)},
                {"heartbeat": beat(RTL)},
            )
        ],
        [WEAK, WEAK, "return: ", WEAK, WEAK, WEAK, "land: ", "land: ", "return: ", SELF],
    ),
]


PX4 = fleet_of(autopilot="px4").context
PX4_HOLD = PX4.vehicles["uav1"].dialect.modes.hold.custom_mode
EMPTY = "Emergency battery level"
WAITS = "wait: holding in its own failsafe; waiting for it to act"


@pytest.mark.parametrize(
    ("given", "expected"),
    [
        ({}, "return: "),
        ({"critical_since_s": NOW_S - 14.9}, WAITS),
        ({"critical_since_s": NOW_S - 15.0}, "return: "),
        ({"critical_since_s": NOW_S - 40.0}, "return: "),
        (says(EMPTY, NOW_S - 14.9), WAITS),
        (says(EMPTY, NOW_S - 15.0), "return: "),
        (says(EMPTY, NOW_S - 40.0), "return: "),
        ({"alarm": ("Low battery", NOW_S - 1.0)}, "return: "),
        (says(EMPTY, NOW_S - 40.0, critical_since_s=NOW_S - 1.0), WAITS),
        (says(EMPTY, NOW_S - 1.0, mode_since_s=NOW_S - 0.5), "return: "),
        (says(EMPTY, NOW_S - 1.0, heartbeat=Heartbeat(12, 67371008, True, 5)), "return: "),
        (says(EMPTY, NOW_S - 1.0, errand=HomingOrder(NOW_S, force=True)), "return: "),
    ],
)
def test_a_failsafe_that_begins_in_a_hold_of_ours_is_waited_for(given: dict[str, object], expected: str) -> None:
    """PX4 holds before it lands: the mode is the one that the crew chose, and an order would take its place."""
    held = {"heartbeat": Heartbeat(12, PX4_HOLD, True, 4), "mode_since_s": NOW_S - 30.0}
    found = homing.advise_homing(PX4, with_facts(COMES, **(held | given)), NOW_S)
    assert ": ".join(found) == expected


def test_an_arducopters_failsafe_acts_at_once() -> None:
    held = advice(heartbeat=beat(HOLD), mode_since_s=NOW_S - 30.0, **says("Battery Failsafe", NOW_S - 1.0))
    assert held == "return: "


@pytest.mark.parametrize(("what", "found", "expected"), ROWS, ids=[row[0] for row in ROWS])
def test_everything_that_comes_of_it(what: str, found: Callable[[], object], expected: object) -> None:
    assert rounded(found()) == expected
