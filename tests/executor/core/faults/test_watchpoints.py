"""The table of watchpoints: each raises, persists, clears by its own threshold, and knows when it does not know."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace

import pytest

from executor.core.battery import account
from executor.core.battery.account import BatteryState
from executor.core.battery.voltage import VoltageState
from executor.core.faults import watchpoints
from executor.core.faults.watching import Finding, Verdict, View, Watchpoint
from executor.core.faults.watchpoints import TABLE, judge
from executor.core.messages import Heartbeat
from executor.core.parts import Cause, Fix, OnBoard
from executor.core.vehicle import Stage, VehicleState
from missions import Phase
from tests.executor.builders import fleet_of, vehicle, with_facts

FLEET = fleet_of()
CONTEXT, SETUP = FLEET.context, FLEET.context.vehicles["uav1"]
LIMITS = CONTEXT.limits
NOW_S = 1000.0
AUTO, RTL = 3, 6
PAD_E, PAD_N = SETUP.pad_m

Change = Callable[[VehicleState], VehicleState]


def at(*, east_m: float = 300.0, up_m: float = 20.0, climbs_m_s: float = 0.0, age_s: float = 0.0) -> Fix:
    heard_s = NOW_S - age_s
    return Fix(heard_s, heard_s, (PAD_E + east_m, PAD_N), up_m, 450.0 + up_m, (3.0, 0.0, climbs_m_s))


def pack(*percents: float, apart_s: float = 1.0, age_s: float = 0.0, charge_state: int = 1) -> BatteryState:
    """Return a battery with these reports, the last one `age_s` ago; the model expects hardly anything."""
    state = BatteryState()
    for index, percent in enumerate(percents):
        reported_s = NOW_S - age_s - (len(percents) - 1 - index) * apart_s
        state = account.with_remaining(account.drawn(state, 0.036 * apart_s), percent, charge_state, reported_s)
    return state


def falling_pack(reports: int, apart_s: float = 10.0, age_s: float = 0.0) -> BatteryState:
    """Return a battery that loses a percent from report to report."""
    return pack(*(90.0 - number for number in range(reports)), apart_s=apart_s, age_s=age_s)


def volts(voltage_v: float = 15.0, usual_v: float = 15.2, age_s: float = 0.0, **changes: object) -> VoltageState:
    """Return a pack of four cells whose current is known."""
    drop = 1.0 - voltage_v / usual_v
    told: dict[str, object] = {
        "reported_s": NOW_S - age_s,
        "voltage_v": voltage_v,
        "highest_v": 16.8,
        "usual_v": usual_v,
        "known_load": True,
        "drop": drop,
        "dropped_s": NOW_S - age_s if drop > LIMITS.voltage_step / 2 else None,
    }
    return VoltageState(**(told | changes))  # type: ignore[arg-type]


def flying(**changes: object) -> VehicleState:
    """Return a vehicle in the midst of its mission, with nothing wrong."""
    healthy: dict[str, object] = {
        "stage": Stage.FLYING,
        "heard_s": NOW_S,
        "heartbeat": Heartbeat(3, AUTO, True, 4),
        "heartbeat_s": NOW_S,
        "item_s": NOW_S,
        "armed_once": True,
        "took_off": True,
        "fix": at(),
        "anchor": at(),
        "battery": pack(90.0, 90.0),
        "volts": volts(),
        "waypoint": 2,
    }
    return vehicle(FLEET, "uav1", **(healthy | changes))


def mission() -> OnBoard:
    """Return what it carries."""
    board = flying().assignment.board
    assert board is not None
    return board


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
        flying(alarm=("Battery 1 is low 10.22V used 1476 mAh", NOW_S), heartbeat=Heartbeat(3, AUTO, True, 5)),
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
        "used 13.0 % in 130 s where 5.2 % is usual over minutes",
        unknown=flying(battery=falling_pack(14, age_s=7.5)),
        hangs=flying(battery=falling_pack(11)),
    ),
    Row(
        "reserve",
        flying(battery=pack(14.0, 14.0)),
        "would land with 10 % of its battery, give or take 1.7, reserve 15 %: below it by 99 % probability",
        unknown=flying(battery=pack(14.0, age_s=7.5)),
        hangs=flying(battery=pack(16.5, 16.5)),
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
        "mode",
        flying(heartbeat=Heartbeat(3, RTL, True, 5), cause=Cause.FAILSAFE),
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


def point(name: str) -> Watchpoint:
    return next(watchpoint for watchpoint in TABLE if watchpoint.name == name)


def verdict(name: str, state: VehicleState, *, failing: bool = False) -> Verdict:
    return point(name).judge(View(CONTEXT, SETUP, state, failing, NOW_S)).verdict


def names(rows: list[Row]) -> list[str]:
    return [row.name for row in rows]


def test_every_watchpoint_has_its_row() -> None:
    assert names(ROWS) == [watchpoint.name for watchpoint in TABLE]


@pytest.mark.parametrize("watchpoint", TABLE, ids=lambda one: str(one.name))
def test_a_healthy_vehicle_is_fine(watchpoint: Watchpoint) -> None:
    assert verdict(watchpoint.name, flying()) is Verdict.OK


@pytest.mark.parametrize("row", ROWS, ids=names(ROWS))
def test_it_fails_with_its_evidence(row: Row) -> None:
    finding = point(row.name).judge(View(CONTEXT, SETUP, row.fails, False, NOW_S))
    assert (finding.verdict, finding.evidence) == (Verdict.FAIL, row.evidence)


@pytest.mark.parametrize("row", [row for row in ROWS if row.hangs], ids=lambda row: str(row.name))
def test_it_clears_by_a_threshold_of_its_own(row: Row) -> None:
    assert row.hangs is not None
    assert verdict(row.name, row.hangs) is Verdict.OK
    assert verdict(row.name, row.hangs, failing=True) is Verdict.FAIL
    assert verdict(row.name, flying(), failing=True) is Verdict.OK


def raised(state: VehicleState, now_s: float) -> tuple[list[str], VehicleState]:
    """Look at every watchpoint; return what is raised, and the vehicle that remembers it."""
    judgement = judge(CONTEXT, SETUP, state, now_s)
    return [watchpoint.name for watchpoint, _ in judgement.raised], replace(state, watches=judgement.watches)


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
    alarm, jump = (
        (state.telemetry.alarm[0], state.telemetry.alarm[1] + by_s),
        (state.motion.jump[0], state.motion.jump[1] + by_s),
    )
    beat_s = None if state.link.heartbeat_s is None else state.link.heartbeat_s + by_s
    item_s = None if state.telemetry.item_s is None else state.telemetry.item_s + by_s
    fresh = with_facts(fresh, heartbeat_s=beat_s, item_s=item_s)
    return with_facts(fresh, heard_s=heard_s, battery=moved, volts=pack_v, alarm=alarm, jump=jump)


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
def test_a_moment_of_health_begins_the_wait_anew(row: Row) -> None:
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
def test_it_is_looked_at_in_its_stages_only(row: Row) -> None:
    for stage in Stage:
        found, _ = raised(later(raised(replace(row.fails, stage=stage), NOW_S)[1], 9.0), NOW_S + 9.0)
        assert (row.name in found) is (stage in point(row.name).stages)


def test_the_most_important_reason_comes_first() -> None:
    state = flying(heartbeat=Heartbeat(3, RTL, False, 3), heard_s=NOW_S - 30.0)
    judgement = judge(CONTEXT, SETUP, state, NOW_S)
    assert [watchpoint.name for watchpoint, _ in judgement.raised] == ["off-pad", "link"]


def test_a_landing_on_the_pad_is_no_fault() -> None:
    down = flying(heartbeat=Heartbeat(3, AUTO, False, 3), fix=at(east_m=5.0, up_m=0.0))
    assert verdict("off-pad", landing(down)) is Verdict.OK


def test_a_kill_switch_over_the_pad_is_no_landing() -> None:
    """A disarm at 2.5 m in the take-off: the mission was not over."""
    killed = flying(heartbeat=DISARMED, fix=at(east_m=5.0, up_m=2.5), waypoint=0)
    assert off_pad(killed).evidence == "disarmed over its pad in mid-mission"


def landing(state: VehicleState) -> VehicleState:
    """Return a vehicle whose mission has come to its landing."""
    assert state.assignment.board is not None
    last = next(n for n, way in enumerate(state.assignment.board.path.waypoints) if way.phase is Phase.LAND)
    return with_facts(state, waypoint=last)


DISARMED = Heartbeat(3, AUTO, False, 3)


def off_pad(state: VehicleState) -> Finding:
    return point("off-pad").judge(View(CONTEXT, SETUP, state, False, NOW_S))


def test_a_vehicle_that_disarms_high_above_its_pad_falls() -> None:
    high = off_pad(flying(heartbeat=DISARMED, fix=at(east_m=5.0, up_m=18.0)))
    assert (high.verdict, high.evidence) == (Verdict.FAIL, "disarmed 18 m above its pad")
    old = off_pad(landing(flying(heartbeat=DISARMED, fix=at(east_m=5.0, up_m=18.0, age_s=8.0))))
    assert old.verdict is Verdict.OK, "it came down in the silence"


def test_a_vehicle_that_disarms_before_it_took_off_did_not_fly_its_mission() -> None:
    sitting = flying(heartbeat=DISARMED, fix=at(east_m=0.0, up_m=0.0), took_off=False)
    assert off_pad(sitting).evidence == "disarmed on its pad before it took off"
    assert off_pad(replace(sitting, stage=Stage.RETURNING)).verdict is Verdict.OK


@pytest.mark.parametrize(("age_s", "shown"), [(1.0, True), (14.0, True), (16.0, False)])
def test_what_the_vehicle_said_of_it_is_part_of_the_evidence(age_s: float, shown: bool) -> None:
    said = ("Battery Failsafe", NOW_S - age_s)
    went = point("mode").judge(
        View(
            CONTEXT, SETUP, flying(heartbeat=Heartbeat(3, RTL, True, 5), alarm=said, cause=Cause.FAILSAFE), False, NOW_S
        )
    )
    assert went.evidence == "RTL by its own failsafe" + ("; it says: Battery Failsafe" if shown else "")
    assert off_pad(flying(heartbeat=DISARMED, alarm=said)).evidence.endswith("Battery Failsafe") is shown


def test_a_vehicle_whose_clock_stands_still_does_not_stall() -> None:
    """A simulator that the computer lets wait for ninety seconds has flown for ten."""
    starved = flying(anchor=replace(at(age_s=91.0), boot_s=at().boot_s - 10.0))
    assert verdict("stall", starved) is Verdict.OK


def test_a_vehicle_that_never_armed_is_not_down() -> None:
    assert verdict("off-pad", flying(heartbeat=Heartbeat(3, AUTO, False, 3), armed_once=False)) is Verdict.OK


@pytest.mark.parametrize("cause", [Cause.OURS, Cause.MISSION, Cause.PERSON])
def test_only_a_failsafe_of_its_own_is_a_fault(cause: Cause) -> None:
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
        state = account.drawn(state, 0.04)
        at_s = NOW_S - 400 + second
        state = account.with_consumed(state, used_ah, at_s)
        state = account.with_remaining(state, round(100 - used_ah / 5.0 * 100), 1, at_s)
        known = flying(battery=state)
        finding = watchpoints.battery_drains(View(CONTEXT, SETUP, known, False, at_s))
        if finding.verdict is Verdict.FAIL:
            break
    assert 300 < second < 340
    assert finding.evidence.endswith("by its counter of charge")


def test_the_modes_words() -> None:
    strange = flying(heartbeat=Heartbeat(3, 77, True, 4), cause=Cause.FAILSAFE)
    finding = watchpoints.left_mission(View(CONTEXT, SETUP, strange, False, NOW_S))
    assert finding.evidence == "number 77 by its own failsafe"


LOW_TEXT = ("Battery Failsafe", NOW_S)


@pytest.mark.parametrize(
    ("state", "shows"),
    [
        (flying(alarm=LOW_TEXT), False),
        (flying(alarm=LOW_TEXT, heartbeat=Heartbeat(3, RTL, True, 4)), True),
        (flying(alarm=LOW_TEXT, heartbeat=Heartbeat(3, AUTO, True, 5)), True),
        (flying(alarm=LOW_TEXT, battery=pack(90.0, charge_state=2)), True),
        (flying(alarm=LOW_TEXT, battery_faults=4), True),
        (flying(alarm=LOW_TEXT, unhealthy=0x2000000), True),
        (flying(alarm=LOW_TEXT, battery=pack(30.0, 30.0)), True),
        (flying(alarm=LOW_TEXT, battery=BatteryState()), True),
        (flying(alarm=LOW_TEXT, volts=volts(low_since_s=NOW_S - 1.0)), True),
    ],
)
def test_a_text_of_the_battery_alone_is_nobodys_fault(state: VehicleState, shows: bool) -> None:
    """Anybody can send a text; a failsafe shows in the mode, the state or the battery as well."""
    assert verdict("battery-failsafe", state) is (Verdict.FAIL if shows else Verdict.OK)


def parted(**changes: object) -> VehicleState:
    """Return a vehicle that has disarmed on its way home."""
    healthy: dict[str, object] = {"stage": Stage.RETURNING, "heartbeat": DISARMED, "fix": at(east_m=5.0, up_m=0.5)}
    return flying(**(healthy | changes))


def sinking(up_m: float, climbs_m_s: float) -> Fix:
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
        flying(alarm=(LOW_TEXT[0], NOW_S - 15.1), heartbeat=Heartbeat(3, AUTO, True, 5)),
        flying(alarm=(LOW_TEXT[0], NOW_S - 15.0), heartbeat=Heartbeat(3, AUTO, True, 5)),
    ),
    (
        "battery-failsafe",
        flying(alarm=LOW_TEXT, battery=pack(30.1, 30.1)),
        flying(alarm=LOW_TEXT, battery=pack(30.0, 30.0)),
    ),
]


@pytest.mark.parametrize(("name", "fine", "fails"), EDGES, ids=[f"{n}-{one[0]}" for n, one in enumerate(EDGES)])
def test_it_fails_from_its_threshold_on(name: str, fine: VehicleState, fails: VehicleState) -> None:
    assert verdict(name, fine) is Verdict.OK
    assert verdict(name, fails) is Verdict.FAIL


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


FAULTS = [(1, "deep discharge"), (4, "a failed cell"), (8, "over-current"), (16, "over-temperature"),
          (64, "a voltage that does not fit"), (256, "cells that are not the set ones"),
          (4 | 16, "a failed cell, over-temperature")]  # fmt: skip


@pytest.mark.parametrize(("bits", "words"), FAULTS)
def test_the_faults_of_a_battery_in_words(bits: int, words: str) -> None:
    finding = point("battery-critical").judge(View(CONTEXT, SETUP, flying(battery_faults=bits), False, NOW_S))
    assert finding.evidence == f"its battery reports {words}"
    states = {3: "critical", 4: "emergency", 5: "failed", 6: "unhealthy"}
    for number, name in states.items():
        view = View(CONTEXT, SETUP, flying(battery=pack(20.0, charge_state=number)), False, NOW_S)
        assert point("battery-critical").judge(view).evidence == f"the autopilot reports its battery {name}"


UNPLANNED = replace(SETUP, planned=False)
LOITER, LAND = 5, 9


def unplanned(name: str, **changes: object) -> Verdict:
    """Look at a vehicle of which nobody knows the plan, as a recorded one."""
    state = flying(**({"flew_mission": True, "mode_since_s": NOW_S - 60.0} | changes))
    return point(name).judge(View(CONTEXT, UNPLANNED, state, False, NOW_S)).verdict


def rtl(**changes: object) -> dict[str, object]:
    return {"heartbeat": Heartbeat(3, RTL, True, 4), **changes}


UNPLANNED_ROWS: list[tuple[str, dict[str, object], Verdict]] = [
    ("mode", rtl(), Verdict.FAIL),
    ("mode", rtl(flew_mission=False), Verdict.OK),
    ("mode", rtl(heartbeat=Heartbeat(3, RTL, False, 4)), Verdict.OK),
    ("mode", rtl(ordered_mode_s=NOW_S - 2.9), Verdict.OK),
    ("mode", rtl(ordered_mode_s=NOW_S - 3.0), Verdict.FAIL),
    ("mode", rtl(ordered_mode_s=NOW_S - 62.9), Verdict.OK),
    ("mode", rtl(ordered_mode_s=NOW_S - 63.0), Verdict.FAIL),
    # ArduPilot counts its home: of 10 items the last is 10, and a return there begins with the last but one.
    ("mode", rtl(item=(9, 10)), Verdict.OK),
    ("mode", rtl(item=(8, 10)), Verdict.FAIL),
    ("mode", rtl(item=(9, 65535)), Verdict.FAIL),
    ("mode", rtl(item=(65535, 65535)), Verdict.FAIL),
    ("mode", rtl(item=(9, None)), Verdict.FAIL),
    ("mode", {"heartbeat": Heartbeat(3, LOITER, True, 4), "item": (9, 10)}, Verdict.FAIL),
    ("stall", {"anchor": at(age_s=239.9)}, Verdict.OK),
    ("stall", {"anchor": at(age_s=240.0)}, Verdict.FAIL),
    ("stall", {"anchor": at(age_s=240.0), "heartbeat": Heartbeat(3, LOITER, True, 4)}, Verdict.OK),
    ("off-pad", {"heartbeat": DISARMED, "fix": at(up_m=5.1, climbs_m_s=-1.5)}, Verdict.FAIL),
    ("off-pad", {"heartbeat": DISARMED, "fix": at(up_m=5.0, climbs_m_s=-1.5)}, Verdict.OK),
    ("off-pad", {"heartbeat": DISARMED, "fix": at(up_m=5.1, age_s=3.0)}, Verdict.FAIL),
    ("off-pad", {"heartbeat": DISARMED, "fix": at(up_m=5.1, age_s=3.1)}, Verdict.OK),
    ("off-pad", {"heartbeat": DISARMED, "fix": at(up_m=5.1), "on_ground": True}, Verdict.OK),
    ("off-pad", {"heartbeat": DISARMED, "fix": replace(at(up_m=9.0), velocity_m_s=(1.0, 0.0, 0.0))}, Verdict.OK),
    ("off-pad", {"heartbeat": DISARMED, "fix": replace(at(up_m=9.0), velocity_m_s=(0.0, 1.1, 0.0))}, Verdict.FAIL),
    ("battery-failsafe", {"alarm": LOW_TEXT}, Verdict.FAIL),
    ("heartbeat", {"heartbeat_s": NOW_S - 99.0}, Verdict.STALE),
    ("battery-critical", {"battery": pack(20.0, charge_state=3), "fix": at(age_s=99.0)}, Verdict.FAIL),
    ("link", {"heartbeat_s": NOW_S - 99.0, "fix": at(age_s=99.0)}, Verdict.OK),
]


@pytest.mark.parametrize(("name", "changes", "expected"), UNPLANNED_ROWS)
def test_where_no_plan_is_known(name: str, changes: dict[str, object], expected: Verdict) -> None:
    assert unplanned(name, **changes) is expected


WAITS_S = {
    "falling": 0.4, "battery-step": 2.5, "voltage-step": 3.0, "battery-critical": 3.0, "battery-failsafe": 1.0,
    "battery-plunge": 0.4, "battery-drain": 2.5, "reserve": 5.0, "mode": 1.0,
}  # fmt: skip


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
