"""A browser's side of the page: how old the state is that somebody sees, in a process of its own."""

from __future__ import annotations

import contextlib
import http.client
import json
import multiprocessing
import time
from collections.abc import Iterator
from multiprocessing.connection import Connection

AGAIN_S = 0.2
"""Real seconds between two attempts to reach a page that is not there yet."""
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
"""What a browser asks for before it follows."""

Seen = list[tuple[float, float]]
"""When a state arrived, in seconds since 1970, and the flight's time that it is of."""


@contextlib.contextmanager
def browser(port: int) -> Iterator[Connection]:
    """Follow the page of this computer as a browser does; yields where `seen` reads what it saw, once the page ends."""
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
    """Return how old a state grew at most before the next one took its place, in real seconds.

    Args:
        seen: What a browser saw.
        began_unix_s: When the flight's clock was at zero.
        speedup: Seconds of the flight in a real one.
        since_s: The flight's time from when on it counts.
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
