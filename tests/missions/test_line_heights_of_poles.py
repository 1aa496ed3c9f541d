"""Poles on the ground of a raster: what it fills in, and what contradicts it."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from missions import Network, NetworkError, with_heights
from missions.errors import ElevationError
from missions.geo import LocalFrame
from missions.line_heights import add_ground_heights, add_structure_heights
from missions.readers.elevation_rasters import RasterOptions, read_elevation
from missions.terrain import Elevation, reading_box_m
from tests.mountains import Mountain, write_raster
from tests.terrain_judge import lines_over

MOUNTAIN = Mountain(5, gorge_m=0.0, step_m=0.0, relief_m=50.0)


@pytest.fixture(scope="module")
def network() -> Network:
    return lines_over(MOUNTAIN, np.random.default_rng(5))


@pytest.fixture(scope="module")
def ground(network: Network, tmp_path_factory: pytest.TempPathFactory) -> Elevation:
    path = write_raster(tmp_path_factory.mktemp("ground") / "ground.tif", MOUNTAIN)
    return read_elevation([path], RasterOptions(network.frame, *reading_box_m(network), "egm96", 4.0))


def without_ground(network: Network) -> Network:
    return replace(network, pylons=tuple(replace(pylon, elevation_m=None) for pylon in network.pylons))


def moved(network: Network, by_m: float, *which: int) -> Network:
    pylons = list(network.pylons)
    for index in which or range(len(pylons)):
        pylons[index] = replace(pylons[index], elevation_m=(pylons[index].elevation_m or 0.0) + by_m)
    return replace(network, pylons=tuple(pylons))


def test_ground_that_no_file_knows_is_the_rasters(network: Network, ground: Elevation) -> None:
    filled, found = add_ground_heights(without_ground(network), ground, depot_known=True)
    assert found == (f"the ground of 24 of 24 pylons is that of {ground.source}",)
    for known, got in zip(network.pylons, filled.pylons, strict=True):
        assert got.elevation_m == pytest.approx(known.elevation_m, abs=2.0)


def test_what_the_file_knows_stays(network: Network, ground: Elevation) -> None:
    same, found = add_ground_heights(network, ground, depot_known=True)
    assert same.pylons == network.pylons
    assert found == ()


def test_a_depot_without_a_height_has_the_rasters(network: Network, ground: Elevation) -> None:
    frame = LocalFrame(network.frame.lat_deg, network.frame.lon_deg)
    placed, found = add_ground_heights(replace(network, frame=frame), ground, depot_known=False)
    assert placed.frame.alt_m == pytest.approx(network.frame.alt_m, abs=1.0)
    assert found[0].startswith("the depot's height is that of ground.tif, ")


def test_a_structures_height_is_asked_for_and_never_invented(network: Network) -> None:
    bare = replace(network, pylons=tuple(replace(pylon, height_m=None) for pylon in network.pylons))
    with pytest.raises(NetworkError, match="heights: expected height_m of every pylon"):
        with_heights(bare, flat=False)
    assert {pylon.height_m for pylon in add_structure_heights(bare, 25.0).pylons} == {25.0}
    assert add_structure_heights(network, 25.0).pylons == network.pylons


def test_all_pylons_over_or_under_the_raster_are_counted_from_something_else(
    network: Network, ground: Elevation
) -> None:
    with pytest.raises(
        NetworkError, match=r"pylon 'P0': elevation_m: .* more than 4[789] m above it: are they counted"
    ):
        add_ground_heights(moved(network, 48.0), ground, depot_known=True)


def test_one_gross_pylon_is_refused_by_its_name(network: Network, ground: Elevation) -> None:
    with pytest.raises(
        NetworkError, match=r"pylon 'P7': elevation_m: expected the ground above mean sea level, .* apart"
    ):
        add_ground_heights(moved(network, 90.0, 7), ground, depot_known=True)


def test_odd_pylons_are_worth_a_look(network: Network, ground: Elevation) -> None:
    _, found = add_ground_heights(moved(moved(network, 30.0, 7), 25.0, 9), ground, depot_known=True)
    (line,) = found
    assert line.startswith("pylon 'P7' stands at ")
    assert line.endswith(", and 1 more pylons are as far off")


def test_a_depot_that_contradicts_the_raster(network: Network, ground: Elevation) -> None:
    frame = network.frame
    with pytest.raises(NetworkError, match="depot: alt_m: expected the ground above mean sea level"):
        add_ground_heights(replace(network, frame=replace(frame, alt_m=frame.alt_m + 120.0)), ground, depot_known=True)
    _, found = add_ground_heights(
        replace(network, frame=replace(frame, alt_m=frame.alt_m + 20.0)), ground, depot_known=True
    )
    assert found[0].startswith("the depot is given at ")


def test_a_pylon_on_unknown_ground_is_named(network: Network, tmp_path: Path) -> None:
    east, north = network.positions_m[4].tolist()
    path = write_raster(tmp_path / "holed.tif", MOUNTAIN, holes_m=((east, north, 60.0),))
    holed = read_elevation([path], RasterOptions(network.frame, *reading_box_m(network), "egm96", 4.0))
    with pytest.raises(ElevationError, match=r"holed\.tif: no-data: .* 0 m from pylon 'P4'"):
        add_ground_heights(without_ground(network), holed, depot_known=True)
