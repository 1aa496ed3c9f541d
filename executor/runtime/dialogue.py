"""Drives one protocol machine over a link and a clock."""

from __future__ import annotations

import asyncio
from typing import TypeVar

from executor.core.messages import Message
from executor.core.ports import Clock, Link
from executor.protocols.machine import Machine

M = TypeVar("M", bound=Machine)

INBOX = 256
"""Messages that may wait for a dialogue; telemetry beyond it is dropped, the protocols ask again for the rest."""


async def converse(machine: M, link: Link, clock: Clock) -> M:
    """Run a dialogue to its one outcome.

    When the task is cancelled the vehicle is told so where the protocol allows it.
    """
    inbox: asyncio.Queue[Message] = asyncio.Queue(INBOX)

    def take(message: Message) -> None:
        if not inbox.full():
            inbox.put_nowait(message)

    stop_listening = link.listen(take)
    try:
        machine, send = machine.begin(clock.now_s())
        while True:
            for message in send:
                link.send(message)
            if machine.outcome is not None:
                return machine
            left_s = (machine.deadline_s - clock.now_s()) / clock.speedup
            try:
                async with asyncio.timeout(max(0.0, left_s)):
                    heard = await inbox.get()
            except TimeoutError:
                machine, send = machine.on_deadline(clock.now_s())
            else:
                machine, send = machine.on_message(heard, clock.now_s())
    except asyncio.CancelledError:
        _, send = machine.cancel()
        for message in send:
            link.send(message)
        raise
    finally:
        stop_listening()
