"""Angles between looks."""

from __future__ import annotations

import pytest

from executor.core.payload.camera_state import angle_between_deg, bearing_deg


@pytest.mark.parametrize(
    ("one", "other", "angle"),
    [
        ((0.0, 0.0), (0.0, 90.0), 90.0),
        ((-90.0, 0.0), (-90.0, 200.0), 0.0),  # straight down there is no bearing
        ((-72.0, 350.0), (-72.0, 10.0), 6.1),
        ((-45.0, 0.0), (45.0, 0.0), 90.0),
    ],
)
def test_looks_are_apart_by_their_angle_in_space(
    one: tuple[float, float], other: tuple[float, float], angle: float
) -> None:
    assert angle_between_deg(*one, *other) == pytest.approx(angle, abs=0.1)


def test_bearings_are_clockwise_from_north() -> None:
    assert [bearing_deg((0.0, 0.0), end) for end in ((0.0, 1.0), (1.0, 0.0), (0.0, -1.0), (-1.0, 0.0))] == [
        0.0, 90.0, 180.0, 270.0,
    ]  # fmt: skip
