"""The shape of the ground as it is shown: lit from the north-west, with lines of one height; nothing where unknown."""

from __future__ import annotations

import numpy as np
import pytest

from executor.site.ground_view import MOST_CELLS, Hillshade, compute_hillshade, interval_for, shade_heights
from tests.executor.grounds import Hills

LOW_M, HIGH_M = (-1000.0, -800.0), (1200.0, 1000.0)


def shown(hills: Hills, contour_m: float | None = None) -> Hillshade:
    found = compute_hillshade(hills, LOW_M, HIGH_M, contour_m)
    assert found is not None
    return found


def light(slope: tuple[float, float]) -> float:
    """Return how light a plane is that rises by so much to the east and to the north."""
    shade = shown(Hills(hill_m=0.0, slope=slope)).shade[..., 0]
    assert int(shade.max()) - int(shade.min()) <= 2
    return float(shade.mean())


def test_what_faces_north_west_is_light_and_what_faces_south_east_is_dark() -> None:
    level = light((0.0, 0.0))
    assert level == pytest.approx(255.0 * np.sqrt(0.5), abs=1.0)
    assert light((0.3, -0.3)) > level + 30  # falls to the north-west: it faces the sun
    assert light((-0.3, 0.3)) < level - 60
    assert light((0.3, 0.3)) == pytest.approx(light((-0.3, -0.3)), abs=1.0)


def test_gentle_hills_are_shown_steeper_than_they_are_and_flat_ground_stays_flat() -> None:
    gentle = shown(Hills(hill_m=6.0)).shade[..., 0]
    assert gentle.std() > 3.0  # as they are, it would be 0.8
    assert shown(Hills(hill_m=0.0)).shade[..., 0].std() == 0.0


def test_heights_lie_where_they_belong() -> None:
    hills = Hills()
    found = shown(hills)
    rows, columns = found.heights_m.shape
    east_m = np.linspace(LOW_M[0], HIGH_M[0], 2 * columns + 1)[1::2]
    north_m = np.linspace(HIGH_M[1], LOW_M[1], 2 * rows + 1)[1::2]
    assert found.heights_m == pytest.approx(hills.grid_m(east_m, north_m), abs=0.01)


def test_every_contour_line_lies_at_its_height() -> None:
    hills = Hills()
    found = shown(hills)
    assert found.interval_m == 10.0
    assert {one.height_m % 10.0 for one in found.contours} == {0.0}
    for one in found.contours:
        places = np.array(one.places_m)
        assert hills.at_m(*places.T) == pytest.approx(one.height_m, abs=0.4)
    assert {one.height_m for one in found.contours if one.bold} == {450.0, 500.0}
    assert {one.height_m for one in shown(hills, 25.0).contours} == {425.0, 450.0, 475.0, 500.0, 525.0}


def test_lines_suit_the_relief_and_are_never_without_number() -> None:
    assert [interval_for(relief_m) for relief_m in (0.0, 12.0, 80.0, 900.0, 8000.0)] == [0.5, 1.0, 10.0, 100.0, 500.0]
    assert len({one.height_m for one in shown(Hills(hill_m=800.0), 0.01).contours}) <= 301


def test_where_no_height_is_known_nothing_is_shown() -> None:
    found = shown(Hills(unknown_east_m=100.0))
    known = found.shade[..., 1] == 255
    assert 0.4 < known.mean() < 0.55
    assert not found.shade[~known].any()
    assert max(east for one in found.contours for east, _ in one.places_m) <= 100.0
    assert compute_hillshade(Hills(unknown_east_m=-5000.0), LOW_M, HIGH_M) is None


def test_the_grid_is_bounded_however_fine_the_raster() -> None:
    found = compute_hillshade(Hills(cell_m=0.1), (-20_000.0, -20_000.0), (20_000.0, 20_000.0))
    assert found is not None
    assert found.heights_m.size <= 1.01 * MOST_CELLS


def test_a_grid_of_a_single_slope_is_even() -> None:
    heights_m = np.add.outer(np.arange(5.0), np.arange(7.0)).astype(np.float32)
    assert np.unique(shade_heights(heights_m, (10.0, 10.0))[..., 0]).size == 1
