"""DataFlash logs of old firmware, in text, begun in the air, of several flights, without what newer ones have."""

from __future__ import annotations

import io
import random
from contextlib import redirect_stderr, redirect_stdout
from pathlib import Path
from typing import Any, TypeVar

import pytest
from pymavlink import DFReader

from benchmarks.witness.statements import read_log_evidence
from executor.adapters.chunks import PIECE
from executor.adapters.logs.ardupilot_boot import WantedColumns
from executor.adapters.logs.dataflash import BinaryRows, DataFlashFile
from executor.core.interface.messages import Battery, Heartbeat, LandedState, Position, StatusText, VehicleSetting
from executor.core.interface.recorded_log import Record, SkippedRecords
from executor.errors import LogError
from executor.replay.log_replay import build_replay_rules, replay_log
from tests.onboard import DataFlashWriter
from tests.recorded import real_logs

M = TypeVar("M")
SECOND = 1_000_000
MODE = ("MODE", "QMBB", "TimeUS,Mode,ModeNum,Rsn")
EV = ("EV", "QB", "TimeUS,Id")
CTUN = ("CTUN", "Qff", "TimeUS,ThO,Alt")
BAT = ("BAT", "Qfff", "TimeUS,Volt,Curr,CurrTot")
POS = ("POS", "QLLff", "TimeUS,Lat,Lng,Alt,RelHomeAlt")
MSG = ("MSG", "QZ", "TimeUS,Message")
PARM = ("PARM", "QNf", "TimeUS,Name,Value")


def log(*records: tuple[Any, ...]) -> DataFlashWriter:
    writer = DataFlashWriter()
    for record in records:
        writer.say(*record)
    return writer


def read(path: Path, *, text: bool = False) -> tuple[list[Record], DataFlashFile]:
    file = DataFlashFile(path, text=text)
    return list(file.read_records()), file


def of(records: list[Record], kind: type[M]) -> list[tuple[int, M]]:
    return [(t_usec, said) for t_usec, _, said in records if isinstance(said, kind)]


def copter_of_2014() -> DataFlashWriter:
    """Return what ArduCopter 3.2 wrote: milliseconds, whole numbers, no time in modes, events and parameters."""
    gps = "Status,TimeMS,Week,NSats,HDop,Lat,Lng,RelAlt,Alt,Spd,GCrs,VZ,T"
    writer = log(
        ("PARM", "Nf", "Name,Value", "BATT_CAPACITY", 3300.0),
        ("MSG", "Z", "Message", "ArduCopter V3.2 (c8e0f3e1)"),
        ("MODE", "Mh", "Mode,ThrCrs", 0, 450),
    )
    curr = ("CURR", "IhIhhhf", "TimeMS,ThrOut,ThrInt,Volt,Curr,Vcc,CurrTot")
    for second in range(10):
        if second == 2:
            writer.say("EV", "B", "Id", 10)
        t_msec = 60_000 + 1000 * second
        writer.say(*curr, t_msec, 400, 9000, 1152 - second, 1834, 5010, 100.0 + 5 * second)
        place = (47.3977, 8.5456, 12.5, 488.25)
        writer.say("GPS", "BIHBcLLeeEefI", gps, 3, 302_400_000, 1820, 9, 1.2, *place, 3.0, 90.0, -0.5, t_msec)
    return writer


@pytest.mark.parametrize("text", [False, True])
def test_a_log_of_2014(text: bool, tmp_path: Path) -> None:
    writer = copter_of_2014()
    path = writer.write_text(tmp_path / "a.log") if text else writer.write(tmp_path / "a.BIN")
    records, file = read(path, text=text)
    [first, *_] = of(records, Battery)
    assert (first[0], first[1].voltage_v, first[1].consumed_ah) == (60 * SECOND, 11.52, 0.1)
    assert first[1].current_a == pytest.approx(18.34)
    assert first[1].remaining_pct == 96, "of 3.3 Ah, cut off as its autopilot does"
    _, there = of(records, Position)[-1]
    assert there.lat_deg == pytest.approx(47.3977)
    assert there.east_m_s == pytest.approx(3.0)
    assert (there.alt_rel_m, there.alt_msl_m, there.down_m_s) == (12.5, 488.25, -0.5)
    assert there.boot_s == 69.0, "not the satellites' time"
    assert [said for _, said in of(records, VehicleSetting)] == [VehicleSetting("BATT_CAPACITY", 3300.0)]
    assert [(t_usec, beat.armed) for t_usec, beat in of(records, Heartbeat)][:3] == [
        (60 * SECOND, False), (61 * SECOND, False), (61 * SECOND, True),
    ]  # fmt: skip
    assert not file.skipped


def test_a_pack_without_a_percentage_hands_over_its_counter(tmp_path: Path) -> None:
    path = log((*MODE, SECOND, 3, 3, 1), (*BAT, 2 * SECOND, 22.8, 15.5, 640.0)).write(tmp_path / "a.BIN")
    [(_, said)] = of(read(path)[0], Battery)
    assert (said.remaining_pct, said.consumed_ah, said.current_a) == (None, 0.64, 15.5)


def test_a_log_that_begins_in_the_air(tmp_path: Path) -> None:
    rows = [(*CTUN, second * SECOND, 0.42, 20.0) for second in range(1, 8)]
    records, _ = read(log((*MODE, SECOND, 3, 3, 1), *rows).write(tmp_path / "a.BIN"))
    assert [(t_usec // SECOND, beat.armed) for t_usec, beat in of(records, Heartbeat)][:3] == [
        (1, False), (2, False), (3, True),
    ]  # fmt: skip


def test_thrust_does_not_arm_what_was_disarmed(tmp_path: Path) -> None:
    rows = [(*CTUN, second * SECOND, 0.42, 0.0) for second in range(1, 8)]
    records, _ = read(log((*MODE, SECOND, 0, 0, 1), (*EV, SECOND, 11), *rows).write(tmp_path / "a.BIN"))
    assert not any(beat.armed for _, beat in of(records, Heartbeat))


def test_on_the_ground_and_off_it(tmp_path: Path) -> None:
    events = [(*EV, second * SECOND, event) for second, event in ((2, 10), (3, 28), (9, 18), (10, 11))]
    records, _ = read(log((*MODE, SECOND, 0, 0, 1), *events).write(tmp_path / "a.BIN"))
    assert [said.on_ground for _, said in of(records, LandedState)] == [False, True]
    assert [beat.armed for _, beat in of(records, Heartbeat)] == [False, True, True, True, False]


def test_a_log_without_a_mode(tmp_path: Path) -> None:
    rows = [(*BAT, second * SECOND, 15.0, 20.0, 100.0) for second in range(1, 20)]
    records, file = read(log((*EV, SECOND, 10), *rows).write(tmp_path / "a.BIN"))
    assert {(beat.custom_mode, beat.armed) for _, beat in of(records, Heartbeat)} == {(255, True)}
    assert file.notes == ["no MODE in it: its flight mode is unknown"]


@pytest.mark.parametrize(
    ("said", "words"),
    [("ArduPlane V3.8.0", "fixed wing"), ("APMrover2 V2.45", "ground rover"), ("ArduSub V4.1", "submarine")],
)
def test_logs_of_other_writers(said: str, words: str, tmp_path: Path) -> None:
    path = log((*MSG, SECOND, said), (*MODE, SECOND, 3, 3, 1), (*BAT, 2 * SECOND, 15.0, 20.0, 1.0)).write(
        tmp_path / "a.BIN"
    )
    found = replay_log(DataFlashFile(path), build_replay_rules(None))
    assert found.vehicles == ()
    assert any(words in note for note in found.notes)


def test_two_boots_in_one_file(tmp_path: Path) -> None:
    once = log(
        (*MODE, SECOND, 3, 3, 1), *((*EV, at * SECOND, 10) for at in (2, 100)), (*MSG, 100 * SECOND, "one")
    ).data()
    path = tmp_path / "a.BIN"
    path.write_bytes(once + once)
    records, file = read(path)
    beats = of(records, Heartbeat)
    again = next(index for index, (t_usec, _) in enumerate(beats) if index and t_usec < beats[index - 1][0])
    assert [beat.armed for _, beat in beats[again - 1 : again + 2]] == [True, False, True]
    assert not file.skipped
    assert replay_log(DataFlashFile(path), build_replay_rules(None)).skipped.time_back == 1


def test_one_damaged_time_moves_nothing(tmp_path: Path) -> None:
    times = [1, 2, 3, 1 << 40, 4, 5]
    records, file = read(
        log((*MODE, SECOND, 3, 3, 1), *((*BAT, at * SECOND, 15.0, 1.0, 1.0) for at in times)).write(tmp_path / "a.BIN")
    )
    assert [t_usec // SECOND for t_usec, _ in of(records, Battery)] == [1, 2, 3, 4, 5]
    assert file.skipped.impossible == 1


def test_a_log_that_pauses_for_an_hour_loses_nothing(tmp_path: Path) -> None:
    times = [1, 2, 3600, 3601]
    records, file = read(
        log((*MODE, SECOND, 3, 3, 1), *((*MSG, at * SECOND, str(at)) for at in times)).write(tmp_path / "a.BIN")
    )
    assert [said.text for _, said in of(records, StatusText)] == ["1", "2", "3600", "3601"]
    assert not file.skipped


def test_logs_of_px4_before_ulog_are_named(tmp_path: Path) -> None:
    rows = [
        ("TIME", "Q", "StartTime", 5),
        ("STAT", "B", "MainState", 1),
        ("GPOS", "LLf", "Lat,Lon,Alt", 47.0, 8.0, 1.0),
    ]
    records, file = read(log(*rows).write(tmp_path / "a.bin"))
    assert records == []
    assert file.notes == ["it is a log of PX4 before version 1.5 (sdlog2), which is not read"]


def test_what_describes_nothing_is_no_log(tmp_path: Path) -> None:
    (tmp_path / "a.BIN").write_bytes(random.Random(1).randbytes(5000))
    with pytest.raises(LogError, match="describes none of its records"):
        read(tmp_path / "a.BIN")


def test_padding_is_one_gap(tmp_path: Path) -> None:
    path = tmp_path / "a.BIN"
    path.write_bytes(log((*MODE, SECOND, 3, 3, 1), (*MSG, 2 * SECOND, "the last word")).data() + b"\xff" * 4000)
    records, file = read(path)
    assert [said.text for _, said in of(records, StatusText)] == ["the last word"]
    assert file.skipped.garbage_runs == 1


def test_a_record_that_lost_bytes_is_not_believed(tmp_path: Path) -> None:
    writer = log((*MODE, SECOND, 3, 3, 1), *((*POS, at * SECOND, 47.0, 8.0, 500.0, 10.0) for at in range(1, 9)))
    whole = writer.data()
    at = len(whole) - 3 * len(writer.parts[-1]) - 10
    (tmp_path / "a.BIN").write_bytes(whole[:at] + whole[at + 6 :])
    records, file = read(tmp_path / "a.BIN")
    assert {said.lat_deg for _, said in of(records, Position)} == {47.0}
    assert len(of(records, Position)) == 7
    assert file.skipped.garbage_runs == 1


def test_lines_that_are_none_are_counted(tmp_path: Path) -> None:
    path = copter_of_2014().write_text(tmp_path / "a.log")
    path.write_text(path.read_text() + "what is this\nMODE, 3\nCURR, a, b, c, d, e, f, g\n")
    _, file = read(path, text=True)
    assert (file.skipped.garbage_runs, file.skipped.unreadable) == (1, 2)


def test_a_mode_by_its_name(tmp_path: Path) -> None:
    lines = ["FMT, 3, 6, MODE, Mh, Mode,ThrCrs", "FMT, 9, 0, CURR, Iff, TimeMS,Volt,Curr"]
    lines += [
        "CURR, 1000, 12.1, 3",
        "MODE, AltHold, 500",
        "CURR, 3000, 12.1, 3",
        "MODE, Auto, 500",
        "CURR, 5000, 12.0, 3",
    ]
    (tmp_path / "a.log").write_text("\n".join(lines))
    records, _ = read(tmp_path / "a.log", text=True)
    assert [beat.custom_mode for _, beat in of(records, Heartbeat)] == [2, 2, 3, 3]


NUMBERS = (
    "BAT",
    "POS",
    "GPS",
    "MODE",
    "EV",
    "ERR",
    "RCIN",
    "ATT",
    "PARM",
    "MSG",
    "CURR",
    "NKF1",
    "XKF1",
    "EKF1",
    "CTUN",
)


@pytest.mark.parametrize("name", ["nominal.BIN", "real/erlerobot+logs__pxf_copter_10-11-2014_104.BIN"])
def test_it_reads_what_pymavlink_reads(name: str) -> None:
    path = real_logs() / name
    if not path.exists():
        pytest.skip(f"the log {name} is not in {real_logs()}")
    with redirect_stdout(io.StringIO()), redirect_stderr(io.StringIO()):
        theirs = DFReader.DFReader_binary(str(path), zero_time_base=True)
    columns = {one.name: frozenset(one.columns) for one in theirs.formats.values() if one.name in NUMBERS}
    ours = BinaryRows(path, {kind: WantedColumns(columns[kind]) for kind in columns}, SkippedRecords())
    compared = 0
    for _, kind, fields in ours:
        message = theirs.recv_match(type=list(columns))
        assert message.get_type() == kind
        for column, value in fields.items():
            assert getattr(message, column) == (
                value if isinstance(value, str) else pytest.approx(value, nan_ok=True)
            ), kind
        compared += 1
    assert compared > 3000
    assert theirs.recv_match(type=list(columns)) is None
    theirs.data_map.close()
    theirs.filehandle.close()


def test_a_file_longer_than_a_piece_is_read_the_same(tmp_path: Path) -> None:
    rows = [(*BAT, at * SECOND // 2, 15.0, 20.0, at / 10) for at in range(2, 2 + 3 * PIECE // 20)]
    records, file = read(log((*MODE, SECOND, 3, 3, 1), *rows).write(tmp_path / "a.BIN"))
    assert [said.consumed_ah for _, said in of(records, Battery)] == [pytest.approx(row[-1] / 1e3) for row in rows]
    assert not file.skipped


def copter_of_2013() -> DataFlashWriter:
    """Return what ArduCopter 3.0 wrote: no time of its own anywhere, and the satellites' 0 until there is a fix."""
    gps = "Status,Time,NSats,HDop,Lat,Lng,RelAlt,Alt,Spd,GCrs"
    writer = log(
        ("PARM", "Nf", "Name,Value", "BATT_CAPACITY", 3300.0),
        ("MSG", "Z", "Message", "ArduCopter V3.0.1 (5c6503e2)"),
        ("MODE", "Mh", "Mode,ThrCrs", 0, 450),
    )
    for second in range(90):
        fixed = second >= 20
        for _ in range(100):
            writer.say("ATT", "cccc", "RollIn,Roll,PitchIn,Pitch", 0.0, 1.0, 0.0, 2.0)
        if second == 30:
            writer.say("EV", "B", "Id", 10)
        writer.say("CURR", "hIhhhf", "Thr,ThrInt,Volt,Curr,Vcc,CurrTot", 400, 9000, 1152, 1834, 5010, 5.0 * second)
        writer.say("CTUN", "hcefchhhh", "ThrIn,SonAlt,BarAlt,WPAlt,DesSonAlt,AngBst,CRate,ThrOut,DCRate",
                   400, 0.0, 12.0, 12.0, 0.0, 0, 0, 400 * (second >= 30), 0)  # fmt: skip
        writer.say("GPS", "BIBcLLeeEe", gps, 3 if fixed else 1, (302_400_000 + 1000 * second) * fixed, 9, 1.2,
                   47.3977, 8.5456, 12.5, 488.25, 3.0, 90.0)  # fmt: skip
    return writer


@pytest.mark.parametrize("text", [False, True])
def test_a_log_of_2013_goes_by_the_satellites_clock(text: bool, tmp_path: Path) -> None:
    writer = copter_of_2013()
    path = writer.write_text(tmp_path / "a.log") if text else writer.write(tmp_path / "a.BIN")
    found = replay_log(DataFlashFile(path, text=text), build_replay_rules(None))
    [vehicle] = found.vehicles
    assert found.lasted_s == pytest.approx(70.0, abs=1.0), "from the first fix on"
    assert vehicle.flown_s == pytest.approx(60.0, abs=1.0)
    assert vehicle.declarations == ()


def test_the_judge_reads_a_log_of_2013_too(tmp_path: Path) -> None:
    told = read_log_evidence(copter_of_2013().write(tmp_path / "a.BIN"))[1]
    assert (told.ended_usec - told.began_usec) / SECOND == pytest.approx(70.0, abs=1.0)
    assert [(t_usec - told.began_usec) / SECOND for t_usec, armed in told.armed if armed] == [
        pytest.approx(10.0, abs=1.0)
    ]


def test_the_satellites_time_is_not_taken_for_the_vehicles(tmp_path: Path) -> None:
    """TimeMS of a GPS record of 2014 is that of the week; the judge went by it, and by 0 where there was no fix."""
    told = read_log_evidence(copter_of_2014().write(tmp_path / "a.BIN"))[1]
    assert told.ended_usec == 69 * SECOND
    assert told.moments[0].t_usec == 60 * SECOND
