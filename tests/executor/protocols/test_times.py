"""When each dialogue asks again, how often, and when it gives up: second by second."""

from __future__ import annotations

import math

import pytest

from executor.core.messages import (
    CommandAck,
    MissionAck,
    MissionCount,
    MissionItemReceived,
    MissionRequest,
    SendCommand,
    SendMissionItem,
    SendMissionRequest,
)
from executor.protocols.command import CommandDialogue
from executor.protocols.download import DownloadDialogue
from executor.protocols.machine import Accepted, Machine, Rejected, TimedOut
from executor.protocols.upload import UploadDialogue
from missions import MissionItem

ORDER = SendCommand(400, (1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0))
ITEMS = tuple(MissionItem(seq, 3, 16, x=seq) for seq in range(3))
SILENCE_S = 5.0


def unanswered(machine: Machine, now_s: float = 100.0) -> tuple[list[float], Machine]:
    """Return when a dialogue speaks that nobody answers, and how it ends."""
    state, sent = machine.begin(now_s)
    spoken_s = [now_s] * len(sent)
    while state.outcome is None:
        now_s = state.deadline_s
        state, sent = state.on_deadline(now_s)
        spoken_s += [now_s] * len(sent)
    assert math.isinf(state.deadline_s)
    return spoken_s, state


def uploading() -> UploadDialogue:
    return UploadDialogue(ITEMS, SILENCE_S, frozenset({13}))


def test_a_command_is_sent_five_times_a_second_apart() -> None:
    spoken_s, ended = unanswered(CommandDialogue(ORDER, "arm"))
    assert spoken_s == [100.0, 101.0, 102.0, 103.0, 104.0]
    assert ended.outcome == TimedOut("arm: no acknowledgement")


def test_a_mission_is_asked_for_eight_times_a_second_apart() -> None:
    spoken_s, ended = unanswered(DownloadDialogue())
    assert spoken_s == [100.0 + second for second in range(8)]
    assert ended.outcome == TimedOut("no answer when asked for the count")


def test_a_mission_is_announced_five_times() -> None:
    spoken_s, ended = unanswered(uploading())
    assert spoken_s == [100.0, 101.5, 103.0, 104.5, 106.0]
    assert ended.outcome == TimedOut("the vehicle did not ask for the first item")


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


def test_each_answer_of_a_download_gives_the_next_question_its_full_time() -> None:
    state, _ = DownloadDialogue().begin(100.0)
    state, sent = state.on_message(MissionCount(3), 100.4)
    assert (sent, state.deadline_s, state.tries) == ((SendMissionRequest(0),), 101.4, 1)
    state, _ = state.on_deadline(101.4)
    assert (state.deadline_s, state.tries) == (102.4, 2)
    state, sent = state.on_message(MissionItemReceived(ITEMS[0]), 101.9)
    assert (sent, state.deadline_s, state.tries) == ((SendMissionRequest(1),), 102.9, 1)
    for second in range(8):
        state, _ = state.on_deadline(102.9 + second)
    assert state.outcome == TimedOut("no answer when asked for item 1 of 3")


def test_a_request_that_is_repeated_at_once_crossed_our_answer() -> None:
    state, _ = uploading().begin(100.0)
    state, sent = state.on_message(MissionRequest(0), 100.5)
    assert (sent, state.deadline_s) == ((SendMissionItem(ITEMS[0]),), 101.5)
    assert state.on_message(MissionRequest(0), 100.59)[1] == ()
    assert state.on_message(MissionRequest(0), 100.61)[1] == (SendMissionItem(ITEMS[0]),)
    assert state.on_message(MissionRequest(1), 100.51)[1] == (SendMissionItem(ITEMS[1]),)
    assert state.on_message(MissionRequest(3), 100.51) == (state, ())
    assert state.on_message(MissionRequest(-1), 100.51) == (state, ())


@pytest.mark.parametrize(("asked", "repeats"), [(0, False), (1, False), (2, True)])
def test_only_the_last_item_is_repeated_until_the_silence_is_too_long(asked: int, *, repeats: bool) -> None:
    state, _ = uploading().begin(100.0)
    state, _ = state.on_message(MissionRequest(asked), 100.0)
    for second in range(1, 5):
        state, sent = state.on_deadline(100.0 + second)
        assert sent == ((SendMissionItem(ITEMS[2]),) if repeats else ())
        assert state.deadline_s == 101.0 + second
    state, _ = state.on_deadline(105.0)
    assert state.outcome == TimedOut(f"no answer after item {asked} of 3")


def test_a_vehicle_that_waits_less_than_a_second_is_given_up_sooner() -> None:
    state, _ = UploadDialogue(ITEMS, 0.4, frozenset()).begin(100.0)
    state, _ = state.on_message(MissionRequest(0), 100.0)
    assert state.deadline_s == 100.4
    assert state.on_deadline(100.4)[0].outcome is not None


def test_which_acknowledgement_ends_an_upload() -> None:
    begun, _ = uploading().begin(100.0)
    assert begun.on_message(MissionAck(0), 100.1)[0].outcome is None, "nothing was asked for yet"
    assert begun.on_message(MissionAck(15), 100.1)[0].outcome is None, "of an earlier transfer"
    first, _ = begun.on_message(MissionRequest(0), 100.2)
    assert first.on_message(MissionAck(0), 100.3)[0].outcome is None
    assert first.on_message(MissionAck(13), 100.3)[0].outcome is None, "this autopilot goes on after it"
    assert first.on_message(MissionAck(15), 100.3)[0].outcome == Rejected("mission refused: cancelled by the vehicle")
    assert first.on_message(MissionAck(4), 100.3)[0].outcome == Rejected("mission refused: no space")
    doubted, _ = first.on_message(MissionAck(1), 100.3)
    assert doubted.outcome is None
    assert doubted.on_deadline(105.2)[0].outcome == Rejected("mission refused: error, or busy with another transfer")
    assert doubted.on_message(MissionRequest(1), 100.4)[0].on_deadline(105.4)[0].outcome == TimedOut(
        "no answer after item 1 of 3"
    )
    last, _ = first.on_message(MissionRequest(2), 100.4)
    assert last.on_message(MissionAck(0), 100.5)[0].outcome == Accepted()
    assert last.on_message(MissionAck(1), 100.5)[0].outcome is not None
