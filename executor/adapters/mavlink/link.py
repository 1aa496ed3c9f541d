"""The link to one vehicle: a datagram endpoint, the source filter, and the counts of what was lost."""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol, cast
from urllib.parse import urlsplit

from executor.adapters.mavlink.codec import Codec, Received
from executor.core.messages import Heartbeat, Message, Outgoing, StationHeard
from executor.errors import ConnectionFailed

AUTOPILOT_COMPONENT = 1


class FrameLog(Protocol):
    """Where every frame of both directions is recorded."""

    def write(self, frame: bytes) -> None:
        """Append one frame."""
        ...


@dataclass(slots=True)
class LinkCounts:
    """What came and what did not."""

    received: int = 0
    missing: int = 0
    """Frames that the sequence numbers say were sent and never came."""
    foreign: int = 0
    """Frames of other systems on this port."""


class VehicleLink(asyncio.DatagramProtocol):
    """Messages of one vehicle; knows its address only from what it hears, or from the connection string."""

    def __init__(self, sysid: int, log: FrameLog | None) -> None:
        """Make a link that is not open yet; see `open_link`."""
        self.sysid = sysid
        self.component = AUTOPILOT_COMPONENT
        self.counts = LinkCounts()
        self.codec = Codec()
        self._log = log
        self._transport: asyncio.DatagramTransport | None = None
        self._peer: tuple[str, int] | None = None
        self._connected = False
        self._listeners: list[Callable[[Message], None]] = []
        self._last_seq: int | None = None
        self._absent: set[int] = set()
        """Sequence numbers that were passed over, as long as they may still come."""

    def listen(self, listener: Callable[[Message], None]) -> Callable[[], None]:
        """Call `listener` with every message of the vehicle from now on; returns how to stop that."""
        self._listeners.append(listener)
        return lambda: self._listeners.remove(listener)

    def send(self, message: Outgoing) -> None:
        """Send one message; before the vehicle's address is known there is nowhere to send it."""
        if self._transport is None or self._transport.is_closing() or not (self._connected or self._peer):
            return
        frame = self.codec.encode(message, self.sysid, self.component)
        self._transport.sendto(frame, None if self._connected else self._peer)
        if self._log is not None:
            self._log.write(frame)

    def close(self) -> None:
        """Close the endpoint."""
        if self._transport is not None:
            self._transport.close()

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        """Take the endpoint (called by asyncio)."""
        # asyncio's own datagram transport is no subclass of the class that its documentation names (3.11).
        self._transport = cast("asyncio.DatagramTransport", transport)
        self._connected = transport.get_extra_info("peername") is not None

    def datagram_received(self, data: bytes, addr: tuple[str, int]) -> None:
        """Take a datagram (called by asyncio)."""
        for received in self.codec.decode(data):
            if received.sysid != self.sysid:
                self.counts.foreign += 1
                if isinstance(received.message, StationHeard):
                    self._hand_on(received.message, received.compid)
                continue
            self._peer = addr
            if self._log is not None:
                self._log.write(received.frame)
            self._count(received)
            for message in (received.message, *received.more):
                if message is not None:
                    self._hand_on(message, received.compid)

    def error_received(self, exc: Exception) -> None:
        """A port where nobody listens yet answers with an error; the link-loss watchpoint covers it."""

    def _hand_on(self, message: Message, component: int) -> None:
        if isinstance(message, Heartbeat):
            self.codec.autopilot = message.autopilot
            self.component = component
        for listener in tuple(self._listeners):
            listener(message)

    def _count(self, received: Received) -> None:
        self.counts.received += 1
        if received.compid != self.component:
            return
        if self._last_seq is not None:
            gap = (received.seq - self._last_seq) % 256
            if gap == 0 or gap > 128:
                # A duplicate, or a frame that was overtaken on the way: then it is not missing after all.
                self.counts.missing -= received.seq in self._absent
                self._absent.discard(received.seq)
                return
            self.counts.missing += gap - 1
            self._absent |= {(self._last_seq + step) % 256 for step in range(1, gap)}
            self._absent.discard(received.seq)
        self._last_seq = received.seq


async def open_link(connection: str, sysid: int, log: FrameLog | None) -> VehicleLink:
    """Open the endpoint that a site file's connection string names.

    Raises:
        ConnectionFailed: the port is taken, or the host is not known.
    """
    url = urlsplit(connection)
    address = (url.hostname or "127.0.0.1", url.port or 0)
    link = VehicleLink(sysid, log)
    loop = asyncio.get_running_loop()
    try:
        if url.scheme == "udpin":
            await loop.create_datagram_endpoint(lambda: link, local_addr=address)
        else:
            await loop.create_datagram_endpoint(lambda: link, remote_addr=address)
    except OSError as error:
        raise ConnectionFailed(f"{connection}: cannot be opened: {error.strerror or error}") from error
    return link
