"""`faultline network`: what was understood of a file, and one line for each file that cannot be."""

from __future__ import annotations

import io
import json
import sqlite3
import zipfile
from pathlib import Path

import openpyxl
import pytest
import shapefile

from executor.site import site_model
from executor.site.site_file import read_site
from missions import import_network, read_network
from tests.executor.cli.test_main import Place, place
from tests.missions.readers import same
from tests.missions.test_files import room_for

__all__ = ["place"]

KML_FOLDER = Path(__file__).resolve().parents[4] / "shared" / "data" / "kml"
LINE = "<LineString><coordinates>{}</coordinates></LineString>"
BOMB = '<!DOCTYPE kml [<!ENTITY a "aaaaaaaaaa">' + "".join(
    f'<!ENTITY {after} "{f"&{before};" * 10}">' for before, after in zip("abcdefgh", "bcdefghi", strict=True)
) + "]>"  # fmt: skip


def kml(inside: str, before: str = "") -> bytes:
    marks = f"<Document><Placemark><name>V 7</name>{inside}</Placemark></Document>"
    return f'<?xml version="1.0"?>{before}<kml xmlns="http://www.opengis.net/kml/2.2">{marks}</kml>'.encode()


def zipped(**files: bytes) -> bytes:
    content = io.BytesIO()
    with zipfile.ZipFile(content, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, inside in files.items():
            archive.writestr(name.replace("__", "."), inside)
    return content.getvalue()


def osm(inside: str) -> bytes:
    return f'<osm version="0.6">{inside}</osm>'.encode()


def elements(*inside: object) -> bytes:
    return json.dumps({"elements": inside}).encode()


def gpx(inside: str) -> bytes:
    return f'<gpx version="1.1" xmlns="http://www.topografix.com/GPX/1/1">{inside}</gpx>'.encode()


def sheets(*titles: str) -> bytes:
    book, content = openpyxl.Workbook(), io.BytesIO()
    for title in titles:
        book.create_sheet(title).append(["order", "lat", "lon"])
    book.remove(book.worksheets[0])
    book.save(content)
    return content.getvalue()


def shapes(**but: bytes | None) -> bytes:
    """Return a zipped shapefile with some of its parts replaced, or left out."""
    parts = {name: io.BytesIO() for name in ("shp", "shx", "dbf")}
    with shapefile.Writer(**parts, shapeType=shapefile.POLYLINE) as writer:
        writer.field("name", "C")
        writer.line([[[15.6, 49.6], [15.602, 49.6]]])
        writer.record("V1")
    files: dict[str, bytes | None] = {name: part.getvalue() for name, part in parts.items()}
    files |= {"prj": b'GEOGCS["WGS 84",DATUM["WGS_1984",SPHEROID["WGS 84",6378137,298.257223563]],'
              b'PRIMEM["Greenwich",0],UNIT["degree",0.0174532925199433]]', **but}  # fmt: skip
    return zipped(**{f"lines__{name}": content for name, content in files.items() if content is not None})


def database(*statements: str) -> bytes:
    connection = sqlite3.connect(":memory:")
    for statement in statements:
        connection.execute(statement)
    connection.commit()
    return connection.serialize()


GPKG = (
    "CREATE TABLE gpkg_contents (table_name, data_type)",
    "CREATE TABLE gpkg_geometry_columns (table_name, column_name, geometry_type_name, srs_id)",
    "CREATE TABLE gpkg_spatial_ref_sys (srs_id, organization, organization_coordsys_id, definition)",
    "CREATE TABLE hv (fid INTEGER PRIMARY KEY, geom BLOB, name)",
    "INSERT INTO gpkg_contents VALUES ('hv', 'features')",
    "INSERT INTO gpkg_geometry_columns VALUES ('hv', 'geom', 'LINESTRING', 4326)",
    "INSERT INTO gpkg_spatial_ref_sys VALUES (4326, 'EPSG', 4326, '')",
)
TWO = '<node id="1" lat="49.6" lon="15.6"/><node id="2" lat="49.6" lon="15.602"/>'
POWER = '<tag k="power" v="line"/><tag k="voltage" v="110000"/>'
WAY = f'<way id="7"><nd ref="1"/><nd ref="2"/>{POWER}</way>'
GEOJSON_LINE = {"type": "Feature", "geometry": {"type": "LineString", "coordinates": [[15.6, 49.6], [15.602, 49.6]]},
                "properties": {"name": "V1"}}  # fmt: skip

MALFORMED: dict[str, tuple[str, bytes, str, str]] = {
    "a bomb of entities": ("a.kml", kml("<description>&i;</description>", BOMB), "", "a.kml: "),
    "a bomb in an attribute": ("a.kml", kml('<Point id="&i;"/>', BOMB), "", "a.kml: "),
    "a document type": ("a.kml", kml(LINE.format("15,49 16,49"), "<!DOCTYPE kml>"), "",
                        "a.kml: content: expected XML without a document type (DOCTYPE)"),
    "KML that is cut off": ("a.kml", kml(LINE.format("15,49 15.01,49"))[:150], "", "a.kml: line 1: expected XML: "),
    "KML words for figures": ("a.kml", kml(LINE.format("15,49 15.01,north")), "", ("a.kml: Placemark 'V 7' (line 1): "
                              "coordinates: expected longitude,latitude[,altitude], got '15.01,north'")),
    "KML with a line of one place": ("a.kml", kml(LINE.format("15,49")), "", ("a.kml: Placemark 'V 7' (line 1): "
                                     "coordinates: expected a line of at least two positions")),
    "KML without places": ("a.kml", kml("<LineString/>"), "", ("a.kml: Placemark 'V 7' (line 1): coordinates: expected "
                           "longitude,latitude[,altitude], found none")),
    "KML with latitude first": ("a.kml", kml(LINE.format("49,120 49.01,120")), "", ("a.kml: Placemark 'V 7' (line 1): "
                                "lat_deg: expected -90 to 90, got 120.0; are latitude and longitude swapped")),
    "KML of points alone": ("a.kml", kml("<Point><coordinates>15,49</coordinates></Point>"), "",
                            "a.kml: segments: expected at least one, found none: 1 points and no line"),
    "KML with a height in words": ("a.kml", kml('<ExtendedData><Data name="height_m"><value>tall</value></Data>'
                                   "</ExtendedData><Point><coordinates>15,49</coordinates></Point>"), "",
                                   "a.kml: Placemark 'V 7' (line 1): height_m: expected metres as a finite number"),
    "an unknown folder": ("a.kml", kml(LINE.format("15,49 15.01,49")), "--layer HV",
                          "a.kml: layer: expected a folder of the file, '', got 'HV'"),
    "KMZ without KML": ("a.kmz", zipped(readme__txt=b"hello"), "",
                        "a.kmz: content: expected a KMZ, shapefiles or a workbook in the archive, found none"),
    "KMZ that is cut off": ("a.kmz", zipped(doc__kml=kml(LINE.format("15,49 15.01,49")))[:-30], "",
                            "a.kmz: content: expected a whole zip archive: "),
    "KMZ that is a bomb": ("a.kmz", zipped(doc__kml=bytes(50_000_000)), "", ("a.kmz: doc.kml: expected a file that "
                           "unpacks to at most 200 times its size")),
    "other XML": ("a.xml", b"<svg/>", "", "a.xml: content: expected XML that is kml, gpx or osm, got 'svg'"),
    "OpenStreetMap without lines": ("a.osm", osm(TWO), "",
                                    "a.osm: ways: expected some with power = line or minor_line, found none"),
    "OpenStreetMap without nodes": ("a.osm", osm(WAY), "", ("a.osm: way 7: expected at least two of its nodes in the "
                                    "file, found 2 by number alone; ask Overpass for")),
    "OpenStreetMap with a bad node": ("a.osm", osm('<node id="1" lat="x" lon="15"/>'), "",
                                      "a.osm: node 1 (line 1): expected lat and lon in degrees, got 'x' and '15'"),
    "Overpass with an error": ("a.json", b'{"elements": "timed out"}', "",
                               "a.json: elements: expected a list of nodes and ways"),
    "Overpass ids only": ("a.json", elements({"type": "way", "id": 3, "tags": {"power": "line"}}), "",
                          "a.json: elements[0].nodes: expected a list of nodes, got None; ask Overpass for 'out geom'"),
    "GPX without a longitude": ("a.gpx", gpx('<rte><name>R</name>\n<rtept lat="49"/><rtept lat="49" lon="15"/></rte>'),
                                "", "a.gpx: rtept in line 2: expected lat and lon in degrees, got '49' and None"),
    "GPX with an empty track": ("a.gpx", gpx("<trk><name>T</name></trk>"), "",
                                "a.gpx: T: expected a line of at least two points"),
    "CSV without an order": ("a.csv", b"pole,lat,lon\nP1,49,15\n", "", ("a.csv: columns: expected one that says which "
                             "pole follows which, 'order', 'seq', ")),
    "CSV without places": ("a.csv", b"pole,order\nP1,1\n", "", ("a.csv: columns: expected lat and lon, or easting and "
                           "northing, got 'pole', 'order'")),
    "CSV of an unknown grid": ("a.csv", b"order,x,y\n1,2,3\n", "",
                               "a.csv: crs: expected one such as 'EPSG:5514' for easting and northing, none is given"),
    "CSV outside of its grid": ("a.csv", b"order,x,y\n1,1e11,3\n2,1e11,3\n", "--crs EPSG:25833",
                                "a.csv: line 2: position: expected a place of ETRS89 / UTM zone 33N"),
    "CSV with a hole": ("a.csv", b"order,lat,lon\n1,49,15\n2,49,\n", "", "a.csv: line 3: lon: expected a number, got "),
    "CSV with two of one order": ("a.csv", b"order,lat,lon\n1,49,15\n1,49,16\n", "",
                                  "a.csv: line 3: order: expected another than that of line 2, got 1"),
    "CSV with a line of one pole": ("a.csv", b"line,order,lat,lon\nV1,1,49,15\n", "",
                                    "a.csv: line 2: expected two poles or more of line 'V1', found one"),
    "CSV of an unknown encoding": ("a.csv", b"pole,order,lat,lon\nP,1,49,15\n", "--encoding cp9",
                                   "a.csv: encoding: expected the table's own, such as 'cp1250' or 'utf-16', got"),
    "CSV of another encoding": ("a.csv", b"pole,order,lat,lon\n\x8e,1,49,15\n", "--encoding utf-8",
                                "a.csv: encoding: expected the table's own, such as 'cp1250' or 'utf-16', got 'utf-8'"),
    "an encoding for what has its own": ("a.osm", osm(TWO + WAY), "--encoding cp1250",
                                         ("a.osm: encoding: expected none for "
                                         "OpenStreetMap XML, only for CSV and shapefiles; got 'cp1250'")),
    "CSV that is cut off": ("a.csv", b"line,order,lat,lon\nV1,1,49,15\nV1,2,49", "",
                            "a.csv: line 3: expected 4 cells as in the first row, got 3: the file ends in the middle"),
    "CSV with an open quote": ("a.csv", b'line,order,lat,lon\n"V1,1,49,15\nV1,2,49,16\n', "",
                               "a.csv: line 3: expected a table: a quote that is not closed"),
    "CSV whose first rows have no line": ("a.csv", b"line,order,lat,lon\n,1,49,15\nV1,2,49,16\n", "",
                                          "a.csv: line 2: line: expected its name, as other rows have it"),
    "CSV with too many cells": ("a.csv", b"order,lat,lon\n1,49,15,7\n", "",
                                "a.csv: line 2: expected 3 cells as in the first row, got 4"),
    "a workbook of two sheets": ("a.xlsx", sheets("North", "South"), "",
                                 "a.xlsx: layer: expected one sheet of 'North', 'South', found 2"),
    "an unknown sheet": ("a.xlsx", sheets("North"), "--layer West",
                         "a.xlsx: layer: expected a sheet of the file, 'North', got 'West'"),
    "another database": ("a.gpkg", database("CREATE TABLE t (a)"), "", "a.gpkg: content: expected a GeoPackage: "),
    "a GeoPackage that is cut off": ("a.gpkg", database(*GPKG)[:3000], "", "a.gpkg: content: expected a GeoPackage: "),
    "a GeoPackage without layers": ("a.gpkg", database(*GPKG[:3]), "",
                                    "a.gpkg: layers: expected one of lines, found none of lines or points"),
    "a GeoPackage's bad geometry": ("a.gpkg", database(*GPKG, "INSERT INTO hv VALUES (12, x'4750000100', 'V1')"), "",
                                    "a.gpkg: layer 'hv' feature 12: geometry: expected a GeoPackage's: no header"),
    "an unknown layer": ("a.gpkg", database(*GPKG), "--layer mv",
                         "a.gpkg: layer: expected a layer of the file, 'hv', got 'mv'"),
    "a shapefile without .prj": ("a.zip", shapes(prj=None), "", ("a.zip: lines.prj: crs: expected a reference system, "
                                 "none is in the file; crs says it")),
    "a shapefile with another .prj": ("a.zip", shapes(prj=b"north is up"), "", ("a.zip: lines.prj: crs: expected a "
                                      "coordinate reference system such as 'EPSG:32633', got 'north is up'")),
    "a shapefile without .dbf": ("a.zip", shapes(dbf=None), "",
                                 "a.zip: lines.dbf: expected the names and attributes next to the .shp"),
    "a shapefile with half a .shp": ("a.zip", shapes(shp=b"\x00\x00\x27\x0a" + bytes(40)), "", "a.zip: lines: "),
    "GeoJSON of an unknown system": ("a.json", json.dumps({"type": "FeatureCollection", "features": [GEOJSON_LINE],
                                     "crs": {"type": "name", "properties": {"name": "Mars"}}}).encode(), "",
                                     "a.json: crs: expected a coordinate reference system such as"),
    "a filter that is none": ("a.osm", osm(TWO + WAY), "--where voltage>>1", "--where: expected comparisons such as "),
    "a filter of nothing": ("a.osm", osm(TWO + WAY), "--where volts>1",
                            "a.osm: where: expected an attribute of the lines, 'id', 'power', 'voltage', got 'volts'"),
    "a filter that nothing fulfils": ("a.osm", osm(TWO + WAY), "--where voltage<1", ("a.osm: where: expected lines of "
                                      "which voltage < 1 holds, found none of 1")),
    "a crs for what has its own": ("a.osm", osm(TWO + WAY), "--crs EPSG:5514", ("a.osm: crs: expected none for "
                                   "OpenStreetMap XML, which is always WGS 84; got 'EPSG:5514'")),
    "a picture": ("a.png", b"\x89PNG\r\n\x1a\n" + bytes(30), "",
                  "a.png: content: expected a map's data, got a picture (PNG)"),
    "a letter": ("a.txt", b"Dear Sir,\nplease find attached", "", "a.txt: content: expected GeoJSON, or a graph file"),
    "an empty file": ("a.csv", b"", "", "a.csv: content: expected a row of column names, found none"),
}  # fmt: skip


@pytest.mark.parametrize("name", MALFORMED)
def test_a_malformed_file_is_one_line_with_file_place_and_expectation(name: str, place: Place) -> None:
    file, content, options, reason = MALFORMED[name]
    path = Path(place.path(file))
    path.write_bytes(content)
    said = place.refused("network", str(path), *options.split())
    assert said.startswith(reason if reason.startswith("--") else f"{place.folder}/{reason}")


def test_a_file_that_is_not_there_is_named(place: Place) -> None:
    assert place.refused("network", place.path("none.kml")).endswith(
        "none.kml: file: expected a readable network file: No such file or directory"
    )


def test_lines_poles_and_findings_are_shown_without_a_depot(place: Place) -> None:
    code, out, err = place.run("network", str(same.geopackage(place.folder, "EPSG:5514")))
    assert (code, err) == (0, "")
    head, _, *rows = out.splitlines()
    assert head.endswith("grid.gpkg: GeoPackage, S-JTSK / Krovak East North (EPSG:5514)")
    assert " ".join(rows[0].split()) == "V410 3 0.71 km 210.3 m 259.6 m 4 4 of 4 4 of 4"
    assert rows[2].split()[:2] == ["all", "5"]
    assert rows[3] == "no depot in the file; lines 2"


def test_the_json_says_all_of_it(place: Place) -> None:
    bent = [[15.6, 49.6], [15.602, 49.6], [15.602, 49.6], [15.604, 49.6005]]
    place.network({**GEOJSON_LINE, "geometry": {"type": "LineString", "coordinates": bent}})
    _, out, _ = place.run("network", place.path("line.geojson"), "--json")
    said = json.loads(out)
    assert (said["format"], said["depot"], said["segments"], said["pylons"]) == ("GeoJSON", None, 2, 3)
    assert [(line["name"], line["spans"]) for line in said["lines"]] == [("V1", 2)]
    assert said["findings"] == [
        {"matter": "spans without length", "asset": "V1", "text": "two positions at one place (49.600000, 15.602000): "
         "taken once"}
    ]  # fmt: skip


def test_what_is_written_reads_back_and_is_drawn(place: Place) -> None:
    source, written, picture = same.overpass(place.folder), place.path("o.geojson"), Path(place.path("o.png"))
    assert place.run("network", str(source), "-o", written, "--picture", str(picture))[0] == 0
    assert (
        import_network(written, anywhere=True).network.segments
        == import_network(source, anywhere=True).network.segments
    )
    assert picture.read_bytes().startswith(b"\x89PNG")


def test_a_full_disk_leaves_what_was_written_before(place: Place) -> None:
    source, written = same.overpass(place.folder), Path(place.path("o.geojson"))
    written.write_text("before")
    with room_for(100):
        assert place.refused("network", str(source), "-o", str(written)).endswith("cannot be written: File too large")
    assert written.read_text() == "before"


def test_what_is_missing_is_reported_before_the_lines_and_where_it_is_planned(place: Place) -> None:
    source, site = Path(place.path("a.kmz")), Path(place.path("new.toml"))
    link = b"<NetworkLink><name>more</name></NetworkLink>"
    source.write_bytes(
        zipped(doc__kml=kml(LINE.format("15.6,49.6 15.602,49.6")).replace(b"<Placemark>", link + b"<Placemark>"))
    )
    _, out, _ = place.run("network", str(source))
    assert out.splitlines()[1:3] == ["is it whole (1):", "  more: a link to another file: not followed"]
    assert place.run("init", str(source), "--depot", "49.6,15.6", "-o", str(site))[0] == 0
    site.write_text(site.read_text().replace('# heights = "flat"', 'heights = "flat"'))
    _, out, err = place.run("plan", str(site), "--seconds", "0.2", "--cost", "minmax")
    assert "is it whole: more: a link to another file: not followed" in out + err


def test_a_country_is_cut_and_a_code_page_is_kept_in_the_site(place: Place) -> None:
    site, rows = Path(place.path("new.toml")), ["line,order,lat,lon"]
    rows += [f"{name},{k},{lat},{15.6 + k / 500}" for name, lat in (("Ole\xe8", 49.6), ("far", 55.0)) for k in (1, 2)]
    source = Path(place.path("a.csv"))
    source.write_bytes("\n".join([*rows, ""]).encode("latin-1"))
    words = ("--depot", "49.6,15.6,450", "--radius", "1500", "--encoding", "cp1252", "--vehicles", "1", "-o", str(site))
    assert place.run("init", str(source), *words)[0] == 0
    assert 'encoding = "cp1252"' in site.read_text()
    site.write_text(site.read_text().replace('# heights = "flat"', 'heights = "flat"'))
    assert place.run("plan", str(site), "--seconds", "0.2", "--cost", "minmax", "-o", place.path("plan.json"))[0] == 0
    assert [one["name"] for one in json.loads(Path(place.path("plan.json")).read_text())["segments"]] == ["Oleè.1"]


def test_flat_ground_by_format_is_still_flat_when_written(place: Place) -> None:
    graph = Path(place.path("line.graph"))
    graph.write_text('pylons_position = "0 0 0; 100 0 0; 200 0 0;"\nconnections_indexes = "2; 1 3; 2;"\n')
    assert place.run("network", str(graph), "--depot", "49.6,15.6,450", "-o", place.path("o.geojson"))[0] == 0
    first, again = read_network(graph, depot=(49.6, 15.6, 450.0)), read_network(place.path("o.geojson"))
    assert (again.flat, again.frame, again.pylons, again.segments) == (True, first.frame, first.pylons, first.segments)


def test_a_graph_file_is_shown_without_a_depot_and_it_is_reported(place: Place) -> None:
    graph = Path(place.path("line.graph"))
    graph.write_text('pylons_position = "0 0 0; 100 0 0; 200 0 0;"\nconnections_indexes = "2; 1 3; 2;"\n')
    said = json.loads(place.run("network", str(graph), "--json")[1])
    assert (said["segments"], said["depot"], said["length_m"]) == (2, None, pytest.approx(200.0))
    assert [one["text"] for one in said["findings"]] == [
        "offsets without a depot: shown about 0, 0, which is in the sea; a depot places them"
    ]
    assert "depot: expected lat_deg" in place.refused("network", str(graph), "--crs", "EPSG:25833")


def test_a_site_chooses_lines_and_they_keep_their_names(place: Place) -> None:
    source, site = same.overpass(place.folder), Path(place.path("new.toml"))
    words = ("--where", "voltage >= 400000", "--depot", "49.6,15.6,450", "--vehicles", "1", "-o", str(site))
    assert place.run("init", str(source), *words)[0] == 0
    ground = site_model.load_site_model(read_site(site), place.folder)
    assert [segment.label for segment in ground.network.segments] == ["V410.1", "V410.2", "V410.3"]
    assert place.run("plan", str(site), "--seconds", "0.2", "-o", place.path("plan.json"))[0] == 0
    first, *_ = json.loads(Path(place.path("plan.json")).read_text())["segments"]
    assert (first["name"], first["pylons"]) == ("V410.1", ["A1", "A2"])


@pytest.mark.parametrize(
    ("row", "reason"),
    [
        ('where = "voltage >"', "network.where: expected comparisons such as"),
        ("snap_m = 0", "network.snap_m: "),
        ("max_span_m = 1", "network.max_span_m: "),
        ('layer = ""', "network.layer"),
        ('layer = "hv"', "layer: expected none for GeoJSON, which has no layers; got 'hv'"),
    ],
)
def test_what_a_site_says_of_its_network_is_checked(place: Place, row: str, reason: str) -> None:
    place.site(extra=row)
    assert reason in place.refused("plan", place.path("site.toml"), "--seconds", "0.1")


def test_a_site_shows_its_network_with_what_it_leaves_out_and_locks(place: Place) -> None:
    names = [segment.label for segment in import_network(place.folder / "line.geojson", anywhere=True).network.segments]
    lock = f'[[lock]]\nsegments = ["{names[1]}"]\nvehicle = "uav2"\n'
    place.site(extra=f'leave_out = ["{names[0]}"]\n{lock}')
    code, out, err = place.run("network", place.path("site.toml"), "-o", place.path("seen.geojson"))
    assert (code, err) == (0, "")
    assert out.splitlines()[-2:] == [f"left out by the site: {names[0]}", f"locked to uav2: {names[1]}"]
    seen = json.loads(Path(place.path("seen.geojson")).read_text(encoding="utf-8"))["features"]
    said = {one["properties"].get("name"): one["properties"] for one in seen}
    assert (said[names[0]]["left_out"], said[names[1]]["locked"]) == (True, "uav2")
    document = json.loads(place.run("network", place.path("site.toml"), "--json")[1])
    assert document["chosen"] == [{"name": names[0], "left_out": True}, {"name": names[1], "locked": "uav2"}]
    reason = place.refused("network", place.path("site.toml"), "--snap", "3")
    assert reason == f"--snap: expected none with {place.path('site.toml')}, which states how it is read"


def test_what_was_mended_is_reported_where_it_is_planned(place: Place) -> None:
    source, site = same.gpx(place.folder), Path(place.path("new.toml"))
    source.write_text(source.read_text().replace("<name>A2</name>", "<name>A1</name>"))
    assert place.run("init", str(source), "--depot", "49.6,15.6", "-o", str(site))[0] == 0
    site.write_text(site.read_text().replace('# heights = "flat"', 'heights = "flat"'))
    _, out, err = place.run("plan", str(site), "--seconds", "0.2", "--cost", "minmax")
    assert "poles of one name: A1: another pole has this name: it is called 'A1 (2)' here" in out + err


def stations(place: Place) -> str:
    points = "".join(
        f"<Placemark><name>B{number}</name><Point><coordinates>15.6{number},49.6</coordinates></Point></Placemark>"
        for number in (1, 2)
    )
    path = Path(place.path("stations.kml"))
    path.write_text(f"<kml><Document>{points}</Document></kml>")
    return str(path)


def test_a_depot_may_be_a_point_of_a_file(place: Place) -> None:
    file, source = stations(place), str(same.gpx(place.folder))
    site = Path(place.path("new.toml"))
    assert place.run("init", source, "--depot", f"{file}#B2", "-o", str(site))[0] == 0
    depot = read_site(site).depot
    assert depot is not None
    assert (depot.lat_deg, depot.lon_deg, depot.alt_m) == (49.6, 15.62, None)
    assert place.refused("init", source, "--depot", file).startswith("--depot: expected the name of a point in ")
    assert "of #B1, #B2, got" in place.refused("init", source, "--depot", f"{file}#B3")


@pytest.mark.parametrize("station", ["B1", "B2"])
def test_a_real_line_as_drawn_in_google_earth_is_planned_from_its_bases(place: Place, station: str) -> None:
    if not KML_FOLDER.exists():
        pytest.skip("the public line ../shared/data/kml is not there")
    site = Path(place.path("new.toml"))
    words = ("--depot", f"{KML_FOLDER / 'stations.kml'}#{station}", "--snap", "4", "-o", str(site))
    code, out, _ = place.run("init", str(KML_FOLDER / "pylons.kml"), *words)
    assert (code, ": 26 segments, 3 vehicles; next: " in out) == (0, True)
    site.write_text(site.read_text().replace('# heights = "flat"', 'heights = "flat"'))
    code, out, err = place.run("plan", str(site), "--seconds", "0.3", "--cost", "minmax")
    assert (code, "26 of 26 segments" in out) == (0, True), err
    assert "ends joined: Untitled Path: joined to 'P10', 3.60 m away" in out
