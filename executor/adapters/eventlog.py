"""Event log: one JSON object per line, handed to the operating system before the event is applied.

Every value is a frozen dataclass, a tuple or a plain value, so one generic rule writes and reads them all: a dataclass
becomes an object with its class name under ``kind``, a tuple becomes a list. The end of a log is read without the rest,
as a log of ten hours takes too long to read.
"""

from __future__ import annotations

import asyncio
import dataclasses
import hashlib
import json
import mmap
import os
import sys
from collections import deque
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from enum import Enum
from functools import cache, partial
from pathlib import Path
from typing import Any, TypeGuard, get_args, get_type_hints

from executor.core.interface import events, intents, messages
from executor.core.interface.events import Event, Heard, Reopened, Tick
from executor.errors import LogError

PIECE_BYTES = 64 * 1024
"""Block size for reading a log and for finding its end."""


@dataclass(frozen=True, slots=True)
class LogPlace:
    """Position after a whole line in a log, with a digest that identifies the log."""

    size: int
    """Bytes up to this position."""
    lines: int
    at_s: float
    """Time of the last event before this position."""
    digest: str
    """Digest of the log's first line and of the last line before this position."""


def digest_of(first: bytes, last: bytes) -> str:
    """Return the digest of a position."""
    return hashlib.sha256(first + last).hexdigest()


def is_place_in_log(path: Path, place: LogPlace) -> bool:
    """Return whether a position belongs to this log, that is, the same flight wrote both."""
    with suppress(OSError):
        if 0 < place.size <= path.stat().st_size:
            first, last = read_ends(path, place.size)
            return last.endswith(b"\n") and digest_of(first, last) == place.digest
    return False


@contextmanager
def _map_log(path: Path) -> Iterator[mmap.mmap | bytes]:
    """Map a log into memory, so that only the pages used are read."""
    with path.open("rb") as file:
        if not os.fstat(file.fileno()).st_size:
            yield b""
            return
        with mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ) as log:
            yield log


def read_ends(path: Path, size: int) -> tuple[bytes, bytes]:
    """Return the first line of a log, and the last line of its first `size` bytes."""
    with _map_log(path) as log:
        begin = log.rfind(b"\n", 0, max(0, size - 1)) + 1
        return log[: log.find(b"\n") + 1] or log[:], log[begin:size]


def count_lines_after(path: Path, place: LogPlace | None) -> int:
    """Return the number of whole lines after a position, or in the whole log."""
    with path.open("rb") as file:
        file.seek(0 if place is None else place.size)
        return sum(piece.count(b"\n") for piece in iter(partial(file.read, PIECE_BYTES), b""))


def is_flight_finished(path: Path) -> bool:
    """Return whether a log ends with the note that no vehicle is left to supervise."""
    with _map_log(path) as log:
        return b'"command":{"kind":"Finish"' in log[max(0, len(log) - PIECE_BYTES) :]


def read_last_event_s(path: Path) -> float | None:
    """Return the time of a log's last event; None if it holds none."""
    with _map_log(path) as log:
        end = log.rfind(b"\n")
        while end >= 0:
            begin = log.rfind(b"\n", 0, end) + 1
            t_s = _parse_event_time_s(log[begin:end])
            if t_s is not None:
                return t_s
            end = begin - 1
    return None


def _parse_event_time_s(line: bytes) -> float | None:
    if b'"event":' not in line[:60]:
        return None
    with suppress(ValueError, TypeError, KeyError, RecursionError):
        t_s = json.loads(line)["t_s"]
        return float(t_s) if is_time(t_s) else None
    return None


def is_time(value: object) -> TypeGuard[float]:
    """Return whether a value is a valid flight time."""
    return isinstance(value, int | float) and abs(value) <= sys.float_info.max


FORMAT = "faultline-events/1"
MOST_WAITING = 50_000
"""Most unwritten lines, of about 200 bytes each: 15 minutes of four vehicles."""
LONGEST_PAUSE_S = 30.0
"""Longest gap between events in flight time; a tick comes every 0.2 s, or every 0.02 real seconds."""
DISK_S = 1.0
"""Real seconds that a command waits for the disk. A healthy disk takes milliseconds; the wait is limited, as only a
power loss could undo the decision."""
GAP = "lines_lost"
"""Key of a note that replaces lines that could not be written."""
CLOCK_SET = "clock_set_s"
"""Key of a note that the computer's clock was stepped, with the seconds."""
LATEST_UNIX_S = 1e12
"""Latest start of a flight: 30,000 years from now."""
FASTEST = 1000.0
"""Fastest simulation, in multiples of real time."""

_KINDS: dict[str, type] = {
    name: item
    for module in (events, intents, messages)
    for name, item in vars(module).items()
    if isinstance(item, type) and dataclasses.is_dataclass(item)
}


def _find_enum_reader(hint: object) -> Callable[[Any], Enum | None] | None:
    """Return a reader for a field's type if the field holds, or may hold, a member of an enum; else None."""
    kind = next((one for one in (hint, *get_args(hint)) if isinstance(one, type) and issubclass(one, Enum)), None)
    if kind is None or kind is hint:
        return kind
    return lambda value: None if value is None else kind(value)


_ENUMS = {
    name: {key: read for key, hint in get_type_hints(kind).items() if (read := _find_enum_reader(hint)) is not None}
    for name, kind in _KINDS.items()
}
"""Readers of enum fields; the log holds an enum by its value."""


@cache
def _fields_of(kind: type) -> tuple[str, ...] | None:
    """Return a dataclass's field names, None for any other class; cached, as it is called for every frame."""
    return tuple(field.name for field in dataclasses.fields(kind)) if dataclasses.is_dataclass(kind) else None


def to_plain(value: object) -> object:
    """Return a value that JSON can hold."""
    kind: Any = type(value)
    names = _fields_of(kind)
    if names is not None:
        plain: dict[str, object] = {"kind": kind.__name__}
        for name in names:
            plain[name] = to_plain(getattr(value, name))
        return plain
    if isinstance(value, tuple):
        return [to_plain(item) for item in value]
    return value.value if isinstance(value, Enum) else value


def from_plain(value: Any) -> Any:  # noqa: ANN401 - the inverse of a generic rule
    """Return the value that was passed to `to_plain`.

    Raises:
        LogError: An unknown kind, or fields that do not fit it.
    """
    if isinstance(value, dict):
        fields = {key: from_plain(item) for key, item in value.items() if key != "kind"}
        try:
            for key, read in _ENUMS[value["kind"]].items():
                if key in fields:  # an older log may lack it
                    fields[key] = read(fields[key])
            return _KINDS[value["kind"]](**fields)
        except (KeyError, TypeError, ValueError) as error:
            raise LogError(f"unknown event {value.get('kind')!r}: {error}") from error
    if isinstance(value, list):
        return tuple(from_plain(item) for item in value)
    return value


@dataclasses.dataclass(frozen=True, slots=True)
class LogHeader:
    """First line of a log."""

    began_unix_s: float
    """Unix time at which the log's time is 0."""
    speedup: float

    def __post_init__(self) -> None:
        """Check both values.

        Raises:
            ValueError: No flight has this start time or speed-up.
        """
        if not (0 <= self.began_unix_s < LATEST_UNIX_S and 0 < self.speedup <= FASTEST):
            raise ValueError(f"expected a time, got {self}")


class EventLog:
    """Append events to a file; each is with the operating system when `write` returns.

    A full disk must not end a flight: lines that cannot be written wait in memory until there is room. Beyond
    `MOST_WAITING` lines, only decisions and the results of procedures are kept, and the gap is noted.
    """

    def __init__(
        self,
        path: Path,
        *,
        began_unix_s: float | None = None,
        speedup: float = 1.0,
        told: Callable[[str], None] = lambda _: None,
        lines: int = 0,
    ) -> None:
        """Create the file, or continue one; anything after its last whole line is then cut off.

        Args:
            path: File to write.
            began_unix_s: For a new log: Unix time at which its time is 0.
            speedup: For a new log: speed-up of the flight.
            told: Called with a line for the operator when writing fails, and when it works again.
            lines: Number of whole lines in a log that is continued.

        Raises:
            LogError: A new log exists already, or the file cannot be written.
        """
        self.lost = 0
        """Number of lines dropped."""
        self._told = told
        self._waiting: deque[bytes] = deque()
        """Lines not yet written."""
        self._begun = 0
        """Bytes already written of the first waiting line."""
        self._dropped = 0
        """Lines dropped since the last line written."""
        self._now_s = 0.0
        """Time of the last event."""
        self._written = self._synced = 0
        """Lines written, and lines synced to disk."""
        self._syncing: asyncio.Task[None] | None = None
        """The only task that waits for the disk."""
        self._slow = False
        self._lines = lines
        """Lines handed to the operating system."""
        self._first = self._last = b""
        new = os.O_CREAT | os.O_EXCL if began_unix_s is not None else 0
        try:
            self._fd = os.open(path, os.O_WRONLY | os.O_APPEND | new, 0o644)
            if began_unix_s is None:
                with _map_log(path) as log:
                    whole = log.rfind(b"\n") + 1  # whole lines
                os.ftruncate(self._fd, whole)
                self._first, self._last = read_ends(path, whole)
        except OSError as error:
            raise LogError(f"{path}: cannot be made: {error.strerror}") from error
        if began_unix_s is not None:
            self._write({"format": FORMAT, "began_unix_s": began_unix_s, "speedup": speedup})

    def write(self, event: Event, now_s: float) -> None:
        """Append one event."""
        self._now_s = now_s
        self._write({"t_s": now_s, "event": to_plain(event)}, spare=isinstance(event, Heard | Tick))

    def note(self, now_s: float, **fields: object) -> None:
        """Append a decision in words; replay skips this line."""
        self._write({"t_s": now_s, **fields})

    def current_place(self) -> LogPlace | None:
        """Return the end of the log; None while lines wait that the system has not accepted."""
        if self._fd < 0 or self._waiting:
            return None
        try:
            size = os.fstat(self._fd).st_size
        except OSError:
            return None
        return LogPlace(size, self._lines, self._now_s, digest_of(self._first, self._last))

    async def settle(self) -> None:
        """Wait until all lines would survive a power loss; no command is sent to a vehicle before.

        A disk may be slow or hang: the loop keeps running, and the wait ends after `DISK_S`.
        """
        wanted = self._written
        with suppress(TimeoutError):
            async with asyncio.timeout(DISK_S):
                while self._synced < wanted:
                    if self._syncing is None:
                        self._syncing = asyncio.create_task(self._sync())
                    await asyncio.shield(self._syncing)
        self._report_slow_disk(slow=self._synced < wanted)

    async def _sync(self) -> None:
        until = self._written
        try:
            await asyncio.to_thread(_sync_to_disk, self._fd)
            self._synced = until
        finally:
            self._syncing = None

    def _report_slow_disk(self, *, slow: bool) -> None:
        if slow is self._slow:
            return
        self._slow = slow
        self._report_trouble(
            f"the disk takes longer than {DISK_S:g} s to write the event log: orders no longer wait for it"
            if slow
            else "the disk writes the event log in time again"
        )

    def _report_trouble(self, text: str) -> None:
        """Report a problem to the operator, and log it once there is room again."""
        self._told(text)
        self._waiting.append(json.dumps({"t_s": self._now_s, "told": text, "level": "warning"}).encode() + b"\n")
        self._flush()

    def close(self) -> None:
        """Close the file."""
        self._flush()
        self.lost += len(self._waiting)
        self._waiting.clear()
        with suppress(OSError):
            os.close(self._fd)
        self._fd = -1

    def _write(self, line: dict[str, object], *, spare: bool = False) -> None:
        try:
            data = json.dumps(line, separators=(",", ":"), allow_nan=False).encode() + b"\n"
        except ValueError:
            data = b""
        if not data or self._fd < 0:
            self.lost += 1
            return
        stuck = bool(self._waiting)
        self._flush()
        if self._waiting and spare and len(self._waiting) >= MOST_WAITING:
            self.lost += 1
            self._dropped += 1
            return
        if self._dropped:
            self._waiting.append(json.dumps({"t_s": line.get("t_s", 0.0), GAP: self._dropped}).encode() + b"\n")
            self._dropped = 0
        self._waiting.append(data)
        self._written += 1
        self._flush()
        if bool(self._waiting) is not stuck:
            lost = f"; {self.lost} lines are lost" if self.lost else ""
            trouble = "the event log cannot be written: is the disk full? What happens is kept in memory"
            self._report_trouble(trouble if self._waiting else f"the event log is written again{lost}")

    def _flush(self) -> None:
        while self._waiting:
            rest = self._waiting[0] if self._begun == 0 else self._waiting[0][self._begun :]
            try:
                written = os.write(self._fd, rest)
            except OSError:
                return
            if written < len(rest):
                self._begun += written
                return
            self._begun = 0
            self._last = self._waiting.popleft()
            self._first = self._first or self._last
            self._lines += 1


def _sync_to_disk(fd: int) -> None:
    with suppress(OSError):
        getattr(os, "fdatasync", os.fsync)(fd)  # macOS has no fdatasync


def read_head(path: Path) -> LogHeader:
    """Return a log's first line.

    Raises:
        LogError: It cannot be read, or the file is not an event log.
    """
    try:
        with path.open("rb") as file:
            head = _expect_format(path, file.readline())
        return LogHeader(float(head["began_unix_s"]), float(head["speedup"]))
    except OSError as error:
        raise LogError(f"{path}: cannot be read: {error.strerror}") from error
    except (ValueError, KeyError, TypeError, OverflowError) as error:
        raise LogError(f"{path}: line 1: expected a log of format {FORMAT}") from error


def total_clock_step_s(path: Path, since: LogPlace | None = None) -> float:
    """Return by how many seconds the time of day was set while a log was written, from its notes."""
    return sum(step_s for note in read_notes(path, since) if is_time(step_s := note.get(CLOCK_SET)))


def _expect_format(path: Path, line: bytes) -> dict[str, Any]:
    try:
        head = json.loads(line.decode())
        known = head["format"]
    except UnicodeDecodeError as error:
        raise LogError(f"{path}: not a log: {error}") from error
    except (ValueError, KeyError, TypeError, RecursionError):
        raise LogError(f"{path}: line 1: expected a log of format {FORMAT}") from None
    if known != FORMAT:
        newer = ", written by a newer version" if str(known).startswith(FORMAT.rpartition("/")[0]) else ""
        raise LogError(f"{path}: line 1: expected a log of format {FORMAT}, got {known}{newer}")
    return dict(head)


def read_notes(path: Path, since: LogPlace | None = None) -> Iterator[dict[str, Any]]:
    """Yield the lines of a log other than events, each with its time as ``t_s``.

    Unreadable lines are skipped; `read_events` reports their errors.
    """
    with path.open(encoding="utf-8", errors="replace") as file:
        file.seek(0 if since is None else since.size)
        for line in file:
            # Most lines are events; this cheap check skips them.
            if '"event":' in line[:60] or not line.endswith("\n"):
                continue
            try:
                content = json.loads(line)
            except (ValueError, RecursionError):
                continue
            if isinstance(content, dict) and is_time(content.get("t_s")):
                yield content


def read_decisions(path: Path, since: LogPlace | None = None) -> Iterator[tuple[float, object]]:
    """Yield decisions with their times: lines for the operator, and commands as plain data."""
    for note in read_notes(path, since):
        decided = note.get("command", note.get("said"))
        if decided is not None:
            yield note["t_s"], decided


def read_events(
    path: Path, damaged: Callable[[str], None] | None = None, since: LogPlace | None = None
) -> Iterator[tuple[float, Event]]:
    """Yield the events of a log with their times; skip an incomplete last line.

    Args:
        path: The log.
        damaged: Called with a description of damage that does not prevent reading: unreadable lines, lines that were
            never written, periods without a record. If omitted, damage is an error.
        since: Where to begin, if not at the beginning.

    Raises:
        LogError: The file is not an event log, or a line before the last cannot be read.
    """
    last_s = None if since is None else since.at_s
    try:
        with path.open("rb") as file:
            _expect_format(path, file.readline())
            if since is not None:
                file.seek(since.size)
            for number, line in enumerate(file, start=2 if since is None else since.lines + 1):
                if not line.endswith(b"\n"):
                    if damaged is not None:
                        damaged(f"line {number}, the last one, is torn and was dropped")
                    return
                content = _parse_line(path, number, line, damaged)
                if damaged is not None and GAP in content:
                    damaged(f"line {number}: {content[GAP]} lines could not be written here")
                try:
                    timed = _parse_event(content)
                except (LogError, RecursionError) as error:
                    raise LogError(f"{path}: line {number}: {error}") from error
                if timed is None:
                    continue
                paused_s = 0.0 if last_s is None or isinstance(timed[1], Reopened) else timed[0] - last_s
                if damaged is not None and paused_s > LONGEST_PAUSE_S:
                    damaged(f"line {number}: nothing is on record from {last_s:.0f} to {timed[0]:.0f} s")
                last_s = timed[0]
                yield timed
    except OSError as error:
        raise LogError(f"{path}: cannot be read: {error.strerror}") from error


def _parse_line(path: Path, number: int, line: bytes, damaged: Callable[[str], None] | None) -> dict[str, Any]:
    """Return a line's object; an empty one for an unreadable line if damage is accepted."""
    reason = "expected an object"
    try:
        content = json.loads(line)
        if isinstance(content, dict):
            return content
    except (ValueError, RecursionError) as error:
        reason = f"not JSON: {error}"
    if damaged is None:
        raise LogError(f"{path}: line {number}: {reason}")
    damaged(f"line {number} cannot be read and was passed over")
    return {}


def _parse_event(content: dict[str, Any]) -> tuple[float, Event] | None:
    """Return a line's event with its time; None if the line has none."""
    if "event" not in content:
        return None
    t_s, event = content.get("t_s"), from_plain(content["event"])
    if not is_time(t_s):
        raise LogError("no time t_s")
    if not isinstance(event, Event):
        raise LogError(f"expected an event, got {event!r:.60}")
    return t_s, event
