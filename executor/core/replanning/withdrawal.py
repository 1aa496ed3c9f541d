"""A vehicle leaves the plan: the judgement that it will not finish its route, and what follows from it."""

from __future__ import annotations

from dataclasses import replace

from executor.core.context import Context
from executor.core.formatting import format_count
from executor.core.inflight.custody.mode_causes import is_under_foreign_control
from executor.core.inflight.homing import return_home
from executor.core.inflight.homing.return_home import HomingAction
from executor.core.interface.commands import CancelSolve, Command, Disarm
from executor.core.lines import replanning
from executor.core.replanning import new_missions
from executor.core.state.fleet_state import FleetState, Stepped
from executor.core.state.vehicle_position import describe_last_position, has_fallen, has_mission_ended, is_over_pad
from executor.core.state.vehicle_state import Fault, FaultKind, Stage, VehicleState, change_stage
from planner import segment_of


def declare_fault(context: Context, state: FleetState, vehicle: VehicleState, fault: Fault) -> Stepped:
    """Declare a fault: the vehicle is brought home where it can be, and its segments are reassigned."""
    kind, why, now_s = fault.kind, fault.reason, fault.detected_s
    left = _find_left_segments(state, vehicle)
    down = vehicle.sortie.armed_once and not vehicle.armed
    commands: tuple[Command, ...] = ()
    if kind is FaultKind.LINK:
        stage, then = Stage.LOST, describe_last_position(context, vehicle, now_s)
    elif kind is FaultKind.DOWN:
        stage, then = Stage.DOWN, ""  # its place is its reason
    elif down and not _is_landed_at_home(context, vehicle):
        # Where it comes to rest is said when it does.
        stage, then = Stage.DOWN, describe_last_position(context, vehicle, now_s)
    elif down or (vehicle.stage is Stage.STARTING and not vehicle.armed):
        stage, then = Stage.LANDED, ""
    elif is_under_foreign_control(vehicle):
        stage, then = Stage.PILOT, replanning.PILOT_HAS_IT
    elif vehicle.stage is Stage.STARTING and not vehicle.sortie.took_off:
        stage, then, commands = Stage.RETURNING, replanning.DISARM, (Disarm(vehicle.name, force=False),)
    else:
        stage, then = Stage.RETURNING, ""
    gone = leave_plan(vehicle, stage, now_s)
    state = state.put(replace(gone, fault=fault, sortie=replace(gone.sortie, place_told=kind is FaultKind.DOWN)))
    if stage is Stage.RETURNING and not then:
        then = _describe_homing(context, state, vehicle.name, now_s)
        state, commands = return_home.bring_home(context, state, state.vehicles[vehicle.name], now_s)
    trigger = replanning.LINK_FAULT if kind is FaultKind.LINK else replanning.FAULT
    trigger = trigger.format(vehicle=vehicle.name, kind=kind.value, why=why)
    state, more = withdraw_vehicle(state, vehicle.name, trigger, now_s)
    parts = (trigger, then, _describe_reassignment(state, vehicle.name, left))
    return state, (replanning.LEAVES.say(parts="; ".join(part for part in parts if part)), *more, *commands)


def _is_landed_at_home(context: Context, vehicle: VehicleState) -> bool:
    """Return whether a vehicle that has disarmed lies where, and as, a landed one does."""
    stood = not vehicle.sortie.took_off or has_mission_ended(context, vehicle)
    return is_over_pad(context, vehicle) and stood and not has_fallen(context, vehicle)


def _describe_homing(context: Context, state: FleetState, name: str, now_s: float) -> str:
    found = return_home.advise_homing(context, state.vehicles[name], now_s)
    match found.answer:
        case HomingAction.RETURN:
            return replanning.RTL_WAITS if state.vehicles[name].link.stale else replanning.RTL
        case HomingAction.LAND:
            return replanning.LANDS_ON_PAD
        case _:
            return found.words


def _find_left_segments(state: FleetState, vehicle: VehicleState) -> frozenset[int]:
    if vehicle.stage not in {Stage.FLYING, Stage.STARTING, Stage.PILOT}:
        return frozenset()
    return frozenset(segment_of(visit) for visit in vehicle.remaining_visits()) - set(state.coverage.inspected)


def _describe_reassignment(state: FleetState, name: str, left: frozenset[int]) -> str:
    """Return what becomes of what a vehicle leaves; nothing where it leaves nothing."""
    if not left or state.progress.recalled:
        return ""
    others = any(
        one.name != name
        and one.fault is None
        and not one.orders.excluded
        and one.stage in {Stage.STARTING, Stage.FLYING}
        for one in state.vehicles.values()
    )
    line = replanning.TO_REASSIGN if others else replanning.FOR_NOBODY
    return line.format(segments=format_count(len(left), "segment"))


def leave_plan(vehicle: VehicleState, stage: Stage, now_s: float) -> VehicleState:
    """Return a vehicle that does not fly its mission any more."""
    return replace(
        change_stage(vehicle, stage),
        orders=replace(vehicle.orders, ordered_mode_s=now_s, held_s=None, errand=None, cleared_s=None),
        assignment=replace(vehicle.assignment, run=None, pending=None, owed=None),
        motion=replace(vehicle.motion, anchor=None),
        sortie=replace(vehicle.sortie, left_s=now_s),
    )


def withdraw_vehicle(state: FleetState, name: str, trigger: str, now_s: float) -> Stepped:
    """Plan around a vehicle at once: a re-plan that is being solved counted on it, one that is put on board goes on."""
    plan = state.replanning.replan
    solving = plan is not None and plan.solve_s is None
    before = [plan.solve.trigger] if plan is not None and solving and not plan.solve.sortie else []
    before += [state.replanning.trigger] if state.replanning.urgent and state.replanning.trigger not in before else []
    state = state.want_replan("; ".join((*before, trigger)), now_s)
    if plan is not None and solving:
        return state.with_replanning(replan=None), (CancelSolve(plan.solve.revision),)
    if plan is not None and name in plan.pending:
        state = state.with_replanning(replan=replace(plan, pending=plan.pending - {name}))
        return new_missions.end_replan_if_done(state, now_s)
    return state, ()
