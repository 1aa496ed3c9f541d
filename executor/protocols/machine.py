"""What all dialogues share: outcomes, the shape of a machine, and how long an answer takes over a link.

A machine is a frozen state. ``begin``, ``on_message``, ``on_deadline`` and ``cancel`` return the next state and what to
send. A state with an outcome is final: whatever comes later leaves it as it is and sends nothing.

A round trip is measured after RFC 6298, and Karn's rule. That rule is the asker's to keep: what was asked twice is no
measure, as nobody knows which of the two was answered.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass, field, replace
from typing import ClassVar, Self

from executor.core.interface.codes import Ending
from executor.core.interface.messages import Message, Outgoing

VARIANCES = 2
"""Variances above the mean to wait for an answer. RFC 6298 has four, as a wrong retransmission costs a whole segment.
Here a question is 20 bytes, and on a link that loses a fifth each way every third one waits this long."""
MOST_AHEAD = 16
"""Most items or questions in flight: half a telemetry radio's buffer."""
LEAST_VARIANCE_S = 0.1
"""Least margin above the round trip, for a busy computer and a vehicle that answers at fixed intervals."""


@dataclass(frozen=True, slots=True)
class RoundTrip:
    """What is known of a link's round trip."""

    waits_s: float = 1.0
    """Time after which an answer counts as lost; initially that of RFC 6298."""
    most_s: float = 8.0
    least_s: float = 0.25
    mean_s: float | None = None
    varies_s: float = 0.0
    shortest_s: float = 0.0
    """Shortest round trip measured so far."""

    @property
    def usual_s(self) -> float:
        """By when most answers have come."""
        return self.least_s if self.mean_s is None else max(self.least_s, self.mean_s + self.varies_s)

    def record_round_trip(self, took_s: float) -> Self:
        """Return what is known after a question that was asked once was answered."""
        if self.mean_s is None:
            mean_s, varies_s = took_s, took_s / 2
        else:
            varies_s = 0.75 * self.varies_s + 0.25 * abs(self.mean_s - took_s)
            mean_s = 0.875 * self.mean_s + 0.125 * took_s
        waits_s = mean_s + max(LEAST_VARIANCE_S, VARIANCES * varies_s)
        waits_s = min(max(waits_s, self.least_s), self.most_s)
        shortest_s = took_s if self.mean_s is None else min(self.shortest_s, took_s)
        return replace(self, waits_s=waits_s, mean_s=mean_s, varies_s=varies_s, shortest_s=shortest_s)

    def record_timeout(self) -> Self:
        """Return what is waited after nothing came in that time: a jam is not to be fed."""
        return replace(self, waits_s=min(2 * self.waits_s, self.most_s))

    def adopt(self, known: RoundTrip) -> Self:
        """Return this with what earlier dialogues have measured over the same link; it never makes less patient."""
        if known.mean_s is None or self.mean_s is not None:
            return self
        waits_s = known.mean_s + max(LEAST_VARIANCE_S, VARIANCES * known.varies_s)
        waits_s = min(max(waits_s, self.waits_s), self.most_s)
        return replace(self, waits_s=waits_s, mean_s=known.mean_s, varies_s=known.varies_s, shortest_s=known.shortest_s)


SAME_S = 1e-6
"""Difference below which two times are equal: timers end slightly early, and sums are rounded."""


@dataclass(frozen=True, slots=True)
class Accepted:
    """The vehicle has done, or will do, what was asked."""

    reason: ClassVar[str] = ""
    code: ClassVar[Ending | None] = None


@dataclass(frozen=True, slots=True)
class Rejected:
    """The vehicle said no."""

    reason: str
    code: Ending = field(default=Ending.UNKNOWN_RESULT, compare=False)


@dataclass(frozen=True, slots=True)
class TimedOut:
    """The vehicle did not answer any more."""

    reason: str
    code: Ending = field(default=Ending.NO_ANSWER, compare=False)


@dataclass(frozen=True, slots=True)
class Aborted:
    """We gave it up ourselves."""

    reason: ClassVar[str] = "cancelled"
    code: ClassVar[Ending | None] = Ending.BROKEN_OFF


Outcome = Accepted | Rejected | TimedOut | Aborted


@dataclass(frozen=True, slots=True, kw_only=True)
class DialogueMachine(ABC):
    """One dialogue."""

    outcome: Outcome | None = None
    """The outcome, once there is one."""
    deadline_s: float = 0.0
    """Time at which to call `on_deadline` if no message arrives before."""
    round_trip: RoundTrip = field(default=RoundTrip(), kw_only=True)
    """Round trip of the link, as far as measured."""

    most_ahead: int = MOST_AHEAD
    """Most items in flight that its channel permits."""

    is_transfer: ClassVar[bool] = False
    """Whether it is a long transfer, which takes turns with those of other vehicles on the same radio."""

    @property
    def accepted(self) -> bool:
        """Whether it ended well."""
        return isinstance(self.outcome, Accepted)

    @property
    def reason(self) -> str:
        """Why it did not, in words."""
        return "" if self.outcome is None else self.outcome.reason

    @property
    def code(self) -> Ending | None:
        """The same as a code."""
        return None if self.outcome is None else self.outcome.code

    @abstractmethod
    def begin(self, now_s: float) -> tuple[Self, tuple[Outgoing, ...]]:
        """Open the dialogue."""

    def on_message(self, message: Message, now_s: float) -> tuple[Self, tuple[Outgoing, ...]]:
        """Take a message that may or may not belong to this dialogue."""
        return self._take(message, now_s) if self.outcome is None else (self, ())

    def on_deadline(self, now_s: float) -> tuple[Self, tuple[Outgoing, ...]]:
        """`deadline_s` has passed: repeat what may be repeated, or give up."""
        return self._expire(now_s) if self.outcome is None else (self, ())

    def move(self, now_s: float) -> tuple[Self, tuple[Outgoing, ...]]:
        """Go on over another link: what was asked over the one that is left is asked again."""
        return self.on_deadline(now_s)

    def cancel(self) -> tuple[Self, tuple[Outgoing, ...]]:
        """Give up; what is sent tells the vehicle so where it can be told."""
        return (self._finish(Aborted()), self._build_farewell()) if self.outcome is None else (self, ())

    @abstractmethod
    def _take(self, message: Message, now_s: float) -> tuple[Self, tuple[Outgoing, ...]]: ...

    @abstractmethod
    def _expire(self, now_s: float) -> tuple[Self, tuple[Outgoing, ...]]: ...

    def _build_farewell(self) -> tuple[Outgoing, ...]:
        return ()

    def _finish(self, outcome: Outcome) -> Self:
        return replace(self, outcome=outcome, deadline_s=float("inf"))
