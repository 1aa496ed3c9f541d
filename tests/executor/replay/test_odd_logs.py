"""Logs with nothing to follow say why, and logs of several flights are no flight with gaps."""

from __future__ import annotations

import struct
from pathlib import Path

import pytest
from pymavlink.dialects.v20 import common as mav

from executor.adapters.logs.dataflash import DataFlashFile
from executor.adapters.mavlink.tlog_reader import TelemetryFile
from executor.cli import main
from executor.errors import LogError
from executor.replay.log_replay import build_replay_rules, replay_log
from executor.replay.open_log import open_log
from executor.replay.replay_result import LogReplay
from tests.onboard import DataFlashWriter
from tests.recorded import Writer, battery, flight, heartbeat, position, station


def replayed(writer: Writer, tmp_path: Path) -> LogReplay:
    path = writer.write(tmp_path / "a.tlog")
    return replay_log(TelemetryFile(path), build_replay_rules(None))


def test_an_empty_log(tmp_path: Path) -> None:
    assert "it is empty" in replayed(Writer(), tmp_path).notes


def test_only_a_ground_station(tmp_path: Path) -> None:
    writer = Writer()
    writer.say(0.0, 255, station())
    assert "only ground stations were recorded" in replayed(writer, tmp_path).notes


def test_a_vehicle_that_never_says_what_it_is(tmp_path: Path) -> None:
    writer = Writer()
    for second in range(5):
        writer.say(float(second), 7, position(second))
    assert "no HEARTBEAT of an autopilot in it; heard were the systems 7" in replayed(writer, tmp_path).notes


def test_no_frame_at_all(tmp_path: Path) -> None:
    (tmp_path / "a.tlog").write_bytes(bytes(3000))
    found = replay_log(TelemetryFile(tmp_path / "a.tlog"), build_replay_rules(None))
    assert "there is no MAVLink frame in it" in found.notes
    assert found.skipped.garbage_runs >= 1


def test_a_copter_that_says_at_first_that_it_is_anything(tmp_path: Path) -> None:
    writer = Writer()
    writer.say(0.0, 7, heartbeat(armed=False, kind=0))
    writer.say(0.5, 7, battery(90))
    for second in range(1, 5):
        writer.say(float(second), 7, heartbeat())
    found = replayed(writer, tmp_path)
    assert [one.sysid for one in found.vehicles] == [7]
    assert not any("not followed" in note for note in found.notes)
    assert found.skipped.not_followed == 2


def test_one_that_never_arms(tmp_path: Path) -> None:
    writer = Writer()
    for second in range(9):
        writer.say(float(second), 7, heartbeat(armed=False))
    assert replayed(writer, tmp_path).notes == ("7 is never armed in it",)


def test_parameters_that_come_first_are_kept(tmp_path: Path) -> None:
    writer = DataFlashWriter()
    for capacity in (5100.0, 5200.0):
        writer.say("PARM", "QNf", "TimeUS,Name,Value", 1_000_000, "BATT_CAPACITY", capacity)
    writer.say("MODE", "QMBB", "TimeUS,Mode,ModeNum,Rsn", 2_000_000, 3, 3, 1)
    path = writer.write(tmp_path / "a.BIN")
    assert not replay_log(DataFlashFile(path), build_replay_rules(None)).skipped


@pytest.mark.parametrize("later_s", [7200.0, -7200.0])
def test_two_flights_in_one_log(later_s: float, tmp_path: Path) -> None:
    first, second = Writer(), Writer()
    for writer, from_s in ((first, 10_000.0), (second, 10_000.0 + later_s)):
        flight(writer, 3, range(60))
        writer.say(60.5, 3, heartbeat(armed=False))
        writer.records = [(from_s + at_s, frame) for at_s, frame in writer.records]
    path = tmp_path / "a.tlog"
    path.write_bytes(first.data() + second.data())
    found = replay_log(TelemetryFile(path), build_replay_rules(None))
    [vehicle] = found.vehicles
    assert vehicle.declarations == ()
    assert vehicle.flown_s == pytest.approx(120, abs=6)
    assert (found.skipped.gaps, found.skipped.time_back) == ((1, 0) if later_s > 0 else (0, 1))


def test_mavlink_without_times_is_named(tmp_path: Path) -> None:
    sender = mav.MAVLink(None, srcSystem=7, srcComponent=1)
    (tmp_path / "a.raw").write_bytes(b"".join(bytes(heartbeat().pack(sender)) for _ in range(9)))
    with pytest.raises(LogError, match="without times"):
        open_log(tmp_path / "a.raw")


def test_a_log_is_known_by_what_it_holds(tmp_path: Path) -> None:
    writer = DataFlashWriter()
    writer.say("MODE", "QMBB", "TimeUS,Mode,ModeNum,Rsn", 2_000_000, 3, 3, 1)
    telemetry = Writer()
    flight(telemetry, 3, range(3))
    for path, on_board in (
        (writer.write(tmp_path / "one.log"), True),
        (writer.write_text(tmp_path / "two.txt"), True),
        (telemetry.write(tmp_path / "three.log"), False),
    ):
        opened = open_log(path)
        assert opened.on_board is on_board
        assert replay_log(opened, build_replay_rules(None)).vehicles
    (tmp_path / "four.log").write_text("2024-01-01 something else\n" * 50)
    with pytest.raises(LogError, match="expected a telemetry log"):
        open_log(tmp_path / "four.log")


def test_of_many_logs_one_that_cannot_be_read_costs_no_other(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    telemetry = Writer()
    flight(telemetry, 3, range(3))
    telemetry.write(tmp_path / "one.tlog")
    (tmp_path / "two.BIN").write_bytes(b"\xa3\x95 nothing of the kind")
    telemetry.write(tmp_path / "three.log")
    (tmp_path / "four.log").write_text("2024-01-01 something else\n")
    with pytest.raises(SystemExit) as left:
        main.main(["replay", str(tmp_path)])
    assert not left.value.code
    said = capsys.readouterr().out
    assert "describes none of its records" in said
    assert "three.log" in said
    assert "four.log" not in said


def test_a_stamp_alone_is_cut_off(tmp_path: Path) -> None:
    writer = Writer()
    flight(writer, 3, range(3))
    (tmp_path / "a.tlog").write_bytes(writer.data() + struct.pack(">Q", 5))
    assert replay_log(TelemetryFile(tmp_path / "a.tlog"), build_replay_rules(None)).skipped.truncated == 1
