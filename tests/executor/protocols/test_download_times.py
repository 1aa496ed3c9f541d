"""When a download asks again, how often, and when it gives up: second by second."""

from __future__ import annotations

from executor.core.messages import (
    MissionCount,
    MissionItemReceived,
    SendMissionRequest,
)
from executor.protocols.download import DownloadDialogue
from executor.protocols.machine import TimedOut
from missions import MissionItem
from tests.executor.protocols.silences import unanswered

ITEMS = tuple(MissionItem(seq, 3, 16, x=seq) for seq in range(3))


def test_a_mission_is_asked_for_eight_times_a_second_apart() -> None:
    spoken_s, ended = unanswered(DownloadDialogue())
    assert spoken_s == [100.0 + second for second in range(8)]
    assert ended.outcome == TimedOut("no answer when asked for the count")


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
