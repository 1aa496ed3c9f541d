"""The measurement of uploads, on small cases."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from typer.testing import CliRunner

from benchmarks.commands import cli
from benchmarks.upload import Measured, Row, UploadCase, UploadTiming, content_of, markdown_of, measure_cases


def test_both_programs_upload_to_both_autopilots() -> None:
    cells = [UploadCase(autopilot, 10, 0.0, delay_s) for autopilot in ("ardupilot", "px4") for delay_s in (0.0, 0.05)]
    rows = measure_cases(cells, repeats=2, seed=1, said=lambda _: None).rows
    assert [row.cell for row in rows] == cells
    assert [len(timing.accepted_s) for row in rows for timing in (row.native, row.mavsdk)] == [2] * 8
    near, far = rows[:2]
    assert near.round_trip_s < far.round_trip_s
    assert far.floor_s == 11 * far.round_trip_s


ROW = Row(
    UploadCase("px4", 40, 0.2, 0.3),
    0.6,
    UploadTiming((20.0, 30.0, 22.0), ()),
    UploadTiming((), ("timeout", "busy", "timeout")),
)


def test_a_row_shows_medians_and_why_the_others_failed() -> None:
    content = content_of(Measured((ROW,), 9.0, 0.1), repeats=3, seed=1)
    text = markdown_of([ROW], content)
    assert "| 40 | 300 | 20 | 24.60 | 22.00 (3/3) | - (0/3) | busy (1), timeout (2) |" in text.splitlines()
    assert "own failures" not in text
    assert [row["native_s"] for row in json.loads(json.dumps(content))["rows"]] == [22.0]


def test_our_own_failures_are_named() -> None:
    row = Row(ROW.cell, 0.6, UploadTiming((), ("no answer after item 3 of 40",)), ROW.mavsdk)
    assert "no answer after item 3 of 40" in markdown_of([row], content_of(Measured((row,), 9.0, 0.1), 1, 1))


def test_the_command_writes_what_it_prints(tmp_path: Path) -> None:
    case = ["upload", "--items", "4", "--loss", "0", "--delay", "0", "--repeats", "1"]
    done = CliRunner().invoke(cli, [*case, "--out", str(tmp_path)])
    assert done.exit_code == 0
    assert (tmp_path / "upload.md").read_text() == done.stdout.removesuffix("\n")
    rows = json.loads((tmp_path / "upload.json").read_text())["rows"]
    assert [row["cell"]["autopilot"] for row in rows] == ["ardupilot", "px4"]


@pytest.mark.parametrize("case", [["--items", "3"], ["--loss", "1"], ["--delay", "-1"], ["--repeats", "0"]])
def test_a_case_that_cannot_be_measured_is_refused(case: list[str]) -> None:
    assert CliRunner().invoke(cli, ["upload", *case]).exit_code == 2
