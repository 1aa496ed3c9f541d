"""The exact solver: its optimum is the optimum, its bound a bound, and the search finds the same on small instances."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from planner import (
    PRESETS,
    Cancelled,
    Cost,
    Instance,
    InstanceError,
    Iterations,
    Plan,
    Progress,
    Route,
    SearchParams,
    Seconds,
    Travel,
    Vehicle,
    build_instance,
    build_remaining_problem,
    combine_stop_rules,
    evaluate,
    solve,
    solve_exact,
    travel_for,
)
from planner.columns import SEGMENTS_UP_TO
from planner.moves import Dynamics
from planner.params import ExactParams
from tests.planner.builders import UNIT, fleet, line, nechranice_ends_m, random_instance

TO_THE_END = Seconds(1e9)
WINDY = travel_for(PRESETS["mavic2"], 8.0, 3.0, wind_m_s=(5.0, -2.0))
CALM = Travel(5.0, 1.0, 0.05, 0.06, Dynamics())


@st.composite
def instances(draw: st.DrawFn, most_segments: int = 8) -> Instance:
    """Vehicles of their own places, budgets and kinds, or alike; budgets for everything, a part, or nothing."""
    chance = np.random.default_rng(draw(st.integers(0, 10**6)))
    segments = draw(st.integers(1, most_segments))
    first = chance.uniform(-500, 500, (segments, 2))
    ends = np.stack([first, first + chance.uniform(-70, 70, (segments, 2))], axis=1)
    alike = draw(st.booleans())
    budgets = [draw(st.sampled_from([0.0, 12.0, 20.0, 30.0, 60.0]))] * 3 if alike else chance.uniform(5, 60, 3).tolist()
    airborne = not alike and draw(st.booleans())
    starts = [(0.0, 0.0)] * 3 if alike else [tuple(place) for place in chance.uniform(-300, 300, (3, 2)).tolist()]
    travel = draw(st.sampled_from([WINDY, CALM]))
    vehicles = [
        Vehicle(f"v{number}", (start[0], start[1]), budget, 1.0 if alike else 1 + number / 10, airborne)
        for number, (start, budget) in enumerate(zip(starts, budgets, strict=True))
    ]
    return build_instance(ends, (0.0, 0.0), vehicles, travel)


def worth(instance: Instance, plan: Plan) -> float:
    return float(instance.value.sum() - instance.value[list(plan.uncovered)].sum())


@settings(max_examples=40, deadline=None, derandomize=True)
@given(instances(), st.sampled_from(Cost), st.booleans())
def test_the_search_finds_the_optimum_of_small_instances(instance: Instance, cost: Cost, all_vehicles: bool) -> None:
    exact = solve_exact(instance, cost=cost, stop=TO_THE_END, all_vehicles=all_vehicles)
    found = solve(instance, cost=cost, stop=Iterations(4000), all_vehicles=all_vehicles, seed=1)
    assert exact.stopped_by == "optimal"
    assert exact.bound == exact.evaluation.value
    assert exact.evaluation.violations == found.evaluation.violations
    assert worth(instance, exact.plan) == pytest.approx(worth(instance, found.plan))
    assert exact.evaluation.value == pytest.approx(found.evaluation.value, rel=2e-6, abs=1e-6)
    assert exact.feasible == found.feasible
    if all_vehicles:
        flying = [sum(bool(route.visits) for route in result.plan.routes) for result in (exact, found)]
        assert flying[0] == flying[1]


def every_plan(instance: Instance) -> list[Plan]:
    """All plans of two vehicles, with all choices of what is left out."""
    plans = []
    for size in range(instance.segments + 1):
        for order in itertools.permutations(range(instance.segments), size):
            left = tuple(segment for segment in range(instance.segments) if segment not in order)
            for directions in itertools.product((0, 1), repeat=size):
                visits = tuple(2 * s + d for s, d in zip(order, directions, strict=True))
                plans += [Plan((Route(0, visits[:split]), Route(1, visits[split:])), left) for split in range(size + 1)]
    return plans


@pytest.mark.parametrize("budgets_pct", [(60.0, 60.0), (14.0, 9.0), (9.0, 9.0), (0.0, 20.0)])
@pytest.mark.parametrize("cost", Cost)
def test_the_optimum_is_the_best_of_all_plans(budgets_pct: tuple[float, float], cost: Cost) -> None:
    instance = random_instance(3, 4, fleet(*budgets_pct))
    allowed = []
    for plan in every_plan(instance):
        evaluation = evaluate(instance, plan, cost)
        if not evaluation.violations:
            allowed.append((-round(worth(instance, plan), 6), evaluation.value))
    exact = solve_exact(instance, cost=cost, stop=TO_THE_END)
    least, value = min(allowed)
    assert worth(instance, exact.plan) == pytest.approx(-least)
    assert exact.evaluation.value == pytest.approx(value)
    assert exact.bound == pytest.approx(value)
    assert (exact.impossible is None) == (not exact.plan.uncovered)


@pytest.mark.parametrize("cost", Cost)
def test_twelve_segments_are_closed(cost: Cost) -> None:
    instance = random_instance(8, 12, fleet(60.0, 60.0, 60.0), dynamics=True)
    exact = solve_exact(instance, cost=cost, stop=TO_THE_END)
    assert exact.bound == exact.evaluation.value
    found = solve(instance, cost=cost, stop=Iterations(6000))
    assert exact.evaluation.value == pytest.approx(found.evaluation.value, rel=2e-6)


def test_the_optimum_is_found_where_the_search_has_not() -> None:
    """The search does not see more than its first plan here; the proof must not depend on it."""
    instance = random_instance(21, 9, fleet(45.0, 40.0, 35.0))
    blind = SearchParams(exact=ExactParams(search_iterations=0))
    exact = solve_exact(instance, cost=Cost.MINSUM, stop=TO_THE_END, params=blind)
    first = solve(instance, cost=Cost.MINSUM, stop=Iterations(0))
    best = solve(instance, cost=Cost.MINSUM, stop=Iterations(6000))
    assert exact.evaluation.value < first.evaluation.value - 0.1
    assert exact.evaluation.value == pytest.approx(best.evaluation.value)


def test_what_a_loss_leaves_is_planned_exactly() -> None:
    instance = random_instance(3, 10, fleet(40.0, 40.0, 40.0))
    flown = solve(instance, cost=Cost.MINMAX, stop=Iterations(2000))
    left = build_remaining_problem(instance, flown.plan, 0, 0.3 * flown.evaluation.longest_route_s).instance
    exact = solve_exact(left, cost=Cost.MINCOMB, stop=TO_THE_END)
    assert exact.bound == pytest.approx(exact.evaluation.value)
    assert exact.evaluation.value <= solve(left, cost=Cost.MINCOMB, stop=Iterations(3000)).evaluation.value + 1e-6


def test_a_vehicle_that_cannot_get_home_is_left_alone() -> None:
    vehicles = [Vehicle("far", (100.0, 0.0), 50.0, airborne=True), Vehicle("near", (0.0, 0.0), 1000.0)]
    instance = build_instance([[[10.0, 0.0], [20.0, 0.0]]], (0.0, 0.0), vehicles, UNIT)
    exact = solve_exact(instance, cost=Cost.MINMAX, stop=TO_THE_END)
    assert [route.visits for route in exact.plan.routes] in ([(), (0,)], [(), (1,)])
    assert not exact.feasible
    assert exact.bound == exact.evaluation.value == 100.0


def test_a_stopped_proof_keeps_its_plan() -> None:
    instance = random_instance(8, 11, fleet(60.0, 50.0, 40.0))
    at_once = solve_exact(instance, cost=Cost.MINSUM, stop=Iterations(0))
    assert (at_once.stopped_by, at_once.bound) == ("iterations", None)
    assert at_once.feasible
    seen: list[Progress] = []
    stop = combine_stop_rules(TO_THE_END, Cancelled(lambda: len(seen) > 1))
    later = solve_exact(instance, cost=Cost.MINSUM, stop=stop, on_progress=seen.append)
    assert later.stopped_by == "cancelled"
    assert len(seen) == 2
    assert later.feasible


def test_without_segments_and_with_too_many() -> None:
    nothing = solve_exact(line(0, 10.0), cost=Cost.MINMAX, stop=TO_THE_END)
    assert (nothing.bound, nothing.feasible) == (0.0, True)
    with pytest.raises(InstanceError, match=f"expected at most {SEGMENTS_UP_TO} for a proof"):
        solve_exact(line(SEGMENTS_UP_TO + 1, 1.0), cost=Cost.MINMAX, stop=TO_THE_END)


@pytest.mark.parametrize(("cost", "optimum_s"), [(Cost.MINMAX, 1098.019), (Cost.MINSUM, 4201.960)])
def test_the_papers_smallest_network_is_closed(cost: Cost, optimum_s: float) -> None:
    """18 segments, four vehicles alike; PyVRP's best c-MinSum, 4201.98 (planner notes, part 3), is the optimum."""
    travel = Travel(5.0, 1.0, 1.0, 1.0, Dynamics())
    instance = build_instance(nechranice_ends_m(500), (0.0, 0.0), fleet(*[1262.0] * 4), travel)
    exact = solve_exact(instance, cost=cost, stop=TO_THE_END, all_vehicles=True)
    assert exact.stopped_by == "optimal"
    assert exact.evaluation.value == pytest.approx(optimum_s, abs=1e-3)
    assert all(route.visits for route in exact.plan.routes)
