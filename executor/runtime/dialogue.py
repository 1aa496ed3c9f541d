"""Drives one protocol machine over a link and a clock."""

from __future__ import annotations

import asyncio
from dataclasses import dataclass, replace
from typing import TypeVar

from executor.core.interface.messages import Message, Outgoing
from executor.core.interface.ports import Clock, Link
from executor.protocols.machine import DialogueMachine, TimedOut
from executor.runtime.awake import LEAST_WAIT_S, count_awake_time, underlying

M = TypeVar("M", bound=DialogueMachine)

INBOX = 256
"""Messages that may wait for a dialogue; telemetry beyond it is dropped, the protocols ask again for the rest."""


AGAIN_S = 1.0
"""Between two repeats of what a machine asked last, where this program lost time."""
MOST_SPEEDUP = 10.0
"""Faster than this the time-outs of a dialogue do not follow: a fifteenth of a second is no time on a busy computer."""


@dataclass(frozen=True, slots=True)
class _DialogueClock:
    """A dialogue's own time: the flight's, but never faster than `MOST_SPEEDUP`."""

    clock: Clock

    @property
    def speedup(self) -> float:
        return min(self.clock.speedup, MOST_SPEEDUP)

    def now_s(self) -> float:
        return self.clock.now_s() / self.clock.speedup * self.speedup


@dataclass(slots=True)
class _Patience:
    """How long a vehicle has not answered: what it is asked again, and when it may be given up."""

    able: Clock
    paced: _DialogueClock
    since_s: float = 0.0
    able_since_s: float = 0.0
    granted_s: float | None = None
    """How long the machine would have waited."""
    repeat: tuple[Outgoing, ...] = ()
    """What was asked again last."""

    def begin(self) -> None:
        """Begin anew: it has answered."""
        self.since_s, self.able_since_s = self.paced.now_s(), self.able.now_s()
        self.granted_s, self.repeat = None, ()

    def pass_deadline(self, machine: M) -> tuple[M, tuple[Outgoing, ...]]:
        """Carry a machine over its deadline; who is given up had that time while this program was able to hear it.

        What is repeated goes by the flight's clock all the same: a vehicle's own time-outs do not wait for us.
        """
        now_s = self.paced.now_s()
        after, send = machine.on_deadline(now_s)
        if isinstance(after.outcome, TimedOut):
            self.granted_s = now_s - self.since_s if self.granted_s is None else self.granted_s
            waited_s = (self.able.now_s() - self.able_since_s) / self.able.speedup * self.paced.speedup
            if waited_s < self.granted_s - LEAST_WAIT_S:
                return replace(machine, deadline_s=now_s + AGAIN_S), self.repeat
        self.repeat = send or self.repeat
        return after, send


@count_awake_time
async def run_dialogue(machine: M, link: Link, clock: Clock) -> M:
    """Run a dialogue to its one outcome.

    When the task is cancelled the vehicle is told so where the protocol allows it.
    """
    inbox: asyncio.Queue[Message] = asyncio.Queue(INBOX)

    def take(message: Message) -> None:
        if not inbox.full():
            inbox.put_nowait(message)

    paced = _DialogueClock(underlying(clock))
    patience = _Patience(clock, paced)
    stop_listening = link.listen(take)
    try:
        machine, send = machine.begin(paced.now_s())
        patience.begin()
        while True:
            for message in send:
                link.send(message)
            if machine.outcome is not None:
                return machine
            heard = await _receive_within(inbox, (machine.deadline_s - paced.now_s()) / paced.speedup)
            if heard is None:
                machine, send = patience.pass_deadline(machine)
                continue
            before = machine
            machine, send = machine.on_message(heard, paced.now_s())
            if machine is not before:
                patience.begin()
    except asyncio.CancelledError:
        _, send = machine.cancel()
        for message in send:
            link.send(message)
        raise
    finally:
        stop_listening()


async def _receive_within(inbox: asyncio.Queue[Message], real_s: float) -> Message | None:
    """Return the next message, or nothing once that time has passed."""
    try:
        async with asyncio.timeout(max(0.0, real_s)):
            return await inbox.get()
    except TimeoutError:
        return None
