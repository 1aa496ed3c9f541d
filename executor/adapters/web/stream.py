"""The present as server-sent events: the newest state wins, and who cannot follow is let go."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator

from starlette.types import Receive, Scope, Send

from executor.adapters.web.connection_limits import ConnectionLimits, origin_of

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
