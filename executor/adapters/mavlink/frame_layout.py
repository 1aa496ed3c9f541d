"""Where the parts of a MAVLink frame are, of both versions: header, checksum, signature, and integer parameters.

MAVLink 2 message signing (mavlink.io): who holds the key may talk. A frame ends with a link id, a time of 48 bits and
the first 48 bits of a SHA-256 over the key and all that is before. Nothing is believed of a frame before its signature
is: not its time, and not that there is such a stream.
"""

from __future__ import annotations

import hashlib
import hmac
import struct
from collections.abc import Callable
from enum import Enum
from typing import Any

from pymavlink.generator.mavcrc import x25crc

V1, V2 = 0xFE, 0xFD
HEADS = {V1: 6, V2: 10}
"""Header lengths by the byte that frames of both versions begin with."""
CHECKSUM = 2
"""Bytes of it."""


def message_id_of(frame: bytes | bytearray) -> int:
    """Return the message id of a frame."""
    return frame[5] if frame[0] == V1 else int.from_bytes(frame[7:10], "little")


def payload_of(frame: bytes | bytearray, size: int) -> bytes:
    """Return the first bytes of what a frame says; zeros at its end are not sent."""
    begins = HEADS[frame[0]]
    return bytes(frame[begins : begins + min(frame[1], size)]).ljust(size, b"\0")


def has_valid_checksum(frame: bytes | bytearray, extra: int) -> bool:
    """Return whether a frame has its checksum, of which its message's CRC_EXTRA is a part."""
    stop = HEADS[frame[0]] + frame[1]
    if stop + CHECKSUM > len(frame):
        return False
    return bool(x25crc(bytes(frame[1:stop]) + bytes((extra,))).crc == frame[stop] | frame[stop + 1] << 8)


AUTOPILOT_ARDUPILOT = 3
INTEGER_TYPES = frozenset(range(1, 9))
"""MAV_PARAM_TYPE 1 to 8 are the integers."""


def from_wire(value: float, kind: int, autopilot: int | None) -> float:
    """Return the value of a parameter of MAV_PARAM_TYPE `kind`."""
    if _is_bitwise(kind, autopilot):
        return float(struct.unpack("<i", struct.pack("<f", value))[0])
    return float(value)


def to_wire(value: float, kind: int, autopilot: int | None) -> float:
    """Return what stands in the field for a value."""
    if _is_bitwise(kind, autopilot):
        return float(struct.unpack("<f", struct.pack("<i", round(value)))[0])
    return value


def _is_bitwise(kind: int, autopilot: int | None) -> bool:
    """Return whether the bits of an integer stand where the float would; ArduPilot alone sends its value as a float."""
    return kind in INTEGER_TYPES and autopilot not in {None, AUTOPILOT_ARDUPILOT}


SIGNED_FLAG = 1
"""The one flag that a receiver may not know (mavlink.io, Serialization)."""
SIGNATURE_BYTES, TIMED_BYTES = 13, 12
"""Link id, time and hash; time and hash."""
EPOCH_UNIX_S = 1420070400
"""2015-01-01: the times of signatures count from there, in steps of 10 us."""
TICKS_PER_S = 100_000
NEW_STREAM_S = 60
"""A stream that was never heard may be as old as this; an older frame was recorded once and is sent again."""


class FrameRejection(Enum):
    """Why a frame is not believed."""

    UNSIGNED = "unsigned"
    FORGED = "forged"
    REPLAYED = "replayed"


class LinkSigning:
    """Signs what goes out on one link, and looks at what comes in."""

    def __init__(self, key: bytes, link_id: int, unix_s: Callable[[], float]) -> None:
        """Begin knowing no stream.

        Args:
            key: 32 bytes that the vehicles hold as well.
            link_id: Tells this link from our others: each has a time of its own.
            unix_s: A clock that does not go back, over restarts neither.
        """
        self._key = key
        self._link_id = link_id % 256
        self._unix_s = unix_s
        self._newest: dict[tuple[int, int, int], int] = {}

    def timestamp_ticks(self) -> int:
        """Return the time for a signature."""
        return max(0, round((self._unix_s() - EPOCH_UNIX_S) * TICKS_PER_S))

    def prepare(self, packer: Any) -> None:  # noqa: ANN401 - pymavlink's classes are untyped
        """Have pymavlink's packer sign the next frame."""
        signing = packer.signing
        signing.secret_key, signing.link_id, signing.sign_outgoing = self._key, self._link_id, True
        signing.timestamp = max(signing.timestamp, self.timestamp_ticks())  # it counts on by itself

    def check_signature(self, frame: bytes, sysid: int, compid: int) -> FrameRejection | None:
        """Return why a whole frame with a good checksum is not believed; None if it is."""
        if frame[0] != 0xFD or not frame[2] & SIGNED_FLAG:
            return FrameRejection.UNSIGNED
        expected = hashlib.sha256(self._key + frame[:-6]).digest()[:6]
        if not hmac.compare_digest(expected, frame[-6:]):
            return FrameRejection.FORGED
        stream = (frame[-SIGNATURE_BYTES], sysid, compid)
        ticks = int.from_bytes(frame[-TIMED_BYTES:-6], "little")
        oldest = self._newest.get(stream, self.timestamp_ticks() - NEW_STREAM_S * TICKS_PER_S)
        if ticks <= oldest:
            return FrameRejection.REPLAYED
        self._newest[stream] = ticks
        return None
