"""A country's file: the part near the depot is cut out before any check of the whole."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from missions import NetworkError, Selection, import_network, parse_where, read_network

DEPOT = (49.599, 15.6, 400.0)


def line(name: str, *places: tuple[float, float]) -> dict[str, object]:
    coordinates = [[lon, lat] for lat, lon in places]
    return {"type": "Feature", "properties": {"name": name},
            "geometry": {"type": "LineString", "coordinates": coordinates}}  # fmt: skip


def point(name: str, lat: float, lon: float, **more: object) -> dict[str, object]:
    return {"type": "Feature", "properties": {"name": name, **more},
            "geometry": {"type": "Point", "coordinates": [lon, lat]}}  # fmt: skip


def span(a: str, b: str) -> dict[str, object]:
    return {"type": "Feature", "properties": {"a": a, "b": b}, "geometry": None}


NEAR = line("V1", (49.6, 15.6), (49.6, 15.602), (49.6, 15.604), (49.6, 15.65))
FAR = line("V2", (52.6, 15.6), (52.6, 15.602), (52.6, 15.602))


def file_of(tmp_path: Path, *features: dict[str, object]) -> Path:
    path = tmp_path / "country.geojson"
    path.write_text(json.dumps({"type": "FeatureCollection", "features": features}))
    return path


def test_what_is_near_is_cut_out_of_what_is_too_large(tmp_path: Path) -> None:
    path = file_of(tmp_path, FAR, NEAR)
    understood = import_network(path, depot=DEPOT, radius_m=1500)
    assert [segment.label for segment in understood.network.segments] == ["V1.1", "V1.2"]
    assert understood.found == ()
    with pytest.raises(NetworkError, match=r"km away; radius_m, or --radius with --depot, cuts what is near out"):
        read_network(path, depot=DEPOT)


def test_a_line_across_a_country_is_cut_at_the_radius(tmp_path: Path) -> None:
    path = file_of(tmp_path, line("long", (49.6, 15.6), (49.6, 15.602), *((49.6 + k, 15.6) for k in range(1, 9))))
    assert [s.label for s in read_network(path, depot=DEPOT, radius_m=1000).segments] == ["long.1"]


def test_poles_and_spans_by_their_names_are_cut_too(tmp_path: Path) -> None:
    features = [point("A", 49.6, 15.6), point("B", 49.6, 15.602), point("X", 52.6, 15.6), point("Y", 52.6, 15.602)]
    path = file_of(tmp_path, *features, span("A", "B"), span("X", "Y"))
    assert [one.id for one in read_network(path, depot=DEPOT, radius_m=1000).pylons] == ["A", "B"]


def test_the_depot_of_the_file_cuts_as_well(tmp_path: Path) -> None:
    path = file_of(tmp_path, FAR, point("base", 49.599, 15.6, role="depot"), NEAR)
    assert len(import_network(path, radius_m=1500).network.segments) == 2
    without = file_of(tmp_path, NEAR)
    with pytest.raises(NetworkError, match="radius_m: expected a depot with it"):
        import_network(without, radius_m=1500, anywhere=True)


def test_names_do_not_hang_on_the_radius(tmp_path: Path) -> None:
    """A pole without a name is numbered among all that a network may have, so a wider radius keeps its number."""
    path = file_of(tmp_path, line("V0", (49.7, 15.6), (49.7, 15.602)), NEAR)
    narrow, wide = (read_network(path, depot=DEPOT, radius_m=radius_m) for radius_m in (1500, 50_000))
    assert [one.id for one in narrow.pylons] == ["P3", "P4", "P5"]
    assert {one.id for one in narrow.pylons} < {one.id for one in wide.pylons}


@pytest.mark.parametrize(
    ("depot", "hint"), [(DEPOT[:2], ""), (DEPOT[1::-1], "; latitude and longitude look swapped (GeoJSON has")]
)
def test_nothing_near_is_reported_and_why_it_may_be(depot: tuple[float, float], hint: str, tmp_path: Path) -> None:
    path = file_of(tmp_path, NEAR if hint else FAR)
    with pytest.raises(NetworkError) as caught:
        read_network(path, depot=(*depot, 400.0), radius_m=1000)
    assert f"radius_m: no segment lies within 1000 m of the depot{hint}" in str(caught.value)


def test_places_beyond_the_antimeridian_are_near(tmp_path: Path) -> None:
    path = file_of(tmp_path, line("V1", (65.0, 179.999), (65.0, -179.999)), FAR)
    assert len(read_network(path, depot=(65.0, 179.99, 0.0), radius_m=2000).segments) == 1


def test_a_place_that_is_none_is_still_refused_by_name(tmp_path: Path) -> None:
    path = file_of(tmp_path, NEAR, line("V3", (95.0, 15.6), (95.0, 15.602)))
    with pytest.raises(NetworkError, match="lat_deg: expected -90 to 90, got 95"):
        read_network(path, depot=DEPOT, radius_m=1000)


VOLTS = ("132 kV", "22 kV", "110000;22000", "400/220 kV", "high", "132 000 V", None)


@pytest.mark.parametrize(
    ("where", "taken"),
    [
        ("volt >= 110", [0, 2, 3, 5]),
        ("volt >= 110000", [0, 2, 3, 5]),
        ("volt < 100", [1]),
        ("volt > '200 kV'", [3]),
        ("volt = 132", [0]),
    ],
)
def test_figures_with_units_are_compared_and_others_are_reported(where: str, taken: list[int], tmp_path: Path) -> None:
    features = []
    for number, volt in enumerate(VOLTS):
        feature = line(f"L{number}", (49.6 + number / 100, 15.6), (49.6 + number / 100, 15.602))
        features.append({**feature, "properties": {"name": f"L{number}", "volt": volt}})
    understood = import_network(file_of(tmp_path, *features), Selection(where=parse_where(where)), anywhere=True)
    assert sorted(set(understood.lines.values())) == [f"L{number}" for number in taken]
    said = [one.text for one in understood.found]
    assert said[-1] == "4 such as '132 kV' are read as figures with a unit"
    by_order = where.split()[1] != "="
    assert said[:-1] == (["1 without a value: left out", "1 such as 'high' are no numbers: left out"] * by_order)


def test_a_filter_of_what_is_nested_or_blank_is_no_fault(tmp_path: Path) -> None:
    nested = {**NEAR, "properties": {"name": "V1", "volt": {"of": 110}}}
    blank = {**NEAR, "properties": {"name": "V2", "volt": "<Null>"}}
    known = {**NEAR, "properties": {"name": "V3", "volt": 110}}
    path = file_of(tmp_path, nested, blank, known)
    understood = import_network(path, Selection(where=parse_where("volt >= 110")), anywhere=True)
    assert [one.text for one in understood.found[:2]] == [
        "1 without a value: left out", "1 such as \"{'of': 110}\" are no numbers: left out",
    ]  # fmt: skip


def test_a_track_with_a_lost_fix_far_away_is_cut_as_well(tmp_path: Path) -> None:
    path = tmp_path / "a.gpx"
    points = "<trkpt lat='52' lon='15.6'/><trkpt lat='52' lon='15.602'/>"
    path.write_text(f"<gpx><trk><trkseg><trkpt lat='52' lon='15'/></trkseg><trkseg>{points}</trkseg></trk></gpx>")
    with pytest.raises(NetworkError, match="radius_m: no segment lies within 1000 m of the depot"):
        read_network(path, depot=DEPOT, radius_m=1000)


def test_a_filter_that_could_compare_nothing_says_so(tmp_path: Path) -> None:
    path = file_of(tmp_path, {**NEAR, "properties": {"name": "V1", "volt": "high"}})
    with pytest.raises(NetworkError, match=r"found none of 1; volt: 1 such as 'high' are no numbers: left out"):
        import_network(path, Selection(where=parse_where("volt >= 110")), anywhere=True)
    with pytest.raises(ValueError, match="expected a number behind >="):
        parse_where("volt >= high")
