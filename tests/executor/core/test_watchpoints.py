"""Watchpoints and warnings at their limits, one look at a time."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import pytest

from executor.core.battery.account import BatteryState, Charge
from executor.core.battery.cusum import Drift
from executor.core.context import VehicleSetup
from executor.core.faults import streams, warnings, watchpoints
from executor.core.faults.watching import View
from executor.core.link_quality import LinkQuality
from executor.core.messages import Heartbeat, Radio
from executor.core.parts import Cause
from executor.core.state import Told
from executor.core.vehicle import Stage, VehicleState
from missions import PX4
from tests.executor.builders import with_facts
from tests.executor.core.faults.test_watchpoints import DISARMED, FLEET, NOW_S, RTL, at, flying, pack, volts
from tests.executor.core.steps import HOLD, HOMEWARD, STILL, Changes, beat, landed, over_pad, rounded

CONTEXT = FLEET.context
PLANNED = CONTEXT.vehicles["uav1"]
UNPLANNED = replace(PLANNED, planned=False)


def look(name: str, one: VehicleState, setup: VehicleSetup = PLANNED, *, failing: bool = False) -> str:
    """Return what a watchpoint finds: its evidence, ok, or stale."""
    point = next(point for point in watchpoints.TABLE if point.name == name)
    found = point.judge(View(CONTEXT, setup, one, failing, NOW_S))
    return found.evidence or found.verdict.value


def warn(name: str, one: VehicleState, setup: VehicleSetup = PLANNED) -> str:
    """Return what a warning says."""
    row = next(row for row in warnings.TABLE if row.name == name)
    return row.look(View(CONTEXT, setup, one, False, NOW_S))


def beside(given: Changes) -> VehicleState:
    return landed(**{"stage": Stage.FLYING, **given})


UNSEEN = {"heartbeat_s": NOW_S - 60.0, "fix": at(age_s=60.0)}
HAND: Changes = {"heartbeat": beat(HOLD), "flew_mission": True, "mode_since_s": NOW_S - 60.0, "ordered_mode_s": 5.0}
KNOWN: list[Changes] = [
    {},
    {"dropped_s": None},
    {"usual_v": None},
    {"voltage_v": None},
    {"reported_s": NOW_S - 7.0},
    {"reported_s": NOW_S - 7.1},
]
SAYS = flying(alarm=("Battery Failsafe", NOW_S - 15.0))
DRAIN = Drift(2.5, 5.0, 2.5, NOW_S - 30.0, 4, 0.0, 0.0, 0.2)
COUNTS = Charge(consumed_ah=2.0, began_ah=1.0)


def drained(**given: Any) -> VehicleState:
    return flying(battery=replace(pack(90.0, 90.0), **given))


ROWS: list[tuple[str, Callable[[], object], object]] = [
    (
        "until when one is not lost",
        lambda: [look("link", flying(heard_s=NOW_S - age_s)) for age_s in (9.9, 10.0)],
        ["ok", "link lost for 10.0 s, time-out 10 s"],
    ),
    (
        "who says nothing of itself",
        lambda: [
            look("link", flying(**UNSEEN | given), setup)
            for given in (
                {},
                {"heartbeat_s": NOW_S - 59.9},
                {"fix": at(age_s=59.9)},
                {"fix": None},
                {"heartbeat_s": None},
                {"excused_s": NOW_S - 59.9},
            )
            for setup in (PLANNED, UNPLANNED)
        ],
        ["neither HEARTBEAT nor position for 60 s", "ok", "ok", "ok", "ok", "ok", "ok", "ok", "ok", "ok", "ok", "ok"],
    ),
    (
        "who says nothing of itself, with a long time-out",
        lambda: [
            look("link", flying(**UNSEEN), replace(PLANNED, link_timeout_s=timeout_s)) for timeout_s in (60.0, 60.1)
        ],
        ["neither HEARTBEAT nor position for 60 s", "ok"],
    ),
    (
        "where one may disarm",
        lambda: [look("off-pad", beside({"fix": over_pad(north_m=-north_m)})) for north_m in (15.0, 15.1)],
        ["ok", "disarmed 15 m from its pad, 0 m high"],
    ),
    (
        "how high one may disarm",
        lambda: [look("off-pad", beside({"fix": over_pad(up_m)})) for up_m in (5.0, 5.1)],
        ["ok", "disarmed 5 m above its pad"],
    ),
    (
        "how old a height may be",
        lambda: [
            look("off-pad", beside({"fix": over_pad(9.0, age_s=age_s), "disarmed_s": NOW_S - 8.0}))
            for age_s in (1.5, 1.6, 3.1, 6.0)
        ],
        ["disarmed 9 m above its pad", "stale", "stale", "ok"],
    ),
    (
        "who disarms before it took off",
        lambda: [
            look("off-pad", beside({"took_off": False, "stage": stage})) for stage in (Stage.FLYING, Stage.STARTING)
        ],
        ["disarmed on its pad before it took off", "ok"],
    ),
    (
        "who disarms in the midst of its mission",
        lambda: [
            look("off-pad", beside({"away_once": False, "waypoint": 2, "stage": stage}))
            for stage in (Stage.FLYING, Stage.RETURNING, Stage.PILOT)
        ],
        ["disarmed over its pad in mid-mission", "ok", "ok"],
    ),
    (
        "who disarms and has started anew",
        lambda: [
            look("off-pad", beside({"rebooted_s": 5.0, "alarm": ("Crash: Disarming", NOW_S - age_s)}))
            for age_s in (15.0, 15.1)
        ],
        [
            "its autopilot has rebooted, and it is disarmed; it says: Crash: Disarming",
            "its autopilot has rebooted, and it is disarmed",
        ],
    ),
    (
        "who never armed, or is armed",
        lambda: [
            look("off-pad", flying(**given))
            for given in ({"armed_once": False, "heartbeat": DISARMED}, {}, {"heartbeat": None})
        ],
        ["ok", "ok", "stale"],
    ),
    (
        "who may land anywhere must rest",
        lambda: [
            look("off-pad", flying(heartbeat=DISARMED, fix=fix, on_ground=on_ground), UNPLANNED)
            for fix, on_ground in (
                (at(up_m=5.1), None),
                (at(up_m=5.0), None),
                (at(), True),
                (at(), False),
                (at(age_s=3.0), None),
                (at(age_s=3.1), None),
                (STILL, None),
                (replace(at(), velocity_m_s=(1.0, 0.0, 0.0)), None),
                (None, None),
            )
        ],
        [
            "disarmed 5 m over its home at 3.0 m/s",
            "ok",
            "ok",
            "disarmed 20 m over its home at 3.0 m/s",
            "disarmed 20 m over its home at 3.0 m/s",
            "ok",
            "ok",
            "ok",
            "stale",
        ],
    ),
    (
        "who gives itself up",
        lambda: [
            look("terminated", flying(heartbeat=beat(armed=armed, status=status), alarm=("Crash", NOW_S - 15.0)))
            for armed in (True, False)
            for status in (5, 6, 7, 8)
        ],
        [
            "ok",
            "reports an emergency; it says: Crash",
            "ok",
            "reports that its flight is terminated; it says: Crash",
            "ok",
            "ok",
            "ok",
            "ok",
        ],
    ),
    (
        "how fast one may sink",
        lambda: [
            look("falling", flying(fix=at(climbs_m_s=climbs_m_s, age_s=age_s)))
            for climbs_m_s, age_s in ((-5.0, 0.0), (-5.1, 3.0), (-5.1, 3.1))
        ],
        ["ok", "falls at 5.1 m/s", "stale"],
    ),
    (
        "whose failsafe took it off its mission",
        lambda: [
            look("mode", flying(heartbeat=beat(RTL, armed=armed), cause=cause, alarm=("Radio Failsafe", NOW_S)))
            for armed in (True, False)
            for cause in Cause
        ],
        ["ok", "ok", "RTL by its own failsafe; it says: Radio Failsafe", "ok", "ok", "ok", "ok", "ok"],
    ),
    (
        "who left a mission that nobody planned",
        lambda: [
            look("mode", flying(**HAND | given), UNPLANNED)
            for given in (
                {},
                {"heartbeat": beat()},
                {"heartbeat": beat(HOLD, armed=False)},
                {"flew_mission": False},
                {"ordered_mode_s": NOW_S - 3.0},
                {"ordered_mode_s": NOW_S - 2.9},
                {"mode_since_s": 8.0},
                {"mode_since_s": 7.9},
                {"heartbeat": None},
            )
        ],
        [
            "went to mode HOLD by itself",
            "ok",
            "ok",
            "ok",
            "went to mode HOLD by itself",
            "ok",
            "went to mode HOLD by itself",
            "ok",
            "stale",
        ],
    ),
    (
        "who left a mission that nobody planned at its end",
        lambda: [
            look("mode", flying(**HAND | {"heartbeat": beat(mode), "item": item}), setup)
            for mode in (RTL, HOLD)
            for item in ((9, 10), (8, 10), (9, None), (65534, 65535), None)
            for setup in (UNPLANNED,)
        ],
        [
            "ok",
            "went to mode RTL by itself",
            "went to mode RTL by itself",
            "went to mode RTL by itself",
            "went to mode RTL by itself",
            "went to mode HOLD by itself",
            "went to mode HOLD by itself",
            "went to mode HOLD by itself",
            "went to mode HOLD by itself",
            "went to mode HOLD by itself",
        ],
    ),
    (
        "who left a mission of PX4's that nobody planned at its end",
        lambda: [
            look(
                "mode",
                flying(**HAND | {"heartbeat": Heartbeat(12, 5 << 24 | 4 << 16, True, 4), "item": item}),
                replace(UNPLANNED, dialect=PX4),
            )
            for item in ((8, 10), (7, 10))
        ],
        ["ok", "went to mode RTL by itself"],
    ),
    (
        "a step of the battery",
        lambda: [
            look("battery-step", flying(battery=pack(90.0, 90.0, left_pct, age_s=age_s)))
            for left_pct, age_s in ((82.1, 0.0), (81.9, 0.0), (81.9, 7.0), (81.9, 7.1))
        ],
        [
            "ok",
            "lost 8 % at once where the flight costs 0.1 %",
            "lost 8 % at once where the flight costs 0.1 %",
            "stale",
        ],
    ),
    (
        "a step of the battery some seconds ago",
        lambda: [
            look("battery-step", flying(battery=pack(90.0, 60.0, *[60.0] * after)), failing=failing)
            for after in (5, 6, 23, 24)
            for failing in (False, True)
        ],
        [
            "lost 30 % at once where the flight costs 0.2 %",
            "lost 30 % at once where the flight costs 0.2 %",
            "lost 30 % at once where the flight costs 0.3 %",
            "lost 30 % at once where the flight costs 0.3 %",
            "lost 30 % at once where the flight costs 0.9 %",
            "lost 30 % at once where the flight costs 0.9 %",
            "ok",
            "ok",
        ],
    ),
    (
        "a step of the battery that nobody looked at",
        lambda: [
            look(
                "battery-step",
                drained(
                    history=pack(90.0, 60.0, *[60.0] * 9).history, drift=Drift(jumped_s=jumped_s, jumped_pct=jumped_pct)
                ),
            )
            for jumped_s, jumped_pct in ((NOW_S - 24.0, 8.0), (NOW_S - 24.1, 8.0), (NOW_S, 7.9))
        ],
        ["lost 30 % at once where the flight costs 0.4 %", "ok", "ok"],
    ),
    (
        "a battery without a position is not known",
        lambda: [
            look("battery-step", flying(battery=pack(90.0, 60.0), fix=at(age_s=age_s)), setup)
            for age_s in (3.0, 3.1)
            for setup in (PLANNED, UNPLANNED)
        ],
        [
            "lost 30 % at once where the flight costs 0.0 %",
            "lost 30 % at once where the flight costs 0.0 %",
            "stale",
            "lost 30 % at once where the flight costs 0.0 %",
        ],
    ),
    (
        "a drain of a battery that is blind",
        lambda: [
            look(
                "battery-drain",
                with_facts(drained(drift=replace(DRAIN, excess_pct=excess_pct)), fix=at(climbs_m_s=climbs_m_s)),
                failing=failing,
            )
            for excess_pct, climbs_m_s, failing in (
                (2.3, 0.0, False),
                (2.4, 0.0, False),
                (1.9, 0.0, True),
                (2.0, 0.0, True),
                (2.5, 0.4, False),
                (2.5, 0.3, False),
            )
        ],
        [
            "ok",
            "used 5.0 % in 30 s where 2.5 % is usual",
            "ok",
            "used 5.0 % in 30 s where 2.5 % is usual",
            "ok",
            "used 5.0 % in 30 s where 2.5 % is usual",
        ],
    ),
    (
        "a drain of a battery that is counted",
        lambda: [
            look(
                "battery-drain",
                drained(drift=replace(DRAIN, excess_pct=excess_pct), charge=COUNTS, roughness_pct=rough_pct),
            )
            for excess_pct, rough_pct in ((1.9, 0.0), (2.0, 0.0), (2.4, 0.5), (2.5, 0.5))
        ],
        ["ok", "used 5.0 % in 30 s where 2.5 % is usual", "ok", "used 5.0 % in 30 s where 2.5 % is usual"],
    ),
    (
        "a drain by the counter",
        lambda: [
            look("battery-drain", drained(charge=replace(COUNTS, drift=replace(DRAIN, excess_pct=excess_pct))))
            for excess_pct in (0.9, 1.0)
        ],
        ["ok", "used 5.0 % in 30 s where 2.5 % is usual by its counter of charge"],
    ),
    (
        "a slow drain",
        lambda: [
            look("battery-drain", drained(slow=replace(DRAIN, excess_pct=excess_pct), charge=charge))
            for excess_pct, charge in ((5.4, Charge()), (5.5, Charge()), (3.9, COUNTS), (4.0, COUNTS))
        ],
        [
            "ok",
            "used 5.0 % in 30 s where 2.5 % is usual over minutes",
            "ok",
            "used 5.0 % in 30 s where 2.5 % is usual over minutes",
        ],
    ),
    (
        "a drain in a hurry",
        lambda: [
            look(
                "battery-plunge",
                drained(
                    drift=replace(DRAIN, excess_pct=excess_pct), slow=replace(DRAIN, excess_pct=9.0), charge=charge
                ),
            )
            for excess_pct, charge in ((2.3, Charge()), (2.4, Charge()), (3.3, COUNTS), (3.4, COUNTS))
        ],
        ["ok", "used 5.0 % in 30 s where 2.5 % is usual", "ok", "used 5.0 % in 30 s where 2.5 % is usual"],
    ),
    (
        "a voltage that drops",
        lambda: [
            look("voltage-step", flying(volts=volts(drop=drop, known_load=known, dropped_s=5.0)), failing=failing)
            for drop, known, failing in (
                (0.049, True, False),
                (0.05, True, False),
                (0.064, False, False),
                (0.065, False, False),
                (0.034, True, True),
                (0.036, True, True),
            )
        ],
        [
            "ok",
            "15.00 V where 15.20 V is usual under this load",
            "ok",
            "15.00 V where 15.20 V is usual under this load",
            "ok",
            "15.00 V where 15.20 V is usual under this load",
        ],
    ),
    (
        "a voltage of which something is not known",
        lambda: [
            look("voltage-step", flying(volts=replace(volts(drop=0.2, dropped_s=5.0), **given))) for given in KNOWN
        ],
        [
            "15.00 V where 15.20 V is usual under this load",
            "ok",
            "ok",
            "ok",
            "15.00 V where 15.20 V is usual under this load",
            "stale",
        ],
    ),
    (
        "weak cells",
        lambda: [
            look("cells", flying(volts=volts(**given)))
            for given in (
                {"low_since_s": NOW_S - 9.9},
                {"low_since_s": NOW_S - 10.0},
                {"cells_v": (3.9, 3.9, 3.5), "spread_since_s": NOW_S - 10.0},
                {"cells_v": (3.9, 3.9, 3.5), "spread_since_s": NOW_S - 9.9},
                {"low_since_s": 5.0, "reported_s": NOW_S - 7.0},
                {"low_since_s": 5.0, "reported_s": NOW_S - 7.1},
            )
        ],
        [
            "ok",
            "3.75 V a cell under load",
            "one cell at 3.50 V, 0.40 V below the others",
            "ok",
            "3.75 V a cell under load",
            "stale",
        ],
    ),
    (
        "a reserve",
        lambda: [
            look("reserve", flying(battery=pack(percent, percent), waypoint=waypoint), failing=failing)
            for percent, waypoint, failing in (
                (14.0, 2, False),
                (16.0, 2, False),
                (17.0, 2, False),
                (17.5, 2, True),
                (18.0, 2, True),
                (14.0, 4, False),
                (14.0, 5, False),
            )
        ],
        [
            ("would land with 10 % of its battery, give or take 1.7, reserve 15 %: below it by 99 % probability"),
            "ok",
            "ok",
            "ok",
            "ok",
            "ok",
            "ok",
        ],
    ),
    (
        "what an autopilot says of its battery",
        lambda: [
            look("battery-failsafe", with_facts(SAYS, **given), setup)
            for setup in (PLANNED, UNPLANNED)
            for given in (
                {},
                {"alarm": ("Battery Failsafe", NOW_S - 15.1)},
                {"alarm": ("Low battery", NOW_S)},
                {"heartbeat": beat(status=4)},
                {"heartbeat": beat(status=5)},
                {"heartbeat": beat(RTL)},
            )
        ],
        [
            "ok",
            "ok",
            "ok",
            "ok",
            "it says: Battery Failsafe",
            "it says: Battery Failsafe",
            "it says: Battery Failsafe",
            "ok",
            "ok",
            "it says: Battery Failsafe",
            "it says: Battery Failsafe",
            "it says: Battery Failsafe",
        ],
    ),
    (
        "what shows a battery's failsafe",
        lambda: [
            look("battery-failsafe", with_facts(SAYS, **given)) != "ok"
            for given in (
                {"battery": BatteryState()},
                {"battery": pack(30.0)},
                {"battery": pack(30.1)},
                {"battery": pack(90.0, charge_state=2)},
                {"battery_faults": 1},
                {"unhealthy": 1},
                {"unhealthy": 0x2000000},
                {"volts": volts(low_since_s=5.0)},
                {"volts": volts(spread_since_s=5.0)},
                {"volts": volts(dropped_s=5.0)},
                {"heartbeat": None},
            )
        ],
        [True, True, False, True, True, False, True, True, True, True, False],
    ),
    (
        "what an autopilot calls its battery",
        lambda: [look("battery-critical", flying(battery=pack(90.0, charge_state=state))) for state in range(8)],
        [
            "ok",
            "ok",
            "ok",
            "the autopilot reports its battery critical",
            "the autopilot reports its battery emergency",
            "the autopilot reports its battery failed",
            "the autopilot reports its battery unhealthy",
            "ok",
        ],
    ),
    (
        "what a battery reports",
        lambda: [
            look("battery-critical", flying(battery_faults=bits)) for bits in (1, 2, 4, 8, 16, 32, 64, 128, 256, 5)
        ],
        [
            "its battery reports deep discharge",
            "ok",
            "its battery reports a failed cell",
            "its battery reports over-current",
            "its battery reports over-temperature",
            "ok",
            "its battery reports a voltage that does not fit",
            "ok",
            "its battery reports cells that are not the set ones",
            "its battery reports deep discharge, a failed cell",
        ],
    ),
    (
        "how far one may jump",
        lambda: [
            (look("position", flying(jump=jump)), warn("position", flying(jump=jump)))
            for jump in ((99.9, NOW_S), (100.0, NOW_S - 3.0), (100.0, NOW_S - 3.1), (9.9, NOW_S), (10.0, NOW_S - 3.0))
        ],
        [
            ("ok", "its position jumped by 100 m"),
            ("its position jumped by 100 m", "its position jumped by 100 m"),
            ("ok", ""),
            ("ok", ""),
            ("ok", "its position jumped by 10 m"),
        ],
    ),
    (
        "how long one may stand",
        lambda: [
            look("stall", flying(fix=at(age_s=age_s), anchor=at(age_s=age_s + stood_s), held_s=held_s), setup)
            for stood_s, age_s, held_s in (
                (89.9, 0.0, None),
                (90.0, 3.0, None),
                (90.0, 3.1, None),
                (90.0, 0.0, 5.0),
                (240.0, 0.0, None),
            )
            for setup in (PLANNED, UNPLANNED)
        ],
        [
            "ok",
            "ok",
            "has not moved for 90 s",
            "ok",
            "stale",
            "stale",
            "ok",
            "ok",
            "has not moved for 240 s",
            "has not moved for 240 s",
        ],
    ),
    (
        "who stands and is flown by hand",
        lambda: look("stall", flying(anchor=at(age_s=900.0), heartbeat=beat(HOLD)), UNPLANNED),
        "ok",
    ),
    (
        "for how long a stream may be gone",
        lambda: [
            look(name, flying(**given))
            for name, given in (
                ("heartbeat", {"heartbeat_s": NOW_S - 19.9}),
                ("heartbeat", {"heartbeat_s": NOW_S - 20.0}),
                ("positions", {"fix": at(age_s=19.9)}),
                ("positions", {"fix": at(age_s=20.0)}),
                ("battery-reports", {"battery": pack(90.0, age_s=59.9)}),
                ("battery-reports", {"battery": pack(90.0, age_s=60.0)}),
                ("items", {"item_s": NOW_S - 19.9}),
                ("items", {"item_s": NOW_S - 20.0}),
            )
        ],
        [
            "ok",
            "no HEARTBEAT for 20 s, while other messages come",
            "ok",
            "no position for 20 s, while other messages come",
            "ok",
            "no battery report for 60 s, while other messages come",
            "ok",
            "no report of its current waypoint for 20 s, while other messages come",
        ],
    ),
    (
        "streams of who is not heard, or not planned, or never sent them",
        lambda: [
            look(name, flying(item_s=item_s, heard_s=heard_s), setup)
            for name, item_s, heard_s, setup in (
                ("items", NOW_S - 30.0, NOW_S - 3.0, PLANNED),
                ("items", NOW_S - 30.0, None, PLANNED),
                ("items", NOW_S - 30.0, NOW_S, UNPLANNED),
                ("items", None, NOW_S, PLANNED),
            )
        ],
        ["stale", "stale", "stale", "stale"],
    ),
    (
        "with a long time-out streams are waited for longer",
        lambda: [
            look("items", flying(item_s=NOW_S - 30.0), replace(PLANNED, link_timeout_s=timeout_s))
            for timeout_s in (30.0, 30.1)
        ],
        ["no report of its current waypoint for 30 s, while other messages come", "ok"],
    ),
    (
        "who is asked for its streams",
        lambda: [
            streams.to_be_asked(View(CONTEXT, PLANNED, flying(**given), False, NOW_S))
            for given in (
                {},
                {"item_s": NOW_S - 30.0},
                {"item_s": NOW_S - 30.0, "streams_asked_s": NOW_S - 6.0},
                {"item_s": NOW_S - 30.0, "streams_asked_s": NOW_S - 5.9},
                {"item_s": NOW_S - 30.0, "heard_s": NOW_S - 3.0},
                {"battery": pack(90.0, age_s=7.0)},
                {"battery": pack(90.0, age_s=6.9)},
                {"heartbeat_s": NOW_S - 3.5},
                {"fix": at(age_s=3.0)},
            )
        ],
        [False, True, True, False, False, True, False, True, True],
    ),
    (
        "what is missing while others come",
        lambda: [
            warn(name, flying(**given))
            for name, given in (
                ("heartbeat", {"heartbeat_s": NOW_S - 3.4}),
                ("heartbeat", {"heartbeat_s": NOW_S - 3.5}),
                ("heartbeat", {"heartbeat_s": NOW_S - 3.5, "heard_s": NOW_S - 0.1}),
                ("heartbeat", {"heartbeat_s": NOW_S - 6.0, "heard_s": NOW_S - 2.5}),
                ("heartbeat", {"heartbeat_s": NOW_S - 6.0, "heard_s": NOW_S - 2.6}),
                ("items", {"item_s": NOW_S - 9.0}),
                ("items", {"item_s": NOW_S - 9.0, "stage": Stage.RETURNING}),
                ("battery-silent", {"battery": pack(90.0, age_s=7.0)}),
                ("silent", {"heard_s": NOW_S - 2.9}),
                ("silent", {"heard_s": NOW_S - 3.0}),
                ("silent", {"heard_s": None}),
            )
        ],
        [
            "",
            "no HEARTBEAT for 4 s, while other messages come",
            "",
            "no HEARTBEAT for 6 s, while other messages come",
            "",
            "no report of its current waypoint for 9 s, while other messages come",
            "",
            "no battery report for 7 s, while other messages come",
            "",
            "no message for 3.0 s",
            "",
        ],
    ),
    (
        "a lossy link",
        lambda: [
            warn("loss", flying(quality=LinkQuality(lost=lost, usual=usual)))
            for lost, usual in ((None, 0.1), (0.32, 0.1), (0.33, 0.1), (0.5, None), (0.3, 0.0))
        ],
        [
            "",
            "",
            "33 % of its frames are lost, where 10 % is usual",
            "",
            "30 % of its frames are lost, where 0 % is usual",
        ],
    ),
    (
        "a weak radio",
        lambda: [
            warn("radio", flying(quality=LinkQuality(radio=Radio(20, 60, 20, 20, 90), radio_s=NOW_S - age_s)))
            for age_s in (5.0, 5.1)
        ],
        ["radio signal 20 over noise 20 here", ""],
    ),
    (
        "a low battery",
        lambda: [
            warn("battery-low", flying(**given))
            for given in (
                {},
                {"battery": pack(90.0, charge_state=2)},
                {"unhealthy": 0x2000000},
                {"unhealthy": 0x1000000},
            )
        ],
        ["", "the autopilot reports its battery low", "the autopilot reports its battery not healthy", ""],
    ),
    (
        "a doubtful reserve",
        lambda: [
            warn("reserve", flying(battery=pack(percent), **given), setup)
            for percent, given in (
                (18.0, {}),
                (16.0, {}),
                (15.0, {}),
                (15.0, {"waypoint": 5}),
                (15.0, {"waypoint": 4}),
                (15.0, {"heartbeat": DISARMED}),
            )
            for setup in (PLANNED, UNPLANNED)
        ],
        [
            "below its reserve at landing with 77 % probability",
            "below its reserve at landing with 77 % probability",
            "below its reserve at landing with 97 % probability",
            "below its reserve at landing with 97 % probability",
            "below its reserve at landing with 99 % probability",
            "below its reserve at landing with 99 % probability",
            "",
            "below its reserve at landing with 64 % probability",
            "below its reserve at landing with 89 % probability",
            "below its reserve at landing with 89 % probability",
            "",
            "below its reserve at landing with 99 % probability",
        ],
    ),
    (
        "who stands on its way home",
        lambda: [
            warn("stands", flying(**{**HOMEWARD, "fix": at(up_m=2.0), "anchor": at(age_s=20.0), **given}))
            for given in (
                {},
                {"anchor": at(age_s=19.9)},
                {"fix": at(up_m=1.9)},
                {"fix": at(age_s=3.0), "anchor": at(age_s=23.0)},
                {"fix": at(age_s=3.1), "anchor": at(age_s=33.0)},
                {"stage": Stage.FLYING},
                {"heartbeat": DISARMED},
                {"anchor": None},
                {"fix": None},
            )
        ],
        [
            "has not moved for 20 s on its way home, 49.600138, 15.603617, 2 m over its home",
            "",
            "",
            "has not moved for 20 s on its way home, 49.600138, 15.603617, 20 m over its home",
            "",
            "",
            "",
            "",
            "",
        ],
    ),
    (
        "a refuted HEARTBEAT",
        lambda: [bool(warn("disarmed", flying(doubted=doubted))) for doubted in (None, (DISARMED, NOW_S))],
        [False, True],
    ),
    (
        "who is not warned of",
        lambda: [
            len(warnings.warnings(View(CONTEXT, PLANNED, flying(stage=stage, fix=at(age_s=9.0)), False, NOW_S)))
            for stage in Stage
        ],
        [0, 1, 1, 1, 1, 0, 0, 1],
    ),
    (
        "what was said is said again after a while",
        lambda: [
            warnings.new_warnings(
                View(CONTEXT, PLANNED, flying(fix=at(age_s=9.0)), False, NOW_S),
                Told((("positions", NOW_S - age_s), ("items", NOW_S - 29.0))),
            )
            for age_s in (29.9, 30.0)
        ],
        [
            (Told(at_s=(("positions", NOW_S), ("items", NOW_S - 29.0))), ()),
            (
                Told(at_s=(("items", NOW_S - 29.0), ("positions", NOW_S))),
                ("uav1: no position for 9 s, while other messages come",),
            ),
        ],
    ),
    (
        "what was said is forgotten",
        lambda: [
            warnings.new_warnings(View(CONTEXT, PLANNED, flying(), False, NOW_S), told)
            for told in (Told(), Told((("items", NOW_S - 30.0),)), Told((("items", NOW_S - 29.9),)))
        ],
        [(Told(), ()), (Told(), ()), (Told(at_s=(("items", NOW_S - 29.9),)), ())],
    ),
]


@pytest.mark.parametrize(("what", "found", "expected"), ROWS, ids=[row[0] for row in ROWS])
def test_everything_that_comes_of_it(what: str, found: Callable[[], object], expected: object) -> None:
    assert rounded(found()) == expected
