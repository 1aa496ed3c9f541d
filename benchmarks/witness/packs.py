"""A pack's behaviour after it was declared faulty: its cell voltage, its counter, and its autopilot's own texts."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterator, Sequence
from statistics import median
from typing import TypeVar

import numpy as np

from benchmarks.witness.log_evidence import (
    SECOND,
    LogEvidence,
    MotionSample,
    PowerReport,
    select_between,
    select_near,
)
from benchmarks.witness.statements import BATTERY, StatementKind, find_statements
from executor.replay.replay_result import Declaration

V = TypeVar("V")
Say = Callable[[str], V]

SAID_BEFORE_S, SAID_AFTER_S = 120.0, 300.0
"""Interval about a declaration in which the autopilot's own failsafe shows that it was right, and early."""
FULL_CELL_V = 4.3
EMPTY_V, LOW_V, SOUND_V = 3.3, 3.45, 3.6
"""A cell under load: empty, low, and well charged."""
STEP_V = 0.12
"""Sudden loss of a cell's voltage, at equal load, that counts as a step."""
BACK_V = 0.03
"""A pack within this of its old voltage lost nothing: the load was briefly high."""
STAYS_S, OUTLASTS_S = 30.0, 900.0
"""Remaining flight time: too short to be evidence, and longer than any empty pack lasts."""
GROUND_M = 1.5
IDLE_A = 3.0
MORE, AS_BEFORE = 1.4, 1.2
REST_A = 1.5
RESTED_S, RESTS_S = 20.0, 120.0
"""Time after motor stop until the voltage has recovered, and for which it is read."""
FELL_V = 0.05
"""Drop of a resting cell; smaller ones may come from temperature or resting time."""
OFF_PCT = 15.0
"""Excess of the reported over the resting cell's charge; lagging ions explain a third of it."""
LEFT_PCT = (0.0, 10.0, 20.0, 30.0, 40.0, 60.0, 80.0, 100.0)
RESTING_V = (
    (3.3, 3.69, 3.73, 3.77, 3.80, 3.87, 4.02, 4.20),
    (2.8, 3.27, 3.43, 3.53, 3.61, 3.78, 3.95, 4.18),
)
"""Resting cell voltage by charge: lithium polymer, and lithium ion of nickel, manganese and cobalt."""
LOAD_SHARE = 0.25
MOVES = 0.004
"""Share of its voltage that any pack loses per ampere of load."""
LOADED_A = 5.0
COUNTED_DOWN_PCT, EMPTY_PCT, MUCH_PCT = 3.0, 2.0, 15.0
"""Fall of a percentage, and its values at the landing."""
TRIED_V = 10.0


def cells_of(told: LogEvidence) -> int | None:
    """Return the number of cells: a full LiPo cell has 4.2 V, an empty one 3.3; None if ambiguous."""
    volts = [one.volts for one in told.powers if one.volts]
    if not volts:
        return None
    # Voltage before the load, not a spike: the 95th percentile.
    top = sorted(volts)[int(0.95 * (len(volts) - 1))]
    fewest = max(1, math.ceil(top / FULL_CELL_V))
    return fewest if top >= TRIED_V / 2 else None


def pack_verdict(declared: Declaration, told: LogEvidence, confirmed: Say[V], refuted: Say[V], undecided: Say[V]) -> V:
    """Check a battery declaration against the log."""
    at = declared.t_usec
    own = _own_words(told, at)
    if own:
        return confirmed(own)
    if _TEXT.search(declared.reason):
        return refuted("no text, no record and no state of the battery says so")
    since = told.find_arming_usec(at)
    if since is None:
        return refuted("it was not armed")
    if _on_ground(told, since, at):
        return refuted(f"it stood on the ground, {(at - since) / 1e6:.0f} s after it was armed")
    for judged in _judgements(declared, told, since, confirmed, refuted):
        if judged is not None:
            return judged
    return undecided("the log ends, or has neither voltage nor counter to say so")


def _judgements(
    declared: Declaration, told: LogEvidence, since: int, confirmed: Say[V], refuted: Say[V]
) -> Iterator[V | None]:  # fmt: skip
    """Yield the verdict of each kind of evidence, the best one first."""
    at = declared.t_usec
    if declared.reason == "pack":
        yield _judge_by_rest(told, since, at, confirmed, refuted)
    if declared.reason == "reserve":
        yield _judge_by_percent(told, at, confirmed, refuted)
    if _has_load_response(told):
        yield _judge_by_voltage(declared, told, at, confirmed, refuted)
    if "drain" in declared.reason or "plunge" in declared.reason:
        yield _judge_by_counter(told, since, at, confirmed, refuted)


_TEXT = re.compile(r"failsafe|critical")


def _own_words(told: LogEvidence, at: int) -> str:
    """Return the autopilot's own battery texts in the same flight."""
    until = told.find_disarm_usec(at) + 5 * SECOND
    low, high = at - round(SAID_BEFORE_S * SECOND), min(at + round(SAID_AFTER_S * SECOND), until)
    for one in find_statements(told, math.inf):
        if one.what is StatementKind.BATTERY and low <= one.t_usec <= high:
            return f"{one.words}, {(one.t_usec - at) / 1e6:+.1f} s"
    said = [one for one in select_near(told.texts, at, 15.0, 5.0) if BATTERY.search(one.words)]
    return said[0].words if said else ""


def _on_ground(told: LogEvidence, since: int, at: int) -> bool:
    seen: Sequence[MotionSample] = [
        one for one in select_between(told.moments, since, at + SECOND) if one.height_m is not None
    ]
    drawn = [one.amperes for one in select_between(told.powers, since, at) if one.amperes is not None]
    idle = not drawn or max(drawn) < IDLE_A
    if not seen:
        return bool(drawn) and idle
    return max(one.height_m or 0.0 for one in seen) < GROUND_M and max(one.speed_m_s for one in seen) < 1.5


def _has_load_response(told: LogEvidence) -> bool:
    """Return whether the voltage responds to the load: a simulator's battery may be constant."""
    volts = [one.volts for one in told.powers if one.volts]
    drawn = [one.amperes for one in told.powers if one.amperes is not None]
    loaded = bool(drawn) and max(drawn) - min(drawn) > LOADED_A
    return bool(volts) and not (loaded and max(volts) - min(volts) <= MOVES * max(volts))


def _judge_by_percent(told: LogEvidence, at: int, confirmed: Say[V], refuted: Say[V]) -> V | None:
    """Check a landing below the reserve against its reported percentage, if that counted down to it."""
    end = told.find_disarm_usec(at)
    reported = [one.percent for one in select_between(told.powers, at, end) if one.percent is not None]
    if not reported or end == told.ended_usec or reported[0] - reported[-1] < COUNTED_DOWN_PCT:
        return None
    words = f"{reported[-1]:.0f} % reported at its landing"
    if reported[-1] <= EMPTY_PCT:
        return confirmed(words)
    return refuted(words) if reported[-1] >= MUCH_PCT else None


def _judge_by_voltage(
    declared: Declaration, told: LogEvidence, at: int, confirmed: Say[V], refuted: Say[V]
) -> V | None:
    cells = cells_of(told)
    if cells is None:
        return None
    end = told.find_disarm_usec(at)
    now = _load(told, at, at + 10 * SECOND)
    if now is not None and now.volts is not None and now.volts / cells < EMPTY_V:
        return confirmed(f"{now.volts / cells:.2f} V a cell under load")
    if "step" in declared.reason:
        return _judge_voltage_step(told, at, cells, confirmed, refuted)
    last = _load(told, max(at, end - 25 * SECOND), end - 5 * SECOND)
    if (end - at) / 1e6 < STAYS_S or last is None or last.volts is None:
        return None
    cell, later_s = last.volts / cells, (end - at) / 1e6
    if later_s > OUTLASTS_S:
        return refuted(f"it flew on for {later_s / 60:.0f} minutes")
    if cell < LOW_V and later_s <= SAID_AFTER_S:
        return confirmed(f"{cell:.2f} V a cell under load {later_s:.0f} s later, at the end of the flight")
    if cell >= SOUND_V:
        return refuted(f"{cell:.2f} V a cell under load {later_s:.0f} s later, at the end of the flight")
    return None


def _judge_by_rest(told: LogEvidence, since: int, at: int, confirmed: Say[V], refuted: Say[V]) -> V | None:
    """Check a percentage against the resting voltages before and after the flight, in both chemistries."""
    cells, end = cells_of(told), told.find_disarm_usec(at)
    before = _find_rest(told, since - round(RESTS_S * SECOND), since)
    after = _find_rest(told, end + round(RESTED_S * SECOND), end + round(RESTS_S * SECOND))
    if cells is None or before is None or after is None or before[0] - after[0] < FELL_V * cells:
        return None
    counted = before[1] - after[1]
    left = [(float(np.interp(before[0] / cells, one, LEFT_PCT)), float(np.interp(after[0] / cells, one, LEFT_PCT)))
            for one in RESTING_V]  # fmt: skip
    gone, most = [first - last for first, last in left], max(last for _, last in left)
    words = f"at rest {before[0] / cells:.2f} V a cell before it and {after[0] / cells:.2f} V after it: {counted:.0f} %"
    if min(gone) >= MORE * counted > 0:
        return confirmed(f"{words} counted, {min(gone):.0f} % gone at least")
    if after[1] - most >= OFF_PCT:
        held = f"{after[0] / cells:.2f} V a cell at rest after it, {most:.0f} % at most"
        return confirmed(f"{held}, and {after[1]:.0f} % reported")
    return refuted(f"{words} counted, {max(gone):.0f} % gone at most") if max(gone) <= AS_BEFORE * counted else None


def _find_rest(told: LogEvidence, from_usec: int, to_usec: int) -> tuple[float, float] | None:
    """Return the median voltage and percentage of an interval on the ground with motors off."""
    rows: Sequence[PowerReport] = [
        one for one in select_between(told.powers, from_usec, to_usec)
        if one.volts and one.percent is not None and (one.amperes or 0.0) <= REST_A and not told.is_armed(one.t_usec)
    ]  # fmt: skip
    if not rows:
        return None
    return median(one.volts or 0.0 for one in rows), median(one.percent or 0.0 for one in rows)


def _judge_voltage_step(told: LogEvidence, at: int, cells: int, confirmed: Say[V], refuted: Say[V]) -> V | None:
    before, after = _load(told, at - 20 * SECOND, at - 6 * SECOND), _load(told, at + 2 * SECOND, at + 15 * SECOND)
    if before is None or after is None or before.volts is None or after.volts is None:
        return None
    fell = (before.volts - after.volts) / cells
    back = max((one.volts or 0.0 for one in select_between(told.powers, at - SECOND, at + 15 * SECOND)), default=0.0)
    if back / cells >= before.volts / cells - BACK_V:
        return refuted(f"{back:.2f} V again within 15 s, where {before.volts:.2f} V had been usual")
    if before.amperes and after.amperes and abs(after.amperes - before.amperes) > LOAD_SHARE * before.amperes:
        words = f"{fell:+.2f} V a cell where the current went from {before.amperes:.0f} to {after.amperes:.0f} A"
        return refuted(words) if fell < 3 * STEP_V else None
    if fell >= STEP_V:
        return confirmed(f"{fell:.2f} V a cell lost, and not regained")
    return refuted(f"{fell:+.2f} V a cell between 13 s before and 8 s after")


def _load(told: LogEvidence, from_usec: int, to_usec: int) -> PowerReport | None:
    """Return the median voltage and current of an interval."""
    rows: Sequence[PowerReport] = select_between(told.powers, from_usec, to_usec)
    volts = [one.volts for one in rows if one.volts]
    drawn = [one.amperes for one in rows if one.amperes is not None]
    if not volts:
        return None
    return PowerReport(from_usec, median(volts), median(drawn) if drawn else None, None, None)


def _judge_by_counter(told: LogEvidence, since: int, at: int, confirmed: Say[V], refuted: Say[V]) -> V | None:
    """Check a drain against the measured current: before it, and in the half minute up to it."""
    flying = since + 10 * SECOND
    usual = [
        one.amperes
        for one in select_between(told.powers, flying, at - 30 * SECOND)
        if one.amperes and one.amperes > IDLE_A
    ]
    lately = [
        one.amperes for one in select_between(told.powers, at - 20 * SECOND, at + 5 * SECOND) if one.amperes is not None
    ]
    if len(usual) < 10 or len(lately) < 5:
        return None
    was, is_ = median(usual), median(lately)
    words = f"{is_:.1f} A where {was:.1f} A had been usual"
    if is_ >= MORE * was:
        return confirmed(words)
    return refuted(words) if is_ <= AS_BEFORE * was else None
