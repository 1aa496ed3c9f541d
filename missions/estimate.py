"""How long a flight really takes and what it uses, climbs, stops and holds included: to hold a plan against."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from missions.geo import FloatArray, LocalFrame
from missions.safety import legs_m
from missions.setup import Motion
from missions.waypoints import FlightPath, Phase, Waypoint
from planner import Travel

STOP_TURN_DEG = 30.0
"""At a pass-through corner sharper than this the vehicle is taken to come to a stop; both autopilots slow down."""


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


def estimate(path: FlightPath, travel: Travel, motion: Motion, *, consumption: float = 1.0) -> Estimate:
    """Return the duration in seconds and the energy in percent of a full battery of a flight.

    Inspection, holds, climb and descent are charged with the inspection's power, which is nearly that of a hover, and
    everything else with the transit's; in wind, each with that of its air speed. A leg takes its length over its speed,
    plus half a ramp for each end at which the vehicle stands, and never less than its height takes.

    Args:
        path: The flight; a path without waypoints takes nothing.
        travel: The planner's energy rates.
        motion: How the vehicle climbs, stops and waits.
        consumption: The vehicle's own, relative to the energy model.
    """
    if not path.waypoints:
        return Estimate(0.0, 0.0, ())
    first = path.waypoints[0]
    along_m = legs_m(path, LocalFrame(first.lat_deg, first.lon_deg))
    along_m = along_m[:, 1] - along_m[:, 0]
    stops = [_stops_at_end(path, along_m, index) for index in range(len(path.waypoints))]
    hold_rate = float(travel.inspection_rates_pct_per_s(np.zeros(2)))
    legs = []
    for index, point in enumerate(path.waypoints):
        starts_from_rest = index == 0 or stops[index - 1]
        moving_s = _moving_s(point, along_m[index], starts_from_rest + stops[index], motion)
        hold_s = motion.hold_s if point.hold else 0.0
        slow = point.phase in (Phase.INSPECT, Phase.TAKEOFF, Phase.LAND)
        rates = travel.inspection_rates_pct_per_s if slow else travel.transit_rates_pct_per_s
        energy_pct = moving_s * float(rates(along_m[index, :2])) + hold_s * hold_rate
        legs.append(LegEstimate(moving_s + hold_s, consumption * energy_pct))
    return Estimate(sum(leg.duration_s for leg in legs), sum(leg.energy_pct for leg in legs), tuple(legs))


def _stops_at_end(path: FlightPath, along_m: FloatArray, index: int) -> bool:
    point = path.waypoints[index]
    if point.hold or point.phase in (Phase.TAKEOFF, Phase.LAND) or index + 1 == len(path.waypoints):
        return True
    before, after = along_m[index, :2], along_m[index + 1, :2]
    lengths = math.hypot(*before) * math.hypot(*after)
    # Straight up or down afterwards: the vehicle stands first.
    return lengths < 1e-6 or float(np.dot(before, after)) / lengths < math.cos(math.radians(STOP_TURN_DEG))


def _moving_s(point: Waypoint, along_m: FloatArray, ends_at_rest: int, motion: Motion) -> float:
    """Return the time of a leg at its speed with 0 to 2 of its ends at rest (trapezoidal or triangular speed)."""
    length_m = float(np.linalg.norm(along_m))
    ramp_m = ends_at_rest * point.speed_m_s**2 / (2.0 * motion.acceleration_m_s2)
    if length_m < ramp_m:
        moving_s = math.sqrt(2.0 * ends_at_rest * length_m / motion.acceleration_m_s2)
    else:
        moving_s = length_m / point.speed_m_s + ends_at_rest * point.speed_m_s / (2.0 * motion.acceleration_m_s2)
    vertical_m_s = motion.climb_m_s if along_m[2] > 0 else motion.descent_m_s
    return max(moving_s, abs(float(along_m[2])) / vertical_m_s)
