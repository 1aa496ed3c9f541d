"""The seams through which runtime knows the outside."""

from __future__ import annotations

from collections.abc import Callable, Coroutine, Hashable, Sequence
from dataclasses import dataclass, field
from typing import Protocol

from executor.core.interface.commands import Solve
from executor.core.interface.connection import Connection
from executor.core.interface.events import Event, SolveEnded
from executor.core.interface.messages import Message, Outgoing
from missions import Pricing


class Clock(Protocol):
    """The time of the flight, which runs `speedup` times as fast as the real one in a simulation."""

    @property
    def speedup(self) -> float:
        """Seconds of the flight in a real second."""

    def now_s(self) -> float:
        """Seconds since the ground station began; never goes back."""


@dataclass(frozen=True, slots=True)
class LinkView:
    """One of a vehicle's links, as far as it is worth showing."""

    connection: str
    heard_age_s: float | None
    """How long ago something came over it; None if nothing ever did."""
    loss: float | None
    """Share of its frames that were lost in the last seconds."""
    used: bool
    """Whether orders and missions go over it."""


class Link(Protocol):
    """One vehicle's messages, in and out."""

    @property
    def peer(self) -> Hashable | None:
        """What its frames go to: links with the same one share a radio, and what is for everybody goes there once.

        None as long as nobody knows.
        """

    @property
    def connection(self) -> str:
        """Its connection, as the site file has it."""

    @property
    def ways(self) -> Sequence[Link]:
        """The links that it is made of, the one that orders go over first; one of one connection is its own."""

    @property
    def is_alive(self) -> bool:
        """Whether something came over it just now, as far as anybody looks: where a vehicle has several links."""

    def describe_links(self) -> tuple[LinkView, ...]:
        """Return the state of each of its links; nothing where it has but one."""

    def send(self, message: Outgoing) -> None:
        """Send without waiting; what cannot be sent is lost, as on the air."""

    def listen(self, listener: Callable[[Message], None]) -> Callable[[], None]:
        """Call `listener` with every message from now on; returns how to stop that."""


@dataclass(slots=True)
class LinkCounts:
    """What came from a vehicle and what did not."""

    received: int = 0
    missing: int | None = 0
    """Frames that the sequence numbers say were sent and never came; None where they cannot be seen."""
    foreign: int = 0
    """Frames of systems on this connection that are nobody's vehicle."""
    refused: dict[str, int] = field(default_factory=dict)
    """Frames that were not believed, by the reason: unsigned, forged or replayed."""
    strangers: dict[int, str] = field(default_factory=dict)
    """Those systems, and where each was heard."""
    by_connection: dict[str, LinkCounts] = field(default_factory=dict)
    """Of a vehicle with several links: of each."""


class OpenLink(Link, Protocol):
    """A link of the flight, as long as it is open."""

    @property
    def counts(self) -> LinkCounts:
        """What came so far."""


@dataclass(frozen=True, slots=True)
class LinkRequest:
    """A link to be opened."""

    connection: Connection
    sysid: int
    log: Callable[[bytes], None] = lambda _: None
    """Takes every frame of both directions, to record it."""
    more: tuple[LinkRequest, ...] = ()
    """Further links to the same vehicle, each with its own record."""
    may_be_absent: bool = False
    """Whether a device that is not there now is opened once it is, as the vehicle has other links."""


@dataclass(frozen=True, slots=True)
class Keyring:
    """What frames are signed with."""

    key: bytes = field(repr=False)
    """32 bytes; nothing may show them."""
    unix_s: Callable[[], float]
    """Seconds since 1970 by a clock that does not go back."""


class EventSink(Protocol):
    """Where events are written before they are applied."""

    def write(self, event: Event, now_s: float) -> None:
        """Append one event."""

    async def settle(self) -> None:
        """Wait until everything written outlives a power loss, or the disk has had its time."""


class Solver(Protocol):
    """The planner in a process of its own."""

    async def solve(self, problem: Solve, pricing: Pricing) -> SolveEnded:
        """Return the best routes found within the deadline."""

    def cancel(self, revision: int) -> None:
        """Make whatever works on this revision stop soon."""


LossJudge = Callable[[Solve, Pricing], Coroutine[None, None, tuple[int, ...] | None]]
"""The planner, asked what would be when nothing else is asked: returns the segments that could not be covered; None if
something more urgent came."""
