"""Read ArduPilot's DataFlash log (.BIN, or .log as text) as our messages, timed by the vehicle's time since boot.

A log describes its own records (FMT), so old and new firmware are read alike; the writing firmware and vehicle are
identified first. pymavlink supplies the meaning of a record's format letters and numbers. Its own file reader maps the
whole file, lists every record and gives up on a damaged description, so this module reads the file itself, in pieces:
it unpacks wanted records, and checks only the head of others.
"""

from __future__ import annotations

import re
import struct
from abc import ABC, abstractmethod
from collections.abc import Generator, Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, ClassVar

from pymavlink.DFReader import FORMAT_TO_STRUCT, DFFormat, DFMessage

from executor.adapters.chunks import read_in_chunks
from executor.adapters.logs.ardupilot_boot import NO_MODE, READERS, WANTED, ArduPilotBoot, Fields, WantedColumns
from executor.core.interface.messages import ListedItem, VehicleSetting
from executor.core.interface.recorded_log import Record, RecordedFile, SkippedRecords
from executor.core.telemetry.plausibility import filter_implausible
from executor.errors import LogError

HEAD = b"\xa3\x95"
HEAD_SIZE, FMT, FMT_SIZE = 3, 128, 89
PADDING, PADDED = frozenset({0x00, 0xFF}), 16
"""Padding at the end of a flash block, or of a file cut off when the battery was pulled."""
HIGHEST = 256
INSTANCES = ("Inst", "Instance", "I", "C")
"""Names of the column for the number of the pack, receiver or filter."""
LARGEST_LINE = 4096
Row = tuple[int | None, str, Fields]
"""Microseconds since boot, record type, wanted fields; old types have no time."""
SYSTEM = 1
"""System id if the log holds none (MAV_SYSID, SYSID_THISMAV)."""
SYSTEM_PARAMETERS = frozenset({"MAV_SYSID", "SYSID_THISMAV"})
MOST_SYSTEMS = 256
BEAT_USEC = 1_000_000
LATE_USEC = 5_000_000
"""Most time by which records of one boot are out of order."""
LEAP_USEC = 600_000_000
AGREES_USEC = 60_000_000
"""Tolerance within which the next record must confirm a clock jump of more than ten minutes."""
SURVEY_ROWS = 20_000
"""Leading parameters and texts in which a log identifies its vehicle."""
MOST_HELD = 5000
TOLD_ONCE = frozenset({"MODE", "EV", "ERR", "PARM", "MSG"})
"""Records kept from before the first fix in a log whose only clock is GPS, as they are logged once."""
FIXED = 3
COPTER = 2
"""MAV_TYPE of a copter; the log does not give the number of rotors."""
FIRMWARE = re.compile(r"(Ardu|APM:? ?)?(?P<name>Copter|Plane|Rover|rover2|Sub|Blimp|AntennaTracker)\b.* V?\d")
TYPES = {"Copter": COPTER, "Plane": 1, "Rover": 10, "rover2": 10, "Sub": 12, "Blimp": 7, "AntennaTracker": 5}
"""MAV_TYPE of a firmware."""
OTHERS_KINDS = {"TECS": 1, "AETR": 1, "STER": 10}
"""Record types that only plane or rover firmware defines."""
SDLOG2 = frozenset({"TIME", "STAT", "GPOS"})
"""Record types of PX4 logs before 1.5, which have the same format."""
SURVEYED = {
    name: WantedColumns(frozenset(columns.split())) for name, columns in (("MSG", "Message"), ("PARM", "Name Value"))
}


@dataclass(slots=True)
class RecordKind:
    """A record type as the log describes it, with its wanted columns."""

    described: DFFormat
    wanted: WantedColumns
    in_text: bool
    newest: dict[int, int] = field(default_factory=dict)
    """Time of the last record taken, by instance."""
    columns: tuple[str, ...] = field(init=False)
    time_column: str = field(init=False)
    """Column of the autopilot's time; empty if none."""
    instance_column: str = field(init=False)
    layout: struct.Struct = field(init=False)

    def __post_init__(self) -> None:
        there, letters = self.described.columns, dict(zip(self.described.columns, self.described.format, strict=True))
        self.layout = struct.Struct(self.described.msg_struct)
        self.columns = tuple(column for column in there if column in self.wanted.columns)
        # TimeMS of an old GPS record is the satellites' time.
        times = ("TimeUS", "T") if self.described.name == "GPS" else ("TimeUS", "TimeMS")
        self.time_column = next((column for column in times if column in letters), "")
        instances = (column for column in INSTANCES if letters.get(column) == "B")
        self.instance_column = next(instances, "")

    def read_record(self, values: Sequence[Any]) -> Row | None:
        """Return a record's wanted columns; None if it follows another of its instance too soon.

        Raises:
            ValueError: A text is no number.
        """
        record, t_usec = DFMessage(self.described, values, not self.in_text, None), None
        if self.time_column:
            t_usec = getattr(record, self.time_column) * (1 if self.time_column == "TimeUS" else 1000)
        if t_usec is not None and self.wanted.every_usec:
            instance = getattr(record, self.instance_column) if self.instance_column else 0
            if 0 <= t_usec - self.newest.get(instance, -self.wanted.every_usec) < self.wanted.every_usec:
                return None
            self.newest[instance] = t_usec
        return t_usec, self.described.name, {column: getattr(record, column) for column in self.columns}


@dataclass(slots=True)
class Rows(ABC):
    """Records of a log, read once."""

    path: Path
    wanted: Mapping[str, WantedColumns]
    skipped: SkippedRecords
    formats: dict[int | str, RecordKind] = field(default_factory=dict)
    """Formats of wanted records, by number; in text logs by name."""
    kinds: set[str] = field(default_factory=set)
    """All record types that the log defines."""
    in_text: ClassVar[bool] = False
    """Whether fields are text, with numbers in display units."""
    _in_garbage: bool = False

    @property
    def is_timed(self) -> bool:
        """Return whether any wanted record type has the autopilot's own time."""
        return any(one.time_column for one in self.formats.values())

    @abstractmethod
    def __iter__(self) -> Iterator[Row]:
        """Yield the wanted records, in the order of the file."""

    def _describe_kind(self, key: int | str, length: int, name: str, letters: str, columns: Sequence[str]) -> None:
        """Note a record type that the log describes, and how to read it if it is wanted and readable."""
        self.kinds.add(name)
        self.formats.pop(key, None)
        if name not in self.wanted:
            return
        if len(letters) == len(columns) and all(letter in FORMAT_TO_STRUCT for letter in letters):
            described = DFFormat(key, name, length, letters, ",".join(columns))
            made = RecordKind(described, self.wanted[name], self.in_text)
            timed = not made.time_column or letters[columns.index(made.time_column)] in "QqIi"
            if timed and (self.in_text or made.layout.size + HEAD_SIZE <= length):
                self.formats[key] = made
                return
        self.skipped.unreadable += 1


@dataclass(slots=True)
class BinaryRows(Rows):
    """Records of a .BIN."""

    sizes: list[int] = field(default_factory=lambda: [0] * HIGHEST)
    """Record sizes by number; 0 without a format."""

    def __iter__(self) -> Iterator[Row]:
        self.sizes[FMT] = FMT_SIZE
        yield from read_in_chunks(self.path, self._read_piece)

    def _read_piece(self, buffer: bytes, last: bool) -> Generator[Row, None, int]:
        """Yield the rows of a piece; return where the rest begins. Inlined, as calls would take most of the time."""
        at, size, sizes, formats = 0, len(buffer), self.sizes, self.formats
        while at + HEAD_SIZE <= size:
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
                # Bytes are missing, or this is no record.
                at = self._skip_garbage(buffer, at, last=last)
                continue
            self._in_garbage = False
            if number == FMT:
                self._register_format(buffer[at + HEAD_SIZE : end])
            elif (known := formats.get(number)) is not None:
                row = known.read_record(known.layout.unpack_from(buffer, at + HEAD_SIZE))
                if row is not None:
                    yield row
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
        if length < HEAD_SIZE:
            self.skipped.unreadable += 1
            return
        self.sizes[number] = length
        self._describe_kind(number, length, name, letters, columns.split(","))


class TextRows(Rows):
    """Records of a .log, as ground stations convert a DataFlash log: one per line, numbers in display units."""

    in_text = True

    def __iter__(self) -> Iterator[Row]:
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
                    self._describe_kind(texts[2], 0, texts[2], texts[3], texts[4:])
                elif (known := self.formats.get(kind)) is not None:
                    row = self._parse_row(known, texts)
                    if row is not None:
                        yield row

    def _parse_row(self, known: RecordKind, texts: list[str]) -> Row | None:
        count = len(known.described.columns)
        if len(texts) >= count:
            with suppress(ValueError, OverflowError):
                # A text in the last column may contain commas.
                return known.read_record([*texts[: count - 1], ",".join(texts[count - 1 :])])
        self.skipped.unreadable += 1
        return None


def _is_padding(behind: bytes) -> bool:
    return behind[0] in PADDING and behind.count(behind[0]) == len(behind)


@dataclass(slots=True)
class DataFlashFile(RecordedFile):
    """A DataFlash log, read once."""

    text: bool = False
    system: int = SYSTEM
    vehicle_type: int = COPTER
    _now_usec: int | None = None
    _held: list[tuple[str, Fields]] = field(default_factory=list)
    """Untimed records before the first timed one."""
    _doubted: tuple[int, str, Fields] | None = None
    """A record with an implausible time, until the next one confirms it."""
    _boot: ArduPilotBoot = field(default_factory=ArduPilotBoot)
    _beat_usec: int = 0

    def read_records(self) -> Iterator[Record]:
        """Yield the log's messages in order, with one heartbeat a second.

        Raises:
            LogError: The file is no such log.
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
            self.notes.append("no MODE in it: its flight mode is unknown")

    def _open_rows(self, wanted: Mapping[str, WantedColumns], skipped: SkippedRecords) -> Rows:
        return (TextRows if self.text else BinaryRows)(self.path, wanted, skipped)

    def _find_writer(self) -> bool:
        """Identify the writer of the log; return whether it can be read."""
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
        """Return a record with its time, after any record it confirms; nothing while it is doubtful."""
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
            self._boot = ArduPilotBoot()  # another boot: arming and mode are unknown
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
    """Return a record of a log of 2013, which has no times, with the time of its GPS fix."""
    _, kind, fields = row
    if kind != "GPS" or rows.is_timed or fields.get("Status", 0) < FIXED:
        return row
    return 1000 * int(fields.get("TimeMS", fields.get("Time", 0))) or None, kind, fields
