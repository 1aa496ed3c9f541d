"""A time in which a vehicle, or nobody, was heard, or nobody listened: what was done meanwhile, and how long one can.

The ground's own radio ends no flight. While nobody at all is heard nothing is held against anybody, until the battery
of each would be empty; a vehicle whose link is regained is taken up where it is, with what it flew.
"""

from __future__ import annotations

import math
from collections.abc import Collection
from dataclasses import replace

from executor.core.context import Context, Scene
from executor.core.imaging import picture_proof
from executor.core.inflight.homing import is_on_mission
from executor.core.interface.commands import Level, Say
from executor.core.replanning.replan_messages import format_segments
from executor.core.resume.inferred_coverage import infer_coverage
from executor.core.state.fleet_state import FleetState, Stepped
from executor.core.state.inspection_run import GAP_S
from executor.core.state.vehicle_parts import OnboardMission
from executor.core.state.vehicle_state import VehicleState, last_known_of

CATCH_UP_S = 5.0
"""So long a vehicle whose link is regained has to say where it is, in which mode, on which item."""
ENDURES = 1.5
"""Nobody flies longer than this many times what the energy model makes of its battery."""


def record_blackout(context: Scene, state: FleetState, now_s: float) -> Stepped:  # noqa: ARG001
    """Keep where all vehicles were when all links were lost: a run with such a gap proves nothing."""
    since_s = state.listening.silent_since_s
    if since_s is None or now_s - since_s < GAP_S:
        return state, ()
    for vehicle in state.vehicles.values():
        before = vehicle.assignment.before or last_known_of(vehicle, since_s)
        if before is not vehicle.assignment.before:
            state = state.put(vehicle.with_assignment(before=before, run=None))
    return state, ()


def max_remaining_flight_s(context: Scene, vehicle: VehicleState) -> float:
    """Return how long a vehicle can fly at most from when it was heard last."""
    percent = vehicle.power.battery.remaining_pct
    return ENDURES * (100.0 if percent is None else percent) / min(context.draws_pct_s)


def may_be_airborne(context: Scene, vehicle: VehicleState, now_s: float) -> bool:
    """Return whether a vehicle that is not heard may still be in the air."""
    return vehicle.link.spoke_s is not None and now_s - vehicle.link.spoke_s < max_remaining_flight_s(context, vehicle)


def recover_after_silence(context: Context, state: FleetState, vehicle: VehicleState, now_s: float) -> Stepped | None:
    """Take up a vehicle whose link, or position, is regained; None as long as it has not said enough."""
    before, board, fix = vehicle.assignment.before, vehicle.assignment.board, vehicle.motion.fix
    if before is None:
        return state, ()
    since_s = before.until_s
    asked = math.isinf(since_s)  # after a restart it was asked already
    if asked or fix is None or vehicle.link.heartbeat_s is None or board is None:
        return state.put(vehicle.with_assignment(before=None)), ()
    again_s = since_s if vehicle.link.regained_s is None else max(since_s, vehicle.link.regained_s)
    if vehicle.link.stale or (again_s <= since_s and fix.at_s <= since_s):
        return None
    said = fix.at_s > since_s and vehicle.link.heartbeat_s > since_s
    item = vehicle.telemetry.item_s is not None and vehicle.telemetry.item_s > since_s
    given = vehicle.assignment.pending is not None or vehicle.assignment.stubborn
    if given:  # what it carries now is known when that is over
        return state.put(_close_gap(vehicle, board)), ()
    if said and (item or not vehicle.armed or not is_on_mission(context, vehicle)):
        return catch_up_mission(context, state, vehicle, board, None)
    if now_s - again_s < CATCH_UP_S:
        return None
    return state.put(_close_gap(vehicle, board)), ()


def catch_up_mission(
    context: Context, state: FleetState, vehicle: VehicleState, board: OnboardMission, seq: int | None
) -> Stepped:
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
    found = infer_coverage(context, vehicle, board, waypoint)
    # What it began meanwhile at the first pylon, and was seen to begin, needs no evidence.
    joins = None if vehicle.assignment.run is not None else found.joins
    proven = {board.tracks[joins].segment} if joins is not None else set()
    vehicle = _close_gap(vehicle, board, {*found.segments, *proven}, told=bool(found.why_not))
    known = replace(vehicle.assignment, waypoint=waypoint)
    vehicle = replace(
        vehicle, assignment=known if joins is None else replace(known, run=found.run, run_visit=joins)
    ).with_sortie(took_off=vehicle.sortie.took_off or not vehicle.armed)
    state = state.put(vehicle)
    new = [segment for segment in found.segments if segment not in state.coverage.inspected]
    heard_s = vehicle.link.heard_s or 0.0
    state = picture_proof.record_flown_segments(
        context, state, vehicle.name, [(segment, None) for segment in new], heard_s
    )
    inferred = state.coverage.inferred | {*new, *proven}
    state = state.with_coverage(inferred=inferred)
    if found.why_not:
        text = f"{vehicle.name}: flight during the outage is not counted: {found.why_not}"
        return state, (Say(Level.WARNING, text),)
    if not new:
        return state, ()
    names = format_segments(context, tuple(new))
    return state, (
        Say(Level.INFO, f"{vehicle.name}: flew {names} during the outage, inferred from its clock and position"),
    )


def _close_gap(
    vehicle: VehicleState, board: OnboardMission, counted: Collection[int] = (), *, told: bool = False
) -> VehicleState:
    """Return a vehicle whose gap is judged: the inspection that it broke is over, unless it counts all the same.

    Args:
        vehicle: Heard again.
        board: What it carries.
        counted: Segments that count.
        told: Whether it is said already why the others do not.
    """
    known, before, fix = vehicle.assignment, vehicle.assignment.before, vehicle.motion.fix
    judged = replace(known, before=None)
    if before is None or before.run is None or before.run_visit is None or fix is None:
        return replace(vehicle, assignment=judged)
    segment = board.tracks[before.run_visit].segment
    if segment in counted:
        return replace(vehicle, assignment=judged)
    why = f"no position for {fix.boot_s - before.fix.boot_s:.1f} s"
    owed = known.owed if told else (before.run_visit, why)
    return replace(vehicle, assignment=replace(judged, runs_broken=(*known.runs_broken, (segment, why)), owed=owed))
