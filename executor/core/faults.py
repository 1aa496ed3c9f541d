"""Watchpoints: a table of what may be wrong with a vehicle, looked at as levels on every tick.

Each answers OK, FAIL or STALE. FAIL must last `raise_after_s` before it is a fault; STALE neither starts nor ends that
time, so that a silent vehicle's last battery report raises nothing by itself. One arbiter picks one reason.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from enum import Enum

from executor.core import battery, energy
from executor.core.context import Context, VehicleSetup
from executor.core.modes import is_mission_mode, mode_name
from executor.core.vehicle import FaultKind, Stage, VehicleState, Watch
from missions import Phase


class Verdict(Enum):
    """What a watchpoint says of one moment."""

    OK = "ok"
    FAIL = "fail"
    STALE = "stale"


@dataclass(frozen=True, slots=True)
class View:
    """What a watchpoint may look at."""

    context: Context
    setup: VehicleSetup
    state: VehicleState
    failing: bool
    """Whether it failed at the last look: the clear threshold may differ from the raise threshold."""
    now_s: float


@dataclass(frozen=True, slots=True)
class Finding:
    """A verdict with its evidence in words."""

    verdict: Verdict
    evidence: str = ""


OK = Finding(Verdict.OK)
STALE = Finding(Verdict.STALE)


@dataclass(frozen=True, slots=True)
class Watchpoint:
    """One row of the table; the first row that is raised gives the reason."""

    name: str
    kind: FaultKind
    judge: Callable[[View], Finding]
    raise_after_s: float
    stages: frozenset[Stage]
    """The stages in which it is looked at."""


def link_silent(view: View) -> Finding:
    """Nothing was heard for the vehicle's time-out."""
    heard_s = view.state.heard_s
    if heard_s is None:
        return STALE
    age_s = view.now_s - heard_s
    if age_s >= view.setup.link_timeout_s:
        return Finding(Verdict.FAIL, f"silent for {age_s:.1f} s, time-out {view.setup.link_timeout_s:g} s")
    return OK


def down_off_pad(view: View) -> Finding:
    """It disarmed where, or when, it should not have landed."""
    state, limits = view.state, view.context.limits
    if state.fix is None or state.heartbeat is None:
        return STALE
    if state.armed or not state.armed_once:
        return OK
    away_m = math.dist(state.fix.place_m, view.setup.pad_m)
    if away_m > limits.off_pad_m:
        return Finding(
            Verdict.FAIL, f"disarmed {away_m:.0f} m from its pad, {state.fix.alt_rel_m:.0f} m high{_alarm(view)}"
        )
    # An old position says nothing of its height: it may have come down since.
    if state.fix.alt_rel_m > limits.off_pad_up_m and view.now_s - state.fix.at_s <= limits.link_stale_s:
        return Finding(Verdict.FAIL, f"disarmed {state.fix.alt_rel_m:.0f} m above its pad{_alarm(view)}")
    if not state.took_off and state.stage is Stage.FLYING:
        return Finding(Verdict.FAIL, f"disarmed on its pad before it took off{_alarm(view)}")
    return OK


def terminated(view: View) -> Finding:
    """Its heartbeat says that it gave itself up."""
    heartbeat = view.state.heartbeat
    if heartbeat is None:
        return STALE
    names = {6: "an emergency", 8: "that its flight is terminated"}  # MAV_STATE
    if heartbeat.armed and heartbeat.system_status in names:
        return Finding(Verdict.FAIL, f"reports {names[heartbeat.system_status]}{_alarm(view)}")
    return OK


def falling(view: View) -> Finding:
    """It sinks faster than it was ever told to."""
    fix = view.state.fix
    if fix is None or view.now_s - fix.at_s > view.context.limits.link_stale_s:
        return STALE
    if fix.velocity_m_s[2] < -view.context.limits.fall_m_s:
        return Finding(Verdict.FAIL, f"falls at {-fix.velocity_m_s[2]:.1f} m/s")
    return OK


def left_mission(view: View) -> Finding:
    """It is in a mode that nobody here ordered."""
    state = view.state
    if state.heartbeat is None:
        return STALE
    dialect = view.setup.dialect
    if is_mission_mode(dialect, state.heartbeat.custom_mode) or not state.armed:
        return OK
    if view.now_s - state.ordered_mode_s < view.context.limits.mode_grace_s:
        return OK
    leg = state.leg
    if leg is not None and leg.phase is Phase.LAND:
        return OK  # PX4 leaves the mission mode on its own when it has landed
    mode = mode_name(dialect, state.heartbeat.custom_mode)
    return Finding(Verdict.FAIL, f"went to mode {mode} by itself{_alarm(view)}")


def battery_stepped(view: View) -> Finding:
    """Much was lost at once."""
    if not _battery_fresh(view):
        return STALE
    limits = view.context.limits
    excess, expected = battery.excess_pct(view.state.battery, limits.battery_step_window_s)
    # While it fails the window moves on, so the loss is looked for in the time since.
    if view.failing:
        excess, expected = battery.excess_pct(view.state.battery, 4 * limits.battery_step_window_s)
    if excess >= limits.battery_step_pct:
        used = excess + expected
        return Finding(Verdict.FAIL, f"lost {used:.0f} % at once where the flight costs {expected:.1f} %")
    return OK


def battery_drains(view: View) -> Finding:
    """More is used than the flight should cost, by more than a gust explains."""
    if not _battery_fresh(view):
        return STALE
    limits = view.context.limits
    excess, expected = battery.excess_pct(view.state.battery, limits.battery_window_s)
    threshold = max(limits.battery_excess_pct, expected)
    if view.failing:
        threshold *= 0.7
    if excess >= threshold:
        return Finding(
            Verdict.FAIL,
            f"used {excess + expected:.0f} % in {limits.battery_window_s:.0f} s where {expected:.1f} % was expected",
        )
    return OK


def reserve_broken(view: View) -> Finding:
    """The mission on board would end below the reserve."""
    left = energy.at_landing_pct(view.state)
    if left is None or not _battery_fresh(view):
        return STALE
    limits = view.context.limits
    floor = view.setup.reserve_pct - limits.reserve_slack_pct
    if view.failing:
        floor += limits.reserve_slack_pct + limits.reserve_clear_pct
    if left < floor:
        return Finding(
            Verdict.FAIL, f"would land with {left:.0f} % of its battery, reserve {view.setup.reserve_pct:g} %"
        )
    return OK


def battery_critical(view: View) -> Finding:
    """The autopilot itself calls the battery critical, failed or unhealthy."""
    if not _battery_fresh(view):
        return STALE
    names = {3: "critical", 4: "emergency", 5: "failed", 6: "unhealthy"}
    state = view.state.battery.charge_state
    if state in names:
        return Finding(Verdict.FAIL, f"the autopilot calls its battery {names[state]}")
    return OK


def stalled(view: View) -> Finding:
    """It is on its mission and does not move."""
    state, limits = view.state, view.context.limits
    if state.fix is None or state.anchor is None or view.now_s - state.fix.at_s > limits.link_stale_s:
        return STALE
    # By its own clock: a simulator that the computer lets wait stands still, and so does its time.
    stood_s = state.fix.boot_s - state.anchor.boot_s
    if stood_s >= limits.stall_s:
        return Finding(Verdict.FAIL, f"has not moved for {stood_s:.0f} s")
    return OK


def _alarm(view: View) -> str:
    """Return what the vehicle said of it, if it did."""
    text, said_s = view.state.alarm
    return f"; it says: {text}" if view.now_s - said_s <= view.context.limits.alarm_s else ""


def _battery_fresh(view: View) -> bool:
    # 2 s is PX4's own interval of BATTERY_STATUS; three are waited for.
    return view.now_s - view.state.battery.reported_s <= view.context.limits.battery_stale_s


_IN_THE_AIR = frozenset({Stage.FLYING, Stage.RETURNING})
_ON_MISSION = frozenset({Stage.FLYING})

TABLE: tuple[Watchpoint, ...] = (
    Watchpoint("off-pad", FaultKind.INTERRUPTION, down_off_pad, 0.0, _IN_THE_AIR),
    Watchpoint("falling", FaultKind.INTERRUPTION, falling, 0.4, _IN_THE_AIR),
    Watchpoint("terminated", FaultKind.INTERRUPTION, terminated, 0.0, _IN_THE_AIR),
    Watchpoint("link", FaultKind.LINK, link_silent, 0.0, _IN_THE_AIR | {Stage.STARTING}),
    Watchpoint("battery-step", FaultKind.BATTERY, battery_stepped, 2.5, _ON_MISSION),
    Watchpoint("battery-critical", FaultKind.BATTERY, battery_critical, 3.0, _ON_MISSION),
    Watchpoint("battery-drain", FaultKind.BATTERY, battery_drains, 4.0, _ON_MISSION),
    Watchpoint("reserve", FaultKind.BATTERY, reserve_broken, 5.0, _ON_MISSION),
    Watchpoint("mode", FaultKind.INTERRUPTION, left_mission, 1.0, _ON_MISSION),
    Watchpoint("stall", FaultKind.INTERRUPTION, stalled, 0.0, _ON_MISSION),
)


@dataclass(frozen=True, slots=True)
class Judgement:
    """All watchpoints of one vehicle at one moment."""

    watches: tuple[tuple[str, Watch], ...]
    raised: tuple[tuple[Watchpoint, str], ...]
    """What has failed for long enough, the most important first, with its evidence."""


def judge(context: Context, setup: VehicleSetup, state: VehicleState, now_s: float) -> Judgement:
    """Look at every watchpoint of a vehicle."""
    old = dict(state.watches)
    watches: list[tuple[str, Watch]] = []
    raised: list[tuple[Watchpoint, str]] = []
    for point in TABLE:
        if state.stage not in point.stages:
            continue
        since = old.get(point.name, Watch()).failing_since_s
        finding = point.judge(View(context, setup, state, since is not None, now_s))
        if finding.verdict is Verdict.FAIL:
            since = now_s if since is None else since
            if now_s - since >= point.raise_after_s:
                raised.append((point, finding.evidence))
        elif finding.verdict is Verdict.OK:
            since = None
        if since is not None:
            watches.append((point.name, Watch(since)))
    return Judgement(tuple(watches), tuple(raised))
