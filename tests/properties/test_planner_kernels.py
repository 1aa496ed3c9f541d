"""The kernels against the definition in evaluate.py, on random instances and on degenerate ones."""

from __future__ import annotations

import itertools
from typing import Any

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from planner import (
    DEFAULT_PARAMS,
    Cost,
    Instance,
    Plan,
    Route,
    SteadyWind,
    Travel,
    Vehicle,
    build_instance,
    evaluate,
    route_energy_pct,
)
from planner.kernels.anneal import compute_objective
from planner.kernels.tours import (
    draw_integer,
    draw_uniform,
    find_cheapest_place,
    insert,
    insert_by_regret,
    orient_visits,
)
from planner.moves import Dynamics
from planner.plan_search import (
    PlanSearch,
    build_guide_weights,
    build_kernel_problem,
    build_kernel_state,
    build_plan,
    build_random_state,
    build_true_weights,
)
from planner.stop_rules import Stopwatch

# A coarse grid, so that coincident pylons and segments without length are common.
COORDINATES = st.integers(-4, 4).map(lambda steps: 50.0 * steps)
POINTS = st.tuples(COORDINATES, COORDINATES)
VEHICLES = st.builds(
    Vehicle,
    name=st.just("v"),
    start_m=POINTS,
    budget_pct=st.sampled_from([0.0, 5.0, 20.0, 60.0, 1000.0]),
    consumption=st.sampled_from([1.0, 1.3]),
    airborne=st.booleans(),
)


# Wind makes a move and its reverse differ; vehicles differ in speed, rate and dynamics.
TRAVELS = st.sampled_from([
    Travel(5.0, 1.0, 0.05, 0.06),
    Travel(8.0, 2.0, 0.07, 0.05, Dynamics()),
    Travel(5.0, 1.0, 0.05, 0.06, None, SteadyWind(3.0, -1.0, (0.0, 4.0, 8.0, 12.0), (0.06, 0.05, 0.07, 0.2))),
])  # fmt: skip


@st.composite
def instances(draw: st.DrawFn, most_segments: int = 9) -> Instance:
    ends = draw(st.lists(st.tuples(POINTS, POINTS), min_size=1, max_size=most_segments))
    vehicles = draw(st.lists(VEHICLES, min_size=1, max_size=4))
    travels = draw(st.lists(TRAVELS, min_size=len(vehicles), max_size=len(vehicles)))
    return build_instance(np.array(ends), draw(POINTS), vehicles, travels)


SEEDS = st.integers(0, 2**64)
LOOSE: dict[str, Any] = {"deadline": None, "derandomize": True}


@settings(max_examples=150, **LOOSE)
@given(instances(), SEEDS, st.sampled_from(Cost), st.booleans())
def test_a_search_keeps_exact_loads_and_never_exceeds_a_budget(
    instance: Instance, seed: int, cost: Cost, all_vehicles: bool
) -> None:
    search = PlanSearch(instance, cost=cost, seed=seed, initial=None, all_vehicles=all_vehicles, watch=Stopwatch())
    for iterations in (1, 7, 40):
        search._advance(iterations)
        for state in (search._leader.best, search._starts[0].current, search._starts[0].trial):
            plan = build_plan(state)
            evaluation = evaluate(instance, plan, cost)
            assert state.loads.tolist() == pytest.approx(evaluation.energies_pct, abs=1e-9)
            for vehicle, route in zip(instance.vehicles, plan.routes, strict=True):
                # What is given a visit is within its budget; one that cannot even get home is given none. On its
                # way the search may go beyond.
                most = (
                    vehicle.budget_pct
                    if state is search._leader.best
                    else vehicle.budget_pct * (1 + DEFAULT_PARAMS.annealing.slack)
                )
                assert not route.visits or state.loads[route.vehicle] <= most + 1e-6
            accounted = [visit >> 1 for route in plan.routes for visit in route.visits] + list(plan.uncovered)
            assert sorted(accounted) == list(range(instance.segments))


@settings(max_examples=60, **LOOSE)
@given(instances(), SEEDS, st.sampled_from(Cost))
def test_what_is_remembered_of_places_is_so(instance: Instance, seed: int, cost: Cost) -> None:
    search = PlanSearch(instance, cost=cost, seed=seed, initial=None, all_vehicles=False, watch=Stopwatch(), starts=2)
    search._advance(150)
    for start in search._starts:
        memory, state = start._memory, start.current
        for segment, route in np.argwhere(memory.version == memory.versions).tolist():
            if state.route_of[segment] == route:
                continue  # it was looked for when the segment was out of the route
            place = find_cheapest_place(search._problem, state, route, segment, 0.0, build_random_state(0))
            assert memory.added[segment, route] == place[0]
            assert memory.place[segment, route] == 2 * place[1] + (place[2] & 1)


@settings(max_examples=60, **LOOSE)
@given(instances(), SEEDS, st.sampled_from(Cost))
def test_the_objective_is_the_cost_function(instance: Instance, seed: int, cost: Cost) -> None:
    search = PlanSearch(instance, cost=cost, seed=seed, initial=None, all_vehicles=False, watch=Stopwatch())
    search._advance(20)
    truth = build_true_weights(build_kernel_problem(instance), cost, all_vehicles=False)
    evaluation = evaluate(instance, build_plan(search._leader.best), cost)
    if not evaluation.violations:
        assert compute_objective(build_kernel_problem(instance), truth, search._leader.best) == pytest.approx(
            evaluation.value, rel=1e-5, abs=1e-9
        )


@settings(max_examples=60, **LOOSE)
@given(instances(), st.data())
def test_the_cheapest_place_is_the_cheapest(instance: Instance, data: st.DataObject) -> None:
    problem = build_kernel_problem(instance)
    order = data.draw(st.permutations(range(instance.segments)))
    visits = [2 * segment + data.draw(st.integers(0, 1)) for segment in order[1:]]
    state = build_kernel_state(problem, [])
    for place, visit in enumerate(visits):
        insert(problem, state, 0, place, visit)
    before = route_energy_pct(instance, Route(0, tuple(visits)))
    added, position, visit = find_cheapest_place(problem, state, 0, order[0], 0.0, build_random_state(0))
    brute = min(
        route_energy_pct(instance, Route(0, (*visits[:place], 2 * order[0] + reverse, *visits[place:])))
        for place in range(len(visits) + 1)
        for reverse in (0, 1)
    )
    assert before + added == pytest.approx(brute, abs=1e-9)
    insert(problem, state, 0, position, visit)
    assert state.loads[0] == pytest.approx(brute, abs=1e-9)


@settings(max_examples=60, **LOOSE)
@given(instances(most_segments=6), st.data())
def test_orient_finds_the_best_directions(instance: Instance, data: st.DataObject) -> None:
    problem = build_kernel_problem(instance)
    order = data.draw(st.permutations(range(instance.segments)))
    state = build_kernel_state(problem, [])
    for place, segment in enumerate(order):
        insert(problem, state, 0, place, 2 * segment + data.draw(st.integers(0, 1)))
    orient_visits(problem, state, 0, np.zeros((instance.segments, 2), dtype=np.int64))
    brute = min(
        route_energy_pct(instance, Route(0, tuple(2 * s + d for s, d in zip(order, directions, strict=True))))
        for directions in itertools.product((0, 1), repeat=len(order))
    )
    found = tuple(int(visit) for visit in state.visits[0, : len(order)])
    assert [visit >> 1 for visit in found] == list(order)
    assert route_energy_pct(instance, Route(0, found)) == pytest.approx(brute, abs=1e-9)
    assert state.loads[0] == pytest.approx(brute, abs=1e-9)


@settings(max_examples=60, **LOOSE)
@given(instances(), st.sampled_from(Cost))
def test_regret_leaves_out_only_what_fits_nowhere(instance: Instance, cost: Cost) -> None:
    problem = build_kernel_problem(instance)
    state = build_kernel_state(problem, [])
    everything = np.arange(instance.segments, dtype=np.int64)
    weights = build_guide_weights(problem, cost, DEFAULT_PARAMS.annealing, scale=1.0, all_vehicles=False, power=8.0)
    insert_by_regret(problem, weights, state, everything, build_random_state(0))
    plan = build_plan(state)
    for left in plan.uncovered:
        for route, vehicle in zip(plan.routes, instance.vehicles, strict=True):
            for place, reverse in itertools.product(range(len(route.visits) + 1), (0, 1)):
                longer = Route(route.vehicle, (*route.visits[:place], 2 * left + reverse, *route.visits[place:]))
                assert route_energy_pct(instance, longer) > vehicle.budget_pct


@settings(max_examples=40, **LOOSE)
@given(instances(), st.lists(st.lists(st.integers(0, 17), max_size=9), min_size=1, max_size=4))
@example(build_instance([[[0.0, 0.0], [0.0, 0.0]]], (0, 0), [Vehicle("v", (0, 0), 0.0)], Travel(5, 1, 1, 1)), [[0]])
def test_given_routes_are_cut_down_to_their_budgets(instance: Instance, wishes: list[list[int]]) -> None:
    seen: set[int] = set()
    routes: list[list[int]] = []
    for wish in wishes[: len(instance.vehicles)]:
        route = [visit for visit in dict.fromkeys(wish) if visit >> 1 < instance.segments and visit >> 1 not in seen]
        route = [visit for place, visit in enumerate(route) if visit >> 1 not in {v >> 1 for v in route[:place]}]
        seen.update(visit >> 1 for visit in route)
        routes.append(route)
    plan = build_plan(build_kernel_state(build_kernel_problem(instance), routes))
    for wish, kept in zip(routes, plan.routes, strict=False):
        assert [visit for visit in wish if visit in kept.visits] == list(kept.visits)
        if kept.visits != tuple(wish):
            full = route_energy_pct(instance, Route(kept.vehicle, tuple(wish)))
            assert full > instance.vehicles[kept.vehicle].budget_pct
        if kept.visits:
            assert route_energy_pct(instance, kept) <= instance.vehicles[kept.vehicle].budget_pct + 1e-6


def test_chance_is_uniform_and_the_seed_decides() -> None:
    rng = build_random_state(1)
    numbers = np.array([draw_uniform(rng) for _ in range(20_000)])
    assert numbers.min() >= 0
    assert numbers.max() < 1
    counts = np.histogram(numbers, bins=20, range=(0, 1))[0]
    assert np.abs(counts - 1000).max() < 150  # five standard deviations
    again = build_random_state(1)
    assert [draw_uniform(again) for _ in range(5)] == numbers[:5].tolist()
    rolls = build_random_state(2)
    assert {draw_integer(rolls, 6) for _ in range(200)} == set(range(6))


def test_plans_of_no_routes_name_everything() -> None:
    instance = build_instance(np.zeros((2, 2, 2)), (0, 0), [Vehicle("v", (0, 0), 1.0)], Travel(5, 1, 1, 1))
    assert build_plan(build_kernel_state(build_kernel_problem(instance), [])) == Plan((Route(0, ()),), (0, 1))
