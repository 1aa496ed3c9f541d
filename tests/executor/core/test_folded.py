"""One message, and everything that it changes of what is known of a vehicle."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import pytest

from executor.core.battery.account import BatterySample, Charge
from executor.core.battery.cusum import Drift
from executor.core.battery.kalman import BatteryEstimate
from executor.core.battery.roundings import Roundings
from executor.core.carried import Carried
from executor.core.context import Context
from executor.core.hearing import fold
from executor.core.messages import (
    Attitude,
    Battery,
    FenceStatus,
    FlightMessage,
    Gps,
    LandedState,
    MissionCurrent,
    OrderSeen,
    Position,
    Radio,
    StationHeard,
    StatusText,
    SystemStatus,
    Traffic,
    Wind,
)
from executor.core.parts import Fix
from executor.core.vehicle import Stage, VehicleState
from tests.executor.builders import flat, fleet_of, vehicle, with_facts
from tests.executor.core.faults.test_watchpoints import (
    AUTO,
    DISARMED,
    FLEET,
    LOW_TEXT,
    NOW_S,
    PAD_E,
    PAD_N,
    at,
    flying,
    pack,
    volts,
)
from tests.executor.core.steps import HOLD, Changes, beat, changes, landed, over_pad, rounded

CONTEXT = FLEET.context
PX4_FLEET = fleet_of(autopilot="px4")
PX4_CONTEXT = PX4_FLEET.context
UNPLANNED = replace(CONTEXT, vehicles={"uav1": replace(CONTEXT.vehicles["uav1"], planned=False)})
RESTS = landed(stage=Stage.LANDED)
BLIND = replace(pack(90.0, 90.0), charge=Charge())


def folded(one: VehicleState, message: FlightMessage, context: Context = CONTEXT) -> tuple[Any, ...]:
    """Return what a message changes, what it proves to be inspected, and its words."""
    found = fold.fold(context, one, message, NOW_S)
    changed = changes(one, found.state)
    for name in ("battery", "volts", "quality", "carried", "roundings"):
        if name in changed:
            changed[name] = changes(flat(one)[name], changed[name])
    for name in ("spoke_s", "heard_s"):
        if changed.get(name) == NOW_S:
            del changed[name]  # it was heard
    return (changed, *((found.inspected, found.text) if found.inspected is not None or found.text else ()))


def placed(
    east_m: float = 300.0,
    up_m: float = 20.0,
    *,
    boot_s: float = NOW_S,
    north_m: float = PAD_N,
    speed_m_s: float = 3.0,
    climbs_m_s: float = 0.0,
) -> Position:
    """Return a report of a place so far east of the pad."""
    lat_deg, lon_deg = CONTEXT.frame.to_wgs84_deg(PAD_E + east_m, north_m)
    return Position(boot_s, lat_deg, lon_deg, 450.0 + up_m, up_m, 0.0, speed_m_s, -climbs_m_s, None)


def moved(one: VehicleState, message: Position) -> Changes:
    """Return what a position changes but the position itself, as far as that is worth a word."""
    changed = changes(one, fold.fold(CONTEXT, one, message, NOW_S).state)
    for name in ("spoke_s", "heard_s", "fix"):
        changed.pop(name, None)
    if "battery" in changed:
        changed["battery"] = changed["battery"].modelled_pct - one.power.battery.modelled_pct
    if "anchor" in changed:
        changed["anchor"] = changed["anchor"].boot_s
    return changed


def inspects(*places: tuple[float, float], later: Changes | None = None, **given: Any) -> tuple[Any, ...]:
    """Return what came of places along the first segment, seen at (seconds, metres east of its pylon)."""
    one, found = flying(fix=None, **given), list[object]()
    for t_s, east_m in places:
        message = placed(100.0 - PAD_E + east_m, 15.0, boot_s=NOW_S + t_s, north_m=-5.0)
        step = fold.fold(CONTEXT, one, message, NOW_S + t_s)
        one = with_facts(step.state, **(later or {})) if t_s > 16.0 else step.state
        found += [(t_s, step.inspected)] if step.inspected is not None else []
    return found, one.assignment.run_visit, one.assignment.runs_broken, one.assignment.owed


ALONG = tuple((4.0 * step, 12.0 * step - 1.0) for step in range(10))


ROWS: list[tuple[str, Callable[[], object], object]] = [
    ("a HEARTBEAT like the last", lambda: folded(flying(), beat()), ({"flew_mission": True, "beat_boot_s": NOW_S},)),
    (
        "a HEARTBEAT of another mode",
        lambda: folded(flying(), beat(HOLD)),
        ({"heartbeat": beat(HOLD), "mode_since_s": NOW_S, "beat_boot_s": NOW_S},),
    ),
    (
        "the first HEARTBEAT",
        lambda: folded(flying(heartbeat=None, heartbeat_s=None, armed_once=False), beat()),
        (
            {
                "heartbeat": beat(),
                "mode_since_s": NOW_S,
                "armed_once": True,
                "heartbeat_s": NOW_S,
                "flew_mission": True,
                "beat_boot_s": NOW_S,
            },
        ),
    ),
    (
        "a HEARTBEAT after a silence",
        lambda: [
            folded(flying(heard_s=NOW_S - age_s, spoke_s=NOW_S - age_s, beat_boot_s=7.0), beat())
            for age_s in (2.9, 3.0)
        ],
        [
            ({"flew_mission": True, "beat_boot_s": NOW_S},),
            (
                {
                    "flew_mission": True,
                    "regained_s": NOW_S,
                    "unseen_until_s": NOW_S,
                    "unseen_from_boot_s": 7.0,
                    "beat_boot_s": NOW_S,
                },
            ),
        ],
    ),
    (
        "a HEARTBEAT after others were heard again",
        lambda: [
            folded(flying(heartbeat_s=NOW_S - 5.0, regained_s=regained_s, beat_boot_s=7.0), beat())
            for regained_s in (NOW_S - 5.0, NOW_S - 4.9)
        ],
        [
            ({"heartbeat_s": NOW_S, "flew_mission": True, "beat_boot_s": NOW_S},),
            (
                {
                    "heartbeat_s": NOW_S,
                    "flew_mission": True,
                    "unseen_until_s": NOW_S,
                    "unseen_from_boot_s": 7.0,
                    "beat_boot_s": NOW_S,
                },
            ),
        ],
    ),
    (
        "a HEARTBEAT that says that it stands, and it flies",
        lambda: folded(flying(), beat(armed=False)),
        ({"doubted": (beat(armed=False), NOW_S)},),
    ),
    (
        "a second one",
        lambda: [folded(flying(doubted=(DISARMED, NOW_S - age_s)), beat(armed=False)) for age_s in (2.4, 2.5)],
        [({},), ({"heartbeat": beat(armed=False), "disarmed_s": NOW_S, "beat_boot_s": NOW_S, "doubted": None},)],
    ),
    (
        "a HEARTBEAT that refutes it",
        lambda: folded(flying(doubted=(DISARMED, NOW_S - 1.0)), beat()),
        ({"flew_mission": True, "beat_boot_s": NOW_S, "doubted": None},),
    ),
    (
        "whom nobody doubts that says that it stands",
        lambda: [
            "doubted" in folded(flying(**given), beat(armed=False))[0]
            for given in (
                {},
                {"took_off": False},
                {"fix": None},
                {"fix": at(age_s=1.5)},
                {"fix": at(age_s=1.6)},
                {"on_ground": True},
                {"on_ground": False},
                {"alarm": ("Crash: Disarming", NOW_S - 5.0)},
                {"alarm": ("Crash: Disarming", NOW_S - 5.1)},
                {"alarm": ("Battery Failsafe", NOW_S)},
                {"heartbeat_s": NOW_S - 3.4},
                {"heartbeat_s": NOW_S - 3.5},
                {"heartbeat_s": None},
                {"fix": over_pad(2.0)},
                {"fix": over_pad(2.1)},
                {"fix": over_pad(climbs_m_s=1.0)},
                {"fix": over_pad(climbs_m_s=1.1)},
                {"heartbeat": DISARMED},
            )
        ],
        [
            True,
            False,
            False,
            True,
            False,
            False,
            True,
            False,
            True,
            True,
            True,
            False,
            False,
            False,
            True,
            False,
            True,
            False,
        ],
    ),
    (
        "a HEARTBEAT that says that it stands where nobody knows its plan",
        lambda: folded(flying(), beat(armed=False), UNPLANNED),
        ({"heartbeat": beat(armed=False), "disarmed_s": NOW_S, "beat_boot_s": NOW_S},),
    ),
    (
        "a position of the same time after a silence",
        lambda: moved(flying(fix=at(age_s=3.0)), placed(350.0, boot_s=NOW_S - 3.0)).get("jump"),
        None,
    ),
    (
        "a HEARTBEAT in its mission's mode in the air",
        lambda: [
            folded(flying(flew_mission=False, took_off=took_off), beat(mode, armed=armed))[0].get("flew_mission")
            for took_off, mode, armed in (
                (True, AUTO, True),
                (True, HOLD, True),
                (False, AUTO, True),
                (True, AUTO, False),
            )
        ],
        [True, None, None, None],
    ),
    (
        "a HEARTBEAT that says that it stands where it stands",
        lambda: folded(flying(fix=over_pad()), beat(armed=False)),
        ({"heartbeat": beat(armed=False), "disarmed_s": NOW_S, "beat_boot_s": NOW_S},),
    ),
    (
        "a position",
        lambda: folded(flying(fix=at(age_s=1.0)), placed()),
        (
            {
                "fix": Fix(
                    at_s=NOW_S,
                    boot_s=NOW_S,
                    place_m=(261.50000000008964, 15.400000001049465),
                    alt_rel_m=20.0,
                    alt_msl_m=470.0,
                    velocity_m_s=(3.0, 0.0, 0.0),
                ),
                "battery": {"modelled_pct": 0.107924},
                "run_visit": 0,
                "away_once": True,
            },
        ),
    ),
    (
        "what a position costs",
        lambda: [
            moved(flying(fix=at(age_s=age_s), heartbeat=heartbeat), placed(up_m=20.0)).get("battery")
            for age_s, heartbeat in ((1.0, beat()), (10.0, beat()), (599.0, beat()), (600.0, beat()), (1.0, DISARMED))
        ],
        [0.0359245, 0.359245, 21.5188, None, None],
    ),
    (
        "the first position",
        lambda: moved(flying(fix=None, anchor=None), placed()),
        {"anchor": NOW_S, "run_visit": 0, "away_once": True},
    ),
    (
        "a position that was overtaken",
        lambda: [
            folded(flying(fix=at(age_s=age_s)), placed(boot_s=NOW_S - back_s))
            for age_s, back_s in ((1.0, 1.0), (1.0, 60.9))
        ],
        [({},), ({},)],
    ),
    (
        "a position of a clock that began anew",
        lambda: [
            moved(flying(fix=at(age_s=age_s)), placed(boot_s=NOW_S - back_s))
            for age_s, back_s in ((1.0, 61.0), (3.0, 4.0), (2.9, 4.0))
        ],
        [
            {"anchor": NOW_S - 61.0, "run_visit": 0, "rebooted_s": NOW_S, "away_once": True},
            {"anchor": NOW_S - 4.0, "run_visit": 0, "rebooted_s": NOW_S, "away_once": True},
            {},
        ],
    ),
    (
        "a position near the last anchor",
        lambda: [
            moved(flying(fix=at(age_s=1.0), anchor=at(age_s=9.0)), placed(300.0 + away_m, 20.0 + up_m)).get("anchor")
            for away_m, up_m in ((2.9, 0.0), (3.1, 0.0), (0.0, 3.1), (2.2, 2.2))
        ],
        [None, NOW_S, NOW_S, NOW_S],
    ),
    (
        "a position of a clock before that of its anchor",
        lambda: moved(flying(fix=at(age_s=5.0), anchor=at(age_s=-50.0)), placed()).get("anchor"),
        NOW_S,
    ),
    (
        "a take-off",
        lambda: [
            moved(flying(fix=over_pad(age_s=1.0), took_off=False, heartbeat=heartbeat), placed(0.0, up_m)).get(
                "took_off"
            )
            for up_m, heartbeat in ((2.0, beat()), (2.1, beat()), (2.1, DISARMED))
        ],
        [None, True, None],
    ),
    (
        "away from its pad",
        lambda: [
            moved(flying(took_off=took_off, fix=over_pad(1.0, age_s=1.0)), placed(away_m, 1.0)).get("away_once")
            for away_m, took_off in ((14.9, True), (15.1, True), (15.1, False))
        ],
        [None, True, None],
    ),
    (
        "a fall",
        lambda: [
            moved(flying(fix=at(age_s=1.0), took_off=took_off), placed(up_m=1.0, climbs_m_s=-speed_m_s)).get("falls_s")
            for speed_m_s, took_off in ((5.0, True), (5.1, True), (5.1, False))
        ],
        [None, NOW_S, None],
    ),
    (
        "a jump",
        lambda: [
            moved(flying(fix=at(age_s=age_s)), placed(300.0 + away_m)).get("jump")
            for age_s, away_m in (
                (1.0, 12.9),
                (1.0, 13.1),
                (2.0, 25.9),
                (2.0, 26.1),
                (9.9, 200.0),
                (10.0, 200.0),
                (0.5, 11.6),
            )
        ],
        [None, (10.1, NOW_S), None, (20.1, NOW_S), (170.3, NOW_S), None, (10.1, NOW_S)],
    ),
    (
        "a jump to the side",
        lambda: moved(
            flying(fix=replace(at(age_s=2.0), velocity_m_s=(3.0, 4.0, 0.0))), placed(306.0, north_m=PAD_N + 30.0)
        ).get("jump"),
        (26.0, NOW_S),
    ),
    ("an inspection", lambda: inspects(*ALONG), ([(36.0, 0)], 0, (), None)),
    (
        "an inspection in another stage",
        lambda: [inspects(*ALONG, stage=stage)[0] for stage in Stage],
        [[], [], [(36.0, 0)], [], [(36.0, 0)], [], [], []],
    ),
    (
        "an inspection by a pilot in another mode",
        lambda: inspects(*ALONG, stage=Stage.PILOT, heartbeat=beat(HOLD))[0],
        [],
    ),
    ("an inspection of another mission", lambda: inspects(*ALONG, carried=Carried(foreign_s=5.0))[0], []),
    ("an inspection whose item is ahead", lambda: inspects(*ALONG, waypoint=3), ([], 1, (), None)),
    ("an inspection on the way home", lambda: inspects(*ALONG, waypoint=4), ([], None, (), None)),
    ("an inspection on the way to it", lambda: inspects(*ALONG, waypoint=1), ([(36.0, 0)], 0, (), None)),
    (
        "an inspection that breaks",
        lambda: inspects(*ALONG[:4], (60.0, 40.0)),
        ([], 0, ((0, "no position for 48.0 s"),), (0, "no position for 48.0 s")),
    ),
    (
        "a battery",
        lambda: folded(flying(), Battery(0, 89.0, 15.0, 20.0, None, 1, 0, (3.75,) * 4)),
        (
            {
                "battery": {
                    "remaining_pct": 89.0,
                    "least_pct": 89.0,
                    "history": (
                        BatterySample(at_s=NOW_S - 1.0, remaining_pct=90.0, modelled_pct=0.036),
                        BatterySample(at_s=NOW_S, remaining_pct=90.0, modelled_pct=0.072),
                        BatterySample(at_s=NOW_S, remaining_pct=89.0, modelled_pct=0.072),
                    ),
                    "lowest_pct": 89.0,
                    "estimate": BatteryEstimate(
                        remaining_pct=89.9634,
                        factor=1.00001,
                        var_remaining=0.0830928,
                        covariance=-0.000800447,
                        var_factor=0.0225749,
                    ),
                    "drift": Drift(excess_pct=1.0, used_pct=1.0, since_s=NOW_S, reports=1, biggest_pct=1.0),
                    "slow": Drift(excess_pct=1.0, used_pct=1.0, since_s=NOW_S, reports=1, biggest_pct=1.0),
                },
                "packs": ((0, 89.0),),
                "volts": {"began_s": NOW_S, "cells_v": (3.75, 3.75, 3.75, 3.75)},
            },
        ),
    ),
    (
        "a battery of which more is known",
        lambda: folded(flying(), Battery(0, 89.0, 15.0, 20.0, 1.5, 2, 4)),
        (
            {
                "battery": {
                    "remaining_pct": 89.0,
                    "least_pct": 89.0,
                    "charge_state": 2,
                    "history": (
                        BatterySample(at_s=NOW_S - 1.0, remaining_pct=90.0, modelled_pct=0.036),
                        BatterySample(at_s=NOW_S, remaining_pct=90.0, modelled_pct=0.072),
                        BatterySample(at_s=NOW_S, remaining_pct=89.0, modelled_pct=0.072),
                    ),
                    "lowest_pct": 89.0,
                    "estimate": BatteryEstimate(
                        remaining_pct=89.9634,
                        factor=1.00001,
                        var_remaining=0.0830928,
                        covariance=-0.000800447,
                        var_factor=0.0225749,
                    ),
                    "drift": Drift(excess_pct=1.0, used_pct=1.0, since_s=NOW_S, reports=1, biggest_pct=1.0),
                    "slow": Drift(excess_pct=1.0, used_pct=1.0, since_s=NOW_S, reports=1, biggest_pct=1.0),
                    "charge": Charge(consumed_ah=1.5, at_s=NOW_S, modelled_pct=0.072, began_ah=1.5, began_pct=90.0),
                },
                "packs": ((0, 89.0),),
                "volts": {"began_s": NOW_S},
                "battery_faults": 4,
            },
        ),
    ),
    (
        "a battery on the ground",
        lambda: folded(RESTS, Battery(0, 89.0, 15.0, 20.0, 1.5, 1, 0)),
        (
            {
                "battery": {
                    "remaining_pct": 89.0,
                    "least_pct": 89.0,
                    "history": (
                        BatterySample(at_s=NOW_S - 1.0, remaining_pct=90.0, modelled_pct=0.036),
                        BatterySample(at_s=NOW_S, remaining_pct=90.0, modelled_pct=0.072),
                        BatterySample(at_s=NOW_S, remaining_pct=89.0, modelled_pct=0.072),
                    ),
                    "lowest_pct": 89.0,
                    "estimate": BatteryEstimate(
                        remaining_pct=89.9634,
                        factor=1.00001,
                        var_remaining=0.0830928,
                        covariance=-0.000800447,
                        var_factor=0.0225749,
                    ),
                    "drift": Drift(excess_pct=1.0, used_pct=1.0, since_s=NOW_S, reports=1, biggest_pct=1.0),
                    "slow": Drift(excess_pct=1.0, used_pct=1.0, since_s=NOW_S, reports=1, biggest_pct=1.0),
                },
                "packs": ((0, 89.0),),
                "volts": {"usual_v": None, "drop": 0.0},
            },
        ),
    ),
    (
        "a battery without a percentage",
        lambda: folded(flying(), Battery(0, None, 15.0, None, None, 0, 0)),
        ({"volts": {"began_s": NOW_S, "known_load": False}},),
    ),
    (
        "a second battery",
        lambda: folded(flying(packs=((0, 80.0),)), Battery(1, 89.0, 15.0, 20.0, 1.5, 1, 0)),
        (
            {
                "battery": {
                    "remaining_pct": 80.0,
                    "least_pct": 80.0,
                    "history": (
                        BatterySample(at_s=NOW_S - 1.0, remaining_pct=90.0, modelled_pct=0.036),
                        BatterySample(at_s=NOW_S, remaining_pct=90.0, modelled_pct=0.072),
                        BatterySample(at_s=NOW_S, remaining_pct=80.0, modelled_pct=0.072),
                    ),
                    "lowest_pct": 80.0,
                    "estimate": BatteryEstimate(
                        remaining_pct=80.0,
                        factor=0.999996,
                        var_remaining=0.0833333,
                        covariance=0.0,
                        var_factor=0.0225749,
                    ),
                    "drift": Drift(jumped_s=NOW_S, jumped_pct=10.0),
                    "slow": Drift(jumped_s=NOW_S, jumped_pct=10.0),
                },
                "packs": ((0, 80.0), (1, 89.0)),
            },
        ),
    ),
    (
        "a battery that is full again",
        lambda: [
            folded(flying(battery=pack(70.0)), Battery(0, percent, None, None, None, 1, 0))[0]["battery"][
                "remaining_pct"
            ]
            for percent in (90.0, 90.1)
        ],
        [90.0, 90.1],
    ),
    (
        "a battery that is full again began anew",
        lambda: [
            folded(flying(battery=pack(90.0, 70.0)), Battery(0, percent, None, None, None, 1, 0))[0]["battery"].get(
                "first_pct"
            )
            for percent in (90.0, 90.1)
        ],
        [None, 90.1],
    ),
    (
        "a battery of PX4's",
        lambda: folded(
            flying(battery=BLIND, roundings=Roundings(ceiled=90.0, ceiled_s=NOW_S - 1.0)),
            Battery(0, 89.0, None, None, None, 1, 0),
            PX4_CONTEXT,
        ),
        (
            {
                "battery": {
                    "remaining_pct": 89.25,
                    "least_pct": 89.25,
                    "history": (
                        BatterySample(at_s=NOW_S - 1.0, remaining_pct=90.0, modelled_pct=0.036),
                        BatterySample(at_s=NOW_S, remaining_pct=90.0, modelled_pct=0.072),
                        BatterySample(at_s=NOW_S, remaining_pct=89.25, modelled_pct=0.072),
                    ),
                    "lowest_pct": 89.25,
                    "estimate": BatteryEstimate(
                        remaining_pct=89.9636,
                        factor=1.0,
                        var_remaining=0.0830928,
                        covariance=-0.000800447,
                        var_factor=0.0225749,
                    ),
                    "drift": Drift(excess_pct=0.75, used_pct=0.75, since_s=NOW_S, reports=1, biggest_pct=0.75),
                    "slow": Drift(excess_pct=0.75, used_pct=0.75, since_s=NOW_S, reports=1, biggest_pct=0.75),
                },
                "packs": ((0, 89.0),),
                "roundings": {"rounded": 89.0, "rounded_s": NOW_S},
            },
        ),
    ),
    (
        "a status of PX4's",
        lambda: folded(
            flying(battery=BLIND, packs=((0, 89.0),), roundings=Roundings(rounded=89.0, rounded_s=NOW_S - 1.0)),
            SystemStatus(90.0, None, 0, None),
            PX4_CONTEXT,
        ),
        (
            {
                "battery": {
                    "remaining_pct": 89.25,
                    "least_pct": 89.25,
                    "history": (
                        BatterySample(at_s=NOW_S - 1.0, remaining_pct=90.0, modelled_pct=0.036),
                        BatterySample(at_s=NOW_S, remaining_pct=90.0, modelled_pct=0.072),
                        BatterySample(at_s=NOW_S, remaining_pct=89.25, modelled_pct=0.072),
                    ),
                    "lowest_pct": 89.25,
                    "estimate": BatteryEstimate(
                        remaining_pct=89.9636,
                        factor=1.0,
                        var_remaining=0.0830928,
                        covariance=-0.000800447,
                        var_factor=0.0225749,
                    ),
                    "drift": Drift(excess_pct=0.75, used_pct=0.75, since_s=NOW_S, reports=1, biggest_pct=0.75),
                    "slow": Drift(excess_pct=0.75, used_pct=0.75, since_s=NOW_S, reports=1, biggest_pct=0.75),
                },
                "roundings": {"ceiled": 90.0, "ceiled_s": NOW_S},
            },
        ),
    ),
    (
        "a status of PX4's of several packs",
        lambda: folded(
            flying(battery=BLIND, packs=((0, 89.0), (1, 90.0))), SystemStatus(90.0, None, 0, None), PX4_CONTEXT
        ),
        ({},),
    ),
    (
        "a status",
        lambda: [
            folded(
                flying(battery=pack(90.0, age_s=age_s), volts=volts(age_s=age_s)), SystemStatus(85.0, 14.0, 32, None)
            )
            for age_s in (7.0, 7.1)
        ],
        [
            ({"unhealthy": 32},),
            (
                {
                    "battery": {
                        "remaining_pct": 85.0,
                        "least_pct": 85.0,
                        "reported_s": NOW_S,
                        "charge_state": 0,
                        "history": (
                            BatterySample(at_s=NOW_S - 7.1, remaining_pct=90.0, modelled_pct=0.036),
                            BatterySample(at_s=NOW_S, remaining_pct=85.0, modelled_pct=0.036),
                        ),
                        "lowest_pct": 85.0,
                        "estimate": BatteryEstimate(
                            remaining_pct=85.0, factor=1.0, var_remaining=0.0833333, covariance=0.0, var_factor=0.0225
                        ),
                        "began_s": NOW_S,
                        "drift": Drift(excess_pct=4.574, used_pct=5.0, since_s=NOW_S - 7.1, reports=1, biggest_pct=5.0),
                        "slow": Drift(excess_pct=5.0, used_pct=5.0, since_s=NOW_S - 7.1, reports=1, biggest_pct=5.0),
                    },
                    "volts": {"reported_s": NOW_S, "voltage_v": 14.0, "began_s": NOW_S, "known_load": False},
                    "unhealthy": 32,
                },
            ),
        ],
    ),
    (
        "a status without a percentage",
        lambda: folded(flying(battery=pack(90.0, age_s=9.0)), SystemStatus(None, None, 0, None)),
        ({},),
    ),
    ("an item", lambda: folded(flying(), MissionCurrent(7, None)), ({"waypoint": 4, "item": (7, None)},)),
    (
        "items",
        lambda: [
            fold.fold(CONTEXT, flying(waypoint=waypoint), MissionCurrent(seq, None), NOW_S).state.assignment.waypoint
            for waypoint, seq in ((2, 0), (2, 1), (2, 9), (2, 10), (2, -1), (5, 4), (4, 4), (5, 9))
        ],
        [2, 0, 5, 2, 2, 5, 2, 5],
    ),
    (
        "items of PX4's",
        lambda: [
            fold.fold(
                PX4_CONTEXT,
                vehicle(PX4_FLEET, "uav1", stage=Stage.FLYING, waypoint=1),
                MissionCurrent(seq, None),
                NOW_S,
            ).state.assignment.waypoint
            for seq in (-1, 0, 1, 3)
        ],
        [1, 0, 1, 2],
    ),
    (
        "an inspection whose item moves on to the way home",
        lambda: inspects(*ALONG, later={"waypoint": 4}),
        ([(36.0, 0)], 0, (), None),
    ),
    (
        "items in other stages",
        lambda: [
            fold.fold(CONTEXT, flying(stage=stage), MissionCurrent(7, None), NOW_S).state.assignment.waypoint
            for stage in Stage
        ],
        [2, 4, 4, 2, 4, 2, 2, 4],
    ),
    (
        "items of another mission",
        lambda: folded(flying(), MissionCurrent(7, 12)),
        ({"item": (7, 12), "carried": {"foreign_s": NOW_S, "words": "12 items where ours has 9"}},),
    ),
    (
        "items of another mission while it is given one",
        lambda: [
            folded(flying(**given), MissionCurrent(7, 12))[0].get("carried")
            for given in ({"pending": 4}, {"stubborn": True}, {"stage": Stage.RETURNING}, {"board": None})
        ],
        [None, None, None, None],
    ),
    ("on the ground", lambda: folded(flying(), LandedState(True)), ({"on_ground": True},)),
    ("satellites", lambda: folded(flying(), Gps(3, 12)), ({"gps": Gps(fix=3, satellites=12)},)),
    ("wind", lambda: folded(flying(), Wind(4.0, 90.0)), ({"wind": Wind(speed_m_s=4.0, from_deg=90.0)},)),
    (
        "an attitude",
        lambda: [
            folded(flying(tilted_since_s=since_s), Attitude(roll_deg, pitch_deg))[0].get("tilted_since_s")
            for since_s in (None, 5.0)
            for roll_deg, pitch_deg in ((75.0, 0.0), (75.1, 0.0), (0.0, -75.1))
        ],
        [None, NOW_S, NOW_S, None, None, None],
    ),
    ("a fence", lambda: folded(flying(), FenceStatus(True)), ({"fence_breached": True},)),
    ("words", lambda: folded(flying(), StatusText(4, "hello")), ({}, None, StatusText(severity=4, text="hello"))),
    (
        "words of an alarm",
        lambda: folded(flying(), StatusText(4, "Battery Failsafe")),
        ({"alarm": LOW_TEXT}, None, StatusText(severity=4, text="Battery Failsafe")),
    ),
    (
        "words that only say what follows",
        lambda: [
            folded(flying(alarm=("Low battery", NOW_S - age_s)), StatusText(4, "Failsafe activated: Return"))[0].get(
                "alarm"
            )
            for age_s in (4.9, 5.0)
        ],
        [None, ("Failsafe activated: Return", NOW_S)],
    ),
    (
        "words of a mission that somebody else put on board",
        lambda: folded(flying(), StatusText(6, "Flight plan received")),
        (
            {"carried": {"told_s": NOW_S}},
            None,
            StatusText(severity=6, text="Flight plan received"),
        ),
    ),
    ("an order of others", lambda: folded(flying(spoke_s=5.0), OrderSeen(21)), ({"ordered_mode_s": NOW_S},)),
    (
        "traffic",
        lambda: folded(flying(spoke_s=5.0), Traffic(30, 1)),
        ({"quality": {"window": ((NOW_S, 30, 1),), "lost": 0.0322581, "usual": 0.0322581}},),
    ),
    (
        "a radio",
        lambda: folded(flying(spoke_s=5.0), Radio(80, 60, 20, 20, 90)),
        (
            {
                "quality": {
                    "radio": Radio(rssi=80, remote_rssi=60, noise=20, remote_noise=20, free_buffer_pct=90),
                    "radio_s": NOW_S,
                }
            },
        ),
    ),
    (
        "another station",
        lambda: folded(flying(spoke_s=5.0), StationHeard(254, 190)),
        ({"strangers": frozenset({StationHeard(system=254, component=190)})},),
    ),
    (
        "the end of a silence",
        lambda: [folded(flying(spoke_s=NOW_S - age_s), Wind(4.0, 90.0))[0].get("regained_s") for age_s in (2.9, 3.0)],
        [None, NOW_S],
    ),
]


@pytest.mark.parametrize(("what", "found", "expected"), ROWS, ids=[row[0] for row in ROWS])
def test_everything_that_comes_of_it(what: str, found: Callable[[], object], expected: object) -> None:
    assert rounded(found()) == expected
