"""The ground station dies, is stopped, or comes back on another computer: the flight ends as it would have."""

from __future__ import annotations

import asyncio
import json
import os
import shutil
import signal
from pathlib import Path
from typing import Any

import pytest

from executor.adapters.run_directory import RunDirectory
from executor.replay.run_replay import replay_run
from simulator.truth import read_truths
from tests.e2e.flights import called, ended, notes, said_in, site_file
from tests.e2e.judge import wrongly_counted

FILES = tuple(file.name for file in RunDirectory(Path()).checkpoints)

pytestmark = pytest.mark.asyncio

KEY = "a passphrase that everybody knows"
SPEEDUP = 5.0


async def killed(process: asyncio.subprocess.Process) -> None:
    """Kill the ground station: no handler runs, nothing is flushed, nobody is told."""
    process.kill()
    await process.wait()


async def resumed(run: Path, *more: str) -> tuple[int, dict[str, Any], str]:
    """Take a flight up again to its end."""
    async with called("resume", str(run), "--yes", "--json", *more) as process:
        out, err = await ended(process)
    assert process.returncode in {0, 1}, err
    return process.returncode, json.loads(out), err


async def test_killed_before_the_take_off_and_in_flight_and_copied_to_another_computer(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Every frame is signed, too: after two restarts the vehicles still believe us, and we them."""
    monkeypatch.setenv("LINE_KEY", KEY)
    site, _ = site_file(tmp_path, pylons=6, vehicles=2, speedup=SPEEDUP)
    site.write_text(site.read_text() + '[signing]\nkey_env = "LINE_KEY"\n')
    run, copy, truth = tmp_path / "run", tmp_path / "copy", tmp_path / "truth.jsonl"
    async with called("simulate", str(site), "--truth", str(truth)):
        async with called("fly", str(site), "--yes", "--run", str(run)) as flight:
            await said_in(flight.stderr, "mission items on board")
            await killed(flight)
        async with called("resume", str(run), "--yes") as flight:
            await said_in(flight.stderr, "nothing was launched", "uav1: flies its mission", "uav2: flies its mission")
            await killed(flight)
        shutil.copytree(run, copy)
        with (copy / "events.jsonl").open("a") as log:
            log.write('{"t_s":77.0,"event":{"kind":"Ti')
        code, report, _ = await resumed(copy)
        code_again, again, _ = await resumed(copy)
    assert code == 0
    assert report["finished"]
    assert report["faults"] == []
    assert report["segments_inspected"] == report["segments_total"]
    assert [absence["restarted"] for absence in report["absences"]] == [True]
    assert all(vehicle["landed"] and not vehicle["frames_refused"] for vehicle in report["vehicles"])
    assert (code_again, again) == (0, report)
    assert any("torn and was dropped" in note["said"] for note in notes(copy))
    assert any((copy / name).exists() for name in FILES)
    assert not any("is not used" in note["said"] for note in notes(copy))
    assert replay_run(copy).comparison.is_same
    assert KEY not in "".join(path.read_text(errors="replace") for path in copy.iterdir() if path.is_file())
    starts = [one.vehicle for one in read_truths(truth) if one.what == "took_off"]
    assert sorted(starts) == sorted(set(starts)) or report["replans"]


async def test_stopped_for_half_a_minute_of_the_flight(tmp_path: Path) -> None:
    """A laptop that was suspended: nobody is lost for our own absence, what was flown is proven from what waited."""
    site, _ = site_file(tmp_path, pylons=6, vehicles=2, speedup=SPEEDUP)
    run = tmp_path / "run"
    async with called("simulate", str(site)), called("fly", str(site), "--yes", "--run", str(run)) as flight:
        await said_in(flight.stderr, "uav1: flies its mission", "uav2: flies its mission")
        os.kill(flight.pid, signal.SIGSTOP)
        await asyncio.sleep(30.0 / SPEEDUP)
        os.kill(flight.pid, signal.SIGCONT)
        _, err = await ended(flight)
    assert flight.returncode == 0, err
    report = json.loads((run / "report.json").read_text(encoding="utf-8"))
    assert report["finished"]
    assert report["faults"] == []
    assert any("the ground station stalled for" in note["said"] for note in notes(run))
    assert [absence["restarted"] for absence in report["absences"]].count(True) == 0
    assert report["absences"][0]["pause_s"] > 25.0
    assert wrongly_counted(run, report) == []


async def test_the_checklist_alone(tmp_path: Path) -> None:
    site, _ = site_file(tmp_path, pylons=5, vehicles=2, speedup=SPEEDUP)
    async with called("simulate", str(site)), called("preflight", str(site), "--json") as process:
        out, err = await ended(process)
    assert process.returncode == 0, err
    found = json.loads(out)
    assert found["ready"]
    assert {check["subject"] for check in found["checks"]} >= {"uav1", "uav2", "separation"}
    site.write_text(site.read_text().replace("speedup = 5.0", "speedup = 5.0\nconnect_timeout_s = 1.0"))
    async with called("preflight", str(site), "--quiet") as process:
        out, err = await ended(process)
    assert (process.returncode, out, err) == (1, "", "")
    assert set(os.listdir(tmp_path)) == {"line.yaml", "site.toml"}  # noqa: PTH208 - nothing waits here
