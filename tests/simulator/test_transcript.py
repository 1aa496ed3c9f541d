"""What is written down of a dialogue: no telemetry, frames in pieces put together, each message in a few words."""

from __future__ import annotations

from typing import Any

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mav

from simulator.transcript import Recorder, describe_message, format_transcript

PARAMS = (0, 0, 0, 0, 0, 0, 0)


@pytest.mark.parametrize(
    ("message", "expected"),
    [
        (mav.MAVLink_command_ack_message(400, 4), "COMMAND_ACK COMPONENT_ARM_DISARM FAILED"),
        (mav.MAVLink_command_long_message(1, 1, 400, 0, 1, *PARAMS[1:]), "COMMAND_LONG COMPONENT_ARM_DISARM 1"),
        (mav.MAVLink_command_int_message(1, 1, 0, 31999, 0, 0, 0, 0, 0, 0, 5, 6, 7), "COMMAND_INT 31999 0 0 0 0 5 6 7"),
        (mav.MAVLink_mission_count_message(1, 1, 7, 1), "MISSION_COUNT 7, fence"),
        (mav.MAVLink_mission_request_int_message(1, 1, 3, 2), "MISSION_REQUEST_INT 3, rally points"),
        (mav.MAVLink_mission_ack_message(1, 1, 13), "MISSION_ACK INVALID_SEQUENCE"),
        (mav.MAVLink_mission_item_reached_message(4), "MISSION_ITEM_REACHED 4"),
        (mav.MAVLink_param_set_message(1, 1, b"RTL_ALT", 1500, 6), "PARAM_SET RTL_ALT 1500"),
        (mav.MAVLink_param_request_read_message(1, 1, b"", 9), "PARAM_REQUEST_READ 9"),
        (mav.MAVLink_param_value_message(b"RTL_ALT", 1500, 6, 1, 65535), "PARAM_VALUE RTL_ALT INT32, no index"),
        (mav.MAVLink_statustext_message(4, b"Low battery\t"), "STATUSTEXT 'Low battery'"),
        (
            mav.MAVLink_file_transfer_protocol_message(0, 1, 1, [0, 0, 0, 4, *[0] * 247]),
            "FILE_TRANSFER_PROTOCOL OPENFILERO",
        ),
        (mav.MAVLink_mission_clear_all_message(1, 1), "MISSION_CLEAR_ALL"),
    ],
    ids=str,
)
def test_a_message_in_words(message: Any, expected: str) -> None:
    frame = message.pack(mav.MAVLink(None, srcSystem=1, srcComponent=1))
    [back] = mav.MAVLink(None).parse_buffer(frame)
    assert describe_message(back) == expected


def test_both_sides_are_written_down_with_their_time_and_telemetry_is_not() -> None:
    now_s = [0.0]
    recorder = Recorder("uav1", lambda: now_s[0])
    client, vehicle = mav.MAVLink(None, srcSystem=255, srcComponent=190), mav.MAVLink(None, srcSystem=1)
    recorder.note(mav.MAVLink_heartbeat_message(6, 8, 0, 0, 4, 3).pack(client), True)
    recorder.note(mav.MAVLink_mission_count_message(1, 1, 2).pack(client), True)
    now_s[0] = 1.25
    answer = mav.MAVLink_mission_request_int_message(255, 190, 0).pack(vehicle)
    beat = mav.MAVLink_heartbeat_message(2, 12, 0, 0, 4, 3).pack(vehicle)
    for piece in (beat, beat + answer[:5], answer[5:] + beat[:4], beat[4:], b"\x55\x55"):
        recorder.note(piece, False)
    assert format_transcript(recorder.said) == (
        "     0.00 s  255 -> uav1     MISSION_COUNT 2\n     1.25 s  uav1 -> 255     MISSION_REQUEST_INT 0"
    )
    assert [one.name for one in recorder.said] == ["HEARTBEAT", "MISSION_COUNT", "MISSION_REQUEST_INT"]
