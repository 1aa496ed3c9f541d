"""Programs of others: the files that they get, and their answers as routes; a small fake stands for each."""

from __future__ import annotations

import sys
from dataclasses import replace
from pathlib import Path

import pytest

from benchmarks.dataset.checker import Instance, Routes, Solution, check
from benchmarks.dataset.compare import Effort, solve_by_all
from benchmarks.dataset.generator import generate_instance
from benchmarks.dataset.peers import solve_hgs, solve_lkh
from benchmarks.errors import BenchError

LKH = """
keys = dict(line.split(" = ") for line in open("problem.par").read().splitlines())
text = open("problem.tsp").read()
size = int(text.partition("DIMENSION : ")[2].split()[0])
fixed = text.partition("FIXED_EDGES_SECTION")[2].split("-1")[0].split()
assert keys["MTSP_OBJECTIVE"] == "MINMAX" or "DISTANCE : " in text
pairs = list(zip(fixed[::2], fixed[1::2])) or [(str(city),) for city in range(2, size + 1)]
tours = [[], []]
for number, pair in enumerate(pairs):
    tours[number % 2] += reversed(pair) if number == 2 else pair
with open(keys["MTSP_SOLUTION_FILE"], "w") as out:
    print("problem, Cost: 1_2", "The tours traveled by the 2 salesmen are:", sep="\\n", file=out)
    for tour in tours:
        print("1", *tour, "1 (#3)  Cost: 5", file=out)
"""
"""Gives the segments to two vehicles in turn; the third one it flies backwards."""
HGS = """
import sys
place = sys.argv[sys.argv.index("-sol") + 1]
assert sys.argv[sys.argv.index("-type") + 1] == "35"
count = int(open("problem").read().partition("ARISTAS_REQ : ")[2].split()[0])
with open(place, "w") as out:
    print(5, 1, 0.1, 0.1, sep="\\n", file=out)
    ends = {n: (2 * n + 1, 2 * n) if n == 2 else (2 * n, 2 * n + 1) for n in range(1, count + 1)}
    services = [f"(S {n},{first},{last})" for n, (first, last) in ends.items()]
    print(" 0 1 1 0 5  9 (D 0,1,1)", *services, "(D 0,1,1)", file=out)
"""
"""Gives all segments to one vehicle; the second one it flies backwards."""


def program(folder: Path, text: str) -> Path:
    path = folder / "program"
    path.write_text(f"#!{sys.executable}\n{text}", encoding="utf-8")
    path.chmod(0o755)
    return path


@pytest.fixture
def instance() -> Instance:
    return generate_instance("tree", 5, 2, seed=3, budget_pct=500.0)


def is_valid(instance: Instance, routes: Routes | None) -> bool:
    return routes is not None and not check(instance, Solution(instance.name, "minmax", None, routes, ()))[1]


@pytest.mark.parametrize("objective", ["minmax", "minsum"])
def test_two_cities_of_a_tour_are_a_segment_with_its_direction(
    tmp_path: Path, instance: Instance, objective: str
) -> None:
    routes = solve_lkh(program(tmp_path, LKH), instance, objective, seconds=1, seed=1)
    assert routes == ((1, -3, 5), (2, 4))
    assert is_valid(instance, routes)


def test_a_segment_of_no_length_is_one_city(tmp_path: Path, instance: Instance) -> None:
    cities = replace(instance, segments_m=tuple((last, last) for _, last in instance.segments_m))
    assert solve_lkh(program(tmp_path, LKH), cities, "minmax", seconds=1, seed=1) == ((1, 3, 5), (2, 4))
    assert solve_hgs(program(tmp_path, HGS), cities, seconds=1, seed=1) is None


def test_a_service_is_a_segment_with_its_direction(tmp_path: Path, instance: Instance) -> None:
    routes = solve_hgs(program(tmp_path, HGS), instance, seconds=1, seed=1)
    assert routes == ((1, -2, 3, 4, 5), ())
    assert is_valid(instance, routes)


def test_a_program_that_writes_nothing_or_nonsense_has_no_answer(tmp_path: Path, instance: Instance) -> None:
    assert solve_lkh(program(tmp_path, "raise SystemExit(1)"), instance, "minmax", seconds=1, seed=1) is None
    nonsense = 'open("routes.txt", "w").write("a\\nb\\n1 x y 1 (#2)\\n")'
    assert solve_lkh(program(tmp_path, nonsense), instance, "minmax", seconds=1, seed=1) is None
    with pytest.raises(BenchError, match="expected a program that can be run"):
        solve_lkh(tmp_path / "missing", instance, "minmax", seconds=1, seed=1)


def test_each_answer_is_checked(tmp_path: Path, instance: Instance) -> None:
    """The fake HGS-CARP puts all into one route, which exceeds a tight budget."""
    tight = replace(instance, budget_pct=90.0)
    (tmp_path / "a").mkdir()
    (tmp_path / "b").mkdir()
    effort = Effort(1.0, iterations=500, lkh=program(tmp_path / "a", LKH), hgs=program(tmp_path / "b", HGS))
    answers = {one.program: one for one in solve_by_all(tight, "minmax", effort)}
    assert set(answers) == {"faultline", "LKH-3", "HGS-CARP"}
    assert answers["HGS-CARP"].value is None
    assert "of the budget of 90.000000 %" in answers["HGS-CARP"].refused
    assert answers["faultline"].value is not None
