"""Flights over mountains, and who holds them against the raster: with a transformation and a reading of its own.

The judge takes latitudes and longitudes of waypoints, and heights over the vehicle's home as they would be sent; from
the raster it takes the highest of the four cells around every place, 5 m apart.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np
import pyproj
import rasterio

from missions import FlightPath, FlightSetup, Inspection, Network, Phase, Pylon, Segment, plan_flight_setup
from missions.geo import FloatArray, LocalFrame
from missions.readers.elevation_rasters import RasterOptions, read_elevation
from missions.terrain import Terrain, reading_box_m
from tests.mountains import LAT_DEG, LON_DEG, Mountain, write_raster

STEP_M = 5.0
FLEET = ("uav1", "uav2", "uav3", "uav4")
RASTERS = (("EPSG:4326", 1 / 3600), ("EPSG:32632", 30.0), ("EPSG:32632", 10.0), ("EPSG:31254", 25.0))


@dataclass(frozen=True)
class Judge:
    """Rasters, read whole."""

    paths: tuple[Path, ...]

    @cached_property
    def _rasters(self) -> list[tuple[FloatArray, object, pyproj.Transformer]]:
        found = []
        for path in self.paths:
            with rasterio.open(path) as dataset:
                heights = dataset.read(1).astype(np.float64)
                if dataset.nodata is not None:
                    heights[heights == dataset.nodata] = np.nan
                level = pyproj.CRS(dataset.crs.to_wkt())
                to_raster = pyproj.Transformer.from_crs("EPSG:4326", level.to_2d(), always_xy=True)
                found.append((heights, ~dataset.transform, to_raster))
        return found

    def highest_m(self, lat_lon_deg: FloatArray) -> FloatArray:
        best = np.full(len(lat_lon_deg), np.nan)
        for heights, back, to_raster in self._rasters:
            at = np.column_stack(
                (*to_raster.transform(lat_lon_deg[:, 1], lat_lon_deg[:, 0]), np.ones(len(lat_lon_deg)))
            )
            columns, rows = np.array(back).reshape(3, 3)[:2] @ at.T
            first = np.floor(np.column_stack((rows, columns)) - 0.5).astype(int)
            inside = ((first >= 0) & (first < np.array(heights.shape) - 1)).all(axis=1)
            r, c = first[inside].T
            four = np.stack((heights[r, c], heights[r + 1, c], heights[r, c + 1], heights[r + 1, c + 1]))
            best[inside] = np.fmax(best[inside], four.max(axis=0))
        return best

    def least_over_m(self, setup: FlightSetup, path: FlightPath) -> float:
        """Return how far over the highest cells a mission is at its lowest, take-off and landing left out."""
        home_m = setup.pad_of(path.vehicle).alt_m
        least_m = math.inf
        for before, after in itertools.pairwise(path.waypoints):
            if after.phase is not Phase.LAND:
                a = np.array([before.lat_deg, before.lon_deg, before.alt_rel_m + home_m])
                b = np.array([after.lat_deg, after.lon_deg, after.alt_rel_m + home_m])
                least_m = min(least_m, self._least_m(a, b))
        return least_m

    def least_home_m(self, setup: FlightSetup, path: FlightPath) -> float:
        """Return the same of its own level ways home, from every waypoint and from between them."""
        pad = setup.pad_of(path.vehicle)
        home = np.array([*setup.frame.to_wgs84_deg(pad.east_m, pad.north_m), 0.0])
        up = np.array([0.0, 0.0, setup.return_height_m(path.vehicle) + pad.alt_m])
        places = [np.array([point.lat_deg, point.lon_deg, 0.0]) for point in path.waypoints]
        places += [0.5 * (a + b) for a, b in itertools.pairwise(places)]
        return min(self._least_m(place + up, home + up) for place in places)

    def _least_m(self, a: FloatArray, b: FloatArray) -> float:
        metres = np.array([111_320.0, 111_320.0 * math.cos(math.radians(a[0])), 1.0])
        steps = max(1, math.ceil(float(np.linalg.norm((b - a) * metres)) / STEP_M))
        places = a + np.linspace(0.0, 1.0, steps + 1)[:, np.newaxis] * (b - a)
        over_m = places[:, 2] - self.highest_m(places[:, :2])
        return -math.inf if np.isnan(over_m).any() else float(over_m.min())


@dataclass(frozen=True)
class Case:
    """A fleet over mountains."""

    setup: FlightSetup
    judge: Judge
    routes: tuple[tuple[int, ...], ...]
    """Of each vehicle."""
    rng: np.random.Generator


def lines_over(mountain: Mountain, rng: np.random.Generator, *, lines: int = 3, pylons: int = 8) -> Network:
    """Return lines that wind over a mountain, with pylons that stand on it."""
    places: list[FloatArray] = []
    pairs: list[tuple[int, int]] = []
    first = rng.uniform(0, 2 * math.pi)
    for line in range(lines):
        # Apart: where lines of different heights cross in mid-span nobody flies, with or without a raster.
        heading = first + line * 2 * math.pi / lines
        place = rng.uniform(150, 250) * np.array([math.cos(heading), math.sin(heading)])
        for number in range(pylons):
            if number:
                pairs.append((len(places) - 1, len(places)))
            places.append(place)
            heading += rng.uniform(-0.25, 0.25)
            place = place + rng.uniform(90, 170) * np.array([math.cos(heading), math.sin(heading)])
    at = np.array(places)
    ground_m = mountain.at_m(at[:, 0], at[:, 1])
    depot_m = float(mountain.at_m(np.zeros(1), np.zeros(1))[0])
    frame = LocalFrame(LAT_DEG, LON_DEG, round(depot_m, 1))
    degrees = frame.many_to_wgs84_deg(at)
    known = tuple(
        Pylon(
            f"P{n}",
            float(degrees[n, 0]),
            float(degrees[n, 1]),
            round(float(ground_m[n]), 1),
            float(rng.uniform(18, 40)),
        )
        for n in range(len(at))
    )
    segments = tuple(Segment(n, *pair) for n, pair in enumerate(pairs))
    return Network(known, segments, frame, "lines.geojson")


def mountain_of(seed: int) -> Mountain:
    rng = np.random.default_rng([seed, 1])
    return Mountain(seed, relief_m=rng.uniform(40, 320), gorge_m=rng.uniform(0, 90), step_m=rng.uniform(0, 30))


def case_of(seed: int, folder: Path, *, holes: bool = False) -> Case:
    """Return a random fleet over a random mountain.

    Raises:
        ElevationError: the raster does not know all of the ground.
    """
    rng = np.random.default_rng(seed)
    mountain = mountain_of(seed)
    network = lines_over(mountain, rng)
    crs, cell = RASTERS[seed % len(RASTERS)]
    gaps = tuple((*rng.uniform(-2500, 2500, 2).tolist(), float(rng.uniform(40, 120))) for _ in range(3 if holes else 0))
    path = write_raster(folder / f"mountain-{seed}.tif", mountain, crs=crs, cell=cell, holes_m=gaps)
    reading = RasterOptions(network.frame, *reading_box_m(network), "egm96", float(rng.uniform(1, 8)))
    terrain = Terrain(read_elevation([path], reading), float(rng.uniform(10, 30)))
    fleet = FLEET[: int(rng.integers(2, 5))]
    inspection = Inspection(height_m=float(rng.uniform(12, 25)), ceiling_m=500.0, return_ceiling_m=1000.0)
    setup = plan_flight_setup(network, fleet, inspection, terrain=terrain)
    order = rng.permutation(len(network.segments))
    parts = np.array_split(order[: int(rng.integers(len(fleet), len(order) + 1))], len(fleet))
    routes = tuple(tuple(2 * int(one) + int(rng.integers(2)) for one in part) for part in parts)
    return Case(setup, Judge((path,)), routes, rng)


def cases(seeds: Sequence[int], folder: Path) -> Iterator[Case]:
    for seed in seeds:
        yield case_of(seed, folder)
