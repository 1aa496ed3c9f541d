"""The streams of a vehicle, each watched for itself: one may stop while the others come.

What stops is said and asked for again, and is a fault by its own name if it stays away.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

from executor.core.inflight.faults.watchpoint_types import OK, STALE, Finding, WatchView
from executor.core.limits import Limits
from executor.core.state.mission_height import ITEM_STALE_S

LEAST_GONE_S = 20.0
"""What was asked for three times and has not come does not come."""
BATTERY_GONE_S = 60.0
"""A pack that was well may be unseen for so long: it loses 4 % in a minute, and 12 if it drains three times as fast."""
ASK_AGAIN_S = 6.0
UNSEEN_S = 60.0
"""Who says neither where it is nor whether it is armed for so long is as good as silent."""


@dataclass(frozen=True, slots=True)
class Stream:
    """One of a vehicle's streams."""

    words: str
    """What is missing, in words, where it does not come."""
    last_s: Callable[[WatchView], float | None]
    """When it came last; None if it never did."""
    stale_s: Callable[[Limits], float]
    """An age that is worth a word."""
    gone_s: float = LEAST_GONE_S
    """An age that is a fault, or the link's time-out if that is longer."""

    def age_s(self, view: WatchView) -> float:
        """Return for how long it has not come; not a number if it never came."""
        last_s = self.last_s(view)
        return math.nan if last_s is None else view.now_s - max(last_s, view.state.link.excused_s)

    def is_stale(self, view: WatchView) -> bool:
        """Return whether it should have come."""
        return self.age_s(view) >= self.stale_s(view.context.limits)

    def describe_missing(self, view: WatchView) -> str:
        """Return in words that it does not come while others do; nothing if it comes."""
        age_s, stale_s, heard_s = self.age_s(view), self.stale_s(view.context.limits), view.state.link.heard_s
        if not age_s >= stale_s or heard_s is None or not is_link_alive(view):
            return ""
        if view.now_s - heard_s > age_s - stale_s:
            return ""  # nothing else came since this was due: a silence of everything begins with one of them
        return f"{self.words} for {age_s:.0f} s, while other messages come"

    def check(self, view: WatchView) -> Finding:
        """Return whether it stays away for longer than is usual, and than a silence of everything lasts."""
        age_s, heard_s, after_s = self.age_s(view), view.state.link.heard_s, max(self.gone_s, view.setup.link_timeout_s)
        if not view.setup.planned or math.isnan(age_s) or heard_s is None or not is_link_alive(view):
            return STALE
        if age_s < after_s:
            return OK
        if view.now_s - heard_s > age_s - after_s:
            return STALE  # nothing at all came since it was due: that may be the link
        return self.describe_missing(view)


HEARTBEAT = Stream("no HEARTBEAT", lambda view: view.state.link.heartbeat_s, lambda limits: limits.heartbeat_stale_s)
"""Without it nobody knows its mode, and whether it is armed."""
POSITION = Stream(
    "no position",
    lambda view: None if view.state.motion.fix is None else view.state.motion.fix.at_s,
    lambda limits: limits.link_stale_s,
)
"""GLOBAL_POSITION_INT: without it nobody knows where it is."""
BATTERY = Stream(
    "no battery report",
    lambda view: None if view.state.power.battery.remaining_pct is None else view.state.power.battery.reported_s,
    lambda limits: limits.battery_stale_s,
    BATTERY_GONE_S,
)
"""BATTERY_STATUS or SYS_STATUS."""
ITEM = Stream(
    "no report of its current waypoint",
    lambda view: view.state.telemetry.item_s if view.setup.planned else None,
    lambda _: ITEM_STALE_S,
)
"""MISSION_CURRENT: without it nobody knows which segment it flies to."""


def is_link_alive(view: WatchView) -> bool:
    """Return whether it is heard: a silence of everything is a matter of its link."""
    heard_s = view.state.link.heard_s
    return heard_s is not None and view.now_s - heard_s < view.context.limits.link_stale_s


def is_stream_request_due(view: WatchView) -> bool:
    """Return whether it is to be asked for its streams again."""
    if view.now_s - view.state.orders.streams_asked_s < ASK_AGAIN_S or not is_link_alive(view):
        return False
    return any(stream.is_stale(view) for stream in (HEARTBEAT, POSITION, BATTERY, ITEM))


def state_silence_s(view: WatchView) -> float:
    """Return for how long neither HEARTBEAT nor a position has come; 0 before both came."""
    ages_s = (HEARTBEAT.age_s(view), POSITION.age_s(view))
    return 0.0 if any(map(math.isnan, ages_s)) else min(ages_s)
