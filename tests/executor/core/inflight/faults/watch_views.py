"""One look at a vehicle."""

from __future__ import annotations

from executor.core.context import VehicleSetup
from executor.core.inflight.faults import warning_rules, watchpoints
from executor.core.inflight.faults.watchpoint_types import Verdict, Watchpoint, WatchView
from executor.core.state.vehicle_state import VehicleState
from tests.executor.core.vehicles import FLEET, NOW_S

CONTEXT = FLEET.context
PLANNED = CONTEXT.vehicles["uav1"]


def point(name: str) -> Watchpoint:
    return next(watchpoint for watchpoint in watchpoints.TABLE if watchpoint.name == name)


def verdict(name: str, state: VehicleState, *, failing: bool = False) -> Verdict:
    return point(name).judge(WatchView(CONTEXT, PLANNED, state, failing, NOW_S)).verdict


def look(name: str, one: VehicleState, setup: VehicleSetup = PLANNED, *, failing: bool = False) -> str:
    """Return what a watchpoint finds: its evidence, ok, or stale."""
    point = next(point for point in watchpoints.TABLE if point.name == name)
    found = point.judge(WatchView(CONTEXT, setup, one, failing, NOW_S))
    return found.evidence or found.verdict.value


def warn(name: str, one: VehicleState, setup: VehicleSetup = PLANNED) -> str:
    """Return what a warning says."""
    row = next(row for row in warning_rules.TABLE if row.name == name)
    return row.look(WatchView(CONTEXT, setup, one, False, NOW_S))
