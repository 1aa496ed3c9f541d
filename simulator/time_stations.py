"""The ground stations that a fleet keeps its time together with: it lives on no further than they can follow."""

from __future__ import annotations

import asyncio
import os
import time
from collections.abc import Callable
from typing import cast

from simulator.common_time import (
    AHEAD_S,
    HERE,
    Greeting,
    LineBuffer,
    ReplyWait,
    format_time_line,
    parse_greeting,
    parse_time_line,
)


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
        """Set when one of them has taken something in, has come, or has gone."""
        self.ever = False
        """Whether anybody was ever there: the dates of such a flight follow its time, not the computer's."""
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
        """Whether the fleet lives on without it, until it says something again."""

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
