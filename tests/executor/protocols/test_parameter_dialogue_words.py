"""A parameter word by word: what is sent, until when an answer is waited for, and how it ends."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace

import pytest

from executor.core.interface.messages import (
    MissionAck,
    ParamValue,
    SendParamRequest,
    SendParamSet,
)
from executor.protocols.machine import Aborted, Accepted, Rejected, TimedOut
from executor.protocols.parameter_dialogue import ParameterDialogue
from tests.executor.core.steps import rounded
from tests.executor.protocols.talks import LATE, late, talk

WANTED = SendParamSet("RTL_ALT", 1500.0, 4)
GIVE_UP = "give up"

ROWS: list[tuple[str, Callable[[], object], object]] = [
    (
        "a parameter",
        lambda: talk(ParameterDialogue("RTL_ALT"), (101.0, ParamValue("RTL_ALT", 1500.0, 4))),
        [(SendParamRequest(name="RTL_ALT"), 101.0), (math.inf,), Accepted()],
    ),
    (
        "a parameter that nobody answers",
        lambda: talk(ParameterDialogue("RTL_ALT"), *late(101, 103, 107, 111, 115, 119)),
        [
            (SendParamRequest(name="RTL_ALT"), 101.0),
            (SendParamRequest(name="RTL_ALT"), 103.0),
            (SendParamRequest(name="RTL_ALT"), 107.0),
            (SendParamRequest(name="RTL_ALT"), 111.0),
            (SendParamRequest(name="RTL_ALT"), 115.0),
            (SendParamRequest(name="RTL_ALT"), 119.0),
            (math.inf,),
            TimedOut(reason="RTL_ALT: no answer"),
        ],
    ),
    (
        "another parameter's answer",
        lambda: talk(ParameterDialogue("RTL_ALT"), (101.0, ParamValue("RTL_SPEED", 1500.0, 4)), (102.0, MissionAck(0))),
        [(SendParamRequest(name="RTL_ALT"), 101.0), (101.0,), (101.0,), None],
    ),
    (
        "a parameter that is set",
        lambda: [
            talk(ParameterDialogue("RTL_ALT", WANTED), (101.0, ParamValue("RTL_ALT", value, 4)))[-1]
            for value in (1500.0, 1500.01, 1500.02, 1499.0)
        ],
        [Accepted(), Accepted(), None, None],
    ),
    (
        "a parameter of nothing that is set",
        lambda: [
            talk(ParameterDialogue("RTL_ALT", replace(WANTED, value=0.0)), (101.0, ParamValue("RTL_ALT", value, 4)))[-1]
            for value in (0.0, 0.0000009, 0.0000011)
        ],
        [Accepted(), Accepted(), None],
    ),
    (
        "a parameter that stays",
        lambda: talk(
            ParameterDialogue("RTL_ALT", WANTED), (100.5, ParamValue("RTL_ALT", 900.0, 4)), *late(*range(101, 105))
        ),
        [
            (WANTED, 101.0),
            (101.0,),
            (WANTED, 102.0),
            (WANTED, 103.0),
            (WANTED, 104.0),
            (math.inf,),
            Rejected(reason="RTL_ALT stays 900"),
        ],
    ),
    (
        "a parameter that is not set",
        lambda: talk(ParameterDialogue("RTL_ALT", WANTED), *late(101, 103, 107, 111, 115, 119))[-1],
        TimedOut(reason="RTL_ALT: no answer"),
    ),
    (
        "a parameter that is given up",
        lambda: talk(
            ParameterDialogue("RTL_ALT"),
            (101.0, GIVE_UP),
            (102.0, GIVE_UP),
            (103.0, ParamValue("RTL_ALT", 1.0, 4)),
            (104.0, LATE),
        ),
        [(SendParamRequest(name="RTL_ALT"), 101.0), (math.inf,), (math.inf,), (math.inf,), (math.inf,), Aborted()],
    ),
]


@pytest.mark.parametrize(("what", "found", "expected"), ROWS, ids=[row[0] for row in ROWS])
def test_everything_that_comes_of_it(what: str, found: Callable[[], object], expected: object) -> None:
    assert rounded(found()) == expected
