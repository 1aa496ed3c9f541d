"""A new mission that a vehicle was not given is offered to it again when it answers.

One that was busy, or did not answer, may take a mission later. Until then its part is planned for other vehicles. What
it carries is read first: that shows that it answers, and an upload whose end nobody heard may be on board after all.
"""

from __future__ import annotations

from dataclasses import replace

from executor.core.context import Context
from executor.core.inflight.custody.mode_causes import is_under_foreign_control
from executor.core.interface.codes import Ending
from executor.core.interface.commands import Level, Say
from executor.core.interface.events import UploadEnded
from executor.core.replanning import survivors
from executor.core.state.fleet_state import FleetState, NewMission, Stepped
from executor.core.state.vehicle_parts import DeclinedMission
from executor.core.state.vehicle_state import Stage, VehicleState, build_onboard_mission

OFFERS = 3
"""How often in a row a new mission is offered: who takes none of them is planned around for the rest of the flight."""
AGAIN_S = 10.0
"""Before it is offered the next one: an upload has its own patience, and its part is being planned for others."""
LATER = frozenset({
    Ending.NO_ANSWER, Ending.ERROR, Ending.OTHER_STATION, Ending.CANCELLED, Ending.BROKEN_OFF, Ending.LEFT_MISSION,
})  # fmt: skip
"""Ends of an upload after which the next may end well; a plain refusal does not become another answer by waiting."""


def record_declined_mission(
    context: Context, vehicle: VehicleState, mission: NewMission, event: UploadEnded, now_s: float
) -> tuple[VehicleState, str]:
    """Return a vehicle that could not be given its new mission, and for how long it is planned around, in words."""
    known = replace(vehicle.assignment, stubborn=True, declined=None)
    if event.code not in LATER or (event.mixed and not mission.fresh):
        return replace(vehicle, assignment=known), ""
    tries = 1 + (0 if vehicle.assignment.declined is None else vehicle.assignment.declined.tries)
    maybe = None
    if context.vehicles[vehicle.name].dialect.upload_is_atomic and not mission.fresh:
        maybe = build_onboard_mission(context, vehicle.name, event.revision, mission.path, mission.visits)
    known = replace(known, declined=DeclinedMission(now_s, tries, maybe))
    how_long = " until it answers again" if tries < OFFERS else " for the rest of the flight"
    return replace(vehicle, assignment=known), how_long


def retry_declined_missions(context: Context, state: FleetState, now_s: float) -> Stepped:
    """Look who answers again that could not be given a new mission, and plan with it."""
    if state.replanning.replan is not None or state.progress.recalled or state.listening.silent_since_s is not None:
        return state, ()
    for vehicle in state.vehicles.values():
        refused = vehicle.assignment.declined
        if refused is None or refused.tries >= OFFERS or not _is_answering_again(vehicle, refused, now_s):
            continue
        ready = vehicle.with_assignment(stubborn=False)
        if survivors.build_survivor(context, ready, now_s) is None:
            if vehicle.stage is not Stage.FLYING:
                state = state.put(ready)  # it waits for the crew's word, as others do
            continue
        if vehicle.stage is Stage.FLYING and vehicle.assignment.carried.read_s <= refused.at_s:
            # As if it had said that it was given one: that is read, and nothing is put on board before.
            carried = replace(vehicle.assignment.carried, told_s=now_s)
            state = state.put(vehicle.with_assignment(carried=carried))
            continue
        return _replan_with(state, ready, now_s)
    return state, ()


def _is_answering_again(vehicle: VehicleState, refused: DeclinedMission, now_s: float) -> bool:
    """Return whether it was heard since, and is not in other hands."""
    known, beat_s = vehicle.assignment, vehicle.link.heartbeat_s
    if not known.stubborn or known.pending is not None or known.before is not None or is_under_foreign_control(vehicle):
        return False
    if vehicle.stage not in {Stage.GROUND, Stage.LANDED, Stage.FLYING}:
        return False
    return beat_s is not None and beat_s > refused.at_s and now_s - refused.at_s >= AGAIN_S


def _replan_with(state: FleetState, vehicle: VehicleState, now_s: float) -> Stepped:
    left = frozenset(state.replanning.records[-1].uncovered) if state.replanning.records else frozenset()
    trigger = f"{vehicle.name}: answers again"
    known = replace(state.replanning, ordered=True)
    if not known.urgent:
        known = replace(known, trigger=trigger, trigger_s=now_s)
    state = replace(state.put(vehicle), replanning=known).with_coverage(given_up=state.coverage.given_up - left)
    return state, (Say(Level.INFO, f"{trigger}; re-planning with it"),)
