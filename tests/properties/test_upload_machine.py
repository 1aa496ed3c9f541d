"""The upload machine, under any order, duplication and loss of messages."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st
from pymavlink.dialects.v20 import common as mav

from executor.core.interface.messages import (
    CommandAck,
    Message,
    MissionAck,
    MissionCount,
    MissionItemInt,
    MissionRequest,
    Outgoing,
)
from executor.protocols.machine import Aborted, Accepted, Rejected, TimedOut
from executor.protocols.mission_transfer import (
    AGAIN_AHEAD,
    COUNT_PERIOD_S,
    COUNT_TRIES,
    REPEAT_S,
    RESULT_NAMES,
    UploadDialogue,
)
from missions import ARDUPILOT, PX4, Dialect, MissionItem
from tests.properties.machines import Cancel, Told, play, stories

ITEMS = tuple(MissionItem(seq, 3, 16, x=seq) for seq in range(4))
LAST = len(ITEMS) - 1
RESULTS = sorted(mav.enums["MAV_MISSION_RESULT"])[:-1]
"""Every MAV_MISSION_RESULT; the enum's last entry is its end mark."""
TEMPORARY = {1}
"""ERROR once the vehicle has asked for items: what PX4 says of an old COUNT or item that comes late."""

MESSAGES: st.SearchStrategy[Message] = st.one_of(
    st.builds(MissionRequest, st.integers(-1, len(ITEMS))),
    st.builds(MissionAck, st.sampled_from(RESULTS)),
    st.sampled_from([MissionCount(4), CommandAck(16, 0), MissionAck(0), MissionRequest(LAST)]),
)
DIALECTS = pytest.mark.parametrize("dialect", [ARDUPILOT, PX4], ids=lambda dialect: str(dialect.name))


def upload(dialect: Dialect) -> UploadDialogue:
    return UploadDialogue(ITEMS, dialect.upload_silence_s + 1.0, dialect.upload_warnings)


def told(dialect: Dialect, *messages: Message, apart_s: float = 0.2) -> tuple[UploadDialogue, list[Outgoing]]:
    """Return an upload that was told messages, and what it sent for them."""
    machine, _ = upload(dialect).begin(0.0)
    sent: list[Outgoing] = []
    for number, message in enumerate(messages, start=1):
        machine, said = machine.on_message(message, number * apart_s)
        sent.extend(said)
    return machine, sent


@DIALECTS
@given(story=stories(MESSAGES))
def test_it_ends_exactly_once_whatever_comes(dialect: Dialect, story: list[Told]) -> None:
    play(upload(dialect), story)


@DIALECTS
@given(story=stories(MESSAGES, cancels=False))
def test_it_is_accepted_only_after_the_last_item_was_sent(dialect: Dialect, story: list[Told]) -> None:
    machine, sent = play(upload(dialect), story)
    if isinstance(machine.outcome, Accepted):
        assert MissionItemInt(ITEMS[LAST]) in sent
        assert MissionAck(0) in [one.step for one in story]


@DIALECTS
@given(story=stories(MESSAGES))
def test_it_repeats_the_count_only_until_the_first_request(dialect: Dialect, story: list[Told]) -> None:
    _, sent = play(upload(dialect), story)
    kinds = [type(message) for message in sent]
    assert kinds.count(MissionCount) <= COUNT_TRIES
    if MissionItemInt in kinds:
        assert MissionCount not in kinds[kinds.index(MissionItemInt) :]


@DIALECTS
@given(old=st.lists(st.sampled_from([MissionAck(0), MissionAck(15)]), max_size=6))
def test_an_acknowledgement_of_an_earlier_transfer_never_ends_the_present_one(
    dialect: Dialect, old: list[MissionAck]
) -> None:
    asked = [MissionRequest(seq) for seq in range(LAST)]
    machine, _ = told(dialect, *old, asked[0], *(ack for ack in old if ack.result == 0), *asked[1:])
    assert machine.outcome is None
    machine, _ = machine.on_message(MissionRequest(LAST), 60.0)
    machine, _ = machine.on_message(MissionAck(0), 60.2)
    assert machine.outcome == Accepted()


def test_every_result_has_its_words() -> None:
    assert set(RESULT_NAMES) == set(RESULTS) - {0}


@DIALECTS
@pytest.mark.parametrize("result", RESULTS)
def test_every_result_before_the_first_request(dialect: Dialect, result: int) -> None:
    machine, _ = told(dialect, MissionAck(result))
    if result in {0, 15} | dialect.upload_warnings:
        assert machine.outcome is None, "it can only belong to an earlier transfer"
    else:
        assert machine.outcome == Rejected(f"mission refused: {RESULT_NAMES[result]}")


@DIALECTS
@pytest.mark.parametrize("result", RESULTS)
def test_every_result_in_the_midst(dialect: Dialect, result: int) -> None:
    machine, _ = told(dialect, MissionRequest(0), MissionRequest(1), MissionAck(result))
    if result in {0} | TEMPORARY | dialect.upload_warnings:
        assert machine.outcome is None, "the vehicle goes on"
    else:
        assert machine.outcome == Rejected(f"mission refused: {RESULT_NAMES[result]}")


@DIALECTS
@pytest.mark.parametrize("result", RESULTS)
def test_every_result_after_the_last_item(dialect: Dialect, result: int) -> None:
    machine, _ = told(dialect, *(MissionRequest(seq) for seq in range(len(ITEMS))), MissionAck(result))
    if result == 0:
        assert machine.outcome == Accepted()
    elif result in dialect.upload_warnings:
        assert machine.outcome is None
    else:
        assert machine.outcome == Rejected(f"mission refused: {RESULT_NAMES[result]}")


def test_an_unknown_result_is_named_by_its_number() -> None:
    machine, _ = told(PX4, MissionAck(99))
    assert machine.outcome == Rejected("mission refused: result 99")


def test_an_error_in_the_midst_is_the_reason_if_the_vehicle_asks_no_more() -> None:
    machine, _ = told(PX4, MissionRequest(0), MissionAck(1))
    now_s = 0.0
    while machine.outcome is None:
        now_s = machine.deadline_s
        machine, _ = machine.on_deadline(now_s)
    assert machine.outcome == Rejected(f"mission refused: {RESULT_NAMES[1]}")
    assert now_s < 0.2 + PX4.upload_silence_s + 3.0


def test_an_error_that_is_followed_by_a_request_is_forgotten() -> None:
    machine, _ = told(PX4, MissionRequest(0), MissionAck(1), MissionRequest(1))
    while machine.outcome is None:
        machine, _ = machine.on_deadline(machine.deadline_s)
    assert machine.outcome == TimedOut("no answer after item 1 of 4")


def test_a_vehicle_that_never_requests_items_gets_the_count_five_times() -> None:
    machine, sent = play(upload(PX4), [])
    assert sent == [MissionCount(len(ITEMS))] * COUNT_TRIES
    assert machine.outcome == TimedOut("the vehicle did not ask for the first item")


def test_the_count_is_repeated_at_its_period() -> None:
    machine, _ = upload(PX4).begin(5.0)
    assert machine.deadline_s == pytest.approx(5.0 + COUNT_PERIOD_S)


def test_a_request_that_crossed_the_answer_is_answered_once() -> None:
    machine, sent = told(PX4, MissionRequest(0), MissionRequest(0), apart_s=REPEAT_S / 2)
    assert sent == [MissionItemInt(item) for item in ITEMS]
    machine, said = machine.on_message(MissionRequest(0), 1.0)
    assert said == (), "more requests may come in the same packet"
    _, said = machine.on_deadline(machine.deadline_s)
    assert said == tuple(MissionItemInt(item) for item in ITEMS[:AGAIN_AHEAD])


def test_the_last_item_is_repeated_while_its_acknowledgement_stays_away() -> None:
    machine, _ = told(PX4, *(MissionRequest(seq) for seq in range(len(ITEMS))))
    machine, said = machine.on_deadline(machine.deadline_s)
    assert said == (MissionItemInt(ITEMS[LAST]),)
    machine, _ = machine.on_message(MissionAck(0), 3.0)
    assert machine.outcome == Accepted()


def test_a_cancellation_is_sent_to_the_vehicle() -> None:
    machine, _ = told(PX4, MissionRequest(0))
    ended, said = machine.cancel()
    assert (ended.outcome, said) == (Aborted(), (MissionAck(15),))


def test_a_cancelled_story_ends_cancelled() -> None:
    machine, sent = play(upload(ARDUPILOT), [Told(Cancel(), 0.1), Told(MissionRequest(0), 0.1)])
    assert machine.outcome == Aborted()
    assert sent[-1] == MissionAck(15)
