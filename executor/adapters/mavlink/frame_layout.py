"""Where the parts of a MAVLink frame are, of both versions, and its checksum: for readers without pymavlink."""

from __future__ import annotations

from binascii import crc_hqx

V1, V2 = 0xFE, 0xFD
HEADS = {V1: 6, V2: 10}
"""Header lengths by the byte that frames of both versions begin with."""
CHECKSUM = 2
"""Bytes of it."""
_REVERSED = bytes(int(f"{byte:08b}"[::-1], 2) for byte in range(256))


def compute_checksum(data: bytes) -> int:
    """Return MAVLink's checksum (CRC-16/MCRF4XX): the standard library's runs the other way round.

    >>> checksum(b"123456789") == 0x6F91
    True
    """
    turned = crc_hqx(data.translate(_REVERSED), 0xFFFF)
    return _REVERSED[turned >> 8] | _REVERSED[turned & 255] << 8


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
    return compute_checksum(bytes(frame[1:stop]) + bytes((extra,))) == frame[stop] | frame[stop + 1] << 8
