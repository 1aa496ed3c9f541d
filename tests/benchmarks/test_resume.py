"""The measured time to resume a flight, on a small one."""

from __future__ import annotations

import json
from pathlib import Path

from typer.testing import CliRunner

from benchmarks.commands import cli
from benchmarks.resume import ResumedFlight, resume_report


def test_a_flight_is_killed_and_resumed_after_hours(tmp_path: Path) -> None:
    case = ["resume", "--vehicles", "2", "--minutes", "0.5", "--hours", "0.2", "--speedup", "6"]
    done = CliRunner().invoke(cli, [*case, "--out", str(tmp_path), "--json"])
    assert done.exit_code == 0, done.output
    [row] = json.loads((tmp_path / "resume.json").read_text())["rows"]
    assert 0.0 < row["heartbeat_s"] < row["charge_s"] <= row["asked_s"]
    assert 0.0 < row["cpu_s"] < row["charge_s"] + 1.0
    assert row["lines"] > 10 * row["lines_after"] > 0
    assert row["checkpoint_kb"] > 1.0
    assert "| 2 | 0.2 |" in (tmp_path / "resume.md").read_text()


def test_the_whole_log_is_reckoned_from_a_line() -> None:
    taken = ResumedFlight(6, 10.0, 564.1, 3_000_000, 2_700, 78.7, 1.1, 2.8, 1.7, 2.0, 1.3, 2.1, 0.08)
    row = next(line for line in resume_report([taken], {"cores": 2, "processor": "x", "commit": "y"}).splitlines()
               if line.startswith("| 6 |"))  # fmt: skip
    assert row.strip("| ").split(" | ")[-5:] == ["1.70", "2.00", "1.30", "2.10", "240"]
