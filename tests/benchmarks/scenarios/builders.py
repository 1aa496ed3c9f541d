"""Small days for tests."""

from __future__ import annotations

import numpy as np

from benchmarks.scenarios import Day, DayInstance, DayTask, DayVehicle
from planner.road_graph import build_road_graph


def random_day(seed: int, tasks: int, vehicles: int, depots: int, *, places: int = 7, whole: bool = True) -> Day:
    """Return a day on a random connected graph; times in whole seconds have many equal ways."""
    chance = np.random.default_rng(seed)
    pairs = [(int(chance.integers(0, place)), place) for place in range(1, places)]
    pairs += [tuple(sorted(chance.choice(places, 2, replace=False).tolist())) for _ in range(places)]
    pairs = sorted(set(pairs))
    times = chance.integers(1, 9, len(pairs)) if whole else chance.uniform(0.5, 9.0, len(pairs))
    ways = build_road_graph(places, [(a, b, float(time)) for (a, b), time in zip(pairs, times, strict=True)])
    wanted = [pairs[number] for number in chance.permutation(len(pairs))[:tasks]]
    farthest = float(ways.times_s.max())
    return Day(
        streets=ways,
        tasks=tuple(DayTask(a, b, float(ways.along_s[a, b])) for a, b in wanted),
        depots=tuple(chance.choice(places, depots, replace=False).tolist()),
        starts=tuple(chance.integers(0, places, vehicles).tolist()),
        capacity_s=float(chance.choice([1.3, 2.0, 3.0])) * farthest,
        turnaround_s=float(chance.choice([0.0, 2.0, 2.0 * farthest])),
    )


def instance_of(day: Day, seed: int = 0) -> DayInstance:
    """Return the whole day, with vehicles that are ready at different times."""
    chance = np.random.default_rng([seed, 5])
    ended = chance.integers(0, 20, len(day.starts)).tolist()
    vehicles = tuple(
        DayVehicle(place, float(end) + day.turnaround_s, float(end))
        for place, end in zip(day.starts, ended, strict=True)
    )
    return DayInstance(day.streets.times_s, day.tasks, day.depots, vehicles, day.capacity_s, day.turnaround_s)
