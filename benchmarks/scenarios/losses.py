"""A day in which vehicles are lost one after another, each loss re-planned from what is known at its time.

A trip that has begun is flown to its end. What a vehicle did counts once it has landed and its turnaround is over: a
lost one loses what was still on board. Survivors are given new trips after the one under way.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import pairwise
from math import inf

from benchmarks.scenarios.day import Day, TimedTrip, Timeline, TripStart, build_day_instance
from planner import Plan, PlanError, Route, Stopwatch
from planner.sorties import SortieInstance

SAME_TIME_S = 1e-6
"""Times nearer to each other than this are the same."""


@dataclass(frozen=True, slots=True)
class DayLeft:
    """What is left of a day after a loss."""

    kept: tuple[Timeline, ...]
    """Trips that count, or are under way, of each vehicle."""
    survivors: tuple[int, ...]
    """Whom the instance's vehicles are."""
    open: tuple[int, ...]
    """Which of the day's tasks the instance's tasks are."""
    instance: SortieInstance | None
    """None where nobody survives, or nothing is left to do."""
    tails: tuple[Route, ...]
    """What the survivors were to fly next, of the tasks that are open."""


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
    trip_starts = [_find_trip_start(day, kept[vehicle], vehicle, at_s) for vehicle in flying]
    instance = build_day_instance(day, waiting, trip_starts)
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
    task_of = {frozenset(task): number for number, task in enumerate(day.tasks)}
    done = {task_of.get(step) for timeline in timelines for trip in timeline for step in _steps(trip)}
    return tuple(number for number in range(len(day.tasks)) if number not in done)


def day_after(day: Day, left: DayLeft, plan: Plan) -> tuple[Timeline, ...]:
    """Return everybody's trips, those of a plan for what was left included."""
    timelines = list(left.kept)
    if left.instance is not None:
        for number, (vehicle, own) in enumerate(zip(left.survivors, left.instance.vehicles, strict=True)):
            walks = day.list_walks(left.open, own.base, plan.routes_of(number))
            timelines[vehicle] += day.time_walks(walks, own.ready_s)
    return tuple(timelines)


def replan_losses(
    day: Day,
    timelines: Sequence[Timeline],
    losses: Sequence[tuple[int, float]],
    solve: Callable[[SortieInstance, tuple[Route, ...]], Plan],
    took: Callable[[float], None] = lambda _: None,
) -> tuple[tuple[Timeline, ...], ...]:
    """Return the timelines after each loss, in the order of their times.

    Args:
        day: what stays the same.
        timelines: the plan for the whole day.
        losses: vehicle and time of each; nobody knows one before its time.
        solve: makes the plan for what is left, from what was to be flown next.
        took: told the seconds from each loss to everybody's new trips.
    """
    history: list[tuple[Timeline, ...]] = []
    now, lost = tuple(timelines), [vehicle for vehicle, _ in losses]
    for number, (_, at_s) in enumerate(losses, 1):
        watch = Stopwatch()
        left = build_day_left(day, now, lost[:number], at_s)
        now = left.kept if left.instance is None else day_after(day, left, solve(left.instance, left.tails))
        took(watch.seconds)
        history.append(now)
    return tuple(history)


def _select_begun_trips(timeline: Timeline, at_s: float) -> Timeline:
    return tuple(trip for trip in timeline if trip.start_s < at_s - SAME_TIME_S)


def _brought_home(timeline: Timeline, at_s: float, turnaround_s: float) -> Timeline:
    return tuple(trip for trip in timeline if trip.end_s + turnaround_s < at_s - SAME_TIME_S)


def _steps(trip: TimedTrip) -> list[frozenset[int]]:
    return [frozenset(step) for step in pairwise(trip.places)]


def _find_trip_start(day: Day, timeline: Timeline, vehicle: int, at_s: float) -> TripStart:
    if not timeline:
        return TripStart(day.starts[vehicle], at_s)
    last = timeline[-1]
    return TripStart(last.places[-1], max(at_s, last.end_s + day.turnaround_s))


def _tails(
    day: Day, timelines: Sequence[Timeline], kept: Sequence[Timeline], survivors: Sequence[int], waiting: Sequence[int]
) -> tuple[Route, ...]:
    """Return the waiting tasks on the survivors' trips to come, in order, each where it comes first."""
    open_visits = {
        step: 2 * number + turned for number, task in enumerate(waiting)
        for turned, step in enumerate((day.tasks[task], day.tasks[task][::-1]))
    }  # fmt: skip
    bases = day.bases
    tails: list[Route] = []
    for place, vehicle in enumerate(survivors):
        for trip in timelines[vehicle][len(kept[vehicle]) :]:
            visits = []
            for step in pairwise(trip.places):
                visit = open_visits.pop(step, None)
                if visit is not None:
                    open_visits.pop(step[::-1], None)
                    visits.append(visit)
            if visits:
                base, lands = bases.index(trip.places[0]), bases.index(trip.places[-1])
                tails.append(Route(place, tuple(visits), base, lands, trip.start_s))
    return tuple(tails)
