"""One network, written in every format by programs that share nothing with the readers."""

from __future__ import annotations

import csv
import itertools
import json
import zipfile
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

import gpxpy.gpx
import numpy as np
import openpyxl
import pyogrio.raw
import pyproj
import shapely
import simplekml

from missions import LocalFrame, Network

MIDDLE = LocalFrame(49.6, 15.6)


@dataclass(frozen=True, slots=True)
class Tower:
    name: str
    east_m: float
    north_m: float
    elevation_m: float
    height_m: float

    @property
    def lat_lon_deg(self) -> tuple[float, float]:
        return MIDDLE.to_wgs84_deg(self.east_m, self.north_m)


TOWERS = {
    tower.name: tower
    for tower in (
        Tower("A1", 0.0, 0.0, 450.0, 30.0),
        Tower("A2", 210.0, 12.0, 452.0, 31.0),
        Tower("A3", 450.0, 20.0, 455.5, 30.0),
        Tower("A4", 700.0, 90.0, 457.0, 33.5),
        Tower("B1", 300.0, 240.0, 449.0, 20.0),
        Tower("B2", 380.0, 400.0, 447.0, 22.0),
    )
}
LINES = {"V410": ("A1", "A2", "A3", "A4"), "V52 Žďár": ("A3", "B1", "B2")}
VOLTAGES = {"V410": 400_000, "V52 Žďár": 110_000}


def places(line: str) -> list[tuple[float, float]]:
    return [TOWERS[name].lat_lon_deg for name in LINES[line]]


def xy(lat_deg: float, lon_deg: float, crs: str) -> tuple[float, float]:
    x, y = pyproj.Transformer.from_crs("EPSG:4326", crs, always_xy=True).transform(lon_deg, lat_deg)
    return float(x), float(y)


def assert_same(network: Network, *, names: bool = True, heights: bool = True, within_m: float = 0.1) -> None:
    """Every tower is where it stands, and the spans are between the right ones."""
    found = {}
    for pylon in network.pylons:
        east_m, north_m = MIDDLE.to_local_m(pylon.lat_deg, pylon.lon_deg)
        tower = min(TOWERS.values(), key=lambda one: np.hypot(one.east_m - east_m, one.north_m - north_m))
        assert np.hypot(tower.east_m - east_m, tower.north_m - north_m) <= within_m
        if names:
            assert pylon.id == tower.name
        if heights:
            assert (pylon.elevation_m, pylon.height_m) == (tower.elevation_m, tower.height_m)
        found[pylon.id] = tower.name
    assert sorted(found.values()) == sorted(TOWERS)
    spans = [(found[network.pylons[segment.a].id], found[network.pylons[segment.b].id]) for segment in network.segments]
    assert sorted(spans) == sorted(pair for names_ in LINES.values() for pair in itertools.pairwise(names_))


def overpass(folder: Path) -> Path:
    """Write what Overpass answers to `(way[power=line];>;); out body;`."""
    numbers = {name: 1000 + index for index, name in enumerate(TOWERS)}
    nodes: list[dict[str, object]] = []
    for tower in TOWERS.values():
        lat, lon = tower.lat_lon_deg
        tags = {"power": "tower", "ref": tower.name, "ele": str(tower.elevation_m), "height": f"{tower.height_m} m"}
        nodes.append({"type": "node", "id": numbers[tower.name], "lat": lat, "lon": lon, "tags": tags})
    ways = [
        {"type": "way", "id": 7 + index, "nodes": [numbers[name] for name in names],
         "tags": {"power": "line", "name": line, "voltage": str(VOLTAGES[line])}}
        for index, (line, names) in enumerate(LINES.items())
    ]  # fmt: skip
    path = folder / "overpass.json"
    path.write_text(json.dumps({"version": 0.6, "elements": [*ways, *nodes]}), encoding="utf-8")
    return path


def osm_xml(folder: Path) -> Path:
    document = json.loads(overpass(folder).read_text(encoding="utf-8"))
    rows = ['<?xml version="1.0" encoding="UTF-8"?>', '<osm version="0.6">']
    for element in document["elements"]:
        place = f' lat="{element["lat"]!r}" lon="{element["lon"]!r}"' if element["type"] == "node" else ""
        rows.append(f'<{element["type"]} id="{element["id"]}"{place}>')
        rows += [f'<nd ref="{node}"/>' for node in element.get("nodes", ())]
        rows += [f'<tag k="{key}" v="{value}"/>' for key, value in element["tags"].items()]
        rows.append(f"</{element['type']}>")
    path = folder / "cut.osm"
    path.write_text("\n".join([*rows, "</osm>"]), encoding="utf-8")
    return path


def kmz(folder: Path) -> Path:
    document = simplekml.Kml()
    for tower in TOWERS.values():
        lat, lon = tower.lat_lon_deg
        point = document.newpoint(name=tower.name, coords=[(lon, lat)])
        point.extendeddata.newdata("elevation_m", tower.elevation_m)
        point.extendeddata.newdata("height_m", tower.height_m)
    for line in LINES:
        document.newlinestring(name=line, coords=[(lon, lat) for lat, lon in places(line)])
    path = folder / "towers.kmz"
    document.savekmz(str(path))
    return path


def gpx(folder: Path) -> Path:
    document = gpxpy.gpx.GPX()
    for tower in TOWERS.values():
        document.waypoints.append(gpxpy.gpx.GPXWaypoint(*tower.lat_lon_deg, name=tower.name))
    for line in LINES:
        route = gpxpy.gpx.GPXRoute(name=line)
        route.points = [gpxpy.gpx.GPXRoutePoint(*place) for place in places(line)]
        document.routes.append(route)
    path = folder / "walked.gpx"
    path.write_text(document.to_xml(), encoding="utf-8")
    return path


def _rows(crs: str | None) -> Iterator[list[object]]:
    horizontal = ["lat", "lon"] if crs is None else ["Easting", "Northing"]
    yield ["line", "order", "pole", *horizontal, "elevation_m", "height_m"]
    for line, names in LINES.items():
        for number, name in enumerate(names, start=1):
            tower = TOWERS[name]
            where = tower.lat_lon_deg if crs is None else xy(*tower.lat_lon_deg, crs)
            yield [line, number * 10, name, *where, tower.elevation_m, tower.height_m]


def table(folder: Path, crs: str | None = None, delimiter: str = ",", decimal: str = ".") -> Path:
    """Write a CSV file with its rows upside down: the column `order` says what follows what."""
    path = folder / "poles.csv"
    header, *rows = _rows(crs)
    with path.open("w", encoding="utf-8-sig", newline="") as file:
        writer = csv.writer(file, delimiter=delimiter)
        writer.writerow(header)
        for row in reversed(rows):
            writer.writerow([str(cell).replace(".", decimal) if isinstance(cell, float) else cell for cell in row])
    return path


def workbook(folder: Path, crs: str | None = None) -> Path:
    book = openpyxl.Workbook()
    sheet = book.active
    assert sheet is not None
    sheet.title = "Poles"
    for row in _rows(crs):
        sheet.append(row)
    book.create_sheet("Notes").append(["nothing here"])
    path = folder / "poles.xlsx"
    book.save(path)
    return path


def layers(path: Path, crs: str, driver: str, append: Callable[[str], Path] = lambda _: Path()) -> Path:
    """Write towers and lines as GDAL does; each to a file of its own where a name is given for it."""
    points = [shapely.Point(xy(*tower.lat_lon_deg, crs)) for tower in TOWERS.values()]
    lines = [shapely.MultiLineString([[xy(*place, crs) for place in places(line)]]) for line in LINES]
    elevation = "elevation_" if driver.startswith("ESRI") else "elevation_m"  # ten letters
    towers: dict[str, list[object]] = {
        "name": [tower.name for tower in TOWERS.values()],
        elevation: [tower.elevation_m for tower in TOWERS.values()],
        "height_m": [tower.height_m for tower in TOWERS.values()],
    }
    named: dict[str, list[object]] = {"name": [*LINES], "voltage": [VOLTAGES[line] for line in LINES]}
    for layer, geometries, kind, fields in (
        ("towers", points, "Point", towers),
        ("lines", lines, "MultiLineString", named),
    ):
        each = append(layer)
        one_file = each == Path()
        data = [np.array(v, dtype=object if isinstance(v[0], str) else None) for v in fields.values()]
        pyogrio.raw.write(
            str(path if one_file else each), np.array([shapely.to_wkb(one) for one in geometries], dtype=object),
            data, list(fields), geometry_type=kind, crs=crs, layer=layer if one_file else None, driver=driver,
            append=one_file and layer == "lines", encoding=None if driver == "GPKG" else "utf-8",
        )  # fmt: skip
    return path


def geopackage(folder: Path, crs: str) -> Path:
    return layers(folder / "grid.gpkg", crs, "GPKG")


def zipped_shapes(folder: Path, crs: str) -> Path:
    inside = folder / "shapes"
    inside.mkdir()
    layers(inside, crs, "ESRI Shapefile", lambda layer: inside / f"{layer}.shp")
    path = folder / "export.zip"
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        for file in inside.iterdir():
            archive.write(file, f"export/{file.name}")
    return path


def geojson(folder: Path, crs: str) -> Path:
    """Write lines alone as GDAL does, with the system that older programs name."""
    path = folder / "lines.geojson"
    lines = [shapely.LineString([xy(*place, crs) for place in places(line)]) for line in LINES]
    pyogrio.raw.write(
        str(path), np.array([shapely.to_wkb(one) for one in lines], dtype=object),
        [np.array(list(LINES), dtype=object)], ["name"], geometry_type="LineString", crs=crs, driver="GeoJSON",
        COORDINATE_PRECISION=9,
    )  # fmt: skip
    return path
