"""MAVLink 2 message signing: who holds the key may talk (mavlink.io, Message Signing).

A frame ends with a link id, a time of 48 bits and the first 48 bits of a SHA-256 over the key and all that is before.
Nothing is believed of a frame before its signature is: not its time, and not that there is such a stream.
"""

from __future__ import annotations

import hashlib
import hmac
from collections.abc import Callable
from enum import Enum
from typing import Any

SIGNED_FLAG = 1
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
