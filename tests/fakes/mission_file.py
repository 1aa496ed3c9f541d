"""ArduPilot's side of MAVFTP, as far as its mission goes, message by message.

Written by GCS_FTP.cpp and AP_Filesystem_Mission.cpp; nothing is shared with the simulated vehicles, nor with ours.
"""

from __future__ import annotations

import binascii
from collections.abc import Callable, Sequence

from pymavlink.dialects.v20 import common as mav

from executor.core.interface.messages import FileReply, FileRequest
from missions import MissionItem

FAIL, INVALID_SESSION, FILE_NOT_FOUND = 1, 4, 10
TERMINATE, WRITE, OPEN_TO_WRITE, CALC_CRC32 = 1, 7, 11, 14
HEADER_BYTES, ITEM_BYTES = 10, 38
OLD = b"\x3d\x76\0\0\x01\0\0\0\x63\0"
"""What the memory of a file holds before it is written: the header of an earlier one."""


class FakeMissionFile:
    """The one file that can be open."""

    def __init__(
        self, put: Callable[[int, list[MissionItem]], None], on_board: Callable[[], Sequence[MissionItem]]
    ) -> None:
        """Begin with no file open."""
        self.there_is_one = False
        """Whether this firmware has mission files at all."""
        self.data: bytearray | None = None
        self.session = -1
        self.heard_s = float("-inf")
        self.repeats_checksum = True
        """Whether it knows the checksum of a file."""
        self._put, self._on_board = put, on_board
        self._last: tuple[int, int, FileReply] | None = None

    def hear(self, asked: FileRequest, now_s: float) -> FileReply:
        """Answer a request; one that comes twice in a row is answered as before."""
        if self._last is not None and self._last[:2] == (asked.session, asked.number):
            return self._last[2]
        error, data = self._do(asked, now_s)
        self.heard_s = now_s
        answer = FileReply(asked.number, asked.session, error, data)
        self._last = (asked.session, asked.number, answer)
        return answer

    def _do(self, asked: FileRequest, now_s: float) -> tuple[int | None, bytes]:
        if self.data is not None and asked.session != self.session:
            if asked.operation == TERMINATE:
                return None, b""
            if now_s - self.heard_s < 3.0:
                return INVALID_SESSION, b""
            self.close()
        if asked.operation == TERMINATE:
            self.close()
            return None, b""
        if asked.operation == CALC_CRC32:
            return (None, self._checksum()) if self.repeats_checksum and self.there_is_one else (FAIL, b"")
        if asked.operation == OPEN_TO_WRITE:
            if self.data is not None:
                return FAIL, b""
            if not self.there_is_one or asked.data != b"@MISSION/mission.dat":
                return FILE_NOT_FOUND, b""
            self.data, self.session = bytearray(), asked.session
            return None, b""
        if self.data is None:
            return FILE_NOT_FOUND, b""
        if asked.operation != WRITE:
            return FAIL, b""
        end = asked.offset + len(asked.data)
        self.data += OLD[len(self.data) : end] + bytes(max(0, end - max(len(self.data), len(OLD))))
        self.data[asked.offset : end] = asked.data
        return None, b""

    def close(self) -> None:
        """Close it, whoever asks for that; what is whole takes effect."""
        written, self.data, self.session = self.data, None, -1
        if not written or len(written) < HEADER_BYTES:
            return
        magic, _, options, start, count = (int.from_bytes(written[at : at + 2], "little") for at in range(0, 10, 2))
        rows = [bytes(written[at : at + ITEM_BYTES]) for at in range(HEADER_BYTES, len(written), ITEM_BYTES)]
        if (magic, options, count) == (0x763D, 1, len(rows)) and all(any(row) for row in rows):
            self._put(start, list(map(_unpack, rows)))

    def _checksum(self) -> bytes:
        items = self._on_board()
        head = b"".join(number.to_bytes(2, "little") for number in (0x763D, 0, 0, 0, len(items)))
        crc = binascii.crc32(head + b"".join(map(_pack, items)), 0xFFFFFFFF) ^ 0xFFFFFFFF
        return crc.to_bytes(4, "little")


def _pack(item: MissionItem) -> bytes:
    message = mav.MAVLink_mission_item_int_message(
        0, 0, item.seq, item.frame, item.command, int(item.current), int(item.autocontinue), item.param1, item.param2,
        item.param3, item.param4, item.x, item.y, item.z, 0,
    )  # fmt: skip
    frame = message.pack(mav.MAVLink(None))
    return bytes(frame[10 : 10 + frame[1]]).ljust(ITEM_BYTES, b"\0")


def _unpack(row: bytes) -> MissionItem:
    frame = bytes([0xFD, ITEM_BYTES, 0, 0, 0, 1, 1, mav.MAVLINK_MSG_ID_MISSION_ITEM_INT, 0, 0]) + row
    crc = mav.x25crc(frame[1:] + bytes([mav.MAVLink_mission_item_int_message.crc_extra])).crc
    read = mav.MAVLink(None).decode(bytearray(frame + crc.to_bytes(2, "little")))
    return MissionItem(
        read.seq, read.frame, read.command, read.param1, read.param2, read.param3, read.param4, read.x, read.y, read.z,
        bool(read.current), bool(read.autocontinue),
    )  # fmt: skip
