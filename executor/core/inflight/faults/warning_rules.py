"""Warn of conditions that may become faults: a table beside the watchpoints, over the same view.

A link degrades before it is lost, a battery before it breaks the reserve. Warnings trigger no action.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

from executor.core.inflight.faults import watch_view, watchpoints
from executor.core.inflight.faults.watch_view import WatchView
from executor.core.inflight.faults.watchpoints import BATTERY_SENSOR, LOW, assess_pack_in_flight, describe_jump
from executor.core.lines import battery, height, link, position, speed
from executor.core.state import legs
from executor.core.state.fleet_state import ReportedWarnings
from executor.core.state.mission_height import find_mission_height
from executor.core.state.vehicle_position import describe_position, is_over_pad, last_fix
from executor.core.state.vehicle_state import FaultKind, Stage
from missions import Phase

RADIO_REPORT_AGE_S = 5.0
REPEAT_S = 30.0


@dataclass(frozen=True, slots=True)
class WarningRule:
    """One row of the table."""

    name: str
    kind: FaultKind
    look: Callable[[WatchView], str]
    """Returns the warning's text, empty if all is well."""


def describe_silence(view: WatchView) -> str:
    """Warn that nothing was received for a while."""
    heard_s = view.state.link.heard_s
    age_s = 0.0 if heard_s is None else view.now_s - heard_s
    return link.SILENT.format(age_s=age_s) if age_s >= view.context.limits.link_stale_s else ""


def describe_missing_items(view: WatchView) -> str:
    """Warn that messages arrive without the current mission item."""
    return watch_view.ITEM.describe_missing(view) if view.state.stage is Stage.FLYING else ""


def describe_doubtful_disarm(view: WatchView) -> str:
    """Warn that HEARTBEAT reports disarmed while the positions contradict it."""
    doubted = view.state.telemetry.doubted is not None
    return link.DISARMED_IN_FLIGHT if doubted else ""


def describe_frame_loss(view: WatchView) -> str:
    """Warn that more frames are lost than usual."""
    quality = view.state.link.quality
    if quality.lost is None or quality.worse < view.context.limits.loss_warn:
        return ""
    return link.FRAMES_LOST.format(lost_pct=100 * quality.lost, usual_pct=100 * (quality.usual or 0.0))


def describe_radio_trouble(view: WatchView) -> str:
    """Warn of a radio's complaint, unless `channel_watch` reports it for all vehicles behind it."""
    quality = view.state.link.quality
    if watch_view.is_radio_measured(view):
        return ""
    return quality.weak if view.now_s - quality.radio_s <= RADIO_REPORT_AGE_S else ""


def describe_low_battery(view: WatchView) -> str:
    """Warn that the autopilot reports the battery low or unhealthy."""
    if view.state.power.battery.charge_state == LOW:
        return battery.REPORTED_STATE.format(state=battery.LOW)
    sick = view.state.sensors.unhealthy & BATTERY_SENSOR
    return battery.REPORTED_STATE.format(state=battery.NOT_HEALTHY) if sick else ""


def describe_doubtful_pack(view: WatchView) -> str:
    """Warn that the pack's rest voltage does not fit its percentage."""
    found = assess_pack_in_flight(view)
    return battery.PACK.format(condition=found.words) if found is not None and found.doubtful else ""


def describe_second_battery_fault(view: WatchView) -> str:
    """Warn that the battery fails too while returning from another fault; the first reason stands."""
    fault = view.state.fault
    if not view.setup.planned or fault is None or fault.kind is FaultKind.BATTERY or not view.state.armed:
        return ""
    looks = (watchpoints.check_battery_failsafe, watchpoints.check_battery_status, watchpoints.check_cells)
    return next((battery.BESIDES.format(finding=found) for look in looks if (found := look(view))), "")


def describe_reserve_risk(view: WatchView) -> str:
    """Warn that the vehicle may land below the reserve."""
    leg = view.state.leg
    if view.setup.planned and (not view.state.armed or (leg is not None and leg.phase is Phase.LAND)):
        return ""  # landing: no action is left
    chance = legs.landing_chance_below(view.context, view.state, view.setup, view.setup.reserve_pct)
    if chance is None or chance < view.context.limits.reserve_warn_chance:
        return ""
    return battery.MAY_LAND_BELOW_RESERVE.format(chance_pct=100 * chance)


GPS_LOSS_S = 2.0
"""Time without GPS after which it counts as lost; a single report is an estimator glitch."""


def gps_lost(view: WatchView) -> str:
    """Warn that GPS is lost; the position is dead-reckoned, and its error grows."""
    known = view.state.sensors.positioning
    if known.lost_s is None or (known.adrift_s is not None and view.now_s - known.lost_s < GPS_LOSS_S):
        return ""
    return position.GPS_LOST.format(why=known.why, last_fix=last_fix(view.context, view.state))


def describe_stuck_return(view: WatchView) -> str:
    """Warn that the vehicle should be returning, but hovers in place."""
    state, limits, fix, stood_s = view.state, view.context.limits, view.fresh_fix, view.state.motion.stood_s
    if state.stage is not Stage.RETURNING or fix is None or not state.armed:
        return ""
    if stood_s < limits.hangs_s or (fix.alt_rel_m < limits.airborne_m and not is_over_pad(view.context, state)):
        return ""  # low, and away from its pad, it is about to be declared down
    return speed.HANGS.format(stood_s=stood_s, position=describe_position(view.context, state))


def low(view: WatchView) -> str:
    """Warn that the vehicle flies below its mission and does not climb."""
    state, limits = view.state, view.context.limits
    if not view.setup.planned or state.stage is not Stage.FLYING or view.fresh_fix is None:
        return ""
    asked = find_mission_height(view.context, view.setup, state)
    if asked is None or asked.below_m < limits.below_mission_m or state.motion.climbs_m_s > CLIMBS_M_S:
        return ""
    return height.FLIES_LOW.format(below_m=asked.below_m)


CLIMBS_M_S = 0.1


def describe_straying(view: WatchView) -> str:
    """Warn that the vehicle flies away from its waypoint, long after it should have reached it.

    A state of PX4's main branch of July 2026 flew past waypoints and on, in mission mode and without a failsafe. It is
    a warning alone: the crew sees on the map what it does.
    """
    state, fix, known = view.state, view.fresh_fix, view.state.assignment
    if state.stage is not Stage.FLYING or not watch_view.is_in_mission_mode(view) or state.orders.held_s is not None:
        return ""
    if fix is None or fix.reckoned or known.board is None or known.leg_began is None or state.leg is None:
        return ""
    leg, end_m = known.board.legs[known.waypoint], known.board.places_m[known.waypoint]
    begin_m = known.board.places_m[max(0, known.waypoint - 1)]
    since_s = max(known.leg_began.at_s, legs.find_last_disturbance_s(state))
    late_s = view.now_s - since_s - known.pace.factor_of(state.leg.phase) * leg.duration_s
    away_m = math.dist(fix.place_m, end_m)
    recedes = sum(v * (end - at) for v, end, at in zip(fix.velocity_m_s, end_m, fix.place_m, strict=False)) < 0.0
    if not recedes or late_s < max(STRAYS_LATE_S, leg.duration_s) or away_m < math.dist(begin_m, end_m) + STRAYS_M:
        return ""
    return position.STRAYS.format(away_m=away_m, late_s=late_s)


STRAYS_LATE_S, STRAYS_M = 30.0, 30.0
"""Delay, and distance beyond the leg's length, that neither a gust nor a wide turn explains."""


TABLE: tuple[WarningRule, ...] = (
    WarningRule("silent", FaultKind.LINK, describe_silence),
    WarningRule("heartbeat", FaultKind.LINK, watch_view.HEARTBEAT.describe_missing),
    WarningRule("disarmed", FaultKind.INTERRUPTION, describe_doubtful_disarm),
    WarningRule("positions", FaultKind.INTERRUPTION, watch_view.POSITION.describe_missing),
    WarningRule("items", FaultKind.INTERRUPTION, describe_missing_items),
    WarningRule("loss", FaultKind.LINK, describe_frame_loss),
    WarningRule("radio", FaultKind.LINK, describe_radio_trouble),
    WarningRule("battery-silent", FaultKind.BATTERY, watch_view.BATTERY.describe_missing),
    WarningRule("battery-low", FaultKind.BATTERY, describe_low_battery),
    WarningRule("pack", FaultKind.BATTERY, describe_doubtful_pack),
    WarningRule("battery-besides", FaultKind.BATTERY, describe_second_battery_fault),
    WarningRule("reserve", FaultKind.BATTERY, describe_reserve_risk),
    WarningRule("gps", FaultKind.INTERRUPTION, gps_lost),
    WarningRule("position", FaultKind.INTERRUPTION, lambda view: describe_jump(view, view.context.limits.jump_warn_m)),
    WarningRule("low", FaultKind.INTERRUPTION, low),
    WarningRule("strays", FaultKind.INTERRUPTION, describe_straying),
    WarningRule("stands", FaultKind.INTERRUPTION, describe_stuck_return),
)


def find_new_warnings(view: WatchView, before: ReportedWarnings) -> tuple[ReportedWarnings, tuple[str, ...]]:
    """Return the warnings not reported yet, for the operator of a live flight.

    `link_loss` reports silences; a warning that recurs within `REPEAT_S` is not new.
    """
    now = [(row.name, words) for row, words in find_warnings(view) if row.look is not describe_silence]
    if not now and not before:
        return before, ()
    known = {name: at_s for name, at_s in before if view.now_s - at_s < REPEAT_S}
    new = tuple(f"{view.state.name}: {words}" for name, words in now if name not in known)
    return tuple({**known, **dict.fromkeys((name for name, _ in now), view.now_s)}.items()), new


def find_warnings(view: WatchView) -> tuple[tuple[WarningRule, str], ...]:
    """Evaluate every row; return the active ones with their texts."""
    if view.state.is_at_rest:
        return ()
    return tuple((row, words) for row in TABLE if (words := row.look(view)))
