"""A base of a day that is closed: nobody takes off from it until the crew opens it again.

Who is in the air lands there all the same, as it has no other place; what its vehicles had ahead of them is open for
the sorties of others.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from executor.core.commands import Command, SendHome
from executor.core.context import Context
from executor.core.replan import new_missions
from executor.core.roster.withdraw import declare, left_plan, withdrawn
from executor.core.state import FleetState, Stepped
from executor.core.vehicle import Fault, FaultCode, FaultKind, Stage, VehicleState


def base_names(context: Context) -> tuple[str, ...]:
    """Return the bases of the day; none where the flight is no day of sorties."""
    return () if context.day is None else tuple(dict.fromkeys(context.day.bases.values()))


def based_at(context: Context, state: FleetState, base: str) -> tuple[VehicleState, ...]:
    """Return the vehicles that stand at a base, or land there."""
    bases = {} if context.day is None else context.day.bases
    return tuple(vehicle for name, vehicle in state.vehicles.items() if bases.get(name) == base)


def is_closed(context: Context, state: FleetState, base: str) -> bool:
    """Return whether nobody may take off from a base."""
    return all(vehicle.orders.base_closed for vehicle in based_at(context, state, base))


def base_closed(context: Context, state: FleetState, base: str, now_s: float) -> tuple[FleetState, tuple[Command, ...]]:
    """Return the state in which nobody takes off from a base, and what keeps those there that were about to."""
    commands: list[Command] = []
    for vehicle in based_at(context, state, base):
        shut = replace(vehicle, orders=replace(vehicle.orders, base_closed=True, cleared_s=None))
        state, more = _kept_there(context, state.put(shut), shut, f"base {base} is closed", now_s)
        commands.extend(more)
    return state, tuple(commands)


def _kept_there(context: Context, state: FleetState, vehicle: VehicleState, why: str, now_s: float) -> Stepped:
    """Keep a vehicle on the ground that is being sent out."""
    if vehicle.stage is Stage.STARTING and vehicle.armed and not vehicle.sortie.took_off:
        fault = Fault(FaultKind.OPERATOR, "its base was closed during its start", now_s, FaultCode.OPERATOR_EXCLUDE)
        return declare(context, state, vehicle, fault)
    if vehicle.stage is Stage.STARTING and not vehicle.armed:
        left = left_plan(vehicle, Stage.LANDED, now_s)
        state, more = withdrawn(state.put(left), vehicle.name, f"{vehicle.name}: {why}", now_s)
        return state, (*more, SendHome(vehicle.name))  # in place of its start
    plan = state.replanning.replan
    if vehicle.stage not in {Stage.GROUND, Stage.LANDED} or plan is None or vehicle.name not in plan.pending:
        return state, ()
    state, _, said = new_missions.let_go(state, plan, vehicle.name, why, now_s)
    state, more = new_missions.ended_if_done(state, now_s)
    return state, (said, *more)


def base_opened(context: Context, state: FleetState, base: str) -> FleetState:
    """Return the state in which vehicles may be sent out from a base again, each by the crew's word."""
    for vehicle in based_at(context, state, base):
        state = state.put(replace(vehicle, orders=replace(vehicle.orders, base_closed=False)))
    return state


def in_the_air(vehicles: Sequence[VehicleState]) -> tuple[str, ...]:
    """Return who is not on the ground."""
    away = {Stage.GROUND, Stage.LANDED, Stage.DOWN, Stage.LOST}
    return tuple(vehicle.name for vehicle in vehicles if vehicle.stage not in away)
