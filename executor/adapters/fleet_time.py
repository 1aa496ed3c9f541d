"""The time of a simulated fleet of faultline's own, by which a flight goes that is faster than real time."""

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

GREETS_REAL_S = 1.0
"""Who does not greet within this is no fleet of ours."""
BUSY_REAL_S = 0.25
"""What never comes to rest goes on all the same after this: a flood of frames slows a flight, and does not end it."""


class FleetTime(asyncio.Protocol):
    """Seconds of a steady clock: the computer's, or as many as the fleet has lived through, as long as one is there.

    The fleet's next moment begins when everything that it said before has been taken in; that is then acknowledged, and
    the fleet lives at most `AHEAD_S` beyond it. So a process that the computer keeps waiting keeps the other waiting,
    and neither sees the other late.
    """

    def __init__(
        self, speedup: float, steady_s: Callable[[], float], monotonic_s: Callable[[], float] = time.monotonic
    ) -> None:
        """Begin alone.

        Args:
            speedup: Of the flight; a fleet with another one keeps its own time.
            steady_s: The computer's own steady clock.
            monotonic_s: Real seconds, to see how long a partner has been silent.
        """
        self._speedup = speedup
        self._own_s = steady_s
        self._monotonic_s = monotonic_s
        self._transport: asyncio.Transport | None = None
        self._lines = LineBuffer()
        self._turn: ReplyWait | None = None
        self._came = asyncio.Event()
        self._behind_s = 0.0
        """Of our time behind the computer's clock, while alone."""
        self._base_s = 0.0
        self._base_lived_s = 0.0
        self._lived_s = 0.0
        """What we live in, in the fleet's time."""
        self._told_s = 0.0
        """How far the fleet has lived."""
        self._heard_at_s = 0.0
        self._taken_s = 0.0
        """What was acknowledged last."""
        self._together = False
        self._dated: tuple[float, float] | None = None
        """A moment of our time, and its date on the fleet's clock."""

    @property
    def is_synchronised(self) -> bool:
        """Whether the fleet's time is ours at the moment."""
        return self._together

    def steady_s(self) -> float:
        """Return seconds of a clock that never goes back."""
        if self._together:
            return self._base_s + (self._lived_s - self._base_lived_s) / self._speedup
        return self._own_s() - self._behind_s

    @property
    def is_connected(self) -> bool:
        """Whether a fleet has greeted and is still there, be it stopped."""
        return self._turn is not None

    def date_unix_s(self) -> float | None:
        """Return the date on the fleet's clock, which follows its own time; None without a fleet."""
        if self._dated is None or not self._together:
            return None
        at_s, unix_s = self._dated
        return unix_s + self.steady_s() - at_s

    async def connect(self, port: int) -> bool:
        """Ask the fleet behind this port for a common time; returns whether there is one."""
        try:
            async with asyncio.timeout(GREETS_REAL_S):
                await asyncio.get_running_loop().create_connection(lambda: self, HERE, port)
                await self._came.wait()
        except (OSError, TimeoutError):
            self.disconnect()
        return self._turn is not None

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        """Wait for the greeting."""
        self._came.clear()
        self._transport, self._lines = cast("asyncio.Transport", transport), LineBuffer()

    def data_received(self, data: bytes) -> None:
        """Hear how far the fleet has lived."""
        for line in self._lines.take(data):
            if self._turn is None:
                greeting = parse_greeting(line)
                if greeting is None or greeting.speedup != self._speedup:
                    self.disconnect()
                    return
                self._handle_greeting(greeting)
            elif (told_s := parse_time_line(line)) is not None and told_s > self._told_s:
                if not self._together:
                    self._synchronise(told_s)
                if self._told_s == self._lived_s:
                    self._heard_at_s = self._monotonic_s()
                self._told_s = told_s
                self._turn.end()
        # It lived on without us, and what it said meanwhile is late already: it is heard as late as it was.
        if self._together and self._told_s - self._lived_s > 2 * AHEAD_S:
            self._advance()

    def _handle_greeting(self, greeting: Greeting) -> None:
        self._turn = ReplyWait(greeting.pid)
        if self._transport is not None:
            self._transport.write(Greeting(os.getpid(), self._speedup).to_line())
        self._synchronise(greeting.lived_s)
        self._dated = (self._base_s, greeting.unix_s)
        self._came.set()

    def _synchronise(self, lived_s: float) -> None:
        self._base_s = self.steady_s()
        self._base_lived_s = self._lived_s = self._told_s = self._taken_s = lived_s
        self._together = True

    def _fall_back_to_own_time(self) -> None:
        if self._together:
            self._behind_s = self._own_s() - self.steady_s()
            self._together = False

    def _advance(self) -> None:
        self._lived_s = self._told_s

    def note_idle(self) -> bool:
        """Take note that everything that was heard is dealt with; returns whether time has gone on by that."""
        if self._told_s > self._lived_s:
            self._advance()
            return True
        if self._taken_s < self._lived_s and self._transport is not None and self._turn is not None:
            self._taken_s = self._lived_s
            self._transport.write(format_time_line(self._taken_s))
            self._turn.begin(self._monotonic_s())
        return False

    def note_busy(self) -> None:
        """Take note that there is still something to be dealt with."""
        if self._told_s > self._lived_s and self._monotonic_s() - self._heard_at_s >= BUSY_REAL_S:
            self._advance()
            self.note_idle()

    def note_silence(self) -> None:
        """Take note that nothing was heard for a while: the fleet may be stopped, or gone."""
        if self._turn is not None and self._turn.is_gone(self._monotonic_s()):
            self._fall_back_to_own_time()

    def disconnect(self) -> None:
        """Go on alone."""
        self._fall_back_to_own_time()
        self._turn = None
        if self._transport is not None:
            self._transport.abort()
            self._transport = None

    def connection_lost(self, exc: Exception | None) -> None:  # noqa: ARG002 - asyncio's signature
        """Go on alone."""
        self._fall_back_to_own_time()
        self._turn = self._transport = None
        self._came.set()
