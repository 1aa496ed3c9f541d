"""The distance bench on one small flight, and what it makes of figures known beforehand."""

from __future__ import annotations

import json
import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from benchmarks import distance
from benchmarks.commands import cli
from benchmarks.distance import FAULTS, DistanceFlight, distance_results, drawn_faults
from benchmarks.distancepage import distance_document, report_distance
from benchmarks.parallel_flights import FlightCase, make_flight_cases

NAMES = ("uav1", "uav2", "uav3")
GOOD = DistanceFlight(
    number=4, autopilot="px4", vehicles=3, segments=13, faults=("uav1:silent=30@40%", "uav2:crash@50%"),
    planned_asked=12, counted=13, counted_asked=10, untold=0, off=(), replans=2, nearest_m=7.5, promised_m=5.0,
    nearest="uav1 and uav2 after 60 s", longest_s=330.0, longest_in_layers_s=300.0, flown_s=400.0,
)  # fmt: skip


def test_a_small_flight_is_inspected_where_it_says_so() -> None:
    flown = distance.fly_distance(FlightCase(0, 2, "ardupilot"))
    assert (flown.wrong, flown.vehicles, flown.segments) == ("", 3, 13)
    assert flown.off == ()
    assert flown.counted == 13
    assert 0 < flown.counted_asked <= 13
    assert flown.promised_m <= flown.nearest_m < math.inf


def test_dialects_take_turns_and_faults_follow_the_seed() -> None:
    assert [case.autopilot for case in make_flight_cases(3, 1, ["ardupilot", "px4"])] == [
        "ardupilot",
        "px4",
        "ardupilot",
    ]
    drawn = [drawn_faults(NAMES, FAULTS, np.random.default_rng(seed)) for seed in range(200)]
    assert drawn == [drawn_faults(NAMES, FAULTS, np.random.default_rng(seed)) for seed in range(200)]
    kinds = {distance.kind_of(fault) for faults in drawn for fault in faults}
    assert kinds == {"crash", "silent", "pilot", "drain"}
    assert max(len({fault.split(":")[0] for fault in faults}) for faults in drawn) == 2


def test_what_comes_too_near_or_is_elsewhere_has_a_line_of_its_own() -> None:
    near = replace(GOOD, number=5, nearest_m=4.9)
    off = replace(GOOD, number=6, off=("3 by uav2: 20.2 m, said 15 m",), vehicles=4)
    lost = replace(GOOD, number=7, wrong="the supervision did not end")
    calm = replace(GOOD, number=8, faults=(), flown_s=363.0)
    assert distance_results([GOOD, calm])["undisturbed"] == {"flights": 1, "lasted_longer_pct": 10.0}
    found = distance_results([GOOD, near, off, lost])
    assert found["undisturbed"] == {"flights": 0, "lasted_longer_pct": None}
    assert (found["flights"], found["segments"], found["planned_asked"]) == (3, 39, 36)
    assert found["faults"] == {"crash": 3, "silent": 3}
    assert found["too_near"] == ["flight 5 (px4, uav1:silent=30@40%, uav2:crash@50%): 4.90 m, uav1 and uav2 after 60 s"]
    assert found["off"] == ["flight 6: 3 by uav2: 20.2 m, said 15 m"]
    assert found["not_flown"] == ["flight 7: the supervision did not end"]
    assert found["longer_pct"] == {"median": 10.0, "most": 10.0}
    assert [row["vehicles"] for row in found["by_vehicles"]] == [3, 4]


def test_the_page_names_what_went_wrong(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    near = replace(GOOD, number=5, nearest_m=4.9)
    content = distance_document([GOOD, near], "faultline bench distance", 1)
    report_distance(content).keep(tmp_path)
    page = (tmp_path / "distance.md").read_text()
    assert "24 of 26 segments as planned, and 20 of the 26 that counted" in page
    assert "- flight 5 (px4" in page
    assert json.loads((tmp_path / "distance.json").read_text())["nearest_m"] == 4.9
    report_distance(content).show()
    assert "flight 5 (px4" in capsys.readouterr().out
    report_distance(distance_document([GOOD], "faultline bench distance", 1)).keep(tmp_path)
    assert "By name" not in (tmp_path / "distance.md").read_text()


@pytest.mark.parametrize(
    ("flown", "code"), [(GOOD, 0), (replace(GOOD, nearest_m=4.9), 1), (replace(GOOD, wrong="x"), 1)]
)
def test_the_command_says_no_where_anything_was_wrong(
    flown: DistanceFlight, code: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(distance, "fly_distance", lambda _case, **_: flown)
    done = CliRunner().invoke(cli, ["distance", "--flights", "1", "--json"])
    assert done.exit_code == code
    assert json.loads(done.stdout)["command"] == "faultline bench distance --flights 1 --seed 1"
