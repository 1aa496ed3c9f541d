"""Flights of real aircraft: declared faults against the logs' own statements."""

from __future__ import annotations

from functools import cache
from pathlib import Path
from typing import Any

import pytest

from benchmarks.reallogs import judge_log, logs_under
from tests.recorded import LOGS

FOLDER = LOGS / "real"
REAL = logs_under(FOLDER) if FOLDER.is_dir() else []
NEAR_S = 8.0
IRIS = "kevinaangstadt+quadcopter-logs__2016-"
JUMPY = "harrylerman+drone_scripts__2022-06-02_15-27-04.tlog"
LONG = "dronekit+dronekit-python__examples_flight_replay_flight.tlog"
GAPS = "mbiuki+Phoenix__Trajecotry_Autonomous_real_traces_mission1_2018-09-17_16-44-06.tlog"
INDOORS = "fdeedat+Repo_TA_2024__LOGS_00000029.BIN"
CRASHED = "fdeedat+Repo_TA_2024__LOGS_00000010.BIN"
CASCADE = "rima48-bit+ardupilot-log-diagnosis__test_cascade.BIN"


@cache
def judged(name: str) -> dict[str, Any]:
    if not FOLDER.is_dir():
        pytest.skip("the flights of real aircraft are not beside the project (../shared/logs/real)")
    return judge_log(FOLDER / name, FOLDER)


def declared(name: str) -> list[dict[str, Any]]:
    return [one for one in judged(name)["declared"] if one["by"] == "watchpoints"]


def near(name: str, at_s: float, kind: str = "", reason: str = "") -> list[dict[str, Any]]:
    return [
        one
        for one in declared(name)
        if abs(one["at_s"] - at_s) <= NEAR_S and kind in one["kind"] and reason in one["reason"]
    ]


def found(name: str, what: str, at_s: float) -> dict[str, Any]:
    [one] = [one for one in judged(name)["stated"] if one["what"] == what and abs(one["at_s"] - at_s) <= 1.0]
    return dict(one["watchpoints"])


def test_the_logs_are_there() -> None:
    if not FOLDER.is_dir():
        pytest.skip("the flights of real aircraft are not beside the project (../shared/logs/real)")
    assert len(REAL) > 40


@pytest.mark.parametrize("path", REAL, ids=lambda path: str(path.name))
def test_nothing_is_declared_that_the_log_refutes(path: Path) -> None:
    row = judged(path.name)
    assert row["failed"] == ""
    assert [one for one in declared(path.name) if one["verdict"] == "refuted"] == []


@pytest.mark.parametrize("path", REAL, ids=lambda path: str(path.name))
def test_all_that_the_log_states_is_declared_in_time(path: Path) -> None:
    assert [one for one in judged(path.name)["stated"] if one["watchpoints"]["outcome"] != "declared"] == []


@pytest.mark.parametrize("path", REAL, ids=lambda path: str(path.name))
def test_what_is_not_followed_says_why(path: Path) -> None:
    row = judged(path.name)
    assert row["vehicles"] or any(note != "no vehicle in it that can be followed" for note in row["notes"])


@pytest.mark.parametrize(
    ("name", "what", "at_s"),
    [
        (f"{IRIS}03-14_015_015-F13.tlog", "battery failsafe", 173.4),
        (f"{IRIS}03-14_015_015-F13.tlog", "crash", 182.9),
        (f"{IRIS}07-21_006_006.tlog", "battery failsafe", 136.9),
        (LONG, "battery failsafe", 483.2),
        (CRASHED, "crash", 25.3),
        (GAPS, "link gap", 597.5),
        (GAPS, "link gap", 704.3),
    ],
)
def test_what_happened_is_declared_with_its_kind(name: str, what: str, at_s: float) -> None:
    outcome = found(name, what, at_s)
    assert outcome["outcome"] == "declared"
    assert outcome["after_s"] <= 2.0


@pytest.mark.parametrize(
    ("name", "at_s", "kind", "why"),
    [
        (f"{IRIS}07-21_006_006.tlog", 57.0, "", "the mode was ordered, and acknowledged"),
        (JUMPY, 751.3, "battery", "its percentage stood at 100 for long: nobody knows what is usual"),
        (JUMPY, 1000.3, "battery", "it was armed 2.5 s before"),
        (JUMPY, 1406.5, "battery", "its percentage stood at 100 for long: nobody knows what is usual"),
        (LONG, 595.2, "interruption", "it was armed 3.4 s before, on the ground"),
        (INDOORS, 287.7, "battery", "no satellites: the model says that nothing is used"),
        (CASCADE, 199.7, "battery", "an EKF failsafe and what came of it, no loss of the pack"),
    ],
)
def test_what_did_not_happen_is_not_declared(name: str, at_s: float, kind: str, why: str) -> None:
    assert near(name, at_s, kind) == [], why


def test_a_mode_that_a_ground_station_ordered_ten_times_is_no_interruption() -> None:
    assert [one for one in declared(f"{IRIS}07-21_005_005.tlog") if one["reason"] == "mode"] == []


@pytest.mark.parametrize("path", [one for one in REAL if "erlerobot" in one.name], ids=lambda path: str(path.name))
def test_old_logs_are_followed(path: Path) -> None:
    assert judged(path.name)["vehicles"] == 1
