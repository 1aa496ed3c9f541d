"""The common surface: its bounds, its fit to the lines, and legs that follow it."""

from __future__ import annotations

import itertools

import numpy as np
import pytest

from missions.surface import CHECK_STEP_M, FOLLOW_M, Surface, build_flat_surface, fit_surface


def grid_m(reach: float, step: float) -> np.ndarray[tuple[int, int], np.dtype[np.float64]]:
    axis = np.arange(-reach, reach + step, step)
    return np.stack(np.meshgrid(axis, axis), axis=-1).reshape(-1, 2)


def test_on_a_lone_line_the_surface_is_the_line() -> None:
    tracks = np.array([[[0.0, 0.0], [300.0, 0.0]]])
    fitted = fit_surface(tracks, np.array([[40.0, 55.0]]), 5.0)
    assert fitted.surface.height_m(150.0, 0.0) == pytest.approx(47.5, abs=0.05)
    assert fitted.surface.height_m(0.0, 0.0) == pytest.approx(40.0, abs=0.05)
    assert fitted.error_m < 0.05


def test_the_surface_never_leaves_the_lines_heights_and_is_never_steeper_than_its_bound() -> None:
    tracks = np.array([[[0.0, 0.0], [300.0, 0.0]], [[50.0, 80.0], [50.0, 400.0]]])
    surface = fit_surface(tracks, np.array([[40.0, 55.0], [30.0, 70.0]]), 5.0).surface
    places = grid_m(600.0, 15.0)
    heights = surface.interpolate_m(places)
    assert heights.min() >= 30.0 - 1e-9
    assert heights.max() <= 70.0 + 1e-9
    east, north = (surface.interpolate_m(places + np.array(step)) for step in ([0.5, 0.0], [0.0, 0.5]))
    assert max(np.abs(east - heights).max(), np.abs(north - heights).max()) <= 0.5 * surface.slope + 1e-9


def test_the_spacing_is_the_layer_plus_slope_and_legs_off_the_surface() -> None:
    fitted = fit_surface(np.array([[[0.0, 0.0], [300.0, 0.0]]]), np.array([[40.0, 40.0]]), 10.0)
    slope = fitted.surface.slope
    assert fitted.spacing_m == pytest.approx(10.0 * (1 + slope**2) ** 0.5 + 2 * (FOLLOW_M + slope * CHECK_STEP_M))


def test_crossing_lines_of_different_height_cost_spacing() -> None:
    tracks = np.array([[[-200.0, 0.0], [200.0, 0.0]], [[0.0, -200.0], [0.0, 200.0]]])
    level = fit_surface(tracks, np.array([[40.0, 40.0], [40.0, 40.0]]), 5.0)
    apart = fit_surface(tracks, np.array([[40.0, 40.0], [60.0, 60.0]]), 5.0)
    # Where they cross, one surface cannot be at both heights: it is 10 m off each at best.
    assert apart.error_m >= 10.0 - 1e-9
    assert apart.spacing_m >= level.spacing_m + 18.0


def test_a_flat_surface_is_flat() -> None:
    assert build_flat_surface(15.0).interpolate_m(grid_m(500.0, 250.0)).tolist() == [15.0] * 25


def test_legs_that_follow_the_surface_stay_near_it_everywhere() -> None:
    surface = Surface(np.array([[0.0, 0.0], [100.0, 40.0], [220.0, -30.0]]), np.array([40.0, 46.0, 38.0]), 0.12)
    start = np.array([-150.0, 5.0, surface.height_m(-150.0, 5.0)])
    goal = np.array([300.0, 20.0, surface.height_m(300.0, 20.0)])
    stops = np.vstack((start, surface.follow_m(start, goal, FOLLOW_M), goal))
    assert len(stops) > 3
    for first, last in itertools.pairwise(stops):
        places = first + np.linspace(0.0, 1.0, 50)[:, np.newaxis] * (last - first)
        off = np.abs(surface.interpolate_m(places[:, :2]) - places[:, 2])
        assert off.max() <= FOLLOW_M + surface.slope * CHECK_STEP_M


def test_a_leg_over_flat_ground_needs_no_waypoint() -> None:
    start, goal = np.array([0.0, 0.0, 20.0]), np.array([900.0, 0.0, 20.0])
    assert build_flat_surface(20.0).follow_m(start, goal, FOLLOW_M).shape == (0, 3)


def test_a_very_long_network_is_fitted_with_bounded_work() -> None:
    tracks = np.array([[[1000.0 * n, 0.0], [1000.0 * (n + 1), 0.0]] for n in range(60)])
    assert len(fit_surface(tracks, np.full((60, 2), 40.0), 5.0).surface.points_m) <= 1500 + 2 * 60
