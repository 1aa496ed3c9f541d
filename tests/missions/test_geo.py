"""Geodesy against published values and against an independent implementation of geodesics."""

from __future__ import annotations

import math

import numpy as np
import pyproj
import pytest

from missions.geo import LocalFrame, distance_m, grid_offsets_to_wgs84_deg, wrap_lon_deg


def test_distance_is_the_published_geodesic() -> None:
    # Wellington to Salamanca, the example of GeographicLib's documentation.
    assert distance_m(-41.32, 174.81, 40.96, -5.50) == pytest.approx(19959679.267, abs=1e-3)


def test_a_degree_along_the_equator_is_the_published_length() -> None:
    # WGS 84: 6378137 m * pi / 180.
    east, north = LocalFrame(0.0, 10.0).to_local_m(0.0, 11.0)
    assert east == pytest.approx(111319.4908, abs=1e-3)
    assert north == pytest.approx(0.0, abs=1e-6)


def test_distance_and_direction_from_the_depot_are_the_geodesic_ones() -> None:
    # New York to London Heathrow, the example of GeographicLib's GeodSolve: 5551759.400 m at 51.19888285 degrees.
    east, north = LocalFrame(40.6, -73.8).to_local_m(51.6, -0.5)
    assert math.hypot(east, north) == pytest.approx(5551759.400, abs=1e-2)
    assert math.degrees(math.atan2(east, north)) == pytest.approx(51.19888285, abs=1e-7)


def test_a_kilometre_away_from_the_depot_is_right_to_4_mm_at_30_km() -> None:
    frame = LocalFrame(49.6, 15.6)
    (lat_a, lon_a), (lat_b, lon_b) = frame.to_wgs84_deg(30_000.0, 0.0), frame.to_wgs84_deg(30_000.0, 1000.0)
    assert 1000.0 - distance_m(lat_a, lon_a, lat_b, lon_b) == pytest.approx(0.0037, abs=2e-4)


def test_many_places_equal_one_at_a_time() -> None:
    frame = LocalFrame(49.6, 15.6)
    places = np.array([[49.61, 15.62], [49.5, 15.5], [49.6, 15.6]])
    local = frame.many_to_local_m(places)
    assert local.tolist() == [list(frame.to_local_m(lat, lon)) for lat, lon in places]
    assert np.allclose(frame.many_to_wgs84_deg(local), places, atol=1e-10)


def test_a_depot_at_the_date_line_has_neighbours_on_both_sides() -> None:
    frame = LocalFrame(-17.0, 179.999)
    _, lon = frame.to_wgs84_deg(1000.0, 0.0)
    assert -180.0 <= lon < -179.98
    assert frame.to_local_m(-17.0, lon)[0] == pytest.approx(1000.0, abs=0.1)
    assert frame.many_to_wgs84_deg(np.array([[1000.0, 0.0]]))[0, 1] == lon


@pytest.mark.parametrize(
    ("lon", "same"), [(180.0, -180.0), (540.5, -179.5), (-180.0, -180.0), (-1e-16 - 180.0, -180.0)]
)
def test_longitudes_wrap(lon: float, same: float) -> None:
    assert wrap_lon_deg(lon) == pytest.approx(same)
    assert LocalFrame(0.0, lon).lon_deg == pytest.approx(same)


def test_a_longitude_in_range_keeps_all_its_digits() -> None:
    assert LocalFrame(0.0, 15.6137).lon_deg == 15.6137


@pytest.mark.parametrize("lat", [90.0, -89.5, 91.0])
def test_poles_are_refused(lat: float) -> None:
    with pytest.raises(ValueError, match=r"latitude .* expected -89"):
        LocalFrame(lat, 0.0)


@pytest.mark.parametrize("broken", [(math.nan, 0.0, 0.0), (0.0, math.inf, 0.0), (0.0, 0.0, math.nan)])
def test_a_depot_that_is_no_number_is_refused(broken: tuple[float, float, float]) -> None:
    with pytest.raises(ValueError, match="finite"):
        LocalFrame(*broken)


def test_up_counts_from_the_depot() -> None:
    assert LocalFrame(0.0, 0.0, 450.0).up_m(470.5) == 20.5


def test_grid_offsets_are_scaled_and_turned_as_the_grid_is() -> None:
    frame = LocalFrame(50.345749, 13.325244)
    lat, lon = grid_offsets_to_wgs84_deg(frame, np.array([[0.0, 1000.0]]), "EPSG:32633")[0]
    azimuth, _, length = pyproj.Geod(ellps="WGS84").inv(frame.lon_deg, frame.lat_deg, lon, lat)
    factors = pyproj.Proj("EPSG:32633").get_factors(frame.lon_deg, frame.lat_deg)
    assert length == pytest.approx(1000.0 / factors.meridional_scale, abs=0.01)
    assert azimuth == pytest.approx(factors.meridian_convergence, abs=0.01)
    assert factors.meridian_convergence == pytest.approx(-1.29, abs=0.01)


@pytest.mark.parametrize(("crs", "reason"), [("EPSG:999999", "unknown"), ("EPSG:4326", "not a map grid in metres")])
def test_a_system_that_is_no_grid_is_refused(crs: str, reason: str) -> None:
    with pytest.raises(ValueError, match=reason):
        grid_offsets_to_wgs84_deg(LocalFrame(50.0, 13.0), np.zeros((1, 2)), crs)
