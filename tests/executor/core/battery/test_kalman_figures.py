"""The filter of the consumption in figures, one step at a time."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import pytest

from executor.core.battery import kalman
from executor.core.battery.kalman import BatteryEstimate, Prior, Projection
from tests.executor.core.steps import rounded

ESTIMATE = BatteryEstimate(80.0, 1.2, 0.3, 0.02, 0.01)

ROWS: list[tuple[str, Callable[[], object], object]] = [
    (
        "the first estimate",
        lambda: kalman.initialise_estimate(87.0, Prior(1.1, 0.2)),
        BatteryEstimate(remaining_pct=87.0, factor=1.1, var_remaining=0.0833333, covariance=0.0, var_factor=0.04),
    ),
    (
        "an estimate carried on",
        lambda: [
            kalman.predict_estimate(ESTIMATE, modelled_pct, elapsed_s)
            for modelled_pct, elapsed_s in ((0.0, 10.0), (2.0, 30.0), (2.0, -1.0))
        ],
        [
            BatteryEstimate(remaining_pct=80.0, factor=1.2, var_remaining=0.300001, covariance=0.02, var_factor=0.01),
            BatteryEstimate(
                remaining_pct=77.6, factor=1.2, var_remaining=0.264801, covariance=0.0, var_factor=0.0100576
            ),
            BatteryEstimate(remaining_pct=77.6, factor=1.2, var_remaining=0.264801, covariance=0.0, var_factor=0.01),
        ],
    ),
    (
        "an estimate corrected",
        lambda: [
            kalman.correct_with_report(ESTIMATE, percent, since_s, rough)
            for percent, since_s, rough in (
                (79.0, 1.0, 0.0),
                (79.0, 30.0, 0.0),
                (79.0, 12.0, 2.0),
                (81.9, 1.0, 0.0),
                (82.1, 1.0, 0.0),
                (83.0, 30.0, 3.0),
                (84.5, 30.0, 3.0),
            )
        ],
        [
            BatteryEstimate(
                remaining_pct=79.7692,
                factor=1.18462,
                var_remaining=0.230769,
                covariance=0.0153846,
                var_factor=0.00969231,
            ),
            BatteryEstimate(
                remaining_pct=79.2174,
                factor=1.14783,
                var_remaining=0.0652174,
                covariance=0.00434783,
                var_factor=0.00895652,
            ),
            BatteryEstimate(
                remaining_pct=79.7831,
                factor=1.18554,
                var_remaining=0.23494,
                covariance=0.0156627,
                var_factor=0.00971084,
            ),
            BatteryEstimate(
                remaining_pct=80.4385,
                factor=1.22923,
                var_remaining=0.230769,
                covariance=0.0153846,
                var_factor=0.00969231,
            ),
            replace(ESTIMATE, remaining_pct=82.1, var_remaining=0.0833333, covariance=0.0),
            BatteryEstimate(
                remaining_pct=80.3418,
                factor=1.22278,
                var_remaining=0.265823,
                covariance=0.0177215,
                var_factor=0.0098481,
            ),
            replace(ESTIMATE, remaining_pct=84.5, var_remaining=0.0833333, covariance=0.0),
        ],
    ),
    (
        "an estimate refined",
        lambda: [kalman.correct_with_counter(ESTIMATE, percent) for percent in (79.5, 82.0, 82.1, 77.9)],
        [
            BatteryEstimate(
                remaining_pct=79.5349,
                factor=1.16899,
                var_remaining=0.0209302,
                covariance=0.00139535,
                var_factor=0.00875969,
            ),
            BatteryEstimate(
                remaining_pct=81.8605,
                factor=1.32403,
                var_remaining=0.0209302,
                covariance=0.00139535,
                var_factor=0.00875969,
            ),
            replace(ESTIMATE, remaining_pct=82.1, var_remaining=0.0833333, covariance=0.0),
            replace(ESTIMATE, remaining_pct=77.9, var_remaining=0.0833333, covariance=0.0),
        ],
    ),
    (
        "an estimate projected",
        lambda: kalman.project_remaining(ESTIMATE, 20.0),
        Projection(mean_pct=56.0, sd_pct=1.88361),
    ),
    (
        "probability of less charge left",
        lambda: [Projection(20.0, 2.0).chance_below(floor_pct) for floor_pct in (16.0, 20.0, 22.0)],
        [0.0227501, 0.5, 0.841345],
    ),
]


@pytest.mark.parametrize(("what", "found", "expected"), ROWS, ids=[row[0] for row in ROWS])
def test_everything_that_comes_of_it(what: str, found: Callable[[], object], expected: object) -> None:
    assert rounded(found()) == expected
