"""A time in which nobody was heard, or nobody listened: what the vehicles did meanwhile, and how long they can.

The ground's own radio ends no flight. While nobody at all is heard nothing is held against anybody, until the battery
of each would be empty; a vehicle whose link is regained is taken up where it is, with what it flew.
"""

from __future__ import annotations

import math
from dataclasses import replace
from types import MappingProxyType

from executor.core.commands import Command, Level, Say
from executor.core.context import Context, Scene
from executor.core.parts import Before, OnBoard
from executor.core.replan.wording import listed
from executor.core.resume.inference import NOTHING, flown_meanwhile
from executor.core.state import FleetState
from executor.core.vehicle import Stage, VehicleState

Stepped = tuple[FleetState, tuple[Command, ...]]

CATCH_UP_S = 5.0
"""So long a vehicle whose link is regained has to say where it is, in which mode, on which item."""
ENDURES = 1.5
"""Nobody flies longer than this many times what the energy model makes of its battery."""


def before_of(vehicle: VehicleState, until_s: float = float("-inf")) -> Before | None:
    """Return where a vehicle on its mission is now, before all links are lost; None for one that is not on it."""
    if (
        vehicle.stage not in {Stage.STARTING, Stage.FLYING}
        or vehicle.motion.fix is None
        or vehicle.assignment.board is None
    ):
        return None
    percent = vehicle.power.battery.remaining_pct
    return Before(
        vehicle.motion.fix,
        vehicle.assignment.waypoint,
        vehicle.assignment.run,
        vehicle.assignment.run_visit,
        percent,
        until_s,
    )


def began(state: FleetState, since_s: float) -> FleetState:
    """Keep where all vehicles were when all links were lost: a run with such a gap proves nothing."""
    for vehicle in state.vehicles.values():
        before = vehicle.assignment.before or before_of(vehicle, since_s)
        if before is not vehicle.assignment.before:
            state = state.put(replace(vehicle, assignment=replace(vehicle.assignment, before=before, run=None)))
    return state


def endures_s(context: Scene, vehicle: VehicleState) -> float:
    """Return how long a vehicle can fly at most from when it was heard last."""
    percent = vehicle.power.battery.remaining_pct
    return ENDURES * (100.0 if percent is None else percent) / min(context.draws_pct_s)


def may_fly(context: Scene, vehicle: VehicleState, now_s: float) -> bool:
    """Return whether a vehicle that is not heard may still be in the air."""
    return vehicle.link.spoke_s is not None and now_s - vehicle.link.spoke_s < endures_s(context, vehicle)


def taken_up(context: Context, state: FleetState, vehicle: VehicleState, now_s: float) -> Stepped | None:
    """Take up a vehicle whose link is regained after all were lost; None as long as it has not said enough."""
    before = vehicle.assignment.before
    if before is None:
        return state, ()
    since_s = before.until_s
    asked = math.isinf(since_s)  # after a restart it was asked already
    if asked or vehicle.motion.fix is None or vehicle.link.heartbeat_s is None or vehicle.assignment.board is None:
        return state.put(replace(vehicle, assignment=replace(vehicle.assignment, before=None))), ()
    if vehicle.link.stale or vehicle.link.regained_s is None or vehicle.link.regained_s <= since_s:
        return None
    said = vehicle.motion.fix.at_s > since_s and vehicle.link.heartbeat_s > since_s
    item = vehicle.telemetry.item_s is not None and vehicle.telemetry.item_s > since_s
    if said and (item or not vehicle.armed):
        return caught_up(context, state, vehicle, vehicle.assignment.board, None)
    if now_s - vehicle.link.regained_s < CATCH_UP_S:
        return None
    return state.put(replace(vehicle, assignment=replace(vehicle.assignment, before=None))), ()


def caught_up(context: Context, state: FleetState, vehicle: VehicleState, board: OnBoard, seq: int | None) -> Stepped:
    """Take a vehicle on its mission for where it is now, with what it flew on its way there.

    Args:
        context: Of the flight.
        state: Of it.
        vehicle: Heard again; `before` says where it was.
        board: What it carries.
        seq: The item that it flies to; None where its state has that.
    """
    waypoint = vehicle.assignment.waypoint
    if seq is not None and 0 <= seq < len(board.waypoint_of):
        waypoint = board.waypoint_of[seq] or waypoint
    found = NOTHING if vehicle.assignment.before is None else flown_meanwhile(context, vehicle, board, waypoint)
    took_off = vehicle.sortie.took_off or not vehicle.armed
    run, visit = (
        (vehicle.assignment.run, vehicle.assignment.run_visit) if found.joins is None else (found.run, found.joins)
    )
    vehicle = replace(
        vehicle,
        assignment=replace(vehicle.assignment, before=None, waypoint=waypoint, run=run, run_visit=visit),
        sortie=replace(vehicle.sortie, took_off=took_off),
    )
    state = state.put(vehicle)
    new = [segment for segment in found.segments if segment not in state.coverage.inspected]
    inspected = {**state.coverage.inspected, **dict.fromkeys(new, vehicle.name)}
    marked = set(new) if found.joins is None else {*new, board.tracks[found.joins].segment}
    state = replace(
        state,
        coverage=replace(
            state.coverage, inspected=MappingProxyType(inspected), inferred=state.coverage.inferred | marked
        ),
    )
    if found.why_not:
        text = f"{vehicle.name}: what it flew meanwhile does not count: {found.why_not}"
        return state, (Say(Level.WARNING, text),)
    if not new:
        return state, ()
    names = listed(context, tuple(new))
    return state, (Say(Level.INFO, f"{vehicle.name}: flew {names} meanwhile, by its clock and where it is now"),)
