"""Bytes to MAVLink frames: out of datagrams, and out of streams that have noise in them and are cut anywhere."""

from __future__ import annotations

import re
import struct
import sys
from collections.abc import Collection
from typing import Any

from pymavlink.dialects.v20 import ardupilotmega as mav

from executor.adapters.mavlink import message_readers
from executor.adapters.mavlink.frame_layout import CHECKSUM, HEADS, V1, V2, has_valid_checksum, message_id_of

SIGNATURE, SIGNED = 13, 1
"""Bytes of a signature, and the one flag that a receiver may not know (mavlink.io, Serialization)."""
MARK = re.compile(b"[%c%c]" % (V1, V2))

OF_ANYBODY = frozenset({mav.MAVLINK_MSG_ID_HEARTBEAT, mav.MAVLINK_MSG_ID_RADIO_STATUS})
"""Messages that are read from any sender; of the rest it is enough that they are whole."""

MOST_WRONG = 500
"""Marks at once that begin no frame, until all that came with them is noise: 60 kB of them took 0.4 s to go through."""


class FrameParser:
    """Cuts a stream of bytes into frames, wherever it was cut on its way.

    A frame counts only with its checksum. Where there is none the search goes on one byte later, so that a start mark
    among noise costs no frame that follows it. The checksum of a message that pymavlink does not know cannot be seen:
    in a datagram such a frame counts where another or the end follows it, as there is no noise between.
    """

    def __init__(self, *, in_datagrams: bool = False, systems: Collection[int] | None = None) -> None:
        """Begin with nothing.

        Args:
            in_datagrams: Whether nothing but frames is to be expected.
            systems: Whose frames are taken apart, everybody's if None. A flood of strangers' must not cost what the
                fleet's do: of theirs all but `OF_ANYBODY` come as unknown messages, with their header.
        """
        self._systems = systems
        self._mav = mav.MAVLink(None)
        self._in_datagrams = in_datagrams
        self._buffer = bytearray()
        self._in_garbage = False
        self.garbage = 0
        """How many runs of bytes were no frame."""

    def feed(self, data: bytes) -> list[Any]:
        """Take the next bytes; return the frames that are whole now."""
        self._buffer += data
        frames, at, wrong = [], 0, 0
        while (end := self._find_frame_end(at)) <= len(self._buffer):
            frame = self._parse_frame(at, end)
            if frame is None:
                self.garbage += not self._in_garbage
                wrong += self._buffer[at] in HEADS
                at = self._find_mark(at + 1) if wrong < MOST_WRONG else len(self._buffer)
            else:
                frames.append(frame)
                at = end
            self._in_garbage = frame is None
        del self._buffer[:at]
        return frames

    def close(self) -> int:
        """Give up what is unfinished; return how many runs of bytes were no frame so far."""
        self.garbage += bool(self._buffer) and not self._in_garbage
        self._buffer.clear()
        self._in_garbage = False
        return self.garbage

    def _find_mark(self, at: int) -> int:
        """Return where the next frame may begin, from here on; the end of what there is if none may."""
        mark = MARK.search(self._buffer, at)
        return len(self._buffer) if mark is None else mark.start()

    def _find_frame_end(self, at: int) -> int:
        """Return where a frame that begins here ends: here if there is none, out of reach if that cannot be seen."""
        buffer = self._buffer
        if at >= len(buffer):
            return sys.maxsize
        if buffer[at] not in HEADS:
            return at
        head = HEADS[buffer[at]]
        if at + head > len(buffer):
            return sys.maxsize
        end, flags, number = at + head + buffer[at + 1] + CHECKSUM, 0, buffer[at + 5]
        if buffer[at] == V2:
            flags, number = buffer[at + 2], int.from_bytes(buffer[at + 7 : at + 10], "little")
            end += SIGNATURE * (flags & SIGNED)
        known = number in mav.mavlink_map or number == message_readers.EVENT
        if flags & ~SIGNED or not (known or self._is_followed(end)):
            return at
        return end

    def _is_followed(self, end: int) -> bool:
        """Return whether a frame that ends here fills its datagram, or another begins behind it."""
        size = len(self._buffer)
        return self._in_datagrams and (end == size or (end < size and self._buffer[end] in HEADS))

    def _parse_frame(self, at: int, end: int) -> Any | None:  # noqa: ANN401 - pymavlink's classes are untyped
        if end == at:
            return None
        data = self._buffer[at:end]
        if message_id_of(data) == message_readers.EVENT and not has_valid_checksum(data, message_readers.EVENT_EXTRA):
            return None
        try:
            frame = _build_raw_frame(data) if self._is_unread_kind(data) else self._mav.decode(data)
        except (mav.MAVError, struct.error, UnicodeDecodeError):
            return None
        if frame is not None and isinstance(frame, mav.MAVLink_unknown):  # pymavlink says nothing of who sent it
            system = 3 if data[0] == V1 else 5
            frame.get_header().srcSystem, frame.get_header().srcComponent = data[system], data[system + 1]
            frame.get_header().seq = data[system - 1]
        return frame

    def _is_unread_kind(self, data: bytearray) -> bool:
        """Return whether nobody here wants to know what a frame says."""
        if self._systems is None:
            return False
        system = data[3] if data[0] == V1 else data[5]
        return system not in self._systems and message_id_of(data) not in OF_ANYBODY


def _build_raw_frame(data: bytearray) -> Any | None:  # noqa: ANN401
    """Return a frame that is not taken apart; None if its checksum is wrong."""
    number = message_id_of(data)
    kind = mav.mavlink_map.get(number)
    return (
        None if kind is not None and not has_valid_checksum(data, kind.crc_extra) else mav.MAVLink_unknown(number, data)
    )
