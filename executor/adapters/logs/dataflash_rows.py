"""The records of a DataFlash log, binary (.BIN) or text (.log), with the fields that are wanted.

A log describes its own records (FMT), so old and new firmware are read alike. The file is read in pieces and only what
is wanted is unpacked: of the rest the head alone is looked at. pymavlink's reader maps the whole file, keeps a list of
every record and prints what it passes over; a test holds the two against each other.
"""

from __future__ import annotations

import struct
from collections.abc import Generator, Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from executor.adapters.chunks import read_in_chunks
from executor.core.interface.recorded_log import SkippedRecords

HEAD = b"\xa3\x95"
FMT, FMT_SIZE = 128, 89
PADDING, PADDED = frozenset({0x00, 0xFF}), 16
"""What fills the end of a block of the flash, or of a file that was cut off when the battery was pulled."""
HIGHEST = 256
LETTERS: Mapping[str, tuple[str, float | None]] = {
    "a": ("64s", None), "b": ("b", None), "B": ("B", None), "h": ("h", None), "H": ("H", None), "i": ("i", None),
    "I": ("I", None), "f": ("f", None), "d": ("d", None), "g": ("e", None), "n": ("4s", None), "N": ("16s", None),
    "Z": ("64s", None), "c": ("h", 0.01), "C": ("H", 0.01), "e": ("i", 0.01), "E": ("I", 0.01), "L": ("i", 1e-7),
    "M": ("B", None), "q": ("q", None), "Q": ("Q", None),
}  # fmt: skip
"""Of a FMT: how a field is stored, and what its numbers count."""
WORDS = frozenset("nNZM")
"""Of a text log: a mode has its name there."""
WHOLE = frozenset("bBhHiIqQ")
LARGEST_LINE = 4096
Fields = Mapping[str, Any]
Row = tuple[int | None, str, Fields]
"""Microseconds since the autopilot's boot, the kind, its wanted fields; old kinds have no time of their own."""


@dataclass(frozen=True, slots=True)
class WantedColumns:
    """What is read of a kind."""

    columns: frozenset[str]
    every_usec: int = 0
    """One that follows another of its instance sooner than this is passed over."""


@dataclass(slots=True)
class RecordFormat:
    """What a log says of one kind of its records."""

    name: str
    letters: str
    columns: tuple[str, ...]
    layout: struct.Struct
    picked: tuple[tuple[str, int, float | None], ...]
    """Of the wanted columns: name, index, scale."""
    every_usec: int
    time_at: int = -1
    """Where its time stands behind the head, or in a line; -1 if it has none."""
    time_size: int = 8
    usec: int = 1
    """How many a unit of its time has."""
    instance_at: int = -1
    newest: dict[int, int] = field(default_factory=dict)
    """When a record was taken last, by its instance."""

    def pick_fields(self, values: tuple[Any, ...]) -> dict[str, Any]:
        """Return the wanted fields of a record."""
        found = {}
        for column, index, scale in self.picked:
            value = values[index]
            if type(value) is bytes:
                value = value.split(b"\0", 1)[0].decode("utf-8", "replace")
            found[column] = value if scale is None else value * scale
        return found

    def is_due(self, t_usec: int, instance: int) -> bool:
        """Return whether a record is far enough from the last one."""
        if 0 <= t_usec - self.newest.get(instance, -self.every_usec) < self.every_usec:
            return False
        self.newest[instance] = t_usec
        return True


def format_of(name: str, letters: str, columns: tuple[str, ...], wanted: WantedColumns) -> RecordFormat | None:
    """Return how to read a kind; None if its letters are unknown, or do not fit its columns."""
    if len(letters) != len(columns) or any(letter not in LETTERS for letter in letters):
        return None
    layout = struct.Struct("<" + "".join(LETTERS[letter][0] for letter in letters))
    picked = tuple(
        (column, index, LETTERS[letters[index]][1]) for index, column in enumerate(columns) if column in wanted.columns
    )
    made = RecordFormat(name, letters, columns, layout, picked, wanted.every_usec)
    index = _find_time_index(name, columns)
    if index is not None:
        made.time_at = struct.calcsize("<" + "".join(LETTERS[one][0] for one in letters[:index]))
        made.time_size = struct.calcsize("<" + LETTERS[letters[index]][0])
        made.usec = 1 if columns[index] == "TimeUS" else 1000
        if letters[index] not in "QqIi":
            return None
    for instance in ("Inst", "Instance", "I", "C"):
        if instance in columns and letters[columns.index(instance)] == "B":
            before = letters[: columns.index(instance)]
            made.instance_at = struct.calcsize("<" + "".join(LETTERS[one][0] for one in before))
    return made


def _find_time_index(name: str, columns: tuple[str, ...]) -> int | None:
    """Return which field is the autopilot's own time; TimeMS of an old GPS record is that of the satellites."""
    for column in ("TimeUS", "T") if name == "GPS" else ("TimeUS", "TimeMS"):
        if column in columns:
            return columns.index(column)
    return None


@dataclass(slots=True)
class BinaryRows:
    """A .BIN, read once."""

    path: Path
    wanted: Mapping[str, WantedColumns]
    skipped: SkippedRecords
    sizes: list[int] = field(default_factory=lambda: [0] * HIGHEST)
    """Of whole records, by their number; 0 where no format was seen."""
    formats: list[RecordFormat | None] = field(default_factory=lambda: [None] * HIGHEST)
    kinds: set[str] = field(default_factory=set)
    """That the log describes, wanted or not."""
    _in_garbage: bool = False

    @property
    def is_timed(self) -> bool:
        """Whether any kind that is wanted has the autopilot's own time."""
        return any(one is not None and one.time_at >= 0 for one in self.formats)

    def __iter__(self) -> Iterator[Row]:
        """Yield what is wanted, in the order of the file."""
        self.sizes[FMT] = FMT_SIZE
        yield from read_in_chunks(self.path, self._read_piece)

    def _read_piece(self, buffer: bytes, last: bool) -> Generator[Row, None, int]:
        """Yield the rows of a piece; returns where the rest begins. Calls would take most of the time."""
        at, size, sizes, formats = 0, len(buffer), self.sizes, self.formats
        while at + 3 <= size:
            number = buffer[at + 2]
            length = sizes[number]
            if not length or buffer[at] != HEAD[0] or buffer[at + 1] != HEAD[1]:
                at = self._skip_garbage(buffer, at, last=last)
                continue
            end = at + length
            if end >= size and not last:
                break
            if end > size:
                self.skipped.truncated = 1
                at = self._skip_garbage(buffer, at, last=last, told=True)
                continue
            if end < size and buffer[end] != HEAD[0] and not _is_padding(buffer[end : end + PADDED]):
                # Bytes are missing in it, or it is none.
                at = self._skip_garbage(buffer, at, last=last)
                continue
            self._in_garbage = False
            if number == FMT:
                self._register_format(buffer[at + 3 : end])
            elif (known := formats[number]) is not None:
                body, t_usec = at + 3, None
                if known.time_at >= 0:
                    place = body + known.time_at
                    t_usec = int.from_bytes(buffer[place : place + known.time_size], "little") * known.usec
                if (
                    not known.every_usec
                    or t_usec is None
                    or known.is_due(t_usec, buffer[body + known.instance_at] if known.instance_at >= 0 else 0)
                ):
                    yield t_usec, known.name, known.pick_fields(known.layout.unpack_from(buffer, body))
            at = end
        return at

    def _skip_garbage(self, buffer: bytes, at: int, *, last: bool, told: bool = False) -> int:
        """Return where the next record may begin."""
        self.skipped.garbage_runs += not (self._in_garbage or told)
        self._in_garbage = True
        found = buffer.find(HEAD, at + 1)
        if found >= 0:
            return found
        # The last byte may be the first of a head.
        return len(buffer) if last else max(at + 1, len(buffer) - 1)

    def _register_format(self, body: bytes) -> None:
        number, length, *texts = struct.unpack("<BB4s16s64s", body)
        name, letters, columns = (text.split(b"\0", 1)[0].decode("ascii", "replace") for text in texts)
        if number == FMT:
            return
        if length < 3:
            self.skipped.unreadable += 1
            return
        self.sizes[number], self.formats[number] = length, None
        self.kinds.add(name)
        if name in self.wanted:
            made = format_of(name, letters, tuple(columns.split(",")), self.wanted[name])
            if made is None or made.layout.size + 3 > length:
                self.skipped.unreadable += 1
            else:
                self.formats[number] = made


@dataclass(slots=True)
class TextRows:
    """A .log, as ground stations write it from a DataFlash log: a record a line, its numbers in their own units."""

    path: Path
    wanted: Mapping[str, WantedColumns]
    skipped: SkippedRecords
    formats: dict[str, RecordFormat] = field(default_factory=dict)
    kinds: set[str] = field(default_factory=set)
    """That the log describes, wanted or not."""

    @property
    def is_timed(self) -> bool:
        """Whether any kind that is wanted has the autopilot's own time."""
        return any(one.time_at >= 0 for one in self.formats.values())

    def __iter__(self) -> Iterator[Row]:
        """Yield what is wanted, in the order of the file."""
        in_garbage = False
        with self.path.open("rb") as file:
            while line := file.readline(LARGEST_LINE):
                name, _, rest = line.partition(b",")
                kind = name.strip().decode("ascii", "replace")
                if not rest or not kind.isalnum() or len(kind) > 4:
                    self.skipped.garbage_runs += not in_garbage and bool(line.strip())
                    in_garbage = True
                    continue
                in_garbage = False
                if kind == "FMT":
                    self._register_format([one.strip() for one in rest.decode("utf-8", "replace").split(",")])
                elif (known := self.formats.get(kind)) is not None:
                    row = self._parse_row(known, rest.decode("utf-8", "replace"))
                    if row is not None:
                        yield row

    def _parse_row(self, known: RecordFormat, rest: str) -> Row | None:
        texts = [one.strip() for one in rest.split(",", len(known.columns) - 1)]
        if len(texts) != len(known.columns):
            self.skipped.unreadable += 1
            return None
        try:
            t_usec = None if known.time_at < 0 else round(float(texts[known.time_at])) * known.usec
            if t_usec is not None and known.every_usec:
                instance = int(texts[known.instance_at]) if known.instance_at >= 0 else 0
                if not known.is_due(t_usec, instance):
                    return None
            fields = {column: _parse_value(texts[index], known.letters[index]) for column, index, _ in known.picked}
        except (ValueError, OverflowError):
            self.skipped.unreadable += 1
            return None
        return t_usec, known.name, fields

    def _register_format(self, said: list[str]) -> None:
        if len(said) < 5:
            return
        self.kinds.add(said[2])
        if said[2] not in self.wanted:
            return
        name, letters, columns = said[2], said[3], tuple(said[4:])
        made = format_of(name, letters, columns, self.wanted[name])
        if made is None:
            self.skipped.unreadable += 1
            return
        # Of a line it is the number of the field that counts.
        index = _find_time_index(name, columns)
        made.time_at = -1 if index is None else index
        made.instance_at = next((columns.index(one) for one in ("Inst", "Instance", "I", "C") if one in columns), -1)
        self.formats[name] = made


def _is_padding(behind: bytes) -> bool:
    return behind[0] in PADDING and behind.count(behind[0]) == len(behind)


def _parse_value(text: str, letter: str) -> str | float:
    if letter in WORDS:
        return text
    return int(float(text)) if letter in WHOLE else float(text)
