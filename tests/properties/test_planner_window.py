"""Windows and certificates against exact answers on small random instances."""

from __future__ import annotations

from typing import Any

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from planner import Cost, Instance, Iterations, Plan, Vehicle, build_remaining_problem, evaluate, solve
from planner.bounds import ASCENT, explain_infeasibility
from planner.evaluate import RepairStatus
from planner.exact import find_covering_plan
from planner.proofs import bound_earliest_window_s
from planner.window import iterate_losses, replan_window
from tests.planner.builders import random_instance

LOOSE: dict[str, Any] = {"deadline": None, "derandomize": True}


@st.composite
def instances(draw: st.DrawFn, most_segments: int = 7, least_vehicles: int = 1) -> Instance:
    """Return small instances: starts apart, some vehicles in the air, unequal budgets and consumptions."""
    chance = np.random.default_rng(draw(st.integers(0, 10**6)))
    vehicles = [
        Vehicle(
            f"v{number}",
            (0.0, 0.0) if draw(st.booleans()) else (float(chance.uniform(-300, 300)), float(chance.uniform(-300, 300))),
            float(chance.uniform(10, 60)),
            float(chance.uniform(0.9, 1.3)),
            airborne=draw(st.booleans()),
        )
        for number in range(draw(st.integers(least_vehicles, 3)))
    ]
    segments = draw(st.integers(1, most_segments))
    return random_instance(int(chance.integers(10**6)), segments, vehicles, dynamics=draw(st.booleans()))


@settings(max_examples=150, **LOOSE)
@given(instances())
def test_what_is_certainly_impossible_has_no_plan(instance: Instance) -> None:
    if explain_infeasibility(instance, ascent=ASCENT) is not None:
        assert find_covering_plan(instance) is None
    if explain_infeasibility(instance) is not None:
        assert explain_infeasibility(instance, ascent=ASCENT) is not None


@settings(max_examples=25, **LOOSE)
@given(instances(least_vehicles=2), st.booleans())
def test_every_verdict_of_the_table_is_true(instance: Instance, fly_again: bool) -> None:
    plan = solve(instance, cost=Cost.MINCOMB, stop=Iterations(30)).plan
    for row in iterate_losses(instance, plan, fly_again=fly_again, effort=400):
        for at_s in (row.from_s, 0.5 * (row.from_s + row.to_s)):
            left = build_remaining_problem(instance, plan, row.vehicle, at_s, fly_again=fly_again)
            if row.plan is not None:
                assert row.plan.uncovered == ()
                assert evaluate(left.instance, row.plan, Cost.MINSUM).violations == ()
            exact: Plan | None = find_covering_plan(left.instance)
            assert row.verdict is (RepairStatus.IMPOSSIBLE if exact is None else RepairStatus.FEASIBLE)


@settings(max_examples=25, **LOOSE)
@given(instances(least_vehicles=2))
def test_no_window_begins_before_its_certificates(instance: Instance) -> None:
    plan = solve(instance, cost=Cost.MINCOMB, stop=Iterations(30)).plan
    window = replan_window(instance, plan)
    assert window.certified_earliest_s == window.earliest_s  # small enough for exact answers
    if not evaluate(instance, plan, Cost.MINMAX).violations and not plan.uncovered:
        assert bound_earliest_window_s(instance, 2.0 * window.longest_route_s) <= window.earliest_s + 1e-6
