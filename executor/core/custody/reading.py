"""A vehicle says that it was given a mission, not from here: what it carries is read before that is believed."""

from __future__ import annotations

from dataclasses import replace

from executor.core import carried
from executor.core.commands import Command, Level, Say
from executor.core.events import Found
from executor.core.state import FleetState
from executor.core.vehicle import Stage, VehicleState


def wanted(vehicle: VehicleState, now_s: float) -> bool:
    """Return whether it is time to look up what a vehicle carries."""
    flies = (
        vehicle.stage in {Stage.FLYING, Stage.PILOT} and vehicle.assignment.pending is None and not vehicle.link.stale
    )
    return flies and vehicle.assignment.carried.to_be_read(now_s)


def mission_read(state: FleetState, found: Found, now_s: float) -> tuple[FleetState, tuple[Command, ...]]:
    """Believe, or not, that a vehicle was given another station's mission."""
    vehicle = state.vehicles[found.vehicle]
    if vehicle.assignment.board is None or vehicle.assignment.carried.told_s is None:
        return state, ()  # it was given one of ours meanwhile
    if found.items is None and now_s - (vehicle.link.heard_s or 0.0) >= carried.SURE_S:
        # Nothing came of it at all: it is asked again when it is heard.
        return state.put(
            replace(
                vehicle,
                assignment=replace(vehicle.assignment, carried=replace(vehicle.assignment.carried, asked_s=None)),
            )
        ), ()
    was_ours = vehicle.assignment.carried.foreign_s is None
    known = carried.after_reading(vehicle.assignment.carried, found.against(vehicle.assignment.board.revision), now_s)
    state = state.put(replace(vehicle, assignment=replace(vehicle.assignment, carried=known)))
    if known.foreign_s is not None or not was_ours:
        return state, ()
    text = f"{vehicle.name}: reported a new mission; verified by read-back, it is ours"
    return state, (Say(Level.WARNING, text),)
