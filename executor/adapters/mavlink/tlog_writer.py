"""One .tlog per vehicle: microseconds since 1970, big-endian, then the frame as it was on the wire, both directions.

A log that has grown large, or that another process began, is left as it is: the next part has a number in its name.
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
    """Appends frames to a file that MAVProxy, QGroundControl and pymavlink read."""

    def __init__(self, path: Path, label_usec: Callable[[], int], *, most_bytes: int = MOST_BYTES) -> None:
        """Begin a new part of the log at `path`; `label_usec` gives each frame's time."""
        self._path = path
        self._label_usec = label_usec
        self._most_bytes = most_bytes
        self._bytes = 0
        self._flushed_usec = 0
        self._file = self._open_part()

    def write(self, frame: bytes) -> None:
        """Append one frame, where there is room: a full disk must not end a flight."""
        usec = self._label_usec()
        with suppress(OSError, ValueError):
            if self._bytes >= self._most_bytes:
                self._file.close()
                self._file, self._bytes = self._open_part(), 0
            self._bytes += self._file.write(_STAMP.pack(usec) + frame)
        if abs(usec - self._flushed_usec) >= HELD_USEC:
            self._flushed_usec = usec
            with suppress(OSError, ValueError):  # then it stays where it is until there is room
                self._file.flush()

    def close(self) -> None:
        """Flush and close."""
        with suppress(OSError):
            self._file.close()

    def _open_part(self) -> IO[bytes]:
        """Make the first part that is not there yet: uav1.tlog, uav1-1.tlog, uav1-2.tlog ..."""
        for number in itertools.count():
            path = self._path if number == 0 else self._path.with_stem(f"{self._path.stem}-{number}")
            try:
                return path.open("xb")
            except FileExistsError:
                continue
        raise AssertionError("there is always a next number")
