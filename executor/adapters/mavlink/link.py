"""The link to one vehicle: its messages both ways, and the counts of what was lost."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable

from executor.adapters.mavlink.codec import DecodedFrame, MavlinkCodec
from executor.adapters.mavlink.signing import FrameRejection
from executor.core.interface.messages import (
    DoubleHeard,
    Heartbeat,
    Message,
    OrderSeen,
    Outgoing,
    Radio,
    StationHeard,
    Traffic,
)
from executor.core.interface.ports import FrameLog, LinkCounts
from executor.core.telemetry.vehicle_identity import AUTOPILOT

MOST_SOURCES = 8
"""Addresses, or strange systems, that are remembered."""
ENOUGH_FRAMES = 80
"""Counts of frames are handed on with a HEARTBEAT once there are as many, as from a log."""
LATE_FRAMES = 32
"""A frame that is this far behind the newest may have been overtaken: links reorder within some tenths of a second."""
KEPT_BEATS = 8
"""HEARTBEATs of which a copy that comes late is known."""

Write = Callable[[bytes], bool]
"""Sends one frame without waiting; says whether it went anywhere."""


def discard_frame(_: bytes) -> bool:
    """Write to a vehicle that is not known yet, or not connected any more."""
    return False


class VehicleLink:
    """Messages of one vehicle; an endpoint brings its frames and says where to write to."""

    def __init__(self, sysid: int, codec: MavlinkCodec, log: FrameLog | None = None) -> None:
        """Make a link that leads nowhere yet."""
        self.sysid = sysid
        self.component = AUTOPILOT
        self.counts = LinkCounts(missing=0)
        self.write: Write = discard_frame
        """Set by the endpoint when it knows where the vehicle is."""
        self._codec = codec
        self._log = log
        self._listeners: list[Callable[[Message], None]] = []
        self._arrived = self._missing = 0
        """Frames of the autopilot alone: every component numbers its own."""
        self._told = (0, 0)
        """Arrived and missing frames when they were handed on last."""
        self._source = ""
        self._beat_source = ""
        self._sources: set[str] = set()
        """Every address that its frames came from."""
        self._told_places: tuple[str, ...] = ()
        self._last_seq: int | None = None
        self._beat_seq: int | None = None
        """Of the newest HEARTBEAT."""
        self._beats: deque[bytes] = deque(maxlen=KEPT_BEATS)
        """The last HEARTBEATs as they came."""
        self._absent: set[int] = set()
        """Sequence numbers that were passed over, as long as they may still come."""

    def listen(self, listener: Callable[[Message], None]) -> Callable[[], None]:
        """Call `listener` with every message of the vehicle from now on; returns how to stop that."""
        self._listeners.append(listener)
        return lambda: self._listeners.remove(listener)

    def send(self, message: Outgoing) -> None:
        """Send one message; before the vehicle's address is known there is nowhere to send it."""
        if self.write is discard_frame:
            return
        frame = self._codec.encode(message, self.sysid, self.component)
        if self.write(frame) and self._log is not None:
            self._log.write(frame)

    def receive(self, received: DecodedFrame, source: str = "", write: Write | None = None) -> None:
        """Take a frame of this vehicle.

        Args:
            received: The frame.
            source: The address that it came from, where there is one.
            write: How to answer there; others that use the vehicle's sysid are not answered.
        """
        if received.own and write is not None:
            self.write = write
        if received.own and source and source != self._source:
            self._note_source(source)
        if self._log is not None:
            self._log.write(received.frame)
        told = None if self._is_outdated(received) else received.message
        self._count(received)
        if isinstance(told, Heartbeat):
            if received.own:
                self._beat_source = source
            self._report_traffic(received.compid)
        for message in (told, *received.more):
            if message is not None:
                self._dispatch(message, received.compid)

    def _report_traffic(self, component: int) -> None:
        """Hand on what came and what did not, once it is enough to say something."""
        received, missing = self._arrived - self._told[0], self._missing - self._told[1]
        if received + missing >= ENOUGH_FRAMES:
            self._told = (self._arrived, self._missing)
            self._dispatch(Traffic(received, max(0, missing)), component)

    def count_refused(self, refusal: FrameRejection) -> None:
        """Count a frame that claims to be this vehicle's, or came over its connection, and is not believed."""
        self.counts.refused[refusal.value] = self.counts.refused.get(refusal.value, 0) + 1

    def _note_source(self, source: str) -> None:
        """Note another address; one that comes back to an earlier one is two vehicles, not one that moved."""
        if source in self._sources:
            places = tuple(sorted(self._sources))
            if places != self._told_places:
                self._told_places = places
                self._dispatch(DoubleHeard(self.sysid, places), self.component)
        elif len(self._sources) < MOST_SOURCES:
            self._sources.add(source)
        self._source = source

    def receive_foreign(self, received: DecodedFrame, source: str = "") -> None:
        """Take a frame that came over this vehicle's connection, of a system that is nobody's vehicle."""
        self.counts.foreign += 1
        if len(self.counts.strangers) < MOST_SOURCES:
            self.counts.strangers.setdefault(received.sysid, source)
        # A SiK radio speaks as a system of its own (51), from where the vehicle behind it does.
        if isinstance(received.message, Radio) and source != self._beat_source:
            return
        told = received.message
        ordered = isinstance(told, OrderSeen) and told.to in {0, self.sysid}
        if told is not None and (ordered or isinstance(told, StationHeard | Radio)):
            self._dispatch(told, received.compid)

    def _dispatch(self, message: Message, component: int) -> None:
        if isinstance(message, Heartbeat):
            self.component = component
        for listener in tuple(self._listeners):
            listener(message)

    def _is_outdated(self, received: DecodedFrame) -> bool:
        """Return whether a HEARTBEAT is older than one that came before it: its mode is one that was.

        It was passed over, or it is a copy. Whatever else seems to be behind counts anew: after a silence of any number
        of frames, or after a reboot.
        """
        if not received.own or not isinstance(received.message, Heartbeat):
            return False
        last, newest, came = self._beat_seq, self._last_seq, received.frame in self._beats
        if not came:
            self._beats.append(received.frame)
        if last is not None and newest is not None and (came or received.seq in self._absent):
            older = 0 < (last - received.seq) % 256 < 128
            if older and (newest - received.seq) % 256 <= LATE_FRAMES:
                return True
        self._beat_seq = received.seq
        return False

    def _count(self, received: DecodedFrame) -> None:
        self.counts.received += 1
        if not received.own:
            return
        self._arrived += 1
        if self._last_seq is not None:
            gap = (received.seq - self._last_seq) % 256
            if gap == 0 or gap > 128:
                # A duplicate, or a frame that was overtaken on the way: then it is not missing after all.
                self._missing -= received.seq in self._absent
                self._absent.discard(received.seq)
                self.counts.missing = self._missing
                return
            self._missing += gap - 1
            self._absent |= {(self._last_seq + step) % 256 for step in range(1, gap)}
            self._absent.discard(received.seq)
        self._last_seq = received.seq
        self.counts.missing = self._missing
