"""ArduPilot's mission as a file over MAVFTP, after GCS_FTP.cpp and AP_Filesystem_Mission.cpp: to write alone.

Measured on Copter 4.7-dev: a file that is closed without its header changes nothing; a part of a list is put in place
at once, and restarts the leg once; what stands behind it stays.
"""

from __future__ import annotations

import struct
import zlib
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from enum import IntEnum

from missions.items import MissionItem
from simulator.messages import FileOperation, FileRequest, Outbound, Peer, build_message

NAME = b"@MISSION/mission.dat"
MAGIC, KEEP_REST = 0x763D, 1
HEADER = struct.Struct("<HHHHH")
"""Magic, kind of list, options, first item, number of items."""
ITEM = struct.Struct("<4fiifHHBBBBBB")
CHECKSUM = struct.Struct("<I")
REPLY = struct.Struct("<HBBBBBxI")
REPLY_BYTES = 251
SESSION_S = 3.0
"""After so long without a request another station may take over."""
SLOWS_S = 1.0
"""For so long after an answer all streams are slower."""


class Error(IntEnum):
    """MAVFTP's errors."""

    FAIL = 1
    INVALID_SESSION = 4
    FILE_NOT_FOUND = 10


@dataclass(frozen=True, slots=True)
class FilePart:
    """What a mission file that was closed wants to have in place."""

    first: int
    items: tuple[MissionItem, ...]
    keeps_rest: bool


Put = Callable[[FilePart], None]


class MissionFileServer:
    """The one file that can be open at a time."""

    def __init__(self) -> None:
        self._open: bytearray | None = None
        self._session = -1
        self._answered_s = float("-inf")
        self._last: tuple[tuple[Peer, int, int], Outbound] | None = None
        """To whom the last answer went, in which session and to which request: to the same again it is repeated."""

    def is_active(self, now_s: float) -> bool:
        """Return whether it sends answers just now."""
        return now_s - self._answered_s < SLOWS_S

    def handle(
        self, request: FileRequest, sender: Peer, now_s: float, items: Sequence[MissionItem], put: Put, *, refuses: bool
    ) -> Outbound:
        """Return the answer to a request.

        Args:
            request: Of a station.
            sender: Which.
            now_s: The time.
            items: The mission on board.
            put: Takes what a file that was closed wants to have in place.
            refuses: Whether no file can be opened.
        """
        asked = sender, request.session, request.number
        if self._last is not None and self._last[0] == asked:
            self._answered_s = now_s
            return self._last[1]
        frame = _build_answer(request, sender, self._carry_out(request, now_s, items, put, refuses=refuses))
        self._last = asked, frame
        ends = request.operation == FileOperation.TERMINATESESSION
        self._answered_s = float("-inf") if ends else now_s
        return frame

    def _carry_out(
        self, request: FileRequest, now_s: float, items: Sequence[MissionItem], put: Put, *, refuses: bool
    ) -> bytes | Error:
        ends = request.operation in {FileOperation.TERMINATESESSION, FileOperation.RESETSESSION}
        if request.session != self._session:
            if ends:
                return b""
            if self._open is not None and now_s - self._answered_s < SESSION_S:
                return Error.INVALID_SESSION
            self._close(put)
        if ends:
            self._close(put)
            return b""
        if request.operation == FileOperation.CALCFILECRC:
            return CHECKSUM.pack(compute_checksum(items)) if request.data == NAME else Error.FILE_NOT_FOUND
        if request.operation in {FileOperation.OPENFILEWO, FileOperation.CREATEFILE}:
            return self._open_file(request, refuses=refuses)
        return self._write(request) if request.operation == FileOperation.WRITEFILE else Error.FAIL

    def _open_file(self, request: FileRequest, *, refuses: bool) -> bytes | Error:
        if self._open is not None:
            return Error.FAIL
        if refuses or request.data.rstrip(b"\0") != NAME:
            return Error.FILE_NOT_FOUND
        self._open, self._session = bytearray(), request.session
        return b""

    def _write(self, request: FileRequest) -> bytes | Error:
        if self._open is None:
            return Error.FILE_NOT_FOUND
        end = request.offset + len(request.data)
        self._open.extend(bytes(max(0, end - len(self._open))))
        self._open[request.offset : end] = request.data
        return b""

    def _close(self, put: Put) -> None:
        written, self._open, self._session = self._open, None, -1
        part = None if written is None else _read_part(bytes(written))
        if part is not None:
            put(part)


def _read_part(data: bytes) -> FilePart | None:
    """Return what a file says; None where a part of it was not written."""
    if len(data) < HEADER.size:
        return None
    magic, _, options, first, count = HEADER.unpack_from(data)
    body = data[HEADER.size :]
    rows = [body[at : at + ITEM.size] for at in range(0, len(body) - ITEM.size + 1, ITEM.size)]
    if magic != MAGIC or len(rows) != count or not all(map(any, rows)):
        return None
    return FilePart(first, tuple(map(_read_item, rows)), bool(options & KEEP_REST))


def _read_item(row: bytes) -> MissionItem:
    one, two, three, four, x, y, z, seq, command, _, _, frame, current, goes_on, _ = ITEM.unpack(row)
    return MissionItem(seq, frame, command, one, two, three, four, x, y, z, bool(current), bool(goes_on))


def compute_checksum(items: Sequence[MissionItem]) -> int:
    """Return the CRC32 of the file that these items make, with nothing inverted before and after it."""
    data = HEADER.pack(MAGIC, 0, 0, 0, len(items)) + b"".join(
        ITEM.pack(
            item.param1, item.param2, item.param3, item.param4, item.x, item.y, item.z, item.seq, item.command, 0, 0,
            item.frame, item.current, item.autocontinue, 0,
        )
        for item in items
    )  # fmt: skip
    return ~zlib.crc32(data, 0xFFFFFFFF) & 0xFFFFFFFF


def _build_answer(request: FileRequest, to: Peer, answer: bytes | Error) -> Outbound:
    accepted = isinstance(answer, bytes)
    opcode, data = (FileOperation.ACK, answer) if isinstance(answer, bytes) else (FileOperation.NAK, bytes([answer]))
    offset = request.offset if request.operation == FileOperation.WRITEFILE and accepted else 0
    head = REPLY.pack((request.number + 1) & 0xFFFF, request.session, opcode, len(data), request.operation, 0, offset)
    return build_message(
        "FILE_TRANSFER_PROTOCOL", target_network=0, target_system=to.sysid, target_component=to.compid,
        payload=list((head + data).ljust(REPLY_BYTES, b"\0")),
    )  # fmt: skip
