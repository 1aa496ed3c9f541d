"""Vehicles flown by other parties, and their detected faults."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

from executor.core.inflight.faults.passive_watch import Finding, PassiveWatch, VehicleReports
from executor.core.state.vehicle_state import Fault, FaultCode, FaultKind, Stage, VehicleState
from tests.executor.core.steps import (
    changes,
    differences,
    flight_of,
)
from tests.executor.core.vehicles import NOW_S, flying


def watched(*vehicles: VehicleState, **given: Any) -> PassiveWatch:
    """Return vehicles that are watched, whose modes were told."""
    known: dict[str, Any] = {name: given.pop(name) for name in ("open", "warned_s", "told") if name in given}
    state = flight_of(*vehicles, **given)
    there = {one.name: one for one in vehicles}
    told = {one.name: VehicleReports(mode_s=one.telemetry.mode_since_s) for one in vehicles}
    return replace(PassiveWatch(replace(state, vehicles=there)), **{"told": told, **known})


def seen(before: PassiveWatch, of: tuple[PassiveWatch, tuple[Finding, ...]]) -> tuple[object, ...]:
    """Return what was found, what changed of each vehicle and of the flight, and what is open."""
    after, found = of
    return (found, *differences(before.fleet, after.fleet), changes(before, replace(after, fleet=before.fleet)))


LOST = flying(
    stage=Stage.LOST,
    fault=Fault(FaultKind.LINK, "why", 5.0, FaultCode.LINK_LOST),
    heard_s=NOW_S - 50.0,
    spoke_s=NOW_S - 50.0,
)
