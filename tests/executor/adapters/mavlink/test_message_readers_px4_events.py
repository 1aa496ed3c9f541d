"""PX4's events on a link and in telemetry logs: pymavlink's dialect does not have their message."""

from __future__ import annotations

import struct
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import pytest
from pymavlink.dialects.v20 import common as mav

from executor.adapters.logs.ulog import UlogFile
from executor.adapters.mavlink import message_readers
from executor.adapters.mavlink.codec import DecodedFrame, FrameParser, MavlinkCodec
from executor.adapters.mavlink.frame_layout import has_valid_checksum
from executor.adapters.mavlink.tlog_reader import TelemetryFile
from executor.core.interface.messages import Actor, Heartbeat, Message, ModeChange, OwnFailsafe
from executor.core.telemetry.mode_evidence import compute_event_id
from tests.onboard import UlogWriter
from tests.recorded import BEGAN_USEC, real_logs

PX4, ARDUPILOT = 12, 3
BATTERY = struct.pack("<IBB", 0, 6, 4)
FAILED = OwnFailsafe("battery", active=True, words="failsafe: critical battery level, switching to RTL")


def fields(name: str, arguments: bytes = b"", sequence: int = 5) -> dict[str, Any]:
    return {
        "id": compute_event_id(name), "event_time_boot_ms": 61500, "sequence": sequence, "destination_component": 0,
        "destination_system": 0, "log_levels": 36, "arguments": list(arguments),
    }  # fmt: skip


def event(name: str, arguments: bytes = b"", sequence: int = 5, component: int = 1) -> bytes:
    frame = message_readers.build_event_frame(fields(name, arguments, sequence), 7, component)
    assert frame is not None
    return frame


def beat(autopilot: int = PX4) -> bytes:
    return bytes(
        mav.MAVLink_heartbeat_message(2, autopilot, 128, 4 << 24 | 4 << 16, 4, 3).pack(mav.MAVLink(None, 7, 1))
    )


ENTERS = event("commander_failsafe_enter", BATTERY)
CURRENT = bytes(mav.MAVLink_mission_current_message(3).pack(mav.MAVLink(None, 7, 1)))


def evidence(*datagrams: bytes, codec: MavlinkCodec | None = None) -> list[Message]:
    codec = codec or MavlinkCodec()
    return told([received for datagram in datagrams for received in codec.decode(datagram)])


def told(frames: Iterable[DecodedFrame]) -> list[Message]:
    said = [one for received in frames for one in (received.message, *received.more)]
    return [one for one in said if isinstance(one, OwnFailsafe | ModeChange)]


def test_what_a_recorded_one_looks_like() -> None:
    """As PX4 1.17 sent it: commander_armed_by, by a mission's start; zeros at the end are left out."""
    recorded = bytes.fromhex("fd0e00009329019a0100f3ca9001a4140000040000006605d2bf")
    [frame] = FrameParser().feed(recorded)
    assert has_valid_checksum(frame.get_msgbuf(), message_readers.EVENT_EXTRA)
    assert recorded[10:14] == struct.pack("<I", compute_event_id("commander_armed_by"))


@pytest.mark.parametrize(
    ("datagrams", "found"),
    [
        ([beat(), ENTERS], [FAILED]),
        ([beat(), ENTERS, ENTERS], [FAILED]),  # another station had missed it
        ([beat(), ENTERS, event("commander_failsafe_enter", BATTERY, 6)], [FAILED, FAILED]),
        ([beat() + ENTERS + CURRENT], [FAILED]),
        ([beat(), event("commander_rc_override")], [ModeChange(None, Actor.PILOT)]),
        ([beat(), event("commander_failsafe_enter", BATTERY, component=100)], []),  # of a camera
        ([beat(ARDUPILOT), ENTERS], []),
        ([ENTERS], []),  # nobody knows whose it is
        ([beat(), event("commander_takeoff_detected")], []),
    ],
)
def test_what_is_heard(datagrams: list[bytes], found: list[Message]) -> None:
    assert evidence(*datagrams) == found


def test_a_frame_with_a_wrong_checksum_is_noise() -> None:
    torn = bytearray(ENTERS)
    torn[20] ^= 1
    codec = MavlinkCodec()
    assert evidence(beat(), codec=codec) == []
    assert [one.frame for one in codec.decode(bytes(torn) + CURRENT)] == [CURRENT]


def test_it_is_read_out_of_a_stream_that_is_cut_anywhere() -> None:
    stream = beat() + b"\x00\xfd\x00" + ENTERS + CURRENT
    for size in (1, 7, 40):
        cutter, codec = FrameParser(), MavlinkCodec()
        frames = [one for at in range(0, len(stream), size) for one in cutter.feed(stream[at : at + size])]
        assert told(codec.read(frames)) == [FAILED]


def test_another_parser_takes_it_apart() -> None:
    codec = MavlinkCodec()
    list(codec.decode(beat()))
    read = codec.read_fields("EVENT", 7, 1, fields("commander_failsafe_enter", BATTERY))
    assert read == (ENTERS, (FAILED,))
    assert codec.read_fields("EVENT", 7, 1, {**fields("commander_rc_override"), "sequence": -1}) is None
    assert codec.read_fields("EVENT", 7, 1, {"id": 5}) is None


def test_in_a_telemetry_log(tmp_path: Path) -> None:
    frames = (beat(), ENTERS, ENTERS, event("commander_rc_override"), event("check_battery_low"), beat())
    stamps = (struct.pack(">Q", BEGAN_USEC + 1_000_000 * second) for second in range(len(frames)))
    path = tmp_path / "a.tlog"
    path.write_bytes(b"".join(stamp + frame for stamp, frame in zip(stamps, frames, strict=True)))
    file = TelemetryFile(path)
    said = [(system, one) for _, system, one in file.read_records() if isinstance(one, OwnFailsafe | ModeChange)]
    assert said == [(7, FAILED), (7, ModeChange(None, Actor.PILOT))]
    assert not file.skipped


def test_in_its_own_log(tmp_path: Path) -> None:
    topics = {
        "vehicle_status": [("nav_state", "uint8_t"), ("arming_state", "uint8_t"), ("failsafe", "uint8_t")],
        "event": [("id", "uint32_t"), *((f"arguments[{one}]", "uint8_t") for one in range(25))],
    }
    writer = UlogWriter(topics)
    for second, mode in ((1, 3), (2, 3), (3, 5), (4, 5), (9, 2)):
        writer.say(second * 1_000_000, "vehicle_status", nav_state=mode, arming_state=2, failsafe=mode == 5)
    arguments = {f"arguments[{place}]": byte for place, byte in enumerate(BATTERY)}
    writer.say(2_900_000, "event", id=compute_event_id("commander_failsafe_enter"), **arguments)
    writer.say(8_900_000, "event", id=compute_event_id("failsafe_rc_override"))
    said = [one for _, _, one in UlogFile(writer.write(tmp_path / "a.ulg")).read_records()]
    assert FAILED in said
    assert [one.by for one in said if isinstance(one, ModeChange)] == [Actor.UNKNOWN, Actor.FAILSAFE, Actor.PILOT]
    assert any(isinstance(one, Heartbeat) for one in said)


@pytest.mark.parametrize("name", ["px4_nominal", "px4_fastdrain"])
def test_a_recorded_flight_says_itself_that_its_mission_is_over(name: str) -> None:
    """The telemetry log has the event; the vehicle's own log says by it, or by its mission, who chose Hold."""
    telemetry, own = TelemetryFile(real_logs() / f"{name}.tlog"), UlogFile(real_logs() / f"{name}.ulg")
    assert [one.by for _, _, one in telemetry.read_records() if isinstance(one, ModeChange)] == [Actor.MISSION]
    said = [one for _, _, one in own.read_records()]
    assert [one for one in said if isinstance(one, OwnFailsafe)] == []
    hold = 3 << 24 | 4 << 16
    assert Actor.MISSION in {one.by for one in said if isinstance(one, ModeChange) and one.custom_mode == hold}
