"""An upload word by word: what is sent, until when an answer is waited for, and how it ends."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace

import pytest

from executor.core.interface.messages import (
    MissionAck,
    MissionCount,
    MissionRequest,
)
from executor.protocols import mission_transfer
from executor.protocols.machine import Aborted, Accepted, Rejected, TimedOut
from missions import ARDUPILOT, compute_list_checksum, encode
from tests.executor.core.steps import rounded
from tests.executor.core.vehicles import flying
from tests.executor.protocols.talks import LATE, late, talk

BOARD = flying().assignment.board
assert BOARD is not None
ITEMS = encode(BOARD.path, ARDUPILOT).items[:3]
UPLOAD = mission_transfer.UploadDialogue(ITEMS, 8.0, frozenset({13}), most_ahead=1, room=1)
SIX = encode(BOARD.path, ARDUPILOT).items[:6]
AHEAD = mission_transfer.UploadDialogue(SIX, 8.0, frozenset({13}), room=4)
GIVE_UP = "give up"


def ask(seq: int) -> MissionRequest:
    return MissionRequest(seq)


def items(begin: int, end: int) -> tuple[str, ...]:
    return tuple(f"item {seq}" for seq in range(begin, end))


ALL = [(101.0, ask(0)), (102.0, ask(1)), (103.0, ask(2))]

ROWS: list[tuple[str, Callable[[], object], object]] = [
    (
        "an upload",
        lambda: talk(UPLOAD, *ALL, (104.0, MissionAck(0))),
        [("count 3", 101.5), ("item 0", 103.0), ("item 1", 103.75), ("item 2", 104.562), (math.inf,), Accepted()],
    ),
    (
        "an upload that nobody answers",
        lambda: talk(UPLOAD, *late(101.5, 103.0, 104.5, 106.0, 107.5)),
        [
            ("count 3", 101.5),
            ("count 3", 103.0),
            ("count 3", 104.5),
            ("count 3", 106.0),
            ("count 3", 107.5),
            (math.inf,),
            TimedOut(reason="the vehicle did not ask for the first item"),
        ],
    ),
    (
        "an upload that is asked for the same at once",
        lambda: talk(UPLOAD, (101.0, ask(0)), (101.09, ask(0)), (101.2, ask(0)), (101.25, ask(1))),
        [("count 3", 101.5), ("item 0", 103.0), (103.09,), (103.2,), ("item 1", 103.281), None],
    ),
    (
        "an upload of which too much is asked for",
        lambda: talk(UPLOAD, (101.0, ask(-1)), (101.0, ask(3))),
        [("count 3", 101.5), (101.5,), (101.5,), None],
    ),
    (
        "an upload that falls silent",
        lambda: talk(UPLOAD, (101.0, ask(0)), *late(102.0, 108.9, 109.0)),
        [
            ("count 3", 101.5),
            ("item 0", 103.0),
            ("item 0", 104.4),
            ("item 0", 109.0),
            (math.inf,),
            TimedOut(reason="no answer after item 0 of 3"),
        ],
    ),
    (
        "an upload that falls silent at its end",
        lambda: talk(UPLOAD, *ALL, *late(104.0, 110.9, 111.0)),
        [
            ("count 3", 101.5),
            ("item 0", 103.0),
            ("item 1", 103.75),
            ("item 2", 104.562),
            ("item 2", 106.4),
            ("item 2", 111.0),
            (math.inf,),
            TimedOut(reason="no answer after item 2 of 3"),
        ],
    ),
    (
        "an upload that is asked for an item again",
        lambda: talk(UPLOAD, *ALL, (103.5, ask(1)), *late(104.5)),
        [
            ("count 3", 101.5),
            ("item 0", 103.0),
            ("item 1", 103.75),
            ("item 2", 104.562),
            (105.062,),
            ("item 2", 106.9),
            None,
        ],
    ),
    (
        "an upload that is accepted too early",
        lambda: talk(UPLOAD, (101.0, MissionAck(0)), (102.0, ask(0)), (103.0, MissionAck(0))),
        [("count 3", 101.5), (101.5,), ("item 0", 104.4), (104.4,), None],
    ),
    (
        "an upload that is refused",
        lambda: [talk(UPLOAD, (101.0, MissionAck(result)))[-1] for result in (1, 2, 13, 14, 15, 99)],
        [
            Rejected(reason="mission refused: error, or busy with another transfer"),
            Rejected(reason="mission refused: unsupported frame"),
            None,
            Rejected(reason="mission refused: denied: another ground station is uploading"),
            None,
            Rejected(reason="mission refused: result 99"),
        ],
    ),
    (
        "an upload that is refused in its midst",
        lambda: [talk(UPLOAD, (101.0, ask(0)), (102.0, MissionAck(result)))[-1] for result in (1, 4, 13, 15)],
        [
            None,
            Rejected(reason="mission refused: no space"),
            None,
            Rejected(reason="mission refused: cancelled by the vehicle"),
        ],
    ),
    (
        "an upload that is refused at its end",
        lambda: [talk(UPLOAD, *ALL, (104.0, MissionAck(result)))[-1] for result in (1, 5, 13)],
        [
            Rejected(reason="mission refused: error, or busy with another transfer"),
            Rejected(reason="mission refused: invalid item"),
            None,
        ],
    ),
    (
        "an upload that says that it is busy and goes on",
        lambda: talk(UPLOAD, (101.0, ask(0)), (101.5, MissionAck(1)), (102.0, ask(1)), *late(110.0))[-1],
        TimedOut(reason="no answer after item 1 of 3"),
    ),
    (
        "an upload that says that it is busy and falls silent",
        lambda: talk(UPLOAD, (101.0, ask(0)), (101.5, MissionAck(1)), *late(109.0))[-1],
        Rejected(reason="mission refused: error, or busy with another transfer"),
    ),
    (
        "an upload that is given up",
        lambda: [
            talk(UPLOAD, *before, (102.0, GIVE_UP), (103.0, ask(0)), (104.0, LATE), (105.0, GIVE_UP))
            for before in ((), ((101.0, ask(0)),))
        ],
        [
            [
                ("count 3", 101.5),
                (MissionAck(result=15), math.inf),
                (math.inf,),
                (math.inf,),
                (math.inf,),
                Aborted(),
            ],
            [
                ("count 3", 101.5),
                ("item 0", 103.0),
                (MissionAck(result=15), math.inf),
                (math.inf,),
                (math.inf,),
                (math.inf,),
                Aborted(),
            ],
        ],
    ),
    (
        "an upload to one that is never silent for long",
        lambda: talk(replace(UPLOAD, silence_s=0.5), (101.0, ask(0))),
        [("count 3", 101.5), ("item 0", 101.5), None],
    ),
    (
        "an upload hears what is not for it",
        lambda: talk(UPLOAD, (101.0, MissionCount(3))),
        [("count 3", 101.5), (101.5,), None],
    ),
    (
        "an upload over a link that takes its time sends ahead",
        lambda: talk(AHEAD, (101.0, ask(0)), (102.0, ask(1)), (102.1, ask(2)), (102.2, MissionAck(0))),
        [("count 6", 101.5), (*items(0, 4), 103.0), (*items(4, 6), 104.0), (104.125,), (104.125,), None],
    ),
    (
        "an upload sends on from what got lost",
        lambda: talk(AHEAD, (101.0, ask(0)), (102.0, ask(2)), (103.5, ask(2)), *late(103.7), (104.5, ask(3))),
        [
            ("count 6", 101.5),
            (*items(0, 4), 103.0),
            (*items(4, 6), 104.0),
            (103.7,),
            (*items(2, 6), 105.7),
            (106.5,),
            None,
        ],
    ),
    (
        "an upload repeats what was out of turn, and does not repeat what may be on its way",
        lambda: talk(
            AHEAD,
            (101.0, ask(0)),
            (101.5, MissionAck(13)),
            (102.6, MissionAck(13)),
            *late(102.8),
            (102.9, MissionAck(13)),
        ),
        [("count 6", 101.5), (*items(0, 4), 103.0), (103.5,), (102.8,), (*items(0, 4), 104.8), (104.8,), None],
    ),
    (
        "an upload whose end nobody hears is over when the vehicle asks for nothing more",
        lambda: [
            talk(AHEAD, (101.0, ask(0)), (102.0, ask(4)), (102.5, MissionAck(result)), (104.0, LATE))[-1]
            for result in (0, 1)
        ],
        [Accepted(), Rejected(reason="mission refused: error, or busy with another transfer")],
    ),
    (
        "an upload that is accepted by its checksum is over at once",
        lambda: [
            talk(AHEAD, (101.0, ask(0)), (102.0, ask(1)), (102.1, MissionAck(0, checksum=number)))[-1]
            for number in (compute_list_checksum(SIX), 7)
        ],
        [Accepted(), None],
    ),
    (
        "every refusal in words",
        lambda: [talk(UPLOAD, (101.0, MissionAck(result)))[-1] for result in range(1, 15) if result != 13],
        [
            Rejected(reason="mission refused: error, or busy with another transfer"),
            Rejected(reason="mission refused: unsupported frame"),
            Rejected(reason="mission refused: unsupported command"),
            Rejected(reason="mission refused: no space"),
            Rejected(reason="mission refused: invalid item"),
            Rejected(reason="mission refused: invalid param1"),
            Rejected(reason="mission refused: invalid param2"),
            Rejected(reason="mission refused: invalid param3"),
            Rejected(reason="mission refused: invalid param4"),
            Rejected(reason="mission refused: invalid latitude"),
            Rejected(reason="mission refused: invalid longitude"),
            Rejected(reason="mission refused: invalid height"),
            Rejected(reason="mission refused: denied: another ground station is uploading"),
        ],
    ),
    (
        "whether an upload has begun",
        lambda: [replace(UPLOAD, furthest=furthest).is_begun for furthest in (-1, 0, 1)],
        [False, True, True],
    ),
]


@pytest.mark.parametrize(("what", "found", "expected"), ROWS, ids=[row[0] for row in ROWS])
def test_everything_that_comes_of_it(what: str, found: Callable[[], object], expected: object) -> None:
    assert rounded(found()) == expected
