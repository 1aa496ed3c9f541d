"""The comparison of plans chosen for their probability: what the page says of figures that are given."""

from __future__ import annotations

import pytest

from benchmarks.coverage import gain_of, report_coverage
from benchmarks.store import Json


def plan(probability: float) -> Json:
    return {
        "probability": probability, "low_95": probability - 0.02, "high_95": probability + 0.02, "earliest_s": 600.0,
        "longest_s": 1200.0, "flown_s": 4000.0, "cpu_s": 3.0,
    }  # fmt: skip


def row(mincomb: float, window: float, coverage: float) -> Json:
    return {
        "radius_m": 500.0, "tightness": 0.86, "segments": 18, "mtbf_h": 3.25, "mincomb": plan(mincomb),
        "window": plan(window), "coverage": plan(coverage),
    }  # fmt: skip


def test_a_gain_has_the_interval_of_two_shares() -> None:
    gain, half = gain_of(row(0.8, 0.8, 0.9), "mincomb", 1000)
    assert gain == pytest.approx(0.1)
    assert half == pytest.approx(1.96 * (0.16 / 1000 + 0.09 / 1000) ** 0.5, rel=1e-3)


def test_the_page_counts_cells_with_the_gain_and_those_that_an_interval_tells() -> None:
    content = {
        "machine": {"cores": 1, "processor": "one", "commit": "abc"}, "command": "faultline bench coverage", "seeds": 4,
        "iterations": 1000, "plan_iterations": 200, "flights": 2000,
        "rows": [row(0.8, 0.84, 0.86), row(0.8, 0.9, 0.79)],
    }  # fmt: skip
    page = report_coverage(content).page()
    assert (
        "Over the MinComb plan: 5 points or more in 1 of 2 cells; the interval shows a gain in 1 and a loss in 0."
        in page
    )
    assert (
        "Over the window plan: 5 points or more in 0 of 2 cells; the interval shows a gain in 0 and a loss in 1."
        in page
    )
    assert "| 500 | 0.86 | 18 | 3.25 | 80.0 (78.0 to 82.0) | 84.0 (82.0 to 86.0) | 86.0 (84.0 to 88.0) |" in page
