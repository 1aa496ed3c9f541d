"""A kill switch that is on where a vehicle stands: no start until included.

In flight the vehicle shows it by being disarmed. On the ground nothing but its words tells it, and both autopilots
refuse to arm as long as the switch is on.
"""

from __future__ import annotations

from executor.core.interface.commands import Command, HandsOff, Level, Say
from executor.core.interface.messages import StatusText
from executor.core.replanning.withdrawal import leave_plan, withdraw_vehicle
from executor.core.state.fleet_state import FleetState, Stepped
from executor.core.state.vehicle_position import is_kill_switch_text
from executor.core.state.vehicle_state import Stage, VehicleState

_STANDS = frozenset({Stage.GROUND, Stage.LANDED, Stage.STARTING})


def apply_kill_switch_text(state: FleetState, vehicle: VehicleState, text: StatusText, now_s: float) -> Stepped:
    """Leave a vehicle on the ground that says that its kill switch is on."""
    stands = vehicle.stage in _STANDS and not vehicle.armed and not vehicle.orders.excluded
    if state.progress.launched_s is None or not stands or not is_kill_switch_text(text.text):
        return state, ()
    return stand_down_vehicle(state, vehicle, now_s)


def stand_down_vehicle(state: FleetState, vehicle: VehicleState, now_s: float) -> Stepped:
    """Leave a vehicle that stands with its kill switch on."""
    name, starting = vehicle.name, vehicle.stage is Stage.STARTING
    commands: tuple[Command, ...] = (HandsOff(name),)
    if starting:
        vehicle = leave_plan(vehicle, Stage.LANDED, now_s)
    given = starting or vehicle.assignment.pending is not None
    state = state.put(vehicle.with_orders(excluded=True, cleared_s=None).with_assignment(pending=None))
    if given:
        state, more = withdraw_vehicle(state, name, f"{name}: its kill switch is on", now_s)
        commands = (*commands, *more)
    line = f"{name}: its kill switch is on; no start until included"
    return state, (Say(Level.FAULT, line), *commands)
