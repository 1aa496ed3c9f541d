"""Keep one time between a simulated fleet and its ground stations, so that neither outruns the other.

Lines of text on a TCP connection within this computer, to the port number of the fleet's first vehicle. The fleet
greets, the ground station greets back; then the fleet says how far it has lived, and the ground station up to where it
has taken everything in.
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
"""Most simulated seconds that the fleet runs ahead of the ground station: a radio's delay."""
LOOK_REAL_S = 0.5
"""Silence after which a partner is checked; one that was stopped on purpose is not waited for."""
PATIENCE_REAL_S = 10.0
"""Silence after which the fleet continues without a partner that is not stopped."""
LONGEST_LINE = 200


@dataclass(frozen=True, slots=True)
class Greeting:
    """Who is there."""

    pid: int
    speedup: float
    lived_s: float = 0.0
    """Time up to which the fleet has run."""
    unix_s: float = 0.0
    """Unix time of that moment on the fleet's clock."""

    def to_line(self) -> bytes:
        """Return it as it is sent."""
        return f"{NAME} {self.pid} {self.speedup!r} {self.lived_s!r} {self.unix_s!r}\n".encode()


def parse_greeting(line: bytes) -> Greeting | None:
    """Return the greeting in a line; None if it is something else."""
    try:
        name, pid, *figures = line.decode("ascii").split(" ")
        speedup, lived_s, unix_s = map(float, figures)
        return Greeting(int(pid), speedup, lived_s, unix_s) if name == NAME else None
    except ValueError:
        return None


def format_time_line(lived_s: float) -> bytes:
    """Return a simulated time as it is sent."""
    return f"{lived_s!r}\n".encode()


def parse_time_line(line: bytes) -> float | None:
    """Return the simulated time in a line; None if it is something else."""
    try:
        return float(line)
    except ValueError:
        return None


class LineBuffer:
    """Cuts what comes into lines."""

    def __init__(self) -> None:
        self._rest = b""

    def take(self, data: bytes) -> list[bytes]:
        """Return the lines that are complete now; something that is no line of ours is dropped."""
        *lines, rest = (self._rest + data).split(b"\n")
        self._rest = rest if len(rest) <= LONGEST_LINE else b""
        return lines


def is_process_stopped(pid: int) -> bool:
    """Return whether a process of this computer was stopped (SIGSTOP, Ctrl-Z, a debugger), where Linux can tell."""
    try:
        stat = Path(f"/proc/{pid}/stat").read_text(encoding="ascii", errors="replace")
    except OSError:
        return False
    return stat.rpartition(")")[2].split()[:1] in (["T"], ["t"])


class ReplyWait:
    """How long a partner has owed a word, in real seconds."""

    def __init__(self, pid: int) -> None:
        self._pid = pid
        self._since_s: float | None = None
        self._looked_s = 0.0

    def begin(self, now_s: float) -> None:
        """It was told something, and has to answer."""
        if self._since_s is None:
            self._since_s = self._looked_s = now_s

    def end(self) -> None:
        """It did."""
        self._since_s = None

    def is_gone(self, now_s: float) -> bool:
        """Return whether it is no use to wait for it: it was stopped, or has owed its word for too long."""
        if self._since_s is None or now_s - self._looked_s < LOOK_REAL_S:
            return False
        self._looked_s = now_s
        return now_s - self._since_s >= PATIENCE_REAL_S or is_process_stopped(self._pid)


class Stations:
    """Who has asked for a common time; without anybody the fleet's time is its own."""

    def __init__(
        self, speedup: float, dated_s: Callable[[float], float], monotonic_s: Callable[[], float] = time.monotonic
    ) -> None:
        """Begin at the simulated time 0.

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
        """Return how far the fleet may live now."""
        now_s = self.monotonic_s()
        return min((station.safe_time_s(now_s) for station in self._here), default=float("inf"))

    def send_time(self, lived_s: float) -> None:
        """Tell everybody how far the fleet has lived, after what it said until then."""
        if lived_s > self.lived_s:
            self.lived_s = lived_s
            for station in self._here:
                station.send_time(lived_s)

    def add_station(self, station: Station) -> None:
        """Wait for this one from now on."""
        self.ever = True
        self._here.add(station)
        self.moved.set()

    def remove_station(self, station: Station) -> None:
        """Wait for this one no more."""
        self._here.discard(station)
        self.moved.set()

    async def open(self, port: int) -> asyncio.Server:
        """Listen for them.

        Raises:
            OSError: the port is taken.
        """
        loop = asyncio.get_running_loop()
        return await loop.create_server(lambda: Station(self), HERE, port)

    def close(self) -> None:
        """Let go of all."""
        for station in tuple(self._here):
            station.disconnect()


class Station(asyncio.Protocol):
    """One of them."""

    def __init__(self, stations: Stations) -> None:
        self._stations = stations
        self._lines = LineBuffer()
        self._transport: asyncio.Transport | None = None
        self._turn: ReplyWait | None = None
        self._taken_s = 0.0
        self._alone = False
        """Whether the fleet continues without it until it speaks again."""

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        """Greet."""
        self._transport = cast("asyncio.Transport", transport)
        whole = self._stations
        greeting = Greeting(os.getpid(), whole.speedup, whole.lived_s, whole.dated_s(whole.lived_s))
        self._transport.write(greeting.to_line())

    def data_received(self, data: bytes) -> None:
        """Hear how far it has come."""
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
        """Say how far the fleet has lived, unless it hears nothing at present."""
        if self._transport is None or self._turn is None:
            return
        self._turn.begin(self._stations.monotonic_s())
        if not self._alone or self._transport.get_write_buffer_size() == 0:
            self._transport.write(format_time_line(lived_s))

    def safe_time_s(self, now_s: float) -> float:
        """Return how far the fleet may live for its sake."""
        if self._turn is not None and self._turn.is_gone(now_s):
            self._alone = True
        return float("inf") if self._alone else self._taken_s + AHEAD_S

    def disconnect(self) -> None:
        """Let go."""
        if self._transport is not None:
            self._transport.abort()

    def connection_lost(self, exc: Exception | None) -> None:  # noqa: ARG002 - asyncio's signature
        """Note that it has gone."""
        self._stations.remove_station(self)
