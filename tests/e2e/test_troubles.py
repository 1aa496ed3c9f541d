"""A computer in trouble: a disk that is full or slow, a clock that is set back. The flight's outcome is the same."""

from __future__ import annotations

import asyncio
import itertools
import json
import resource
import sys
from collections.abc import AsyncIterator, Sequence
from contextlib import asynccontextmanager
from pathlib import Path
from typing import Any

import pytest

from executor.replay.run_replay import replay_run
from tests.e2e import flights
from tests.e2e.flights import called, ended, log_lines, said_in, site_file
from tests.e2e.judge import wrongly_counted

pytestmark = pytest.mark.asyncio

SPEEDUP = 10.0
LOSS = "uav2:silent@40%"


@asynccontextmanager
async def flying(folder: Path) -> AsyncIterator[tuple[asyncio.subprocess.Process, Path]]:
    """Fly three vehicles, of which one is lost; every survivor is on its way when the block begins."""
    site, _ = site_file(folder, pylons=7, vehicles=3, speedup=SPEEDUP)
    run = folder / "run"
    async with (
        called("simulate", str(site), "--fault", LOSS),
        called("fly", str(site), "--yes", "--run", str(run)) as flight,
    ):
        await said_in(flight.stderr, *(f"uav{number}: flies its mission" for number in (1, 2, 3)))
        yield flight, run


def report_in(run: Path) -> dict[str, Any]:
    report: dict[str, Any] = json.loads((run / "report.json").read_text(encoding="utf-8"))
    return report


def well(report: dict[str, Any]) -> None:
    """Check that one was lost, and that the others inspected everything."""
    assert report["finished"]
    assert report["segments_inspected"] == report["segments_total"] > 0
    assert [(fault["vehicle"], fault["kind"]) for fault in report["faults"]] == [("uav2", "link")]
    assert len(report["replans"]) == 1
    assert all(one["landed"] for one in report["vehicles"] if one["name"] != "uav2")


def no_file_grows(process: asyncio.subprocess.Process, run: Path, *, beyond: int | None) -> None:
    """Let no file of a process grow any more, as on a full disk, from what the largest one has on; None lets them."""
    _, most = resource.prlimit(process.pid, resource.RLIMIT_FSIZE)
    largest = max(path.stat().st_size for path in run.iterdir())
    resource.prlimit(process.pid, resource.RLIMIT_FSIZE, (most if beyond is None else largest + beyond, most))


async def test_a_disk_that_is_full_while_a_vehicle_is_lost(tmp_path: Path) -> None:
    async with flying(tmp_path) as (flight, run):
        no_file_grows(flight, run, beyond=5000)
        await said_in(flight.stderr, "the event log cannot be written", "uav2: link lost", "re-plan 1 is on board")
        no_file_grows(flight, run, beyond=None)
        _, err = await ended(flight)
    assert flight.returncode == 0, err
    well(report_in(run))
    assert "the event log is written again" in err
    told = [line["told"] for line in log_lines(run) if "told" in line]
    assert any("cannot be written" in text for text in told)
    assert any("written again" in text for text in told)
    assert replay_run(run).comparison.is_same  # every line was kept until there was room


async def test_a_disk_that_stays_full(tmp_path: Path) -> None:
    """The report is shown all the same, and the next flight says what is missing in the record."""
    async with flying(tmp_path) as (flight, run):
        # Less than a report takes: nothing whatever can be written.
        _, most = resource.prlimit(flight.pid, resource.RLIMIT_FSIZE)
        resource.prlimit(flight.pid, resource.RLIMIT_FSIZE, (100, most))
        out, err = await ended(flight)
    assert flight.returncode == 0, err
    assert out.startswith("6 of 6 segments inspected")
    assert "uav2: link lost" in err
    assert "report.json cannot be written: File too large" in err
    assert "Traceback" not in err
    assert "internal error" not in err
    assert not (run / "report.json").exists()


async def test_a_clock_that_is_set_back_an_hour(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    marker = tmp_path / "set-back"
    command: Sequence[str] = (sys.executable, "-m", "tests.e2e.troubles", str(marker))
    monkeypatch.setattr(flights, "FAULTLINE", command)
    async with flying(tmp_path) as (flight, run):
        marker.touch()
        _, err = await ended(flight)
    assert flight.returncode == 0, err
    report = report_in(run)
    well(report)
    times_s = [line["t_s"] for line in log_lines(run) if "event" in line]
    assert times_s == sorted(times_s)
    assert max(after - before for before, after in itertools.pairwise(times_s)) < 30.0
    assert wrongly_counted(run, report) == []
    assert [line["told"] for line in log_lines(run) if "told" in line] == [
        "this computer's clock was set back by 3600 s; the flight's own time continues"
    ]
    assert replay_run(run).comparison.is_same
