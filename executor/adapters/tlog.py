"""One .tlog per vehicle: microseconds since 1970, big-endian, then the frame as it was on the wire, both directions."""

from __future__ import annotations

import struct
from collections.abc import Callable
from pathlib import Path

_STAMP = struct.Struct(">Q")


class TelemetryLog:
    """Appends frames to a file that MAVProxy, QGroundControl and pymavlink read."""

    def __init__(self, path: Path, label_usec: Callable[[], int]) -> None:
        """Open `path` for appending; `label_usec` gives each frame's time."""
        self._file = path.open("ab")
        self._label_usec = label_usec
        self.lost = 0
        """Frames that could not be written: a full disk must not end a flight."""

    def write(self, frame: bytes) -> None:
        """Append one frame."""
        try:
            self._file.write(_STAMP.pack(self._label_usec()) + frame)
        except OSError:
            self.lost += 1

    def close(self) -> None:
        """Flush and close."""
        try:
            self._file.close()
        except OSError:
            self.lost += 1
