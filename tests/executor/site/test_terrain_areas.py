"""A site with areas and terrain: plan, profile, re-plan and run directory, over hills and around the areas."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from executor.adapters.run_directory import RunDirectory
from executor.analysis.height_profile import build_profiles
from executor.flight.run_start import FlightRequest, write_run_start
from executor.site import site_model
from executor.site.site_model import SiteModel
from executor.site.site_planning import describe_site_changes, plan_site, preview_loss
from missions import FlightPath, PlanFile, check_plan, continue_path, estimate, read_plan, write_plan
from missions.area_rules import check_areas
from missions.geo import LocalFrame
from planner import Cost
from tests.executor.site.test_terrain import MOUNTAIN, RASTER, SITE, WANTED, ground_at, write_site
from tests.missions.test_surface_overland_areas import ROUNDING_M
from tests.mountains import LAT_DEG, LON_DEG
from tests.properties.test_missions_areas import least_m
from tests.terrain_judge import Judge, lines_over

KEPT_M = 23.0
"""18 m, and 5 m that the raster may be off."""
NEAR_M = 0.03


def walls() -> str:
    """Return areas between the depot and the first two lines, wider than the lines are long."""
    network = lines_over(MOUNTAIN, np.random.default_rng(2), pylons=6)
    frame, tables = LocalFrame(LAT_DEG, LON_DEG, 0.0), ""
    for number, pylon in ((1, 0), (2, 6)):
        first_m = network.positions_m[pylon]
        ahead_m = first_m / np.hypot(*first_m)
        aside_m = np.array([-ahead_m[1], ahead_m[0]])
        middle_m = first_m - 60.0 * ahead_m
        corners = [middle_m + along * ahead_m + across * aside_m
                   for along, across in ((-15, -160), (15, -160), (15, 260), (-15, 260))]  # fmt: skip
        places = [frame.to_wgs84_deg(float(east), float(north)) for east, north in corners]
        polygon = ", ".join(f"[{lat:.7f}, {lon:.7f}]" for lat, lon in places)
        tables += f'\n[[area]]\nname = "wall {number}"\nmargin_m = 15\npolygon = [{polygon}]\n'
    return tables


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("site")
    write_site(path, SITE + walls())
    return path


@pytest.fixture(scope="module")
def ground(folder: Path) -> SiteModel:
    return ground_at(folder / "site.toml")


@pytest.fixture(scope="module")
def plan(ground: SiteModel) -> PlanFile:
    return plan_site(ground, WANTED)


def paths_of(ground: SiteModel, plan: PlanFile) -> list[FlightPath]:
    setup = ground.setup
    return list(site_model.build_paths(setup, site_model.name_routes(ground, plan.build_task(), plan.plan)).values())


def judged(ground: SiteModel, folder: Path, paths: list[FlightPath]) -> None:
    setup, judge = ground.setup, Judge((folder / RASTER,))
    assert len(setup.areas) == 2
    for path in paths:
        assert judge.least_over_m(setup, path) >= KEPT_M - NEAR_M
        assert judge.least_home_m(setup, path) >= KEPT_M - NEAR_M
        for one in setup.areas:
            assert least_m(setup.frame, path, one) >= one.margin_m - ROUNDING_M
    assert check_areas(setup, paths) == []


def test_a_plan_leads_around_areas_and_over_hills(ground: SiteModel, plan: PlanFile, folder: Path) -> None:
    paths = paths_of(ground, plan)
    judged(ground, folder, paths)
    open_folder = folder / "open"
    open_folder.mkdir()
    open_ground = ground_at(write_site(open_folder))
    straight = paths_of(open_ground, plan)
    met = [least_m(ground.setup.frame, path, one) < one.margin_m for path in straight for one in ground.setup.areas]
    assert any(met), "they are in the way"
    assert sum(len(path.waypoints) for path in paths) > sum(len(path.waypoints) for path in straight)


def test_its_times_are_about_those_that_it_was_chosen_by(ground: SiteModel, plan: PlanFile) -> None:
    priced = site_model.build_pricing(ground)
    for path in paths_of(ground, plan):
        flown_s = estimate(path, priced.models[path.vehicle]).duration_s
        planned_s = plan.durations_s[[one.name for one in plan.vehicles].index(path.vehicle)]
        # As over hills without areas: the surface is asked at a few places along each leg, and a plan errs to be long.
        assert 0.99 * flown_s <= planned_s <= 1.06 * flown_s


def test_the_profile_of_a_way_around_is_over_what_is_asked(ground: SiteModel, plan: PlanFile) -> None:
    setup = ground.setup
    for one in build_profiles(setup, paths_of(ground, plan)):
        flying = (one.along_m > 0) & (one.along_m < one.along_m[-1])
        assert (one.flown_m[flying] >= one.least_m[flying] - 0.05).all()
        assert one.lowest_point[2] > KEPT_M - NEAR_M


def test_a_re_plan_leads_around_them_as_well(ground: SiteModel, plan: PlanFile, folder: Path, tmp_path: Path) -> None:
    write_plan(tmp_path / "plan.json", plan)
    again = read_plan(tmp_path / "plan.json")
    assert check_plan(again) == []
    assert again.areas == plan.areas
    lost, _ = preview_loss(again, "uav2", 60.0, cost=Cost.MINMAX, seconds=0.2, seed=1)
    assert check_plan(lost, search_window=False) == []
    setup, [path, *_] = ground.setup, paths_of(ground, plan)
    rng = np.random.default_rng(4)
    for keep_waypoints in range(1, len(path.waypoints), 3):
        visits = [2 * int(one) + int(rng.integers(2)) for one in rng.permutation(len(ground.network.segments))[:5]]
        judged(ground, folder, [continue_path(setup, path, keep_waypoints, visits)])


def test_a_run_needs_neither_raster_nor_site(ground: SiteModel, plan: PlanFile, folder: Path, tmp_path: Path) -> None:
    write_run_start(FlightRequest(ground.site, folder, ground, plan, tmp_path, lambda _: ()))
    again = ground_at(RunDirectory(tmp_path).site)
    assert describe_site_changes(read_plan(RunDirectory(tmp_path).plan_path(0)), again) == []
    assert [path.waypoints for path in paths_of(again, plan)] == [path.waypoints for path in paths_of(ground, plan)]
