"""Proven optima of small days, compared with the search."""

from __future__ import annotations

import itertools
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from benchmarks.exact_sorties import solve_sorties_exact
from planner import InstanceError, Iterations
from planner.sorties import Objective, SortieInstance, evaluate_sorties, solve_sorties
from tests.planner.sorties.builders import BROAD, DAY, TRAVEL, line_instance

LIMITED: dict[str, Any] = {"packs": 2, "days": DAY[:1]}
OWN: dict[str, Any] = {"transfer": False, "vehicles": 3, "travels": (TRAVEL, BROAD)}


@pytest.mark.parametrize(("seed", "more"), [(1, {}), (3, {}), (7, {}), (9, {}), (3, LIMITED), (6, LIMITED), (7, OWN)])
def test_the_search_finds_the_proven_optimum_of_eight_segments(seed: int, more: dict[str, Any]) -> None:
    instance = line_instance(seed, 8, budget_pct=32.0, **more)
    proven = solve_sorties_exact(instance)
    assert proven is not None
    best = evaluate_sorties(instance, proven)
    assert best.violations == ()
    found = solve_sorties(instance, stop=Iterations(100_000), seed=1).evaluation
    assert found.violations == ()
    assert found.finish_s == pytest.approx(best.finish_s, abs=1e-5)
    assert found.flight_s == pytest.approx(best.flight_s, abs=1e-5)
    assert len(proven.routes) > len({one.vehicle for one in proven.routes}) or len(instance.vehicles) > 2


@pytest.mark.parametrize(("seed", "most"), [(0, 4), (2, 8), (3, 2), (4, 7)])
def test_a_day_that_is_too_short_has_as_many_segments_as_any_plan(seed: int, most: int) -> None:
    instance = line_instance(seed, 8, bases=1, vehicles=1, days=((0.0, 900.0),), budget_pct=25.0)
    flown = (
        count
        for count in range(8, 0, -1)
        for some in itertools.combinations(range(8), count)
        if solve_sorties_exact(replace(instance, wanted=np.isin(np.arange(8), some))) is not None
    )
    assert next(flown) == most
    found = solve_sorties(instance, stop=Iterations(20_000), seed=1)
    assert found.evaluation.violations == ()
    assert 8 - len(found.plan.uncovered) == most


@pytest.mark.parametrize("objective", Objective)
def test_a_segment_that_no_way_leads_to_costs_the_others_nothing(objective: Objective) -> None:
    whole = line_instance(4, 8, budget_pct=32.0)
    out_s, out_pct = whole.out_s.copy(), whole.out_pct.copy()
    out_s[..., 6:8] = out_pct[..., 6:8] = np.inf
    behind = replace(whole, out_s=out_s, out_pct=out_pct)
    without = replace(whole, wanted=np.arange(8) != 3)
    found, expected = (
        solve_sorties(instance, objective=objective, stop=Iterations(30_000), seed=1) for instance in (behind, without)
    )
    assert found.plan.uncovered == (3,)
    assert found.evaluation.finish_s == pytest.approx(expected.evaluation.finish_s, rel=0.01)
    assert found.evaluation.flight_s == pytest.approx(expected.evaluation.flight_s, rel=0.01)


def test_packs_cost_time_where_they_are_short() -> None:
    many = solve_sorties_exact(line_instance(3, 6, budget_pct=32.0, days=DAY[:1]))
    few = line_instance(3, 6, budget_pct=32.0, packs=2, days=DAY[:1])
    some = solve_sorties_exact(few)
    assert many is not None
    assert some is not None
    assert evaluate_sorties(few, some).finish_s >= evaluate_sorties(few, many).finish_s
    none = replace(few, bases=tuple(replace(base, packs=0) for base in few.bases))
    assert solve_sorties_exact(none) is None


def test_unreachable_segments_have_no_plan_and_the_search_leaves_them_over() -> None:
    instance = line_instance(0, 5, budget_pct=15.0)
    assert solve_sorties_exact(instance) is None
    found = solve_sorties(instance, stop=Iterations(2_000))
    assert found.plan.uncovered
    assert found.evaluation.violations == ()


def test_a_proof_is_refused_where_it_would_not_be_one() -> None:
    with pytest.raises(InstanceError, match="at most 10"):
        solve_sorties_exact(line_instance(1, 11))
    for wrong in (
        line_instance(1, 4, packs=2, recharge_s=60.0, days=DAY[:1]), line_instance(1, 4, packs=2),
        line_instance(1, 4, stagger_s=5.0),
    ):  # fmt: skip
        with pytest.raises(InstanceError, match="stagger_s"):
            solve_sorties_exact(wrong)


def test_an_instance_says_what_does_not_fit() -> None:
    fine = line_instance(1, 4)

    def refused(pattern: str, **changes: Any) -> None:
        with pytest.raises(InstanceError, match=pattern):
            replace(fine, **changes)

    refused("expected one at least", days=())
    refused("has shape", out_s=fine.out_s[:1])
    refused("0 or more", home_s=-fine.home_s)
    refused("begin before its end", days=((5.0, 2.0),))
    refused("within a day", days=((0.0, 10.0),))
    refused("stagger_s", stagger_s=-1.0)
    for changes in ({"turnaround_s": -1.0}, {"recharge_s": -1.0}, {"packs": -1}):
        refused("expected 0 or more", bases=(replace(fine.bases[0], **changes), fine.bases[1]))
    for changes in ({"base": 7}, {"profile": 3}, {"consumption": 0.0}):
        refused("vehicle uav1", vehicles=(replace(fine.vehicles[0], **changes), fine.vehicles[1]))


def test_one_sortie_of_one_vehicle_is_a_single_flight() -> None:
    instance = single(line_instance(5, 7, bases=1, vehicles=1, budget_pct=500.0))
    found = solve_sorties(instance, stop=Iterations(20_000), seed=1)
    proven = solve_sorties_exact(instance)
    assert proven is not None
    assert len(found.plan.routes) == 1
    assert found.evaluation.finish_s == pytest.approx(evaluate_sorties(instance, proven).finish_s, abs=1e-6)


def single(instance: SortieInstance) -> SortieInstance:
    """Return the instance with turnarounds that are never worth it."""
    return replace(instance, bases=(replace(instance.bases[0], turnaround_s=3000.0),))
