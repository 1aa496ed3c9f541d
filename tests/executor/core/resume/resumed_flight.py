"""A resumed flight."""

from __future__ import annotations

from typing import Any

from executor.core.context import Context
from executor.core.interface.commands import Upload
from executor.core.interface.events import Found, Match, Resumed
from executor.core.resume import reconciliation
from executor.core.state.fleet_state import Replan
from executor.core.state.vehicle_state import VehicleState
from tests.executor.core.steps import (
    differences,
    flight_of,
)
from tests.executor.core.vehicles import FLEET, NOW_S

CONTEXT = FLEET.context


def found(*matches: Match, seq: int | None = 5, items: int | None = 10, heard: bool = True) -> Found:
    return Found("uav1", heard, seq, items, matches)


def taken_up(
    one: VehicleState, found: Found, *, context: Context = CONTEXT, beside: tuple[VehicleState, ...] = (), **given: Any
) -> tuple[Any, ...]:
    """Return the lines and orders, what came to its end meanwhile, what is strange, and what changed."""
    before = flight_of(one, *beside, **given)
    taken = reconciliation.resume_fleet(context, before, Resumed((found,)), NOW_S)
    told = [
        f"upload {one.vehicle} {one.revision} {one.airborne}" if isinstance(one, Upload) else one
        for one in taken.commands
    ]
    ones, flight = differences(before, taken.state)
    plan = flight.get("replan")
    if isinstance(plan, Replan):
        flight["replan"] = (sorted(plan.pending), sorted(plan.missions), plan.unmade)
    return told, taken.ended, taken.strange, ones, flight
