"""Windows and certificates against exact answers on small random instances."""

from __future__ import annotations

from typing import Any

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from planner import Cost, Instance, Iterations, Plan, Repair, Vehicle, evaluate, loss_table, remaining, solve
from planner.bounds import least_earliest_s, why_certainly_impossible, why_impossible
from planner.exact import covers
from planner.window import replan_window
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
    if why_certainly_impossible(instance) is not None:
        assert covers(instance) is None
    if why_impossible(instance) is not None:
        assert why_certainly_impossible(instance) is not None


@settings(max_examples=25, **LOOSE)
@given(instances(least_vehicles=2), st.booleans())
def test_every_verdict_of_the_table_is_true(instance: Instance, fly_again: bool) -> None:
    plan = solve(instance, cost=Cost.MINCOMB, stop=Iterations(30)).plan
    for row in loss_table(instance, plan, fly_again=fly_again, effort=400):
        for at_s in (row.from_s, 0.5 * (row.from_s + row.to_s)):
            left = remaining(instance, plan, row.vehicle, at_s, fly_again=fly_again)
            if row.plan is not None:
                assert row.plan.uncovered == ()
                assert evaluate(left.instance, row.plan, Cost.MINSUM).violations == ()
            exact: Plan | None = covers(left.instance)
            assert row.verdict is (Repair.IMPOSSIBLE if exact is None else Repair.FEASIBLE)


@settings(max_examples=25, **LOOSE)
@given(instances(least_vehicles=2))
def test_no_window_begins_before_its_certificates(instance: Instance) -> None:
    plan = solve(instance, cost=Cost.MINCOMB, stop=Iterations(30)).plan
    window = replan_window(instance, plan)
    assert window.certified_earliest_s == window.earliest_s  # small enough for exact answers
    assert least_earliest_s(instance) <= window.earliest_s + 1e-6
