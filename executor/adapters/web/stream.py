"""The present as server-sent events: the newest state wins, and who cannot follow is let go."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator

from starlette.types import Receive, Scope, Send

SLOW_S = 10.0
"""A browser that takes longer than this for one state is let go; it comes back by itself."""
MOST_CLIENTS = 24
"""Browsers at once."""
RETRY_MS = 1000


class Newest:
    """Holds one value; everybody who waits gets the newest, and misses those in between."""

    def __init__(self) -> None:
        """Hold nothing."""
        self.value = b""
        self.count = 0
        self.clients = 0
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

    async def values(self) -> AsyncIterator[bytes]:
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
    """An ASGI answer that lasts until the browser goes."""

    def __init__(self, newest: Newest) -> None:
        """Follow a value."""
        self._newest = newest

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:  # noqa: ARG002
        """Send what is newest, for as long as it is taken."""
        self._newest.clients += 1
        gone = asyncio.ensure_future(_left(receive))
        sending = asyncio.ensure_future(self._send(send))
        try:
            await asyncio.wait({gone, sending}, return_when=asyncio.FIRST_COMPLETED)
        finally:
            self._newest.clients -= 1
            for task in (gone, sending):
                task.cancel()
            await asyncio.gather(gone, sending, return_exceptions=True)

    async def _send(self, send: Send) -> None:
        headers = [(b"content-type", b"text/event-stream; charset=utf-8")]
        await send({"type": "http.response.start", "status": 200, "headers": headers})
        await send({"type": "http.response.body", "body": f"retry: {RETRY_MS}\n\n".encode(), "more_body": True})
        try:
            async for value in self._newest.values():
                async with asyncio.timeout(SLOW_S):
                    body = b"data: " + value + b"\n\n"
                    await send({"type": "http.response.body", "body": body, "more_body": True})
            await send({"type": "http.response.body", "body": b"", "more_body": False})
        except TimeoutError:
            self._newest.dropped += 1


async def _left(receive: Receive) -> None:
    """Wait until the browser has gone."""
    while (await receive())["type"] != "http.disconnect":
        pass
