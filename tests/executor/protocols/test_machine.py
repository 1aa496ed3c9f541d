"""What every dialogue is before it begins."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import fields, replace

import pytest

from executor.protocols import mission_transfer, vehicle_commands
from executor.protocols.machine import RoundTrip
from executor.protocols.mission_transfer import FIRST_READ_TRIP, DownloadDialogue
from executor.protocols.parameter_dialogue import ParameterDialogue
from executor.protocols.vehicle_commands import CommandDialogue
from missions import ARDUPILOT, MissionKind, encode
from tests.executor.core.steps import rounded
from tests.executor.core.vehicles import flying

BOARD = flying().assignment.board
assert BOARD is not None
ITEMS = encode(BOARD.path, ARDUPILOT).items[:3]
UPLOAD = mission_transfer.UploadDialogue(ITEMS, 8.0, frozenset({13}))
ARM = vehicle_commands.arm()
COMMAND = CommandDialogue(ARM, "arm")


def told(machine: object) -> dict[str, object]:
    return {one.name: getattr(machine, one.name) for one in fields(machine)}  # type: ignore[arg-type]


ROWS: list[tuple[str, Callable[[], object], object]] = [
    (
        "dialogues before they begin",
        lambda: [
            told(one) for one in (replace(UPLOAD, items=()), DownloadDialogue(), COMMAND, ParameterDialogue("RTL_ALT"))
        ],
        [
            {
                "items": (),
                "silence_s": 8.0,
                "warnings": frozenset({13}),
                "kind": MissionKind.MISSION,
                "outcome": None,
                "most_ahead": 16,
                "deadline_s": 0.0,
                "counts_sent": 0,
                "furthest": -1,
                "counted_s": 0.0,
                "under_way": (),
                "room": 8,
                "highest": -1,
                "repeats": 0,
                "early": False,
                "moved": False,
                "is_touched": False,
                "checksum": None,
                "round_trip": mission_transfer.FIRST_TRIP,
                "heard_s": 0.0,
                "asked_s": 0.0,
                "asks": 0,
                "doubts": False,
                "refusal": None,
            },
            {
                "kind": MissionKind.MISSION,
                "outcome": None,
                "most_ahead": 16,
                "deadline_s": 0.0,
                "count": None,
                "items": (),
                "first": 0,
                "ahead": 1,
                "checksum": None,
                "later": (),
                "proven": False,
                "room": 8,
                "under_way": (),
                "tries": 0,
                "refusal": None,
                "round_trip": FIRST_READ_TRIP,
                "asked_s": 0.0,
                "heard_s": 0.0,
                "begun": 0,
                "broke_off_at": "",
            },
            {
                "command": ARM,
                "what": "arm",
                "outcome": None,
                "most_ahead": 16,
                "deadline_s": 0.0,
                "round_trip": RoundTrip(),
                "tries": 0,
                "refusal": "",
                "sent_s": 0.0,
            },
            {
                "name": "RTL_ALT",
                "wanted": None,
                "outcome": None,
                "most_ahead": 16,
                "deadline_s": 0.0,
                "round_trip": RoundTrip(),
                "tries": 0,
                "value": None,
            },
        ],
    ),
]


@pytest.mark.parametrize(("what", "found", "expected"), ROWS, ids=[row[0] for row in ROWS])
def test_everything_that_comes_of_it(what: str, found: Callable[[], object], expected: object) -> None:
    assert rounded(found()) == expected
