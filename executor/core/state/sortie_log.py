"""A vehicle's sorties: which pack each began and ended with."""

from __future__ import annotations

from dataclasses import replace

from executor.core.context import Context
from executor.core.state.fleet_state import FleetState
from executor.core.state.vehicle_parts import FlownSortie, PowerState
from executor.core.state.vehicle_state import VehicleState

REFILLED_PCT = 10.0
"""A pack at rest recovers by less."""


def begin_sortie(state: FleetState, vehicle: VehicleState, now_s: float) -> VehicleState:
    """Return a vehicle that is told to start; one that never left its pad since begins the same sortie again."""
    turn, rest = vehicle.turn, vehicle.power.pack.rest
    before = turn.sorties
    if before and before[-1].ended_s is None and not vehicle.sortie.took_off:
        before = before[:-1]
    own = tuple(sorted(segment for segment, name in state.coverage.inspected.items() if name == vehicle.name))
    sortie = FlownSortie(
        len(before) + 1,
        turn.label,
        now_s,
        vehicle.power.battery.remaining_pct,
        None if rest is None else rest.voltage_v,
        own,
    )
    return replace(vehicle, turn=replace(turn, sorties=(*before, sortie)))


def end_sortie(context: Context, vehicle: VehicleState, now_s: float) -> VehicleState:
    """Return a vehicle that has landed; what its pack held before a silence is not what it ended with."""
    turn = vehicle.turn
    if not turn.sorties or turn.sorties[-1].ended_s is not None or not vehicle.sortie.took_off:
        return vehicle
    power, sag = vehicle.power, vehicle.power.pack.sag
    # What its voltage says then is of another pack, in effect.
    refilled = (power.battery.remaining_pct or 0.0) > (power.landed_pct or 0.0) + REFILLED_PCT
    last = replace(
        turn.sorties[-1],
        ended_s=now_s,
        ended_pct=power.landed_pct if is_charge_fresh(context, power, now_s) else None,
        end_v=None if refilled else power.volts.voltage_v if sag is None else sag.recovered_v,
        cells=power.volts.cells if power.volts.voltage_v is not None else None,
    )
    return replace(vehicle, turn=replace(turn, sorties=(*turn.sorties[:-1], last)))


def is_charge_fresh(context: Context, power: PowerState, now_s: float) -> bool:
    """Return whether its percentage was reported just now."""
    return now_s - power.battery.reported_s <= context.limits.battery_stale_s
