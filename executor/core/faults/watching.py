"""What a watchpoint is: a look at one vehicle at one moment, with its evidence."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from enum import Enum

from executor.core.context import Scene, VehicleSetup
from executor.core.own_words import acts
from executor.core.vehicle import FaultCode, FaultKind, Stage, VehicleState


class Verdict(Enum):
    """What a watchpoint says of one moment."""

    OK = "ok"
    FAIL = "fail"
    STALE = "stale"


@dataclass(frozen=True, slots=True)
class View:
    """What a watchpoint may look at."""

    context: Scene
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
    code: FaultCode


def said_failed(view: View, kind: str) -> str:
    """Return in words what an autopilot said has failed and made it act; nothing if it did not."""
    for failed, said_s in view.state.evidence.failed:
        if failed.what == kind and view.now_s - said_s <= view.context.limits.alarm_s and acts(failed):
            return f"it says: {failed.words}"
    return ""
