"""The end of an event log, read without the rest: a log of ten hours is larger than anybody can wait for."""

from __future__ import annotations

import hashlib
import json
import os
import sys
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import TypeGuard

PIECE_BYTES = 64 * 1024
"""A log is read from its end in pieces of this size."""


@dataclass(frozen=True, slots=True)
class LogPlace:
    """The end of a whole line in a log, and how to know that log again."""

    size: int
    """Bytes up to there."""
    lines: int
    at_s: float
    """Time of the last event before it."""
    digest: str
    """Of the log's first line, and of the last one before this place."""


def digest_of(first: bytes, last: bytes) -> str:
    """Return what a place is known by."""
    return hashlib.sha256(first + last).hexdigest()


def is_place_in_log(path: Path, place: LogPlace) -> bool:
    """Return whether a place lies in this log: the same flight has written both."""
    with suppress(OSError):
        if 0 < place.size <= path.stat().st_size:
            first, last = read_ends(path, place.size)
            return last.endswith(b"\n") and digest_of(first, last) == place.digest
    return False


def read_ends(path: Path, size: int) -> tuple[bytes, bytes]:
    """Return the first line of a log, and the last one of its first `size` bytes."""
    with path.open("rb") as file:
        first = file.readline()
        tail, begin = b"", size
        while begin > 0 and b"\n" not in tail[:-1]:
            piece = min(begin, PIECE_BYTES)
            begin -= piece
            file.seek(begin)
            tail = file.read(piece) + tail
    return first, tail[tail.rfind(b"\n", 0, -1) + 1 :]


def count_whole_bytes(path: Path) -> int:
    """Return how many bytes of a log are whole lines."""
    with path.open("rb") as file:
        end = file.seek(0, os.SEEK_END)
        while end > 0:
            begin = max(0, end - PIECE_BYTES)
            file.seek(begin)
            at = file.read(end - begin).rfind(b"\n")
            if at >= 0:
                return begin + at + 1
            end = begin
    return 0


def count_lines_after(path: Path, place: LogPlace | None) -> int:
    """Return how many whole lines follow a place, or are in the whole log."""
    lines = 0
    with path.open("rb") as file:
        file.seek(0 if place is None else place.size)
        while piece := file.read(PIECE_BYTES):
            lines += piece.count(b"\n")
    return lines


def is_flight_finished(path: Path) -> bool:
    """Return whether the last that a log holds is that nothing is left to supervise."""
    with path.open("rb") as file:
        size = file.seek(0, os.SEEK_END)
        file.seek(max(0, size - PIECE_BYTES))
        return b'"command":{"kind":"Finish"' in file.read(PIECE_BYTES)


def read_last_event_s(path: Path) -> float | None:
    """Return the time of a log's last event; None if it holds none."""
    with path.open("rb") as file:
        begin, after = count_whole_bytes(path), b""
        while begin > 0:
            piece = min(begin, PIECE_BYTES)
            begin -= piece
            file.seek(begin)
            after, *lines = (file.read(piece) + after).split(b"\n")
            for line in reversed(lines):
                t_s = _parse_event_time_s(line)
                if t_s is not None:
                    return t_s
    return None


def _parse_event_time_s(line: bytes) -> float | None:
    if b'"event":' not in line[:60]:
        return None
    with suppress(ValueError, TypeError, KeyError, RecursionError):
        t_s = json.loads(line)["t_s"]
        return float(t_s) if is_time(t_s) else None
    return None


def is_time(value: object) -> TypeGuard[float]:
    """Return whether this can be a time of the flight."""
    return isinstance(value, int | float) and abs(value) <= sys.float_info.max
