"""Shapefiles, one by its .shp or several in a zip archive, of any reference system that a .prj names.

The .shp, .shx and .dbf belong together. Programs that change a shape in place write it at the end of the .shp, where
only the .shx points, and mark what was deleted in the .dbf alone: which shapes there are, and in which order, all three
say together.
"""

from __future__ import annotations

import io
import itertools
import struct
import warnings
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from importlib.util import find_spec
from pathlib import Path, PurePosixPath
from typing import TYPE_CHECKING

from missions.errors import NetworkError
from missions.files import to_printable
from missions.readers.archives import NEEDS, Archive, read_limited
from missions.readers.code_pages import code_page_of
from missions.readers.features import (
    EMPTY,
    OTHER,
    Feature,
    GeometryKind,
    SourceLayer,
    add_layers,
)
from missions.readers.raw_network import RawNetwork, ReadOptions, Remark, RemarkTopic

if TYPE_CHECKING:
    import shapefile

FORMAT = "Shapefile"
MAGIC = b"\x00\x00\x27\x0a"
PARTS = ("shp", "shx", "dbf", "prj", "cpg")
KINDS = {1: GeometryKind.POINT, 8: GeometryKind.POINT, 3: GeometryKind.LINE}
"""Shape types without their dimensions; 11 and 21 are 1 with z and with a measure, and so on."""
HEADER = 100
DELETED = b"*"


@dataclass(frozen=True, slots=True)
class _Shapes:
    """The files of one layer, as far as they are there."""

    name: str
    files: Mapping[str, bytes]


def read_shapefile(path: Path, choice: ReadOptions) -> RawNetwork:
    """Return what the shapefile beside whose .shp the others lie shows.

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
    return _read_layers([_Shapes(path.stem, files)], choice)


def read_zipped_shapes(archive: Archive, choice: ReadOptions) -> RawNetwork:
    """Return what the shapefiles of an archive show.

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
        every.append(_Shapes(to_printable(PurePosixPath(stem).name), files))
    return _read_layers(every, choice)


def _read_layers(every: list[_Shapes], choice: ReadOptions) -> RawNetwork:
    if find_spec("shapefile") is None:
        raise NetworkError(f"a shapefile {NEEDS}")
    drawing = choice.create_raw_network(FORMAT)
    with warnings.catch_warnings(record=True) as warned:
        warnings.simplefilter("always")
        add_layers(drawing, [_open_layer(shapes, drawing, choice) for shapes in every], choice)
    said = dict.fromkeys(to_printable(str(one.message)) for one in warned)
    drawing.found += [Remark(RemarkTopic.FILE, FORMAT, words) for words in said]
    return drawing


def _open_layer(shapes: _Shapes, drawing: RawNetwork, choice: ReadOptions) -> SourceLayer:
    import shapefile

    if "dbf" not in shapes.files:
        raise NetworkError(f"{shapes.name}.dbf: expected the names and attributes beside the .shp")
    try:
        shp = rebuild_shp(shapes.files["shp"], shapes.files.get("shx"), shapes.files["dbf"])
    except (PartError, struct.error) as reason:
        raise NetworkError(f"{shapes.name}: expected a whole shapefile: {reason}") from reason
    encoding, words = code_page_of(shapes.files["dbf"], shapes.files.get("cpg"), choice.encoding)
    if words:
        drawing.found.append(Remark(RemarkTopic.FILE, f"{shapes.name}.dbf", words))
    try:
        reader = shapefile.Reader(
            shp=io.BytesIO(shp), dbf=io.BytesIO(shapes.files["dbf"]), encoding=encoding, encodingErrors="replace",
        )  # fmt: skip
    except (shapefile.ShapefileException, struct.error, ValueError, LookupError, OSError, TypeError) as reason:
        raise NetworkError(f"{shapes.name}: expected a shapefile: {to_printable(str(reason))}") from reason
    system = shapes.files.get("prj", b"").decode("utf-8-sig", "replace").strip()
    features = _iterate_features(reader, shapes.name)
    return SourceLayer(shapes.name, _kind_of(reader.shapeType), len(reader), features, system, f"{shapes.name}.prj")


def _kind_of(shape_type: int) -> GeometryKind:
    return KINDS.get(shape_type % 10, GeometryKind.OTHER)


def _iterate_features(reader: shapefile.Reader, layer: str) -> Iterator[Feature]:
    import shapefile

    number = 0
    try:
        for number, found in enumerate(reader.iterShapeRecords(), start=1):
            shape, place = found.shape, f"layer {layer!r} feature {number}"
            kind = _kind_of(shape.shapeType)
            if shape.shapeType == shapefile.NULL or kind is GeometryKind.OTHER:
                other = EMPTY if shape.shapeType == shapefile.NULL else OTHER
                yield Feature(place, GeometryKind.OTHER, (), found.record.as_dict(), other=other)
                continue
            heights = getattr(shape, "z", None) or [None] * len(shape.points)
            positions = [(float(point[0]), float(point[1]), third_m) for point, third_m in
                         zip(shape.points, heights, strict=False)]  # fmt: skip
            starts = (
                [*getattr(shape, "parts", [0]), len(positions)] if kind is GeometryKind.LINE else [0, len(positions)]
            )
            parts = [positions[a:b] for a, b in itertools.pairwise(starts)]
            yield Feature(place, kind, parts, found.record.as_dict())
    except (
        shapefile.ShapefileException,
        struct.error,
        ValueError,
        IndexError,
        TypeError,
        OSError,
        AssertionError,
    ) as reason:
        place = f"layer {layer!r} feature {number + 1}"
        raise NetworkError(
            f"{place}: expected a whole shape and its attributes: {to_printable(str(reason))}"
        ) from reason


class PartError(Exception):
    """One of the files is cut off, or of another state than the others."""


def rebuild_shp(shp: bytes, shx: bytes | None, dbf: bytes) -> bytes:
    """Return a .shp with the shapes that count, one behind the other, as many as the .dbf has rows not deleted.

    Raises:
        PartError: one of the files is cut off, or of another state than the others.
        struct.error: one is shorter than its header.
    """
    (length,) = struct.unpack_from(">i", shp, 24)
    if 2 * length > len(shp):
        raise PartError(f"the .shp ends after {len(shp)} of {2 * length} bytes")
    shapes = _read_all_shapes(shp) if shx is None else _read_indexed_shapes(shp, shx)
    rows = _find_kept_rows(dbf)
    if len(rows) != len(shapes):
        raise PartError(
            f"the .dbf has {len(rows)} rows and the .{'shp' if shx is None else 'shx'} {len(shapes)} shapes"
        )
    kept = [shape for shape, is_kept in zip(shapes, rows, strict=True) if is_kept]
    body = b"".join(struct.pack(">ii", number, len(shape) // 2) + shape for number, shape in enumerate(kept, 1))
    return shp[:24] + struct.pack(">i", (HEADER + len(body)) // 2) + shp[28:HEADER] + body


def _read_all_shapes(shp: bytes) -> list[bytes]:
    """Return the shapes of a file without its index."""
    found: list[bytes] = []
    numbers, at = set[int](), HEADER
    while at + 8 <= len(shp):
        number, words = struct.unpack_from(">ii", shp, at)
        if words < 2 or at + 8 + 2 * words > len(shp):
            raise PartError(f"the .shp ends in the middle of shape {len(found) + 1}")
        if number in numbers and number > 0:
            raise PartError(f"the .shp has shape {number} twice: which one counts says the .shx, which is missing")
        numbers.add(number)
        found.append(shp[at + 8 : at + 8 + 2 * words])
        at += 8 + 2 * words
    return found


def _read_indexed_shapes(shp: bytes, shx: bytes) -> list[bytes]:
    (length,) = struct.unpack_from(">i", shx, 24)
    if 2 * length > len(shx):
        raise PartError(f"the .shx ends after {len(shx)} of {2 * length} bytes")
    found: list[bytes] = []
    for number, (offset, words) in enumerate(
        struct.iter_unpack(">ii", shx[HEADER : HEADER + (len(shx) - 100) // 8 * 8])
    ):
        at = 2 * offset
        if (
            at < HEADER
            or words < 2
            or at + 8 + 2 * words > len(shp)
            or (struct.unpack_from(">i", shp, at + 4)[0] != words)
        ):
            raise PartError(f"the .shx is of another state than the .shp: shape {number + 1} is not where it says")
        found.append(shp[at + 8 : at + 8 + 2 * words])
    return found


def _find_kept_rows(dbf: bytes) -> list[bool]:
    """Return of every row whether it is there, or only marked as deleted."""
    count, header, wide = struct.unpack_from("<LHH", dbf, 4)
    if wide < 1 or header + count * wide > len(dbf):
        raise PartError(f"the .dbf ends after {max(0, len(dbf) - header) // max(1, wide)} of {count} rows")
    return [dbf[header + row * wide : header + row * wide + 1] != DELETED for row in range(count)]
