"""The definition of every figure of a day's plan: slow, obvious, and what the kernels must agree with."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from benchmarks.scenarios.model import DayInstance, DayPlan, DayVehicle, Trip, way_of
from planner.errors import PlanError

TOLERANCE_S = 1e-6
"""By which a trip may be longer than allowed: sums depend on their order."""


@dataclass(frozen=True, slots=True)
class DayEvaluation:
    """The figures of one day's plan."""

    last_end_s: float
    """When the last trip of anybody ends, those so far included."""
    sum_ends_s: float
    """The sum of all vehicles' last ends, which decides between equal last ends."""
    starts_s: tuple[tuple[float, ...], ...]
    """When each trip begins: as early as can be."""
    ends_s: tuple[float, ...]
    """When each vehicle's last trip ends."""
    violations: tuple[str, ...]
    """In words; empty if every task is done or named as uncovered, by trips that may be."""


def trip_s(instance: DayInstance, trip: Trip) -> float:
    """Return how long a trip takes; infinite if no way leads along it.

    Raises:
        PlanError: a visit or a place is not in the instance.
    """
    for visit in trip.visits:
        if not 0 <= visit < 2 * len(instance.tasks):
            raise PlanError(f"visit {visit} is not in the instance of {len(instance.tasks)} tasks")
    for place in (trip.begin, trip.end):
        if not 0 <= place < len(instance.times_s):
            raise PlanError(f"place {place} is not in the instance of {len(instance.times_s)} places")
    place, seconds = trip.begin, 0.0
    for visit in trip.visits:
        begin, end = way_of(instance, visit)
        seconds += float(instance.times_s[place, begin]) + instance.tasks[visit >> 1].seconds
        place = end
    return seconds + float(instance.times_s[place, trip.end])


def evaluate_day(instance: DayInstance, plan: DayPlan) -> DayEvaluation:
    """Return all figures of a plan.

    Raises:
        PlanError: the plan is for another number of vehicles, or names what the instance does not have.
    """
    if len(plan.trips) != len(instance.vehicles):
        raise PlanError(f"the plan is for {len(plan.trips)} vehicles, the instance has {len(instance.vehicles)}")
    timed = [_time_trips(instance, own, trips) for own, trips in zip(instance.vehicles, plan.trips, strict=True)]
    ends = tuple(end for _, end in timed)
    return DayEvaluation(
        last_end_s=max(ends),
        sum_ends_s=sum(ends),
        starts_s=tuple(starts for starts, _ in timed),
        ends_s=ends,
        violations=tuple(_violations(instance, plan)),
    )


def _time_trips(instance: DayInstance, own: DayVehicle, trips: tuple[Trip, ...]) -> tuple[tuple[float, ...], float]:
    """Return when each trip begins, and the end of the last one."""
    starts: list[float] = []
    ready, end = own.ready_s, own.ended_s
    for trip in trips:
        starts.append(ready)
        end = ready + trip_s(instance, trip)
        ready = end + instance.turnaround_s
    return tuple(starts), end


def _violations(instance: DayInstance, plan: DayPlan) -> Iterator[str]:
    for number, (own, trips) in enumerate(zip(instance.vehicles, plan.trips, strict=True)):
        place = own.place
        for trip in trips:
            if trip.begin != place:
                yield f"vehicle {number} begins at place {trip.begin}, it is at {place}"
            if trip.end not in instance.depots:
                yield f"vehicle {number} lands at place {trip.end}, which is no depot"
            lasts = trip_s(instance, trip)
            if not lasts <= instance.capacity_s + TOLERANCE_S:
                yield f"vehicle {number} has a trip of {lasts:.3f} s, {instance.capacity_s:.3f} s are allowed"
            place = trip.end
    done = np.bincount(
        [visit >> 1 for trips in plan.trips for trip in trips for visit in trip.visits] + list(plan.uncovered),
        minlength=len(instance.tasks),
    )
    for task, times in enumerate(done):
        if times != 1:
            yield f"task {task} is done or named as uncovered {times} times, expected once"
