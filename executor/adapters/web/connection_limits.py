"""Who may be connected, how many, and for how long without a word: nobody keeps the crew out of its own page.

This computer has places of its own, which connections from elsewhere never use up. Where all places are taken, the one
that has been silent longest makes room: a browser says what it wants within moments. The present goes out as
server-sent events: the newest state wins, and who cannot follow is let go.
"""

from __future__ import annotations

import asyncio
import ipaddress
import socket
import struct
from collections.abc import AsyncIterator, Iterable, Mapping
from contextlib import suppress
from dataclasses import dataclass
from typing import ClassVar, TypeVar, cast

import h11
from starlette.types import Receive, Scope, Send
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


SLOW_S = 10.0
"""A browser that takes longer than this for one state is let go; it comes back by itself."""
RETRY_MS = 1000


class LatestValue:
    """Holds one value; everybody who waits gets the newest, and misses those in between."""

    def __init__(self) -> None:
        """Hold nothing."""
        self.value = b""
        self.count = 0
        self.streams: dict[EventStream, str] = {}
        """Who follows, from where; the oldest first."""
        self.dropped = 0
        """Clients that were let go."""
        self._news = asyncio.Condition()
        self._closed = False

    async def put(self, value: bytes) -> None:
        """Replace the value."""
        async with self._news:
            self.value = value
            self.count += 1
            self._news.notify_all()

    async def close(self) -> None:
        """Let everybody who waits have the newest value, and go."""
        async with self._news:
            self._closed = True
            self._news.notify_all()

    async def iterate_values(self) -> AsyncIterator[bytes]:
        """Yield the value that is there, then each newest one."""
        seen = -1
        while True:
            async with self._news:
                while (self.count == seen or not self.value) and not self._closed:
                    await self._news.wait()
                if self.count == seen:
                    return
                seen, value = self.count, self.value
            yield value


class EventStream:
    """An ASGI answer that lasts until the browser goes, or must make room for another one."""

    def __init__(self, newest: LatestValue, limits: ConnectionLimits | None = None) -> None:
        """Follow a value."""
        self._newest = newest
        self._places = (limits or ConnectionLimits()).streams
        self._replaced = asyncio.Event()
        self.sends_s: float | None = None
        """Since when a value is on its way."""

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Send what is newest, for as long as it is taken."""
        peer, own = (scope.get(name) or ("", 0) for name in ("client", "server"))
        self._take_place(origin_of(peer[0], own[0]))
        gone = asyncio.ensure_future(_wait_for_disconnect(receive))
        sending = asyncio.ensure_future(self._send(send))
        replaced = asyncio.ensure_future(self._replaced.wait())
        try:
            await asyncio.wait({gone, sending, replaced}, return_when=asyncio.FIRST_COMPLETED)
        finally:
            del self._newest.streams[self]
            for task in (gone, sending, replaced):
                task.cancel()
            ended = await asyncio.gather(sending, gone, replaced, return_exceptions=True)
        if isinstance(ended[0], Exception):
            raise ended[0]

    def _take_place(self, origin: str) -> None:
        """Take a place; where there is none, who takes nothing goes first, then who has looked longest.

        A browser that must go comes back by itself.
        """
        rivals = self._places.find_rivals(self._newest.streams, origin)
        if rivals:
            stuck = [one for one in rivals if one.sends_s is not None]
            min(stuck, key=lambda one: one.sends_s or 0.0, default=rivals[0]).end_stream()
        self._newest.streams[self] = origin

    def end_stream(self) -> None:
        """End it."""
        self._newest.dropped += 1
        self._replaced.set()

    async def _send(self, send: Send) -> None:
        headers = [(b"content-type", b"text/event-stream; charset=utf-8")]
        await send({"type": "http.response.start", "status": 200, "headers": headers})
        await send({"type": "http.response.body", "body": f"retry: {RETRY_MS}\n\n".encode(), "more_body": True})
        try:
            async for value in self._newest.iterate_values():
                self.sends_s = asyncio.get_running_loop().time()
                async with asyncio.timeout(SLOW_S):
                    body = b"data: " + value + b"\n\n"
                    await send({"type": "http.response.body", "body": body, "more_body": True})
                self.sends_s = None
            await send({"type": "http.response.body", "body": b"", "more_body": False})
        except TimeoutError:
            self._newest.dropped += 1


async def _wait_for_disconnect(receive: Receive) -> None:
    """Wait until the browser has gone."""
    while (await receive())["type"] != "http.disconnect":
        pass
