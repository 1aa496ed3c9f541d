"""Recorded frames, as other programs read them."""

from __future__ import annotations

from pathlib import Path

import pytest
from pymavlink import mavutil
from pymavlink.dialects.v20 import common as mav

from executor.adapters.mavlink.codec import MavlinkCodec
from executor.adapters.mavlink.tlog_writer import TelemetryLog
from executor.core.interface.messages import MissionCount
from tests.executor.adapters.mavlink.test_codec import Vehicle
from tests.fakes.disk import room_for

BEGAN_USEC = 1_790_000_000_000_000


def test_pymavlink_reads_both_directions_with_their_times(tmp_path: Path) -> None:
    stamps = iter(range(BEGAN_USEC, BEGAN_USEC + 10_000_000, 500_000))
    log = TelemetryLog(tmp_path / "uav1.tlog", lambda: next(stamps))
    vehicle = Vehicle()
    log.write(vehicle.pack(mav.MAVLink_heartbeat_message(2, 3, 0, 0, 3, 3)))
    log.write(MavlinkCodec().encode(MissionCount(4), 7, 1))
    log.write(vehicle.pack(mav.MAVLink_mission_request_message(255, 190, 0)))
    log.close()

    reader = mavutil.mavlink_connection(str(tmp_path / "uav1.tlog"))
    read = []
    while (message := reader.recv_match()) is not None:
        read.append((message.get_type(), message.get_srcSystem(), message._timestamp))
    reader.close()
    assert read == [
        ("HEARTBEAT", 7, pytest.approx(BEGAN_USEC / 1e6)),
        ("MISSION_COUNT", 255, pytest.approx(BEGAN_USEC / 1e6 + 0.5)),
        ("MISSION_REQUEST", 7, pytest.approx(BEGAN_USEC / 1e6 + 1.0)),
    ]


def test_a_log_that_is_there_is_left_as_it_is(tmp_path: Path) -> None:
    """Another process may have died in the midst of a frame: what follows is a part of its own."""
    for _ in range(3):
        log = TelemetryLog(tmp_path / "uav1.tlog", lambda: BEGAN_USEC)
        log.write(b"frame")
        log.close()
    once = BEGAN_USEC.to_bytes(8, "big") + b"frame"
    assert {path.name: path.read_bytes() for path in tmp_path.iterdir()} == {
        "uav1.tlog": once, "uav1-1.tlog": once, "uav1-2.tlog": once,
    }  # fmt: skip


def test_a_log_that_has_grown_large_continues_in_the_next_part(tmp_path: Path) -> None:
    log = TelemetryLog(tmp_path / "uav1.tlog", lambda: BEGAN_USEC, most_bytes=30)
    for _ in range(7):
        log.write(b"frame")
    log.close()
    assert sorted((path.name, path.stat().st_size) for path in tmp_path.iterdir()) == [
        ("uav1-1.tlog", 39), ("uav1-2.tlog", 13), ("uav1.tlog", 39),
    ]  # fmt: skip


def test_what_is_a_second_old_outlives_the_process(tmp_path: Path) -> None:
    stamps = iter(range(BEGAN_USEC, BEGAN_USEC + 10_000_000, 400_000))
    log = TelemetryLog(tmp_path / "uav1.tlog", lambda: next(stamps))
    for count in range(8):
        log.write(b"frame")
        assert (tmp_path / "uav1.tlog").stat().st_size >= 13 * (count - 2)
    log.close()


def test_a_full_disk_ends_no_flight_and_tears_no_frame(tmp_path: Path) -> None:
    stamps = iter(range(BEGAN_USEC, BEGAN_USEC + 10**10, 2_000_000))
    log = TelemetryLog(tmp_path / "uav1.tlog", lambda: next(stamps))
    with room_for(40_000):
        for _ in range(60):
            log.write(bytes(992))
    log.write(bytes(992))
    log.close()
    content = (tmp_path / "uav1.tlog").read_bytes()
    assert len(content) % 1000 == 0
    stamps_read = [int.from_bytes(content[at : at + 8], "big") for at in range(0, len(content), 1000)]
    assert stamps_read == sorted(stamps_read)
    assert all(stamp % 2_000_000 == BEGAN_USEC % 2_000_000 for stamp in stamps_read)
    assert 40 <= len(content) // 1000 < 61
