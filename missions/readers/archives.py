"""Files of limited size, and what is in archives: no bomb of a few kilobytes fills the memory."""

from __future__ import annotations

import io
import lzma
import zipfile
import zlib
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from missions.errors import MissionsError, NetworkError
from missions.files import NESTED, to_printable

MOST_BYTES = 256_000_000
"""Of a file, and of all that an archive unpacks to."""
NEEDS = "needs the extra geo: pip install openpyxl pyshp"
"""What is said of a workbook or a shapefile where nothing is installed to read it with."""
UNREADABLE = (
    zipfile.BadZipFile, zlib.error, lzma.LZMAError, EOFError, RuntimeError, NotImplementedError, ValueError, OSError,
)  # fmt: skip
"""What zipfile raises for a member that is damaged, locked, or packed in a way that nobody knows."""
MOST_MEMBERS = 10_000
MOST_RATIO = 200
"""A member that unpacks to more than so many times its size is a bomb, or empty space."""
RATIO_FROM_BYTES = 10_000_000
PACKED = "a file that is packed ({}): unpack it first"
FOREIGN = {
    b"\xd0\xcf\x11\xe0\xa1\xb1\x1a\xe1": "an old Excel file (.xls), or one with a password: save it as .xlsx or as CSV",
    b"\x1f\x8b": PACKED.format("gzip"),
    b"BZh": PACKED.format("bzip2"),
    b"\xfd7zXZ\x00": PACKED.format("xz"),
    b"\x28\xb5\x2f\xfd": PACKED.format("Zstandard"),
    b"7z\xbc\xaf\x27\x1c": PACKED.format("7-Zip"),
    b"Rar!": PACKED.format("RAR"),
    b"%PDF": "a PDF, which is a picture of a map",
    b"\x89PNG": "a picture (PNG)",
    b"\xff\xd8\xff": "a picture (JPEG)",
    b"II*\x00": "a picture or a raster (TIFF)",
    b"MM\x00*": "a picture or a raster (TIFF)",
    b"AC10": "a drawing of AutoCAD (DWG): export it as KML, GeoPackage or a shapefile",
    b"PAR1": "GeoParquet: export it as a GeoPackage or GeoJSON",
    b"fgb\x03": "FlatGeobuf: export it as a GeoPackage or GeoJSON",
    b"!table": "a MapInfo table: export it as a GeoPackage or a shapefile",
    b"\x37\x7f\x06\x82": "the -wal file of a database: name the database beside it",
    b"\x37\x7f\x06\x83": "the -wal file of a database: name the database beside it",
    b"version https://": "a pointer of Git LFS: fetch the file itself",
}
"""What begins otherwise than anything that is read, and what people do about it."""


def read_first_bytes(path: Path) -> bytes:
    """Return the first 16 bytes of a file.

    Raises:
        NetworkError: it cannot be read, or is of a kind that is not read anywhere.
    """
    if path.exists() and not path.is_file() and not path.is_dir():
        raise NetworkError("file: expected a readable network file: it is a device or a pipe")
    try:
        with path.open("rb") as file:
            begin = file.read(16)
    except OSError as reason:
        raise NetworkError(f"file: expected a readable network file: {reason.strerror}") from reason
    for magic, words in FOREIGN.items():
        if begin.startswith(magic):
            raise NetworkError(f"content: expected a map's data, got {words}")
    return begin


def read_limited(path: Path) -> bytes:
    """Return the content of a file that can be read.

    Raises:
        NetworkError: it is too large.
    """
    if path.stat().st_size > MOST_BYTES:
        raise NetworkError(f"file: expected at most {MOST_BYTES // 1_000_000} MB; cut out what is flown")
    return path.read_bytes()


@contextmanager
def naming_file(path: Path, error: type[MissionsError] = NetworkError) -> Iterator[None]:
    """Let what is wrong with a file's content be said of the file.

    Raises:
        MissionsError: of the type that is given, in one line that begins with the file's name.
    """
    try:
        yield
    except MissionsError as reason:
        text = str(reason)
        raise error(text if text.startswith(f"{path}: ") else f"{path}: {text}") from reason
    except RecursionError:
        raise error(f"{path}: content: {NESTED}") from None


class Archive:
    """A zip archive, of which nothing is unpacked that is not asked for."""

    def __init__(self, content: bytes) -> None:
        """Look into an archive.

        Raises:
            NetworkError: it is none, or unpacks to too much.
        """
        try:
            self._zip = zipfile.ZipFile(io.BytesIO(content))
            members = [member for member in self._zip.infolist() if not member.is_dir()]
        except (zipfile.BadZipFile, ValueError, NotImplementedError, OSError) as reason:
            raise NetworkError(f"content: expected a whole zip archive: {to_printable(str(reason))}") from reason
        if len(members) > MOST_MEMBERS:
            raise NetworkError(f"content: expected at most {MOST_MEMBERS} files in it, found {len(members)}")
        if sum(member.file_size for member in members) > MOST_BYTES:
            raise NetworkError(f"content: expected it to unpack to at most {MOST_BYTES // 1_000_000} MB")
        for member in members:
            if member.file_size > max(RATIO_FROM_BYTES, MOST_RATIO * member.compress_size):
                place = f"{to_printable(member.filename)}"
                raise NetworkError(f"{place}: expected a file that unpacks to at most {MOST_RATIO} times its size")
        # What macOS puts beside every file is none of ours.
        self.names = tuple(member.filename for member in members if not member.filename.startswith("__MACOSX/"))

    def list_by_suffix(self, suffix: str) -> tuple[str, ...]:
        """Return the files whose names end so, without regard to case."""
        return tuple(name for name in self.names if name.lower().endswith(suffix))

    def read(self, name: str) -> bytes:
        """Return the content of a file, never more than its size says.

        Raises:
            NetworkError: it is damaged or locked.
        """
        try:
            with self._zip.open(name) as file:
                return file.read(self._zip.getinfo(name).file_size)
        except UNREADABLE as reason:
            raise NetworkError(
                f"{to_printable(name)}: expected a whole file without a password: {to_printable(str(reason))}"
            ) from reason
