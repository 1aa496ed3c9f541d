"""A trace keeps no more of a long flight than a chart can show."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import partial

import pytest

from executor.replay import replay_result
from executor.replay.replay_result import SampleTrace
from tests.executor.core.steps import rounded


def trace(count: int, every_s: float) -> SampleTrace:
    found = SampleTrace()
    for number in range(count):
        sample = replay_result.ReplaySample(number * every_s, None, None, None, None, None, 0.0, 0.0, None, None)
        found.add(sample.at_s, partial(replace, sample))
    return found


ROWS: list[tuple[str, Callable[[], object], object]] = [
    ("a trace keeps one in three seconds", lambda: len(trace(10, 1.0).samples), 4),
    (
        "a trace of a long flight",
        lambda: [
            (len(found.samples), found.every_s, found.samples[-1].at_s)
            for count in (4000, 4001, 4003)
            for found in (trace(count, 3.0),)
        ],
        [(4000, 3.0, 11997.0), (2001, 6.0, 12000.0), (2002, 6.0, 12006.0)],
    ),
]


@pytest.mark.parametrize(("what", "found", "expected"), ROWS, ids=[row[0] for row in ROWS])
def test_everything_that_comes_of_it(what: str, found: Callable[[], object], expected: object) -> None:
    assert rounded(found()) == expected
