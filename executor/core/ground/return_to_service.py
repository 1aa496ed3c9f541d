"""A vehicle on the ground that comes back into service, by the crew's word."""

from __future__ import annotations

from dataclasses import replace

from executor.core.replanning import replan_cycle
from executor.core.state.fleet_state import FleetState
from executor.core.state.vehicle_state import Stage, VehicleState, change_stage


def return_to_service(state: FleetState, vehicle: VehicleState) -> tuple[FleetState, VehicleState]:
    """Return a vehicle on the ground with nothing held against it, and the state that remembers what was."""
    mended = state.replanning.mended
    if vehicle.fault is not None:
        mended = (*mended, (vehicle.name, vehicle.fault))
    ready = (
        replace(change_stage(vehicle, Stage.GROUND), fault=None, watches=())
        .with_orders(excluded=False, lands=False, held_s=None, cleared_s=None)
        .with_assignment(stubborn=False, declined=None, failures=0)
        .with_telemetry(alarm=("", float("-inf")))
        .with_sortie(armed_once=False)
        .with_custody(taken=None)
    )
    return state.put(ready).with_replanning(mended=mended), ready


def clear_for_takeoff(state: FleetState, vehicle: VehicleState, now_s: float) -> FleetState:
    """Return the state in which everything open is planned with a vehicle that may take off now."""
    left = replan_cycle.find_left_over_segments(state)
    trigger = f"{vehicle.name}: back in service with {vehicle.power.battery.remaining_pct or 0.0:.0f} % in its battery"
    state = state.put(vehicle.with_orders(cleared_s=now_s)).with_crew(offers_over=False)
    return state.with_coverage(given_up=frozenset()).with_replanning(
        urgent=True,
        ordered=state.replanning.ordered or bool(left),  # what is left over is no need for a re-plan by itself
        trigger=trigger,
        trigger_s=now_s,
        considered=state.replanning.considered - {vehicle.name},
    )
