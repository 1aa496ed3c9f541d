"""Geodesy there and back, anywhere on Earth that a depot may be."""

from __future__ import annotations

import math

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from missions.geo import LocalFrame, distance_m, wrap_lon_deg

LATITUDES = st.floats(-85.0, 85.0)
LONGITUDES = st.floats(-180.0, 179.999999)
OFFSETS_M = st.floats(-30_000.0, 30_000.0)


@settings(derandomize=True, deadline=None, max_examples=200)
@given(LATITUDES, LONGITUDES, OFFSETS_M, OFFSETS_M)
def test_local_metres_come_back(lat: float, lon: float, east: float, north: float) -> None:
    frame = LocalFrame(lat, lon)
    place = frame.to_wgs84_deg(east, north)
    assert -180.0 <= place[1] < 180.0
    assert math.dist(frame.to_local_m(*place), (east, north)) < 1e-4
    many = frame.many_to_wgs84_deg(np.array([[east, north]]))
    assert np.array_equal(many, [place])


@settings(derandomize=True, deadline=None, max_examples=200)
@given(LATITUDES, LONGITUDES, OFFSETS_M, OFFSETS_M)
def test_distance_from_the_depot_is_the_geodesic(lat: float, lon: float, east: float, north: float) -> None:
    place = LocalFrame(lat, lon).to_wgs84_deg(east, north)
    assert abs(distance_m(lat, lon, *place) - math.hypot(east, north)) < 1e-4


@settings(derandomize=True, deadline=None)
@given(st.floats(-1e5, 1e5))
def test_a_wrapped_longitude_is_the_same_meridian(lon: float) -> None:
    wrapped = wrap_lon_deg(lon)
    assert -180.0 <= wrapped < 180.0
    turns = (lon - wrapped) / 360.0
    assert abs(turns - round(turns)) < 1e-9
