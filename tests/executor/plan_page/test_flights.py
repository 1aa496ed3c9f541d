from __future__ import annotations

import asyncio
import subprocess
from pathlib import Path
from typing import Any

import pytest

from executor.adapters.run_directory import RunDirectory, lock_run_directory
from executor.errors import SiteError
from executor.plan_page import flights
from executor.plan_page.flights import find_run, list_flights, run_checklist, start_flight
from tests.executor.plan_page.opened import make_demo_site


def make_run(folder: Path, name: str) -> Path:
    run = folder / "runs" / name
    run.mkdir(parents=True)
    RunDirectory(run).events.touch()
    return run


def test_flights_are_listed_the_newest_first_with_those_that_are_flown(tmp_path: Path) -> None:
    assert list(list_flights(tmp_path)) == []
    make_run(tmp_path, "20260101-080000")
    flown = make_run(tmp_path, "20260102-080000")
    (tmp_path / "runs" / "no-flight").mkdir()
    with lock_run_directory(flown):
        shown = list(list_flights(tmp_path))
    assert [(one["run"], one["running"], one["report"]) for one in shown] == [
        ("runs/20260102-080000", True, None), ("runs/20260101-080000", False, None)
    ]  # fmt: skip


@pytest.mark.parametrize("name", ["runs/../x", "../runs/20260101-080000", "runs", "runs/no-flight", "/etc", ""])
def test_only_a_flight_of_the_folder_is_found(tmp_path: Path, name: str) -> None:
    make_run(tmp_path, "20260101-080000")
    (tmp_path / "runs" / "no-flight").mkdir()
    (tmp_path / "x").mkdir()
    assert find_run(tmp_path, "runs/20260101-080000") == tmp_path / "runs" / "20260101-080000"
    with pytest.raises(SiteError, match="run: expected a flight of"):
        find_run(tmp_path, name)


def test_a_flight_without_its_page_is_ended(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    started, really_start = list[subprocess.Popen[bytes]](), subprocess.Popen

    def start(*words: Any, **more: Any) -> subprocess.Popen[bytes]:
        started.append(really_start(*words, **more))
        return started[-1]

    monkeypatch.setattr(flights, "STARTS_S", 0.0)
    monkeypatch.setattr(subprocess, "Popen", start)
    with pytest.raises(SiteError, match="the flight's page was not there after 0 s, it was ended; see "):
        asyncio.run(start_flight(tmp_path, make_demo_site(tmp_path), tmp_path / "plan.json"))
    assert started[0].poll() is not None


def test_a_flight_that_does_not_begin_says_why(tmp_path: Path) -> None:
    site = make_demo_site(tmp_path, "[web]\nenabled = false")
    with pytest.raises(SiteError, match=r"the flight has not begun: --on-page: expected \[web\] enabled in"):
        asyncio.run(start_flight(tmp_path, site, tmp_path / "plan.json"))
    with pytest.raises(SiteError, match=r"plan\.json: file: expected a readable plan file"):
        asyncio.run(run_checklist(tmp_path, site, tmp_path / "plan.json"))
