"""The source of a mode change, from the log around it."""

from __future__ import annotations

import re

from benchmarks.witness.log_evidence import Controller, LogEvidence, ModeSet, select_near
from benchmarks.witness.statements import BATTERY, CRASH, EKF

BEFORE_S, AFTER_S = 3.5, 1.5
"""HEARTBEAT shows a mode up to a second, on a bad link a few, after it was set; its acknowledgement may come after."""
FAILSAFE = re.compile(
    r"fail ?safe|radio .*lost|fence breach|terrain data missing|gps glitch|low battery|battery (is )?(low|critical)|"
    r"manual control lost|gcs (connection )?lost|data link lost|critical battery|battery level|position control lost",
    re.IGNORECASE,
)
OVER = re.compile(r"clear|cleared|over|ok\b|regained|disabled|prearm", re.IGNORECASE)
ENDED = re.compile(r"mission complete|mission finished|mission: \d+ (rtl|land)", re.IGNORECASE)


def hand_of(told: LogEvidence, change: ModeSet) -> tuple[Controller, str]:
    """Return the source of a mode change, and the line of the log that shows it."""
    if change.by is not None:
        return change.by, change.words
    moved = select_near(told.switches, change.t_usec, BEFORE_S, AFTER_S)
    if moved:
        return Controller.PILOT, moved[-1].words
    ordered = select_near(told.orders, change.t_usec, BEFORE_S, AFTER_S)
    if ordered:
        return Controller.STATION, ordered[-1].words
    failed = select_near(told.failings, change.t_usec, BEFORE_S, AFTER_S)
    if failed:
        return Controller.FAILSAFE, failed[0].words
    texts = [one.words for one in select_near(told.texts, change.t_usec, BEFORE_S + 1.5, AFTER_S)]
    said = next((words for words in texts if _failsafe(words)), "")
    if said:
        return Controller.FAILSAFE, said
    ended = next((words for words in texts if ENDED.search(words)), "")
    if ended:
        return Controller.MISSION, ended
    return Controller.NOBODY, ""


def _failsafe(words: str) -> bool:
    told = any(pattern.search(words) for pattern in (FAILSAFE, BATTERY, CRASH, EKF))
    return told and not OVER.search(words)
