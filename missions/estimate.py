"""How long a whole flight takes and what it uses, leg by leg, by the model that plans are made with."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from missions.flight_model import UNKNOWN, FlightModel
from missions.geo import FloatArray, LocalFrame
from missions.safety import legs_m
from missions.waypoints import FlightPath, Phase

UPRIGHT_M = 1e-6
"""A leg that goes less far over the ground goes straight up or down."""


@dataclass(frozen=True, slots=True)
class LegEstimate:
    """One leg, with the hold at its end."""

    duration_s: float
    energy_pct: float


@dataclass(frozen=True, slots=True)
class Estimate:
    """A whole flight."""

    duration_s: float
    energy_pct: float
    legs: tuple[LegEstimate, ...]
    """One for each waypoint: the leg that ends there."""


def estimate(path: FlightPath, model: FlightModel, *, consumption: float = 1.0) -> Estimate:
    """Return the duration in seconds and the energy in percent of a full battery of a flight.

    Args:
        path: The flight; a path without waypoints takes nothing.
        model: What the vehicle's flights take.
        consumption: The vehicle's own, relative to the energy model.
    """
    if not path.waypoints:
        return Estimate(0.0, 0.0, ())
    first = path.waypoints[0]
    ends_m = legs_m(path, LocalFrame(first.lat_deg, first.lon_deg))
    along_m = ends_m[:, 1] - ends_m[:, 0]
    stops = np.array([_is_stop_at_end(path, along_m, index) for index in range(len(path.waypoints))], dtype=np.float64)
    at_rest = np.concatenate(([1.0], stops[:-1])) + stops
    speeds = np.array([point.speed_m_s for point in path.waypoints])
    seconds, pct = model.price_legs(along_m, speeds, at_rest)
    performance = model.performance
    for index, point in enumerate(path.waypoints):
        if point.phase in (Phase.TAKEOFF, Phase.LAND):
            upright = model.price_take_off if point.phase is Phase.TAKEOFF else model.price_landing
            seconds[index], pct[index] = upright(np.abs(along_m[index, 2]))
            continue
        more_s = performance.settle_s * stops[index] + max(performance.hold_s, point.hover_s) * point.hold
        before_m = along_m[index - 1] if index and path.waypoints[index - 1].phase is not Phase.TAKEOFF else UNKNOWN
        if index and stops[index - 1]:
            stays_there = math.hypot(along_m[index, 0], along_m[index, 1]) < UPRIGHT_M
            came_m = 0.0 if stays_there else math.hypot(before_m[0], before_m[1])  # it comes to rest going up
            arrives_m_s = performance.arrival_speed_m_s(np.array(came_m), speeds[index - 1])
            more_s += float(performance.turns_s(before_m, along_m[index], arrives_m_s))
        elif index:
            more_s += float(performance.corners_s(before_m, along_m[index], speeds[index]))
        seconds[index] += more_s
        pct[index] += more_s * model.hover_pct_per_s
    paces = np.array([model.pace.factor_of(point.phase) for point in path.waypoints])
    seconds, pct = paces * seconds, consumption * paces * pct
    legs = tuple(LegEstimate(*leg) for leg in zip(seconds.tolist(), pct.tolist(), strict=True))
    return Estimate(float(seconds.sum()), float(pct.sum()), legs)


def _is_stop_at_end(path: FlightPath, along_m: FloatArray, index: int) -> bool:
    point = path.waypoints[index]
    if point.hold or point.phase in (Phase.TAKEOFF, Phase.LAND) or index + 1 == len(path.waypoints):
        return True
    before, after = along_m[index, :2], along_m[index + 1, :2]
    # Straight up or down: the vehicle stands first.
    return math.hypot(*before) * math.hypot(*after) < 1e-6
