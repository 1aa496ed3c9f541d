"""The exact planner of days against trying everything, and the search against the exact planner."""

from __future__ import annotations

import itertools
from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from benchmarks.scenarios import (
    DayInstance,
    DayPlan,
    DayTask,
    DayVehicle,
    Trip,
    evaluate_day,
    exact,
    least_last_end_s,
    solve_day,
    solve_day_exact,
)
from planner import InstanceError, Iterations
from tests.benchmarks.scenarios.builders import instance_of, random_day


def every_day(instance: DayInstance, number: int, waiting: frozenset[int]) -> Iterator[tuple[Trip, ...]]:
    """Yield every sequence of a vehicle's trips through all of some tasks, without useless moves."""
    place = instance.vehicles[number].place
    depots = sorted(set(instance.depots))
    for order in itertools.permutations(sorted(waiting)):
        for turned in itertools.product((0, 1), repeat=len(order)):
            visits = tuple(2 * task + way for task, way in zip(order, turned, strict=True))
            for cuts in itertools.product((False, True), repeat=max(0, len(order) - 1)):
                edges = [0, *(at for at, cut in enumerate(cuts, 1) if cut), len(order)]
                parts = [visits[a:b] for a, b in itertools.pairwise(edges)] if order else []
                # Before each trip perhaps a move to another depot; then where it lands.
                for ends in itertools.product([None, *depots], depots, repeat=len(parts)):
                    yield tuple(_trips(place, parts, ends))


def _trips(place: int, parts: list[tuple[int, ...]], ends: tuple[int | None, ...]) -> Iterator[Trip]:
    for part, before, end in zip(parts, ends[::2], ends[1::2], strict=True):
        if before is not None:
            yield Trip(place, (), before)
            place = before
        assert end is not None
        yield Trip(place, part, end)
        place = end


def best_by_trying(instance: DayInstance) -> tuple[float, float] | None:
    """Return the best last end and sum of ends over everything, for two depots at most: no move needs a second one."""
    tasks = range(len(instance.tasks))
    best: tuple[float, float] | None = None
    ends: dict[tuple[int, frozenset[int]], float] = {}
    for number, own in enumerate(instance.vehicles):
        alone = replace(instance, vehicles=(own,))
        for chosen in itertools.chain.from_iterable(
            itertools.combinations(tasks, size) for size in range(len(tasks) + 1)
        ):
            part = frozenset(chosen)
            others = tuple(task for task in tasks if task not in part)
            plans = (evaluate_day(alone, DayPlan((trips,), others)) for trips in every_day(instance, number, part))
            ends[number, part] = min((one.last_end_s for one in plans if not one.violations), default=np.inf)
    for owners in itertools.product(range(len(instance.vehicles)), repeat=len(tasks)):
        lasts = [
            ends[number, frozenset(task for task in tasks if owners[task] == number)]
            for number in range(len(instance.vehicles))
        ]
        if max(lasts) < np.inf and (best is None or (max(lasts), sum(lasts)) < best):
            best = (max(lasts), sum(lasts))
    return best


@settings(max_examples=25, deadline=None, derandomize=True)
@given(st.integers(0, 10**6), st.integers(0, 3), st.integers(1, 2), st.integers(1, 2))
def test_the_exact_planner_finds_what_trying_everything_finds(
    seed: int, tasks: int, vehicles: int, depots: int
) -> None:
    instance = instance_of(random_day(seed, tasks, vehicles, depots, places=5), seed)
    best = best_by_trying(instance)
    plan = solve_day_exact(instance)
    if best is None:
        assert plan is None
        return
    assert plan is not None
    found = evaluate_day(instance, plan)
    assert found.violations == ()
    assert (found.last_end_s, found.sum_ends_s) == pytest.approx(best)


@settings(max_examples=25, deadline=None, derandomize=True)
@given(st.integers(0, 10**6), st.integers(1, 8), st.integers(1, 2), st.integers(1, 2), st.booleans())
@example(1, 8, 2, 2, True)
def test_the_search_finds_the_optimum_of_small_days(
    seed: int, tasks: int, vehicles: int, depots: int, whole: bool
) -> None:
    instance = instance_of(random_day(seed, tasks, vehicles, depots, whole=whole), seed)
    best = solve_day_exact(instance)
    found = solve_day(instance, stop=Iterations(6_000), seed=1, starts=2)
    if best is None:
        assert found.plan.uncovered
        return
    expected = evaluate_day(instance, best)
    assert expected.violations == () == found.evaluation.violations
    assert not found.plan.uncovered
    assert found.evaluation.last_end_s == pytest.approx(expected.last_end_s)
    assert found.evaluation.sum_ends_s == pytest.approx(expected.sum_ends_s)


def test_trips_that_fall_apart_into_rings_are_chosen_again() -> None:
    """A ring at a far depot costs little by itself; the way there is what it lacks."""
    times = 10.0 * np.abs(np.arange(9.0) - np.arange(9.0)[:, np.newaxis])
    instance = DayInstance(times, (DayTask(0, 1, 10.0), DayTask(7, 8, 10.0)), (0, 4, 8), (DayVehicle(0),), 45.0, 1.0)
    plan = solve_day_exact(instance)
    assert plan is not None
    found = evaluate_day(instance, plan)
    assert found.violations == ()
    # Out to 1 and on to the depot at 4, then to 8 over the second task.
    assert found.last_end_s == 40.0 + 1.0 + 40.0


@settings(max_examples=15, deadline=None, derandomize=True)
@given(st.integers(0, 10**6), st.integers(1, 6), st.integers(1, 2), st.integers(1, 2))
def test_trips_that_others_make_useless_change_no_optimum(seed: int, tasks: int, vehicles: int, depots: int) -> None:
    instance = instance_of(random_day(seed, tasks, vehicles, depots, places=6), seed)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(exact, "_metric", lambda _: False)
        every = solve_day_exact(instance)
    fewer = solve_day_exact(instance)
    if every is None or fewer is None:
        assert every is fewer
        assert least_last_end_s(instance) == np.inf
        return
    one, other = evaluate_day(instance, every), evaluate_day(instance, fewer)
    assert other.violations == ()
    assert (one.last_end_s, one.sum_ends_s) == pytest.approx((other.last_end_s, other.sum_ends_s))
    assert least_last_end_s(instance) == pytest.approx(one.last_end_s)
    assert least_last_end_s(instance, limit_s=1e-9) <= one.last_end_s + 1e-6


def test_a_detour_that_is_shorter_than_the_way_keeps_every_trip() -> None:
    """From 0 to 2 it takes 10 s, through 1 only 2 s: who leaves the task at 1 out flies longer."""
    times = np.array([[0.0, 1.0, 10.0], [1.0, 0.0, 1.0], [10.0, 1.0, 0.0]])
    instance = DayInstance(times, (DayTask(1, 1, 0.0), DayTask(2, 2, 0.0)), (0, 2), (DayVehicle(0),), 12.0, 5.0)
    plan = solve_day_exact(instance)
    assert plan is not None
    assert evaluate_day(instance, plan).violations == ()
    assert evaluate_day(instance, plan).last_end_s == 2.0


def test_a_vehicle_that_must_be_back_by_a_time_leaves_the_rest_to_others() -> None:
    times = 10.0 * np.abs(np.arange(3.0) - np.arange(3.0)[:, np.newaxis])
    both = (DayVehicle(1), DayVehicle(1))
    instance = DayInstance(times, (DayTask(0, 1, 10.0), DayTask(1, 2, 10.0)), (1,), both, 20.0, 5.0)
    assert least_last_end_s(instance) == 20.0
    assert least_last_end_s(instance, (np.inf, 25.0)) == 20.0
    assert least_last_end_s(instance, (np.inf, 24.0)) == 45.0
    assert least_last_end_s(instance, (44.0, 24.0)) == np.inf


def test_too_many_trips_are_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(exact, "MOST_COLUMNS", 20)
    with pytest.raises(InstanceError, match="more than 20 trips"):
        solve_day_exact(instance_of(random_day(1, 8, 2, 2)))
