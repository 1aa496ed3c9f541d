"""What waits for the broker: cells, in which the newest message wins, and queues with a bound.

Nothing here waits for anybody, and what can wait is bounded: a broker may be away for the whole flight.
"""

from __future__ import annotations

import asyncio
from collections import deque
from collections.abc import Iterable
from dataclasses import dataclass

MOST_KEPT = 500
"""Messages of a topic that wait at most, beside those under way; of more the oldest are dropped, and counted."""


@dataclass(frozen=True, slots=True)
class MqttMessage:
    """One message."""

    topic: str
    payload: bytes
    retain: bool = False


@dataclass(frozen=True, slots=True)
class PendingMessage:
    """A message that is under way, and its place in the row; None for one out of a cell."""

    letter: MqttMessage
    number: int | None


class Outbox:
    """Messages for the broker, in the order in which they are to be sent."""

    def __init__(self, most_kept: int = MOST_KEPT) -> None:
        """Begin empty."""
        self._most_kept = most_kept
        self._cells: dict[str, MqttMessage] = {}
        self._rows: dict[str, deque[tuple[int, MqttMessage]]] = {}
        self._retained: dict[str, MqttMessage] = {}
        self._number = 0
        self._closed = False
        self._ready = asyncio.Event()
        self.dropped: dict[str, int] = {}
        """How many messages of a topic were given up because too many waited."""

    def __len__(self) -> int:
        """Return how many messages wait."""
        return len(self._cells) + sum(len(row) for row in self._rows.values())

    def put_latest(self, letter: MqttMessage) -> None:
        """Send a message instead of the one that still waits on its topic."""
        if letter.retain:
            self._retained[letter.topic] = letter
        # A topic keeps its place in the row, so that one that changes often does not wait for ever.
        self._cells[letter.topic] = letter
        self._ready.set()

    def enqueue(self, letter: MqttMessage) -> None:
        """Send a message after those that wait already; of too many on one topic the oldest is dropped."""
        self._number += 1
        row = self._rows.setdefault(letter.topic, deque())
        row.append((self._number, letter))
        self._drop_oldest(letter.topic)
        self._ready.set()

    def take_batch(self, most: int) -> list[PendingMessage]:
        """Return what is to be sent next, at most so many; half of the places are for either kind while both wait."""
        for_cells = min(len(self._cells), max(most // 2, most - (len(self) - len(self._cells))))
        taken: list[PendingMessage] = []
        while len(taken) < most - for_cells:
            row = min((row for row in self._rows.values() if row), key=lambda row: row[0][0], default=None)
            if row is None:
                break
            number, letter = row.popleft()
            taken.append(PendingMessage(letter, number))
        taken.extend(PendingMessage(self._cells.pop(topic), None) for topic in list(self._cells)[:for_cells])
        if not len(self) and not self._closed:
            self._ready.clear()
        return taken

    def return_unsent(self, unsent: Iterable[PendingMessage]) -> None:
        """Let messages wait again that could not be sent; a newer one in their cell wins."""
        for one in reversed(list(unsent)):
            if one.number is None:
                self._cells.setdefault(one.letter.topic, one.letter)
            else:
                self._rows.setdefault(one.letter.topic, deque()).appendleft((one.number, one.letter))
                self._drop_oldest(one.letter.topic)
            self._ready.set()

    def resend_retained(self) -> None:
        """Send everything again that a broker should hold: one that was restarted may have forgotten it."""
        for letter in self._retained.values():
            self._cells.setdefault(letter.topic, letter)
            self._ready.set()

    def close(self) -> None:
        """Wait for nothing more: `ready` returns at once from now on."""
        self._closed = True
        self._ready.set()

    async def wait_until_ready(self) -> None:
        """Return when something waits, or when the outbox is closed."""
        await self._ready.wait()

    def _drop_oldest(self, topic: str) -> None:
        row = self._rows[topic]
        while len(row) > self._most_kept:
            row.popleft()
            self.dropped[topic] = self.dropped.get(topic, 0) + 1
