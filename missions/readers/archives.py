"""Read untrusted files of limited size, and archives, so that no decompression bomb fills the memory.

Also detect text encodings: tables are in UTF-8, UTF-16 or an unnamed Windows code page, which is guessed. A shapefile
declares its own in its .cpg, or by a byte of its .dbf.
"""

from __future__ import annotations

import codecs
import io
import lzma
import math
import re
import struct
import zipfile
import zlib
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path

from missions.errors import MissionsError, NetworkError
from missions.files import NESTED, to_printable

MOST_BYTES = 256_000_000
"""Greatest size of a file, and of everything unpacked from an archive."""
NEEDS = "needs the extra geo: pip install openpyxl pyshp"
"""Message if no library is installed to read a workbook or a shapefile."""
UNREADABLE = (
    zipfile.BadZipFile, zlib.error, lzma.LZMAError, EOFError, RuntimeError, NotImplementedError, ValueError, OSError,
)  # fmt: skip
"""Errors of zipfile for a member that is damaged, encrypted, or packed by an unknown method."""
MOST_MEMBERS = 10_000
MOST_RATIO = 200
"""Compression ratio above which a member is a bomb, or empty space."""
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
    b"\x37\x7f\x06\x82": "the -wal file of a database: name the database next to it",
    b"\x37\x7f\x06\x83": "the -wal file of a database: name the database next to it",
    b"version https://": "a pointer of Git LFS: fetch the file itself",
}
"""Signatures of unsupported formats, and advice for each."""
MARKS = ((codecs.BOM_UTF8, "utf-8-sig"), (codecs.BOM_UTF16_LE, "utf-16"), (codecs.BOM_UTF16_BE, "utf-16"))
LETTERS: Mapping[str, Sequence[str]] = {
    "cp1252": (
        "üäöß", "éèàêçôâîûùïëœæüÿ", "óíáéñúüªº", "ãçáéíóêâõúàªº", "èàòùéìíó", "äåöéšž", "åøæéöäü", "áíðéöóúþýæ",
        "ëéïóöüèá", "àèéíóòçúïü·",
    ),
    "cp1250": (
        "íáěéřčžýšůúóňďť", "áíčéýžšťúľňôóďäŕĺ", "łążęóśćńź", "áéöóőíüúű", "čšžćđ", "ăîâşţ", "üäöß", "ëç",
    ),
    "cp1257": ("āīēšžļņķūčģ", "ėšžųįūčęą", "õäüöšž"),
    "cp1254": ("ıüşçğöâîû",),
    "cp1251": (
        "оеаинтсрвлкмдпуяыьгзбчйхжшюцщэфъё", "оанівиертслкдупмязьбгйчхцжіїшющєґф", "аоиенртсвкудмјлпзгшбчцћхжњљђфџ",
    ),
    "cp1253": ("αοιετσνρκπμλςυδγήάόίθώέχφβύηωξζψϊϋΐΰ",),
}  # fmt: skip
"""European code pages, and for each its languages' non-ASCII letters, the most frequent first."""
APART = ("cp1251", "cp1253")
"""Code pages in which no word mixes the page's own letters with ASCII letters."""
SIGNS = frozenset("°±§©®«»„“”‚‘’‹›–—…·•€£µ²³½¼¾\u00a0№")
_WORD = re.compile(r"[^\W\d_]+")
_CONTROL = re.compile(rb"[\x00-\x08\x0e-\x1f]")
MOST_WORDS = 3
SIGN, NEVER = 0.02, 1e-4
"""Probabilities of a common sign among letters, and of a letter that a language does not have."""
AT = 29
"""Offset of the code page in a .dbf."""
PAGES: Mapping[int, str] = {
    0x01: "cp437", 0x02: "cp850", 0x03: "cp1252", 0x04: "mac_roman", 0x08: "cp865", 0x09: "cp437", 0x0A: "cp850",
    0x0B: "cp437", 0x0D: "cp437", 0x0E: "cp850", 0x0F: "cp437", 0x10: "cp850", 0x11: "cp437", 0x12: "cp850",
    0x13: "cp932", 0x14: "cp850", 0x15: "cp437", 0x16: "cp850", 0x17: "cp865", 0x18: "cp437", 0x19: "cp437",
    0x1A: "cp850", 0x1B: "cp437", 0x1C: "cp863", 0x1D: "cp850", 0x1F: "cp852", 0x22: "cp852", 0x23: "cp852",
    0x24: "cp860", 0x25: "cp850", 0x26: "cp866", 0x37: "cp850", 0x40: "cp852", 0x4D: "cp936", 0x4E: "cp949",
    0x4F: "cp950", 0x50: "cp874", 0x58: "cp1252", 0x59: "cp1252", 0x64: "cp852", 0x65: "cp866", 0x66: "cp865",
    0x67: "cp861", 0x6A: "cp737", 0x6B: "cp857", 0x6C: "cp863", 0x78: "cp950", 0x79: "cp949", 0x7A: "cp936",
    0x7B: "cp932", 0x7C: "cp874", 0x7D: "cp1255", 0x7E: "cp1256", 0x86: "cp737", 0x87: "cp852", 0x88: "cp857",
    0x96: "mac_cyrillic", 0x97: "mac_latin2", 0x98: "mac_greek", 0xC8: "cp1250", 0xC9: "cp1251", 0xCA: "cp1254",
    0xCB: "cp1253", 0xCC: "cp1257",
}  # fmt: skip
"""Code pages of dBASE, FoxPro and ArcGIS. 0x57 means the writer's system code page, which is unknown."""
USUAL = "utf-8"
OTHER_ENCODING = "encoding: expected the table's own, such as 'cp1250' or 'utf-16', got {!r}"
FIELD_BYTES = 32
FIELDS_END = 0x0D


def read_first_bytes(path: Path) -> bytes:
    """Return the first 16 bytes of a file.

    Raises:
        NetworkError: it cannot be read, or has an unsupported format.
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
    """Return the content of a readable file.

    Raises:
        NetworkError: it is too large.
    """
    if path.stat().st_size > MOST_BYTES:
        raise NetworkError(f"file: expected at most {MOST_BYTES // 1_000_000} MB; cut out what is flown")
    return path.read_bytes()


@contextmanager
def naming_file(path: Path, error: type[MissionsError] = NetworkError) -> Iterator[None]:
    """Add the file's name to errors on its content.

    Raises:
        MissionsError: of the given type, in one line that begins with the file's name.
    """
    try:
        yield
    except MissionsError as reason:
        text = str(reason)
        raise error(text if text.startswith(f"{path}: ") else f"{path}: {text}") from reason
    except RecursionError:
        raise error(f"{path}: content: {NESTED}") from None


@contextmanager
def explaining_errors(
    words: str, *errors: type[Exception], error: type[MissionsError] = NetworkError
) -> Iterator[None]:
    """Convert library errors to our own, with the original text appended.

    Raises:
        MissionsError: of the given type, in one line.
    """
    try:
        yield
    except errors as reason:
        raise error(f"{words}: {to_printable(str(reason))}") from reason


class Archive:
    """A zip archive; members are unpacked on request only."""

    def __init__(self, content: bytes) -> None:
        """Open an archive and list its members.

        Raises:
            NetworkError: it is not an archive, or unpacks to too much.
        """
        with explaining_errors("content: expected a whole zip archive", *UNREADABLE):
            self._zip = zipfile.ZipFile(io.BytesIO(content))
            members = [member for member in self._zip.infolist() if not member.is_dir()]
        if len(members) > MOST_MEMBERS:
            raise NetworkError(f"content: expected at most {MOST_MEMBERS} files in it, found {len(members)}")
        if sum(member.file_size for member in members) > MOST_BYTES:
            raise NetworkError(f"content: expected it to unpack to at most {MOST_BYTES // 1_000_000} MB")
        for member in members:
            if member.file_size > max(RATIO_FROM_BYTES, MOST_RATIO * member.compress_size):
                place = f"{to_printable(member.filename)}"
                raise NetworkError(f"{place}: expected a file that unpacks to at most {MOST_RATIO} times its size")
        # Ignore the metadata that macOS adds for every file.
        self.names = tuple(member.filename for member in members if not member.filename.startswith("__MACOSX/"))

    def list_by_suffix(self, suffix: str) -> tuple[str, ...]:
        """Return the files with a suffix, ignoring case."""
        return tuple(name for name in self.names if name.lower().endswith(suffix))

    def read(self, name: str) -> bytes:
        """Return the content of a file, never more than its declared size.

        Raises:
            NetworkError: it is damaged or encrypted.
        """
        words = f"{to_printable(name)}: expected a whole file without a password"
        with explaining_errors(words, *UNREADABLE), self._zip.open(name) as file:
            return file.read(self._zip.getinfo(name).file_size)


def decode_table(content: bytes, encoding: str | None) -> tuple[str, str]:
    """Return the decoded text, and a remark on its encoding; empty for UTF-8 or a declared encoding.

    Args:
        content: The file's bytes.
        encoding: The user's setting; None to detect it.

    Raises:
        NetworkError: it is unknown, or does not match the bytes.
    """
    marked = next((mark for begin, mark in MARKS if content.startswith(begin)), None)
    if marked is not None or encoding is not None:
        return _decode_as(content, marked or str(encoding)), ""
    if content[:2].count(b"\x00") == 1:
        mark = "utf-16-le" if content[1] == 0 else "utf-16-be"
        return _decode_as(content, mark), f"no encoding is stated: read as {mark}"
    try:
        return content.decode("utf-8"), ""
    except UnicodeDecodeError as reason:
        if _CONTROL.search(content):
            raise NetworkError(f"encoding: expected text, found other bytes at {reason.start}") from reason
    page, names = guess_code_page(content)
    return content.decode(page, "replace"), f"no encoding is stated: read as {page}{names}; encoding says another"


def _decode_as(content: bytes, encoding: str) -> str:
    with explaining_errors(OTHER_ENCODING.format(encoding), LookupError, ValueError):
        return content.decode(encoding)


def guess_code_page(content: bytes) -> tuple[str, str]:
    """Return the code page with the most likely letters in one of its languages, and examples of decoded words."""
    page = max(LETTERS, key=lambda one: _log_likelihood(content.decode(one, "replace"), one))
    text = content.decode(page, "replace")
    names = list(dict.fromkeys(word for word in _WORD.findall(text) if not word.isascii()))[:MOST_WORDS]
    return page, f", with names such as {', '.join(map(repr, names))}" if names else ""


def _log_likelihood(text: str, page: str) -> float:
    """Return the log-likelihood of a text in the best-fitting language of a code page."""
    signs = sum(
        math.log(SIGN if letter in SIGNS else NEVER) for letter in text if not (letter.isascii() or letter.isalpha())
    )
    words = [word.replace("İ", "i").lower() for word in _WORD.findall(text) if not word.isascii()]
    odd = [word for word in words if page in APART and any(map(str.isascii, word))]
    letters = Counter(letter for word in words for letter in word if not letter.isascii())
    return signs + len(odd) * math.log(NEVER) + max(_log_likelihood_in(letters, own) for own in LETTERS[page])


def _log_likelihood_in(letters: Counter[str], own: str) -> float:
    """Return the log-likelihood of letters in a language: the second is half as likely as the first (Zipf)."""
    of_all = sum(1.0 / rank for rank in range(1, len(own) + 1))
    shares = {letter: 1.0 / rank / of_all for rank, letter in enumerate(own, start=1)}
    return sum(count * math.log(shares.get(letter, NEVER)) for letter, count in letters.items())


def code_page_of(dbf: bytes, cpg: bytes | None, encoding: str | None) -> tuple[str, str]:
    """Return Python's name of a table's encoding, and a remark on it; empty if the file declares it.

    Args:
        dbf: The table.
        cpg: The file that declares its encoding, if present.
        encoding: The user's setting; None to use the files.

    Raises:
        NetworkError: the setting is unknown, or does not match the names.
    """
    texts = [text for text in _iterate_texts(dbf) if not text.isascii()]
    if encoding is not None:
        with explaining_errors(OTHER_ENCODING.format(encoding), LookupError, ValueError):
            _check_letters(texts, encoding)
        return encoding, ""
    by_cpg, by_dbf = _parse_cpg(cpg), PAGES.get(dbf[AT] if len(dbf) > AT else 0)
    told = [page for page in (by_cpg, by_dbf) if page is not None]
    fitting = next((page for page in (*told, USUAL) if _is_encoding_of(texts, page)), None)
    if fitting == (told or [USUAL])[0]:
        return fitting, ""
    fitting, names = (fitting, "") if fitting is not None else guess_code_page(b"\n".join(texts))
    wrong = f"names are not in {told[0]}, as it says" if told else "names are in no code page that it states"
    return fitting, f"{wrong}: read as {fitting}{names}; encoding says another"


def _is_encoding_of(texts: Sequence[bytes], encoding: str) -> bool:
    try:
        _check_letters(texts, encoding)
    except ValueError:
        return False
    return True


def _check_letters(texts: Sequence[bytes], encoding: str) -> None:
    """Refuse an encoding that does not match the texts; a full field may end within a character."""
    b"abcd".decode(encoding)  # some codecs are not text encodings
    for text in texts:
        codecs.getincrementaldecoder(encoding)("strict").decode(text, False)


def _parse_cpg(cpg: bytes | None) -> str | None:
    """Return Python's name of a .cpg's encoding: UTF-8, 1250, 'ANSI 1250', 88592, LDID/200; None if unknown."""
    if cpg is None:
        return None
    said = to_printable(cpg.decode("ascii", "replace").lstrip("\ufeff")).strip("\ufffd ").lower()
    if (ldid := re.fullmatch(r"ldid/(\d+)", said)) is not None:
        return PAGES.get(int(ldid[1]))
    number = re.fullmatch(r"(?:ansi|oem|windows|cp|ibm)?[ _-]*(\d{3,5})", said)
    if number is not None:
        said = USUAL if number[1] == "65001" else re.sub(r"^8859-?(\d+)$", r"iso8859-\1", number[1])
        said = f"cp{said}" if said.isdigit() else said
    said = re.sub(r"^iso[ _-]*8859[ _-]*(\d+)$", r"iso8859-\1", said)
    try:
        return codecs.lookup(said).name
    except (LookupError, ValueError):
        return None


def _iterate_texts(dbf: bytes) -> Iterator[bytes]:
    """Yield the names of a table's columns and its texts; of a damaged table as far as it is readable."""
    try:
        count, head, length = struct.unpack_from("<IHH", dbf, 4)
        fields, at, offset = [], FIELD_BYTES, 1
        while at + FIELD_BYTES <= head and dbf[at] != FIELDS_END:
            yield dbf[at : at + 11].partition(b"\0")[0]
            width = dbf[at + 16]
            if dbf[at + 11 : at + 12] == b"C":
                fields.append((offset, width))
            offset, at = offset + width, at + FIELD_BYTES
    except (struct.error, IndexError):
        return
    for start in range(head, min(head + count * length, len(dbf)), max(length, 1)):
        row = dbf[start : start + length]
        if not row.isascii():
            yield from (row[offset : offset + width].rstrip(b"\0 ") for offset, width in fields)
