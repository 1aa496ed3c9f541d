"""GeoJSON files: what is read, and one line with file, place and expectation for what is not."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from missions import (
    MendingLimits,
    NetworkError,
    RemarkTopic,
    Selection,
    default_network_path,
    import_network,
    read_network,
)


def point(name: str | int, lon: float, lat: float | None, **properties: object) -> dict[str, object]:
    geometry = {"type": "Point", "coordinates": [lon, lat]}
    return {"type": "Feature", "geometry": geometry, "properties": {"id": name, **properties}}


def depot_point() -> dict[str, object]:
    geometry = {"type": "Point", "coordinates": [15.6, 49.6, 499.0]}
    return {"type": "Feature", "geometry": geometry, "properties": {"role": "depot", "elevation_m": 450.0}}


def line(*coordinates: tuple[float, ...], **properties: object) -> dict[str, object]:
    geometry = {"type": "LineString", "coordinates": [list(place) for place in coordinates]}
    return {"type": "Feature", "geometry": geometry, "properties": properties}


def step(a: str, b: str) -> dict[str, object]:
    return {"type": "Feature", "geometry": None, "properties": {"a": a, "b": b}}


PYLONS = [
    point("A", 15.602, 49.601, elevation_m=452, height_m=30.5),
    point("B", 15.604, 49.601),
    point(7, 15.606, 49.602),
]


def geojson_file(tmp_path: Path, *features: object, kind: str = "FeatureCollection") -> Path:
    path = tmp_path / "line.geojson"
    path.write_text(json.dumps({"type": kind, "features": list(features)}), encoding="utf-8")
    return path


def test_a_geojson_line_runs_over_its_pylons(tmp_path: Path) -> None:
    features = [depot_point(), *PYLONS, line((15.602, 49.601), (15.6040001, 49.601, 460.0), (15.606, 49.602), id="V1")]
    network = read_network(geojson_file(tmp_path, *features))
    # The third coordinate of a position is not used: the depot's height is its elevation_m.
    assert network.depot == (49.6, 15.6, 450.0)
    assert [pylon.id for pylon in network.pylons] == ["A", "B", "7"]
    assert (network.pylons[0].elevation_m, network.pylons[0].height_m) == (452.0, 30.5)
    assert [(segment.a, segment.b, segment.label) for segment in network.segments] == [(0, 1, "V1.1"), (1, 2, "V1.2")]


def test_without_points_the_vertices_are_the_pylons(tmp_path: Path) -> None:
    """Two lines that meet share the pylon where they do."""
    lines = [line((15.602, 49.601), (15.604, 49.601)), line((15.604, 49.601), (15.606, 49.602), (15.608, 49.602))]
    network = read_network(geojson_file(tmp_path, depot_point(), *lines))
    assert [(segment.a, segment.b) for segment in network.segments] == [(0, 1), (1, 2), (2, 3)]
    assert [pylon.id for pylon in network.pylons] == ["P1", "P2", "P3", "P4"]
    assert not network.has_heights


def test_a_geojson_segment_may_name_its_pylons(tmp_path: Path) -> None:
    network = read_network(geojson_file(tmp_path, depot_point(), *PYLONS, step("B", "A"), step("7", "B")))
    assert [(segment.a, segment.b, segment.label) for segment in network.segments] == [(1, 0, "B-A"), (2, 1, "7-B")]


def test_a_third_coordinate_is_kept_with_its_pylon_and_is_no_height(tmp_path: Path) -> None:
    """The Point's own before that of a line's vertex."""
    own = {**point("A", 15.602, 49.601), "geometry": {"type": "Point", "coordinates": [15.602, 49.601, 512.5]}}
    features = [depot_point(), own, point("B", 15.604, 49.601), line((15.602, 49.601, 1.0), (15.604, 49.601, 499.0))]
    network = read_network(geojson_file(tmp_path, *features))
    assert [pylon.third_m for pylon in network.pylons] == [512.5, 499.0]
    assert [pylon.elevation_m for pylon in network.pylons] == [None, None]
    bare = read_network(geojson_file(tmp_path, depot_point(), line((15.602, 49.601, 7.0), (15.604, 49.601))))
    assert [pylon.third_m for pylon in bare.pylons] == [7.0, None]


def test_segments_are_named_as_people_call_them_each_in_its_own_way(tmp_path: Path) -> None:
    """Name before ref before id; lines of the same name are told apart, and one without a name has its pylons'."""
    named = line((15.602, 49.601), (15.604, 49.601), id="way/7", ref="V1", name="North")
    again = line((15.604, 49.601), (15.606, 49.602), name="North", id="way/8")
    features = [depot_point(), *PYLONS, named, again, line((15.602, 49.601), (15.606, 49.602))]
    network = read_network(geojson_file(tmp_path, *features))
    assert [network.segment_name(number) for number in range(3)] == ["North.1", "North.1 (B-7)", "A-7"]


def test_a_pylon_may_be_named_by_its_ref(tmp_path: Path) -> None:
    geometry = {"type": "Point", "coordinates": [15.602, 49.601]}
    tower = {"type": "Feature", "geometry": geometry, "properties": {"ref": 12, "power": "tower"}}
    network = read_network(geojson_file(tmp_path, depot_point(), tower, PYLONS[1], step("12", "B")))
    assert [pylon.id for pylon in network.pylons] == ["12", "B"]


def test_a_depot_without_a_height_takes_that_of_the_file_next_to_it(tmp_path: Path) -> None:
    path = geojson_file(tmp_path, depot_point(), *PYLONS, step("A", "B"))
    assert read_network(path, depot=(49.6001, 15.6, None)).depot == (49.6001, 15.6, 450.0)
    with pytest.raises(NetworkError, match=r"depot: expected its height above sea level, .*: alt_m of the site's"):
        read_network(path, depot=(49.59, 15.59, None))


def test_a_depot_of_the_file_must_have_a_height_where_pylons_have_theirs(tmp_path: Path) -> None:
    depot = {**depot_point(), "properties": {"role": "depot"}}
    with pytest.raises(NetworkError, match=r"line\.geojson: depot: .* or elevation_m of the file's$"):
        read_network(geojson_file(tmp_path, depot, *PYLONS, step("A", "B")))
    bare = read_network(geojson_file(tmp_path, depot, PYLONS[1], PYLONS[2], step("7", "B")))
    assert bare.depot == (49.6, 15.6, 0.0)


def test_the_callers_depot_wins_over_the_files(tmp_path: Path) -> None:
    path = geojson_file(tmp_path, depot_point(), *PYLONS, step("A", "B"))
    assert read_network(path, depot=(49.59, 15.59, 400.0)).depot == (49.59, 15.59, 400.0)


@pytest.mark.parametrize(
    ("features", "reason"),
    [
        ([*PYLONS, step("A", "B")], r"depot: expected where the vehicles stand: .* or a point with role = depot"),
        ([depot_point(), *PYLONS], r"segments: expected at least one, found none"),
        ([depot_point(), step("A", "B")], r"features\[1\]\.properties\.a: expected the id of a pylon, got unknown 'A'"),
        ([depot_point(), *PYLONS, step("A", "Z")], r"features\[4\]\.properties\.b: .* got unknown 'Z'"),
        (
            [depot_point(), *PYLONS, PYLONS[0], step("A", "B")],
            r"features\[4\]\.properties\.id: expected a name that no other pylon has",
        ),
        ([depot_point(), point("A", 15.6, None)], r"features\[1\]\.geometry\.coordinates: expected finite numbers"),
        ([depot_point(), point("A", 15.6, True)], r"features\[1\]\.geometry\.coordinates: expected finite numbers"),
        ([depot_point(), point("A", 15.6, float("nan"))], r"features\[1\]\.geometry\.coordinates: expected finite"),
        (
            [depot_point(), point("A", 15.6, 49.6, height_m="30 yards")],
            r"features\[1\]: height_m: expected metres",
        ),
        ([depot_point(), *PYLONS, line((15.602, 49.601))], r"features\[4\]\.geometry\.coordinates: expected a line"),
        (
            [{"type": "Feature", "geometry": {"type": "Circle"}}],
            r"features\[0\]\.geometry\.type: expected Point or Line",
        ),
        ([{"type": "Feature", "geometry": [1]}], r"features\[0\]: expected properties and geometry to be objects"),
        (["no feature"], r"features\[0\]: expected an object of type Feature"),
        ([depot_point(), *PYLONS, step("A", "B"), step("B", "A")], r"segment B-A: pylons: expected a pair only once"),
        (
            [depot_point(), point("A", 49.601, 15.601), point("B", 49.602, 15.601), step("A", "B")],
            r"pylon 'A': position: .*latitude and longitude look swapped \(GeoJSON has longitude first\)",
        ),
    ],
)
def test_a_broken_geojson_file_is_named(tmp_path: Path, features: list[object], reason: str) -> None:
    path = geojson_file(tmp_path, *features)
    with pytest.raises(NetworkError, match=reason) as caught:
        read_network(path)
    assert str(caught.value).startswith(f"{path}: ")
    assert "\n" not in str(caught.value)


def test_json_that_is_no_geojson_is_named(tmp_path: Path) -> None:
    with pytest.raises(NetworkError, match=r"line\.geojson: type: expected a FeatureCollection"):
        read_network(geojson_file(tmp_path, kind="Topology"))


def test_json_that_is_cut_off_is_named(tmp_path: Path) -> None:
    path = geojson_file(tmp_path)
    path.write_text('{"type":\n', encoding="utf-8")
    with pytest.raises(NetworkError, match=r"line\.geojson: line 2: expected JSON"):
        read_network(path)


def test_a_depot_at_a_pole_in_the_file_is_named(tmp_path: Path) -> None:
    depot = {**depot_point(), "geometry": {"type": "Point", "coordinates": [0.0, 89.9]}}
    with pytest.raises(NetworkError, match=r"features\[0\]: depot: latitude 89.9 is out of range"):
        read_network(geojson_file(tmp_path, depot, *PYLONS, step("A", "B")))


def test_a_line_that_ends_without_a_pylon_gets_one_and_it_is_reported(tmp_path: Path) -> None:
    path = geojson_file(tmp_path, depot_point(), *PYLONS, line((15.602, 49.601), (15.604, 49.60102), id="V1"))
    understood = import_network(path)
    assert [pylon.id for pylon in understood.network.pylons] == ["A", "P4"]
    (made,) = (finding.words for finding in understood.found if finding.matter is RemarkTopic.MADE)
    assert made == (
        "V1: ends at 49.601020, 15.604000 without a pole of the file: 'P4' is made there; 'B' is 2.2 m away, "
        "snap_m = 2.3 takes it"
    )
    closer = import_network(path, Selection(mending=MendingLimits(snap_m=2.3)))
    assert [pylon.id for pylon in closer.network.pylons] == ["A", "B"]


def test_geojson_has_no_other_grid(tmp_path: Path) -> None:
    path = geojson_file(tmp_path, depot_point(), *PYLONS, step("A", "B"))
    with pytest.raises(NetworkError, match=r"line\.geojson: crs: expected none for GeoJSON"):
        read_network(path, crs="EPSG:32633")


def test_the_default_network_has_about_30_segments_within_700_m_and_a_hundred_within_3_km() -> None:
    network = read_network(default_network_path(), radius_m=3000.0)
    assert len(read_network(default_network_path(), radius_m=700.0).segments) == 33
    assert len(network.segments) == 96
    assert network.has_heights
    assert network.lengths_m.min() >= 100.0
    assert network.lengths_m.max() <= 450.0
    elevations = [pylon.elevation_m for pylon in network.pylons if pylon.elevation_m is not None]
    assert 5.0 <= max(elevations) - min(elevations) <= 20.0
    assert all(pylon.height_m is not None and 25.0 <= pylon.height_m <= 50.0 for pylon in network.pylons)
