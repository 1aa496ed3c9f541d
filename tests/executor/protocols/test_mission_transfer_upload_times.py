"""When an upload asks again, how often, and when it gives up: second by second."""

from __future__ import annotations

from dataclasses import replace

import pytest

from executor.core.interface.messages import (
    MissionAck,
    MissionItemInt,
    MissionRequest,
)
from executor.protocols.machine import Accepted, Rejected, TimedOut
from executor.protocols.mission_transfer import FIRST_TRIP, UploadDialogue
from missions import MissionItem
from tests.executor.protocols.silences import unanswered

ITEMS = tuple(MissionItem(seq, 3, 16, x=seq) for seq in range(3))
SILENCE_S = 5.0


def uploading() -> UploadDialogue:
    return UploadDialogue(ITEMS, SILENCE_S, frozenset({13}), most_ahead=1, room=1)


def test_a_mission_is_announced_five_times() -> None:
    spoken_s, ended = unanswered(uploading())
    assert spoken_s == [100.0, 101.5, 103.0, 104.5, 106.0]
    assert ended.outcome == TimedOut("the vehicle did not ask for the first item")


def test_a_request_that_is_repeated_within_a_round_trip_crossed_our_answer() -> None:
    """The count was answered after 0.5 s; that the next answer takes half as long again surprises nobody."""
    state, _ = uploading().begin(100.0)
    state, sent = state.on_message(MissionRequest(0), 100.5)
    assert (sent, state.deadline_s) == ((MissionItemInt(ITEMS[0]),), 101.5)
    assert state.on_message(MissionRequest(0), 100.59)[1] == ()
    assert state.on_message(MissionRequest(0), 101.24)[1] == ()
    doubted, sent = state.on_message(MissionRequest(0), 101.26)
    assert sent == (), "the next request may be in the same packet"
    assert doubted.deadline_s == pytest.approx(101.385)
    assert doubted.on_message(MissionRequest(1), 101.27)[1] == (MissionItemInt(ITEMS[1]),)
    assert doubted.on_message(MissionRequest(0), 101.3)[0].deadline_s == doubted.deadline_s
    assert doubted.on_deadline(101.385)[1] == (MissionItemInt(ITEMS[0]),)
    assert state.on_message(MissionRequest(1), 100.51)[1] == (MissionItemInt(ITEMS[1]),)
    assert state.on_message(MissionRequest(3), 100.51) == (state, ())
    assert state.on_message(MissionRequest(-1), 100.51) == (state, ())


def test_on_a_fast_link_a_request_is_answered_again_after_a_tenth_of_a_second() -> None:
    state, _ = uploading().begin(100.0)
    state, _ = state.on_message(MissionRequest(0), 100.001)
    assert state.on_message(MissionRequest(0), 100.1)[1] == ()
    assert state.on_message(MissionRequest(0), 100.11)[1] == (MissionItemInt(ITEMS[0]),)


def test_of_an_item_that_was_sent_twice_the_copy_that_can_have_arrived_is_the_measure() -> None:
    state, _ = uploading().begin(100.0)
    state, _ = state.on_message(MissionRequest(0), 100.4)
    doubted, _ = state.on_message(MissionRequest(0), 101.2)
    twice, sent = doubted.on_deadline(101.3)
    assert sent == (MissionItemInt(ITEMS[0]),)
    second, _ = twice.on_message(MissionRequest(1), 101.6)
    assert second.round_trip.mean_s == pytest.approx(0.4), "the second: the first had got lost"
    first, _ = twice.on_message(MissionRequest(1), 101.35)
    assert first.round_trip.mean_s == pytest.approx(0.4 + (0.95 - 0.4) / 8), "the first: it only took longer"


def test_an_item_that_a_vehicle_keeps_asking_for_is_repeated_sooner_as_its_patience_ends() -> None:
    """Round trips of 2 s leave PX4 time for two copies; where a fifth is lost each way, that is too few."""
    state, _ = UploadDialogue(ITEMS, 6.0, frozenset(), most_ahead=1, room=1).begin(100.0)
    state, _ = state.on_message(MissionRequest(0), 102.0)
    sent_s = []
    for quarter in range(1, 20):
        state, sent = state.on_message(MissionRequest(0), 102.0 + quarter / 4)
        assert not state.doubts, "nothing is waited for any more"
        sent_s += [102.0 + quarter / 4 for _ in sent]
    assert sent_s == pytest.approx([104.0, 105.5, 106.5])


def test_repeated_requests_tell_how_long_a_vehicle_waits_while_this_computer_stalls() -> None:
    """Twelve requests of 3 s are read within a moment: one copy goes out at once, and no second one."""
    state, _ = UploadDialogue(ITEMS, 6.0, frozenset(), most_ahead=1, room=1).begin(100.0)
    state, _ = state.on_message(MissionRequest(0), 102.0)
    sent_s = []
    for number in range(12):
        now_s = 103.6 + number / 1000
        state, sent = state.on_message(MissionRequest(0), now_s)
        sent_s += [now_s for _ in sent]
    assert len(sent_s) == 1


def test_what_was_sent_with_an_item_that_has_just_arrived_is_not_lost() -> None:
    """Others' items stood before ours in the radio: PX4 repeats its question meanwhile, every quarter of a second."""
    state, _ = UploadDialogue(ITEMS, 6.0, frozenset(), most_ahead=3, room=3).begin(100.0)
    state, sent = state.on_message(MissionRequest(0), 100.6)
    assert len(sent) == 3
    state, _ = state.on_message(MissionRequest(1), 102.1)
    state, sent = state.on_message(MissionRequest(1), 102.35)
    assert (sent, state.doubts) == ((), False)
    state, _ = state.on_message(MissionRequest(1), 102.85)
    assert state.doubts


def test_an_earlier_request_is_late_unless_it_continues() -> None:
    state, _ = uploading().begin(100.0)
    state, _ = state.on_message(MissionRequest(0), 100.2)
    state, _ = state.on_message(MissionRequest(1), 100.4)
    assert state.on_message(MissionRequest(0), 100.5)[1] == ()
    assert state.on_message(MissionRequest(0), 101.4)[1] == (MissionItemInt(ITEMS[0]),), "it has begun anew"


@pytest.mark.parametrize("asked", [0, 1, 2])
def test_an_item_is_repeated_more_and_more_seldom_until_the_silence_is_too_long(asked: int) -> None:
    state, _ = uploading().begin(100.0)
    state, _ = state.on_message(MissionRequest(asked), 100.0)
    spoken_s = []
    while state.deadline_s < 105.0:
        spoken_s.append(state.deadline_s)
        state, sent = state.on_deadline(state.deadline_s)
        assert sent == (MissionItemInt(ITEMS[asked]),)
    first = [101.0, 102.0, 103.0, 104.0] if asked == 2 else [100.25, 100.5, 100.9, 101.7, 103.3]
    assert spoken_s == pytest.approx(first), "the last one is waited for a second: the vehicle asks for what it lacks"
    state, _ = state.on_deadline(105.0)
    assert state.outcome == TimedOut(f"no answer after item {asked} of 3")


def test_a_vehicle_that_waits_less_than_a_second_is_given_up_sooner() -> None:
    state, _ = UploadDialogue(ITEMS, 0.4, frozenset(), most_ahead=1, room=1).begin(100.0)
    state, _ = state.on_message(MissionRequest(0), 100.0)
    assert state.deadline_s == 100.25
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


@pytest.mark.parametrize(("trip_s", "at_once"), [(0.6, 8), (1.4, 24)])
def test_over_a_far_radio_as_many_items_go_out_at_once_as_it_may_hold(trip_s: float, at_once: int) -> None:
    """Each time that it doubles costs a round trip."""
    items = tuple(MissionItem(seq, 3, 16, x=seq) for seq in range(40))
    state, _ = UploadDialogue(items, SILENCE_S, frozenset({13}), most_ahead=24).begin(100.0)
    assert len(state.on_message(MissionRequest(0), 100.0 + trip_s)[1]) == at_once


def test_a_count_that_took_far_longer_than_known_is_what_is_known_from_then_on() -> None:
    """Of two links with one vehicle behind them the other one's answer had been measured: items went out twice."""
    known = replace(FIRST_TRIP, mean_s=0.1, waits_s=0.3, shortest_s=0.1)
    state, _ = UploadDialogue(ITEMS, SILENCE_S, frozenset({13}), round_trip=known).begin(100.0)
    for took_s, mean_s in ((0.15, 0.10625), (1.4, 1.4)):
        after, _ = state.on_message(MissionRequest(0), 100.0 + took_s)
        assert after.round_trip.mean_s == pytest.approx(mean_s)
