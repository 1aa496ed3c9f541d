"""Areas of files: what is read, and what is refused in a line with the file, the feature and what was expected."""

from __future__ import annotations

import json
import zipfile
from pathlib import Path

import pytest
import simplekml

from missions import parse_where
from missions.errors import AreaError
from missions.readers.area_files import read_areas

SQUARE = [[15.0, 49.0], [15.01, 49.0], [15.01, 49.01], [15.0, 49.01], [15.0, 49.0]]
SMALL = [[15.002, 49.002], [15.004, 49.002], [15.004, 49.004], [15.002, 49.002]]


def feature(kind: str | None, coordinates: object, **properties: object) -> dict[str, object]:
    geometry = None if kind is None else {"type": kind, "coordinates": coordinates}
    return {"type": "Feature", "geometry": geometry, "properties": properties}


def written(path: Path, *features: object) -> Path:
    path.write_text(json.dumps({"type": "FeatureCollection", "features": list(features)}), encoding="utf-8")
    return path


def test_polygons_holes_and_lines_of_geojson_are_read(tmp_path: Path) -> None:
    found = read_areas(written(
        tmp_path / "zones.geojson",
        feature("Polygon", [SQUARE, SMALL], name="airfield", margin_m=30),
        feature("MultiPolygon", [[SQUARE], [SMALL]], ref="P7", max_agl_m="50"),
        feature("LineString", SQUARE[:3], name="railway", width_m=40),
        feature("Polygon", [[[*place, 120.0] for place in SQUARE]]),
    ))  # fmt: skip
    assert [(one.name, len(one.rings_deg), one.is_line, dict(one.figures)) for one in found] == [
        ("airfield", 2, False, {"margin_m": 30.0}),
        ("P7", 1, False, {"max_agl_m": 50.0}),
        ("P7", 1, False, {"max_agl_m": 50.0}),
        ("railway", 1, True, {"width_m": 40.0}),
        ("", 1, False, {}),
    ]
    assert found[0].rings_deg[0] == ((49.0, 15.0), (49.0, 15.01), (49.01, 15.01), (49.01, 15.0))


def test_polygons_and_lines_of_kml_and_kmz_are_read_as_google_earth_writes_them(tmp_path: Path) -> None:
    document = simplekml.Kml()
    folder = document.newfolder(name="no fly")
    outline = [tuple(place) for place in SQUARE]
    park = folder.newpolygon(name="park", outerboundaryis=outline, innerboundaryis=[[tuple(p) for p in SMALL]])
    park.extendeddata.newdata("margin_m", "25")
    document.newlinestring(name="road", coords=outline[:2])
    document.save(tmp_path / "zones.kml")
    document.savekmz(tmp_path / "zones.kmz")
    for path in (tmp_path / "zones.kml", tmp_path / "zones.kmz"):
        found = {one.name: one for one in read_areas(path)}
        assert (len(found["park"].rings_deg), dict(found["park"].figures)) == (2, {"margin_m": 25.0})
        assert found["road"].is_line
        assert [one.name for one in read_areas(path, layers=["no fly"])] == ["park"]


def test_where_chooses_features(tmp_path: Path) -> None:
    path = written(
        tmp_path / "zones.geojson",
        feature("Polygon", [SQUARE], name="a", **{"class": "CTR"}),
        feature("Point", [15, 49], name="label", **{"class": "X"}),
    )
    assert [one.name for one in read_areas(path, where=parse_where("class = 'CTR'"))] == ["a"]


REFUSED: dict[str, tuple[object, str]] = {
    "no JSON": (b"{", "zones.geojson: "),
    "another format": (b"a,b,c\n1,2,3\n", "zones.geojson: content: expected GeoJSON, KML or KMZ, found none"),
    "nothing": (b"", "zones.geojson: content: expected GeoJSON, KML or KMZ, found none"),
    "binary": (bytes(range(128, 255)), "zones.geojson: encoding: expected UTF-8 text, found other bytes at 0"),
    "a list": (b"[]", "zones.geojson: content: expected GeoJSON, KML or KMZ, found none"),
    "lists in lists": (b'{"a":' + b"[" * 50_000, "zones.geojson: "),
    "no features": ({"type": "FeatureCollection", "features": []}, "areas: expected at least one polygon or line"),
    "a bare geometry": ({"type": "Polygon", "coordinates": [SQUARE]}, "type: expected a FeatureCollection"),
    "a point": ([feature("Point", [15, 49], name="mast")], "features[0] 'mast': geometry: expected a Polygon"),
    "no geometry": ([feature(None, None, name="x")], "features[0] 'x': geometry: expected a Polygon"),
    "a collection": ([feature("GeometryCollection", [])], "features[0]: geometry: expected a Polygon or a LineString"),
    "an unknown kind": ([feature("Circle", [15, 49])], "features[0].geometry.type: expected"),
    "an open outline": ([feature("Polygon", [SQUARE[:4]], name="x")], "'x': expected an outline of at least 3"),
    "two corners": ([feature("Polygon", [[SQUARE[0], SQUARE[1], SQUARE[0]]])], "expected an outline of at least 3"),
    "one place": ([feature("Polygon", [[SQUARE[0]] * 5], name="x")], "'x': expected an outline of at least 3"),
    "a line of one place": ([feature("LineString", [SQUARE[0]] * 2)], "expected a line of at least 2 places, got 1"),
    "no outline": ([feature("Polygon", [], name="x")], "'x': coordinates: expected a list of outlines"),
    "a flat polygon": ([feature("Polygon", SQUARE)], "expected finite numbers [longitude, latitude]"),
    "text": ([feature("Polygon", "POLYGON((1 2))", name="x")], "'x': coordinates: expected a list of outlines"),
    "a number as a place": ([feature("Polygon", [[1, 2, 3, 1]])], "expected finite numbers [longitude, latitude]"),
    "not a number": (json.dumps(feature("Polygon", [[[float("nan"), 49]] * 4])).encode(), "zones.geojson: "),
    "swapped and far": (
        [feature("Polygon", [[[49, 115], [49, 116], [50, 115], [49, 115]]], name="x")],
        "are they swapped?",
    ),
    "metres for degrees": (
        [feature("Polygon", [[[5e5, 5e6], [6e5, 5e6], [6e5, 6e6], [5e5, 5e6]]])],
        "are they swapped?",
    ),
    "an unknown system": (
        {
            "type": "FeatureCollection",
            "crs": {"properties": {"name": "EPSG:1"}},
            "features": [feature("Polygon", [SQUARE])],
        },
        "crs: expected a coordinate reference system",
    ),
    "a margin in words": ([feature("Polygon", [SQUARE], name="x", margin_m="wide")], "'x': margin_m: expected metres"),
    "features as text": ({"type": "FeatureCollection", "features": ["x"]}, "features[0]: expected an object of type"),
    "properties as a list": (
        [{"type": "Feature", "geometry": None, "properties": [1]}],
        "expected properties and geom",
    ),
}
KML = {
    "no coordinates": ("<Polygon><outerBoundaryIs><LinearRing/></outerBoundaryIs></Polygon>", "coordinates: expected"),
    "no outline": ("<Polygon></Polygon>", "'x' (line 1): outerBoundaryIs: expected a LinearRing, found none"),
    "a point": (
        "<Point><coordinates>15,49</coordinates></Point>",
        "'x' (line 1): geometry: expected a Polygon or a LineString",
    ),
    "nothing": ("", "Placemark 'x' (line 1): geometry: expected a Polygon or a LineString, got none"),
    "words": ("<LineString><coordinates>here there</coordinates></LineString>", "expected longitude,latitude"),
    "an open outline": (
        "<LinearRing><coordinates>15,49 16,49 16,50 15,50</coordinates></LinearRing>",
        "that ends where it begins",
    ),
}


@pytest.mark.parametrize(("content", "expected"), REFUSED.values(), ids=REFUSED)
def test_a_file_that_is_not_understood_is_refused(tmp_path: Path, content: object, expected: str) -> None:
    path = tmp_path / "zones.geojson"
    if isinstance(content, bytes):
        path.write_bytes(content)
    elif isinstance(content, list):
        written(path, *content)
    else:
        path.write_text(json.dumps(content), encoding="utf-8")
    with pytest.raises(AreaError) as refused:
        read_areas(path)
    assert str(refused.value).startswith(f"{path}: ")
    assert expected in str(refused.value)
    assert "\n" not in str(refused.value)


@pytest.mark.parametrize(("geometry", "expected"), KML.values(), ids=KML)
def test_a_placemark_that_is_not_understood_is_refused(tmp_path: Path, geometry: str, expected: str) -> None:
    path = tmp_path / "zones.kml"
    path.write_text(f"<kml><Placemark><name>x</name>{geometry}</Placemark></kml>", encoding="utf-8")
    with pytest.raises(AreaError) as refused:
        read_areas(path)
    assert str(refused.value).startswith(f"{path}: ")
    assert expected in str(refused.value)


def test_links_archives_without_kml_and_missing_files_are_refused(tmp_path: Path) -> None:
    linked = tmp_path / "linked.kml"
    linked.write_text("<kml><NetworkLink><name>all</name></NetworkLink></kml>", encoding="utf-8")
    with pytest.raises(AreaError, match="NetworkLink 'all': expected the areas themselves, got a link"):
        read_areas(linked)
    packed = tmp_path / "zones.kmz"
    with zipfile.ZipFile(packed, "w") as archive:
        archive.writestr("readme.txt", "nothing")
    with pytest.raises(AreaError, match=r"content: expected GeoJSON, KML or KMZ, found an archive without a \.kml"):
        read_areas(packed)
    with pytest.raises(AreaError, match=r"nowhere\.geojson: file: expected a readable"):
        read_areas(tmp_path / "nowhere.geojson")
    plain = tmp_path / "plain.kml"
    plain.write_text("<kml><Placemark><name>x</name></Placemark></kml>", encoding="utf-8")
    with pytest.raises(AreaError, match="layer: expected a folder of the file"):
        read_areas(plain, layers=["zones"])
    with pytest.raises(AreaError, match="where: expected an attribute of the lines"):
        read_areas(written(tmp_path / "z.geojson", feature("Polygon", [SQUARE])), where=parse_where("class = 1"))
