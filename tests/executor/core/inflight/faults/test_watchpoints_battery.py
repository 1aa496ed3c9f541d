"""The watchpoints of a battery at their limits, one look at a time."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import pytest

from executor.core.battery.account import BatteryState
from executor.core.battery.charge_counter import ChargeCounter
from executor.core.battery.cusum import Drift
from executor.core.state.vehicle_state import VehicleState
from tests.executor.builders import with_facts
from tests.executor.core.inflight.faults.watch_views import PLANNED, look
from tests.executor.core.steps import Changes, beat, rounded
from tests.executor.core.vehicles import NOW_S, RTL, at, flying, pack, says, volts

UNPLANNED = replace(PLANNED, planned=False)
KNOWN: list[Changes] = [
    {},
    {"dropped_s": None},
    {"usual_v": None},
    {"voltage_v": None},
    {"reported_s": NOW_S - 7.0},
    {"reported_s": NOW_S - 7.1},
]
SAYS = flying(**says("Battery Failsafe", NOW_S - 15.0))
DRAIN = Drift(2.5, 5.0, 2.5, NOW_S - 30.0, 4, 0.0, 0.0, 0.2)
COUNTS = ChargeCounter(consumed_ah=2.0, began_ah=1.0)


def drained(**given: Any) -> VehicleState:
    return flying(battery=replace(pack(90.0, 90.0), **given))


ROWS: list[tuple[str, Callable[[], object], object]] = [
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
        ["ok", "used 5.0 % in 30 s where 2.5 % is usual by its charge counter"],
    ),
    (
        "a slow drain",
        lambda: [
            look("battery-drain", drained(slow=replace(DRAIN, excess_pct=excess_pct), charge=charge))
            for excess_pct, charge in ((5.4, ChargeCounter()), (5.5, ChargeCounter()), (3.9, COUNTS), (4.0, COUNTS))
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
            for excess_pct, charge in ((2.3, ChargeCounter()), (2.4, ChargeCounter()), (3.3, COUNTS), (3.4, COUNTS))
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
            "would land with 9 % of its battery, give or take 2.5: 100 % likely to be below its reserve of 15 %",
            "would land with 11 % of its battery, give or take 2.5: 97 % likely to be below its reserve of 15 %",
            "ok",
            "would land with 12 % of its battery, give or take 2.5: 83 % likely to be below its reserve of 15 %",
            "ok",
            "ok",
            "ok",
        ],
    ),
    (
        "battery states reported by an autopilot",
        lambda: [
            look("battery-failsafe", with_facts(SAYS, **given), setup)
            for setup in (PLANNED, UNPLANNED)
            for given in (
                {},
                says("Battery Failsafe", NOW_S - 15.1),
                {"failed": ()},
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
        "signs of a battery failsafe",
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
        "names of battery states",
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
        "battery reports",
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
            "its battery reports an incompatible voltage",
            "ok",
            "its battery reports an incompatible cell configuration",
            "its battery reports deep discharge, a failed cell",
        ],
    ),
]


@pytest.mark.parametrize(("what", "found", "expected"), ROWS, ids=[row[0] for row in ROWS])
def test_everything_that_comes_of_it(what: str, found: Callable[[], object], expected: object) -> None:
    assert rounded(found()) == expected
