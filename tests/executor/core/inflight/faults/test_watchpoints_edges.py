"""Each watchpoint fails from its threshold on, and what is too old says nothing."""

from __future__ import annotations

import math

import pytest

from executor.core.inflight.faults.watch_view import WatchView
from executor.core.interface.messages import Heartbeat
from executor.core.state.vehicle_parts import PositionFix
from executor.core.state.vehicle_state import Stage, VehicleState
from tests.executor.core.inflight.faults.watch_views import Verdict, point, verdict
from tests.executor.core.vehicles import AUTO, CONTEXT, DISARMED, LOW_TEXT, NOW_S, SETUP, at, flying, pack, says, volts


def parted(**changes: object) -> VehicleState:
    """Return a vehicle that has disarmed on its way home."""
    healthy: dict[str, object] = {"stage": Stage.RETURNING, "heartbeat": DISARMED, "fix": at(east_m=5.0, up_m=0.5)}
    return flying(**(healthy | changes))


def sinking(up_m: float, climbs_m_s: float) -> PositionFix:
    return at(east_m=5.0, up_m=up_m, climbs_m_s=climbs_m_s)


EDGES: list[tuple[str, VehicleState, VehicleState]] = [
    # The vehicle is fine at the last figure before the threshold, and fails from there on.
    ("link", flying(heard_s=NOW_S - 9.9), flying(heard_s=NOW_S - 10.0)),
    ("falling", flying(fix=at(climbs_m_s=-5.0)), flying(fix=at(climbs_m_s=-5.1))),
    ("off-pad", parted(fix=at(east_m=15.0, up_m=0.0)), parted(fix=at(east_m=15.1, up_m=0.0))),
    ("off-pad", parted(fix=sinking(5.0, 0.0)), parted(fix=sinking(5.1, 0.0))),
    ("off-pad", parted(fix=sinking(2.0, -0.3)), parted(fix=sinking(2.0, -0.4))),
    ("off-pad", parted(fix=sinking(1.0, -0.4)), parted(fix=sinking(1.1, -0.4))),
    ("off-pad", parted(), parted(rebooted_s=NOW_S - 30.0)),
    (
        "off-pad",
        parted(alarm=("RC: Motors Emergency Stopped", NOW_S - 25.1), disarmed_s=NOW_S - 10.0),
        parted(alarm=("RC: Motors Emergency Stopped", NOW_S - 25.0), disarmed_s=NOW_S - 10.0),
    ),
    (
        "off-pad",
        parted(alarm=("Kill engaged", NOW_S), disarmed_s=NOW_S - 15.1),
        parted(alarm=("Kill engaged", NOW_S), disarmed_s=NOW_S - 15.0),
    ),
    ("terminated", flying(heartbeat=Heartbeat(3, AUTO, True, 5)), flying(heartbeat=Heartbeat(3, AUTO, True, 6))),
    ("terminated", flying(heartbeat=Heartbeat(3, AUTO, False, 8)), flying(heartbeat=Heartbeat(3, AUTO, True, 8))),
    ("heartbeat", flying(heartbeat_s=NOW_S - 19.9), flying(heartbeat_s=NOW_S - 20.0)),
    ("positions", flying(fix=at(age_s=19.9)), flying(fix=at(age_s=20.0))),
    ("items", flying(item_s=NOW_S - 19.9), flying(item_s=NOW_S - 20.0)),
    ("items", flying(item_s=NOW_S - 20.0, excused_s=NOW_S - 9.0), flying(item_s=NOW_S - 20.0, excused_s=NOW_S - 20.0)),
    ("battery-reports", flying(battery=pack(90.0, age_s=59.9)), flying(battery=pack(90.0, age_s=60.0))),
    ("position", flying(jump=(99.9, NOW_S)), flying(jump=(100.0, NOW_S))),
    ("position", flying(jump=(120.0, NOW_S - 3.1)), flying(jump=(120.0, NOW_S - 3.0))),
    ("stall", flying(anchor=at(age_s=89.9)), flying(anchor=at(age_s=90.0))),
    ("stall", flying(anchor=at(age_s=90.0), held_s=NOW_S - 1.0), flying(anchor=at(age_s=90.0))),
    (
        "voltage-step",
        flying(volts=volts(drop=0.0499, dropped_s=NOW_S)),
        flying(volts=volts(drop=0.05, dropped_s=NOW_S)),
    ),
    (
        "voltage-step",
        flying(volts=volts(drop=0.0649, dropped_s=NOW_S, known_load=False)),
        flying(volts=volts(drop=0.065, dropped_s=NOW_S, known_load=False)),
    ),
    ("cells", flying(volts=volts(low_since_s=NOW_S - 9.9)), flying(volts=volts(low_since_s=NOW_S - 10.0))),
    (
        "cells",
        flying(volts=volts(cells_v=(3.8, 3.8, 3.4), spread_since_s=NOW_S - 9.9)),
        flying(volts=volts(cells_v=(3.8, 3.8, 3.4), spread_since_s=NOW_S - 10.0)),
    ),
    ("battery-critical", flying(battery=pack(20.0, charge_state=2)), flying(battery=pack(20.0, charge_state=4))),
    ("battery-critical", flying(battery=pack(20.0, charge_state=7)), flying(battery=pack(20.0, charge_state=6))),
    ("battery-critical", flying(battery_faults=2 | 32 | 128), flying(battery_faults=2 | 32 | 128 | 16)),
    (
        "battery-failsafe",
        flying(**says(LOW_TEXT[0], NOW_S - 15.1, heartbeat=Heartbeat(3, AUTO, True, 5))),
        flying(**says(LOW_TEXT[0], NOW_S - 15.0, heartbeat=Heartbeat(3, AUTO, True, 5))),
    ),
    (
        "battery-failsafe",
        flying(**says(LOW_TEXT[0], battery=pack(30.1, 30.1))),
        flying(**says(LOW_TEXT[0], battery=pack(30.0, 30.0))),
    ),
]
OLD: list[tuple[str, VehicleState, VehicleState]] = [
    # What was said so long ago still counts, and a moment longer ago it says nothing.
    ("falling", flying(fix=at(climbs_m_s=-6.0, age_s=3.0)), flying(fix=at(climbs_m_s=-6.0, age_s=3.1))),
    (
        "stall",
        flying(anchor=at(age_s=99.0), fix=at(age_s=3.0)),
        flying(anchor=at(age_s=99.0), fix=at(age_s=3.1)),
    ),
    ("voltage-step", flying(volts=volts(13.5, age_s=7.0)), flying(volts=volts(13.5, age_s=7.1))),
    (
        "cells",
        flying(volts=volts(low_since_s=NOW_S - 20.0, age_s=7.0)),
        flying(volts=volts(low_since_s=NOW_S - 20.0, age_s=7.1)),
    ),
    (
        "battery-critical",
        flying(battery=pack(20.0, charge_state=3, age_s=7.0)),
        flying(battery=pack(20.0, charge_state=3, age_s=7.1)),
    ),
    (
        "battery-critical",
        flying(battery=pack(20.0, charge_state=3), fix=at(age_s=3.0)),
        flying(battery=pack(20.0, charge_state=3), fix=at(age_s=3.1)),
    ),
    (
        "heartbeat",
        flying(heartbeat_s=NOW_S - 23.0, heard_s=NOW_S - 2.9),
        flying(heartbeat_s=NOW_S - 23.0, heard_s=NOW_S - 3.0),
    ),
    # Due since then, and nothing at all came since: that may be the link.
    (
        "heartbeat",
        flying(heartbeat_s=NOW_S - 21.0, heard_s=NOW_S - 1.0),
        flying(heartbeat_s=NOW_S - 21.0, heard_s=NOW_S - 1.1),
    ),
    # Disarmed 20 m from its pad: its place is seen for 1.5 s, and after 6 s it is taken for where it was last.
    (
        "off-pad",
        parted(fix=at(east_m=20.0, age_s=1.5), disarmed_s=NOW_S),
        parted(fix=at(east_m=20.0, age_s=1.6), disarmed_s=NOW_S),
    ),
    (
        "off-pad",
        parted(fix=at(east_m=20.0, age_s=9.0), disarmed_s=NOW_S - 6.0),
        parted(fix=at(east_m=20.0, age_s=9.0), disarmed_s=NOW_S - 5.9),
    ),
]
FAULTS = [(1, "deep discharge"), (4, "a failed cell"), (8, "over-current"), (16, "over-temperature"),
          (64, "an incompatible voltage"), (256, "an incompatible cell configuration"),
          (4 | 16, "a failed cell, over-temperature")]  # fmt: skip


@pytest.mark.parametrize(("name", "fine", "fails"), EDGES, ids=[f"{n}-{one[0]}" for n, one in enumerate(EDGES)])
def test_it_fails_from_its_threshold_on(name: str, fine: VehicleState, fails: VehicleState) -> None:
    assert verdict(name, fine) is Verdict.OK
    assert verdict(name, fails) is Verdict.FAIL


@pytest.mark.parametrize(("name", "fails", "unknown"), OLD, ids=[f"{n}-{one[0]}" for n, one in enumerate(OLD)])
def test_what_is_too_old_says_nothing(name: str, fails: VehicleState, unknown: VehicleState) -> None:
    assert verdict(name, fails) is Verdict.FAIL
    assert verdict(name, unknown) is Verdict.STALE


def test_neither_heartbeat_nor_position_for_a_minute_is_a_lost_link() -> None:
    def unseen(heartbeat_s: float, position_s: float, excused_s: float = -math.inf) -> Verdict:
        state = flying(heartbeat_s=NOW_S - heartbeat_s, fix=at(age_s=position_s), excused_s=excused_s)
        return verdict("link", state)

    assert unseen(60.0, 60.0) is unseen(60.0, 90.0) is unseen(90.0, 60.0) is Verdict.FAIL
    assert unseen(59.9, 90.0) is unseen(90.0, 59.9) is Verdict.OK
    assert unseen(90.0, 90.0, excused_s=NOW_S - 30.0) is Verdict.OK
    assert verdict("link", flying(heartbeat_s=None, fix=at(age_s=90.0))) is Verdict.OK


@pytest.mark.parametrize(("bits", "words"), FAULTS)
def test_the_faults_of_a_battery_in_words(bits: int, words: str) -> None:
    finding = point("battery-critical").judge(WatchView(CONTEXT, SETUP, flying(battery_faults=bits), False, NOW_S))
    assert finding == f"its battery reports {words}"
    states = {3: "critical", 4: "emergency", 5: "failed", 6: "unhealthy"}
    for number, name in states.items():
        view = WatchView(CONTEXT, SETUP, flying(battery=pack(20.0, charge_state=number)), False, NOW_S)
        assert point("battery-critical").judge(view) == f"the autopilot reports its battery {name}"
