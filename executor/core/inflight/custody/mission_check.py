"""A vehicle says that it was given a mission, not from here: what it carries is read before that is believed."""

from __future__ import annotations

from dataclasses import replace

from executor.core.interface.events import Found
from executor.core.lines import custody
from executor.core.state import mission_ownership
from executor.core.state.fleet_state import FleetState, Stepped
from executor.core.state.vehicle_parts import DeclinedMission
from executor.core.state.vehicle_state import Stage, VehicleState, apply_onboard_mission


def is_mission_read_due(vehicle: VehicleState, now_s: float) -> bool:
    """Return whether it is time to look up what a vehicle carries."""
    known, heard = vehicle.assignment, not vehicle.link.stale
    flies = vehicle.stage in {Stage.FLYING, Stage.PILOT} and known.pending is None
    return flies and heard and known.carried.is_reading_due(now_s)


def apply_mission_read(state: FleetState, found: Found, now_s: float) -> Stepped:
    """Believe, or not, that a vehicle was given another station's mission."""
    vehicle = state.vehicles[found.vehicle]
    board, carried, declined = vehicle.assignment.board, vehicle.assignment.carried, vehicle.assignment.declined
    if board is None or carried.told_s is None:
        return state, ()  # it was given one of ours meanwhile
    if found.items is None and now_s - (vehicle.link.heard_s or 0.0) >= mission_ownership.SURE_S:
        # Nothing came of it at all: it is asked again when it is heard.
        return state.put(vehicle.with_assignment(carried=replace(carried, asked_s=None))), ()
    if vehicle.assignment.stubborn and declined is not None:
        return _apply_read_of_declined(state, vehicle, declined, found, now_s)
    known = mission_ownership.apply_mission_readback(carried, found.match_of(board.revision), now_s)
    state = state.put(vehicle.with_assignment(carried=known))
    if known.foreign_s is not None or carried.foreign_s is not None:
        return state, ()
    return state, (custody.MISSION_IS_OURS.say(vehicle=vehicle.name),)


def _apply_read_of_declined(
    state: FleetState, vehicle: VehicleState, declined: DeclinedMission, found: Found, now_s: float
) -> Stepped:
    """Take what a vehicle carries whose last upload came to no known end."""
    board, carried, maybe = vehicle.assignment.board, vehicle.assignment.carried, declined.maybe
    new = None if maybe is None else found.match_of(maybe.revision)
    if maybe is not None and new is not None and new.whole:
        carries = apply_onboard_mission(vehicle, maybe, now_s)
        # It is planned around until it is planned with again: others have its part by now.
        known = replace(carries.assignment, stubborn=True, declined=replace(declined, maybe=None))
        known = replace(known, carried=replace(known.carried, read_s=now_s))
        said = custody.MISSION_ON_BOARD.say(vehicle=vehicle.name, revision=maybe.revision)
        return state.put(replace(carries, assignment=known)), (said,)
    if found.items is None or board is None:
        unread = replace(carried, told_s=None, asked_s=None)
        declined = replace(declined, at_s=now_s, tries=declined.tries + 1)
        return state.put(vehicle.with_assignment(carried=unread, declined=declined)), ()
    looked_up = mission_ownership.apply_mission_readback(carried, found.match_of(board.revision), now_s)
    return state.put(vehicle.with_assignment(carried=looked_up)), ()
