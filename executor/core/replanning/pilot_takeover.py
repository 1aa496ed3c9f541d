"""A vehicle that a person has taken, by mode switch, sticks or another ground station.

It is shown and waited for, and not commanded.
"""

from __future__ import annotations

from dataclasses import replace

from executor.core.context import Context
from executor.core.inflight.custody.mode_attribution import attribute_mode_change
from executor.core.inflight.custody.mode_causes import is_long_hold, is_unseen_hold, max_failsafe_hold_s
from executor.core.inflight.homing.return_home import is_on_mission
from executor.core.interface.commands import CancelSolve, Command, HandsOff, Level, Resume, Say
from executor.core.interface.messages import Actor
from executor.core.replanning import new_missions
from executor.core.replanning.withdrawal import withdraw_vehicle
from executor.core.state import leg_times, vehicle_position
from executor.core.state.fleet_state import FleetState, Stepped
from executor.core.state.vehicle_parts import ModeCause, Takeover
from executor.core.state.vehicle_state import Stage, VehicleState, change_stage
from missions.autopilots.modes import mode_name

RETURNED_AFTER_S = 1.0
"""So long it is on its mission again before anybody says so: a switch goes through other positions on its way."""


def apply_takeover(context: Context, state: FleetState, vehicle: VehicleState) -> Stepped:
    """Let go of a vehicle that a person has taken; its segments are kept for it for a while."""
    beat = vehicle.telemetry.heartbeat
    mode = "unknown" if beat is None else mode_name(context.vehicles[vehicle.name].dialect, beat.custom_mode)
    on_ground = vehicle.stage in {Stage.GROUND, Stage.LANDED}
    had_work = vehicle.stage in {Stage.FLYING, Stage.STARTING} and bool(vehicle.remaining_visits())
    # Another station's mission is flown in the mode that ours was.
    since_s = max(vehicle.telemetry.mode_since_s, vehicle.assignment.carried.foreign_s or 0.0)
    since_s = since_s if vehicle.custody.taken is None else vehicle.custody.taken.since_s
    hold = replace(vehicle.custody.taken or Takeover(since_s, given_away=not had_work), returned_s=None)
    if vehicle.fault is not None:
        hold = replace(hold, given_away=True)
    vehicle = replace(
        change_stage(vehicle, Stage.PILOT),
        custody=replace(vehicle.custody, taken=hold, cause=ModeCause.PERSON),
        orders=replace(vehicle.orders, errand=None, held_s=None, cleared_s=None),
        assignment=replace(vehicle.assignment, run=None, before=None),
        motion=replace(vehicle.motion, anchor=None),
    )
    state, more = _cancel_solve_with(state.put(vehicle), vehicle.name)
    if on_ground:
        text = f"{vehicle.name}: armed on the ground by another source, mode {mode}: keep clear"
        return state, (Say(Level.FAULT, text), HandsOff(vehicle.name), *more)
    kept = f"; its segments are kept for {context.pilot_grace_s:g} s" if not hold.given_away else ""
    if vehicle.assignment.carried.foreign_s is not None:
        what = f"{vehicle.name}: has a foreign mission on board ({vehicle.assignment.carried.words})"
        text = f"{what}: another station's; it may leave its layer; not commanded from here{kept}"
        return state, (Say(Level.FAULT, text), HandsOff(vehicle.name), *more)
    text = f"{vehicle.name}: {_describe_new_controller(context, vehicle, mode)}; not commanded from here{kept}"
    if is_unseen_hold(context, vehicle):
        whose = f"mode {mode} set while there was no link, by its pilot or a failsafe"
        text = f"{vehicle.name}: {whose}; not commanded from here{kept}"
    elif is_long_hold(context, vehicle):
        held_s = max_failsafe_hold_s(context, vehicle.name)
        whose = f"mode {mode} for {held_s:g} s, by its own failsafe or by its pilot since"
        text = f"{vehicle.name}: {whose}; not commanded from here{kept}"
    return state, (Say(Level.FAULT, text), HandsOff(vehicle.name), *more)


def _describe_new_controller(context: Context, vehicle: VehicleState, mode: str) -> str:
    """Return in words who has taken a vehicle, as far as anything says so."""
    match attribute_mode_change(context.vehicles[vehicle.name], vehicle).by:
        case Actor.PILOT:
            return f"its pilot has switched it to {mode}"
        case Actor.GROUND_STATION:
            return f"another ground station has ordered it to {mode}"
        case _:
            return f"with its pilot, mode {mode}"


def _cancel_solve_with(state: FleetState, name: str) -> Stepped:
    """Plan anew without a vehicle if it is part of what is being solved; what goes on board already goes on."""
    plan = state.replanning.replan
    if plan is None or plan.solve_s is not None or name not in {offer.vehicle for offer in plan.solve.survivors}:
        return state, ()
    return new_missions.request_replan_again(state, plan), (CancelSolve(plan.solve.revision),)


def monitor_taken_vehicle(context: Context, state: FleetState, vehicle: VehicleState, now_s: float) -> Stepped:
    """Look at a vehicle that is with its pilot."""
    hold = vehicle.custody.taken or Takeover(now_s)
    if not vehicle.armed:
        return _apply_pilot_landing(context, state, vehicle, now_s)
    ours = vehicle.assignment.carried.foreign_s is None
    returned = ours and is_on_mission(context, vehicle) and now_s - vehicle.telemetry.mode_since_s >= RETURNED_AFTER_S
    if returned is not (hold.returned_s is not None):
        return _apply_pilot_return(context, state, vehicle, hold, now_s, returned=returned)
    if hold.returned_s is None and not hold.given_away and now_s - hold.since_s >= context.pilot_grace_s:
        return _reassign_segments(context, state, vehicle, hold, now_s)
    return state, ()


def _apply_pilot_return(
    context: Context, state: FleetState, vehicle: VehicleState, hold: Takeover, now_s: float, *, returned: bool
) -> Stepped:
    state = state.put(vehicle.with_custody(taken=replace(hold, returned_s=now_s if returned else None)))
    if not returned:
        beat = vehicle.telemetry.heartbeat
        mode = "unknown" if beat is None else mode_name(context.vehicles[vehicle.name].dialect, beat.custom_mode)
        return state, (Say(Level.WARNING, f"{vehicle.name}: taken over by its pilot again, mode {mode}"),)
    if vehicle.fault is not None:
        text = (
            f"{vehicle.name}: its pilot has set mission mode, but its segments were reassigned; not commanded from here"
        )
        return state, (Say(Level.WARNING, text),)
    if state.progress.recalled:
        text = f"{vehicle.name}: its pilot has set mission mode, but the flight was aborted; not commanded from here"
        return state, (Say(Level.WARNING, text),)
    if context.pilot_returns:
        return take_back_from_pilot(context, state, state.vehicles[vehicle.name], now_s)
    text = f"{vehicle.name}: its pilot has set mission mode again; use include to put it back in the plan"
    return state, (Say(Level.FAULT, text),)


def _reassign_segments(
    context: Context, state: FleetState, vehicle: VehicleState, hold: Takeover, now_s: float
) -> Stepped:
    state = state.put(vehicle.with_custody(taken=replace(hold, given_away=True)))
    who = "with its pilot" if vehicle.assignment.carried.foreign_s is None else "on another station's mission"
    trigger = f"{vehicle.name}: {who} for {context.pilot_grace_s:g} s"
    state, more = withdraw_vehicle(state, vehicle.name, trigger, now_s)
    return state, (Say(Level.WARNING, f"{trigger}; its segments are released to the others"), *more)


def _apply_pilot_landing(context: Context, state: FleetState, vehicle: VehicleState, now_s: float) -> Stepped:
    fix = vehicle.motion.fix
    # Who has landed may be switched off by its kill switch too.
    in_the_air = vehicle_position.has_used_kill_switch(context, vehicle) and vehicle.telemetry.on_ground is False
    lean = vehicle_position.describe_lean(vehicle) if vehicle.sortie.took_off else ""
    fell = bool(lean) or (fix is not None and (fix.alt_rel_m > context.limits.off_pad_up_m or in_the_air))
    place = (
        ""
        if vehicle_position.is_over_pad(context, vehicle) and not fell
        else f", {vehicle_position.describe_down_place(context, vehicle)}"
    )
    stage = Stage.DOWN if place else Stage.LANDED
    vehicle = vehicle if place else leg_times.end_sortie(context, vehicle, vehicle.link.heard_s or 0.0)
    state = state.put(
        change_stage(vehicle, stage)
        .with_custody(taken=None)
        .with_orders(excluded=True)
        .with_assignment(run=None)
        .with_sortie(place_told=bool(place) and not fell)
    )
    text = f"{vehicle.name}: is on the ground, landed or disarmed by its pilot{place}"
    if fell:
        # A landing on a hill, or motors that were stopped in the air: the position of that moment does not tell.
        leans = f"; {lean}" if lean else ""
        text = f"{vehicle.name}: disarmed with its pilot{leans}; {vehicle_position.describe_last_position(context, vehicle, now_s)}"
    if not place and not vehicle.sortie.took_off:
        text = f"{vehicle.name}: disarmed by its pilot on its pad; stays there until included"
    elif not place and vehicle.sortie.rebooted_s is not None:
        text = f"{vehicle.name}: is disarmed on its pad; its autopilot has rebooted; stays there until included"
    elif not place:
        text = f"{vehicle.name}: landed by its pilot; stays on the ground until included"
    hold = vehicle.custody.taken
    trigger = f"{vehicle.name}: {'disarmed with' if fell else 'landed by'} its pilot"
    if hold is not None and not hold.given_away:
        state = state.with_replanning(urgent=True, trigger=trigger, trigger_s=vehicle.link.heard_s or 0.0)
    return state, (Say(Level.FAULT if place else Level.INFO, text),)


def take_back_from_pilot(context: Context, state: FleetState, vehicle: VehicleState, now_s: float) -> Stepped:
    """Take a vehicle back into the plan that its pilot has returned to its mission.

    Both autopilots forget the speed of a leg when the mode changes, so it is told that again.
    """
    modes = context.vehicles[vehicle.name].dialect.modes
    speed_m_s = vehicle.leg.speed_m_s if vehicle.leg is not None else 0.0
    hold = vehicle.custody.taken
    back = (
        change_stage(vehicle, Stage.FLYING)
        .with_custody(taken=None, cause=ModeCause.OURS)
        .with_assignment(run=None)
        .with_motion(anchor=None)
        .with_orders(excluded=False, ordered_mode_s=now_s, ordered_modes=frozenset({modes.mission.custom_mode}))
    )
    state = state.put(back)
    if hold is not None and hold.given_away:
        trigger = f"{vehicle.name}: is back in the plan"
        state = state.with_replanning(ordered=True, trigger=trigger, trigger_s=now_s)
    text = f"{vehicle.name}: is back in the plan, from its pilot"
    commands: tuple[Command, ...] = (Resume(vehicle.name, speed_m_s),) if speed_m_s > 0 else ()
    return state, (Say(Level.INFO, text), *commands)
