"""Step the flight: ``step(context, state, event, now_s) -> (state, commands)``.

All decisions about the fleet are made here. Faults are levels, evaluated on every tick; the same log of events gives
the same commands.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from types import MappingProxyType

from executor.core import launch
from executor.core.context import Context
from executor.core.formatting import format_count
from executor.core.ground import out_of_service, takeoff_offers, turnaround
from executor.core.imaging import asset_status
from executor.core.imaging import camera_faults as faults_of_cameras
from executor.core.inflight import channel_watch, climb_conflicts, homing, touchdown
from executor.core.inflight.climb_conflicts import record_separation
from executor.core.inflight.custody import mode_causes
from executor.core.inflight.faults import link_loss, warning_rules, watch_view, watchpoints
from executor.core.inflight.faults.watch_view import Watchpoint, WatchView
from executor.core.interface import events, messages
from executor.core.interface.codes import Check
from executor.core.interface.commands import AskStreams, Command, Finish, HandsOff, Level, ReadMission, Say, SendHome
from executor.core.launch import apply_upload_result
from executor.core.lines import flight, link, takeoff
from executor.core.operator import intent_handling
from executor.core.replanning import lower_to_inspection_height, replan_cycle, survivors, withdrawal
from executor.core.replanning.withdrawal import declare_fault
from executor.core.resume import link_blackout, reconciliation
from executor.core.state import legs, vehicle_position
from executor.core.state.bases import place_vehicles
from executor.core.state.fleet_state import (
    KEPT_LINES,
    Briefing,
    CrewDialogue,
    FleetState,
    LossOutlook,
    OperatorLine,
    Question,
    Stepped,
    step_each,
)
from executor.core.state.gps_loss import describe_gps_return
from executor.core.state.vehicle_parts import Assignment, ModeCause, OnboardMission, PlannedSortie, Turnaround
from executor.core.state.vehicle_state import (
    Fault,
    FaultCode,
    FaultKind,
    Stage,
    VehicleState,
    change_stage,
    current_setup_of,
)
from executor.core.telemetry import status_texts
from executor.core.telemetry.camera_reports import apply_payload_message
from executor.core.telemetry.message_update import apply_message
from executor.core.telemetry.vehicle_identity import (
    ForeignSystem,
    describe_foreign_system,
    describe_new_foreign_systems,
    is_behind_forward,
)
from missions.fences import Fence


def build_initial_state(
    boards: Mapping[str, OnboardMission | None],
    checks: tuple[Check, ...] = (),
    fences: Mapping[str, Fence] = MappingProxyType({}),
    ahead: Mapping[str, tuple[PlannedSortie, ...]] = MappingProxyType({}),
) -> FleetState:
    """Return the state before launch.

    Args:
        boards: The missions on board, or to be uploaded.
        checks: The checklist.
        fences: The fences on board, or to be uploaded.
        ahead: On a day, the sorties of each vehicle in order, the one on board first.
    """
    vehicles = MappingProxyType(
        {
            name: VehicleState(
                name,
                assignment=Assignment(board=board, fence=fences.get(name)),
                turn=Turnaround(ahead=ahead.get(name, ())),
            )
            for name, board in boards.items()
        }
    )
    return FleetState(vehicles, crew=CrewDialogue(briefing=Briefing(checks)))


def step(context: Context, state: FleetState, event: events.Event, now_s: float) -> Stepped:
    """Apply one event."""
    context = place_vehicles(context, state.vehicles.values())
    state, commands = _dispatch_event(context, state, event, now_s)
    if not commands:
        return state, commands
    at_s = round(now_s, 2)
    lines = tuple(OperatorLine(at_s, command.level, command.text) for command in commands if isinstance(command, Say))
    return (state.with_crew(said=(*state.crew.said, *lines)[-KEPT_LINES:]) if lines else state), commands


def _dispatch_event(  # noqa: C901, PLR0911, PLR0912 - one return for each kind of event
    context: Context, state: FleetState, event: events.Event, now_s: float
) -> Stepped:
    match event:
        case events.Heard():
            return _apply_message(context, state, event, now_s)
        case events.Tick():
            return _apply_tick(context, state, event.late_s, now_s)
        case events.LaunchOrdered():
            return launch.launch_fleet(context, state, now_s)
        case events.StartEnded():
            return launch.apply_start_result(context, state, event, now_s)
        case events.UploadEnded():
            return apply_upload_result(context, state, event, now_s)
        case events.SolveEnded():
            return turnaround.apply_sortie_solution(context, state, event, now_s)
        case events.Examined():
            return turnaround.apply_examination(context, state, event, now_s)
        case events.MissionsWanted():
            return replan_cycle.apply_missions_wanted(context, state, event, now_s)
        case events.LossJudged(vehicle, revision, uncovered):
            if revision != state.replanning.revision:
                return state, ()
            outlook = {**state.replanning.outlook, vehicle: LossOutlook(now_s, uncovered)}
            return state.with_replanning(outlook=MappingProxyType(outlook)), ()
        case events.IntentReceived(intent):
            return intent_handling.apply_intent(context, state, intent, now_s)
        case events.OrderEnded() | events.ReturnEnded():
            return intent_handling.apply_order_result(context, state, event, now_s)
        case events.ReturnAllOrdered():
            return intent_handling.recall_fleet(context, state, now_s)
        case events.Reopened():
            return reconciliation.apply_reopening(state, event, now_s)
        case events.MissionRead(found):
            return launch.apply_mission_read(state, found, now_s)
        case events.Resumed():
            return _resume_fleet(context, state, event, now_s)
        case events.Asked(question, text, lines):
            asked = Question(question, text, lines)
            return state.with_crew(briefing=replace(state.crew.briefing, question=asked, answered="")), ()


def _resume_fleet(context: Context, state: FleetState, event: events.Resumed, now_s: float) -> Stepped:

    def declare_strange(state: FleetState, strange: tuple[str, str]) -> Stepped:
        name, why = strange
        fault = Fault(FaultKind.INTERRUPTION, why, now_s, FaultCode.MISSION_FOREIGN)
        return declare_fault(context, state, state.vehicles[name], fault)

    taken = reconciliation.resume_fleet(context, state, event, now_s)
    state, ended = step_each(taken.state, taken.ended, lambda state, one: _dispatch_event(context, state, one, now_s))
    state, declared = step_each(state, taken.strange, declare_strange)
    return state, (*taken.commands, *ended, *declared)


def _apply_message(context: Context, state: FleetState, event: events.Heard, now_s: float) -> Stepped:
    before = state.vehicles[event.vehicle]
    if isinstance(event.message, messages.ComponentText):
        return status_texts.show_text(state, before, event.message, now_s)
    if isinstance(event.message, messages.PayloadMessage):
        return apply_payload_message(context, state, before, event.message, now_s), ()
    folded = apply_message(context, before, event.message, now_s)
    if isinstance(event.message, messages.Heartbeat):
        folded = replace(
            folded, state=mode_causes.update_mode_cause(context, state.listening.absences, before, folded.state, now_s)
        )
    elif isinstance(event.message, messages.MissionCurrent | messages.LandedState | messages.Position):
        start = context.vehicles[event.vehicle].start
        folded = replace(folded, state=legs.track_legs(before, folded.state, now_s, start))
    commands = _announce_link_findings(state, before, folded.state, event.message, now_s)
    state = state.put(folded.state)
    if folded.text is not None:
        state, more = status_texts.show_text(state, folded.state, folded.text, now_s)
        commands.extend(more)
        state, more = out_of_service.apply_kill_switch_text(state, state.vehicles[event.vehicle], folded.text, now_s)
        commands.extend(more)
    if folded.inspected is not None:
        state = asset_status.record_flown_segments(
            context, state, event.vehicle, [(folded.inspected, folded.flown)], now_s
        )
    state = asset_status.record_passed_pylons(context, state, before, now_s)
    if folded.state.assignment.runs_broken is not before.assignment.runs_broken:
        # An inferred start of the run no longer counts: the segment counts when all of it is observed.
        broken = {folded.state.assignment.runs_broken[-1][0]} - set(state.coverage.inspected)
        state = state.with_coverage(inferred=state.coverage.inferred - broken)
    if isinstance(event.message, messages.Position):
        state = record_separation(context, state, folded.state, now_s)
    # Only a HEARTBEAT shows mode and arming; the last one is from before the silence.
    if isinstance(event.message, messages.Heartbeat):
        state, more = _apply_heartbeat(context, state, before, now_s)
        commands.extend(more)
    return state, tuple(commands)


FORWARD = "[forward]"
"""Subject of a line about stations behind all vehicles."""


def _announce_link_findings(
    state: FleetState, before: VehicleState, after: VehicleState, message: messages.Message, now_s: float
) -> list[Command]:
    """Report other systems on its link and their actions, and that GPS is regained."""
    known, now, said = before.link.strangers, after.link.strangers, list[Command]()
    if now is not known:
        behind = frozenset(filter(is_behind_forward, now))
        new = describe_new_foreign_systems(known, now - behind)
        said += [flight.FOUND.say(vehicle=after.name, found=found) for found in new]
        # A station behind all vehicles is reported once.
        known = frozenset[ForeignSystem]().union(*(one.link.strangers for one in state.vehicles.values()))
        said += [flight.FOUND.say(vehicle=FORWARD, found=one) for one in describe_new_foreign_systems(known, behind)]
    if isinstance(message, messages.StationActed) and message.passed:
        whose = after.name if message.system else FORWARD
        said.append(flight.FOUND.say(vehicle=whose, found=describe_foreign_system(message)))
    if regained := describe_gps_return(before, after, now_s):
        said.append(flight.FOUND.with_level(Level.INFO).say(vehicle=after.name, found=regained))
    return said


def _apply_heartbeat(context: Context, state: FleetState, before: VehicleState, now_s: float) -> Stepped:
    vehicle = state.vehicles[before.name]
    commands: tuple[Command, ...] = ()
    if vehicle.custody.cause is ModeCause.PERSON and before.custody.cause is not ModeCause.PERSON:
        commands = (HandsOff(vehicle.name),)  # in any case no more commands are sent to it
        if vehicle.stage is Stage.STARTING:
            state = state.put(vehicle.with_orders(start_let_go=True))
    if before.stage is Stage.LOST:
        state, more = _recover_lost_vehicle(context, state, vehicle, now_s)
        if state.progress.finished:  # it is received at the moment the flight ended without it
            state = state.with_progress(finished=False)
        return state, (*commands, *more)
    return state, commands


def _recover_lost_vehicle(context: Context, state: FleetState, vehicle: VehicleState, now_s: float) -> Stepped:
    """Keep a vehicle whose segments were reassigned from continuing them, in the air or on the ground."""
    name = vehicle.name
    if vehicle.armed and vehicle.is_under_foreign_control:
        state, more = withdrawal.apply_takeover(context, state, vehicle)
        return state, (link.LOST_REGAINED.say(vehicle=name), *more)
    if vehicle.armed:
        vehicle = change_stage(vehicle, Stage.RETURNING).with_motion(anchor=None).with_sortie(left_s=now_s)
        state, more = homing.bring_home(context, state, vehicle, now_s)
        comes = homing.is_coming_home(context, vehicle)
        return state, ((link.LOST_REGAINED_COMING if comes else link.LOST_REGAINED_ALOFT).say(vehicle=name), *more)
    if not vehicle_position.is_over_pad(context, vehicle):
        down = change_stage(vehicle, Stage.DOWN).with_orders(ordered_mode_s=now_s).with_sortie(place_told=True)
        place = vehicle_position.describe_down_place(context, vehicle)
        return state.put(down), (link.LOST_REGAINED_DOWN.say(vehicle=name, place=place),)
    state = state.put(change_stage(vehicle, Stage.LANDED).with_orders(ordered_mode_s=now_s))
    if not homing.is_on_mission(context, vehicle):
        return state, (link.LOST_REGAINED_ON_GROUND.say(vehicle=name, then=""),)
    # Armed in this mode it would fly its old mission: neither autopilot takes off for an RTL.
    if vehicle.custody.taken is not None:
        line = link.LOST_REGAINED_ON_GROUND.with_level(Level.WARNING)
        return state, (line.say(vehicle=name, then=link.PILOT_HAS_IT),)
    return state, (link.LOST_REGAINED_ON_GROUND.say(vehicle=name, then=link.SET_TO_RTL), SendHome(name))


def _check_all_vehicles(context: Context, state: FleetState, now_s: float) -> Stepped:
    return step_each(state, state.vehicles, lambda state, name: _check_vehicle(context, state, name, now_s))


def _check_vehicle(context: Context, state: FleetState, name: str, now_s: float) -> Stepped:
    vehicle = state.vehicles[name]
    alone = state.listening.silent_since_s is not None and link_blackout.may_be_airborne(context, vehicle, now_s)
    if vehicle.is_at_rest:
        return _check_grounded_vehicle(context, state, vehicle, now_s)
    if vehicle.stage is Stage.LOST:
        return state, ()
    commands: list[Command] = []
    state, more = link_loss.check_link(context, state, vehicle, now_s)
    commands.extend(more)
    if vehicle.link.stale and not state.vehicles[name].link.stale:
        state = replan_cycle.replan_for_regained_link(state, state.vehicles[name], now_s)
    taken_up = link_blackout.recover_after_silence(context, state, state.vehicles[name], now_s)
    if taken_up is not None:
        state, more = taken_up
        commands.extend(more)
    vehicle = mode_causes.review_mode_cause(context, state.listening.absences, state.vehicles[name], now_s)
    setup = current_setup_of(context, vehicle)
    view = WatchView(context, setup, vehicle, False, now_s)
    told, lines = warning_rules.find_new_warnings(view, state.crew.told.get(name, ()))
    if told is not state.crew.told.get(name):
        state = state.with_crew(told=MappingProxyType({**state.crew.told, name: told}))
    commands.extend(flight.NOT_WELL.say(line=line) for line in lines)
    ours = vehicle.stage is not Stage.PILOT and not vehicle.is_under_foreign_control
    if ours and (missing := watch_view.list_streams_to_ask(view)) is not None:
        vehicle = vehicle.with_orders(streams_asked_s=now_s)
        commands.append(AskStreams(name, missing))
    if launch.is_mission_read_due(vehicle, now_s):
        vehicle = vehicle.with_assignment(carried=replace(vehicle.assignment.carried, asked_s=now_s))
        commands.append(ReadMission(name))
    vehicle, raised = watchpoints.judge_watchpoints(context, setup, vehicle, now_s)
    state = state.put(vehicle)
    raised = [(point, why) for point, why in raised if not (alone and point.kind is FaultKind.LINK)]
    if taken_up is None:
        raised = [(point, why) for point, why in raised if point.kind is FaultKind.LINK]
        if not raised:
            return state, tuple(commands)  # it has not reported its activity yet
    state, more = _decide_vehicle(context, state, vehicle, raised, now_s)
    commands.extend(more)
    state, more = _report_unproven_segment(context, state, name)
    return state, (*commands, *more)


def _decide_vehicle(  # noqa: PLR0911 - one return for each thing
    context: Context, state: FleetState, vehicle: VehicleState, raised: list[tuple[Watchpoint, str]], now_s: float
) -> Stepped:
    """Decide one thing at a time, the most important first."""
    name = vehicle.name
    lost = next((why for point, why in raised if point.kind is FaultKind.LINK), "")
    if vehicle.stage is not Stage.PILOT and mode_causes.is_taken_over(vehicle, now_s) and not lost:
        return withdrawal.apply_takeover(context, state, vehicle)
    if vehicle.stage is Stage.FLYING and vehicle.assignment.carried.is_surely_foreign(now_s) and not lost:
        return withdrawal.apply_takeover(context, state, vehicle)
    left_its_mission = bool(raised) and raised[0][0].code is FaultCode.MODE_CHANGED
    if left_its_mission and mode_causes.is_gcs_absence_failsafe(context, state.listening.absences, vehicle, now_s):
        return _return_after_absence(context, state, vehicle, now_s)
    if vehicle.fault is not None:
        # The first reason stands. A later one only changes where the vehicle counts as being, and hides nothing.
        stopped = vehicle.sortie.armed_once and not vehicle.armed and not vehicle.orders.lands
        is_down = stopped and not vehicle_position.is_over_pad(context, vehicle)
        raised = [(point, why) for point, why in raised if is_down or point.kind is FaultKind.LINK]
    if raised:
        point, why = raised[0]
        return _apply_fault(context, state, vehicle, Fault(point.kind, why, now_s, point.code))
    if why := touchdown.describe_unexpected_landing(context, vehicle, now_s):
        return _report_down_vehicle(context, state, vehicle, why, now_s)
    if vehicle.stage is Stage.PILOT:
        return withdrawal.monitor_taken_vehicle(context, state, vehicle, now_s)
    if vehicle.stage is Stage.STARTING:
        return launch.monitor_start(context, state, vehicle, now_s)
    if vehicle.sortie.armed_once and not vehicle.armed and vehicle.stage in {Stage.FLYING, Stage.RETURNING}:
        return _apply_landing(context, state, vehicle, now_s)
    return homing.issue_homing_order(context, state, name, now_s)


def _apply_landing(context: Context, state: FleetState, vehicle: VehicleState, now_s: float) -> Stepped:
    """Take a disarmed vehicle as on the ground once it is seen at rest."""
    if not vehicle_position.is_resting_place_known(vehicle, now_s):
        return state, ()
    spare = survivors.build_pad_survivor(context, state, vehicle).budget_pct > 0.0
    state, commands = touchdown.apply_touchdown(context, state, vehicle, now_s, spare=spare)
    waits = turnaround.describe_awaited_sortie(context, state, state.vehicles[vehicle.name], now_s)
    return state, (*commands, takeoff.AWAITS_SORTIE.say(vehicle=vehicle.name, waits=waits)) if waits else commands


def _check_grounded_vehicle(context: Context, state: FleetState, vehicle: VehicleState, now_s: float) -> Stepped:
    if state.progress.launched_s is None:
        return state, ()
    if vehicle.stage is Stage.DOWN:
        if not vehicle.armed and not vehicle.sortie.place_told and vehicle_position.is_at_rest(vehicle, now_s):
            state = state.put(vehicle.with_sortie(place_told=True))
            place = vehicle_position.describe_down_place(context, vehicle)
            return state, (takeoff.DOWN_AT.say(vehicle=vehicle.name, place=place),)
        if not touchdown.is_flying_again(vehicle):
            return state, ()
        return _bring_home_flying_vehicle(context, state, vehicle, "down", now_s)
    if vehicle.armed and mode_causes.is_taken_over(vehicle, now_s):
        return withdrawal.apply_takeover(context, state, vehicle)
    if mode_causes.has_never_landed(context, vehicle):
        return _bring_home_flying_vehicle(context, state, vehicle, "landed", now_s)
    if vehicle.armed and mode_causes.may_arm_late(vehicle, now_s) and vehicle.custody.cause is ModeCause.OURS:
        return state.put(change_stage(vehicle, Stage.RETURNING)), (takeoff.ARMED_LATE.say(vehicle=vehicle.name),)
    return state, ()


def _bring_home_flying_vehicle(
    context: Context, state: FleetState, vehicle: VehicleState, taken_for: str, now_s: float
) -> Stepped:
    """Return a vehicle that counted as on the ground and flies: its segments were reassigned."""
    position = vehicle_position.describe_last_position(context, vehicle, now_s)
    said = takeoff.FLIES_AGAIN.say(vehicle=vehicle.name, taken_for=taken_for, position=position)
    back = change_stage(vehicle, Stage.RETURNING).with_motion(anchor=None).with_sortie(left_s=now_s)
    state, more = homing.bring_home(context, state, back, now_s)
    return state, (said, *more)


def _report_down_vehicle(context: Context, state: FleetState, vehicle: VehicleState, why: str, now_s: float) -> Stepped:
    if vehicle.fault is None:
        return declare_fault(context, state, vehicle, Fault(FaultKind.DOWN, why, now_s, FaultCode.DOWN))
    lies = change_stage(vehicle, Stage.DOWN).with_orders(errand=None).with_sortie(place_told=True)
    lies = lies.with_motion(anchor=vehicle.motion.fix)
    return state.put(lies), (takeoff.DOWN_AT.say(vehicle=vehicle.name, place=why),)


def _report_unproven_segment(context: Context, state: FleetState, name: str) -> Stepped:
    """Report that an inspection does not count, once its vehicle has left the segment."""
    vehicle, board = state.vehicles[name], state.vehicles[name].assignment.board
    if vehicle.assignment.owed is None or board is None:
        return state, ()
    visit, why = vehicle.assignment.owed
    ahead = any(point.visit == visit for point in board.path.waypoints[vehicle.assignment.waypoint :])
    if ahead and vehicle.stage in {Stage.FLYING, Stage.PILOT}:
        return state, ()
    segment, broken = board.tracks[visit].segment, vehicle.assignment.runs_broken
    if state.coverage.inspected.get(segment) == name:
        # It overshot the first pylon, and joined the line anew.
        broken = tuple(one for one in broken if one != (segment, why))
    state = state.put(vehicle.with_assignment(owed=None, runs_broken=broken))
    if segment in state.coverage.inspected:
        return state, ()
    return state, (flight.UNPROVEN.say(vehicle=name, segment=context.segment_name(segment), why=why),)


def _return_after_absence(context: Context, state: FleetState, vehicle: VehicleState, now_s: float) -> Stepped:
    """Return a vehicle whose failsafe acted on our absence: it is sound, and may fly again.

    Its mission is not resumed in the air: both autopilots drop the speed at a mode change (measured).
    """
    vehicle = change_stage(vehicle, Stage.RETURNING).with_assignment(run=None)
    vehicle = vehicle.with_motion(anchor=None).with_sortie(left_s=now_s)
    state, more = homing.bring_home(context, state, vehicle, now_s)
    trigger = flight.ENDED_IN_ABSENCE.format(vehicle=vehicle.name)
    return state.want_replan(trigger, now_s), (flight.RETURNING.say(trigger=trigger), *more)


def _apply_fault(context: Context, state: FleetState, vehicle: VehicleState, fault: Fault) -> Stepped:
    if vehicle.fault is None:
        return declare_fault(context, state, vehicle, fault)
    position = vehicle_position.describe_last_position(context, vehicle, fault.detected_s)
    stage, line = Stage.DOWN, flight.FAULT_AGAIN
    if fault.kind is FaultKind.LINK:
        stage, line = Stage.LOST, line.with_level(Level.WARNING)
    place_told = vehicle.sortie.place_told and stage is Stage.LOST
    vehicle = change_stage(vehicle.with_orders(errand=None), stage).with_sortie(place_told=place_told)
    return state.put(vehicle), (line.say(vehicle=vehicle.name, reason=fault.reason, position=position),)


def _finish_flight_if_over(context: Context, state: FleetState, now_s: float) -> Stepped:
    waiting = {Stage.STARTING, Stage.FLYING, Stage.RETURNING, Stage.PILOT}
    if state.progress.finished or state.progress.launched_s is None or state.replanning.replan is not None:
        return state, ()
    if any(vehicle.stage in waiting for vehicle in state.vehicles.values()) or state.crew.offer is not None:
        return state, ()
    awaited = lower_to_inspection_height.is_clearance_awaited(context, state, now_s)
    if awaited or turnaround.find_awaited_vehicles(context, state, now_s):
        return state, ()
    if not state.progress.recalled and replan_cycle.find_orphan_segments(context, state):
        return state, ()
    missing = context.segments - len(state.coverage.inspected)
    reason = flight.ALL_INSPECTED
    if missing:
        reason = flight.NOT_INSPECTED.format(segments=format_count(missing, "segment"))
    if left := state.coverage.left_over - set(state.coverage.inspected):
        reason += flight.NEXT_SORTIE.format(count=len(left))
    return state.with_progress(finished=True), (Finish(reason),)


@dataclass(frozen=True, slots=True)
class TickPhase:
    """One part of a tick."""

    name: str
    act: Callable[[Context, FleetState, float], Stepped]
    why_here: str
    """What it needs from earlier phases, and what later ones need from it."""


PHASES: tuple[TickPhase, ...] = (
    TickPhase(
        "host pause", link_loss.discount_host_pause,
        "First: each silence is counted from when a link was last heard, and a pause of our own must not count.",
    ),
    TickPhase(
        "loss of all links", link_loss.check_all_links,
        "Before the vehicles: while all are silent none is declared lost that may still fly, and no re-plan begins.",
    ),
    TickPhase(
        "gap in the tracks", link_blackout.record_blackout,
        "After the loss of all links: needs to know since when. Before the vehicles: one with a gap is judged by its "
        "link alone until it has said what it flew meanwhile.",
    ),
    TickPhase(
        "vehicles", _check_all_vehicles,
        "After the loss of all links: needs to know whether one is silent or all are. Before the re-plan, and all else "
        "that plans or commands: it goes by the stages and faults that are set here.",
    ),
    TickPhase(
        "radios", channel_watch.watch_channels,
        "After the vehicles: one that its pilot has taken, or that is silent, is asked for nothing, and one that was "
        "asked just now for what is missing is not asked in the same tick.",
    ),
    TickPhase(
        "pictures", asset_status.judge_pictures,
        "After the vehicles: only those in the air with a link are asked again. Before the re-plan: a segment "
        "flown without its pictures is open.",
    ),
    TickPhase(
        "cameras", faults_of_cameras.check_cameras,
        "After the vehicles: a vehicle's first fault stands. After the pictures: what they have just shown is not "
        "reassigned.",
    ),
    TickPhase(
        "missions offered again", launch.retry_declined_missions,
        "After the vehicles: one that is lost is offered none. Before the re-plan: it begins in this tick, with the "
        "vehicle that answers again.",
    ),
    TickPhase(
        "re-plan", replan_cycle.begin_replan,
        "After the vehicles, pictures, cameras and missions offered again: one re-plan serves all that they open.",
    ),
    TickPhase(
        "asked distance", lower_to_inspection_height.lower_one_vehicle,
        "After the re-plan: open segments come before a nearer look, and only one re-plan is under way at a time.",
    ),
    TickPhase(
        "climbs", climb_conflicts.avoid_climbs,
        "After the vehicles and the cameras: an RTL commanded in this tick is already a climb to give way to.",
    ),
    TickPhase(
        "turnarounds", turnaround.advance_turnarounds,
        "After the re-plan and the asked distance: a sortie can wait on its base, a vehicle in the air cannot.",
    ),
    TickPhase(
        "starts", launch.retry_waiting_starts,
        "After the vehicles: one that has just left its start, to its pilot or by a fault, is not started again.",
    ),
    TickPhase(
        "status texts", status_texts.report_suppressed_texts,
        "Needs no other phase and none needs it: it only counts lines, so it comes after all that command vehicles.",
    ),
    TickPhase(
        "take-off offers", takeoff_offers.update_offers,
        "After the re-plan and the asked distance: it offers only what these leave. Before the end of flight: that "
        "waits for the crew's answer.",
    ),
    TickPhase(
        "operator intents", intent_handling.settle_intents,
        "After the vehicles and the re-plan: a new stage, or nothing to plan, ends an intent. Before the end of "
        "flight: it may be the last tick.",
    ),
    TickPhase(
        "end of flight", _finish_flight_if_over,
        "Last: the flight ends only if no phase has found anything more to fly, to plan or to ask.",
    ),
)  # fmt: skip
"""The phases of a tick, in order."""


def _apply_tick(context: Context, state: FleetState, late_s: float, now_s: float) -> Stepped:
    state = state.with_listening(late_s=late_s)
    return step_each(state, PHASES, lambda state, phase: phase.act(context, state, now_s))
