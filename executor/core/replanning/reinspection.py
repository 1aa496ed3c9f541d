"""Once more at the asked distance: who has done its own part inspects again what counts from a layer, if it can.

Where others' ways were in the way, a segment was inspected from its vehicle's layer. It counts; but when they have
left, who is about to fly home with enough in its battery comes by again, lower. That is no re-plan: nothing is open,
what counts goes on counting, and whatever does become open comes before it. When everybody is down, who has enough left
may take off for it, as for anything else: by the crew's word, or where the site says that nobody is asked.
"""

from __future__ import annotations

import math
from collections.abc import Iterable

from executor.core.context import Context
from executor.core.interface.commands import Survivor
from executor.core.replanning import survivors
from executor.core.state import legs
from executor.core.state.fleet_state import FleetState
from executor.core.state.vehicle_state import Stage, VehicleState
from missions.inspection_height import visit_distances_m
from planner import segment_of, visit_of

_DOWN = frozenset({Stage.GROUND, Stage.LANDED, Stage.DOWN, Stage.LOST})
AT_ONCE = 5
"""Segments that it goes to again; more of them afterwards."""
SPARE_PCT = 5.0
"""Of its battery, which it keeps besides its reserve: nobody needs it to go there."""


def has_done_its_part(state: FleetState, vehicle: VehicleState, offer: Survivor) -> bool:
    """Return whether all that a vehicle would be given anew counts already, and it has no sortie ahead."""
    return not vehicle.turn.ahead and all(segment_of(visit) in state.coverage.inspected for visit in offer.tail)


def is_fleet_down(state: FleetState) -> bool:
    """Return whether nobody is in the air, or about to be, but for who is lost."""
    return all(vehicle.stage in _DOWN for vehicle in state.vehicles.values())


def find_distant_segments(context: Context, state: FleetState, vehicle: VehicleState) -> frozenset[int]:
    """Return the segments that count from farther away than asked, and that a vehicle may be sent to once more.

    Not what somebody has before it, and not what it was sent to already: that was not proven, and may not be again.
    """
    coverage, asked_m = state.coverage, context.setup.inspection.height_m
    found = {segment for segment in coverage.inspected if coverage.is_nearer_than_counted(segment, asked_m)}
    if not found:
        return frozenset()
    for other in state.mission_vehicles():
        found -= {segment_of(visit) for visit in other.remaining_visits()}
    return frozenset(
        found - _find_tried_segments(context, state, vehicle) - survivors.find_barred_segments(context, vehicle)
    )


def _find_tried_segments(context: Context, state: FleetState, vehicle: VehicleState) -> set[int]:
    """Return what a vehicle was sent to for a nearer look by the mission on board."""
    board = vehicle.assignment.board
    if board is None:
        return set()
    at_m = visit_distances_m(context.setup, board.path, board.visits)
    segments = map(segment_of, board.visits)
    return {
        segment
        for segment, here_m in zip(segments, at_m, strict=True)
        if state.coverage.is_nearer_than_counted(segment, here_m)
    }


def build_nearest_visits(context: Context, begin_m: tuple[float, float], segments: Iterable[int]) -> tuple[int, ...]:
    """Return visits of the nearest segments: each time the one, and the end of it, to which it is nearest."""
    left, here_m = set(segments), begin_m
    visits: list[int] = []
    while left and len(visits) < AT_ONCE:
        _, segment, backwards = min(
            (math.dist(here_m, end), segment, backwards)
            for segment in left
            for backwards, end in enumerate(context.setup.tracks_m[segment].tolist())
        )
        visits.append(visit_of(segment, bool(backwards)))
        here_m = tuple(context.setup.tracks_m[segment][1 - backwards].tolist())
        left.remove(segment)
    return tuple(visits)


def turn_back_energy_pct(vehicle: VehicleState, offer: Survivor) -> float:
    """Return what turning back costs a vehicle on its way home: as much as it has flown of that leg."""
    board = vehicle.assignment.board
    if board is None or not offer.airborne or offer.kept > vehicle.assignment.waypoint:
        return 0.0
    whole_pct = offer.pace.factor_of(board.path.waypoints[offer.kept].phase) * board.legs[offer.kept].energy_pct
    return offer.consumption * max(0.0, whole_pct - legs.energy_to_reach_pct(vehicle, offer.kept))
