"""Generated lines of four shapes: each instance follows from its shape, its number of segments and its seed alone.

Only `random.Random.random` is drawn from, and places are rounded to decimetres: every Python gives the same bytes.
"""

from __future__ import annotations

import json
import math
import random
from collections.abc import Callable, Mapping
from itertools import pairwise
from types import MappingProxyType

from benchmarks.dataset.checker import INSTANCE_FORMAT, Instance, Place

SPAN_M = (200.0, 350.0)
"""Shortest and longest distance between two pylons."""
TRANSIT_M_S, INSPECTION_M_S = 5.0, 1.0
TRANSIT_PCT_PER_S, INSPECTION_PCT_PER_S = 0.05, 0.06
"""Round figures of the order of a small multicopter: half an hour in transit on a full battery."""
BRANCHES = 0.12
"""Share of the pylons of a tree where another line begins."""
AWAY_M = 400.0
"""Distance of the depot from the nearest pylon of a line, a ring and a grid."""
Ends = tuple[Place, Place]


def generate_line(segments: int, chance: random.Random) -> list[Ends]:
    """Return one line that hardly bends; the depot is beside its middle."""
    places, heading = [(0.0, 0.0)], 0.0
    for _ in range(segments):
        heading = 0.9 * heading + _draw_between(chance, -0.08, 0.08)
        places.append(_beyond(places[-1], heading, _draw_between(chance, *SPAN_M)))
    middle = places[len(places) // 2]
    return _connect(_shift(places, -middle[0], AWAY_M - middle[1]))


def generate_ring(segments: int, chance: random.Random) -> list[Ends]:
    """Return a closed line of 3 segments or more; the depot is inside, near one place of it."""
    lengths = [_draw_between(chance, *SPAN_M) for _ in range(segments)]
    around, radius_m, turned, places = sum(lengths), sum(lengths) / (2 * math.pi), 0.0, []
    for length_m in lengths:
        wobble = radius_m + _draw_between(chance, -40.0, 40.0)
        places.append((wobble * math.sin(turned), wobble * math.cos(turned)))
        turned += 2 * math.pi * length_m / around
    return _connect(_shift([*places, places[0]], -places[0][0], AWAY_M - places[0][1]))


def generate_tree(segments: int, chance: random.Random) -> list[Ends]:
    """Return lines that leave the depot in four directions and branch."""
    tips = [((0.0, 0.0), math.pi / 2 * (arm + _draw_between(chance, 0.0, 0.7))) for arm in range(4)]
    ends = []
    for number in range(segments):
        turn = number % len(tips)
        here, heading = tips[turn]
        heading += _draw_between(chance, -0.25, 0.25)
        there = _beyond(here, heading, _draw_between(chance, *SPAN_M))
        ends.append((here, there))
        tips[turn] = there, heading
        if chance.random() < BRANCHES:
            tips.append((there, heading + (1 if chance.random() < 0.5 else -1) * _draw_between(chance, 0.8, 1.8)))
    return ends


def generate_grid(segments: int, chance: random.Random) -> list[Ends]:
    """Return streets of a town, row by row from the depot's corner; pylons are up to 40 m off."""
    side = math.ceil(math.sqrt(segments / 2)) + 1
    place = {
        (row, column): (
            AWAY_M / 2 + 275.0 * column + _draw_between(chance, -40.0, 40.0),
            AWAY_M / 2 + 275.0 * row + _draw_between(chance, -40.0, 40.0),
        )
        for row in range(side)
        for column in range(side)
    }
    streets = [(at, there) for at in place for there in ((at[0], at[1] + 1), (at[0] + 1, at[1])) if there in place]
    nearest = sorted(streets, key=lambda street: (max(street[1]), street))
    return [(place[first], place[second]) for first, second in nearest[:segments]]


SHAPES: Mapping[str, Callable[[int, random.Random], list[Ends]]] = MappingProxyType({
    "line": generate_line,
    "ring": generate_ring,
    "tree": generate_tree,
    "grid": generate_grid,
})  # fmt: skip


def generate_instance(
    shape: str, segments: int, vehicles: int, *, seed: int, budget_pct: float, longest_s: float | None = None
) -> Instance:
    """Return the instance of a shape, named after it, its segments and its vehicles.

    Args:
        shape: a key of `SHAPES`.
        segments: their number, at least 1.
        vehicles: their number.
        seed: of all random numbers.
        budget_pct: energy limit of each vehicle.
        longest_s: limit of the longest route of a solution for the window.
    """
    ends = SHAPES[shape](segments, random.Random(f"{shape}-{segments}-{seed}"))
    return Instance(
        name=f"{shape}-{segments}-{vehicles}" + ("" if seed == 1 else f"-seed{seed}"),
        segments_m=tuple((_round_place(first), _round_place(second)) for first, second in ends),
        depot_m=(0.0, 0.0),
        vehicles=vehicles,
        budget_pct=float(budget_pct),
        transit_m_s=TRANSIT_M_S,
        inspection_m_s=INSPECTION_M_S,
        transit_pct_per_s=TRANSIT_PCT_PER_S,
        inspection_pct_per_s=INSPECTION_PCT_PER_S,
        longest_s=None if longest_s is None else float(longest_s),
    )


def format_instance(instance: Instance, source: str) -> str:
    """Return an instance's file: JSON with a segment a line."""
    content = {
        "format": INSTANCE_FORMAT,
        "name": instance.name,
        "source": source,
        "vehicles": instance.vehicles,
        "budget_pct": instance.budget_pct,
        **({} if instance.longest_s is None else {"longest_s": instance.longest_s}),
        "speeds_m_s": {"transit": instance.transit_m_s, "inspection": instance.inspection_m_s},
        "pct_per_s": {"transit": instance.transit_pct_per_s, "inspection": instance.inspection_pct_per_s},
        "depot_m": list(instance.depot_m),
    }
    lines = [f" {json.dumps(key)}: {json.dumps(value)}," for key, value in content.items()]
    segments = ",\n".join(f"  {json.dumps(segment)}" for segment in instance.segments_m)
    return "\n".join(["{", *lines, f' "segments_m": [\n{segments}\n ]', "}", ""])


def _draw_between(chance: random.Random, low: float, high: float) -> float:
    return low + (high - low) * chance.random()


def _beyond(here: Place, heading: float, length_m: float) -> Place:
    return here[0] + length_m * math.cos(heading), here[1] + length_m * math.sin(heading)


def _shift(places: list[Place], east_m: float, north_m: float) -> list[Place]:
    return [(place[0] + east_m, place[1] + north_m) for place in places]


def _connect(places: list[Place]) -> list[Ends]:
    return list(pairwise(places))


def _round_place(place: Place) -> Place:
    return round(place[0], 1) + 0.0, round(place[1], 1) + 0.0
