"""What links to several vehicles share: one radio. Its transfers take turns, its round trip is known to all of them.

Whether a transfer comes on is a matter of the computer's time, as that of its vehicle's answers.
"""

from __future__ import annotations

import asyncio
import math
from collections.abc import AsyncIterator, Hashable
from contextlib import asynccontextmanager
from contextvars import ContextVar
from dataclasses import dataclass, field
from itertools import count
from weakref import WeakKeyDictionary, WeakSet

from executor.core.interface.messages import Radio
from executor.core.interface.ports import Link
from executor.protocols.machine import RoundTrip
from executor.protocols.turns import Rank, Turn, count_at_once, find_most_ahead, find_wait_s, is_buffer_full, is_next

MOST_CHANNELS = 200
"""Most channels to remember; a reopened connection is a new one."""
LEAST_WAIT_S = 0.01


@dataclass(eq=False, slots=True)
class Channel:
    """One channel, as far as our own dialogues know it; times are those of dialogues."""

    round_trip: RoundTrip = field(default_factory=RoundTrip)
    """Round trip, as last measured by a dialogue."""
    radio: Radio | None = None
    radio_s: float = float("-inf")
    under_way: dict[Turn, float] = field(default_factory=dict)
    """Transfers in progress, with the loop time of their last progress."""
    waiting: set[Turn] = field(default_factory=set)
    links: WeakSet[Link] = field(default_factory=WeakSet)
    """Links behind it."""
    changed: asyncio.Event = field(default_factory=asyncio.Event)
    sent_s: float = float("-inf")
    """Loop time of the last message of a dialogue."""
    _numbers: count[int] = field(default_factory=count)
    _told: RoundTrip | None = None
    """Round trip that was last passed on."""

    def hear(self, radio: Radio, now_s: float) -> None:
        """Take a report of our own radio."""
        self.radio, self.radio_s = radio, now_s

    def is_full(self, now_s: float) -> bool:
        """Return whether the radio holds more than it can send."""
        return is_buffer_full(self.radio, self.radio_s, now_s)

    @property
    def is_busy(self) -> bool:
        """Whether transfers of ours are under way, or wait."""
        return bool(self.under_way or self.waiting)

    @property
    def at_once(self) -> int:
        """How many transfers may be under way side by side."""
        return count_at_once(self.round_trip, self.radio)

    @property
    def most_ahead(self) -> int:
        """How many items of a transfer may be in flight."""
        return find_most_ahead(self.round_trip, self.radio, alone=len(self.links) == 1)

    def learn(self, round_trip: RoundTrip) -> None:
        """Take what a dialogue has measured, if it has."""
        if round_trip.mean_s is not None:
            self.round_trip = round_trip

    def take_round_trip_s(self) -> float | None:
        """Return the round trip if it was measured since this was asked last."""
        before, self._told = self._told, self.round_trip
        return None if before is self._told or self._told.mean_s is None else round(self._told.mean_s, 3)

    def note_sent(self) -> None:
        """Note that a dialogue says something."""
        self.sent_s = asyncio.get_running_loop().time()

    def is_quiet(self, for_real_s: float) -> bool:
        """Return whether no dialogue has said anything for so long."""
        return asyncio.get_running_loop().time() - self.sent_s >= for_real_s

    def note_progress(self) -> None:
        """Note that the transfer of this task has come on."""
        turn = _TURN.get()
        if turn in self.under_way:
            self.under_way[turn] = asyncio.get_running_loop().time()

    @asynccontextmanager
    async def take_turn(self, rank: Rank, needed_s: float = math.inf) -> AsyncIterator[bool]:
        """Wait until a transfer may begin, and hold the channel inside the block; yields whether that took any time."""
        if _TURN.get() in self.under_way:  # it is a part of one
            yield False
            return
        if (outer := _TURN.get()) is not None:  # it holds another channel, which was left in the middle
            rank, needed_s = outer.rank, outer.needed_s
        turn, waited, now_s = Turn(rank, needed_s, next(self._numbers)), False, asyncio.get_running_loop().time
        self.waiting.add(turn)
        try:
            while not is_next(turn, self.waiting, self.under_way.values(), now_s(), self.at_once):
                waited = True
                await self._wait(max(LEAST_WAIT_S, find_wait_s(self.under_way.values(), now_s(), self.at_once)))
        finally:
            self.waiting.discard(turn)
            self._tell()
        self.under_way[turn] = now_s()
        token = _TURN.set(turn)
        try:
            yield waited
        finally:
            _TURN.reset(token)
            del self.under_way[turn]
            self._tell()

    def _tell(self) -> None:
        self.changed.set()
        self.changed = asyncio.Event()

    async def _wait(self, real_s: float) -> None:
        try:
            async with asyncio.timeout(real_s):
                await self.changed.wait()
        except TimeoutError:
            return


_TURN: ContextVar[Turn | None] = ContextVar("the turn of this task's transfer", default=None)
_CHANNELS: WeakKeyDictionary[asyncio.AbstractEventLoop, dict[Hashable, Channel]] = WeakKeyDictionary()


def channel_of(link: Link) -> Channel:
    """Return the channel of a link: that of all links to the same peer, of several the one that orders go over."""
    link = link.ways[0]
    known = _CHANNELS.setdefault(asyncio.get_running_loop(), {})
    if len(known) > MOST_CHANNELS:
        for peer in [peer for peer, one in known.items() if not one.under_way and not one.waiting]:
            del known[peer]
    channel = known.setdefault(link.peer or id(link), Channel())
    channel.links.add(link)
    return channel
