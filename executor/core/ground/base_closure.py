"""A base of a day that is closed: nobody takes off from it until the crew opens it again.

Who is in the air lands there all the same, as it has no other place; what its vehicles had ahead of them is open for
the sorties of others.
"""

from __future__ import annotations

from collections.abc import Sequence

from executor.core.context import Context
from executor.core.interface.commands import Command, SendHome
from executor.core.replanning import new_missions
from executor.core.replanning.withdrawal import declare_fault, leave_plan, withdraw_vehicle
from executor.core.state.fleet_state import FleetState, Stepped
from executor.core.state.vehicle_state import Fault, FaultCode, FaultKind, Stage, VehicleState


def list_bases(context: Context) -> tuple[str, ...]:
    """Return the bases of the day; none where the flight is no day of sorties."""
    return () if context.day is None else tuple(dict.fromkeys(context.day.bases.values()))


def find_vehicles_at_base(context: Context, state: FleetState, base: str) -> tuple[VehicleState, ...]:
    """Return the vehicles that stand at a base, or land there."""
    bases = {} if context.day is None else context.day.bases
    return tuple(vehicle for name, vehicle in state.vehicles.items() if bases.get(name) == base)


def is_base_closed(context: Context, state: FleetState, base: str) -> bool:
    """Return whether nobody may take off from a base."""
    return all(vehicle.orders.base_closed for vehicle in find_vehicles_at_base(context, state, base))


def close_base(context: Context, state: FleetState, base: str, now_s: float) -> Stepped:
    """Return the state in which nobody takes off from a base, and what keeps those there that were about to."""
    commands: list[Command] = []
    for vehicle in find_vehicles_at_base(context, state, base):
        shut = vehicle.with_orders(base_closed=True, cleared_s=None)
        state, more = _keep_on_ground(context, state.put(shut), shut, f"base {base} is closed", now_s)
        commands.extend(more)
    return state, tuple(commands)


def _keep_on_ground(context: Context, state: FleetState, vehicle: VehicleState, why: str, now_s: float) -> Stepped:
    """Keep a vehicle on the ground that is being sent out."""
    if vehicle.stage is Stage.STARTING and vehicle.armed and not vehicle.sortie.took_off:
        fault = Fault(FaultKind.OPERATOR, "its base was closed during its start", now_s, FaultCode.OPERATOR_EXCLUDE)
        return declare_fault(context, state, vehicle, fault)
    if vehicle.stage is Stage.STARTING and not vehicle.armed:
        left = leave_plan(vehicle, Stage.LANDED, now_s)
        state, more = withdraw_vehicle(state.put(left), vehicle.name, f"{vehicle.name}: {why}", now_s)
        return state, (*more, SendHome(vehicle.name))  # in place of its start
    plan = state.replanning.replan
    if vehicle.stage not in {Stage.GROUND, Stage.LANDED} or plan is None or vehicle.name not in plan.pending:
        return state, ()
    state, _, said = new_missions.drop_late_mission(state, plan, vehicle.name, why, now_s)
    state, more = new_missions.end_replan_if_done(state, now_s)
    return state, (said, *more)


def open_base(context: Context, state: FleetState, base: str) -> FleetState:
    """Return the state in which vehicles may be sent out from a base again, each by the crew's word."""
    for vehicle in find_vehicles_at_base(context, state, base):
        state = state.put(vehicle.with_orders(base_closed=False))
    return state


def find_airborne_names(vehicles: Sequence[VehicleState]) -> tuple[str, ...]:
    """Return who is not on the ground."""
    away = {Stage.GROUND, Stage.LANDED, Stage.DOWN, Stage.LOST}
    return tuple(vehicle.name for vehicle in vehicles if vehicle.stage not in away)
