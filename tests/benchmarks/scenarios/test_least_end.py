"""The bound of days against proven optima, and those against trying everything."""

from __future__ import annotations

import itertools
from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from benchmarks.exact_sorties import solve_sorties_exact
from benchmarks.scenarios import TripStart, build_day_instance, least_end, least_last_end_s
from planner import InstanceError, Plan, Route
from planner.sorties import (
    SortieInstance,
    evaluate_sorties,
    sortie_duration_s,
)
from tests.benchmarks.scenarios.builders import instance_of, random_day, row_day

SEEDS = st.integers(0, 10**6)


def every_order(instance: SortieInstance, number: int, waiting: frozenset[int]) -> Iterator[tuple[Route, ...]]:
    """Yield every sequence of a vehicle's sorties through all of some segments."""
    own, bases = instance.vehicles[number], range(len(instance.bases))
    for order in itertools.permutations(sorted(waiting)):
        for turned in itertools.product((0, 1), repeat=len(order)):
            visits = tuple(2 * task + way for task, way in zip(order, turned, strict=True))
            for cuts in itertools.product((False, True), repeat=max(0, len(order) - 1)):
                edges = [0, *(at for at, cut in enumerate(cuts, 1) if cut), len(order)]
                parts = [visits[a:b] for a, b in itertools.pairwise(edges)] if order else []
                for ends in itertools.product(bases, repeat=2 * len(parts)):
                    sorties, place, ready_s = [], own.base, own.ready_s
                    for part, base, land in zip(parts, ends[::2], ends[1::2], strict=True):
                        one = Route(number, part, base, land, ready_s + float(instance.transfer_s[place, base]))
                        place, lasts_s = land, sortie_duration_s(instance, one)
                        ready_s = one.start_s + lasts_s + instance.bases[land].turnaround_s
                        sorties.append(one)
                    yield tuple(sorties)


def best_by_trying(instance: SortieInstance) -> float:
    """Return the soonest last landing over everything, infinite where there is none."""
    segments, fleet = range(instance.segments), range(len(instance.vehicles))
    ends: dict[tuple[int, frozenset[int]], float] = {}
    for number in fleet:
        for size in range(instance.segments + 1):
            for chosen in itertools.combinations(segments, size):
                others = tuple(task for task in segments if task not in chosen)
                plans = (Plan(own, others) for own in every_order(instance, number, frozenset(chosen)))
                found = (evaluate_sorties(instance, plan) for plan in plans)
                ends[number, frozenset(chosen)] = min(
                    (one.finish_s for one in found if not one.violations), default=np.inf
                )
    return min(
        max(ends[number, frozenset(task for task in segments if owners[task] == number)] for number in fleet)
        for owners in itertools.product(fleet, repeat=instance.segments)
    )


@settings(max_examples=20, deadline=None, derandomize=True)
@given(SEEDS, st.integers(1, 2), st.integers(1, 2), st.integers(1, 2))
def test_the_exact_planner_finds_what_trying_everything_finds(
    seed: int, tasks: int, vehicles: int, depots: int
) -> None:
    instance = instance_of(random_day(seed, tasks, vehicles, depots, places=5), seed)
    plan = solve_sorties_exact(instance)
    if plan is None:
        assert best_by_trying(instance) == np.inf
        return
    found = evaluate_sorties(instance, plan)
    assert found.violations == ()
    assert found.finish_s == pytest.approx(best_by_trying(instance))


@settings(max_examples=25, deadline=None, derandomize=True)
@given(SEEDS, st.integers(1, 6), st.integers(1, 2), st.integers(1, 3), st.booleans())
def test_the_bound_is_the_end_of_the_best_plan(seed: int, tasks: int, vehicles: int, depots: int, whole: bool) -> None:
    instance = instance_of(random_day(seed, tasks, vehicles, depots, places=6, whole=whole), seed)
    plan = solve_sorties_exact(instance)
    if plan is None:
        assert least_last_end_s(instance) == np.inf
        return
    best_s = evaluate_sorties(instance, plan).finish_s
    assert least_last_end_s(instance) == pytest.approx(best_s)
    assert least_last_end_s(instance, limit_s=1e-9) <= best_s + 1e-6


def test_trips_that_fall_apart_into_rings_are_chosen_again() -> None:
    """A ring at a far depot costs little by itself; the way there is what it lacks."""
    instance = instance_of(replace(row_day(9, [(0, 1), (7, 8)], (0, 4, 8), capacity_s=45.0), turnaround_s=1.0))
    # Out to 1 and on to the depot at 4, then to 8 over the second task.
    assert least_last_end_s(instance) == pytest.approx(40.0 + 1.0 + 40.0)


def test_a_vehicle_that_must_be_back_by_a_time_leaves_the_rest_to_others() -> None:
    day = row_day(3, [(0, 1), (1, 2)], (1,), capacity_s=20.0)
    instance = build_day_instance(day, [0, 1], [TripStart(1), TripStart(1)])
    assert least_last_end_s(instance) == 20.0
    assert least_last_end_s(instance, (np.inf, 25.0)) == 20.0
    assert least_last_end_s(instance, (np.inf, 24.0)) == pytest.approx(45.0)
    assert least_last_end_s(instance, (44.0, 24.0)) == np.inf


def test_too_many_trips_are_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(least_end, "MOST_COLUMNS", 20)
    with pytest.raises(InstanceError, match="more than 20 trips"):
        least_last_end_s(instance_of(random_day(1, 8, 2, 2)))
