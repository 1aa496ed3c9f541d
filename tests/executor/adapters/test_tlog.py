"""Recorded frames, as other programs read them."""

from __future__ import annotations

from pathlib import Path

import pytest
from pymavlink import mavutil
from pymavlink.dialects.v20 import common as mav

from executor.adapters.mavlink.codec import Codec
from executor.adapters.tlog import TelemetryLog
from executor.core.messages import SendMissionCount
from tests.executor.adapters.test_codec import Vehicle

BEGAN_USEC = 1_790_000_000_000_000


def test_pymavlink_reads_both_directions_with_their_times(tmp_path: Path) -> None:
    stamps = iter(range(BEGAN_USEC, BEGAN_USEC + 10_000_000, 500_000))
    log = TelemetryLog(tmp_path / "uav1.tlog", lambda: next(stamps))
    vehicle = Vehicle()
    log.write(vehicle.pack(mav.MAVLink_heartbeat_message(2, 3, 0, 0, 3, 3)))
    log.write(Codec().encode(SendMissionCount(4), 7, 1))
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
    assert log.lost == 0


def test_a_log_is_carried_on(tmp_path: Path) -> None:
    for _ in range(2):
        log = TelemetryLog(tmp_path / "uav1.tlog", lambda: BEGAN_USEC)
        log.write(b"frame")
        log.close()
    assert (tmp_path / "uav1.tlog").read_bytes() == 2 * (BEGAN_USEC.to_bytes(8, "big") + b"frame")


def test_a_full_disk_ends_no_flight() -> None:
    """/dev/full takes nothing: every write of more than the buffer fails."""
    log = TelemetryLog(Path("/dev/full"), lambda: BEGAN_USEC)
    log.write(bytes(100_000))
    log.close()
    assert log.lost > 0
