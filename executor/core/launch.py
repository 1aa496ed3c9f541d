"""Start vehicles after the crew's confirmation, and handle the results of mission uploads, in flight or at a base.

A vehicle that was busy or did not answer may get a new mission later; until then its part is planned for others. Its
mission is read back first: that shows that it answers, and an upload without a known end may be on board after all. A
report of an upload that was not ours is read back as well before it is believed.
"""

from __future__ import annotations

import math
from dataclasses import replace

from executor.core.context import Context, RelaunchPolicy
from executor.core.formatting import format_count
from executor.core.ground import out_of_service, turnaround
from executor.core.ground.turnaround import PLACELESS_S
from executor.core.inflight.homing import is_coming_home, is_on_mission
from executor.core.interface.codes import Ending
from executor.core.interface.commands import Command, HandsOff, Start
from executor.core.interface.events import Found, StartEnded, UploadEnded
from executor.core.interface.intents import IntentReason
from executor.core.lines import custody, operator, replanning, sorties, takeoff
from executor.core.preflight.readiness import CHECKS_OUTDATED, find_obstacles
from executor.core.replanning import survivors
from executor.core.replanning.replan_cycle import end_replan_if_done, format_segments, has_left_mission
from executor.core.replanning.withdrawal import declare_fault
from executor.core.state import legs
from executor.core.state.fleet_state import FleetState, NewMission, Replan, Stepped, step_each
from executor.core.state.mission_ownership import AGREEMENT_S, MissionOwnership, apply_mission_readback
from executor.core.state.vehicle_parts import DeclinedMission, ModeCause
from executor.core.state.vehicle_position import has_fresh_heartbeat, has_fresh_position, is_kill_switch_text
from executor.core.state.vehicle_state import (
    Fault,
    FaultCode,
    FaultKind,
    Stage,
    VehicleState,
    apply_onboard_mission,
    build_onboard_mission,
    change_stage,
)
from missions import StartStep
from planner import segment_of

RETRIES = 3
"""Attempts to repeat a failed start."""
START_WINDOW_S = 45.0
"""Time after the crew's confirmation in which a start is repeated; each attempt tries to arm for half a minute, and
later a person may be at the pad."""
HEARD_LATELY_S = 15.0
"""Age of the last message at the crew's confirmation that still shows a link; newer ones queue while the question is
open."""
OFFERS = 3
"""Consecutive offers of a new mission, after which the plan works around the vehicle for the rest of the flight."""
AGAIN_S = 10.0
"""Wait before the next offer; an upload has its own retries, and the vehicle's part is being planned for others."""
LATER = frozenset({
    Ending.NO_ANSWER, Ending.ERROR, Ending.OTHER_STATION, Ending.CANCELLED, Ending.BROKEN_OFF, Ending.LEFT_MISSION,
})  # fmt: skip
"""Results of an upload after which another attempt may succeed; a plain refusal does not change with time."""
_MAY_BE_ON_BOARD = LATER | {Ending.READ_BACK_DIFFERS}
"""Results of an upload after which the new mission may be on board all the same."""


def launch_fleet(context: Context, state: FleetState, now_s: float) -> Stepped:
    """Start all vehicles with a mission, after the crew's confirmation."""
    commands: list[Command] = []
    for vehicle in state.vehicles.values():
        if vehicle.link.heard_s is not None and now_s - vehicle.link.heard_s < HEARD_LATELY_S:
            state = state.put(vehicle.with_link(heard_s=now_s, excused_s=now_s))
    planned: set[int] = set()
    begun: set[int] = set()
    for vehicle in state.vehicles.values():
        if vehicle.assignment.board is None or not vehicle.assignment.board.visits:
            continue
        own = {segment_of(visit) for visit in vehicle.assignment.board.visits}
        planned |= own
        if sorties.REBOOTED in find_obstacles(context, state, vehicle, now_s):
            commands.append(takeoff.REBOOTED.say(vehicle=vehicle.name, why=takeoff.HAS_REBOOTED))
            continue
        # On a day one after the other, each in its base's slot; and never one that others have armed.
        if context.day is not None or vehicle.armed:
            continue
        begun |= own
        state, order = order_start(context, state, vehicle, now_s)
        commands.append(order)
    if context.day is not None:
        state, begun = turnaround.queue_first_sorties(context, state, now_s), planned
    left = context.wanted - planned - state.later_segments()
    if left:
        commands.append(takeoff.LATER.say(segments=format_segments(context, left)))
    given_up = state.coverage.given_up | (planned - begun)
    state = state.with_coverage(given_up=given_up, left_over=left).with_progress(launched_s=now_s)
    return state.with_crew(briefing=replace(state.crew.briefing, question=None)), tuple(commands)


def order_start(context: Context, state: FleetState, vehicle: VehicleState, now_s: float) -> tuple[FleetState, Start]:
    """Return the state with a vehicle commanded to start, and the command."""
    dialect = context.vehicles[vehicle.name].dialect
    modes_on_the_way = {dialect.modes.mission.custom_mode}
    if StartStep.GUIDED in dialect.start:
        modes_on_the_way.add(dialect.modes.guided.custom_mode)
    vehicle = change_stage(legs.begin_sortie(state, vehicle, now_s), Stage.STARTING)
    vehicle = (
        vehicle.with_orders(
            ordered_mode_s=now_s, errand=None, ordered_modes=frozenset(modes_on_the_way), start_let_go=False
        )
        .with_assignment(waypoint=0, run=None, owed=None, carried=MissionOwnership(ours_s=now_s), leg_began=None)
        .with_sortie(armed_once=False, took_off=False, rebooted_s=None, away_once=False)
        .with_motion(anchor=None)
        .with_power(began_pct=vehicle.power.battery.remaining_pct, aloft_pct=None)
    )
    return state.put(vehicle), Start(vehicle.name)


def start_from_base(context: Context, state: FleetState, vehicle: VehicleState, now_s: float) -> Stepped:
    """Start a vehicle that was on its base: at once if it reports a position, else once it does.

    A vehicle without a position may have rebooted, lost its settings and got another pack.
    """
    placed, anew = has_fresh_position(context, vehicle, now_s), _describe_reboot(context, state, vehicle, now_s)
    state, order = order_start(context, state, vehicle, now_s)
    if placed and not anew:
        return state, (order,)
    owed = state.vehicles[vehicle.name]
    owed = owed.with_orders(start_owed_s=now_s).with_sortie(rebooted_s=vehicle.sortie.rebooted_s if anew else None)
    return state.put(owed), () if placed else (takeoff.WAITS.say(vehicle=vehicle.name),)


def apply_start_result(context: Context, state: FleetState, event: StartEnded, now_s: float) -> Stepped:
    """Apply the result of a start: the vehicle flies, starts again, or is at fault on its pad."""
    vehicle = state.vehicles[event.vehicle]
    if vehicle.stage is not Stage.STARTING:
        return state, ()
    if event.accepted:
        return _begin_mission(state, vehicle.with_orders(cleared_s=None).with_motion(anchor=None), now_s)
    if not vehicle.armed and is_kill_switch_text(event.reason):
        return out_of_service.stand_down_vehicle(state, vehicle, now_s)
    stopped = (vehicle.sortie.armed_once or event.armed) and not vehicle.armed
    may = context.fly_again is RelaunchPolicy.AUTO or (_is_clearance_fresh(state, vehicle, now_s) and not stopped)
    may = may and event.code not in {Ending.MODE_CHANGED, Ending.STOOD_STILL} and vehicle.sortie.rebooted_s is None
    if vehicle.assignment.failures + 1 < RETRIES and may and _is_waiting_on_pad(context, vehicle, event, now_s):
        vehicle = vehicle.with_assignment(failures=vehicle.assignment.failures + 1).with_orders(ordered_mode_s=now_s)
        if not has_fresh_position(context, vehicle, now_s):
            owed = vehicle.with_orders(start_owed_s=now_s)
            return state.put(owed), (takeoff.TRIED_ONCE_PLACED.say(vehicle=vehicle.name, reason=event.reason),)
        said = takeoff.TRIED_AGAIN.say(vehicle=vehicle.name, reason=event.reason)
        return state.put(vehicle), (said, Start(vehicle.name))
    if event.armed and not vehicle.armed and not has_fresh_heartbeat(context, vehicle, now_s):
        # It acknowledged arming, then went silent: it may be there with its motors on.
        why = event.reason + takeoff.UNHEARD_SINCE
        return declare_fault(context, state, vehicle, _build_start_fault(why, now_s, FaultKind.LINK))
    why = event.reason + (takeoff.DISARMED_SINCE if stopped else "")
    return declare_fault(context, state, vehicle, _build_start_fault(why, now_s))


def _build_start_fault(why: str, now_s: float, kind: FaultKind = FaultKind.INTERRUPTION) -> Fault:
    return Fault(kind, takeoff.NOT_STARTED.format(why=why), now_s, FaultCode.NOT_STARTED)


def monitor_start(context: Context, state: FleetState, vehicle: VehicleState, now_s: float) -> Stepped:
    """Check a starting vehicle: it may have disarmed, and its start may no longer be followed up."""
    beat_s, released = vehicle.link.heartbeat_s, vehicle.orders.start_let_go
    # Two HEARTBEATs confirm it: one may be another vehicle's.
    stopped = vehicle.sortie.armed_once and not vehicle.armed and (beat_s or 0.0) > vehicle.sortie.disarmed_s
    if stopped and (released or context.fly_again is not RelaunchPolicy.AUTO):
        why = takeoff.MODE_CHANGED if released else takeoff.ARMED_THEN_DISARMED
        state, more = declare_fault(context, state, vehicle, _build_start_fault(why, now_s))
        return state, (HandsOff(vehicle.name), *more)  # its start procedure would arm it again
    flies = released and vehicle.sortie.took_off and vehicle.custody.cause is ModeCause.OURS
    return _begin_mission(state, vehicle, now_s) if flies and is_on_mission(context, vehicle) else (state, ())


def _begin_mission(state: FleetState, vehicle: VehicleState, now_s: float) -> Stepped:
    vehicle = change_stage(vehicle, Stage.FLYING).with_assignment(failures=0).with_orders(ordered_mode_s=now_s)
    return state.put(vehicle), (takeoff.FLIES.say(vehicle=vehicle.name),)


def _is_clearance_fresh(state: FleetState, vehicle: VehicleState, now_s: float) -> bool:
    """Return whether the crew's confirmation is recent: later a person may be at the vehicle's pad."""
    asked_s = max(state.progress.launched_s or now_s, vehicle.orders.cleared_s or -math.inf)
    return now_s - asked_s < START_WINDOW_S


def retry_waiting_starts(context: Context, state: FleetState, now_s: float) -> Stepped:
    """Repeat starts that wait for a position; a vehicle long silent may have rebooted with another pack."""

    def retry(state: FleetState, vehicle: VehicleState) -> Stepped:
        owed_s = vehicle.orders.start_owed_s
        if owed_s is None:
            return state, ()
        why, fix = _describe_reboot(context, state, vehicle, now_s), vehicle.motion.fix
        if not why and now_s - owed_s > PLACELESS_S:
            why = takeoff.PLACELESS.format(placeless_s=PLACELESS_S)
        starts = vehicle.stage is Stage.STARTING
        if starts and not why and (fix is None or fix.at_s <= owed_s):
            return state, ()
        paid = vehicle.with_orders(start_owed_s=None, ordered_mode_s=now_s)
        if starts and why:
            return declare_fault(context, state.put(paid), paid, _build_start_fault(why, now_s))
        return state.put(paid), (Start(vehicle.name),) if starts else ()

    return step_each(state, tuple(state.vehicles.values()), retry)


def _describe_reboot(context: Context, state: FleetState, vehicle: VehicleState, now_s: float) -> str:
    """Return why an autopilot is no longer the one that was checked or included; empty if it is."""
    obstacles = find_obstacles(context, state, vehicle, now_s)
    return next((words for line, (_, words) in obstacles.items() if line in CHECKS_OUTDATED), "")


def _is_waiting_on_pad(context: Context, vehicle: VehicleState, event: StartEnded, now_s: float) -> bool:
    """Return whether a vehicle whose start failed is certain to be on its pad still, under our control."""
    if not (vehicle.sortie.armed_once or event.armed):
        return True
    if not has_fresh_heartbeat(context, vehicle, now_s) or not has_fresh_position(context, vehicle, now_s):
        return False  # it may have taken off, or its autopilot rebooted
    return (
        not vehicle.sortie.took_off and not is_coming_home(context, vehicle) and vehicle.custody.cause is ModeCause.OURS
    )


def resume_start(context: Context, state: FleetState, vehicle: VehicleState, now_s: float) -> Stepped:
    """Continue a start that an upload interrupted; uploads preempt every other dialogue."""
    if vehicle.sortie.took_off:
        return _begin_mission(state, vehicle, now_s)
    asks = not vehicle.armed and context.fly_again is not RelaunchPolicy.AUTO
    if asks and not _is_clearance_fresh(state, vehicle, now_s):
        why = takeoff.NOT_IN_TIME.format(window_s=START_WINDOW_S)
        return declare_fault(context, state, vehicle, Fault(FaultKind.INTERRUPTION, why, now_s, FaultCode.NOT_STARTED))
    state, order = order_start(context, state, vehicle, now_s)
    return state, (order,)


def apply_upload_result(context: Context, state: FleetState, event: UploadEnded, now_s: float) -> Stepped:
    """Apply the result of an upload for a re-plan, or of a sortie."""
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
    if event.mixed and not event.accepted and not mission.fresh and not has_left_mission(context, vehicle):
        unknown = event.code is Ending.NO_ANSWER
        why = replanning.MAY_BE_MIXED if unknown else replanning.MIXED
        fault = Fault(FaultKind.INTERRUPTION, why, now_s, FaultCode.MISSION_MIXED)
        state, more = declare_fault(context, state, state.vehicles[vehicle.name], fault)
        commands.extend(more)
    state, more = end_replan_if_done(state, now_s)
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
    if has_left_mission(context, vehicle) or (state.listening.silent_since_s is not None and not event.mixed):
        # No contact, or it has left its mission meanwhile: not its refusal.
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
    """Start a vehicle at its base, or continue a start that the upload interrupted."""
    mission, sortie = plan.missions[vehicle.name], plan.solve.sortie == vehicle.name
    if mission.fresh and event.accepted and operator.UNCLEARED not in find_obstacles(context, state, vehicle, now_s):
        if not sortie:
            return start_from_base(context, state, state.vehicles[vehicle.name], now_s)
        state = turnaround.record_sortie_start(state, vehicle.name, now_s)  # a turnaround checks reboots itself
        state, start = order_start(context, state, state.vehicles[vehicle.name], now_s)
        return state, (start,)
    if sortie:
        why = sorties.TOO_LATE if event.accepted else sorties.UPLOAD_FAILED.format(reason=event.reason)
        return turnaround.end_turnaround(state, state.vehicles[vehicle.name], IntentReason.NOT_READY, why, now_s)
    if mission.fresh and event.accepted:
        return state, (replanning.STAYS_UNCLEARED.say(vehicle=vehicle.name),)
    if vehicle.stage is Stage.STARTING and not event.mixed:
        return resume_start(context, state, state.vehicles[vehicle.name], now_s)
    return state, ()


def record_declined_mission(
    context: Context, vehicle: VehicleState, mission: NewMission, event: UploadEnded, now_s: float
) -> tuple[VehicleState, str]:
    """Return a vehicle whose new mission was not accepted, and in words how long the plan works around it."""
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
    """Find vehicles that answer again after a declined mission, and plan with them."""
    if state.replanning.replan is not None or state.progress.recalled or state.listening.silent_since_s is not None:
        return state, ()
    for vehicle in state.vehicles.values():
        refused = vehicle.assignment.declined
        if refused is None or refused.tries >= OFFERS or not _is_answering_again(vehicle, refused, now_s):
            continue
        ready = vehicle.with_assignment(stubborn=False)
        if survivors.build_survivor(context, state, ready, now_s) is None:
            if vehicle.stage is not Stage.FLYING:
                state = state.put(ready)  # it waits for the crew's include, as others do
            continue
        if vehicle.stage is Stage.FLYING and vehicle.assignment.carried.read_s <= refused.at_s:
            # Treat it as if it had reported a new mission: that is read back, and nothing is uploaded before.
            carried = replace(vehicle.assignment.carried, told_s=now_s)
            state = state.put(vehicle.with_assignment(carried=carried))
            continue
        trigger = replanning.ANSWERS.format(vehicle=vehicle.name)
        given_up = state.coverage.given_up - state.list_uncovered_last()
        state = state.put(ready).with_replanning(ordered=True).with_coverage(given_up=given_up)
        if not state.replanning.urgent:
            state = state.with_replanning(trigger=trigger, trigger_s=now_s)
        return state, (replanning.ANSWERS_AGAIN.say(trigger=trigger),)
    return state, ()


def _is_answering_again(vehicle: VehicleState, refused: DeclinedMission, now_s: float) -> bool:
    """Return whether it was received since, and is under our control."""
    known, beat_s = vehicle.assignment, vehicle.link.heartbeat_s
    if not known.stubborn or known.pending is not None or known.before is not None or vehicle.is_under_foreign_control:
        return False
    if vehicle.stage not in {Stage.GROUND, Stage.LANDED, Stage.FLYING}:
        return False
    return beat_s is not None and beat_s > refused.at_s and now_s - refused.at_s >= AGAIN_S


def is_mission_read_due(vehicle: VehicleState, now_s: float) -> bool:
    """Return whether a vehicle's mission should be read back now."""
    known, heard = vehicle.assignment, not vehicle.link.stale
    flies = vehicle.stage in {Stage.FLYING, Stage.PILOT} and known.pending is None
    return flies and heard and known.carried.is_reading_due(now_s)


def apply_mission_read(state: FleetState, found: Found, now_s: float) -> Stepped:
    """Confirm or reject a vehicle's report of a mission that was not ours."""
    vehicle = state.vehicles[found.vehicle]
    board, carried, declined = vehicle.assignment.board, vehicle.assignment.carried, vehicle.assignment.declined
    if board is None or carried.told_s is None:
        return state, ()  # ours was uploaded meanwhile
    if found.items is None and now_s - (vehicle.link.heard_s or 0.0) >= AGREEMENT_S:
        # No contact during the read-back: repeat it with contact.
        return state.put(vehicle.with_assignment(carried=replace(carried, asked_s=None))), ()
    if vehicle.assignment.stubborn and declined is not None:
        return _apply_read_of_declined(state, vehicle, declined, found, now_s)
    known = apply_mission_readback(carried, found.match_of(board.revision), now_s)
    state = state.put(vehicle.with_assignment(carried=known))
    if known.foreign_s is not None or carried.foreign_s is not None:
        return state, ()
    return state, (custody.MISSION_IS_OURS.say(vehicle=vehicle.name),)


def _apply_read_of_declined(
    state: FleetState, vehicle: VehicleState, declined: DeclinedMission, found: Found, now_s: float
) -> Stepped:
    """Apply the read-back of a vehicle whose last upload had no known end."""
    board, carried, maybe = vehicle.assignment.board, vehicle.assignment.carried, declined.maybe
    new = None if maybe is None else found.match_of(maybe.revision)
    if maybe is not None and new is not None and new.whole:
        carries = apply_onboard_mission(vehicle, maybe, now_s)
        # The plan works around it until the next one: others have its part by now.
        known = replace(carries.assignment, stubborn=True, declined=replace(declined, maybe=None))
        known = replace(known, carried=replace(known.carried, read_s=now_s))
        said = custody.MISSION_ON_BOARD.say(vehicle=vehicle.name, revision=maybe.revision)
        return state.put(replace(carries, assignment=known)), (said,)
    if found.items is None or board is None:
        unread = replace(carried, told_s=None, asked_s=None)
        declined = replace(declined, at_s=now_s, tries=declined.tries + 1)
        return state.put(vehicle.with_assignment(carried=unread, declined=declined)), ()
    looked_up = apply_mission_readback(carried, found.match_of(board.revision), now_s)
    return state.put(vehicle.with_assignment(carried=looked_up)), ()
