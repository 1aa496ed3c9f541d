"""A source that says itself that it is a part, is open elsewhere, or is one of several: refused, or said first."""

from __future__ import annotations

import io
import json
import sqlite3
import struct
import zipfile
from collections.abc import Callable
from contextlib import closing
from pathlib import Path

import pytest
import shapefile

from missions import NetworkError, NetworkImport, RemarkTopic, import_network
from missions.errors import AreaError
from missions.readers.area_files import read_areas
from tests.missions.readers import same

GEOMETRY = {"type": "LineString", "coordinates": [[15.6, 49.6], [15.602, 49.6]]}
FEATURE = {"type": "Feature", "properties": {"name": "V1"}, "geometry": GEOMETRY}
OSM = (
    '<osm version="0.6">{}<node id="1" lat="49.6" lon="15.6"/><node id="2" lat="49.6" lon="15.602"/>'
    '<node id="3" lat="49.6" lon="15.604"/>'
    '<way id="7"><nd ref="1"/><nd ref="2"/><nd ref="3"/><tag k="power" v="line"/></way>'
    '<way id="8"><nd ref="1"/><nd ref="3"/><tag k="power" v="line"/></way></osm>'
)
PRJ = (
    'GEOGCS["WGS 84",DATUM["WGS_1984",SPHEROID["WGS 84",6378137,298.257223563]],PRIMEM["Greenwich",0],'
    'UNIT["degree",0.0174532925199433]]'
)


def read(path: Path, content: bytes | str) -> NetworkImport:
    path.write_bytes(content if isinstance(content, bytes) else content.encode())
    return import_network(path, anywhere=True)


def lines(understood: NetworkImport) -> list[str]:
    return sorted(set(understood.lines.values()))


def said_first(understood: NetworkImport) -> str:
    assert understood.found[0].matter is RemarkTopic.WHOLE
    return understood.found[0].text


def collection(**more: object) -> str:
    return json.dumps({"type": "FeatureCollection", "features": [FEATURE], **more})


PARTS = {
    "Overpass, out of time": (
        json.dumps({"elements": [], "remark": 'runtime error: Query timed out in "query" at line 1'}),
        "remark: expected a whole answer, the server gave up: runtime error: Query timed out",
    ),
    "Overpass XML, out of memory": (
        OSM.format("<remark> runtime error: Query ran out of memory </remark>"),
        "remark: expected a whole answer, the server gave up: runtime error: Query ran out of memory",
    ),
    "ArcGIS": (collection(exceededTransferLimit=True), "exceededTransferLimit: expected all features"),
    "ArcGIS, newer": (collection(properties={"exceededTransferLimit": True}), "exceededTransferLimit: expected all"),
    "OGC API Features": (collection(numberMatched=12, numberReturned=1), "numberMatched: expected all 12 features"),
    "WFS of GeoServer": (collection(totalFeatures=12), "numberMatched: expected all 12 features, the server sent 1"),
    "a link to the next page": (collection(links=[{"rel": "next", "href": "x"}]), "links: expected all features"),
}


@pytest.mark.parametrize("name", PARTS)
def test_an_answer_that_its_server_cut_off_is_refused(name: str, tmp_path: Path) -> None:
    content, reason = PARTS[name]
    with pytest.raises(NetworkError) as caught:
        read(tmp_path / ("a.osm" if content.startswith("<") else "a.json"), content)
    assert f": {reason}" in str(caught.value)


def test_areas_of_such_an_answer_are_refused_too(tmp_path: Path) -> None:
    path = tmp_path / "areas.geojson"
    path.write_text(collection(exceededTransferLimit=True))
    with pytest.raises(AreaError, match="exceededTransferLimit: expected all features"):
        read_areas(path)


@pytest.mark.parametrize(
    "more",
    [
        {"exceededTransferLimit": False},
        {"numberMatched": 1, "numberReturned": 1, "links": [{"rel": "next"}]},
        {"numberMatched": "unknown", "links": [{"rel": "self"}]},
    ],
)
def test_a_whole_answer_is_read(more: dict[str, object], tmp_path: Path) -> None:
    assert lines(read(tmp_path / "a.json", collection(**more))) == ["V1"]


def test_what_else_a_server_remarks_is_reported(tmp_path: Path) -> None:
    remark = "<remark>runtime remark: Timeout is 180 and maxsize is 536870912</remark>"
    assert said_first(read(tmp_path / "a.osm", OSM.format(remark))).startswith("the server remarks: runtime")


@pytest.fixture
def project(tmp_path: Path) -> Path:
    return same.geopackage(tmp_path, "EPSG:4326")


def edited(path: Path, mode: str) -> sqlite3.Connection:
    """Return what holds a project open: one line is deleted, the other renamed, nothing is checkpointed."""
    program = sqlite3.connect(path, isolation_level=None)
    program.execute(f"PRAGMA journal_mode = {mode}")
    program.execute("PRAGMA wal_autocheckpoint = 0")
    for trigger, *_ in program.execute("SELECT name FROM sqlite_master WHERE type = 'trigger'").fetchall():
        program.execute(f'DROP TRIGGER "{trigger}"')
    program.execute("BEGIN")
    program.execute("DELETE FROM lines WHERE name = 'V410'")
    program.execute("UPDATE lines SET name = 'drawn today'")
    return program


def test_what_a_program_has_saved_and_not_checkpointed_is_read(project: Path) -> None:
    with closing(edited(project, "WAL")) as program:
        program.execute("COMMIT")
        before = {one.name: one.read_bytes() for one in project.parent.glob("grid.gpkg*")}
        assert set(before) == {"grid.gpkg", "grid.gpkg-wal", "grid.gpkg-shm"}
        assert lines(import_network(project, anywhere=True)) == ["drawn today"]
        assert {one.name: one.read_bytes() for one in project.parent.glob("grid.gpkg*")} == before


def test_what_a_program_has_not_saved_yet_is_not_read(project: Path, tmp_path: Path) -> None:
    with closing(edited(project, "DELETE")) as program:
        program.execute("PRAGMA cache_spill = 1")
        assert lines(import_network(project, anywhere=True)) == sorted(same.LINES)


def test_a_copy_without_its_wal_is_reported_first(project: Path, tmp_path: Path) -> None:
    with closing(edited(project, "WAL")) as program:
        program.execute("COMMIT")
        copy = tmp_path / "copy.gpkg"
        copy.write_bytes(project.read_bytes())
        assert "copied without its -wal: the latest changes may be missing" in said_first(
            import_network(copy, anywhere=True)
        )


def kml(name: str, more: str = "") -> str:
    return (
        f"<kml><Document>{more}<Placemark><name>{name}</name><LineString><coordinates>15.6,49.{name[-1]} "
        f"15.602,49.{name[-1]}</coordinates></LineString></Placemark></Document></kml>"
    )


def link(to: str) -> str:
    return f"<NetworkLink><name>more</name><Link><href>{to}</href></Link></NetworkLink>"


def zipped(files: dict[str, str | bytes]) -> bytes:
    content = io.BytesIO()
    with zipfile.ZipFile(content, "w") as archive:
        for name, inside in files.items():
            archive.writestr(name, inside)
    return content.getvalue()


@pytest.mark.parametrize("first", ["a.kml", "doc.kml"])
def test_all_kml_files_of_an_archive_are_read_and_reported(first: str, tmp_path: Path) -> None:
    content = zipped({"z/b.kml": kml("V2"), first: kml("V1", link("z/b.kml"))})
    understood = read(tmp_path / "a.kmz", content)
    assert lines(understood) == ["V1", "V2"]
    assert [one.text for one in understood.found] == [
        f"2 KML files in the archive, all of them are read: 'z/b.kml', '{first}'"
    ]


def test_a_link_to_elsewhere_is_reported_first(tmp_path: Path) -> None:
    understood = read(tmp_path / "a.kmz", zipped({"doc.kml": kml("V1", link("https://example.org/b.kml"))}))
    assert said_first(understood) == "a link to another file: not followed"


def test_what_else_may_hold_lines_in_an_archive_is_reported(tmp_path: Path) -> None:
    understood = read(tmp_path / "a.kmz", zipped({"doc.kml": kml("V1"), "old/b.gpx": "", "readme.txt": ""}))
    assert said_first(understood) == "also in the archive, and not read: 'old/b.gpx'"
    with pytest.raises(NetworkError, match=r"found none but 'b\.geojson': unpack it"):
        read(tmp_path / "b.zip", zipped({"b.geojson": ""}))


Files = dict[str, bytes]


def shapes(*names: str) -> Files:
    """Return a shapefile of lines, one north of the other, each called by its name."""
    parts = {end: io.BytesIO() for end in ("shp", "shx", "dbf")}
    with shapefile.Writer(**parts, shapeType=shapefile.POLYLINE) as writer:
        writer.field("name", "C")
        for number, name in enumerate(names):
            writer.line([[[15.6, 49.6 + number / 100], [15.602, 49.6 + number / 100]]])
            writer.record(name)
    return {end: part.getvalue() for end, part in parts.items()} | {"prj": PRJ.encode()}


def without_index(files: Files) -> Files:
    return {end: content for end, content in files.items() if end != "shx"}


def marked_deleted(files: Files, row: int) -> Files:
    header, wide = struct.unpack_from("<HH", files["dbf"], 8)
    dbf = bytearray(files["dbf"])
    dbf[header + row * wide] = ord("*")
    return {**files, "dbf": bytes(dbf)}


def moved_to_the_end(files: Files, shape: int) -> Files:
    """Return a shapefile as GDAL leaves it when a shape has grown: the new one behind all, the old one where it was."""
    offset, words = struct.unpack_from(">ii", files["shx"], 100 + 8 * shape)
    record = bytearray(files["shp"][2 * offset : 2 * offset + 8 + 2 * words])
    record[-16:] = struct.pack("<dd", 15.7, 49.7)
    shp = files["shp"][:24] + struct.pack(">i", (len(files["shp"]) + len(record)) // 2) + files["shp"][28:] + record
    shx = bytearray(files["shx"])
    struct.pack_into(">i", shx, 100 + 8 * shape, len(files["shp"]) // 2)
    return {**files, "shp": bytes(shp), "shx": bytes(shx)}


def read_shapes(folder: Path, files: Files) -> NetworkImport:
    for end, content in files.items():
        (folder / f"hv.{end}").write_bytes(content)
    return import_network(folder / "hv.shp", anywhere=True)


@pytest.mark.parametrize("change", [lambda files: files, without_index])
def test_a_shapefile_is_read_with_and_without_its_index(change: Callable[[Files], Files], tmp_path: Path) -> None:
    assert lines(read_shapes(tmp_path, change(shapes("V1", "V2")))) == ["V1", "V2"]


def test_a_deleted_row_takes_its_shape_and_leaves_the_names_of_others(tmp_path: Path) -> None:
    understood = read_shapes(tmp_path, marked_deleted(shapes("V1", "V2", "V3"), 1))
    assert lines(understood) == ["V1", "V3"]
    assert [round(one.lat_deg, 6) for one in understood.network.pylons] == [49.6, 49.6, 49.62, 49.62]


def test_a_shape_that_was_changed_in_place_is_read_where_the_index_says(tmp_path: Path) -> None:
    understood = read_shapes(tmp_path, moved_to_the_end(shapes("V1", "V2"), 0))
    assert lines(understood) == ["V1", "V2"]
    assert max(one.lat_deg for one in understood.network.pylons) == pytest.approx(49.7)


BROKEN: dict[str, tuple[Callable[[], Files], str]] = {
    ".dbf of another count": (
        lambda: {**shapes("V1", "V2"), "dbf": shapes("V1")["dbf"]}, "the .dbf has 1 rows and the .shx 2 shapes",
    ),
    ".shx of another count": (
        lambda: {**shapes("V1", "V2"), "shx": shapes("V1")["shx"]}, "the .dbf has 2 rows and the .shx 1 shapes",
    ),
    ".shx of another file": (
        lambda: {**shapes("V1", "V2"), "shx": moved_to_the_end(shapes("V1", "V2"), 1)["shx"]},
        "the .shx does not match the .shp: shape 2 is not where it states",
    ),
    "a cut .shp": (lambda: {**shapes("V1"), "shp": shapes("V1")["shp"][:-8]}, "the .shp ends after"),
    "a cut .dbf": (lambda: {**shapes("V1", "V2"), "dbf": shapes("V1", "V2")["dbf"][:-60]}, "the .dbf ends after"),
    "a shape twice": (
        lambda: without_index(moved_to_the_end(shapes("V1", "V2"), 0)), "the .shp has shape 1 twice: the .shx",
    ),
}  # fmt: skip


@pytest.mark.parametrize("name", BROKEN)
def test_parts_of_a_shapefile_of_several_states_are_refused(name: str, tmp_path: Path) -> None:
    make, reason = BROKEN[name]
    with pytest.raises(NetworkError) as caught:
        read_shapes(tmp_path, make())
    assert f"hv.shp: hv: expected a whole shapefile: {reason}" in str(caught.value)


def test_a_part_of_a_shapefile_is_not_taken_for_all_of_it(tmp_path: Path) -> None:
    read_shapes(tmp_path, shapes("V1"))
    with pytest.raises(NetworkError, match=r"hv\.shx: file: expected the \.shp, of which this is a part"):
        import_network(tmp_path / "hv.shx", anywhere=True)


def test_a_feature_a_line_is_read(tmp_path: Path) -> None:
    other = {**FEATURE, "properties": {"name": "V2"}, "geometry": {**GEOMETRY, "coordinates": [[15.6, 49], [15.7, 49]]}}
    for mark in ("", "\x1e"):
        text = "".join(f"{mark}{json.dumps(one)}\n" for one in (FEATURE, other))
        assert lines(read(tmp_path / "a.geojsonl", text)) == ["V1", "V2"]
    with pytest.raises(NetworkError, match=r"a\.geojsonl: line 2: line 1: expected JSON"):
        read(tmp_path / "a.geojsonl", text[:-30])
    assert lines(read(tmp_path / "one.geojson", json.dumps(FEATURE))) == ["V1"]


def test_prefixes_that_are_not_declared_are_read_over(tmp_path: Path) -> None:
    text = kml("V1").replace("<Document>", '<Document xsi:schemaLocation="x"><gx:Tour/>')
    for content in (text, text.replace("<", "<kml:").replace("<kml:/", "</kml:").replace("kml:gx:", "gx:")):
        assert lines(read(tmp_path / "a.kml", content)) == ["V1"]
    with pytest.raises(NetworkError, match=r"a\.kml: line 1: expected XML: "):
        read(tmp_path / "a.kml", text[:-9])


OTHERS: dict[str, tuple[str, bytes | str, str]] = {
    "polygons alone": (
        "a.kml", "<kml>" + 3 * "<Placemark><name>A</name><Polygon/></Placemark>"
        + "<Placemark><name>B</name><Track/></Placemark><GroundOverlay><name>C</name></GroundOverlay>"
        "<Placemark><name>D</name></Placemark></kml>",
        "nor poles; left out: 3 Polygons (A, A, A), 1 Track (B), 1 empty feature (D), 1 GroundOverlay (C)",
    ),
    "GeoJSON of polygons": (
        "a.json", json.dumps({"type": "FeatureCollection", "features": 2 * [{"type": "Feature", "properties": {},
                              "geometry": {"type": "Polygon"}}]}),
        "neither lines nor poles; left out: 2 Polygons (features[0], features[1])",
    ),
    "a link alone": ("a.kml", f"<kml>{link('b.kml')}</kml>", "nor poles; a link to another file: not followed"),
    "cables alone": (
        "a.osm", OSM.format("").replace('v="line"', 'v="cable"'), "found none; left out: 2 cables (way 7, way 8)",
    ),
    "a bare &": ("a.kml", kml("A & B1"), "line 1: expected XML: a bare &, which XML writes as &amp;"),
    "a bare & in a word": ("a.kml", kml("A&B1"), "a bare &, which XML writes as &amp;"),
    "an entity of HTML": ("a.kml", kml("A&nbsp;B1"), "entities are not expanded (Entity 'nbsp' not defined"),
    "a server's page": (
        "a.json", "<!DOCTYPE html>\n<html><head><title>504 Gateway Time-out</title></head><br></html>",
        "got a page of HTML such as a server's: '504 Gateway Time-out'",
    ),
    "a server's exception": (
        "a.xml", "<ExceptionReport><Exception><Text>no such layer</Text></Exception></ExceptionReport>",
        "got 'ExceptionReport': a server's error: no such layer",
    ),
    "a server's error": ("a.json", '{"error": {"code": 400, "message": "Invalid"}}', "got a server's error: {'code'"),
    "an old workbook": ("a.xls", b"\xd0\xcf\x11\xe0\xa1\xb1\x1a\xe1" + bytes(99), "got an old Excel file (.xls), or"),
    "gzip": ("a.geojson.gz", b"\x1f\x8b\x08" + bytes(99), "got a file that is packed (gzip): unpack it first"),
    "a pointer": ("a.gpkg", "version https://git-lfs.github.com/spec/v1\n", "got a pointer of Git LFS: fetch"),
}  # fmt: skip


@pytest.mark.parametrize("name", OTHERS)
def test_the_cause_is_named_where_nothing_can_be_read(name: str, tmp_path: Path) -> None:
    file, content, reason = OTHERS[name]
    with pytest.raises(NetworkError) as caught:
        read(tmp_path / file, content)
    assert reason in str(caught.value)
    assert "\n" not in str(caught.value)
