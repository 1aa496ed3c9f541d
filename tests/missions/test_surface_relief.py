"""Transits over ridges cost their climb: planned times and energies beside those of the paths that are flown."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path
from statistics import median

import numpy as np
import pytest

from missions import FlightModel, Pricing, build_flight_path, column_radius_m, dialect_for, estimate
from missions.pricing import build_priced_instance
from missions.terrain import Grid, hull_m, is_inside_convex, limit_slope
from planner import PRESETS, Cost, Plan, Route, Vehicle, build_steady_wind, evaluate, segment_of
from tests.terrain_judge import Case, case_of

POWER = build_steady_wind(next(iter(PRESETS.values())), 8.0, (0.0, 0.0))


def pricing_of(case: Case, autopilot: str) -> Pricing:
    setup, names = case.setup, case.setup.layers.vehicles
    models = {name: FlightModel(dialect_for(autopilot).performance, POWER, 8.0, 3.0) for name in names}
    pads = tuple((pad.east_m, pad.north_m) for pad in setup.pads)
    bases = {name: setup.base_of(name) for name in names}
    return Pricing(
        setup.tracks_up_m,
        bases,
        models,
        pads,
        column_radius_m(setup.layers.layer_m),
        10.0,
        relief=setup.layers.relief,
    )


def flown_over_planned(case: Case, pricing: Pricing) -> list[float]:
    names = case.setup.layers.vehicles
    instance = build_priced_instance(pricing, [Vehicle(name, (0.0, 0.0), 90.0) for name in names])
    covered = {segment_of(visit) for route in case.routes for visit in route}
    left = tuple(one for one in range(len(case.setup.network.segments)) if one not in covered)
    plan = Plan(tuple(Route(number, route) for number, route in enumerate(case.routes)), left)
    planned = evaluate(instance, plan, Cost.MINMAX).durations_s
    paths = [build_flight_path(case.setup, name, route) for name, route in zip(names, case.routes, strict=True)]
    return [
        estimate(path, pricing.models[path.vehicle]).duration_s / planned_s
        for path, planned_s in zip(paths, planned, strict=True)
        if path.waypoints
    ]


@pytest.mark.parametrize(("autopilot", "bound"), [("px4", 0.06), ("ardupilot", 0.16)])
def test_what_is_planned_is_what_is_flown_over_hills(autopilot: str, bound: float, tmp_path: Path) -> None:
    by_relief, by_lines = [], []
    for seed in range(8):
        case = case_of(seed, tmp_path)
        pricing = pricing_of(case, autopilot)
        by_relief += flown_over_planned(case, pricing)
        by_lines += flown_over_planned(case, replace(pricing, relief=None))
    assert max(abs(ratio - 1.0) for ratio in by_relief) < bound
    assert abs(median(by_relief) - 1.0) < 0.05
    # Straight legs make routes over hills look shorter than they are.
    assert median(by_lines) > median(by_relief)


def hills(seed: int = 3) -> Grid:
    rng = np.random.default_rng(seed)
    return Grid((-200.0, -100.0), 10.0, rng.uniform(0.0, 120.0, (41, 33)))


@pytest.mark.parametrize("slope", [0.2, 0.7])
def test_cones_are_over_or_under_every_height_and_no_steeper(slope: float) -> None:
    grid = hills()
    high, low = limit_slope(grid, slope, np.maximum), limit_slope(grid, -slope, np.minimum)
    assert (high.heights_m >= grid.heights_m).all()
    assert (low.heights_m <= grid.heights_m).all()
    places = grid.places_m.reshape(-1, 2)
    for one in (high, low):
        assert one.slope <= 1.4143 * slope + 1e-9
        for step in ((3.0, 0.0), (0.0, 3.0), (2.0, -2.0)):
            rise = np.abs(one.interpolate_m(places + np.array(step)) - one.interpolate_m(places))
            assert rise.max() <= one.slope * math.hypot(*step) + 1e-9
    # The highest peak stays as it is, and so does the lowest pit.
    assert high.heights_m.max() == grid.heights_m.max()
    assert low.heights_m.min() == grid.heights_m.min()


def test_a_hull_holds_all_places_and_nothing_beside() -> None:
    places = np.random.default_rng(1).normal(0, 100, (300, 2))
    hull = hull_m(places)
    assert is_inside_convex(hull, places, 1e-9).all()
    assert not is_inside_convex(hull, places + np.array([2000.0, 0.0])).any()
    assert len(hull) < 40
