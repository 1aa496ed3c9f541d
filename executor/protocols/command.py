"""One command and its acknowledgement."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Self

from executor.core.interface.codes import Ending
from executor.core.interface.messages import CommandAck, Message, Outgoing, SendCommand
from executor.protocols.machine import Accepted, DialogueMachine, Rejected, TimedOut

PERIOD_S = 1.0
TRIES = 5
IN_PROGRESS_S = 10.0
"""How long a vehicle may work on a command that it has acknowledged as in progress."""
RESULT_NAMES = {1: "temporarily rejected", 2: "denied", 3: "unsupported", 4: "failed", 6: "cancelled"}
"""MAV_RESULT in words."""
_CODES = {
    1: Ending.TEMPORARILY_REJECTED, 2: Ending.DENIED, 3: Ending.UNSUPPORTED, 4: Ending.FAILED, 6: Ending.CANCELLED,
}  # fmt: skip


@dataclass(frozen=True, slots=True)
class CommandDialogue(DialogueMachine):
    """The state of one command."""

    command: SendCommand
    what: str
    """The command in words, for reasons."""
    tries: int = 0
    refusal: str = ""
    """What the vehicle said last when it rejected the command for the time being."""

    def begin(self, now_s: float) -> tuple[Self, tuple[Outgoing, ...]]:
        """Send the command."""
        return replace(self, tries=1, deadline_s=now_s + PERIOD_S), (self.command,)

    def on_message(self, message: Message, now_s: float) -> tuple[Self, tuple[Outgoing, ...]]:
        """Take the acknowledgement; 'temporarily rejected' is asked again at the deadline."""
        if self.outcome is not None:
            return self, ()
        match message:
            case CommandAck(command, result) if command == self.command.command:
                match result:
                    case 0:
                        return self._finish(Accepted()), ()
                    case 1:
                        return replace(self, refusal=RESULT_NAMES[result]), ()
                    case 5:
                        return replace(self, deadline_s=now_s + IN_PROGRESS_S), ()
                    case _:
                        reason = RESULT_NAMES.get(result, f"result {result}")
                        code = _CODES.get(result, Ending.UNKNOWN_RESULT)
                        return self._finish(Rejected(f"{self.what}: {reason}", code)), ()
            case _:
                return self, ()

    def on_deadline(self, now_s: float) -> tuple[Self, tuple[Outgoing, ...]]:
        """Send it again with the next confirmation number, or give up."""
        if self.outcome is not None:
            return self, ()
        if self.tries >= TRIES:
            if self.refusal:
                return self._finish(Rejected(f"{self.what}: {self.refusal}", Ending.TEMPORARILY_REJECTED)), ()
            return self._finish(TimedOut(f"{self.what}: no acknowledgement")), ()
        state = replace(self, tries=self.tries + 1, deadline_s=now_s + PERIOD_S)
        return state, (replace(self.command, confirmation=self.tries),)
