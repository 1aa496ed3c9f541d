"""Each dialogue word by word: what is sent, until when an answer is waited for, and how it ends."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import fields, replace

import pytest

from executor.core.messages import (
    CommandAck,
    Message,
    MissionAck,
    MissionCount,
    MissionItemReceived,
    MissionRequest,
    Outgoing,
    ParamValue,
    SendCommand,
    SendMissionAck,
    SendMissionCount,
    SendMissionItem,
    SendMissionRequest,
    SendMissionRequestList,
    SendParamRequest,
    SendParamSet,
)
from executor.protocols import orders, upload
from executor.protocols.command import CommandDialogue
from executor.protocols.download import DownloadDialogue
from executor.protocols.machine import Accepted, BrokenOff, Machine, Rejected, TimedOut
from executor.protocols.params import Parameter
from missions import ARDUPILOT, PX4, encode
from tests.executor.core.faults.test_watchpoints import flying
from tests.executor.core.steps import rounded

BOARD = flying().assignment.board
assert BOARD is not None
ITEMS = encode(BOARD.path, ARDUPILOT).items[:3]
UPLOAD = upload.UploadDialogue(ITEMS, 8.0, frozenset({13}))
ARM = orders.arm()
COMMAND = CommandDialogue(ARM, "arm")
WANTED = SendParamSet("RTL_ALT", 1500.0, 4)
LATE = None
GIVE_UP = "give up"


def told(machine: object) -> dict[str, object]:
    return {one.name: getattr(machine, one.name) for one in fields(machine)}  # type: ignore[arg-type]


def words(sent: Outgoing) -> object:
    """Return a message in a few words."""
    match sent:
        case SendMissionItem(item):
            return f"item {item.seq}"
        case SendMissionCount(count):
            return f"count {count}"
        case _:
            return sent


def talk(machine: Machine, *heard: tuple[float, Message | str | None]) -> list[object]:
    """Return what is sent, and until when an answer is waited for, after each thing heard; how it ended at last."""
    machine, sent = machine.begin(100.0)
    found: list[object] = [(*map(words, sent), machine.deadline_s)]
    for now_s, message in heard:
        if message is LATE:
            machine, sent = machine.on_deadline(now_s)
        elif isinstance(message, str):
            machine, sent = machine.cancel()
        else:
            machine, sent = machine.on_message(message, now_s)
        found.append((*map(words, sent), machine.deadline_s))
    return [*found, machine.outcome]


def ask(seq: int) -> MissionRequest:
    return MissionRequest(seq)


def late(*at_s: float) -> list[tuple[float, None]]:
    return [(one_s, LATE) for one_s in at_s]


ALL = [(101.0, ask(0)), (102.0, ask(1)), (103.0, ask(2))]


ROWS: list[tuple[str, Callable[[], object], object]] = [
    (
        "an upload",
        lambda: talk(UPLOAD, *ALL, (104.0, MissionAck(0))),
        [("count 3", 101.5), ("item 0", 102.0), ("item 1", 103.0), ("item 2", 104.0), (math.inf,), Accepted()],
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
        [("count 3", 101.5), ("item 0", 102.0), (102.09,), ("item 0", 102.2), ("item 1", 102.25), None],
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
            ("item 0", 102.0),
            (103.0,),
            (109.9,),
            (math.inf,),
            TimedOut(reason="no answer after item 0 of 3"),
        ],
    ),
    (
        "an upload that falls silent at its end",
        lambda: talk(UPLOAD, *ALL, *late(104.0, 110.9, 111.0)),
        [
            ("count 3", 101.5),
            ("item 0", 102.0),
            ("item 1", 103.0),
            ("item 2", 104.0),
            ("item 2", 105.0),
            ("item 2", 111.9),
            (math.inf,),
            TimedOut(reason="no answer after item 2 of 3"),
        ],
    ),
    (
        "an upload that is asked for an item again",
        lambda: talk(UPLOAD, *ALL, (103.5, ask(1)), *late(104.5)),
        [
            ("count 3", 101.5),
            ("item 0", 102.0),
            ("item 1", 103.0),
            ("item 2", 104.0),
            ("item 1", 104.5),
            ("item 2", 105.5),
            None,
        ],
    ),
    (
        "an upload that is accepted too early",
        lambda: talk(UPLOAD, (101.0, MissionAck(0)), (102.0, ask(0)), (103.0, MissionAck(0))),
        [("count 3", 101.5), (101.5,), ("item 0", 103.0), (103.0,), None],
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
                (SendMissionAck(result=15), math.inf),
                (math.inf,),
                (math.inf,),
                (math.inf,),
                BrokenOff(),
            ],
            [
                ("count 3", 101.5),
                ("item 0", 102.0),
                (SendMissionAck(result=15), math.inf),
                (math.inf,),
                (math.inf,),
                (math.inf,),
                BrokenOff(),
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
        lambda: [replace(UPLOAD, furthest=furthest).begun for furthest in (-1, 0, 1)],
        [False, True, True],
    ),
    (
        "a download",
        lambda: talk(
            DownloadDialogue(),
            (101.0, MissionCount(2)),
            (102.0, MissionItemReceived(ITEMS[0])),
            (103.0, MissionItemReceived(ITEMS[1])),
            (104.0, MissionCount(5)),
        ),
        [
            (SendMissionRequestList(), 101.0),
            (SendMissionRequest(seq=0), 102.0),
            (SendMissionRequest(seq=1), 103.0),
            (SendMissionAck(result=0), math.inf),
            (math.inf,),
            Accepted(),
        ],
    ),
    (
        "a download of nothing",
        lambda: talk(DownloadDialogue(), (101.0, MissionCount(0))),
        [(SendMissionRequestList(), 101.0), (SendMissionAck(result=0), math.inf), Accepted()],
    ),
    (
        "a download that nobody answers",
        lambda: talk(DownloadDialogue(), *late(*range(101, 109))),
        [
            (SendMissionRequestList(), 101.0),
            (SendMissionRequestList(), 102.0),
            (SendMissionRequestList(), 103.0),
            (SendMissionRequestList(), 104.0),
            (SendMissionRequestList(), 105.0),
            (SendMissionRequestList(), 106.0),
            (SendMissionRequestList(), 107.0),
            (SendMissionRequestList(), 108.0),
            (math.inf,),
            TimedOut(reason="no answer when asked for the count"),
        ],
    ),
    (
        "a download that falls silent",
        lambda: talk(DownloadDialogue(), (101.0, MissionCount(2)), *late(*range(102, 110))),
        [
            (SendMissionRequestList(), 101.0),
            (SendMissionRequest(seq=0), 102.0),
            (SendMissionRequest(seq=0), 103.0),
            (SendMissionRequest(seq=0), 104.0),
            (SendMissionRequest(seq=0), 105.0),
            (SendMissionRequest(seq=0), 106.0),
            (SendMissionRequest(seq=0), 107.0),
            (SendMissionRequest(seq=0), 108.0),
            (SendMissionRequest(seq=0), 109.0),
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
            (101.0, MissionItemReceived(ITEMS[0])),
            (102.0, MissionCount(2)),
            (103.0, MissionItemReceived(ITEMS[1])),
            (104.0, MissionCount(3)),
        ),
        [(SendMissionRequestList(), 101.0), (101.0,), (SendMissionRequest(seq=0), 103.0), (103.0,), (103.0,), None],
    ),
    (
        "a download that is given up",
        lambda: talk(DownloadDialogue(), (101.0, GIVE_UP), (102.0, GIVE_UP), (103.0, MissionCount(2)), (104.0, LATE)),
        [
            (SendMissionRequestList(), 101.0),
            (SendMissionAck(result=15), math.inf),
            (math.inf,),
            (math.inf,),
            (math.inf,),
            BrokenOff(),
        ],
    ),
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
        [(ARM, 101.0), (math.inf,), (math.inf,), (math.inf,), (math.inf,), BrokenOff()],
    ),
    (
        "a parameter",
        lambda: talk(Parameter("RTL_ALT"), (101.0, ParamValue("RTL_ALT", 1500.0, 4))),
        [(SendParamRequest(name="RTL_ALT"), 101.0), (math.inf,), Accepted()],
    ),
    (
        "a parameter that nobody answers",
        lambda: talk(Parameter("RTL_ALT"), *late(*range(101, 106))),
        [
            (SendParamRequest(name="RTL_ALT"), 101.0),
            (SendParamRequest(name="RTL_ALT"), 102.0),
            (SendParamRequest(name="RTL_ALT"), 103.0),
            (SendParamRequest(name="RTL_ALT"), 104.0),
            (math.inf,),
            (math.inf,),
            TimedOut(reason="RTL_ALT: no answer"),
        ],
    ),
    (
        "another parameter's answer",
        lambda: talk(Parameter("RTL_ALT"), (101.0, ParamValue("RTL_SPEED", 1500.0, 4)), (102.0, MissionAck(0))),
        [(SendParamRequest(name="RTL_ALT"), 101.0), (101.0,), (101.0,), None],
    ),
    (
        "a parameter that is set",
        lambda: [
            talk(Parameter("RTL_ALT", WANTED), (101.0, ParamValue("RTL_ALT", value, 4)))[-1]
            for value in (1500.0, 1500.01, 1500.02, 1499.0)
        ],
        [Accepted(), Accepted(), None, None],
    ),
    (
        "a parameter of nothing that is set",
        lambda: [
            talk(Parameter("RTL_ALT", replace(WANTED, value=0.0)), (101.0, ParamValue("RTL_ALT", value, 4)))[-1]
            for value in (0.0, 0.0000009, 0.0000011)
        ],
        [Accepted(), Accepted(), None],
    ),
    (
        "a parameter that stays",
        lambda: talk(Parameter("RTL_ALT", WANTED), (100.5, ParamValue("RTL_ALT", 900.0, 4)), *late(*range(101, 105))),
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
        lambda: talk(Parameter("RTL_ALT", WANTED), *late(*range(101, 105)))[-1],
        TimedOut(reason="RTL_ALT: no answer"),
    ),
    (
        "a parameter that is given up",
        lambda: talk(
            Parameter("RTL_ALT"),
            (101.0, GIVE_UP),
            (102.0, GIVE_UP),
            (103.0, ParamValue("RTL_ALT", 1.0, 4)),
            (104.0, LATE),
        ),
        [(SendParamRequest(name="RTL_ALT"), 101.0), (math.inf,), (math.inf,), (math.inf,), (math.inf,), BrokenOff()],
    ),
    (
        "dialogues before they begin",
        lambda: [told(one) for one in (replace(UPLOAD, items=()), DownloadDialogue(), COMMAND, Parameter("RTL_ALT"))],
        [
            {
                "items": (),
                "silence_s": 8.0,
                "warnings": frozenset({13}),
                "outcome": None,
                "deadline_s": 0.0,
                "counts_sent": 0,
                "furthest": -1,
                "answered": -1,
                "answered_s": -math.inf,
                "heard_s": 0.0,
                "refusal": None,
            },
            {"outcome": None, "deadline_s": 0.0, "count": None, "items": (), "tries": 0, "refusal": None},
            {"command": ARM, "what": "arm", "outcome": None, "deadline_s": 0.0, "tries": 0, "refusal": ""},
            {"name": "RTL_ALT", "wanted": None, "outcome": None, "deadline_s": 0.0, "tries": 0, "value": None},
        ],
    ),
    (
        "the orders",
        lambda: [
            orders.arm(),
            orders.disarm(force=False),
            orders.disarm(force=True),
            orders.start_mission(),
            orders.change_speed(4.5),
            orders.message_interval(33, 4.0),
            orders.request_message(148),
            orders.run_prearm_checks(),
            orders.send_banner(),
            orders.set_mode(ARDUPILOT.modes.hold),
            orders.set_mode(PX4.modes.land),
            orders._command(1, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0),
        ],
        [
            ARM,
            SendCommand(command=400),
            SendCommand(command=400, params=(0.0, 21196.0, 0.0, 0.0, 0.0, 0.0, 0.0)),
            SendCommand(command=300),
            SendCommand(command=178, params=(1.0, 4.5, -1.0, 0.0, 0.0, 0.0, 0.0)),
            SendCommand(command=511, params=(33.0, 250000.0, 0.0, 0.0, 0.0, 0.0, 0.0)),
            SendCommand(command=512, params=(148.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)),
            SendCommand(command=401),
            SendCommand(command=42428),
            SendCommand(command=176, params=(1.0, 17.0, 0.0, 0.0, 0.0, 0.0, 0.0)),
            SendCommand(command=176, params=(1.0, 4.0, 6.0, 0.0, 0.0, 0.0, 0.0)),
            SendCommand(command=1, params=(1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0)),
        ],
    ),
    (
        "the messages that are asked for",
        lambda: [
            orders.GPS_RAW_INT,
            orders.ATTITUDE,
            orders.HEARTBEAT,
            orders.GLOBAL_POSITION_INT,
            orders.SYS_STATUS,
            orders.MISSION_CURRENT,
            orders.BATTERY_STATUS,
            orders.AUTOPILOT_VERSION,
            orders.FENCE_STATUS,
            orders.WIND,
            orders.WIND_COV,
            orders.EXTENDED_SYS_STATE,
        ],
        [24, 30, 0, 33, 1, 42, 147, 148, 162, 168, 231, 245],
    ),
]


@pytest.mark.parametrize(("what", "found", "expected"), ROWS, ids=[row[0] for row in ROWS])
def test_everything_that_comes_of_it(what: str, found: Callable[[], object], expected: object) -> None:
    assert rounded(found()) == expected
