"""A day with successive vehicle losses, each re-planned from the information at its time.

A trip that has begun is flown to its end. A vehicle's work counts once it has landed and its turnaround is over: a lost
vehicle loses what was still on board. Survivors get new trips after the current one.
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
"""Times closer to each other than this are equal."""


@dataclass(frozen=True, slots=True)
class DayLeft:
    """Remainder of a day after a loss."""

    kept: tuple[Timeline, ...]
    """Trips of each vehicle that count, or are under way."""
    survivors: tuple[int, ...]
    """Vehicles of the instance."""
    open: tuple[int, ...]
    """The day's tasks that are the instance's tasks."""
    instance: SortieInstance | None
    """None without survivors or open tasks."""
    tails: tuple[Route, ...]
    """Next planned trips of the survivors, with open tasks only."""


def build_day_left(day: Day, timelines: Sequence[Timeline], lost: Sequence[int], at_s: float) -> DayLeft:
    """Return the remainder when the last of ``lost`` is lost at ``at_s``, the others before.

    Raises:
        PlanError: an unknown vehicle.
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
    """Return the remainder at the first loss with all others known, and until when each vehicle may fly.

    No strategy that knows each loss only at its time can end earlier than the best plan for this.

    Args:
        day: the fixed part of the day.
        timelines: the plan for the whole day.
        losses: vehicle and time of each, in order of time.
    """
    at_s, lost_s = losses[0][1], dict(losses)
    begun = tuple(_select_begun_trips(timeline, at_s) for timeline in timelines)
    kept = tuple(
        _brought_home(timeline, lost_s[vehicle], day.turnaround_s) if vehicle in lost_s else timeline
        for vehicle, timeline in enumerate(begun)
    )
    # A vehicle that loses its load now returns nothing later.
    flying = tuple(vehicle for vehicle in range(len(begun)) if kept[vehicle] == begun[vehicle])
    left = _build_day_left(day, timelines, kept, flying, at_s)
    return left, tuple(lost_s.get(vehicle, inf) for vehicle in flying)


def open_tasks(day: Day, timelines: Sequence[Timeline]) -> tuple[int, ...]:
    """Return the tasks that are on no trip."""
    task_of = {frozenset(task): number for number, task in enumerate(day.tasks)}
    done = {task_of.get(step) for timeline in timelines for trip in timeline for step in _steps(trip)}
    return tuple(number for number in range(len(day.tasks)) if number not in done)


def day_after(day: Day, left: DayLeft, plan: Plan) -> tuple[Timeline, ...]:
    """Return all vehicles' trips, including those of a plan for the remainder."""
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
    """Return the timelines after each loss, in order of time.

    Args:
        day: the fixed part of the day.
        timelines: the plan for the whole day.
        losses: vehicle and time of each; each is unknown before its time.
        solve: makes the plan for the remainder, from the next planned trips.
        took: receives the seconds from each loss to the new trips of all vehicles.
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
    """Return the waiting tasks on the survivors' future trips, in order, each at its first occurrence."""
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
