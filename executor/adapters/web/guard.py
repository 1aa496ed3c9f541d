"""Who may talk to the server: names, origins, tokens, how much anybody may send, and how many may be connected.

A page of another origin must not fly our vehicles: its requests carry another Origin, and a name that was made to point
here (DNS rebinding) is no name that we answer to. Every answer forbids the browser whatever the page does not need.

This computer has places of its own, which connections from elsewhere never use up. Where all places are taken, the one
that has been silent longest makes room: a browser says what it wants within moments. The present goes out as
server-sent events: the newest state wins, and who cannot follow is let go.
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
"""Bytes of a request: an intent has about 100."""
Refuse = Callable[..., Response]
"""Returns an answer of a text, a status and headers."""
HEADERS = {
    "content-security-policy": "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' data:; "
    "connect-src 'self'; manifest-src 'self'; base-uri 'none'; form-action 'none'; frame-ancestors 'none'",
    "x-content-type-options": "nosniff",
    "x-frame-options": "DENY",
    "referrer-policy": "no-referrer",
    "cross-origin-resource-policy": "same-origin",
}
"""Beside these, what does not say how long it may be kept is not kept at all."""


@dataclass(eq=False, repr=False)
class Guard:
    """ASGI middleware that lets through what may talk to us."""

    _app: ASGIApp
    """What is guarded."""
    names: frozenset[str]
    """Host names that we answer to, beside numeric addresses where a token is asked for."""
    token: str | None
    """What has to be shown; None where only this computer can connect."""
    most_bytes: Callable[[str], int] = lambda _: MOST_BODY
    """How long the body of a request may be, by its path."""
    refuse: Refuse = PlainTextResponse
    """Makes the answer to what is not let through."""

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Answer a request, or hand it on."""
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
        """Take the token of the address that the terminal showed, once, and keep it as a cookie."""
        value = QueryParams(scope["query_string"]).get("token", "")
        if scope["method"] == "GET" and scope["path"] == "/" and self._is_token(value):
            answer = RedirectResponse(URL(scope=scope).path, 303)
            answer.set_cookie(cookie_name_for(value), value, httponly=True, samesite="strict", path="/")
            return answer
        text = "a token is needed: open the address that ends in /?token=..., or send 'Authorization: Bearer ...'"
        return self.refuse(text, 401, {"www-authenticate": "Bearer"})


def cookie_name_for(token: str) -> str:
    """Return what a browser keeps a token as: it does not tell two flights on one computer apart by their ports."""
    return f"faultline_{sha256(token.encode()).hexdigest()[:12]}"


def _name_of(host: str) -> str:
    """Return a Host without its port.

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
    """Return whether a browser opens the page itself from a page of the same computer, as the plan page leads to it.

    Nothing but the page is given, and to nobody but who looks at it: no other page may read or frame it.
    """
    kind = tuple(headers.get(f"sec-fetch-{key}") for key in ("site", "mode", "dest"))
    is_page = scope["method"] == "GET" and scope["path"] == "/"
    return is_page and kind == ("same-site", "navigate", "document") and "origin" not in headers


def _is_small(headers: Headers, most_bytes: int) -> bool:
    """Return whether a body has a length, and a small one; a request without a body says nothing of it."""
    if "transfer-encoding" in headers:
        return False
    length = headers.get("content-length", "0")
    return length.isascii() and length.isdigit() and int(length) <= most_bytes


HERE = "this computer"
LOOK_S = 0.25
"""Real seconds between two looks at who is silent."""
FULL = (
    b"HTTP/1.1 503 Service Unavailable\r\ncontent-type: text/plain\r\nconnection: close\r\n"
    b"content-length: 28\r\n\r\ntoo many connections at once"
)
AT_ONCE = struct.pack("ii", 1, 0)
"""Lingers for no time."""
SLOWEST_BYTES_S = 50_000.0
"""Who sends so much is not silent, however long its request lasts."""
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
        if self.silent_s is not None:
            now_s, begun = self.loop.time(), self._begun
            self._begun, self.silent_s = (
                True,
                min(now_s, self.silent_s + len(data) / SLOWEST_BYTES_S) if begun else now_s,
            )
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


class EventStream(StreamingResponse):
    """An answer that lasts until the browser goes, takes nothing, or must make room for another one."""

    def __init__(self, newest: LatestValue, limits: ConnectionLimits | None = None) -> None:
        """Follow a value."""
        super().__init__(self._iterate_events(), media_type="text/event-stream")
        self._newest = newest
        self._places = (limits or ConnectionLimits()).streams
        self.patience = asyncio.timeout(None)
        """By when the value on its way must be taken, if one is."""

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Send what is newest, for as long as it is taken."""
        peer, own = (scope.get(name) or ("", 0) for name in ("client", "server"))
        self._take_place(origin_of(peer[0], own[0]))
        try:
            with suppress(TimeoutError):
                async with self.patience:
                    await super().__call__(scope, receive, send)
        finally:
            self._newest.streams.pop(self, None)

    def _take_place(self, origin: str) -> None:
        """Take a place; where there is none, who takes nothing goes first, then who has looked longest.

        A browser that must go comes back by itself.
        """
        rivals = self._places.find_rivals(self._newest.streams, origin)
        if rivals:
            stuck = [one for one in rivals if one.patience.when() is not None]
            goes = min(stuck, key=lambda one: one.patience.when() or 0.0, default=rivals[0])
            goes.wait_until(0.0)
            del self._newest.streams[goes]
        self._newest.streams[self] = origin

    def wait_until(self, at_s: float | None) -> None:
        """Be patient until then, or for ever; who has no place any more is being let go."""
        if self in self._newest.streams and not self.patience.expired():
            self.patience.reschedule(at_s)

    async def _iterate_events(self) -> AsyncIterator[bytes]:
        yield f"retry: {RETRY_MS}\n\n".encode()
        async for value in self._newest.iterate_values():
            self.wait_until(asyncio.get_running_loop().time() + SLOW_S)
            yield b"data: " + value + b"\n\n"
            self.wait_until(None)
