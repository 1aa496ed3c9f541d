"""The same network out of every format that a utility has."""

from __future__ import annotations

import json
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

from missions import NetworkImport, Selection, build_network_document, import_network, parse_where
from tests.missions.readers import same
from tests.patience import PATIENCE_S

ROOT = Path(__file__).parents[3]
KROVAK, UTM = "EPSG:5514", "EPSG:25833"
FILES: dict[str, tuple[Callable[[Path], Path], Selection]] = {
    "Overpass JSON": (same.overpass, Selection()),
    "OpenStreetMap XML": (same.osm_xml, Selection()),
    "KMZ": (same.kmz, Selection()),
    "CSV": (same.table, Selection()),
    "CSV in a grid": (lambda folder: same.table(folder, KROVAK), Selection(crs=KROVAK)),
    "CSV of a spreadsheet": (lambda folder: same.table(folder, None, ";", ","), Selection()),
    "XLSX": (same.workbook, Selection(layers=("Poles",))),
    "XLSX in a grid": (lambda folder: same.workbook(folder, UTM), Selection(layers=("Poles",), crs=UTM)),
    "GeoPackage, Krovak": (lambda folder: same.geopackage(folder, KROVAK), Selection()),
    "GeoPackage, UTM": (lambda folder: same.geopackage(folder, UTM), Selection()),
    "zipped shapefiles": (lambda folder: same.zipped_shapes(folder, UTM), Selection()),
    "zipped shapefiles, Krovak": (lambda folder: same.zipped_shapes(folder, KROVAK), Selection()),
}


def read(name: str, folder: Path) -> NetworkImport:
    write, wanted = FILES[name]
    return import_network(write(folder), wanted, anywhere=True)


@pytest.mark.parametrize("name", FILES)
def test_the_same_network_comes_out_of_every_format(name: str, tmp_path: Path) -> None:
    understood = read(name, tmp_path)
    same.assert_same(understood.network)
    assert sorted(set(understood.lines.values())) == sorted(same.LINES)
    assert understood.found == ()


@pytest.mark.parametrize("name", FILES)
def test_what_was_understood_reads_back_to_the_same_network(name: str, tmp_path: Path) -> None:
    first = read(name, tmp_path)
    path = tmp_path / "understood.geojson"
    path.write_text(json.dumps(build_network_document(first)), encoding="utf-8")
    again = import_network(path, anywhere=True)
    assert again.network.pylons == first.network.pylons
    assert again.network.segments == first.network.segments
    assert again.lines == first.lines


def test_waypoints_of_a_receiver_are_poles_and_its_routes_lines(tmp_path: Path) -> None:
    same.assert_same(import_network(same.gpx(tmp_path), anywhere=True).network, heights=False)


@pytest.mark.parametrize("crs", ["EPSG:4326", KROVAK])
def test_lines_alone_have_their_poles_at_their_positions(crs: str, tmp_path: Path) -> None:
    """An older GeoJSON names its system; a name of QGIS."""
    understood = import_network(same.geojson(tmp_path, crs), anywhere=True)
    same.assert_same(understood.network, names=False, heights=False)
    assert understood.crs == ("WGS 84" if crs == "EPSG:4326" else "S-JTSK / Krovak East North (EPSG:5514)")


MARK = (
    "<Placemark><name>V1</name><LineString><coordinates>15.6,49.6 15.602,49.6,7</coordinates></LineString></Placemark>"
)
ROUTE = (
    '<gpx><trk><name>V1</name>{}<trkseg><trkpt lat="49.6" lon="15.6"/><trkpt lat="49.6" lon="15.602"/></trkseg></trk>'
    "</gpx>"
)
AS_FOUND: dict[str, tuple[str, bytes]] = {
    "KML in UTF-16": ("a.kml", f'<?xml version="1.0" encoding="UTF-16"?><kml>{MARK}</kml>'.encode("utf-16")),
    "KML without its outermost element": ("a.kml", MARK.encode()),
    "KML that begins with a folder": ("a.kml", f"<Folder><Folder>{MARK}</Folder></Folder>".encode()),
    "a track with an empty part": (
        "a.gpx",
        ROUTE.format('<trkseg/><trkseg><trkpt lat="1" lon="1"/></trkseg>').encode(),
    ),
    "CSV of an old Macintosh": ("a.csv", b"line,order,lat,lon\rV1,1,49.6,15.6\rV1,2,49.6,15.602\r"),
    "CSV without its ending": ("poles", b"line\torder\tlat\tlon\nV1\t1\t49.6\t15.6\nV1\t2\t49.6\t15.602\n"),
}


@pytest.mark.parametrize("name", AS_FOUND)
def test_files_as_programs_leave_them_are_read(name: str, tmp_path: Path) -> None:
    file, content = AS_FOUND[name]
    path = tmp_path / file
    path.write_bytes(content)
    understood = import_network(path, anywhere=True)
    assert [segment.label for segment in understood.network.segments] == ["V1.1"]
    assert understood.network.lengths_m == pytest.approx([144.6], abs=0.1)


def test_what_an_altitude_is_above_is_reported(tmp_path: Path) -> None:
    """Kept where it is above sea level, for what contradicts it; never flown by."""
    path = tmp_path / "a.kml"
    for mode, third_m, words in (
        ("absolute", 7.0, "above sea level (absolute): kept, and not flown by"),
        ("relativeToGround", None, "above the ground (relativeToGround), of wire or top is not said: not used"),
    ):
        path.write_text(MARK.replace("<LineString>", f"<LineString><altitudeMode>{mode}</altitudeMode>"))
        understood = import_network(path, anywhere=True)
        assert [pylon.third_m for pylon in understood.network.pylons] == [None, third_m]
        assert [remark.text for remark in understood.found] == [f"1 position has an altitude {words}"]


def test_heights_of_some_poles_of_openstreetmap_are_used_for_none(tmp_path: Path) -> None:
    path = same.overpass(tmp_path)
    document = json.loads(path.read_text())
    del document["elements"][-1]["tags"]["height"]
    path.write_text(json.dumps(document))
    understood = import_network(path, anywhere=True)
    same.assert_same(understood.network, heights=False)
    assert {pylon.height_m for pylon in understood.network.pylons} == {None}
    assert [remark.text for remark in understood.found] == ["height is known of 5 of 6 poles: not used"]


def test_a_layer_is_asked_for_where_several_could_be_meant(tmp_path: Path) -> None:
    path = same.geopackage(tmp_path, UTM)
    lines = import_network(path, Selection(layers=("lines",)), anywhere=True)
    same.assert_same(lines.network, names=False, heights=False)
    chosen = import_network(path, Selection(where=parse_where("voltage > 200000")), anywhere=True)
    assert set(chosen.lines.values()) == {"V410"}
    assert sorted(remark.asset for remark in chosen.found) == ["B1", "B2"]


MEASURED = """
import re, sys
from pathlib import Path
from missions import import_network
understood = import_network(sys.argv[1], anywhere=True)
kib = re.search("VmHWM: *(.*) kB", Path("/proc/self/status").read_text().replace(chr(9), " "))[1]
print(len(understood.network.segments), len(understood.found), int(kib) // 1024)
"""
"""The most memory of a process, without what it was forked from."""


def test_ten_thousand_spans_fit_in_little_memory(tmp_path: Path) -> None:
    """A hundred lines side by side, each of a hundred spans; measured 4 to 6 s on two busy cores, in 85 MiB."""
    rows = ["line,order,pole,lat,lon,elevation_m,height_m"]
    rows += [f"L{i},{k},L{i}-{k},{49.5 + 0.002 * i},{15.5 + 0.004 * k},400,30" for i in range(100) for k in range(101)]
    path = tmp_path / "many.csv"
    path.write_text("\n".join(rows))
    command = [sys.executable, "-c", f"import sys; sys.path.insert(0, {str(ROOT)!r}){MEASURED}", str(path)]
    done = subprocess.run(command, capture_output=True, text=True, check=True, timeout=PATIENCE_S)
    spans, remarks, most_mib = map(int, done.stdout.split())
    assert (spans, remarks) == (10_000, 0)
    assert most_mib < 300
