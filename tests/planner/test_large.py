"""Large instances: first plans along a curve, regions, the promises of the solver kept."""

from __future__ import annotations

import itertools

import numpy as np
import pytest

from benchmarks.synthetic import SPAN_M, generate_network
from planner import Cost, Instance, Iterations, Plan, Progress, Route, Travel, Vehicle, build_instance, evaluate, solve
from planner.large import LargeSearch, sort_along_curve, split_into_routes
from planner.model import build_part_instance
from planner.moves import Dynamics
from planner.params import DEFAULT_PARAMS
from planner.stop_rules import Stopwatch
from tests.planner.builders import fleet, random_instance, table_pct

TRAVEL = Travel(5.0, 1.0, 1.0, 1.0, Dynamics())


def network(segments: int, *budgets: float, tables_up_to: int = 0) -> Instance:
    vehicles = [Vehicle(f"v{number}", (0.0, 0.0), budget) for number, budget in enumerate(budgets)]
    return build_instance(generate_network(segments, 3), (0.0, 0.0), vehicles, TRAVEL, tables_up_to=tables_up_to)


def test_a_network_grows_from_the_substation() -> None:
    ends = generate_network(400, 7)
    lengths = np.hypot(*(ends[:, 1] - ends[:, 0]).T)
    assert lengths.min() >= SPAN_M[0]
    assert lengths.max() <= SPAN_M[1]
    begun = {(0.0, 0.0)} | {tuple(end) for end in ends[:, 1].tolist()}
    assert all(tuple(end) in begun for end in ends[:, 0].tolist())
    assert generate_network(100, 7).tolist() == ends[:100].tolist()
    assert generate_network(100, 8).tolist() != ends[:100].tolist()


def test_the_curve_visits_every_cell_before_it_leaves_its_neighbourhood() -> None:
    grid = np.array([(x, y) for x in range(8) for y in range(8)], dtype=np.float64)
    order = sort_along_curve(grid)
    assert sorted(order.tolist()) == list(range(64))
    steps = np.abs(np.diff(grid[order], axis=0)).sum(axis=1)
    assert steps.max() == 1
    assert sort_along_curve(np.zeros((3, 2))).tolist() == [0, 1, 2]


def test_the_first_plan_gives_equal_vehicles_about_the_same() -> None:
    instance = network(300, *[40_000.0] * 12)
    routes = split_into_routes(instance, sort_along_curve(instance.end_m[::2]), everybody=True)
    plan = Plan(tuple(Route(vehicle, visits) for vehicle, visits in enumerate(routes)))
    evaluation = evaluate(instance, plan, Cost.MINMAX)
    assert evaluation.violations == ()
    assert all(routes)
    fewest = split_into_routes(instance, sort_along_curve(instance.end_m[::2]), everybody=False)
    assert 0 < sum(map(bool, fewest)) < 12
    assert sum(map(len, fewest)) == 300
    assert min(evaluation.energies_pct[:-1]) > 0.7 * max(evaluation.energies_pct)


def test_what_budgets_do_not_carry_is_left_out_of_the_first_plan() -> None:
    instance = network(100, 0.0, 3000.0)
    routes = split_into_routes(instance, sort_along_curve(instance.end_m[::2]), everybody=True)
    assert routes[0] == ()
    assert 0 < len(routes[1]) < 100


def test_a_part_has_the_same_moves() -> None:
    instance = network(30, 1.0, 2.0, 3.0)
    part = build_part_instance(instance, [2, 0], [7, 3])
    visits = [14, 15, 6, 7]
    assert [vehicle.budget_pct for vehicle in part.vehicles] == [3.0, 1.0]
    assert table_pct(part) == pytest.approx(table_pct(instance)[np.ix_(visits, visits)])
    assert part.start_pct.tolist() == instance.start_pct[np.ix_([2, 0], visits)].tolist()


@pytest.mark.parametrize("cost", Cost)
def test_regions_make_a_large_plan_better_within_its_budgets(cost: Cost) -> None:
    instance = network(600, *[32_000.0] * 30)
    seen: list[Progress] = []
    result = solve(instance, cost=cost, stop=Iterations(16_000), seed=2, starts=2, on_progress=seen.append)
    assert result.feasible
    assert result.evaluation.violations == ()
    assert result.iterations == 16_000
    assert seen[-1].value == pytest.approx(result.evaluation.value)
    assert all(later.value <= earlier.value + 1e-6 for earlier, later in itertools.pairwise(seen))
    assert result.evaluation.value < seen[0].value
    again = solve(instance, cost=cost, stop=Iterations(16_000), seed=2, starts=2)
    assert again.plan == result.plan


def test_a_large_search_continues_from_a_plan_and_cuts_it_down_to_the_budgets() -> None:
    instance = random_instance(4, 40, fleet(60.0, 25.0, 60.0))
    wish = Plan((Route(0, (0, 2, 4)), Route(1, tuple(range(6, 60, 2))), Route(2, ())), tuple(range(30, 40)))
    search = LargeSearch(instance, cost=Cost.MINSUM, seed=0, initial=wish, all_vehicles=False, watch=Stopwatch())
    result = search.run(Iterations(0))
    assert result.plan.routes[0].visits == (0, 2, 4)
    assert 0 < len(result.plan.routes[1].visits) < 27
    assert result.evaluation.violations == ()
    improved = search.run(Iterations(8000))
    assert improved.iterations == 8000
    assert len(improved.plan.uncovered) < len(result.plan.uncovered)
    assert improved.evaluation.violations == ()


@pytest.mark.parametrize("cost", Cost)
def test_regions_find_what_the_whole_search_does_on_a_small_instance(cost: Cost) -> None:
    instance = random_instance(5, 25, fleet(40.0, 40.0, 60.0))
    whole = solve(instance, cost=cost, stop=Iterations(12_000), seed=1)
    search = LargeSearch(instance, cost=cost, seed=1, initial=None, all_vehicles=True, watch=Stopwatch(), starts=3)
    result = search.run(Iterations(12_000))
    assert result.feasible
    assert result.evaluation.value <= 1.05 * whole.evaluation.value


def test_a_region_has_no_more_open_segments_than_a_region_has() -> None:
    # One route far from a second: what is open between them is nearly the whole network, whose moves no memory holds.
    instance = network(900, 3000.0, 3000.0)
    first, last = 0, 2 * (instance.segments - 1)
    wish = Plan((Route(0, (first,)), Route(1, (last,))), tuple(range(1, instance.segments - 1)))
    search = LargeSearch(instance, cost=Cost.MINSUM, seed=0, initial=wish, all_vehicles=False, watch=Stopwatch())
    nobody, nothing = np.zeros(2, dtype=np.bool_), np.zeros(instance.segments, dtype=np.bool_)
    region = search._build_region(0, nobody, nothing, longest=False)
    assert region.vehicles == (0, 1)
    assert len(region.segments) <= DEFAULT_PARAMS.large.region + 2
