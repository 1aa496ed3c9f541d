"""The seams through which runtime knows the outside."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

from executor.core.commands import Solve
from executor.core.connection import Connection
from executor.core.events import Event, SolveEnded
from executor.core.messages import Message, Outgoing


class Clock(Protocol):
    """The time of the flight, which runs `speedup` times as fast as the real one in a simulation."""

    @property
    def speedup(self) -> float:
        """Seconds of the flight in a real second."""
        ...

    def now_s(self) -> float:
        """Seconds since the ground station began; never goes back."""
        ...


class Link(Protocol):
    """One vehicle's messages, in and out."""

    def send(self, message: Outgoing) -> None:
        """Send without waiting; what cannot be sent is lost, as on the air."""
        ...

    def listen(self, listener: Callable[[Message], None]) -> Callable[[], None]:
        """Call `listener` with every message from now on; returns how to stop that."""
        ...


@dataclass(slots=True)
class LinkCounts:
    """What came from a vehicle and what did not."""

    received: int = 0
    missing: int | None = 0
    """Frames that the sequence numbers say were sent and never came; None where they cannot be seen."""
    foreign: int = 0
    """Frames of systems on this connection that are nobody's vehicle."""


class OpenLink(Link, Protocol):
    """A link of the flight, as long as it is open."""

    @property
    def counts(self) -> LinkCounts:
        """What came so far."""
        ...


class FrameLog(Protocol):
    """Where every frame of both directions is recorded."""

    def write(self, frame: bytes) -> None:
        """Append one frame."""
        ...


@dataclass(frozen=True, slots=True)
class LinkOrder:
    """A link to be opened."""

    connection: Connection
    sysid: int
    log: FrameLog | None = None


class EventSink(Protocol):
    """Where events are written before they are applied."""

    def write(self, event: Event, now_s: float) -> None:
        """Append one event."""
        ...


class Solver(Protocol):
    """The planner in a process of its own."""

    async def solve(self, problem: Solve) -> SolveEnded:
        """Return the best routes found within the deadline."""
        ...

    def cancel(self, revision: int) -> None:
        """Make whatever works on this revision stop soon."""
        ...


class Judge(Protocol):
    """The planner, asked what would be, when nothing else is asked."""

    async def judge(self, problem: Solve) -> tuple[int, ...] | None:
        """Return the segments that could not be covered; None if something more urgent came."""
        ...
