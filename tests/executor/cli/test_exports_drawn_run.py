"""A flight exported for maps: the flight in `flights`, as programs of others read it."""

from __future__ import annotations

import json
from datetime import UTC, datetime, timedelta
from pathlib import Path

import gpxpy
import pyogrio
import pytest
import shapely
from lxml import etree

from executor.cli.exports import build_drawn_run
from executor.errors import LogError
from missions.exports import MapFeatureKind, format_geojson, format_gpx, format_kml
from tests.executor.flights import LAUNCH_S, write_run
from tests.missions.builders import FRAME
from tests.missions.exports.kmlschema import kml_schema

LAUNCHED = datetime.fromtimestamp(1.8e9 + LAUNCH_S, UTC)
KML = "{http://www.opengis.net/kml/2.2}"
GX = "{http://www.google.com/kml/ext/2.2}"


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("run")
    write_run(folder)
    return folder


def test_gpxpy_reads_every_track_with_times(run: Path) -> None:
    gpx = gpxpy.parse(format_gpx(build_drawn_run(run)))
    flown = {one.name: one for one in gpx.tracks if one.type == "flown"}
    assert set(flown) == {"uav1 flown", "uav2 flown", "uav3 flown"}
    points = flown["uav1 flown"].segments[0].points
    assert len(points) == 151
    assert points[0].time == LAUNCHED
    assert points[40].time == LAUNCHED + timedelta(seconds=40)
    east_m, north_m = FRAME.to_local_m(points[40].latitude, points[40].longitude)
    assert (east_m, north_m) == pytest.approx((400.0, 0.0), abs=0.06)
    assert points[40].elevation == 480.0
    assert points[0].elevation == 450.0
    # 5 m/s along the line: what any program makes of places and times.
    assert points[50].speed_between(points[45]) == pytest.approx(5.0, abs=0.05)


def test_a_loss_is_a_point_with_its_time_and_reason(run: Path) -> None:
    [lost] = [one for one in gpxpy.parse(format_gpx(build_drawn_run(run))).waypoints if one.type == "event"]
    assert lost.name == "uav2 lost: link"
    assert lost.time == LAUNCHED + timedelta(seconds=50)
    assert FRAME.to_local_m(lost.latitude, lost.longitude) == pytest.approx((250.0, 0.0), abs=0.06)
    assert lost.description is not None
    assert "reason: link lost for 10 s" in lost.description


def test_the_kml_has_tracks_with_a_time_for_every_place(run: Path) -> None:
    root = etree.fromstring(format_kml(build_drawn_run(run)).encode())
    kml_schema().assertValid(root)
    tracks = {mark.findtext(f"{KML}name"): list(mark.iter(f"{GX}Track")) for mark in root.iter(f"{KML}Placemark")}
    [track] = tracks["uav1 flown"]
    times, places = track.findall(f"{KML}when"), track.findall(f"{GX}coord")
    assert len(times) == len(places) == 151
    assert times[0].text == f"{LAUNCHED:%Y-%m-%dT%H:%M:%S}.000Z"
    assert [float(one) for one in places[40].text.split()][2] == 480.0
    assert track.findtext(f"{KML}altitudeMode") == "absolute"


def test_gdal_reads_plans_and_flights_from_the_geojson(run: Path, tmp_path: Path) -> None:
    path = tmp_path / "flight.geojson"
    path.write_text(format_geojson(build_drawn_run(run)), encoding="utf-8")
    info, _, geometries, fields = pyogrio.raw.read(path)
    columns = dict(zip(info["fields"], fields, strict=True))
    named = dict(zip(columns["name"], shapely.from_wkb(geometries), strict=True))
    inspected = dict(zip(columns["name"], columns["inspected_by"], strict=True))
    assert [inspected[f"segment {number}"] for number in range(5)] == ["uav2", "uav3", "uav1", "uav1", "uav1"]
    replanned = shapely.get_coordinates(named["uav1 re-plan 1"])
    assert FRAME.to_local_m(replanned[0][1], replanned[0][0]) == pytest.approx((500.0, 0.0), abs=0.02)
    assert {"uav1 planned", "uav2 planned", "uav3 re-plan 1", "uav2 lost: link"} <= set(named)
    assert "uav3 planned" not in named


def test_a_gap_is_not_drawn_over(run: Path, tmp_path: Path) -> None:
    """Of what happened between two positions far apart in time nobody knows anything."""
    lines = (run / "events.jsonl").read_text(encoding="utf-8").splitlines(keepends=True)
    for name in ("site.toml", "plan-000.json", "plan-001.json", "report.json"):
        (tmp_path / name).write_bytes((run / name).read_bytes())

    def in_gap(line: str) -> bool:
        content = json.loads(line)
        return LAUNCH_S + 60 < content.get("t_s", 0.0) < LAUNCH_S + 75 and "Position" in line and '"uav1"' in line

    (tmp_path / "events.jsonl").write_text("".join(line for line in lines if not in_gap(line)), encoding="utf-8")
    drawn = build_drawn_run(tmp_path)
    [way] = [one for one in drawn.ways if one.kind is MapFeatureKind.FLOWN and one.vehicle == "uav1"]
    assert [len(piece.positions) for piece in way.pieces] == [61, 76]
    assert len(gpxpy.parse(format_gpx(drawn)).tracks[-3].segments) == 2
    root = etree.fromstring(format_kml(drawn).encode())
    kml_schema().assertValid(root)
    assert len(root.findall(f".//{GX}MultiTrack/{GX}Track")) == 2


def test_a_directory_without_a_report_is_refused_in_a_line(tmp_path: Path) -> None:
    with pytest.raises(LogError, match=r"report\.json"):
        build_drawn_run(tmp_path)
