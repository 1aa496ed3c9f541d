"""The sum of what a battery gives beyond the usual, in figures."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace

import pytest

from executor.core.battery import cusum
from executor.core.battery.cusum import Drift
from tests.executor.core.steps import rounded

DRIFT = Drift(1.0, 3.0, 2.0, 90.0, 2, 95.0, 2.5, 0.7)

ROWS: list[tuple[str, Callable[[], object], object]] = [
    (
        "an excess that grows",
        lambda: cusum.add_usage(DRIFT, 2.0, 1.0, slack_pct=0.25, elapsed_s=5.0, now_s=100.0, memory_s=90.0),
        Drift(
            excess_pct=1.69596,
            used_pct=5.0,
            expected_pct=3.0,
            since_s=90.0,
            reports=3,
            jumped_s=95.0,
            jumped_pct=2.5,
            biggest_pct=1.0,
        ),
    ),
    (
        "an excess that begins",
        lambda: cusum.add_usage(Drift(), 2.0, 1.0, slack_pct=0.25, elapsed_s=5.0, now_s=100.0, memory_s=90.0),
        Drift(excess_pct=0.75, used_pct=2.0, expected_pct=1.0, since_s=95.0, reports=1, biggest_pct=1.0),
    ),
    (
        "an excess that is over",
        lambda: cusum.add_usage(DRIFT, 0.0, 1.5, slack_pct=0.25, elapsed_s=5.0, now_s=100.0, memory_s=90.0),
        Drift(jumped_s=95.0, jumped_pct=2.5),
    ),
    (
        "a jump is set aside",
        lambda: [
            cusum.add_usage(
                replace(DRIFT, jumped_s=jumped_s), 7.5, 1.0, slack_pct=0.25, elapsed_s=5.0, now_s=100.0, memory_s=90.0
            )
            for jumped_s in (-math.inf, 39.9, 40.0)
        ],
        [
            replace(DRIFT, jumped_s=100.0, jumped_pct=6.5),
            replace(DRIFT, jumped_s=100.0, jumped_pct=6.5),
            Drift(
                excess_pct=7.19596,
                used_pct=10.5,
                expected_pct=3.0,
                since_s=90.0,
                reports=3,
                jumped_s=100.0,
                biggest_pct=6.5,
            ),
        ],
    ),
    (
        "a second jump at once counts with the first",
        lambda: [
            cusum.add_usage(
                replace(one, jumped_s=jumped_s), 7.5, 1.0, slack_pct=0.25, elapsed_s=5.0, now_s=100.0, memory_s=90.0
            )
            for one in (DRIFT, replace(DRIFT, since_s=None))
            for jumped_s in (89.9, 90.0)
        ],
        [
            Drift(
                excess_pct=7.19596,
                used_pct=10.5,
                expected_pct=3.0,
                since_s=90.0,
                reports=3,
                jumped_s=100.0,
                biggest_pct=6.5,
            ),
            Drift(
                excess_pct=9.56086,
                used_pct=13.0,
                expected_pct=3.0,
                since_s=90.0,
                reports=4,
                jumped_s=100.0,
                biggest_pct=6.5,
            ),
            Drift(
                excess_pct=7.19596,
                used_pct=10.5,
                expected_pct=3.0,
                since_s=95.0,
                reports=3,
                jumped_s=100.0,
                biggest_pct=6.5,
            ),
            Drift(
                excess_pct=9.56086,
                used_pct=13.0,
                expected_pct=3.0,
                since_s=90.0,
                reports=4,
                jumped_s=100.0,
                biggest_pct=6.5,
            ),
        ],
    ),
    (
        "rises that are no jump",
        lambda: [
            cusum.add_usage(
                Drift(), used_pct, 1.0, slack_pct=0.0, elapsed_s=elapsed_s, now_s=100.0, memory_s=90.0
            ).reports
            for used_pct, elapsed_s in ((3.0, 1.0), (3.1, 1.0), (6.0, 5.0), (6.1, 5.0), (8.0, 6.0), (8.0, 6.1))
        ],
        [1, 0, 1, 0, 0, 1],
    ),
    ("duration of an excess", lambda: [one.duration_s(100.0) for one in (Drift(), DRIFT)], [0.0, 10.0]),
    (
        "excesses that are a drain",
        lambda: [
            cusum.is_drain(Drift(excess, reports=reports, biggest_pct=biggest), 2.0, 8.0)
            for excess, reports, biggest in (
                (1.9, 9, 0.0),
                (2.0, 3, 0.8),
                (2.0, 3, 0.9),
                (2.0, 2, 0.0),
                (3.4, 2, 2.2),
                (3.3, 2, 0.0),
                (7.9, 1, 7.9),
                (8.0, 1, 8.0),
            )
        ],
        [False, True, False, False, False, False, False, True],
    ),
]


@pytest.mark.parametrize(("what", "found", "expected"), ROWS, ids=[row[0] for row in ROWS])
def test_everything_that_comes_of_it(what: str, found: Callable[[], object], expected: object) -> None:
    assert rounded(found()) == expected
