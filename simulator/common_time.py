"""Synchronise time between a simulated fleet and its ground stations, so that neither outruns the other.

Protocol: lines of text on a local TCP connection, on the port number of the fleet's first vehicle. The fleet greets,
the ground station greets back; then the fleet sends its simulated time, and the ground station the time up to which it
has processed everything.
"""

from __future__ import annotations

import asyncio
import os
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import cast

NAME = "faultline-time-1"
HERE = "127.0.0.1"
AHEAD_S = 0.1
"""Maximum lead of the fleet over the ground station in simulated seconds: a radio's delay."""
LOOK_REAL_S = 0.5
"""Silence after which a partner is checked; the fleet does not wait for a deliberately stopped one."""
PATIENCE_REAL_S = 10.0
"""Silence after which the fleet continues without a partner that is not stopped."""
LONGEST_LINE = 200


@dataclass(frozen=True, slots=True)
class Greeting:
    """Process and time of the sender."""

    pid: int
    speedup: float
    lived_s: float = 0.0
    """Simulated time reached by the fleet."""
    unix_s: float = 0.0
    """Unix time of that moment on the fleet's clock."""

    def to_line(self) -> bytes:
        """Return it as a line to send."""
        return f"{NAME} {self.pid} {self.speedup!r} {self.lived_s!r} {self.unix_s!r}\n".encode()


def parse_greeting(line: bytes) -> Greeting | None:
    """Return the greeting in a line; None for any other line."""
    try:
        name, pid, *figures = line.decode("ascii").split(" ")
        speedup, lived_s, unix_s = map(float, figures)
        return Greeting(int(pid), speedup, lived_s, unix_s) if name == NAME else None
    except ValueError:
        return None


def format_time_line(lived_s: float) -> bytes:
    """Return a simulated time as a line to send."""
    return f"{lived_s!r}\n".encode()


def parse_time_line(line: bytes) -> float | None:
    """Return the simulated time in a line; None for any other line."""
    try:
        return float(line)
    except ValueError:
        return None


class LineBuffer:
    """Split received bytes into lines."""

    def __init__(self) -> None:
        self._rest = b""

    def take(self, data: bytes) -> list[bytes]:
        """Return the lines that are now complete; invalid lines are dropped."""
        *lines, rest = (self._rest + data).split(b"\n")
        self._rest = rest if len(rest) <= LONGEST_LINE else b""
        return lines


def is_process_stopped(pid: int) -> bool:
    """Return whether a local process was stopped (SIGSTOP, Ctrl-Z, a debugger), where Linux can tell."""
    try:
        stat = Path(f"/proc/{pid}/stat").read_text(encoding="ascii", errors="replace")
    except OSError:
        return False
    return stat.rpartition(")")[2].split()[:1] in (["T"], ["t"])


class ReplyWait:
    """Time for which a partner's reply is outstanding, in real seconds."""

    def __init__(self, pid: int) -> None:
        self._pid = pid
        self._since_s: float | None = None
        self._looked_s = 0.0

    def begin(self, now_s: float) -> None:
        """Start waiting for a reply."""
        if self._since_s is None:
            self._since_s = self._looked_s = now_s

    def end(self) -> None:
        """Stop waiting."""
        self._since_s = None

    def is_gone(self, now_s: float) -> bool:
        """Return whether waiting is useless: the partner was stopped, or its reply is overdue."""
        if self._since_s is None or now_s - self._looked_s < LOOK_REAL_S:
            return False
        self._looked_s = now_s
        return now_s - self._since_s >= PATIENCE_REAL_S or is_process_stopped(self._pid)


class Stations:
    """Ground stations that requested a common time; without any the fleet keeps its own time."""

    def __init__(
        self, speedup: float, dated_s: Callable[[float], float], monotonic_s: Callable[[], float] = time.monotonic
    ) -> None:
        """Begin at simulated time 0.

        Args:
            speedup: Of the fleet.
            dated_s: Returns the date of a simulated time.
            monotonic_s: Real seconds that never go back.
        """
        self.lived_s = 0.0
        self.moved = asyncio.Event()
        """Set when a partner has acknowledged, connected or disconnected."""
        self.ever = False
        """Whether a partner ever connected; dates then follow flight time, not the computer's."""
        self.speedup = speedup
        self.dated_s = dated_s
        self.monotonic_s = monotonic_s
        self._here: set[Station] = set()

    def safe_time_s(self) -> float:
        """Return the simulated time up to which the fleet may run now."""
        now_s = self.monotonic_s()
        return min((station.safe_time_s(now_s) for station in self._here), default=float("inf"))

    def send_time(self, lived_s: float) -> None:
        """Send the fleet's simulated time to all stations, after its messages up to then."""
        if lived_s > self.lived_s:
            self.lived_s = lived_s
            for station in self._here:
                station.send_time(lived_s)

    def add_station(self, station: Station) -> None:
        """Wait for this station from now on."""
        self.ever = True
        self._here.add(station)
        self.moved.set()

    def remove_station(self, station: Station) -> None:
        """Stop waiting for this station."""
        self._here.discard(station)
        self.moved.set()

    async def open(self, port: int) -> asyncio.Server:
        """Listen for stations.

        Raises:
            OSError: the port is taken.
        """
        loop = asyncio.get_running_loop()
        return await loop.create_server(lambda: Station(self), HERE, port)

    def close(self) -> None:
        """Disconnect all stations."""
        for station in tuple(self._here):
            station.disconnect()


class Station(asyncio.Protocol):
    """One ground station."""

    def __init__(self, stations: Stations) -> None:
        self._stations = stations
        self._lines = LineBuffer()
        self._transport: asyncio.Transport | None = None
        self._turn: ReplyWait | None = None
        self._taken_s = 0.0
        self._alone = False
        """Whether the fleet continues without it until its next message."""

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        """Send the greeting."""
        self._transport = cast("asyncio.Transport", transport)
        whole = self._stations
        greeting = Greeting(os.getpid(), whole.speedup, whole.lived_s, whole.dated_s(whole.lived_s))
        self._transport.write(greeting.to_line())

    def data_received(self, data: bytes) -> None:
        """Read the time up to which it has processed."""
        for line in self._lines.take(data):
            if self._turn is None:
                greeting = parse_greeting(line)
                if greeting is None:
                    self.disconnect()
                    return
                self._turn = ReplyWait(greeting.pid)
                self._taken_s = self._stations.lived_s
                self._stations.add_station(self)
            elif (taken_s := parse_time_line(line)) is not None:
                self._taken_s = min(max(taken_s, self._taken_s), self._stations.lived_s)
                self._alone = False
                self._turn.end()
                self._stations.moved.set()
        if self._turn is not None and self._taken_s < self._stations.lived_s:
            self._turn.begin(self._stations.monotonic_s())

    def send_time(self, lived_s: float) -> None:
        """Send the fleet's time, unless the station does not read at present."""
        if self._transport is None or self._turn is None:
            return
        self._turn.begin(self._stations.monotonic_s())
        if not self._alone or self._transport.get_write_buffer_size() == 0:
            self._transport.write(format_time_line(lived_s))

    def safe_time_s(self, now_s: float) -> float:
        """Return the time up to which this station lets the fleet run."""
        if self._turn is not None and self._turn.is_gone(now_s):
            self._alone = True
        return float("inf") if self._alone else self._taken_s + AHEAD_S

    def disconnect(self) -> None:
        """Abort the connection."""
        if self._transport is not None:
            self._transport.abort()

    def connection_lost(self, exc: Exception | None) -> None:  # noqa: ARG002 - asyncio's signature
        """Remove the station."""
        self._stations.remove_station(self)
