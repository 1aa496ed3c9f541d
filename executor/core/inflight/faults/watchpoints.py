"""Watchpoints: a table of what may be wrong with a vehicle, looked at as levels on every tick.

Each answers OK, FAIL or STALE. FAIL must last `raise_after_s` before it is a fault; STALE neither starts nor ends that
time, so that a silent vehicle's last battery report raises nothing by itself. One arbiter picks one reason.
"""

from __future__ import annotations

import math
from dataclasses import replace

from executor.core.context import Scene, VehicleSetup
from executor.core.inflight.custody.mode_attribution import (
    GEOFENCE_SENSOR,
    attribute_mode_change,
    describe_fence_action,
    is_attribution_final,
)
from executor.core.inflight.faults import battery_watchpoints as battery
from executor.core.inflight.faults import height_watch
from executor.core.inflight.faults import stream_watch as streams
from executor.core.inflight.faults.watchpoint_types import (
    OK,
    STALE,
    Finding,
    Watchpoint,
    WatchView,
    alarm_words,
    describe_reported_failure,
    is_estimate_lost,
    is_in_mission_mode,
)
from executor.core.interface.messages import Actor
from executor.core.state.onboard_fence import describe_fence_departure
from executor.core.state.positioning import is_dead_reckoning
from executor.core.state.vehicle_parts import ModeCause, WatchpointMemory
from executor.core.state.vehicle_position import has_fallen, has_mission_ended, is_resting_place_known
from executor.core.state.vehicle_state import FaultCode, FaultKind, Stage, VehicleState
from missions.autopilots.dialect import is_home_mode, is_manual_mode, mode_name


def check_link_silence(view: WatchView) -> Finding:
    """Nothing was heard for the vehicle's time-out."""
    heard_s = view.state.link.heard_s
    if heard_s is None:
        return STALE
    age_s = view.now_s - heard_s
    if age_s >= view.setup.link_timeout_s:
        return f"link lost for {age_s:.1f} s, time-out {view.setup.link_timeout_s:g} s"
    unseen_s = streams.state_silence_s(view)
    unseen = view.setup.planned and unseen_s >= max(streams.UNSEEN_S, view.setup.link_timeout_s)
    return f"neither HEARTBEAT nor position for {unseen_s:.0f} s" if unseen else OK


def check_unexpected_disarm(view: WatchView) -> Finding:  # noqa: C901, PLR0911 - one return for each reason
    """It disarmed where, or when, it should not have landed."""
    state, limits = view.state, view.context.limits
    if state.motion.fix is None or state.telemetry.heartbeat is None:
        return STALE
    if state.armed or not state.sortie.armed_once:
        return OK
    if not view.setup.planned:
        return _check_disarm_in_flight(view)
    away_m = math.dist(state.motion.fix.place_m, view.setup.pad_m)
    if not is_resting_place_known(state, view.now_s):
        return STALE  # its place is from before it was silent, or began anew
    if state.stage is Stage.PILOT:
        return OK  # its pilot may disarm it anywhere
    if is_dead_reckoning(state):
        return f"disarmed without GPS, position unknown{alarm_words(view)}"
    if away_m > limits.off_pad_m:
        return f"disarmed {away_m:.0f} m from its pad, {state.motion.fix.alt_rel_m:.0f} m high{alarm_words(view)}"
    # An old position says nothing of its height: it may have come down since.
    if has_fallen(view.context, state) and view.now_s - state.motion.fix.at_s <= limits.link_stale_s:
        return f"disarmed {state.motion.fix.alt_rel_m:.0f} m above its pad{alarm_words(view)}"
    if not state.sortie.took_off and state.stage is Stage.FLYING:
        return f"disarmed on its pad before it took off{alarm_words(view)}"
    if state.sortie.rebooted_s is not None:
        return f"its autopilot has rebooted, and it is disarmed{alarm_words(view)}"
    return OK if has_mission_ended(view.context, state) else f"disarmed over its pad in mid-mission{alarm_words(view)}"


def _check_disarm_in_flight(view: WatchView) -> Finding:
    """Look at a vehicle that disarmed and may land anywhere: it must have come to rest."""
    fix, limits = view.fresh_fix, view.context.limits
    if fix is None or view.state.telemetry.on_ground:
        return OK
    speed_m_s = math.hypot(*fix.velocity_m_s)
    if fix.alt_rel_m <= limits.off_pad_up_m or speed_m_s <= limits.at_rest_m_s:
        return OK
    return f"disarmed {fix.alt_rel_m:.0f} m over its home at {speed_m_s:.1f} m/s{alarm_words(view)}"


def check_termination(view: WatchView) -> Finding:
    """Its HEARTBEAT reports flight termination."""
    heartbeat = view.state.telemetry.heartbeat
    if heartbeat is None:
        return STALE
    names = {6: "an emergency", 8: "that its flight is terminated"}  # MAV_STATE
    what = names.get(heartbeat.system_status) if heartbeat.armed else None
    return f"reports {what}{alarm_words(view)}" if what else OK


def check_fall(view: WatchView) -> Finding:
    """It sinks faster than it was ever told to."""
    fix = view.fresh_fix
    if fix is None:
        return STALE
    if not view.setup.planned and not _is_sinking(view):
        return OK
    up_m_s = fix.velocity_m_s[2]
    return f"falls at {-up_m_s:.1f} m/s" if up_m_s < -view.context.limits.fall_m_s else OK


def check_mission_mode(view: WatchView) -> Finding:
    """It is in a mode that nobody here ordered, by its own failsafe."""
    state = view.state
    if state.mode is None:
        return STALE
    if check_fence_breach(view):
        return OK  # that is said by its own name
    dialect = view.setup.dialect
    if view.setup.planned:
        if not state.armed or state.custody.cause is not ModeCause.FAILSAFE:
            return OK
        return f"{mode_name(dialect, state.mode)} by its own failsafe{alarm_words(view)}"
    return OK if is_in_mission_mode(view) or not state.armed else _check_unplanned_mode(view, state.mode)


def _check_unplanned_mode(view: WatchView, mode: int) -> Finding:
    """Look at who changed the mode of a vehicle that somebody else flies."""
    state, who, name = view.state, attribute_mode_change(view.setup, view.state), mode_name(view.setup.dialect, mode)
    if who.by is Actor.FAILSAFE and who.failed is not None:
        # A battery's failsafe is said by its own name. Any other takes a vehicle from whoever flies it.
        return OK if who.failed.what == "battery" else f"went to mode {name} by its own failsafe: {who.failed.words}"
    if not state.sortie.flew_mission:
        return OK  # it never was on a mission, or a person had it before
    if who.by is Actor.FAILSAFE and view.now_s - state.telemetry.mode_since_s >= UNNAMED_S:
        return f"went to mode {name} by its own failsafe: {who.why or 'it does not say which'}"
    if who.by is Actor.UNKNOWN and is_home_mode(view.setup.dialect, mode) and is_attribution_final(state, view.now_s):
        return f"went to mode {name}, by an unknown source"
    return OK


FENCE_SEEN_S = 1.5
"""Until then a HEARTBEAT shows what it does about it by itself, which is left to it."""


def check_fence_breach(view: WatchView) -> Finding:
    """It is outside its fence, by its autopilot's word, or by its position where its fence is known here."""
    state, sensors = view.state, view.state.sensors
    if not state.armed:
        return OK
    said = describe_reported_failure(view, "fence")
    # Who did not plan the flight does not know whether the fence is well otherwise.
    bit = view.setup.planned and state.sortie.took_off and bool(sensors.unhealthy & GEOFENCE_SENSOR)
    told = sensors.fence_breached or bit
    off = describe_fence_departure(state, view.now_s, view.context.limits.link_stale_s)
    # It may be inside its fence again before it is heard that it has left its mission.
    left = state.sortie.flew_mission and not is_in_mission_mode(view)
    newly = left and view.now_s - state.telemetry.mode_since_s <= view.context.limits.alarm_s
    led = "" if said or told or off or not newly else describe_fence_action(view.setup, state)
    if not said and not told and not off and not led:
        return OK
    parts = ("its fence was breached" if led else "its fence is breached", off, said)
    return "; ".join(part for part in parts if part)


UNNAMED_S = 1.0
"""A failsafe's text may come so much later than the HEARTBEAT that shows its mode."""


def check_crash(view: WatchView) -> Finding:
    """Its autopilot says that it has crashed, or it lies as none flies."""
    if view.setup.planned and view.state.armed:
        return OK  # a text is the one thing that anybody can send
    if said := describe_reported_failure(view, "crash"):
        return said
    since_s, attitude = view.state.sensors.tilted_since_s, view.state.sensors.attitude
    if view.setup.planned or since_s is None or attitude is None or not view.state.sortie.took_off:
        return OK
    disarmed = not view.state.armed and view.now_s - since_s >= 0.0
    if not disarmed and view.now_s - since_s < view.context.limits.tilt_s:
        return OK
    return f"lies or hangs tilted by {max(abs(attitude.roll_deg), abs(attitude.pitch_deg)):.0f} degrees"


def _is_sinking(view: WatchView) -> bool:
    """Return whether its heights say what its velocity says, in a mode in which the autopilot holds its rate of sink.

    On the ground, and until a filter has settled, a velocity alone says nothing; and a pilot may let it drop.
    """
    mode, fix, before = view.state.mode, view.state.motion.fix, view.state.motion.last_fix
    if mode is None or is_manual_mode(view.setup.dialect, mode) or not view.state.sortie.took_off:
        return False
    if fix is None or before is None or fix.boot_s <= before.boot_s or is_estimate_lost(view):
        return False
    lost_m = before.alt_rel_m - fix.alt_rel_m
    # It may have begun to fall at any time since the fix before.
    return lost_m > FALLEN * view.context.limits.fall_m_s * min(fix.boot_s - before.boot_s, 1.0)


FALLEN = 0.3


def check_position_jump(view: WatchView) -> Finding:
    """Its position is suddenly elsewhere: where it is, and where it flies to, is not known any more."""
    off_m, at_s = view.state.motion.jump
    limits = view.context.limits
    if not view.setup.planned and (not is_in_mission_mode(view) or is_estimate_lost(view)):
        return OK  # it is not flown by its position; or knows itself that it is elsewhere
    jumped = off_m >= limits.jump_m and view.now_s - at_s <= limits.link_stale_s
    return f"its position jumped by {off_m:.0f} m" if jumped else OK


def check_stall(view: WatchView) -> Finding:
    """It is on its mission and does not move."""
    state, limits = view.state, view.context.limits
    fix = view.fresh_fix
    if fix is None or fix.reckoned or state.motion.anchor is None:
        return STALE
    if state.orders.held_s is not None:
        return OK  # the operator's order
    if view.setup.planned is False and not is_in_mission_mode(view):
        return OK  # somebody flies it by hand
    # By its own clock: a simulator that the computer lets wait stands still, and so does its time.
    stood_s = state.motion.stood_s
    stalls = stood_s >= (limits.stall_s if view.setup.planned else limits.unplanned_stall_s)
    return f"has not moved for {stood_s:.0f} s" if stalls else OK


_IN_THE_AIR = frozenset({Stage.FLYING, Stage.RETURNING})
_OUT_THERE = _IN_THE_AIR | {Stage.STARTING, Stage.PILOT}

CRASH = Watchpoint("crash", FaultKind.INTERRUPTION, check_crash, 0.0, FaultCode.CRASHED, _IN_THE_AIR)
TABLE: tuple[Watchpoint, ...] = (
    Watchpoint("off-pad", FaultKind.INTERRUPTION, check_unexpected_disarm, 0.0, FaultCode.DISARMED, _IN_THE_AIR),
    Watchpoint("falling", FaultKind.INTERRUPTION, check_fall, 0.4, FaultCode.FALLING, _IN_THE_AIR),
    Watchpoint("sinking", FaultKind.INTERRUPTION, height_watch.check_sinking, 2.0, FaultCode.SINKING),
    Watchpoint("thrust", FaultKind.INTERRUPTION, height_watch.check_thrust, 3.5, FaultCode.THRUST_LOST),
    Watchpoint("lies", FaultKind.DOWN, height_watch.check_grounded_on_mission, 0.0, FaultCode.DOWN),
    CRASH,
    Watchpoint("terminated", FaultKind.INTERRUPTION, check_termination, 0.0, FaultCode.TERMINATED, _IN_THE_AIR),
    Watchpoint("link", FaultKind.LINK, check_link_silence, 0.0, FaultCode.LINK_LOST, _OUT_THERE),
    Watchpoint("heartbeat", FaultKind.INTERRUPTION, streams.HEARTBEAT.check, 0.0, FaultCode.HEARTBEAT_LOST),
    Watchpoint("positions", FaultKind.INTERRUPTION, streams.POSITION.check, 0.0, FaultCode.POSITION_LOST),
    Watchpoint("battery-step", FaultKind.BATTERY, battery.check_battery_step, 2.5, FaultCode.BATTERY_STEP),
    Watchpoint("voltage-step", FaultKind.BATTERY, battery.check_voltage_step, 3.0, FaultCode.VOLTAGE_STEP),
    Watchpoint("cells", FaultKind.BATTERY, battery.check_cells, 0.0, FaultCode.CELL_WEAK),
    Watchpoint("battery-critical", FaultKind.BATTERY, battery.check_battery_status, 3.0, FaultCode.BATTERY_CRITICAL),
    Watchpoint("battery-failsafe", FaultKind.BATTERY, battery.check_battery_failsafe, 1.0, FaultCode.BATTERY_FAILSAFE),
    Watchpoint("battery-plunge", FaultKind.BATTERY, battery.check_battery_plunge, 0.4, FaultCode.BATTERY_PLUNGE),
    Watchpoint("battery-drain", FaultKind.BATTERY, battery.check_battery_drain, 2.5, FaultCode.BATTERY_DRIFT),
    Watchpoint("pack", FaultKind.BATTERY, battery.check_pack_charge, 15.0, FaultCode.PACK_SHORT),
    Watchpoint("reserve", FaultKind.BATTERY, battery.check_reserve, 5.0, FaultCode.BATTERY_LOW),
    Watchpoint("battery-reports", FaultKind.BATTERY, streams.BATTERY.check, 0.0, FaultCode.BATTERY_REPORT_LOST),
    Watchpoint("items", FaultKind.INTERRUPTION, streams.ITEM.check, 0.0, FaultCode.ITEM_LOST),
    Watchpoint("position", FaultKind.INTERRUPTION, check_position_jump, 0.0, FaultCode.POSITION_JUMP),
    Watchpoint("fence", FaultKind.FENCE, check_fence_breach, FENCE_SEEN_S, FaultCode.FENCE_BREACHED),
    Watchpoint("mode", FaultKind.INTERRUPTION, check_mission_mode, 1.0, FaultCode.MODE_CHANGED),
    Watchpoint("stall", FaultKind.INTERRUPTION, check_stall, 0.0, FaultCode.STALL),
)


_BY_STAGE = {stage: tuple(point for point in TABLE if stage in point.stages) for stage in Stage}


def judge_watchpoints(
    context: Scene, setup: VehicleSetup, state: VehicleState, now_s: float
) -> tuple[VehicleState, list[tuple[Watchpoint, str]]]:
    """Look at every watchpoint of a vehicle; return it with what they remember, and what has failed for long enough.

    The most important comes first, each with its evidence.
    """
    old = dict(state.watches)
    watches: list[tuple[str, WatchpointMemory]] = []
    raised: list[tuple[Watchpoint, str]] = []
    fine = WatchView(context, setup, state, False, now_s)
    failing = replace(fine, failing=True) if old else fine
    for point in _BY_STAGE[state.stage]:
        since = old[point.name].failing_since_s if point.name in old else None
        finding = point.judge(fine if since is None else failing)
        if finding:
            since = now_s if since is None else since
            if now_s - since >= point.raise_after_s:
                raised.append((point, finding))
        elif finding == OK:
            since = None
        if since is not None:
            watches.append((point.name, WatchpointMemory(since)))
    return state if tuple(watches) == state.watches else replace(state, watches=tuple(watches)), raised
