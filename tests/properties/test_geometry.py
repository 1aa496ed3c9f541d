"""Distances from straight legs against the nearest of many places on them."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from missions.geo import FloatArray
from missions.geometry import find_nearest_on_legs, leg_distances_m, locate_on_leg, place_distances_m

# A coarse grid beside the fine one, so that legs without length, parallel ones and places on them are common.
COORDINATES = st.one_of(st.integers(-3, 3).map(float), st.floats(-50.0, 50.0, allow_subnormal=False))
FLAT = st.tuples(COORDINATES, COORDINATES)
SPACE = st.tuples(COORDINATES, COORDINATES, COORDINATES)
POINTS = 201
ROUNDING_M = 1e-6


def along(leg_m: FloatArray) -> FloatArray:
    """Return (POINTS, d) places on a leg, as far from each other."""
    points: FloatArray = leg_m[0] + np.linspace(0.0, 1.0, POINTS)[:, np.newaxis] * (leg_m[1] - leg_m[0])
    return points


def step_m(leg_m: FloatArray) -> float:
    """Return how far the nearest of them may be from where a leg is nearest."""
    return float(np.linalg.norm(leg_m[1] - leg_m[0])) / (POINTS - 1) / 2.0 + ROUNDING_M


def arrays(*points: tuple[float, ...]) -> FloatArray:
    return np.array(points, dtype=np.float64)


@pytest.mark.parametrize("point", [FLAT, SPACE], ids=["flat", "space"])
def test_a_place_is_as_far_as_the_nearest_point_of_a_leg(point: st.SearchStrategy[tuple[float, ...]]) -> None:
    @given(point, point, point)
    def holds(begin: tuple[float, ...], end: tuple[float, ...], place: tuple[float, ...]) -> None:
        leg, places = arrays(begin, end), arrays(place)
        (distance,), (share,) = (figures[0] for figures in find_nearest_on_legs(places, leg[:1], leg[1:] - leg[:1]))
        sampled = float(np.linalg.norm(along(leg) - places, axis=1).min())
        assert distance - ROUNDING_M <= sampled <= distance + step_m(leg)
        assert 0.0 <= share <= 1.0
        assert np.linalg.norm(leg[0] + share * (leg[1] - leg[0]) - places[0]) == pytest.approx(distance, abs=ROUNDING_M)

    holds()


@given(st.lists(FLAT, min_size=1, max_size=4), st.lists(st.tuples(FLAT, FLAT), min_size=1, max_size=4))
def test_many_at_once_are_each_by_itself(
    places: list[tuple[float, float]], legs: list[tuple[tuple[float, float], tuple[float, float]]]
) -> None:
    distances = place_distances_m(np.array(legs), np.array(places))
    assert distances.shape == (len(places), len(legs))
    for row, place in zip(distances, places, strict=True):
        for distance, (begin, end) in zip(row, legs, strict=True):
            assert distance == pytest.approx(locate_on_leg(begin, end, place)[1], abs=ROUNDING_M)


@given(FLAT, FLAT, st.floats(-2.0, 3.0), st.floats(-20.0, 20.0))
def test_a_place_is_found_where_it_was_put(
    begin: tuple[float, float], end: tuple[float, float], share: float, left_m: float
) -> None:
    one, other = np.array(begin), np.array(end)
    length = float(np.hypot(*(other - one)))
    if length < 0.01:
        return
    ahead = (other - one) / length
    place = one + share * (other - one) + left_m * np.array([-ahead[1], ahead[0]])
    along_m, away_m = locate_on_leg(begin, end, (float(place[0]), float(place[1])))
    beyond_m = max(-share, share - 1.0, 0.0) * length
    assert along_m == pytest.approx(share * length, abs=ROUNDING_M)
    assert away_m == pytest.approx(float(np.hypot(left_m, beyond_m)), abs=ROUNDING_M)


@given(SPACE, SPACE, SPACE, SPACE)
def test_legs_are_as_far_apart_as_the_nearest_of_their_points(
    begin_a: tuple[float, ...], end_a: tuple[float, ...], begin_b: tuple[float, ...], end_b: tuple[float, ...]
) -> None:
    leg_a, leg_b = arrays(begin_a, end_a), arrays(begin_b, end_b)
    distance = float(leg_distances_m(leg_a[np.newaxis], leg_b[np.newaxis])[0, 0])
    sampled = float(np.linalg.norm(along(leg_a)[:, np.newaxis] - along(leg_b), axis=2).min())
    assert distance - 1e-3 <= sampled <= distance + step_m(leg_a) + step_m(leg_b) + 1e-3


def test_a_leg_without_length_is_a_place() -> None:
    assert locate_on_leg((2.0, 2.0), (2.0, 2.0), (5.0, 6.0)) == (0.0, 5.0)
