"""Fold one message of a vehicle into its state: position, battery, link, inspections."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

from executor.core.battery import account
from executor.core.context import Scene
from executor.core.interface import messages
from executor.core.interface.messages import BOOT, CRITICAL, FlightMessage, StatusText
from executor.core.lines import inspection
from executor.core.state import gps_loss, link_quality, mission_height, mission_ownership, vehicle_position
from executor.core.state.inspection_proof import GAP_S, SLOWED_GAP_S, PositionSample, SegmentPass, advance_run
from executor.core.state.link_quality import ReportedPosition, add_reported_position
from executor.core.state.vehicle_parts import Assignment, LinkState, MotionState, PositionFix, Positioning
from executor.core.state.vehicle_state import Stage, VehicleState, is_slowed_by_us, last_known_of
from executor.core.telemetry import mode_evidence
from executor.core.telemetry.battery_reports import apply_battery_status, apply_pack_setting, apply_system_status
from executor.core.telemetry.mode_evidence import ALARM, EXPLAINS_DISARMING, STOPS_MOTORS
from executor.core.telemetry.vehicle_identity import add_foreign_system
from missions import Phase
from missions.autopilots.dialect import is_mission_mode
from planner import CLIMB_SHARE_PER_M_S

OVERTAKEN_S = 60.0
"""Step back in a position's time below which it was overtaken in transit; a larger one, or one after a silence, is a
reboot."""
CLOCK_LOSS_S = 5.0
"""Loss of the vehicle's clock over a gap that is more than a slow link: a rebooted autopilot may already report a later
time than before."""
LONGEST_SILENCE_S = 600.0
"""Longest gap of its own clock over which consumption is modelled; in a longer one it may have landed and been
charged."""
_MAY_FLY_MISSION = frozenset({Stage.FLYING, Stage.STARTING, Stage.PILOT, Stage.LOST})
"""Stages in which the index counts: a pilot may have returned it to its mission, and a lost vehicle may still fly
it."""
REASON_S = 5.0
"""Time after the text with a reason in which PX4 reports its action: "Failsafe activated: switching to Return"."""
WITHOUT_FIX = inspection.WITHOUT_FIX.format(gap_s=GAP_S)
"""The reason of an inspection that does not count because its positions are dead-reckoned."""
JUMP_GAP_S = 10.0
"""Longest gap over which a position can show a jump."""


@dataclass(frozen=True, slots=True)
class MessageEffect:
    """A vehicle after a message, with the segment that it proved inspected."""

    state: VehicleState
    inspected: int | None = None
    flown: SegmentPass | None = None
    """The figures of the segment."""
    text: StatusText | None = None


def apply_message(  # noqa: C901, PLR0912 - one case for each kind of message
    context: Scene, state: VehicleState, message: FlightMessage, now_s: float
) -> MessageEffect:
    """Apply one message to the state."""
    if isinstance(message, messages.PayloadMessage):
        return MessageEffect(state)  # camera messages are no contact with the autopilot; see `camera_reports`
    if isinstance(message, messages.LinkMessage):
        return MessageEffect(_apply_link_report(context, state, message, now_s))
    if isinstance(message, messages.EvidenceMessage):
        return MessageEffect(_apply_evidence(state, message, now_s))
    silent = state.link.spoke_s is not None and now_s - state.link.spoke_s >= context.limits.link_stale_s
    regained_s = now_s if silent else state.link.regained_s
    link = replace(state.link, heard_s=now_s, spoke_s=now_s, regained_s=regained_s)
    sensors, telemetry = state.sensors, state.telemetry
    match message:
        case messages.Heartbeat():
            after = _apply_heartbeat(context, state, link, message, now_s)
        case messages.Position():
            link = _update_link_position(link, state.name, message, now_s, context)
            return _apply_position(context, state, link, message, now_s)
        case messages.Battery():
            after = replace(state, link=link, power=apply_battery_status(context, state, message, now_s))
        case messages.SystemStatus(unhealthy=unhealthy):
            sensors = replace(sensors, unhealthy=unhealthy, positioning=_positioning(state, message, now_s))
            after = replace(
                state, link=link, sensors=sensors, power=apply_system_status(context, state, message, now_s)
            )
        case messages.MissionCurrent():
            after = _current_item(context, state, link, message, now_s)
        case messages.ListedItem(item):
            after = replace(state, own=mission_height.add_onboard_item(state.own, item))
        case messages.HeightTarget(below_m):
            after = replace(state, link=link, own=replace(state.own, below_m=below_m, below_s=now_s))
        case messages.LandedState(on_ground):
            after = replace(state, link=link, telemetry=replace(telemetry, on_ground=on_ground))
        case messages.Gps() | messages.EstimatorStatus():
            known = _positioning(state, message, now_s)
            gps = message if isinstance(message, messages.Gps) and message.receiver == 0 else sensors.gps
            after = replace(state, link=link, sensors=replace(sensors, gps=gps, positioning=known))
        case messages.Wind():
            after = replace(state, link=link, sensors=replace(sensors, wind=message))
        case messages.Attitude(roll_deg, pitch_deg):
            tilted = max(abs(roll_deg), abs(pitch_deg)) > context.limits.tilt_deg
            tilted_s = (sensors.tilted_since_s or now_s) if tilted else None
            after = replace(state, link=link, sensors=replace(sensors, attitude=message, tilted_since_s=tilted_s))
        case messages.FenceStatus(breached):
            breached_s = now_s if breached else sensors.breached_s
            after = replace(state, link=link, sensors=replace(sensors, fence_breached=breached, breached_s=breached_s))
        case StatusText(_, said):
            assignment = _apply_mission_report(context, state, message, now_s)
            if ALARM.search(said) and not _is_redundant_text(state, said, now_s):
                telemetry = replace(telemetry, alarm=(said, now_s))
            setup = context.vehicles.get(state.name)
            low_acts = setup is not None and setup.dialect.low_battery_acts
            failed = mode_evidence.parse_failure_text(said, low_acts=low_acts)
            evident = mode_evidence.record_failure(state.evidence, failed, now_s) if failed else state.evidence
            after = replace(state, link=link, telemetry=telemetry, assignment=assignment)
            return MessageEffect(after if evident is state.evidence else replace(after, evidence=evident), text=message)
        case _:
            after = replace(state, link=link)
    return MessageEffect(after)


def _current_item(
    context: Scene, state: VehicleState, link: LinkState, message: messages.MissionCurrent, now_s: float
) -> VehicleState:
    assignment = _apply_current_item(state, _apply_mission_report(context, state, message, now_s), message.seq)
    telemetry = replace(state.telemetry, item=(message.seq, message.total), item_s=now_s)
    after = replace(state, link=link, telemetry=telemetry, assignment=assignment)
    if context.vehicles[state.name].planned:
        return after
    return replace(after, own=mission_height.record_current_item(state.own, message.seq, state.motion.fix))


CONFIRMATION_S = 2.5
"""Time in which a doubtful HEARTBEAT must be confirmed; the vehicle's own comes every second, and one may be lost."""
REFUTING_FIX_S = 1.5


def _apply_heartbeat(
    context: Scene, state: VehicleState, link: LinkState, message: messages.Heartbeat, now_s: float
) -> VehicleState:
    old, sortie, custody = state.telemetry, state.sortie, state.custody
    if not message.armed and _is_seen_flying(context, state, now_s):
        if old.doubted is None:
            return replace(state, link=link, telemetry=replace(old, doubted=(message, now_s)))
        if now_s - old.doubted[1] < CONFIRMATION_S:
            return replace(state, link=link)
    other = old.heartbeat is None or old.heartbeat.custom_mode != message.custom_mode
    since = now_s if other else old.mode_since_s
    before, before_s = old.mode_before, old.mode_before_s
    if other and old.heartbeat is not None and state.link.heartbeat_s is not None:
        before, before_s = old.heartbeat.custom_mode, state.link.heartbeat_s
    since_s = now_s if old.critical_since_s is None else old.critical_since_s
    critical_s = None if message.system_status < CRITICAL else since_s
    # Its clock shows it too, once it has a position.
    starts_anew = message.system_status == BOOT and old.heartbeat is not None and old.heartbeat.system_status > BOOT
    rebooted_s = now_s if starts_anew else sortie.rebooted_s
    armed_once = sortie.armed_once or message.armed
    disarmed_s = now_s if state.armed and not message.armed else sortie.disarmed_s
    unseen_s, from_s = custody.unseen_until_s, custody.unseen_from_boot_s
    if old.heartbeat is not None and _is_first_after_silence(context, state.link, link.regained_s, now_s):
        unseen_s, from_s = now_s, custody.beat_boot_s
    boot_s = None if state.motion.fix is None else state.motion.fix.boot_s
    flew = sortie.flew_mission
    if not flew and sortie.took_off and message.armed and state.name in context.vehicles:
        flew = is_mission_mode(context.vehicles[state.name].dialect, message.custom_mode)
    after = replace(
        state,
        link=replace(link, heartbeat_s=now_s),
        telemetry=replace(
            old,
            heartbeat=message,
            mode_since_s=since,
            mode_before_s=before_s,
            mode_before=before,
            critical_since_s=critical_s,
            doubted=None,
        ),
        sortie=replace(sortie, armed_once=armed_once, flew_mission=flew, disarmed_s=disarmed_s, rebooted_s=rebooted_s),
        custody=replace(custody, unseen_until_s=unseen_s, unseen_from_boot_s=from_s, beat_boot_s=boot_s),
    )
    known = mode_evidence.record_critical_heartbeat(state.evidence, old.heartbeat, message, now_s)
    if other:
        after = replace(after, own=mission_height.restart_mission_here(state.own))
    return after if known is state.evidence else replace(after, evidence=known)


def _is_seen_flying(context: Scene, state: VehicleState, now_s: float) -> bool:
    fix, setup = state.motion.fix, context.vehicles.get(state.name)
    if not state.armed or not state.sortie.took_off or fix is None or setup is None or not setup.planned:
        return False
    text, said_s = state.telemetry.alarm
    explained = now_s - said_s <= REASON_S and EXPLAINS_DISARMING.search(text)
    if now_s - fix.at_s > REFUTING_FIX_S or state.telemetry.on_ground or explained:
        return False
    if now_s - state.motion.falls_s < CONFIRMATION_S:
        return False  # a position does not refute a fall
    if state.link.heartbeat_s is None or now_s - state.link.heartbeat_s >= context.limits.heartbeat_stale_s:
        return False  # armed was reported before a silence
    return fix.alt_rel_m > context.limits.airborne_m or math.hypot(*fix.velocity_m_s) > context.limits.at_rest_m_s


REST_SPEED_M_S = 0.3


def _is_redundant_text(state: VehicleState, said: str, now_s: float) -> bool:
    """Return whether a text explains nothing.

    It only states the autopilot's action on a reason just given; or the motors of a landed vehicle were stopped, which
    ends no flight.
    """
    if now_s - state.telemetry.alarm[1] < REASON_S and "failsafe activated" in said.lower():
        return True
    fix = state.motion.fix
    if fix is None or not state.telemetry.on_ground or now_s - fix.at_s > REFUTING_FIX_S:
        return False
    return bool(STOPS_MOTORS.search(said)) and math.hypot(*fix.velocity_m_s) < REST_SPEED_M_S


def _is_first_after_silence(context: Scene, link: LinkState, regained_s: float | None, now_s: float) -> bool:
    """Return whether a HEARTBEAT is the first one after a silence, or the first one this process receives.

    A HEARTBEAT lost among other messages is no silence: no failsafe has acted on that.
    """
    if link.heartbeat_s is None:
        return True
    silent = link.heard_s is not None and now_s - link.heard_s >= context.limits.link_stale_s
    return silent or (regained_s is not None and regained_s > link.heartbeat_s)


def _positioning(
    state: VehicleState, message: messages.Gps | messages.EstimatorStatus | messages.SystemStatus, now_s: float
) -> Positioning:
    beat = state.telemetry.heartbeat
    stands = beat is not None and not beat.armed and not state.sortie.took_off
    return gps_loss.update_positioning(state.sensors.positioning, message, state.motion.fix, now_s, stands=stands)


def _apply_link_report(
    context: Scene, state: VehicleState, message: messages.LinkMessage, now_s: float
) -> VehicleState:
    """Apply a report about a vehicle by others; it is no contact with it."""
    known = state.link.quality
    match message:
        case messages.StationActed(passed=True):
            return state  # the crew is told in any case
        case messages.StationHeard() | messages.StationActed() | messages.DoubleHeard():
            return state.with_link(strangers=add_foreign_system(state.link.strangers, message))
        case messages.Traffic():
            window_s = context.limits.loss_window_s
            return state.with_link(quality=link_quality.add_traffic(known, message, now_s, window_s))
        case messages.Radio():
            return state.with_link(quality=replace(known, radio=message, radio_s=now_s))


def _apply_evidence(state: VehicleState, message: messages.EvidenceMessage, now_s: float) -> VehicleState:
    """Apply evidence for a mode change; a command to the vehicle is no contact with it."""
    if isinstance(message, messages.OrderSeen) and mode_evidence.may_be_ours(state.orders, message, now_s):
        return state
    known = replace(state, evidence=mode_evidence.record_evidence(state.evidence, message, now_s))
    if isinstance(message, messages.OwnFailsafe) and message.active:
        return known.with_telemetry(alarm=(message.words, now_s))
    if isinstance(message, messages.VehicleSetting):
        return replace(known, power=apply_pack_setting(state, message))
    return known


def _apply_mission_report(
    context: Scene, state: VehicleState, message: messages.MissionCurrent | StatusText, now_s: float
) -> Assignment:
    """Apply its report of the mission on board, unless an upload is under way."""
    old = state.assignment
    if old.board is None or old.pending is not None or old.stubborn or state.stage not in _MAY_FLY_MISSION:
        return old
    if isinstance(message, StatusText):
        known = mission_ownership.note_mission_text(old.carried, message.text, now_s)
    else:
        expected = mission_ownership.compute_expected_total(context, state.name, len(old.board.waypoint_of))
        known = mission_ownership.apply_mission_report(old.carried, message, expected, now_s)
    return old if known is old.carried else replace(old, carried=known)


def _apply_current_item(state: VehicleState, assignment: Assignment, seq: int) -> Assignment:
    if assignment.carried.foreign_s is not None:
        return assignment  # an index into an unknown list
    if assignment.board is None or not 0 <= seq < len(assignment.board.waypoint_of):
        return assignment
    waypoint = assignment.board.waypoint_of[seq]
    if waypoint is None or waypoint == assignment.waypoint or state.stage not in _MAY_FLY_MISSION:
        return assignment
    if state.leg is not None and state.leg.phase is Phase.LAND and waypoint < assignment.waypoint:
        return assignment  # both autopilots restart the index after the mission
    return replace(assignment, waypoint=waypoint)


def _update_link_position(
    link: LinkState, name: str, message: messages.Position, now_s: float, context: Scene
) -> LinkState:
    """Return the link after a position, which may reveal another vehicle with the same id."""
    twins = add_reported_position(link.twins, ReportedPosition(now_s, message.boot_s, message.lat_deg, message.lon_deg))
    if not twins.are_two or link.twins.are_two or name not in context.vehicles:
        return replace(link, twins=twins)
    double = messages.DoubleHeard(context.vehicles[name].sysid, ())
    return replace(link, twins=twins, strangers=add_foreign_system(link.strangers, double))


def _apply_position(
    context: Scene, state: VehicleState, link: LinkState, message: messages.Position, now_s: float
) -> MessageEffect:
    last, sortie, power = state.motion.fix, state.sortie, state.power
    rebooted_s = sortie.rebooted_s
    if last is not None and message.boot_s <= last.boot_s:
        if last.boot_s - message.boot_s < OVERTAKEN_S and now_s - last.at_s < context.limits.link_stale_s:
            return MessageEffect(replace(state, link=link))  # overtaken in transit by a newer one, or a duplicate
        rebooted_s = now_s
    place = context.frame.to_local_m(message.lat_deg, message.lon_deg)
    velocity = (message.east_m_s, message.north_m_s, -message.down_m_s)
    known = state.sensors.positioning
    fix = PositionFix(
        now_s, message.boot_s, place, message.alt_rel_m, message.alt_msl_m, velocity, message.heading_deg,
        reckoned=known.lost_s is not None,
    )  # fmt: skip
    elapsed_s = 0.0 if last is None else message.boot_s - last.boot_s
    if state.armed and 0.0 < elapsed_s < LONGEST_SILENCE_S:
        climb = 1.0 + CLIMB_SHARE_PER_M_S * max(0.0, -message.down_m_s)
        drawn_pct = climb * context.draw_pct_per_s(message.east_m_s, message.north_m_s) * elapsed_s
        power = replace(power, battery=account.add_modelled_use(power.battery, drawn_pct))
    anchor = state.motion.anchor
    if anchor is None or fix.boot_s < anchor.boot_s or anchor.distance_m(fix) > context.limits.stall_m:
        anchor = fix
    settles = known.lost_s is not None or now_s - known.regained_s <= vehicle_position.GPS_SETTLE_S
    jump = (None if settles else _find_jump(context, last, fix, elapsed_s)) or state.motion.jump
    took_off = sortie.took_off or (state.armed and fix.alt_rel_m > context.limits.airborne_m)
    away = sortie.away_once or context.vehicles[state.name].pad_distance_m(place) > context.limits.off_pad_m
    away = took_off and away
    falls = took_off and fix.velocity_m_s[2] < -context.limits.fall_m_s
    if (took_off, away, rebooted_s) != (sortie.took_off, sortie.away_once, sortie.rebooted_s):
        sortie = replace(sortie, took_off=took_off, away_once=away, rebooted_s=rebooted_s)
    behind_s, fell_back_s = _update_clock_lag(
        state.motion, last, fix, anew=rebooted_s == now_s or state.motion.reopened
    )
    falls_s = now_s if falls else state.motion.falls_s
    climbs_m_s = _climb_rate_m_s(state.motion, fix, elapsed_s, context.limits.fall_m_s)
    sinks_s = now_s if took_off and climbs_m_s < -context.limits.sinks_m_s else state.motion.sinks_s
    drops_s = now_s if took_off and climbs_m_s < -context.limits.drops_m_s else state.motion.drops_s
    motion = MotionState(fix, last, anchor, jump, falls_s, climbs_m_s, sinks_s, drops_s, behind_s, fell_back_s)
    sample = PositionSample(message.boot_s, place, math.hypot(message.east_m_s, message.north_m_s))
    if fix.reckoned:
        without_s = vehicle_position.time_without_fix_s(known, fix)
        assignment, inspected, flown = _break_unproven_run(context, state, without_s)
    else:
        gap_s = SLOWED_GAP_S if is_slowed_by_us(state, now_s) else GAP_S
        before_gap = _keep_state_before_gap(state, elapsed_s, gap_s)
        assignment, inspected, flown = _advance_coverage(context, before_gap, sample, gap_s)
    if assignment.fix_waypoint != assignment.waypoint:
        assignment = replace(assignment, fix_waypoint=assignment.waypoint)
    after = replace(state, link=link, motion=motion, power=power, sortie=sortie, assignment=assignment)
    if state.own.listed and state.own.leg_from is None:
        after = replace(after, own=replace(state.own, leg_from=fix))
    return MessageEffect(after, inspected, flown)


CLIMB_TIME_CONSTANT_S = 1.5
"""Time constant of the climb rate; heights are accurate to centimetres, and arrive up to ten times a second."""


def _climb_rate_m_s(known: MotionState, fix: PositionFix, elapsed_s: float, most_m_s: float) -> float:
    """Return the climb rate by its heights; limited, as a reset of the estimate is no fall."""
    if known.fix is None or not 0.0 < elapsed_s < JUMP_GAP_S:
        return 0.0
    rate_m_s = min(most_m_s, max(-most_m_s, (fix.alt_rel_m - known.fix.alt_rel_m) / elapsed_s))
    return known.climbs_m_s + (rate_m_s - known.climbs_m_s) * elapsed_s / (elapsed_s + CLIMB_TIME_CONSTANT_S)


def _update_clock_lag(
    known: MotionState, before: PositionFix | None, fix: PositionFix, *, anew: bool
) -> tuple[float, float]:
    """Return the lag of its clock, and since when; messages queued during a silence catch up."""
    if before is None or anew:
        return 0.0, known.fell_back_s
    lost_s = fix.at_s - before.at_s - (fix.boot_s - before.boot_s)
    if lost_s >= CLOCK_LOSS_S:
        return known.behind_s + lost_s, fix.at_s
    return (max(0.0, known.behind_s + lost_s) if known.behind_s else 0.0), known.fell_back_s


def _keep_state_before_gap(state: VehicleState, elapsed_s: float, gap_s: float) -> VehicleState:
    """Save its progress before a gap in its positions, until the gap is judged."""
    if elapsed_s <= gap_s or state.assignment.before is not None or state.motion.fix is None:
        return state
    before = last_known_of(state, state.motion.fix.at_s)
    return state if before is None else state.with_assignment(before=before, run=None)


def _find_jump(
    context: Scene, before: PositionFix | None, fix: PositionFix, elapsed_s: float
) -> tuple[float, float] | None:
    """Return the distance of a position from the one its velocity predicts, if it is notable."""
    if before is None or not 0.0 < elapsed_s < JUMP_GAP_S:
        return None
    (east_m, north_m), (was_east, was_north, _), (is_east, is_north, _) = (
        before.place_m, before.velocity_m_s, fix.velocity_m_s
    )  # fmt: skip
    led_to = (east_m + (was_east + is_east) / 2 * elapsed_s, north_m + (was_north + is_north) / 2 * elapsed_s)
    off_m = math.dist(fix.place_m, led_to)
    # Over a longer gap it may have flown a turn.
    return (off_m, fix.at_s) if off_m > context.limits.jump_warn_m * max(1.0, elapsed_s) else None


_CoverageStep = tuple[Assignment, int | None, SegmentPass | None]
"""A mission after a position, the segment proven inspected, and its figures."""


def _advance_coverage(context: Scene, state: VehicleState, sample: PositionSample, gap_s: float) -> _CoverageStep:
    old, leg = state.assignment, state.leg
    if old.board is None or leg is None or not _may_count(context, state):
        return old, None, None
    # The index may be ahead of the position by an item, or behind it by a lost message: a run continues until it ends.
    visit = old.run_visit if old.run_visit is not None and old.run is not None else leg.visit
    if leg.visit is not None and visit != leg.visit and leg.phase is Phase.INSPECT:
        visit = leg.visit
    if visit is None:
        return old, None, None
    track = old.board.tracks[visit]
    if track.by_pictures:
        return old, None, None
    run = old.run if old.run_visit == visit else None
    step = advance_run(
        run, track, sample, corridor_m=context.corridor_m, speed_m_s=context.inspection_speed_m_s, longest_gap_s=gap_s
    )
    if step.flown is not None:
        return replace(old, run=step.run, run_visit=visit), track.segment, step.flown
    if step.broken:
        broken = (*old.runs_broken, (track.segment, step.broken))
        old = replace(old, runs_broken=broken, owed=(visit, step.broken))
    return replace(old, run=step.run, run_visit=visit), None, None


def _break_unproven_run(context: Scene, state: VehicleState, without_s: float) -> _CoverageStep:
    """Break the inspection under way once GPS has been lost for longer than positions may be missing.

    A dead-reckoned position counts as none, and a gap of `GAP_S` is tolerated as well.
    """
    old, leg = state.assignment, state.leg
    if without_s <= GAP_S or old.board is None or leg is None or not _may_count(context, state):
        return old, None, None
    visit = old.run_visit if old.run is not None else leg.visit if leg.phase is Phase.INSPECT else None
    if visit is None or old.board.tracks[visit].by_pictures:
        return old, None, None
    segment = old.board.tracks[visit].segment
    if old.run is None and (segment, WITHOUT_FIX) in old.runs_broken[-1:]:
        return old, None, None
    broken = (*old.runs_broken, (segment, WITHOUT_FIX))
    return replace(old, run=None, run_visit=visit, runs_broken=broken, owed=(visit, WITHOUT_FIX)), None, None


def _may_count(context: Scene, state: VehicleState) -> bool:
    """Return whether it flies its mission; a pilot may have returned it to it."""
    if state.assignment.carried.foreign_s is not None:
        return False
    if state.stage is Stage.FLYING:
        return True
    return state.stage is Stage.PILOT and is_mission_mode(context.vehicles[state.name].dialect, state.mode)
