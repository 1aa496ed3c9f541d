"""`faultline bench solvers` with one instance: its JSON, and what it refuses."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from benchmarks.data import CSUM, MTSP, NECHRANICE, data_directory
from benchmarks.problems import AUTHORS_S, cities_problem, line_instance, network_of, read_problem
from benchmarks.single import single_result
from executor.cli.main import main
from executor.site.site_planning import PlanSolver
from missions import MissionsError
from planner import Cost, Instance, Iterations, Plan, Route, evaluate, solve, visit_of
from tests.benchmarks.test_tsplib import SQUARE, written


def data() -> Path:
    found = data_directory(None)
    if found is None:
        pytest.skip(f"{MTSP} and {NECHRANICE} are not in ../shared/data beside the project")
    return found


def called(capsys: pytest.CaptureFixture[str], *arguments: str) -> tuple[int | str | None, str, str]:
    with pytest.raises(SystemExit) as ended:
        main(["bench", "solvers", *arguments])
    said = capsys.readouterr()
    return ended.value.code, said.out, said.err


def test_cities_give_their_tour_as_json(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = written(tmp_path, SQUARE)
    code, out, _ = called(capsys, "--instance", str(path), "--vehicles", "1", "--seconds", "0.1", "--json")
    result = json.loads(out)
    assert code == 0
    assert {"value", "routes", "seconds", "iterations"} <= result.keys()
    assert result["value"] == pytest.approx(41.0)
    assert sorted(result["routes"][0]) == [1, 3, 9]
    assert result["feasible"]
    assert result["uncovered"] == []


def test_a_network_gives_its_segments_within_the_budget(capsys: pytest.CaptureFixture[str]) -> None:
    code, out, _ = called(
        capsys, "--radius", "500", "--cost", "minsum", "--vehicles", "3", "--dynamics", "--seconds", "0.1", "--json"
    )
    result = json.loads(out)
    assert code == 0
    instance = line_instance(network_of(None, 500).ends_m, 3, AUTHORS_S)
    visits = [[visit_of(stop["segment"], stop["reversed"]) for stop in route] for route in result["routes"]]
    plan = Plan(tuple(Route(number, tuple(route)) for number, route in enumerate(visits)))
    again = evaluate(instance, plan, Cost.MINSUM)
    assert again.value == pytest.approx(result["value"])
    assert again.violations == ()


def test_what_the_budget_leaves_out_is_named(tmp_path: Path) -> None:
    problem = cities_problem(written(tmp_path, SQUARE), vehicles=1, budget=25.0)
    found = solve(problem.instance, cost=Cost.MINMAX, stop=Iterations(500))
    result = single_result(problem, PlanSolver.SEARCH, found)
    assert not result["feasible"]
    assert len(result["uncovered"]) == 2
    assert set(result["uncovered"]) < {1, 3, 9}


@pytest.mark.parametrize(
    ("arguments", "names"),
    [
        (["--instance", "nowhere.tsp"], "nowhere.tsp"),
        (["--instance", "nowhere.yaml"], "nowhere.yaml"),
        (["--radius", "1"], "no segment lies within 1 m"),
    ],
)
def test_bad_input_is_one_line_and_exit_2(arguments: list[str], names: str, capsys: pytest.CaptureFixture[str]) -> None:
    code, out, err = called(capsys, *arguments)
    assert (code, out) == (2, "")
    assert names in err
    assert err.count("\n") == 1


def test_a_graph_file_is_read_about_its_depot() -> None:
    problem = read_problem(data() / NECHRANICE, radius_m=500, vehicles=1, budget=None, dynamics=True)
    in_order = Plan((Route(0, tuple(range(0, 36, 2))),))
    assert problem.instance.segments == 18
    assert evaluate(problem.instance, in_order, Cost.MINSUM).value == pytest.approx(4651.688, abs=0.01)


@pytest.mark.parametrize("row", CSUM, ids=lambda row: f"{row.radius_m:g} m")
def test_the_references_are_for_as_many_segments_as_the_network_has(row) -> None:  # type: ignore[no-untyped-def]
    assert len(network_of(data() / NECHRANICE, row.radius_m).segments) == row.segments


def test_a_graph_file_without_a_connection_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "graph.yaml"
    path.write_text('pylons_position: "1 1 0;";\n', encoding="utf-8")
    with pytest.raises(MissionsError, match="connections_indexes"):
        network_of(path, None)


def test_the_best_known_tour_of_eil51_is_reached() -> None:
    instance: Instance = cities_problem(data() / "tsplib" / "eil51.tsp", vehicles=2).instance
    found = solve(instance, cost=Cost.MINMAX, stop=Iterations(40_000), seed=1)
    assert found.evaluation.value == pytest.approx(222.73, rel=5e-3)
    assert found.feasible
