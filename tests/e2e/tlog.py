"""Telemetry logs, read with pymavlink's definitions: only the messages that are wanted are taken apart."""

from __future__ import annotations

import struct
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from pymavlink.dialects.v20 import common as mav

STAMP = 8
"""Microseconds since 1970, big-endian, before every frame."""


def messages(log: Path, *names: str) -> Iterator[tuple[float, Any]]:
    """Yield the messages of these names, each with its time in seconds since 1970."""
    wanted = {number for number, kind in mav.mavlink_map.items() if kind.msgname in names}
    codec, data, at = mav.MAVLink(None), log.read_bytes(), 0
    while at + STAMP + 3 <= len(data):
        frame = at + STAMP
        if data[frame] == mav.PROTOCOL_MARKER_V2:
            size = 12 + data[frame + 1] + (mav.MAVLINK_SIGNATURE_BLOCK_LEN if data[frame + 2] & 1 else 0)
            number = int.from_bytes(data[frame + 7 : frame + 10], "little")
        else:
            assert data[frame] == mav.PROTOCOL_MARKER_V1, f"{log}: expected a frame at {frame}"
            size, number = 8 + data[frame + 1], data[frame + 5]
        if number in wanted and frame + size <= len(data):
            yield struct.unpack_from(">Q", data, at)[0] / 1e6, codec.decode(bytearray(data[frame : frame + size]))
        at = frame + size
