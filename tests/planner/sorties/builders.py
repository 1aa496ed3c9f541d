"""Small days of sorties over random lines."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from planner import Iterations, Plan, Travel
from planner.moves import Dynamics, MoveGeometry
from planner.sorties import SortieBase, SortieInstance, SortieVehicle, solve_sorties

TRAVEL = Travel(5.0, 2.0, 0.1, 0.12)
BROAD = Travel(4.0, 2.0, 0.09, 0.12, Dynamics())
DAY = ((0.0, 4000.0), (10_000.0, 14_000.0))


def line_instance(
    seed: int,
    segments: int,
    *,
    bases: int = 2,
    vehicles: int = 2,
    days: Sequence[tuple[float, float]] = DAY,
    budget_pct: float = 60.0,
    packs: int | None = None,
    recharge_s: float | None = None,
    turnaround_s: float = 60.0,
    transfer: bool = True,
    stagger_s: float = 0.0,
    travels: Sequence[Travel] = (TRAVEL,),
) -> SortieInstance:
    """Return a line with kinks through a square of a kilometre, bases beside it."""
    rng = np.random.default_rng(seed)
    places_m = rng.uniform(0, 1000, (bases, 2))
    pylons_m = np.cumsum(rng.uniform(-120, 120, (segments + 1, 2)), axis=0) + rng.uniform(200, 800, 2)
    ends_m = np.stack((pylons_m[:-1], pylons_m[1:]), axis=1)
    first_m = ends_m.reshape(-1, 2)
    last_m = np.ascontiguousarray(ends_m[:, ::-1]).reshape(-1, 2)
    profiles = [number % len(travels) for number in range(vehicles)]
    out, home = np.zeros((2, vehicles, bases, 2 * segments)), np.zeros((2, vehicles, 2 * segments, bases))
    for row, profile in enumerate(profiles):
        travel = travels[profile]
        there = np.hypot(*(first_m[np.newaxis] - places_m[:, np.newaxis]).transpose(2, 0, 1)) / travel.transit_speed_m_s
        along = np.hypot(*(last_m - first_m).T) / travel.inspection_speed_m_s
        back = np.hypot(*(last_m[:, np.newaxis] - places_m[np.newaxis]).transpose(2, 0, 1)) / travel.transit_speed_m_s
        out[0, row], home[0, row] = there + along + 20.0, back + 15.0
        out[1, row] = there * travel.transit_pct_per_s + along * travel.inspection_pct_per_s + 2.0
        home[1, row] = back * travel.transit_pct_per_s + 1.0
    apart_m = np.hypot(*(places_m[:, np.newaxis] - places_m[np.newaxis]).transpose(2, 0, 1))
    able = np.ones((vehicles, segments), dtype=np.bool_)
    transfer_s = apart_m / 3.0 if transfer else np.where(np.eye(bases) > 0, 0.0, math.inf)
    return SortieInstance(
        moves=MoveGeometry(first_m, last_m, tuple(travels)),
        bases=tuple(
            SortieBase(f"base{number}", turnaround_s, packs, recharge_s) for number in range(bases)
        ),
        vehicles=tuple(
            SortieVehicle(f"uav{row + 1}", row % bases, budget_pct, tuple(days), tuple(range(bases)), profiles[row])
            for row in range(vehicles)
        ),
        days=tuple(days),
        out_s=out[0], out_pct=out[1], home_s=home[0], home_pct=home[1],
        transfer_s=transfer_s, able=able, wanted=np.ones(segments, dtype=np.bool_), stagger_s=stagger_s,
    )  # fmt: skip


def short_day(seed: int = 3, end_s: float = 1_200.0, packs: int | None = None) -> tuple[SortieInstance, Plan]:
    """Return a day of two vehicles that a loss may leave too short, and its plan."""
    instance = line_instance(seed, 20, budget_pct=45.0, days=((0.0, end_s),), packs=packs)
    found = solve_sorties(instance, stop=Iterations(20_000), seed=1)
    assert found.evaluation.violations == ()
    assert not found.plan.uncovered
    return instance, found.plan
