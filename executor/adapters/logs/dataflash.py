"""ArduPilot's DataFlash log (.BIN, or .log as text) to our messages, on the vehicle's own clock: time since its boot.

A log describes its own records (FMT), so old and new firmware are read alike; which system and which vehicle wrote it
is looked for before it is read. The file is read in pieces and only what is wanted is unpacked: of the rest the head
alone is looked at. pymavlink's reader maps the whole file, keeps a list of every record and prints what it passes over;
a test holds the two against each other.
"""

from __future__ import annotations

import re
import struct
from abc import ABC, abstractmethod
from collections.abc import Generator, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import accumulate
from pathlib import Path
from typing import Any

from executor.adapters.chunks import read_in_chunks
from executor.adapters.logs.ardupilot_boot import NO_MODE, READERS, WANTED, ArduPilotBoot, Fields, WantedColumns
from executor.core.interface.messages import ListedItem, VehicleSetting
from executor.core.interface.recorded_log import Record, RecordedFile, SkippedRecords
from executor.core.telemetry.plausibility import filter_implausible
from executor.errors import LogError

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
Row = tuple[int | None, str, Fields]
"""Microseconds since the autopilot's boot, the kind, its wanted fields; old kinds have no time of their own."""
SYSTEM = 1
"""Where the log does not say which system wrote it (MAV_SYSID, SYSID_THISMAV)."""
SYSTEM_PARAMETERS = frozenset({"MAV_SYSID", "SYSID_THISMAV"})
MOST_SYSTEMS = 256
BEAT_USEC = 1_000_000
LATE_USEC = 5_000_000
"""Records of one boot are out of order by less."""
LEAP_USEC = 600_000_000
AGREES_USEC = 60_000_000
"""A clock that leaps by more than ten minutes is believed if the next record agrees."""
SURVEY_ROWS = 20_000
"""Parameters and texts at the beginning in which a log says who wrote it."""
MOST_HELD = 5000
TOLD_ONCE = frozenset({"MODE", "EV", "ERR", "PARM", "MSG"})
"""What is kept of the time before the first fix in a log that has no other clock than the satellites'."""
FIXED = 3
COPTER = 2
"""MAV_TYPE: the log does not say how many rotors a copter has."""
FIRMWARE = re.compile(r"(Ardu|APM:? ?)?(?P<name>Copter|Plane|Rover|rover2|Sub|Blimp|AntennaTracker)\b.* V?\d")
TYPES = {"Copter": COPTER, "Plane": 1, "Rover": 10, "rover2": 10, "Sub": 12, "Blimp": 7, "AntennaTracker": 5}
"""MAV_TYPE of a firmware."""
OTHERS_KINDS = {"TECS": 1, "AETR": 1, "STER": 10}
"""Records that only an aeroplane's or a rover's firmware describes."""
SDLOG2 = frozenset({"TIME", "STAT", "GPOS"})
"""PX4's logs before version 1.5 are of the same form, with records of their own."""
SURVEYED = {
    name: WantedColumns(frozenset(columns.split())) for name, columns in (("MSG", "Message"), ("PARM", "Name Value"))
}


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


def format_of(
    name: str, letters: str, columns: tuple[str, ...], wanted: WantedColumns, *, in_text: bool
) -> RecordFormat | None:
    """Return how to read a kind; None if its letters are unknown, or do not fit its columns."""
    if len(letters) != len(columns) or any(letter not in LETTERS for letter in letters):
        return None
    layout = struct.Struct("<" + "".join(LETTERS[letter][0] for letter in letters))
    picked = tuple(
        (column, index, LETTERS[letters[index]][1]) for index, column in enumerate(columns) if column in wanted.columns
    )
    made = RecordFormat(name, letters, columns, layout, picked, wanted.every_usec)
    places = list(accumulate(struct.calcsize("<" + LETTERS[one][0]) for one in letters))
    places = list(range(len(letters))) if in_text else [0, *places]
    index = _find_time_index(name, columns)
    if index is not None:
        if letters[index] not in "QqIi":
            return None
        made.time_at, made.time_size = places[index], struct.calcsize("<" + LETTERS[letters[index]][0])
        made.usec = 1 if columns[index] == "TimeUS" else 1000
    for instance in ("Inst", "Instance", "I", "C"):
        if instance in columns and letters[columns.index(instance)] == "B":
            made.instance_at = places[columns.index(instance)]
    return made


def _find_time_index(name: str, columns: tuple[str, ...]) -> int | None:
    """Return which field is the autopilot's own time; TimeMS of an old GPS record is that of the satellites."""
    for column in ("TimeUS", "T") if name == "GPS" else ("TimeUS", "TimeMS"):
        if column in columns:
            return columns.index(column)
    return None


@dataclass(slots=True)
class Rows(ABC):
    """A log, read once."""

    path: Path
    wanted: Mapping[str, WantedColumns]
    skipped: SkippedRecords
    formats: dict[int | str, RecordFormat] = field(default_factory=dict)
    """Of what is wanted, by number; in text by name."""
    kinds: set[str] = field(default_factory=set)
    """That the log describes, wanted or not."""
    _in_garbage: bool = False

    @property
    def is_timed(self) -> bool:
        """Whether any kind that is wanted has the autopilot's own time."""
        return any(one.time_at >= 0 for one in self.formats.values())

    @abstractmethod
    def __iter__(self) -> Iterator[Row]:
        """Yield what is wanted, in the order of the file."""

    def _describe_kind(self, name: str, letters: str, columns: Sequence[str], *, in_text: bool) -> RecordFormat | None:
        """Note that the log describes a kind; return how to read it, if it is wanted and can be read."""
        self.kinds.add(name)
        if name not in self.wanted:
            return None
        made = format_of(name, letters, tuple(columns), self.wanted[name], in_text=in_text)
        self.skipped.unreadable += made is None
        return made


@dataclass(slots=True)
class BinaryRows(Rows):
    """A .BIN."""

    sizes: list[int] = field(default_factory=lambda: [0] * HIGHEST)
    """Of whole records, by their number; 0 where no format was seen."""

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
            elif (known := formats.get(number)) is not None:
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
        self.sizes[number] = length
        self.formats.pop(number, None)
        made = self._describe_kind(name, letters, columns.split(","), in_text=False)
        if made is not None and made.layout.size + 3 > length:
            self.skipped.unreadable += 1
        elif made is not None:
            self.formats[number] = made


class TextRows(Rows):
    """A .log, as ground stations write it from a DataFlash log: a record a line, its numbers in their own units."""

    def __iter__(self) -> Iterator[Row]:
        """Yield what is wanted, in the order of the file."""
        with self.path.open("rb") as file:
            while line := file.readline(LARGEST_LINE):
                name, _, rest = line.partition(b",")
                kind = name.strip().decode("ascii", "replace")
                if not rest or not kind.isalnum() or len(kind) > 4:
                    self.skipped.garbage_runs += not self._in_garbage and bool(line.strip())
                    self._in_garbage = True
                    continue
                self._in_garbage = False
                texts = [one.strip() for one in rest.decode("utf-8", "replace").split(",")]
                if kind == "FMT" and len(texts) >= 5:
                    made = self._describe_kind(texts[2], texts[3], texts[4:], in_text=True)
                    if made is not None:
                        self.formats[made.name] = made
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


def _is_padding(behind: bytes) -> bool:
    return behind[0] in PADDING and behind.count(behind[0]) == len(behind)


def _parse_value(text: str, letter: str) -> str | float:
    if letter in WORDS:
        return text
    return int(float(text)) if letter in WHOLE else float(text)


@dataclass(slots=True)
class DataFlashFile(RecordedFile):
    """A log being read once."""

    text: bool = False
    system: int = SYSTEM
    vehicle_type: int = COPTER
    _now_usec: int | None = None
    _held: list[tuple[str, Fields]] = field(default_factory=list)
    """Records without a time, before the first one that has one."""
    _doubted: tuple[int, str, Fields] | None = None
    """A record whose time is far from that of the others."""
    _boot: ArduPilotBoot = field(default_factory=ArduPilotBoot)
    _beat_usec: int = 0

    def read_records(self) -> Iterator[Record]:
        """Yield what the log says, in its order, with a heartbeat a second.

        Raises:
            LogError: not such a log at all.
        """
        if self.path.stat().st_size == 0:
            self.notes.append("it is empty")
            return
        if not self._find_writer():
            return
        wanted = {kind: replace(one, every_usec=0) for kind, one in WANTED.items()} if self.every_record else WANTED
        rows = self._open_rows(wanted, self.skipped)
        for row in rows:
            for t_usec, kind, fields in self._attach_time(row, rows):
                yield from self._read(t_usec, kind, fields)
        if not rows.kinds:
            raise LogError(
                f"{self.path}: expected a DataFlash log of ArduPilot: it describes none of its records (FMT)"
            )
        if self._doubted is not None:
            self.skipped.impossible += 1
        if not self._boot.begun and self._now_usec is not None:
            self.notes.append("it ends before it says a mode or lasts ten seconds")
        elif self._boot.mode == NO_MODE:
            self.notes.append("no MODE in it: nobody knows in which mode it flew")

    def _open_rows(self, wanted: Mapping[str, WantedColumns], skipped: SkippedRecords) -> Rows:
        return (TextRows if self.text else BinaryRows)(self.path, wanted, skipped)

    def _find_writer(self) -> bool:
        """Look for who wrote the log; returns whether it can be read."""
        rows, system, kind = self._open_rows(SURVEYED, SkippedRecords()), None, None
        for number, (_, name, fields) in enumerate(rows):
            if name == "PARM" and fields.get("Name") in SYSTEM_PARAMETERS and 0 < fields.get("Value", 0) < MOST_SYSTEMS:
                system = system or int(fields["Value"])
            elif name == "MSG" and (found := FIRMWARE.match(fields.get("Message", ""))) is not None:
                kind = kind or TYPES[found["name"]]
            if (system and kind) or number > SURVEY_ROWS:
                break
        self.system = system or SYSTEM
        self.vehicle_type = kind or next((OTHERS_KINDS[one] for one in OTHERS_KINDS if one in rows.kinds), COPTER)
        if rows.kinds >= SDLOG2 and "MODE" not in rows.kinds:
            self.notes.append("it is a log of PX4 before version 1.5 (sdlog2), which is not read")
            return False
        return True

    def _attach_time(self, row: Row, rows: Rows) -> Iterable[tuple[int, str, Fields]]:
        """Return a record with its time, and before it one whose time is no longer doubted; nothing while it is."""
        t_usec, kind, fields = row if row[0] is not None else _with_satellites_time(row, rows)
        if self._now_usec is None:
            if t_usec is not None or kind in TOLD_ONCE or rows.is_timed:
                self._held.append((kind, fields))
            if t_usec is None and len(self._held) < MOST_HELD:
                return []
            self._now_usec = t_usec or 0
            held, self._held = self._held, []
            return [(self._now_usec, *one) for one in held]
        if t_usec is None:
            return [(self._now_usec, kind, fields)]
        ahead_usec = t_usec - self._now_usec
        if -LATE_USEC <= ahead_usec <= LEAP_USEC:
            if self._doubted is not None:
                self.skipped.impossible += 1
                self._doubted = None
            self._now_usec = max(t_usec, self._now_usec)
            return [(self._now_usec, kind, fields)]
        before, self._doubted = self._doubted, (t_usec, kind, fields)
        if before is None or abs(t_usec - before[0]) > AGREES_USEC:
            self.skipped.impossible += before is not None
            return []
        if t_usec < self._now_usec:
            self._boot = ArduPilotBoot()  # another boot: it was neither armed nor in a mode
        self._now_usec, self._doubted = t_usec, None
        return [(min(before[0], t_usec), *before[1:]), (t_usec, kind, fields)]

    def _read(self, t_usec: int, kind: str, fields: Fields) -> Iterator[Record]:
        boot = self._boot
        try:
            told = READERS[kind](boot, t_usec, fields)
        except (KeyError, ValueError, TypeError, OverflowError):
            self.skipped.unreadable += 1
            return
        if not boot.begun and not boot.begin_when_known(t_usec):
            if isinstance(told, VehicleSetting | ListedItem):
                yield t_usec, self.system, told
            return
        if boot.changed or t_usec - self._beat_usec >= BEAT_USEC:
            self._beat_usec, boot.changed = t_usec, False
            yield t_usec, self.system, boot.build_heartbeat(self.vehicle_type)
        for one in told if isinstance(told, tuple) else () if told is None else (told,):
            if (known := filter_implausible(one)) is not one:
                self.skipped.impossible += 1
            if known is not None:
                yield t_usec, self.system, known


def _with_satellites_time(row: Row, rows: Rows) -> Row:
    """Return a record of a log of 2013, which has no time of its own, with that of its fix."""
    _, kind, fields = row
    if kind != "GPS" or rows.is_timed or fields.get("Status", 0) < FIXED:
        return row
    return 1000 * int(fields.get("TimeMS", fields.get("Time", 0))) or None, kind, fields
