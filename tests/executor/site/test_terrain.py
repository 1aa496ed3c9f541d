"""A site over ground that a raster knows: from its table to plan, run directory, export, checklist and picture."""

from __future__ import annotations

import json
import shutil
from pathlib import Path

import numpy as np
import pytest

from executor.adapters.run_directory import RunDirectory
from executor.analysis.height_profile import build_profiles
from executor.analysis.pictures import draw_profile_figure, save_figure
from executor.core.interface.codes import Severity
from executor.core.preflight import mission_checks
from executor.errors import SiteError
from executor.flight.run_start import FlightRequest, write_run_start
from executor.site import site_model
from executor.site.plan_summary import compute_planned_heights
from executor.site.site_file import read_site
from executor.site.site_model import SiteModel
from executor.site.site_planning import PlanRequest, check_plan_fits, describe_site_changes, plan_site, preview_loss
from missions import MissionsError, PlanFile, PlanFileError, check_plan, read_plan, write_plan
from planner import Cost
from tests.mountains import LAT_DEG, LON_DEG, Mountain, write_raster
from tests.terrain_judge import Judge, lines_over

MOUNTAIN = Mountain(2, relief_m=90.0, gorge_m=30.0, step_m=10.0)
WANTED = PlanRequest(Cost.MINMAX, 0.2, 1, starts=1)
RASTER = "Copernicus_DSM_COG_10_N46.tif"
SITE = f"""
[depot]
lat_deg = {LAT_DEG}
lon_deg = {LON_DEG}

[network]
file = "lines.geojson"
pylon_height_m = 25

[terrain]
files = "{RASTER}"
margin_m = 18

[inspection]
ceiling_m = 300
return_ceiling_m = 600

[[vehicle]]
name = "uav1"
connection = "udpin://127.0.0.1:14551"
sysid = 1
autopilot = "px4"

[[vehicle]]
name = "uav2"
connection = "udpin://127.0.0.1:14552"
sysid = 2
autopilot = "ardupilot"
"""


def write_site(folder: Path, text: str = SITE) -> Path:
    """Write a site whose network knows no heights at all, and its raster."""
    network = lines_over(MOUNTAIN, np.random.default_rng(2), pylons=6)
    places = [[pylon.lon_deg, pylon.lat_deg] for pylon in network.pylons]
    shapes: list[tuple[str, object, dict[str, str]]] = [
        ("Point", place, {"id": pylon.id}) for place, pylon in zip(places, network.pylons, strict=True)
    ]
    shapes += [("LineString", [places[one.a], places[one.b]], {"name": f"s{one.id}"}) for one in network.segments]
    features = [
        {"type": "Feature", "geometry": {"type": kind, "coordinates": at}, "properties": properties}
        for kind, at, properties in shapes
    ]
    document = {"type": "FeatureCollection", "features": features}
    (folder / "lines.geojson").write_text(json.dumps(document), encoding="utf-8")
    write_raster(folder / RASTER, MOUNTAIN)
    (folder / "site.toml").write_text(text, encoding="utf-8")
    return folder / "site.toml"


def ground_at(site: Path) -> SiteModel:
    return site_model.load_site_model(read_site(site), site.parent)


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("site")
    write_site(path)
    return path


@pytest.fixture(scope="module")
def ground(folder: Path) -> SiteModel:
    return ground_at(folder / "site.toml")


@pytest.fixture(scope="module")
def plan(ground: SiteModel) -> PlanFile:
    return plan_site(ground, WANTED)


def test_a_site_without_any_height_is_flown_by_the_raster(ground: SiteModel, plan: PlanFile, folder: Path) -> None:
    setup = ground.setup
    paths = site_model.build_paths(setup, site_model.name_routes(ground, plan.build_task(), plan.plan)).values()
    assert setup.terrain is not None
    assert setup.terrain.kept_m == 18.0 + 5.0
    judge = Judge((folder / RASTER,))
    for path in paths:
        assert judge.least_over_m(setup, path) > 23.0 - 0.03
        assert judge.least_home_m(setup, path) > 23.0 - 0.03
    assert f"the ground of 18 of 18 pylons is that of {RASTER}" in ground.worth_a_look


def test_plan_and_checklist_say_the_margin_and_how_sure_it_is(ground: SiteModel, plan: PlanFile) -> None:
    planned = compute_planned_heights(ground, [site_model.name_routes(ground, plan.build_task(), plan.plan)])
    assert f"; ground +-5 m by {RASTER}, and 18 m over that are kept" in planned.words
    assert ", lowest " in planned.words
    assert planned.document is not None
    assert planned.document["terrain"] == {
        "source": RASTER, "digest": ground.terrain and ground.terrain.elevation.digest, "vertical": "EGM2008",
        "uncertainty_m": 5.0, "margin_m": 18.0,
        "most_raised_m": round(float(ground.setup.layers.raised_m.max()), 1),
    }  # fmt: skip


def test_a_plan_file_needs_nothing_else_to_be_checked(plan: PlanFile, tmp_path: Path) -> None:
    write_plan(tmp_path / "plan.json", plan)
    again = read_plan(tmp_path / "plan.json")
    assert again.terrain == plan.terrain
    assert again.durations_s == plan.durations_s
    assert check_plan(again) == []
    lost, _ = preview_loss(again, "uav2", 60.0, cost=Cost.MINMAX, seconds=0.2, seed=1)
    assert lost.terrain == plan.terrain
    assert check_plan(lost, search_window=False) == []


def test_a_run_needs_no_raster_any_more(ground: SiteModel, plan: PlanFile, folder: Path, tmp_path: Path) -> None:
    order = FlightRequest(ground.site, folder, ground, plan, tmp_path, lambda _: ())
    write_run_start(order)
    assert RunDirectory(tmp_path).terrain.stat().st_size < 200_000
    again = ground_at(RunDirectory(tmp_path).site)
    assert again.terrain is not None
    assert again.terrain.elevation.digest == (ground.terrain and ground.terrain.elevation.digest)
    assert again.network.pylons == ground.network.pylons
    assert describe_site_changes(read_plan(RunDirectory(tmp_path).plan_path(0)), again) == []
    places = np.random.default_rng(1).uniform(-600, 600, (200, 2))
    np.testing.assert_array_equal(
        again.setup.layers.surface.interpolate_m(places), ground.setup.layers.surface.interpolate_m(places)
    )


def test_a_plan_over_another_ground_is_not_flown(plan: PlanFile, folder: Path, tmp_path: Path) -> None:
    site = shutil.copytree(folder, tmp_path / "later") / "site.toml"
    write_raster(site.parent / RASTER, Mountain(2, relief_m=90.0, gorge_m=30.0, step_m=12.0))
    with pytest.raises(PlanFileError, match=r"the site has changed: .*"):
        check_plan_fits(plan, ground_at(site), "plan.json")
    site.write_text(SITE.replace("margin_m = 18", "margin_m = 30"), encoding="utf-8")
    write_raster(site.parent / RASTER, MOUNTAIN)
    with pytest.raises(PlanFileError, match=r"terrain\.margin_m is 30, the plan was made with 18"):
        check_plan_fits(plan, ground_at(site), "plan.json")


def test_profiles_are_drawn_over_the_ground(ground: SiteModel, plan: PlanFile, tmp_path: Path) -> None:
    setup = ground.setup
    routes = site_model.name_routes(ground, plan.build_task(), plan.plan)
    paths = list(site_model.build_paths(setup, routes).values())
    drawn = build_profiles(setup, paths)
    assert [one.vehicle for one in drawn] == [path.vehicle for path in paths]
    for one in drawn:
        flying = (one.along_m > 0) & (one.along_m < one.along_m[-1])
        assert (one.flown_m[flying] >= one.least_m[flying] - 0.05).all()
        assert one.lowest_point[2] > 23.0
        assert one.return_m >= one.flown_m.max() - 0.01
        assert len(one.waypoints_m) > 4
    save_figure(draw_profile_figure(setup, routes), tmp_path / "profile.png")
    assert (tmp_path / "profile.png").read_bytes().startswith(b"\x89PNG")


def test_a_flight_that_is_too_low_stops(ground: SiteModel, plan: PlanFile) -> None:
    setup = ground.setup
    paths = list(site_model.build_paths(setup, site_model.name_routes(ground, plan.build_task(), plan.plan)).values())
    assert all(check.severity is not Severity.STOP for check in mission_checks.check_flight_heights(setup, paths))


REFUSED = {
    "flat beside it": ("[inspection]", '[inspection]\nheights = "flat"', "inspection.heights: expected 'known'"),
    "no file": (f'files = "{RASTER}"', "", "terrain.files: expected this key"),
    "files of nothing": (f'files = "{RASTER}"', "files = []", "terrain.files"),
    "another vertical": ("margin_m = 18", 'vertical = "navd88"', "terrain.vertical"),
    "no margin": ("margin_m = 18", "margin_m = 0", "terrain.margin_m"),
    "a sure raster": ("margin_m = 18", "uncertainty_m = -1", "terrain.uncertainty_m"),
    "an unknown key": ("margin_m = 18", "marginn_m = 18", "terrain.marginn_m: unknown key"),
    "poles of no height": ("pylon_height_m = 25", "pylon_height_m = 0", "network.pylon_height_m"),
    "poles that nobody knows": ("pylon_height_m = 25", "", "heights: expected height_m of every pylon"),
    "a raster that is not there": (RASTER, "none.tif", "none.tif: file: expected a raster of heights"),
}


@pytest.mark.parametrize("kind", REFUSED)
def test_what_is_wrong_with_a_site_is_one_line(kind: str, folder: Path, tmp_path: Path) -> None:
    before, after, expected = REFUSED[kind]
    site = shutil.copytree(folder, tmp_path / "wrong") / "site.toml"
    assert before in SITE
    site.write_text(SITE.replace(before, after), encoding="utf-8")
    with pytest.raises((SiteError, MissionsError)) as refused:
        ground_at(site)
    assert expected in str(refused.value)
    assert "\n" not in str(refused.value)


def test_several_files_and_folders(folder: Path, tmp_path: Path) -> None:
    site = shutil.copytree(folder, tmp_path / "tiles") / "site.toml"
    tiles = site.parent / "tiles"
    tiles.mkdir()
    (site.parent / RASTER).unlink()
    for number, bounds in enumerate(((-4000.0, -4000.0, 0.0, 4000.0), (0.0, -4000.0, 4000.0, 4000.0))):
        write_raster(tiles / f"Copernicus_DSM_COG_10_{number}.tif", MOUNTAIN, bounds_m=bounds)
    site.write_text(SITE.replace(f'"{RASTER}"', '["tiles"]'), encoding="utf-8")
    ground = ground_at(site)
    assert ground.terrain is not None
    assert ground.terrain.elevation.source == "2 rasters"
