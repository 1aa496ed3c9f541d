"""Days of several trips: several depots, recharging between trips, vehicles lost one after another.

    >>> ways = build_road_graph(places, edges)                                             # doctest: +SKIP
    >>> instance = day_instance(ways.times_s, tasks, depots, vehicles, capacity_s=20)   # doctest: +SKIP
    >>> found = solve_day(instance, stop=Seconds(0.5))                            # doctest: +SKIP

Importing this package is cheap; the first plan, or ``warm_up_day``, loads the compiled kernels.
"""

from benchmarks.scenarios.evaluate import DayEvaluation, evaluate_day, trip_s
from benchmarks.scenarios.exact import MOST_COLUMNS, least_last_end_s, solve_day_exact
from benchmarks.scenarios.losses import (
    Day,
    DayLeft,
    TimedTrip,
    Timeline,
    build_day_left,
    build_day_left_with_foresight,
    day_after,
    open_tasks,
    replan_losses,
)
from benchmarks.scenarios.model import DayInstance, DayPlan, DayTask, DayVehicle, Trip, day_instance
from benchmarks.scenarios.result import DayResult
from benchmarks.scenarios.solve import solve_day, warm_up_day
from planner.road_graph import RoadGraph, build_road_graph

__all__ = [
    "MOST_COLUMNS",
    "Day",
    "DayEvaluation",
    "DayInstance",
    "DayLeft",
    "DayPlan",
    "DayResult",
    "DayTask",
    "DayVehicle",
    "RoadGraph",
    "TimedTrip",
    "Timeline",
    "Trip",
    "build_day_left",
    "build_day_left_with_foresight",
    "build_road_graph",
    "day_after",
    "day_instance",
    "evaluate_day",
    "least_last_end_s",
    "open_tasks",
    "replan_losses",
    "solve_day",
    "solve_day_exact",
    "trip_s",
    "warm_up_day",
]
