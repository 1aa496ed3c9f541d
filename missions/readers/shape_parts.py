"""The three files of a shapefile that belong together: .shp, .shx and .dbf, of one state or of several.

Programs that change a shape in place write it at the end of the .shp, where only the .shx points, and mark what was
deleted in the .dbf alone: which shapes there are, and in which order, all three say together.
"""

from __future__ import annotations

import struct

HEADER = 100
DELETED = b"*"


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
