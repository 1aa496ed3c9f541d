"""Define the ports through which runtime reaches the outside."""

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
    """The time of the flight, `speedup` times real time in a simulation."""

    @property
    def speedup(self) -> float:
        """Seconds of the flight per real second."""

    def now_s(self) -> float:
        """Return the seconds since the ground station started; never goes back."""


@dataclass(frozen=True, slots=True)
class LinkView:
    """One of a vehicle's links, as displayed."""

    connection: str
    heard_age_s: float | None
    """Age of the last message; None if there was none."""
    loss: float | None
    """Share of frames lost in the last seconds."""
    used: bool
    """Whether commands and missions use it."""


class Link(Protocol):
    """The messages of one vehicle, in and out."""

    @property
    def peer(self) -> Hashable | None:
        """The destination of its frames: links with the same one share a radio, and broadcasts are sent there once.

        None while unknown.
        """

    @property
    def connection(self) -> str:
        """Its connection string from the site file."""

    @property
    def ways(self) -> Sequence[Link]:
        """The links it consists of, the one in use first; a link with a single connection is its own."""

    @property
    def is_alive(self) -> bool:
        """Whether a message arrived just now, where a vehicle has several links."""

    def describe_links(self) -> tuple[LinkView, ...]:
        """Return the state of each of its links; empty if it has only one."""

    def send(self, message: Outgoing) -> None:
        """Send without waiting; frames that cannot be sent are lost, as on the air."""

    def listen(self, listener: Callable[[Message], None]) -> Callable[[], None]:
        """Call `listener` with every message from now on; return a function that stops it."""


@dataclass(slots=True)
class LinkCounts:
    """Frames of a vehicle received and missing."""

    received: int = 0
    missing: int | None = 0
    """Frames missing by sequence number; None where numbers are not visible."""
    foreign: int = 0
    """Frames on this connection from systems that are no vehicle of the site."""
    refused: dict[str, int] = field(default_factory=dict)
    """Frames rejected, by reason: unsigned, forged or replayed."""
    strangers: dict[int, str] = field(default_factory=dict)
    """Those systems, and the addresses they sent from."""
    by_connection: dict[str, LinkCounts] = field(default_factory=dict)
    """For a vehicle with several links, the counts of each."""


class OpenLink(Link, Protocol):
    """A link of the flight while it is open."""

    @property
    def counts(self) -> LinkCounts:
        """The counts so far."""


@dataclass(frozen=True, slots=True)
class LinkRequest:
    """A link to open."""

    connection: Connection
    sysid: int
    log: Callable[[bytes], None] = lambda _: None
    """Records every frame of both directions."""
    more: tuple[LinkRequest, ...] = ()
    """Further links to the same vehicle, each with its own record."""
    may_be_absent: bool = False
    """Whether to open a missing device once it appears, as the vehicle has other links."""


@dataclass(frozen=True, slots=True)
class Keyring:
    """The key and clock for signing frames."""

    key: bytes = field(repr=False)
    """32 bytes, never displayed."""
    unix_s: Callable[[], float]
    """Seconds since 1970 by a clock that does not go back."""


class EventSink(Protocol):
    """The log to which events are written before they are applied."""

    def write(self, event: Event, now_s: float) -> None:
        """Append one event."""

    async def settle(self) -> None:
        """Wait until all events written survive a power loss, or the disk has had its time."""


class Solver(Protocol):
    """The planner in its own process."""

    async def solve(self, problem: Solve, pricing: Pricing) -> SolveEnded:
        """Return the best routes found within the deadline."""

    def cancel(self, revision: int) -> None:
        """Stop the work on a revision soon."""


LossJudge = Callable[[Solve, Pricing], Coroutine[None, None, tuple[int, ...] | None]]
"""The planner as an idle-time judge: returns the segments a loss would leave uncovered; None if interrupted by
something more urgent."""
