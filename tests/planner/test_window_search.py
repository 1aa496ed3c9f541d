"""Plans chosen for their re-plan window."""

from __future__ import annotations

import itertools

import pytest

from planner import (
    PRESETS,
    Cost,
    Instance,
    Iterations,
    Plan,
    PlanError,
    Route,
    Vehicle,
    build_instance,
    evaluate,
    find_pareto_front,
    replan_window,
    solve,
    solve_window,
    travel_for,
)
from planner.evaluate import rank_window
from planner.proofs import bound_earliest_window_s
from tests.planner.builders import fleet, line, nechranice_ends_m, random_instance

SMALL = random_instance(3, 8, fleet(34.0, 34.0, 34.0))
ENOUGH = Iterations(32_000)


@pytest.fixture(scope="module")
def nechranice() -> Instance:
    vehicles = [Vehicle(f"uav{number}", (0.0, 0.0), 55.5 / 0.82) for number in range(4)]
    return build_instance(nechranice_ends_m(500), (0, 0), vehicles, travel_for(PRESETS["mavic2"], 5.0, 1.0))


def test_a_window_larger_than_mincombs_at_its_own_length(nechranice: Instance) -> None:
    minmax = solve(nechranice, cost=Cost.MINMAX, stop=Iterations(10_000), all_vehicles=True)
    mincomb = solve(nechranice, cost=Cost.MINCOMB, stop=Iterations(10_000), all_vehicles=True)
    longest_s = minmax.evaluation.longest_route_s
    stretch = mincomb.evaluation.longest_route_s / longest_s - 1
    found = solve_window(
        nechranice, stretch=stretch, longest_s=longest_s, stop=Iterations(75_000), initial=[mincomb.plan],
        all_vehicles=True,
    )  # fmt: skip
    assert found.feasible
    assert found.evaluation.violations == ()
    assert all(route.visits for route in found.plan.routes)
    assert found.evaluation.longest_route_s <= mincomb.evaluation.longest_route_s + 1e-6
    assert found.window == replan_window(nechranice, found.plan)
    assert found.window.earliest_s < replan_window(nechranice, mincomb.plan).earliest_s
    assert bound_earliest_window_s(nechranice, longest_s) <= found.window.certified_earliest_s
    assert found.window.certified_earliest_s <= found.window.earliest_s


def test_the_same_iterations_give_the_same_plan_on_two_threads() -> None:
    found = [solve_window(SMALL, stretch=0.1, stop=ENOUGH, seed=5, starts=2) for _ in range(2)]
    assert found[0].plan == found[1].plan
    assert found[0].window == found[1].window
    assert found[0].iterations == found[1].iterations


def test_more_length_never_hurts_when_the_shorter_plan_is_given() -> None:
    short = solve_window(SMALL, stretch=0.0, stop=ENOUGH)
    long = solve_window(SMALL, stretch=0.3, stop=ENOUGH, initial=[short.plan])
    assert short.feasible
    assert long.feasible
    assert long.window.earliest_s <= short.window.earliest_s


@pytest.mark.parametrize("seed", range(6))
def test_no_given_plan_of_the_same_length_is_better_in_seconds_or_percent(seed: int) -> None:
    instance = random_instance(seed, 8, fleet(34.0, 34.0, 34.0))
    given = [
        solve(instance, cost=cost, stop=Iterations(500), seed=seed + number).plan
        for cost in Cost for number in range(3)
    ]  # fmt: skip
    shortest_s = min(evaluate(instance, plan, Cost.MINMAX).longest_route_s for plan in given)
    found = solve_window(instance, stretch=0.15, longest_s=shortest_s, stop=Iterations(1), initial=given).window
    for plan in given:
        known = replan_window(instance, plan)
        if known.longest_route_s <= min(found.longest_route_s, 1.15 * shortest_s):
            assert found.earliest_s <= known.earliest_s + 1e-6
            assert found.window_pct >= known.window_pct - 1e-6


def test_of_equal_windows_in_seconds_the_shorter_plan_is_chosen() -> None:
    # Both have a full window; one inspects the second segment first and flies back for the first.
    instance = line(4, 300.0, 300.0)
    long, short = (Plan((Route(0, visits), Route(1, ()))) for visits in ((2, 0, 4, 6), (0, 2, 4, 6)))
    found = solve_window(instance, stretch=2.0, longest_s=40.0, stop=Iterations(1), initial=[long, short])
    assert (found.window.earliest_s, found.window.longest_route_s) == (0, 80)
    assert rank_window(0.0, 80.0) < rank_window(1e-9, 120.0) < rank_window(1.0, 60.0)


def test_budgets_hold_and_may_leave_no_plan() -> None:
    found = solve_window(line(4, 30.0, 30.0), stretch=0.1, stop=Iterations(2_000))
    assert not found.feasible
    assert evaluate(line(4, 30.0, 30.0), found.plan, Cost.MINMAX).violations == ()
    assert found.window.window_pct == 0


def test_a_full_window_ends_the_search() -> None:
    found = solve_window(line(3, 500.0, 500.0), stretch=0.5, stop=Iterations(10**9))
    assert found.window.window_pct == 100
    assert found.stopped_by == "full window"


def test_it_stops_while_it_still_looks_for_plans_to_begin_with() -> None:
    assert solve_window(SMALL, stretch=0.1, stop=Iterations(3_000)).iterations <= 3_000


def test_bad_wishes() -> None:
    with pytest.raises(PlanError, match="only vehicle"):
        solve_window(line(2, 99.0), stretch=0.1, stop=ENOUGH)
    with pytest.raises(PlanError, match="stretch"):
        solve_window(line(2, 99.0, 99.0), stretch=-0.1, stop=ENOUGH)


def test_no_plan_of_the_front_beats_another() -> None:
    plans = find_pareto_front(SMALL, stop=Iterations(60_000), stretches=(0.0, 0.2))
    assert len(plans) > 1
    figures = [(plan.longest_route_s, plan.energy_pct, plan.window.earliest_s) for plan in plans]
    assert figures == sorted(figures)
    for one, other in itertools.permutations(figures, 2):
        assert any(ours < theirs for ours, theirs in zip(one, other, strict=True))
    for plan in plans:
        evaluation = evaluate(SMALL, plan.plan, Cost.MINMAX)
        assert evaluation.violations == ()
        assert plan.plan.uncovered == ()
        assert plan.longest_route_s == evaluation.longest_route_s
        assert plan.energy_pct == pytest.approx(sum(evaluation.energies_pct))


def test_no_front_without_a_complete_plan() -> None:
    assert find_pareto_front(line(4, 30.0, 30.0), stop=Iterations(1_000)) == ()
