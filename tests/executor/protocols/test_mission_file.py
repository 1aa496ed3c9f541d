"""A mission's last part as a file: all of it is on board, or nothing."""

from __future__ import annotations

import random
from dataclasses import replace

import pytest
from hypothesis import given
from hypothesis import strategies as st

from executor.core.interface.codes import Ending
from executor.core.interface.messages import FileRequest, Message, MissionRequest, Outgoing
from executor.protocols.machine import Aborted, Accepted, Rejected, TimedOut
from executor.protocols.mission_file import MOST_AT_ONCE, SESSION, FileOperation, MissionFileUpload
from missions import ARDUPILOT, Command, Frame, MissionItem
from tests.fakes.vehicle import FakeMissions

HOME = MissionItem(0, Frame.GLOBAL, Command.NAV_WAYPOINT, x=496000000, y=156000000, z=450.0)


def waypoints(heights_m: list[float]) -> tuple[MissionItem, ...]:
    items = (
        MissionItem(seq, Frame.GLOBAL_RELATIVE_ALT, Command.NAV_WAYPOINT, 1.0, x=496000000 + seq, y=156000000, z=z)
        for seq, z in enumerate(heights_m, start=1)
    )
    return (HOME, *items)


OLD = waypoints([20.0, 20.0, 20.0, 20.0, 20.0, 20.0])
NEW = waypoints([20.0, 20.0, 30.0, 31.5, 32.25, 33.0, 34.0, 35.0, 36.0, 37.0, 38.0, 39.0, 40.0, 41.0, 42.0])


def vehicle() -> FakeMissions:
    board = FakeMissions(ARDUPILOT, OLD)
    board.file.there_is_one = True
    return board


def fly(
    board: FakeMissions,
    upload: MissionFileUpload,
    air: random.Random | None = None,
    loss: float = 0.0,
    give_up: int = 0,
) -> tuple[MissionFileUpload, list[Outgoing]]:
    """Let the two talk, a message at a time, over a link that loses some of them.

    Args:
        board: The vehicle.
        upload: Before it begins.
        air: The dice of the link.
        loss: Share of messages that get lost, each way.
        give_up: After so many steps the upload is cancelled; 0 for never.
    """
    dice, now_s = air or random.Random(1), 100.0
    said: list[Outgoing] = []
    upload, sent = upload.begin(now_s)
    for step in range(1, 1000):
        said += sent
        answers = [one for request in sent if dice.random() >= loss for one in board.hear(request, now_s)]
        heard: list[Message] = [one for one in answers if dice.random() >= loss]
        if upload.outcome is not None:
            return upload, said
        if step == give_up:
            upload, sent = upload.cancel()
            continue
        now_s += 0.1
        sent = ()
        for one in heard:
            upload, more = upload.on_message(one, now_s)
            sent += more
        if not heard:
            now_s = max(now_s, upload.deadline_s)
            upload, sent = upload.on_deadline(now_s)
    raise AssertionError("it does not end")


def test_the_new_part_is_put_in_place_and_proven() -> None:
    board = vehicle()
    upload, sent = fly(board, MissionFileUpload(NEW, 3, 0))
    assert (upload.outcome, upload.is_proven, tuple(board.items)) == (Accepted(), True, NEW)
    written = [one for one in sent if isinstance(one, FileRequest) and one.operation == FileOperation.WRITE]
    assert sum(len(one.data) for one in written) == 10 + 13 * 38 + 10, "the new items alone, and the header twice"


def test_no_more_is_under_way_than_the_vehicle_keeps() -> None:
    upload, sent = MissionFileUpload(NEW, 3, 0, most_ahead=100).begin(100.0)
    assert len(sent) == MOST_AT_ONCE == len(upload.under_way)


@pytest.mark.parametrize(("most_ahead", "in_one", "at_once"), [(16, 5, 3), (6, 2, 3), (10, 5, 2), (1, 2, 1)])
def test_no_more_items_are_under_way_than_the_channel_permits(most_ahead: int, in_one: int, at_once: int) -> None:
    board = vehicle()
    upload, sent = fly(board, MissionFileUpload(NEW, 3, 0, most_ahead=most_ahead))
    _, first = MissionFileUpload(NEW, 3, 0, most_ahead=most_ahead).begin(100.0)
    assert (len(first), upload.is_proven, tuple(board.items)) == (at_once, True, NEW)
    assert max(len(one.data) for one in sent if isinstance(one, FileRequest)) == in_one * 38


def test_the_checksum_alone_is_asked_of_a_mission_that_is_on_board() -> None:
    board = vehicle()
    for items, proven in ((OLD, True), (NEW, False)):
        upload, sent = fly(board, MissionFileUpload(items, len(items), 0))
        assert (upload.accepted, upload.is_proven, tuple(board.items)) == (True, proven, OLD)
        assert [type(one) for one in sent] == [FileRequest, MissionRequest]


def test_a_checksum_that_is_refused_is_not_asked_for_again() -> None:
    board = vehicle()
    board.file.there_is_one = False
    upload, sent = fly(board, MissionFileUpload(OLD, len(OLD), 0))
    assert (upload.accepted, upload.is_proven, len(sent)) == (True, False, 2)


def test_the_header_waits_for_all_else() -> None:
    """Who closes a file without one, ourselves or the next station, changes nothing."""
    board = vehicle()
    upload, sent = MissionFileUpload(NEW, 3, 0).begin(100.0)
    while not upload.is_begun:
        answers = [one for request in sent for one in board.hear(request, 100.0)]
        assert board.file.data is not None
        assert not any(board.file.data[:10]), "not the header of an earlier file, which its memory still holds"
        sent = ()
        for one in answers:
            upload, more = upload.on_message(one, 100.0)
            sent += more


def test_an_autopilot_without_mission_files_says_so_at_once() -> None:
    board = vehicle()
    board.file.there_is_one = False
    upload, _ = fly(board, MissionFileUpload(NEW, 3, 0))
    assert isinstance(upload.outcome, Rejected)
    assert (upload.is_open, upload.code) == (False, Ending.ERROR)


def test_another_station_that_has_a_file_open_keeps_it() -> None:
    board = vehicle()
    board.file.data, board.file.session, board.file.heard_s = bytearray(b"theirs"), SESSION + 1, 99.0
    upload, _ = fly(board, MissionFileUpload(NEW, 3, 0))
    assert isinstance(upload.outcome, Rejected)
    assert board.file.data == b"theirs"
    assert tuple(board.items) == OLD


def test_an_unanswered_request_is_repeated_four_times() -> None:
    board = vehicle()
    upload, sent = fly(board, MissionFileUpload(NEW, 3, 0), loss=1.0)
    assert (upload.outcome, upload.is_open) == (TimedOut("no answer over MAVFTP"), False)
    opened = [one for one in sent if isinstance(one, FileRequest) and one.operation == FileOperation.OPEN_TO_WRITE]
    assert len(opened) == 5


def test_a_file_that_we_left_open_is_dropped_and_not_taken() -> None:
    board = vehicle()
    left, sent = MissionFileUpload(waypoints([99.0] * 9), 1, 0).begin(90.0)
    while not left.is_begun:
        answers, sent = [one for request in sent for one in board.hear(request, 90.0)], ()
        for one in answers:
            left, more = left.on_message(one, 90.0)
            sent += more
    header = next(one for one in sent if isinstance(one, FileRequest))
    board.hear(header, 90.0)  # and then the link is lost
    heights_m: list[float] = []
    put = board.file._put

    def note(first: int, items: list[MissionItem]) -> None:
        heights_m.extend(item.z for item in items)
        put(first, items)

    board.file._put = note
    upload, _ = fly(board, MissionFileUpload(NEW, 3, 4096))
    assert (upload.outcome, upload.is_proven, tuple(board.items)) == (Accepted(), True, NEW)
    assert 99.0 not in heights_m


def test_a_wrong_item_on_board_is_noticed() -> None:
    board = vehicle()
    board.spoils = 5
    upload, _ = fly(board, MissionFileUpload(NEW, 3, 0))
    assert (upload.accepted, upload.is_proven) == (True, False)


def test_items_that_the_vehicle_marks_as_current_are_no_difference() -> None:
    """AP_Mission::get_item marks all waypoints while the index is 16, MAV_CMD_NAV_WAYPOINT."""
    board = vehicle()
    board._stored = lambda item: HOME if item.seq == 0 else replace(item, current=item.command == 16)  # type: ignore[method-assign]
    board.items = [replace(item, current=True) for item in OLD]
    upload, _ = fly(board, MissionFileUpload(NEW, 3, 0))
    assert upload.is_proven


def test_without_a_checksum_nothing_is_proven() -> None:
    board = vehicle()
    board.file.repeats_checksum = False
    upload, sent = fly(board, MissionFileUpload(NEW, 3, 0))
    assert (upload.accepted, upload.is_proven, tuple(board.items)) == (True, False, NEW)
    assert MissionRequest(0) in sent


@given(seed=st.integers(0, 10**6), loss=st.sampled_from([0.0, 0.1, 0.3, 0.6]), give_up=st.integers(0, 40))
def test_whatever_is_lost_the_mission_on_board_is_the_old_or_the_new_one(seed: int, loss: float, give_up: int) -> None:
    board = vehicle()
    upload, _ = fly(board, MissionFileUpload(NEW, 3, 0), random.Random(seed), loss, give_up)
    assert tuple(board.items) in {OLD, NEW}
    if upload.is_proven:
        assert tuple(board.items) == NEW
    if not upload.is_begun:
        assert tuple(board.items) == OLD
        board.file.close()
        assert tuple(board.items) == OLD, "what it left behind is nothing"
    if give_up == 0 and loss <= 0.1:
        assert not isinstance(upload.outcome, Aborted)


@pytest.mark.parametrize("loss", [0.05, 0.2])
def test_over_a_bad_link_it_comes_through(loss: float) -> None:
    proven = 0
    for seed in range(40):
        upload, _ = fly(vehicle(), MissionFileUpload(NEW, 3, 0), random.Random(seed), loss)
        proven += upload.is_proven
    assert proven >= (38 if loss < 0.1 else 28), "the rest is read, and uploaded again"
