"""Whether a vehicle on its mission holds the height that is asked of it: by its mission, and by its own autopilot.

A vehicle that loses thrust sinks slowly, in mission mode, and its autopilot may say no word of it.
"""

from __future__ import annotations

from executor.core.inflight.faults.watchpoint_types import (
    OK,
    STALE,
    Finding,
    WatchView,
    alarm_words,
    has_failed_lately,
    is_estimate_lost,
    is_in_mission_mode,
)
from executor.core.state.mission_height import GROUND_ITEMS, find_mission_height, is_stopped_below_mission, item_of
from executor.core.state.vehicle_position import describe_down_place
from missions import Phase

MOST_WORDS_S = 10.0
"""An autopilot's word of lost thrust, which by itself decides nothing, is about what is seen within this."""
LEAST_TARGET_M_S = 0.8
"""Sinking like this, a vehicle that is metres below its autopilot's target has none of it under control."""
TARGET_S = 3.5
LYING_UP_M = 1.5
"""So near to the height of its home it may lie on the ground."""
LYING_S = 5.0
DROPPED_S = 4.0
"""It came down so shortly before it lay still."""


def check_sinking(view: WatchView) -> Finding:
    """It is far below its mission and sinks on, faster than the mission asks."""
    if view.fresh_fix is None:
        return STALE
    asked = find_mission_height(view.context, view.setup, view.state)
    if asked is None or (not view.setup.planned and is_estimate_lost(view)):
        return OK
    limits, climbs_m_s = view.context.limits, view.state.motion.climbs_m_s
    least_m = limits.below_mission_m * (0.5 if has_failed_lately(view, {"motor"}, MOST_WORDS_S) else 1.0)
    if asked.below_m < least_m or climbs_m_s >= -asked.sinks_m_s - limits.sinks_m_s:
        return OK
    return f"sinks at {-climbs_m_s:.1f} m/s, {asked.below_m:.0f} m below its mission{alarm_words(view)}"


def check_thrust(view: WatchView) -> Finding:
    """It sinks though its autopilot wants to be higher."""
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
    words = f"sinks at {-climbs_m_s:.1f} m/s, while its autopilot wants to be {own.below_m:.1f} m higher"
    return words + alarm_words(view)


def check_grounded_on_mission(view: WatchView) -> Finding:
    """It lies on the ground in the middle of its mission, armed."""
    fix, state, stood_s = view.fresh_fix, view.state, view.state.motion.stood_s
    if fix is None or state.motion.anchor is None:
        return STALE
    if view.setup.planned:
        lies = is_stopped_below_mission(view.context, view.setup, state)
        return f"does not move, {describe_down_place(view.context, state)}" if lies else OK
    if not is_in_mission_mode(view) or not state.sortie.took_off or _is_taking_off_or_landing(view):
        return OK
    if stood_s < LYING_S:
        return OK
    dropped = state.motion.drops_s >= view.now_s - stood_s - DROPPED_S and fix.alt_rel_m <= LYING_UP_M
    if not dropped and not is_stopped_below_mission(view.context, view.setup, state):
        return OK
    words = f"has not moved for {stood_s:.0f} s on its mission, {max(0.0, fix.alt_rel_m):.0f} m over its home"
    return words + (", after it came down" if dropped else "") + alarm_words(view)


def _is_taking_off_or_landing(view: WatchView) -> bool:
    """Return whether it takes off or lands as its mission has it."""
    leg, item = view.state.leg, item_of(view.state.own, view.state.own.leads_to)
    if leg is not None and leg.phase in {Phase.TAKEOFF, Phase.LAND}:
        return True
    return item is not None and item.command in GROUND_ITEMS
