"""What all dialogues share: outcomes, and the shape of a machine.

A machine is a frozen state. ``begin``, ``on_message``, ``on_deadline`` and ``cancel`` return the next state and what to
send. A state with an outcome is final: whatever comes later leaves it as it is and sends nothing.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass, field, replace
from typing import Self

from executor.core.interface.codes import Ending
from executor.core.interface.messages import Message, Outgoing

SAME_S = 1e-6
"""Times nearer to each other than this are one: a timer may end that much before its deadline, and sums are rounded."""


@dataclass(frozen=True, slots=True)
class Accepted:
    """The vehicle has done, or will do, what was asked."""


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


Outcome = Accepted | Rejected | TimedOut | Aborted


@dataclass(frozen=True, slots=True, kw_only=True)
class DialogueMachine(ABC):
    """One dialogue."""

    outcome: Outcome | None = None
    """The one outcome, once there is one."""
    deadline_s: float = 0.0
    """When `on_deadline` wants to be called if nothing comes before."""

    @abstractmethod
    def begin(self, now_s: float) -> tuple[Self, tuple[Outgoing, ...]]:
        """Open the dialogue."""

    @abstractmethod
    def on_message(self, message: Message, now_s: float) -> tuple[Self, tuple[Outgoing, ...]]:
        """Take a message that may or may not belong to this dialogue."""

    @abstractmethod
    def on_deadline(self, now_s: float) -> tuple[Self, tuple[Outgoing, ...]]:
        """`deadline_s` has passed."""

    def cancel(self) -> tuple[Self, tuple[Outgoing, ...]]:
        """Give up; what is sent tells the vehicle so where it can be told."""
        return (self if self.outcome is not None else self._finish(Aborted())), ()

    def _finish(self, outcome: Outcome) -> Self:
        return replace(self, outcome=outcome, deadline_s=float("inf"))
