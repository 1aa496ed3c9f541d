"""Whatever bytes a log holds, it is read as far as it goes, or one line says what it is not."""

from __future__ import annotations

import tempfile
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from executor.errors import LogError
from executor.replay.log_replay import build_replay_rules, replay_log
from executor.replay.open_log import open_log
from tests.onboard import DataFlashWriter, UlogWriter
from tests.recorded import Writer, flight

SECOND = 1_000_000


def dataflash() -> DataFlashWriter:
    writer = DataFlashWriter()
    writer.say("PARM", "QNf", "TimeUS,Name,Value", SECOND, "SYSID_THISMAV", 4.0)
    writer.say("MSG", "QZ", "TimeUS,Message", SECOND, "ArduCopter V4.5.1")
    writer.say("MODE", "QMBB", "TimeUS,Mode,ModeNum,Rsn", SECOND, 3, 3, 1)
    writer.say("EV", "QB", "TimeUS,Id", SECOND, 10)
    for tick in range(1, 60):
        at_usec = tick * SECOND // 2
        writer.say("BAT", "QBfffB", "TimeUS,Inst,Volt,Curr,CurrTot,RemPct", at_usec, 0, 15.0, 20.0, tick * 3.0, 90)
        writer.say("POS", "QLLff", "TimeUS,Lat,Lng,Alt,RelHomeAlt", at_usec, 47.0, 8.0, 500.0, 20.0)
        writer.say("ATT", "Qcc", "TimeUS,Roll,Pitch", at_usec, 3.0, -2.0)
        gps = "TimeUS,I,Status,NSats,Lat,Lng,Alt,Spd,GCrs,VZ"
        writer.say("GPS", "QBBBLLefff", gps, at_usec, 0, 3, 12, 47.0, 8.0, 500.0, 3.0, 90.0, 0.1)
        writer.say("RCIN", "QHHHHH", "TimeUS,C1,C2,C3,C4,C5", at_usec, 1500, 1500, 1500, 1500, 1800)
    writer.say("ERR", "QBB", "TimeUS,Subsys,ECode", 30 * SECOND, 12, 1)
    return writer


def ulog() -> bytes:
    topics = {
        "vehicle_status": [("nav_state", "uint8_t"), ("arming_state", "uint8_t"), ("failsafe", "uint8_t")],
        "battery_status": [("voltage_v", "float"), ("current_a", "float"), ("remaining", "float")],
        "vehicle_global_position": [("lat", "double"), ("lon", "double"), ("alt", "float")],
        "vehicle_attitude": [(f"q[{one}]", "float") for one in range(4)],
        "vehicle_command": [("param2", "float"), ("param3", "float"), ("command", "uint32_t")],
    }
    writer = UlogWriter(topics, {"BAT1_CAPACITY": 5000.0})
    for tick in range(1, 60):
        at_usec = tick * SECOND // 2
        writer.say(at_usec, "vehicle_status", nav_state=3, arming_state=2)
        writer.say(at_usec, "battery_status", voltage_v=15.0, current_a=20.0, remaining=0.9)
        writer.say(at_usec, "vehicle_global_position", lat=47.0, lon=8.0, alt=500.0)
        writer.say(at_usec, "vehicle_attitude", **{"q[0]": 1.0})
        writer.say(at_usec, "vehicle_command", command=176, param2=4.0)
    writer.text(20 * SECOND, "Low battery")
    return writer.data()


def text() -> bytes:
    with tempfile.TemporaryDirectory() as folder:
        return dataflash().write_text(Path(folder) / "a.log").read_bytes()


def telemetry() -> bytes:
    writer = Writer()
    flight(writer, 3, range(40))
    return writer.data()


LOGS = {".BIN": dataflash().data(), ".ulg": ulog(), ".log": text(), ".tlog": telemetry()}


def is_explained(path: Path) -> bool:
    """Return whether somebody is followed, or it is said why nobody is."""
    try:
        opened = open_log(path)
        found = replay_log(opened, build_replay_rules(None))
    except LogError as error:
        return str(path) in str(error)
    return bool(found.vehicles or found.notes)


MOMENT = st.floats(0, 1, exclude_max=True)


@pytest.mark.parametrize("suffix", LOGS)
@settings(max_examples=60, deadline=None)
@given(
    flips=st.lists(st.tuples(MOMENT, st.integers(0, 7)), max_size=30),
    cut=st.tuples(MOMENT, MOMENT),
    noise=st.tuples(MOMENT, st.binary(max_size=200)),
    copies=st.integers(1, 3),
)
def test_no_damage_is_a_defect_of_ours(
    suffix: str,
    flips: list[tuple[float, int]],
    cut: tuple[float, float],
    noise: tuple[float, bytes],
    copies: int,
) -> None:
    whole = LOGS[suffix]
    data = bytearray(whole)
    for at, bit in flips:
        data[int(at * len(data))] ^= 1 << bit
    at = int(noise[0] * len(data))
    data[at:at] = noise[1]
    first, second = sorted(int(share * len(data)) for share in cut)
    damaged = bytes(data[:second] if copies == 1 else data[first:] if copies == 2 else bytes(data) + whole)
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / f"a{suffix}"
        path.write_bytes(damaged)
        assert is_explained(path)


@pytest.mark.parametrize("suffix", LOGS)
@settings(max_examples=40, deadline=None)
@given(content=st.binary(max_size=2000))
def test_no_bytes_are(suffix: str, content: bytes) -> None:
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / f"a{suffix}"
        path.write_bytes(LOGS[suffix][:16] + content)
        assert is_explained(path)


@pytest.mark.parametrize("suffix", LOGS)
def test_an_undamaged_log_is_followed(suffix: str, tmp_path: Path) -> None:
    path = tmp_path / f"a{suffix}"
    path.write_bytes(LOGS[suffix])
    opened = open_log(path)
    [vehicle] = replay_log(opened, build_replay_rules(None)).vehicles
    assert vehicle.flown_s > 25
