"""One message of a vehicle into what is known of it: its place, its battery, its link, its inspections."""

from __future__ import annotations

import math
import re
from dataclasses import dataclass, replace

from executor.core import carried, link_quality
from executor.core.battery import account
from executor.core.battery.account import BatteryState
from executor.core.battery.voltage import Report, Thresholds, VoltageState, measured
from executor.core.context import Scene
from executor.core.coverage import Sample, SegmentPass, follow
from executor.core.hearing.strangers import noted
from executor.core.messages import (
    Attitude,
    Battery,
    DoubleHeard,
    FenceStatus,
    FlightMessage,
    Gps,
    Heartbeat,
    LandedState,
    MissionCurrent,
    OrderSeen,
    Position,
    Radio,
    StationHeard,
    StatusText,
    SystemStatus,
    Traffic,
    Wind,
)
from executor.core.parts import Fix
from executor.core.vehicle import Stage, VehicleState
from missions import Phase
from missions.autopilots.modes import is_mission_mode

_ALARM = re.compile(
    r"failsafe|fence|\bkill|\bcrash|terminat|parachute|emergency|thrust loss|motor fail|critical battery|low battery|"
    r"battery .*(low|critical|missing|unhealthy|fail)|no valid mission",
    re.IGNORECASE,
)
"""What both autopilots say when a mission ends: "Battery Failsafe", "Crash: Disarming", "Battery 1 is low"."""

OVERTAKEN_S = 60.0
"""A position older than the one before it by less than this was overtaken on the way; by more, or after a silence, the
autopilot has started anew."""
LONGEST_SILENCE_S = 600.0
"""Over a longer gap of its own clock nobody knows what a vehicle used: it may have landed and been charged."""
_ON_ITS_MISSION = frozenset({Stage.FLYING, Stage.STARTING, Stage.PILOT, Stage.LOST})
"""Where the index says something: a pilot may have put it back on its mission, and a lost one may still fly it."""
NAMED_S = 5.0
"""So shortly after the text that names a reason PX4 says what it does: "Failsafe activated: switching to Return"."""
_ABOUT = (Traffic, Radio, OrderSeen, StationHeard, DoubleHeard)
"""What others say about a vehicle."""
JUMP_GAP_S = 10.0
"""After a longer gap a position says nothing of a jump."""


@dataclass(frozen=True, slots=True)
class Folded:
    """A vehicle after a message, and the segment that the message proved to be inspected."""

    state: VehicleState
    inspected: int | None = None
    flown: SegmentPass | None = None
    """How it was flown."""
    text: StatusText | None = None


def fold(  # noqa: C901, PLR0911, PLR0912 - one return for each kind of message
    context: Scene, state: VehicleState, message: FlightMessage, now_s: float
) -> Folded:
    """Take one message into the state."""
    if not isinstance(message, _ABOUT):
        silent = state.link.spoke_s is not None and now_s - state.link.spoke_s >= context.limits.link_stale_s
        state = replace(
            state, link=replace(state.link, spoke_s=now_s, regained_s=now_s if silent else state.link.regained_s)
        )
    match message:
        case Heartbeat():
            return Folded(_beat(context, state, message, now_s))
        case Position():
            return _positioned(context, replace(state, link=replace(state.link, heard_s=now_s)), message, now_s)
        case Battery():
            return Folded(_powered(context, state, message, now_s))
        case SystemStatus():
            return Folded(_status(context, state, message, now_s))
        case MissionCurrent(seq, total):
            state = replace(
                state,
                link=replace(state.link, heard_s=now_s),
                telemetry=replace(state.telemetry, item=(seq, total), item_s=now_s),
            )
            return Folded(_at_item(_carries(context, state, message, now_s), seq))
        case LandedState(on_ground):
            return Folded(
                replace(
                    state,
                    link=replace(state.link, heard_s=now_s),
                    telemetry=replace(state.telemetry, on_ground=on_ground),
                )
            )
        case Gps():
            return Folded(
                replace(state, link=replace(state.link, heard_s=now_s), sensors=replace(state.sensors, gps=message))
            )
        case Wind():
            return Folded(
                replace(state, link=replace(state.link, heard_s=now_s), sensors=replace(state.sensors, wind=message))
            )
        case Attitude(roll_deg, pitch_deg):
            tilted = max(abs(roll_deg), abs(pitch_deg)) > context.limits.tilt_deg
            tilted_s = (state.sensors.tilted_since_s or now_s) if tilted else None
            return Folded(
                replace(
                    state,
                    link=replace(state.link, heard_s=now_s),
                    sensors=replace(state.sensors, attitude=message, tilted_since_s=tilted_s),
                )
            )
        case FenceStatus(breached):
            return Folded(
                replace(
                    state,
                    link=replace(state.link, heard_s=now_s),
                    sensors=replace(state.sensors, fence_breached=breached),
                )
            )
        case StatusText(_, said):
            alarm = (
                (said, now_s)
                if _ALARM.search(said) and not _adds_nothing(state, said, now_s)
                else state.telemetry.alarm
            )
            told = _carries(
                context,
                replace(
                    state, link=replace(state.link, heard_s=now_s), telemetry=replace(state.telemetry, alarm=alarm)
                ),
                message,
                now_s,
            )
            return Folded(told, text=message)
        case Traffic() | Radio() | OrderSeen() | StationHeard() | DoubleHeard():
            return Folded(_about(context, state, message, now_s))
        case _:
            return Folded(replace(state, link=replace(state.link, heard_s=now_s)))


DOUBT_S = 2.5
"""The vehicle's own HEARTBEAT comes every second, and one may be lost: what it refutes meanwhile was not so."""
DOUBTED_FIX_S = 1.5


def _beat(context: Scene, state: VehicleState, message: Heartbeat, now_s: float) -> VehicleState:
    if not message.armed and _flies(context, state, now_s):
        if state.telemetry.doubted is None:
            return replace(
                state,
                link=replace(state.link, heard_s=now_s),
                telemetry=replace(state.telemetry, doubted=(message, now_s)),
            )
        if now_s - state.telemetry.doubted[1] < DOUBT_S:
            return replace(state, link=replace(state.link, heard_s=now_s))
    other = state.telemetry.heartbeat is None or state.telemetry.heartbeat.custom_mode != message.custom_mode
    since = now_s if other else state.telemetry.mode_since_s
    armed_once = state.sortie.armed_once or message.armed
    disarmed_s = now_s if state.armed and not message.armed else state.sortie.disarmed_s
    unseen_s, from_s = state.custody.unseen_until_s, state.custody.unseen_from_boot_s
    if state.telemetry.heartbeat is not None and _was_unseen(context, state, now_s):
        unseen_s, from_s = now_s, state.custody.beat_boot_s
    boot_s = None if state.motion.fix is None else state.motion.fix.boot_s
    flew = state.sortie.flew_mission
    if not flew and state.sortie.took_off and message.armed and state.name in context.vehicles:
        flew = is_mission_mode(context.vehicles[state.name].dialect, message.custom_mode)
    return replace(
        state,
        link=replace(state.link, heard_s=now_s, heartbeat_s=now_s),
        telemetry=replace(state.telemetry, heartbeat=message, mode_since_s=since, doubted=None),
        sortie=replace(state.sortie, armed_once=armed_once, flew_mission=flew, disarmed_s=disarmed_s),
        custody=replace(state.custody, unseen_until_s=unseen_s, unseen_from_boot_s=from_s, beat_boot_s=boot_s),
    )


def _flies(context: Scene, state: VehicleState, now_s: float) -> bool:
    """Return whether a vehicle that says that it is disarmed is seen to fly on."""
    fix, setup = state.motion.fix, context.vehicles.get(state.name)
    if not state.armed or not state.sortie.took_off or fix is None or setup is None or not setup.planned:
        return False
    if now_s - fix.at_s > DOUBTED_FIX_S or state.telemetry.on_ground or _killed(state, now_s):
        return False
    if now_s - state.motion.falls_s < DOUBT_S:
        return False  # who falls is not refuted by where it is
    if state.link.heartbeat_s is None or now_s - state.link.heartbeat_s >= context.limits.heartbeat_stale_s:
        return False  # that it is armed is from before a silence
    return fix.alt_rel_m > context.limits.airborne_m or math.hypot(*fix.velocity_m_s) > context.limits.at_rest_m_s


_STOPPED = re.compile(r"emergency stop|kill", re.IGNORECASE)
RESTS_M_S = 0.3
_DISARMS = re.compile(r"disarm|crash|kill|emergency stop|terminat", re.IGNORECASE)


def _killed(state: VehicleState, now_s: float) -> bool:
    """Return whether it says why it disarms in the air."""
    text, said_s = state.telemetry.alarm
    return now_s - said_s <= NAMED_S and bool(_DISARMS.search(text))


def _adds_nothing(state: VehicleState, said: str, now_s: float) -> bool:
    """Return whether a text explains nothing.

    It only says what an autopilot does about something that it has just named; or somebody stops the motors of a
    vehicle that has landed, which ends no flight.
    """
    does = now_s - state.telemetry.alarm[1] < NAMED_S and "failsafe activated" in said.lower()
    return does or (bool(_STOPPED.search(said)) and _rests(state, now_s))


def _rests(state: VehicleState, now_s: float) -> bool:
    """Return whether it is seen to stand on the ground."""
    fix = state.motion.fix
    if fix is None or not state.telemetry.on_ground or now_s - fix.at_s > DOUBTED_FIX_S:
        return False
    return math.hypot(*fix.velocity_m_s) < RESTS_M_S


def _was_unseen(context: Scene, state: VehicleState, now_s: float) -> bool:
    """Return whether a heartbeat is the first one after a silence, or the first one that this process hears.

    One that got lost among other messages is no silence: nothing that a failsafe waits for has happened then.
    """
    if state.link.heartbeat_s is None:
        return True
    silent = state.link.heard_s is not None and now_s - state.link.heard_s >= context.limits.link_stale_s
    return silent or (state.link.regained_s is not None and state.link.regained_s > state.link.heartbeat_s)


def _about(
    context: Scene,
    state: VehicleState,
    message: Traffic | Radio | OrderSeen | StationHeard | DoubleHeard,
    now_s: float,
) -> VehicleState:
    """Take what others say about a vehicle, which does not mean that it was heard."""
    match message:
        case StationHeard() | DoubleHeard():
            return replace(state, link=replace(state.link, strangers=noted(state.link.strangers, message)))
        case Traffic():
            window_s = context.limits.loss_window_s
            return replace(
                state,
                link=replace(
                    state.link, quality=link_quality.with_traffic(state.link.quality, message, now_s, window_s)
                ),
            )
        case Radio():
            return replace(
                state, link=replace(state.link, quality=link_quality.heard_radio(state.link.quality, message, now_s))
            )
        case OrderSeen():
            return replace(state, orders=replace(state.orders, ordered_mode_s=now_s))


def _powered(context: Scene, state: VehicleState, message: Battery, now_s: float) -> VehicleState:
    packs = state.power.packs
    if message.remaining_pct is not None:
        # Of several packs the emptiest one ends the flight.
        packs = tuple({**dict(packs), message.battery: message.remaining_pct}.items())
    single = len(packs) <= 1  # the counters of several packs are not one account
    if message.consumed_ah is not None and single and state.armed:
        counted = account.with_consumed(state.power.battery, message.consumed_ah, now_s, context.limits)
        state = replace(state, power=replace(state.power, battery=counted))
    charge = state.power.battery
    if message.remaining_pct is not None:
        percent = min(dict(packs).values())
        if single and _rounds_twice(context, state):
            state = replace(
                state,
                power=replace(state.power, roundings=replace(state.power.roundings, rounded=percent, rounded_s=now_s)),
            )
            percent = state.power.roundings.percent
        charge = _charged(context, state, percent, message.charge_state, now_s)
    volts = state.power.volts
    if message.voltage_v and single:
        report = Report(message.voltage_v, message.current_a, message.cells_v)
        volts = _measured(context, state, report, now_s)
    return replace(
        state,
        link=replace(state.link, heard_s=now_s),
        power=replace(state.power, packs=packs, battery=charge, volts=volts, battery_faults=message.faults),
    )


def _status(context: Scene, state: VehicleState, message: SystemStatus, now_s: float) -> VehicleState:
    charge, volts = state.power.battery, state.power.volts
    if message.remaining_pct is not None and _unreported(context, state, now_s):
        charge = _charged(context, state, message.remaining_pct, 0, now_s)
    elif message.remaining_pct is not None and len(state.power.packs) == 1 and _rounds_twice(context, state):
        state = replace(
            state,
            power=replace(
                state.power, roundings=replace(state.power.roundings, ceiled=message.remaining_pct, ceiled_s=now_s)
            ),
        )
        charge = _charged(context, state, state.power.roundings.percent, charge.charge_state, now_s)
    if message.voltage_v and now_s - volts.reported_s > context.limits.battery_stale_s:
        volts = _measured(context, state, Report(message.voltage_v), now_s)
    return replace(
        state,
        link=replace(state.link, heard_s=now_s),
        power=replace(state.power, battery=charge, volts=volts),
        sensors=replace(state.sensors, unhealthy=message.unhealthy),
    )


def _measured(context: Scene, state: VehicleState, report: Report, now_s: float) -> VoltageState:
    limits = context.limits
    known = report.current_a is not None and report.current_a > 0
    step = limits.voltage_step if known else limits.voltage_step_blind
    thresholds = Thresholds(step, limits.cell_low_v, limits.cell_spread_v)
    return measured(state.power.volts, report, thresholds, now_s, flying=state.armed and state.sortie.took_off)


def _unreported(context: Scene, state: VehicleState, now_s: float) -> bool:
    # SYS_STATUS rounds in another way than BATTERY_STATUS, and stands for any one of several packs.
    return now_s - state.power.battery.reported_s > context.limits.battery_stale_s


def _rounds_twice(context: Scene, state: VehicleState) -> bool:
    """Return whether it rounds its percentage in two ways, and has nothing finer than that."""
    return (
        account.is_blind(state.power.battery)
        and state.name in context.vehicles
        and context.vehicles[state.name].dialect.rounds_twice
    )


def _charged(
    context: Scene, state: VehicleState, remaining_pct: float, charge_state: int, now_s: float
) -> BatteryState:
    # Both autopilots' percentages jump back to 100 at a restart; PX4's simulated one also when it disarms.
    known = state.power.battery
    if known.remaining_pct is not None and remaining_pct > known.remaining_pct + 20.0:
        return account.swapped(known, remaining_pct, charge_state, now_s, context.prior)
    return account.with_remaining(known, remaining_pct, charge_state, now_s, context.prior, context.limits)


def _carries(context: Scene, state: VehicleState, message: MissionCurrent | StatusText, now_s: float) -> VehicleState:
    """Take what it says of the mission on board, unless it is being given one."""
    if (
        state.assignment.board is None
        or state.assignment.pending is not None
        or state.assignment.stubborn
        or state.stage not in _ON_ITS_MISSION
    ):
        return state
    if isinstance(message, StatusText):
        known = carried.texted(state.assignment.carried, message.text, now_s)
    else:
        expected = carried.items_expected(context, state.name, len(state.assignment.board.waypoint_of))
        known = carried.after_report(state.assignment.carried, message, expected, now_s)
    return (
        state
        if known is state.assignment.carried
        else replace(state, assignment=replace(state.assignment, carried=known))
    )


def _at_item(state: VehicleState, seq: int) -> VehicleState:
    if state.assignment.carried.foreign_s is not None:
        return state  # an index into a list that we do not know
    if state.assignment.board is None or not 0 <= seq < len(state.assignment.board.waypoint_of):
        return state
    waypoint = state.assignment.board.waypoint_of[seq]
    if waypoint is None or state.stage not in _ON_ITS_MISSION:
        return state
    if state.leg is not None and state.leg.phase is Phase.LAND and waypoint < state.assignment.waypoint:
        return state  # both autopilots begin to count anew when the mission is over
    return replace(state, assignment=replace(state.assignment, waypoint=waypoint))


def _positioned(context: Scene, state: VehicleState, message: Position, now_s: float) -> Folded:
    if state.motion.fix is not None and message.boot_s <= state.motion.fix.boot_s:
        late_s = state.motion.fix.boot_s - message.boot_s
        if late_s < OVERTAKEN_S and now_s - state.motion.fix.at_s < context.limits.link_stale_s:
            return Folded(state)  # overtaken on the way by a newer one, or a duplicate
        state = replace(state, sortie=replace(state.sortie, rebooted_s=now_s))
    place = context.frame.to_local_m(message.lat_deg, message.lon_deg)
    velocity = (message.east_m_s, message.north_m_s, -message.down_m_s)
    fix = Fix(now_s, message.boot_s, place, message.alt_rel_m, message.alt_msl_m, velocity, message.heading_deg)
    drained = state.power.battery
    elapsed_s = 0.0 if state.motion.fix is None else message.boot_s - state.motion.fix.boot_s
    if state.armed and 0.0 < elapsed_s < LONGEST_SILENCE_S:
        drained = account.drawn(drained, context.draw_pct_per_s(message.east_m_s, message.north_m_s) * elapsed_s)
    anchor = state.motion.anchor
    if anchor is None or fix.boot_s < anchor.boot_s or _apart_m(anchor, fix) > context.limits.stall_m:
        anchor = fix
    took_off = state.sortie.took_off or (state.armed and fix.alt_rel_m > context.limits.airborne_m)
    jump = _jump(context, state.motion.fix, fix, elapsed_s) or state.motion.jump
    away = state.sortie.away_once or math.dist(place, context.vehicles[state.name].pad_m) > context.limits.off_pad_m
    falls = took_off and fix.velocity_m_s[2] < -context.limits.fall_m_s
    state = replace(
        state,
        motion=replace(
            state.motion, falls_s=now_s if falls else state.motion.falls_s, fix=fix, anchor=anchor, jump=jump
        ),
        power=replace(state.power, battery=drained),
        sortie=replace(state.sortie, took_off=took_off, away_once=took_off and away),
    )
    return _covered(context, state, Sample(message.boot_s, place, math.hypot(message.east_m_s, message.north_m_s)))


def _jump(context: Scene, before: Fix | None, fix: Fix, elapsed_s: float) -> tuple[float, float] | None:
    """Return how far a position lies from where the velocities lead, if that is worth a word."""
    if before is None or not 0.0 < elapsed_s < JUMP_GAP_S:
        return None
    east, north = (
        (one + other) / 2 * elapsed_s for one, other in zip(before.velocity_m_s[:2], fix.velocity_m_s[:2], strict=True)
    )
    off_m = math.dist(fix.place_m, (before.place_m[0] + east, before.place_m[1] + north))
    # Over a longer gap a turn may have been flown in between.
    return (off_m, fix.at_s) if off_m > context.limits.jump_warn_m * max(1.0, elapsed_s) else None


def _apart_m(one: Fix, other: Fix) -> float:
    return math.dist((*one.place_m, one.alt_rel_m), (*other.place_m, other.alt_rel_m))


def _covered(context: Scene, state: VehicleState, sample: Sample) -> Folded:
    leg = state.leg
    if state.assignment.board is None or leg is None or not _may_count(context, state):
        return Folded(state)
    # The index may be ahead of the place by an item or behind it by a lost message: a run goes on until it ends.
    visit = (
        state.assignment.run_visit
        if state.assignment.run_visit is not None and state.assignment.run is not None
        else leg.visit
    )
    if leg.visit is not None and visit != leg.visit and leg.phase is Phase.INSPECT:
        visit = leg.visit
    if visit is None:
        return Folded(state)
    track = state.assignment.board.tracks[visit]
    run = state.assignment.run if state.assignment.run_visit == visit else None
    step = follow(run, track, sample, corridor_m=context.corridor_m, speed_m_s=context.inspection_speed_m_s)
    state = replace(state, assignment=replace(state.assignment, run=step.run, run_visit=visit))
    if step.done:
        return Folded(state, inspected=track.segment, flown=step.flown)
    if step.broken:
        broken = (*state.assignment.runs_broken, (track.segment, step.broken))
        return Folded(
            replace(state, assignment=replace(state.assignment, runs_broken=broken, owed=(visit, step.broken)))
        )
    return Folded(state)


def _may_count(context: Scene, state: VehicleState) -> bool:
    """Return whether it flies its mission; a pilot may have put it back on it."""
    if state.assignment.carried.foreign_s is not None:
        return False
    if state.stage is Stage.FLYING:
        return True
    beat = state.telemetry.heartbeat
    on_mission = beat is not None and is_mission_mode(context.vehicles[state.name].dialect, beat.custom_mode)
    return state.stage is Stage.PILOT and on_mission
