"""Public failure scenarios: read, solved by the rules, judged, and what is wrong in one is a line."""

from __future__ import annotations

import copy
import json
import runpy
import subprocess
import sys
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from typer.testing import CliRunner

from benchmarks.commands import cli
from benchmarks.data import find_shared_folder
from benchmarks.errors import BenchError
from benchmarks.failures import families, scenario_files, solve_scenario
from benchmarks.failurespage import failures_document, report_failures
from benchmarks.least import least_value
from benchmarks.scenario import Scenario, day_of, initial_timelines, read_scenario, wrong_with
from benchmarks.scenarios import TimedTrip
from benchmarks.store import Json
from planner import Iterations
from tests.patience import PATIENCE_S

GRID: Json = {
    "name": "grid.1",
    "depots": [11, 33],
    "capacity": 9.0,
    "recharge": 18.0,
    "edges": [
        [11, 12, 2.0, 1],
        [12, 13, 2.5, 1],
        [13, 33, 2.0, 0],
        [12, 22, 1.0, 1],
        [22, 33, 3.0, 1],
        [12, 11, 4.0, 0],
    ],
    "start": [11, 33],
    "failures": [{"vehicle": 2, "at": 6.0}],
    "initial": [[[11, 12, 13, 33]], [[33, 22, 12, 11]]],
    "published": {"before": 6.5, "after": 40.0, "seconds": 0.2},
}
"""Two vehicles over a line with a bow; the second is lost in the air, with two edges that only it had done."""
STOP = Iterations(300)


def scenario(**changes: Any) -> Scenario:
    return Scenario.model_validate({**copy.deepcopy(GRID), **changes})


def write(folder: Path, content: object, name: str = "grid.1.json") -> Path:
    path = folder / name
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(json.dumps(content), encoding="utf-8")
    return path


def test_the_survivor_does_what_the_lost_one_had_on_board() -> None:
    solved = solve_scenario(scenario(), STOP, seed=1)
    assert (solved.left, solved.wrong, len(solved.replan_s)) == (0, (), 1)
    # It lands at 33 at 6.5, is ready at 24.5, and needs 22-33 and 12-22: 3 + 1 + 2 to the other depot.
    assert solved.value_s == 24.5 + 6.0
    first, last = solved.solution["history"]
    assert first == {
        "at": 0.0,
        "trips": [[{"start": 0.0, "nodes": [11, 12, 13, 33]}], [{"start": 0.0, "nodes": [33, 22, 12, 11]}]],
    }
    assert last["at"] == 6.0
    assert last["trips"] == [[first["trips"][0][0], {"start": 24.5, "nodes": [33, 22, 12, 11]}], []]


def test_losses_come_in_the_order_of_their_times() -> None:
    both = scenario(failures=[{"vehicle": 2, "at": 30.0}, {"vehicle": 1, "at": 3.0}])
    solved = solve_scenario(both, STOP, seed=1)
    assert [entry["at"] for entry in solved.solution["history"]] == [0.0, 3.0, 30.0]
    # The second landed at 6 and was ready at 24: by 30 its first trip counts, the one under way does not.
    assert solved.solution["history"][-1]["trips"] == [[], [{"start": 0.0, "nodes": [33, 22, 12, 11]}]]
    assert solved.left == 1
    assert solved.wrong == ()


def test_what_breaks_a_rule_is_named() -> None:
    one = scenario()
    day = day_of(one)
    first = initial_timelines(one, day)
    begun = first[0]
    early, long = TimedTrip(5.0, 6.0, (4, 3, 1, 0)), day.time_walks([(4, 2, 1, 2, 4)], 24.5)
    cases = {
        ((TimedTrip(0.0, 2.0, (0, 1)),), ()): "vehicle 1: what had begun was changed",
        (begun, first[1]): "vehicle 2: is lost and flies on",
        ((*begun, early), ()): "vehicle 1: trip 2 begins too early",
        ((*begun, *day.time_walks([(0, 1, 0)], 30.0)), ()): "vehicle 1: trip 2 does not lead from where the vehicle is",
        ((*begun, *day.time_walks([(4, 3, 1, 2)], 30.0)), ()): "to a depot",
        ((*begun, *day.time_walks([(4, 3, 1, 0, 1, 0)], 30.0)), ()): "trip 2 takes 10 s of 9 s",
        ((*begun, replace(long[0], lasts_s=1.0)), ()): "trip 2 takes 9 s of 9 s",
    }
    for after, said in cases.items():
        assert any(said in line for line in wrong_with(one, day, (first, after))), said
    assert list(wrong_with(one, day, (first, (begun, ())))) == []


@pytest.mark.parametrize(
    ("key", "value", "said"),
    [
        ("depots", [], "depots: expected at least one depot"),
        ("depots", [99], "depots[0]: expected a place of an edge, got 99"),
        ("start", [11, "33"], "start[1]: expected a whole number, got '33'"),
        ("start", [11, 5], "start[1]: expected a place of an edge, got 5"),
        ("capacity", -1, "capacity: expected"),
        ("recharge", None, "recharge: expected a number, got None"),
        ("edges", [[11, 12, 2.0]], "edges[0][3]: expected one more value"),
        ("edges", [[11, 11, 2.0, 1], [11, 33, 1.0, 1]], "edges[0]: expected two places, got 11 twice"),
        ("edges", [[11, 33, -2.0, 1]], "edges[0][2]: expected"),
        ("failures", [{"vehicle": 3, "at": 1.0}], "failures[0].vehicle: expected one of 2, each once, got 3"),
        ("failures", [{"vehicle": 1, "at": 1.0}] * 2, "failures[1].vehicle: expected one of 2, each once, got 1"),
        ("failures", [{"at": 1.0}], "failures[0].vehicle: expected this key, but it is missing"),
        ("initial", [[]], "initial: expected the trips of 2 vehicles, got 1"),
        ("initial", [[[11, 33]], []], "initial[0][0]: expected places along edges, got [11, 33]"),
    ],
)
def test_a_scenario_that_cannot_be_used_is_one_line(tmp_path: Path, key: str, value: object, said: str) -> None:
    path = write(tmp_path, {**GRID, key: value})
    with pytest.raises(BenchError) as refused:
        read_scenario(path)
    text = str(refused.value)
    assert text.startswith(f"{path}: {said}")
    assert "\n" not in text


def test_files_that_are_none_are_one_line(tmp_path: Path) -> None:
    with pytest.raises(BenchError, match=r"none.json: file: expected a readable failure scenario"):
        read_scenario(tmp_path / "none.json")
    broken = tmp_path / "broken.json"
    broken.write_text("{", encoding="utf-8")
    with pytest.raises(BenchError, match=r"broken.json: line 1: expected JSON"):
        read_scenario(broken)
    with pytest.raises(BenchError, match=r"failures: expected failure scenarios"):
        scenario_files(tmp_path)


def test_one_scenario_from_the_command_line(tmp_path: Path) -> None:
    path, out = write(tmp_path, GRID), tmp_path / "solution.json"
    asked = ["failures", "--instance", str(path), "-o", str(out), "--seconds", "0.05"]
    shown = CliRunner().invoke(cli, [*asked, "--json"])
    assert shown.exit_code == 0
    found = json.loads(shown.stdout)
    assert (found["value"], found["published"], len(found["replan_s"]), found["left"]) == (30.5, 40.0, 1, 0)
    assert len(json.loads(out.read_text(encoding="utf-8"))["history"]) == 2
    assert "the last trip ends at 30.5, published 40" in CliRunner().invoke(cli, asked).stdout
    nobody = write(tmp_path, {**GRID, "failures": [{"vehicle": 1, "at": 1.0}, {"vehicle": 2, "at": 2.0}]})
    alone = CliRunner().invoke(cli, ["failures", "--instance", str(nobody), "--seconds", "0.05"])
    assert alone.exit_code == 1
    assert "4 required edges are left over" in alone.stdout


def test_all_scenarios_make_a_page(tmp_path: Path) -> None:
    write(tmp_path / "failures", GRID, "grid.10.json")
    write(tmp_path / "failures", {**GRID, "name": "grid.2", "published": {}}, "grid.2.json")
    shown = CliRunner().invoke(
        cli, ["failures", "--data", str(tmp_path), "--out", str(tmp_path / "out"), "--seconds", "0.05", "--json"]
    )
    assert shown.exit_code == 0
    content = json.loads(shown.stdout)
    assert [row["name"] for row in content["rows"]] == ["grid.2", "grid.1"]  # files by number
    assert len(scenario_files(tmp_path, "grid")) == 2
    with pytest.raises(BenchError, match=r"expected failure scenarios \(gri\."):
        scenario_files(tmp_path, "gri")
    (family,) = content["families"]
    assert (family["scenarios"], family["valid"], family["compared"], family["not_longer"]) == (2, 2, 1, 1)
    assert (family["sum"], family["published_sum"]) == (30.5, 40.0)
    page = (tmp_path / "out" / "failures.md").read_text(encoding="utf-8")
    assert "| grid.1 | 1 | 30 | 40 | -23.8 % |" in page
    assert "Not valid" not in page
    assert json.loads((tmp_path / "out" / "failures.json").read_text(encoding="utf-8")) == content


def test_what_no_answer_can_fall_below_is_proven(tmp_path: Path) -> None:
    path = write(tmp_path / "failures", GRID)
    asked = ["failures", "--seconds", "0.05", "--prove", "5"]
    shown = CliRunner().invoke(cli, [*asked, "--instance", str(path)])
    assert "no answer can end before 30.5, proven" in shown.stdout
    shown = CliRunner().invoke(cli, [*asked, "--data", str(tmp_path), "--out", str(tmp_path), "--json"])
    content = json.loads(shown.stdout)
    assert content["rows"][0]["least"] == 30.5
    (family,) = content["families"]
    assert (family["proven"], family["least_possible"], family["least_sum"]) == (1, 1, 30.5)
    page = (tmp_path / "failures.md").read_text(encoding="utf-8")
    assert "| grid | 1 | 1 of 1 | 30 | 30 | 40 | -23.8 % |" in page
    assert content["command"].endswith("--prove 5")


def test_a_bound_knows_what_comes_and_what_is_under_way(monkeypatch: pytest.MonkeyPatch) -> None:
    assert least_value(scenario(failures=[]), 5.0) == 6.5
    # The other is lost as well, before it could bring its second trip home: only its first counts.
    both = scenario(failures=[{"vehicle": 2, "at": 30.0}, {"vehicle": 1, "at": 6.0}])
    assert least_value(both, 5.0) == float("inf")
    monkeypatch.setattr("benchmarks.scenarios.least_end.MOST_COLUMNS", 1)
    assert least_value(scenario(), 5.0) == 6.5


def test_missing_data_is_reported(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("benchmarks.data.ROOT", tmp_path)
    monkeypatch.chdir(tmp_path)
    shown = CliRunner().invoke(cli, ["failures"])
    assert shown.exit_code == 0
    assert "the failure scenarios are left out: no ../shared/data" in shown.output


def test_what_is_not_valid_is_on_the_page(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    row = {**solve_scenario(scenario(), STOP, seed=1).row, "wrong": ["at 6 s, vehicle 1: flies off"], "value": 45.0}
    content = failures_document([row], "faultline bench failures", 0.5, 100, 1)
    assert content["families"] == families([row])
    assert (content["families"][0]["valid"], content["families"][0]["not_longer"]) == (0, 0)
    assert "- grid.1: at 6 s, vehicle 1: flies off" in report_failures(content).page()
    report_failures(content).keep(tmp_path)
    report_failures(content).show()
    assert "grid" in capsys.readouterr().out


def test_the_public_checker_takes_every_answer() -> None:
    """As little search as there can be: what is valid must not depend on it."""
    data, tools = find_shared_folder(None, "data", ""), find_shared_folder(None, "tools", "")
    if data is None or tools is None or not (data / "failures").is_dir():
        pytest.skip("no ../shared/data/failures and ../shared/tools beside the project")
    check = runpy.run_path(str(tools / "check_failures.py"))["check"]
    for path in scenario_files(data):
        solved = solve_scenario(read_scenario(path), Iterations(200), seed=1)
        bad, value, missing = check(json.loads(path.read_text(encoding="utf-8")), solved.solution)
        assert (bad, missing) == ([], 0), path.stem
        assert value == pytest.approx(solved.value_s), path.stem


@pytest.mark.parametrize("name", ["gdb.3", "bccm.1", "bccm.37"])
def test_the_public_checker_takes_the_solutions(name: str, tmp_path: Path) -> None:
    data, tools = find_shared_folder(None, "data", ""), find_shared_folder(None, "tools", "")
    if data is None or tools is None or not (data / "failures").is_dir():
        pytest.skip("no ../shared/data/failures and ../shared/tools beside the project")
    path = data / "failures" / f"{name}.json"
    solved = solve_scenario(read_scenario(path), Iterations(2_000), seed=1)
    out = write(tmp_path, solved.solution, "solution.json")
    checked = subprocess.run(
        [sys.executable, tools / "check_failures.py", path, out],
        capture_output=True,
        text=True,
        check=False,
        timeout=PATIENCE_S,
    )
    assert checked.returncode == 0, checked.stdout
    assert json.loads(checked.stdout)["makespan"] == pytest.approx(solved.value_s)
    assert solved.value_s <= (solved.scenario.published.after or 0.0)
