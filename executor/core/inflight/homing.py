"""Decide when RTL or a landing may be commanded.

A command is sent once, and again only if it was lost or refused.

An autopilot in its own emergency is left alone, and so is a vehicle that descends over its pad: a descent must not
become a flight.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Literal

from executor.core.context import Context
from executor.core.formatting import join_first_names
from executor.core.inflight.custody.mode_causes import (
    is_failsafe_in_hold,
    is_holding,
    is_long_hold,
)
from executor.core.interface.commands import Command, LandNow, SendHome
from executor.core.interface.events import OrderEnded, ReturnEnded
from executor.core.lines import custody
from executor.core.state.fleet_state import FleetState, Stepped
from executor.core.state.vehicle_parts import HomingOrder, ModeCause
from executor.core.state.vehicle_position import is_kill_switch_text
from executor.core.state.vehicle_state import IN_THE_AIR, SINKS, Stage, VehicleState
from missions import Phase
from missions.area_rules import find_areas_on_return
from missions.autopilots.dialect import is_home_mode, is_mission_mode

REFUSED_AGAIN_S = 5.0
"""Wait after a refusal before the command is sent again."""
FRESH_FIX_S = 1.5
"""Wait for a position of a vehicle just regained before it is commanded."""
SINKS_M_S = 0.3
STOPPED_S = 5.0
"""Time in which a vehicle whose motors were stopped reports disarmed."""
UNSAID_S = 5.0
"""Time without HEARTBEAT after which its mode is unknown."""
MOST_NAMED = 3
"""Areas named in a line to the crew."""

HomingAdvice = tuple[Literal["return", "land", "leave", "wait"], str]
"""What to do about a vehicle that should return, and why."""


def is_coming_home(context: Context, vehicle: VehicleState) -> bool:
    """Return whether it reports RTL or a landing."""
    return is_home_mode(context.vehicles[vehicle.name].dialect, vehicle.mode)


def is_on_mission(context: Context, vehicle: VehicleState) -> bool:
    """Return whether it reports mission mode."""
    return is_mission_mode(context.vehicles[vehicle.name].dialect, vehicle.mode)


def is_coming_down(context: Context, vehicle: VehicleState) -> bool:
    """Return whether a vehicle that took off is landing, or on the ground again."""
    fix = vehicle.motion.fix
    if vehicle.stage not in IN_THE_AIR or not vehicle.sortie.took_off:
        return False
    if not vehicle.armed or vehicle.telemetry.on_ground:
        return True
    if is_on_mission(context, vehicle) and vehicle.leg is not None and vehicle.leg.phase is Phase.LAND:
        return True
    return fix is not None and fix.velocity_m_s[2] < -SINKS_M_S and _is_over_pad(context, vehicle)


def _is_over_pad(context: Context, vehicle: VehicleState) -> bool:
    fix = vehicle.motion.fix
    return fix is not None and context.vehicles[vehicle.name].pad_distance_m(fix.place_m) <= context.limits.pad_m


def advise_homing(context: Context, vehicle: VehicleState, now_s: float) -> HomingAdvice:  # noqa: C901, PLR0911 - one return a reason
    """Return what to do about a vehicle that should no longer fly its mission."""
    errand = vehicle.orders.errand or HomingOrder(now_s)
    if vehicle.is_under_foreign_control:  # confirmed or not: a command that takes it changes the cause
        return "leave", custody.WITH_PILOT
    text, said_s = vehicle.telemetry.alarm
    if is_kill_switch_text(text) and now_s - said_s < STOPPED_S and not errand.force:
        return "wait", custody.KILL_SWITCH
    if errand.land:
        return "land", ""
    if is_coming_home(context, vehicle) and not errand.force:
        return "leave", custody.COMING_HOME
    if not errand.force and (failsafe := _await_failsafe(context, vehicle)) is not None:
        return failsafe
    if _cannot_climb(context, vehicle, now_s) and not errand.force:
        return "leave", custody.CANNOT_CLIMB
    fix = vehicle.motion.fix
    if fix is None or now_s - fix.at_s > context.limits.link_stale_s:
        if now_s - errand.since_s < FRESH_FIX_S:
            return "wait", ""
        return "return", ""  # only its autopilot knows its position
    if _is_over_pad(context, vehicle):
        lands = vehicle.leg is not None and vehicle.leg.phase in {Phase.LAND, Phase.RETURN}
        lands = is_on_mission(context, vehicle) and (lands or fix.velocity_m_s[2] < -SINKS_M_S)
        if lands and vehicle.motion.stood_s < HANGS_S:
            return "leave", custody.LANDING_ON_PAD
        return "land", ""
    if is_on_mission(context, vehicle) and vehicle.leg is not None and vehicle.leg.phase is Phase.LAND:
        return "leave", custody.LANDING
    return "return", ""


def _await_failsafe(context: Context, vehicle: VehicleState) -> HomingAdvice | None:
    """Return that a failsafe is awaited which holds before it acts; None if none acts."""
    if vehicle.custody.cause is ModeCause.OURS and is_failsafe_in_hold(context, vehicle):
        return "wait", custody.HOLDS_FIRST
    if vehicle.custody.cause is not ModeCause.FAILSAFE or vehicle.mode is None:
        return None
    if not is_holding(context, vehicle):
        return "leave", custody.OWN_FAILSAFE
    return None if is_long_hold(context, vehicle) else ("wait", custody.HOLDS_FIRST)


def _cannot_climb(context: Context, vehicle: VehicleState, now_s: float) -> bool:
    """Return whether a vehicle that sank below its mission still sinks, or is on the ground, away from its pad.

    RTL climbs before it flies, and a landing descends onto whatever is below: the choice is its pilot's. A vehicle that
    holds its height again is commanded like any other.
    """
    fix = vehicle.motion.fix
    if vehicle.fault is None or vehicle.fault.code not in SINKS:
        return False
    if fix is None or vehicle.motion.anchor is None or now_s - fix.at_s > context.limits.link_stale_s:
        return True
    if _is_over_pad(context, vehicle):
        return False
    moves = vehicle.motion.stood_s < HANGS_S and fix.alt_rel_m > context.limits.off_pad_up_m
    return not moves or now_s - vehicle.motion.sinks_s < CLIMBS_AGAIN_S


CLIMBS_AGAIN_S = 10.0
HANGS_S = 10.0
"""Time for which no mission of ours stands anywhere."""


def bring_home(
    context: Context, state: FleetState, vehicle: VehicleState, now_s: float, *, land: bool = False, force: bool = False
) -> Stepped:
    """Return a vehicle that has left its mission: command it now, or as soon as that is right."""
    vehicle = vehicle.with_orders(errand=HomingOrder(now_s, land=land, force=force))
    return issue_homing_order(context, state.put(vehicle), vehicle.name, now_s)


def issue_homing_order(context: Context, state: FleetState, name: str, now_s: float) -> Stepped:
    """Send a vehicle its pending command, if that is right now."""
    vehicle = state.vehicles[name]
    errand = vehicle.orders.errand
    if errand is None or errand.told:
        return state, ()
    if vehicle.stage is not Stage.RETURNING:
        return state.put(vehicle.with_orders(errand=None)), ()
    if vehicle.link.stale or now_s < errand.not_before_s:
        return state, ()
    answer, _ = advise_homing(context, vehicle, now_s)
    if answer in {"wait", "leave"}:
        return state, ()
    land, modes = answer == "land", context.vehicles[name].dialect.modes
    expected = {modes.land.custom_mode} if land else {modes.return_home.custom_mode, modes.land.custom_mode}
    told = vehicle.with_orders(
        errand=replace(errand, told=True), ordered_mode_s=now_s, ordered_modes=frozenset(expected)
    )
    if land:
        return state.put(told), (LandNow(vehicle.name),)
    return state.put(told), (*_warn_of_areas(context, vehicle), SendHome(vehicle.name))


def _warn_of_areas(context: Context, vehicle: VehicleState) -> tuple[Command, ...]:
    """Report if the vehicle's RTL path crosses an area; its autopilot knows none."""
    fix = vehicle.motion.fix
    if fix is None or not context.setup.areas:
        return ()
    if not (names := find_areas_on_return(context.setup, vehicle.name, fix.place_m)):
        return ()
    areas = join_first_names([repr(name) for name in names], MOST_NAMED)
    return (custody.CROSSES_AREA.say(vehicle=vehicle.name, areas=areas),)


def apply_homing_result(state: FleetState, event: ReturnEnded | OrderEnded, now_s: float) -> Stepped:
    """Apply a vehicle's answer: a lost or refused command is sent again, any other is closed."""
    vehicle = state.vehicles[event.vehicle]
    errand = vehicle.orders.errand
    if errand is None or not errand.told:
        return state, ()
    if event.accepted:
        return state.put(vehicle.with_orders(errand=None)), ()
    if event.lost:
        return state.put(vehicle.with_orders(errand=replace(errand, told=False))), ()
    if event.refused:
        again = replace(errand, told=False, not_before_s=now_s + REFUSED_AGAIN_S)
        return state.put(vehicle.with_orders(errand=again)), ()
    done = state.put(vehicle.with_orders(errand=None))
    if vehicle.link.heartbeat_s is None or now_s - vehicle.link.heartbeat_s >= UNSAID_S:
        return done, ()  # its state is unknown
    return done, (custody.DOES_NOT_FOLLOW.say(vehicle=vehicle.name),)
