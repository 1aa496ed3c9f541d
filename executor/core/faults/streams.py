"""The streams of a vehicle, each watched for itself: one may stop while the others come.

What stops is said and asked for again, and is a fault by its own name if it stays away.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

from executor.core.asked_heights import ITEM_STALE_S
from executor.core.faults.watching import OK, STALE, Finding, Verdict, View

LEAST_GONE_S = 20.0
"""What was asked for three times and has not come does not come."""
BATTERY_GONE_S = 60.0
"""A pack that was well may be unseen for so long: it loses 4 % in a minute, and 12 if it drains three times as fast."""
ASK_AGAIN_S = 6.0
UNSEEN_S = 60.0
"""Who says neither where it is nor whether it is armed for so long is as good as silent."""


@dataclass(frozen=True, slots=True)
class Stream:
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


def heartbeat_stream(view: View) -> Stream:
    """HEARTBEAT: without it nobody knows its mode, and whether it is armed."""
    return _stream(view, "no HEARTBEAT", view.state.link.heartbeat_s, view.context.limits.heartbeat_stale_s)


def positions(view: View) -> Stream:
    """GLOBAL_POSITION_INT: without it nobody knows where it is."""
    fix = view.state.motion.fix
    return _stream(view, "no position", None if fix is None else fix.at_s, view.context.limits.link_stale_s)


def battery_stream(view: View) -> Stream:
    """BATTERY_STATUS or SYS_STATUS."""
    known = view.state.power.battery
    last_s = None if known.remaining_pct is None else known.reported_s
    return _stream(view, "no battery report", last_s, view.context.limits.battery_stale_s)


def items(view: View) -> Stream:
    """MISSION_CURRENT: without it nobody knows which segment it flies to."""
    last_s = view.state.telemetry.item_s if view.setup.planned else None
    return _stream(view, "no report of its current waypoint", last_s, ITEM_STALE_S)


def _stream(view: View, words: str, last_s: float | None, stale_s: float) -> Stream:
    age_s = math.nan if last_s is None else view.now_s - max(last_s, view.state.link.excused_s)
    return Stream(words, age_s, stale_s)


def others_come(view: View) -> bool:
    """Return whether it is heard: a silence of everything is a matter of its link."""
    heard_s = view.state.link.heard_s
    return heard_s is not None and view.now_s - heard_s < view.context.limits.link_stale_s


def missing(of: Callable[[View], Stream], view: View) -> str:
    """Return in words what does not come while others do; nothing if it comes."""
    stream, heard_s = of(view), view.state.link.heard_s
    if not stream.stale or heard_s is None or not others_come(view):
        return ""
    if view.now_s - heard_s > stream.age_s - stream.stale_s:
        return ""  # nothing else came since this was due: a silence of everything begins with one of them
    return f"{stream.words} for {stream.age_s:.0f} s, while other messages come"


def to_be_asked(view: View) -> bool:
    """Return whether it is to be asked for its streams again."""
    if view.now_s - view.state.orders.streams_asked_s < ASK_AGAIN_S or not others_come(view):
        return False
    return any(stream(view).stale for stream in (heartbeat_stream, positions, battery_stream, items))


def gone(of: Callable[[View], Stream], view: View, least_s: float = LEAST_GONE_S) -> Finding:
    """Return whether something stays away for longer than is usual, and than a silence of everything lasts."""
    stream, heard_s, after_s = of(view), view.state.link.heard_s, max(least_s, view.setup.link_timeout_s)
    if not view.setup.planned or math.isnan(stream.age_s) or heard_s is None or not others_come(view):
        return STALE
    if stream.age_s < after_s:
        return OK
    if view.now_s - heard_s > stream.age_s - after_s:
        return STALE  # nothing at all came since it was due: that may be the link
    return Finding(Verdict.FAIL, missing(of, view))


heartbeat_gone = partial(gone, heartbeat_stream)
"""Its HEARTBEAT stays away."""
position_gone = partial(gone, positions)
"""Its positions stay away."""
battery_gone = partial(gone, battery_stream, least_s=BATTERY_GONE_S)
"""It does not say any more what its battery holds."""
item_gone = partial(gone, items)
"""It does not say any more which waypoint it flies to."""


def unseen_s(view: View) -> float:
    """Return for how long neither HEARTBEAT nor a position has come; 0 before both came."""
    ages_s = (heartbeat_stream(view).age_s, positions(view).age_s)
    return 0.0 if any(map(math.isnan, ages_s)) else min(ages_s)


def position_fresh(view: View) -> bool:
    """Return whether its positions come, if any ever did."""
    fix = view.state.motion.fix
    return fix is None or view.now_s - fix.at_s <= view.context.limits.link_stale_s
