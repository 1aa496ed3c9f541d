"""Read layered files in any reference system: GeoPackages, and shapefiles, as a .shp or several in a zip archive.

A GeoPackage (OGC 12-128) is an SQLite file, read with Python's own sqlite3 and never written; geometries are the
standard's header followed by well-known binary.

The .shp, .shx and .dbf of a shapefile belong together. Programs that edit a shape in place append it to the .shp, where
only the .shx refers to it, and mark deleted ones in the .dbf only: the set of shapes and their order follow from all
three together.
"""

from __future__ import annotations

import io
import itertools
import sqlite3
import struct
import warnings
from collections.abc import Iterator, Mapping, Sequence
from contextlib import ExitStack, closing, contextmanager
from importlib.util import find_spec
from pathlib import Path, PurePosixPath
from shutil import copyfile
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING
from urllib.parse import quote

from missions.errors import NetworkError
from missions.files import to_printable
from missions.readers.archives import NEEDS, Archive, code_page_of, explaining_errors, read_limited
from missions.readers.features import (
    EMPTY,
    OTHER,
    Feature,
    GeometryKind,
    Position,
    SourceLayer,
    add_layers,
)
from missions.readers.raw_network import RawNetwork, ReadOptions, Remark, RemarkTopic

if TYPE_CHECKING:
    import shapefile

GEOPACKAGE = "GeoPackage"
SQLITE_MAGIC = b"SQLite format 3\x00"
JOURNALS = ("-wal", "-journal")
WAL = b"\x02\x02"
COPIES = 5
"""Most attempts to copy a file that is being written."""
MOST_FEATURES = 500_000
ENVELOPE_BYTES = {0: 0, 1: 32, 2: 48, 3: 48, 4: 64}
POINT, LINE, MULTI_POINT, MULTI_LINE, COLLECTION = 1, 2, 4, 5, 7
MOST_WORK = 20_000_000
"""Thousands of SQLite virtual machine steps after which a query is aborted: a view may be arbitrarily expensive."""
KINDS_BY_NAME = {
    "POINT": GeometryKind.POINT, "MULTIPOINT": GeometryKind.POINT, "LINESTRING": GeometryKind.LINE,
    "MULTILINESTRING": GeometryKind.LINE,
    "GEOMETRY": GeometryKind.LINE, "GEOMETRYCOLLECTION": GeometryKind.LINE,
}  # fmt: skip
SHAPEFILE = "Shapefile"
SHAPEFILE_MAGIC = b"\x00\x00\x27\x0a"
PARTS = ("shp", "shx", "dbf", "prj", "cpg")
KINDS_BY_NUMBER = {1: GeometryKind.POINT, 8: GeometryKind.POINT, 3: GeometryKind.LINE}
"""Shape types without their dimensions; 11 and 21 are 1 with z and with a measure, and so on."""
HEADER = 100


class _Damaged(Exception):
    """An invalid geometry; or a file that is truncated, or inconsistent with the others of its layer."""


def read_geopackage(path: Path, choice: ReadOptions) -> RawNetwork:
    """Return the content of a GeoPackage.

    Raises:
        NetworkError: one line that names the file, the layer and feature and what was expected.
    """
    reasons = sqlite3.Error, sqlite3.Warning, UnicodeDecodeError, OSError
    with explaining_errors("content: expected a GeoPackage", *reasons), open_sqlite(path) as database:
        drawing = _read_tables(database, choice)
    # Its header requires a -wal for the last changes, and there is none.
    with path.open("rb") as file:
        modes = file.read(20)[18:20]
    if modes == WAL and not path.resolve().with_name(path.resolve().name + JOURNALS[0]).exists():
        text = "a program has it open, or it was copied without its -wal: the latest changes may be missing"
        drawing.found.append(Remark(RemarkTopic.WHOLE, choice.source, text))
    return drawing


@contextmanager
def open_sqlite(path: Path) -> Iterator[sqlite3.Connection]:
    """Open an untrusted SQLite file read-only, with a limit on the duration of queries.

    Changes saved by a program that has it open are in a journal next to it: both are read, from a copy.

    Raises:
        sqlite3.Error: it cannot be opened.
        OSError: it cannot be copied.
    """
    path = path.resolve()
    journals = [path.with_name(path.name + end) for end in JOURNALS]
    with ExitStack() as stack:
        file, how = path, "ro&immutable=1"
        if any(one.is_file() and one.stat().st_size for one in journals):
            folder = stack.enter_context(TemporaryDirectory(prefix="faultline-"))
            file, how = _copy_database(path, journals, Path(folder)), "rw"
        database = stack.enter_context(closing(sqlite3.connect(f"file:{quote(str(file))}?mode={how}", uri=True)))
        database.execute("PRAGMA trusted_schema = OFF")
        database.execute("PRAGMA cell_size_check = ON")
        left = iter(range(MOST_WORK))
        database.set_progress_handler(lambda: int(next(left, None) is None), 1000)
        yield database


def _copy_database(path: Path, journals: Sequence[Path], folder: Path) -> Path:
    for _ in range(COPIES):
        before = _read_file_state(path, journals)
        for one in (path, *journals):
            (folder / one.name).unlink(missing_ok=True)
            if one.is_file():
                copyfile(one, folder / one.name)
        if _read_file_state(path, journals) == before:
            return folder / path.name
    raise sqlite3.OperationalError("a program writes into it all the time: close it there, or save a copy")


def _read_file_state(path: Path, journals: Sequence[Path]) -> list[tuple[int, int] | None]:
    each = [one.stat() if one.is_file() else None for one in (path, *journals)]
    return [None if one is None else (one.st_size, one.st_mtime_ns) for one in each]


def _read_tables(database: sqlite3.Connection, choice: ReadOptions) -> RawNetwork:
    rows = database.execute(
        "SELECT c.table_name, g.column_name, g.geometry_type_name, g.srs_id FROM gpkg_contents c "
        "JOIN gpkg_geometry_columns g ON g.table_name = c.table_name WHERE c.data_type = 'features' ORDER BY c.rowid"
    ).fetchall()
    layers = []
    for table, column, kind, srs in rows:
        ((count,),) = database.execute(_build_query("count(*)", table))
        name, kind = str(table), KINDS_BY_NAME.get(str(kind).upper(), GeometryKind.OTHER)
        features = _iterate_rows(database, name, str(column))
        layers.append(SourceLayer(name, kind, count, features, _find_system(database, srs), f"layer {name!r}"))
    drawing = choice.create_raw_network(GEOPACKAGE)
    add_layers(drawing, layers, choice)
    return drawing


def _build_query(what: str, table: object) -> str:
    """Return a query of a whole table, whose name comes from the file."""
    name = str(table).replace('"', '""')
    return " ".join(("SELECT", what, "FROM", f'"{name}"'))


def _find_system(database: sqlite3.Connection, srs: object) -> str:
    row = database.execute(
        "SELECT organization, organization_coordsys_id, definition FROM gpkg_spatial_ref_sys WHERE srs_id = ?", (srs,)
    ).fetchone()
    if row is None or srs in {0, -1}:
        return ""
    organization, code, definition = row
    known = str(organization).upper() in {"EPSG", "ESRI", "IGNF", "OGC"}
    return f"{organization}:{code}" if known else str(definition)


def _iterate_rows(database: sqlite3.Connection, table: str, column: str) -> Iterator[Feature]:
    cursor = database.execute(_build_query("*", table))
    names = [str(entry[0]) for entry in cursor.description]
    if column not in names:
        raise NetworkError(f"layer {table!r}: expected its column {column!r}, found none")
    key = next((name for name in names if name.lower() in {"fid", "ogc_fid"}), None)
    at = names.index(column)
    for number, row in enumerate(cursor, start=1):
        if number > MOST_FEATURES:
            raise NetworkError(f"layer {table!r}: expected at most {MOST_FEATURES} features")
        attributes = {name: value for name, value in zip(names, row, strict=True) if name != column}
        place = f"layer {table!r} feature {number if key is None else attributes.pop(key)}"
        blob = row[at]
        with explaining_errors(f"{place}: geometry: expected a GeoPackage's", _Damaged, struct.error, TypeError):
            kind, parts = (GeometryKind.OTHER, ()) if blob is None else parse_geometry(blob)
        yield Feature(place, kind, parts, attributes, other=EMPTY if blob is None else OTHER)


def parse_geometry(blob: bytes) -> tuple[GeometryKind, Sequence[Sequence[Position]]]:
    """Return the kind of a GeoPackage geometry, and its positions by part.

    Raises:
        _Damaged: it is invalid.
    """
    if not isinstance(blob, bytes) or blob[:2] != b"GP" or len(blob) < 8:
        raise _Damaged("no header 'GP'")
    envelope = ENVELOPE_BYTES.get(blob[3] >> 1 & 7)
    if envelope is None:
        raise _Damaged("an unknown envelope")
    if blob[3] >> 4 & 1:  # empty
        return GeometryKind.LINE, ()
    geometries: list[tuple[int, list[Position]]] = []
    _parse_wkb(blob, 8 + envelope, geometries, 0)
    kinds = {code for code, _ in geometries}
    if len(kinds) > 1 or not kinds <= {POINT, LINE}:
        return GeometryKind.OTHER, ()
    return GeometryKind.LINE if kinds == {LINE} else GeometryKind.POINT, [part for _, part in geometries]


def _parse_wkb(blob: bytes, at: int, into: list[tuple[int, list[Position]]], depth: int) -> int:
    """Parse well-known binary at an offset; return the offset of its end."""
    order = {0: ">", 1: "<"}.get(blob[at] if at < len(blob) else -1)
    if order is None or depth > 4:
        raise _Damaged("no well-known binary")
    code = int(struct.unpack_from(f"{order}I", blob, at + 1)[0])
    # Dimensions beyond the first two, as encoded by ISO or by PostGIS.
    thousands, has_z = (code & 0x0FFFFFFF) // 1000, bool(code & 0x80000000)
    width = 2 + max({1: 1, 2: 1, 3: 2}.get(thousands, 0), has_z + bool(code & 0x40000000))
    third = 2 if has_z or thousands in {1, 3} else None
    kind, at = (code & 0x0FFFFFFF) % 1000, at + 5
    if kind in {POINT, LINE}:
        count, at = (1, at) if kind == POINT else (int(struct.unpack_from(f"{order}I", blob, at)[0]), at + 4)
        if count * 8 * width > len(blob) - at:
            raise _Damaged(f"{count} positions do not fit in {len(blob)} bytes")
        rows = struct.iter_unpack(f"{order}{width}d", blob[at : at + 8 * width * count])
        into.append((kind, [(row[0], row[1], None if third is None else row[third]) for row in rows]))
        return at + 8 * width * count
    if kind in {MULTI_POINT, MULTI_LINE, COLLECTION}:
        (count,) = struct.unpack_from(f"{order}I", blob, at)
        at += 4
        if count > len(blob) - at:
            raise _Damaged(f"{count} parts do not fit in {len(blob)} bytes")
        for _ in range(count):
            at = _parse_wkb(blob, at, into, depth + 1)
        return at
    into.append((kind, []))
    return len(blob)


def read_shapefile(path: Path, choice: ReadOptions) -> RawNetwork:
    """Return the content of a shapefile, given its .shp; the other files are next to it.

    Raises:
        NetworkError: one line that names the file, the feature and what was expected.
    """
    files = {}
    for part in PARTS:
        beside = next((one for one in (path.with_suffix(f".{part}"), path.with_suffix(f".{part.upper()}"))
                       if one.exists()), None)  # fmt: skip
        if beside is not None:
            files[part] = read_limited(beside)
    files["shp"] = read_limited(path)
    return _read_shapes([(path.stem, files)], choice)


def read_zipped_shapes(archive: Archive, choice: ReadOptions) -> RawNetwork:
    """Return the content of an archive's shapefiles.

    Raises:
        NetworkError: one line that names the file, the feature and what was expected.
    """
    by_name = {name.lower(): name for name in archive.names}
    every = []
    for shp in archive.list_by_suffix(".shp"):
        stem = shp[: -len(".shp")]
        files = {
            part: archive.read(by_name[f"{stem}.{part}".lower()])
            for part in PARTS
            if f"{stem}.{part}".lower() in by_name
        }
        every.append((to_printable(PurePosixPath(stem).name), files))
    return _read_shapes(every, choice)


def _read_shapes(every: Sequence[tuple[str, Mapping[str, bytes]]], choice: ReadOptions) -> RawNetwork:
    """Return the content of layers, given by name with the files present."""
    if find_spec("shapefile") is None:
        raise NetworkError(f"a shapefile {NEEDS}")
    drawing = choice.create_raw_network(SHAPEFILE)
    with warnings.catch_warnings(record=True) as warned:
        warnings.simplefilter("always")
        add_layers(drawing, [_open_layer(name, files, drawing, choice) for name, files in every], choice)
    said = dict.fromkeys(to_printable(str(one.message)) for one in warned)
    drawing.found += [Remark(RemarkTopic.FILE, SHAPEFILE, words) for words in said]
    return drawing


def _open_layer(name: str, files: Mapping[str, bytes], drawing: RawNetwork, choice: ReadOptions) -> SourceLayer:
    import shapefile

    if "dbf" not in files:
        raise NetworkError(f"{name}.dbf: expected the names and attributes next to the .shp")
    with explaining_errors(f"{name}: expected a whole shapefile", _Damaged, struct.error):
        _check_parts(files["shp"], files.get("shx"), files["dbf"])
    encoding, words = code_page_of(files["dbf"], files.get("cpg"), choice.encoding)
    if words:
        drawing.found.append(Remark(RemarkTopic.FILE, f"{name}.dbf", words))
    parts = {part: io.BytesIO(files[part]) for part in ("shp", "shx", "dbf") if part in files}
    reasons = shapefile.ShapefileException, struct.error, ValueError, LookupError, OSError, TypeError
    with explaining_errors(f"{name}: expected a shapefile", *reasons):
        reader = shapefile.Reader(**parts, encoding=encoding, encodingErrors="replace")
    system = files.get("prj", b"").decode("utf-8-sig", "replace").strip()
    features = _iterate_shapes(reader, name)
    return SourceLayer(name, _kind_of(reader.shapeType), len(reader), features, system, f"{name}.prj")


def _kind_of(shape_type: int) -> GeometryKind:
    return KINDS_BY_NUMBER.get(shape_type % 10, GeometryKind.OTHER)


def _iterate_shapes(reader: shapefile.Reader, layer: str) -> Iterator[Feature]:
    import shapefile

    number = 0
    try:
        for number in range(len(reader)):
            record, shape = reader.record(number), reader.shape(number)
            if record is None or shape is None:
                continue  # marked as deleted
            place, kind = f"layer {layer!r} feature {number + 1}", _kind_of(shape.shapeType)
            heights = getattr(shape, "z", None) or [None] * len(shape.points)
            positions = [(float(point[0]), float(point[1]), third_m) for point, third_m in
                         zip(shape.points, heights, strict=False)]  # fmt: skip
            starts = getattr(shape, "parts", [0]) if kind is GeometryKind.LINE else [0]
            parts = [positions[a:b] for a, b in itertools.pairwise([*starts, len(positions)])]
            other = EMPTY if shape.shapeType == shapefile.NULL else OTHER
            yield Feature(place, kind, parts, record.as_dict(), other=other)
    except (
        shapefile.ShapefileException, struct.error, ValueError, IndexError, TypeError, OSError, AssertionError
    ) as reason:  # fmt: skip
        words = f"expected a whole shape and its attributes: {to_printable(str(reason))}"
        raise NetworkError(f"layer {layer!r} feature {number + 1}: {words}") from reason


def _check_parts(shp: bytes, shx: bytes | None, dbf: bytes) -> None:
    """Refuse files that are truncated, or inconsistent with each other.

    Raises:
        _Damaged: they are.
        struct.error: one is shorter than its header.
    """
    for name, content in (("shp", shp), ("shx", shp if shx is None else shx)):
        (length,) = struct.unpack_from(">i", content, 24)
        if 2 * length > len(content):
            raise _Damaged(f"the .{name} ends after {len(content)} of {2 * length} bytes")
    shapes = _count_shapes(shp) if shx is None else _count_indexed_shapes(shp, shx)
    rows, header, wide = struct.unpack_from("<LHH", dbf, 4)
    if wide < 1 or header + rows * wide > len(dbf):
        raise _Damaged(f"the .dbf ends after {max(0, len(dbf) - header) // max(1, wide)} of {rows} rows")
    if rows != shapes:
        raise _Damaged(f"the .dbf has {rows} rows and the .{'shp' if shx is None else 'shx'} {shapes} shapes")


def _count_shapes(shp: bytes) -> int:
    """Return the number of shapes in a file without its index."""
    count, numbers, at = 0, set[int](), HEADER
    while at + 8 <= len(shp):
        number, words = struct.unpack_from(">ii", shp, at)
        if words < 2 or at + 8 + 2 * words > len(shp):
            raise _Damaged(f"the .shp ends in the middle of shape {count + 1}")
        if number in numbers and number > 0:
            raise _Damaged(f"the .shp has shape {number} twice: the .shx states which one counts, and is missing")
        numbers.add(number)
        count, at = count + 1, at + 8 + 2 * words
    return count


def _count_indexed_shapes(shp: bytes, shx: bytes) -> int:
    index = list(struct.iter_unpack(">ii", shx[HEADER : HEADER + (len(shx) - HEADER) // 8 * 8]))
    for number, (offset, words) in enumerate(index, start=1):
        at, is_there = 2 * offset, HEADER <= 2 * offset <= len(shp) - 8 - 2 * words and words >= 2
        if not is_there or struct.unpack_from(">i", shp, at + 4)[0] != words:
            raise _Damaged(f"the .shx does not match the .shp: shape {number} is not where it states")
    return len(index)
