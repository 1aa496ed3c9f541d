"""Which stretch of a span no picture shows."""

from __future__ import annotations

import pytest

from executor.core.imaging.asset_status import find_unseen_stretches, max_picture_spacing_m
from missions.cameras import SpanCameraTask, Trigger


@pytest.mark.parametrize(
    ("places", "unseen"),
    [
        ([], [(0.0, 100.0)]),
        ([0, 10, 20, 30, 40, 50, 60, 70, 80, 90, 100], []),
        ([10, 20, 30, 40, 50, 60, 70, 80, 90], []),  # the first and the last show the pylons
        ([10, 20, 30, 50, 60, 70, 80, 90], [(30, 50)]),
        ([90, 10, 60, 20, 40, 30, 50, 80, 70], []),  # in whichever order they were heard
        ([-3, 10, 20, 30, 40, 50, 60, 70, 80], [(80, 100.0)]),
    ],
)
def test_one_picture_that_is_missing_is_a_stretch_unseen(
    places: list[float], unseen: list[tuple[float, float]]
) -> None:
    most_m = max_picture_spacing_m(SpanCameraTask("rgb", Trigger.DISTANCE, 10.0), 3.0)
    assert find_unseen_stretches(100.0, places, most_m) == unseen


def test_a_camera_that_films_says_so_once_a_second() -> None:
    assert max_picture_spacing_m(SpanCameraTask("rgb", Trigger.VIDEO), 3.0) == pytest.approx(11.5)
