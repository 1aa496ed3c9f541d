"""A whole small table on faultline's own network, end to end and interrupted."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest

from benchmarks.store import Store
from benchmarks.table.cells import PlanFigures
from benchmarks.table.make import Maker
from benchmarks.table.settings import TableSettings
from benchmarks.table.tasks import TableTask, TaskKind, do
from executor.cli.main import main
from executor.site.site_planning import PlanSolver
from planner import Cost

TINY = TableSettings(None, radii_m=(500.0,), tightness=(0.8,), seeds=2, iterations=200)


def made(folder: Path, *more: str) -> Any:
    with pytest.raises(SystemExit) as ended:
        main(["bench", "table", "--network", "default", "--radius", "500", "--tightness", "0.8", "--seeds", "2",
              "--iterations", "200", "--jobs", "1", "--out", str(folder), *more])  # fmt: skip
    assert ended.value.code == 0
    return json.loads((folder / "table.json").read_text(encoding="utf-8"))


def test_a_table_is_made_and_resumes_where_it_stopped(tmp_path: Path) -> None:
    first = made(tmp_path)
    (cell,) = first["cells"]
    assert cell["c_max_pct"] == pytest.approx(min(
        plan["longest_pct"] for series in cell["series"] if series["cost"] == "minmax" for plan in series["plans"]
    ) / 0.8)  # fmt: skip
    assert [len(series["plans"]) for series in cell["series"]] == [2] * 6
    assert [one["stretch"] for one in cell["windows"]] == [0.0, 0.05, 0.1, 0.2]
    for one in (*cell["windows"], *(against["chosen"] for against in cell["against"])):
        assert one["plan"]["feasible"]
        assert one["plan"]["longest_s"] <= (1 + one["stretch"]) * cell["minmax_s"] + 1e-6
        assert cell["least_earliest_s"] <= one["plan"]["earliest_s"] + 1e-6
        assert one["plan"]["certified_earliest_s"] <= one["plan"]["earliest_s"] + 1e-6
    assert (tmp_path / "table.png").stat().st_size > 10_000
    assert "## 500 m" in (tmp_path / "table.md").read_text(encoding="utf-8")

    # Interrupted after all but one piece: that one alone is made again, and is the same.
    pieces = sorted((tmp_path / "table").glob("plan-500-0.8-*.json"))
    changed = json.loads(pieces[0].read_text(encoding="utf-8"))
    changed["result"]["longest_s"] = 1234.5
    pieces[0].write_text(json.dumps(changed), encoding="utf-8")
    pieces[1].unlink()
    kept = made(tmp_path)
    longest = [plan["longest_s"] for series in kept["cells"][0]["series"] for plan in series["plans"]]
    assert 1234.5 in longest
    assert pieces[1].is_file()
    assert made(tmp_path, "--fresh")["cells"] == first["cells"]


def test_the_told_progress_counts_what_is_there(tmp_path: Path) -> None:
    told: list[tuple[str, int, int]] = []
    maker = Maker(TINY, Store(tmp_path), 1, lambda *what: told.append(what))
    task = TableTask(TaskKind.BOUND, 500.0, 0.8, 100.0)
    maker.make_all("bounds", [task])
    maker.make_all("bounds", [task])
    assert told == [("bounds", 0, 1), ("bounds", 1, 1), ("bounds", 1, 1)]


def test_a_plan_beyond_its_budget_has_no_window() -> None:
    free = do(TableTask(TaskKind.PLAN, 500.0, cost=Cost.MINMAX, solver=PlanSolver.GRASP), TINY)
    routes = tuple(tuple(route) for route in free["routes"])
    task = TableTask(TaskKind.WINDOW, 500.0, 0.8, 0.9 * free["longest_pct"], routes=routes)
    figures = PlanFigures.from_content(do(task, TINY))
    assert not figures.feasible
    assert figures.window_pct == 0
