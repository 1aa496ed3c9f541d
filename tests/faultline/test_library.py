"""The library as its how-to shows it: every example runs as it stands, and the names are those that were promised."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from importlib.util import find_spec
from pathlib import Path

import pytest

import faultline
from tests.executor.flights import write_run

ROOT = Path(__file__).parents[2]
PAGE = (ROOT / "docs" / "how-to" / "library.md").read_text(encoding="utf-8")
EXAMPLES = dict(re.findall(r"^## ([^\n]+)\n(?:(?!^## |```).)*```python\n(.*?)```", PAGE, re.MULTILINE | re.DOTALL))
BLOCKS = re.findall(r"```python\n(.*?)```", PAGE, re.DOTALL)
TABLES = [block for block in BLOCKS if "import pandas" in block or "import duckdb" in block]
STABLE = {
    "ERRORS", "PRESETS", "Cost", "FlightRecord", "FlightReport", "Instance", "Iterations", "PlanFile", "ReplanWindow",
    "Result", "Run", "Seconds", "Vehicle", "__version__", "build_instance", "build_site", "check", "plan", "read_plan",
    "read_run", "replan", "replan_window", "solve", "travel_for", "window", "write_plan",
}  # fmt: skip


def ran(example: str, folder: Path) -> str:
    """Run a script in a folder; returns what it prints."""
    environment = {**os.environ, "PYTHONPATH": str(ROOT)}
    done = subprocess.run(
        [sys.executable, "-c", example], cwd=folder, env=environment, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    return done.stdout


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Where the examples run: a folder with a run directory of three vehicles and a re-plan."""
    made = tmp_path_factory.mktemp("library")
    (made / "runs" / "last").mkdir(parents=True)
    write_run(made / "runs" / "last")
    return made


def test_the_five_examples_run_one_after_another(folder: Path) -> None:
    five = [text for title, text in EXAMPLES.items() if "DuckDB" not in title]
    assert len(five) == 5
    planned, window, replanned, arrays, run = (ran(one, folder) for one in five)
    assert re.fullmatch(r"(uav\d \[\d+.*\] \d+ s\n){3}", planned)
    assert re.match(r"any one loss from \d+ s on: \d+ % of the longest route\n", window)
    assert [line.split()[0] for line in replanned.splitlines()] == ["uav1", "uav2", "uav3"]
    assert re.fullmatch(r"\(\d+\.\d+, \d+\.\d+\) \d+\.\d+\n", arrays)
    said = run.splitlines()
    assert said[0] == "5 of 5 segments, 1 re-plans"
    assert [line.split()[0] for line in said[1:]] == ["uav1", "uav2", "uav3"]
    assert [line.endswith("lost") for line in said[1:]] == [False, True, False]


@pytest.mark.parametrize(("package", "block"), [("pandas", TABLES[0]), ("duckdb", TABLES[1])])
def test_a_run_directory_opens_in(package: str, block: str, folder: Path) -> None:
    if find_spec(package) is None:
        pytest.skip(f"{package} is not installed: pip install {package}, to try its line of docs/how-to/library.md")
    printed = ran(block, folder)
    assert all(
        word in printed for word in {"pandas": ["uav1", "uav3"], "duckdb": ["lost, silent", "Position"]}[package]
    )


def test_the_names_are_the_promised_ones() -> None:
    assert set(faultline.__all__) == STABLE
    assert all(hasattr(faultline, name) for name in STABLE)


def test_a_run_without_a_report_is_one_line(tmp_path: Path) -> None:
    with pytest.raises(faultline.ERRORS, match=r"report\.json: cannot be read: .*; expected the report of a flight"):
        faultline.read_run(tmp_path)


def test_tables_that_are_no_site_are_one_line() -> None:
    site = faultline.build_site() | {"inspection": {"speed_m_s": -1.0}}
    with pytest.raises(faultline.ERRORS, match=r"^site: inspection\.speed_m_s: [^\n]*$"):
        faultline.plan(site)


def test_another_projects_package_is_refused_before_it_is_loaded(tmp_path: Path) -> None:
    (tmp_path / "planner").mkdir()
    (tmp_path / "planner" / "__init__.py").write_text("raise SystemExit('loaded')\n", encoding="utf-8")
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join((str(tmp_path), str(ROOT)))}
    command = [sys.executable, "-c", "import faultline"]
    done = subprocess.run(command, cwd=tmp_path, env=environment, capture_output=True, text=True, check=False)
    assert done.stderr.splitlines()[-1].startswith("ImportError: faultline: planner: expected faultline's own package")


def test_the_package_is_thin() -> None:
    assert len((ROOT / "faultline" / "__init__.py").read_text(encoding="utf-8").splitlines()) < 200
