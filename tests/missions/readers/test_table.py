"""Tables as people keep them: a title above, a line named once for its poles, rows that a filter hides."""

from __future__ import annotations

from pathlib import Path

import openpyxl
import pytest

from missions import NetworkError, NetworkImport, Selection, import_network, parse_where

HEADER = ("line", "order", "pole", "lat", "lon", "kV")
POLES = [("V1", 1, "A", 49.6, 15.6, 110), ("", 2, "B", 49.6, 15.602, ""), ("", 3, "C", 49.6, 15.604, ""),
         ("V2", 1, "D", 49.61, 15.6, 22), ("", 2, "E", 49.61, 15.602, "")]  # fmt: skip


def csv_of(tmp_path: Path, *rows: tuple[object, ...], before: str = "", delimiter: str = ";", end: str = "\n") -> Path:
    path = tmp_path / "poles.csv"
    path.write_text(before + "\n".join(delimiter.join(map(str, row)) for row in rows) + end, encoding="utf-8")
    return path


def texts(understood: NetworkImport) -> list[str]:
    return [one.text for one in understood.found]


def test_a_line_that_is_named_once_for_a_group_of_poles_continues(tmp_path: Path) -> None:
    understood = import_network(csv_of(tmp_path, HEADER, *POLES), anywhere=True)
    assert [segment.label for segment in understood.network.segments] == ["V1.1", "V1.2", "V2.1"]
    assert texts(understood) == ["3 rows without the name of their line: taken for that of the line above them"]


def test_a_filter_goes_by_what_the_group_says_of_its_line(tmp_path: Path) -> None:
    path = csv_of(tmp_path, HEADER, *POLES)
    chosen = import_network(path, Selection(where=parse_where("kV >= 110 and line = V1")), anywhere=True)
    assert [segment.label for segment in chosen.network.segments] == ["V1.1", "V1.2"]


def test_what_the_group_says_of_its_line_is_true_of_all_its_poles_but_not_what_it_says_of_a_pole(
    tmp_path: Path,
) -> None:
    more = [("underground", ""), ("", ""), ("", ""), ("", "removed"), ("", ""), ("", "")]
    poles = [*POLES, ("", 3, "F", 49.61, 15.604, "")]
    rows = [(*pole, *own) for pole, own in zip(poles, more, strict=True)]
    understood = import_network(csv_of(tmp_path, (*HEADER, "location", "status"), *rows), anywhere=True)
    assert [pylon.id for pylon in understood.network.pylons] == ["E", "F"]
    left_out = "3 poles of an underground line (A, B, C), 1 removed pole (D)"
    assert left_out in texts(understood)


def test_a_group_that_starts_again_without_a_name_is_refused(tmp_path: Path) -> None:
    rows = [(*POLES[0],), (*POLES[1],), ("", 1, "X", 49.7, 15.6, "")]
    with pytest.raises(NetworkError, match="line 4: order: expected another than that of line 2, got 1 twice in line"):
        import_network(csv_of(tmp_path, HEADER, *rows), anywhere=True)


def test_what_excel_says_of_the_delimiter_is_no_row(tmp_path: Path) -> None:
    path = csv_of(tmp_path, HEADER, *POLES[:2], before="sep=|\n", delimiter="|")
    understood = import_network(path, anywhere=True)
    assert understood.network.segment_name(0) == "V1.1"


@pytest.mark.parametrize("title", ["Poles of V1, as of May\n", "Poles of V1\n\n;;;;;\nby: survey, 2026\n"])
def test_a_title_above_the_columns_is_reported_and_not_read(title: str, tmp_path: Path) -> None:
    understood = import_network(csv_of(tmp_path, HEADER, *POLES, before=title), anywhere=True)
    assert len(understood.network.segments) == 3
    assert texts(understood)[0].endswith(f"above the names of the columns, {title.splitlines()[0]!r}: not read")


def test_a_last_line_that_may_be_cut_off_is_reported_first(tmp_path: Path) -> None:
    header, rows = HEADER[:5], [row[:5] for row in POLES[:3]]
    whole = import_network(csv_of(tmp_path, header, *rows), anywhere=True)
    assert whole.found[0].matter.value == "the file itself"
    cut = import_network(csv_of(tmp_path, header, *rows[:2], (*rows[2][:4], "15."), end=""), anywhere=True)
    assert cut.found[0].matter.value == "is it whole"
    assert "line 4, the last, ends with '15.' and without an end of line" in cut.found[0].text


def workbook(tmp_path: Path, *rows: tuple[object, ...], hidden_row: int = 0, hidden_sheet: str = "") -> Path:
    book = openpyxl.Workbook()
    sheet = book.active
    assert sheet is not None
    for row in rows:
        sheet.append([None if cell == "" else cell for cell in row])
    if hidden_row:
        sheet.row_dimensions[hidden_row].hidden = True
    if hidden_sheet:
        book.create_sheet(hidden_sheet).sheet_state = "hidden"
    path = tmp_path / "poles.xlsx"
    book.save(path)
    return path


def test_a_workbook_with_a_title_merged_cells_and_hidden_rows_and_sheets(tmp_path: Path) -> None:
    path = workbook(tmp_path, ("Poles",), (), HEADER, *POLES, hidden_row=5, hidden_sheet="lists")
    understood = import_network(path, anywhere=True)
    assert [segment.label for segment in understood.network.segments] == ["V1.1", "V1.2", "V2.1"]
    assert texts(understood) == [
        "1 rows are hidden, as by a filter: they are read all the same",
        "a row above the names of the columns, 'Poles': not read",
        "3 rows without the name of their line: taken for that of the line above them",
    ]
