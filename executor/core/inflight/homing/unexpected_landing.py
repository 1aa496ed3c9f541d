"""Vehicles that are on the ground where, when or how they should not be: people must keep away from them."""

from __future__ import annotations

import math

from executor.core.context import Context
from executor.core.inflight.homing.return_home import is_coming_home
from executor.core.state.vehicle_position import describe_down_place, describe_lean, down_at, is_over_pad
from executor.core.state.vehicle_state import SINKS, Stage, VehicleState

_SEEN = frozenset({Stage.FLYING, Stage.RETURNING, Stage.PILOT})
UNSAID_S = 10.0
"""So long without HEARTBEAT the last one says nothing any more."""
FLIES_UP_M = 5.0
FLIES_M_S = 1.5
"""What is this much higher, or this fast, after it was found down, flies."""


def describe_unexpected_landing(context: Context, vehicle: VehicleState, now_s: float) -> str:
    """Return why an armed vehicle is taken to be down, with its place; empty if it is not."""
    fix, limits = vehicle.motion.fix, context.limits
    if vehicle.stage not in _SEEN or not vehicle.armed or fix is None:
        return ""
    if vehicle.sensors.tilted_since_s is not None and now_s - vehicle.sensors.tilted_since_s >= limits.tilt_s:
        return f"{describe_lean(vehicle)}, {describe_down_place(context, vehicle)}"
    if now_s - fix.at_s > limits.link_stale_s:
        return ""
    if vehicle.stage is not Stage.RETURNING or not _has_stopped(context, vehicle, now_s):
        return ""
    if _is_mode_unknown(vehicle, now_s):
        return f"does not move, {down_at(context, vehicle)}; no HEARTBEAT says that it is disarmed: keep away"
    return f"does not move, {describe_down_place(context, vehicle)}"


def _is_mode_unknown(vehicle: VehicleState, now_s: float) -> bool:
    """Return whether nobody knows any more in which mode it is, and whether it is armed."""
    return vehicle.link.heartbeat_s is None or now_s - max(vehicle.link.heartbeat_s, vehicle.link.excused_s) >= UNSAID_S


def _has_stopped(context: Context, vehicle: VehicleState, now_s: float) -> bool:
    """Return whether a vehicle on its way home has stopped for good."""
    fix, anchor, limits = vehicle.motion.fix, vehicle.motion.anchor, context.limits
    if (
        fix is None
        or anchor is None
        or vehicle.sortie.left_s is None
        or now_s - vehicle.sortie.left_s < limits.on_ground_s
    ):
        return False
    low_over_pad = is_over_pad(context, vehicle) and fix.alt_rel_m > limits.airborne_m
    stood_s = fix.boot_s - anchor.boot_s
    if not low_over_pad and vehicle.fault is not None and vehicle.fault.code in SINKS:
        return stood_s >= limits.lies_s  # it sank in its mission's mode, and is left in it
    if low_over_pad or not (is_coming_home(context, vehicle) or _is_mode_unknown(vehicle, now_s)):
        return False
    # On its pad it lands, and disarms some seconds later.
    if vehicle.telemetry.on_ground and not is_over_pad(context, vehicle):
        return stood_s >= limits.on_ground_s
    # Who hangs in the air says so, and a wreck on a hill may say the same.
    hangs = vehicle.telemetry.on_ground is False and fix.alt_rel_m > limits.off_pad_up_m
    return stood_s >= (limits.hangs_most_s if hangs else limits.down_s)


def is_flying_again(vehicle: VehicleState) -> bool:
    """Return whether a vehicle that was found down flies after all."""
    fix, anchor = vehicle.motion.fix, vehicle.motion.anchor
    if fix is None or anchor is None or not vehicle.armed or vehicle.sensors.tilted_since_s is not None:
        return False
    moves_m_s = math.hypot(*(fix.velocity_m_s[2:] if fix.reckoned else fix.velocity_m_s))  # a wreck's reckoning drifts
    return abs(fix.alt_rel_m - anchor.alt_rel_m) > FLIES_UP_M or moves_m_s > FLIES_M_S
