"""The chance of finishing: closed forms where there are any, and what holds for every plan."""

from __future__ import annotations

import math
import pickle

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from planner import (
    Cost,
    FirstFeasible,
    Instance,
    InstanceError,
    Iterations,
    Plan,
    PlanError,
    RiskCampaign,
    RiskEstimate,
    Route,
    build_instance,
    build_remaining_problem,
    build_risk_campaign,
    combine_stop_rules,
    estimate_risks,
    evaluate,
    replan,
    segment_of,
    simulate_chunk,
    solve,
    split_flights,
)
from planner.fleet_state import build_state_before_losses
from planner.risk import estimate_probability, repair_plan
from tests.planner.builders import UNIT, fleet, line, random_instance

FLIGHTS = 20_000
WIDE = 5.0
"""Standard deviations by which an estimate may miss: once in more than a million."""
HOUR_S = 3600.0


def estimate(instance: Instance, plan: Plan, mtbf_s: float, *, flights: int = FLIGHTS, **how: float) -> RiskEstimate:
    found = build_risk_campaign(
        instance, plan, mtbf_h=[mtbf_s / HOUR_S], battery_spread_pct=how.get("battery_spread_pct", 0.0),
        reserve_pct=how.get("reserve_pct", 15.0), max_losses=int(how.get("max_losses", 2)), effort=300,
    )  # fmt: skip
    return fly(found, flights)[0]


def fly(found: RiskCampaign, flights: int, seed: int = 1, per_chunk: int = FLIGHTS) -> tuple[RiskEstimate, ...]:
    return estimate_risks(
        found, [simulate_chunk(found, chunk) for chunk in split_flights(flights, seed, per_chunk=per_chunk)]
    )


def near(probability: float, flights: int = FLIGHTS) -> object:
    return pytest.approx(probability, abs=WIDE * math.sqrt(probability * (1 - probability) / flights))


def test_one_vehicle_must_live_until_its_last_visit_ends() -> None:
    # Three visits end at 10, 20, 30 s; the way home, until 60 s, no longer matters.
    found = estimate(line(3, 100.0), Plan((Route(0, (0, 2, 4)),)), 100.0)
    assert [chance.estimate for chance in found.finished] == [near(math.exp(-0.3))] * 3
    assert found.losses_share[0] == near(math.exp(-0.6))
    assert found.losses_share[2] == 0
    # A segment of 10 m is left for each visit that was not reached.
    assert found.undone_m[0] == pytest.approx(10 * sum(1 - math.exp(-t / 100) for t in (10, 20, 30)), rel=0.05)


def test_without_a_repair_two_vehicles_must_both_live() -> None:
    # a: eastward until 20 s, home at 40. b: westward until 30 s, home at 60. Neither can do more.
    ends = [[[10.0, 0.0], [20.0, 0.0]], [[-20.0, 0.0], [-30.0, 0.0]]]
    instance = build_instance(ends, (0.0, 0.0), fleet(40.0, 60.0), UNIT)
    found = estimate(instance, Plan((Route(0, (0,)), Route(1, (2,)))), 100.0)
    expected = math.exp(-0.2 - 0.3)
    assert found.finished[0].estimate == near(expected)
    assert found.finished[1].estimate == found.finished[2].estimate == found.finished[0].estimate
    assert found.expected_losses == pytest.approx(2 - math.exp(-0.4) - math.exp(-0.6), rel=0.05)
    assert found.finished[0].low < expected < found.finished[0].high


@pytest.mark.parametrize("max_losses", [1, 2, 3])
def test_each_spare_is_one_more_try(max_losses: int) -> None:
    # One visit of 10 s, three spares that can all do it: each try fails with 1 - exp(-10/20).
    instance, plan = line(1, 100.0, 100.0, 100.0, 100.0), Plan((Route(0, (0,)), *(Route(k, ()) for k in (1, 2, 3))))
    found = estimate(instance, plan, 20.0, max_losses=max_losses)
    fails = 1 - math.exp(-0.5)
    assert [chance.estimate for chance in found.finished] == [
        near(1 - fails ** (tries + 1)) for tries in range(max_losses + 1)
    ]
    assert found.undone_m == pytest.approx([10 * (1 - chance.estimate) for chance in found.finished])


def test_a_spare_does_not_fail_on_the_ground() -> None:
    instance, plan = line(1, 100.0, 100.0), Plan((Route(0, (0,)), Route(1, ())))
    found = estimate(instance, plan, 20.0, max_losses=1)
    # 20 s in the air for the first, and, if it is lost in its first 10, 20 s for the spare.
    once, again = 1 - math.exp(-1.0), (1 - math.exp(-0.5)) * (1 - math.exp(-1.0))
    assert found.expected_losses == pytest.approx(once + again, rel=0.05)


def test_a_vehicle_that_flies_again_continues_its_flight_hours() -> None:
    # b lands at 20 s. When a is lost at 25 s, on the visit that ends at 30 m east, b flies there and back: 60 s.
    state = build_state_before_losses(line(3, 100.0, 200.0), Plan((Route(0, (2, 4)), Route(1, (0,)))))
    answer = repair_plan(state, 0, 25.0, effort=100)
    assert answer is not None
    after = state.apply_plan(*answer)
    assert after.fleet == (1,)
    flown = after.progress_of(0)
    assert flown.time_s.tolist() == [0, 10, 20, 25, 55, 85]
    assert flown.airborne_s.tolist() == flown.used_pct.tolist() == [0, 10, 20, 20, 50, 80]
    assert after.visit_ends_s(0).tolist() == [55]
    assert after.visit_values(0).tolist() == [10]


def test_a_battery_that_holds_less_than_the_route_takes_is_a_loss() -> None:
    # The visits take 30 %, budget and reserve are 33 %: too little where the factor is above 1.1 = 1 + one spread.
    instance, plan = line(3, 60.0), Plan((Route(0, (0, 2, 4)),))
    found = estimate(instance, plan, 1e12, battery_spread_pct=10.0, reserve_pct=6.0)
    # 66 % for 60 % of the whole route.
    above = 0.5 * math.erfc(1.0 / math.sqrt(2.0))
    assert found.losses_share[1] == near(above)
    # It dies on its way home as long as 30 % is within reach: factors up to 2.2.
    assert found.finished[0].estimate == 1.0
    certain = estimate(instance, plan, 1e12, battery_spread_pct=0.0, reserve_pct=0.0)
    assert certain.expected_losses == 0


def test_intervals_are_those_of_wilson() -> None:
    # Newcombe 1998, table I: 81 of 263.
    found = estimate_probability(81, 263)
    assert (round(found.low, 4), round(found.high, 4)) == (0.2553, 0.3662)
    assert estimate_probability(0, 20).low == 0.0
    assert estimate_probability(20, 20).high == 1.0


@settings(max_examples=15, deadline=None)
@given(seed=st.integers(0, 10_000), vehicles=st.integers(2, 4), mtbf_s=st.floats(100.0, 3000.0))
def test_more_replans_never_hurt(seed: int, vehicles: int, mtbf_s: float) -> None:
    instance = random_instance(seed, 7, fleet(*[100.0] * vehicles))
    plan = solve(instance, cost=Cost.MINMAX, stop=Iterations(300), seed=seed, all_vehicles=True).plan
    found = estimate(instance, plan, mtbf_s, flights=300, battery_spread_pct=10.0, max_losses=3)
    chances = [chance.estimate for chance in found.finished]
    assert chances == sorted(chances)
    assert list(found.undone_m) == sorted(found.undone_m, reverse=True)
    assert sum(found.losses_share) == pytest.approx(1.0)
    assert sum(found.blame_share) == pytest.approx(1.0 if chances[-1] < 1 else 0.0)


@settings(max_examples=25, deadline=None)
@given(seed=st.integers(0, 10_000), shares=st.lists(st.floats(0.01, 0.99), min_size=1, max_size=3))
def test_a_state_after_losses_holds_its_budgets_and_all_that_is_left(seed: int, shares: list[float]) -> None:
    instance = random_instance(seed, 8, fleet(90.0, 90.0, 90.0, 90.0))
    plan = solve(instance, cost=Cost.MINMAX, stop=Iterations(300), seed=seed).plan
    state, at_s, inspected = build_state_before_losses(instance, plan), 0.0, 0
    for number, share in enumerate(sorted(shares)):
        at_s = max(at_s, share * evaluate(instance, plan, Cost.MINMAX).longest_route_s)
        lost = number % len(state.fleet)
        answer = repair_plan(state, lost, at_s, effort=200)
        if answer is None:
            return
        left, new = answer
        inspected = left.instance.segments + sum(
            len(one.completed) + (one.finishing is not None) for one in left.survivors
        ) + len(left.completed)  # fmt: skip
        assert inspected == state.instance.segments
        state = state.apply_plan(left, new)
        found = evaluate(state.instance, state.plan, Cost.MINMAX)
        assert found.violations == ()
        assert state.plan.uncovered == ()
        for vehicle, name in enumerate(state.fleet):
            flown = state.progress_of(vehicle)
            assert np.all(np.diff(flown.time_s) >= -1e-9)
            assert flown.used_pct[-1] <= instance.vehicles[name].budget_pct + 1e-6
            assert flown.time_s[-1] == pytest.approx(found.durations_s[vehicle])


def test_the_state_is_what_the_definition_makes_of_the_same_loss() -> None:
    instance = random_instance(5, 8, fleet(150.0, 150.0, 150.0))
    plan = solve(instance, cost=Cost.MINMAX, stop=Iterations(500), seed=1).plan
    at_s = 0.4 * evaluate(instance, plan, Cost.MINMAX).longest_route_s
    left = build_remaining_problem(instance, plan, 1, at_s)
    result = replan(left.instance, warm=left.warm, stop=combine_stop_rules(FirstFeasible(), Iterations(500)))
    assert result.feasible
    state = build_state_before_losses(instance, plan).apply_plan(left, result.plan)
    assert state.fleet == (0, 2)
    for vehicle, survivor in enumerate(left.survivors):
        new_s = result.evaluation.durations_s[vehicle]
        assert state.progress_of(vehicle).time_s[-1] == pytest.approx(survivor.free_s + new_s)
        used_pct = survivor.spent_pct + result.evaluation.energies_pct[vehicle]
        assert state.progress_of(vehicle).used_pct[-1] == pytest.approx(used_pct)
        assert len(state.visit_ends_s(vehicle)) == len(state.plan.routes[vehicle].visits)
    visited = {segment_of(visit) for route in state.plan.routes for visit in route.visits}
    assert visited == set(range(state.instance.segments))


def test_the_answer_depends_on_nothing_but_plan_and_seed() -> None:
    instance = random_instance(3, 8, fleet(120.0, 120.0, 120.0))
    plan = solve(instance, cost=Cost.MINMAX, stop=Iterations(500), seed=1).plan
    found = build_risk_campaign(instance, plan, mtbf_h=(0.3, 1.0), battery_spread_pct=5.0, effort=100)
    sent: RiskCampaign = pickle.loads(pickle.dumps(found))  # noqa: S301 - it is our own
    assert fly(found, 200, per_chunk=50) == fly(sent, 200, per_chunk=50)
    assert fly(found, 200, seed=1, per_chunk=50) != fly(found, 200, seed=2, per_chunk=50)
    chunks = split_flights(200, 1, per_chunk=50)
    backwards = [simulate_chunk(found, chunk) for chunk in reversed(chunks)]
    assert estimate_risks(found, backwards[::-1]) == fly(found, 200, per_chunk=50)
    # The same chance for each mean time between failures: more time, fewer losses.
    short, long = fly(found, 200)
    assert short.expected_losses > long.expected_losses
    alone = build_risk_campaign(instance, plan, mtbf_h=(1.0,), battery_spread_pct=5.0, effort=100)
    assert fly(alone, 200) == (long,)


def test_what_is_no_figure_for_a_campaign_is_refused() -> None:
    instance, plan = line(1, 100.0, 100.0), Plan((Route(0, (0,)), Route(1, ())))
    for wrong in ({"mtbf_h": ()}, {"mtbf_h": (0.0,)}, {"mtbf_h": (math.nan,)}):
        with pytest.raises(InstanceError, match="mean time between failures"):
            build_risk_campaign(instance, plan, **wrong)
    with pytest.raises(InstanceError, match="battery spread is -1"):
        build_risk_campaign(instance, plan, mtbf_h=(1.0,), battery_spread_pct=-1.0)
    with pytest.raises(InstanceError, match="reserve is -1"):
        build_risk_campaign(instance, plan, mtbf_h=(1.0,), reserve_pct=-1.0)
    with pytest.raises(InstanceError, match="max_losses is -1"):
        build_risk_campaign(instance, plan, mtbf_h=(1.0,), max_losses=-1)
    with pytest.raises(InstanceError, match="flights is 0"):
        split_flights(0, 1)
    with pytest.raises(PlanError, match="leaves out 1 segments"):
        build_risk_campaign(instance, Plan((Route(0, ()), Route(1, ())), (0,)), mtbf_h=(1.0,))
    with pytest.raises(PlanError, match="a spends 20"):
        build_risk_campaign(line(1, 10.0, 10.0), plan, mtbf_h=(1.0,))
