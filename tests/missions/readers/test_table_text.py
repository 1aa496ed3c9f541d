"""Tables in the encodings of Europe: what a program did not say is tried, and what was taken is said."""

from __future__ import annotations

from pathlib import Path

import pytest

from missions import NetworkError, Selection, import_network
from missions.readers.archives import decode_table

NAMES = {
    "cp1250": ("Příbram;Týniště nad Orlicí", "Łódź;Częstochowa", "Győr;Székesfehérvár", "Brašov;Bacău", "Čačak;Užice"),
    "cp1252": (
        "Bjørnøya;Ålesund",
        "Forêt;Château d'Été",
        "São João;Evangelização",
        "España;Línea Ñuñoa",
        "Þingvellir;Ísafjörður",
        "Groß Söhl",
    ),
    "cp1251": ("Столб 1;Москва", "ВЛ Київ"),
    "cp1253": ("Αθήνα;γραμμή",),
    "cp1254": ("İstanbul;Iğdır",),
    "cp1257": ("Šiauliai;Ąžuolų",),
}


@pytest.mark.parametrize(("page", "names"), [(page, names) for page, own in NAMES.items() for names in own])
def test_a_code_page_is_tried_by_the_letters_of_its_languages(page: str, names: str) -> None:
    text, remark = decode_table(names.encode(page), None)
    assert text == names
    assert remark.startswith(f"no encoding is stated: read as {page}, with names such as ")


def table(name: str) -> str:
    return f"line;order;lat;lon\r\n{name};1;49,6;15,6\r\n{name};2;49,6;15,602\r\n"


@pytest.mark.parametrize(("encoding", "is_said"), [("utf-8-sig", True), ("utf-16", True), ("utf-16-le", False)])
def test_what_excel_calls_unicode_is_read(encoding: str, is_said: bool, tmp_path: Path) -> None:
    path = tmp_path / "a.csv"
    path.write_bytes(table("Žďár").encode(encoding))
    understood = import_network(path, anywhere=True)
    assert set(understood.lines.values()) == {"Žďár"}
    assert [one.text for one in understood.found] == ([] if is_said else ["no encoding is stated: read as utf-16-le"])


def test_the_user_may_set_the_encoding(tmp_path: Path) -> None:
    path = tmp_path / "a.csv"
    path.write_bytes(table("Ole\xe8").encode("latin-1"))
    said = {
        encoding: import_network(path, Selection(encoding=encoding), anywhere=True) for encoding in ("cp1250", "cp1252")
    }
    assert [set(one.lines.values()) for one in said.values()] == [{"Oleč"}, {"Oleè"}]
    assert [one.found for one in said.values()] == [(), ()]


def test_bytes_of_no_text_are_refused(tmp_path: Path) -> None:
    path = tmp_path / "a.csv"
    path.write_bytes(b"\xa3\x95\x80\x01\x02\xff")
    with pytest.raises(NetworkError, match=r"a\.csv: encoding: expected text, found other bytes at 0"):
        import_network(path, anywhere=True)
