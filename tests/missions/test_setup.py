"""Layers, and the least distance between two flights on cases worked out by hand."""

from __future__ import annotations

import math
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from pydantic import TypeAdapter, ValidationError

from missions import (
    FlightPath,
    FlightSetup,
    HeightReference,
    Inspection,
    Pad,
    SafetyError,
    check_separation,
    plan_flight_setup,
)
from missions.geo import FloatArray
from missions.geometry import leg_distances_m
from missions.setup import _find_nearest_legs
from missions.waypoints import legs_m
from tests.missions.builders import FLEET, FRAME, default_setup, line_east, network_of, path_through


def separation_m(path_a: FlightPath, path_b: FlightPath, home_alt_m: tuple[float, float] = (0.0, 0.0)) -> float:
    """Return the least distance in space between two flights; infinite if one of them stays on the ground."""
    nearest = _find_nearest_legs(path_a, path_b, home_alt_m)
    return math.inf if nearest is None else nearest[0]


@pytest.mark.parametrize(
    ("places_b", "least"),
    [
        # Crossing at the same height, at mid-leg of both.
        ([(50.0, -50.0, 20.0), (50.0, 50.0, 20.0)], 0.0),
        # Crossing 7 m above.
        ([(50.0, -50.0, 27.0), (50.0, 50.0, 27.0)], 7.0),
        # Parallel, 3 m beside and 4 m above.
        ([(20.0, 60.0, 24.0), (20.0, 3.0, 24.0), (90.0, 3.0, 24.0)], math.hypot(3.0, 4.0)),
        # Behind the end of the leg: end to end.
        ([(106.0, 8.0, 20.0), (200.0, 80.0, 20.0)], 10.0),
        # Far above, but its take-off column stands 6 m beside the leg.
        ([(50.0, 6.0, 90.0), (50.0, 200.0, 90.0)], 6.0),
        # Climbs through: a slanted leg across.
        ([(50.0, -40.0, 10.0), (50.0, 40.0, 30.0)], 0.0),
    ],
)
def test_separation_of_constructed_paths(places_b: list[tuple[float, float, float]], least: float) -> None:
    path_a = path_through("a", [(0.0, 0.0, 20.0), (100.0, 0.0, 20.0)])
    path_b = path_through("b", places_b)
    assert separation_m(path_a, path_b) == pytest.approx(least, abs=1e-3)
    assert separation_m(path_b, path_a) == pytest.approx(least, abs=1e-3)


METRES = st.integers(-60, 60).map(float)
PLACES = st.lists(st.tuples(METRES, METRES, st.integers(1, 40).map(float)), min_size=1, max_size=3)
SHARES = np.linspace(0.0, 1.0, 61)


def sampled_m(places_m: list[tuple[float, float, float]]) -> FloatArray:
    """Return many points of a flight from the ground below its first place."""
    corners = np.array([(*places_m[0][:2], 0.0), *places_m])
    return np.concatenate([a + SHARES[:, np.newaxis] * (b - a) for a, b in pairwise(corners)])


@given(PLACES, PLACES)
def test_the_separation_is_the_least_distance_of_all_points(
    places_a: list[tuple[float, float, float]], places_b: list[tuple[float, float, float]]
) -> None:
    points_a, points_b = sampled_m(places_a), sampled_m(places_b)
    least = float(np.sqrt(((points_a[:, np.newaxis] - points_b[np.newaxis]) ** 2).sum(axis=2)).min())
    found = separation_m(path_through("a", places_a), path_through("b", places_b))
    # Neighbouring points are at most 2.9 m from each other, so no place of a leg is further than half of that from one.
    assert least - 2.9 <= found <= least + 1e-3


def test_a_conflict_is_reported_from_a_millimetre_below_the_distance() -> None:
    def conflicts(up_m: float) -> int:
        paths = [path_through("a", [(0.0, 0.0, 20.0), (100.0, 0.0, 20.0)])]
        paths.append(path_through("b", [(50.0, -50.0, up_m), (50.0, 50.0, up_m)]))
        return len(check_separation(paths, 5.0))

    assert [conflicts(up_m) for up_m in (24.998, 24.9995, 25.0, 25.5)] == [1, 0, 0, 0]


def test_legs_begin_on_the_ground_of_the_vehicles_home() -> None:
    path = path_through("a", [(10.0, 5.0, 20.0), (100.0, 5.0, 30.0)])
    expected = [[[10.0, 5.0, 3.0], [10.0, 5.0, 23.0]], [[10.0, 5.0, 23.0], [100.0, 5.0, 33.0]]]
    assert legs_m(path, FRAME, 3.0) == pytest.approx(np.array(expected), abs=1e-3)
    assert legs_m(path, FRAME)[0, 0, 2] == 0.0


def test_homes_at_different_heights_count() -> None:
    path_a = path_through("a", [(0.0, 0.0, 20.0), (100.0, 0.0, 20.0)])
    path_b = path_through("b", [(50.0, -50.0, 27.0), (50.0, 50.0, 27.0)])
    assert separation_m(path_a, path_b, home_alt_m=(457.0, 450.0)) == pytest.approx(0.0, abs=1e-3)
    assert separation_m(path_a, path_b, home_alt_m=(450.0, 453.0)) == pytest.approx(10.0, abs=1e-3)


def test_legs_that_touch_at_an_end_and_legs_that_cross() -> None:
    flat = np.array([[[0.0, 0.0, 0.0], [10.0, 0.0, 0.0]]])
    for other, expected_m in [
        ([[5.0, -5.0, 3.0], [5.0, 5.0, 3.0]], 3.0),
        ([[5.0, 0.0, 3.0], [5.0, 9.0, 3.0]], 3.0),
        ([[5.0, -9.0, 3.0], [5.0, 0.0, 3.0]], 3.0),
        ([[5.0, 4.0, 3.0], [5.0, 9.0, 3.0]], 5.0),
        ([[10.0, -5.0, 3.0], [10.0, 5.0, 3.0]], 3.0),
        ([[14.0, -5.0, 3.0], [14.0, 5.0, 3.0]], 5.0),
        ([[-4.0, -5.0, 3.0], [-4.0, 5.0, 3.0]], 5.0),
        ([[2.0, 4.0, 3.0], [8.0, 4.0, 3.0]], 5.0),
        ([[5.0, 4.0, 3.0], [5.0, 4.0, 3.0]], 5.0),
    ]:
        legs = np.array([other])
        assert leg_distances_m(flat, legs).tolist() == [[pytest.approx(expected_m)]], other
        assert leg_distances_m(legs, flat).tolist() == [[pytest.approx(expected_m)]], other


def test_a_vehicle_on_the_ground_counts_for_nothing() -> None:
    path = path_through("a", [(0.0, 0.0, 20.0), (100.0, 0.0, 20.0)])
    assert separation_m(path, FlightPath("b", ())) == math.inf
    assert check_separation([path, FlightPath("b", ())], 5.0) == []


def test_conflicts_are_reported_in_words() -> None:
    paths = [
        path_through("uav1", [(0.0, 0.0, 20.0), (100.0, 0.0, 20.0)]),
        path_through("uav2", [(50.0, -50.0, 23.0), (50.0, 50.0, 23.0)]),
        path_through("uav3", [(0.0, 500.0, 20.0), (100.0, 500.0, 20.0)]),
    ]
    assert check_separation(paths, 5.0) == [
        "uav1 on leg 1 (transit) and uav2 on leg 1 (transit) come within 3.00 m, 5 m expected"
    ]
    assert check_separation(paths, 3.0) == []
    assert check_separation(paths, 5.0, home_alt_m={"uav1": 450.0, "uav2": 453.0, "uav3": 450.0}) == []


def test_a_setup_knows_its_pads() -> None:
    setup = default_setup()
    assert setup.pad_of("uav2") == setup.pads[1]
    assert setup.home_alt_m == dict.fromkeys(FLEET, 462.0)
    assert setup.obstacles_for("uav1").centres_m == tuple((pad.east_m, pad.north_m) for pad in setup.pads[1:])
    with pytest.raises(SafetyError, match="vehicle 'uav9': expected one of uav1"):
        setup.pad_of("uav9")


def test_pads_may_be_given_where_the_vehicles_really_stand() -> None:
    pads = [Pad("uav1", 0.0, 30.0, 451.0), Pad("uav2", 0.0, -30.0, 449.0)]
    setup = plan_flight_setup(line_east(), ["uav1", "uav2"], Inspection(), pads=pads)
    assert setup.pads == tuple(pads)
    with pytest.raises(SafetyError, match=r"^pads: expected one each for uav2, uav1, in that order$"):
        plan_flight_setup(line_east(), ["uav2", "uav1"], Inspection(), pads=pads)


def test_lines_below_the_depot_are_refused() -> None:
    network = network_of([(100.0, 0.0), (300.0, 0.0)], [(0, 1)], [(380.0, 30.0), (380.0, 30.0)])
    with pytest.raises(SafetyError, match=r"^inspection\.height_m: .* pad of uav1, got -25\.0 m: the lines lie below"):
        plan_flight_setup(network, ["uav1"], Inspection(height_m=15.0))


@pytest.mark.parametrize("key", ["height_m", "standoff_m", "speed_m_s", "transit_speed_m_s", "layer_m", "ceiling_m"])
@pytest.mark.parametrize("value", [-1.0, 1001.0, math.nan])
def test_an_inspection_figure_of_a_file_that_is_not_positive_is_named(key: str, value: float) -> None:
    with pytest.raises(ValidationError, match=key):
        TypeAdapter(Inspection).validate_python({key: value})


def test_a_standoff_of_nothing_is_allowed_and_a_speed_of_nothing_is_not() -> None:
    assert TypeAdapter(Inspection).validate_python({"standoff_m": 0.0}).standoff_m == 0.0
    with pytest.raises(ValidationError, match="speed_m_s"):
        TypeAdapter(Inspection).validate_python({"speed_m_s": 0.0})


def test_the_default_network_needs_little_more_than_the_layer() -> None:
    setup: FlightSetup = default_setup(5.0)
    assert setup.layers.reference is HeightReference.PYLON_TOPS
    assert 6.0 < setup.layers.spacing_m < 9.0
