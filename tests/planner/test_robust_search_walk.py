"""A walk on the window keeps repairs from plan to plan: what it believes of them is what the definition says."""

from __future__ import annotations

import pytest

from planner import Cost, Instance, Iterations, Plan, Route, solve
from planner.evaluate import evaluate
from planner.replan import build_remaining_problem
from planner.robust_search import FoundPlan, RobustSearch, Walker
from planner.stop_rules import Stopwatch
from tests.planner.builders import fleet, random_instance

INSTANCE = random_instance(11, 24, fleet(70.0, 70.0, 70.0, 70.0))


def walked(instance: Instance, seed: int, iterations: int) -> Walker:
    """Return a walk that has gone some way below the window of an ordinary plan."""
    plan = solve(instance, cost=Cost.MINSUM, stop=Iterations(2_000), seed=seed).plan
    search = RobustSearch(
        instance, Iterations(10**9), Stopwatch(), seed=seed, all_vehicles=False, starts=1, fly_again=True
    )
    routes = tuple(route.visits for route in plan.routes)
    longest_s = evaluate(instance, plan, Cost.MINMAX).longest_route_s
    walker = search._build_walker(seed, FoundPlan(routes, 0.6 * longest_s, longest_s))
    search._cap_s = float("inf")
    search._begin_cycle(walker)
    walker.left = walker.length = 10 * iterations  # nothing may begin anew
    search._walk(walker, iterations)
    return walker


@pytest.mark.parametrize("seed", range(4))
def test_repairs_that_are_kept_are_repairs_of_the_plan_where_the_walk_stands(seed: int) -> None:
    walker = walked(INSTANCE, seed, 3_000)
    here, fleet_size = walker.here, len(INSTANCE.vehicles)
    plan = Plan(tuple(
        Route(route, tuple(int(visit) for visit in here.base.visits[route, :length]))
        for route, length in enumerate(here.base.lengths)
    ))  # fmt: skip
    looked = [slot for slot in range(len(here.lacks)) if here.repairs.known[slot] == 1 and here.lacks[slot] > -1]
    seen = 0
    for slot in looked:
        lost, at_s = slot % fleet_size, float(walker.probes_s[slot // fleet_size])
        if at_s < 0 or here.clock.durations_s[lost] <= at_s:
            continue
        seen += 1
        left = build_remaining_problem(INSTANCE, plan, lost, at_s)
        number = {segment: place for place, segment in enumerate(left.open_segments)}
        routes = tuple(
            Route(place, tuple(
                2 * number[int(visit) >> 1] + (int(visit) & 1)
                for visit in here.repairs.visits[slot, survivor.vehicle, : here.repairs.lengths[slot, survivor.vehicle]]
            ))
            for place, survivor in enumerate(left.survivors)
        )  # fmt: skip
        figures = evaluate(left.instance, Plan(routes), Cost.MINSUM)
        lacks = sum(
            max(0.0, energy - vehicle.budget_pct)
            for energy, vehicle, route in zip(figures.energies_pct, left.instance.vehicles, routes, strict=True)
            if route.visits
        )
        assert sorted(visit >> 1 for route in routes for visit in route.visits) == list(range(len(number)))
        assert lacks == pytest.approx(float(here.lacks[slot]), abs=1e-6)
    assert seen > 0
