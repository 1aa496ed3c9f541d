"""Areas among mountains: ways around them keep the margin over the ground, and out of the areas, at every 5 m.

Two judges, neither of which finds ways: the raster's cells under every leg, and shapely's distance from every area.
"""

from __future__ import annotations

import math
import random
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest
from shapely.geometry import LineString

from missions import FlightPath, FlightSetup, Inspection, build_flight_path, plan_flight_setup
from missions.area_rules import apply_areas, check_areas
from missions.errors import SafetyError
from missions.geo import FloatArray
from missions.no_fly_areas import Area, AreaKind
from missions.readers.elevation_rasters import RasterOptions, read_elevation
from missions.terrain import DETOUR_M, Terrain, reading_box_m
from tests.missions.test_surface_overland import judged, replanned
from tests.mountains import write_raster
from tests.properties.test_missions_areas import least_m, star
from tests.terrain_judge import FLEET, RASTERS, Case, Judge, lines_over, mountain_of

SEEDS = 8
ROUNDING_M = 0.02


@dataclass(frozen=True)
class Closed:
    """A case with areas, and the same without."""

    case: Case
    open: FlightSetup


def between(dice: random.Random, number: int, margin_m: float) -> Area:
    """Return a polygon or a corridor somewhere between the lines, away from the depot."""
    bearing, away_m = dice.uniform(0, 2 * math.pi), dice.uniform(350, 900)
    middle_m = (away_m * math.cos(bearing), away_m * math.sin(bearing))
    if dice.random() < 0.35:
        turn, half_m = dice.uniform(0, math.pi), dice.uniform(60, 160)
        line = tuple((middle_m[0] + side * half_m * math.cos(turn), middle_m[1] + side * half_m * math.sin(turn))
                     for side in (-1, 1))  # fmt: skip
        return Area(f"area {number}", AreaKind.CORRIDOR, (line,), margin_m, dice.uniform(10, 220))
    outline = star(dice, middle_m, dice.randint(3, 9), dice.uniform(60, 170))
    return Area(f"area {number}", AreaKind.NO_FLY, (outline,), margin_m)


def closed_case(seed: int, folder: Path, areas: list[Area] | None = None) -> Closed:
    """Return a random fleet over a random mountain, with areas between its lines."""
    rng, dice = np.random.default_rng([seed, 7]), random.Random(seed)
    mountain = mountain_of(seed)
    network = lines_over(mountain, rng, lines=3, pylons=6)
    crs, cell = RASTERS[seed % len(RASTERS)]
    path = write_raster(folder / f"hills-{seed}.tif", mountain, crs=crs, cell=cell)
    reading = RasterOptions(network.frame, *reading_box_m(network, DETOUR_M), "egm96", float(rng.uniform(1, 8)))
    terrain = Terrain(read_elevation([path], reading), float(rng.uniform(10, 30)))
    fleet = FLEET[: int(rng.integers(2, 4))]
    inspection = Inspection(height_m=float(rng.uniform(12, 25)), ceiling_m=500.0, return_ceiling_m=1000.0)
    while True:
        found = areas
        if found is None:
            found = [between(dice, count, dice.choice([5.0, 20.0, 60.0, 120.0])) for count in range(dice.randint(2, 5))]
        bare = plan_flight_setup(network, fleet, inspection, terrain=terrain, areas=found)
        try:
            setup = apply_areas(bare, found)
        except SafetyError:
            assert areas is None, "the depot is enclosed"
            continue
        never = {one.segment for one in setup.unreachable}
        open_segments = [one.id for one in network.segments if one.id not in never]
        if len(open_segments) >= 2 * len(fleet):
            break
        assert areas is None, "too little is left to fly"
    order = rng.permutation(open_segments)
    routes = tuple(
        tuple(2 * int(one) + int(rng.integers(2)) for one in part) for part in np.array_split(order, len(fleet))
    )
    return Closed(Case(setup, Judge((path,)), routes, rng), bare)


def paths_of(setup: FlightSetup, routes: tuple[tuple[int, ...], ...]) -> list[FlightPath]:
    return [
        build_flight_path(setup, name, route)
        for name, route in zip(setup.layers.vehicles, routes, strict=True)
        if route
    ]


def judged_among_areas(case: Case, paths: list[FlightPath]) -> None:
    for path in paths:
        for one in case.setup.areas:
            assert least_m(case.setup.frame, path, one) >= one.margin_m - ROUNDING_M, (one.name, path.vehicle)
    assert check_areas(case.setup, paths) == []
    judged(case, paths)


def flown_m(setup: FlightSetup, paths: list[FlightPath]) -> float:
    places: list[list[tuple[float, float]]] = [
        [setup.frame.to_local_m(point.lat_deg, point.lon_deg) for point in path.waypoints] for path in paths
    ]
    return float(sum(LineString(one).length for one in places))


@pytest.mark.parametrize("seed", range(SEEDS))
def test_plans_and_re_plans_among_areas_keep_the_margin_over_hills(seed: int, tmp_path: Path) -> None:
    found = closed_case(seed, tmp_path)
    case = found.case
    paths = paths_of(case.setup, case.routes)
    judged_among_areas(case, paths)
    judged_among_areas(case, replanned(case, paths))


def wall(seed: int, half_m: float) -> Area:
    """Return a long, thin area between the depot and the first line, across the way there."""
    network = lines_over(mountain_of(seed), np.random.default_rng([seed, 7]), lines=3, pylons=6)
    first_m = network.positions_m[0]
    ahead_m = first_m / np.hypot(*first_m)
    aside_m, away_m = np.array([-ahead_m[1], ahead_m[0]]), float(np.hypot(*first_m)) - 70.0
    corners = ((-30.0, -half_m), (20.0, -half_m), (20.0, half_m), (-30.0, half_m))
    ring = tuple(place_of(ahead_m * (away_m + along) + aside_m * across) for along, across in corners)
    return Area("wall", AreaKind.NO_FLY, (ring,), 20.0)


def place_of(place_m: FloatArray) -> tuple[float, float]:
    return float(place_m[0]), float(place_m[1])


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_a_way_around_is_flown_over_ground_that_is_known(seed: int, tmp_path: Path) -> None:
    """The ends of the wall lie beyond all lines: the raster is read there, and its ground is kept from."""
    found = closed_case(seed, tmp_path, [wall(seed, 900.0)])
    assert found.case.setup.unreachable == ()
    paths = paths_of(found.case.setup, found.case.routes)
    direct = paths_of(found.open, found.case.routes)
    assert flown_m(found.open, direct) + 1000.0 < flown_m(found.open, paths)
    judged_among_areas(found.case, paths)
    judged_among_areas(found.case, replanned(found.case, paths))


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_what_only_a_way_over_unknown_ground_leads_to_is_not_flown(seed: int, tmp_path: Path) -> None:
    """Once ways led around areas of kilometres at the height of the lines, 90 m below the ridges there."""
    found = closed_case(seed, tmp_path, [wall(seed, 2600.0)])
    why = {one.why for one in found.case.setup.unreachable}
    assert len(found.case.setup.unreachable) >= 5
    assert why == {"no path leads to it around the areas, over ground that is known"}
    paths = paths_of(found.case.setup, found.case.routes)
    judged_among_areas(found.case, paths)
    judged_among_areas(found.case, replanned(found.case, paths))


def test_half_of_these_flights_would_have_met_an_area(tmp_path: Path) -> None:
    met = flights = 0
    for seed in range(SEEDS):
        found = closed_case(seed, tmp_path)
        direct = paths_of(found.open, found.case.routes)
        flights += len(direct)
        met += sum(
            any(least_m(found.open.frame, path, one) < one.margin_m for one in found.case.setup.areas)
            for path in direct
        )
    assert met >= flights / 3
