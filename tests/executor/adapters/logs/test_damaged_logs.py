"""Damaged logs of every kind: what can be read is used, what cannot is counted, and nothing is printed by libraries."""

from __future__ import annotations

import io
import json
import random
import tempfile
from collections.abc import Callable
from contextlib import redirect_stdout
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from executor.adapters.mavlink.tlog_reader import TelemetryFile
from executor.cli import main
from executor.replay.log_replay import build_replay_rules, replay_log
from tests.recorded import Writer, flight, real_logs


def flown() -> bytes:
    writer = Writer()
    flight(writer, 3, range(60))
    flight(writer, 4, range(30, 60))
    return writer.data()


FLOWN = flown()
MOMENTS = st.integers(0, len(FLOWN) - 1)


@settings(max_examples=40, deadline=None)
@given(
    cut=MOMENTS,
    flips=st.lists(st.tuples(MOMENTS, st.integers(0, 7)), max_size=12),
    inserted=st.tuples(MOMENTS, st.binary(max_size=300)),
)
def test_no_damage_stops_the_reader(
    cut: int, flips: list[tuple[int, int]], inserted: tuple[int, bytes]
) -> None:  # fmt: skip
    data = bytearray(FLOWN)
    for at, bit in flips:
        data[at] ^= 1 << bit
    at, noise = inserted
    damaged = bytes(data[:at] + noise + data[at:])[: len(FLOWN) - cut]
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "a.tlog"
        path.write_bytes(damaged)
        found = replay_log(TelemetryFile(path), build_replay_rules(None))
    assert len(found.vehicles) <= 2
    assert found.lasted_s >= 0.0


@settings(max_examples=20, deadline=None)
@given(st.lists(st.tuples(st.integers(-200, 200), st.integers(0, 60)), min_size=1, max_size=5))
def test_clocks_that_leap_both_ways(leaps: list[tuple[int, int]]) -> None:
    writer, ahead_s = Writer(), 0
    for leap_s, lasts_s in leaps:
        ahead_s += leap_s
        part = Writer(senders=writer.senders)
        flight(part, 3, range(lasts_s))
        writer.records += [(1000.0 + ahead_s + at_s, frame) for at_s, frame in part.records]
    data = b"".join(Writer(records=[record]).data() for record in writer.records)
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "a.tlog"
        path.write_bytes(data)
        found = replay_log(TelemetryFile(path), build_replay_rules(None))
    assert found.lasted_s >= 0.0
    assert found.skipped.time_back <= len(leaps)


def cut(data: bytes) -> bytes:
    return data[: len(data) // 2 + 7]


def beheaded(data: bytes) -> bytes:
    return data[1000:]


def holed(data: bytes) -> bytes:
    third = len(data) // 3
    return data[:third] + bytes(5000) + data[third + 5000 :]


def sprinkled(data: bytes) -> bytes:
    rng, damaged = random.Random(5), bytearray(data)
    for _ in range(200):
        damaged[rng.randrange(200, len(damaged))] ^= 1 << rng.randrange(8)
    return bytes(damaged)


def stuffed(data: bytes) -> bytes:
    return data[: len(data) // 3] + random.Random(6).randbytes(20000) + data[len(data) // 3 :]


def noise(data: bytes) -> bytes:
    return random.Random(7).randbytes(min(len(data), 20000))


@pytest.mark.parametrize("damage", [cut, beheaded, holed, sprinkled, stuffed, noise])
@pytest.mark.parametrize("name", ["link_dead.BIN", "px4_fastdrain.ulg"])
def test_the_autopilots_own_logs(
    name: str, damage: Callable[[bytes], bytes], tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    """Neither has checksums: a damaged record is known by its form or its values alone."""
    path = tmp_path / name
    path.write_bytes(damage((real_logs() / name).read_bytes()))
    out = io.StringIO()
    with redirect_stdout(out), pytest.raises(SystemExit) as left:
        main.main(["replay", str(path), "--json"])
    said = capfd.readouterr()
    assert said.out == ""
    lines = said.err.splitlines()
    assert left.value.code in {0, 1, 2}
    if left.value.code == 2:
        assert len(lines) == 1
        assert name in lines[0]
        return
    assert lines == []
    content = json.loads(out.getvalue())
    assert bool(content["vehicles"]) == (left.value.code == 0)
    if damage in {holed, stuffed, sprinkled}:
        assert sum(content["skipped"].values()) > 0


def test_a_folder_without_logs(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as left:
        main.main(["replay", str(tmp_path)])
    assert left.value.code == 2
    assert "expected a run directory, or a folder with" in capsys.readouterr().err
