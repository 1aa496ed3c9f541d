"""Take vehicles on the ground out of service and back: closed bases, kill switches, the crew's include.

A vehicle in the air when its base is closed still lands there, having no other place; the later sorties of its vehicles
are opened to others. In flight a kill switch shows by disarming; on the ground only its text shows it, and both
autopilots refuse to arm while it is on.
"""

from __future__ import annotations

from dataclasses import replace

from executor.core.context import Context
from executor.core.interface.commands import Command, HandsOff, SendHome
from executor.core.interface.messages import StatusText
from executor.core.lines import sorties
from executor.core.replanning import replan_cycle
from executor.core.replanning.withdrawal import declare_fault, leave_plan, withdraw_vehicle
from executor.core.state.bases import base_of, landing_base_of
from executor.core.state.fleet_state import FleetState, Stepped, step_each
from executor.core.state.vehicle_position import is_kill_switch_text
from executor.core.state.vehicle_state import Fault, FaultCode, FaultKind, Stage, VehicleState, change_stage

_STANDS = frozenset({Stage.GROUND, Stage.LANDED, Stage.STARTING})


def list_bases(context: Context) -> tuple[str, ...]:
    """Return the bases of the day; empty if the flight is no day of sorties."""
    if context.day is None:
        return ()
    elsewhere = (base for own in context.day.pads.values() for base in own)
    return tuple(dict.fromkeys((*context.day.bases.values(), *elsewhere)))


def find_vehicles_at_base(context: Context, state: FleetState, base: str) -> tuple[VehicleState, ...]:
    """Return the vehicles that stand at a base, or land there."""
    return tuple(
        one
        for one in state.vehicles.values()
        if landing_base_of(context, one) == base or (one.stage in _STANDS and base_of(context, one) == base)
    )


def close_base(context: Context, state: FleetState, base: str, now_s: float) -> Stepped:
    """Return the state with a base closed to take-offs, and the commands that keep vehicles there."""
    state, why = (
        state.with_crew(closed_bases=state.crew.closed_bases | {base}),
        sorties.BASE_IS_CLOSED.format(base=base),
    )
    vehicles = find_vehicles_at_base(context, state, base)
    return step_each(state, vehicles, lambda state, vehicle: _keep_on_ground(context, state, vehicle, why, now_s))


def _keep_on_ground(context: Context, state: FleetState, vehicle: VehicleState, why: str, now_s: float) -> Stepped:
    vehicle = vehicle.with_orders(cleared_s=None)
    state = state.put(vehicle)
    if vehicle.stage is Stage.STARTING and vehicle.armed and not vehicle.sortie.took_off:
        fault = Fault(FaultKind.OPERATOR, sorties.CLOSED_IN_START, now_s, FaultCode.OPERATOR_EXCLUDE)
        return declare_fault(context, state, vehicle, fault)
    if vehicle.stage is Stage.STARTING and not vehicle.armed:
        left = leave_plan(vehicle, Stage.LANDED, now_s)
        state, more = withdraw_vehicle(state.put(left), vehicle.name, f"{vehicle.name}: {why}", now_s)
        return state, (*more, SendHome(vehicle.name))  # instead of its start
    plan = state.replanning.replan
    if not vehicle.is_on_base or plan is None or vehicle.name not in plan.pending:
        return state, ()
    return replan_cycle.release_vehicle(state, plan, vehicle.name, why, now_s)


def apply_kill_switch_text(state: FleetState, vehicle: VehicleState, text: StatusText, now_s: float) -> Stepped:
    """Keep a vehicle on the ground that reports its kill switch on."""
    stands = vehicle.stage in _STANDS and not vehicle.armed and not vehicle.orders.excluded
    if state.progress.launched_s is None or not stands or not is_kill_switch_text(text.text):
        return state, ()
    return stand_down_vehicle(state, vehicle, now_s)


def stand_down_vehicle(state: FleetState, vehicle: VehicleState, now_s: float) -> Stepped:
    """Keep a vehicle with its kill switch on."""
    name, starting = vehicle.name, vehicle.stage is Stage.STARTING
    commands: tuple[Command, ...] = (HandsOff(name),)
    if starting:
        vehicle = leave_plan(vehicle, Stage.LANDED, now_s)
    given = starting or vehicle.assignment.pending is not None
    state = state.put(vehicle.with_orders(excluded=True, cleared_s=None).with_assignment(pending=None))
    if given:
        state, more = withdraw_vehicle(state, name, sorties.KILL_SWITCH_TRIGGER.format(vehicle=name), now_s)
        commands = (*commands, *more)
    return state, (sorties.KILL_SWITCH.say(vehicle=name), *commands)


def return_to_service(state: FleetState, vehicle: VehicleState) -> tuple[FleetState, VehicleState]:
    """Return a vehicle on the ground as back in service, and the state with a record of its fault."""
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
    """Return the state with a vehicle cleared for take-off and a re-plan of all open segments."""
    left, left_pct = replan_cycle.find_left_over_segments(state), vehicle.power.battery.remaining_pct or 0.0
    trigger = sorties.BACK_IN_SERVICE.format(vehicle=vehicle.name, left_pct=left_pct)
    state = state.put(vehicle.with_orders(cleared_s=now_s)).with_crew(offers_over=False)
    return (
        state.with_coverage(given_up=frozenset())
        .want_replan(trigger, now_s)
        .with_replanning(
            ordered=state.replanning.ordered or bool(left),  # segments left over alone do not start a re-plan
            considered=state.replanning.considered - {vehicle.name},
        )
    )
