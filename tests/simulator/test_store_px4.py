"""PX4's side of the mission protocol, as measured."""

from __future__ import annotations

from dataclasses import replace

from hypothesis import given
from hypothesis import strategies as st

from missions import compute_list_checksum
from missions.items import Frame
from simulator.config import AutopilotKind
from simulator.messages import (
    MissionAckReceived,
    MissionClearAll,
    MissionCount,
    MissionRequest,
    MissionRequestList,
    MissionSetCurrent,
    Outbound,
)
from tests.simulator.harness import (
    OTHER,
    Operator,
    fields_of,
    numbered,
    on_wire,
    rtl,
    speed,
    takeoff,
    waypoint,
)

LIST = numbered((takeoff(), speed(5), waypoint(100, 0), waypoint(100, 100), rtl()), current=0)


def operator() -> Operator:
    return Operator(AutopilotKind.PX4)


def acks(messages: list[Outbound]) -> list[object]:
    return [fields_of(message)["type"] for message in messages if message.name == "MISSION_ACK"]


def test_it_asks_with_mission_request_int_in_order() -> None:
    op = operator()
    op.upload(LIST)
    assert [fields["seq"] for fields in op.sent("MISSION_REQUEST_INT")] == [0, 1, 2, 3, 4]


def test_the_final_ack_carries_the_id_that_mission_current_shows() -> None:
    op = operator()
    op.upload(LIST)
    identity = op.sent("MISSION_ACK")[-1]["opaque_id"]
    assert identity == compute_list_checksum(LIST) != 0
    assert op.mission_current()["mission_id"] == identity
    assert fields_of(op.send(MissionRequestList(0))[0])["opaque_id"] == identity


def test_what_was_sent_reads_back() -> None:
    op = operator()
    op.upload(LIST)
    back = op.download()
    for item, fields in zip(LIST, back, strict=True):
        frame = Frame.GLOBAL_RELATIVE_ALT_INT if item.frame == Frame.GLOBAL_RELATIVE_ALT else item.frame
        assert (fields["seq"], fields["frame"], fields["command"]) == (item.seq, frame, item.command)
        assert (fields["x"], fields["y"], fields["z"]) == (item.x, item.y, item.z)
        assert fields["current"] == int(item.current)


def test_a_missing_item_is_asked_for_again_every_250_ms() -> None:
    op = operator()
    op.send(MissionCount(3, 0))
    op.run(1.1)
    assert len(op.sent("MISSION_REQUEST_INT")) == 5


def test_an_abandoned_upload_ends_after_5_s_with_a_text_and_no_ack() -> None:
    op = operator()
    op.upload(LIST)
    acks_before = len(op.sent("MISSION_ACK"))
    op.send(MissionCount(2, 0))
    op.run(4.9)
    assert "Operation timeout\t" not in op.texts()
    op.run(0.2)
    assert "Operation timeout\t" in op.texts()
    assert len(op.sent("MISSION_ACK")) == acks_before
    assert op.vehicle.store.items == LIST


def test_where_a_busy_computer_may_be_silent_an_upload_is_not_given_up_sooner() -> None:
    op = Operator(AutopilotKind.PX4, {"transfer_patience_s": 60.0})
    op.send(MissionCount(2, 0))
    op.run(59.5)
    assert "Operation timeout\t" not in op.texts()
    op.run(1.0)
    assert "Operation timeout\t" in op.texts()


def test_a_second_ground_station_gets_ack_1_at_once() -> None:
    op = operator()
    op.send(MissionCount(len(LIST), 0))
    assert acks(op.send(MissionCount(2, 0), OTHER)) == [1]
    assert acks(op.send(MissionRequestList(0), OTHER)) == []
    assert op.texts() == ["Mission download request ignored, already active\t"]
    assert acks(op.send(MissionRequest(0, 0, integer=True), OTHER)) == []
    assert acks(op.send(on_wire(LIST[0]), OTHER)) == []
    assert acks(op.send(MissionAckReceived(15, 0), OTHER)) == []
    assert op.texts()[1:] == [
        "WPM: REJ. CMD: partner id mismatch\t",
        "REJ. MIS ITEM: partner id mismatch\t",
        "REJ. WP CMD: partner id mismatch\t",
    ]
    assert op.upload_rest(LIST) == 0


def test_an_unknown_command_is_3_and_a_bad_frame_is_2_and_the_old_mission_stays() -> None:
    op = operator()
    op.upload(LIST)
    assert op.upload((LIST[0], replace(LIST[1], command=4000), *LIST[2:])) == 3
    assert op.upload((LIST[0], replace(LIST[2], seq=1, frame=10), *LIST[2:])) == 2
    assert op.vehicle.store.items == LIST


def test_the_same_content_is_acknowledged_and_ignored() -> None:
    op = operator()
    op.upload(LIST)
    assert op.upload(numbered(LIST, current=3)) == 0
    assert op.mission_current()["seq"] == 0
    op.send(MissionSetCurrent(3))
    assert op.mission_current()["seq"] == 3


@given(st.integers(0, 4), st.integers(0, 4))
def test_the_id_leaves_current_out(one: int, two: int) -> None:
    assert compute_list_checksum(numbered(LIST, one)) == compute_list_checksum(numbered(LIST, two))


@given(st.integers(0, 4), st.floats(1, 100, width=32))
def test_the_id_knows_everything_else(seq: int, more: float) -> None:
    changed = tuple(replace(item, param1=item.param1 + more) if item.seq == seq else item for item in LIST)
    assert compute_list_checksum(changed) != compute_list_checksum(LIST)


def test_a_cancellation_is_honoured() -> None:
    op = operator()
    op.send(MissionCount(len(LIST), 0))
    op.send(on_wire(LIST[0]))
    op.send(MissionAckReceived(15, 0))
    assert acks(op.send(on_wire(LIST[1]))) == [1]
    assert "IGN MISSION_ITEM: No transfer\t" in op.texts()


def test_a_wrong_sequence_is_ignored_in_silence() -> None:
    op = operator()
    op.send(MissionCount(len(LIST), 0))
    assert op.send(on_wire(LIST[3])) == []
    assert op.upload_rest(LIST) == 0


def test_a_lost_final_ack_is_sent_again_for_the_last_item() -> None:
    op = operator()
    op.upload(LIST)
    assert acks(op.send(on_wire(LIST[-1]))) == [0]
    assert acks(op.send(on_wire(LIST[1]))) == [1]


def test_a_repeated_count_is_busy_once_items_have_come() -> None:
    op = operator()
    op.send(MissionCount(len(LIST), 0))
    assert [message.name for message in op.send(MissionCount(len(LIST), 0))] == ["MISSION_REQUEST_INT"]
    op.send(on_wire(LIST[0]))
    assert acks(op.send(MissionCount(len(LIST), 0))) == [1]


def test_a_download_makes_a_count_fail_until_it_is_acknowledged() -> None:
    op = operator()
    op.upload(LIST)
    op.download()
    assert acks(op.send(MissionCount(2, 0))) == [1]
    op.send(MissionAckReceived(0, 0))
    assert op.upload(LIST[:3]) == 0


def test_a_download_that_is_not_acknowledged_times_out() -> None:
    op = operator()
    op.upload(LIST)
    op.download()
    op.run(5.1)
    assert "Operation timeout\t" in op.texts()
    assert op.upload(LIST[:3]) == 0


def test_clear_while_busy_is_a_text_only() -> None:
    op = operator()
    op.send(MissionCount(2, 0))
    assert acks(op.send(MissionClearAll(0))) == []
    assert op.texts() == ["WPM: IGN CLEAR CMD: Busy\t"]


def test_clear_empties_the_list() -> None:
    op = operator()
    op.upload(LIST)
    assert acks(op.send(MissionClearAll(0))) == [0]
    current = op.mission_current()
    assert (current["total"], current["mission_state"], current["mission_id"]) == (65535, 1, 0)


def test_count_0_empties_the_list() -> None:
    op = operator()
    op.upload(LIST)
    assert acks(op.send(MissionCount(0, 0))) == [0]
    assert op.vehicle.store.items == ()


def test_a_question_for_an_item_without_a_list_request_is_not_answered() -> None:
    op = operator()
    op.upload(LIST)
    assert op.send(MissionRequest(0, 0, integer=True)) == []


def test_a_question_for_an_item_out_of_turn_ends_the_download() -> None:
    op = operator()
    op.upload(LIST)
    op.send(MissionRequestList(0))
    assert acks(op.send(MissionRequest(2, 0, integer=True))) == [1]
    assert op.texts() == ["WPM: REJ. CMD: Req. WP was unexpected\t"]
    assert op.send(MissionRequest(0, 0, integer=True)) == []


def test_during_a_download_an_upload_is_refused_and_so_is_an_item() -> None:
    op = operator()
    op.upload(LIST)
    op.send(MissionRequestList(0))
    assert acks(op.send(MissionCount(2, 0))) == [1]
    assert acks(op.send(on_wire(LIST[0]))) == [1]
    assert op.texts() == ["WPM: IGN MISSION_COUNT: Busy\t", "IGN MISSION_ITEM: Busy\t"]
    assert op.send(MissionRequestList(0), OTHER)[0].name == "STATUSTEXT"


def test_it_asks_on_in_the_flavour_that_it_was_answered_in() -> None:
    op = operator()
    assert op.send(MissionCount(3, 0))[0].name == "MISSION_REQUEST_INT"
    assert op.send(replace(on_wire(LIST[0]), integer=False))[0].name == "MISSION_REQUEST"
    assert op.send(on_wire(LIST[1]))[0].name == "MISSION_REQUEST_INT"


def test_the_index_is_not_changed_by_message_while_a_transfer_runs() -> None:
    op = operator()
    op.upload(LIST)
    op.send(MissionCount(2, 0))
    op.send(MissionSetCurrent(3))
    assert op.mission_current()["seq"] == 0
