"""Write one .tlog per vehicle: microseconds since 1970, big-endian, then the frame as sent, both directions.

A large log, or one that another process began, is left unchanged: the next part has a number in its name.
"""

from __future__ import annotations

import itertools
import struct
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import IO

MOST_BYTES = 64_000_000
"""Most bytes of one part: about ten hours of one vehicle, and small enough for other programs."""
HELD_USEC = 1_000_000
"""Longest time that frames are buffered; they are lost if the process is killed."""
_STAMP = struct.Struct(">Q")


class TelemetryLog:
    """Append frames to a file that MAVProxy, QGroundControl and pymavlink read."""

    def __init__(self, path: Path, label_usec: Callable[[], int], *, most_bytes: int = MOST_BYTES) -> None:
        """Begin a new part of the log at `path`; `label_usec` returns each frame's time."""
        self._path = path
        self._label_usec = label_usec
        self._most_bytes = most_bytes
        self._bytes = 0
        self._flushed_usec = 0
        self._file = self._open_part()

    def write(self, frame: bytes) -> None:
        """Append one frame if there is room: a full disk must not end a flight."""
        usec = self._label_usec()
        with suppress(OSError, ValueError):
            if self._bytes >= self._most_bytes:
                self._file.close()
                self._file, self._bytes = self._open_part(), 0
            self._bytes += self._file.write(_STAMP.pack(usec) + frame)
        if abs(usec - self._flushed_usec) >= HELD_USEC:
            self._flushed_usec = usec
            with suppress(OSError, ValueError):  # then it stays buffered until there is room
                self._file.flush()

    def close(self) -> None:
        """Flush and close."""
        with suppress(OSError):
            self._file.close()

    def _open_part(self) -> IO[bytes]:
        """Create the first part that does not exist yet: uav1.tlog, uav1-1.tlog, uav1-2.tlog ..."""
        for number in itertools.count():
            path = self._path if number == 0 else self._path.with_stem(f"{self._path.stem}-{number}")
            try:
                return path.open("xb")
            except FileExistsError:
                continue
        raise AssertionError("there is always a next number")
