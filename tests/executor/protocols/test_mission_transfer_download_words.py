"""A download word by word: what is sent, until when an answer is waited for, and how it ends."""

from __future__ import annotations

import math
from collections.abc import Callable

import pytest

from executor.core.interface.messages import (
    MissionAck,
    MissionCount,
    MissionItemInt,
    MissionRequest,
    MissionRequestList,
)
from executor.protocols.machine import Aborted, Accepted, Rejected, TimedOut
from executor.protocols.mission_transfer import DownloadDialogue
from missions import ARDUPILOT, encode
from tests.executor.core.steps import rounded
from tests.executor.core.vehicles import flying
from tests.executor.protocols.talks import LATE, late, talk

BOARD = flying().assignment.board
assert BOARD is not None
ITEMS = encode(BOARD.path, ARDUPILOT).items[:3]
GIVE_UP = "give up"

ROWS: list[tuple[str, Callable[[], object], object]] = [
    (
        "a download",
        lambda: talk(
            DownloadDialogue(),
            (101.0, MissionCount(2)),
            (102.0, MissionItemInt(ITEMS[0])),
            (103.0, MissionItemInt(ITEMS[1])),
            (104.0, MissionCount(5)),
        ),
        [
            (MissionRequestList(), 101.0),
            (MissionRequest(seq=0), 103.0),
            (MissionRequest(seq=1), 103.75),
            (MissionAck(result=0), math.inf),
            (math.inf,),
            Accepted(),
        ],
    ),
    (
        "a download of nothing",
        lambda: talk(DownloadDialogue(), (101.0, MissionCount(0))),
        [(MissionRequestList(), 101.0), (MissionAck(result=0), math.inf), Accepted()],
    ),
    (
        "a download that nobody answers",
        lambda: talk(DownloadDialogue(), *late(*range(101, 109))),
        [
            (MissionRequestList(), 101.0),
            (MissionRequestList(), 102.0),
            (MissionRequestList(), 104.0),
            (MissionRequestList(), 105.0),
            (MissionRequestList(), 106.0),
            (MissionRequestList(), 107.0),
            (MissionRequestList(), 108.0),
            (MissionRequestList(), 108.0),
            (math.inf,),
            TimedOut(reason="no answer when asked for the count"),
        ],
    ),
    (
        "a download that falls silent",
        lambda: talk(DownloadDialogue(), (101.0, MissionCount(2)), *late(*range(102, 110))),
        [
            (MissionRequestList(), 101.0),
            (MissionRequest(seq=0), 103.0),
            (MissionRequest(seq=0), 104.0),
            (MissionRequest(seq=0), 105.0),
            (MissionRequest(seq=0), 106.0),
            (MissionRequest(seq=0), 107.0),
            (MissionRequestList(), 108.0),
            (MissionRequestList(), 109.0),
            (MissionRequestList(), 109.0),
            (math.inf,),
            TimedOut(reason="no answer when asked for item 0 of 2"),
        ],
    ),
    (
        "a download that is refused",
        lambda: [
            talk(DownloadDialogue(), (100.5, MissionAck(result)), *late(*range(101, 109)))[-1] for result in (0, 1, 99)
        ],
        [
            TimedOut(reason="no answer when asked for the count"),
            Rejected(reason="download refused: error, or busy with another transfer"),
            Rejected(reason="download refused: result 99"),
        ],
    ),
    (
        "a download that is refused and goes on",
        lambda: talk(DownloadDialogue(), (100.5, MissionAck(1)), (101.0, MissionCount(2)), *late(*range(102, 110)))[-1],
        TimedOut(reason="no answer when asked for item 0 of 2"),
    ),
    (
        "a download of other items",
        lambda: talk(
            DownloadDialogue(),
            (101.0, MissionItemInt(ITEMS[0])),
            (102.0, MissionCount(2)),
            (103.0, MissionItemInt(ITEMS[1])),
            (104.0, MissionCount(3)),
        ),
        [(MissionRequestList(), 101.0), (101.0,), (MissionRequest(seq=0), 104.0), (104.0,), (104.0,), None],
    ),
    (
        "a download that is given up",
        lambda: talk(DownloadDialogue(), (101.0, GIVE_UP), (102.0, GIVE_UP), (103.0, MissionCount(2)), (104.0, LATE)),
        [
            (MissionRequestList(), 101.0),
            (MissionAck(result=15), math.inf),
            (math.inf,),
            (math.inf,),
            (math.inf,),
            Aborted(),
        ],
    ),
]


@pytest.mark.parametrize(("what", "found", "expected"), ROWS, ids=[row[0] for row in ROWS])
def test_everything_that_comes_of_it(what: str, found: Callable[[], object], expected: object) -> None:
    assert rounded(found()) == expected
