"""ArduPilot's side of the mission protocol, as measured."""

from __future__ import annotations

from dataclasses import replace

from missions.items import Command, Frame
from simulator.config import AutopilotKind
from simulator.messages import (
    MissionAckReceived,
    MissionClearAll,
    MissionCount,
    MissionRequest,
    MissionRequestList,
    MissionWritePartialList,
    Outbound,
)
from tests.simulator.harness import (
    BRAKE,
    OTHER,
    Operator,
    fields_of,
    land,
    numbered,
    on_wire,
    rtl,
    speed,
    takeoff,
    waypoint,
)

LIST = numbered((waypoint(0, 0, 0.0), takeoff(), speed(5), waypoint(100, 0, hold_s=1.5), land(), rtl()))


def operator() -> Operator:
    return Operator(AutopilotKind.ARDUPILOT)


def acks(messages: list[Outbound]) -> list[object]:
    return [fields_of(message)["type"] for message in messages if message.name == "MISSION_ACK"]


def test_it_asks_with_the_old_mission_request_and_takes_items_int() -> None:
    op = operator()
    asked = op.send(MissionCount(len(LIST), 0))
    assert [message.name for message in asked] == ["MISSION_REQUEST"]
    assert op.upload(LIST) == 0
    assert op.texts() == ["Flight plan received"]


def test_item_0_reads_back_as_its_own_home() -> None:
    op = operator()
    op.upload(numbered((waypoint(500, 500, 9.0), *LIST[1:])))
    home = op.download()[0]
    assert (home["x"], home["y"]) == op.vehicle.home.lat_lon_e7(0, 0)
    assert (home["z"], home["frame"]) == (300.0, 0)


def test_a_part_is_replaced_and_the_rest_stays() -> None:
    op = operator()
    op.upload(LIST)
    [asked] = op.send(MissionWritePartialList(3, 3, 0))
    assert (asked.name, asked.fields["seq"]) == ("MISSION_REQUEST", 3)
    higher = replace(LIST[3], z=33.0)
    assert [answer.fields.get("type") for answer in op.send(on_wire(higher)) if answer.name == "MISSION_ACK"] == [0]
    back = op.download()
    assert [item["command"] for item in back] == [item.command for item in LIST]
    assert [item["z"] for item in back][3] == 33.0
    refused = op.send(MissionWritePartialList(3, len(LIST) + 1, 0))
    assert [answer.fields["type"] for answer in refused if answer.name == "MISSION_ACK"] == [1]


def test_read_back_rewrites_frames_current_and_params() -> None:
    op = operator()
    flagged = tuple(replace(item, current=item.seq == 1) for item in LIST)
    flagged = (*flagged[:3], replace(flagged[3], frame=Frame.GLOBAL_RELATIVE_ALT_INT, z=25.004), *flagged[4:])
    assert op.upload(flagged) == 0
    back = op.download()
    assert [item["command"] for item in back] == [item.command for item in LIST]
    assert {item["current"] for item in back} == {0}
    assert back[2]["frame"] == 0  # DO_CHANGE_SPEED
    assert back[5]["frame"] == 0  # RTL
    assert back[3]["frame"] == 3
    assert back[3]["z"] == 25.0  # centimetres
    assert back[3]["param1"] == 1.0  # whole seconds
    assert back[4]["param4"] == 1.0


def test_a_missing_item_is_asked_for_again_after_a_second() -> None:
    op = operator()
    op.send(MissionCount(3, 0))
    op.run(0.9)
    assert op.sent("MISSION_REQUEST", 0.5) == []
    op.run(0.2)
    assert [fields["seq"] for fields in op.sent("MISSION_REQUEST", 0.5)] == [0]


def test_a_duplicate_brings_ack_13_while_the_upload_continues() -> None:
    op = operator()
    op.send(MissionCount(len(LIST), 0))
    op.send(on_wire(LIST[0]))
    assert acks(op.send(on_wire(LIST[0]))) == [13]
    answers = op.send(on_wire(LIST[1]))
    assert [fields_of(message)["seq"] for message in answers if message.name == "MISSION_REQUEST"] == [2]


def test_eight_seconds_without_an_item_end_it_with_ack_15_and_a_text() -> None:
    op = operator()
    op.send(MissionCount(len(LIST), 0))
    op.send(on_wire(LIST[0]))
    op.run(7.9)
    assert op.sent("MISSION_ACK") == []
    op.run(0.2)
    assert [fields["type"] for fields in op.sent("MISSION_ACK")] == [15]
    assert "Mission upload timeout" in op.texts()


def test_where_a_busy_computer_may_be_silent_an_upload_is_not_given_up_sooner() -> None:
    op = Operator(AutopilotKind.ARDUPILOT, {"transfer_patience_s": 60.0})
    op.send(MissionCount(len(LIST), 0))
    op.run(59.5)
    assert op.sent("MISSION_ACK") == []
    op.run(1.0)
    assert [fields["type"] for fields in op.sent("MISSION_ACK")] == [15]


def test_a_second_ground_station_gets_ack_14_for_upload_and_download() -> None:
    op = operator()
    op.send(MissionCount(len(LIST), 0))
    assert acks(op.send(MissionCount(2, 0), OTHER)) == [14]
    assert acks(op.send(MissionRequestList(0), OTHER)) == [14]
    assert acks(op.send(MissionRequest(0, 0, integer=True), OTHER)) == [14]
    assert op.upload(LIST) == 0


def test_the_same_partner_may_start_again() -> None:
    op = operator()
    op.send(MissionCount(len(LIST), 0))
    op.send(on_wire(LIST[0]))
    answers = op.send(MissionCount(2, 0))
    assert [fields_of(message)["seq"] for message in answers] == [0]


def test_an_upload_is_not_atomic() -> None:
    op = operator()
    op.upload(LIST)
    newer = numbered((waypoint(0, 0, 0.0), waypoint(1, 1), waypoint(2, 2), waypoint(3, 3)))
    op.send(MissionCount(4, 0))
    assert len(op.vehicle.store.items) == 4  # cut off at the count already
    op.send(on_wire(newer[0]))
    op.send(on_wire(newer[1]))
    op.run(10)
    mixture = op.vehicle.store.items
    assert [item.command for item in mixture] == [Command.NAV_WAYPOINT] * 2 + [Command.DO_CHANGE_SPEED] + [
        Command.NAV_WAYPOINT
    ]


def test_a_cancellation_is_not_understood() -> None:
    op = operator()
    op.send(MissionCount(len(LIST), 0))
    assert op.send(MissionAckReceived(15, 0)) == []
    assert fields_of(op.send(on_wire(LIST[0]))[0])["seq"] == 1


def test_clear_and_count_0_empty_the_list_on_the_ground() -> None:
    op = operator()
    for clearing in (MissionClearAll(0), MissionCount(0, 0)):
        op.upload(LIST)
        assert acks(op.send(clearing)) == [0]
        assert op.vehicle.store.items == ()
        assert op.mission_current()["mission_state"] == 1


def test_clear_all_in_auto_is_refused_and_count_0_is_not() -> None:
    op = operator()
    op.fly(numbered((waypoint(0, 0, 0.0), takeoff(), waypoint(200, 0), waypoint(400, 0))))
    op.run(30)
    assert acks(op.send(MissionClearAll(0))) == [1]
    assert len(op.vehicle.store.items) == 4
    assert acks(op.send(MissionCount(0, 0))) == [0]
    place = op.vehicle.frame.body.place
    op.run(5)
    assert op.vehicle.frame.body.north_m > place.north_m + 20  # flies on to its old waypoint


def test_clear_all_in_brake_is_accepted() -> None:
    op = operator()
    op.fly(numbered((waypoint(0, 0, 0.0), takeoff(), waypoint(200, 0), waypoint(400, 0))))
    op.run(30)
    op.mode(BRAKE)
    assert acks(op.send(MissionClearAll(0))) == [0]
    assert op.mission_current()["seq"] == 0


def test_an_item_without_an_upload_is_an_error() -> None:
    assert acks(operator().send(on_wire(LIST[1]))) == [1]


def test_unknown_commands_and_frames_end_the_upload() -> None:
    for bad, result in ((replace(LIST[1], command=84), 3), (replace(LIST[1], frame=99), 2)):
        op = operator()
        assert op.upload((LIST[0], bad, *LIST[2:])) == result
        assert acks(op.send(on_wire(LIST[1]))) == [1]


def test_too_many_items_are_refused_with_a_text() -> None:
    op = operator()
    assert acks(op.send(MissionCount(5000, 0))) == [4]
    assert "Only 650 items are supported" in op.texts()


def test_a_list_that_is_not_known_is_unsupported() -> None:
    assert acks(operator().send(MissionCount(3, 3))) == [3]


def test_the_older_item_message_is_sent_on_request() -> None:
    op = operator()
    op.upload(LIST)
    answer, advice = op.send(MissionRequest(3, 0, integer=False))
    assert advice.name == "STATUSTEXT"
    assert [message.name for message in op.send(MissionRequest(3, 0, integer=False))] == ["MISSION_ITEM"]
    fields = fields_of(answer)
    assert answer.name == "MISSION_ITEM"
    assert isinstance(fields["x"], float)
    assert abs(fields["x"] - LIST[3].x * 1e-7) < 1e-9
