"""Tables of poles, CSV or XLSX: a row a pole, and a column that says which follows which.

Columns by their names in the first row, without regard to case: ``order`` (or seq, sequence), ``lat`` and ``lon`` in
WGS 84 or ``easting`` and ``northing`` with ``crs`` given, ``id`` (or name, pole, ...), ``line`` (or circuit) where
there are several, ``elevation_m`` and ``height_m``. A pole of two lines has a row in each, of the same name and
place.
"""

from __future__ import annotations

import csv
import io
import itertools
import warnings
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from missions.errors import NetworkError
from missions.files import is_figure, printable
from missions.readers.attributes import (
    ELEVATION,
    HEIGHT,
    LINES,
    POLES,
    by_plain_name,
    flattened,
    heights_of,
    name_of,
    said,
)
from missions.readers.choice import Choice, quoted_names
from missions.readers.crs import ToWgs84, to_wgs84
from missions.readers.drawing import Drawing, Line, Pole
from missions.readers.meaning import Meaning, row_meaning
from missions.readers.opened import NEEDS, UNREADABLE, Archive
from missions.readers.values import (
    EAST_WEST,
    NORTH_SOUTH,
    PoleRank,
    decimal_mark_of,
    degrees_of,
    grid_figure_of,
    rank_keys,
    rank_of,
)

if TYPE_CHECKING:
    import openpyxl

CSV, XLSX = "CSV", "XLSX"
ORDER = ("order", "seq", "sequence", "position", "nr", "no")
LAT, LON = ("lat", "latitude", "lat_deg"), ("lon", "lng", "long", "longitude", "lon_deg")
EAST, NORTH = ("easting", "east", "x", "e"), ("northing", "north", "y", "n")
DELIMITERS = ";\t|,"
MOST_ROWS = 500_000
LEFT = {Meaning.UNBUILT_POLE, Meaning.REMOVED_POLE, Meaning.DELETED}
"""Poles over which the wires of their neighbours go."""


@dataclass(frozen=True, slots=True)
class _Row:
    place: str
    cells: Mapping[str, object]


@dataclass(frozen=True, slots=True)
class _Member:
    order: PoleRank
    row: _Row
    x: float
    y: float
    is_pole: bool = True
    is_buried: bool = False


def looks_like_table(text: str) -> bool:
    """Return whether the first line of a text has the columns of a table of poles."""
    header = {cell.lower() for cell in _header(text)}
    return bool(header & {*LAT, *EAST}) and bool(header & {*LON, *NORTH})


def draw_csv(text: str, source: str, choice: Choice) -> Drawing:
    """Return what a table in a text file shows; a comma, semicolon, tab or bar divides it.

    Raises:
        NetworkError: one line that names the file, the row and what was expected.
    """
    choice.no_layers(source, CSV)
    delimiter = _delimiter(text)
    try:
        rows = [
            (f"line {number}", row)
            for number, row in enumerate(csv.reader(io.StringIO(text, newline=None), delimiter=delimiter), 1)
        ]
    except csv.Error as reason:
        raise NetworkError(f"{source}: content: expected a table: {reason}") from reason
    return _drawn(_rows(rows, source), source, CSV, choice)


def draw_xlsx(archive: Archive, content: bytes, source: str, choice: Choice) -> Drawing:
    """Return what a sheet of a workbook shows: the one that is asked for, or else the only one.

    Raises:
        NetworkError: as `draw_csv`; or nothing is installed to read it with.
    """
    try:
        import openpyxl
        from openpyxl.utils.exceptions import InvalidFileException
    except ImportError:
        raise NetworkError(f"{source}: a workbook {NEEDS}") from None
    for name in archive.ending_in(".xml"):
        if b"<!DOCTYPE" in archive.read(name)[:4096]:
            raise NetworkError(f"{source}: {name}: expected XML without a document type (DOCTYPE)")
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # of styles and extensions that are not read
            book = openpyxl.load_workbook(io.BytesIO(content), read_only=True, data_only=True)
        rows = _sheet(book, source, choice)
    except (
        *UNREADABLE, InvalidFileException, SyntaxError, KeyError, TypeError, AttributeError, IndexError,
    ) as reason:  # fmt: skip
        raise NetworkError(f"{source}: content: expected a workbook: {printable(str(reason))}") from reason
    return _drawn(_rows(rows, source), source, XLSX, choice)


def _sheet(book: openpyxl.Workbook, source: str, choice: Choice) -> list[tuple[str, Sequence[object]]]:
    titles = [sheet.title for sheet in book.worksheets]
    wanted = choice.chosen_layers(source, titles, "sheet")
    if len(wanted) != 1:
        raise NetworkError(f"{source}: layer: expected one sheet of {quoted_names(titles)}, found {len(wanted)}")
    sheet = book[wanted[0]]
    sheet.reset_dimensions()  # what a sheet says of its own size may be anything
    rows = zip(range(1, MOST_ROWS + 3), sheet.iter_rows(values_only=True), strict=False)
    return [(f"sheet {wanted[0]!r} row {number}", row) for number, row in rows]


def _header(text: str) -> list[str]:
    first = text.lstrip("\ufeff").partition("\n")[0]
    return [cell.strip().strip('"') for cell in first.split(_delimiter(text))]


def _delimiter(text: str) -> str:
    first = text.partition("\n")[0]
    return max(DELIMITERS, key=first.count)


def _rows(rows: Sequence[tuple[str, Sequence[object]]], source: str) -> Iterator[_Row]:
    filled = [(place, row) for place, row in rows if any(cell not in {None, ""} for cell in row)]
    if len(filled) > MOST_ROWS:
        raise NetworkError(f"{source}: content: expected at most {MOST_ROWS} rows")
    if not filled:
        raise NetworkError(f"{source}: content: expected a row of column names, found none")
    header = [printable(str(cell)) if cell is not None else "" for cell in filled[0][1]]
    for place, row in filled[1:]:
        if len(row) > len(header) and any(cell not in {None, ""} for cell in row[len(header) :]):
            raise NetworkError(f"{source}: {place}: expected {len(header)} cells as in the first row, got {len(row)}")
        cells = {name: cell.strip() if isinstance(cell, str) else cell
                 for name, cell in zip(header, row, strict=False) if name}  # fmt: skip
        yield _Row(place, cells)


def _drawn(rows: Iterator[_Row], source: str, what: str, choice: Choice) -> Drawing:
    every = list(rows)
    if not every:
        raise NetworkError(f"{source}: content: expected rows of poles below the column names, found none")
    columns = [name for row in every[:1] for name in row.cells]
    system, horizontal = _system(columns, source, choice)
    if not {name.lower() for name in columns} & set(ORDER):
        raise NetworkError(
            f"{source}: columns: expected one that says which pole follows which, {quoted_names(ORDER)}, "
            f"got {quoted_names(columns)}"
        )
    drawing = Drawing(source, what, crs=system.words)
    members: dict[str, list[_Member]] = {}
    mark = _mark_of(every, horizontal)
    for row in every:
        member = _member(row, drawing, horizontal, mark, choice)
        if member is not None:
            members.setdefault(name_of(row.cells, LINES), []).append(member)
    for line, own in members.items():
        _add_line(drawing, line, own, system, mark)
    return drawing


def _mark_of(rows: Sequence[_Row], horizontal: Sequence[Sequence[str]]) -> str | None:
    """Return the decimal mark that coordinates and heights of a table show; degrees need none."""
    keys = (*horizontal, ELEVATION, HEIGHT)
    cells = (said(row.cells, own) for row in rows for own in keys)
    return decimal_mark_of(cell for cell in cells if isinstance(cell, str))


def _member(
    row: _Row, drawing: Drawing, horizontal: Sequence[Sequence[str]], mark: str | None, choice: Choice
) -> _Member | None:
    """Return a pole of a line; None for one that is left out: not built, not there any more, or not wanted."""
    attributes = flattened(row.cells)
    known = by_plain_name(attributes)
    name = name_of(known, POLES) or row.place
    point, line, key = row_meaning(known)
    if point in LEFT or (line is Meaning.DISUSED and not choice.asks_for(key)):
        drawing.leave_out(point.value, name)
        return None
    if not choice.takes(attributes):
        return None
    is_pole, is_buried = point in {Meaning.POLE, Meaning.DISUSED_POLE}, line in {Meaning.UNDERGROUND, Meaning.CABLE}
    if not is_pole or is_buried:
        drawing.leave_out("pole of an underground line" if is_buried else point.value, name)
    x, y = (_coordinate(row, keys, drawing.source, mark) for keys in horizontal)
    return _Member(_rank(row, drawing.source), row, x, y, is_pole, is_buried)


def _system(
    columns: Sequence[str], source: str, choice: Choice
) -> tuple[ToWgs84, tuple[tuple[str, ...], tuple[str, ...]]]:
    known = {name.lower() for name in columns}
    if known & set(LAT) and known & set(LON):
        choice.no_crs(source, "columns lat and lon")
        return ToWgs84("WGS 84", source, None), (LON, LAT)
    if not (known & set(EAST) and known & set(NORTH)):
        raise NetworkError(
            f"{source}: columns: expected lat and lon, or easting and northing, got {quoted_names(columns)}"
        )
    if choice.crs is None:
        raise NetworkError(f"{source}: crs: expected one such as 'EPSG:5514' for easting and northing, none is given")
    return to_wgs84(choice.crs, source), (EAST, NORTH)


def _coordinate(row: _Row, keys: Sequence[str], source: str, mark: str | None) -> float:
    value = said(row.cells, keys)
    if keys in {LAT, LON}:
        figure = degrees_of(value, NORTH_SOUTH if keys == LAT else EAST_WEST)
    else:
        figure = grid_figure_of(value, mark)
    if figure is None or not is_figure(figure):
        raise NetworkError(f"{source}: {row.place}: {keys[0]}: expected a number, got {value!r}")
    return figure


def _rank(row: _Row, source: str) -> PoleRank:
    value = said(row.cells, ORDER)
    rank = rank_of(value)
    if rank is None:
        raise NetworkError(f"{source}: {row.place}: {ORDER[0]}: expected a number, or one with letters, got {value!r}")
    return rank


def _add_line(drawing: Drawing, line: str, members: list[_Member], system: ToWgs84, mark: str | None) -> None:
    keyed = sorted(zip(rank_keys([member.order for member in members]), members, strict=True), key=lambda pair: pair[0])
    for (key, one), (next_key, other) in itertools.pairwise(keyed):
        if key == next_key:
            raise NetworkError(
                f"{drawing.source}: {other.row.place}: {ORDER[0]}: expected another than that of {one.row.place}, "
                f"got {other.order.text}" + (f" twice in line {line!r}" if line else "")
            )
    members = [member for _, member in keyed]
    if len(members) < 2 and drawing.left:
        drawing.leave_out("line of one pole", line or members[0].row.place)
        return
    if len(members) < 2:
        raise NetworkError(
            f"{drawing.source}: {members[0].row.place}: expected two poles or more of line {line!r}, found one"
        )
    places = [f"{drawing.source}: {member.row.place}" for member in members]
    found = system.lat_lon_deg([member.x for member in members], [member.y for member in members], places)
    for (lat_deg, lon_deg), member, place in zip(found, members, places, strict=True):
        heights = heights_of(member.row.cells, place, mark)
        name = name_of(member.row.cells, POLES)
        if member.is_pole and not member.is_buried:
            drawing.poles.append(Pole(member.row.place, name, lat_deg, lon_deg, *heights, line=line))
    # Between poles of which one is under the ground the wires are not in the air.
    runs = itertools.groupby(zip(found, members, strict=True), key=lambda pair: pair[1].is_buried)
    parts = [tuple((*at, None) for at, _ in run) for is_buried, run in runs if not is_buried]
    parts = [part for part in parts if len(part) > 1]
    if parts:
        drawing.draw(Line(members[0].row.place, line, tuple(parts)))
