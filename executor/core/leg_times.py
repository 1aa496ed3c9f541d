"""When each leg of a mission on board began and ended, and what the battery gave for it: held against the plan later.

A leg ends when the vehicle goes on to the next waypoint, by its own word. As in a plan, the first one begins with the
start of its motors, and the last one ends with their end on the ground. What is not heard, as in a silence, stays
unknown; nothing is decided by any of it.
"""

from __future__ import annotations

from dataclasses import replace

from executor.core.parts import FlownLeg, LegBegin
from executor.core.vehicle import Stage, VehicleState
from missions import Phase
from planner import segment_of

_FLIES_MISSION = frozenset({Stage.STARTING, Stage.FLYING, Stage.PILOT})


def followed(before: VehicleState, state: VehicleState, now_s: float) -> VehicleState:
    """Return a vehicle after something was heard of where it is, with the legs that this begins and ends."""
    assignment = state.assignment
    if assignment.board is None or state.stage not in _FLIES_MISSION:
        return state
    if assignment.leg_began is None:
        runs = state.armed or state.sortie.took_off
        first = assignment.waypoint == 0
        began = LegBegin(now_s, given_pct(state))
        return replace(state, assignment=replace(assignment, leg_began=began)) if runs and first else state
    if not state.armed and not state.sortie.took_off:  # its motors stopped before it took off: it begins anew
        return replace(state, assignment=replace(assignment, leg_began=None))
    if assignment.waypoint != before.assignment.waypoint:
        return _passed(state, before.assignment.waypoint, assignment.waypoint, now_s)
    stands = state.telemetry.on_ground and not state.armed
    return landed(state, now_s) if stands and state.sortie.took_off else state


def landed(state: VehicleState, now_s: float) -> VehicleState:
    """Return a vehicle that stands on the ground, with the end of its landing if its mission led there."""
    assignment, leg = state.assignment, state.leg
    if assignment.board is None or assignment.leg_began is None or leg is None or leg.phase is not Phase.LAND:
        return state
    return _passed(state, assignment.waypoint, assignment.waypoint + 1, now_s)


def given_pct(state: VehicleState) -> float | None:
    """Return what its battery has given since its first report, in percent; None if there was none."""
    battery = state.power.battery
    if battery.estimate is None or battery.first_pct is None:
        return None
    return battery.earlier_pct + battery.first_pct - battery.estimate.remaining_pct


def _passed(state: VehicleState, waypoint: int, goes_to: int, now_s: float) -> VehicleState:
    """Return a vehicle that was on its way to one waypoint and is on its way to another one now."""
    board, began = state.assignment.board, state.assignment.leg_began
    if board is None:
        return state
    end = LegBegin(now_s, given_pct(state))
    flown = []
    # Of several at once it is known when the first began and the last ended.
    for leg in range(waypoint, min(goes_to, len(board.legs))):
        point = board.path.waypoints[leg]
        segment = None if point.visit is None else segment_of(board.visits[point.visit])
        ended = end if leg == goes_to - 1 else None
        flown.append(FlownLeg(board.revision, leg, point.phase, segment, board.legs[leg], began, ended))
        began = None
    lands = goes_to >= len(board.legs)
    assignment = replace(state.assignment, flown=(*state.assignment.flown, *flown), leg_began=None if lands else end)
    return replace(state, assignment=assignment)
