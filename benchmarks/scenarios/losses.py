"""A day in which vehicles are lost one after another, each loss re-planned from what is known at its time.

A trip that has begun is flown to its end. What a vehicle did counts once it has landed and its turnaround is over: a
lost one loses what was still on board. Survivors are given new trips after the one under way.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from math import inf

from benchmarks.scenarios.model import DayInstance, DayPlan, DayTask, DayVehicle, Trip, way_of
from benchmarks.scenarios.result import DayResult
from planner.errors import PlanError
from planner.road_graph import RoadGraph
from planner.stop_rules import Stopwatch

SAME_TIME_S = 1e-6
"""Times nearer to each other than this are the same."""


@dataclass(frozen=True, slots=True)
class TimedTrip:
    """A trip as it is flown."""

    start_s: float
    lasts_s: float
    places: tuple[int, ...]
    """All the way, from where it begins to where it lands."""

    @property
    def end_s(self) -> float:
        """When it lands."""
        return self.start_s + self.lasts_s


Timeline = tuple[TimedTrip, ...]
"""One vehicle's trips, past ones included."""


@dataclass(frozen=True, slots=True)
class Day:
    """What stays the same all day."""

    streets: RoadGraph
    tasks: tuple[DayTask, ...]
    """Edges of the streets, each done by a trip that leads along it."""
    depots: tuple[int, ...]
    starts: tuple[int, ...]
    """Where each vehicle begins its day."""
    capacity_s: float
    turnaround_s: float

    def time_walks(self, walks: Iterable[Sequence[int]], from_s: float = 0.0) -> Timeline:
        """Return trips along walks, one after the other without a pause besides the turnaround.

        Raises:
            PlanError: a walk leads along no edge.
        """
        trips: list[TimedTrip] = []
        start_s = from_s
        for walk in walks:
            lasts_s = sum(float(self.streets.along_s[step]) for step in pairwise(walk))
            if not lasts_s < float("inf"):
                raise PlanError(f"the trip through {list(walk)} leads along no edge")
            trips.append(TimedTrip(start_s, lasts_s, tuple(walk)))
            start_s += lasts_s + self.turnaround_s
        return tuple(trips)


@dataclass(frozen=True, slots=True)
class DayLeft:
    """What is left of a day after a loss."""

    kept: tuple[Timeline, ...]
    """Trips that count, or are under way, of each vehicle."""
    survivors: tuple[int, ...]
    """Whom the instance's vehicles are."""
    open: tuple[int, ...]
    """Which of the day's tasks the instance's tasks are."""
    instance: DayInstance | None
    """None where nobody survives, or nothing is left to do."""
    tails: tuple[tuple[int, ...], ...]
    """What the survivors were to visit next, in order: the instance's visits."""


def build_day_left(day: Day, timelines: Sequence[Timeline], lost: Sequence[int], at_s: float) -> DayLeft:
    """Return what is left when the last of ``lost`` is lost at ``at_s``, the others before.

    Raises:
        PlanError: a vehicle that there is not.
    """
    if len(timelines) != len(day.starts) or not all(0 <= vehicle < len(day.starts) for vehicle in lost):
        raise PlanError(f"expected timelines and losses of {len(day.starts)} vehicles")
    kept = tuple(
        timeline if vehicle in lost[:-1] else _select_begun_trips(timeline, at_s) if vehicle not in lost
        else _brought_home(timeline, at_s, day.turnaround_s)
        for vehicle, timeline in enumerate(timelines)
    )  # fmt: skip
    survivors = tuple(vehicle for vehicle in range(len(timelines)) if vehicle not in lost)
    return _build_day_left(day, timelines, kept, survivors, at_s)


def _build_day_left(
    day: Day, timelines: Sequence[Timeline], kept: tuple[Timeline, ...], flying: tuple[int, ...], at_s: float
) -> DayLeft:
    waiting = open_tasks(day, kept)
    if not waiting or not flying:
        return DayLeft(kept, flying, waiting, None, ())
    instance = DayInstance(
        times_s=day.streets.times_s,
        tasks=tuple(day.tasks[number] for number in waiting),
        depots=day.depots,
        vehicles=tuple(_vehicle(day, kept[vehicle], vehicle, at_s) for vehicle in flying),
        capacity_s=day.capacity_s,
        turnaround_s=day.turnaround_s,
    )
    return DayLeft(kept, flying, waiting, instance, _tails(day, timelines, kept, flying, waiting))


def build_day_left_with_foresight(
    day: Day, timelines: Sequence[Timeline], losses: Sequence[tuple[int, float]]
) -> tuple[DayLeft, tuple[float, ...]]:
    """Return what is left at the first loss for somebody who knows all the others, and until when each may fly.

    Nothing that keeps to what is known at each loss can end earlier than the best plan for that.

    Args:
        day: what stays the same.
        timelines: the plan for the whole day.
        losses: vehicle and time of each, in the order of their times.
    """
    at_s, lost_s = losses[0][1], dict(losses)
    begun = tuple(_select_begun_trips(timeline, at_s) for timeline in timelines)
    kept = tuple(
        _brought_home(timeline, lost_s[vehicle], day.turnaround_s) if vehicle in lost_s else timeline
        for vehicle, timeline in enumerate(begun)
    )
    # Whoever loses what it has on board now brings nothing home later.
    flying = tuple(vehicle for vehicle in range(len(begun)) if kept[vehicle] == begun[vehicle])
    left = _build_day_left(day, timelines, kept, flying, at_s)
    return left, tuple(lost_s.get(vehicle, inf) for vehicle in flying)


def open_tasks(day: Day, timelines: Sequence[Timeline]) -> tuple[int, ...]:
    """Return the tasks that are on no trip."""
    task_of = {frozenset((task.a, task.b)): number for number, task in enumerate(day.tasks)}
    done = {task_of.get(step) for timeline in timelines for trip in timeline for step in _steps(trip)}
    return tuple(number for number in range(len(day.tasks)) if number not in done)


def day_after(day: Day, left: DayLeft, plan: DayPlan) -> tuple[Timeline, ...]:
    """Return everybody's trips, those of a plan for what was left included."""
    timelines = list(left.kept)
    if left.instance is not None:
        for vehicle, own, trips in zip(left.survivors, left.instance.vehicles, plan.trips, strict=True):
            walks = [trip_places(day.streets, left.instance, trip) for trip in trips]
            timelines[vehicle] += day.time_walks(walks, own.ready_s)
    return tuple(timelines)


def replan_losses(
    day: Day,
    timelines: Sequence[Timeline],
    losses: Sequence[tuple[int, float]],
    solve: Callable[[DayLeft, DayInstance], DayResult],
    took: Callable[[float], None] = lambda _: None,
) -> tuple[tuple[Timeline, ...], ...]:
    """Return the timelines after each loss, in the order of their times.

    Args:
        day: what stays the same.
        timelines: the plan for the whole day.
        losses: vehicle and time of each; nobody knows one before its time.
        solve: makes the plan for what is left.
        took: told the seconds from each loss to everybody's new trips.
    """
    history: list[tuple[Timeline, ...]] = []
    now, lost = tuple(timelines), [vehicle for vehicle, _ in losses]
    for number, (_, at_s) in enumerate(losses, 1):
        watch = Stopwatch()
        left = build_day_left(day, now, lost[:number], at_s)
        now = left.kept if left.instance is None else day_after(day, left, solve(left, left.instance).plan)
        took(watch.seconds)
        history.append(now)
    return tuple(history)


def trip_places(streets: RoadGraph, instance: DayInstance, trip: Trip) -> tuple[int, ...]:
    """Return all places of a trip whose tasks are edges of the streets."""
    places = [trip.begin]
    for visit in trip.visits:
        begin, end = way_of(instance, visit)
        places += [*streets.find_way(places[-1], begin)[1:], end]
    places += streets.find_way(places[-1], trip.end)[1:]
    return tuple(places)


def _select_begun_trips(timeline: Timeline, at_s: float) -> Timeline:
    return tuple(trip for trip in timeline if trip.start_s < at_s - SAME_TIME_S)


def _brought_home(timeline: Timeline, at_s: float, turnaround_s: float) -> Timeline:
    return tuple(trip for trip in timeline if trip.end_s + turnaround_s < at_s - SAME_TIME_S)


def _steps(trip: TimedTrip) -> list[frozenset[int]]:
    return [frozenset(step) for step in pairwise(trip.places)]


def _vehicle(day: Day, timeline: Timeline, vehicle: int, at_s: float) -> DayVehicle:
    if not timeline:
        return DayVehicle(day.starts[vehicle], at_s)
    last = timeline[-1]
    return DayVehicle(last.places[-1], max(at_s, last.end_s + day.turnaround_s), last.end_s)


def _tails(
    day: Day, timelines: Sequence[Timeline], kept: Sequence[Timeline], survivors: Sequence[int], waiting: Sequence[int]
) -> tuple[tuple[int, ...], ...]:
    """Return the waiting tasks on the survivors' trips to come, in order, as visits of what is left."""
    waits: Mapping[frozenset[int], int] = {
        frozenset((day.tasks[task].a, day.tasks[task].b)): number for number, task in enumerate(waiting)
    }
    taken: set[int] = set()
    tails: list[tuple[int, ...]] = []
    for vehicle in survivors:
        tail: list[int] = []
        for trip in timelines[vehicle][len(kept[vehicle]) :]:
            for step in _steps(trip):
                number = waits.get(step)
                if number is not None and number not in taken:
                    taken.add(number)
                    tail.append(2 * number)
        tails.append(tuple(tail))
    return tuple(tails)
