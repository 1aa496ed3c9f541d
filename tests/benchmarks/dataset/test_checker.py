"""The checker alone: good solutions, each kind of broken one, and agreement with the planner's own definition."""

from __future__ import annotations

import json
import random
import subprocess
import sys
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from benchmarks.dataset import checker
from benchmarks.dataset.checker import (
    INSTANCE_FORMAT,
    SOLUTION_FORMAT,
    Instance,
    bound_minmax,
    bound_minsum,
    check,
    read_instance,
    read_solution,
)
from benchmarks.dataset.convert import build_plan, build_planner_instance, find_repairs, format_solution
from benchmarks.dataset.generator import SHAPES, generate_instance
from planner import Cost, Iterations, evaluate, replan_window, solve, solve_exact

CHECKER = Path(checker.__file__)
SQUARE: dict[str, Any] = {
    "format": INSTANCE_FORMAT,
    "name": "square",
    "vehicles": 2,
    "budget_pct": 60.0,
    "longest_s": 60.0,
    "speeds_m_s": {"transit": 10.0, "inspection": 5.0},
    "pct_per_s": {"transit": 1.0, "inspection": 2.0},
    "depot_m": [0.0, 0.0],
    "segments_m": [[[0.0, 0.0], [50.0, 0.0]], [[50.0, 0.0], [50.0, 50.0]], [[0.0, 50.0], [0.0, 0.0]]],
}
"""A segment takes 10 s and 20 %; from the end of the second home it is 7.07 s and %."""
GOOD: dict[str, Any] = {
    "format": SOLUTION_FORMAT,
    "instance": "square",
    "objective": "minsum",
    "routes": [[1, 2], [-3]],
}


def violations(solution: dict[str, Any], instance: dict[str, Any] = SQUARE) -> list[str]:
    return check(read_instance(instance), read_solution(solution))[1]


def test_the_values_of_a_solution_are_those_that_one_computes_by_hand() -> None:
    figures, wrong = check(read_instance(SQUARE), read_solution(GOOD))
    assert wrong == []
    assert figures is not None
    home = 50 * 2**0.5 / 10
    assert figures.minmax == pytest.approx(40 + home)
    assert figures.minsum == pytest.approx(40 + home + 20 + 5)
    assert figures.mincomb == pytest.approx(65 + home + (40 + home) / 2)
    assert figures.longest_s == pytest.approx(20 + home)


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"routes": [[1, 2], []]}, "routes: no route visits segment 3"),
        ({"routes": [[1, 2], [-3, 2]]}, "routes[1]: segment 2 is already in routes[0]"),
        ({"routes": [[1, 2], [-3, 4]]}, "routes[1]: visit 4 is no segment of 1 to 3"),
        ({"routes": [[1, 2], [-3, 0]]}, "routes[1]: visit 0 is no segment of 1 to 3"),
        ({"routes": [[1, 2, -3]]}, "routes: expected 2, one for each vehicle, got 1"),
        ({"routes": [[1, 2, 3], []]}, "routes[0]: takes 65.000000 % of the budget of 60.000000 %"),
        ({"instance": "circle"}, "instance: is 'circle', the instance's name is 'square'"),
        ({"value": 72.0}, "value: is 72.000000, the routes have 72.071068"),
        ({"objective": "window", "value": 0.0}, "repairs: no repair for the loss of vehicle 1 from 20.000 s"),
        ({"objective": "window", "routes": [[1, 2, -3], []]}, "routes[0]: takes 72.071068 % of the budget"),
    ],
)
def test_each_kind_of_violation_is_a_line(change: dict[str, Any], said: str) -> None:
    assert any(line.startswith(said) for line in violations({**GOOD, **change})), violations({**GOOD, **change})


def test_a_window_needs_a_limit_two_vehicles_and_a_route_within_it() -> None:
    window = {**GOOD, "objective": "window"}
    assert "no longest_s" in violations(window, {key: one for key, one in SQUARE.items() if key != "longest_s"})[0]
    assert "the longest takes 27.071 s" in violations(window, {**SQUARE, "longest_s": 27.0})[0]
    alone = {**SQUARE, "vehicles": 1, "budget_pct": 100.0, "segments_m": SQUARE["segments_m"]}
    assert "the only vehicle" in violations({**window, "routes": [[1, 2, -3]]}, alone)[-1]


BUSY = {**SQUARE, "budget_pct": 100.0}
WINDOW = {
    **GOOD,
    "objective": "window",
    "repairs": [
        {"lost": 1, "from_s": 20.0, "routes": {}},
        {"lost": 1, "from_s": 15.0, "routes": {"2": [2]}},
        {"lost": 1, "from_s": 10.0, "routes": {"2": [2]}},
        {"lost": 2, "from_s": 10.0, "routes": {}},
        {"lost": 1, "from_s": 0.0, "routes": {"2": [2, -1]}},
        {"lost": 2, "from_s": 0.0, "routes": {"1": [2, 3]}},
    ],
}
"""Events: 10 s (both end a visit), 15 s (vehicle 2 lands), 20 s, 27.07 s."""


def test_a_window_reaches_back_to_the_last_loss_that_no_repair_covers() -> None:
    figures, wrong = check(read_instance(BUSY), read_solution(WINDOW))
    assert wrong == []
    assert figures is not None
    assert figures.window == 0.0
    without = {**WINDOW, "repairs": [one for one in WINDOW["repairs"] if (one["lost"], one["from_s"]) != (2, 10.0)]}
    figures, wrong = check(read_instance(BUSY), read_solution(without))
    assert (figures and figures.window, wrong) == (15.0, [])
    assert violations({**without, "value": 15.0}, BUSY) == []
    assert violations({**without, "value": 10.0}, BUSY) == [
        "repairs: no repair for the loss of vehicle 2 from 10.000 s"
    ]


@pytest.mark.parametrize(
    ("place", "routes", "said"),
    [
        (1, {"2": []}, "repairs: the loss of vehicle 1 from 15.000 s leaves 1 segments open, its routes visit others"),
        (
            1,
            {"2": [2, 3]},
            "repairs: the loss of vehicle 1 from 15.000 s leaves 1 segments open, its routes visit others",
        ),
        (1, {"1": [2]}, "repairs: the loss of vehicle 1 from 15.000 s has a route of a vehicle that does not survive"),
        (1, {"3": [2]}, "repairs: the loss of vehicle 1 from 15.000 s has a route of a vehicle that does not survive"),
    ],
)
def test_a_repair_that_does_not_repair_is_named(place: int, routes: dict[str, list[int]], said: str) -> None:
    repairs = [{**one, "routes": routes} if n == place else one for n, one in enumerate(WINDOW["repairs"])]
    assert violations({**WINDOW, "value": 0.0, "repairs": repairs}, BUSY) == [said]


def test_a_survivor_that_has_landed_pays_for_its_second_flight_too() -> None:
    """Vehicle 2 has spent 25 % when it lands at 15 s; segment 2 takes another 5 + 20 + 7.07 %."""
    tight = {**BUSY, "budget_pct": 57.0}
    assert violations({**WINDOW, "value": 15.0}, tight) == [
        "repairs: after the loss of vehicle 1 from 15.000 s vehicle 2 exceeds its budget"
    ]
    assert violations({**WINDOW, "value": 10.0}, {**BUSY, "budget_pct": 57.1}) == []


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"format": "plan/1"}, "format: expected 'line-inspection-instance/1', got 'plan/1'"),
        ({"vehicles": 0}, "vehicles: expected a whole number from 1, got 0"),
        ({"vehicles": True}, "vehicles: expected a whole number from 1, got True"),
        ({"budget_pct": -1}, "budget_pct: expected more than 0, got -1"),
        ({"budget_pct": float("nan")}, "budget_pct: expected a number, got nan"),
        ({"speeds_m_s": {"transit": 5.0}}, "speeds_m_s.inspection: expected a number, got None"),
        ({"segments_m": []}, "segments_m: expected a list of one segment or more"),
        ({"segments_m": [[[0.0, 0.0]]]}, "segments_m[0]: expected two places"),
        ({"depot_m": [1.0]}, "depot_m: expected two numbers, east and north in metres"),
        ({"name": ""}, "name: expected a text"),
    ],
)
def test_a_bad_instance_is_one_line_with_its_key(change: dict[str, Any], said: str) -> None:
    with pytest.raises(checker.BadFileError) as refused:
        read_instance({**SQUARE, **change})
    assert str(refused.value) == said


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"objective": "best"}, "objective: expected one of minmax, minsum, mincomb, window, got 'best'"),
        ({"routes": [[1.5]]}, "routes[0]: expected a whole number, got 1.5"),
        ({"routes": {}}, "routes: expected a list with a list of visits for each vehicle"),
        ({"value": "12"}, "value: expected a number, got '12'"),
        ({"repairs": [{"lost": 0}]}, "repairs[0].routes: expected an object with keys"),
        ({"repairs": [{"lost": 0, "from_s": 0, "routes": {}}]},
         "repairs[0].lost: expected a whole number from 1, got 0"),
        ({"repairs": [{"lost": 1, "from_s": 0, "routes": {"a": []}}]},
         "repairs[0].routes: expected the numbers of vehicles as keys"),
    ],
)  # fmt: skip
def test_a_bad_solution_is_one_line_with_its_key(change: dict[str, Any], said: str) -> None:
    with pytest.raises(checker.BadFileError) as refused:
        read_solution({**GOOD, **change})
    assert str(refused.value) == said


def run(folder: Path, instance: object, solution: object) -> tuple[int, str, str]:
    """Run the checker as a researcher does, without this project and without any installed package."""
    paths = folder / "instance.json", folder / "solution.json"
    for path, content in zip(paths, (instance, solution), strict=True):
        path.write_text(content if isinstance(content, str) else json.dumps(content), encoding="utf-8")
    done = subprocess.run(
        [sys.executable, "-I", "-S", CHECKER, *paths], cwd=folder, capture_output=True, text=True, check=False
    )
    return done.returncode, done.stdout, done.stderr


def test_it_runs_alone_and_its_exit_code_tells(tmp_path: Path) -> None:
    code, out, _ = run(tmp_path, SQUARE, GOOD)
    assert (code, out.splitlines()[0]) == (0, "valid: square, minsum 72.071068")
    code, out, _ = run(tmp_path, SQUARE, {**GOOD, "routes": [[1, 2], []]})
    assert code == 1
    assert out == f"invalid: {tmp_path / 'solution.json'}: routes: no route visits segment 3\n"
    code, out, err = run(tmp_path, SQUARE, "{")
    assert (code, out) == (2, "")
    assert err.startswith(f"{tmp_path / 'solution.json'}: expected a readable JSON file")
    assert checker.main([]) == 2


@st.composite
def planned(draw: st.DrawFn) -> tuple[Instance, list[list[int]]]:
    """Return a random instance, and random routes that visit every segment once."""
    shape, segments = draw(st.sampled_from(sorted(SHAPES))), draw(st.integers(3, 12))
    vehicles, seed = draw(st.integers(1, 4)), draw(st.integers(0, 10_000))
    chance = random.Random(seed)
    instance = generate_instance(shape, segments, vehicles, seed=seed, budget_pct=round(chance.uniform(20, 400), 1))
    visits = [segment * chance.choice((1, -1)) for segment in range(1, segments + 1)]
    chance.shuffle(visits)
    routes: list[list[int]] = [[] for _ in range(vehicles)]
    for visit in visits:
        chance.choice(routes).append(visit)
    return instance, routes


@given(planned())
def test_the_planner_gives_every_plan_the_same_values(drawn: tuple[Instance, list[list[int]]]) -> None:
    instance, routes = drawn
    solution = {"format": SOLUTION_FORMAT, "instance": instance.name, "objective": "minmax", "routes": routes}
    figures, wrong = check(instance, read_solution(solution))
    theirs, plan = build_planner_instance(instance), build_plan(routes)
    assert figures is not None
    longest = evaluate(theirs, plan, Cost.MINMAX)
    assert figures.minmax == pytest.approx(longest.value)
    assert figures.longest_s == pytest.approx(longest.longest_route_s)
    assert len(wrong) == len(longest.violations)
    if not wrong:
        assert figures.minsum == pytest.approx(evaluate(theirs, plan, Cost.MINSUM).value)
        assert figures.mincomb == pytest.approx(evaluate(theirs, plan, Cost.MINCOMB).value)
    assert bound_minmax(instance) <= figures.minmax + 1e-9
    assert bound_minsum(instance) <= figures.minsum + 1e-9


@pytest.mark.parametrize("shape", sorted(SHAPES))
@pytest.mark.parametrize("tightness", [0.7, 0.85])
def test_the_planners_windows_are_valid_and_no_earlier_claim_is(shape: str, tightness: float) -> None:
    bare = generate_instance(shape, 9, 3, seed=4, budget_pct=1e4)
    least = solve_exact(build_planner_instance(bare), cost=Cost.MINMAX, stop=Iterations(10_000))
    instance = replace(bare, budget_pct=least.evaluation.value / tightness, longest_s=1e5)
    theirs = build_planner_instance(instance)
    plan = solve(theirs, cost=Cost.MINCOMB, stop=Iterations(2_000), seed=1).plan
    window = replan_window(theirs, plan)
    repairs = find_repairs(theirs, plan, window.earliest_s)
    content = format_solution(instance, "window", plan, value=window.earliest_s, repairs=repairs)
    figures, wrong = check(instance, read_solution(content))
    assert wrong == []
    assert figures is not None
    assert figures.window == pytest.approx(window.earliest_s)
    if window.earliest_s > 1.0:
        assert check(instance, read_solution({**content, "value": window.earliest_s - 1.0}))[1] != []
    chance = random.Random(shape)
    for _ in range(10):
        broken = [one for one in repairs if one is not chance.choice(repairs)]
        if len(broken) < len(repairs):
            assert check(instance, read_solution({**content, "repairs": broken}))[1] != []
