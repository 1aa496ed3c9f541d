"""One look at a vehicle."""

from __future__ import annotations

from enum import Enum

from executor.core.context import VehicleSetup
from executor.core.inflight.faults import warning_rules, watchpoints
from executor.core.inflight.faults.watch_view import Finding, Watchpoint, WatchView
from executor.core.state.vehicle_state import VehicleState
from tests.executor.core.vehicles import FLEET, NOW_S

CONTEXT = FLEET.context
PLANNED = CONTEXT.vehicles["uav1"]


class Verdict(Enum):
    """What a watchpoint says of one moment, without its words."""

    OK = "ok"
    FAIL = "fail"
    STALE = "stale"


def verdict_of(found: Finding) -> Verdict:
    return Verdict.STALE if found is None else Verdict.FAIL if found else Verdict.OK


def point(name: str) -> Watchpoint:
    return next(watchpoint for watchpoint in watchpoints.TABLE if watchpoint.name == name)


def verdict(name: str, state: VehicleState, *, failing: bool = False) -> Verdict:
    return verdict_of(point(name).judge(WatchView(CONTEXT, PLANNED, state, failing, NOW_S)))


def look(name: str, one: VehicleState, setup: VehicleSetup = PLANNED, *, failing: bool = False) -> str:
    """Return what a watchpoint finds: its evidence, ok, or stale."""
    point = next(point for point in watchpoints.TABLE if point.name == name)
    found = point.judge(WatchView(CONTEXT, setup, one, failing, NOW_S))
    return found or verdict_of(found).value


def warn(name: str, one: VehicleState, setup: VehicleSetup = PLANNED) -> str:
    """Return what a warning says."""
    row = next(row for row in warning_rules.TABLE if row.name == name)
    return row.look(WatchView(CONTEXT, setup, one, False, NOW_S))
