"""The same network out of every format that a utility has."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

import pytest

from missions import Understood, Wanted, network_document, understand
from tests.missions.readers import same

KROVAK, UTM = "EPSG:5514", "EPSG:25833"
FILES: dict[str, tuple[Callable[[Path], Path], Wanted]] = {
    "Overpass JSON": (same.overpass, Wanted()),
    "OpenStreetMap XML": (same.osm_xml, Wanted()),
    "KMZ": (same.kmz, Wanted()),
    "CSV": (same.table, Wanted()),
    "CSV in a grid": (lambda folder: same.table(folder, KROVAK), Wanted(crs=KROVAK)),
    "CSV of a spreadsheet": (lambda folder: same.table(folder, None, ";", ","), Wanted()),
    "XLSX": (same.workbook, Wanted(layers=("Poles",))),
    "XLSX in a grid": (lambda folder: same.workbook(folder, UTM), Wanted(layers=("Poles",), crs=UTM)),
    "GeoPackage, Krovak": (lambda folder: same.geopackage(folder, KROVAK), Wanted()),
    "GeoPackage, UTM": (lambda folder: same.geopackage(folder, UTM), Wanted()),
    "zipped shapefiles": (lambda folder: same.zipped_shapes(folder, UTM), Wanted()),
    "zipped shapefiles, Krovak": (lambda folder: same.zipped_shapes(folder, KROVAK), Wanted()),
}


def read(name: str, folder: Path) -> Understood:
    write, wanted = FILES[name]
    return understand(write(folder), wanted, anywhere=True)


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
    path.write_text(json.dumps(network_document(first)), encoding="utf-8")
    again = understand(path, anywhere=True)
    assert again.network.pylons == first.network.pylons
    assert again.network.segments == first.network.segments
    assert again.lines == first.lines


def test_waypoints_of_a_receiver_are_poles_and_its_routes_lines(tmp_path: Path) -> None:
    same.assert_same(understand(same.gpx(tmp_path), anywhere=True).network, heights=False)


@pytest.mark.parametrize("crs", ["EPSG:4326", KROVAK])
def test_lines_alone_have_their_poles_at_their_positions(crs: str, tmp_path: Path) -> None:
    """An older GeoJSON names its system; a name of QGIS."""
    understood = understand(same.geojson(tmp_path, crs), anywhere=True)
    same.assert_same(understood.network, names=False, heights=False)
    assert understood.crs == ("WGS 84" if crs == "EPSG:4326" else "S-JTSK / Krovak East North (EPSG:5514)")
