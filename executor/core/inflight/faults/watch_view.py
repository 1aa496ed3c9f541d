"""Define what a watchpoint sees: one vehicle at one moment, and each of its streams.

One stream may stop while the others continue. It is reported and requested again, and becomes a fault of its own if it
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
    """The input of a watchpoint."""

    context: Scene
    setup: VehicleSetup
    state: VehicleState
    failing: bool
    """Whether it failed at the last evaluation: the clear threshold may differ from the raise threshold."""
    now_s: float

    @property
    def fresh_fix(self) -> PositionFix | None:
        """Its newest position, if recent."""
        fix = self.state.motion.fix
        return None if fix is None or self.now_s - fix.at_s > self.context.limits.link_stale_s else fix


Finding = str | None
"""The result of a watchpoint: the evidence in words if it fails."""
OK: Finding = ""
STALE: Finding = None
"""Unknown."""


@dataclass(frozen=True, slots=True)
class Watchpoint:
    """One row of the table; the first one raised gives the reason."""

    name: str
    kind: FaultKind
    judge: Callable[[WatchView], Finding]
    raise_after_s: float
    code: FaultCode
    stages: frozenset[Stage] = frozenset({Stage.FLYING})
    """The stages in which it is evaluated; by default on its mission."""


def describe_reported_failure(view: WatchView, kind: str) -> str:
    """Return in words a reported failure on which the autopilot acts; empty if there is none."""
    for failed, said_s in view.state.evidence.failed:
        if failed.what == kind and view.now_s - said_s <= view.context.limits.alarm_s and has_failsafe_action(failed):
            return failsafe.SAYS.format(words=failed.words)
    return ""


LOST_ITSELF_S = 30.0


def is_estimate_lost(view: WatchView) -> bool:
    """Return whether its autopilot reports its position and velocity estimate lost."""
    return has_failed_lately(view, {"ekf", "gps"}, LOST_ITSELF_S)


def has_failed_lately(view: WatchView, kinds: Collection[str], within_s: float) -> bool:
    """Return whether its autopilot reported a failure of one of these kinds within a time."""
    return any(one.what in kinds and view.now_s - said_s <= within_s for one, said_s in view.state.evidence.failed)


def is_in_mission_mode(view: WatchView) -> bool:
    """Return whether it reports mission mode."""
    return is_mission_mode(view.setup.dialect, view.state.mode)


def alarm_words(view: WatchView) -> str:
    """Return the vehicle's own text on it, if any."""
    text, said_s = view.state.telemetry.alarm
    return failsafe.ALSO_SAYS.format(words=text) if view.now_s - said_s <= view.context.limits.alarm_s else ""


LEAST_GONE_S = 20.0
"""Shortest time after which a stream is gone: it was requested three times."""
BATTERY_GONE_S = 60.0
"""Time for which the battery of a sound pack may be unreported: it loses 4 % in a minute, 12 if it drains three times
as fast."""
SLOWED = 3.0
"""Factor on the age of a stream slowed by our upload."""
IN_A_ROW = 4.0
"""Consecutive messages of a stream that are not lost by chance."""
ASK_AGAIN_S = 6.0
UNSEEN_S = 60.0
"""Time without position and arming state after which a vehicle counts as silent."""


@dataclass(frozen=True, slots=True)
class Stream:
    """One of a vehicle's streams."""

    words: str
    """The text when it is missing."""
    last_s: Callable[[WatchView], float | None]
    """When it last arrived; None if never."""
    stale_s: Callable[[Limits], float]
    """Age from which it is reported."""
    gone_s: float = LEAST_GONE_S
    """Age that is a fault; the link time-out if that is longer."""
    messages: tuple[int, ...] = ()
    """Messages that carry it, the most frequent first."""

    def age_s(self, view: WatchView) -> float:
        """Return its age; NaN if it never arrived."""
        last_s = self.last_s(view)
        return math.nan if last_s is None else view.now_s - max(last_s, view.state.link.excused_s)

    def usual_s(self, view: WatchView) -> float:
        """Return the age from which it is reported now."""
        slowed = is_slowed_by_us(view.state, view.now_s)
        stale_s = self.stale_s(view.context.limits)
        if self.age_s(view) >= stale_s and is_radio_measured(view):
            rate_hz = choose_streams_hz(view.setup, view.state).get(self.messages[0], radio_budget.HEARTBEAT_HZ)
            stale_s = max(stale_s, IN_A_ROW / rate_hz)
        return (SLOWED if slowed else 1.0) * stale_s

    def describe_missing(self, view: WatchView) -> str:
        """Return the text that it is missing while others arrive; empty if it arrives."""
        age_s, stale_s, heard_s = self.age_s(view), self.usual_s(view), view.state.link.heard_s
        if not age_s >= stale_s or heard_s is None or not is_link_alive(view):
            return ""
        if view.now_s - heard_s > age_s - stale_s:
            return ""  # nothing else has arrived since it was due: any loss of the link begins like this
        return link.MISSING.format(stream=self.words, age_s=age_s)

    def check(self, view: WatchView) -> Finding:
        """Check whether it is missing for longer than usual, and than a loss of the link takes."""
        age_s, heard_s, after_s = self.age_s(view), view.state.link.heard_s, max(self.gone_s, view.setup.link_timeout_s)
        after_s *= SLOWED if is_slowed_by_us(view.state, view.now_s) else 1.0
        if not view.setup.planned or math.isnan(age_s) or heard_s is None or not is_link_alive(view):
            return STALE
        if age_s < after_s:
            return OK
        if view.now_s - heard_s > age_s - after_s:
            return STALE  # nothing at all has arrived since it was due: perhaps the link
        return self.describe_missing(view)


HEARTBEAT = Stream(
    link.NO_HEARTBEAT,
    lambda view: view.state.link.heartbeat_s,
    lambda limits: limits.heartbeat_stale_s,
    messages=(radio_budget.HEARTBEAT,),
)
"""Without it mode and arming state are unknown."""
POSITION = Stream(
    link.NO_POSITION,
    lambda view: None if view.state.motion.fix is None else view.state.motion.fix.at_s,
    lambda limits: limits.link_stale_s,
    messages=(GLOBAL_POSITION_INT,),
)
"""GLOBAL_POSITION_INT: without it the position is unknown."""
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
"""MISSION_CURRENT: without it the current segment is unknown."""


def is_link_alive(view: WatchView) -> bool:
    """Return whether messages arrive; if none do, the link itself is the problem."""
    heard_s = view.state.link.heard_s
    return heard_s is not None and view.now_s - heard_s < view.context.limits.link_stale_s


def is_radio_measured(view: WatchView) -> bool:
    """Return whether it is behind a telemetry radio with counted bytes."""
    link, radio = view.state.link.quality, view.setup.radio
    return bool(link.counted) and radio.find_capacity_bytes_s(on_radio=link.radio is not None) is not None


def list_streams_to_ask(view: WatchView) -> tuple[int, ...] | None:
    """Return the messages to request again, none of them named for all; None for no request.

    Over a radio only the missing ones: requests for what it sends or has refused would only take room.
    """
    if view.now_s - view.state.orders.streams_asked_s < ASK_AGAIN_S or not is_link_alive(view):
        return None
    late = [one for one in (HEARTBEAT, POSITION, BATTERY, ITEM) if one.age_s(view) >= one.usual_s(view)]
    if not late:
        return None
    return tuple(message for one in late for message in one.messages) if is_radio_measured(view) else ()
