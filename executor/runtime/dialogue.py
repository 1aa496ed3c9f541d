"""Drives one protocol machine over a link and a clock."""

from __future__ import annotations

import asyncio
from dataclasses import dataclass
from typing import TypeVar

from executor.core.messages import Message
from executor.core.ports import Clock, Link
from executor.protocols.machine import Machine
from executor.runtime.awake import LEAST_WAIT_S, by_awake_time

M = TypeVar("M", bound=Machine)

INBOX = 256
"""Messages that may wait for a dialogue; telemetry beyond it is dropped, the protocols ask again for the rest."""


MOST_SPEEDUP = 10.0
"""Faster than this the time-outs of a dialogue do not follow: a fifteenth of a second is no time on a busy computer."""


@dataclass(frozen=True, slots=True)
class _Paced:
    """A dialogue's own time: the flight's, but never faster than `MOST_SPEEDUP`."""

    clock: Clock

    @property
    def speedup(self) -> float:
        return min(self.clock.speedup, MOST_SPEEDUP)

    def now_s(self) -> float:
        return self.clock.now_s() / self.clock.speedup * self.speedup


@by_awake_time
async def converse(machine: M, link: Link, clock: Clock) -> M:
    """Run a dialogue to its one outcome.

    When the task is cancelled the vehicle is told so where the protocol allows it.
    """
    inbox: asyncio.Queue[Message] = asyncio.Queue(INBOX)

    def take(message: Message) -> None:
        if not inbox.full():
            inbox.put_nowait(message)

    paced = _Paced(clock)
    stop_listening = link.listen(take)
    try:
        machine, send = machine.begin(paced.now_s())
        while True:
            for message in send:
                link.send(message)
            if machine.outcome is not None:
                return machine
            heard = await _heard_within(inbox, (machine.deadline_s - paced.now_s()) / paced.speedup)
            if heard is not None:
                machine, send = machine.on_message(heard, paced.now_s())
            elif paced.now_s() >= machine.deadline_s - LEAST_WAIT_S:
                machine, send = machine.on_deadline(paced.now_s())
            else:
                send = ()  # this program was kept from its work: what was said meanwhile is heard first
    except asyncio.CancelledError:
        _, send = machine.cancel()
        for message in send:
            link.send(message)
        raise
    finally:
        stop_listening()


async def _heard_within(inbox: asyncio.Queue[Message], real_s: float) -> Message | None:
    """Return the next message, or nothing once that time has passed."""
    try:
        async with asyncio.timeout(max(0.0, real_s)):
            return await inbox.get()
    except TimeoutError:
        return None
