"""Names of shapefiles in whatever letters their programs have."""

from __future__ import annotations

from pathlib import Path

import pytest
import shapefile

from missions import NetworkError, NetworkImport, RemarkTopic, Selection, import_network
from missions.readers.archives import code_page_of
from tests.missions.readers.tagged import WGS84

NAME = "Žďár nad Řekou"


def written(folder: Path, encoding: str, *, byte: int = 0, cpg: str | None = None, name: str = NAME) -> Path:
    path = folder / "lines.shp"
    with shapefile.Writer(str(path), shapeType=shapefile.POLYLINE, encoding=encoding) as writer:
        writer.field("NAME", "C", 14)
        writer.line([[[15.6, 49.6], [15.602, 49.6]]])
        writer.record(name.encode(encoding)[:14].decode(encoding, "ignore"))
    table = path.with_suffix(".dbf")
    content = bytearray(table.read_bytes())
    content[29] = byte
    table.write_bytes(content)
    path.with_suffix(".prj").write_text(WGS84)
    path.with_suffix(".cpg").unlink(missing_ok=True)
    if cpg is not None:
        path.with_suffix(".cpg").write_text(cpg)
    return path


def names_of(understood: NetworkImport) -> set[str]:
    return set(understood.lines.values())


@pytest.mark.parametrize(
    ("encoding", "byte", "cpg"),
    [
        ("cp1250", 0xC8, None), ("cp852", 0x64, None), ("cp1250", 0, "1250"), ("cp1250", 0x57, "ANSI 1250"),
        ("iso8859-2", 0, "88592"), ("iso8859-2", 0, "ISO 8859-2"), ("cp1250", 0x03, "LDID/200"),
        ("cp1250", 0, "windows-1250"), ("mac_latin2", 0x97, None),
    ],
)  # fmt: skip
def test_names_are_read_by_the_code_page_that_the_file_says(
    encoding: str, byte: int, cpg: str | None, tmp_path: Path
) -> None:
    understood = import_network(written(tmp_path, encoding, byte=byte, cpg=cpg), anywhere=True)
    assert names_of(understood) == {NAME}
    assert understood.found == ()


@pytest.mark.parametrize("cpg", [None, "UTF-8", "65001", "utf8\r\n"])
def test_utf_8_needs_no_word_even_where_a_field_ends_within_a_letter(cpg: str | None, tmp_path: Path) -> None:
    understood = import_network(written(tmp_path, "utf-8", byte=0x57, cpg=cpg, name="Příštpo-Žďárů"), anywhere=True)
    assert names_of(understood) == {"Příštpo-Ž"} or names_of(understood) == {"Příštpo-Žď"}
    assert understood.found == ()


@pytest.mark.parametrize(
    ("cpg", "words"),
    [
        (None, "names are in no code page that it states: read as {}, with names such as {}; encoding says another"),
        ("UTF-8", "names are not in utf-8, as it says: read as {}, with names such as {}; encoding says another"),
    ],
)
@pytest.mark.parametrize(
    ("encoding", "name"), [("cp1252", "Fürth-Süd"), ("cp1250", "Žďár-Šíře"), ("cp1251", "Київ-Мир")]
)
def test_what_is_guessed_is_reported(cpg: str | None, words: str, encoding: str, name: str, tmp_path: Path) -> None:
    understood = import_network(written(tmp_path, encoding, cpg=cpg, name=name), anywhere=True)
    assert names_of(understood) == {name}
    text = words.format(encoding, ", ".join(map(repr, name.split("-"))))
    assert [(one.matter, one.asset, one.text) for one in understood.found] == [(RemarkTopic.FILE, "lines.dbf", text)]


def test_the_user_may_set_the_encoding_of_a_shapefile(tmp_path: Path) -> None:
    path = written(tmp_path, "cp1250", byte=0x57, cpg="1252")
    understood = import_network(path, Selection(encoding="cp1250"), anywhere=True)
    assert (names_of(understood), understood.found) == ({NAME}, ())
    for encoding in ("cp9", "utf-8", "hex"):
        with pytest.raises(NetworkError, match=f"lines.shp: encoding: expected the table's own, .* got '{encoding}': "):
            import_network(path, Selection(encoding=encoding), anywhere=True)


@pytest.mark.parametrize("content", [b"", b"\x03" * 20, bytes(33), b"\xff" * 200])
def test_a_damaged_table_has_the_usual_letters(content: bytes) -> None:
    assert code_page_of(content, None, None)
