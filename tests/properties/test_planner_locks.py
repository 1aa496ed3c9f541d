"""Locks of random small instances: kept by every solver and after every loss but that of the vehicle they name."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from planner import (
    Cost,
    Instance,
    Iterations,
    Plan,
    Result,
    Vehicle,
    build_remaining_problem,
    evaluate,
    find_pareto_front,
    replan,
    segment_of,
    solve,
    solve_exact,
    solve_grasp,
    solve_window,
)
from planner.evaluate import RepairStatus
from planner.exact import find_covering_plan
from planner.fleet_state import build_state_before_losses
from planner.model import BARRED_PCT, lift_locks, visit_of
from planner.moves import MoveTables
from planner.params import DEFAULT_PARAMS
from planner.risk import repair_plan
from planner.sorties import SortieInstance, evaluate_sorties, solve_sorties
from planner.sorties.sortie_losses import build_sorties_after_loss
from planner.window import iterate_losses
from tests.planner.builders import random_instance
from tests.planner.sorties.builders import line_instance

LOOSE: dict[str, Any] = {"deadline": None, "derandomize": True}
Directions = Mapping[int, bool]


def lock(instance: Instance, locked: Mapping[int, int], directions: Directions) -> Instance:
    """Return an instance with locks in its prices, as missions make them."""
    fleet, profiles, tables = range(len(instance.vehicles)), list(instance.profile), instance.moves.tabulate()
    more = np.zeros((len(instance.vehicles), 2 * instance.segments))
    for segment, keeper in locked.items():
        more[[one for one in fleet if one != keeper], 2 * segment : 2 * segment + 2] += BARRED_PCT
    for segment, is_turned in directions.items():
        more[:, visit_of(segment, not is_turned)] += BARRED_PCT
    return replace(
        instance,
        profile=tuple(fleet),
        moves=MoveTables(tables.table_s[profiles], tables.table_pct[profiles]).add_pct(more),
        start_pct=instance.start_pct + more * np.array([[one.consumption] for one in instance.vehicles]),
        depot_pct=instance.depot_pct + more,
        locked=locked,
    )


@st.composite
def instances(draw: st.DrawFn, most_segments: int = 7) -> tuple[Instance, Directions]:
    """Return small instances with locks: who alone flies some segments, in which direction some are flown."""
    chance = np.random.default_rng(draw(st.integers(0, 10**6)))
    fleet = draw(st.integers(2, 3))
    vehicles = [
        Vehicle(
            f"v{number}",
            (0.0, 0.0) if draw(st.booleans()) else (float(chance.uniform(-300, 300)), float(chance.uniform(-300, 300))),
            float(chance.uniform(15, 80)), float(chance.uniform(0.9, 1.3)), airborne=draw(st.booleans()),
        )
        for number in range(fleet)
    ]  # fmt: skip
    segments = draw(st.integers(2, most_segments))
    some = st.integers(0, segments - 1)
    locked = draw(st.dictionaries(some, st.integers(0, fleet - 1), min_size=1, max_size=segments))
    directions = draw(st.dictionaries(some, st.booleans(), max_size=segments))
    plain = random_instance(int(chance.integers(10**6)), segments, vehicles, dynamics=draw(st.booleans()))
    return lock(replace(plain, answer_s=float(draw(st.sampled_from((0, 20))))), locked, directions), directions


def find_broken_locks(instance: Instance, directions: Directions, plan: Plan) -> list[str]:
    """Return in words which visits of a plan a lock forbids."""
    return [
        f"visit {visit} by {route.vehicle}"
        for route in plan.routes
        for visit in route.visits
        if instance.locked.get(segment_of(visit), route.vehicle) != route.vehicle
        or visit_of(segment_of(visit), directions.get(segment_of(visit), bool(visit & 1))) != visit
    ]


@settings(max_examples=40, **LOOSE)
@given(instances(), st.sampled_from(Cost))
def test_every_solver_keeps_locks(case: tuple[Instance, Directions], cost: Cost) -> None:
    instance, directions = case
    found: list[Result] = [
        solve(instance, cost=cost, stop=Iterations(60)),
        solve(instance, cost=cost, stop=Iterations(60), all_vehicles=True),
        solve_exact(instance, cost=cost, stop=Iterations(100)),
        solve_grasp(instance, cost=cost, stop=Iterations(60)),
        solve_window(instance, stretch=0.1, stop=Iterations(300)),
    ]
    plans = [one.plan for one in found] + [one.plan for one in find_pareto_front(instance, stop=Iterations(600))]
    for plan in plans:
        assert find_broken_locks(instance, directions, plan) == []
        flown = {segment_of(visit) for route in plan.routes for visit in route.visits}
        assert flown | set(plan.uncovered) == set(range(instance.segments))
    for one in (*found[:3], found[4]):
        assert not [
            line for line in one.evaluation.violations if "cannot get home" not in line and "spends" not in line
        ]
    assert found[0].evaluation.value >= found[2].evaluation.value - 1e-6 or len(found[0].plan.uncovered) > len(
        found[2].plan.uncovered
    )


@settings(max_examples=30, **LOOSE)
@given(instances(), st.booleans())
def test_a_loss_lifts_the_locks_of_the_lost_alone(case: tuple[Instance, Directions], fly_again: bool) -> None:
    instance, directions = case
    plan = solve(instance, cost=Cost.MINCOMB, stop=Iterations(30)).plan
    for row in iterate_losses(instance, plan, fly_again=fly_again, effort=400):
        left = build_remaining_problem(instance, plan, row.vehicle, row.from_s, fly_again=fly_again)
        fleet = [survivor.vehicle for survivor in left.survivors]
        assert {left.open_segments[number]: fleet[own] for number, own in left.instance.locked.items()} == {
            segment: keeper
            for segment, keeper in instance.locked.items()
            if keeper != row.vehicle and segment in left.open_segments
        }
        ways = {number: directions[one] for number, one in enumerate(left.open_segments) if one in directions}
        exact = find_covering_plan(left.instance)
        again = replan(left.instance, warm=left.warm, stop=Iterations(30)).plan
        for answer in (exact, again, left.warm, row.plan):
            assert answer is None or find_broken_locks(left.instance, ways, answer) == []
        assert row.verdict is (RepairStatus.IMPOSSIBLE if exact is None else RepairStatus.FEASIBLE)
        if row.plan is not None:
            assert row.plan.uncovered == ()
            assert evaluate(left.instance, row.plan, Cost.MINSUM).violations == ()


@settings(max_examples=30, **LOOSE)
@given(instances())
def test_without_its_locks_an_instance_is_as_before(case: tuple[Instance, Directions]) -> None:
    instance, directions = case
    plain, free = lift_locks(instance, range(3)), lock(lift_locks(instance, range(3)), instance.locked, {})
    assert plain.locked == {}
    assert np.allclose(free.moves.tabulate().table_pct, instance.moves.tabulate().table_pct, atol=1e-9)
    assert np.allclose(free.start_pct, instance.start_pct, atol=1e-9)
    assert np.allclose(free.depot_pct, instance.depot_pct, atol=1e-9)
    assert (plain.moves.tabulate().table_pct < BARRED_PCT / 2).all() == (not directions)


@settings(max_examples=15, **LOOSE)
@given(instances(), st.floats(0, 1))
def test_one_loss_after_another_lifts_one_lock_after_another(case: tuple[Instance, Directions], share: float) -> None:
    instance, _ = case
    plan = solve(instance, cost=Cost.MINCOMB, stop=Iterations(60)).plan
    state = build_state_before_losses(instance, plan)
    while len(state.fleet) > 1 and not state.plan.uncovered:
        at_s = share * max(evaluate(state.instance, state.plan, Cost.MINMAX).durations_s)
        answer = repair_plan(state, 0, at_s, effort=60)
        if answer is None:
            return
        state = state.apply_plan(*answer)
        # Nobody is charged for what a lost vehicle alone was given.
        assert evaluate(state.instance, state.plan, Cost.MINSUM).value < BARRED_PCT / 2


@st.composite
def days(draw: st.DrawFn) -> SortieInstance:
    instance = line_instance(draw(st.integers(0, 10_000)), draw(st.integers(2, 10)), vehicles=draw(st.integers(2, 3)))
    some, fleet = st.integers(0, instance.segments - 1), st.integers(0, len(instance.vehicles) - 1)
    return replace(instance, locked=draw(st.dictionaries(some, fleet, min_size=1)))


@settings(max_examples=40, **LOOSE)
@given(days())
def test_days_keep_locks_until_their_vehicle_is_lost(instance: SortieInstance) -> None:
    found = solve_sorties(instance, stop=Iterations(400))
    assert found.evaluation.violations == ()
    for one in found.plan.routes:
        assert all(instance.locked.get(visit >> 1, one.vehicle) == one.vehicle for visit in one.visits)
    left = build_sorties_after_loss(instance, found.plan.routes, {0: 0.0}, 0.0)
    assert left.instance.locked == {one: keeper for one, keeper in instance.locked.items() if keeper != 0}
    again = solve_sorties(left.instance, stop=Iterations(400), initial=left.tails)
    assert evaluate_sorties(left.instance, again.plan).violations == ()
    lifted = [segment for segment, keeper in instance.locked.items() if keeper == 0]
    if not again.plan.uncovered:
        assert all(any(visit >> 1 == one for route in again.plan.routes for visit in route.visits) for one in lifted)


def test_a_large_network_is_covered_though_locks_are_far_from_their_vehicles_routes() -> None:
    vehicles = [Vehicle(f"v{number}", (0.0, 0.0), 100.0) for number in range(16)]
    locked = {segment: segment % 16 for segment in range(0, 300, 7)}
    directions = {segment: segment % 2 == 0 for segment in range(0, 300, 5)}
    instance = lock(random_instance(3, 300, vehicles), locked, directions)
    regions = replace(DEFAULT_PARAMS.large, above=100, region=40, region_routes=3, spell=300)
    params = replace(DEFAULT_PARAMS, large=regions)
    plan = solve(instance, cost=Cost.MINMAX, stop=Iterations(30_000), params=params).plan
    assert find_broken_locks(instance, directions, plan) == []
    assert plan.uncovered == ()


@settings(max_examples=6, **LOOSE)
@given(st.integers(0, 1000), st.booleans(), st.floats(0.8, 1.3))
def test_losses_beyond_exact_proof_are_repaired_too(seed: int, airborne: bool, consumption: float) -> None:
    """With so much energy any two of three can do everything, but not what is locked to the third."""
    vehicles = [Vehicle(f"v{number}", (0.0, 0.0), 300.0, consumption, airborne=airborne) for number in range(3)]
    locked, directions = {segment: segment % 3 for segment in range(0, 24, 2)}, dict.fromkeys(range(0, 24, 5), True)
    instance = lock(random_instance(seed, 24, vehicles), locked, directions)
    found = solve_window(instance, stretch=0.1, stop=Iterations(400))
    assert (found.plan.uncovered, found.window.earliest_s) == ((), 0.0)
    assert find_broken_locks(instance, directions, found.plan) == []
    for row in iterate_losses(instance, found.plan, effort=2000):
        left = build_remaining_problem(instance, found.plan, row.vehicle, row.from_s)
        ways = {number: True for number, one in enumerate(left.open_segments) if one in directions}
        assert row.plan is not None
        assert find_broken_locks(left.instance, ways, row.plan) == []


def test_a_vehicle_on_the_ground_begins_with_segments_locked_to_the_lost_one() -> None:
    vehicles = [Vehicle(f"v{number}", (0.0, 0.0), 300.0, 1.2) for number in range(2)]
    instance = lock(random_instance(1, 16, vehicles), dict.fromkeys(range(16), 1), {})
    plan = solve(instance, cost=Cost.MINSUM, stop=Iterations(100)).plan
    assert [len(route.visits) for route in plan.routes] == [0, 16]
    assert {row.verdict for row in iterate_losses(instance, plan, effort=200)} == {RepairStatus.FEASIBLE}
