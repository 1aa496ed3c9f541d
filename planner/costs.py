"""From segment end points to the time and energy of every move; the names of the cost functions.

The default is the paper's model: distance over speed, no other dynamics. With ``Dynamics`` it is the matrix of the
authors' public solver, which adds acceleration from and to rest and turns on the spot.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from enum import Enum

import numpy as np
import numpy.typing as npt

from planner.energy import Drone, pct_per_s
from planner.errors import InstanceError
from planner.model import FloatArray, Instance, Vehicle

K_C = 1000.0
"""k_c of the paper: the weight of what a tour spends beyond its budget."""


class Cost(Enum):
    """What a plan is chosen by; c(T) is a route's energy in percent of a full battery."""

    MINMAX = "minmax"
    """max c(T)."""
    MINSUM = "minsum"
    """c-MinSum: sum of c(T) + K_C max(0, c(T) - budget)."""
    MINCOMB = "mincomb"
    """c-MinSum + MinMax / number of vehicles."""


@dataclass(frozen=True, slots=True)
class Dynamics:
    """What the authors' public solver adds to the paper's model."""

    acceleration_m_s2: float = 2.5
    yaw_rate_rad_s: float = 1.0

    def __post_init__(self) -> None:
        """Check both rates.

        Raises:
            InstanceError: a rate is not a positive number.
        """
        _check_positive("acceleration_m_s2", self.acceleration_m_s2)
        _check_positive("yaw_rate_rad_s", self.yaw_rate_rad_s)


@dataclass(frozen=True, slots=True)
class Travel:
    """How fast the vehicles move and what a second of it uses at a consumption of 1."""

    transit_speed_m_s: float
    inspection_speed_m_s: float
    transit_pct_per_s: float
    inspection_pct_per_s: float
    dynamics: Dynamics | None = None

    def __post_init__(self) -> None:
        """Check that all figures are positive.

        Raises:
            InstanceError: a figure is not a positive number.
        """
        for name in ("transit_speed_m_s", "inspection_speed_m_s", "transit_pct_per_s", "inspection_pct_per_s"):
            _check_positive(name, getattr(self, name))


def travel_for(
    drone: Drone, transit_speed_m_s: float, inspection_speed_m_s: float, dynamics: Dynamics | None = None
) -> Travel:
    """Return the travel of a drone at the two speeds, with its energy from the pen-and-paper model.

    Raises:
        InstanceError: a speed is not a positive number, or beyond what the drone's battery can give.
    """
    return Travel(
        transit_speed_m_s,
        inspection_speed_m_s,
        pct_per_s(drone, transit_speed_m_s),
        pct_per_s(drone, inspection_speed_m_s),
        dynamics,
    )


def build_instance(
    ends_m: npt.ArrayLike, landing_m: npt.ArrayLike, vehicles: Sequence[Vehicle], travel: Travel
) -> Instance:
    """Return the instance of ``n`` segments and a fleet that lands at one place.

    Args:
        ends_m: (n, 2, 2) float64, the end points a and b of each segment, local east and north in metres.
        landing_m: (2,) float64, where every route ends.
        vehicles: the fleet; each starts at its own ``start_m``, in the air if ``airborne``.
        travel: speeds and energy rates.

    Raises:
        InstanceError: a shape does not fit, or a coordinate is not a number.
    """
    ends, landing = _checked_points(ends_m, landing_m)
    first = ends.reshape(-1, 2)  # row 2s is a, row 2s + 1 is b: visit 2s starts at a, visit 2s + 1 at b
    last = ends[:, ::-1].reshape(-1, 2)
    along = last - first
    starts = np.array([vehicle.start_m for vehicle in vehicles], dtype=np.float64).reshape(-1, 2)
    if not np.all(np.isfinite(starts)):
        raise InstanceError("a vehicle's start_m holds a number that is infinite or NaN")
    consumption = np.array([vehicle.consumption for vehicle in vehicles], dtype=np.float64)[:, np.newaxis]
    in_the_air = np.array([vehicle.airborne for vehicle in vehicles], dtype=np.float64)
    east = np.array([1.0, 0.0])  # the authors' vehicles leave the depot facing east

    move = _moves(last, along, first, along, travel)
    start = _moves(starts, np.broadcast_to(east, starts.shape), first, along, travel)
    depot = _moves(landing[np.newaxis], east[np.newaxis], first, along, travel)
    home = _transit_s(last, along, landing[np.newaxis], travel)[:, 0]
    idle = _transit_s(starts, np.broadcast_to(east, starts.shape), landing[np.newaxis], travel)[:, 0] * in_the_air
    home_s = np.tile(home, (len(vehicles), 1))
    return Instance(
        vehicles=tuple(vehicles),
        move_s=move.seconds,
        start_s=start.seconds,
        home_s=home_s,
        idle_s=idle,
        move_pct=move.pct,
        start_pct=start.pct * consumption,
        home_pct=home_s * travel.transit_pct_per_s * consumption,
        idle_pct=idle * travel.transit_pct_per_s * consumption[:, 0],
        depot_s=depot.seconds[0],
        depot_pct=depot.pct[0],
        value=np.hypot(along[::2, 0], along[::2, 1]),
        end_m=last.copy(),
        landing_m=(float(landing[0]), float(landing[1])),
    )


@dataclass(frozen=True, slots=True)
class _Moves:
    """(p, 2n) float64 each: from p places to the end of every visit."""

    seconds: FloatArray
    pct: FloatArray


def _moves(places: FloatArray, headings: FloatArray, first: FloatArray, along: FloatArray, travel: Travel) -> _Moves:
    """Return the moves from places, left in the direction of ``headings``, to the end of visits along ``along``."""
    transit_s = _transit_s(places, headings, first, travel)
    length_m = np.hypot(along[:, 0], along[:, 1])
    inspection_s = np.broadcast_to(length_m / travel.inspection_speed_m_s, transit_s.shape)
    if travel.dynamics is not None:
        arrival = first[np.newaxis] - places[:, np.newaxis]
        ramps_s = travel.inspection_speed_m_s / travel.dynamics.acceleration_m_s2
        inspection_s = inspection_s + ramps_s + _turn_s(arrival, along[np.newaxis], travel.dynamics)
    pct = transit_s * travel.transit_pct_per_s + inspection_s * travel.inspection_pct_per_s
    return _Moves(transit_s + inspection_s, pct)


def _transit_s(places: FloatArray, headings: FloatArray, targets: FloatArray, travel: Travel) -> FloatArray:
    """Return (p, q) float64, the seconds from each place to each target.

    With dynamics: the turn from the heading, then d / v + v / a, which is the authors' (d - v^2/a)/v + 2 v/a. They
    charge it to a transit of no length as well.
    """
    vector = targets[np.newaxis] - places[:, np.newaxis]
    seconds: FloatArray = np.hypot(vector[..., 0], vector[..., 1]) / travel.transit_speed_m_s
    if travel.dynamics is not None:
        ramps_s = travel.transit_speed_m_s / travel.dynamics.acceleration_m_s2
        seconds = seconds + ramps_s + _turn_s(headings[:, np.newaxis], vector, travel.dynamics)
    return seconds


def _turn_s(before: FloatArray, after: FloatArray, dynamics: Dynamics) -> FloatArray:
    """Return the seconds of the turns between vectors; a vector of no length faces east, as atan2(0, 0) has it."""
    turn = np.arctan2(before[..., 1], before[..., 0]) - np.arctan2(after[..., 1], after[..., 0])
    wrapped: FloatArray = np.abs((turn + math.pi) % (2 * math.pi) - math.pi)
    return wrapped / dynamics.yaw_rate_rad_s


def _checked_points(ends_m: npt.ArrayLike, landing_m: npt.ArrayLike) -> tuple[FloatArray, FloatArray]:
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


def _check_positive(name: str, number: float) -> None:
    if not (math.isfinite(number) and number > 0):
        raise InstanceError(f"{name} is {number}, expected a positive number")
