"""The search for a day: valid plans, the same for the same seed, and nothing left that can be done."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from benchmarks.scenarios import DayInstance, DayPlan, DayTask, DayVehicle, Trip, day_instance, evaluate_day, solve_day
from planner import InstanceError, Iterations, PlanError
from tests.benchmarks.scenarios.builders import instance_of, random_day


def chain(length: int) -> np.ndarray:
    """Return the times between places in a row, 10 s from one to the next."""
    row = np.arange(length, dtype=float)
    return 10.0 * np.abs(row - row[:, np.newaxis])


def test_the_same_seed_starts_and_iterations_give_the_same_plan() -> None:
    instance = instance_of(random_day(3, 12, 3, 3, places=12))
    once, again = (solve_day(instance, stop=Iterations(3_001), seed=4, starts=2) for _ in range(2))
    assert once.plan == again.plan
    assert (once.iterations, once.stopped_by) == (again.iterations, "iterations")


def test_a_task_between_two_depots_needs_no_way_back() -> None:
    instance = day_instance(chain(5), [DayTask(1, 2, 10.0)], [0, 4], [DayVehicle(0)], capacity_s=40.0)
    found = solve_day(instance, stop=Iterations(50))
    assert found.plan.trips == ((Trip(0, (0,), 0),),)
    assert found.evaluation.last_end_s == 40.0
    to_the_right = replace(instance, tasks=(DayTask(1, 3, 20.0),))
    assert solve_day(to_the_right, stop=Iterations(50)).plan.trips == ((Trip(0, (0,), 4),),)


def test_what_is_too_far_for_one_trip_is_reached_from_depot_to_depot() -> None:
    """Three depots in a row, and a task beyond the last that only a trip from there can do."""
    times = chain(10)
    instance = day_instance(times, [DayTask(9, 8, 10.0)], [0, 3, 6], [DayVehicle(0)], capacity_s=60.0, turnaround_s=5.0)
    found = solve_day(instance, stop=Iterations(50))
    assert found.evaluation.violations == ()
    assert [(trip.begin, trip.end) for trip in found.plan.trips[0]] == [(0, 6), (6, 6)]
    assert found.evaluation.last_end_s == 60.0 + 5.0 + 60.0
    near = replace(instance, capacity_s=59.0)
    assert solve_day(near, stop=Iterations(50)).plan == DayPlan(((),), (0,))


def test_a_vehicle_that_cannot_get_there_is_given_nothing() -> None:
    times = np.full((4, 4), np.inf)
    times[:2, :2] = times[2:, 2:] = [[0.0, 5.0], [5.0, 0.0]]
    tasks = [DayTask(0, 1, 5.0), DayTask(2, 3, 5.0)]
    instance = day_instance(times, tasks, [0, 2], [DayVehicle(0), DayVehicle(2)], capacity_s=20.0)
    found = solve_day(instance, stop=Iterations(300))
    assert found.evaluation.violations == ()
    assert [[visit >> 1 for trip in trips for visit in trip.visits] for trips in found.plan.trips] == [[0], [1]]
    alone = replace(instance, vehicles=(DayVehicle(0),))
    assert solve_day(alone, stop=Iterations(300)).plan.uncovered == (1,)


def test_a_given_order_is_kept_where_there_is_no_time_to_search() -> None:
    instance = replace(instance_of(random_day(5, 9, 2, 2, places=9)), capacity_s=60.0)
    order = ([0, 5, 2], [17])
    found = solve_day(instance, stop=Iterations(0), initial=order)
    done = [[visit >> 1 for trip in trips for visit in trip.visits] for trips in found.plan.trips]
    assert [task for task in done[0] if task in (0, 1, 2)] == [0, 2, 1]
    assert 8 in done[1]
    assert found.evaluation.violations == ()


def test_with_nothing_to_do_nobody_flies() -> None:
    instance = day_instance(chain(3), [], [0], [DayVehicle(0, 7.0, 3.0)], capacity_s=10.0)
    found = solve_day(instance, stop=Iterations(10))
    assert (found.plan, found.stopped_by, found.evaluation.last_end_s) == (DayPlan(((),)), "nothing to do", 3.0)


def test_a_large_day_is_valid() -> None:
    instance = instance_of(random_day(8, 95, 12, 12, places=140))
    found = solve_day(instance, stop=Iterations(500))
    assert found.evaluation.violations == ()
    assert found.plan.uncovered == ()


@pytest.mark.parametrize(
    ("change", "expected"),
    [
        ({"depots": ()}, "depots: expected one at least"),
        ({"depots": (9,)}, "place 9: expected one from 0 to 2"),
        ({"vehicles": ()}, "vehicles: expected one at least"),
        ({"capacity_s": -1.0}, "capacity_s: expected 0 or more"),
        ({"turnaround_s": float("nan")}, "turnaround_s: expected 0 or more"),
        ({"tasks": (DayTask(0, 1, float("inf")),)}, "seconds of a task: expected 0 or more"),
        ({"times_s": np.zeros((2, 3))}, "times_s: expected a square matrix"),
    ],
)
def test_an_instance_that_does_not_fit_is_refused(change: dict[str, object], expected: str) -> None:
    instance = day_instance(chain(3), [DayTask(0, 1, 10.0)], [0], [DayVehicle(0)], capacity_s=60.0)
    with pytest.raises(InstanceError, match=expected):
        replace(instance, **change)  # type: ignore[arg-type]


def test_an_order_that_does_not_fit_is_refused() -> None:
    instance = day_instance(chain(3), [DayTask(0, 1, 10.0)], [0], [DayVehicle(0)], capacity_s=60.0)
    for order in ([[2]], [[0, 1]]):
        with pytest.raises(PlanError, match="each of 1 tasks once at most"):
            solve_day(instance, stop=Iterations(1), initial=order)
    with pytest.raises(PlanError, match="for 2 vehicles"):
        evaluate_day(instance, DayPlan(((), ())))


def test_each_violation_is_named() -> None:
    tasks = [DayTask(0, 1, 10.0), DayTask(1, 2, 10.0)]
    instance: DayInstance = day_instance(chain(3), tasks, [0], [DayVehicle(0)], capacity_s=15.0)
    found = evaluate_day(instance, DayPlan(((Trip(2, (0,), 1),),), ()))
    assert found.violations == (
        "vehicle 0 begins at place 2, it is at 0",
        "vehicle 0 lands at place 1, which is no depot",
        "vehicle 0 has a trip of 30.000 s, 15.000 s are allowed",
        "task 1 is done or named as uncovered 0 times, expected once",
    )
