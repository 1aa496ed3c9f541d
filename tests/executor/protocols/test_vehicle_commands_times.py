"""When a command is sent again, how often, and when it is given up: second by second."""

from __future__ import annotations

import pytest

from executor.core.interface.messages import (
    CommandAck,
    SendCommand,
)
from executor.protocols.machine import Rejected, TimedOut
from executor.protocols.vehicle_commands import CommandDialogue
from tests.executor.protocols.silences import unanswered

ORDER = SendCommand(400, (1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0))


def test_a_command_is_sent_five_times_a_second_apart() -> None:
    spoken_s, ended = unanswered(CommandDialogue(ORDER, "arm"))
    assert spoken_s == [100.0, 101.0, 102.0, 103.0, 104.0]
    assert ended.outcome == TimedOut("arm: no acknowledgement")


def test_a_command_that_is_worked_on_has_ten_seconds() -> None:
    state, _ = CommandDialogue(ORDER, "arm").begin(100.0)
    state, _ = state.on_message(CommandAck(400, 5), 100.5)
    assert state.deadline_s == 110.5
    state, sent = state.on_deadline(110.5)
    assert (state.deadline_s, [one.confirmation for one in sent if isinstance(one, SendCommand)]) == (111.5, [1])


@pytest.mark.parametrize(
    ("result", "words"),
    [(2, "denied"), (3, "unsupported"), (4, "failed"), (6, "cancelled"), (7, "result 7")],
)
def test_what_a_command_is_answered_in_words(result: int, words: str) -> None:
    state, _ = CommandDialogue(ORDER, "arm").begin(0.0)
    assert state.on_message(CommandAck(400, result), 0.1)[0].outcome == Rejected(f"arm: {words}")
    assert state.on_message(CommandAck(401, result), 0.1) == (state, ())
