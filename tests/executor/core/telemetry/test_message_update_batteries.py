"""A report of a battery, and everything that it changes of what is known of a vehicle."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import pytest

from executor.core.battery.account import BatterySample, PercentRounding
from executor.core.battery.charge_counter import ChargeCounter, PercentTransition
from executor.core.battery.cusum import Drift
from executor.core.battery.kalman import BatteryEstimate
from executor.core.battery.pack_condition import PackState
from executor.core.battery.voltage import SagEstimate
from executor.core.interface.messages import (
    Battery,
    SystemStatus,
)
from executor.core.state.vehicle_state import Stage
from executor.core.telemetry import message_update
from tests.executor.builders import fleet_of, with_facts
from tests.executor.core.steps import landed, rounded
from tests.executor.core.telemetry.message_effects import folded
from tests.executor.core.vehicles import (
    CONTEXT,
    NOW_S,
    at,
    flying,
    pack,
    volts,
)

PX4_FLEET = fleet_of(autopilot="px4")
PX4_CONTEXT = PX4_FLEET.context
UNDER_LOAD = PackState(loaded_s=NOW_S)
"""A voltage without its current says no more than that."""
FIRST_PAIR = replace(UNDER_LOAD, sag=SagEstimate(15.0, 0.0, 4.5009, 0.224955, 0.0112522, NOW_S, 20.0))
"""Of 15 V and 20 A: as good as nothing is known of the resistance yet."""
RESTS = landed(stage=Stage.LANDED)
BLIND = replace(pack(90.0, 90.0), charge=ChargeCounter())

ROWS: list[tuple[str, Callable[[], object], object]] = [
    (
        "a battery",
        lambda: folded(flying(), Battery(0, 89.0, 15.0, 20.0, None, 1, 0, (3.75,) * 4)),
        (
            {
                "aloft_pct": 89.0,
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
                        remaining_pct=89.9639,
                        factor=1.0,
                        var_remaining=0.0824497,
                        covariance=-0.000512333,
                        var_factor=0.0144013,
                    ),
                    "drift": Drift(excess_pct=1.0, used_pct=1.0, since_s=NOW_S, reports=1, biggest_pct=1.0),
                    "slow": Drift(excess_pct=1.0, used_pct=1.0, since_s=NOW_S, reports=1, biggest_pct=1.0),
                    "still_pct": 0.0,
                },
                "packs": ((0, 89.0),),
                "pack": FIRST_PAIR,
                "volts": {"began_s": NOW_S, "cells_v": (3.75, 3.75, 3.75, 3.75)},
            },
        ),
    ),
    (
        "a battery of which more is known",
        lambda: folded(flying(), Battery(0, 89.0, 15.0, 20.0, 1.5, 2, 4)),
        (
            {
                "aloft_pct": 89.0,
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
                        remaining_pct=89.9639,
                        factor=1.0,
                        var_remaining=0.0824497,
                        covariance=-0.000512333,
                        var_factor=0.0144013,
                    ),
                    "drift": Drift(excess_pct=1.0, used_pct=1.0, since_s=NOW_S, reports=1, biggest_pct=1.0),
                    "slow": Drift(excess_pct=1.0, used_pct=1.0, since_s=NOW_S, reports=1, biggest_pct=1.0),
                    "still_pct": 0.0,
                    "charge": ChargeCounter(
                        consumed_ah=1.5,
                        at_s=NOW_S,
                        modelled_pct=0.072,
                        began_ah=1.5,
                        first=PercentTransition(remaining_pct=90.0, consumed_ah=1.5),
                        last=PercentTransition(remaining_pct=90.0, consumed_ah=1.5),
                        began_s=NOW_S,
                        mark=(90.0, 1.5),
                    ),
                },
                "packs": ((0, 89.0),),
                "pack": FIRST_PAIR,
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
                        remaining_pct=89.9639,
                        factor=1.0,
                        var_remaining=0.0824497,
                        covariance=-0.000512333,
                        var_factor=0.0144013,
                    ),
                    "drift": Drift(excess_pct=1.0, used_pct=1.0, since_s=NOW_S, reports=1, biggest_pct=1.0),
                    "slow": Drift(excess_pct=1.0, used_pct=1.0, since_s=NOW_S, reports=1, biggest_pct=1.0),
                    "still_pct": 0.0,
                },
                "packs": ((0, 89.0),),
                "pack": FIRST_PAIR,
                "volts": {"usual_v": None, "drop": 0.0},
            },
        ),
    ),
    (
        "a battery without a percentage",
        lambda: folded(flying(), Battery(0, None, 15.0, None, None, 0, 0)),
        ({"volts": {"began_s": NOW_S, "known_load": False}, "pack": UNDER_LOAD},),
    ),
    (
        "a second battery",
        lambda: folded(flying(packs=((0, 80.0),)), Battery(1, 89.0, 15.0, 20.0, 1.5, 1, 0)),
        (
            {
                "aloft_pct": 80.0,
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
                        remaining_pct=80.5,
                        factor=0.999998,
                        var_remaining=0.0833333,
                        covariance=0.0,
                        var_factor=0.0144013,
                    ),
                    "drift": Drift(
                        jumped_s=NOW_S,
                        jumped_pct=10.0,
                    ),
                    "slow": Drift(
                        jumped_s=NOW_S,
                        jumped_pct=10.0,
                    ),
                    "still_pct": 0.0,
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
            flying(battery=BLIND, roundings=PercentRounding(ceiled=90.0, ceiled_s=NOW_S - 1.0)),
            Battery(0, 89.0, None, None, None, 1, 0),
            PX4_CONTEXT,
        ),
        (
            {
                "aloft_pct": 89.25,
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
                        var_remaining=0.0824497,
                        covariance=-0.000512333,
                        var_factor=0.0144013,
                    ),
                    "drift": Drift(excess_pct=0.75, used_pct=0.75, since_s=NOW_S, reports=1, biggest_pct=0.75),
                    "slow": Drift(excess_pct=0.75, used_pct=0.75, since_s=NOW_S, reports=1, biggest_pct=0.75),
                    "still_pct": 0.0,
                },
                "packs": ((0, 89.0),),
                "roundings": {"rounded": 89.0, "rounded_s": NOW_S},
            },
        ),
    ),
    (
        "a status of PX4's",
        lambda: folded(
            flying(battery=BLIND, packs=((0, 89.0),), roundings=PercentRounding(rounded=89.0, rounded_s=NOW_S - 1.0)),
            SystemStatus(90.0, None, 0, None),
            PX4_CONTEXT,
        ),
        (
            {
                "aloft_pct": 89.25,
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
                        var_remaining=0.0824497,
                        covariance=-0.000512333,
                        var_factor=0.0144013,
                    ),
                    "drift": Drift(excess_pct=0.75, used_pct=0.75, since_s=NOW_S, reports=1, biggest_pct=0.75),
                    "slow": Drift(excess_pct=0.75, used_pct=0.75, since_s=NOW_S, reports=1, biggest_pct=0.75),
                    "still_pct": 0.0,
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
                flying(battery=pack(90.0, age_s=age_s), volts=volts(age_s=age_s), told_s=NOW_S - age_s),
                SystemStatus(85.0, 14.0, 32, None),
            )
            for age_s in (7.0, 7.1)
        ],
        [
            ({"unhealthy": 32},),
            (
                {
                    "unhealthy": 32,
                    "aloft_pct": 85.0,
                    "battery": {
                        "remaining_pct": 85.0,
                        "least_pct": 85.0,
                        "reported_s": NOW_S,
                        "charge_state": 0,
                        "history": (
                            BatterySample(at_s=992.9, remaining_pct=90.0, modelled_pct=0.036),
                            BatterySample(at_s=NOW_S, remaining_pct=85.0, modelled_pct=0.036),
                        ),
                        "lowest_pct": 85.0,
                        "estimate": BatteryEstimate(
                            remaining_pct=85.5, factor=1.0, var_remaining=0.0833333, covariance=0.0, var_factor=0.0144
                        ),
                        "began_s": NOW_S,
                        "drift": Drift(excess_pct=4.574, used_pct=5.0, since_s=992.9, reports=1, biggest_pct=5.0),
                        "slow": Drift(excess_pct=5.0, used_pct=5.0, since_s=992.9, reports=1, biggest_pct=5.0),
                    },
                    "volts": {"reported_s": NOW_S, "voltage_v": 14.0, "began_s": NOW_S, "known_load": False},
                    "pack": UNDER_LOAD,
                },
            ),
        ],
    ),
    (
        "a status without a percentage",
        lambda: folded(flying(battery=pack(90.0, age_s=9.0)), SystemStatus(None, None, 0, None)),
        ({},),
    ),
]


@pytest.mark.parametrize(("what", "found", "expected"), ROWS, ids=[row[0] for row in ROWS])
def test_everything_that_comes_of_it(what: str, found: Callable[[], object], expected: object) -> None:
    assert rounded(found()) == expected


def test_what_it_held_in_the_air_stays_when_its_pack_is_full_again() -> None:
    """As PX4's simulated pack is, as soon as it disarms; the HEARTBEAT that says so comes later."""
    flies = message_update.apply_message(
        CONTEXT, flying(battery=pack(30.0)), Battery(0, 24.9, None, None, None, 1, 0), NOW_S
    ).state
    stands = with_facts(flies, on_ground=True, fix=at(up_m=0.0))
    filled = message_update.apply_message(CONTEXT, stands, Battery(0, 58.0, None, None, None, 1, 0), NOW_S + 2.0).state
    assert (filled.power.battery.remaining_pct, filled.power.landed_pct) == (58.0, 24.9)
    another = with_facts(filled, aloft_pct=None)
    assert another.power.landed_pct == 58.0, "a pack that was changed is what it is"


def test_a_vehicle_that_used_charge_without_a_link_landed_with_the_rest() -> None:
    """What it held before the silence is not what it landed with."""
    flies = message_update.apply_message(
        CONTEXT, flying(battery=pack(70.0)), Battery(0, 69.0, None, None, None, 1, 0), NOW_S
    ).state
    stands = with_facts(flies, on_ground=True, fix=at(up_m=0.0))
    heard = message_update.apply_message(CONTEXT, stands, Battery(0, 7.0, None, None, None, 3, 0), NOW_S + 60.0).state
    assert heard.power.landed_pct == 7.0
