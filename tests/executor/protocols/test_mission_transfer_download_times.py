"""When a download asks again, how often, and when it gives up: second by second."""

from __future__ import annotations

import pytest

from executor.core.interface.messages import (
    MissionAck,
    MissionCount,
    MissionItemInt,
    MissionRequest,
    MissionRequestList,
)
from executor.protocols.machine import Accepted, TimedOut
from executor.protocols.mission_transfer import DownloadDialogue
from missions import MissionItem
from tests.executor.protocols.silences import unanswered

ITEMS = tuple(MissionItem(seq, 3, 16, x=seq) for seq in range(3))


def test_a_mission_is_asked_for_more_and_more_seldom_until_the_silence_is_too_long() -> None:
    spoken_s, ended = unanswered(DownloadDialogue())
    assert spoken_s == [100.0, 101.0, 102.0, 104.0, 106.0]
    assert ended.outcome == TimedOut("no answer when asked for the count")


def test_a_question_is_asked_again_when_the_link_would_have_answered_it() -> None:
    """Answers take 0.4 s: the second question waits for that, and for as much again as the first guess allows."""
    state, _ = DownloadDialogue().begin(100.0)
    state, sent = state.on_message(MissionCount(3), 100.4)
    assert (sent, state.tries) == ((MissionRequest(0),), 1)
    assert state.deadline_s == pytest.approx(101.2)
    state, sent = state.on_deadline(101.2)
    assert (sent, state.tries) == ((MissionRequest(0),), 2)
    assert state.deadline_s == pytest.approx(102.0)
    state, _ = state.on_deadline(102.0)
    assert state.deadline_s == pytest.approx(103.6), "more and more seldom"
    state, _ = state.on_deadline(103.6)
    assert state.deadline_s == pytest.approx(105.6), "but as often as PX4 wants it"
    state, sent = state.on_message(MissionItemInt(ITEMS[0]), 103.7)
    assert (sent, state.tries) == ((MissionRequest(1),), 1)
    assert state.deadline_s == pytest.approx(105.7), "which of them was answered nobody knows"


def test_a_fast_link_is_asked_again_soon() -> None:
    state, _ = DownloadDialogue().begin(100.0)
    state, _ = state.on_message(MissionCount(3), 100.01)
    assert state.deadline_s == pytest.approx(100.26)


def test_a_transfer_that_the_vehicle_has_ended_is_started_again() -> None:
    """PX4 ends one with an error where a doubled question comes late, and answers no further question for an item."""
    state, _ = DownloadDialogue().begin(100.0)
    state, _ = state.on_message(MissionCount(3), 100.4)
    state, _ = state.on_message(MissionItemInt(ITEMS[0]), 100.8)
    state, sent = state.on_message(MissionAck(1), 101.0)
    assert sent == (), "it may be about the upload before"
    state, sent = state.on_deadline(state.deadline_s)
    assert sent == (MissionRequestList(),)
    state, sent = state.on_message(MissionItemInt(ITEMS[1]), 102.0)
    assert sent == (), "late, of the transfer that has ended"
    state, sent = state.on_message(MissionCount(3), 102.5)
    assert sent == (MissionRequest(0),)
    for item in ITEMS:
        state, sent = state.on_message(MissionItemInt(item), 103.0)
    assert (state.outcome, state.items, sent) == (Accepted(), ITEMS, (MissionAck(0),))


def test_an_unanswered_transfer_starts_again_after_px4_has_given_it_up() -> None:
    state, _ = DownloadDialogue().begin(100.0)
    state, _ = state.on_message(MissionCount(3), 100.1)
    said = []
    while state.outcome is None:
        at_s = state.deadline_s
        state, sent = state.on_deadline(at_s)
        said += [(at_s > 105.1, message) for message in sent]
    assert {message for later, message in said if not later} == {MissionRequest(0)}
    assert {message for later, message in said if later} == {MissionRequestList()}
    assert state.outcome == TimedOut("no answer when asked for item 0 of 3")


def test_a_timer_that_ends_a_hair_early_is_the_end_of_the_silence_all_the_same() -> None:
    """Else it would be asked, and asked again, in no time."""
    state, _ = DownloadDialogue().begin(100.0)
    for _ in range(20):
        state, _ = state.on_deadline(state.deadline_s - 1e-9)
    assert state.outcome == TimedOut("no answer when asked for the count")
