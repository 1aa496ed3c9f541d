"""Decide whether a vehicle on the ground has landed or is down, and what the crew is told."""

from __future__ import annotations

import math

from executor.core.battery import account
from executor.core.battery.pack_condition import assess_resting_pack
from executor.core.context import Context, RelaunchPolicy
from executor.core.inflight.homing import is_coming_home
from executor.core.interface.commands import Level
from executor.core.lines import landing
from executor.core.state import legs
from executor.core.state.fleet_state import FleetState, Stepped
from executor.core.state.vehicle_position import (
    REST_TIMEOUT_S,
    describe_down_place,
    describe_last_position,
    describe_lean,
    format_down_position,
    has_fallen,
    has_sinking_fix,
    is_dead_reckoning,
    is_over_pad,
)
from executor.core.state.vehicle_state import IN_THE_AIR, SINKS, Stage, VehicleState, change_stage
from executor.core.telemetry.battery_reports import pack_facts_of
from missions.autopilots.dialect import is_manual_mode, mode_name

SEEN_AFTER_S = 0.5
"""Time after disarming from which a position shows the place on the ground."""
CRASHED_S = 10.0
"""Time before disarming within which a fall rules out a landing."""
MODE_UNKNOWN_S = 10.0
"""Time without HEARTBEAT after which the last one no longer counts."""
FLIES_UP_M = 5.0
FLIES_M_S = 1.5
"""Height gain and speed from which a vehicle found down is flying."""


def _has_come_down(context: Context, vehicle: VehicleState, now_s: float) -> bool | None:
    """Return whether a vehicle came down other than by landing; None until that is known."""
    fix = vehicle.motion.fix
    if not vehicle.sortie.took_off or fix is None:
        return False
    if vehicle.sensors.tilted_since_s is not None:
        return True
    if fix.at_s < vehicle.sortie.disarmed_s + SEEN_AFTER_S and now_s - vehicle.sortie.disarmed_s < REST_TIMEOUT_S:
        return True if fix.alt_rel_m > context.limits.off_pad_up_m and not vehicle.orders.lands else None
    # A commanded landing may end on a hill.
    came_down = has_sinking_fix(vehicle) if vehicle.orders.lands else has_fallen(context, vehicle)
    return came_down or vehicle.sortie.disarmed_s - vehicle.motion.falls_s < CRASHED_S


def apply_touchdown(
    context: Context, state: FleetState, vehicle: VehicleState, now_s: float, *, spare: bool
) -> Stepped:
    """Take a vehicle as on the ground, landed or not; `spare` is budget left for another flight."""
    came_down = _has_come_down(context, vehicle, now_s)
    if came_down is None:
        return state, ()
    if came_down:
        leans = f"; {lean}" if (lean := describe_lean(vehicle)) else ""
        position = describe_last_position(context, vehicle, now_s)
        lies = change_stage(vehicle, Stage.DOWN).with_assignment(run=None).with_orders(errand=None)
        lies = lies.with_motion(anchor=vehicle.motion.fix).with_sortie(place_told=False)
        return state.put(lies), (landing.CAME_DOWN.say(vehicle=vehicle.name, leans=leans, position=position),)
    vehicle = legs.end_sortie(
        context, legs.end_landing_leg(vehicle, now_s, context.vehicles[vehicle.name].start), now_s
    )
    vehicle = change_stage(vehicle, Stage.LANDED).with_assignment(run=None).with_orders(errand=None, cleared_s=None)
    state = state.put(vehicle)
    if not vehicle.is_pulled_out and vehicle.name not in state.replanning.considered:
        # It was descending at the last re-plan: segments given up then may be for it.
        state = state.with_replanning(considered=state.replanning.considered | {vehicle.name})
        if context.fly_again is RelaunchPolicy.AUTO and state.coverage.given_up and spare:
            trigger = landing.SPARE.format(vehicle=vehicle.name)
            state = state.with_replanning(urgent=True, trigger=trigger, trigger_s=now_s)
            state = state.with_coverage(given_up=frozenset())
    if not vehicle.sortie.took_off:
        return state, (landing.NOT_SEEN_ALOFT.say(vehicle=vehicle.name),)
    left = _describe_remaining_charge(context, vehicle, now_s)
    if vehicle.sortie.rebooted_s is not None and is_over_pad(context, vehicle):
        return state, (landing.REBOOTED_ON_PAD.say(vehicle=vehicle.name, left=left),)
    place = stays = ""
    # A mode only a person flies in is reported where no crew is asked before the next take-off.
    mode, manual = vehicle.mode, is_manual_mode(context.vehicles[vehicle.name].dialect, vehicle.mode)
    if context.fly_again is RelaunchPolicy.AUTO and mode is not None and manual:
        stays = landing.STAYS_ON_GROUND.format(mode=mode_name(context.vehicles[vehicle.name].dialect, mode))
    if not is_over_pad(context, vehicle):
        where = landing.WITHOUT_GPS if is_dead_reckoning(vehicle) else landing.OFF_PAD
        place = where.format(place=describe_down_place(context, vehicle))
    landed = landing.LANDED.with_level(Level.FAULT if place else Level.WARNING if stays else Level.INFO)
    return state, (landed.say(vehicle=vehicle.name, left=left, place=place, stays=stays),)


def _describe_remaining_charge(context: Context, vehicle: VehicleState, now_s: float) -> str:
    """Return the pack's charge, or the reported one where its voltage before take-off contradicted it."""
    battery, held_pct = vehicle.power.battery, vehicle.power.landed_pct
    if held_pct is None or not legs.is_charge_fresh(context, vehicle.power, now_s):
        return ""
    last = vehicle.turn.sorties[-1] if vehicle.turn.sorties else None
    blind = context.vehicles[vehicle.name].dialect.rounds_twice and account.is_blind(battery)
    if last is None or last.rest_v is None or last.began_pct is None or blind:  # blind: derived from the same voltage
        return landing.LEFT.format(left_pct=held_pct)
    cells, facts = vehicle.power.volts.cells, pack_facts_of(context, vehicle)
    rested = assess_resting_pack(last.rest_v, cells, facts, last.began_pct)
    return (landing.LEFT_DOUBTFUL if rested.doubtful else landing.LEFT).format(left_pct=held_pct)


def describe_unexpected_landing(context: Context, vehicle: VehicleState, now_s: float) -> str:
    """Return why an armed vehicle counts as down, with its position; empty if it does not."""
    fix, limits = vehicle.motion.fix, context.limits
    if vehicle.stage not in IN_THE_AIR or not vehicle.armed or fix is None:
        return ""
    if vehicle.sensors.tilted_since_s is not None and now_s - vehicle.sensors.tilted_since_s >= limits.tilt_s:
        return landing.LEANS_DOWN.format(leans=describe_lean(vehicle), down=describe_down_place(context, vehicle))
    if now_s - fix.at_s > limits.link_stale_s or vehicle.stage is not Stage.RETURNING:
        return ""
    if not _has_stopped(context, vehicle, now_s):
        return ""
    if _is_mode_unknown(vehicle, now_s):
        return landing.STOPPED_MODE_UNKNOWN.format(down=format_down_position(context, vehicle))
    return landing.STOPPED.format(down=describe_down_place(context, vehicle))


def _is_mode_unknown(vehicle: VehicleState, now_s: float) -> bool:
    """Return whether its mode and arming are no longer known."""
    return (
        vehicle.link.heartbeat_s is None
        or now_s - max(vehicle.link.heartbeat_s, vehicle.link.excused_s) >= MODE_UNKNOWN_S
    )


def _has_stopped(context: Context, vehicle: VehicleState, now_s: float) -> bool:
    fix, left_s, limits = vehicle.motion.fix, vehicle.sortie.left_s, context.limits
    if fix is None or vehicle.motion.anchor is None or left_s is None or now_s - left_s < limits.on_ground_s:
        return False
    low_over_pad = is_over_pad(context, vehicle) and fix.alt_rel_m > limits.airborne_m
    stood_s = vehicle.motion.stood_s
    if not low_over_pad and vehicle.fault is not None and vehicle.fault.code in SINKS:
        return stood_s >= limits.lies_s  # it sank in mission mode, and is left in it
    if low_over_pad or not (is_coming_home(context, vehicle) or _is_mode_unknown(vehicle, now_s)):
        return False
    # On its pad it is landing, and disarms some seconds later.
    if vehicle.telemetry.on_ground and not is_over_pad(context, vehicle):
        return stood_s >= limits.on_ground_s
    # A hovering vehicle reports airborne, but a wreck on a hill may too, and PX4 1.18 for a minute after it has landed.
    hangs = vehicle.telemetry.on_ground is False and (
        fix.alt_rel_m > limits.off_pad_up_m or is_over_pad(context, vehicle)
    )
    return stood_s >= (limits.hangs_most_s if hangs else limits.down_s)


def is_flying_again(vehicle: VehicleState) -> bool:
    """Return whether a vehicle found down flies after all."""
    fix, anchor = vehicle.motion.fix, vehicle.motion.anchor
    if fix is None or anchor is None or not vehicle.armed or vehicle.sensors.tilted_since_s is not None:
        return False
    moves_m_s = math.hypot(*(fix.velocity_m_s[2:] if fix.reckoned else fix.velocity_m_s))  # a wreck's reckoning drifts
    return abs(fix.alt_rel_m - anchor.alt_rel_m) > FLIES_UP_M or moves_m_s > FLIES_M_S
