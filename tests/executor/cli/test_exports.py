"""The command `export`: plans for other ground stations, plans and flights for maps."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import gpxpy
import pyogrio
import pytest

from missions import read_plan
from missions.fences import build_fence
from missions.plan_file import setup_of_plan
from tests.executor.cli.test_main import Place, place
from tests.executor.flights import write_run

__all__ = ["place"]


@pytest.mark.parametrize("name", ["kml", "geojson", "gpx"])
def test_a_plan_becomes_one_file_for_maps(name: str, place: Place) -> None:
    code, out, _ = place.run("export", place.planned(), "--format", name, "-o", place.path("out"))
    assert (code, out.splitlines()) == (0, [place.path(f"out/plan.{name}")])
    layer = {"kml": "uav1", "geojson": None, "gpx": "routes"}[name]
    info, _, _, fields = pyogrio.raw.read(out.strip(), layer=layer)
    names = dict(zip([key.lower() for key in info["fields"]], fields, strict=True))["name"]
    assert "uav1 planned" in set(names)


def test_a_run_directory_becomes_one_file_with_what_was_flown(place: Place, tmp_path: Path) -> None:
    run = tmp_path / "run"
    run.mkdir()
    write_run(run)
    code, out, _ = place.run("export", str(run), "-o", place.path("out"))
    assert (code, out.splitlines()) == (0, [place.path("out/flight.kml")])
    assert {"line", "uav1", "uav2", "uav3"} == set(pyogrio.list_layers(out.strip())[:, 0])
    code, out, _ = place.run("export", str(run), "--format", "gpx", "-o", place.path("out"))
    gpx = gpxpy.parse(Path(out.strip()).read_text(encoding="utf-8"))
    assert {one.name for one in gpx.tracks} >= {"uav1 flown", "uav2 flown", "uav3 flown"}


@pytest.mark.parametrize("name", ["qgc", "waypoints"])
def test_a_run_directory_is_no_mission(name: str, place: Place, tmp_path: Path) -> None:
    run = tmp_path / "run"
    run.mkdir()
    write_run(run)
    said = place.refused("export", str(run), "--format", name, "-o", place.path("out"))
    assert said == (
        f"{run}: --format {name}: expected kml, geojson or gpx for a run directory; its plans can be exported one by "
        f"one, such as {run}/plan-000.json"
    )
    assert not Path(place.path("out")).exists()


def test_what_is_neither_is_refused_in_a_line(place: Place, tmp_path: Path) -> None:
    empty = tmp_path / "empty"
    empty.mkdir()
    assert "report.json" in place.refused("export", str(empty), "-o", place.path("out"))
    assert "missing.json" in place.refused("export", place.path("missing.json"), "-o", place.path("out"))
    Path(place.path("taken")).write_text("", encoding="utf-8")
    said = place.refused("export", place.planned(), "--format", "kml", "-o", place.path("taken"))
    assert said.startswith(f"{place.path('taken')}: cannot be written: ")


def mixed(place: Place, fence: str = "") -> str:
    """Plan for one vehicle of each autopilot; returns the plan's path."""
    place.site()
    site = Path(place.path("site.toml"))
    first, mark, second = site.read_text(encoding="utf-8").rpartition("[[vehicle]]")
    site.write_text(first + mark + second.replace('"ardupilot"', '"px4"') + fence, encoding="utf-8")
    plan = place.path("plan.json")
    assert place.run("plan", str(site), "--seconds", "0.2", "--all-vehicles", "--json", "-o", plan)[0] == 0
    return plan


def exported(place: Place, plan: str, *more: str) -> tuple[dict[str, Any], str]:
    """Export for QGroundControl; returns each vehicle's file, and what was said beside."""
    code, out, err = place.run("export", plan, "-o", place.path("out"), *more)
    assert code == 0
    return {Path(one).stem: json.loads(Path(one).read_text(encoding="utf-8")) for one in out.splitlines()}, err


def test_each_vehicles_mission_is_in_the_dialect_of_its_own_autopilot(place: Place) -> None:
    files, err = exported(place, mixed(place))
    assert {name: one["mission"]["firmwareType"] for name, one in files.items()} == {"uav1": 3, "uav2": 12}
    yaws = {name: one["mission"]["items"][-1]["params"][3] for name, one in files.items()}
    assert yaws == {"uav1": 0.0, "uav2": None}
    assert "autopilot" not in err


def test_a_plan_that_does_not_say_its_autopilots_is_written_for_one_and_says_so(place: Place) -> None:
    plan = Path(mixed(place))
    content = json.loads(plan.read_text(encoding="utf-8"))
    for vehicle in content["vehicles"]:
        del vehicle["autopilot"]
    plan.write_text(json.dumps(content), encoding="utf-8")
    files, err = exported(place, str(plan))
    assert {one["mission"]["firmwareType"] for one in files.values()} == {3}
    assert "uav2: the plan does not say its autopilot; written for ardupilot" in err
    files, err = exported(place, str(plan), "--autopilot", "px4")
    assert {one["mission"]["firmwareType"] for one in files.values()} == {12}
    assert "autopilot" not in err


def test_another_autopilot_than_the_plans_is_reported(place: Place) -> None:
    files, err = exported(place, mixed(place), "--autopilot", "px4")
    assert {one["mission"]["firmwareType"] for one in files.values()} == {12}
    assert "uav1: written for px4 as --autopilot has it; the plan is for ardupilot" in err


def test_the_fence_and_the_pad_that_a_site_asks_for_are_in_the_file(place: Place) -> None:
    plan = mixed(place, "[fence]\nenabled = true\nmargin_m = 30\n")
    files, err = exported(place, plan)
    assert "clears" not in err
    content = read_plan(plan)
    assert content.inspection is not None
    setup = setup_of_plan(content, content.inspection)
    for name, one in files.items():
        [polygon] = one["geoFence"]["polygons"]
        assert polygon["inclusion"] is True
        corners_m = [setup.frame.to_local_m(*corner) for corner in polygon["polygon"]]
        places = [item["params"][4:6] for item in one["mission"]["items"] if item["command"] in {16, 21}]
        least_m = build_fence([setup.frame.to_local_m(*place_deg) for place_deg in places], 29.9, 0.0)
        assert build_fence(corners_m, 0.05, 0.0).is_covering(least_m)
        pad = setup.pad_of(name)
        [rally] = one["rallyPoints"]["points"]
        assert setup.frame.to_local_m(*rally[:2]) == pytest.approx((pad.east_m, pad.north_m), abs=0.05)
        assert rally[2] == 0.0


@pytest.mark.parametrize(
    ("fence", "expected"),
    [
        ("", "the plan has neither fence nor rally points"),
        ('[fence]\nenabled = true\nrally = "keep"\n', "the plan has no rally points"),
    ],
)
def test_what_an_upload_would_clear_is_reported(place: Place, fence: str, expected: str) -> None:
    _, err = exported(place, mixed(place, fence))
    assert f"{expected} ([fence] of its site): the upload of these files clears those on board" in err


def test_a_format_that_cannot_say_what_a_vehicle_needs_is_refused_before_anything_is_written(place: Place) -> None:
    said = place.refused("export", mixed(place), "--format", "waypoints", "-o", place.path("out"))
    assert said.startswith("uav2: --format waypoints: PX4: item ")
    assert said.endswith("param4: expected a finite number, got nan; --format qgc has a word for it")
    assert not Path(place.path("out")).exists()
