"""Evaluate the watchpoints, a table of faults a vehicle may have, as levels on every tick.

Each returns OK, FAIL or STALE. FAIL must persist for `raise_after_s` to be a fault; STALE neither starts nor ends that
time, so that the last battery report of a silent vehicle raises nothing. One arbiter picks one reason.

A vehicle that loses thrust sinks slowly, in mission mode, and its autopilot may not report it: its height is compared
with its mission's, and with its autopilot's own target.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace
from functools import partial

from executor.core.battery import account, cusum
from executor.core.battery.pack_condition import PackCondition, assess_pack
from executor.core.context import Scene, VehicleSetup
from executor.core.fault_thresholds import Limits
from executor.core.inflight.custody.mode_causes import (
    GEOFENCE_SENSOR,
    attribute_mode_change,
    describe_fence_action,
    is_attribution_final,
)
from executor.core.inflight.faults import watch_view
from executor.core.inflight.faults.watch_view import (
    OK,
    STALE,
    Finding,
    Watchpoint,
    WatchView,
    alarm_words,
    describe_reported_failure,
    has_failed_lately,
    is_estimate_lost,
    is_in_mission_mode,
)
from executor.core.interface.messages import Actor
from executor.core.lines import battery, failsafe, height, landing, link, position, speed
from executor.core.state import legs, vehicle_position
from executor.core.state.mission_height import GROUND_ITEMS, find_mission_height, is_stopped_below_mission, item_of
from executor.core.state.onboard_fence import describe_fence_departure
from executor.core.state.vehicle_parts import ModeCause
from executor.core.state.vehicle_state import FaultCode, FaultKind, Stage, VehicleState
from executor.core.telemetry.battery_reports import pack_facts_of
from missions import Phase
from missions.autopilots.dialect import is_home_mode, is_manual_mode, mode_name

LOW = 2
"""MAV_BATTERY_CHARGE_STATE_LOW."""
BATTERY_SENSOR = 0x2000000
"""MAV_SYS_STATUS_SENSOR_BATTERY."""
NEAR_PCT = 15.0
"""Charge above the reserve within which a low-battery alarm by voltage is credible."""
PLUNGE = 1.7
"""Factor on the threshold of a drain."""


def check_battery_step(view: WatchView) -> Finding:
    """Check for charge lost at once."""
    limits, power, known = view.context.limits, view.state.power, view.state.power.battery
    # A percentage that does not follow its counter needs a voltage drop with it.
    refuted = account.is_blind(known) and account.has_running_counter(known) and power.volts.dropped_s is None
    if not _is_battery_fresh(view) or refuted:
        return STALE
    window_s = limits.battery_step_window_s
    long_s = 4 * window_s
    # While it fails the window moves on, and a step may have gone unevaluated.
    fell = known.drift.jumped_pct >= limits.battery_step_pct and view.now_s - known.drift.jumped_s <= long_s
    excess, expected = account.excess_pct(known, long_s if view.failing or fell else window_s)
    if excess < limits.battery_step_pct:
        return OK
    return battery.STEP.format(lost_pct=excess + expected, usual_pct=expected)


def _check_drain(view: WatchView, *, hurried: bool) -> Finding:
    if not _is_battery_fresh(view):
        return STALE
    limits, known, fix = view.context.limits, view.state.power.battery, view.state.motion.fix
    climbs = fix is not None and fix.velocity_m_s[2] > limits.climbs_m_s
    eased = (2.0 if climbs else 1.0) * (0.8 if view.failing else 1.0)
    for found, threshold, which in _iterate_excesses(known, limits, hurried=hurried):
        if cusum.is_drain(found, eased * threshold, limits.battery_step_pct):
            lasts_s, usual_pct = found.duration_s(view.now_s), found.expected_pct
            return battery.DRAIN.format(used_pct=found.used_pct, time_s=lasts_s, usual_pct=usual_pct, counted=which)
    return OK


check_battery_drain = partial(_check_drain, hurried=False)
"""Consumption above the flight's, by more than a climb or a gust explains."""
check_battery_plunge = partial(_check_drain, hurried=True)
"""Consumption so far above that there is no time for another report."""


def _iterate_excesses(
    known: account.BatteryState, limits: Limits, *, hurried: bool
) -> Iterator[tuple[cusum.Drift, float, str]]:
    """Yield the consumption beyond the usual by each count, with its threshold and its name."""
    share, blind = PLUNGE if hurried else 1.0, account.is_blind(known)
    yield known.charge.drift, share * limits.charge_excess_pct, battery.BY_COUNTER
    if blind and account.has_running_counter(known):
        return  # the percentage and the counter measure different things
    excess_pct = limits.blind_excess_pct if blind else share * (limits.battery_excess_pct + known.roughness_pct)
    yield known.drift, excess_pct, ""
    if not hurried:
        yield known.slow, limits.slow_blind_pct if blind else limits.slow_excess_pct, battery.OVER_MINUTES


def check_voltage_step(view: WatchView) -> Finding:
    """Check for a voltage drop beyond what the load explains."""
    volts, limits = view.state.power.volts, view.context.limits
    if view.now_s - volts.reported_s > limits.battery_stale_s:
        return STALE
    threshold = limits.voltage_step if volts.known_load else limits.voltage_step_blind
    if not volts.known_load and not view.setup.planned and _is_driven_hard(view):
        return STALE  # its load is unknown, and not the usual one
    if view.failing:
        threshold *= 0.7
    if volts.usual_v is None or volts.voltage_v is None or volts.dropped_s is None or volts.drop < threshold:
        return OK
    expected_v = volts.usual_v if volts.expected_v is None else volts.expected_v
    return battery.VOLTAGE_STEP.format(voltage_v=volts.voltage_v, usual_v=expected_v)


def _is_driven_hard(view: WatchView) -> bool:
    """Return whether it climbs, falls or reports another failure: its motors then draw more than usual."""
    fix, failed = view.state.motion.fix, view.state.evidence.failed
    moves = fix is not None and abs(fix.velocity_m_s[2]) > view.context.limits.climbs_m_s
    said_s = max((at_s for one, at_s in failed if one.what != "battery"), default=float("-inf"))
    return moves or view.now_s - max(said_s, view.state.telemetry.alarm[1]) <= view.context.limits.alarm_s


def check_cells(view: WatchView) -> Finding:
    """Check for a cell almost empty, or far below the others, for longer than a climb."""
    volts, limits = view.state.power.volts, view.context.limits
    if view.now_s - volts.reported_s > limits.battery_stale_s:
        return STALE
    if volts.spread_since_s is not None and view.now_s - volts.spread_since_s >= limits.cell_low_s:
        return battery.CELL_BELOW_OTHERS.format(cell_v=min(volts.cells_v), below_v=volts.spread_v)
    if volts.low_since_s is not None and view.now_s - volts.low_since_s >= limits.cell_low_s:
        return battery.CELL_LOW.format(cell_v=volts.weakest_v or 0.0)
    return OK


def check_reserve(view: WatchView) -> Finding:
    """Check whether the mission on board, or an RTL if none is known, would end below the reserve."""
    leg, limits = view.state.leg, view.context.limits
    if leg is not None and leg.phase in {Phase.RETURN, Phase.LAND}:
        return OK  # already returning: no command would help
    floor_pct = view.setup.reserve_pct - limits.reserve_slack_pct
    chance = legs.landing_chance_below(view.context, view.state, view.setup, floor_pct)
    if chance is None or not _is_battery_fresh(view):
        return STALE
    if chance < (limits.reserve_clear_chance if view.failing else limits.reserve_chance):
        return OK
    ahead = legs.project_landing(view.context, view.state, view.setup)
    if ahead is None:
        return STALE
    return battery.LANDS_BELOW_RESERVE.format(
        left_pct=ahead.mean_pct, band_pct=ahead.band_pct, reserve_pct=view.setup.reserve_pct, chance_pct=100 * chance
    )


def check_pack_charge(view: WatchView) -> Finding:
    """Check whether the pack holds much less than counted, by its rest voltage."""
    if view.now_s - view.state.power.volts.reported_s > view.context.limits.battery_stale_s:
        return STALE
    found = assess_pack_in_flight(view)
    if found is None or not found.in_flight:
        return OK if found is None else STALE
    fails = found.nearly_empty or (found.falls_short and not _is_pack_sufficient(view, found))
    return battery.PACK.format(condition=found.words) if fails else OK


def _is_pack_sufficient(view: WatchView, found: PackCondition) -> bool:
    """Return whether a planned flight is possible even with a pack that gives less than it counts.

    That it gives less is certain by then, so the likely ratio is used: a real ArduPilot with half a pack fell where the
    lenient one, for an unstated chemistry, still called the rest sufficient.
    """
    rest = view.state.power.pack.rest
    ahead = legs.project_landing(view.context, view.state, view.setup) if view.setup.planned else None
    if ahead is None or rest is None or found.times is None or found.likely_times is None:
        return False
    honest_pct = view.setup.pack.honest_pct
    began_pct, reserve_pct = honest_pct(rest.claimed_pct), honest_pct(view.setup.reserve_pct)
    times = max(found.times, found.likely_times)
    return began_pct - times * (began_pct - honest_pct(ahead.mean_pct)) >= reserve_pct


def assess_pack_in_flight(view: WatchView) -> PackCondition | None:
    """Return the condition of its pack by voltage and percentage; None if unknown."""
    power, dialect = view.state.power, view.setup.dialect
    if dialect.rounds_twice and account.is_blind(power.battery):
        return None  # PX4 without a counter derives its percentage from the same voltage
    facts = pack_facts_of(view.context, view.state)
    return assess_pack(power.pack, power.volts.cells, facts, power.battery.remaining_pct, view.now_s)


def check_battery_failsafe(view: WatchView) -> Finding:
    """Check whether the autopilot reports that its battery failsafe acts."""
    said = describe_reported_failure(view, "battery")
    # Anybody can send a text: it must be confirmed by something else.
    return said if said and (not view.setup.planned or _is_alarm_confirmed(view)) else OK


def _is_alarm_confirmed(view: WatchView) -> bool:
    """Return whether a battery alarm shows in anything besides its text."""
    state, power, volts = view.state, view.state.power, view.state.power.volts
    if state.is_critical or (state.mode is not None and not is_in_mission_mode(view)):
        return True
    left_pct = power.battery.remaining_pct
    low = left_pct is None or left_pct <= view.setup.reserve_pct + NEAR_PCT
    sick = power.battery.charge_state >= LOW or power.battery_faults or state.sensors.unhealthy & BATTERY_SENSOR
    return bool(low or sick or volts.low_since_s is not None or volts.spread_since_s is not None or volts.dropped_s)


def check_battery_status(view: WatchView) -> Finding:
    """Check whether the autopilot reports the battery critical, failed or unhealthy."""
    if not _is_battery_fresh(view):
        return STALE
    if state := battery.STATES.get(view.state.power.battery.charge_state):
        return battery.REPORTED_STATE.format(state=state)
    bits = [words for bit, words in battery.FAULTS.items() if view.state.power.battery_faults & bit]
    return battery.REPORTED_FAULTS.format(faults=", ".join(bits)) if bits else OK


def _is_battery_fresh(view: WatchView) -> bool:
    # PX4 sends BATTERY_STATUS every 2 s; three are awaited.
    fresh = view.now_s - view.state.power.battery.reported_s <= view.context.limits.battery_stale_s
    # Without positions the flight's expected consumption is unknown.
    positions_come = view.state.motion.fix is None or view.fresh_fix is not None
    return fresh and (positions_come or not view.setup.planned)


MOST_WORDS_S = 10.0
"""Time for which a reported thrust loss, which alone decides nothing, supports an observation."""
LEAST_TARGET_M_S = 0.8
"""Descent rate at which a vehicle metres below its autopilot's target is out of control."""
TARGET_S = 3.5
LYING_UP_M = 1.5
"""Height over home at which it may be on the ground."""
LYING_S = 5.0
DROPPED_S = 4.0
"""Time before coming to rest within which it dropped."""


def check_sinking(view: WatchView) -> Finding:
    """Check whether it is far below its mission and sinks faster than the mission descends."""
    if view.fresh_fix is None:
        return STALE
    asked = find_mission_height(view.context, view.setup, view.state)
    if asked is None or (not view.setup.planned and is_estimate_lost(view)):
        return OK
    limits, climbs_m_s = view.context.limits, view.state.motion.climbs_m_s
    least_m = limits.below_mission_m * (0.5 if has_failed_lately(view, {"motor"}, MOST_WORDS_S) else 1.0)
    if asked.below_m < least_m or climbs_m_s >= -asked.sinks_m_s - limits.sinks_m_s:
        return OK
    return height.SINKS.format(sinks_m_s=-climbs_m_s, below_m=asked.below_m, says=alarm_words(view))


def check_thrust(view: WatchView) -> Finding:
    """Check whether it sinks though its autopilot wants more height."""
    own = view.state.own
    if view.fresh_fix is None:
        return STALE
    if not is_in_mission_mode(view) or not view.state.sortie.took_off or view.now_s - own.below_s > TARGET_S:
        return OK
    if _is_taking_off_or_landing(view) or (not view.setup.planned and is_estimate_lost(view)):
        return OK
    limits, climbs_m_s = view.context.limits, view.state.motion.climbs_m_s
    least_m = limits.below_target_m * (0.5 if has_failed_lately(view, {"motor"}, MOST_WORDS_S) else 1.0)
    if own.below_m < least_m or climbs_m_s >= -LEAST_TARGET_M_S:
        return OK
    return height.SINKS_UNWANTED.format(sinks_m_s=-climbs_m_s, below_m=own.below_m, says=alarm_words(view))


def check_grounded_on_mission(view: WatchView) -> Finding:
    """Check whether it is on the ground in mid-mission, armed."""
    fix, state, stood_s = view.fresh_fix, view.state, view.state.motion.stood_s
    if fix is None or state.motion.anchor is None:
        return STALE
    if view.setup.planned:
        lies = is_stopped_below_mission(view.context, view.setup, state)
        return landing.STOPPED.format(down=vehicle_position.describe_down_place(view.context, state)) if lies else OK
    if not is_in_mission_mode(view) or not state.sortie.took_off or _is_taking_off_or_landing(view):
        return OK
    if stood_s < LYING_S:
        return OK
    dropped = state.motion.drops_s >= view.now_s - stood_s - DROPPED_S and fix.alt_rel_m <= LYING_UP_M
    if not dropped and not is_stopped_below_mission(view.context, view.setup, state):
        return OK
    line = height.LIES_AFTER_DROP if dropped else height.LIES
    return line.format(stood_s=stood_s, up_m=max(0.0, fix.alt_rel_m), says=alarm_words(view))


def _is_taking_off_or_landing(view: WatchView) -> bool:
    leg, item = view.state.leg, item_of(view.state.own, view.state.own.leads_to)
    if leg is not None and leg.phase in {Phase.TAKEOFF, Phase.LAND}:
        return True
    return item is not None and item.command in GROUND_ITEMS


def check_link_silence(view: WatchView) -> Finding:
    """Check whether nothing was received for the vehicle's time-out."""
    heard_s = view.state.link.heard_s
    if heard_s is None:
        return STALE
    age_s = view.now_s - heard_s
    if age_s >= view.setup.link_timeout_s:
        return link.LOST.format(age_s=age_s, timeout_s=view.setup.link_timeout_s)
    ages_s = (watch_view.HEARTBEAT.age_s(view), watch_view.POSITION.age_s(view))
    unseen_s = 0.0 if any(map(math.isnan, ages_s)) else min(ages_s)  # not before both have arrived
    unseen = view.setup.planned and unseen_s >= max(watch_view.UNSEEN_S, view.setup.link_timeout_s)
    return link.UNSEEN.format(age_s=unseen_s) if unseen else OK


def check_unexpected_disarm(view: WatchView) -> Finding:  # noqa: C901, PLR0911 - one return for each reason
    """Check whether it disarmed where or when it should not have landed."""
    state, limits = view.state, view.context.limits
    if state.motion.fix is None or state.telemetry.heartbeat is None:
        return STALE
    if state.armed or not state.sortie.armed_once:
        return OK
    if not view.setup.planned:
        return _check_disarm_in_flight(view)
    away_m, says = view.setup.pad_distance_m(state.motion.fix.place_m), alarm_words(view)
    if not vehicle_position.is_resting_place_known(state, view.now_s):
        return STALE  # its position is from before a silence or a reboot
    if state.stage is Stage.PILOT:
        return OK  # its pilot may disarm it anywhere
    if vehicle_position.is_dead_reckoning(state):
        return landing.DISARMED_WITHOUT_GPS.format(says=says)
    if away_m > limits.off_pad_m:
        return landing.DISARMED_OFF_PAD.format(away_m=away_m, up_m=state.motion.fix.alt_rel_m, says=says)
    # An old position does not show its height: it may have descended since.
    if vehicle_position.has_fallen(view.context, state) and view.now_s - state.motion.fix.at_s <= limits.link_stale_s:
        return landing.DISARMED_OVER_PAD.format(up_m=state.motion.fix.alt_rel_m, says=says)
    if not state.sortie.took_off and state.stage is Stage.FLYING:
        return landing.DISARMED_BEFORE_TAKEOFF.format(says=says)
    if state.sortie.rebooted_s is not None:
        return landing.DISARMED_BY_REBOOT.format(says=says)
    return (
        OK if vehicle_position.has_mission_ended(view.context, state) else landing.DISARMED_IN_MISSION.format(says=says)
    )


def _check_disarm_in_flight(view: WatchView) -> Finding:
    """Judge a disarmed vehicle that may land anywhere: it must be at rest."""
    fix, limits = view.fresh_fix, view.context.limits
    if fix is None or view.state.telemetry.on_ground:
        return OK
    speed_m_s = math.hypot(*fix.velocity_m_s)
    if fix.alt_rel_m <= limits.off_pad_up_m or speed_m_s <= limits.at_rest_m_s:
        return OK
    return landing.DISARMED_MOVING.format(up_m=fix.alt_rel_m, speed_m_s=speed_m_s, says=alarm_words(view))


def check_termination(view: WatchView) -> Finding:
    """Check whether its HEARTBEAT reports flight termination."""
    heartbeat = view.state.telemetry.heartbeat
    if heartbeat is None:
        return STALE
    state = failsafe.STATES.get(heartbeat.system_status) if heartbeat.armed else None
    return failsafe.REPORTS.format(state=state, says=alarm_words(view)) if state else OK


def check_fall(view: WatchView) -> Finding:
    """Check whether it sinks faster than ever commanded."""
    fix = view.fresh_fix
    if fix is None:
        return STALE
    if not view.setup.planned and not _is_sinking(view):
        return OK
    up_m_s = fix.velocity_m_s[2]
    return height.FALLS.format(sinks_m_s=-up_m_s) if up_m_s < -view.context.limits.fall_m_s else OK


def check_mission_mode(view: WatchView) -> Finding:
    """Check for a mode set by the vehicle's failsafe."""
    state = view.state
    if state.mode is None:
        return STALE
    if check_fence_breach(view):
        return OK  # reported under its own name
    dialect = view.setup.dialect
    if view.setup.planned:
        if not state.armed or state.custody.cause is not ModeCause.FAILSAFE:
            return OK
        return failsafe.MODE.format(mode=mode_name(dialect, state.mode), says=alarm_words(view))
    return OK if is_in_mission_mode(view) or not state.armed else _check_unplanned_mode(view, state.mode)


def _check_unplanned_mode(view: WatchView, mode: int) -> Finding:
    """Judge a mode change of a vehicle flown by others."""
    state, who, name = view.state, attribute_mode_change(view.setup, view.state), mode_name(view.setup.dialect, mode)
    if who.by is Actor.FAILSAFE and who.failed is not None:
        # A battery failsafe is reported under its own name. Any other one takes the vehicle from its operator.
        is_battery = who.failed.what == "battery"
        says = failsafe.ALSO_SAYS.format(words=who.failed.words)
        return OK if is_battery else failsafe.MODE.format(mode=name, says=says)
    if not state.sortie.flew_mission:
        return OK  # never on a mission, or a person had it before
    if who.by is Actor.FAILSAFE and view.now_s - state.telemetry.mode_since_s >= UNNAMED_S:
        return failsafe.MODE.format(mode=name, says=f"; {who.why or failsafe.UNNAMED}")
    if who.by is Actor.UNKNOWN and is_home_mode(view.setup.dialect, mode) and is_attribution_final(state, view.now_s):
        return failsafe.MODE_OF_UNKNOWN.format(mode=name)
    return OK


FENCE_SEEN_S = 1.5
"""Time for a HEARTBEAT to show its own reaction, which is left to act."""


def check_fence_breach(view: WatchView) -> Finding:
    """Check for a fence breach, reported by its autopilot, or by its position if the fence is known."""
    state, sensors = view.state, view.state.sensors
    if not state.armed:
        return OK
    said = describe_reported_failure(view, "fence")
    # Without the flight's plan it is unknown whether the fence is otherwise sound.
    bit = view.setup.planned and state.sortie.took_off and bool(sensors.unhealthy & GEOFENCE_SENSOR)
    told = sensors.fence_breached or bit
    off = describe_fence_departure(state, view.now_s, view.context.limits.link_stale_s)
    # It may be back inside before the mode change is received.
    left = state.sortie.flew_mission and not is_in_mission_mode(view)
    newly = left and view.now_s - state.telemetry.mode_since_s <= view.context.limits.alarm_s
    led = "" if said or told or off or not newly else describe_fence_action(view.setup, state)
    if not said and not told and not off and not led:
        return OK
    parts = (position.FENCE_WAS_BREACHED if led else position.FENCE_BREACHED, off, said)
    return "; ".join(part for part in parts if part)


UNNAMED_S = 1.0
"""Longest delay of a failsafe's text after the HEARTBEAT with its mode."""


def check_crash(view: WatchView) -> Finding:
    """Check whether its autopilot reports a crash, or it is tilted as none flies."""
    if view.setup.planned and view.state.armed:
        return OK  # anybody can send a text
    if said := describe_reported_failure(view, "crash"):
        return said
    since_s, attitude = view.state.sensors.tilted_since_s, view.state.sensors.attitude
    if view.setup.planned or since_s is None or attitude is None or not view.state.sortie.took_off:
        return OK
    disarmed = not view.state.armed and view.now_s - since_s >= 0.0
    if not disarmed and view.now_s - since_s < view.context.limits.tilt_s:
        return OK
    return landing.TILTED.format(tilt_deg=max(abs(attitude.roll_deg), abs(attitude.pitch_deg)))


def _is_sinking(view: WatchView) -> bool:
    """Return whether its heights confirm its velocity, in a mode in which the autopilot controls descent.

    On the ground, and until a filter has settled, a velocity alone shows nothing; and a pilot may let it drop.
    """
    mode, fix, before = view.state.mode, view.state.motion.fix, view.state.motion.last_fix
    if mode is None or is_manual_mode(view.setup.dialect, mode) or not view.state.sortie.took_off:
        return False
    if fix is None or before is None or fix.boot_s <= before.boot_s or is_estimate_lost(view):
        return False
    lost_m = before.alt_rel_m - fix.alt_rel_m
    # The fall may have begun at any time since the fix before.
    return lost_m > FALLEN * view.context.limits.fall_m_s * min(fix.boot_s - before.boot_s, 1.0)


FALLEN = 0.3


def check_position_jump(view: WatchView) -> Finding:
    """Check for a position jump: its position and course are then unknown."""
    if not view.setup.planned and (not is_in_mission_mode(view) or is_estimate_lost(view)):
        return OK  # it does not fly by its position, or knows of the error
    return describe_jump(view, view.context.limits.jump_m)


def describe_jump(view: WatchView, least_m: float) -> str:
    """Return in words that its position has just jumped by at least `least_m`; empty otherwise."""
    off_m, at_s = view.state.motion.jump
    jumped = off_m >= least_m and view.now_s - at_s <= view.context.limits.link_stale_s
    return position.JUMPED.format(off_m=off_m) if jumped else ""


def check_stall(view: WatchView) -> Finding:
    """Check whether it stands still on its mission."""
    state, limits = view.state, view.context.limits
    fix = view.fresh_fix
    if fix is None or fix.reckoned or state.motion.anchor is None:
        return STALE
    if state.orders.held_s is not None:
        return OK  # on the operator's intent
    if view.setup.planned is False and not is_in_mission_mode(view):
        return OK  # flown by hand
    # By the vehicle's clock: a simulator delayed by its computer stands still, and so does its time.
    stood_s = state.motion.stood_s
    stalls = stood_s >= (limits.stall_s if view.setup.planned else limits.unplanned_stall_s)
    return speed.STALLS.format(stood_s=stood_s) if stalls else OK


_IN_THE_AIR = frozenset({Stage.FLYING, Stage.RETURNING})
_OUT_THERE = _IN_THE_AIR | {Stage.STARTING, Stage.PILOT}

CRASH = Watchpoint("crash", FaultKind.INTERRUPTION, check_crash, 0.0, FaultCode.CRASHED, _IN_THE_AIR)
TABLE: tuple[Watchpoint, ...] = (
    Watchpoint("off-pad", FaultKind.INTERRUPTION, check_unexpected_disarm, 0.0, FaultCode.DISARMED, _IN_THE_AIR),
    Watchpoint("falling", FaultKind.INTERRUPTION, check_fall, 0.4, FaultCode.FALLING, _IN_THE_AIR),
    Watchpoint("sinking", FaultKind.INTERRUPTION, check_sinking, 2.0, FaultCode.SINKING),
    Watchpoint("thrust", FaultKind.INTERRUPTION, check_thrust, 3.5, FaultCode.THRUST_LOST),
    Watchpoint("lies", FaultKind.DOWN, check_grounded_on_mission, 0.0, FaultCode.DOWN),
    CRASH,
    Watchpoint("terminated", FaultKind.INTERRUPTION, check_termination, 0.0, FaultCode.TERMINATED, _IN_THE_AIR),
    Watchpoint("link", FaultKind.LINK, check_link_silence, 0.0, FaultCode.LINK_LOST, _OUT_THERE),
    Watchpoint("heartbeat", FaultKind.INTERRUPTION, watch_view.HEARTBEAT.check, 0.0, FaultCode.HEARTBEAT_LOST),
    Watchpoint("positions", FaultKind.INTERRUPTION, watch_view.POSITION.check, 0.0, FaultCode.POSITION_LOST),
    Watchpoint("battery-step", FaultKind.BATTERY, check_battery_step, 2.5, FaultCode.BATTERY_STEP),
    Watchpoint("voltage-step", FaultKind.BATTERY, check_voltage_step, 3.0, FaultCode.VOLTAGE_STEP),
    Watchpoint("cells", FaultKind.BATTERY, check_cells, 0.0, FaultCode.CELL_WEAK),
    Watchpoint("battery-critical", FaultKind.BATTERY, check_battery_status, 3.0, FaultCode.BATTERY_CRITICAL),
    Watchpoint("battery-failsafe", FaultKind.BATTERY, check_battery_failsafe, 1.0, FaultCode.BATTERY_FAILSAFE),
    Watchpoint("battery-plunge", FaultKind.BATTERY, check_battery_plunge, 0.4, FaultCode.BATTERY_PLUNGE),
    Watchpoint("battery-drain", FaultKind.BATTERY, check_battery_drain, 2.5, FaultCode.BATTERY_DRIFT),
    Watchpoint("pack", FaultKind.BATTERY, check_pack_charge, 15.0, FaultCode.PACK_SHORT),
    Watchpoint("reserve", FaultKind.BATTERY, check_reserve, 5.0, FaultCode.BATTERY_LOW),
    Watchpoint("battery-reports", FaultKind.BATTERY, watch_view.BATTERY.check, 0.0, FaultCode.BATTERY_REPORT_LOST),
    Watchpoint("items", FaultKind.INTERRUPTION, watch_view.ITEM.check, 0.0, FaultCode.ITEM_LOST),
    Watchpoint("position", FaultKind.INTERRUPTION, check_position_jump, 0.0, FaultCode.POSITION_JUMP),
    Watchpoint("fence", FaultKind.FENCE, check_fence_breach, FENCE_SEEN_S, FaultCode.FENCE_BREACHED),
    Watchpoint("mode", FaultKind.INTERRUPTION, check_mission_mode, 1.0, FaultCode.MODE_CHANGED),
    Watchpoint("stall", FaultKind.INTERRUPTION, check_stall, 0.0, FaultCode.STALL),
)


_BY_STAGE = {stage: tuple(point for point in TABLE if stage in point.stages) for stage in Stage}


def judge_watchpoints(
    context: Scene, setup: VehicleSetup, state: VehicleState, now_s: float
) -> tuple[VehicleState, list[tuple[Watchpoint, str]]]:
    """Evaluate all watchpoints of a vehicle; return it with their onsets, and the failures that have persisted.

    The most important comes first, each with its evidence.
    """
    old = dict(state.watches)
    watches: list[tuple[str, float]] = []
    raised: list[tuple[Watchpoint, str]] = []
    fine = WatchView(context, setup, state, False, now_s)
    failing = replace(fine, failing=True) if old else fine
    for point in _BY_STAGE[state.stage]:
        since = old.get(point.name)
        finding = point.judge(fine if since is None else failing)
        if finding:
            since = now_s if since is None else since
            if now_s - since >= point.raise_after_s:
                raised.append((point, finding))
        elif finding == OK:
            since = None
        if since is not None:
            watches.append((point.name, since))
    return state if tuple(watches) == state.watches else replace(state, watches=tuple(watches)), raised
