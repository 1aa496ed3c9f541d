"""The kernels of days against the definition in benchmarks/scenarios/evaluate.py, and against trying every division."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from benchmarks.scenarios import DayInstance, DayPlan, Trip, evaluate_day, solve_day, trip_s
from benchmarks.scenarios.construct import day_memory, day_plan, day_problem, day_state
from benchmarks.scenarios.kernels.day import NEVER, divide, guide
from benchmarks.scenarios.kernels.dayinsertion import insert_tasks
from benchmarks.scenarios.kernels.daysearch import less, measure_day
from planner import Iterations
from planner.construct import build_random_state
from tests.benchmarks.scenarios.builders import instance_of, random_day

SEEDS = st.integers(0, 10**6)


@st.composite
def instances(draw: st.DrawFn, most_tasks: int = 9, most_depots: int = 4) -> DayInstance:
    seed = draw(SEEDS)
    tasks, vehicles = draw(st.integers(1, most_tasks)), draw(st.integers(1, 3))
    day = random_day(seed, tasks, vehicles, draw(st.integers(1, most_depots)), whole=draw(st.booleans()))
    return instance_of(day, seed)


def soonest(instance: DayInstance, order: list[int]) -> float:
    """Return when the first vehicle can have done tasks in an order, by trying everything; two depots at most."""
    alone = DayInstance(
        instance.times_s, instance.tasks, instance.depots, instance.vehicles[:1], instance.capacity_s,
        instance.turnaround_s,
    )  # fmt: skip
    others = tuple(task for task in range(len(instance.tasks)) if task not in order)
    best = float("inf")
    for turned in itertools.product((0, 1), repeat=len(order)):
        visits = tuple(2 * task + way for task, way in zip(order, turned, strict=True))
        for cuts in itertools.product((False, True), repeat=len(order) - 1):
            edges = [0, *(at for at, cut in enumerate(cuts, 1) if cut), len(order)]
            parts = [visits[a:b] for a, b in itertools.pairwise(edges)]
            for places in itertools.product([None, *instance.depots], instance.depots, repeat=len(parts)):
                trips, here = [], instance.vehicles[0].place
                for part, moved, end in zip(parts, places[::2], places[1::2], strict=True):
                    assert end is not None
                    if moved is not None:
                        trips.append(Trip(here, (), moved))
                        here = moved
                    trips.append(Trip(here, part, end))
                    here = end
                found = evaluate_day(alone, DayPlan((tuple(trips),), others))
                if not found.violations:
                    best = min(best, found.last_end_s)
    return best


@settings(max_examples=60, deadline=None, derandomize=True)
@given(instances(most_tasks=3, most_depots=2), SEEDS)
def test_an_order_is_divided_as_well_as_can_be(instance: DayInstance, seed: int) -> None:
    order = np.random.default_rng(seed).permutation(len(instance.tasks)).tolist()
    problem = day_problem(instance, 0.1, 0.0)
    state = day_state(problem)
    state.visits[0, : len(order)] = [2 * task for task in order]
    state.lengths[0] = len(order)
    divide(problem, state, day_memory(problem), 0)
    expected = soonest(instance, order)
    assert min(float(state.ends[0]), NEVER) == pytest.approx(min(expected, NEVER))


@settings(max_examples=120, deadline=None, derandomize=True)
@given(instances(), SEEDS)
def test_ends_of_the_kernels_are_those_of_the_definition(instance: DayInstance, seed: int) -> None:
    problem = day_problem(instance, 0.5, 0.25)
    state, memory = day_state(problem), day_memory(problem)
    able = np.flatnonzero(problem.able.any(axis=0)).astype(np.int64)
    assert insert_tasks(problem, state, memory, able, len(able), build_random_state(seed))
    assume(state.ends.max() < NEVER)
    plan = day_plan(instance, problem, state)
    found = evaluate_day(instance, plan)
    assert found.violations == ()
    assert state.ends.tolist() == pytest.approx(found.ends_s)
    home = [
        (start + end_s + instance.turnaround_s) * len(trip.visits)
        for trips, starts in zip(plan.trips, found.starts_s, strict=True)
        for trip, start in zip(trips, starts, strict=True)
        for end_s in [trip_s(instance, trip)]
    ]
    key = np.zeros(3)
    measure_day(state, key)
    assert key.tolist() == pytest.approx([found.last_end_s, found.sum_ends_s, sum(home)])
    assert guide(problem, state) == pytest.approx(found.last_end_s + 0.5 * found.sum_ends_s + 0.25 * sum(home))


@settings(max_examples=60, deadline=None, derandomize=True)
@given(instances(), SEEDS, st.integers(1, 60))
def test_a_search_never_loses_a_task_nor_breaks_a_rule(instance: DayInstance, seed: int, iterations: int) -> None:
    found = solve_day(instance, stop=Iterations(iterations), seed=seed)
    assert found.evaluation.violations == ()
    able = day_problem(instance, 0.1, 0.0).able
    left = {task for task in range(len(instance.tasks)) if not able[:, task].any()}
    assert left <= set(found.plan.uncovered)
    if all(own.place in instance.depots for own in instance.vehicles):
        assert left == set(found.plan.uncovered)


def test_the_first_figure_that_differs_decides() -> None:
    def before(one: list[float], other: list[float]) -> bool:
        return bool(less.py_func(np.array(one), np.array(other)))  # type: ignore[attr-defined]

    assert before([1.0, 9.0, 9.0], [2.0, 0.0, 0.0])
    assert before([1.0, 1.0, 0.0], [1.0, 1.0, 5.0])
    assert not before([1.0, 1.0, 5.0], [1.0, 1.0, 5.0])
    assert before([1.0 + 1e-12, 1.0, 0.0], [1.0, 2.0, 0.0])
