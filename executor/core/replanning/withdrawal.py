"""Withdraw a vehicle from the plan: at fault, or taken by a person, who may return it.

A vehicle with its pilot, by mode switch, sticks or another ground station, is displayed and waited for, not commanded.
"""

from __future__ import annotations

from dataclasses import replace

from executor.core.context import Context
from executor.core.formatting import format_count
from executor.core.inflight import homing
from executor.core.inflight.custody import mode_causes
from executor.core.inflight.homing import is_on_mission
from executor.core.interface.commands import CancelSolve, Command, Disarm, HandsOff, Resume
from executor.core.interface.messages import Actor
from executor.core.lines import custody, pilot, replanning
from executor.core.replanning import replan_cycle
from executor.core.state import legs, vehicle_position
from executor.core.state.fleet_state import FleetState, Stepped
from executor.core.state.vehicle_parts import ModeCause, Takeover
from executor.core.state.vehicle_position import describe_last_position, has_fallen, has_mission_ended, is_over_pad
from executor.core.state.vehicle_state import Fault, FaultKind, Stage, VehicleState, change_stage
from missions.autopilots.dialect import mode_name
from planner import segment_of

RETURNED_AFTER_S = 1.0
"""Time on its mission before a return is reported: a switch passes other positions."""


def declare_fault(context: Context, state: FleetState, vehicle: VehicleState, fault: Fault) -> Stepped:
    """Declare a fault: the vehicle is returned if possible, and its segments are reassigned."""
    kind, why, now_s = fault.kind, fault.reason, fault.detected_s
    flew = vehicle.remaining_visits() if vehicle.stage in {Stage.FLYING, Stage.STARTING, Stage.PILOT} else ()
    left = frozenset(map(segment_of, flew)) - set(state.coverage.inspected)
    down = vehicle.sortie.armed_once and not vehicle.armed
    stood = not vehicle.sortie.took_off or has_mission_ended(context, vehicle)
    landed = stood and is_over_pad(context, vehicle) and not has_fallen(context, vehicle)
    commands: tuple[Command, ...] = ()
    if kind is FaultKind.LINK:
        stage, then = Stage.LOST, describe_last_position(context, vehicle, now_s)
    elif kind is FaultKind.DOWN:
        stage, then = Stage.DOWN, ""  # its reason contains the position
    elif down and not landed:
        # The place where it comes to rest is reported then.
        stage, then = Stage.DOWN, describe_last_position(context, vehicle, now_s)
    elif down or (vehicle.stage is Stage.STARTING and not vehicle.armed):
        stage, then = Stage.LANDED, ""
    elif vehicle.is_under_foreign_control:
        stage, then = Stage.PILOT, custody.WITH_PILOT
    elif vehicle.stage is Stage.STARTING and not vehicle.sortie.took_off:
        stage, then, commands = Stage.RETURNING, replanning.DISARM, (Disarm(vehicle.name, force=False),)
    else:
        stage, then = Stage.RETURNING, ""
    gone = leave_plan(vehicle, stage, now_s)
    state = state.put(replace(gone, fault=fault, sortie=replace(gone.sortie, place_told=kind is FaultKind.DOWN)))
    if stage is Stage.RETURNING and not then:
        then = _describe_homing(context, state, vehicle.name, now_s)
        state, commands = homing.bring_home(context, state, state.vehicles[vehicle.name], now_s)
    trigger = replanning.LINK_TRIGGER if kind is FaultKind.LINK else replanning.FAULT_TRIGGER
    trigger = trigger.format(vehicle=vehicle.name, kind=kind.value, why=why)
    state, more = withdraw_vehicle(state, vehicle.name, trigger, now_s)
    parts = (trigger, then, _describe_reassignment(state, vehicle.name, left))
    return state, (replanning.LEAVES.say(parts="; ".join(part for part in parts if part)), *more, *commands)


def _describe_homing(context: Context, state: FleetState, name: str, now_s: float) -> str:
    answer, words = homing.advise_homing(context, state.vehicles[name], now_s)
    if answer == "return":
        return replanning.RTL_WAITS if state.vehicles[name].link.stale else replanning.RTL
    return replanning.LANDS_ON_PAD if answer == "land" else words


def _describe_reassignment(state: FleetState, name: str, left: frozenset[int]) -> str:
    if not left or state.progress.recalled:
        return ""
    others = any(
        one.name != name and not one.is_pulled_out and one.stage in {Stage.STARTING, Stage.FLYING}
        for one in state.vehicles.values()
    )
    line = replanning.TO_REASSIGN if others else replanning.FOR_NOBODY
    return line.format(segments=format_count(len(left), "segment"))


def leave_plan(vehicle: VehicleState, stage: Stage, now_s: float) -> VehicleState:
    """Return a vehicle that no longer flies its mission."""
    return replace(
        change_stage(vehicle, stage),
        orders=replace(vehicle.orders, ordered_mode_s=now_s, held_s=None, errand=None, cleared_s=None),
        assignment=replace(vehicle.assignment, run=None, pending=None, owed=None),
        motion=replace(vehicle.motion, anchor=None),
        sortie=replace(vehicle.sortie, left_s=now_s),
    )


def withdraw_vehicle(state: FleetState, name: str, trigger: str, now_s: float) -> Stepped:
    """Plan around a vehicle at once: cancel a solve that counted on it; uploads of a re-plan continue."""
    plan = state.replanning.replan
    solving = plan is not None and plan.solve_s is None
    before = [plan.solve.trigger] if plan is not None and solving and not plan.solve.sortie else []
    before += [state.replanning.trigger] if state.replanning.urgent and state.replanning.trigger not in before else []
    state = state.want_replan("; ".join((*before, trigger)), now_s)
    if plan is not None and solving:
        return state.with_replanning(replan=None), (CancelSolve(plan.solve.revision),)
    if plan is not None and name in plan.pending:
        state = state.with_replanning(replan=replace(plan, pending=plan.pending - {name}))
        return replan_cycle.end_replan_if_done(state, now_s)
    return state, ()


def apply_takeover(context: Context, state: FleetState, vehicle: VehicleState) -> Stepped:
    """Release a vehicle that a person has taken; its segments are reserved for it for a while."""
    on_ground = vehicle.is_on_base
    had_work = vehicle.stage in {Stage.FLYING, Stage.STARTING} and bool(vehicle.remaining_visits())
    # Another station's mission is flown in the same mode as ours.
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
    said = pilot.ARMED_ON_GROUND.say(vehicle=vehicle.name, mode=_describe_mode(context, vehicle))
    if not on_ground:
        kept = "" if hold.given_away else pilot.KEPT.format(grace_s=context.pilot_grace_s)
        said = pilot.TAKEN.say(vehicle=vehicle.name, whose=_describe_new_controller(context, vehicle), kept=kept)
    return state, (said, HandsOff(vehicle.name), *more)


def _describe_mode(context: Context, vehicle: VehicleState) -> str:
    return "unknown" if vehicle.mode is None else mode_name(context.vehicles[vehicle.name].dialect, vehicle.mode)


def _describe_new_controller(context: Context, vehicle: VehicleState) -> str:
    if vehicle.assignment.carried.foreign_s is not None:
        return pilot.FOREIGN_MISSION.format(mission=vehicle.assignment.carried.words)
    by = mode_causes.attribute_mode_change(context.vehicles[vehicle.name], vehicle).by
    known = {Actor.PILOT: pilot.PILOT_SWITCHED, Actor.GROUND_STATION: pilot.STATION_ORDERED}
    words = known.get(by, pilot.WITH_PILOT)
    if mode_causes.is_unseen_hold(context, vehicle):
        words = pilot.UNSEEN_MODE
    elif mode_causes.is_long_hold(context, vehicle):
        words = pilot.LONG_HOLD
    held_s = mode_causes.max_failsafe_hold_s(context, vehicle.name)
    return words.format(mode=_describe_mode(context, vehicle), held_s=held_s)


def _cancel_solve_with(state: FleetState, name: str) -> Stepped:
    """Plan again without a vehicle that is part of a running solve; uploads continue."""
    plan = state.replanning.replan
    if plan is None or plan.solve_s is not None or name not in {offer.vehicle for offer in plan.solve.survivors}:
        return state, ()
    return replan_cycle.request_replan_again(state, plan), (CancelSolve(plan.solve.revision),)


def monitor_taken_vehicle(context: Context, state: FleetState, vehicle: VehicleState, now_s: float) -> Stepped:
    """Monitor a vehicle with its pilot."""
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
        return state, (pilot.TAKEN_AGAIN.say(vehicle=vehicle.name, mode=_describe_mode(context, vehicle)),)
    if vehicle.fault is not None or state.progress.recalled:
        why = pilot.GIVEN_AWAY if vehicle.fault is not None else pilot.ABORTED
        return state, (pilot.BACK_TOO_LATE.say(vehicle=vehicle.name, why=why),)
    if context.pilot_returns:
        return take_back_from_pilot(context, state, state.vehicles[vehicle.name], now_s)
    return state, (pilot.MAY_BE_INCLUDED.say(vehicle=vehicle.name),)


def _reassign_segments(
    context: Context, state: FleetState, vehicle: VehicleState, hold: Takeover, now_s: float
) -> Stepped:
    state = state.put(vehicle.with_custody(taken=replace(hold, given_away=True)))
    keeps = pilot.PILOT_KEEPS if vehicle.assignment.carried.foreign_s is None else pilot.STATION_KEEPS
    trigger = keeps.format(vehicle=vehicle.name, grace_s=context.pilot_grace_s)
    state, more = withdraw_vehicle(state, vehicle.name, trigger, now_s)
    return state, (pilot.RELEASED.say(trigger=trigger), *more)


def _apply_pilot_landing(context: Context, state: FleetState, vehicle: VehicleState, now_s: float) -> Stepped:
    fix = vehicle.motion.fix
    # A landed vehicle may be switched off by its kill switch too.
    in_the_air = vehicle_position.has_used_kill_switch(context, vehicle) and vehicle.telemetry.on_ground is False
    lean = vehicle_position.describe_lean(vehicle) if vehicle.sortie.took_off else ""
    fell = bool(lean) or (fix is not None and (fix.alt_rel_m > context.limits.off_pad_up_m or in_the_air))
    place = (
        ""
        if vehicle_position.is_over_pad(context, vehicle) and not fell
        else f", {vehicle_position.describe_down_place(context, vehicle)}"
    )
    stage = Stage.DOWN if place else Stage.LANDED
    vehicle = vehicle if place else legs.end_sortie(context, vehicle, vehicle.link.heard_s or 0.0)
    state = state.put(
        change_stage(vehicle, stage)
        .with_custody(taken=None)
        .with_orders(excluded=True)
        .with_assignment(run=None)
        .with_sortie(place_told=bool(place) and not fell)
    )
    if fell:
        # A landing on a hill, or motors stopped in the air: the position at that moment does not show which.
        line = pilot.FELL
    elif place:
        line = pilot.LANDED_AWAY
    elif not vehicle.sortie.took_off:
        line = pilot.DISARMED_ON_PAD
    else:
        line = pilot.LANDED if vehicle.sortie.rebooted_s is None else pilot.REBOOTED_ON_PAD
    hold = vehicle.custody.taken
    if hold is not None and not hold.given_away:
        trigger = (pilot.DISARMED_WITH_PILOT if fell else pilot.LANDED_BY_PILOT).format(vehicle=vehicle.name)
        state = state.want_replan(trigger, vehicle.link.heard_s or 0.0)
    position = vehicle_position.describe_last_position(context, vehicle, now_s)
    return state, (line.say(vehicle=vehicle.name, place=place, leans=f"; {lean}" if lean else "", position=position),)


def take_back_from_pilot(context: Context, state: FleetState, vehicle: VehicleState, now_s: float) -> Stepped:
    """Take a vehicle that its pilot has returned to its mission back into the plan.

    Both autopilots drop the speed of a leg at a mode change, so it is sent again.
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
        trigger = pilot.BACK.format(vehicle=vehicle.name)
        state = state.with_replanning(ordered=True, trigger=trigger, trigger_s=now_s)
    commands: tuple[Command, ...] = (Resume(vehicle.name, speed_m_s),) if speed_m_s > 0 else ()
    return state, (pilot.BACK_FROM_PILOT.say(vehicle=vehicle.name), *commands)
