"""Where a vehicle is: how well that is known, in words for people who look for it, and whether it may be down there.

A position is by satellites, or reckoned by the autopilot since they were lost: it integrates its own accelerations, and
what it says may be hundreds of metres off within a minute.
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

SETTLES_S = 10.0
"""After GPS is regained the estimator moves to where it is: so long a jump is a correction."""
DRIFT_M_S2 = 0.25
"""What an estimator without GPS takes for acceleration where there is none: its idea of level is off by 1.5 degrees."""
USUAL_M = 3.0
"""What a fix is off by where its receiver does not say."""


def time_without_fix_s(known: Positioning, at: PositionFix) -> float:
    """Return how long before a position the last one with a fix was, by the vehicle's own clock; 0 where it has one."""
    if not at.reckoned or known.fixed is None:
        return 0.0
    return max(0.0, at.boot_s - known.fixed.boot_s)


def is_dead_reckoning(vehicle: VehicleState) -> bool:
    """Return whether its newest position proves nothing: it is reckoned for longer than a gap that is tolerated."""
    fix = vehicle.motion.fix
    return fix is not None and time_without_fix_s(vehicle.sensors.positioning, fix) > GAP_S


@dataclass(frozen=True, slots=True)
class Accuracy:
    """How well the newest position is known."""

    known: str
    """fix: by GPS. reckoned: without it. unsaid: the vehicle has said nothing of its GPS."""
    off_m: float
    """By so much it may be off; a reckoned one by this or more."""


def accuracy_of(vehicle: VehicleState) -> Accuracy | None:
    """Return how well a vehicle's newest position is known; None where there is none."""
    fix, known = vehicle.motion.fix, vehicle.sensors.positioning
    if fix is None:
        return None
    usual_m = USUAL_M if known.accuracy_m is None else known.accuracy_m
    if fix.reckoned:
        drift_m = 0.5 * DRIFT_M_S2 * time_without_fix_s(known, fix) ** 2
        return Accuracy("reckoned", usual_m + drift_m)
    return Accuracy("unsaid" if known.fixed is None else "fix", usual_m)


def format_coordinates(context: Scene, vehicle: VehicleState) -> str:
    """Return a vehicle's place as people paste it into a map, and how it is known.

    Of a vehicle without GPS the last place with a fix comes first: where to look, before what is reckoned since.
    """
    fix, how = vehicle.motion.fix, accuracy_of(vehicle)
    if fix is None or how is None:
        return position.UNKNOWN_PLACE
    if how.known != "reckoned" or vehicle.sensors.positioning.fixed is None:
        return formatting.format_known_place(*context.frame.to_wgs84_deg(*fix.place_m), how.known, how.off_m)
    place = _place(context, fix, how.off_m)
    return position.RECKONED_SINCE.format(last_fix=last_fix(context, vehicle), place=place, off_m=how.off_m)


def last_fix(context: Scene, vehicle: VehicleState) -> str:
    """Return the last place of a vehicle that is by GPS, and how it moved there."""
    fixed, fix = vehicle.sensors.positioning.fixed, vehicle.motion.fix
    if fixed is None or fix is None:
        return position.NO_LAST_FIX
    place = _place(context, fixed, vehicle.sensors.positioning.accuracy_m)
    speed_m_s, without_s = math.hypot(*fixed.velocity_m_s[:2]), time_without_fix_s(vehicle.sensors.positioning, fix)
    return position.LAST_FIX.format(place=place, age_s=without_s, speed_m_s=speed_m_s)


def _place(context: Scene, at: PositionFix, off_m: float | None) -> str:
    return formatting.format_lat_lon(*context.frame.to_wgs84_deg(*at.place_m), off_m)


def describe_position(context: Scene, vehicle: VehicleState) -> str:
    """Return a vehicle's place as coordinates and height over its home."""
    place, fix = format_coordinates(context, vehicle), vehicle.motion.fix
    return place if fix is None else position.AT_HEIGHT.format(place=place, up_m=round(fix.alt_rel_m))


def describe_last_position(context: Scene, vehicle: VehicleState, now_s: float) -> str:
    """Return where a vehicle was heard last, and how long ago that was."""
    fix = vehicle.motion.fix
    if fix is None:
        return position.UNKNOWN
    line = position.RECKONED_LAST if fix.reckoned else position.LAST
    age = formatting.format_age(max(0.0, now_s - fix.at_s))
    return line.format(position=describe_position(context, vehicle), age=age)


def has_fresh_position(context: Scene, vehicle: VehicleState, now_s: float) -> bool:
    """Return whether a vehicle says where it is."""
    fix = vehicle.motion.fix
    return fix is not None and now_s - fix.at_s <= context.limits.link_stale_s


def has_fresh_heartbeat(context: Scene, vehicle: VehicleState, now_s: float) -> bool:
    """Return whether its last HEARTBEAT is recent."""
    beat_s = vehicle.link.heartbeat_s
    return beat_s is not None and now_s - beat_s < context.limits.heartbeat_stale_s


_KILLED = re.compile(r"^(?!.*(disengage|release|clear)).*(emergency stop|kill)", re.IGNORECASE)
"""ArduPilot: "RC: Motors Emergency Stopped", "Arm: Motors Emergency Stopped"; PX4: "Kill engaged"."""
RESTS_AFTER_S = 3.0
"""A vehicle whose motors have stopped falls from 40 m in this time."""
RESTS_M_S = 0.5
SINKS_M_S = 0.3
LANDS_M_S = 1.2
"""Nobody touches down faster: ArduPilot's LAND_SPEED is 0.5, PX4's MPC_LAND_SPEED 0.7 by default."""
SEEN_S = 1.5
UNSEEN_S = 6.0
"""After this nobody waits any more for a position of a vehicle that has disarmed."""


def is_resting_place_known(vehicle: VehicleState, now_s: float) -> bool:
    """Return whether a vehicle that has disarmed was seen since; after a while it is taken for where it was last."""
    fix = vehicle.motion.fix
    return fix is None or now_s - fix.at_s <= SEEN_S or now_s - max(fix.at_s, vehicle.sortie.disarmed_s) >= UNSEEN_S


def is_kill_switch_text(text: str) -> bool:
    """Return whether a text says that somebody has stopped the motors."""
    return bool(_KILLED.search(text))


def has_fallen(context: Scene, vehicle: VehicleState) -> bool:
    """Return whether a vehicle disarmed in the air, as far as its last position tells."""
    fix = vehicle.motion.fix
    if fix is None:
        return False
    fell = fix.alt_rel_m > context.limits.off_pad_up_m or has_sinking_fix(vehicle)
    return fell or has_used_kill_switch(context, vehicle)


def has_used_kill_switch(context: Scene, vehicle: VehicleState) -> bool:
    """Return whether a vehicle disarmed as its kill switch was used, by its own report."""
    text, said_s = vehicle.telemetry.alarm
    return is_kill_switch_text(text) and abs(vehicle.sortie.disarmed_s - said_s) <= context.limits.alarm_s


def has_sinking_fix(vehicle: VehicleState) -> bool:
    """Return whether a vehicle that has disarmed was on its way down when it was seen last."""
    fix = vehicle.motion.fix
    return fix is not None and fix.velocity_m_s[2] < -(SINKS_M_S if fix.alt_rel_m > 1.0 else LANDS_M_S)


def is_at_rest(vehicle: VehicleState, now_s: float) -> bool:
    """Return whether a vehicle whose motors are off is seen to lie where it is."""
    fix = vehicle.motion.fix
    if fix is None or now_s - vehicle.sortie.disarmed_s < RESTS_AFTER_S or now_s - fix.at_s > SEEN_S:
        return False
    if is_dead_reckoning(vehicle):
        return now_s - vehicle.sortie.disarmed_s >= UNSEEN_S  # what it reckons moves on
    return math.hypot(*fix.velocity_m_s) < RESTS_M_S


def describe_down_place(context: Scene, vehicle: VehicleState) -> str:
    """Return where a vehicle is down, and whether it is safe to go there."""
    line = landing.ARMED if vehicle.armed else landing.DISARMED
    return line.format(down=format_down_position(context, vehicle))


def format_down_position(context: Scene, vehicle: VehicleState) -> str:
    """Return where a vehicle is down; one without GPS is not said to be where it reckons."""
    how = accuracy_of(vehicle)
    known = how is None or how.known != "reckoned"
    return (landing.DOWN_AT if known else landing.DOWN).format(place=format_coordinates(context, vehicle))


def describe_lean(vehicle: VehicleState) -> str:
    """Return how a vehicle leans that stands or flies as none does; empty if it does not."""
    attitude = vehicle.sensors.attitude
    if vehicle.sensors.tilted_since_s is None or attitude is None:
        return ""
    return landing.LEANS.format(lean_deg=max(abs(attitude.roll_deg), abs(attitude.pitch_deg)))


def is_over_pad(context: Scene, vehicle: VehicleState) -> bool:
    """Return whether it is where it may land, seen from above; a place that is reckoned does not show it."""
    return not is_dead_reckoning(vehicle) and is_home_by_own_estimate(context, vehicle)


def is_home_by_own_estimate(context: Scene, vehicle: VehicleState) -> bool:
    """Return whether its autopilot takes itself to be over its pad: that is what it acts by."""
    fix = vehicle.motion.fix
    return fix is None or context.vehicles[vehicle.name].pad_distance_m(fix.place_m) <= context.limits.off_pad_m


def has_mission_ended(context: Scene, vehicle: VehicleState) -> bool:
    """Return whether a vehicle that disarms has landed: its mission was over, or it was on its way home."""
    if vehicle.sortie.rebooted_s is not None:
        return False  # it did not come down by itself
    if vehicle.stage is Stage.RETURNING or vehicle.sortie.away_once:
        return True  # whatever its index says: it has been out there, and has come back
    leg = vehicle.leg
    if leg is None or leg.phase in {Phase.LAND, Phase.RETURN}:
        return True
    # Nobody saw how it came down: it may have flown its mission to the end.
    unseen = vehicle.custody.unseen_until_s is not None and vehicle.custody.unseen_until_s == vehicle.link.heartbeat_s
    return unseen or is_home_mode(context.vehicles[vehicle.name].dialect, vehicle.mode)
