"""Read tables of poles, CSV or XLSX: one pole per row, and a column that defines their order.

Columns are named in the first row, ignoring case: ``order`` (or seq, sequence), ``lat`` and ``lon`` in WGS 84 or
``easting`` and ``northing`` with ``crs`` given, ``id`` (or name, pole, ...), ``line`` (or circuit) if there are
several, ``elevation_m`` and ``height_m``. A pole of two lines has a row in each, with the same name and place.
"""

from __future__ import annotations

import csv
import io
import itertools
import re
import warnings
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

from missions.errors import NetworkError
from missions.files import is_figure, to_printable
from missions.readers import values
from missions.readers.archives import NEEDS, UNREADABLE, Archive, explaining_errors
from missions.readers.attributes import (
    ELEVATION,
    HEIGHT,
    LINES,
    POLES,
    PowerFeature,
    classify_row,
    find_first_value,
    flatten_attributes,
    heights_of,
    name_of,
    normalise_attributes,
)
from missions.readers.features import IDENTITY, Wgs84Transform, build_wgs84_transform
from missions.readers.raw_network import Line, Pole, RawNetwork, ReadOptions, Remark, RemarkTopic, quote_names

CSV, XLSX = "CSV", "XLSX"
ORDER = ("order", "seq", "sequence", "position", "nr", "no")
LAT, LON = ("lat", "latitude", "lat_deg"), ("lon", "lng", "long", "longitude", "lon_deg")
EAST, NORTH = ("easting", "east", "x", "e"), ("northing", "north", "y", "n")
DELIMITERS = ";\t|,"
MOST_ROWS = 500_000
MOST_ABOVE = 30
"""Most rows, e.g. with a title, above the row of column names."""
_SAID = re.compile(r"\ufeff?\"?sep=(.)\"?\s*", re.IGNORECASE)
"""Excel's separator declaration in the first line of a file."""
_HIDDEN = re.compile(rb'<row\b[^>]*\bhidden="(?:1|true)"')
LEFT = {PowerFeature.UNBUILT_POLE, PowerFeature.REMOVED_POLE, PowerFeature.DELETED}
"""Poles that the wires between their neighbours pass over."""


@dataclass(frozen=True, slots=True)
class _Row:
    place: str
    cells: dict[str, object]


@dataclass(frozen=True, slots=True)
class _Member:
    order: values.PoleRank
    row: _Row
    x: float
    y: float
    is_pole: bool = True
    is_buried: bool = False


def is_pole_table(text: str) -> bool:
    """Return whether one of the first lines of a text has the columns of a table of poles."""
    return _detect_delimiter(text)[1]


def parse_csv(text: str, choice: ReadOptions, *, remark: str = "") -> RawNetwork:
    """Return the content of a table in a text file, separated by comma, semicolon, tab or bar.

    Args:
        text: The file's text.
        choice: The part to read.
        remark: Remark on the text's encoding.

    Raises:
        NetworkError: one line that names the file, the row and what was expected.
    """
    choice.refuse_layers(CSV)
    (delimiter, _), found = _detect_delimiter(text), [Remark(RemarkTopic.FILE, CSV, remark)] if remark else []
    try:
        reader = csv.reader(io.StringIO(text.lstrip("\ufeff"), newline=None), delimiter=delimiter, strict=True)
        rows = [(f"line {reader.line_num}", row) for row in reader]
    except csv.Error as reason:
        words = "a quote that is not closed" if "end of data" in str(reason) else str(reason)
        raise NetworkError(f"line {reader.line_num}: expected a table: {words}") from reason
    rows = rows[1:] if _SAID.fullmatch(text.partition("\n")[0]) else rows
    table = _find_table(rows, CSV, found)
    if rows and not text.endswith(("\n", "\r")):
        _check_end(table, choice.source, found)
    return _build_raw_network(table, CSV, choice, found)


def _check_end(table: Sequence[tuple[str, Sequence[object]]], source: str, found: list[Remark]) -> None:
    """Check whether the file was truncated in its last line."""
    (place, last), others = table[-1], [row for _, row in table[1:-1]]
    if len(last) < len(table[0][1]):
        raise NetworkError(
            f"{place}: expected {len(table[0][1])} cells as in the first row, got {len(last)}: the file ends "
            "in the middle of a line"
        )
    lengths = [len(str(row[-1]).strip()) for row in others if len(row) == len(last)]
    if len(table) > 1 and lengths and len(str(last[-1]).strip()) < min(lengths):
        text = f"{place}, the last, ends with {str(last[-1])!r} and without an end of line: was the file cut off there?"
        found.append(Remark(RemarkTopic.WHOLE, source, text))


def parse_xlsx(archive: Archive, content: bytes, choice: ReadOptions) -> RawNetwork:
    """Return the content of a workbook's sheet: the requested one, else the only one.

    Raises:
        NetworkError: as for `parse_csv`; or no library is installed to read it.
    """
    try:
        import openpyxl
        from openpyxl.utils.exceptions import InvalidFileException
    except ImportError:
        raise NetworkError(f"a workbook {NEEDS}") from None
    for name in archive.list_by_suffix(".xml"):
        if b"<!DOCTYPE" in archive.read(name)[:4096]:
            raise NetworkError(f"{name}: expected XML without a document type (DOCTYPE)")
    reasons = *UNREADABLE, InvalidFileException, SyntaxError, KeyError, TypeError, AttributeError, IndexError
    with explaining_errors("content: expected a workbook", *reasons):
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # on styles and extensions that are not read
            book = openpyxl.load_workbook(io.BytesIO(content), read_only=True, data_only=True)
        titles = [sheet.title for sheet in book.worksheets]
        wanted = choice.select_layers(titles, "sheet")
        if not choice.layers and len(wanted) > 1:
            wanted = tuple(sheet.title for sheet in book.worksheets if sheet.sheet_state == "visible")
        if len(wanted) != 1:
            raise NetworkError(f"layer: expected one sheet of {quote_names(titles)}, found {len(wanted)}")
        sheet = book[wanted[0]]
        # A sheet is read row by row and does not report the number of hidden rows.
        path = str(getattr(sheet, "_worksheet_path", "")).lstrip("/")
        hidden = len(_HIDDEN.findall(archive.read(path))) if path in archive.names else 0
        sheet.reset_dimensions()  # a sheet's declared size is unreliable
        cells = zip(range(1, MOST_ROWS + 3), sheet.iter_rows(values_only=True), strict=False)
        rows = [(f"sheet {sheet.title!r} row {number}", row) for number, row in cells]
    found: list[Remark] = []
    if hidden:
        text = f"{hidden} rows are hidden, as by a filter: they are read all the same"
        found.append(Remark(RemarkTopic.WHOLE, choice.source, text))
    return _build_raw_network(_find_table(rows, XLSX, found), XLSX, choice, found)


def _detect_delimiter(text: str) -> tuple[str, bool]:
    """Return the separator of a text, and whether one of its first lines has the columns of a table."""
    lines = re.split("\r\n|\r|\n", text.lstrip("\ufeff"), maxsplit=MOST_ABOVE + 1)[: MOST_ABOVE + 1]
    own = _SAID.fullmatch(lines[0])
    for line in lines:
        for delimiter in DELIMITERS if own is None else own[1]:
            if _has_columns([cell.strip().strip('"') for cell in line.split(delimiter)]):
                return delimiter, True
    return max(DELIMITERS, key=lines[0].count) if own is None else own[1], False


def _has_columns(row: Sequence[object]) -> bool:
    names = {to_printable(cell).lower() for cell in row if isinstance(cell, str)}
    return bool(names & {*LAT, *EAST}) and bool(names & {*LON, *NORTH})


def _find_table(
    rows: Sequence[tuple[str, Sequence[object]]], what: str, found: list[Remark]
) -> list[tuple[str, Sequence[object]]]:
    """Return the rows from the column names on, without empty ones; a title above is reported.

    Raises:
        NetworkError: there are too many, or none.
    """
    filled = [(place, row) for place, row in rows if any(cell not in {None, ""} for cell in row)]
    if len(filled) > MOST_ROWS:
        raise NetworkError(f"content: expected at most {MOST_ROWS} rows")
    if not filled:
        raise NetworkError("content: expected a row of column names, found none")
    begin = next((at for at, (_, row) in enumerate(filled[: MOST_ABOVE + 1]) if _has_columns(row)), 0)
    if begin:
        first = to_printable(str(next(cell for cell in filled[0][1] if cell not in {None, ""})))[:60]
        count = "a row" if begin == 1 else f"{begin} rows"
        found.append(Remark(RemarkTopic.FILE, what, f"{count} above the names of the columns, {first!r}: not read"))
    return filled[begin:]


def _build_raw_network(
    table: Sequence[tuple[str, Sequence[object]]], what: str, choice: ReadOptions, found: list[Remark]
) -> RawNetwork:
    header, every = [to_printable(str(cell)) if cell is not None else "" for cell in table[0][1]], []
    for place, said in table[1:]:
        if len(said) > len(header) and any(cell not in {None, ""} for cell in said[len(header) :]):
            raise NetworkError(f"{place}: expected {len(header)} cells as in the first row, got {len(said)}")
        own = {name: cell.strip() if isinstance(cell, str) else cell
                 for name, cell in zip(header, said, strict=False) if name}  # fmt: skip
        every.append(_Row(place, own))
    if not every:
        raise NetworkError("content: expected rows of poles below the column names, found none")
    columns = [name for row in every[:1] for name in row.cells]
    system, horizontal = _find_system(columns, choice)
    if not {name.lower() for name in columns} & set(ORDER):
        raise NetworkError(
            f"columns: expected one that says which pole follows which, {quote_names(ORDER)}, "
            f"got {quote_names(columns)}"
        )
    drawing = choice.create_raw_network(what, system.words)
    drawing.found += found
    members: dict[str, list[_Member]] = {}
    mark = _mark_of(every, horizontal)
    for row, line, cells in _pair_rows_with_lines(every, drawing):
        member = _build_member(row, cells, drawing, horizontal, mark, choice)
        if member is not None:
            members.setdefault(line, []).append(member)
    for line, mine in members.items():
        _add_line(drawing, line, mine, system, mark)
    return drawing


def _pair_rows_with_lines(
    rows: Sequence[_Row], drawing: RawNetwork
) -> Iterator[tuple[_Row, str, Mapping[str, object]]]:
    """Yield every row with its line: if a table names it once for a group of rows, that of the row above.

    The mapping holds the attributes for filters: line attributes of the group's first row apply to the others.

    Raises:
        NetworkError: rows above the first name have none, but others do.
    """
    names = [name_of(row.cells, LINES) for row in rows]
    first, line, went_on = rows[0], "", 0
    for row, name in zip(rows, names, strict=True):
        if name or not any(names):
            first, line = row, name
            yield row, line, row.cells
            continue
        if not line:
            raise NetworkError(f"{row.place}: {LINES[0]}: expected its name, as other rows have it")
        went_on += 1
        yield row, line, first.cells | {key: cell for key, cell in row.cells.items() if cell not in {None, ""}}
    if went_on:
        text = f"{went_on} rows without the name of their line: taken for that of the line above them"
        drawing.found.append(Remark(RemarkTopic.FILE, drawing.format, text))


def _mark_of(rows: Sequence[_Row], horizontal: Sequence[Sequence[str]]) -> str | None:
    """Return the decimal mark found in a table's coordinates and heights; degrees need none."""
    keys = (*horizontal, ELEVATION, HEIGHT)
    cells = (find_first_value(row.cells, own) for row in rows for own in keys)
    return values.decimal_mark_of(cell for cell in cells if isinstance(cell, str))


def _build_member(
    row: _Row,
    of_line: Mapping[str, object],
    drawing: RawNetwork,
    horizontal: Sequence[Sequence[str]],
    mark: str | None,
    choice: ReadOptions,
) -> _Member | None:
    """Return a pole of a line; None if it is left out: not built, removed, or not selected.

    Attributes of the line may be in the first row of its group.
    """
    known, attributes = normalise_attributes(flatten_attributes(row.cells)), flatten_attributes(of_line)
    name = name_of(known, POLES) or row.place
    point, (_, line, key) = classify_row(known)[0], classify_row(normalise_attributes(attributes))
    if point in LEFT or (line is PowerFeature.DISUSED and not choice.has_comparison_of(key)):
        drawing.leave_out((point if point in LEFT else PowerFeature.DISUSED_POLE).value, name)
        return None
    if not choice.is_wanted(attributes):
        return None
    is_pole = point in {PowerFeature.POLE, PowerFeature.DISUSED_POLE}
    is_buried = line in {PowerFeature.UNDERGROUND, PowerFeature.CABLE}
    if not is_pole or is_buried:
        drawing.leave_out("pole of an underground line" if is_buried else point.value, name)
    x, y = (_read_coordinate(row, keys, mark) for keys in horizontal)
    value = find_first_value(row.cells, ORDER)
    rank = values.parse_pole_rank(value)
    if rank is None:
        raise NetworkError(f"{row.place}: {ORDER[0]}: expected a number, or one with letters, got {value!r}")
    return _Member(rank, row, x, y, is_pole, is_buried)


def _find_system(
    columns: Sequence[str], choice: ReadOptions
) -> tuple[Wgs84Transform, tuple[tuple[str, ...], tuple[str, ...]]]:
    known = {name.lower() for name in columns}
    if known & set(LAT) and known & set(LON):
        choice.refuse_crs("columns lat and lon")
        return IDENTITY, (LON, LAT)
    if not (known & set(EAST) and known & set(NORTH)):
        raise NetworkError(f"columns: expected lat and lon, or easting and northing, got {quote_names(columns)}")
    if choice.crs is None:
        raise NetworkError("crs: expected one such as 'EPSG:5514' for easting and northing, none is given")
    return build_wgs84_transform(choice.crs), (EAST, NORTH)


def _read_coordinate(row: _Row, keys: Sequence[str], mark: str | None) -> float:
    value = find_first_value(row.cells, keys)
    if keys in {LAT, LON}:
        figure = values.degrees_of(value, values.NORTH_SOUTH if keys == LAT else values.EAST_WEST)
    else:
        figure = values.grid_figure_of(value, mark)
    if figure is None or not is_figure(figure):
        raise NetworkError(f"{row.place}: {keys[0]}: expected a number, got {value!r}")
    return figure


def _add_line(drawing: RawNetwork, line: str, members: list[_Member], system: Wgs84Transform, mark: str | None) -> None:
    keyed = sorted(
        zip(values.build_rank_keys([member.order for member in members]), members, strict=True),
        key=lambda pair: pair[0],
    )
    for (key, one), (next_key, other) in itertools.pairwise(keyed):
        if key == next_key:
            raise NetworkError(
                f"{other.row.place}: {ORDER[0]}: expected another than that of {one.row.place}, "
                f"got {other.order.text}" + (f" twice in line {line!r}" if line else "")
            )
    members = [member for _, member in keyed]
    if len(members) < 2 and drawing.left:
        drawing.leave_out("line of one pole", line or members[0].row.place)
        return
    if len(members) < 2:
        raise NetworkError(f"{members[0].row.place}: expected two poles or more of line {line!r}, found one")
    places = [f"{member.row.place}" for member in members]
    found = system.lat_lon_deg([member.x for member in members], [member.y for member in members], places)
    for (lat_deg, lon_deg), member, place in zip(found, members, places, strict=True):
        heights = heights_of(member.row.cells, place, mark)
        name = name_of(member.row.cells, POLES)
        if member.is_pole and not member.is_buried:
            drawing.poles.append(Pole(member.row.place, name, lat_deg, lon_deg, *heights, line=line))
    # Between poles of which one is underground there is no overhead wire.
    runs = itertools.groupby(zip(found, members, strict=True), key=lambda pair: pair[1].is_buried)
    parts = [tuple((*at, None) for at, _ in run) for is_buried, run in runs if not is_buried]
    parts = [part for part in parts if len(part) > 1]
    if parts:
        drawing.add_line(Line(members[0].row.place, line, tuple(parts)))
