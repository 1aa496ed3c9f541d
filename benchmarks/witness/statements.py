"""Explicit statements of a log: crashes, battery failsafes and silences, each of which a detector must declare."""

from __future__ import annotations

import re
from dataclasses import dataclass
from enum import StrEnum
from pathlib import Path

from benchmarks.witness.log_evidence import SECOND, LogEvidence
from executor.core.state.vehicle_state import FaultKind

DATAFLASH, ULOG = b"\xa3\x95", b"ULog"


class StatementKind(StrEnum):
    """Kinds of statements."""

    CRASH = "crash"
    BATTERY = "battery failsafe"
    SILENCE = "link gap"


RIGHT = {
    StatementKind.CRASH: frozenset({FaultKind.INTERRUPTION, FaultKind.DOWN}),
    StatementKind.BATTERY: frozenset({FaultKind.BATTERY}),
    StatementKind.SILENCE: frozenset({FaultKind.LINK}),
}
CRASH = re.compile(
    r"crash: disarm|crash: emergency|parachute: crash|crash detected|attitude failure|flight terminat", re.IGNORECASE
)
BATTERY = re.compile(
    r"^(?!.*(?:prearm|preflight|arm:)).*(low battery!|^low battery$|battery failsafe|batt(ery)? \d* ?is (low|critical)|"
    r"(critical|emergency|dangerously low) battery|battery (level )?(critical|emergency))",
    re.IGNORECASE,
)  # fmt: skip
"""ArduPilot 3.3 "Low Battery!", 3.4 "Low battery", 3.6 on "Battery 1 is low 10.2V used 900 mAh" and "Battery Failsafe";
PX4 "Critical battery, return now". PX4's "Low battery level" is a warning without an action of PX4."""
EKF = re.compile(r"EKF (variance|failsafe|primary)|DCM bad|bad ahrs|compass variance|position lost", re.IGNORECASE)
SAME_S = {StatementKind.CRASH: 20.0, StatementKind.BATTERY: 120.0, StatementKind.SILENCE: 0.0}
"""Interval within which a repeated statement counts once."""
EMERGENCY_STATES = frozenset({6, 8})


@dataclass(frozen=True, slots=True)
class Statement:
    """One statement of a log about one vehicle."""

    what: StatementKind
    t_usec: int
    """Time of the statement; of a silence, its begin."""
    words: str
    until_usec: int | None = None


def read_log_evidence(path: Path) -> dict[int, LogEvidence]:
    """Return a log's evidence, by system; empty for a file that is no log.

    Raises:
        OSError: it cannot be read.
    """
    from benchmarks.witness.dataflash_log import read_onboard
    from benchmarks.witness.px4_log import read_px4
    from benchmarks.witness.telemetry_log import read_telemetry

    with path.open("rb") as file:
        head = file.read(16)
    if head.startswith(ULOG):
        return read_px4(path)
    if head.startswith(DATAFLASH):
        return read_onboard(path)
    if len(head) > 8 and head[8] in {0xFD, 0xFE}:
        return read_telemetry(path)
    return read_onboard(path) if path.suffix.lower() in {".log", ".bin"} else {}


def find_statements(told: LogEvidence, link_timeout_s: float) -> list[Statement]:
    """Return a log's statements about an armed vehicle, in order of time."""
    found = [
        *((StatementKind.CRASH, one.t_usec, one.words) for one in told.texts if CRASH.search(one.words)),
        *((StatementKind.BATTERY, one.t_usec, one.words) for one in told.texts if BATTERY.search(one.words)),
        *((StatementKind.CRASH, one.t_usec, one.words) for one in told.failings if one.kind == "crash"),
        *((StatementKind.BATTERY, one.t_usec, one.words) for one in told.failings if one.kind == "battery"),
    ]
    once: list[Statement] = []
    last: dict[StatementKind, int] = {}
    for what, t_usec, words in sorted(found, key=lambda one: one[1]):
        # A crash check disarms at once: its text may come after the heartbeat that reports it.
        if not (told.is_armed(t_usec) or (what is StatementKind.CRASH and told.is_armed(t_usec - 3 * SECOND))):
            continue
        if what in last and t_usec - last[what] < SAME_S[what] * SECOND:
            last[what] = t_usec
            continue
        last[what] = t_usec
        once.append(Statement(what, t_usec, words))
    if not told.on_board:
        once += _find_link_silences(told, link_timeout_s)
    return sorted(once, key=lambda one: one.t_usec)


def _find_link_silences(told: LogEvidence, link_timeout_s: float) -> list[Statement]:
    """Return silences of the link: other senders were heard meanwhile, or there are none."""
    return [
        Statement(StatementKind.SILENCE, one.from_usec, f"nothing of it for {one.lasted_s:.1f} s", one.to_usec)
        for one in told.silences
        if one.lasted_s >= link_timeout_s + MARGIN_S and one.others is True and told.is_armed(one.from_usec)
    ]


MARGIN_S = 0.5
"""A silence hardly longer than the time-out may be declared or not."""
