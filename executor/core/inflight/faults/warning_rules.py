"""What is not well yet no fault: a table of warnings beside that of the watchpoints, over the same view.

A link is degraded before it is lost, a battery before it breaks the reserve. Warnings decide nothing.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from executor.core.inflight.faults import watch_view, watchpoints
from executor.core.inflight.faults.watch_view import WatchView
from executor.core.inflight.faults.watchpoints import BATTERY_SENSOR, LOW, assess_pack_in_flight, describe_jump
from executor.core.lines import battery, height, link, position, speed
from executor.core.state import legs
from executor.core.state.fleet_state import ReportedWarnings
from executor.core.state.mission_height import find_mission_height
from executor.core.state.vehicle_position import describe_position, last_fix
from executor.core.state.vehicle_state import FaultKind, Stage
from missions import Phase

RADIO_S = 5.0
AGAIN_S = 30.0


@dataclass(frozen=True, slots=True)
class WarningRule:
    """One row."""

    name: str
    kind: FaultKind
    look: Callable[[WatchView], str]
    """What is not well, in words; nothing if it is."""


def describe_silence(view: WatchView) -> str:
    """Nothing was heard for a while."""
    heard_s = view.state.link.heard_s
    age_s = 0.0 if heard_s is None else view.now_s - heard_s
    return link.SILENT.format(age_s=age_s) if age_s >= view.context.limits.link_stale_s else ""


def describe_missing_items(view: WatchView) -> str:
    """It speaks, and not of where it flies to."""
    return watch_view.ITEM.describe_missing(view) if view.state.stage is Stage.FLYING else ""


def describe_doubtful_disarm(view: WatchView) -> str:
    """A HEARTBEAT says what its positions refute."""
    doubted = view.state.telemetry.doubted is not None
    return link.DISARMED_IN_FLIGHT if doubted else ""


def describe_frame_loss(view: WatchView) -> str:
    """More frames are lost than usual."""
    quality = view.state.link.quality
    if quality.lost is None or quality.worse < view.context.limits.loss_warn:
        return ""
    return link.FRAMES_LOST.format(lost_pct=100 * quality.lost, usual_pct=100 * (quality.usual or 0.0))


def describe_radio_trouble(view: WatchView) -> str:
    """The radio itself complains, and nobody says so of it and all vehicles behind it: see `channel_watch`."""
    quality = view.state.link.quality
    if watch_view.is_radio_measured(view):
        return ""
    return quality.weak if view.now_s - quality.radio_s <= RADIO_S else ""


def describe_low_battery(view: WatchView) -> str:
    """The autopilot calls it low, or not healthy."""
    if view.state.power.battery.charge_state == LOW:
        return battery.REPORTED_STATE.format(state=battery.LOW)
    sick = view.state.sensors.unhealthy & BATTERY_SENSOR
    return battery.REPORTED_STATE.format(state=battery.NOT_HEALTHY) if sick else ""


def describe_doubtful_pack(view: WatchView) -> str:
    """Its resting voltage does not fit its percentage."""
    found = assess_pack_in_flight(view)
    return battery.PACK.format(condition=found.words) if found is not None and found.doubtful else ""


def describe_second_battery_fault(view: WatchView) -> str:
    """Its battery fails too, on its way home from another fault: the first reason stands, and this is said."""
    fault = view.state.fault
    if not view.setup.planned or fault is None or fault.kind is FaultKind.BATTERY or not view.state.armed:
        return ""
    looks = (watchpoints.check_battery_failsafe, watchpoints.check_battery_status, watchpoints.check_cells)
    return next((battery.BESIDES.format(finding=found) for look in looks if (found := look(view))), "")


def describe_reserve_risk(view: WatchView) -> str:
    """It may well land below the reserve."""
    leg = view.state.leg
    if view.setup.planned and (not view.state.armed or (leg is not None and leg.phase is Phase.LAND)):
        return ""  # it lands: nothing more can be done about it
    chance = legs.landing_chance_below(view.context, view.state, view.setup, view.setup.reserve_pct)
    if chance is None or chance < view.context.limits.reserve_warn_chance:
        return ""
    return battery.MAY_LAND_BELOW_RESERVE.format(chance_pct=100 * chance)


ESTIMATOR_S = 2.0
"""An estimator that leaves GPS for a single report is no loss."""


def gps_lost(view: WatchView) -> str:
    """Its GPS is lost: where it is, is reckoned, and worth less with every second."""
    known = view.state.sensors.positioning
    if known.lost_s is None or (known.adrift_s is not None and view.now_s - known.lost_s < ESTIMATOR_S):
        return ""
    return position.GPS_LOST.format(why=known.why, last_fix=last_fix(view.context, view.state))


def describe_stuck_return(view: WatchView) -> str:
    """It should be on its way home, and hangs in the air where it is."""
    state, limits, fix, stood_s = view.state, view.context.limits, view.fresh_fix, view.state.motion.stood_s
    if state.stage is not Stage.RETURNING or fix is None or not state.armed:
        return ""
    if stood_s < limits.hangs_s or fix.alt_rel_m < limits.airborne_m:
        return ""
    return speed.HANGS.format(stood_s=stood_s, position=describe_position(view.context, state))


def low(view: WatchView) -> str:
    """It flies below its mission, and does not climb."""
    state, limits = view.state, view.context.limits
    if not view.setup.planned or state.stage is not Stage.FLYING or view.fresh_fix is None:
        return ""
    asked = find_mission_height(view.context, view.setup, state)
    if asked is None or asked.below_m < limits.below_mission_m or state.motion.climbs_m_s > CLIMBS_M_S:
        return ""
    return height.FLIES_LOW.format(below_m=asked.below_m)


CLIMBS_M_S = 0.1


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
    WarningRule("stands", FaultKind.INTERRUPTION, describe_stuck_return),
)


def find_new_warnings(view: WatchView, before: ReportedWarnings) -> tuple[ReportedWarnings, tuple[str, ...]]:
    """Return what is not well and was not said yet, for the operator of a live flight.

    A silence is told by `link_loss`; what comes back within `AGAIN_S` is the same.
    """
    now = [(row.name, words) for row, words in find_warnings(view) if row.look is not describe_silence]
    if not now and not before:
        return before, ()
    known = {name: at_s for name, at_s in before if view.now_s - at_s < AGAIN_S}
    new = tuple(f"{view.state.name}: {words}" for name, words in now if name not in known)
    return tuple({**known, **dict.fromkeys((name for name, _ in now), view.now_s)}.items()), new


def find_warnings(view: WatchView) -> tuple[tuple[WarningRule, str], ...]:
    """Look at every row; return those that hold, with their words."""
    if view.state.stage in {Stage.GROUND, Stage.LANDED, Stage.DOWN}:
        return ()
    return tuple((row, words) for row in TABLE if (words := row.look(view)))
