"""Telemetry logs whose recorder's clock was set in flight."""

from __future__ import annotations

import struct
from collections.abc import Callable
from pathlib import Path

import pytest

from benchmarks.witness.statements import read_log_evidence
from executor.adapters.mavlink.tlog_reader import BootTime, TelemetryFile, was_set_by_usec
from executor.replay.log_replay import build_replay_rules, replay_log
from executor.replay.replay_result import LogReplay
from tests.recorded import Writer, battery, heartbeat, position, station

SECOND = 1_000_000
YEARS_S = 1.75e9


def log(stamped: Callable[[float], float], path: Path, *, drops: float = 0.0) -> Path:
    """Write a flight of 100 s; its battery drops at 80 s, and the recorder stamps it as it does."""
    writer = Writer()
    for second in range(100):
        for part in range(5):
            writer.say(second + part / 5 + 0.03, 1, position(second + part / 5, 3.0 * second))
        writer.say(second + 0.1, 1, heartbeat())
        writer.say(second + 0.15, 255, station())
        writer.say(second + 0.5, 1, battery(99 - 0.08 * second - (drops if second >= 80 else 0.0)))
    data = b"".join(
        struct.pack(">Q", round((stamped(at_s) + 1e4) * 1e6)) + frame
        for at_s, frame in sorted(writer.records, key=lambda one: one[0])
    )
    path.write_bytes(data)
    return path


def replayed(path: Path) -> LogReplay:
    return replay_log(TelemetryFile(path), build_replay_rules(None))


def set_at(at_s: float, by_s: float) -> Callable[[float], float]:
    return lambda moment_s: moment_s + (by_s if moment_s >= at_s else 0.0)


@pytest.mark.parametrize("by_s", [YEARS_S, 86_400.0, 3600.0, 30.0, 5.0, 2.5, -2.5, -30.0, -3600.0, -9_000.0])
def test_a_clock_that_is_set_in_flight_changes_no_time(by_s: float, tmp_path: Path) -> None:
    found = replayed(log(set_at(40.05, by_s), tmp_path / "a.tlog", drops=20.0))
    [vehicle] = found.vehicles
    [step] = vehicle.declarations
    assert vehicle.flown_s == pytest.approx(99.5, abs=1.0)
    assert 80.0 < (step.t_usec - found.began_usec) / 1e6 < 84.0
    assert [note for note in found.notes if "clock" in note] == [
        f"the recorder's clock was set by {by_s:+.1f} s at 40.0 s: times go on by the vehicles' own"
    ]
    told = read_log_evidence(tmp_path / "a.tlog")[1]
    assert (told.ended_usec - told.began_usec) / 1e6 == pytest.approx(99.5, abs=1.5)
    assert not told.silences


def test_a_clock_that_is_set_twice(tmp_path: Path) -> None:
    found = replayed(log(lambda s: set_at(30.05, YEARS_S)(s) - (7200.0 if s >= 60.05 else 0.0), tmp_path / "a.tlog"))
    assert found.vehicles[0].flown_s == pytest.approx(99.5, abs=1.0)
    assert sum("clock was set" in note for note in found.notes) == 2


def test_a_silence_of_the_link_stays_one(tmp_path: Path) -> None:
    """What waited in a radio comes at once, with the times at which it was said: both clocks agree again after it."""
    found = replayed(log(lambda s: 49.0 if 40.05 <= s < 49.0 else s, tmp_path / "a.tlog"))
    assert not any("clock" in note for note in found.notes)
    assert found.lasted_s == pytest.approx(99.5, abs=0.5)


def test_a_pause_of_the_recorder_stays_one(tmp_path: Path) -> None:
    path, whole = tmp_path / "a.tlog", Writer()
    for second in (*range(50), *range(350, 400)):
        whole.say(second + 0.1, 1, heartbeat())
        whole.say(second + 0.3, 1, position(second))
    path.write_bytes(whole.data())
    found = replayed(path)
    assert not any("clock" in note for note in found.notes)
    assert found.lasted_s == pytest.approx(399, abs=1.0)
    assert found.vehicles[0].flown_s == pytest.approx(100, abs=6), "nobody knows what it did meanwhile"


def pairs(*after: tuple[float, float]) -> list[tuple[BootTime, BootTime]]:
    """Return reports after one at 100 s of both clocks, as (time since boot, stamp)."""
    before = BootTime(100 * SECOND, 100 * SECOND)
    return [(before, BootTime(round(boot_s * SECOND), round(stamp_s * SECOND))) for boot_s, stamp_s in after]


@pytest.mark.parametrize(
    ("what", "after", "leap_s", "by_s"),
    [
        ("set ahead", [(101.0, 111.0), (104.0, 114.0)], 10.0, 10.0),
        ("too little is seen of a short leap", [(101.0, 111.0)], 10.0, 0.0),
        ("a leap of an hour needs one report", [(101.0, 3701.0)], 3600.0, 3600.0),
        ("a pause", [(111.0, 111.0), (114.0, 114.0)], 10.0, 0.0),
        ("held back", [(101.0, 110.0), (110.0, 110.1), (113.0, 113.0)], 10.0, 0.0),
        ("a reboot in a pause", [(1.0, 111.0), (4.0, 114.0)], 10.0, 0.0),
        ("a reboot, and back in time", [(1.0, 91.0), (4.0, 94.0)], -10.0, -10.0),
        ("no clock reported, time going back", [], -10.0, -10.0),
        ("no clock reported, for years", [], YEARS_S, YEARS_S),
        ("no clock reported, for an hour", [], 3600.0, 0.0),
    ],
)
def test_by_how_much_a_clock_was_set(what: str, after: list[tuple[float, float]], leap_s: float, by_s: float) -> None:
    stamp_s = 100.0 + leap_s
    assert was_set_by_usec(pairs(*after), round(stamp_s * SECOND), 100 * SECOND) == by_s * SECOND, what
