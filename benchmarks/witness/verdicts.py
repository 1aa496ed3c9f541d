"""Declarations checked against the log: confirmed, refuted by one of its lines, or undecided."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from enum import StrEnum
from itertools import pairwise

from benchmarks.witness.falls import never_ordered_m_s, sank_m_s
from benchmarks.witness.hands import hand_of
from benchmarks.witness.log_evidence import (
    SECOND,
    Controller,
    LogEvidence,
    MotionSample,
    find_last_before,
    select_between,
    select_near,
    select_pairs_between,
)
from benchmarks.witness.packs import pack_verdict
from benchmarks.witness.statements import CRASH, EKF, EMERGENCY_STATES, StatementKind, find_statements
from executor.core.state.vehicle_state import FaultKind
from executor.replay.replay_result import Declaration


class Stand(StrEnum):
    """Result of checking a declaration against the log."""

    CONFIRMED = "confirmed"
    REFUTED = "refuted"
    UNDECIDED = "undecided"


@dataclass(frozen=True, slots=True)
class Ruling:
    """Verdict on one declaration."""

    outcome: Stand
    because: str
    """The line of the log that proves it."""


GROUND_M = 1.5
TUMBLED_DEG = 65.0
FLOWN_ON_S = 10.0
STREAM_S = 3.0
JUMP_M = 10.0
STILL_M = 5.0
STILL_S = 25.0
SAID_S = 10.0
FALLS_M_S, DROPS_M_S = 2.5, 8.0
"""Sink rate that may be commanded, and one that no copter reaches in normal flight."""
SANK_S, SANK_M = 6.0, 3.0
"""A vehicle that holds height does not sink this far in this time."""
LANDED_M = 2.5
HIGH_M = 5.0


def confirm(because: str) -> Ruling:
    """Return that the log agrees."""
    return Ruling(Stand.CONFIRMED, because)


def refute(because: str) -> Ruling:
    """Return that the log contradicts."""
    return Ruling(Stand.REFUTED, because)


def leave_undecided(because: str) -> Ruling:
    """Return that the log does not decide."""
    return Ruling(Stand.UNDECIDED, because)


def hold_against(declared: Declaration, told: LogEvidence, link_timeout_s: float) -> Ruling:
    """Check one declaration against the log's evidence on its vehicle."""
    at = declared.t_usec
    if declared.kind is FaultKind.LINK:
        return _link(told, at, link_timeout_s)
    crash = _near_statement(told, StatementKind.CRASH, at, 5.0, 15.0)
    if declared.kind is FaultKind.BATTERY:
        return pack_verdict(declared, told, confirm, refute, leave_undecided)
    if declared.reason in STREAMS:
        return _stream(told, at, STREAMS[declared.reason])
    if declared.reason in SANK:
        return SANK[declared.reason](told, at)
    if declared.reason in CRASHES or declared.kind is FaultKind.DOWN:
        return confirm(crash) if crash else _down(told, at, falls=declared.reason == "falling")
    if declared.reason in BY_REASON:
        return BY_REASON[declared.reason](told, at)
    if "mode" in declared.reason or _find_named_controller(declared) is not None:
        return _mode(declared, told)
    return _judge_by_own_words(declared, told)


def _near_statement(told: LogEvidence, what: StatementKind, at: int, before_s: float, after_s: float) -> str:
    for one in find_statements(told, math.inf):
        if one.what is what and at - before_s * SECOND <= one.t_usec <= at + after_s * SECOND:
            return one.words
    return ""


def _link(told: LogEvidence, at: int, timeout_s: float) -> Ruling:
    for one in told.silences:
        if one.from_usec <= at <= one.to_usec + SECOND:
            if one.others is False:
                return refute(f"nobody at all was recorded for {one.lasted_s:.1f} s: the recorder paused")
            if one.lasted_s >= timeout_s - 0.1:
                return confirm(f"nothing of it for {one.lasted_s:.1f} s")
            return refute(f"nothing of it for {one.lasted_s:.1f} s only, the time-out is {timeout_s:g} s")
    return refute("its frames came all the time")


def _stream(told: LogEvidence, at: int, stream: str) -> Ruling:
    times = told.streams.get(stream, [])
    before = [t_usec for t_usec in times if t_usec <= at]
    if not before:
        return refute(f"no {stream} ever came before")
    age_s = (at - before[-1]) / 1e6
    if age_s >= STREAM_S:
        return confirm(f"no {stream} for {age_s:.1f} s")
    return refute(f"{stream} came {age_s:.1f} s before")


def _find_named_controller(declared: Declaration) -> Controller | None:
    """Return the source of the mode change that the declaration itself names."""
    words = f"{declared.reason} {declared.evidence.partition('; it says')[0]}".lower()
    for hand, name in ((Controller.PILOT, "pilot"), (Controller.STATION, "station"), (Controller.FAILSAFE, "failsafe")):
        if name in words:
            return hand
    return None


def _mode(declared: Declaration, told: LogEvidence) -> Ruling:
    changes = [one for one in told.modes if one.t_usec <= declared.t_usec + SECOND // 2]
    if len(changes) < 2:
        return refute("its mode never changed")
    change = changes[-1]
    hand, words = hand_of(told, change)
    when = f"mode {change.mode} {(declared.t_usec - change.t_usec) / 1e6:.1f} s before"
    claimed = _find_named_controller(declared)
    if hand is Controller.NOBODY:
        return leave_undecided(f"{when}, and the log names nobody")
    if hand is claimed or (claimed is None and hand is Controller.FAILSAFE):
        return confirm(f"{when}: {words}")
    return refute(f"{when} by {hand.value}: {words}")


def _down(told: LogEvidence, at: int, *, falls: bool) -> Ruling:
    tilted = max((tilt for _, tilt in select_pairs_between(told.tilts, at - 3 * SECOND, at + 3 * SECOND)), default=0.0)
    where, since = told.find_motion(at), told.find_arming_usec(at - SECOND)
    flown = [one.height_m or 0.0 for one in select_between(told.moments, since or told.began_usec, at)]
    if flown and max(flown) < GROUND_M:
        return refute(f"it had not left the ground: {max(flown):.1f} m at most since it was armed")
    if tilted >= TUMBLED_DEG:
        return confirm(f"tilted by {tilted:.0f} degrees")
    sinks, by = sank_m_s(told, at - 4 * SECOND, at + round((FLOWN_ON_S + 2.0) * SECOND))
    if sinks >= DROPS_M_S:
        return confirm(f"sinks at {sinks:.0f} m/s ({by})")
    sunk, by = sank_m_s(told, at - 4 * SECOND, at + SECOND)
    never_m_s = never_ordered_m_s(told, at)
    if falls and never_m_s is not None and sunk >= never_m_s:
        return confirm(f"sank at {sunk:.1f} m/s, as nothing in its mode ever asks for ({by})")
    later = told.find_motion(at + round(FLOWN_ON_S * SECOND))
    if told.is_armed(at + round(FLOWN_ON_S * SECOND)) and later is not None and (later.height_m or 0.0) > GROUND_M:
        return refute(f"it flew on, {later.height_m:.0f} m high {FLOWN_ON_S:g} s later")
    if falls:
        return (confirm if sunk > FALLS_M_S else refute)(f"sank at {sunk:.1f} m/s at most ({by})")
    return _judge_disarming(where)


def _sank(told: LogEvidence, at: int) -> Ruling:
    """Check whether it gradually lost height without regaining it."""
    before, then = told.find_motion(at - round(SANK_S * SECOND)), told.find_motion(at)
    if before is None or then is None or before.height_m is None or then.height_m is None:
        return leave_undecided("how high it was is not in the log")
    lost_m = before.height_m - then.height_m
    if lost_m < SANK_M:
        return refute(f"it lost {max(0.0, lost_m):.1f} m in {SANK_S:g} s")
    later = told.find_motion(at + round(FLOWN_ON_S * SECOND))
    if later is not None and told.is_armed(later.t_usec) and (later.height_m or 0.0) > then.height_m + SANK_M:
        return refute(f"it was {later.height_m:.0f} m high again {FLOWN_ON_S:g} s later, from {then.height_m:.0f} m")
    return confirm(f"it lost {lost_m:.1f} m in {SANK_S:g} s, and did not climb again")


def _lay(told: LogEvidence, at: int) -> Ruling:
    """Check whether it descended faster than any landing and stayed down, armed."""
    after = select_between(told.moments, at, at + round(FLOWN_ON_S * SECOND))
    if not told.is_armed(at + round(FLOWN_ON_S * SECOND)) or not after:
        return refute("it disarmed, as after a landing")
    span_m = max(_distance_m(after[0], one) for one in after)
    if span_m >= STILL_M:
        return refute(f"moved {span_m:.0f} m")
    return confirm(f"armed, and moved {span_m:.1f} m in {FLOWN_ON_S:g} s")


def _judge_disarming(where: MotionSample | None) -> Ruling:
    if where is None or where.height_m is None:
        return leave_undecided("where it was is not in the log")
    if where.height_m >= HIGH_M and (where.climb_m_s < -1.0 or where.speed_m_s > 1.0):
        return confirm(f"disarmed {where.height_m:.0f} m high")
    if where.height_m < LANDED_M or (abs(where.climb_m_s) < 0.4 and where.speed_m_s < 0.5):
        return refute(f"{where.height_m:.1f} m high, {where.speed_m_s:.1f} m/s over ground: it had landed")
    return leave_undecided(f"{where.height_m:.1f} m high at {where.speed_m_s:.1f} m/s")


def _judge_termination(told: LogEvidence, at: int) -> Ruling:
    known = find_last_before(told.statuses, at)
    if known is not None and known[1] in EMERGENCY_STATES:
        return confirm(f"HEARTBEAT.system_status {known[1]}")
    return refute(f"HEARTBEAT.system_status {known[1] if known else 'unknown'}")


def _judge_jump(told: LogEvidence, at: int) -> Ruling:
    seen = select_near(told.moments, at, 6.0, 0.5)
    most = 0.0
    for before, after in pairwise(seen):
        elapsed_s = (after.t_usec - before.t_usec) / 1e6
        most = max(most, _distance_m(before, after) - max(before.speed_m_s, after.speed_m_s) * elapsed_s)
    return confirm(f"jumped by {most:.0f} m") if most >= JUMP_M else refute(f"jumped by {most:.1f} m at most")


def _stood(told: LogEvidence, at: int) -> Ruling:
    since = told.find_arming_usec(at)
    if since is None:
        return refute("it was not armed")
    seen = select_between(told.moments, max(since, at - round(STILL_S * SECOND)), at)
    if not seen:
        return leave_undecided("where it was is not in the log")
    if max(one.height_m or 0.0 for one in select_between(told.moments, since, at)) < GROUND_M:
        return refute("it stood on the ground, and had not taken off")
    span_m = max(_distance_m(seen[0], one) for one in seen)
    return confirm(f"moved {span_m:.1f} m in {STILL_S:g} s") if span_m < STILL_M else refute(f"moved {span_m:.0f} m")


def _distance_m(one: object, other: object) -> float:
    """Return the distance between two samples."""
    lat, lon = getattr(one, "lat_deg", 0.0), getattr(one, "lon_deg", 0.0)
    north = (getattr(other, "lat_deg", 0.0) - lat) * 111_320.0
    east = (getattr(other, "lon_deg", 0.0) - lon) * 111_320.0 * math.cos(math.radians(lat))
    return math.hypot(north, east)


def _judge_by_own_words(declared: Declaration, told: LogEvidence) -> Ruling:
    """Search for the autopilot's own text of that kind."""
    pattern = next((one for name, one in SAID.items() if name in declared.reason), None)
    failed = [one for one in select_near(told.failings, declared.t_usec, SAID_S, 2.0) if one.kind in declared.reason]
    if failed:
        return confirm(failed[0].words)
    texts = [one.words for one in select_near(told.texts, declared.t_usec, SAID_S, 2.0)]
    said = next((words for words in texts if pattern is not None and pattern.search(words)), "")
    if said:
        return confirm(said)
    if pattern is not None:
        return refute(f"no text and no record of it within {SAID_S:g} s")
    return leave_undecided("no rule for it")


STREAMS = {"heartbeat": "HEARTBEAT", "positions": "position", "items": "item", "battery-reports": "battery"}
CRASHES = frozenset({"off-pad", "falling", "crash", "crashed", "tumbled", "attitude"})
SANK: Mapping[str, Callable[[LogEvidence, int], Ruling]] = {"sinking": _sank, "thrust": _sank, "lies": _lay}
BY_REASON: Mapping[str, Callable[[LogEvidence, int], Ruling]] = {
    "terminated": _judge_termination, "position": _judge_jump, "stall": _stood,
}  # fmt: skip
SAID: Mapping[str, re.Pattern[str]] = {
    "crash": CRASH,
    "ekf": EKF,
    "gps": re.compile(r"gps|glitch", re.IGNORECASE),
    "compass": re.compile(r"compass|mag", re.IGNORECASE),
    "motor": re.compile(r"motor|thrust|esc\b", re.IGNORECASE),
    "vibration": re.compile(r"vib", re.IGNORECASE),
    "fence": re.compile(r"fence|breach", re.IGNORECASE),
    "rc": re.compile(r"radio|\brc\b|throttle|manual control", re.IGNORECASE),
    "failsafe": re.compile(r"fail ?safe|lost|variance|breach|crash|low battery|critical", re.IGNORECASE),
}
"""Autopilots' texts when they act themselves, by names that watchpoints may have."""
