"""Small instances with known answers, and random ones."""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import numpy.typing as npt
import pytest

from planner import Instance, Travel, Vehicle, build_instance
from planner.moves import Dynamics

NECHRANICE = Path(__file__).parents[3] / "shared" / "data" / "nechranice_graph.yaml"

UNIT = Travel(transit_speed_m_s=1.0, inspection_speed_m_s=1.0, transit_pct_per_s=1.0, inspection_pct_per_s=1.0)
"""A metre is a second is a percent."""


def fleet(*budgets_pct: float, start_m: tuple[float, float] = (0.0, 0.0), consumption: float = 1.0) -> list[Vehicle]:
    """Return vehicles at one place, named a, b, c..."""
    return [Vehicle(chr(ord("a") + number), start_m, budget, consumption) for number, budget in enumerate(budgets_pct)]


def line(segments: int, *budgets_pct: float, travel: Travel = UNIT) -> Instance:
    """Return segments of 10 m in a row, east of the depot: segment s runs from 10 s to 10 s + 10."""
    ends = [[[10.0 * number, 0.0], [10.0 * number + 10.0, 0.0]] for number in range(segments)]
    return build_instance(ends, (0.0, 0.0), fleet(*budgets_pct), travel)


def random_instance(seed: int, segments: int, vehicles: Sequence[Vehicle], *, dynamics: bool = False) -> Instance:
    """Return segments up to 100 m long in a square of 1 km about the depot."""
    chance = np.random.default_rng(seed)
    first = chance.uniform(-500, 500, (segments, 2))
    ends = np.stack([first, first + chance.uniform(-70, 70, (segments, 2))], axis=1)
    travel = Travel(5.0, 1.0, 0.05, 0.06, Dynamics() if dynamics else None)
    return build_instance(ends, (0.0, 0.0), vehicles, travel)


def table_s(instance: Instance, profile: int = 0) -> npt.NDArray[np.float64]:
    """Return (2n, 2n) float64, the seconds of all moves."""
    every = np.arange(2 * instance.segments)
    return instance.moves.seconds(profile, every[:, np.newaxis], every[np.newaxis])


def table_pct(instance: Instance, profile: int = 0) -> npt.NDArray[np.float64]:
    """Return (2n, 2n) float64, the energy of all moves."""
    every = np.arange(2 * instance.segments)
    return instance.moves.pct(profile, every[:, np.newaxis], every[np.newaxis])


def nechranice_ends_m(radius_m: float) -> npt.NDArray[np.float64]:
    """Return (n, 2, 2) float64, the segments near the substation, by (lower pylon, higher pylon); skip without it."""
    if not NECHRANICE.is_file():
        pytest.skip(f"the network of the paper is not at {NECHRANICE.name} beside the project (../shared/data)")
    strings = dict(re.findall(r'(\w+): "([^"]*)"', NECHRANICE.read_text(encoding="utf-8")))
    rows = [row.split() for row in strings["pylons_position"].split(";") if row.strip()]
    pylons = np.array([[float(row[0]), float(row[1])] for row in rows])
    near = np.hypot(pylons[:, 0], pylons[:, 1]) < radius_m
    pairs = {
        (min(pylon, int(other) - 1), max(pylon, int(other) - 1))
        for pylon, others in enumerate(strings["connections_indexes"].split(";"))
        for other in others.split()
    }
    return np.array([[pylons[low], pylons[high]] for low, high in sorted(pairs) if near[low] and near[high]])
