"""Guard the web server: host names, origins, tokens, request sizes, and the number of connections.

A page of another origin must not fly our vehicles: its requests carry another Origin, and a name that was made to point
here (DNS rebinding) is not one of ours. Every answer forbids the browser all features that the page does not need.

Connections from this computer have their own quota, which other clients never use up. If a quota is full, the
connection that was silent longest is closed: browsers send their request within moments. State is sent as server-sent
events: the newest one wins, and a client that cannot keep up is disconnected.
"""

from __future__ import annotations

import asyncio
import ipaddress
import secrets
import socket
import struct
from collections.abc import AsyncIterator, Callable, Iterable, Mapping
from contextlib import suppress
from dataclasses import dataclass
from hashlib import sha256
from typing import ClassVar, TypeVar, cast

import h11
from starlette.datastructures import URL, Headers, MutableHeaders, QueryParams
from starlette.requests import cookie_parser
from starlette.responses import PlainTextResponse, RedirectResponse, Response, StreamingResponse
from starlette.types import ASGIApp, Message, Receive, Scope, Send
from uvicorn.protocols.http.h11_impl import H11Protocol

MOST_BODY = 4096
"""Most bytes of a request body: an intent has about 100."""
Refuse = Callable[..., Response]
"""Build a response from a text, a status and headers."""
HEADERS = {
    "content-security-policy": "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' data:; "
    "connect-src 'self'; manifest-src 'self'; base-uri 'none'; form-action 'none'; frame-ancestors 'none'",
    "x-content-type-options": "nosniff",
    "x-frame-options": "DENY",
    "referrer-policy": "no-referrer",
    "cross-origin-resource-policy": "same-origin",
}
"""Response headers; a response without cache-control also gets no-store."""


@dataclass(eq=False, repr=False)
class Guard:
    """ASGI middleware that lets permitted requests through."""

    _app: ASGIApp
    """Application behind the guard."""
    names: frozenset[str]
    """Accepted host names, besides numeric addresses if a token is required."""
    token: str | None
    """Required token; None if only this computer can connect."""
    most_bytes: Callable[[str], int] = lambda _: MOST_BODY
    """Most bytes of a request body, by path."""
    refuse: Refuse = PlainTextResponse
    """Builds the response to a refused request."""

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Refuse a request, or pass it to the application."""
        if scope["type"] != "http":
            return

        async def with_headers(message: Message) -> None:
            if message["type"] == "http.response.start":
                headers = MutableHeaders(scope=message)
                for name, value in HEADERS.items():
                    headers.setdefault(name, value)
                headers.setdefault("cache-control", "no-store")
            await send(message)

        refusal = self._find_refusal(scope)
        if refusal is not None:
            await refusal(scope, receive, with_headers)
            return
        await self._app(scope, receive, with_headers)

    def _find_refusal(self, scope: Scope) -> Response | None:
        headers = Headers(scope=scope)
        host = headers.get("host", "")
        if not self._is_own_name(host):
            return self.refuse(f"this server does not answer to the name {host[:80]!r}", 421)
        if not (_is_same_origin(headers, host) or _is_link_of_this_computer(scope, headers)):
            return self.refuse("requests of other pages are not taken", 403)
        most_bytes = self.most_bytes(scope["path"])
        if not _is_small(headers, most_bytes):
            return self.refuse(f"expected at most {most_bytes} bytes of a known length", 413)
        if self.token is None or self._has_token(headers):
            return None
        return self._admit_by_token(scope)

    def _is_own_name(self, host: str) -> bool:
        name = _name_of(host)
        if name in self.names:
            return True
        if self.token is None:
            return False
        try:
            ipaddress.ip_address(name.strip("[]"))
        except ValueError:
            return False
        return True

    def _has_token(self, headers: Headers) -> bool:
        kind, _, value = headers.get("authorization", "").partition(" ")
        if kind.lower() == "bearer" and self._is_token(value.strip()):
            return True
        return self.token is not None and self._is_token(
            cookie_parser(headers.get("cookie", "")).get(cookie_name_for(self.token), "")
        )

    def _is_token(self, value: str) -> bool:
        return self.token is not None and secrets.compare_digest(value.encode(), self.token.encode())

    def _admit_by_token(self, scope: Scope) -> Response:
        """Accept the token in the address that the terminal showed, and store it as a cookie."""
        value = QueryParams(scope["query_string"]).get("token", "")
        if scope["method"] == "GET" and scope["path"] == "/" and self._is_token(value):
            answer = RedirectResponse(URL(scope=scope).path, 303)
            answer.set_cookie(cookie_name_for(value), value, httponly=True, samesite="strict", path="/")
            return answer
        text = "a token is needed: open the address that ends in /?token=..., or send 'Authorization: Bearer ...'"
        return self.refuse(text, 401, {"www-authenticate": "Bearer"})


def cookie_name_for(token: str) -> str:
    """Return the cookie name for a token: cookies ignore ports, so two flights on one computer need different names."""
    return f"faultline_{sha256(token.encode()).hexdigest()[:12]}"


def _name_of(host: str) -> str:
    """Return a Host header without its port.

    >>> _name_of("localhost:8080"), _name_of("[::1]:8080"), _name_of("10.0.0.7")
    ('localhost', '[::1]', '10.0.0.7')
    """
    if host.startswith("["):
        return host.partition("]")[0] + "]"
    return host.rpartition(":")[0].lower() if ":" in host else host.lower()


def _is_same_origin(headers: Headers, host: str) -> bool:
    origin, site = headers.get("origin"), headers.get("sec-fetch-site")
    if origin is not None and origin not in {f"http://{host}", f"https://{host}"}:
        return False
    return site in {None, "same-origin", "none"}


def _is_link_of_this_computer(scope: Scope, headers: Headers) -> bool:
    """Return whether a link on a page of the same computer opens the page, as the plan page does.

    Only the page itself is served, and only for viewing: no other page may read or frame it.
    """
    kind = tuple(headers.get(f"sec-fetch-{key}") for key in ("site", "mode", "dest"))
    is_page = scope["method"] == "GET" and scope["path"] == "/"
    return is_page and kind == ("same-site", "navigate", "document") and "origin" not in headers


def _is_small(headers: Headers, most_bytes: int) -> bool:
    """Return whether a body has a known and small length; a request without a body has no length header."""
    if "transfer-encoding" in headers:
        return False
    length = headers.get("content-length", "0")
    return length.isascii() and length.isdigit() and int(length) <= most_bytes


HERE = "this computer"
LOOK_S = 0.25
"""Real seconds between two checks for idle connections."""
FULL = (
    b"HTTP/1.1 503 Service Unavailable\r\ncontent-type: text/plain\r\nconnection: close\r\n"
    b"content-length: 28\r\n\r\ntoo many connections at once"
)
AT_ONCE = struct.pack("ii", 1, 0)
"""SO_LINGER of zero time: closes at once."""
SLOWEST_BYTES_S = 50_000.0
"""Bytes per second above which a connection is not silent, however long its request lasts."""
WAITING = frozenset({h11.IDLE, h11.SEND_BODY})
"""States of a connection whose request is incomplete."""

Guest = TypeVar("Guest")


@dataclass(frozen=True, slots=True)
class ConnectionQuota:
    """Most connections of each origin."""

    here: int
    """Connections from this computer."""
    elsewhere: int
    """Connections from all other addresses together."""
    address: int
    """Connections from one of those addresses."""

    def find_rivals(self, guests: Mapping[Guest, str], origin: str) -> list[Guest]:
        """Return the connections of which one must close to admit another from there; none if there is room."""
        same = [guest for guest, other in guests.items() if other == origin]
        if len(same) >= (self.here if origin == HERE else self.address):
            return same
        others = [] if origin == HERE else [guest for guest, other in guests.items() if other != HERE]
        return others if len(others) >= self.elsewhere else []


@dataclass(frozen=True, slots=True)
class ConnectionLimits:
    """Limits for each client of the server."""

    connections: ConnectionQuota = ConnectionQuota(64, 96, 16)
    streams: ConnectionQuota = ConnectionQuota(24, 24, 8)
    request_s: float = 5.0
    """Real seconds for a whole request, from its first byte, or from the connection."""
    answer_s: float = 10.0
    """Real seconds within which the client must accept part of an answer."""


def origin_of(peer: str, own: str) -> str:
    """Return a connection's origin: this computer, an address, or a network that one computer may own.

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
    """All open connections."""

    def __init__(self, limits: ConnectionLimits) -> None:
        """Start without connections."""
        self.limits = limits
        self._callers: dict[WebConnection, str] = {}

    def admit(self, caller: WebConnection, origin: str) -> bool:
        """Admit a connection, if necessary by closing another one. Return false if there is no room."""
        rivals = self.limits.connections.find_rivals(self._callers, origin)
        if rivals:
            silent = _find_most_silent(rivals)
            if silent is None:
                return False
            self._abort_connection(silent)
        self._callers[caller] = origin
        return True

    def release(self, caller: WebConnection) -> None:
        """Remove a connection."""
        self._callers.pop(caller, None)

    async def close_idle_connections(self) -> None:
        """Close overdue connections periodically."""
        while True:
            now_s = asyncio.get_running_loop().time()
            for caller in tuple(self._callers):
                if caller.is_overdue(now_s):
                    self._abort_connection(caller)
            await asyncio.sleep(LOOK_S)

    def _abort_connection(self, caller: WebConnection) -> None:
        self.release(caller)
        with suppress(OSError):  # without waiting for data that the other end does not accept
            caller.transport.get_extra_info("socket").setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, AT_ONCE)
        caller.transport.abort()


class WebConnection(H11Protocol):
    """One connection that records how long it has been silent."""

    door: ClassVar[ConnectionRegistry]

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        """Register the connection."""
        super().connection_made(cast("asyncio.Transport", transport))
        self.silent_s: float | None = self.loop.time()
        """Time since when the rest of a request is awaited."""
        self.stuck_s: float | None = None
        """Time since when the client has accepted no part of an answer."""
        self._unsent = 0
        self._begun = False
        """Whether part of a request has arrived."""
        peer, own = (str((transport.get_extra_info(name) or ("",))[0]) for name in ("peername", "sockname"))
        if not self.door.admit(self, origin_of(peer, own)):
            self.transport.write(FULL)
            self.transport.close()

    def connection_lost(self, exc: Exception | None) -> None:
        """Unregister the connection."""
        self.door.release(self)
        super().connection_lost(exc)

    def data_received(self, data: bytes) -> None:
        """Take part of a request."""
        if self.silent_s is not None:
            now_s, begun = self.loop.time(), self._begun
            self._begun, self.silent_s = (
                True,
                min(now_s, self.silent_s + len(data) / SLOWEST_BYTES_S) if begun else now_s,
            )
        try:
            super().data_received(data)
        except h11.LocalProtocolError:
            self.transport.abort()  # invalid data during an answer: too late for an error response
            return
        if self.conn.their_state not in WAITING:
            self.silent_s = None

    def on_response_complete(self) -> None:
        """Wait for the next request."""
        super().on_response_complete()
        waits = self.conn.their_state in WAITING
        self.silent_s, self._begun = self.loop.time() if waits else None, False

    def is_overdue(self, now_s: float) -> bool:
        """Return whether it has kept its slot for too long; checked regularly."""
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
    """Return the connection silent longest; None if all are being answered."""
    since_s = {
        caller: min(one for one in (caller.silent_s, caller.stuck_s) if one is not None)
        for caller in callers
        if (caller.silent_s, caller.stuck_s) != (None, None)
    }
    return min(since_s, key=lambda caller: since_s[caller], default=None)


SLOW_S = 10.0
"""Longest real seconds for a browser to accept one state; a slower one is disconnected, and reconnects."""
RETRY_MS = 1000


class LatestValue:
    """Hold one value; every waiting reader gets the newest, and misses those in between."""

    def __init__(self) -> None:
        """Start without a value."""
        self.value = b""
        self.count = 0
        self.streams: dict[EventStream, str] = {}
        """Open streams and their origins, oldest first."""
        self._news = asyncio.Condition()
        self._closed = False

    async def put(self, value: bytes) -> None:
        """Replace the value."""
        async with self._news:
            self.value = value
            self.count += 1
            self._news.notify_all()

    async def close(self) -> None:
        """Give waiting readers the newest value, and end their streams."""
        async with self._news:
            self._closed = True
            self._news.notify_all()

    async def iterate_values(self) -> AsyncIterator[bytes]:
        """Yield the current value, then each newest one."""
        seen = -1
        while True:
            async with self._news:
                while (self.count == seen or not self.value) and not self._closed:
                    await self._news.wait()
                if self.count == seen:
                    return
                seen, value = self.count, self.value
            yield value


class EventStream(StreamingResponse):
    """Event stream that lasts until the browser leaves, stalls, or must make room for another one."""

    def __init__(self, newest: LatestValue, limits: ConnectionLimits | None = None) -> None:
        """Follow a value."""
        super().__init__(self._iterate_events(), media_type="text/event-stream")
        self._newest = newest
        self._places = (limits or ConnectionLimits()).streams
        self.patience = asyncio.timeout(None)
        """Deadline for the browser to accept the value being sent, if any."""

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Send the newest values while the browser accepts them."""
        peer, own = (scope.get(name) or ("", 0) for name in ("client", "server"))
        self._take_place(origin_of(peer[0], own[0]))
        try:
            with suppress(TimeoutError):
                async with self.patience:
                    await super().__call__(scope, receive, send)
        finally:
            self._newest.streams.pop(self, None)

    def _take_place(self, origin: str) -> None:
        """Take a slot; if none is free, close a stalled stream, or else the oldest.

        A disconnected browser reconnects.
        """
        rivals = self._places.find_rivals(self._newest.streams, origin)
        if rivals:
            stuck = [one for one in rivals if one.patience.when() is not None]
            goes = min(stuck, key=lambda one: one.patience.when() or 0.0, default=rivals[0])
            goes.wait_until(0.0)
            del self._newest.streams[goes]
        self._newest.streams[self] = origin

    def wait_until(self, at_s: float | None) -> None:
        """Set the deadline, None for no limit; unchanged for a stream that is being closed."""
        if self in self._newest.streams and not self.patience.expired():
            self.patience.reschedule(at_s)

    async def _iterate_events(self) -> AsyncIterator[bytes]:
        yield f"retry: {RETRY_MS}\n\n".encode()
        async for value in self._newest.iterate_values():
            self.wait_until(asyncio.get_running_loop().time() + SLOW_S)
            yield b"data: " + value + b"\n\n"
            self.wait_until(None)
