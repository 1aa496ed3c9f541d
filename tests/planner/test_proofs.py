"""Column generation against the exact solver and every plan: what it proves is so."""

from __future__ import annotations

import itertools
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings

from planner import Cost, Instance, InstanceError, Plan, PlanError, evaluate, replan_window, solve_exact
from planner.bounds import bound_window_by_trees_s
from planner.columns import SEGMENTS_UP_TO, ColumnSearch, list_kinds
from planner.exact import find_covering_plan
from planner.proofs import bound_earliest_window_s, bound_longest_pct, bound_total_pct, decide_cover
from tests.planner.builders import fleet, random_instance
from tests.planner.test_exact import TO_THE_END, instances

pytest.importorskip("highspy")


@settings(max_examples=60, deadline=None, derandomize=True)
@given(instances(6))
def test_whether_a_fleet_can_cover_everything_is_as_the_exact_solver_says(instance: Instance) -> None:
    verdict, plan = decide_cover(instance), find_covering_plan(instance)
    assert (verdict is False) == (plan is None)
    if isinstance(verdict, Plan):
        assert not evaluate(instance, verdict, Cost.MINSUM).violations
        assert verdict.uncovered == ()


@settings(max_examples=40, deadline=None, derandomize=True)
@given(instances(7))
def test_bounds_are_never_above_the_optimum_and_reach_it(instance: Instance) -> None:
    known = find_covering_plan(instance)
    if known is None:
        return
    for cost, bound_of in ((Cost.MINSUM, bound_total_pct), (Cost.MINMAX, bound_longest_pct)):
        best = solve_exact(instance, cost=cost, stop=TO_THE_END).evaluation.value
        bound, plan = bound_of(instance, known)
        assert bound <= best + 1e-6
        assert bound == pytest.approx(best, rel=1e-5, abs=1e-5)
        assert evaluate(instance, plan, cost).value == pytest.approx(best, rel=1e-5, abs=1e-5)


@settings(max_examples=30, deadline=None, derandomize=True)
@given(instances(8))
def test_every_step_proves_a_bound(instance: Instance) -> None:
    known = find_covering_plan(instance)
    if known is None:
        return
    best = solve_exact(instance, cost=Cost.MINSUM, stop=TO_THE_END).evaluation.value
    search = ColumnSearch(instance.segments, list_kinds(instance), penalty=1e3)
    bounds = []
    while search.step():
        bounds.append(search.bound)
    assert all(earlier <= later <= best + 1e-6 for earlier, later in itertools.pairwise([*bounds, search.bound]))
    assert search.bound == pytest.approx(search.value, rel=1e-5, abs=1e-5)


def test_the_bound_on_the_longest_route_grows_with_the_steps_of_each_program() -> None:
    instance = random_instance(10, 7, fleet(26.0, 26.0, 26.0))
    known = find_covering_plan(instance)
    assert known is not None
    best = solve_exact(instance, cost=Cost.MINMAX, stop=TO_THE_END).evaluation.value
    bounds = []

    def go_on(bound: float) -> bool:
        bounds.append(bound)
        return len(bounds) < 20

    bound_longest_pct(instance, known, go_on=go_on)
    assert bounds == sorted(bounds)
    assert 0.9 * best < bounds[-1] <= best + 1e-6


@pytest.mark.parametrize("seed", [10, 15, 17, 30])
def test_tightened_routes_close_what_the_first_program_leaves_open(seed: int) -> None:
    instance = random_instance(seed, 7, fleet(26.0, 26.0, 26.0))
    best = solve_exact(instance, cost=Cost.MINSUM, stop=TO_THE_END).evaluation.value
    search = ColumnSearch(instance.segments, list_kinds(instance), penalty=1e3)
    values = []
    while search.step():
        values.append(search.value)
    assert min(values) < 0.98 * best
    assert search.bound == pytest.approx(best, rel=1e-5)


@pytest.mark.parametrize("seed", range(6))
def test_no_plan_has_a_window_that_begins_before_the_bound(seed: int) -> None:
    instance = random_instance(seed, 4, fleet(20.0, 20.0, 20.0))
    longest = solve_exact(instance, cost=Cost.MINMAX, stop=TO_THE_END).evaluation.value
    instance = replace(instance, vehicles=tuple(replace(one, budget_pct=1.15 * longest) for one in instance.vehicles))
    begins_s = [
        replan_window(instance, plan).earliest_s
        for plan in list_plans(instance) if not evaluate(instance, plan, Cost.MINMAX).violations
    ]  # fmt: skip
    bound_s = bound_earliest_window_s(instance, max(begins_s))
    assert bound_window_by_trees_s(instance) - 1e-6 <= bound_s <= min(begins_s)


def list_plans(instance: Instance) -> list[Plan]:
    """Return all plans that visit everything, up to the order of equal vehicles."""
    from planner import Route

    plans = []
    for order in itertools.permutations(range(instance.segments)):
        for ways in itertools.product((0, 1), repeat=instance.segments):
            visits = tuple(2 * segment + way for segment, way in zip(order, ways, strict=True))
            for first, second in itertools.combinations_with_replacement(range(len(visits) + 1), 2):
                routes = (visits[:first], visits[first:second], visits[second:])
                if sorted(routes, key=lambda route: (-len(route), route)) == list(routes):
                    plans.append(Plan(tuple(Route(number, route) for number, route in enumerate(routes))))
    return plans


def test_more_segments_than_a_set_holds_are_refused() -> None:
    instance = random_instance(1, SEGMENTS_UP_TO + 1, fleet(100.0))
    with pytest.raises(InstanceError, match=f"expected at most {SEGMENTS_UP_TO}"):
        decide_cover(instance)


def test_one_vehicle_has_no_window_to_bound() -> None:
    with pytest.raises(PlanError, match="nobody is left"):
        bound_earliest_window_s(random_instance(1, 3, fleet(100.0)), 100.0)


def test_without_highs_a_proof_says_how_to_install_it(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("planner.columns.is_available", lambda: False)
    with pytest.raises(InstanceError, match="needs the extra proofs: pip install highspy"):
        decide_cover(random_instance(1, 3, fleet(100.0)))


def test_bounds_are_numbers_even_without_a_route() -> None:
    instance = random_instance(1, 3, fleet(0.0, 0.0))
    assert decide_cover(instance) is False
    assert np.isfinite(bound_earliest_window_s(instance, 100.0))
