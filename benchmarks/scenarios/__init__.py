"""The public failure scenarios as days of sorties: a graph of streets, depots, vehicles lost one after another.

    >>> left = build_day_left(day, timelines, lost=[0], at_s=12.0)                        # doctest: +SKIP
    >>> plan = solve_sorties(left.instance, stop=Seconds(0.5), initial=left.tails).plan    # doctest: +SKIP
    >>> timelines = day_after(day, left, plan)                                        # doctest: +SKIP

Trips are planned by ``planner.sorties``: a task is a segment, a trip a sortie that uses its share of the longest trip.
"""

from benchmarks.scenarios.day import Day, TimedTrip, Timeline, TripStart, build_day_instance
from benchmarks.scenarios.least_end import MOST_COLUMNS, least_last_end_s
from benchmarks.scenarios.losses import (
    DayLeft,
    build_day_left,
    build_day_left_with_foresight,
    day_after,
    open_tasks,
    replan_losses,
)

__all__ = [
    "MOST_COLUMNS",
    "Day",
    "DayLeft",
    "TimedTrip",
    "Timeline",
    "TripStart",
    "build_day_instance",
    "build_day_left",
    "build_day_left_with_foresight",
    "day_after",
    "least_last_end_s",
    "open_tasks",
    "replan_losses",
]
