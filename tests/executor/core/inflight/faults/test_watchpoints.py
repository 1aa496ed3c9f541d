"""The table of watchpoints: each raises, persists, clears by its own threshold, and knows when it does not know."""

from __future__ import annotations

from dataclasses import dataclass, replace

import pytest

from executor.core.battery import account
from executor.core.battery.account import BatteryState
from executor.core.inflight.faults import watchpoints
from executor.core.inflight.faults.watch_view import OK, Finding, Watchpoint, WatchView
from executor.core.inflight.faults.watchpoints import TABLE, judge_watchpoints
from executor.core.interface.messages import Heartbeat
from executor.core.state.vehicle_parts import ModeCause
from executor.core.state.vehicle_state import Stage, VehicleState
from missions import Phase
from tests.executor.builders import with_facts
from tests.executor.core.inflight.faults.watch_views import Verdict, point, verdict
from tests.executor.core.vehicles import (
    AUTO,
    CONTEXT,
    DISARMED,
    LIMITS,
    LOW_TEXT,
    NOW_S,
    RTL,
    SETUP,
    at,
    flying,
    nearly_empty,
    pack,
    says,
    volts,
)


def falling_pack(reports: int, apart_s: float = 10.0, age_s: float = 0.0) -> BatteryState:
    """Return a battery that loses a percent from report to report."""
    return pack(*(90.0 - number for number in range(reports)), apart_s=apart_s, age_s=age_s)


@dataclass(frozen=True, slots=True)
class Row:
    """One watchpoint: states in which it is fine, fails, still fails after having failed, and cannot know."""

    name: str
    fails: VehicleState
    evidence: str
    unknown: VehicleState | None = None
    hangs: VehicleState | None = None
    """Between the clear and the raise threshold: fine by itself, a failure for one that already fails."""


ROWS = [
    Row(
        "off-pad",
        flying(heartbeat=Heartbeat(3, AUTO, False, 3)),
        "disarmed 300 m from its pad, 20 m high",
        unknown=flying(fix=None),
    ),
    Row("falling", flying(fix=at(climbs_m_s=-6.0)), "falls at 6.0 m/s", flying(fix=at(climbs_m_s=-6.0, age_s=3.5))),
    Row(
        "sinking",
        flying(fix=at(east_m=140.0, up_m=5.0), climbs_m_s=-2.0),
        "sinks at 2.0 m/s, 10 m below its mission",
        unknown=flying(fix=at(east_m=140.0, up_m=5.0, age_s=3.5), climbs_m_s=-2.0),
    ),
    Row(
        "thrust",
        flying(below_m=3.6, below_s=NOW_S, climbs_m_s=-2.0),
        "sinks at 2.0 m/s, while its autopilot wants to be 3.6 m higher",
        unknown=flying(below_m=3.6, below_s=NOW_S, climbs_m_s=-2.0, fix=at(age_s=3.5)),
    ),
    Row(
        "lies",
        flying(fix=at(east_m=140.0, up_m=5.0), anchor=at(east_m=140.0, up_m=5.0, age_s=8.0)),
        "does not move, down at 49.60014, 15.60140 (GPS not reported), armed: keep away",
        unknown=flying(fix=at(east_m=140.0, up_m=5.0, age_s=3.5), anchor=at(east_m=140.0, up_m=5.0, age_s=20.0)),
    ),
    Row(
        "crash",
        flying(**says("Crash: Disarming", heartbeat=DISARMED)),
        "it says: Crash: Disarming",
    ),
    Row(
        "terminated",
        flying(heartbeat=Heartbeat(12, AUTO, True, 8)),
        "reports that its flight is terminated",
        unknown=flying(heartbeat=None),
    ),
    Row("link", flying(heard_s=NOW_S - 10.0), "link lost for 10.0 s, time-out 10 s", flying(heard_s=None)),
    Row(
        "heartbeat",
        flying(heartbeat_s=NOW_S - 20.0),
        "no HEARTBEAT for 20 s, while other messages come",
        unknown=flying(heartbeat_s=NOW_S - 20.0, heard_s=NOW_S - 4.0),
    ),
    Row(
        "positions",
        flying(fix=at(age_s=20.0)),
        "no position for 20 s, while other messages come",
        unknown=flying(fix=None),
    ),
    Row(
        "battery-step",
        flying(battery=pack(90.0, 90.0, 60.0)),
        "lost 30 % at once where the flight costs 0.1 %",
        unknown=flying(battery=pack(90.0, 60.0, age_s=7.5)),
    ),
    Row(
        "voltage-step",
        flying(volts=volts(13.5)),
        "13.50 V where 15.20 V is usual under this load",
        unknown=flying(volts=volts(13.5, age_s=7.5)),
        hangs=flying(volts=volts(14.6)),
    ),
    Row(
        "cells",
        flying(volts=volts(low_since_s=NOW_S - LIMITS.cell_low_s)),
        "3.75 V a cell under load",
        unknown=flying(volts=volts(low_since_s=NOW_S - 20.0, age_s=7.5)),
    ),
    Row(
        "battery-critical",
        flying(battery=pack(20.0, charge_state=3)),
        "the autopilot reports its battery critical",
        unknown=flying(battery=pack(20.0, charge_state=3, age_s=7.5)),
    ),
    Row(
        "battery-failsafe",
        flying(**says("Battery 1 is low 10.22V used 1476 mAh", heartbeat=Heartbeat(3, AUTO, True, 5))),
        "it says: Battery 1 is low 10.22V used 1476 mAh",
    ),
    Row(
        "battery-plunge",
        flying(battery=falling_pack(6, apart_s=2.0)),
        "used 5.0 % in 10 s where 0.4 % is usual",
        unknown=flying(battery=falling_pack(6, apart_s=2.0, age_s=7.5)),
        hangs=flying(battery=falling_pack(4, apart_s=2.0)),
    ),
    Row(
        "battery-drain",
        flying(battery=falling_pack(14)),
        "used 13.0 % in 130 s where 4.9 % is usual over minutes",
        unknown=flying(battery=falling_pack(14, age_s=7.5)),
        hangs=flying(battery=falling_pack(11)),
    ),
    Row(
        "pack",
        flying(battery=pack(62.0, 62.0), pack=nearly_empty()),
        "its pack rests at 3.65 V a cell, about 8 %, and reports 62 %",
        unknown=flying(battery=pack(62.0, 62.0), pack=nearly_empty(), volts=volts(age_s=7.5)),
    ),
    Row(
        "reserve",
        flying(battery=pack(14.0, 14.0)),
        "would land with 9 % of its battery, give or take 2.5: 100 % likely to be below its reserve of 15 %",
        unknown=flying(battery=pack(14.0, age_s=7.5)),
        hangs=flying(battery=pack(17.3, 17.3)),
    ),
    Row(
        "battery-reports",
        flying(battery=pack(90.0, 90.0, age_s=60.0)),
        "no battery report for 60 s, while other messages come",
        unknown=flying(battery=BatteryState()),
    ),
    Row(
        "items",
        flying(item_s=NOW_S - 20.0),
        "no report of its current waypoint for 20 s, while other messages come",
        unknown=flying(item_s=None),
    ),
    Row("position", flying(jump=(120.0, NOW_S)), "its position jumped by 120 m"),
    Row(
        "fence",
        flying(**says("Polygon fence breached")),
        "its fence is breached; it says: Polygon fence breached",
    ),
    Row(
        "mode",
        flying(heartbeat=Heartbeat(3, RTL, True, 5), cause=ModeCause.FAILSAFE),
        "RTL by its own failsafe",
        unknown=flying(heartbeat=None),
    ),
    Row(
        "stall",
        flying(anchor=at(age_s=91.0)),
        "has not moved for 91 s",
        unknown=flying(anchor=at(age_s=91.0), fix=at(age_s=3.5)),
    ),
]


def names(rows: list[Row]) -> list[str]:
    return [row.name for row in rows]


def raised(state: VehicleState, now_s: float) -> tuple[list[str], VehicleState]:
    """Look at every watchpoint; return what is raised, and the vehicle that remembers it."""
    after, failed = judge_watchpoints(CONTEXT, SETUP, state, now_s)
    return [watchpoint.name for watchpoint, _ in failed], after


def later(state: VehicleState, by_s: float) -> VehicleState:
    """Return the same vehicle as if everything had been heard later."""
    fresh = state
    if state.motion.fix is not None:
        fresh = with_facts(fresh, fix=replace(state.motion.fix, at_s=state.motion.fix.at_s + by_s))
    if state.motion.anchor is not None:
        fresh = with_facts(fresh, anchor=replace(state.motion.anchor, at_s=state.motion.anchor.at_s + by_s))
    heard_s = None if state.link.heard_s is None else state.link.heard_s + by_s
    history = tuple(replace(sample, at_s=sample.at_s + by_s) for sample in state.power.battery.history)
    moved = replace(state.power.battery, history=history, reported_s=state.power.battery.reported_s + by_s)
    pack_v = replace(state.power.volts, reported_s=state.power.volts.reported_s + by_s)
    alarm, failed, jump = (
        (state.telemetry.alarm[0], state.telemetry.alarm[1] + by_s),
        tuple((one, said_s + by_s) for one, said_s in state.evidence.failed),
        (state.motion.jump[0], state.motion.jump[1] + by_s),
    )
    beat_s = None if state.link.heartbeat_s is None else state.link.heartbeat_s + by_s
    item_s = None if state.telemetry.item_s is None else state.telemetry.item_s + by_s
    fresh = with_facts(fresh, heartbeat_s=beat_s, item_s=item_s)
    fresh = with_facts(fresh, below_s=state.own.below_s + by_s)
    return with_facts(fresh, heard_s=heard_s, battery=moved, volts=pack_v, alarm=alarm, failed=failed, jump=jump)


def landing(state: VehicleState) -> VehicleState:
    """Return a vehicle whose mission has come to its landing."""
    assert state.assignment.board is not None
    last = next(n for n, way in enumerate(state.assignment.board.path.waypoints) if way.phase is Phase.LAND)
    return with_facts(state, waypoint=last)


def off_pad(state: VehicleState) -> Finding:
    return point("off-pad").judge(WatchView(CONTEXT, SETUP, state, False, NOW_S))


WAITS_S = {
    "falling": 0.4, "sinking": 2.0, "thrust": 3.5, "battery-step": 2.5, "voltage-step": 3.0, "battery-critical": 3.0,
    "battery-failsafe": 1.0, "battery-plunge": 0.4, "battery-drain": 2.5, "pack": 15.0, "reserve": 5.0, "mode": 1.0,
    "fence": 1.5,
}  # fmt: skip


def test_every_watchpoint_has_its_row() -> None:
    assert names(ROWS) == [watchpoint.name for watchpoint in TABLE]


@pytest.mark.parametrize("watchpoint", TABLE, ids=lambda one: str(one.name))
def test_a_healthy_vehicle_is_fine(watchpoint: Watchpoint) -> None:
    assert verdict(watchpoint.name, flying()) is Verdict.OK


@pytest.mark.parametrize("row", ROWS, ids=names(ROWS))
def test_it_fails_with_its_evidence(row: Row) -> None:
    finding = point(row.name).judge(WatchView(CONTEXT, SETUP, row.fails, False, NOW_S))
    assert finding == row.evidence


@pytest.mark.parametrize("row", [row for row in ROWS if row.hangs], ids=lambda row: str(row.name))
def test_it_clears_by_a_threshold_of_its_own(row: Row) -> None:
    assert row.hangs is not None
    assert verdict(row.name, row.hangs) is Verdict.OK
    assert verdict(row.name, row.hangs, failing=True) is Verdict.FAIL
    assert verdict(row.name, flying(), failing=True) is Verdict.OK


@pytest.mark.parametrize("row", ROWS, ids=names(ROWS))
def test_it_is_raised_once_it_has_lasted(row: Row) -> None:
    wait_s = point(row.name).raise_after_s
    found, state = raised(row.fails, NOW_S)
    assert (row.name in found) is (wait_s == 0.0)
    almost_s = max(0.0, wait_s - 0.1)
    found, state = raised(later(state, almost_s), NOW_S + almost_s)
    assert (row.name in found) is (wait_s == 0.0)
    found, _ = raised(later(state, 0.2), NOW_S + almost_s + 0.2)
    assert row.name in found


@pytest.mark.parametrize("row", ROWS, ids=names(ROWS))
def test_a_moment_of_health_restarts_the_wait(row: Row) -> None:
    wait_s = point(row.name).raise_after_s
    _, state = raised(row.fails, NOW_S)
    _, state = raised(replace(flying(), watches=state.watches), NOW_S)
    assert row.name not in dict(state.watches)
    found, _ = raised(later(replace(row.fails, watches=state.watches), wait_s), NOW_S + wait_s)
    assert (row.name in found) is (wait_s == 0.0)


@pytest.mark.parametrize("row", [row for row in ROWS if row.unknown], ids=lambda row: str(row.name))
def test_not_knowing_neither_raises_nor_clears(row: Row) -> None:
    assert row.unknown is not None
    assert verdict(row.name, row.unknown) is Verdict.STALE
    found, state = raised(row.unknown, NOW_S)
    assert row.name not in found
    assert row.name not in dict(state.watches), "what is not known begins nothing"
    _, state = raised(row.fails, NOW_S)
    begun = dict(state.watches).get(row.name)
    assert begun is not None
    found, state = raised(replace(row.unknown, watches=state.watches), NOW_S)
    assert row.name not in found
    assert dict(state.watches)[row.name] == begun, "what is not known ends nothing"


@pytest.mark.parametrize("row", ROWS, ids=names(ROWS))
def test_it_is_checked_in_its_stages_only(row: Row) -> None:
    for stage in Stage:
        found, _ = raised(later(raised(replace(row.fails, stage=stage), NOW_S)[1], 16.0), NOW_S + 16.0)
        assert (row.name in found) is (stage in point(row.name).stages)


def test_the_most_important_reason_comes_first() -> None:
    state = flying(heartbeat=Heartbeat(3, RTL, False, 3), heard_s=NOW_S - 30.0)
    assert raised(state, NOW_S)[0] == ["off-pad", "link"]


def test_a_landing_on_the_pad_is_no_fault() -> None:
    down = flying(heartbeat=Heartbeat(3, AUTO, False, 3), fix=at(east_m=5.0, up_m=0.0))
    assert verdict("off-pad", landing(down)) is Verdict.OK


def test_a_kill_switch_over_the_pad_is_no_landing() -> None:
    """A disarm at 2.5 m in the take-off: the mission was not over."""
    killed = flying(heartbeat=DISARMED, fix=at(east_m=5.0, up_m=2.5), waypoint=0)
    assert off_pad(killed) == "disarmed over its pad in mid-mission"


def test_a_vehicle_that_disarms_high_above_its_pad_falls() -> None:
    high = off_pad(flying(heartbeat=DISARMED, fix=at(east_m=5.0, up_m=18.0)))
    assert high == "disarmed 18 m above its pad"
    old = off_pad(landing(flying(heartbeat=DISARMED, fix=at(east_m=5.0, up_m=18.0, age_s=8.0))))
    assert old == OK, "it came down in the silence"


def test_a_vehicle_that_disarms_before_it_took_off_did_not_fly_its_mission() -> None:
    sitting = flying(heartbeat=DISARMED, fix=at(east_m=0.0, up_m=0.0), took_off=False)
    assert off_pad(sitting) == "disarmed on its pad before it took off"
    assert off_pad(replace(sitting, stage=Stage.RETURNING)) == OK


@pytest.mark.parametrize(("age_s", "shown"), [(1.0, True), (14.0, True), (16.0, False)])
def test_what_the_vehicle_said_of_it_is_part_of_the_evidence(age_s: float, shown: bool) -> None:
    said = ("Battery Failsafe", NOW_S - age_s)
    went = point("mode").judge(
        WatchView(
            CONTEXT,
            SETUP,
            flying(heartbeat=Heartbeat(3, RTL, True, 5), alarm=said, cause=ModeCause.FAILSAFE),
            False,
            NOW_S,
        )
    )
    assert went == "RTL by its own failsafe" + ("; it says: Battery Failsafe" if shown else "")
    assert str(off_pad(flying(heartbeat=DISARMED, alarm=said))).endswith("Battery Failsafe") is shown


def test_a_vehicle_with_a_stopped_clock_does_not_stall() -> None:
    """A simulator that the computer lets wait for ninety seconds has flown for ten."""
    starved = flying(anchor=replace(at(age_s=91.0), boot_s=at().boot_s - 10.0))
    assert verdict("stall", starved) is Verdict.OK


def test_a_vehicle_that_never_armed_is_not_down() -> None:
    assert verdict("off-pad", flying(heartbeat=Heartbeat(3, AUTO, False, 3), armed_once=False)) is Verdict.OK


@pytest.mark.parametrize("cause", [ModeCause.OURS, ModeCause.MISSION, ModeCause.PERSON])
def test_only_a_failsafe_of_its_own_is_a_fault(cause: ModeCause) -> None:
    assert verdict("mode", flying(heartbeat=Heartbeat(3, RTL, True, 4), cause=cause)) is Verdict.OK


def test_a_silent_vehicles_last_report_raises_nothing_but_the_link() -> None:
    state = flying(
        battery=pack(90.0, 60.0), fix=at(climbs_m_s=-1.0), anchor=at(age_s=80.0), heard_s=NOW_S
    )  # fmt: skip
    found, state = raised(state, NOW_S)
    assert found == []
    for second in range(1, 200):
        found, state = raised(state, NOW_S + second)
        assert set(found) <= (
            {"link"} if second > LIMITS.battery_stale_s else {"battery-step", "battery-plunge", "battery-drain"}
        )
    assert found == ["link"]


@pytest.mark.parametrize("late_s", [0.5, 5.0, 12.0])
def test_a_step_is_found_by_whoever_looks_late(late_s: float) -> None:
    """A computer that lets the program wait does not look in the seconds in which a step is new."""
    after = pack(90.0, 90.0, 60.0, *(60.0,) * int(late_s / 2.0), apart_s=2.0)
    found, state = raised(flying(battery=after), NOW_S)
    found, _ = raised(state, NOW_S + 3.0)
    assert "battery-step" in found


def test_a_drain_by_the_counter_of_charge() -> None:
    """It is found by tenths of a percent, long before whole percents tell."""
    state, used_ah = BatteryState(), 0.0
    for second in range(400):
        rate_pct_s = 0.04 if second < 300 else 0.1
        used_ah += rate_pct_s / 100 * 5.0
        state = account.add_modelled_use(state, 0.04)
        at_s = NOW_S - 400 + second
        state = account.apply_consumed_report(state, used_ah, at_s)
        state = account.apply_remaining_report(state, round(100 - used_ah / 5.0 * 100), 1, at_s)
        known = flying(battery=state)
        finding = watchpoints.check_battery_drain(WatchView(CONTEXT, SETUP, known, False, at_s))
        if finding:
            break
    assert 300 < second < 340
    assert finding
    assert finding.endswith("by its charge counter")


def test_the_modes_words() -> None:
    strange = flying(heartbeat=Heartbeat(3, 77, True, 4), cause=ModeCause.FAILSAFE)
    finding = watchpoints.check_mission_mode(WatchView(CONTEXT, SETUP, strange, False, NOW_S))
    assert finding == "number 77 by its own failsafe"


@pytest.mark.parametrize(
    ("state", "shows"),
    [
        (flying(**says(LOW_TEXT[0])), False),
        (flying(**says(LOW_TEXT[0], heartbeat=Heartbeat(3, RTL, True, 4))), True),
        (flying(**says(LOW_TEXT[0], heartbeat=Heartbeat(3, AUTO, True, 5))), True),
        (flying(**says(LOW_TEXT[0], battery=pack(90.0, charge_state=2))), True),
        (flying(**says(LOW_TEXT[0], battery_faults=4)), True),
        (flying(**says(LOW_TEXT[0], unhealthy=0x2000000)), True),
        (flying(**says(LOW_TEXT[0], battery=pack(30.0, 30.0))), True),
        (flying(**says(LOW_TEXT[0], battery=BatteryState())), True),
        (flying(**says(LOW_TEXT[0], volts=volts(low_since_s=NOW_S - 1.0))), True),
    ],
)
def test_a_text_of_the_battery_alone_is_no_fault(state: VehicleState, shows: bool) -> None:
    """Anybody can send a text; a failsafe shows in the mode, the state or the battery as well."""
    assert verdict("battery-failsafe", state) is (Verdict.FAIL if shows else Verdict.OK)


@pytest.mark.parametrize("row", ROWS, ids=names(ROWS))
def test_how_long_it_must_last(row: Row) -> None:
    """A text may come after the mode that it explains, a report may be one that is corrected; a fall is no matter of
    seconds."""
    wait_s = WAITS_S.get(row.name, 0.0)
    _, state = raised(row.fails, NOW_S)
    for passed_s in (wait_s - 0.1, wait_s + 0.1):
        if passed_s >= 0.0:
            found, _ = raised(later(state, passed_s), NOW_S + passed_s)
            assert (row.name in found) is (passed_s > wait_s)
