"""How an upload of a new mission in flight, or on a base, came to its end, and what follows from that."""

from __future__ import annotations

from dataclasses import replace

from executor.core.context import Context
from executor.core.formatting import format_count
from executor.core.ground import turnaround
from executor.core.inflight import homing
from executor.core.interface.codes import Ending
from executor.core.interface.commands import Command, Level, Say
from executor.core.interface.events import UploadEnded
from executor.core.launch import vehicle_start
from executor.core.replanning import mission_retry, new_missions, survivors
from executor.core.replanning.withdrawal import declare_fault
from executor.core.state.fleet_state import FleetState, NewMission, Replan, Stepped
from executor.core.state.vehicle_state import (
    Fault,
    FaultCode,
    FaultKind,
    Stage,
    VehicleState,
    apply_onboard_mission,
    build_onboard_mission,
)

_MAY_BE_ON_BOARD = mission_retry.LATER | {Ending.READ_BACK_DIFFERS}
"""Ends of an upload after which a vehicle may carry the new mission all the same."""


def apply_upload_result(context: Context, state: FleetState, event: UploadEnded, now_s: float) -> Stepped:
    """Take how the upload of a re-plan's mission, or of a sortie, came to its end."""
    vehicle = state.vehicles[event.vehicle]
    plan = state.replanning.replan
    if plan is None or event.revision != plan.solve.revision or event.vehicle not in plan.pending:
        return state, ()
    mission = plan.missions[event.vehicle]
    vehicle = vehicle.with_assignment(pending=None)
    if not (event.accepted or event.mixed or event.code in _MAY_BE_ON_BOARD):
        vehicle = vehicle.with_assignment(sent_path=None)
    if event.fenced and mission.fence is not None:
        vehicle = vehicle.with_assignment(fence=mission.fence)
    plan = replace(plan, pending=plan.pending - {event.vehicle})
    if event.accepted:
        state, more = _apply_accepted_upload(context, state, vehicle, mission, event, now_s)
    else:
        plan = replace(plan, failed=(*plan.failed, vehicle.name))
        state, more = _apply_failed_upload(context, state, vehicle, plan, event, now_s)
    commands: list[Command] = [*more]
    state, more = _continue_after_upload(context, state, vehicle, plan, event, now_s)
    commands.extend(more)
    state = state.with_replanning(replan=plan)
    if event.mixed and not event.accepted and not mission.fresh and not _has_left_mission(context, vehicle):
        unknown = event.code is Ending.NO_ANSWER
        why = f"its mission on board {'may be' if unknown else 'is'} a mix of two"
        fault = Fault(FaultKind.INTERRUPTION, why, now_s, FaultCode.MISSION_MIXED)
        state, more = declare_fault(context, state, state.vehicles[vehicle.name], fault)
        commands.extend(more)
    state, more = new_missions.end_replan_if_done(state, now_s)
    return state, (*commands, *more)


def _apply_accepted_upload(
    context: Context, state: FleetState, vehicle: VehicleState, mission: NewMission, event: UploadEnded, now_s: float
) -> Stepped:
    board = build_onboard_mission(context, vehicle.name, event.revision, mission.path, mission.visits)
    if mission.fresh:
        vehicle = vehicle.with_assignment(waypoint=0)
    state = state.put(apply_onboard_mission(vehicle, board, now_s))
    to_go = len(mission.visits if mission.fresh else state.vehicles[vehicle.name].remaining_visits())
    what = f"{format_count(to_go, 'segment')} to go" if to_go else "no segment left, returning"
    what += "; fence widened first" if mission.fence is not None else ""
    return state, (Say(Level.INFO, f"{vehicle.name}: new mission on board, {what}"),)


def _apply_failed_upload(
    context: Context, state: FleetState, vehicle: VehicleState, plan: Replan, event: UploadEnded, now_s: float
) -> Stepped:
    mission, sortie = plan.missions[vehicle.name], plan.solve.sortie == vehicle.name
    if _has_left_mission(context, vehicle) or (state.listening.silent_since_s is not None and not event.mixed):
        # Nobody hears us, or it has left its mission meanwhile: that is not its refusal.
        known = replace(state.replanning, urgent=True, trigger=plan.solve.trigger, trigger_s=plan.begun_s)
        return replace(state.put(vehicle), replanning=state.replanning if sortie else known), ()
    if sortie:
        return state.put(vehicle), ()  # the crew is told, and asked again
    refused, how_long = mission_retry.record_declined_mission(context, vehicle, mission, event, now_s)
    text = f"{vehicle.name}: upload of its new mission failed ({event.reason}); re-planning without it{how_long}"
    trigger = f"{vehicle.name}: {event.reason}"
    state = state.put(refused).with_replanning(urgent=True, trigger=trigger, trigger_s=now_s)
    return state, (Say(Level.WARNING, text),)


def _continue_after_upload(
    context: Context, state: FleetState, vehicle: VehicleState, plan: Replan, event: UploadEnded, now_s: float
) -> Stepped:
    """Start a vehicle on its base, or go on with a start that the upload broke off."""
    mission, sortie = plan.missions[vehicle.name], plan.solve.sortie == vehicle.name
    if mission.fresh and event.accepted and survivors.may_take_off(context, vehicle, now_s):
        if not sortie:
            return vehicle_start.start_from_base(context, state, state.vehicles[vehicle.name], now_s)
        state = turnaround.record_sortie_start(state, vehicle.name, now_s)  # it has looked at its boots itself
        state, start = vehicle_start.order_start(context, state, state.vehicles[vehicle.name], now_s)
        return state, (start,)
    if sortie:
        why = "its mission was uploaded too late" if event.accepted else f"its upload failed ({event.reason})"
        return turnaround.end_failed_turnaround(state, vehicle.name, why, now_s)
    if mission.fresh and event.accepted:
        return state, (Say(Level.WARNING, f"{vehicle.name}: stays on the ground: take-off clearance expired"),)
    if vehicle.stage is Stage.STARTING and not event.mixed:
        return vehicle_start.resume_start(context, state, state.vehicles[vehicle.name], now_s)
    return state, ()


def _has_left_mission(context: Context, vehicle: VehicleState) -> bool:
    """Return whether a vehicle does not fly what is on board any more: a mix of two missions does no harm then."""
    return vehicle.stage in {Stage.RETURNING, Stage.DOWN} or homing.is_coming_down(context, vehicle)
