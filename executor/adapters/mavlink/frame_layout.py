"""Layout of MAVLink frames, versions 1 and 2: header, checksum, signature, and integer parameters.

MAVLink 2 message signing (mavlink.io) authenticates holders of the key. A frame ends with a link id, a time of 48 bits
and the first 48 bits of a SHA-256 over the key and all bytes before. Nothing in a frame is trusted before its signature
is verified: neither its time nor that its stream exists.
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
"""Header lengths by the start byte of each version."""
CHECKSUM = 2
"""Bytes of the checksum."""


def message_id_of(frame: bytes | bytearray) -> int:
    """Return the message id of a frame."""
    return frame[5] if frame[0] == V1 else int.from_bytes(frame[7:10], "little")


def payload_of(frame: bytes | bytearray, size: int) -> bytes:
    """Return the first bytes of a frame's payload; trailing zeros, which are not sent, are restored."""
    begins = HEADS[frame[0]]
    return bytes(frame[begins : begins + min(frame[1], size)]).ljust(size, b"\0")


def has_valid_checksum(frame: bytes | bytearray, extra: int) -> bool:
    """Return whether a frame's checksum is valid; it includes the message's CRC_EXTRA."""
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
    """Return the field's content for a value."""
    if _is_bitwise(kind, autopilot):
        return float(struct.unpack("<f", struct.pack("<i", round(value)))[0])
    return value


def _is_bitwise(kind: int, autopilot: int | None) -> bool:
    """Return whether an integer's bits fill the float field; ArduPilot alone sends its value as a float."""
    return kind in INTEGER_TYPES and autopilot not in {None, AUTOPILOT_ARDUPILOT}


SIGNED_FLAG = 1
"""The only flag that a receiver may ignore (mavlink.io, Serialization)."""
SIGNATURE_BYTES, TIMED_BYTES = 13, 12
"""Link id, time and hash; time and hash."""
EPOCH_UNIX_S = 1420070400
"""2015-01-01: epoch of signature times, which count in steps of 10 us."""
TICKS_PER_S = 100_000
NEW_STREAM_S = 60
"""Most seconds that a new stream's time may lag; an older frame is a replay."""


class FrameRejection(Enum):
    """Reason for rejecting a frame."""

    UNSIGNED = "unsigned"
    FORGED = "forged"
    REPLAYED = "replayed"


class LinkSigning:
    """Sign one link's outgoing frames, and check its incoming ones."""

    def __init__(self, key: bytes, link_id: int, unix_s: Callable[[], float]) -> None:
        """Start without known streams.

        Args:
            key: 32 bytes, shared with the vehicles.
            link_id: Id of this link: each of our links has its own time.
            unix_s: A clock that never goes back, even across restarts.
        """
        self._key = key
        self._link_id = link_id % 256
        self._unix_s = unix_s
        self._newest: dict[tuple[int, int, int], int] = {}

    def timestamp_ticks(self) -> int:
        """Return the time for a signature."""
        return max(0, round((self._unix_s() - EPOCH_UNIX_S) * TICKS_PER_S))

    def prepare(self, packer: Any) -> None:  # noqa: ANN401 - pymavlink's classes are untyped
        """Make pymavlink's packer sign the next frame."""
        signing = packer.signing
        signing.secret_key, signing.link_id, signing.sign_outgoing = self._key, self._link_id, True
        signing.timestamp = max(signing.timestamp, self.timestamp_ticks())  # it increments it

    def check_signature(self, frame: bytes, sysid: int, compid: int) -> FrameRejection | None:
        """Return why a complete frame with a valid checksum is rejected; None if it is accepted."""
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
