"""The same seed gives the same plan, now as before: what each search answers is pinned."""

from __future__ import annotations

import hashlib
from collections.abc import Iterable

from planner import (
    Cost,
    Iterations,
    Plan,
    SearchParams,
    build_remaining_problem,
    build_risk_campaign,
    estimate_risks,
    find_pareto_front,
    replan,
    simulate_chunk,
    solve,
    solve_window,
    split_flights,
)
from planner.params import LargeParams, WindowSearchParams
from tests.planner.builders import fleet, random_instance

INSTANCE = random_instance(5, 25, fleet(60.0, 50.0, 70.0), dynamics=True)
SMALL = random_instance(3, 8, fleet(34.0, 34.0, 34.0))
REGIONS = SearchParams(large=LargeParams(above=20, region=15, spell=300))
SHORT_ROUNDS = SearchParams(window=WindowSearchParams(front_round=8_000))


def digest(plans: Iterable[Plan]) -> str:
    """Return a few letters that say which visits the routes of plans have."""
    routes = [[route.visits for route in plan.routes] for plan in plans]
    return hashlib.sha256(repr(routes).encode()).hexdigest()[:12]


def test_the_routes_of_a_seed_are_the_same_as_ever() -> None:
    stop = Iterations(3_001)
    assert digest(solve(INSTANCE, cost=cost, stop=stop, seed=7).plan for cost in Cost) == "0a8fd9738642"
    assert digest(solve(INSTANCE, cost=cost, stop=stop, seed=7, starts=3).plan for cost in Cost) == "89136847e97f"
    assert digest(solve(INSTANCE, cost=cost, stop=stop, seed=7, params=REGIONS).plan for cost in Cost) == "465656e4ab21"


def test_the_windows_of_a_seed_are_the_same_as_ever() -> None:
    found = [solve_window(SMALL, stretch=0.1, stop=Iterations(33_000), seed=5, starts=starts) for starts in (1, 2)]
    assert digest(one.plan for one in found) == "22d92de2bbc2"
    front = find_pareto_front(SMALL, stop=Iterations(60_000), seed=2, params=SHORT_ROUNDS)
    assert digest(one.plan for one in front) == "47b308bdd7b4"


def test_the_answers_to_losses_are_the_same_as_ever() -> None:
    plan = solve(INSTANCE, cost=Cost.MINCOMB, stop=Iterations(2_000), seed=1).plan
    lefts = [build_remaining_problem(INSTANCE, plan, lost, at_s) for lost in range(3) for at_s in (5.0, 60.0, 200.0)]
    answers = [replan(left.instance, warm=left.warm, stop=Iterations(500), seed=2).plan for left in lefts]
    assert digest([*(left.warm for left in lefts), *answers]) == "bc25487a0afe"


def test_the_risk_of_a_seed_is_the_same_as_ever() -> None:
    plan = solve(SMALL, cost=Cost.MINCOMB, stop=Iterations(2_000), seed=1).plan
    campaign = build_risk_campaign(SMALL, plan, mtbf_h=(0.02, 0.1), battery_spread_pct=8.0, effort=300)
    found = estimate_risks(campaign, [simulate_chunk(campaign, part) for part in split_flights(600, 4, per_chunk=200)])
    shares = [[round(600 * one.estimate) for one in risk.finished] for risk in found]
    assert shares == [[0, 0, 0], [43, 131, 147]]
