"""`bench verify`, `bench compare` and `bench instance`: what they check, keep and refuse."""

from __future__ import annotations

import json
import shutil
from pathlib import Path
from typing import Any

import pytest

from benchmarks.dataset.catalogue import PACKAGE, find_instances, load_entry, load_instance, solution_path
from benchmarks.dataset.checker import bound_minmax, check
from benchmarks.dataset.compare import Answer, Effort, keep_if_better, prove, solve_by_all
from benchmarks.dataset.verify import has_failed, report_verification, verify_entry, verify_package
from benchmarks.errors import BenchError
from executor.cli.main import main

SMALL = "tree-18-3"


def untold(stage: str, done: int, total: int) -> None:
    """Show no progress."""


@pytest.fixture
def package(tmp_path: Path) -> Path:
    """A package with one instance and its solutions."""
    for folder, name in (("instances", f"{SMALL}.json"), ("solutions", f"{SMALL}.minsum.json")):
        (tmp_path / folder).mkdir()
        shutil.copy(PACKAGE / folder / name, tmp_path / folder / name)
    return tmp_path


def change(path: Path, **values: Any) -> None:
    path.write_text(json.dumps({**json.loads(path.read_text(encoding="utf-8")), **values}), encoding="utf-8")


def test_every_best_known_solution_of_the_project_holds() -> None:
    content = verify_package(None, untold, proofs=False)
    assert [row for row in content["rows"] if row["wrong"]] == []
    assert content["changed"] == []
    assert {"minmax", "minsum", "window"} <= {row["objective"] for row in content["rows"]}


def test_a_proof_is_made_again(package: Path) -> None:
    content = verify_package(None, untold, folder=package)
    assert [(row["proof"], row["proof_again"]) for row in content["rows"]] == [("optimal: exact", "yes")]
    assert not has_failed(content)
    assert "1 of 1 best known solutions are valid" in report_verification(content).lines[1]


def test_a_claim_that_does_not_hold_is_a_failure(package: Path) -> None:
    path = solution_path(SMALL, "minsum", package)
    value = load_entry(path).solution.value
    assert value is not None
    change(path, value=value - 1.0)
    content = verify_package(None, untold, folder=package)
    assert has_failed(content)
    assert content["rows"][0]["wrong"][0].startswith("value: is")
    change(path, value=value, proof={"kind": "bound", "value": value + 1.0, "by": "exact"})
    assert verify_package(None, untold, folder=package)["rows"][0]["wrong"][0].startswith("proof: says at least")


def test_a_proof_that_nobody_here_can_make_is_said_to_be_so(package: Path) -> None:
    path = solution_path(SMALL, "minsum", package)
    change(path, proof={"kind": "bound", "value": 1.0, "by": "another program"})
    verdict = verify_entry(load_instance(package / "instances" / f"{SMALL}.json"), load_entry(path))
    assert (verdict.again, verdict.wrong) == ("not here", ())
    assert verdict.proof.startswith("bound 1.000 (gap ")


def test_only_a_better_solution_replaces_the_best_known(package: Path) -> None:
    instance, path = load_instance(package / "instances" / f"{SMALL}.json"), solution_path(SMALL, "minsum", package)
    before = path.read_bytes()
    answers = solve_by_all(instance, "minsum", Effort(1.0, iterations=2_000, peers=False))
    assert not keep_if_better(instance, "minsum", answers, package)
    assert path.read_bytes() == before
    path.unlink()
    assert keep_if_better(instance, "minsum", answers, package)
    entry = load_entry(path)
    assert check(instance, entry.solution)[1] == []
    assert entry.found["program"].startswith("faultline at ")
    assert not keep_if_better(instance, "minsum", [Answer("nobody", None, 0.0)], package)


def test_an_answer_for_the_window_brings_its_repairs() -> None:
    instance = find_instances([SMALL], None)[0]
    answer = solve_by_all(instance, "window", Effort(1.0, iterations=3_000, peers=False))[0]
    assert answer.content is not None
    assert answer.content["repairs"]
    assert answer.value is not None
    assert instance.longest_s is not None
    assert 0 <= answer.value < instance.longest_s


def test_a_value_that_equals_its_bound_is_proven_by_it() -> None:
    instance = find_instances(["line-33-4"], None)[0]
    least = bound_minmax(instance)
    assert prove(instance, "window", 1.0) == {"kind": "none"}
    assert prove(instance, "minmax", least) == {"kind": "optimal", "by": "checker"}
    assert prove(instance, "minmax", least + 1) == {"kind": "bound", "value": round(least, 6), "by": "checker"}


def test_what_is_unknown_is_refused_in_a_line() -> None:
    with pytest.raises(BenchError, match="nowhere-1-1: expected a file, or the name of an instance"):
        find_instances(["nowhere-1-1"], None)
    with pytest.raises(BenchError, match=r"paper-500-0.86: expected --data DIR with nechranice_graph"):
        find_instances(["paper-500-0.86"], None)


def called(capsys: pytest.CaptureFixture[str], *arguments: str) -> tuple[int | str | None, str, str]:
    with pytest.raises(SystemExit) as ended:
        main(["bench", *arguments])
    said = capsys.readouterr()
    return ended.value.code, said.out, said.err


def test_the_command_makes_an_instance_of_the_package_again(capsys: pytest.CaptureFixture[str]) -> None:
    path = PACKAGE / "instances" / f"{SMALL}.json"
    source = json.loads(path.read_text(encoding="utf-8"))["source"].split()
    code, out, _ = called(capsys, *source[2:])
    assert (code, out) == (0, path.read_text(encoding="utf-8"))


def test_cities_become_segments_of_no_length(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    cities = tmp_path / "four.tsp"
    places = "1 0 0\n2 3 4\n3 6 8\n4 0 8\n"
    cities.write_text(
        f"NAME: four\nDIMENSION: 4\nEDGE_WEIGHT_TYPE: EUC_2D\nNODE_COORD_SECTION\n{places}EOF\n", encoding="utf-8"
    )
    code, _, _ = called(capsys, "instance", str(cities), "--vehicles", "2", "-o", str(tmp_path / "four.json"))
    made = load_instance(tmp_path / "four.json")
    assert (code, made.name, made.vehicles) == (0, "four-2", 2)
    assert made.segments_m[0] == ((3.0, 4.0), (3.0, 4.0))
    code, _, err = called(capsys, "instance", "hexagon")
    assert code == 2
    assert "hexagon: expected a file, or one of line, ring, tree, grid" in err
