"""A battery in figures, report by report."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Any

import pytest

from executor.core.battery import account
from executor.core.battery.account import (
    BatteryState,
    Charge,
    PercentStep,
)
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
        state = account.drawn(state, modelled_pct)
        if charges and number in charges:
            state = account.with_consumed(state, charges[number], now_s)
        state = account.with_remaining(state, left_pct, 1, now_s)
    return state


STEADY = [(5.0, 0.5, 99.5 - 0.5 * step) for step in range(12)]
EAGER = [(5.0, 0.5, 99.5 - 0.8 * step) for step in range(12)]
SLOW = [(40.0, 4.0, 96.0 - 4.4 * step) for step in range(8)]
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
                remaining_pct=94.0, factor=1.0, var_remaining=0.267089, covariance=-0.0438361, var_factor=0.0137346
            ),
            Drift(),
            Drift(),
            Charge(),
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
            1.21819,
            1.15121,
            0.0,
            BatteryEstimate(
                remaining_pct=91.7283,
                factor=1.32142,
                var_remaining=0.271931,
                covariance=-0.0440487,
                var_factor=0.0146755,
            ),
            Drift(),
            Drift(excess_pct=1.73519, used_pct=8.8, expected_pct=5.78586, since_s=105.0, reports=11, biggest_pct=0.3),
            Charge(),
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
            1.09871,
            1.0912,
            0.0,
            BatteryEstimate(
                remaining_pct=65.2069, factor=1.10161, var_remaining=0.37119, covariance=-0.030965, var_factor=0.0106981
            ),
            Drift(),
            Drift(),
            Charge(),
            2,
            180.0,
        ),
    ),
    (
        "a battery with a counter of its charge",
        lambda: brief(used(*STEADY, charges=AH)),
        (
            94.0,
            94.0,
            0.974548,
            0.985706,
            0.0,
            BatteryEstimate(
                remaining_pct=94.2564,
                factor=0.952389,
                var_remaining=0.0124618,
                covariance=-0.00297515,
                var_factor=0.00639615,
            ),
            Drift(),
            Drift(),
            Charge(
                consumed_ah=1.2,
                at_s=160.0,
                modelled_pct=6.0,
                began_ah=0.2,
                began_pct=99.5,
                first=PercentStep(99.25, 0.2),
                last=PercentStep(94.25, 1.2),
                capacity_ah=20.0,
            ),
            7,
            110.0,
        ),
    ),
    (
        "a battery whose counter shows more than its percentage",
        lambda: brief(used(*STEADY, charges={**AH, 9: 1.5, 10: 1.6, 11: 1.7})),
        (
            94.0,
            94.0,
            0.974548,
            0.985706,
            0.0,
            BatteryEstimate(
                remaining_pct=94.2564,
                factor=0.952389,
                var_remaining=0.0124618,
                covariance=-0.00297515,
                var_factor=0.00639615,
            ),
            Drift(),
            Drift(),
            Charge(
                consumed_ah=1.7,
                at_s=160.0,
                modelled_pct=6.0,
                began_ah=0.2,
                began_pct=99.5,
                first=PercentStep(99.25, 0.2),
                last=PercentStep(94.25, 1.7),
                capacity_ah=30.0,
            ),
            7,
            110.0,
        ),
    ),
    (
        "a battery whose counter stands still",
        lambda: brief(used(*STEADY, charges=dict.fromkeys(range(12), 0.4))),
        (
            94.0,
            94.0,
            1.0,
            1.0,
            0.0,
            BatteryEstimate(
                remaining_pct=94.0, factor=1.0, var_remaining=0.267089, covariance=-0.0438361, var_factor=0.0137346
            ),
            Drift(),
            Drift(),
            Charge(
                consumed_ah=0.4,
                at_s=160.0,
                modelled_pct=6.0,
                began_ah=0.4,
                began_pct=99.5,
                first=PercentStep(99.25, 0.4),
                last=PercentStep(94.25, 0.4),
            ),
            7,
            110.0,
        ),
    ),
    (
        "a battery whose counter began anew",
        lambda: brief(used(*STEADY, charges={**AH, 10: 0.01, 11: 0.02})),
        (
            94.0,
            94.0,
            0.978256,
            0.987613,
            0.0,
            BatteryEstimate(
                remaining_pct=94.1915,
                factor=0.966644,
                var_remaining=0.041502,
                covariance=-0.00938168,
                var_factor=0.00782186,
            ),
            Drift(),
            Drift(),
            Charge(
                consumed_ah=0.02,
                at_s=160.0,
                modelled_pct=6.0,
                began_ah=0.01,
                began_pct=95.0,
                first=PercentStep(94.75, 0.01),
                last=PercentStep(94.25, 0.02),
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
            0.967775,
            0.96912,
            0.0491667,
            BatteryEstimate(
                remaining_pct=95.6934,
                factor=0.967775,
                var_remaining=0.200646,
                covariance=-0.0388153,
                var_factor=0.0349997,
            ),
            Drift(),
            Drift(),
            Charge(),
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
                remaining_pct=88.0, factor=1.0, var_remaining=0.0833333, covariance=0.0, var_factor=0.0137346
            ),
            Drift(),
            Drift(),
            Charge(),
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
            1.0104,
            1.0052,
            0.0,
            BatteryEstimate(
                remaining_pct=93.6906,
                factor=1.0341,
                var_remaining=0.182181,
                covariance=-0.0296633,
                var_factor=0.0119547,
            ),
            Drift(excess_pct=0.258481, used_pct=1.0, expected_pct=0.1, since_s=165.0, reports=1, biggest_pct=0.9),
            Drift(excess_pct=0.88, used_pct=1.0, expected_pct=0.1, since_s=165.0, reports=1, biggest_pct=0.9),
            Charge(),
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
            1.02804,
            1.01402,
            0.0,
            BatteryEstimate(
                remaining_pct=93.4874,
                factor=1.08413,
                var_remaining=0.198634,
                covariance=-0.0326008,
                var_factor=0.0118906,
            ),
            Drift(),
            Drift(excess_pct=0.8, used_pct=2.0, expected_pct=1.0, since_s=160.0, reports=1, biggest_pct=1.0),
            Charge(),
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
            BatteryEstimate(remaining_pct=95.0, factor=1.0, var_remaining=0.0833333, covariance=0.0, var_factor=0.027),
            Drift(),
            Drift(excess_pct=3.4, used_pct=4.0, expected_pct=0.5, since_s=105.0, reports=1, biggest_pct=3.5),
            Charge(),
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
                remaining_pct=94.0, factor=1.0, var_remaining=0.0833333, covariance=0.0, var_factor=0.0211053
            ),
            Drift(),
            Drift(),
            Charge(),
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
            BatteryEstimate(remaining_pct=99.0, factor=1.0, var_remaining=0.0790825, covariance=0.0, var_factor=0.0225),
            Drift(),
            Drift(),
            Charge(),
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
                remaining_pct=83.5, factor=1.0, var_remaining=0.0911647, covariance=-0.00663987, var_factor=0.0144544
            ),
            Drift(jumped_s=165.0, jumped_pct=9.5),
            Drift(jumped_s=165.0, jumped_pct=9.5),
            Charge(),
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
        lambda: account.with_consumed(BatteryState(), 0.5, 100.0) == BatteryState(),
        True,
    ),
    (
        "another pack",
        lambda: brief(account.swapped(used(*STEADY), 100.0, 2, 200.0)),
        (
            100.0,
            100.0,
            1.0,
            1.0,
            0.0,
            BatteryEstimate(
                remaining_pct=100.0, factor=1.0, var_remaining=0.0833333, covariance=0.0, var_factor=0.0225
            ),
            Drift(),
            Drift(),
            Charge(),
            1,
            None,
        ),
    ),
    (
        "what was given",
        lambda: [
            (state.used_pct, state.given_pct)
            for state in (
                BatteryState(),
                used(*STEADY),
                account.swapped(used(*STEADY), 100.0, 2, 200.0),
                used(*STEADY, (5.0, 0.0, 96.0)),
            )
        ],
        [(0.0, 0.0), (5.5, 5.5), (0.0, 5.5), (3.5, 5.5)],
    ),
    (
        "what is used beyond the usual",
        lambda: [account.excess_pct(used(*EAGER), window_s) for window_s in (4.0, 5.0, 12.0, 60.0)],
        [(0.0, 0.0), (0.190906, 0.609094), (0.381813, 1.21819), (1.14544, 3.65456)],
    ),
    ("of one report nothing is said", lambda: account.excess_pct(used(STEADY[0]), 60.0), (0.0, 0.0)),
    (
        "a factor stays within reason",
        lambda: [
            account.factor(replace(used(STEADY[0]), estimate=replace(ESTIMATE, factor=factor)))
            for factor in (0.6, 0.8, 1.9, 2.1)
        ],
        [0.7, 0.8, 1.9, 2.0],
    ),
    ("nobody knows a factor", lambda: account.factor(BatteryState()), 1.0),
    (
        "who has no counter is blind",
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
            account._counted_pct(used(*STEADY, charges=AH).charge, percent) for percent in (94.0, 95.0, 92.5, 96.0)
        ],
        [94.25, 94.25, None, None],
    ),
]


@pytest.mark.parametrize(("what", "found", "expected"), ROWS, ids=[row[0] for row in ROWS])
def test_everything_that_comes_of_it(what: str, found: Callable[[], object], expected: object) -> None:
    assert rounded(found()) == expected
