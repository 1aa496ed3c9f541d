"""A battery in figures, report by report."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Any

import pytest

from executor.core.battery import account
from executor.core.battery.account import BatteryState
from executor.core.battery.charge_counter import ChargeCounter, PercentTransition, counter_remaining_pct
from executor.core.battery.cusum import Drift
from executor.core.battery.kalman import BatteryEstimate
from tests.executor.core.steps import rounded


def used(
    *reports: tuple[float, float, float], state: BatteryState | None = None, charges: Mapping[int, float] | None = None
) -> BatteryState:
    """Return a battery after reports of (seconds since the last, percent by the model since then, percent left)."""
    state, now_s = state or BatteryState(), 100.0
    for number, (elapsed_s, modelled_pct, left_pct) in enumerate(reports):
        now_s += elapsed_s
        state = account.add_modelled_use(state, modelled_pct)
        if charges and number in charges:
            state = account.apply_consumed_report(state, charges[number], now_s)
        state = account.apply_remaining_report(state, left_pct, 1, now_s)
    return state


STEADY = [(5.0, 0.5, 99.5 - 0.5 * step) for step in range(12)]
EAGER = [(5.0, 0.5, 99.5 - 0.8 * step) for step in range(12)]
SLOW = [(40.0, 4.0, 96.0 - 4.4 * step) for step in range(8)]
WHOLE = [(5.0, 0.5, 99.0 - (step + 1) // 2) for step in range(12)]
"""Whole percents: one ends with every other report."""
AH = {step: 0.1 * (step + 1) for step in range(12)}


def brief(state: BatteryState) -> Any:
    """Return what is known of a battery without its reports."""
    return rounded(
        (
            state.remaining_pct,
            state.lowest_pct,
            state.usual,
            state.usual_long,
            state.roughness_pct,
            state.estimate,
            state.drift,
            state.slow,
            state.charge,
            len(state.history),
            state.began_s,
        )
    )


ESTIMATE = BatteryEstimate(80.0, 1.2, 0.3, 0.02, 0.01)
OF_WHOLE_PERCENTS = BatteryEstimate(
    remaining_pct=93.5089,
    factor=0.980117,
    var_remaining=0.00837164,
    covariance=-0.00261847,
    var_factor=0.0021487,
)
SLOW_OF_WHOLE_PERCENTS = Drift(
    excess_pct=0.39744, used_pct=1.0, expected_pct=0.502133, since_s=155.0, reports=1, biggest_pct=0.497867
)

ROWS: list[tuple[str, Callable[[], object], object]] = [
    (
        "a battery that gives what it should",
        lambda: brief(used(*STEADY)),
        (
            94.0,
            94.0,
            1.0,
            1.0,
            0.0,
            BatteryEstimate(
                remaining_pct=94.0, factor=1.0, var_remaining=0.206215, covariance=-0.0342008, var_factor=0.00798981
            ),
            Drift(),
            Drift(),
            ChargeCounter(),
            7,
            110.0,
        ),
    ),
    (
        "a battery that gives more",
        lambda: brief(used(*EAGER)),
        (
            90.7,
            90.7,
            1.1736,
            1.11767,
            0.0,
            BatteryEstimate(
                remaining_pct=92.1195,
                factor=1.26953,
                var_remaining=0.206639,
                covariance=-0.0341813,
                var_factor=0.00800513,
            ),
            Drift(),
            Drift(excess_pct=1.82737, used_pct=8.8, expected_pct=5.70651, since_s=105.0, reports=11, biggest_pct=0.3),
            ChargeCounter(),
            7,
            110.0,
        ),
    ),
    (
        "a battery over minutes",
        lambda: brief(used(*SLOW)),
        (
            65.2,
            65.2,
            1.09314,
            1.08497,
            0.0,
            BatteryEstimate(
                remaining_pct=65.2619,
                factor=1.09676,
                var_remaining=0.24173,
                covariance=-0.0100503,
                var_factor=0.000747019,
            ),
            Drift(),
            Drift(),
            ChargeCounter(),
            2,
            180.0,
        ),
    ),
    (
        "a battery with a counter of its charge",
        lambda: brief(used(*WHOLE, charges=AH)),
        (
            93.0,
            93.0,
            0.991,
            1.00185,
            0.0,
            OF_WHOLE_PERCENTS,
            Drift(
                excess_pct=0.327665, used_pct=1.0, expected_pct=0.49686, since_s=155.0, reports=1, biggest_pct=0.50314
            ),
            SLOW_OF_WHOLE_PERCENTS,
            ChargeCounter(
                consumed_ah=1.2,
                at_s=160.0,
                modelled_pct=6.0,
                began_ah=0.2,
                first=PercentTransition(remaining_pct=98.5, consumed_ah=0.2),
                last=PercentTransition(remaining_pct=93.5, consumed_ah=1.2),
                capacity_ah=20.0,
                began_s=110.0,
                mark=(94.0, 1.0),
                per_pct_ah=0.16,
            ),
            7,
            110.0,
        ),
    ),
    (
        "a battery whose counter shows more than its percentage",
        lambda: brief(used(*WHOLE, charges={**AH, 9: 1.5, 10: 1.6, 11: 1.7})),
        (
            93.0,
            93.0,
            1.00233,
            1.00185,
            0.0,
            OF_WHOLE_PERCENTS,
            Drift(
                excess_pct=0.321803, used_pct=1.0, expected_pct=0.50155, since_s=155.0, reports=1, biggest_pct=0.49845
            ),
            SLOW_OF_WHOLE_PERCENTS,
            ChargeCounter(
                consumed_ah=1.7,
                at_s=160.0,
                modelled_pct=6.0,
                began_ah=0.2,
                first=PercentTransition(remaining_pct=98.5, consumed_ah=0.2),
                last=PercentTransition(remaining_pct=93.5, consumed_ah=1.7),
                capacity_ah=20.0,
                began_s=110.0,
                mark=(94.0, 1.5),
                per_pct_ah=0.26,
                drift=Drift(
                    excess_pct=1.84321,
                    used_pct=4.0,
                    expected_pct=1.50595,
                    since_s=145.0,
                    reports=3,
                    biggest_pct=2.49757,
                ),
            ),
            7,
            110.0,
        ),
    ),
    (
        "a battery whose counter stands still",
        lambda: brief(used(*WHOLE, charges=dict.fromkeys(range(12), 0.4))),
        (
            93.0,
            93.0,
            1.02085,
            1.01589,
            0.0,
            BatteryEstimate(
                remaining_pct=93.2716,
                factor=1.02831,
                var_remaining=0.206268,
                covariance=-0.0341981,
                var_factor=0.00799201,
            ),
            Drift(),
            Drift(
                excess_pct=0.391292, used_pct=1.0, expected_pct=0.507256, since_s=155.0, reports=1, biggest_pct=0.492744
            ),
            ChargeCounter(
                consumed_ah=0.4,
                at_s=160.0,
                modelled_pct=6.0,
                began_ah=0.4,
                first=PercentTransition(remaining_pct=98.5, consumed_ah=0.4),
                last=PercentTransition(remaining_pct=93.5, consumed_ah=0.4),
                began_s=110.0,
                mark=(94.0, 0.4),
                per_pct_ah=0.0,
            ),
            7,
            110.0,
        ),
    ),
    (
        "a battery whose counter began anew",
        lambda: brief(used(*WHOLE, charges={**AH, 10: 0.01, 11: 0.02})),
        (
            93.0,
            93.0,
            0.993339,
            1.00301,
            0.0,
            BatteryEstimate(
                remaining_pct=93.4679,
                factor=0.992432,
                var_remaining=0.018895,
                covariance=-0.00567404,
                var_factor=0.00303927,
            ),
            Drift(
                excess_pct=0.322359, used_pct=1.0, expected_pct=0.496783, since_s=155.0, reports=1, biggest_pct=0.503217
            ),
            Drift(
                excess_pct=0.397486, used_pct=1.0, expected_pct=0.502095, since_s=155.0, reports=1, biggest_pct=0.497905
            ),
            ChargeCounter(
                consumed_ah=0.02,
                at_s=160.0,
                modelled_pct=6.0,
                began_ah=0.01,
                first=PercentTransition(remaining_pct=93.5, consumed_ah=0.02),
                last=PercentTransition(remaining_pct=93.5, consumed_ah=0.02),
                began_s=155.0,
                mark=(94.0, 0.01),
            ),
            7,
            110.0,
        ),
    ),
    (
        "a battery that wavers",
        lambda: brief(used(*STEADY[:6], (5.0, 0.5, 98.5), (5.0, 0.5, 96.0), (290.0, 0.5, 95.5))),
        (
            95.5,
            95.5,
            0.973564,
            0.974844,
            0.0491667,
            BatteryEstimate(
                remaining_pct=95.6576,
                factor=0.973564,
                var_remaining=0.153622,
                covariance=-0.0300889,
                var_factor=0.0100687,
            ),
            Drift(),
            Drift(),
            ChargeCounter(),
            2,
            110.0,
        ),
    ),
    (
        "a battery after a long silence",
        lambda: brief(used(*STEADY, (60.0, 0.0, 88.0))),
        (
            88.0,
            88.0,
            1.0,
            1.0,
            0.0,
            BatteryEstimate(
                remaining_pct=88.0, factor=1.0, var_remaining=0.0833333, covariance=0.0, var_factor=0.00798981
            ),
            Drift(),
            Drift(),
            ChargeCounter(),
            2,
            110.0,
        ),
    ),
    (
        "a battery that rests for a moment",
        lambda: brief(used(*STEADY, (5.0, 0.0, 94.0), (9.9, 0.1, 93.0))),
        (
            93.0,
            93.0,
            1.00874,
            1.00437,
            0.0,
            BatteryEstimate(
                remaining_pct=93.7255,
                factor=1.02865,
                var_remaining=0.151798,
                covariance=-0.0249221,
                var_factor=0.00635269,
            ),
            Drift(excess_pct=0.263884, used_pct=1.0, expected_pct=0.1, since_s=165.0, reports=1, biggest_pct=0.9),
            Drift(excess_pct=0.88, used_pct=1.0, expected_pct=0.1, since_s=165.0, reports=1, biggest_pct=0.9),
            ChargeCounter(),
            6,
            110.0,
        ),
    ),
    (
        "a battery after ten seconds of silence",
        lambda: brief(used(*STEADY, (10.0, 0.0, 92.0))),
        (
            92.0,
            92.0,
            1.02324,
            1.01162,
            0.0,
            BatteryEstimate(
                remaining_pct=93.5797,
                factor=1.06971,
                var_remaining=0.162877,
                covariance=-0.027013,
                var_factor=0.00679772,
            ),
            Drift(),
            Drift(excess_pct=0.8, used_pct=2.0, expected_pct=1.0, since_s=160.0, reports=1, biggest_pct=1.0),
            ChargeCounter(),
            6,
            110.0,
        ),
    ),
    (
        "a battery of one report after a silence",
        lambda: brief(used((5.0, 0.5, 99.0), (60.0, 0.5, 95.0))),
        (
            95.0,
            95.0,
            1.0,
            1.0,
            0.0,
            BatteryEstimate(
                remaining_pct=95.0, factor=1.0, var_remaining=0.0833333, covariance=0.0, var_factor=0.01448
            ),
            Drift(),
            Drift(excess_pct=3.4, used_pct=4.0, expected_pct=0.5, since_s=105.0, reports=1, biggest_pct=3.5),
            ChargeCounter(),
            2,
            165.0,
        ),
    ),
    (
        "a battery after a silence that came after an uneven flight",
        lambda: brief(used((5.0, 0.5, 99.5), (5.0, 2.0, 97.5), (5.0, 0.1, 97.4), (20.0, 0.0, 94.0))),
        (
            94.0,
            94.0,
            1.0,
            1.0,
            0.0,
            BatteryEstimate(
                remaining_pct=94.0, factor=1.0, var_remaining=0.0833333, covariance=0.0, var_factor=0.0134685
            ),
            Drift(),
            Drift(),
            ChargeCounter(),
            4,
            110.0,
        ),
    ),
    (
        "a battery before it is used",
        lambda: brief(used((5.0, 0.0, 99.0), (5.0, 0.0, 99.0))),
        (
            99.0,
            99.0,
            1.0,
            1.0,
            0.0,
            BatteryEstimate(remaining_pct=99.0, factor=1.0, var_remaining=0.0790825, covariance=0.0, var_factor=0.0144),
            Drift(),
            Drift(),
            ChargeCounter(),
            2,
            None,
        ),
    ),
    (
        "a battery of which much goes at once",
        lambda: brief(used(*STEADY, (5.0, 0.5, 84.0), (5.0, 0.5, 83.5))),
        (
            83.5,
            83.5,
            1.0,
            1.0,
            0.0,
            BatteryEstimate(
                remaining_pct=83.5, factor=1.0, var_remaining=0.0817785, covariance=-0.00378729, var_factor=0.00799337
            ),
            Drift(jumped_s=165.0, jumped_pct=9.5),
            Drift(jumped_s=165.0, jumped_pct=9.5),
            ChargeCounter(),
            7,
            110.0,
        ),
    ),
    (
        "the reports that are kept",
        lambda: [round(one.at_s) for one in used(*STEADY).history],
        [130, 135, 140, 145, 150, 155, 160],
    ),
    (
        "a counter before any percentage",
        lambda: account.apply_consumed_report(BatteryState(), 0.5, 100.0) == BatteryState(),
        True,
    ),
    (
        "another pack",
        lambda: brief(account.restart_account(used(*STEADY), 100.0, 2, 200.0)),
        (
            100.0,
            100.0,
            1.0,
            1.0,
            0.0,
            BatteryEstimate(
                remaining_pct=100.0, factor=1.0, var_remaining=0.0833333, covariance=0.0, var_factor=0.0144
            ),
            Drift(),
            Drift(),
            ChargeCounter(),
            1,
            None,
        ),
    ),
    (
        "charge given",
        lambda: [
            state.given_pct
            for state in (
                BatteryState(),
                used(*STEADY),
                account.restart_account(used(*STEADY), 100.0, 2, 200.0),
                used(*STEADY, (5.0, 0.0, 96.0)),
            )
        ],
        [0.0, 5.5, 5.5, 5.5],
    ),
    (
        "consumption above the usual",
        lambda: [account.excess_pct(used(*EAGER), window_s) for window_s in (4.0, 5.0, 12.0, 60.0)],
        [(0.0, 0.0), (0.213201, 0.586799), (0.426403, 1.1736), (1.27921, 3.52079)],
    ),
    ("of one report nothing is said", lambda: account.excess_pct(used(STEADY[0]), 60.0), (0.0, 0.0)),
    (
        "a factor stays within reason",
        lambda: [
            account.consumption_factor(replace(used(STEADY[0]), estimate=replace(ESTIMATE, factor=factor)))
            for factor in (0.6, 0.8, 1.9, 2.1)
        ],
        [0.7, 0.8, 1.9, 2.0],
    ),
    ("unknown factor", lambda: account.consumption_factor(BatteryState()), 1.0),
    (
        "a vehicle without a counter is blind",
        lambda: [
            (account.is_blind(state), account.blindness_pct(state))
            for state in (
                used(*STEADY),
                used(*STEADY, charges=AH),
                used(*STEADY, charges=dict.fromkeys(range(12), 0.4)),
            )
        ],
        [(True, 1.5), (False, 0.0), (True, 1.5)],
    ),
    (
        "a counter that agrees is finer than the percentage",
        lambda: [
            counter_remaining_pct(used(*WHOLE, charges=AH).charge, percent) for percent in (93.0, 95.0, 92.0, 95.1)
        ],
        [93.5, 93.5, 93.5, None],
    ),
]


@pytest.mark.parametrize(("what", "found", "expected"), ROWS, ids=[row[0] for row in ROWS])
def test_everything_that_comes_of_it(what: str, found: Callable[[], object], expected: object) -> None:
    assert rounded(found()) == expected
