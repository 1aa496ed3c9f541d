"""The wire: every message that the simulator sends is one that MAVLink has, and identities travel."""

from __future__ import annotations

import struct

import pytest
from pymavlink.dialects.v20 import ardupilotmega as dialect

from simulator import messages
from simulator.config import AutopilotKind, Signing
from simulator.messages import (
    MissionRequest,
    ParamRequestRead,
    Ping,
    RequestDataStream,
    Timesync,
    VehicleOutbox,
    build_message,
)
from simulator.streams import MESSAGE_IDS
from simulator.wire import READERS, Codec
from tests.simulator.harness import Operator, numbered, rtl, speed, takeoff, waypoint


def parse(frame: bytes) -> dialect.MAVLink_message:
    parser = dialect.MAVLink(None)
    (message,) = parser.parse_buffer(frame)
    return message


@pytest.mark.parametrize("kind", list(AutopilotKind))
def test_every_message_of_a_flight_packs_and_reads_back(kind: AutopilotKind) -> None:
    op = Operator(kind)
    op.send(RequestDataStream(0, 1, start=True))
    route = (takeoff(), speed(5), waypoint(30, 0), rtl())
    op.fly(numbered((waypoint(0, 0, 0.0), *route) if kind is AutopilotKind.ARDUPILOT else route, 0))
    op.download()
    op.send(MissionRequest(1, 0, integer=False))
    op.send(ParamRequestRead("", 0))
    op.send(Timesync(0, 123))
    op.send(Ping(1, 2, 0))
    op.command(messages.MavCommand.GET_MESSAGE_INTERVAL, 33)
    op.run(10)
    for number in MESSAGE_IDS.values():
        op.command(messages.MavCommand.REQUEST_MESSAGE, number)
    op.run_until(lambda: not op.vehicle.frame.armed)
    others = (
        {"EKF_STATUS_REPORT", "WIND", "FENCE_STATUS"} if kind is AutopilotKind.PX4 else {"WIND_COV", "ESTIMATOR_STATUS"}
    )
    # Other tests ask for it while it circles.
    others |= {*op.vehicle.UNKNOWN, "ORBIT_EXECUTION_STATUS"}
    expected = set(MESSAGE_IDS) - others
    codec, seen = Codec(11), set()
    for _, message in op.log:
        frame = codec.encode(message)
        decoded = parse(frame)
        assert decoded.get_type() == message.name
        assert frame[0] == 0xFD
        seen.add(message.name)
    assert seen >= {*expected, "COMMAND_ACK", "MISSION_ACK", "MISSION_COUNT", "MISSION_ITEM_INT", "PARAM_VALUE",
                    "MISSION_ITEM_REACHED", "STATUSTEXT", "PING", "MESSAGE_INTERVAL"}  # fmt: skip


@pytest.mark.parametrize(
    ("message", "position"),
    [
        (build_message("MISSION_CURRENT", seq=3, total=9, mission_state=3, mission_mode=1, mission_id=0x12345678), 6),
        (
            build_message(
                "MISSION_ACK", target_system=255, target_component=190, type=0, mission_type=0, opaque_id=0x12345678
            ),
            4,
        ),
        (
            build_message(
                "MISSION_COUNT", target_system=255, target_component=190, count=7, mission_type=0, opaque_id=0x12345678
            ),
            5,
        ),
    ],
)
def test_the_missions_identity_is_behind_the_fields_that_pymavlink_knows(message: object, position: int) -> None:
    assert isinstance(message, type(build_message("PING")))
    frame = Codec(11).encode(message)
    decoded = parse(frame)
    assert decoded.get_type() == message.name
    payload = frame[10:-2]
    assert struct.unpack_from("<I", payload.ljust(position + 4, b"\0"), position) == (0x12345678,)
    for name, value in message.fields.items():
        if name not in {"opaque_id", "mission_id"}:
            assert getattr(decoded, name) == value


def test_sequence_numbers_count_every_message() -> None:
    codec = Codec(11)
    heartbeat = build_message("MISSION_CURRENT", seq=0, total=0, mission_state=1, mission_mode=0, mission_id=0)
    extended = build_message("MISSION_CURRENT", seq=0, total=0, mission_state=1, mission_mode=0, mission_id=9)
    seqs = [parse(codec.encode(message)).get_seq() for message in (heartbeat, extended) * 150]
    assert seqs == [number % 256 for number in range(300)]


def test_a_message_that_mavlink_does_not_have_is_refused() -> None:
    with pytest.raises(AttributeError):
        Codec(1).encode(build_message("NO_SUCH_MESSAGE"))
    with pytest.raises(TypeError):
        Codec(1).encode(build_message("PING", no_such_field=1))


def test_numbers_are_pymavlinks() -> None:
    for name, number in MESSAGE_IDS.items():
        assert getattr(dialect, f"MAVLINK_MSG_ID_{name}") == number
    prefixes = {
        "MavCommand": "MAV_CMD_",
        "Result": "MAV_RESULT_",
        "MissionResult": "MAV_MISSION_",
        "Severity": "MAV_SEVERITY_",
        "MissionState": "MISSION_STATE_",
        "LandedState": "MAV_LANDED_STATE_",
    }
    for enum_name, prefix in prefixes.items():
        for member in getattr(messages, enum_name):
            assert getattr(dialect, prefix + member.name) == member.value
    for name in READERS:
        assert hasattr(dialect, f"MAVLink_{name.lower()}_message")


@pytest.mark.parametrize("length", [0, 1, 49, 50, 51, 99, 100, 101])
def test_texts_of_every_length_come_whole(length: int) -> None:
    text = "x" * length
    outbox = VehicleOutbox(tab=False)
    outbox.send_text(6, text)
    parts = [message.fields for _, message in outbox.drain()]
    raw = [part["text"] for part in parts]
    assert b"".join(part for part in raw if isinstance(part, bytes)).decode() == text
    assert [part["chunk_seq"] for part in parts] == list(range(len(parts)))
    assert all(part["id"] == (1 if len(parts) > 1 else 0) for part in parts)
    last = raw[-1]
    assert isinstance(last, bytes)
    assert len(parts) == 1 or len(last) < 50


def test_a_signature_that_a_radio_has_damaged_makes_no_later_frame_an_old_one() -> None:
    """Its report overwrites the time in it, which no checksum covers: the vehicle heard nothing any more."""
    key = bytes(range(32))
    ground, vehicle = Codec(255, component=190, signing=Signing(key, 0)), Codec(1, signing=Signing(key, 0))
    frames = [
        ground.encode(build_message("PING", time_usec=0, seq=seq, target_system=1, target_component=1), 1.0)
        for seq in range(3)
    ]
    damaged = frames[1][:-12] + b"\xff" * 6 + frames[1][-6:]
    assert [len(vehicle.decode(frame)) for frame in (frames[0], damaged, frames[2])] == [1, 0, 1]
