"""Who may be connected, how many, and for how long without a word: nobody keeps the crew out of its own page.

This computer has places of its own, which connections from elsewhere never use up. Where all places are taken, the one
that has been silent longest makes room: a browser says what it wants within moments.
"""

from __future__ import annotations

import asyncio
import ipaddress
import socket
import struct
from collections.abc import Iterable, Mapping
from contextlib import suppress
from dataclasses import dataclass
from typing import ClassVar, TypeVar, cast

import h11
from uvicorn.protocols.http.h11_impl import H11Protocol

HERE = "this computer"
LOOK_S = 0.25
"""Real seconds between two looks at who is silent."""
FULL = (
    b"HTTP/1.1 503 Service Unavailable\r\ncontent-type: text/plain\r\nconnection: close\r\n"
    b"content-length: 28\r\n\r\ntoo many connections at once"
)
AT_ONCE = struct.pack("ii", 1, 0)
"""Lingers for no time."""
WAITING = frozenset({h11.IDLE, h11.SEND_BODY})
"""States of one whose request is not whole."""

Guest = TypeVar("Guest")


@dataclass(frozen=True, slots=True)
class ConnectionQuota:
    """How many there may be."""

    here: int
    """From this computer."""
    elsewhere: int
    """From everywhere else together."""
    address: int
    """From one of those addresses."""

    def find_rivals(self, guests: Mapping[Guest, str], origin: str) -> list[Guest]:
        """Return of whom one must go before another may come from there; nobody where there is room."""
        same = [guest for guest, other in guests.items() if other == origin]
        if len(same) >= (self.here if origin == HERE else self.address):
            return same
        others = [] if origin == HERE else [guest for guest, other in guests.items() if other != HERE]
        return others if len(others) >= self.elsewhere else []


@dataclass(frozen=True, slots=True)
class ConnectionLimits:
    """How much anybody may take of the server."""

    connections: ConnectionQuota = ConnectionQuota(64, 96, 16)
    streams: ConnectionQuota = ConnectionQuota(24, 24, 8)
    request_s: float = 5.0
    """Real seconds for a whole request, from its first byte on, or from the connection."""
    answer_s: float = 10.0
    """Real seconds in which nothing of an answer is taken."""


def origin_of(peer: str, own: str) -> str:
    """Return from where a connection comes: this computer, an address, or a network that one computer may have.

    >>> origin_of("127.0.0.1", "127.0.0.1"), origin_of("10.0.0.7", "10.0.0.2"), origin_of("10.0.0.2", "10.0.0.2")
    ('this computer', '10.0.0.7', 'this computer')
    >>> origin_of("2001:db8::1", "2001:db8:1::2")
    '2001:db8::/64'
    """
    try:
        address = ipaddress.ip_address(peer.partition("%")[0])
    except ValueError:
        return peer
    if isinstance(address, ipaddress.IPv6Address):
        address = address.ipv4_mapped or address
    if peer == own or address.is_loopback:
        return HERE
    if isinstance(address, ipaddress.IPv6Address):
        return str(ipaddress.ip_network((int(address), 64), strict=False))
    return str(address)


class ConnectionRegistry:
    """Knows all connections."""

    def __init__(self, limits: ConnectionLimits) -> None:
        """Open it."""
        self.limits = limits
        self._callers: dict[WebConnection, str] = {}

    def admit(self, caller: WebConnection, origin: str) -> bool:
        """Let a connection in; another one may have to go for it. Returns false where there is no room."""
        rivals = self.limits.connections.find_rivals(self._callers, origin)
        if rivals:
            silent = _find_most_silent(rivals)
            if silent is None:
                return False
            self._abort_connection(silent)
        self._callers[caller] = origin
        return True

    def release(self, caller: WebConnection) -> None:
        """Forget a connection."""
        self._callers.pop(caller, None)

    async def close_idle_connections(self) -> None:
        """End what is silent for too long, for ever."""
        while True:
            now_s = asyncio.get_running_loop().time()
            for caller in tuple(self._callers):
                if caller.is_overdue(now_s):
                    self._abort_connection(caller)
            await asyncio.sleep(LOOK_S)

    def _abort_connection(self, caller: WebConnection) -> None:
        self.release(caller)
        with suppress(OSError):  # without waiting for what the other end does not take
            caller.transport.get_extra_info("socket").setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, AT_ONCE)
        caller.transport.abort()


class WebConnection(H11Protocol):
    """One connection, which knows since when it has been silent."""

    door: ClassVar[ConnectionRegistry]

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        """Ask for a place."""
        super().connection_made(cast("asyncio.Transport", transport))
        self.silent_s: float | None = self.loop.time()
        """Since when the rest of a request is waited for."""
        self.stuck_s: float | None = None
        """Since when nothing of an answer is taken."""
        self._unsent = 0
        self._begun = False
        """Whether a part of a request has come."""
        peer, own = (str((transport.get_extra_info(name) or ("",))[0]) for name in ("peername", "sockname"))
        if not self.door.admit(self, origin_of(peer, own)):
            self.transport.write(FULL)
            self.transport.close()

    def connection_lost(self, exc: Exception | None) -> None:
        """Give the place back."""
        self.door.release(self)
        super().connection_lost(exc)

    def data_received(self, data: bytes) -> None:
        """Take a part of a request."""
        if self.silent_s is not None and not self._begun:
            self._begun, self.silent_s = True, self.loop.time()
        try:
            super().data_received(data)
        except h11.LocalProtocolError:
            self.transport.abort()  # nonsense in the midst of an answer: there is no way to say so any more
            return
        if self.conn.their_state not in WAITING:
            self.silent_s = None

    def on_response_complete(self) -> None:
        """Wait for the next request."""
        super().on_response_complete()
        waits = self.conn.their_state in WAITING
        self.silent_s, self._begun = self.loop.time() if waits else None, False

    def is_overdue(self, now_s: float) -> bool:
        """Return whether it has kept its place for too long; asked for again and again."""
        unsent = self.transport.get_write_buffer_size()
        if unsent == 0:
            self.stuck_s = None
        elif self.stuck_s is None or unsent < self._unsent:
            self.stuck_s = now_s
        self._unsent = unsent
        limits = self.door.limits
        silent = self.silent_s is not None and now_s - self.silent_s > limits.request_s
        return silent or (self.stuck_s is not None and now_s - self.stuck_s > limits.answer_s)


def _find_most_silent(callers: Iterable[WebConnection]) -> WebConnection | None:
    """Return who has been silent longest; None if everybody is being answered."""
    since_s = {
        caller: min(one for one in (caller.silent_s, caller.stuck_s) if one is not None)
        for caller in callers
        if (caller.silent_s, caller.stuck_s) != (None, None)
    }
    return min(since_s, key=lambda caller: since_s[caller], default=None)
