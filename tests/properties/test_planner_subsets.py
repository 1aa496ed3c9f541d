"""The program over all sets of segments against the definition in evaluate.py and every plan there is."""

from __future__ import annotations

import itertools
from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from planner import (
    PRESETS,
    Cost,
    FirstFeasible,
    Instance,
    InstanceError,
    Iterations,
    Plan,
    Route,
    Travel,
    Vehicle,
    build_instance,
    build_remaining_problem,
    combine_stop_rules,
    evaluate,
    route_energy_pct,
    solve,
    travel_for,
)
from planner.exact import EXACT_SEGMENTS, find_covering_plan, find_subset_routes
from planner.moves import Dynamics
from tests.planner.builders import fleet, line, random_instance

# A coarse grid, so that coincident pylons and segments without length are common.
COORDINATES = st.integers(-4, 4).map(lambda steps: 50.0 * steps)
POINTS = st.tuples(COORDINATES, COORDINATES)
TRAVELS = st.sampled_from([
    Travel(5.0, 1.0, 0.05, 0.06),
    Travel(5.0, 1.0, 0.05, 0.06, Dynamics()),
    travel_for(PRESETS["mavic2"], 8.0, 3.0, wind_m_s=(4.0, -3.0)),
])  # fmt: skip
VEHICLES = st.builds(
    Vehicle,
    name=st.just("v"),
    start_m=POINTS,
    budget_pct=st.one_of(st.floats(0.0, 40.0), st.sampled_from([0.0, 1000.0])),
    consumption=st.sampled_from([1.0, 1.3]),
    airborne=st.booleans(),
)


@st.composite
def instances(draw: st.DrawFn, most_segments: int, most_vehicles: int) -> Instance:
    ends = draw(st.lists(st.tuples(POINTS, POINTS), min_size=1, max_size=most_segments))
    vehicles = draw(st.lists(VEHICLES, min_size=1, max_size=most_vehicles))
    travels = [draw(TRAVELS) for _ in vehicles]
    return build_instance(np.array(ends), draw(POINTS), vehicles, travels)


LOOSE: dict[str, Any] = {"deadline": None, "derandomize": True}


def orders(segments: list[int]) -> Iterator[tuple[int, ...]]:
    """Yield every sequence of visits through the segments."""
    for order in itertools.permutations(segments):
        for directions in itertools.product((0, 1), repeat=len(order)):
            yield tuple(2 * s + d for s, d in zip(order, directions, strict=True))


@settings(max_examples=60, **LOOSE)
@given(instances(most_segments=4, most_vehicles=2))
def test_the_best_route_of_a_set_is_the_best_of_all_its_orders(instance: Instance) -> None:
    for number, own in enumerate(find_subset_routes(instance)):
        budget = instance.vehicles[number].budget_pct
        for chosen in range(2**instance.segments):
            inside = [segment for segment in range(instance.segments) if chosen >> segment & 1]
            brute = min(route_energy_pct(instance, Route(number, visits)) for visits in orders(inside))
            if brute <= budget:
                assert own.energy_pct[chosen] == brute
                assert route_energy_pct(instance, Route(number, own.route_of(chosen))) == brute
            elif brute > budget + 2e-6:
                assert own.energy_pct[chosen] == np.inf


@settings(max_examples=100, **LOOSE)
@given(instances(most_segments=4, most_vehicles=3))
def test_a_plan_is_found_exactly_where_there_is_one(instance: Instance) -> None:
    fleet_of = range(len(instance.vehicles))

    def fits(number: int, owner: tuple[int, ...]) -> bool:
        own = [segment for segment in range(instance.segments) if owner[segment] == number]
        least = min(route_energy_pct(instance, Route(number, visits)) for visits in orders(own))
        return least <= instance.vehicles[number].budget_pct + 1e-6

    owners = itertools.product(fleet_of, repeat=instance.segments)
    exists = any(all(fits(number, owner) for number in fleet_of) for owner in owners)
    plan = find_covering_plan(instance)
    assert (plan is not None) == exists
    if plan is not None:
        assert plan.uncovered == ()
        assert evaluate(instance, plan, Cost.MINSUM).violations == ()


@settings(max_examples=25, **LOOSE)
@given(st.integers(0, 10**6), st.integers(5, 10), st.integers(1, 4), st.floats(0.8, 1.3), st.booleans())
def test_what_the_search_finds_exists(seed: int, segments: int, vehicles: int, share: float, dynamics: bool) -> None:
    loose = random_instance(seed, segments, fleet(*[1e6] * vehicles), dynamics=dynamics)
    best = solve(loose, cost=Cost.MINMAX, stop=Iterations(1500)).evaluation.value
    tight = random_instance(seed, segments, fleet(*[share * best] * vehicles), dynamics=dynamics)
    found = solve(tight, cost=Cost.MINSUM, stop=combine_stop_rules(FirstFeasible(), Iterations(3000)))
    plan = find_covering_plan(tight)
    assert (plan is not None) == found.feasible
    if plan is not None:
        assert evaluate(tight, plan, Cost.MINSUM).violations == ()


def test_a_loss_that_can_be_made_good_is_distinguished_from_one_that_cannot() -> None:
    instance = random_instance(3, 10, fleet(*[29.0] * 3))
    flown = solve(instance, cost=Cost.MINMAX, stop=Iterations(2000))
    answers = [
        find_covering_plan(
            build_remaining_problem(instance, flown.plan, 0, share * flown.evaluation.longest_route_s).instance
        )
        is not None
        for share in (0.0, 0.9)
    ]
    assert answers == [False, True]


def test_a_budget_is_met_to_the_tolerance() -> None:
    exact = find_covering_plan(line(3, 60.0))
    assert exact is not None
    assert route_energy_pct(line(3, 60.0), exact.routes[0]) == 60.0
    assert find_covering_plan(line(3, 60.0 - 0.5e-6)) is not None
    assert find_covering_plan(line(3, 60.0 - 2e-6)) is None


def test_without_a_segment_vehicles_must_still_get_home() -> None:
    near, far = Vehicle("near", (10.0, 0.0), 20.0, airborne=True), Vehicle("far", (30.0, 0.0), 20.0, airborne=True)
    travel = Travel(1.0, 1.0, 1.0, 1.0)
    assert find_covering_plan(build_instance([], (0.0, 0.0), [near, near], travel)) == Plan(
        (Route(0, ()), Route(1, ()))
    )
    assert find_covering_plan(build_instance([], (0.0, 0.0), [near, far], travel)) is None


def test_more_segments_than_the_limit_are_refused() -> None:
    with pytest.raises(InstanceError, match=f"{EXACT_SEGMENTS + 1} segments, expected at most {EXACT_SEGMENTS}"):
        find_covering_plan(line(EXACT_SEGMENTS + 1, 1.0))
