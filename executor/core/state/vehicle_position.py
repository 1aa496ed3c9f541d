"""Judge how well a vehicle's position is known, describe it for a search, and judge whether the vehicle is down there.

A position comes from GPS, or the autopilot has dead-reckoned it since GPS was lost: then it integrates its
accelerations, and may be hundreds of metres off within a minute.
"""

from __future__ import annotations

import math
import re
from dataclasses import dataclass

from executor.core import formatting
from executor.core.context import Scene
from executor.core.lines import landing, position
from executor.core.state.inspection_proof import GAP_S
from executor.core.state.vehicle_parts import PositionFix, Positioning
from executor.core.state.vehicle_state import Stage, VehicleState
from missions import Phase
from missions.autopilots.dialect import is_home_mode

GPS_SETTLE_S = 10.0
"""Time after GPS is regained in which a position jump is the estimator's correction."""
DRIFT_M_S2 = 0.25
"""Acceleration error of an estimator without GPS: its attitude is off by 1.5 degrees."""
DEFAULT_ERROR_M = 3.0
"""Position error assumed where the receiver reports none."""


def time_without_fix_s(known: Positioning, at: PositionFix) -> float:
    """Return the time between the last GPS fix and a position, by the vehicle's clock; 0 for a position with a fix."""
    if not at.reckoned or known.fixed is None:
        return 0.0
    return max(0.0, at.boot_s - known.fixed.boot_s)


def is_dead_reckoning(vehicle: VehicleState) -> bool:
    """Return whether the newest position proves nothing: it has been dead-reckoned for longer than `GAP_S`."""
    fix = vehicle.motion.fix
    return fix is not None and time_without_fix_s(vehicle.sensors.positioning, fix) > GAP_S


@dataclass(frozen=True, slots=True)
class Accuracy:
    """The accuracy of the newest position."""

    known: str
    """fix: with GPS. reckoned: without it. unsaid: the vehicle has not reported its GPS."""
    off_m: float
    """Position error; a lower bound for a dead-reckoned position."""


def accuracy_of(vehicle: VehicleState) -> Accuracy | None:
    """Return the accuracy of a vehicle's newest position; None without one."""
    fix, known = vehicle.motion.fix, vehicle.sensors.positioning
    if fix is None:
        return None
    usual_m = DEFAULT_ERROR_M if known.accuracy_m is None else known.accuracy_m
    if fix.reckoned:
        drift_m = 0.5 * DRIFT_M_S2 * time_without_fix_s(known, fix) ** 2
        return Accuracy("reckoned", usual_m + drift_m)
    return Accuracy("unsaid" if known.fixed is None else "fix", usual_m)


def format_coordinates(context: Scene, vehicle: VehicleState) -> str:
    """Return a vehicle's coordinates for pasting into a map, with their accuracy.

    For a vehicle without GPS the last GPS position comes first, as the place to begin a search, then the dead-reckoned
    one.
    """
    fix, how = vehicle.motion.fix, accuracy_of(vehicle)
    if fix is None or how is None:
        return position.UNKNOWN_PLACE
    if how.known != "reckoned" or vehicle.sensors.positioning.fixed is None:
        return formatting.format_known_place(*context.frame.to_wgs84_deg(*fix.place_m), how.known, how.off_m)
    place = _place(context, fix, how.off_m)
    return position.RECKONED_SINCE.format(last_fix=last_fix(context, vehicle), place=place, off_m=how.off_m)


def last_fix(context: Scene, vehicle: VehicleState) -> str:
    """Return the last GPS position of a vehicle, with its speed there."""
    fixed, fix = vehicle.sensors.positioning.fixed, vehicle.motion.fix
    if fixed is None or fix is None:
        return position.NO_LAST_FIX
    place = _place(context, fixed, vehicle.sensors.positioning.accuracy_m)
    speed_m_s, without_s = math.hypot(*fixed.velocity_m_s[:2]), time_without_fix_s(vehicle.sensors.positioning, fix)
    return position.LAST_FIX.format(place=place, age_s=without_s, speed_m_s=speed_m_s)


def _place(context: Scene, at: PositionFix, off_m: float | None) -> str:
    return formatting.format_lat_lon(*context.frame.to_wgs84_deg(*at.place_m), off_m)


def describe_position(context: Scene, vehicle: VehicleState) -> str:
    """Return a vehicle's coordinates and height over its home."""
    place, fix = format_coordinates(context, vehicle), vehicle.motion.fix
    return place if fix is None else position.AT_HEIGHT.format(place=place, up_m=round(fix.alt_rel_m))


def describe_last_position(context: Scene, vehicle: VehicleState, now_s: float) -> str:
    """Return the last reported position of a vehicle, with its age."""
    fix = vehicle.motion.fix
    if fix is None:
        return position.UNKNOWN
    line = position.RECKONED_LAST if fix.reckoned else position.LAST
    age = formatting.format_age(max(0.0, now_s - fix.at_s))
    return line.format(position=describe_position(context, vehicle), age=age)


def has_fresh_position(context: Scene, vehicle: VehicleState, now_s: float) -> bool:
    """Return whether the vehicle's last position is recent."""
    fix = vehicle.motion.fix
    return fix is not None and now_s - fix.at_s <= context.limits.link_stale_s


def has_fresh_heartbeat(context: Scene, vehicle: VehicleState, now_s: float) -> bool:
    """Return whether its last HEARTBEAT is recent."""
    beat_s = vehicle.link.heartbeat_s
    return beat_s is not None and now_s - beat_s < context.limits.heartbeat_stale_s


_KILL_TEXT = re.compile(r"^(?!.*(disengage|release|clear)).*(emergency stop|kill)", re.IGNORECASE)
"""ArduPilot: "RC: Motors Emergency Stopped", "Arm: Motors Emergency Stopped"; PX4: "Kill engaged"."""
FALL_S = 3.0
"""Time after disarming in which a vehicle falls from 40 m."""
REST_SPEED_M_S = 0.5
DESCENT_M_S = 0.3
TOUCHDOWN_M_S = 1.2
"""Fastest touchdown; ArduPilot's LAND_SPEED is 0.5, PX4's MPC_LAND_SPEED 0.7 by default."""
POSITION_AGE_S = 1.5
REST_TIMEOUT_S = 6.0
"""Longest wait for the position of a vehicle that has disarmed."""


def is_resting_place_known(vehicle: VehicleState, now_s: float) -> bool:
    """Return whether a disarmed vehicle has reported its position since; after a while the last one counts."""
    fix = vehicle.motion.fix
    return (
        fix is None
        or now_s - fix.at_s <= POSITION_AGE_S
        or now_s - max(fix.at_s, vehicle.sortie.disarmed_s) >= REST_TIMEOUT_S
    )


def is_kill_switch_text(text: str) -> bool:
    """Return whether a text reports a motor emergency stop."""
    return bool(_KILL_TEXT.search(text))


def has_fallen(context: Scene, vehicle: VehicleState) -> bool:
    """Return whether a vehicle disarmed in the air, by its last position."""
    fix = vehicle.motion.fix
    if fix is None:
        return False
    fell = fix.alt_rel_m > context.limits.off_pad_up_m or has_sinking_fix(vehicle)
    return fell or has_used_kill_switch(context, vehicle)


def has_used_kill_switch(context: Scene, vehicle: VehicleState) -> bool:
    """Return whether a vehicle reports that it disarmed through its kill switch."""
    text, said_s = vehicle.telemetry.alarm
    return is_kill_switch_text(text) and abs(vehicle.sortie.disarmed_s - said_s) <= context.limits.alarm_s


def has_sinking_fix(vehicle: VehicleState) -> bool:
    """Return whether a disarmed vehicle was descending in its last position."""
    fix = vehicle.motion.fix
    return fix is not None and fix.velocity_m_s[2] < -(DESCENT_M_S if fix.alt_rel_m > 1.0 else TOUCHDOWN_M_S)


def is_at_rest(vehicle: VehicleState, now_s: float) -> bool:
    """Return whether a vehicle with its motors off is seen at rest."""
    fix = vehicle.motion.fix
    if fix is None or now_s - vehicle.sortie.disarmed_s < FALL_S or now_s - fix.at_s > POSITION_AGE_S:
        return False
    if is_dead_reckoning(vehicle):
        return now_s - vehicle.sortie.disarmed_s >= REST_TIMEOUT_S  # dead reckoning drifts
    return math.hypot(*fix.velocity_m_s) < REST_SPEED_M_S


def describe_down_place(context: Scene, vehicle: VehicleState) -> str:
    """Return where a vehicle is down, and whether it is safe to approach."""
    line = landing.ARMED if vehicle.armed else landing.DISARMED
    return line.format(down=format_down_position(context, vehicle))


def format_down_position(context: Scene, vehicle: VehicleState) -> str:
    """Return where a vehicle is down; a dead-reckoned position is not given as the place."""
    how = accuracy_of(vehicle)
    known = how is None or how.known != "reckoned"
    return (landing.DOWN_AT if known else landing.DOWN).format(place=format_coordinates(context, vehicle))


def describe_lean(vehicle: VehicleState) -> str:
    """Return the tilt of a vehicle at an attitude in which none stands or flies; empty otherwise."""
    attitude = vehicle.sensors.attitude
    if vehicle.sensors.tilted_since_s is None or attitude is None:
        return ""
    return landing.LEANS.format(lean_deg=max(abs(attitude.roll_deg), abs(attitude.pitch_deg)))


def is_over_pad(context: Scene, vehicle: VehicleState) -> bool:
    """Return whether the vehicle is over its landing place; a dead-reckoned position does not show it."""
    return not is_dead_reckoning(vehicle) and is_home_by_own_estimate(context, vehicle)


def is_home_by_own_estimate(context: Scene, vehicle: VehicleState) -> bool:
    """Return whether the autopilot's own estimate places it over its pad; the autopilot acts on that."""
    fix = vehicle.motion.fix
    return fix is None or context.vehicles[vehicle.name].pad_distance_m(fix.place_m) <= context.limits.off_pad_m


def has_mission_ended(context: Scene, vehicle: VehicleState) -> bool:
    """Return whether a disarmed vehicle has landed: its mission had ended, or it was returning."""
    if vehicle.sortie.rebooted_s is not None:
        return False  # it did not land by itself
    if vehicle.stage is Stage.RETURNING or vehicle.sortie.away_once:
        return True  # whatever its index: it left its pad and came back
    leg = vehicle.leg
    if leg is None or leg.phase in {Phase.LAND, Phase.RETURN}:
        return True
    # The landing was not observed; it may have flown its mission to the end.
    unseen = vehicle.custody.unseen_until_s is not None and vehicle.custody.unseen_until_s == vehicle.link.heartbeat_s
    return unseen or is_home_mode(context.vehicles[vehicle.name].dialect, vehicle.mode)
