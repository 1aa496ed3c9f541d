"""A GPS fix and a time in words."""

from __future__ import annotations

import pytest

from executor.core import formatting

FIXES = ["no GPS", "no fix", "2D", "3D", "DGPS", "RTK float", "RTK", "fix 7"]


@pytest.mark.parametrize(("number", "name"), list(enumerate(FIXES)))
def test_a_gps_fix_in_words(number: int, name: str) -> None:
    assert formatting.format_gps_fix(number, None) == name
    assert formatting.format_gps_fix(number, 0) == f"{name}, 0 sat"


@pytest.mark.parametrize(
    ("seconds", "shown"),
    [(0.0, "0:00"), (59.9, "0:59"), (60.0, "1:00"), (3599.0, "59:59"), (3600.0, "1:00:00"), (-0.1, "0:00")],
)
def test_a_time_in_words(seconds: float, shown: str) -> None:
    assert formatting.format_duration(seconds) == shown
    assert formatting.format_flight_time(seconds) == ("" if seconds < 0 else f"T+{shown}")
