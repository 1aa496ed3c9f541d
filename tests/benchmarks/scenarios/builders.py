"""Small days for tests."""

from __future__ import annotations

import numpy as np

from benchmarks.scenarios import Day, TripStart, build_day_instance
from benchmarks.scenarios.road_graph import build_road_graph
from planner.sorties import SortieInstance


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
        tasks=tuple(wanted),
        depots=tuple(chance.choice(places, depots, replace=False).tolist()),
        starts=tuple(chance.integers(0, places, vehicles).tolist()),
        capacity_s=float(chance.choice([1.3, 2.0, 3.0])) * farthest,
        turnaround_s=float(chance.choice([0.0, 2.0, 2.0 * farthest])),
    )


def row_day(length: int, tasks: list[tuple[int, int]], depots: tuple[int, ...], *, capacity_s: float) -> Day:
    """Return a day of one vehicle on places in a row, 10 s from one to the next."""
    row = build_road_graph(length, [(place, place + 1, 10.0) for place in range(length - 1)])
    return Day(row, tuple(tasks), depots, (depots[0],), capacity_s, 5.0)


def instance_of(day: Day, seed: int | None = None) -> SortieInstance:
    """Return the whole day, with vehicles that are ready at different times if there is a seed."""
    ready = [0.0] * len(day.starts)
    if seed is not None:
        ready = np.random.default_rng([seed, 5]).integers(0, 20, len(day.starts)).astype(float).tolist()
    stands = [TripStart(place, ready_s) for place, ready_s in zip(day.starts, ready, strict=True)]
    return build_day_instance(day, range(len(day.tasks)), stands)
