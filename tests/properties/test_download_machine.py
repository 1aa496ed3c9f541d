"""The download machine, under any order, duplication and loss of messages."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from executor.core.interface.messages import (
    Message,
    MissionAck,
    MissionCount,
    MissionItemInt,
    MissionRequest,
    MissionRequestList,
    Outgoing,
)
from executor.protocols.machine import Aborted, Accepted, Rejected, TimedOut
from executor.protocols.mission_transfer import RESULT_NAMES, DownloadDialogue
from missions import MissionItem
from tests.properties.machines import Deadline, Told, play, stories

ITEMS = tuple(MissionItem(seq, 3, 16, x=seq) for seq in range(4))
MESSAGES: st.SearchStrategy[Message] = st.one_of(
    st.builds(MissionItemInt, st.sampled_from(ITEMS)),
    st.builds(MissionAck, st.integers(0, 15)),
    st.builds(MissionCount, st.sampled_from([4, 4, 4, 3, 0])),
    st.just(MissionRequest(0)),
)


@given(story=stories(MESSAGES))
def test_it_ends_exactly_once_whatever_comes(story: list[Told]) -> None:
    play(DownloadDialogue(), story)


@given(story=stories(MESSAGES, cancels=False))
def test_what_is_accepted_is_whole_and_in_order(story: list[Told]) -> None:
    machine, sent = play(DownloadDialogue(), story)
    if isinstance(machine.outcome, Accepted):
        assert len(machine.items) == machine.count
        assert [item.seq for item in machine.items] == list(range(len(machine.items)))
        assert sent[-1] == MissionAck(0)
        assert sent.count(MissionAck(0)) == 1


def told(*messages: Message) -> tuple[DownloadDialogue, list[Outgoing]]:
    machine, opening = DownloadDialogue().begin(0.0)
    sent = list(opening)
    for message in messages:
        machine, said = machine.on_message(message, 0.1)
        sent.extend(said)
    return machine, sent


def test_a_clean_download() -> None:
    machine, sent = told(MissionCount(4), *(MissionItemInt(item) for item in ITEMS))
    assert (machine.outcome, machine.items) == (Accepted(), ITEMS)
    assert sent == [MissionRequestList(), *(MissionRequest(seq) for seq in range(4)), MissionAck(0)]


def test_an_empty_vehicle() -> None:
    machine, sent = told(MissionCount(0))
    assert (machine.outcome, machine.items) == (Accepted(), ())
    assert sent == [MissionRequestList(), MissionAck(0)]


def test_duplicates_and_strays_change_nothing() -> None:
    machine, sent = told(
        MissionItemInt(ITEMS[0]), MissionCount(4), MissionCount(9), MissionItemInt(ITEMS[2]),
        MissionItemInt(ITEMS[0]), MissionItemInt(ITEMS[0]), MissionAck(0),
    )  # fmt: skip
    assert (machine.outcome, machine.items, machine.count) == (None, ITEMS[:1], 4)
    assert sent == [MissionRequestList(), MissionRequest(0), MissionRequest(1)]


def test_silence_ends_it() -> None:
    machine, sent = play(DownloadDialogue(), [])
    assert set(sent) == {MissionRequestList()}
    assert machine.outcome == TimedOut("no answer when asked for the count")


def test_silence_in_the_midst_names_the_item() -> None:
    machine, _ = play(DownloadDialogue(), [Told(MissionCount(4), 0.1), Told(MissionItemInt(ITEMS[0]), 0.1)])
    assert machine.outcome == TimedOut("no answer when asked for item 1 of 4")


@pytest.mark.parametrize("result", range(1, 16))
def test_a_refusal_is_asked_again_and_then_is_the_reason(result: int) -> None:
    """ERROR and INVALID_SEQUENCE may be late answers to the upload before; 14 ends when the other station is done."""
    machine, _ = told(MissionAck(result))
    assert machine.outcome is None
    answered, _ = machine.on_message(MissionCount(0), 0.2)
    assert answered.outcome == Accepted()
    while machine.outcome is None:
        machine, _ = machine.on_deadline(machine.deadline_s)
    assert machine.outcome == Rejected(f"download refused: {RESULT_NAMES[result]}")


def test_a_cancellation_is_sent_to_the_vehicle() -> None:
    machine, _ = told(MissionCount(4))
    ended, said = machine.cancel()
    assert (ended.outcome, said) == (Aborted(), (MissionAck(15),))


def test_a_deadline_asks_the_open_question_again() -> None:
    _, sent = play(DownloadDialogue(), [Told(MissionCount(4), 0.1), Told(Deadline(), 0.0)])
    assert sent[:3] == [MissionRequestList(), MissionRequest(0), MissionRequest(0)]
