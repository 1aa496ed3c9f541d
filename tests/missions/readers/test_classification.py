"""What is a span and what is a pole: the same in every format, and what is neither is said with its number."""

from __future__ import annotations

import json
import re
import tempfile
from collections.abc import Sequence
from pathlib import Path

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from missions import (
    NetworkError,
    NetworkImport,
    RemarkTopic,
    Selection,
    import_network,
    parse_where,
    read_station_points,
)
from tests.missions.readers import tagged
from tests.missions.readers.tagged import EXPORTS, TABLES, Extract, MapNode, MapWay

LEFT_OUT: dict[str, dict[str, str]] = {
    "cable": {"power": "cable"},
    "underground line": {"power": "line", "location": "underground"},
    "disused line": {"disused:power": "line"},
    "planned line": {"power": "construction", "construction": "line"},
    "removed line": {"demolished:power": "minor_line"},
    "line of a substation": {"power": "line", "line": "busbar"},
}
SPANS: list[dict[str, str]] = [
    {"power": "line"}, {"power": "minor_line"}, {"power": "line;cable"}, {"power": "line", "location": "overground"}
]  # fmt: skip
NAMES = st.text("AbŽďářüß-3 /", min_size=1, max_size=6).map(str.strip).filter(lambda name: any(map(str.isalpha, name)))


@st.composite
def extracts(draw: st.DrawFn) -> Extract:
    """Lines side by side with a tower at every bend, of any meaning; a generator over the first span."""
    nodes, ways = [], []
    kinds = draw(st.lists(st.sampled_from(list(LEFT_OUT)), max_size=4))
    tagsets = [*draw(st.lists(st.sampled_from(SPANS), min_size=1, max_size=3)), *(LEFT_OUT[kind] for kind in kinds)]
    names = draw(st.lists(NAMES, min_size=len(tagsets), max_size=len(tagsets), unique_by=str.lower))
    for row, (tags, name) in enumerate(zip(tagsets, names, strict=True)):
        own = []
        for column in range(draw(st.integers(2, 4))):
            number = 100 * (row + 1) + column
            heights = draw(st.sampled_from([{}, {"ele": "410.5", "height": "30 m"}]))
            bend_m = draw(st.sampled_from([0.0, 40.0]))
            pole = {"power": "tower", "ref": f"{name} {column}", **heights}
            own.append(MapNode(number, 200.0 * column, 300.0 * row + bend_m, pole))
        nodes += own
        ways.append(MapWay(10 + row, tuple(own), {**tags, "name": name}))
    first, second = ways[0].nodes[:2]
    middle = (first.east_m + second.east_m) / 2, (first.north_m + second.north_m) / 2
    return Extract((*nodes, MapNode(9999, *middle, {"power": "generator"})), tuple(ways))


Place = tuple[float, float, float | None, float | None]
Seen = tuple[list[tuple[str, str, str]], dict[str, Place], list[str]]


def seen(understood: NetworkImport) -> Seen:
    """Return all that a network is: spans by their poles' names, poles by place and height, names of lines."""
    network = understood.network
    names = [pylon.id for pylon in network.pylons]
    places = {
        pylon.id: (round(pylon.lat_deg, 6), round(pylon.lon_deg, 6), pylon.elevation_m, pylon.height_m)
        for pylon in network.pylons
    }
    spans = sorted((names[segment.a], names[segment.b], segment.label) for segment in network.segments)
    return spans, places, sorted(set(understood.lines.values()))


def drop_elevations(all_seen: Seen) -> Seen:
    """Return what is seen of a map from which GDAL has dropped every `ele`, as its default osmconf.ini has it."""
    spans, places, lines = all_seen
    return spans, {name: (*place[:2], None, place[3]) for name, place in places.items()}, lines


def left(understood: NetworkImport) -> dict[str, int]:
    """Return how many of each kind were left out."""
    words = ", ".join(one.text for one in understood.found if one.matter is RemarkTopic.LEFT_OUT)
    return {what: int(count) for count, what in re.findall(r"(\d+) ([a-z ]+?)s? \(", words)}


@settings(max_examples=12, deadline=None, derandomize=True, suppress_health_check=list(HealthCheck))
@given(extract=extracts())
def test_a_map_means_the_same_in_every_format(extract: Extract) -> None:
    expected: Seen | None = None
    kinds: dict[str, int] = {}
    for name, (write, wanted) in EXPORTS.items():
        with tempfile.TemporaryDirectory() as folder:
            understood = import_network(write(extract, Path(folder)), wanted, anywhere=True)
        expected = expected or seen(understood)
        assert seen(understood) == (drop_elevations(expected) if name == "ogr2ogr" else expected), name
        counts = {what: count for what, count in left(understood).items() if what != "generator"}
        kinds = kinds or counts
        assert counts == kinds, name
    assert expected is not None
    flown = [way for way in extract.ways if not any(tags.items() <= way.tags.items() for tags in LEFT_OUT.values())]
    assert len(expected[0]) == sum(len(way.nodes) - 1 for way in flown)
    assert sum(kinds.values()) == len(extract.ways) - len(flown)


@settings(max_examples=12, deadline=None, derandomize=True, suppress_health_check=list(HealthCheck))
@given(extract=extracts())
def test_a_table_means_the_same_with_the_tags_of_a_line_at_its_poles(extract: Extract) -> None:
    found = []
    for write in TABLES.values():
        with tempfile.TemporaryDirectory() as folder:
            found.append(seen(import_network(write(extract, Path(folder)), anywhere=True)))
    with tempfile.TemporaryDirectory() as folder:
        spans, _, lines = seen(import_network(tagged.overpass(extract, Path(folder)), anywhere=True))
    assert found[0] == found[1]
    assert (found[0][0], found[0][2]) == (spans, lines)


def document(*lines: dict[str, object], points: Sequence[dict[str, object]] = ()) -> dict[str, object]:
    """Return lines one above the other, and points at the ends of the first, as GeoJSON."""
    places = [[[15.6, 49.6 + 0.01 * row], [15.602, 49.6 + 0.01 * row]] for row in range(len(lines))]
    features = [
        {"type": "Feature", "properties": own, "geometry": {"type": "LineString", "coordinates": place}}
        for own, place in zip(lines, places, strict=True)
    ]
    features += [
        {"type": "Feature", "properties": own, "geometry": {"type": "Point", "coordinates": places[0][number]}}
        for number, own in enumerate(points)
    ]
    return {"type": "FeatureCollection", "features": features}


def read(folder: Path, content: str | dict[str, object], file: str = "a.geojson", where: str = "") -> NetworkImport:
    path = folder / file
    path.write_text(content if isinstance(content, str) else json.dumps(content), encoding="utf-8")
    return import_network(path, Selection(where=parse_where(where) if where else ()), anywhere=True)


def lines_of(understood: NetworkImport) -> list[str]:
    return sorted(set(understood.lines.values()))


@pytest.mark.parametrize(
    "says",
    [
        {"TYPE": "AC; UNDERGROUND"}, {"STATUS": "NOT IN SERVICE"}, {"STATUS": "UNDER CONST"}, {"Status": "Proposed"},
        {"STATUS": "INACTIVE"}, {"power": "cable"}, {"power": "minor_cable"}, {"power": "portal"},
        {"line_type": "Cable"},
        {"type": "Erdkabel"}, {"placement": "podzemní"}, {"OH_UG": "UG"}, {"underground": True}, {"Overhead": "No"},
        {"power": "line", "tunnel": "yes"}, {"power": "line", "location": "underwater"}, {"abandoned_power": "line"},
        {"abandoned:power": "minor_line"}, {"ABANDONED_": "line"}, {"DISUSED_PO": "line"}, {"power": "proposed"},
        {"power": "line", "disused": "yes"}, {"power": "line", "construction": True},
        {"power": "line", "removed": "yes"},
        {"visible": False}, {"@visible": "false"}, {"power": "line", "line": "bay"}, {"tags": {"power": "cable"}},
        {"other_tags": '"power"=>"line","location"=>"underground"'}, {"tags": '{"power": "cable"}'},
        {"tags.power": "line", "tags.location": "underground"}, {"@id": "way/7", "barrier": "fence"},
        {"osm_id": "7", "power": None, "highway": "track"}, {"power": "abandoned:line"}, {"power": "disused_line"},
    ],
)  # fmt: skip
def test_what_is_not_in_the_air_is_left_out_and_reported(says: dict[str, object], tmp_path: Path) -> None:
    understood = read(tmp_path, document({"name": "V1"}, {"name": "V2", **says}))
    assert lines_of(understood) == ["V1"]
    assert [(one.matter, one.asset) for one in understood.found] == [(RemarkTopic.LEFT_OUT, "GeoJSON")]
    assert re.fullmatch(r"1 [a-z ]+ \(V2|1 [a-z ]+ \(way 7\)", understood.found[0].text.removesuffix(")"))


@pytest.mark.parametrize(
    "says",
    [
        {"TYPE": "AC; OVERHEAD", "STATUS": "IN SERVICE"}, {"TYPE": "NOT AVAILABLE"}, {"type": "overhead/underground"},
        {"power": "400 kV"}, {"power": "minor_line"}, {"power": "line", "location": "overground"},
        {"construction": "steel"},
        {"underground": "no"}, {"power": "line", "construction": "minor"}, {"power": "line", "planned": "no"},
        {"STATE": "OH"}, {"disused:railway": "rail"}, {"power": "line", "historic": "yes"}, {"osm_id": "7"},
        {"visible": 1},
    ],
)  # fmt: skip
def test_what_is_in_the_air_stays_a_line(says: dict[str, object], tmp_path: Path) -> None:
    understood = read(tmp_path, document({"name": "V1"}, {"name": "V2", **says}))
    assert (lines_of(understood), understood.found) == (["V1", "V2"], ())


def test_a_circuit_is_no_line_of_its_own(tmp_path: Path) -> None:
    circuit: dict[str, object] = {"@id": "relation/5", "type": "route", "route": "power", "ref": "C5"}
    understood = read(tmp_path, document({"@id": "way/-3", "power": "line"}, circuit))
    assert lines_of(understood) == ["way -3"]
    assert [one.words for one in understood.found] == ["GeoJSON: 1 feature of another kind (C5)"]


def test_a_line_out_of_service_is_flown_where_the_filter_asks_for_it(tmp_path: Path) -> None:
    lines = document({"name": "V1", "status": "in service"}, {"name": "V2", "status": "disused"})
    assert lines_of(read(tmp_path, lines, where="status = 'disused'")) == ["V2"]


@pytest.mark.parametrize(
    "says",
    [
        {"power": "generator"}, {"power": "substation"}, {"TYPE": "Substation"}, {"type": "power plant"},
        {"power": "marker"}, {"demolished:power": "tower"}, {"power": "tower", "construction": "yes"},
        {"@id": "node/7", "natural": "tree"}, {"osm_id": "7", "other_tags": '"telephone"=>"pole"'},
    ],
)  # fmt: skip
def test_a_point_that_is_no_pole_is_left_out_and_reported(says: dict[str, object], tmp_path: Path) -> None:
    understood = read(tmp_path, document({"name": "V1"}, points=({"name": "T1"}, {"ref": "X", **says})))
    assert [pylon.id for pylon in understood.network.pylons] == ["T1", "P2"]
    left_out, made = understood.found
    assert (left_out.asset, made.matter) == ("GeoJSON", RemarkTopic.MADE)
    assert re.fullmatch(r"1 [a-z ]+ \((X|n7)\)", left_out.text)


@pytest.mark.parametrize(
    "says",
    [
        {"power": "pole;substation"}, {"power": "tower", "disused": "yes"}, {"type": "line"},
        {"structure_type": "Terminal"},
        {"power": "transformer"}, {"@id": "node/7", "power": "portal"}, {"osm_id": "7"}, {},
    ],
)  # fmt: skip
def test_a_point_that_may_be_a_pole_is_one(says: dict[str, object], tmp_path: Path) -> None:
    understood = read(tmp_path, document({"name": "V1"}, points=({"name": "T1"}, {"ref": "X", **says})))
    assert [pylon.id for pylon in understood.network.pylons] == ["T1", "X"]
    assert understood.found == ()


@pytest.mark.parametrize(
    ("says", "heights"),
    [
        ({"elevation_m": None, "height_m": float("nan")}, (None, None)),
        ({"elevation_m": "410 m", "height_m": "100 ft"}, (410.0, 30.48)),
        ({"ELEVATION_M": "410,5", "Height [m]": 31}, (410.5, 31.0)),
        ({"elevation_ft": "1345", "height_ft": 100}, (409.956, 30.48)),
        ({"elevation_m": -9999, "height_m": "<Null>"}, (None, None)),
        ({"elevation": "410 m", "height": "30 m"}, (410.0, 30.0)),
        ({"elevation": 410, "height": 30}, (None, None)),
        ({"power": "tower", "ele": "410", "height": "30"}, (410.0, 30.0)),
    ],
)
def test_heights_are_read_with_units_and_without_where_nothing_is_known(
    says: dict[str, object], heights: tuple[float | None, float | None], tmp_path: Path
) -> None:
    understood = read(tmp_path, document({"name": "V1"}, points=({"ref": "T1", **says}, {"ref": "T2", **says})))
    for pylon in understood.network.pylons:
        assert (pylon.elevation_m, pylon.height_m) == pytest.approx(heights)


@pytest.mark.parametrize("more", [[0, None], [None], [410, None, 3], [float("nan")], ["410"], [None, None]])
def test_what_comes_after_longitude_and_latitude_refuses_no_file(more: list[object], tmp_path: Path) -> None:
    places = [[15.6, 49.6, *more], [15.602, 49.6, *more]]
    for kind, coordinates in (("LineString", places), ("MultiLineString", [places])):
        geometry = {"type": kind, "coordinates": coordinates}
        feature = {"type": "Feature", "properties": {"name": None}, "geometry": geometry}
        found = read(tmp_path, {"type": "FeatureCollection", "features": [feature]})
        assert found.network.lengths_m == pytest.approx([144.6], abs=0.1)


def test_a_fourth_figure_of_kml_refuses_no_file(tmp_path: Path) -> None:
    for places in ("15.6,49.6,0,7 15.602,49.6,0,7", "15.6,49.6, 15.602,49.6,", "15.6,49.6,nan 15.602,49.6,nan"):
        line = f"<LineString><coordinates>{places}</coordinates></LineString>"
        mark = f"<kml><Placemark><name>V1</name>{line}</Placemark></kml>"
        assert read(tmp_path, mark, "a.kml").network.lengths_m == pytest.approx([144.6], abs=0.1)


def test_empty_features_are_left_out_and_several_points_are_poles(tmp_path: Path) -> None:
    whole = document({"name": "V1"})
    several = {"type": "MultiPoint", "coordinates": [[15.6, 49.6], [15.602, 49.6]]}
    empty = [None, {"type": "Point", "coordinates": []}, {"type": "Point", "coordinates": [None, None]},
             {"type": "LineString", "coordinates": []}]  # fmt: skip
    features = [{"type": "Feature", "properties": {"a": None, "b": None}, "geometry": one} for one in [several, *empty]]
    found = read(tmp_path, {**whole, "features": [*list(whole["features"]), *features]})  # type: ignore[call-overload]
    assert [pylon.id for pylon in found.network.pylons] == ["P1", "P2"]
    assert left(found) == {"empty feature": 4}


OSM = """<osm version="0.6">
<node id="1" lat="49.6" lon="15.6"><tag k="power" v="tower"/></node><node id="2" lat="49.6" lon="15.602"/>
<node id="3" action="delete" visible="true" lat="49.6" lon="15.604"><tag k="power" v="tower"/></node>
<node id="4" visible="false"/>
<way id="7"><nd ref="1"/><nd ref="2"/><nd ref="3"/><tag k="power" v="line"/></way>
<way id="8" action="delete"><nd ref="1"/><nd ref="2"/><tag k="power" v="line"/></way>
<way id="9"><nd ref="1"/><nd ref="2"/><tag k="power" v="substation"/></way>
<way id="10"><nd ref="1"/><nd ref="2"/><tag k="highway" v="track"/></way>
</osm>"""


def test_what_an_editor_has_deleted_is_not_flown(tmp_path: Path) -> None:
    found = read(tmp_path, OSM, "a.osm")
    assert [segment.label for segment in found.network.segments] == ["way 7.1"]
    assert [one.words for one in found.found if one.matter is RemarkTopic.LEFT_OUT] == [
        "way 7: 1 nodes are not in the file: interrupted there",
        "OpenStreetMap XML: 3 nodes and ways that are deleted",
        "OpenStreetMap XML: 1 substation (way 9)",
    ]


def test_where_nothing_remains_the_omissions_are_reported(tmp_path: Path) -> None:
    with pytest.raises(NetworkError, match=r"neither lines nor poles; left out: 2 cables \(V1, V2\)$"):
        read(tmp_path, document({"name": "V1", "power": "cable"}, {"name": "V2", "power": "cable"}))
    with pytest.raises(NetworkError, match=r"found none; left out: 1 cable \(way 3\)$"):
        read(tmp_path, '<osm><way id="3"><tag k="power" v="cable"/></way></osm>', "a.osm")


def test_a_base_may_stand_at_a_point_that_is_no_pole(tmp_path: Path) -> None:
    path = tmp_path / "stations.geojson"
    path.write_text(json.dumps(document({"name": "V1"}, points=({"name": "S1", "power": "substation"},))))
    assert read_station_points(path) == {"S1": (49.6, 15.6, None)}


TABLE = "line;order;pole;lat;lon;status;location\n"


def test_a_table_has_degrees_thousands_and_poles_put_in_between(tmp_path: Path) -> None:
    degrees = """line;order;name;lat;lon;height_m
V1;12;T12;49°36'00.0"N;15°36'00.0"E;30,5
V1;13;T13;N 49 36 03.6;15°36,24'E;1.030,5
V1;12A;T12A;49,6005;15.602;31"""
    found = read(tmp_path, degrees, "a.csv").network
    assert [pylon.id for pylon in found.pylons] == ["T12", "T12A", "T13"]
    assert [pylon.height_m for pylon in found.pylons] == [30.5, 31.0, 1030.5]
    assert [(round(p.lat_deg, 6), round(p.lon_deg, 6)) for p in found.pylons] == [
        (49.6, 15.6), (49.6005, 15.602), (49.601, 15.604)
    ]  # fmt: skip
    metres = "order\teasting\tnorthing\n1\t543'355.1 m\t5'494'274.6 m N\n2\t543.498,8\t5.494.386,9\n"
    path = tmp_path / "b.csv"
    path.write_text(metres)
    network = import_network(path, Selection(crs="EPSG:32633"), anywhere=True).network
    assert network.lengths_m == pytest.approx([182.4], abs=0.1)


def test_wires_of_a_table_go_over_a_removed_pole_and_not_along_a_cable(tmp_path: Path) -> None:
    rows = ["V1;1;T1;49.6;15.6;;", "V1;2;T2;49.6;15.602;removed;", "V1;3;T3;49.6;15.604;;",
            "V1;4;J4;49.6;15.606;;underground", "V1;5;T5;49.6;15.608;;", "V1;6;T6;49.6;15.610;;"]  # fmt: skip
    found = read(tmp_path, TABLE + "\n".join(rows), "a.csv")
    names = [pylon.id for pylon in found.network.pylons]
    assert [(names[one.a], names[one.b]) for one in found.network.segments] == [("T1", "T3"), ("T5", "T6")]
    assert left(found) == {"removed pole": 1, "pole of an underground line": 1}
