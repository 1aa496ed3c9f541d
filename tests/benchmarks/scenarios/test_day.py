"""A day on a graph as sorties: trips that may be flown, moves from depot to depot, nothing left that can be done."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from benchmarks.exact_sorties import solve_sorties_exact
from benchmarks.scenarios import Day, TripStart, build_day_instance
from benchmarks.scenarios.road_graph import build_road_graph
from planner import InstanceError, Iterations, Plan
from planner.sorties import evaluate_sorties, solve_sorties
from tests.benchmarks.scenarios.builders import instance_of, random_day, row_day

SEEDS = st.integers(0, 10**6)


def walks_of(day: Day, iterations: int = 50) -> list[list[tuple[int, ...]]]:
    """Return the places of everybody's trips, which are checked."""
    instance = instance_of(day)
    found = solve_sorties(instance, stop=Iterations(iterations), seed=1)
    assert found.evaluation.violations == ()
    everybody, done = [], set()
    for number, own in enumerate(map(found.plan.routes_of, range(len(instance.vehicles)))):
        walks = list(day.list_walks(range(len(day.tasks)), instance.vehicles[number].base, own))
        end_s = max((trip.end_s for trip in day.time_walks(walks, instance.vehicles[number].ready_s)), default=0.0)
        assert end_s <= found.evaluation.finish_s + 1e-6
        place = day.starts[number]
        for walk in walks:
            assert (walk[0], walk[-1] in day.depots) == (place, True)
            assert sum(float(day.streets.along_s[step]) for step in pairwise(walk)) <= day.capacity_s + 1e-6
            done |= {frozenset(step) for step in pairwise(walk)}
            place = walk[-1]
        everybody.append(walks)
    left = {number for number, task in enumerate(day.tasks) if frozenset(task) not in done}
    assert left <= set(found.plan.uncovered)
    return everybody


def test_a_task_between_two_depots_needs_no_way_back() -> None:
    day = row_day(5, [(1, 2)], (0, 4), capacity_s=40.0)
    assert walks_of(day) == [[(0, 1, 2, 1, 0)]]
    assert walks_of(replace(day, tasks=((1, 2), (2, 3)))) == [[(0, 1, 2, 3, 4)]]


def test_what_is_too_far_for_one_trip_is_reached_from_depot_to_depot() -> None:
    """Three depots in a row, and a task beyond the last that only a trip from there can do."""
    day = row_day(10, [(9, 8)], (0, 3, 6), capacity_s=60.0)
    outward = (0, 1, 2, 3, 4, 5, 6)
    assert walks_of(day) == [[outward, (6, 7, 8, 9, 8, 7, 6)]]
    assert walks_of(replace(day, capacity_s=59.0)) == [[]]
    # From a place that is no depot the first move leads to one.
    beyond = replace(day, starts=(1,), capacity_s=60.0)
    assert walks_of(beyond) == [[outward[1:], (6, 7, 8, 9, 8, 7, 6)]]


def test_a_vehicle_that_cannot_get_there_is_given_nothing() -> None:
    apart = build_road_graph(4, [(0, 1, 5.0), (2, 3, 5.0)])
    day = Day(apart, ((0, 1), (2, 3)), (0, 2), (0, 2), 20.0, 0.0)
    assert walks_of(day, 300) == [[(0, 1, 0)], [(2, 3, 2)]]
    assert walks_of(replace(day, starts=(0,)), 300) == [[(0, 1, 0)]]


def test_a_large_day_is_valid() -> None:
    day = random_day(8, 95, 12, 12, places=140)
    assert len(walks_of(day, 500)) == 12


@settings(max_examples=60, deadline=None, derandomize=True)
@given(SEEDS, st.integers(1, 9), st.integers(1, 3), st.integers(1, 4), st.booleans())
def test_a_search_never_loses_a_task_nor_breaks_a_rule(
    seed: int, tasks: int, vehicles: int, depots: int, whole: bool
) -> None:
    day = random_day(seed, tasks, vehicles, depots, whole=whole)
    walks_of(day)
    if set(day.starts) <= set(day.depots):
        found = solve_sorties(instance_of(day), stop=Iterations(50))
        alone = [
            build_day_instance(day, [task], [TripStart(place) for place in day.starts]) for task in found.plan.uncovered
        ]
        assert all(solve_sorties_exact(one) is None for one in alone)


@settings(max_examples=25, deadline=None, derandomize=True)
@given(SEEDS, st.integers(1, 6), st.integers(1, 2), st.integers(1, 2), st.booleans())
def test_the_search_finds_the_optimum_of_small_days(
    seed: int, tasks: int, vehicles: int, depots: int, whole: bool
) -> None:
    instance = instance_of(random_day(seed, tasks, vehicles, depots, whole=whole), seed)
    best: Plan | None = solve_sorties_exact(instance)
    found = solve_sorties(instance, stop=Iterations(6_000), seed=1, starts=2)
    assert found.evaluation.violations == ()
    if best is None:
        assert found.plan.uncovered
        return
    assert not found.plan.uncovered
    assert found.evaluation.finish_s == pytest.approx(evaluate_sorties(instance, best).finish_s)


@pytest.mark.parametrize(
    ("change", "expected"),
    [
        ({"depots": ()}, "depots, starts: expected one at least"),
        ({"depots": (9,)}, "place 9: expected one from 0 to 2"),
        ({"tasks": ((0, 3),)}, "place 3: expected one from 0 to 2"),
        ({"starts": ()}, "depots, starts: expected one at least"),
        ({"capacity_s": -1.0}, "capacity_s: expected 0 or more"),
    ],
)
def test_a_day_that_does_not_fit_is_refused(change: dict[str, object], expected: str) -> None:
    day = row_day(3, [(0, 1)], (0,), capacity_s=60.0)
    with pytest.raises(InstanceError, match=expected):
        replace(day, **change)  # type: ignore[arg-type]
