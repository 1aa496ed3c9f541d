"""Plans chosen for the probability that everything is inspected."""

from __future__ import annotations

from dataclasses import replace

import pytest

from planner import (
    DEFAULT_PARAMS,
    Cost,
    InstanceError,
    Iterations,
    Plan,
    PlanError,
    Route,
    build_risk_campaign,
    estimate_coverage,
    estimate_risks,
    evaluate,
    simulate_chunk,
    solve,
    solve_coverage,
    split_flights,
)
from planner.coverage import CoverageResult
from tests.planner.builders import fleet, line, random_instance

MTBF_H = 0.5
"""A few times as long as a route takes: losses are frequent."""
SMALL = random_instance(3, 8, fleet(34.0, 34.0, 34.0))
QUICK = replace(
    DEFAULT_PARAMS,
    window=replace(DEFAULT_PARAMS.window, minmax_iterations=5_000, other_iterations=5_000),
    coverage=replace(DEFAULT_PARAMS.coverage, window_iterations=5_000, cycle=300, flights=200),
)


def chosen(*, seed: int = 5, starts: int = 1, iterations: int = 7_000) -> CoverageResult:
    return solve_coverage(
        SMALL, mtbf_h=MTBF_H, stop=Iterations(iterations), seed=seed, starts=starts, flights=500, params=QUICK
    )


@pytest.fixture(scope="module")
def found() -> CoverageResult:
    return chosen()


def test_the_plan_inspects_everything_within_its_budgets(found: CoverageResult) -> None:
    assert found.feasible
    assert found.plan.uncovered == ()
    assert evaluate(SMALL, found.plan, Cost.MINMAX).violations == ()


def test_its_probability_is_that_of_the_risk_of_the_same_flights(found: CoverageResult) -> None:
    campaign = build_risk_campaign(SMALL, found.plan, mtbf_h=[MTBF_H])
    (risk,) = estimate_risks(campaign, [simulate_chunk(campaign, chunk) for chunk in split_flights(500, 5)])
    assert found.chance == risk


def test_the_same_iterations_give_the_same_plan_on_two_threads() -> None:
    once, again = chosen(starts=2), chosen(starts=2)
    assert (once.plan, once.chance, once.iterations) == (again.plan, again.chance, again.iterations)


def test_more_flights_are_finished_than_with_the_shortest_longest_route(found: CoverageResult) -> None:
    minmax = solve(SMALL, cost=Cost.MINMAX, stop=Iterations(2_000)).plan
    ours, theirs = (
        estimate_coverage(SMALL, plan, MTBF_H, flights=4_000, seed=99, fly_again=True).finished[-1]
        for plan in (found.plan, minmax)
    )
    assert ours.estimate > theirs.estimate


def test_a_spare_that_can_do_everything_leaves_only_its_own_loss() -> None:
    # One visit and two spares: nothing to choose, so every loss has a re-plan.
    found = solve_coverage(
        line(1, 100.0, 100.0, 100.0), mtbf_h=0.01, stop=Iterations(10_000), flights=200, params=QUICK
    )
    assert found.stopped_by == "full window"
    assert found.chance.finished[-1].estimate > 0.9


@pytest.mark.parametrize("hours", [0.0, -1.0, float("nan"), float("inf")])
def test_the_time_between_failures_is_more_than_zero(hours: float) -> None:
    with pytest.raises(InstanceError, match="mean time between failures"):
        solve_coverage(SMALL, mtbf_h=hours, stop=Iterations(1))


def test_one_vehicle_has_nobody_to_take_over() -> None:
    with pytest.raises(PlanError, match="is the only vehicle"):
        solve_coverage(line(2, 100.0), mtbf_h=1.0, stop=Iterations(1))


def test_budgets_that_do_not_suffice_are_refused() -> None:
    with pytest.raises(PlanError, match="no plan found inspects everything"):
        solve_coverage(line(3, 30.0, 30.0), mtbf_h=1.0, stop=Iterations(3_000), params=QUICK)


def test_an_initial_plan_has_to_fit() -> None:
    with pytest.raises(PlanError, match="routes"):
        solve_coverage(SMALL, mtbf_h=1.0, stop=Iterations(1), initial=[Plan((Route(0, ()),))])
