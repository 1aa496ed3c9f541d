"""Whether a log's statements were declared: with the right kind, and in time."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

from benchmarks.witness.log_evidence import SECOND, LogEvidence
from benchmarks.witness.statements import RIGHT, Statement, StatementKind
from executor.core.state.vehicle_state import FaultKind

LATE_S = 2.0
"""Time after the autopilot's own text, or after the time-out, in which a declaration still counts."""
TOO_LATE_S = 60.0
LEAD_S = {StatementKind.CRASH: 30.0, StatementKind.BATTERY: 900.0, StatementKind.SILENCE: 0.0}
"""Time before it in which a declaration of the right kind counts for it."""


@dataclass(frozen=True, slots=True)
class Answered:
    """How a log's statement was declared."""

    outcome: str
    """declared, late or missed."""
    after_s: float | None
    """Time after the text, or after the time-out; negative is before it."""


def found_all(
    told: LogEvidence, stated: Sequence[Statement], declared: Iterable[tuple[int, FaultKind]], link_timeout_s: float
) -> list[Answered]:
    """Return how each statement of a log was declared, by times and kinds of the declarations.

    A declaration belongs to the same flight, whose start is uncertain by a second in old logs. One crash is declared
    once: an earlier crash has its own declaration.
    """
    said, outcomes, crashed_usec = list(declared), [], 0
    for one in stated:
        since = told.find_arming_usec(one.t_usec) or told.find_arming_usec(one.t_usec - 3 * SECOND) or 0
        since = max(since, crashed_usec) if one.what is StatementKind.CRASH else since
        crashed_usec = one.t_usec + 2 * SECOND if one.what is StatementKind.CRASH else crashed_usec
        outcomes.append(_found(one, [pair for pair in said if pair[0] >= since - SECOND], link_timeout_s))
    return outcomes


def _found(stated: Statement, declared: Iterable[tuple[int, FaultKind]], link_timeout_s: float) -> Answered:
    due = stated.t_usec + round((link_timeout_s if stated.what is StatementKind.SILENCE else 0.0) * SECOND)
    first = due - round(LEAD_S[stated.what] * SECOND)
    last = due + round(TOO_LATE_S * SECOND) if stated.until_usec is None else stated.until_usec + SECOND
    right = sorted(t_usec for t_usec, kind in declared if kind in RIGHT[stated.what] and first <= t_usec <= last)
    if not right:
        return Answered("missed", None)
    after_s = (right[0] - due) / 1e6
    return Answered("declared" if after_s <= LATE_S else "late", round(after_s, 2))
