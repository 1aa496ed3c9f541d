"""How an upload of a new mission in flight, or on a base, came to its end, what follows, and when it is offered again.

A vehicle that was busy, or did not answer, may take a mission later. Until then its part is planned for other vehicles.
What it carries is read first: that shows that it answers, and an upload whose end nobody heard may be on board after
all.
"""

from __future__ import annotations

from dataclasses import replace

from executor.core.context import Context
from executor.core.formatting import format_count
from executor.core.ground import turnaround
from executor.core.inflight.custody.mode_causes import is_under_foreign_control
from executor.core.inflight.homing import return_home
from executor.core.interface.commands import Command
from executor.core.interface.endings import Ending
from executor.core.interface.events import UploadEnded
from executor.core.launch import vehicle_start
from executor.core.lines import replanning, sorties
from executor.core.replanning import new_missions, survivors
from executor.core.replanning.withdrawal import declare_fault
from executor.core.state.fleet_state import FleetState, NewMission, Replan, Stepped
from executor.core.state.vehicle_parts import DeclinedMission
from executor.core.state.vehicle_state import (
    Fault,
    FaultCode,
    FaultKind,
    Stage,
    VehicleState,
    apply_onboard_mission,
    build_onboard_mission,
)

OFFERS = 3
"""How often in a row a new mission is offered: who takes none of them is planned around for the rest of the flight."""
AGAIN_S = 10.0
"""Before it is offered the next one: an upload has its own patience, and its part is being planned for others."""
LATER = frozenset({
    Ending.NO_ANSWER, Ending.ERROR, Ending.OTHER_STATION, Ending.CANCELLED, Ending.BROKEN_OFF, Ending.LEFT_MISSION,
})  # fmt: skip
"""Ends of an upload after which the next may end well; a plain refusal does not become another answer by waiting."""
_MAY_BE_ON_BOARD = LATER | {Ending.READ_BACK_DIFFERS}
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
        why = replanning.MAY_BE_MIXED if unknown else replanning.MIXED
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
    what = replanning.TO_GO.format(segments=format_count(to_go, "segment")) if to_go else replanning.NOTHING_TO_GO
    fence = replanning.FENCE_WIDENED if mission.fence is not None else ""
    return state, (replanning.ON_BOARD.say(vehicle=vehicle.name, to_go=what, fence=fence),)


def _apply_failed_upload(
    context: Context, state: FleetState, vehicle: VehicleState, plan: Replan, event: UploadEnded, now_s: float
) -> Stepped:
    mission, sortie = plan.missions[vehicle.name], plan.solve.sortie == vehicle.name
    if _has_left_mission(context, vehicle) or (state.listening.silent_since_s is not None and not event.mixed):
        # Nobody hears us, or it has left its mission meanwhile: that is not its refusal.
        state = state.put(vehicle)
        return state if sortie else state.want_replan(plan.solve.trigger, plan.begun_s), ()
    if sortie:
        return state.put(vehicle), ()  # the crew is told, and asked again
    refused, how_long = record_declined_mission(context, vehicle, mission, event, now_s)
    trigger = replanning.NOT_GIVEN.format(vehicle=vehicle.name, reason=event.reason)
    said = replanning.UPLOAD_FAILED.say(vehicle=vehicle.name, reason=event.reason, how_long=how_long)
    return state.put(refused).want_replan(trigger, now_s), (said,)


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
        why = sorties.TOO_LATE if event.accepted else sorties.UPLOAD_FAILED.format(reason=event.reason)
        return turnaround.end_failed_turnaround(state, vehicle.name, why, now_s)
    if mission.fresh and event.accepted:
        return state, (replanning.STAYS_UNCLEARED.say(vehicle=vehicle.name),)
    if vehicle.stage is Stage.STARTING and not event.mixed:
        return vehicle_start.resume_start(context, state, state.vehicles[vehicle.name], now_s)
    return state, ()


def _has_left_mission(context: Context, vehicle: VehicleState) -> bool:
    """Return whether a vehicle does not fly what is on board any more: a mix of two missions does no harm then."""
    return vehicle.stage in {Stage.RETURNING, Stage.DOWN} or return_home.is_coming_down(context, vehicle)


def record_declined_mission(
    context: Context, vehicle: VehicleState, mission: NewMission, event: UploadEnded, now_s: float
) -> tuple[VehicleState, str]:
    """Return a vehicle that could not be given its new mission, and for how long it is planned around, in words."""
    known = replace(vehicle.assignment, stubborn=True, declined=None)
    if event.code not in LATER or (event.mixed and not mission.fresh):
        return replace(vehicle, assignment=known), ""
    tries = 1 + (0 if vehicle.assignment.declined is None else vehicle.assignment.declined.tries)
    maybe = None
    if context.vehicles[vehicle.name].dialect.upload_is_atomic and not mission.fresh:
        maybe = build_onboard_mission(context, vehicle.name, event.revision, mission.path, mission.visits)
    known = replace(known, declined=DeclinedMission(now_s, tries, maybe))
    how_long = replanning.UNTIL_ANSWER if tries < OFFERS else replanning.REST_OF_FLIGHT
    return replace(vehicle, assignment=known), how_long


def retry_declined_missions(context: Context, state: FleetState, now_s: float) -> Stepped:
    """Look who answers again that could not be given a new mission, and plan with it."""
    if state.replanning.replan is not None or state.progress.recalled or state.listening.silent_since_s is not None:
        return state, ()
    for vehicle in state.vehicles.values():
        refused = vehicle.assignment.declined
        if refused is None or refused.tries >= OFFERS or not _is_answering_again(vehicle, refused, now_s):
            continue
        ready = vehicle.with_assignment(stubborn=False)
        if survivors.build_survivor(context, ready, now_s) is None:
            if vehicle.stage is not Stage.FLYING:
                state = state.put(ready)  # it waits for the crew's word, as others do
            continue
        if vehicle.stage is Stage.FLYING and vehicle.assignment.carried.read_s <= refused.at_s:
            # As if it had said that it was given one: that is read, and nothing is put on board before.
            carried = replace(vehicle.assignment.carried, told_s=now_s)
            state = state.put(vehicle.with_assignment(carried=carried))
            continue
        return _replan_with(state, ready, now_s)
    return state, ()


def _is_answering_again(vehicle: VehicleState, refused: DeclinedMission, now_s: float) -> bool:
    """Return whether it was heard since, and is not in other hands."""
    known, beat_s = vehicle.assignment, vehicle.link.heartbeat_s
    if not known.stubborn or known.pending is not None or known.before is not None or is_under_foreign_control(vehicle):
        return False
    if vehicle.stage not in {Stage.GROUND, Stage.LANDED, Stage.FLYING}:
        return False
    return beat_s is not None and beat_s > refused.at_s and now_s - refused.at_s >= AGAIN_S


def _replan_with(state: FleetState, vehicle: VehicleState, now_s: float) -> Stepped:
    trigger = replanning.ANSWERS.format(vehicle=vehicle.name)
    given_up = state.coverage.given_up - state.list_uncovered_last()
    state = state.put(vehicle).with_replanning(ordered=True).with_coverage(given_up=given_up)
    if not state.replanning.urgent:
        state = state.with_replanning(trigger=trigger, trigger_s=now_s)
    return state, (replanning.ANSWERS_AGAIN.say(trigger=trigger),)
