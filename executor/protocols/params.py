"""Reading and setting one parameter of a vehicle; a set is confirmed by the value that comes back."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Self

from executor.core.endings import Ending
from executor.core.messages import Message, Outgoing, ParamValue, SendParamRequest, SendParamSet
from executor.protocols.machine import Accepted, Machine, Rejected, TimedOut

PERIOD_S = 1.0
TRIES = 4


@dataclass(frozen=True, slots=True)
class Parameter(Machine):
    """The state of one question, or of one change if `wanted` is given."""

    name: str
    wanted: SendParamSet | None = None
    tries: int = 0
    value: ParamValue | None = None

    def begin(self, now_s: float) -> tuple[Self, tuple[Outgoing, ...]]:
        """Ask, or set."""
        return replace(self, tries=1, deadline_s=now_s + PERIOD_S), (self._question(),)

    def on_message(self, message: Message, now_s: float) -> tuple[Self, tuple[Outgoing, ...]]:  # noqa: ARG002
        """Take the value if it is the one asked for, and the one wanted."""
        if self.outcome is not None:
            return self, ()
        match message:
            case ParamValue(name, value) if name == self.name:
                if self.wanted is None or math.isclose(value, self.wanted.value, rel_tol=1e-5, abs_tol=1e-6):
                    return replace(self._ended(Accepted()), value=message), ()
                return replace(self, value=message), ()
            case _:
                return self, ()

    def on_deadline(self, now_s: float) -> tuple[Self, tuple[Outgoing, ...]]:
        """Ask again, or give up."""
        if self.outcome is not None:
            return self, ()
        if self.tries >= TRIES:
            if self.wanted is not None and self.value is not None:
                return self._ended(Rejected(f"{self.name} stays {self.value.value:g}", Ending.VALUE_STAYS)), ()
            return self._ended(TimedOut(f"{self.name}: no answer")), ()
        return replace(self, tries=self.tries + 1, deadline_s=now_s + PERIOD_S), (self._question(),)

    def _question(self) -> Outgoing:
        return self.wanted if self.wanted is not None else SendParamRequest(self.name)
