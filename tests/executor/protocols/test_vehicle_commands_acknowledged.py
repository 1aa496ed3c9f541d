"""A command word by word: what is sent, until when an answer is waited for, and how it ends."""

from __future__ import annotations

import math
from collections.abc import Callable

import pytest

from executor.core.interface.messages import (
    CommandAck,
    MissionAck,
    SendCommand,
)
from executor.protocols import vehicle_commands
from executor.protocols.machine import Aborted, Accepted, Rejected, TimedOut
from executor.protocols.vehicle_commands import CommandDialogue
from tests.executor.core.steps import rounded
from tests.executor.protocols.talks import LATE, late, talk

ARM = vehicle_commands.arm()
COMMAND = CommandDialogue(ARM, "arm")
GIVE_UP = "give up"

ROWS: list[tuple[str, Callable[[], object], object]] = [
    ("a command", lambda: talk(COMMAND, (101.0, CommandAck(400, 0))), [(ARM, 101.0), (math.inf,), Accepted()]),
    (
        "a command that nobody answers",
        lambda: talk(COMMAND, *late(*range(101, 107))),
        [
            (ARM, 101.0),
            (SendCommand(command=400, params=(1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0), confirmation=1), 102.0),
            (SendCommand(command=400, params=(1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0), confirmation=2), 103.0),
            (SendCommand(command=400, params=(1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0), confirmation=3), 104.0),
            (SendCommand(command=400, params=(1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0), confirmation=4), 105.0),
            (math.inf,),
            (math.inf,),
            TimedOut(reason="arm: no acknowledgement"),
        ],
    ),
    (
        "a command that is not for now",
        lambda: talk(COMMAND, (100.5, CommandAck(400, 1)), *late(*range(101, 106))),
        [
            (ARM, 101.0),
            (101.0,),
            (SendCommand(command=400, params=(1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0), confirmation=1), 102.0),
            (SendCommand(command=400, params=(1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0), confirmation=2), 103.0),
            (SendCommand(command=400, params=(1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0), confirmation=3), 104.0),
            (SendCommand(command=400, params=(1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0), confirmation=4), 105.0),
            (math.inf,),
            Rejected(reason="arm: temporarily rejected"),
        ],
    ),
    (
        "a command that takes its time",
        lambda: talk(COMMAND, (101.0, CommandAck(400, 5)), (111.0, LATE)),
        [
            (ARM, 101.0),
            (111.0,),
            (SendCommand(command=400, params=(1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0), confirmation=1), 112.0),
            None,
        ],
    ),
    (
        "a command that is refused",
        lambda: [talk(COMMAND, (101.0, CommandAck(400, result)))[-1] for result in (2, 3, 4, 6, 7)],
        [
            Rejected(reason="arm: denied"),
            Rejected(reason="arm: unsupported"),
            Rejected(reason="arm: failed"),
            Rejected(reason="arm: cancelled"),
            Rejected(reason="arm: result 7"),
        ],
    ),
    (
        "another command's answer",
        lambda: talk(COMMAND, (101.0, CommandAck(300, 0)), (102.0, MissionAck(0))),
        [(ARM, 101.0), (101.0,), (101.0,), None],
    ),
    (
        "a command that is given up",
        lambda: talk(COMMAND, (101.0, GIVE_UP), (102.0, GIVE_UP), (103.0, CommandAck(400, 0)), (104.0, LATE)),
        [(ARM, 101.0), (math.inf,), (math.inf,), (math.inf,), (math.inf,), Aborted()],
    ),
]


@pytest.mark.parametrize(("what", "found", "expected"), ROWS, ids=[row[0] for row in ROWS])
def test_everything_that_comes_of_it(what: str, found: Callable[[], object], expected: object) -> None:
    assert rounded(found()) == expected
