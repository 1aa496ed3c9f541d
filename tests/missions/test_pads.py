"""Pads and the way around the columns of air above them."""

from __future__ import annotations

import itertools
import math

import numpy as np
import pytest

from missions import SafetyError, column_radius_m, place_pads
from missions.geometry import place_distances_m
from missions.pads import way_around_m

LINES_M = np.array([[[60.0, 0.0], [500.0, 0.0]], [[-60.0, 10.0], [-500.0, 80.0]]])


@pytest.mark.parametrize("layer_m", [3.0, 10.0])
@pytest.mark.parametrize("count", [1, 4, 20])
def test_pads_are_apart_and_clear_of_the_lines(count: int, layer_m: float) -> None:
    names = [f"uav{number}" for number in range(count)]
    pads = place_pads(names, LINES_M, layer_m=layer_m, alt_m=450.0)
    places = np.array([(pad.east_m, pad.north_m) for pad in pads])
    assert [pad.vehicle for pad in pads] == names
    assert all(pad.alt_m == 450.0 for pad in pads)
    assert place_distances_m(LINES_M, places).min() >= column_radius_m(layer_m)
    for one, other in itertools.combinations(places, 2):
        # A way must remain between two columns.
        assert math.dist(one, other) >= max(12.0, 2.0 * column_radius_m(layer_m))


def test_the_asked_spacing_is_kept() -> None:
    pads = place_pads(["a", "b"], LINES_M, layer_m=3.0, alt_m=0.0, pad_spacing_m=40.0)
    assert math.dist((pads[0].east_m, pads[0].north_m), (pads[1].east_m, pads[1].north_m)) >= 40.0


def test_pads_keep_away_from_a_line_over_the_depot() -> None:
    over = np.array([[[-500.0, 0.0], [500.0, 0.0]]])
    pads = place_pads(["a", "b", "c"], over, layer_m=5.0, alt_m=0.0)
    assert all(abs(pad.north_m) >= 7.0 for pad in pads)


def test_a_place_without_room_is_refused_in_one_line() -> None:
    mesh = np.array([[[-400.0, north], [400.0, north]] for north in np.arange(-400.0, 401.0, 10.0)])
    with pytest.raises(SafetyError, match=r"^pads: expected room for 2 pads 15\.4 m apart .* found 0$"):
        place_pads(["a", "b"], mesh, layer_m=5.0, alt_m=0.0)


def length_m(places: list[np.ndarray[tuple[int], np.dtype[np.float64]]]) -> float:
    return sum(math.dist(one, other) for one, other in itertools.pairwise(places))


def test_a_clear_way_is_straight() -> None:
    assert way_around_m(np.zeros(2), np.array([100.0, 0.0]), np.array([[50.0, 10.1]]), 10.0).shape == (0, 2)


def test_a_blocked_way_goes_around_and_is_hardly_longer_than_the_taut_one() -> None:
    start, goal, centre = np.zeros(2), np.array([100.0, 0.0]), np.array([[50.0, 1.0]])
    corners = way_around_m(start, goal, centre, 10.0)
    stops = [start, *corners, goal]
    legs = np.array(list(itertools.pairwise(stops)))
    assert place_distances_m(legs, centre).min() >= 10.0 - 1e-9
    # Taut string around a circle of radius 10 whose centre is 1 m off the middle: about 101.8 m; a corner costs little.
    assert 100.0 < length_m(stops) < 103.0
    # It passes on the side away from the centre.
    assert (corners[:, 1] < 0).all()


def test_a_way_through_a_field_of_columns_keeps_clear_of_all() -> None:
    radius = 7.0
    centres = np.array(
        [[east, north] for east in np.arange(20.0, 100.0, 15.4) for north in np.arange(-40.0, 41.0, 15.4)]
    )
    start, goal = np.array([0.0, 2.0]), np.array([130.0, -3.0])
    legs = np.array(list(itertools.pairwise([start, *way_around_m(start, goal, centres, radius), goal])))
    assert len(legs) > 2
    assert place_distances_m(legs, centres).min() >= radius - 1e-9


def test_a_column_around_the_goal_itself_is_no_obstacle() -> None:
    centres = np.array([[100.0, 3.0]])
    assert way_around_m(np.zeros(2), np.array([100.0, 0.0]), centres, 7.0).shape == (0, 2)


def test_a_start_walled_in_by_columns_goes_straight() -> None:
    angles = np.arange(6) * np.pi / 3.0
    ring = 10.0 * np.column_stack((np.cos(angles), np.sin(angles)))
    assert way_around_m(np.zeros(2), np.array([100.0, 0.0]), ring, 7.0).shape == (0, 2)


def test_distances_to_a_track_count_from_its_ends_too() -> None:
    tracks = np.array([[[0.0, 0.0], [10.0, 0.0]], [[5.0, 5.0], [5.0, 5.0]]])
    distances = place_distances_m(tracks, np.array([[13.0, 4.0], [5.0, 2.0]]))
    assert distances == pytest.approx(np.array([[5.0, math.hypot(8.0, 1.0)], [2.0, 3.0]]))
