"""A link in memory that loses, delays, doubles and reorders messages, by a seed and on the event loop's clock."""

from __future__ import annotations

import asyncio
import random
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Protocol

from executor.core.interface.messages import Message, Outgoing
from executor.core.interface.ports import Clock, LinkCounts, LinkView


class Responder(Protocol):
    """The vehicle at the other end."""

    @property
    def wake_s(self) -> float | None:
        """When it wants to be looked at without being spoken to."""
        ...

    def hear(self, message: Outgoing, now_s: float) -> Sequence[Message]:
        """Answer a message."""
        ...

    def tick(self, now_s: float) -> Sequence[Message]:
        """Do what is due by now."""
        ...


@dataclass(frozen=True, slots=True)
class Air:
    """How bad the link is, each way."""

    loss: float = 0.0
    """Share of messages that never arrive."""
    duplicate: float = 0.0
    """Share of messages that arrive twice."""
    delay_s: tuple[float, float] = (0.0, 0.0)
    """Each copy takes a time between these; a wide range reorders."""


CLEAN = Air()


class FakeLink:
    """`ports.Link` to a vehicle in memory."""

    def __init__(self, vehicle: Responder, clock: Clock, air: Air = CLEAN, *, seed: int = 0) -> None:
        """Connect; the loop must run."""
        self.vehicle = vehicle
        self.air = air
        self.sent: list[tuple[float, Outgoing]] = []
        """What was handed to the link, lost or not."""
        self.spoken_to = asyncio.Event()
        """Something was handed to the link."""
        self.counts = LinkCounts()
        self.radio: object | None = None
        self.cut = False
        """Nothing passes any more."""
        self._closed = False
        self._passed = 0
        self._clock = clock
        self._rng = random.Random(seed)
        self._listeners: list[Callable[[Message], None]] = []
        self._timer: asyncio.TimerHandle | None = None
        self._set_timer()

    connection, is_alive = "memory", True

    @property
    def ways(self) -> Sequence[FakeLink]:
        """It is one link."""
        return (self,)

    def describe_links(self) -> tuple[LinkView, ...]:
        """It is one link."""
        return ()

    @property
    def peer(self) -> object | None:
        """The radio that it shares with others, if there is one."""
        return self.radio

    def send(self, message: Outgoing) -> None:
        """Send towards the vehicle."""
        self.sent.append((self._clock.now_s(), message))
        self.spoken_to.set()
        self._pass(lambda: self._reached_vehicle(message))

    def listen(self, listener: Callable[[Message], None]) -> Callable[[], None]:
        """Call `listener` with every message that arrives here."""
        self._listeners.append(listener)
        return lambda: self._listeners.remove(listener)

    def say(self, message: Message) -> None:
        """Let the vehicle say something of its own accord."""
        self._pass(lambda: self._reached_us(message))

    def close(self) -> None:
        """Stop the vehicle's own clock for good: in virtual time it would go on for as long as a loop takes to end."""
        self._closed = True
        self._cancel_timer()

    def of_kind(self, kind: type[Outgoing]) -> list[tuple[float, Outgoing]]:
        """Return what was sent of one kind, with its times."""
        return [(at_s, message) for at_s, message in self.sent if isinstance(message, kind)]

    def _pass(self, arrive: Callable[[], None]) -> None:
        if self._closed or self.cut or self._rng.random() < self.air.loss:
            return
        for _ in range(2 if self._rng.random() < self.air.duplicate else 1):
            late_s = self._rng.uniform(*self.air.delay_s) / self._clock.speedup
            if self.air.delay_s[0] == self.air.delay_s[1]:  # the loop does not keep the order of what is due at once
                self._passed += 1
                late_s += self._passed * 1e-7
            asyncio.get_running_loop().call_later(late_s, arrive)

    def _reached_vehicle(self, message: Outgoing) -> None:
        self._answer(self.vehicle.hear(message, self._clock.now_s()))

    def _reached_us(self, message: Message) -> None:
        for listener in tuple(self._listeners):
            listener(message)

    def _answer(self, messages: Sequence[Message]) -> None:
        for message in messages:
            self.say(message)
        self._set_timer()

    def _cancel_timer(self) -> None:
        if self._timer is not None:
            self._timer.cancel()

    def _set_timer(self) -> None:
        self._cancel_timer()
        if self._closed:
            return
        wake_s = self.vehicle.wake_s
        if wake_s is not None:
            left_s = max(0.0, wake_s - self._clock.now_s()) / self._clock.speedup
            self._timer = asyncio.get_running_loop().call_later(left_s, self._woken)

    def _woken(self) -> None:
        self._answer(self.vehicle.tick(self._clock.now_s()))
