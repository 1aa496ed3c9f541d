"""The front: one call from a day's instance to a plan."""

from __future__ import annotations

from collections.abc import Sequence

from benchmarks.scenarios.model import DayInstance, DayTask, DayVehicle, day_instance
from benchmarks.scenarios.result import DayResult
from planner.errors import PlanError
from planner.stop_rules import Iterations, StopRule, Stopwatch


def solve_day(
    instance: DayInstance, *, stop: StopRule, seed: int = 0, starts: int = 1, initial: Sequence[Sequence[int]] = ()
) -> DayResult:
    """Return the best plan found until ``stop`` ends the search: the last end first, then the sum of all ends.

    What no vehicle can do by trips that are allowed is left uncovered.

    Args:
        instance: the problem.
        stop: asked at least every 250 iterations of a start.
        seed: of all randomness.
        starts: searches side by side, a thread each; iterations are counted over all of them.
        initial: visits to begin with, in order, for each vehicle; the search puts in what is missing.

    Raises:
        PlanError: ``initial`` names a task that the instance does not have, or one twice.
    """
    tasks = [visit >> 1 for visits in initial for visit in visits]
    if len(set(tasks)) < len(tasks) or not all(0 <= task < len(instance.tasks) for task in tasks):
        raise PlanError(f"initial: expected each of {len(instance.tasks)} tasks once at most")
    # Only here: numba takes a second to load, and whoever imports the planner may never make a plan.
    from benchmarks.scenarios.search import DaySearch

    return DaySearch(instance, seed=seed, starts=starts, initial=initial, watch=Stopwatch()).run(stop)


def warm_up_day(starts: int = 1) -> None:
    """Load the search's kernels, compiling them if no process has before, and start its threads once."""
    times = [[0.0, 1.0], [1.0, 0.0]]
    vehicles = [DayVehicle(0), DayVehicle(1)]
    tasks = [DayTask(0, 1, 1.0), DayTask(1, 0, 1.0)]
    instance = day_instance(times, tasks, [0, 1], vehicles, capacity_s=3.0, turnaround_s=1.0)
    solve_day(instance, stop=Iterations(10 * starts), starts=starts)
