"""TSPLIB files: what is read, and what is refused in one line."""

from __future__ import annotations

from pathlib import Path

import pytest

from benchmarks.errors import BenchError
from benchmarks.problems import cities_problem
from benchmarks.tsplib import read_tsplib
from planner import Cost, Plan, Route, evaluate

SQUARE = """NAME : square
TYPE : TSP
DIMENSION : 4
EDGE_WEIGHT_TYPE : EUC_2D
NODE_COORD_SECTION
7 0 0
3 0.0 10.5
1 1.0e1 10.5
9 10 0
EOF
"""


def written(folder: Path, text: str) -> Path:
    path = folder / "square.tsp"
    path.write_text(text, encoding="utf-8")
    return path


def test_cities_keep_their_numbers_and_places(tmp_path: Path) -> None:
    cities = read_tsplib(written(tmp_path, SQUARE))
    assert cities.name == "square"
    assert cities.numbers == (7, 3, 1, 9)
    assert cities.places.tolist() == [[0, 0], [0, 10.5], [10, 10.5], [10, 0]]


def test_the_end_mark_may_be_missing(tmp_path: Path) -> None:
    assert len(read_tsplib(written(tmp_path, SQUARE.replace("EOF\n", ""))).numbers) == 4


def test_a_plan_costs_its_length_from_the_first_city_and_back(tmp_path: Path) -> None:
    problem = cities_problem(written(tmp_path, SQUARE), vehicles=1)
    tour = Plan((Route(0, (0, 2, 5)),))
    assert evaluate(problem.instance, tour, Cost.MINSUM).value == pytest.approx(41.0)
    assert problem.visits(tour.routes[0]) == [3, 1, 9]


@pytest.mark.parametrize(
    ("old", "new", "names"),
    [
        ("EUC_2D", "GEO", "EDGE_WEIGHT_TYPE: expected EUC_2D, got GEO"),
        ("DIMENSION : 4", "DIMENSION : 5", "DIMENSION: expected 4"),
        ("NODE_COORD_SECTION", "DISPLAY_DATA_SECTION", "NODE_COORD_SECTION"),
        ("3 0.0 10.5", "3 0.0", "line 7: expected a city's number and two coordinates"),
        ("3 0.0 10.5", "3 0.0 nan", "line 7"),
        ("3 0.0 10.5", "7 0.0 10.5", "each city once"),
    ],
)
def test_a_file_that_cannot_be_used_is_refused(tmp_path: Path, old: str, new: str, names: str) -> None:
    with pytest.raises(BenchError, match=names):
        read_tsplib(written(tmp_path, SQUARE.replace(old, new)))


def test_a_file_that_is_not_there_is_refused(tmp_path: Path) -> None:
    with pytest.raises(BenchError, match=r"nowhere\.tsp: expected a readable"):
        read_tsplib(tmp_path / "nowhere.tsp")
