"""A browser's side of the page: the age of the state it shows, in its own process."""

from __future__ import annotations

import contextlib
import http.client
import json
import multiprocessing
import time
from collections.abc import Iterator
from multiprocessing.connection import Connection

AGAIN_S = 0.2
"""Real seconds between two attempts to reach a page that is not available yet."""
LOAD = (
    "/",
    "/files/map.css",
    "/files/page.css",
    "/files/page.js",
    "/files/map.js",
    "/files/chart.js",
    "/files/strips.js",
    "/chart",
)
"""Files that a browser requests before it follows the stream."""

Seen = list[tuple[float, float]]
"""Arrival of each state, in seconds since 1970, and its flight time."""


@contextlib.contextmanager
def browser(port: int) -> Iterator[Connection]:
    """Follow the page of this computer as a browser does; yields the connection for `seen`, once the page ends."""
    here = multiprocessing.get_context("spawn")
    ours, theirs = here.Pipe(duplex=False)
    process = here.Process(target=_follow, args=(port, theirs), daemon=True)
    process.start()
    theirs.close()
    try:
        yield ours
    finally:
        process.terminate()
        process.join()


def oldest_shown_s(seen: Seen, began_unix_s: float, speedup: float, since_s: float) -> float:
    """Return the maximum age of a state when the next one replaced it, in real seconds.

    Args:
        seen: States that a browser received.
        began_unix_s: Time at which the flight's clock was at zero.
        speedup: Flight seconds per real second.
        since_s: Flight time from which on states count.
    """
    made_s = [began_unix_s + now_s / speedup for _, now_s in seen]
    ages_s = [
        came_s - made
        for (_, now_s), made, (came_s, _) in zip(seen, made_s, seen[1:], strict=False)
        if now_s >= since_s
    ]  # fmt: skip
    return max(ages_s, default=float("inf"))


def _follow(port: int, told: Connection) -> None:
    seen: Seen = []
    while not seen:
        with contextlib.suppress(OSError, http.client.HTTPException):
            for path in LOAD:
                page = http.client.HTTPConnection("127.0.0.1", port, timeout=10.0)
                page.request("GET", path)
                page.getresponse().read()
                page.close()
            stream = http.client.HTTPConnection("127.0.0.1", port, timeout=10.0)
            stream.request("GET", "/events")
            for line in stream.getresponse():
                if line.startswith(b"data: "):
                    seen.append((time.time(), json.loads(line[6:])["now_s"]))
        if not seen:
            time.sleep(AGAIN_S)
    told.send(seen)
