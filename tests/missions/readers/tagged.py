"""A piece of OpenStreetMap in every format that programs export it to, each as its program writes it."""

from __future__ import annotations

import csv
import json
import re
import zipfile
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from xml.sax.saxutils import escape, quoteattr

import numpy as np
import openpyxl
import pyogrio.raw
import shapefile
import shapely
import simplekml

from missions import Selection
from tests.missions.readers.same import MIDDLE

Tags = Mapping[str, str]
WGS84 = (
    'GEOGCS["WGS 84",DATUM["WGS_1984",SPHEROID["WGS 84",6378137,298.257223563]],PRIMEM["Greenwich",0],'
    'UNIT["degree",0.0174532925199433]]'
)


@dataclass(frozen=True, slots=True)
class MapNode:
    number: int
    east_m: float
    north_m: float
    tags: Tags

    @property
    def lat_lon_deg(self) -> tuple[float, float]:
        lat_deg, lon_deg = MIDDLE.to_wgs84_deg(self.east_m, self.north_m)
        return round(lat_deg, 7), round(lon_deg, 7)

    @property
    def at(self) -> tuple[float, float]:
        return self.lat_lon_deg[1], self.lat_lon_deg[0]


@dataclass(frozen=True, slots=True)
class MapWay:
    number: int
    nodes: tuple[MapNode, ...]
    tags: Tags


@dataclass(frozen=True, slots=True)
class Extract:
    nodes: tuple[MapNode, ...]
    ways: tuple[MapWay, ...]

    @property
    def tags(self) -> list[Tags]:
        return [*(node.tags for node in self.nodes), *(way.tags for way in self.ways)]

    @property
    def keys(self) -> list[str]:
        return sorted({key for tags in self.tags for key in tags})

    def features(self) -> Iterator[tuple[str, MapNode | MapWay, shapely.Geometry]]:
        for node in self.nodes:
            yield "node", node, shapely.Point(node.at)
        for way in self.ways:
            yield "way", way, shapely.LineString([node.at for node in way.nodes])


def overpass(extract: Extract, folder: Path) -> Path:
    """Write what Overpass answers."""
    elements: list[dict[str, object]] = []
    for node in extract.nodes:
        lat, lon = node.lat_lon_deg
        elements.append({"type": "node", "id": node.number, "lat": lat, "lon": lon, "tags": dict(node.tags)})
    for way in extract.ways:
        numbers = [node.number for node in way.nodes]
        elements.append({"type": "way", "id": way.number, "nodes": numbers, "tags": dict(way.tags)})
    return _json(folder / "overpass.json", {"version": 0.6, "elements": elements})


def osm_xml(extract: Extract, folder: Path) -> Path:
    rows = ['<osm version="0.6" generator="JOSM">']
    for node in extract.nodes:
        lat, lon = node.lat_lon_deg
        rows.append(f'<node id="{node.number}" version="1" lat="{lat!r}" lon="{lon!r}">{_tags(node.tags)}</node>')
    for way in extract.ways:
        references = "".join(f'<nd ref="{node.number}"/>' for node in way.nodes)
        rows.append(f'<way id="{way.number}" version="1">{references}{_tags(way.tags)}</way>')
    path = folder / "cut.osm"
    path.write_text("\n".join([*rows, "</osm>"]), encoding="utf-8")
    return path


def _tags(tags: Tags) -> str:
    return "".join(f"<tag k={quoteattr(key)} v={quoteattr(value)}/>" for key, value in tags.items())


def turbo(extract: Extract, folder: Path) -> Path:
    """Write GeoJSON as overpass turbo does: the tags flat, the number beside them."""
    return _geojson(extract, folder, lambda kind, one: {"@id": f"{kind}/{one.number}", **one.tags})


def osmtogeojson(extract: Extract, folder: Path) -> Path:
    """Write GeoJSON with the tags in an object of their own."""
    return _geojson(
        extract, folder, lambda kind, one: {"type": kind, "id": one.number, "tags": dict(one.tags), "meta": {}}
    )


def quickosm(extract: Extract, folder: Path) -> Path:
    """Write GeoJSON as QGIS saves it: every key of any feature, null where a feature has it not."""
    return _geojson(
        extract,
        folder,
        lambda kind, one: {
            "full_id": f"{kind[0]}{one.number}", "osm_id": str(one.number), "osm_type": kind,
            **{key: one.tags.get(key) for key in extract.keys},
        },
    )  # fmt: skip


def flattened_table(extract: Extract, folder: Path) -> Path:
    """Write GeoJSON as tables do it: nested names joined, in capitals, NaN for nothing."""
    return _geojson(
        extract,
        folder,
        lambda kind, one: {
            "ID": f"{kind}/{one.number}",
            **{f"TAGS_{key.upper().replace(':', '_')}": one.tags.get(key, float("nan")) for key in extract.keys},
        },
    )


def _geojson(extract: Extract, folder: Path, properties: Callable[[str, MapNode | MapWay], object]) -> Path:
    features = [
        {"type": "Feature", "id": f"{kind}/{one.number}", "properties": properties(kind, one),
         "geometry": json.loads(shapely.to_geojson(geometry))}
        for kind, one, geometry in extract.features()
    ]  # fmt: skip
    return _json(folder / "export.geojson", {"type": "FeatureCollection", "features": features})


def _json(path: Path, document: object) -> Path:
    path.write_text(json.dumps(document, ensure_ascii=False), encoding="utf-8")
    return path


def hstore(extract: Extract, folder: Path) -> Path:
    """Write a GeoPackage as ogr2ogr does: what has no column of its own is in `other_tags`."""
    source, path = osm_xml(extract, folder), folder / "ogr.gpkg"
    for number, layer in enumerate(("points", "lines")):
        meta, _, geometry, values = pyogrio.raw.read(str(source), layer=layer)
        pyogrio.raw.write(
            str(path), geometry, values, list(meta["fields"]), geometry_type=meta["geometry_type"], crs="EPSG:4326",
            layer=layer, driver="GPKG", append=number > 0,
        )  # fmt: skip
    return path


def geopackage(extract: Extract, folder: Path) -> Path:
    """Write a GeoPackage with a column for every tag, null where a feature has it not, heights as numbers."""
    path = folder / "quick.gpkg"
    for number, (kind, geometry_type) in enumerate((("node", "Point"), ("way", "LineString"))):
        own = [(one, geometry) for of, one, geometry in extract.features() if of == kind]
        columns = [np.array([one.tags.get(key) for one, _ in own], dtype=object) for key in extract.keys]
        wkb = np.array([shapely.to_wkb(geometry) for _, geometry in own], dtype=object)
        pyogrio.raw.write(
            str(path), wkb, [np.array([str(one.number) for one, _ in own], dtype=object), *columns],
            ["osm_id", *extract.keys], geometry_type=geometry_type, crs="EPSG:4326", layer=kind, driver="GPKG",
            append=number > 0,
        )  # fmt: skip
    return path


def shapes(extract: Extract, folder: Path, encoding: str = "utf-8") -> Path:
    """Write a zip of two shapefiles: names of ten letters, in capitals."""
    path = folder / "shapes.zip"
    with zipfile.ZipFile(path, "w") as archive:
        for kind, shape_type in (("node", shapefile.POINT), ("way", shapefile.POLYLINE)):
            with shapefile.Writer(str(folder / kind), shapeType=shape_type, encoding=encoding) as writer:
                for key in ("osm_id", *extract.keys):
                    writer.field(key.upper().replace(":", "_")[:10], "C", 60)
                for of, one, geometry in extract.features():
                    if of == kind:
                        places = list(geometry.coords)
                        writer.point(*places[0]) if kind == "node" else writer.line([places])
                        writer.record(str(one.number), *(one.tags.get(key, "") for key in extract.keys))
            for part in ("shp", "shx", "dbf"):
                archive.write(folder / f"{kind}.{part}", f"{kind}.{part}")
            archive.writestr(f"{kind}.prj", WGS84)
            archive.writestr(f"{kind}.cpg", encoding)
    return path


def kml(extract: Extract, folder: Path) -> Path:
    document = simplekml.Kml()
    for kind, one, geometry in extract.features():
        add = document.newpoint if kind == "node" else document.newlinestring
        mark = add(name=escape(one.tags.get("name", "")), coords=list(geometry.coords))
        for key, value in {"@id": f"{kind}/{one.number}", **one.tags}.items():
            mark.extendeddata.newdata(key, escape(value))
    path = folder / "turbo.kml"
    document.save(str(path))
    return path


def gpx(extract: Extract, folder: Path) -> Path:
    """Write GPX as GDAL does: what GPX has no element for is an extension."""
    rows = ['<gpx version="1.1" creator="GDAL" xmlns:ogr="http://osgeo.org/gdal">']
    for node in extract.nodes:
        lat, lon = node.lat_lon_deg
        rows.append(f'<wpt lat="{lat!r}" lon="{lon!r}">{_extended("node", node)}</wpt>')
    for way in extract.ways:
        points = "".join('<rtept lat="{!r}" lon="{!r}"/>'.format(*node.lat_lon_deg) for node in way.nodes)
        rows.append(f"<rte>{_extended('way', way)}{points}</rte>")
    path = folder / "gdal.gpx"
    path.write_text("\n".join([*rows, "</gpx>"]), encoding="utf-8")
    return path


def _extended(kind: str, one: MapNode | MapWay) -> str:
    name = f"<name>{escape(one.tags['name'])}</name>" if "name" in one.tags else ""
    inside = {"osm_id": str(one.number), "osm_type": kind, **one.tags}
    tags = ((re.sub(r"\W", "_", key), escape(value)) for key, value in inside.items())
    return f"{name}<extensions>{''.join(f'<ogr:{key}>{value}</ogr:{key}>' for key, value in tags)}</extensions>"


def _rows(extract: Extract) -> Iterator[list[object]]:
    ways = [way for way in extract.ways if "line" not in way.tags]  # whose name the column has
    own = sorted({key for way in ways for key in way.tags} - {"name"})
    yield ["line", "order", "pole", "lat", "lon", "elevation_m", "height_m", *own]
    for way in ways:
        for number, node in enumerate(way.nodes, start=1):
            heights = [node.tags.get("ele"), node.tags.get("height")]
            tags = [way.tags.get(key) for key in own]
            yield [way.tags["name"], number, node.tags["ref"], *node.lat_lon_deg, *heights, *tags]


def table(extract: Extract, folder: Path) -> Path:
    """Write a table with the tags of its line at every pole."""
    path = folder / "poles.csv"
    with path.open("w", encoding="utf-8", newline="") as file:
        csv.writer(file, delimiter=";").writerows(_rows(extract))
    return path


def workbook(extract: Extract, folder: Path) -> Path:
    book = openpyxl.Workbook()
    assert book.active is not None
    for row in _rows(extract):
        book.active.append(row)
    path = folder / "poles.xlsx"
    book.save(path)
    return path


EXPORTS: dict[str, tuple[Callable[[Extract, Path], Path], Selection]] = {
    "Overpass": (overpass, Selection()),
    "JOSM": (osm_xml, Selection()),
    "overpass turbo": (turbo, Selection()),
    "osmtogeojson": (osmtogeojson, Selection()),
    "QuickOSM": (quickosm, Selection()),
    "a flattened table": (flattened_table, Selection()),
    "ogr2ogr": (hstore, Selection(layers=("points", "lines"))),
    "GeoPackage": (geopackage, Selection()),
    "shapefiles": (shapes, Selection()),
    "KML": (kml, Selection()),
    "GPX": (gpx, Selection()),
}
TABLES: dict[str, Callable[[Extract, Path], Path]] = {"CSV": table, "XLSX": workbook}
