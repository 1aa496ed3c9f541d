"""What is left to spend and what is left to do: the figures behind every battery decision."""

from __future__ import annotations

import math

from executor.core import battery
from executor.core.context import Context
from executor.core.vehicle import VehicleState


def time_to_reach_s(state: VehicleState, waypoint: int) -> float:
    """Return how long the vehicle needs until the end of a waypoint's leg, by the path on board; 0 if it has passed."""
    if state.board is None or waypoint < state.waypoint:
        return 0.0
    legs = state.board.legs
    rest = _share_of_leg_left(state) * legs[state.waypoint].duration_s
    return rest + sum(leg.duration_s for leg in legs[state.waypoint + 1 : waypoint + 1])


def modelled_to_reach_pct(state: VehicleState, waypoint: int) -> float:
    """Return the energy of the same way by the model, in percent of a full battery."""
    if state.board is None or waypoint < state.waypoint:
        return 0.0
    legs = state.board.legs
    rest = _share_of_leg_left(state) * legs[state.waypoint].energy_pct
    return rest + sum(leg.energy_pct for leg in legs[state.waypoint + 1 : waypoint + 1])


def to_finish_pct(state: VehicleState) -> float:
    """Return what finishing the mission on board should cost, with what was learned of the vehicle's consumption."""
    if state.board is None:
        return 0.0
    return modelled_to_reach_pct(state, len(state.board.legs) - 1) * battery.factor(state.battery)


def at_landing_pct(state: VehicleState) -> float | None:
    """Return what should be left after the mission on board; None while the battery has not reported."""
    if state.battery.remaining_pct is None:
        return None
    return state.battery.remaining_pct - to_finish_pct(state)


def consumption(context: Context, state: VehicleState) -> float:
    """Return what the vehicle uses relative to the planning model, with the overhead of real flight."""
    return battery.factor(state.battery) * context.overhead


def _share_of_leg_left(state: VehicleState) -> float:
    board = state.board
    if board is None or state.fix is None or state.waypoint == 0:
        return 1.0
    begin, end = board.places_m[state.waypoint - 1], board.places_m[state.waypoint]
    length = math.dist(begin, end)
    if length < 1.0:
        return 1.0
    return min(1.0, math.dist(state.fix.place_m, end) / length)
