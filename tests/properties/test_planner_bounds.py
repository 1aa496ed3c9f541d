"""Necessary conditions never deny what is possible."""

from __future__ import annotations

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from planner import Cost, Iterations, Vehicle, build_remaining_problem, evaluate, route_energy_pct, solve
from planner.bounds import compute_tree_bound_pct, explain_infeasibility
from tests.planner.builders import fleet, random_instance


@settings(max_examples=60, deadline=None, derandomize=True)
@given(st.integers(0, 10**6), st.integers(1, 8), st.integers(1, 3), st.floats(5, 60), st.booleans())
def test_where_a_plan_is_found_it_was_not_impossible(
    seed: int, segments: int, vehicles: int, budget_pct: float, dynamics: bool
) -> None:
    instance = random_instance(seed, segments, fleet(*[budget_pct] * vehicles, consumption=1.2), dynamics=dynamics)
    result = solve(instance, cost=Cost.MINSUM, stop=Iterations(100))
    if result.feasible:
        assert explain_infeasibility(instance) is None
        everybody = np.ones(vehicles, dtype=np.bool_)
        used = sum(result.evaluation.energies_pct)
        for ascent in (1, 300):
            bound = compute_tree_bound_pct(
                instance, everybody, starts=instance.start_pct, homes=instance.home_pct, idle=instance.idle_pct,
                enough=used, ascent=ascent,
            )  # fmt: skip
            assert bound <= used + 1e-9


@settings(max_examples=60, deadline=None, derandomize=True)
@given(st.integers(0, 10**6), st.integers(1, 12), st.floats(0, 1.2), st.integers(0, 2), st.booleans())
def test_a_loss_leaves_a_problem_with_consistent_figures(
    seed: int, segments: int, share: float, lost: int, fly_again: bool
) -> None:
    vehicles = [Vehicle(f"uses {factor}", (0.0, 0.0), 60.0, factor) for factor in (1.0, 1.1, 1.3)]
    instance = random_instance(seed, segments, vehicles)
    flown = solve(instance, cost=Cost.MINCOMB, stop=Iterations(30))
    at_s = share * flown.evaluation.longest_route_s
    left = build_remaining_problem(instance, flown.plan, lost, at_s, fly_again=fly_again)
    evaluation = evaluate(left.instance, left.warm, Cost.MINCOMB)
    assert evaluation.violations == ()
    settled = [visit >> 1 for visit in left.completed]
    for survivor, route in zip(left.survivors, left.warm.routes, strict=True):
        old = flown.plan.routes[survivor.vehicle]
        finishing = () if survivor.finishing is None else (survivor.finishing,)
        assert survivor.completed + finishing + survivor.tail == old.visits
        settled += [visit >> 1 for visit in survivor.completed + finishing]
        spent = survivor.spent_pct + route_energy_pct(left.instance, route)
        assert spent <= vehicles[survivor.vehicle].budget_pct + 2e-6
        # A survivor that keeps its own tail and nothing else spends what the old plan said.
        tail = tuple(left.original_visit(visit) for visit in route.visits)
        if survivor.finishing is not None and tail == survivor.tail:
            assert abs(spent - route_energy_pct(instance, old)) < 1e-9
    assert sorted(settled + list(left.open_segments)) == list(range(segments))
