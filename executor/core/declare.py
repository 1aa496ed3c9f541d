"""A vehicle leaves the plan: the judgement that it will not finish its route, and what follows from it."""

from __future__ import annotations

from dataclasses import replace

from executor.core import replanning
from executor.core.commands import CancelSolve, Command, Level, Say, SendHome
from executor.core.context import Context
from executor.core.modes import is_home_mode, is_mission_mode
from executor.core.state import FleetState
from executor.core.vehicle import Fault, FaultKind, Stage, VehicleState, moved_to

Stepped = tuple[FleetState, tuple[Command, ...]]


def comes_home(context: Context, vehicle: VehicleState) -> bool:
    """Return whether it says that it flies home, or lands, by itself."""
    dialect = context.vehicles[vehicle.name].dialect
    return vehicle.heartbeat is not None and is_home_mode(dialect, vehicle.heartbeat.custom_mode)


def on_mission(context: Context, vehicle: VehicleState) -> bool:
    """Return whether it says that it is in mission mode."""
    dialect = context.vehicles[vehicle.name].dialect
    return vehicle.heartbeat is not None and is_mission_mode(dialect, vehicle.heartbeat.custom_mode)


def declare(
    context: Context, state: FleetState, vehicle: VehicleState, kind: FaultKind, why: str, now_s: float
) -> Stepped:
    """Declare a fault: the vehicle is brought home where it can be, and the others are given its work."""
    fault = Fault(kind, why, now_s)
    down = vehicle.armed_once and not vehicle.armed
    commands: list[Command] = []
    if kind is FaultKind.LINK:
        stage, then = Stage.LOST, "its segments are given to the others"
    elif down or (vehicle.stage is Stage.STARTING and not vehicle.armed):
        stage, then = Stage.LANDED, "its segments are given to the others"
    elif comes_home(context, vehicle):
        # Its own failsafe knows better: a landing on the last of a battery must not become a flight home.
        stage, then = Stage.RETURNING, "it is left to that, its segments are given to the others"
    else:
        stage, then = Stage.RETURNING, "it is told to return, its segments are given to the others"
        commands.append(SendHome(vehicle.name))
    state = state.put(replace(left_plan(vehicle, stage, now_s), fault=fault))
    trigger = f"{vehicle.name}: {kind.value}, {why}"
    state, more = withdrawn(state, vehicle.name, trigger, now_s)
    return state, (Say(Level.FAULT, f"{trigger}; {then}"), *more, *commands)


def left_plan(vehicle: VehicleState, stage: Stage, now_s: float) -> VehicleState:
    """Return a vehicle that does not fly its mission any more."""
    return replace(moved_to(vehicle, stage), ordered_mode_s=now_s, run=None, pending=None, held_s=None)


def withdrawn(state: FleetState, name: str, trigger: str, now_s: float) -> Stepped:
    """Plan around a vehicle at once: a re-plan that is being solved counted on it, one that is put on board goes on."""
    state = replace(state, urgent=True, trigger=trigger, trigger_s=now_s)
    plan = state.replan
    if plan is not None and plan.solve_s is None:
        return replace(state, replan=None), (CancelSolve(plan.solve.revision),)
    if plan is not None and name in plan.pending:
        state = replace(state, replan=replace(plan, pending=plan.pending - {name}))
        return replanning.ended_if_done(state, now_s)
    return state, ()
