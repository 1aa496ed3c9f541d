"""pymavlink's codec alone over our own telemetry logs: the reference for the ground station's cost."""

from __future__ import annotations

import struct
import time
from collections.abc import Iterator, Sequence
from pathlib import Path

from pymavlink.dialects.v20 import ardupilotmega as mavlink

STAMP = struct.Struct(">Q")


def measure_bare_codec_s(logs: Sequence[Path], launched_usec: float) -> float:
    """Return the processor time that pymavlink alone needs for the frames since the launch, log by log."""
    spent_s = 0.0
    for path in logs:
        content, codec = path.read_bytes(), mavlink.MAVLink(None)
        began_s = time.process_time()
        for usec, frame in _read_frames(content):
            if usec >= launched_usec:
                codec.decode(bytearray(frame))
        spent_s += time.process_time() - began_s
    return spent_s


def _read_frames(content: bytes) -> Iterator[tuple[int, bytes]]:
    """Yield the timed frames of our own log; all are complete MAVLink 2."""
    at = 0
    while at + STAMP.size + 12 <= len(content):
        size = 12 + content[at + 9] + 13 * (content[at + 10] & 1)
        yield STAMP.unpack_from(content, at)[0], content[at + 8 : at + 8 + size]
        at += STAMP.size + size
