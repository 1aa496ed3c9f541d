"""Detect a drain by Page's test: the running sum of consumption beyond the expected, never below zero.

It needs no window: a severe drain crosses the threshold in seconds, a mild one in a minute. An excess in a single
report that does not continue is a re-estimated percentage, and is set aside.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

LEAST_REPORTS = 3
"""Reports that must show a drain; a single deviation is no rate."""
FEW_REPORTS, FEW_PCT = 2, 3.4
"""Fewer reports suffice from this excess on."""
CONTINUING_SHARE = 0.6
"""Share of the threshold that must come from reports other than the largest."""
JUMP_PCT = 2.0
"""Excess of a jump, in a single report: more than two rounding errors."""
JUMP_PCT_S = 1.0
"""Rate of a jump; faster than a drain that empties a battery in 100 s."""
JUMP_S = 6.0
SECOND_JUMP_S = 60.0
"""Time within which a second jump counts; a single one is a corrected estimate."""
CONSECUTIVE = 2.0
"""Number of report intervals within which two jumps are one drop; an estimate is not corrected twice in a row."""


@dataclass(frozen=True, slots=True)
class Drift:
    """The running sum and its parts."""

    excess_pct: float = 0.0
    """Consumption beyond the expected and its slack."""
    used_pct: float = 0.0
    expected_pct: float = 0.0
    since_s: float | None = None
    """When it was last zero."""
    reports: int = 0
    jumped_s: float = float("-inf")
    """When a jump was last set aside."""
    jumped_pct: float = 0.0
    """Its excess over the expected."""
    biggest_pct: float = 0.0
    """Largest excess of a single report in the sum."""

    def duration_s(self, now_s: float) -> float:
        """Return the time since it was last zero."""
        return 0.0 if self.since_s is None else now_s - self.since_s


def add_usage(drift: Drift, used_pct: float, expected_pct: float, *, slack_pct: float, elapsed_s: float, now_s: float,
             memory_s: float) -> Drift:  # fmt: skip
    """Add the consumption between two reports.

    Args:
        drift: The sum so far.
        used_pct: Consumption by the reports; negative where a percentage rose.
        expected_pct: Expected consumption, with the vehicle's learned factor.
        slack_pct: Excess that needs no explanation.
        elapsed_s: Time between the two reports.
        now_s: Time of the second report.
        memory_s: Time in which an excess decays to 1/e.
    """
    beyond = used_pct - expected_pct
    if beyond > JUMP_PCT and elapsed_s <= JUMP_S and beyond > JUMP_PCT_S * elapsed_s:
        if now_s - drift.jumped_s > SECOND_JUMP_S:
            return replace(drift, jumped_s=now_s, jumped_pct=beyond)
        if now_s - drift.jumped_s <= CONSECUTIVE * elapsed_s:
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
    """Return the sum with the jump set aside just before included."""
    return replace(
        drift,
        excess_pct=drift.excess_pct + drift.jumped_pct,
        used_pct=drift.used_pct + drift.jumped_pct,
        since_s=now_s - 2 * elapsed_s if drift.since_s is None else drift.since_s,
        reports=drift.reports + 1,
        biggest_pct=max(drift.biggest_pct, drift.jumped_pct),
    )


def is_drain(drift: Drift, threshold_pct: float, step_pct: float) -> bool:
    """Return whether it is a drain: several reports agree, or it is as large as a step.

    A re-estimated percentage is one large report among ordinary ones; a drain continues.
    """
    if drift.excess_pct < threshold_pct:
        return False
    goes_on = drift.excess_pct - drift.biggest_pct >= CONTINUING_SHARE * threshold_pct
    enough = FEW_REPORTS if drift.excess_pct >= FEW_PCT else LEAST_REPORTS
    return (drift.reports >= enough and goes_on) or drift.excess_pct >= step_pct
