"""The streams of a vehicle, each watched for itself: one may stop while the others come.

What stops is said and asked for again, and is a fault by its own name if it stays away.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

from executor.core.inflight.faults.watchpoint_types import OK, STALE, Finding, WatchView
from executor.core.state.mission_height import ITEM_STALE_S

LEAST_GONE_S = 20.0
"""What was asked for three times and has not come does not come."""
BATTERY_GONE_S = 60.0
"""A pack that was well may be unseen for so long: it loses 4 % in a minute, and 12 if it drains three times as fast."""
ASK_AGAIN_S = 6.0
UNSEEN_S = 60.0
"""Who says neither where it is nor whether it is armed for so long is as good as silent."""


@dataclass(frozen=True, slots=True)
class StreamStatus:
    """One of a vehicle's streams at one moment."""

    words: str
    """What is missing, in words."""
    age_s: float
    """Since it came last; not a number if it never came."""
    stale_s: float
    """An age that is worth a word."""

    @property
    def stale(self) -> bool:
        """Whether it should have come."""
        return self.age_s >= self.stale_s


def get_heartbeat_stream(view: WatchView) -> StreamStatus:
    """HEARTBEAT: without it nobody knows its mode, and whether it is armed."""
    return _build_stream(view, "no HEARTBEAT", view.state.link.heartbeat_s, view.context.limits.heartbeat_stale_s)


def get_position_stream(view: WatchView) -> StreamStatus:
    """GLOBAL_POSITION_INT: without it nobody knows where it is."""
    fix = view.state.motion.fix
    return _build_stream(view, "no position", None if fix is None else fix.at_s, view.context.limits.link_stale_s)


def get_battery_stream(view: WatchView) -> StreamStatus:
    """BATTERY_STATUS or SYS_STATUS."""
    known = view.state.power.battery
    last_s = None if known.remaining_pct is None else known.reported_s
    return _build_stream(view, "no battery report", last_s, view.context.limits.battery_stale_s)


def get_item_stream(view: WatchView) -> StreamStatus:
    """MISSION_CURRENT: without it nobody knows which segment it flies to."""
    last_s = view.state.telemetry.item_s if view.setup.planned else None
    return _build_stream(view, "no report of its current waypoint", last_s, ITEM_STALE_S)


def _build_stream(view: WatchView, words: str, last_s: float | None, stale_s: float) -> StreamStatus:
    age_s = math.nan if last_s is None else view.now_s - max(last_s, view.state.link.excused_s)
    return StreamStatus(words, age_s, stale_s)


def is_link_alive(view: WatchView) -> bool:
    """Return whether it is heard: a silence of everything is a matter of its link."""
    heard_s = view.state.link.heard_s
    return heard_s is not None and view.now_s - heard_s < view.context.limits.link_stale_s


def describe_missing_stream(of: Callable[[WatchView], StreamStatus], view: WatchView) -> str:
    """Return in words what does not come while others do; nothing if it comes."""
    stream, heard_s = of(view), view.state.link.heard_s
    if not stream.stale or heard_s is None or not is_link_alive(view):
        return ""
    if view.now_s - heard_s > stream.age_s - stream.stale_s:
        return ""  # nothing else came since this was due: a silence of everything begins with one of them
    return f"{stream.words} for {stream.age_s:.0f} s, while other messages come"


def is_stream_request_due(view: WatchView) -> bool:
    """Return whether it is to be asked for its streams again."""
    if view.now_s - view.state.orders.streams_asked_s < ASK_AGAIN_S or not is_link_alive(view):
        return False
    return any(
        stream(view).stale
        for stream in (get_heartbeat_stream, get_position_stream, get_battery_stream, get_item_stream)
    )


def check_stream(of: Callable[[WatchView], StreamStatus], view: WatchView, least_s: float = LEAST_GONE_S) -> Finding:
    """Return whether something stays away for longer than is usual, and than a silence of everything lasts."""
    stream, heard_s, after_s = of(view), view.state.link.heard_s, max(least_s, view.setup.link_timeout_s)
    if not view.setup.planned or math.isnan(stream.age_s) or heard_s is None or not is_link_alive(view):
        return STALE
    if stream.age_s < after_s:
        return OK
    if view.now_s - heard_s > stream.age_s - after_s:
        return STALE  # nothing at all came since it was due: that may be the link
    return describe_missing_stream(of, view)


check_heartbeat_stream = partial(check_stream, get_heartbeat_stream)
"""Its HEARTBEAT stays away."""
check_position_stream = partial(check_stream, get_position_stream)
"""Its positions stay away."""
check_battery_stream = partial(check_stream, get_battery_stream, least_s=BATTERY_GONE_S)
"""It does not say any more what its battery holds."""
check_item_stream = partial(check_stream, get_item_stream)
"""It does not say any more which waypoint it flies to."""


def state_silence_s(view: WatchView) -> float:
    """Return for how long neither HEARTBEAT nor a position has come; 0 before both came."""
    ages_s = (get_heartbeat_stream(view).age_s, get_position_stream(view).age_s)
    return 0.0 if any(map(math.isnan, ages_s)) else min(ages_s)
