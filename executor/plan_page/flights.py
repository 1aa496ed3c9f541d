"""Start flights from the plan page, and list them. A flight is a separate process and outlives the page."""

from __future__ import annotations

import asyncio
import json
import os
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from executor.adapters.interrupts import end_program
from executor.adapters.run_directory import RunDirectory, hold_lock, name_run
from executor.analysis.documents import FlightReport
from executor.core.formatting import command_line
from executor.errors import LogError, SiteError

RUNS = "runs"
STARTS_S = 90.0
"""Real seconds to wait for a flight's page; its process loads the planner first."""
LOOK_S = 0.2
MOST_FLIGHTS = 100


async def start_flight(folder: Path, site: Path, plan: Path) -> dict[str, Any]:
    """Start a flight in a separate process, whose page asks before anything takes off.

    Args:
        folder: Folder of its run directory, in `runs`.
        site: The site file.
        plan: Plan to fly.

    Returns:
        The address of its page, and its run directory.

    Raises:
        SiteError: it ended before its page was up, or was ended because the page did not come up.
    """
    runs = folder / RUNS
    try:
        runs.mkdir(exist_ok=True)
    except OSError as error:
        raise SiteError(f"{runs}: cannot be made: {error.strerror}") from error
    run = name_run(runs)
    words = [str(site), "--plan", str(plan), "--run", str(run), "--on-page"]
    log = run.with_suffix(".log")
    with log.open("wb") as file:
        flight = subprocess.Popen(  # noqa: ASYNC220 - returns at once
            [sys.executable, "-m", "executor", "fly", *words], cwd=folder, env=os.environ | {"PYTHONUNBUFFERED": "1"},
            stdin=subprocess.DEVNULL, stdout=file, stderr=subprocess.STDOUT, start_new_session=True,
        )  # fmt: skip
    until_s = time.monotonic() + STARTS_S
    while time.monotonic() < until_s:
        ended, said = flight.poll(), log.read_text(encoding="utf-8", errors="replace").splitlines()
        for line in said:
            if "page: http" in line:
                return {"url": line.partition("page: ")[2].strip(), "run": _name(folder, run)}
        if ended is not None:
            last = said[-1].removeprefix("faultline: ") if said else f"exit code {ended}"
            raise SiteError(f"the flight has not begun: {last}")
        await asyncio.sleep(LOOK_S)
    # Without a page the flight is invisible: it would hold the ports, and ask on a page that is never opened. Nothing
    # was confirmed yet.
    await asyncio.to_thread(end_program, flight)
    raise SiteError(f"the flight's page was not there after {STARTS_S:g} s, it was ended; see {log}")


async def run_checklist(folder: Path, site: Path, plan: Path) -> dict[str, Any]:
    """Run the checklist alone: vehicles are queried, nothing is uploaded, nothing moves.

    Raises:
        SiteError: it cannot be run.
    """
    words = ["preflight", str(site), "--plan", str(plan), "--json"]
    asked = await asyncio.create_subprocess_exec(
        sys.executable, "-m", "executor", *words, cwd=folder, stdin=asyncio.subprocess.DEVNULL,
        stdout=asyncio.subprocess.PIPE, stderr=asyncio.subprocess.PIPE,
    )  # fmt: skip
    said, wrong = await asked.communicate()
    try:
        found: dict[str, Any] = json.loads(said)
    except ValueError:
        last = wrong.decode(errors="replace").strip().rpartition("\n")[2].removeprefix("faultline: ")
        raise SiteError(last or command_line(*words)) from None
    return found


def _name(folder: Path, run: Path) -> str:
    return run.relative_to(folder).as_posix()


def list_flights(folder: Path) -> Iterator[dict[str, Any]]:
    """Yield the flights of a folder with their results, newest first."""
    runs = folder / RUNS
    found = sorted((one for one in runs.iterdir() if one.is_dir()), reverse=True) if runs.is_dir() else []
    for run in found[:MOST_FLIGHTS]:
        if not RunDirectory(run).events.exists():
            continue
        try:
            report: FlightReport | None = FlightReport.read(RunDirectory(run).report)
        except LogError:
            report = None
        yield {
            "run": _name(folder, run), "running": _is_flown(run), "has_report": RunDirectory(run).page.exists(),
            "report": None if report is None else {
                "finished": report.finished, "inspected": report.segments_inspected, "total": report.segments_total,
                "uncovered": list(report.uncovered_names), "duration_s": report.duration_s,
                "lost": [one.vehicle for one in report.faults],
            },
        }  # fmt: skip


def _is_flown(run: Path) -> bool:
    lock = RunDirectory(run).lock
    try:
        with hold_lock(lock, ""):
            return False
    except (LogError, ImportError, OSError) as error:
        return isinstance(error, LogError)


def find_run(folder: Path, name: str) -> Path:
    """Return a run directory of a folder.

    Raises:
        SiteError: there is none of this name.
    """
    run = folder / name
    if name not in {_name(folder, one) for one in (folder / RUNS).glob("*")} or not RunDirectory(run).events.exists():
        raise SiteError(f"run: expected a flight of {folder / RUNS}, got {name[:100]!r}")
    return run
