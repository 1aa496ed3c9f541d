"""What a watchpoint is: a look at one vehicle at one moment, with its evidence."""

from __future__ import annotations

from collections.abc import Callable, Collection
from dataclasses import dataclass

from executor.core.context import Scene, VehicleSetup
from executor.core.state.vehicle_parts import PositionFix
from executor.core.state.vehicle_state import FaultCode, FaultKind, Stage, VehicleState
from executor.core.telemetry.failsafe_texts import has_failsafe_action
from missions.autopilots.dialect import is_mission_mode


@dataclass(frozen=True, slots=True)
class WatchView:
    """What a watchpoint may look at."""

    context: Scene
    setup: VehicleSetup
    state: VehicleState
    failing: bool
    """Whether it failed at the last look: the clear threshold may differ from the raise threshold."""
    now_s: float

    @property
    def fresh_fix(self) -> PositionFix | None:
        """Its newest position, if it is not old."""
        fix = self.state.motion.fix
        return None if fix is None or self.now_s - fix.at_s > self.context.limits.link_stale_s else fix


Finding = str | None
"""What a watchpoint says of one moment: its evidence in words where it fails."""
OK: Finding = ""
STALE: Finding = None
"""Nobody knows."""


@dataclass(frozen=True, slots=True)
class Watchpoint:
    """One row of the table; the first row that is raised gives the reason."""

    name: str
    kind: FaultKind
    judge: Callable[[WatchView], Finding]
    raise_after_s: float
    code: FaultCode
    stages: frozenset[Stage] = frozenset({Stage.FLYING})
    """The stages in which it is looked at: by default on its mission."""


def describe_reported_failure(view: WatchView, kind: str) -> str:
    """Return in words what an autopilot said has failed and made it act; nothing if it did not."""
    for failed, said_s in view.state.evidence.failed:
        if failed.what == kind and view.now_s - said_s <= view.context.limits.alarm_s and has_failsafe_action(failed):
            return f"it says: {failed.words}"
    return ""


LOST_ITSELF_S = 30.0


def is_estimate_lost(view: WatchView) -> bool:
    """Return whether its autopilot says that it does not know where it is, nor how fast it moves."""
    return has_failed_lately(view, {"ekf", "gps"}, LOST_ITSELF_S)


def has_failed_lately(view: WatchView, kinds: Collection[str], within_s: float) -> bool:
    """Return whether its autopilot said within a time that something of these kinds has failed."""
    return any(one.what in kinds and view.now_s - said_s <= within_s for one, said_s in view.state.evidence.failed)


def is_in_mission_mode(view: WatchView) -> bool:
    """Return whether it says that it is in mission mode."""
    return is_mission_mode(view.setup.dialect, view.state.mode)


def alarm_words(view: WatchView) -> str:
    """Return what the vehicle said of it, if it did."""
    text, said_s = view.state.telemetry.alarm
    return f"; it says: {text}" if view.now_s - said_s <= view.context.limits.alarm_s else ""
