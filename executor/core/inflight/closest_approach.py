"""How near flying vehicles came to each other."""

from __future__ import annotations

import math

from executor.core.context import Context
from executor.core.state.fleet_state import ClosestApproach, FleetState
from executor.core.state.vehicle_state import VehicleState

FRESH_S = 1.5
"""Two positions no older than this say how far two vehicles are apart."""
CLIMBS_MOST_M = 15.0
"""More than anybody rises or sinks in that time."""


def record_separation(context: Context, state: FleetState, vehicle: VehicleState, now_s: float) -> FleetState:
    """Take note of how near two vehicles came to each other, after a position of one of them; reckoned ones say not."""
    fix = vehicle.motion.fix
    high = context.limits.airborne_m
    if fix is None or fix.alt_rel_m < high or not vehicle.armed or fix.reckoned:
        return state
    least = state.progress.separation
    # Every position is held against every vehicle: the height alone settles nearly all of them.
    reach_m = math.inf if least is None else least.least_m + CLIMBS_MOST_M
    for other in state.vehicles.values():
        seen = other.motion.fix
        if seen is None or abs(seen.alt_msl_m - fix.alt_msl_m) > reach_m:
            continue
        if other.name == vehicle.name or seen.alt_rel_m < high or not other.armed or seen.reckoned:
            continue
        age_s = now_s - seen.at_s
        if age_s > FRESH_S:
            continue
        east_m_s, north_m_s, up_m_s = seen.velocity_m_s
        higher_m = seen.alt_msl_m + up_m_s * age_s - fix.alt_msl_m
        east_m = seen.place_m[0] + east_m_s * age_s - fix.place_m[0]
        north_m = seen.place_m[1] + north_m_s * age_s - fix.place_m[1]
        apart_m = math.hypot(east_m, north_m, higher_m)
        if least is None or apart_m < least.least_m:
            least = ClosestApproach(apart_m, (vehicle.name, other.name), now_s)
    if least is state.progress.separation:
        return state
    return state.with_progress(separation=least)
