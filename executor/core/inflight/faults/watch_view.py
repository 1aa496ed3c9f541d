"""What a watchpoint may look at: one vehicle at one moment, and each of its streams.

One stream may stop while the others come. What stops is said and asked for again, and is a fault by its own name if it
stays away.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Collection
from dataclasses import dataclass

from executor.core import radio_budget
from executor.core.context import Scene, VehicleSetup
from executor.core.fault_thresholds import Limits
from executor.core.lines import failsafe, link
from executor.core.radio_budget import BATTERY_STATUS, GLOBAL_POSITION_INT, MISSION_CURRENT, SYS_STATUS
from executor.core.state.mission_height import ITEM_STALE_S
from executor.core.state.radio_channel import choose_streams_hz
from executor.core.state.vehicle_parts import PositionFix
from executor.core.state.vehicle_state import FaultCode, FaultKind, Stage, VehicleState, is_slowed_by_us
from executor.core.telemetry.mode_evidence import has_failsafe_action
from missions.autopilots.dialect import is_mission_mode


@dataclass(frozen=True, slots=True)
class WatchView:
    """What a watchpoint may look at."""

    context: Scene
    setup: VehicleSetup
    state: VehicleState
    failing: bool
    """Whether it failed at the last look: the clear threshold may differ from the raise threshold."""
    now_s: float

    @property
    def fresh_fix(self) -> PositionFix | None:
        """Its newest position, if it is not old."""
        fix = self.state.motion.fix
        return None if fix is None or self.now_s - fix.at_s > self.context.limits.link_stale_s else fix


Finding = str | None
"""What a watchpoint says of one moment: its evidence in words where it fails."""
OK: Finding = ""
STALE: Finding = None
"""Nobody knows."""


@dataclass(frozen=True, slots=True)
class Watchpoint:
    """One row of the table; the first row that is raised gives the reason."""

    name: str
    kind: FaultKind
    judge: Callable[[WatchView], Finding]
    raise_after_s: float
    code: FaultCode
    stages: frozenset[Stage] = frozenset({Stage.FLYING})
    """The stages in which it is looked at: by default on its mission."""


def describe_reported_failure(view: WatchView, kind: str) -> str:
    """Return in words what an autopilot said has failed and made it act; nothing if it did not."""
    for failed, said_s in view.state.evidence.failed:
        if failed.what == kind and view.now_s - said_s <= view.context.limits.alarm_s and has_failsafe_action(failed):
            return failsafe.SAYS.format(words=failed.words)
    return ""


LOST_ITSELF_S = 30.0


def is_estimate_lost(view: WatchView) -> bool:
    """Return whether its autopilot says that it does not know where it is, nor how fast it moves."""
    return has_failed_lately(view, {"ekf", "gps"}, LOST_ITSELF_S)


def has_failed_lately(view: WatchView, kinds: Collection[str], within_s: float) -> bool:
    """Return whether its autopilot said within a time that something of these kinds has failed."""
    return any(one.what in kinds and view.now_s - said_s <= within_s for one, said_s in view.state.evidence.failed)


def is_in_mission_mode(view: WatchView) -> bool:
    """Return whether it says that it is in mission mode."""
    return is_mission_mode(view.setup.dialect, view.state.mode)


def alarm_words(view: WatchView) -> str:
    """Return what the vehicle said of it, if it did."""
    text, said_s = view.state.telemetry.alarm
    return failsafe.ALSO_SAYS.format(words=text) if view.now_s - said_s <= view.context.limits.alarm_s else ""


LEAST_GONE_S = 20.0
"""What was asked for three times and has not come does not come."""
BATTERY_GONE_S = 60.0
"""A pack that was well may be unseen for so long: it loses 4 % in a minute, and 12 if it drains three times as fast."""
SLOWED = 3.0
"""Times as long a stream may stay away that our own upload holds up."""
IN_A_ROW = 4.0
"""So many of a stream's messages that do not come are more than chance."""
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
    messages: tuple[int, ...] = ()
    """What brings it, the most frequent first."""

    def age_s(self, view: WatchView) -> float:
        """Return for how long it has not come; not a number if it never came."""
        last_s = self.last_s(view)
        return math.nan if last_s is None else view.now_s - max(last_s, view.state.link.excused_s)

    def usual_s(self, view: WatchView) -> float:
        """Return an age that is worth a word now."""
        slowed = is_slowed_by_us(view.state, view.now_s)
        stale_s = self.stale_s(view.context.limits)
        if self.age_s(view) >= stale_s and is_radio_measured(view):
            rate_hz = choose_streams_hz(view.setup, view.state).get(self.messages[0], radio_budget.HEARTBEAT_HZ)
            stale_s = max(stale_s, IN_A_ROW / rate_hz)
        return (SLOWED if slowed else 1.0) * stale_s

    def describe_missing(self, view: WatchView) -> str:
        """Return in words that it does not come while others do; nothing if it comes."""
        age_s, stale_s, heard_s = self.age_s(view), self.usual_s(view), view.state.link.heard_s
        if not age_s >= stale_s or heard_s is None or not is_link_alive(view):
            return ""
        if view.now_s - heard_s > age_s - stale_s:
            return ""  # nothing else came since this was due: a silence of everything begins with one of them
        return link.MISSING.format(stream=self.words, age_s=age_s)

    def check(self, view: WatchView) -> Finding:
        """Return whether it stays away for longer than is usual, and than a silence of everything lasts."""
        age_s, heard_s, after_s = self.age_s(view), view.state.link.heard_s, max(self.gone_s, view.setup.link_timeout_s)
        after_s *= SLOWED if is_slowed_by_us(view.state, view.now_s) else 1.0
        if not view.setup.planned or math.isnan(age_s) or heard_s is None or not is_link_alive(view):
            return STALE
        if age_s < after_s:
            return OK
        if view.now_s - heard_s > age_s - after_s:
            return STALE  # nothing at all came since it was due: that may be the link
        return self.describe_missing(view)


HEARTBEAT = Stream(
    link.NO_HEARTBEAT,
    lambda view: view.state.link.heartbeat_s,
    lambda limits: limits.heartbeat_stale_s,
    messages=(radio_budget.HEARTBEAT,),
)
"""Without it nobody knows its mode, and whether it is armed."""
POSITION = Stream(
    link.NO_POSITION,
    lambda view: None if view.state.motion.fix is None else view.state.motion.fix.at_s,
    lambda limits: limits.link_stale_s,
    messages=(GLOBAL_POSITION_INT,),
)
"""GLOBAL_POSITION_INT: without it nobody knows where it is."""
BATTERY = Stream(
    link.NO_BATTERY_REPORT,
    lambda view: None if view.state.power.battery.remaining_pct is None else view.state.power.battery.reported_s,
    lambda limits: limits.battery_stale_s,
    BATTERY_GONE_S,
    (BATTERY_STATUS, SYS_STATUS),
)
"""BATTERY_STATUS or SYS_STATUS."""
ITEM = Stream(
    link.NO_WAYPOINT,
    lambda view: view.state.telemetry.item_s if view.setup.planned else None,
    lambda _: ITEM_STALE_S,
    messages=(MISSION_CURRENT,),
)
"""MISSION_CURRENT: without it nobody knows which segment it flies to."""


def is_link_alive(view: WatchView) -> bool:
    """Return whether it is heard: a silence of everything is a matter of its link."""
    heard_s = view.state.link.heard_s
    return heard_s is not None and view.now_s - heard_s < view.context.limits.link_stale_s


def is_radio_measured(view: WatchView) -> bool:
    """Return whether it is behind a telemetry radio whose bytes are counted."""
    link, radio = view.state.link.quality, view.setup.radio
    return bool(link.counted) and radio.find_capacity_bytes_s(on_radio=link.radio is not None) is not None


def list_streams_to_ask(view: WatchView) -> tuple[int, ...] | None:
    """Return which messages it is to be asked for again, none for all of them; None if it is not.

    Over a radio it is what is missing alone: what it sends, or has refused, would only take room.
    """
    if view.now_s - view.state.orders.streams_asked_s < ASK_AGAIN_S or not is_link_alive(view):
        return None
    late = [one for one in (HEARTBEAT, POSITION, BATTERY, ITEM) if one.age_s(view) >= one.usual_s(view)]
    if not late:
        return None
    return tuple(message for one in late for message in one.messages) if is_radio_measured(view) else ()
