"""Truths of recorded flights: *_truth.json files with the faults injected into each log, and their times."""

from __future__ import annotations

import json
import re
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from executor.core.state.vehicle_state import FaultKind
from executor.errors import LogError

KINDS: Mapping[str, FaultKind] = {
    "battery fault": FaultKind.BATTERY,
    "link loss": FaultKind.LINK,
    "fence breach": FaultKind.FENCE,
    "interruption": FaultKind.INTERRUPTION,
    "mission interruption": FaultKind.INTERRUPTION,
}
"""Names of faults in a truth; any other kind is no fault."""
_ROUTINE = re.compile(r"first heartbeat|\barmed|disarmed|\bend(s|ed)?\b|\bover\b|\bback\b", re.IGNORECASE)
"""Events of every flight, and ends of injected faults."""


@dataclass(frozen=True, slots=True)
class TrueEvent:
    """One true event, from the truth of a log."""

    t_usec: int
    """Time on the log's own clock."""
    what: str


@dataclass(frozen=True, slots=True)
class RecordedTruth:
    """Truth of a recorded flight."""

    kind: FaultKind | None
    """Injected fault; None for a healthy flight."""
    fault_usec: int | None
    """Time at which it became visible in the data, on the log's own clock."""
    events: tuple[TrueEvent, ...]


def read_recorded_truths(folder: Path) -> dict[str, RecordedTruth]:
    """Return the truths of a folder by the names of its telemetry logs; empty without any.

    Raises:
        LogError: a truth file cannot be used.
    """
    found: dict[str, RecordedTruth] = {}
    for path in sorted(folder.glob("*_truth.json")):
        try:
            content = json.loads(path.read_text(encoding="utf-8"))
            found |= {name: _parse_truth(row, on_board=False) for name, row in content["logs"].items()}
            found |= {Path(name).stem: _parse_truth(row, on_board=True) for name, row in content["logs"].items()}
        except OSError as error:
            raise LogError(f"{path}: cannot be read: {error.strerror}") from error
        except (ValueError, KeyError, TypeError, AttributeError) as error:
            raise LogError(f"{path}: expected the truths of recorded flights: {error!r}") from error
    return found


def truth_for(log: Path, truths: Mapping[str, RecordedTruth]) -> RecordedTruth | None:
    """Return the truth of a log; an autopilot's own log shares that of the telemetry log with its name."""
    return truths.get(log.name) if log.suffix.lower() == ".tlog" else truths.get(log.stem)


def _parse_truth(row: Mapping[str, Any], *, on_board: bool) -> RecordedTruth:
    """Parse one; the autopilots' own logs count from the vehicle's boot."""
    events = tuple(
        TrueEvent(_parse_time_usec(event, on_board=on_board), str(event["what"])) for event in row["events"]
    )  # fmt: skip
    kind = KINDS.get(row["kind"])
    if kind is FaultKind.LINK and row.get("vehicle_silent") and not on_board:
        return RecordedTruth(kind, row["vehicle_silent"][0]["from_usec"], events)
    injected = [event for event in events if not _ROUTINE.search(event.what.split("(")[0])]
    if on_board and kind is FaultKind.LINK:
        kind = None  # the vehicle's own log does not show it
    return RecordedTruth(kind, injected[0].t_usec if injected and kind is not None else None, events)


def _parse_time_usec(event: Mapping[str, Any], *, on_board: bool) -> int:
    return int(event["boot_ms"]) * 1000 if on_board else int(event["t_usec"])
