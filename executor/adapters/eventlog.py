"""The event log: one JSON object a line, written and handed to the system before the event is applied.

Every value is a frozen dataclass, a tuple or a plain value, so one generic rule writes and reads them all: a dataclass
is an object with its class name under ``kind``, a tuple is a list.
"""

from __future__ import annotations

import dataclasses
import json
from collections.abc import Iterator
from enum import Enum
from pathlib import Path
from typing import IO, Any, get_type_hints

from executor.core import events, intents, messages
from executor.core.events import Event
from executor.errors import LogError

FORMAT = "faultline-events/1"

_KINDS: dict[str, type] = {
    name: item
    for module in (events, intents, messages)
    for name, item in vars(module).items()
    if isinstance(item, type) and dataclasses.is_dataclass(item)
}

_ENUMS: dict[str, dict[str, type[Enum]]] = {
    name: {key: hint for key, hint in get_type_hints(kind).items() if isinstance(hint, type) and issubclass(hint, Enum)}
    for name, kind in _KINDS.items()
}
"""Fields that hold a member of an enum, which stands in the log by its value."""


def to_plain(value: object) -> object:
    """Return a value that JSON can hold."""
    if dataclasses.is_dataclass(value) and not isinstance(value, type):
        fields = {field.name: to_plain(getattr(value, field.name)) for field in dataclasses.fields(value)}
        return {"kind": type(value).__name__, **fields}
    if isinstance(value, tuple):
        return [to_plain(item) for item in value]
    return value.value if isinstance(value, Enum) else value


def from_plain(value: Any) -> Any:  # noqa: ANN401 - the inverse of a generic rule
    """Return the value that `to_plain` was given.

    Raises:
        LogError: an unknown kind, or fields that do not fit it.
    """
    if isinstance(value, dict):
        fields = {key: from_plain(item) for key, item in value.items() if key != "kind"}
        try:
            for key, enum in _ENUMS[value["kind"]].items():
                fields[key] = enum(fields[key])
            return _KINDS[value["kind"]](**fields)
        except (KeyError, TypeError, ValueError) as error:
            raise LogError(f"unknown event {value.get('kind')!r}: {error}") from error
    if isinstance(value, list):
        return tuple(from_plain(item) for item in value)
    return value


class EventLog:
    """Appends events to a file; each is with the operating system when `write` returns."""

    def __init__(self, path: Path, *, began_unix_s: float, speedup: float) -> None:
        """Create the file.

        Raises:
            LogError: it exists already, or cannot be made.
        """
        try:
            self._file: IO[str] = path.open("x", encoding="utf-8", buffering=1)
        except OSError as error:
            raise LogError(f"{path}: cannot be made: {error.strerror}") from error
        self.lost = 0
        """Events that could not be written: a full disk must not end a flight."""
        self._write({"format": FORMAT, "began_unix_s": began_unix_s, "speedup": speedup})

    def write(self, event: Event, now_s: float) -> None:
        """Append one event."""
        self._write({"t_s": now_s, "event": to_plain(event)})

    def note(self, now_s: float, **fields: object) -> None:
        """Append a line that replay passes over: what was decided, in words."""
        self._write({"t_s": now_s, **fields})

    def close(self) -> None:
        """Close the file."""
        try:
            self._file.close()
        except OSError:
            self.lost += 1

    def _write(self, line: dict[str, object]) -> None:
        try:
            self._file.write(json.dumps(line, separators=(",", ":"), allow_nan=False) + "\n")
        except (OSError, ValueError):
            self.lost += 1


@dataclasses.dataclass(frozen=True, slots=True)
class Head:
    """The first line of a log."""

    began_unix_s: float
    """Seconds since 1970 at which its time is 0."""
    speedup: float


def read_head(path: Path) -> Head:
    """Return a log's first line.

    Raises:
        LogError: it cannot be read, or is not such a log.
    """
    try:
        with path.open(encoding="utf-8") as file:
            head = json.loads(file.readline())
        if head["format"] != FORMAT:
            raise LogError(f"{path}: line 1: expected a log of format {FORMAT}")
        return Head(float(head["began_unix_s"]), float(head["speedup"]))
    except OSError as error:
        raise LogError(f"{path}: cannot be read: {error.strerror}") from error
    except (ValueError, KeyError, TypeError) as error:
        raise LogError(f"{path}: line 1: expected a log of format {FORMAT}") from error


def read_decisions(path: Path) -> Iterator[tuple[float, object]]:
    """Yield what the log holds beside events, with its time: lines that were said, and commands as plain data.

    A line that cannot be read is passed over; `read_events` says what is wrong with it.
    """
    with path.open(encoding="utf-8", errors="replace") as file:
        for line in file:
            # Most lines are events; a cheap look tells them apart.
            if '"event":' in line[:60] or not line.endswith("\n"):
                continue
            try:
                content = json.loads(line)
            except json.JSONDecodeError:
                continue
            if isinstance(content, dict) and "t_s" in content:
                decided = content.get("command", content.get("said"))
                if decided is not None:
                    yield content["t_s"], decided


def read_events(path: Path) -> Iterator[tuple[float, Event]]:
    """Yield the events of a log with their times.

    Raises:
        LogError: not such a log, or a line in its midst cannot be read; a torn last line is passed over.
    """
    try:
        with path.open(encoding="utf-8") as file:
            head = file.readline()
            if f'"{FORMAT}"' not in head:
                raise LogError(f"{path}: line 1: expected a log of format {FORMAT}")
            for number, line in enumerate(file, start=2):
                if not line.endswith("\n"):
                    return
                try:
                    content = json.loads(line)
                except json.JSONDecodeError as error:
                    raise LogError(f"{path}: line {number}: not JSON: {error}") from error
                try:
                    timed = _timed(content)
                except LogError as error:
                    raise LogError(f"{path}: line {number}: {error}") from error
                if timed is not None:
                    yield timed
    except UnicodeDecodeError as error:
        raise LogError(f"{path}: not a log: {error}") from error
    except OSError as error:
        raise LogError(f"{path}: cannot be read: {error.strerror}") from error


def _timed(content: object) -> tuple[float, Event] | None:
    """Return the event of a line with its time; None for a line that has none."""
    if not isinstance(content, dict):
        raise LogError("expected an object")
    if "event" not in content:
        return None
    if not isinstance(content.get("t_s"), int | float):
        raise LogError("no time t_s")
    return content["t_s"], from_plain(content["event"])
