"""From segment end points and a fleet to an instance."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from planner.errors import InstanceError
from planner.model import Instance, Vehicle
from planner.moves import FloatArray, MoveGeometry, Moves, Travel, compute_moves, compute_transits, tabulate_moves

TABLES_UP_TO = 1000
"""Segments up to which all moves are kept in tables: 2000 x 2000 times and energies are 64 MB."""


def build_instance(
    ends_m: npt.ArrayLike,
    landing_m: npt.ArrayLike,
    vehicles: Sequence[Vehicle],
    travel: Travel | Sequence[Travel],
    *,
    tables_up_to: int = TABLES_UP_TO,
) -> Instance:
    """Return the instance of ``n`` segments and a fleet that lands at one place.

    Args:
        ends_m: (n, 2, 2) float64, the end points a and b of each segment, local east and north in metres.
        landing_m: (2,) float64, where every route ends.
        vehicles: the fleet; each starts at its own ``start_m``, in the air if ``airborne``.
        travel: speeds and energy rates of all vehicles, or of each.
        tables_up_to: segments beyond which moves are computed when they are asked for.

    Raises:
        InstanceError: a shape does not fit, or a coordinate is not a number.
    """
    ends, landing = _check_points(ends_m, landing_m)
    first = ends.reshape(-1, 2)  # row 2s is a, row 2s + 1 is b: visit 2s starts at a, visit 2s + 1 at b
    last = np.array(ends[:, ::-1].reshape(-1, 2))
    starts = np.array([vehicle.start_m for vehicle in vehicles], dtype=np.float64).reshape(-1, 2)
    if not np.all(np.isfinite(starts)):
        raise InstanceError("a vehicle's start_m holds a number that is infinite or NaN")
    travels = [travel] * len(vehicles) if isinstance(travel, Travel) else list(travel)
    if len(travels) != len(vehicles):
        raise InstanceError(f"{len(travels)} travels for {len(vehicles)} vehicles, expected one each")
    profiles = tuple(dict.fromkeys(travels))
    profile = tuple(profiles.index(own) for own in travels)
    consumption = np.array([vehicle.consumption for vehicle in vehicles], dtype=np.float64)[:, np.newaxis]
    in_the_air = np.array([vehicle.airborne for vehicle in vehicles], dtype=np.float64)

    east = np.array([1.0, 0.0])  # the authors' vehicles leave the depot facing east
    begin = [compute_moves(start, east, first, last, own) for start, own in zip(starts, travels, strict=True)]
    depot = [compute_moves(landing, east, first, last, own) for own in profiles]
    home = [compute_transits(last, last - first, landing, own) for own in profiles]
    idle = [compute_transits(start, east, landing, own) for start, own in zip(starts, travels, strict=True)]
    home_s, home_pct = _stack_rows([home[own] for own in profile], len(first))
    start_s, start_pct = _stack_rows(begin, len(first))
    depot_s, depot_pct = _stack_rows([depot[own] for own in profile], len(first))
    geometry = MoveGeometry(first, last, profiles)
    moves: Moves = tabulate_moves(geometry) if profiles and len(ends) <= tables_up_to else geometry
    return Instance(
        vehicles=tuple(vehicles),
        profile=profile,
        moves=moves,
        start_s=start_s,
        home_s=home_s,
        idle_s=np.array([float(way[0]) for way in idle]) * in_the_air,
        start_pct=start_pct * consumption,
        home_pct=home_pct * consumption,
        idle_pct=np.array([float(way[1]) for way in idle]) * in_the_air * consumption[:, 0],
        depot_s=depot_s,
        depot_pct=depot_pct,
        value=np.hypot(*(last - first)[::2].T),
        end_m=np.column_stack((last, np.zeros(len(last)))),
        landing_m=(float(landing[0]), float(landing[1])),
    )


def _stack_rows(rows: Sequence[tuple[FloatArray, FloatArray]], visits: int) -> tuple[FloatArray, FloatArray]:
    """Return seconds and energies, (rows, visits) float64 each."""
    shape = (len(rows), visits)
    return np.array([row[0] for row in rows]).reshape(shape), np.array([row[1] for row in rows]).reshape(shape)


def _check_points(ends_m: npt.ArrayLike, landing_m: npt.ArrayLike) -> tuple[FloatArray, FloatArray]:
    ends = np.asarray(ends_m, dtype=np.float64)
    if ends.size == 0:
        ends = np.zeros((0, 2, 2))
    landing = np.asarray(landing_m, dtype=np.float64)
    if ends.ndim != 3 or ends.shape[1:] != (2, 2):
        raise InstanceError(f"ends_m has shape {ends.shape}, expected (n, 2, 2)")
    if landing.shape != (2,):
        raise InstanceError(f"landing_m has shape {landing.shape}, expected (2,)")
    if not (np.all(np.isfinite(ends)) and np.all(np.isfinite(landing))):
        raise InstanceError("ends_m or landing_m holds a number that is infinite or NaN")
    return ends, landing
