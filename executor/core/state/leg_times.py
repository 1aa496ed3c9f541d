"""When each leg of a mission on board, and each sortie, began and ended, and what the battery gave for it.

A leg ends when the vehicle goes on to the next waypoint, by its own report. As in a plan, the first one begins with the
start of its motors, and the last one ends with their end on the ground. What is not heard, as in a silence, stays
unknown. What was flown undisturbed tells of the vehicle: see `learning`.
"""

from __future__ import annotations

from dataclasses import replace

from executor.core import vehicle_learning
from executor.core.context import Context
from executor.core.state.fleet_state import FleetState
from executor.core.state.vehicle_parts import FlownLeg, FlownSortie, LegBoundary, PowerState
from executor.core.state.vehicle_state import Stage, VehicleState
from executor.core.vehicle_learning import UNKNOWN, LearnedFactors
from missions import Phase
from planner import segment_of

_FLIES_MISSION = frozenset({Stage.STARTING, Stage.FLYING, Stage.PILOT})
REFILLED_PCT = 10.0
"""A pack at rest recovers by less."""


def track_legs(
    before: VehicleState, state: VehicleState, now_s: float, start: LearnedFactors = UNKNOWN
) -> VehicleState:
    """Return a vehicle after something was heard of where it is, with the legs that this begins and ends.

    Args:
        before: The vehicle before it was heard.
        state: The vehicle after it.
        now_s: Now.
        start: What was known of its pace before it flew.
    """
    assignment = state.assignment
    if assignment.board is None or state.stage not in _FLIES_MISSION:
        return state
    if assignment.leg_began is None:
        runs = state.armed or state.sortie.took_off
        first = assignment.waypoint == 0
        began = _build_leg_boundary(state, now_s)
        return replace(state, assignment=replace(assignment, leg_began=began)) if runs and first else state
    if not state.armed and not state.sortie.took_off:  # its motors stopped before it took off: it begins anew
        return replace(state, assignment=replace(assignment, leg_began=None))
    if assignment.waypoint != before.assignment.waypoint:
        return _end_legs(state, before.assignment.waypoint, assignment.waypoint, now_s, start)
    stands = state.telemetry.on_ground and not state.armed
    return end_landing_leg(state, now_s, start) if stands and state.sortie.took_off else state


def end_landing_leg(state: VehicleState, now_s: float, start: LearnedFactors = UNKNOWN) -> VehicleState:
    """Return a vehicle that stands on the ground, with the end of its landing if its mission led there."""
    assignment, leg = state.assignment, state.leg
    if assignment.board is None or assignment.leg_began is None or leg is None or leg.phase is not Phase.LAND:
        return state
    return _end_legs(state, assignment.waypoint, assignment.waypoint + 1, now_s, start)


def _build_leg_boundary(state: VehicleState, now_s: float) -> LegBoundary:
    battery, given_pct = state.power.battery, None
    if battery.estimate is not None and battery.first_pct is not None:
        given_pct = battery.earlier_pct + battery.first_pct - battery.estimate.remaining_pct
    return LegBoundary(now_s, given_pct, battery.modelled_pct)


def _end_legs(state: VehicleState, waypoint: int, goes_to: int, now_s: float, start: LearnedFactors) -> VehicleState:
    """Return a vehicle that was on its way to one waypoint and is on its way to another one now."""
    board, began = state.assignment.board, state.assignment.leg_began
    if board is None:
        return state
    end = _build_leg_boundary(state, now_s)
    flown: list[FlownLeg] = []
    # Of several at once it is known when the first began and the last ended.
    for leg in range(waypoint, min(goes_to, len(board.legs))):
        point = board.path.waypoints[leg]
        segment = None if point.visit is None else segment_of(board.visits[point.visit])
        ended = end if leg == goes_to - 1 else None
        flown.append(FlownLeg(board.revision, leg, point.phase, segment, board.legs[leg], began, ended))
        began = None
    lands = goes_to >= len(board.legs)
    assignment = replace(state.assignment, flown=(*state.assignment.flown, *flown), leg_began=None if lands else end)
    if len(flown) == 1:
        assignment = replace(assignment, learned=_learn_from_leg(state, flown[0], start))
    return replace(state, assignment=assignment)


def _learn_from_leg(state: VehicleState, leg: FlownLeg, start: LearnedFactors) -> LearnedFactors | None:
    """Return what is known of a vehicle after a leg."""
    known, began, ended = state.assignment.learned, leg.began, leg.ended
    if began is None or ended is None or not _is_undisturbed(state, began.at_s):
        return known
    flown_s = ended.at_s - began.at_s
    after = vehicle_learning.learn_from_leg(known or start, leg.phase, flown_s, leg.planned.duration_s)
    if began.given_pct is not None and ended.given_pct is not None:
        given_pct, modelled_pct = ended.given_pct - began.given_pct, ended.modelled_pct - began.modelled_pct
        after = vehicle_learning.learn_from_energy(after, given_pct, modelled_pct, flown_s)
    return after


def _is_undisturbed(state: VehicleState, since_s: float) -> bool:
    """Return whether a vehicle has flown this mission of its own, heard all the time, since then."""
    link, assignment = state.link, state.assignment
    silent = max(link.excused_s, link.regained_s or float("-inf"))
    changed = max(
        state.telemetry.mode_since_s, assignment.carried.ours_s, state.orders.hold_asked_s, state.orders.gave_way_s
    )
    return (
        state.stage in {Stage.STARTING, Stage.FLYING}
        and state.fault is None
        and state.custody.taken is None
        and state.orders.held_s is None
        and not assignment.carried.may_be_foreign()
        and max(silent, changed) <= since_s
    )


def begin_sortie(state: FleetState, vehicle: VehicleState, now_s: float) -> VehicleState:
    """Return a vehicle that is told to start; one that never left its pad since begins the same sortie again."""
    turn, rest = vehicle.turn, vehicle.power.pack.rest
    before = turn.sorties
    if before and before[-1].ended_s is None and not vehicle.sortie.took_off:
        before = before[:-1]
    own = tuple(sorted(segment for segment, name in state.coverage.inspected.items() if name == vehicle.name))
    sortie = FlownSortie(
        len(before) + 1,
        turn.label,
        now_s,
        vehicle.power.battery.remaining_pct,
        None if rest is None else rest.voltage_v,
        own,
    )
    return replace(vehicle, turn=replace(turn, sorties=(*before, sortie)))


def end_sortie(context: Context, vehicle: VehicleState, now_s: float) -> VehicleState:
    """Return a vehicle that has landed; a charge reported before a link gap is not the charge at the landing."""
    turn = vehicle.turn
    if not turn.sorties or turn.sorties[-1].ended_s is not None or not vehicle.sortie.took_off:
        return vehicle
    power, sag = vehicle.power, vehicle.power.pack.sag
    # What its voltage says then is of another pack, in effect.
    refilled = (power.battery.remaining_pct or 0.0) > (power.landed_pct or 0.0) + REFILLED_PCT
    last = replace(
        turn.sorties[-1],
        ended_s=now_s,
        ended_pct=power.landed_pct if is_charge_fresh(context, power, now_s) else None,
        end_v=None if refilled else power.volts.voltage_v if sag is None else sag.recovered_v,
        cells=power.volts.cells if power.volts.voltage_v is not None else None,
    )
    return replace(vehicle, turn=replace(turn, sorties=(*turn.sorties[:-1], last)))


def is_charge_fresh(context: Context, power: PowerState, now_s: float) -> bool:
    """Return whether the percentage was reported within `battery_stale_s`."""
    return now_s - power.battery.reported_s <= context.limits.battery_stale_s
