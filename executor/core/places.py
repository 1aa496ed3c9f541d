"""Where a vehicle is, in words for people who look for it, and whether it may be on the ground there."""

from __future__ import annotations

import math

from executor.core.context import Scene
from executor.core.modes import is_home_mode
from executor.core.vehicle import Stage, VehicleState
from missions import Phase


def where(context: Scene, vehicle: VehicleState) -> str:
    """Return a vehicle's place as coordinates and height over its home."""
    fix = vehicle.fix
    if fix is None:
        return "an unknown place"
    lat_deg, lon_deg = context.frame.to_wgs84_deg(*fix.place_m)
    return f"{lat_deg:.6f} {lon_deg:.6f}, {fix.alt_rel_m:.0f} m over its home"


def last_heard(context: Scene, vehicle: VehicleState) -> str:
    """Return where a vehicle was heard last."""
    return f"last position {where(context, vehicle)}" if vehicle.fix is not None else "its position is not known"


def place_words(context: Scene, vehicle: VehicleState) -> str:
    """Return where a vehicle is down, and what that means for whoever goes there."""
    state = "armed: keep away" if vehicle.armed else "disarmed"
    return f"down at {where(context, vehicle)}, {state}"


def over_its_pad(context: Scene, vehicle: VehicleState) -> bool:
    """Return whether it is where it may land, seen from above."""
    fix = vehicle.fix
    return fix is None or math.dist(fix.place_m, context.vehicles[vehicle.name].pad_m) <= context.limits.off_pad_m


def mission_over(context: Scene, vehicle: VehicleState) -> bool:
    """Return whether a vehicle that disarms has landed: its mission was over, or it was on its way home."""
    if vehicle.stage is Stage.RETURNING:
        return True
    leg, beat = vehicle.leg, vehicle.heartbeat
    if leg is None or leg.phase in {Phase.LAND, Phase.RETURN}:
        return True
    # Nobody saw how it came down: it may have flown its mission to the end.
    unseen = vehicle.unseen_until_s is not None and vehicle.unseen_until_s == vehicle.heartbeat_s
    return unseen or (beat is not None and is_home_mode(context.vehicles[vehicle.name].dialect, beat.custom_mode))
