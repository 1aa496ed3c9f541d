"""Reconcile a resumed flight: complete what was under way when the ground station went offline.

The log has the decisions; the vehicles report their missions and positions. Where they disagree, the mission on board
holds, provided it is one that was decided.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

from executor.core.battery.voltage import VoltageState
from executor.core.context import Context, RelaunchPolicy
from executor.core.ground import turnaround
from executor.core.inflight.homing import bring_home, is_on_mission
from executor.core.interface.codes import Ending
from executor.core.interface.commands import Command, Start, Upload
from executor.core.interface.events import Event, Found, Match, Reopened, Resumed, StartEnded, UploadEnded
from executor.core.lines import replanning, resume
from executor.core.replanning import replan_cycle, survivors
from executor.core.replanning.withdrawal import leave_plan, withdraw_vehicle
from executor.core.resume.link_blackout import catch_up_mission
from executor.core.state.fleet_state import FleetState, GroundStationAbsence, NewMission, Replan, Stepped
from executor.core.state.link_quality import LinkQuality
from executor.core.state.vehicle_state import Stage, VehicleState, build_onboard_mission, change_stage, last_known_of
from missions import MissionItem, count_common_items, encode
from planner import segment_of

FLOWN_CHARGE_PCT = 3.0
"""Charge used since the start command above which a vehicle on the ground has flown."""


@dataclass(frozen=True, slots=True)
class Resumption:
    """The step that follows once all vehicles, or one, were read."""

    state: FleetState
    commands: tuple[Command, ...] = ()
    ended: tuple[Event, ...] = ()
    """Events that ended during the absence, as if received now."""
    strange: tuple[tuple[str, str], ...] = ()
    """(vehicle, reason) of those whose mission on board must not continue."""
    again: tuple[Command, ...] = ()
    """For one vehicle: the commands that resend a mission, if it is still wanted."""


def apply_reopening(state: FleetState, event: Reopened, now_s: float) -> Stepped:
    """Start listening again; no time-out counts the absence."""
    for vehicle in state.vehicles.values():
        state = state.put(
            replace(vehicle, watches=())
            .with_assignment(before=vehicle.assignment.before or last_known_of(vehicle), run=None)
            .with_orders(errand=None if vehicle.orders.errand is None else replace(vehicle.orders.errand, told=False))
            .with_link(
                heard_s=None if vehicle.link.heard_s is None else now_s,
                heartbeat_s=None,
                excused_s=now_s,
                stale=False,
                quality=LinkQuality(),
            )
            .with_motion(anchor=None, reopened=True)
            .with_power(volts=VoltageState(highest_v=vehicle.power.volts.highest_v))
        )
    absences = (*state.listening.absences, GroundStationAbsence(now_s, event.away_s, restarted=True))
    state = state.with_listening(tick_s=None, silent_since_s=None, absences=absences)
    said = resume.RUNS_AGAIN.say(away_s=event.away_s)
    return state, (said, *(resume.NOTE.say(note=note) for note in event.notes))


def compare_onboard_mission(
    context: Context, state: FleetState, name: str, items: Sequence[MissionItem] | None, seq: int | None
) -> Found:
    """Compare the items read from a vehicle with every mission that the log may have given it.

    `items` are on board, None if unreadable; `seq` is its current item.
    """
    given, plan, dialect = state.vehicles[name].assignment, state.replanning.replan, context.vehicles[name].dialect
    boards = (given.board, None if given.declined is None else given.declined.maybe)
    paths = {board.revision: board.path for board in boards if board is not None}
    if plan is not None and name in plan.missions:
        paths[plan.solve.revision] = plan.missions[name].path
    matches = []
    for revision, path in paths.items() if items is not None else ():
        ours = encode(path, dialect).items
        same = count_common_items(ours, items or (), dialect)
        matches.append(Match(revision, same, whole=same == len(ours) == len(items or ())))
    return Found(name, True, seq, None if items is None else len(items), tuple(matches))


def _drop_waiting_missions(state: FleetState, plan: Replan, now_s: float) -> FleetState:
    """Plan again for vehicles that wait for others' new missions: the paths may be out of date by now."""
    for route in plan.unmade:
        if route.vehicle in plan.pending:
            state, plan, _ = replan_cycle.drop_late_mission(state, plan, route.vehicle, replanning.FLEW_ON, now_s)
    return state.with_replanning(replan=replace(plan, unmade=()))


def resume_fleet(context: Context, state: FleetState, event: Resumed, now_s: float) -> Resumption:
    """Resume every vehicle from its present state."""
    state = _correct_absence(state, event)
    plan = state.replanning.replan
    if plan is not None and plan.solve_s is None:
        state = replan_cycle.request_replan_again(state, plan)  # the solver ended with the ground station
    elif plan is not None and plan.unmade and plan.low:
        state = _drop_waiting_missions(state, plan, now_s)
    elif plan is not None and plan.unmade:
        state = state.with_replanning(replan=replan_cycle.build_all_missions(context, state, plan))
    state, said = turnaround.end_turnarounds_after_absence(state, now_s)
    commands: list[Command] = [*said]
    ended: list[Event] = []
    strange: list[tuple[str, str]] = []
    again: dict[str, tuple[Command, ...]] = {}
    for found in event.found:
        if not found.heard:
            commands.append(resume.SILENT.say(vehicle=found.vehicle))
            state = state.put(state.vehicles[found.vehicle].with_assignment(before=None))
            ended += _end_unanswered_upload(context, state, found.vehicle)
            continue
        one = _resume_vehicle(context, state, found, now_s)
        state = one.state
        commands += one.commands
        ended += one.ended
        strange += one.strange
        if one.again:
            again[found.vehicle] = one.again
    for found in event.found:
        if found.vehicle in again:
            state, more = _resend_mission(context, state, found, again[found.vehicle], now_s)
            commands += more
    return Resumption(state, tuple(commands), tuple(ended), tuple(strange))


def _correct_absence(state: FleetState, event: Resumed) -> FleetState:
    """Correct the length of the absence by the vehicles' clocks; the computer's may have been set."""
    heard = {found.vehicle for found in event.found if found.heard}
    gaps = [
        vehicle.motion.fix.boot_s - vehicle.assignment.before.fix.boot_s
        for vehicle in state.vehicles.values()
        if vehicle.name in heard and vehicle.motion.fix is not None and vehicle.assignment.before is not None
    ]
    if not state.listening.absences or not gaps:
        return state
    last = state.listening.absences[-1]
    return state.with_listening(
        absences=(*state.listening.absences[:-1], replace(last, pause_s=max(last.pause_s, *gaps)))
    )


def _end_unanswered_upload(context: Context, state: FleetState, name: str) -> tuple[Event, ...]:
    """Return the end of an upload to a vehicle that does not answer, so that no other vehicle waits for it.

    How much is on board is unknown; PX4 at least has one of the two missions whole.
    """
    plan = state.replanning.replan
    if plan is None or name not in plan.pending:
        return ()
    mixed = not plan.missions[name].fresh and not context.vehicles[name].dialect.upload_is_atomic
    return (UploadEnded(name, plan.solve.revision, False, mixed, resume.NO_ANSWER, Ending.NO_ANSWER),)


def _resume_vehicle(context: Context, state: FleetState, found: Found, now_s: float) -> Resumption:
    vehicle, plan = state.vehicles[found.vehicle], state.replanning.replan
    if plan is not None and found.vehicle in plan.pending:
        if vehicle.stage is not Stage.STARTING:
            return _finish_upload(context, state, plan, found, now_s)
        if not _has_started(context, vehicle):
            return _handle_unstarted_vehicle(context, state, vehicle, now_s, ours=False)
        taken = _finish_upload(context, state, plan, found, now_s)
        return replace(taken, ended=(StartEnded(found.vehicle, accepted=True, reason=""), *taken.ended))
    seen = state.put(vehicle.with_assignment(before=None))
    if vehicle.stage not in {Stage.STARTING, Stage.FLYING} or vehicle.assignment.board is None:
        return Resumption(seen)
    match = found.match_of(vehicle.assignment.board.revision)
    other = match is not None and not match.whole
    if match is not None and other and vehicle.armed:
        return Resumption(seen, strange=((found.vehicle, resume.OTHER_MISSION.format(item=match.alike)),))
    if vehicle.stage is Stage.STARTING and _has_started(context, vehicle):
        return Resumption(seen, ended=(StartEnded(found.vehicle, accepted=True, reason=""),))
    if vehicle.stage is Stage.STARTING:
        return _handle_unstarted_vehicle(context, state, vehicle, now_s, ours=not other)
    state, said = catch_up_mission(context, state, vehicle, vehicle.assignment.board, found.seq)
    return Resumption(state, said)


def _finish_upload(context: Context, state: FleetState, plan: Replan, found: Found, now_s: float) -> Resumption:
    """Complete an upload that was under way, about to begin, or over without our knowledge."""
    vehicle, mission = state.vehicles[found.vehicle], plan.missions[found.vehicle]
    revision = plan.solve.revision
    new = found.match_of(revision)
    board = vehicle.assignment.board
    said: tuple[Command, ...] = ()
    if new is not None and new.whole:
        # Its fence was uploaded before it.
        fenced = mission.fence is not None
        ended = (UploadEnded(found.vehicle, revision, accepted=True, mixed=False, reason="", fenced=fenced),)
        if not mission.fresh:
            board = build_onboard_mission(context, found.vehicle, revision, mission.path, mission.visits)
            state, said = catch_up_mission(context, state, vehicle, board, found.seq)
        return Resumption(state, said, ended)
    old = None if board is None else found.match_of(board.revision)
    if not mission.fresh and board is not None and (old is None or old.whole):
        state, said = catch_up_mission(context, state, vehicle, board, found.seq)
        offer = next(one for one in plan.solve.survivors if one.vehicle == found.vehicle)
        if not survivors.is_offer_valid(state.vehicles[found.vehicle], offer):
            state, more = replan_cycle.release_vehicle(state, plan, found.vehicle, replanning.FLEW_ON, now_s)
            return Resumption(state, (*said, *more))
    elif (
        not mission.fresh and new is not None and _is_at_end_of_new_part(found, new) and is_on_mission(context, vehicle)
    ):
        # In any other mode its own failsafe takes precedence: a landing must not become a return flight.
        return _return_stranded_vehicle(context, state, found, mission, revision, now_s)
    elif not mission.fresh and (new is None or found.seq is None or found.seq >= new.alike):
        over = UploadEnded(found.vehicle, revision, False, True, resume.PAST_NEW_PART, Ending.READ_BACK_DIFFERS)
        return Resumption(state, ended=(over,))
    state = state.put(state.vehicles[found.vehicle].with_assignment(before=None))
    # Whether the wider fence is on board is unknown: upload it again, then the mission.
    again = Upload(found.vehicle, revision, mission.path, not mission.fresh, mission.fence)
    return Resumption(state, said, again=(resume.UPLOADED_AGAIN.say(vehicle=found.vehicle, revision=revision), again))


def _is_at_end_of_new_part(found: Found, new: Match) -> bool:
    """Return whether a vehicle flies to the last item common with the new mission, or hovers there.

    ArduPilot then reports its mission complete: a later upload does not move it, and a command that would starts the
    list from the beginning. Item 0 is home, never flown to, and is reported after the end.
    """
    return found.items == new.alike and found.seq is not None and (found.seq == 0 or found.seq >= new.alike - 1)


def _return_stranded_vehicle(
    context: Context, state: FleetState, found: Found, mission: NewMission, revision: int, now_s: float
) -> Resumption:
    """Return a vehicle to its pad whose mission was cut short by our absence: it is sound, and may fly again."""
    vehicle = state.vehicles[found.vehicle]
    board = build_onboard_mission(context, found.vehicle, revision, mission.path, mission.visits)
    state, said = catch_up_mission(context, state, vehicle, board, found.seq)
    trigger = resume.AT_END.format(vehicle=found.vehicle)
    left = leave_plan(state.vehicles[found.vehicle], Stage.RETURNING, now_s)
    state, told = bring_home(context, state.put(left), left, now_s)
    state, more = withdraw_vehicle(state, found.vehicle, trigger, now_s)
    return Resumption(state, (*said, resume.BROUGHT_HOME.say(trigger=trigger), *more, *told))


def _resend_mission(
    context: Context, state: FleetState, found: Found, again: tuple[Command, ...], now_s: float
) -> Stepped:
    """Resend a mission, unless others have flown part of it meanwhile and the vehicle can be released."""
    name, plan = found.vehicle, state.replanning.replan
    if plan is None:
        return state, again
    vehicle, mission = state.vehicles[name], plan.missions[name]
    flown = {
        segment for visit in mission.visits if state.coverage.inspected.get(segment := segment_of(visit), name) != name
    }
    old = None if vehicle.assignment.board is None else found.match_of(vehicle.assignment.board.revision)
    if not flown or not (mission.fresh or (old is not None and old.whole)):
        return state, again
    why = resume.FLOWN_BY_OTHERS.format(segments=replan_cycle.format_segments(context, frozenset(flown)))
    return replan_cycle.release_vehicle(state, plan, name, why, now_s)


def _has_started(context: Context, vehicle: VehicleState) -> bool:
    """Return whether a vehicle commanded to take off has done so, or is about to."""
    fix = vehicle.motion.fix
    if not vehicle.armed or fix is None:
        return False
    return is_on_mission(context, vehicle) or fix.alt_rel_m > context.limits.airborne_m


def _handle_unstarted_vehicle(
    context: Context, state: FleetState, vehicle: VehicleState, now_s: float, *, ours: bool
) -> Resumption:
    """Handle a vehicle that was commanded to take off, and is on the ground.

    If its mission is not `ours`, it waits for the next re-plan as others do.
    """
    name = vehicle.name
    vehicle = vehicle.with_assignment(before=None)
    state = state.put(vehicle)
    had_pct, has_pct = vehicle.power.began_pct, vehicle.power.battery.remaining_pct
    lost_pct = 0.0 if had_pct is None or has_pct is None else had_pct - has_pct
    flown = not vehicle.armed and lost_pct > FLOWN_CHARGE_PCT
    if vehicle.armed and (context.fly_again is not RelaunchPolicy.AUTO or not ours):
        # The crew's clearance is from before: a person may be at the pad by now.
        return Resumption(state, strange=((name, resume.WAS_ARMED),))
    if context.fly_again is RelaunchPolicy.AUTO and ours and not flown:
        state = state.put(vehicle.with_orders(ordered_mode_s=now_s))
        return Resumption(state, (resume.TRIED_AGAIN.say(vehicle=name), Start(name)))
    said = (resume.HAS_FLOWN if flown else resume.STAYS).say(vehicle=name, lost_pct=lost_pct)
    plan = state.replanning.replan
    # It does not clear a start planned later either.
    state = state.put(change_stage(vehicle.with_orders(cleared_s=None), Stage.LANDED if flown else Stage.GROUND))
    if plan is None or name not in plan.pending:
        return Resumption(state, (said,))
    why = resume.LANDED_BEFORE if flown else resume.UNSTARTED_BEFORE
    state, more = replan_cycle.release_vehicle(state, plan, name, why, now_s)
    return Resumption(state, (said, *more))
