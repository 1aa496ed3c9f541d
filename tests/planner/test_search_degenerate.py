"""The solver on input at its edges."""

from __future__ import annotations

import numpy as np
import pytest

from planner import Cost, Iterations, Plan, Route, Vehicle, build_instance, evaluate, solve
from planner.plan_search import build_kernel_problem
from tests.planner.builders import UNIT, fleet, line


@pytest.mark.parametrize("cost", Cost)
def test_one_segment_and_one_vehicle(cost: Cost) -> None:
    result = solve(line(1, 100.0), cost=cost, stop=Iterations(20))
    assert result.feasible
    assert [len(route.visits) for route in result.plan.routes] == [1]
    assert result.evaluation.value == {Cost.MINMAX: 20.0, Cost.MINSUM: 20.0, Cost.MINCOMB: 40.0}[cost]


@pytest.mark.parametrize("cost", Cost)
@pytest.mark.parametrize(
    "ends",
    [
        [[[10.0 * x, 10.0 * x], [10.0 * x + 5, 10.0 * x + 5]] for x in range(12)],  # collinear
        [[[10.0, 0.0], [10.0, 0.0]]] * 12,  # equal pylons, no length, no transit between
        [[[0.0, 0.0], [0.0, 0.0]]] * 3,  # nothing costs anything
        [[[-10.0, 0.0], [10.0, 0.0]], [[0.0, -10.0], [0.0, 10.0]]],  # the depot lies on both
    ],
)
def test_odd_places_have_plans(ends: list[list[list[float]]], cost: Cost) -> None:
    instance = build_instance(ends, (0.0, 0.0), fleet(400.0, 400.0), UNIT)
    result = solve(instance, cost=cost, stop=Iterations(1000), starts=2)
    assert result.feasible
    assert result.evaluation == evaluate(instance, result.plan, cost)
    assert result.plan.uncovered == ()


def test_the_depot_on_a_segment_is_no_way_to_fly() -> None:
    instance = build_instance([[[-10.0, 0.0], [10.0, 0.0]]], (0.0, 0.0), fleet(100.0), UNIT)
    assert solve(instance, cost=Cost.MINSUM, stop=Iterations(5)).evaluation.value == 40.0


def test_a_thousand_vehicles_for_ten_segments() -> None:
    instance = line(10, *[1000.0] * 1000)
    together = solve(instance, cost=Cost.MINSUM, stop=Iterations(1000))
    assert together.evaluation.value == 200.0
    alone = solve(instance, cost=Cost.MINMAX, stop=Iterations(1000))
    assert alone.evaluation.value == 200.0  # the farthest
    everybody = solve(instance, cost=Cost.MINSUM, stop=Iterations(1000), all_vehicles=True)
    assert sum(bool(route.visits) for route in everybody.plan.routes) == 10


def test_vehicles_know_the_last_that_equals_them() -> None:
    vehicles = [*fleet(100.0, 100.0, 90.0, 100.0), Vehicle("far", (9.0, 9.0), 100.0), Vehicle("g", (0.0, 0.0), 100.0)]
    instance = build_instance([[[10.0, 0.0], [20.0, 0.0]]] * 2, (0.0, 0.0), vehicles, UNIT)
    problem = build_kernel_problem(instance)
    assert problem.twin.tolist() == [-1, 0, -1, 1, -1, 3]


def test_a_fleet_without_budget_leaves_everything_out_at_once() -> None:
    instance = line(30, *[0.0] * 50)
    result = solve(instance, cost=Cost.MINMAX, stop=Iterations(200), starts=2)
    assert result.plan == Plan(tuple(Route(vehicle, ()) for vehicle in range(50)), tuple(range(30)))


def test_a_large_instance_may_have_no_plan_either() -> None:
    ends = np.zeros((600, 2, 2))
    ends[:, 0, 0] = 100.0 + np.arange(600)
    ends[:, 1, 0] = 101.0 + np.arange(600)
    instance = build_instance(ends, (0.0, 0.0), fleet(0.0, 260.0), UNIT, tables_up_to=0)
    result = solve(instance, cost=Cost.MINCOMB, stop=Iterations(6000))
    assert not result.feasible
    assert result.evaluation.violations == ()
    assert len(result.plan.routes[1].visits) == 30
