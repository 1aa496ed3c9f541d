"""Layers of a fleet, and its RTL heights."""

from __future__ import annotations

import numpy as np
import pytest

from missions import (
    HeightReference,
    Inspection,
    SafetyError,
    plan_layers,
    tracks_m,
)
from missions.layers_and_rtl_heights import FLAT_M
from tests.missions.builders import FLEET, line_east, network_of


def test_tracks_lie_to_the_right_of_a_to_b() -> None:
    network = network_of([(0.0, 0.0), (0.0, 100.0), (200.0, 100.0)], [(0, 1), (2, 1)])
    north, west = tracks_m(network, 5.0)
    assert north == pytest.approx(np.array([[5.0, 0.0], [5.0, 100.0]]), abs=1e-6)
    assert west == pytest.approx(np.array([[200.0, 105.0], [0.0, 105.0]]), abs=1e-6)


def test_without_heights_layers_count_from_the_depots_ground() -> None:
    layers = plan_layers(line_east(), FLEET, Inspection(height_m=20.0))
    assert layers.reference is HeightReference.DEPOT_GROUND
    assert layers.reference.value == "the depot's ground"
    assert layers.spacing_m == 6.0
    assert [layers.height_m(name, 150.0, 30.0) for name in FLEET] == [20.0, 26.0, 32.0, 38.0]


def test_with_heights_layers_count_from_the_pylon_tops() -> None:
    network = network_of([(100.0, 0.0), (300.0, 0.0)], [(0, 1)], [(455.0, 30.0), (460.0, 32.0)])
    layers = plan_layers(network, FLEET, Inspection(height_m=15.0))
    assert layers.reference is HeightReference.PYLON_TOPS
    # The depot is at 450 m: 5 + 30 + 15 and 10 + 32 + 15.
    assert layers.track_heights_m.tolist() == [[50.0, 57.0]]
    assert layers.height_m("uav1", 200.0, -5.0) == pytest.approx(53.5, abs=0.1)
    assert layers.height_m("uav3", 200.0, -5.0) == pytest.approx(53.5 + 2 * layers.spacing_m, abs=0.1)


def test_pylons_at_the_level_of_the_sea_and_without_height_count_as_they_are() -> None:
    network = network_of(
        [(0.0, 0.0), (0.0, 100.0), (0.0, 200.0)], [(0, 1), (1, 2)], [(0.0, 30.0), (0.0, 0.0), (20.0, 0.0)]
    )
    layers = plan_layers(network, FLEET, Inspection(height_m=10.0))
    assert layers.track_heights_m.tolist() == [[-410.0, -440.0], [-440.0, -420.0]]


def test_a_vehicle_without_a_layer_is_refused() -> None:
    layers = plan_layers(line_east(), FLEET, Inspection(height_m=20.0))
    with pytest.raises(SafetyError, match=r"^vehicle 'uav9': expected one of uav1, uav2, uav3, uav4$"):
        layers.offset_m("uav9")


@pytest.mark.parametrize(("relief_m", "stacked"), [(0.0, False), (FLAT_M, False), (FLAT_M + 0.1, True), (20.0, True)])
def test_vehicles_return_in_their_layers_over_flat_ground_and_stacked_over_relief(
    relief_m: float, *, stacked: bool
) -> None:
    network = network_of([(100.0, 0.0), (300.0, 0.0)], [(0, 1)], [(455.0, 30.0), (455.0 + relief_m, 30.0)])
    layers = plan_layers(network, FLEET, Inspection(height_m=15.0))
    top_m, step_m = 50.0 + relief_m, layers.spacing_m
    # Over relief: the highest in its own layer, the others 5 m, 1 m of height keeping and a whole metre over the next.
    apart = (21.0, 14.0, 7.0, 0.0)
    expected = [top_m + 3 * step_m + up for up in apart] if stacked else [top_m + n * step_m for n in range(4)]
    assert [layers.return_up_m(name) for name in FLEET] == pytest.approx(expected)
