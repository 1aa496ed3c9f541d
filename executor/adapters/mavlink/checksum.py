"""MAVLink's checksum, for who reads frames without pymavlink."""

from __future__ import annotations

from binascii import crc_hqx

_REVERSED = bytes(int(f"{byte:08b}"[::-1], 2) for byte in range(256))


def compute_checksum(data: bytes) -> int:
    """Return MAVLink's checksum (CRC-16/MCRF4XX): the standard library's runs the other way round.

    >>> checksum(b"123456789") == 0x6F91
    True
    """
    turned = crc_hqx(data.translate(_REVERSED), 0xFFFF)
    return _REVERSED[turned >> 8] | _REVERSED[turned & 255] << 8
