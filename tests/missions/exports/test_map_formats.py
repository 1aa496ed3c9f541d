"""What is exported for maps, as programs of others read it."""

from __future__ import annotations

import json
from pathlib import Path

import gpxpy
import numpy as np
import pyogrio
import pytest
import shapely
from lxml import etree

from missions import (
    Inspection,
    Selection,
    SolverRecord,
    build_flight_path,
    import_network,
    make_plan_file,
    parse_where,
    plan_flight_setup,
)
from missions.exports import (
    MapFeatureKind,
    MapFeatures,
    MapLine,
    MapLinePiece,
    MapPoint,
    Reference,
    build_plan_features,
    format_geojson,
    format_gpx,
    format_kml,
)
from missions.plan_file import PlanFile
from missions.setup import FlightSetup
from planner import Cost, Plan, Route, Travel, Vehicle
from tests.missions.builders import FRAME, network_of, paper_task
from tests.missions.exports.kmlschema import kml_schema

KML = "{http://www.opengis.net/kml/2.2}"
GX = "{http://www.google.com/kml/ext/2.2}"
NAMES = ("uav1", "uav2")
PLACES_M = [(100.0, 0.0), (200.0, 0.0), (300.0, 0.0), (300.0, 120.0)]
HEIGHTS_M = [(460.0, 20.0), (470.0, 20.0), (480.0, 25.0), (470.0, 20.0)]
WRITERS = {"kml": format_kml, "geojson": format_geojson, "gpx": format_gpx}


def planned(heights_m: list[tuple[float, float]] | None = HEIGHTS_M) -> tuple[PlanFile, FlightSetup]:
    """Return a plan: uav1 flies two segments, uav2 one."""
    network = network_of(PLACES_M, [(0, 1), (1, 2), (2, 3)], heights_m)
    travel, inspection = Travel(10.0, 5.0, 0.1, 0.1), Inspection()
    task = paper_task(network, range(3), [Vehicle(name, (0.0, 0.0), 75.0) for name in NAMES], travel)
    plan = Plan((Route(0, (0, 2)), Route(1, (5,))))
    content = make_plan_file(
        network, task, travel, plan, Cost.MINMAX, SolverRecord("search", 1, 0.1), inspection=inspection
    )
    return content, plan_flight_setup(content.build_network(), NAMES, content.inspection or inspection)


def written(drawn: MapFeatures, folder: Path) -> dict[str, Path]:
    """Write all formats."""
    paths = {name: folder / f"plan.{name}" for name in WRITERS}
    for name, path in paths.items():
        path.write_text(WRITERS[name](drawn), encoding="utf-8")
    return paths


def expected_m(setup: FlightSetup, name: str, visits: tuple[int, ...]) -> list[tuple[float, float, float]]:
    """Return a vehicle's path as latitude, longitude and height above the sea, from its pad on."""
    pad = setup.pad_of(name)
    path = build_flight_path(setup, name, visits)
    begin = (*setup.frame.to_wgs84_deg(pad.east_m, pad.north_m), pad.alt_m)
    return [begin, *((one.lat_deg, one.lon_deg, one.alt_rel_m + pad.alt_m) for one in path.waypoints)]


def features_of(path: Path, layer: str) -> list[tuple[str, shapely.Geometry]]:
    """Return names and geometries as GDAL reads them."""
    _, _, geometries, fields = pyogrio.raw.read(path, layer=layer, columns=["Name"])
    return list(zip(fields[0].tolist(), shapely.from_wkb(geometries), strict=True))


def test_gdal_reads_every_path_of_the_kml_with_its_heights_above_the_sea(tmp_path: Path) -> None:
    content, setup = planned()
    path = written(build_plan_features(content, setup, "plan"), tmp_path)["kml"]
    assert set(pyogrio.list_layers(path)[:, 0]) == {"line", "uav1", "uav2"}
    for name, visits in (("uav1", (0, 2)), ("uav2", (5,))):
        found = dict(features_of(path, name))
        positions = shapely.get_coordinates(found[f"{name} planned"], include_z=True)
        wanted = [(lon, lat, alt_m) for lat, lon, alt_m in expected_m(setup, name, visits)]
        assert positions == pytest.approx(np.array(wanted), abs=0.006)
        assert positions[:, 2].max() > 450.0 + 30.0
        pad = shapely.get_coordinates(found[f"{name} pad"], include_z=True)[0]
        assert pad == pytest.approx(positions[0], abs=1e-6)
    line = features_of(path, "line")
    assert [name for name, _ in line] == ["segment 0", "segment 1", "segment 2", "depot"]
    tops = shapely.get_coordinates(line[1][1], include_z=True)[:, 2]
    assert tops.tolist() == [490.0, 505.0]


def test_gdal_reads_the_same_from_the_geojson(tmp_path: Path) -> None:
    content, setup = planned()
    path = written(build_plan_features(content, setup, "plan"), tmp_path)["geojson"]
    info, _, geometries, fields = pyogrio.raw.read(path)
    columns = dict(zip(info["fields"], fields, strict=True))
    assert info["crs"] == "EPSG:4326"
    rows = list(zip(columns["name"], columns["kind"], columns["vehicle"], shapely.from_wkb(geometries), strict=True))
    assert [(name, kind, vehicle) for name, kind, vehicle, _ in rows] == [
        ("segment 0", "segment", None), ("segment 1", "segment", None), ("segment 2", "segment", None),
        ("uav1 planned", "planned", "uav1"), ("uav2 planned", "planned", "uav2"),
        ("depot", "depot", None), ("uav1 pad", "pad", "uav1"), ("uav2 pad", "pad", "uav2"),
    ]  # fmt: skip
    positions = shapely.get_coordinates(rows[3][3], include_z=True)
    wanted = [(lon, lat, alt_m) for lat, lon, alt_m in expected_m(setup, "uav1", (0, 2))]
    assert positions == pytest.approx(np.array(wanted), abs=0.006)
    assert set(columns["heights"]) == {"above mean sea level"}
    assert columns["asset"].tolist()[:2] == ["segment 0", "segment 1"]


def test_gpxpy_reads_routes_pads_and_the_line(tmp_path: Path) -> None:
    content, setup = planned()
    path = written(build_plan_features(content, setup, "plan"), tmp_path)["gpx"]
    gpx = gpxpy.parse(path.read_text(encoding="utf-8"))
    assert [(one.name, len(one.points)) for one in gpx.routes] == [
        (f"{name} planned", len(expected_m(setup, name, visits))) for name, visits in (("uav1", (0, 2)), ("uav2", (5,)))
    ]
    heights_m = [point.elevation for point in gpx.routes[0].points]
    assert heights_m == pytest.approx([alt_m for _, _, alt_m in expected_m(setup, "uav1", (0, 2))], abs=0.006)
    assert [one.name for one in gpx.tracks] == ["segment 0", "segment 1", "segment 2"]
    assert [one.name for one in gpx.waypoints] == ["depot", "uav1 pad", "uav2 pad"]


def test_over_flat_ground_heights_are_over_the_ground_and_said_to_be(tmp_path: Path) -> None:
    content, setup = planned(None)
    paths = written(build_plan_features(content, setup, "plan"), tmp_path)
    root = etree.parse(paths["kml"]).getroot()
    modes = {
        mark.findtext(f"{KML}name"): next(mark.iter(f"{KML}altitudeMode")).text for mark in root.iter(f"{KML}Placemark")
    }
    assert modes["uav1 planned"] == "relativeToGround"
    assert modes["segment 0"] == "clampToGround"
    features = json.loads(paths["geojson"].read_text(encoding="utf-8"))["features"]
    by_name = {one["properties"]["name"]: one for one in features}
    first = by_name["uav1 planned"]
    assert first["properties"]["heights"] == "above the ground, which is taken to be flat"
    assert first["geometry"]["coordinates"][0][2] == 0.0
    assert max(place[2] for place in first["geometry"]["coordinates"]) < 40.0
    assert len(by_name["segment 0"]["geometry"]["coordinates"][0]) == 2
    gpx = gpxpy.parse(paths["gpx"].read_text(encoding="utf-8"))
    assert {point.elevation for route in gpx.routes for point in route.points} == {None}


def test_names_that_xml_has_no_letters_for_do_not_break_a_file(tmp_path: Path) -> None:
    odd = 'a\x00<b> & "c"\ud83d'
    spot = MapPoint(MapFeatureKind.EVENT, odd, (49.0, 15.0, 1.0), Reference.SEA, None, None, {"reason": odd})
    way = MapLine(
        MapFeatureKind.SEGMENT, odd, (MapLinePiece(((49.0, 15.0, None), (49.1, 15.0, None))),), Reference.NONE
    )
    drawn = MapFeatures(odd, (), [way], [spot])
    name = 'a <b> & "c" '
    assert [one.text for one in etree.fromstring(format_kml(drawn).encode()).iter(f"{KML}name")] == [
        name,
        "line",
        name,
        name,
    ]
    assert gpxpy.parse(format_gpx(drawn)).waypoints[0].name == name
    assert json.loads(format_geojson(drawn))["features"][1]["properties"]["reason"] == odd


def test_each_vehicle_has_a_colour_of_its_own_in_kml_and_geojson(tmp_path: Path) -> None:
    content, setup = planned()
    drawn = build_plan_features(content, setup, "plan")
    root = etree.fromstring(format_kml(drawn).encode())
    styles = {one.get("id"): one.findtext(f"{KML}LineStyle/{KML}color") for one in root.iter(f"{KML}Style")}
    used = [one.findtext(f"{KML}styleUrl") for one in root.iter(f"{KML}Placemark")]
    assert {url.removeprefix("#") for url in used if url} <= set(styles)
    assert styles["planned-0"] == "b2e9b456"
    assert styles["planned-0"] != styles["planned-1"]
    strokes = [one["properties"].get("stroke") for one in json.loads(format_geojson(drawn))["features"]]
    assert strokes[3:5] == ["#56b4e9", "#e69f00"]


@pytest.mark.parametrize("name", WRITERS)
def test_the_programs_own_reader_finds_the_line_again(name: str, tmp_path: Path) -> None:
    content, setup = planned()
    path = written(build_plan_features(content, setup, "plan"), tmp_path)[name]
    chosen = {
        "kml": Selection(layers=("line",)),
        "geojson": Selection(where=parse_where("kind = 'segment'")),
        "gpx": Selection(where=parse_where("type = 'segment'")),
    }
    found = import_network(path, chosen[name], depot=(FRAME.lat_deg, FRAME.lon_deg, FRAME.alt_m)).network
    assert sorted(round(length_m) for length_m in found.lengths_m.tolist()) == [100, 100, 120]


@pytest.mark.parametrize("heights_m", [HEIGHTS_M, None], ids=["known heights", "flat"])
def test_the_kml_is_valid_by_the_schemas_of_the_ogc_and_of_google(
    heights_m: list[tuple[float, float]] | None,
) -> None:
    content, setup = planned(heights_m)
    kml_schema().assertValid(etree.fromstring(format_kml(build_plan_features(content, setup, "plan")).encode()))
