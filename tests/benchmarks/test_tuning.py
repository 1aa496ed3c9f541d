"""Thresholds swept over logs with truths."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from executor.cli import main
from tests.recorded import BEGAN_USEC, Writer, flight, heartbeat, station, text

EVENTS = [{"t_usec": BEGAN_USEC + 1_000_000, "boot_ms": 0, "what": "armed"}]


def folder_of_logs(tmp_path: Path) -> Path:
    """Return a healthy flight and one with a silent link, and their truths."""
    healthy, silent = Writer(), Writer()
    flight(healthy, 3, range(120))
    flight(silent, 3, range(120), silent=range(60, 67))
    healthy.write(tmp_path / "healthy.tlog")
    silent.write(tmp_path / "silent.tlog")
    gone = {"from_usec": BEGAN_USEC + 59_500_000, "to_usec": BEGAN_USEC + 67_100_000}
    truths = {
        "healthy.tlog": {"kind": "no fault", "events": EVENTS},
        "silent.tlog": {"kind": "link loss", "events": EVENTS, "vehicle_silent": [gone]},
    }
    (tmp_path / "all_truth.json").write_text(json.dumps({"logs": truths}))
    return tmp_path


def test_a_longer_time_out_finds_less(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    folder = folder_of_logs(tmp_path)
    with pytest.raises(SystemExit) as left:
        main.main(["bench", "tune", str(folder), "--json", "-o", str(tmp_path / "out")])
    assert left.value.code == 0
    points = json.loads(capsys.readouterr().out)["points"]
    link = {one["value"]: one for one in points if one["threshold"] == "link_timeout_s"}
    assert link[4.5]["chosen"]
    assert (link[4.5]["found"], link[9.0]["found"]) == (1, 0)
    assert link[2.25]["mean_delay_s"] < link[4.5]["mean_delay_s"] < link[5.4]["mean_delay_s"]
    assert all(one["false_alarms"] == 0 for one in points)
    assert points[-1]["threshold"] == "few lines"
    assert (tmp_path / "out" / "tuning.png").is_file()


def test_a_log_without_truth_is_compared_with_its_own_statements(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    writer = Writer()
    flight(writer, 3, range(150), silent=range(60, 67))
    for second in range(150):
        writer.say(second + 0.7, 255, station())
    writer.say(120.0, 3, text("Battery Failsafe"))
    writer.write(tmp_path / "real.tlog")
    with pytest.raises(SystemExit) as left:
        main.main(["bench", "tune", str(tmp_path), "--json"])
    assert left.value.code == 0
    points = json.loads(capsys.readouterr().out)["points"]
    link = {one["value"]: one for one in points if one["threshold"] == "link_timeout_s"}
    assert {one["faults"] for one in points} == {2}
    assert (link[4.5]["found"], link[9.0]["found"]) == (2, 1)
    assert link[4.5]["false_alarms"] == 0


def test_logs_that_say_nothing(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    writer = Writer()
    for second in range(20):
        writer.say(second, 3, heartbeat(kind=1))
    writer.write(tmp_path / "a.tlog")
    with pytest.raises(SystemExit) as left:
        main.main(["bench", "tune", str(tmp_path)])
    assert left.value.code == 2
    assert "expected logs with truth files next to them" in capsys.readouterr().err
