"""Page's test on consumption: the sum of what was used beyond what explains itself, never below nothing.

It needs no window: a severe drain crosses the threshold in seconds, a mild one in a minute, and what comes in a single
report and does not go on - a percentage that was estimated anew - is set aside.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

ENOUGH_REPORTS = 3
"""A drain shows in several reports; a single one that is off is no rate."""
FEW_REPORTS, FEW_PCT = 2, 3.4
"""Of so much excess two reports are enough."""
GOES_ON = 0.6
"""Share of the threshold that must come from other reports than the largest."""
JUMP_PCT = 2.0
"""More than two roundings, in a single report."""
JUMP_PCT_S = 1.0
"""A drain that empties a battery in 100 s is slower than a jump."""
JUMP_S = 6.0
JUMP_AGAIN_S = 60.0
"""One jump is an estimate that was corrected; another one within this time is not."""
AT_ONCE = 2.0
"""Reports in which a second jump makes one fall of both: nothing is corrected twice running."""


@dataclass(frozen=True, slots=True)
class Drift:
    """The sum, and what it is made of."""

    excess_pct: float = 0.0
    """Used beyond the expected and its slack."""
    used_pct: float = 0.0
    expected_pct: float = 0.0
    since_s: float | None = None
    """When it was last nothing."""
    reports: int = 0
    jumped_s: float = float("-inf")
    """When a report was last set aside."""
    jumped_pct: float = 0.0
    """How much it had beyond the expected."""
    biggest_pct: float = 0.0
    """The largest part that a single report has in it."""

    def duration_s(self, now_s: float) -> float:
        """Return for how long it has been more than nothing."""
        return 0.0 if self.since_s is None else now_s - self.since_s


def add_usage(drift: Drift, used_pct: float, expected_pct: float, *, slack_pct: float, elapsed_s: float, now_s: float,
             memory_s: float) -> Drift:  # fmt: skip
    """Add what was used in the time between two reports.

    Args:
        drift: so far.
        used_pct: by the reports; negative where a percentage rose.
        expected_pct: with what was learned of the vehicle.
        slack_pct: what needs no explanation beyond the expected.
        elapsed_s: between the two reports.
        now_s: the second report.
        memory_s: in which an excess is forgotten but for 1/e.
    """
    beyond = used_pct - expected_pct
    if beyond > JUMP_PCT and elapsed_s <= JUMP_S and beyond > JUMP_PCT_S * elapsed_s:
        if now_s - drift.jumped_s > JUMP_AGAIN_S:
            return replace(drift, jumped_s=now_s, jumped_pct=beyond)
        if now_s - drift.jumped_s <= AT_ONCE * elapsed_s:
            drift = _include_first_jump(drift, elapsed_s, now_s)
        drift = replace(drift, jumped_s=now_s, jumped_pct=0.0)
    excess = drift.excess_pct * math.exp(-elapsed_s / memory_s) + beyond - slack_pct
    if excess <= 0.0:
        return Drift(jumped_s=drift.jumped_s, jumped_pct=drift.jumped_pct)
    return Drift(
        excess,
        drift.used_pct + used_pct,
        drift.expected_pct + expected_pct,
        now_s - elapsed_s if drift.since_s is None else drift.since_s,
        drift.reports + 1,
        drift.jumped_s,
        drift.jumped_pct,
        max(drift.biggest_pct, beyond),
    )


def _include_first_jump(drift: Drift, elapsed_s: float, now_s: float) -> Drift:
    """Return the sum with the jump that was set aside just before."""
    return replace(
        drift,
        excess_pct=drift.excess_pct + drift.jumped_pct,
        used_pct=drift.used_pct + drift.jumped_pct,
        since_s=now_s - 2 * elapsed_s if drift.since_s is None else drift.since_s,
        reports=drift.reports + 1,
        biggest_pct=max(drift.biggest_pct, drift.jumped_pct),
    )


def is_drain(drift: Drift, threshold_pct: float, step_pct: float) -> bool:
    """Return whether it is a drain: several reports agree, or it is as much as a step.

    A percentage that was estimated anew is one large report among ordinary ones; a drain goes on.
    """
    if drift.excess_pct < threshold_pct:
        return False
    goes_on = drift.excess_pct - drift.biggest_pct >= GOES_ON * threshold_pct
    enough = FEW_REPORTS if drift.excess_pct >= FEW_PCT else ENOUGH_REPORTS
    return (drift.reports >= enough and goes_on) or drift.excess_pct >= step_pct
