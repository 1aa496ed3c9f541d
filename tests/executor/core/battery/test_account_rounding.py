"""Two roundings of one percentage are finer than each."""

from __future__ import annotations

from collections.abc import Callable

import pytest

from executor.core.battery.account import PercentRounding
from tests.executor.core.steps import rounded

ROWS: list[tuple[str, Callable[[], object], object]] = [
    (
        "two roundings of one percentage",
        lambda: [
            PercentRounding(rounded, rounded_s, ceiled, ceiled_s).percent
            for rounded, rounded_s, ceiled, ceiled_s in (
                (96.0, 1.0, 96.0, 1.5),
                (96.0, 1.0, 97.0, 5.0),
                (96.0, 1.0, 97.0, 5.1),
                (96.0, 5.1, 97.0, 1.0),
                (96.0, 1.0, 98.0, 1.5),
                (96.0, 1.5, 98.0, 1.0),
                (96.0, 1.0, 95.0, 1.0),
                (97.0, 1.0, 96.5, 1.2),
            )
        ],
        [95.75, 96.25, 97.0, 96.0, 97.5, 96.0, 96.0, 96.0],
    ),
]


@pytest.mark.parametrize(("what", "found", "expected"), ROWS, ids=[row[0] for row in ROWS])
def test_everything_that_comes_of_it(what: str, found: Callable[[], object], expected: object) -> None:
    assert rounded(found()) == expected
