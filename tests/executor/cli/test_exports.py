"""The command `export`: plans for other ground stations, plans and flights for maps."""

from __future__ import annotations

from pathlib import Path

import gpxpy
import pyogrio
import pytest

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
