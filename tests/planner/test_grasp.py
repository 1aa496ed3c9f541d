"""The paper's solver: it does what the authors' does, no better and no worse, and says where a plan breaks a budget."""

from __future__ import annotations

import statistics

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from planner import (
    Cancelled,
    Cost,
    FirstFeasible,
    InstanceError,
    Iterations,
    Plan,
    Progress,
    Route,
    Seconds,
    Travel,
    Vehicle,
    build_instance,
    combine_stop_rules,
    evaluate,
    solve,
    solve_grasp,
)
from planner.grasp import _GraspRuns
from planner.kernels.anneal import compute_objective
from planner.moves import Dynamics
from planner.plan_search import build_plan
from tests.planner.builders import fleet, line, nechranice_ends_m, random_instance

FOR_ALL_RUNS = Seconds(1e9)


@pytest.mark.parametrize(
    ("radius_m", "budget_s", "median_s", "runs"), [(500, 1262, 4380.9, 25), (1000, 3609, 13515.5, 9)]
)
def test_the_median_run_is_the_authors(radius_m: float, budget_s: float, median_s: float, runs: int) -> None:
    """Against the median of their solver's single runs (planner notes, part 3)."""
    travel = Travel(5.0, 1.0, 1.0, 1.0, Dynamics())
    instance = build_instance(nechranice_ends_m(radius_m), (0.0, 0.0), fleet(*[budget_s] * 4), travel)
    values = [
        solve_grasp(instance, cost=Cost.MINSUM, stop=FOR_ALL_RUNS, seed=seed, runs=1).evaluation.value
        for seed in range(runs)
    ]  # fmt: skip
    assert statistics.median(values) == pytest.approx(median_s, rel=0.02)


@settings(max_examples=40, deadline=None, derandomize=True)
@given(
    st.integers(0, 10**6), st.integers(1, 9), st.integers(1, 4), st.floats(1, 60), st.sampled_from(Cost), st.booleans()
)
def test_every_segment_stays_in_and_the_figures_are_those_of_the_definition(
    seed: int, segments: int, vehicles: int, budget_pct: float, cost: Cost, all_vehicles: bool
) -> None:
    everybody = [Vehicle(f"v{factor}", (30.0 * factor, 0.0), budget_pct, 1 + factor / 10) for factor in range(vehicles)]
    instance = random_instance(seed, segments, everybody)
    runs = _GraspRuns(instance, cost, seed, all_vehicles=all_vehicles)
    for _ in range(3):
        runs._advance(15)
        for state in (runs._walk.current, runs._walk.trial, runs._walk.best):
            plan = build_plan(state)
            evaluation = evaluate(instance, plan, cost)
            assert plan.uncovered == ()
            assert state.loads.tolist() == pytest.approx(evaluation.energies_pct, abs=1e-9)
            weights = runs._weights._replace(empty=0.0)
            # The kernels' budgets are half a tolerance wider; MinMax has a trace of the sum to break ties.
            assert compute_objective(runs._problem, weights, state) == pytest.approx(
                evaluation.value, rel=1e-5, abs=2e-3
            )
        assert runs._evaluation.value <= evaluate(instance, build_plan(runs._walk.best), cost).value + 1e-3


def test_budgets_are_soft_and_the_plan_says_so() -> None:
    result = solve_grasp(line(4, 70.0, 60.0), cost=Cost.MINSUM, stop=Iterations(100))
    assert result.plan.uncovered == ()
    assert not result.feasible
    assert len(result.evaluation.violations) == 1
    enough = solve_grasp(line(4, 80.0, 20.0), cost=Cost.MINSUM, stop=Iterations(100))
    assert enough.feasible
    assert enough.evaluation.value == 100.0  # no move takes a vehicle's last visit


def test_minmax_does_not_look_at_budgets() -> None:
    result = solve_grasp(random_instance(1, 6, fleet(1000.0, 1.0)), cost=Cost.MINMAX, stop=FOR_ALL_RUNS, runs=3)
    assert not result.feasible
    assert max(result.evaluation.energies_pct) < 1.5 * min(result.evaluation.energies_pct)


def test_the_best_of_some_runs_is_near_what_the_search_finds() -> None:
    instance = random_instance(4, 9, fleet(80.0, 80.0, 80.0))
    for cost in Cost:
        best = solve(instance, cost=cost, stop=Iterations(3000), all_vehicles=True)
        found = solve_grasp(instance, cost=cost, stop=FOR_ALL_RUNS, runs=20, all_vehicles=True)
        assert best.evaluation.value - 1e-6 <= found.evaluation.value <= 1.1 * best.evaluation.value
        assert found.stopped_by == "runs"
        assert found.feasible


def test_more_runs_are_never_worse_and_begin_alike() -> None:
    instance = random_instance(7, 20, fleet(60.0, 60.0, 60.0))
    values = [
        solve_grasp(instance, cost=Cost.MINCOMB, stop=FOR_ALL_RUNS, seed=3, runs=runs).evaluation.value
        for runs in (1, 2, 8)
    ]
    assert values == sorted(values, reverse=True)
    assert values[0] > values[2]


def test_the_seed_and_the_iterations_decide() -> None:
    instance = random_instance(5, 25, fleet(40.0, 40.0, 60.0))
    first, again, other = (
        solve_grasp(instance, cost=Cost.MINSUM, stop=Iterations(130), seed=seed, runs=5) for seed in (4, 4, 5)
    )
    assert first.plan == again.plan
    assert first.plan != other.plan
    assert (first.iterations, first.stopped_by) == (130, "iterations")


def test_a_run_ends_when_nothing_better_is_found() -> None:
    result = solve_grasp(random_instance(2, 3, fleet(500.0)), cost=Cost.MINSUM, stop=FOR_ALL_RUNS, runs=1)
    assert 200 <= result.iterations < 260
    assert result.stopped_by == "runs"


def test_progress_is_reported_and_the_stop_rule_obeyed() -> None:
    seen: list[Progress] = []
    instance = random_instance(8, 12, fleet(500.0, 500.0))
    stop = combine_stop_rules(Iterations(10**6), Cancelled(lambda: len(seen) == 4))
    result = solve_grasp(instance, cost=Cost.MINSUM, stop=stop, on_progress=seen.append)
    assert result.stopped_by == "cancelled"
    assert [progress.iterations for progress in seen] == [0, 20, 40, 60]
    assert seen[0].value >= seen[-1].value == result.evaluation.value
    quick = solve_grasp(instance, cost=Cost.MINSUM, stop=FirstFeasible())
    assert quick.feasible
    assert quick.iterations == 0


@pytest.mark.parametrize(("segments", "vehicles"), [(1, 1), (1, 3), (2, 2), (3, 4)])
@pytest.mark.parametrize("cost", Cost)
def test_fewer_segments_than_vehicles_are_no_trouble(segments: int, vehicles: int, cost: Cost) -> None:
    result = solve_grasp(line(segments, *[1000.0] * vehicles), cost=cost, stop=FOR_ALL_RUNS, runs=2, all_vehicles=True)
    assert result.feasible
    assert sum(bool(route.visits) for route in result.plan.routes) == min(segments, vehicles)


def test_an_instance_without_segments_and_one_without_runs() -> None:
    assert solve_grasp(line(0, 10.0), cost=Cost.MINMAX, stop=FOR_ALL_RUNS).plan == Plan((Route(0, ()),))
    with pytest.raises(InstanceError, match="runs is 0, expected 1 or more"):
        solve_grasp(line(1, 10.0), cost=Cost.MINMAX, stop=FOR_ALL_RUNS, runs=0)


def test_directions_are_the_best_for_their_order() -> None:
    result = solve_grasp(random_instance(11, 14, fleet(500.0, 500.0)), cost=Cost.MINSUM, stop=Iterations(0))
    instance = random_instance(11, 14, fleet(500.0, 500.0))
    for route in result.plan.routes:
        for place in range(len(route.visits)):
            turned = np.array(route.visits)
            turned[place] ^= 1
            routes = list(result.plan.routes)
            routes[route.vehicle] = Route(route.vehicle, tuple(int(visit) for visit in turned))
            assert evaluate(instance, Plan(tuple(routes)), Cost.MINSUM).value >= result.evaluation.value - 1e-9
