"""Times and satellites in words."""

from __future__ import annotations

from collections.abc import Callable

import pytest

from executor.core import formatting
from tests.executor.core.steps import rounded

ROWS: list[tuple[str, Callable[[], object], object]] = [
    (
        "times in words",
        lambda: [formatting.format_duration(seconds) for seconds in (-3, 0, 59.9, 60, 3599, 3600, 7325)],
        ["0:00", "0:00", "0:59", "1:00", "59:59", "1:00:00", "2:02:05"],
    ),
    (
        "times since the take-off in words",
        lambda: [formatting.format_flight_time(seconds) for seconds in (None, -0.1, 0.0, 61.0)],
        ["", "", "T+0:00", "T+1:01"],
    ),
    (
        "satellites in words",
        lambda: [
            formatting.format_gps_fix(fix, satellites)
            for fix, satellites in ((None, 3), *((fix, None) for fix in range(8)), (3, 0), (3, 9))
        ],
        ["?", "no GPS", "no fix", "2D", "3D", "DGPS", "RTK float", "RTK", "fix 7", "3D, 0 sat", "3D, 9 sat"],
    ),
]


@pytest.mark.parametrize(("what", "found", "expected"), ROWS, ids=[row[0] for row in ROWS])
def test_everything_that_comes_of_it(what: str, found: Callable[[], object], expected: object) -> None:
    assert rounded(found()) == expected


def test_a_printed_command_survives_a_space() -> None:
    assert formatting.command_line("restore", "r A") == "faultline restore 'r A'"
    assert (
        formatting.command_line("fly", "site.toml", "--plan", "plan.json") == "faultline fly site.toml --plan plan.json"
    )
