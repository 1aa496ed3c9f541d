"""What is left to spend and what is left to do: the figures behind every battery decision."""

from __future__ import annotations

import math
from collections.abc import Iterator

from executor.core.battery import account
from executor.core.battery.kalman import Projection, project_remaining
from executor.core.context import Scene, VehicleSetup
from executor.core.state.vehicle_parts import OnboardMission, PositionFix
from executor.core.state.vehicle_state import Stage, VehicleState
from missions import LegEstimate, Phase
from planner import CLIMB_SHARE_PER_M_S

FAR, PLENTY_PCT = 3.0, 10.0
"""With three times the way home and this much left there is no doubt: a factor is known to a third or better."""
UPRIGHT_M = 1.0
"""A leg that is shorter over the ground leads up or down."""


def time_to_reach_s(state: VehicleState, waypoint: int) -> float:
    """Return how long the vehicle needs until the end of a waypoint's leg at its own pace; 0 if it has passed."""
    return _sum_at_own_pace(state, [leg.duration_s for leg in _select_legs_until(state, waypoint)])


def energy_to_reach_pct(state: VehicleState, waypoint: int) -> float:
    """Return the energy of the same way by the model, in percent of a full battery.

    With its pace, as who takes longer draws its power for longer, but without its consumption: that is a factor of
    power, learned by velocities, and comes on top.
    """
    return _sum_at_own_pace(state, [leg.energy_pct for leg in _select_legs_until(state, waypoint)])


def _select_legs_until(state: VehicleState, waypoint: int) -> tuple[LegEstimate, ...]:
    board = state.assignment.board
    return () if board is None else board.legs[state.assignment.waypoint : waypoint + 1]


def energy_to_finish_pct(state: VehicleState) -> float:
    """Return what finishing the mission on board should cost, with what was learned of the vehicle's consumption."""
    if state.assignment.board is None:
        return 0.0
    return energy_to_reach_pct(state, len(state.assignment.board.legs) - 1) * account.consumption_factor(
        state.power.battery
    )


def project_landing(context: Scene, state: VehicleState, setup: VehicleSetup) -> Projection | None:
    """Return what should be left after the mission on board, or after the way home where no mission is known.

    None while the battery has not reported, or nobody knows where it is.
    """
    if state.power.battery.estimate is None:
        return None
    if state.assignment.board is not None and state.stage in {Stage.STARTING, Stage.FLYING}:
        last = len(state.assignment.board.legs) - 1
        modelled_pct: float | None = energy_to_reach_pct(state, last)
        unsure_pct = _pace_uncertainty_pct(state, setup, last)
    else:
        modelled_pct = energy_to_return_pct(context, state, setup)
        unsure_pct = (state.assignment.learned or setup.start).transit.sd * (modelled_pct or 0.0)
    if modelled_pct is None:
        return None
    ahead = project_remaining(state.power.battery.estimate, modelled_pct)
    unsure_pct *= state.power.battery.estimate.factor
    return Projection(ahead.mean_pct, math.hypot(ahead.sd_pct, unsure_pct, account.blindness_pct(state.power.battery)))


def landing_chance_below(context: Scene, state: VehicleState, setup: VehicleSetup, floor_pct: float) -> float | None:
    """Return the probability that less than `floor_pct` is left at the landing; None where nobody knows."""
    known = state.power.battery
    if known.estimate is not None and state.assignment.board is None and state.motion.fix is not None:
        ahead_pct = FAR * known.estimate.factor * (energy_to_return_pct(context, state, setup) or 0.0)
        if known.estimate.remaining_pct - ahead_pct > floor_pct + PLENTY_PCT:
            return 0.0  # most of the time there is no question, and it is asked on every tick
    ahead = project_landing(context, state, setup)
    return None if ahead is None else ahead.chance_below(floor_pct)


def energy_to_return_pct(context: Scene, state: VehicleState, setup: VehicleSetup) -> float | None:
    """Return the energy of a return of its own from here, by the model; None without a place.

    As its autopilot flies it: up to the height of its return, straight home at that speed, and down. Who is over its
    pad only has to come down.
    """
    fix = state.motion.fix
    if fix is None:
        return None
    performance, known = context.model_of(setup)
    learned = state.assignment.learned
    pace = known.transit * (1.0 if learned is None else learned.pace.transit)
    east_m, north_m = setup.pad_m[0] - fix.place_m[0], setup.pad_m[1] - fix.place_m[1]
    away_m, up_m = math.hypot(east_m, north_m), max(0.0, fix.alt_rel_m)
    if away_m <= context.limits.pad_m:
        away_m = 0.0
    else:
        up_m = max(up_m, context.return_height_m(setup.name))
    rise_m = up_m - max(0.0, fix.alt_rel_m)
    climb_s, level_s, land_s = performance.return_s(away_m, rise_m, up_m)
    hover_pct_s = context.draw_pct_per_s(0.0, 0.0)
    climb_pct = (climb_s + CLIMB_SHARE_PER_M_S * rise_m) * hover_pct_s
    if level_s == 0.0:
        return climb_pct + land_s * hover_pct_s
    toward = performance.home_m_s / away_m
    level_pct = pace * level_s * context.draw_pct_per_s(toward * east_m, toward * north_m)
    return climb_pct + level_pct + land_s * hover_pct_s


def _sum_at_own_pace(state: VehicleState, legs: list[float]) -> float:
    """Return the sum of figures of the leg under way, as far as it is left, and of those after it, at its own pace."""
    board, learned = state.assignment.board, state.assignment.learned
    if board is None or not legs:
        return 0.0
    legs[0] *= _remaining_leg_share(state)
    if learned is None:
        return sum(legs)
    pace = learned.pace
    return sum(
        pace.factor_of(phase) * leg
        for phase, leg in zip(_iterate_phases(board, state.assignment.waypoint), legs, strict=False)
    )


def _pace_uncertainty_pct(state: VehicleState, setup: VehicleSetup, waypoint: int) -> float:
    """Return how far off the energy until the end of a waypoint's leg may be, as it is not known how long legs take.

    One standard deviation; what is not known of inspections and of transits is learned from legs of their own.
    """
    board, first = state.assignment.board, state.assignment.waypoint
    if board is None or waypoint < first:
        return 0.0
    learned = state.assignment.learned or setup.start
    inspect_pct = transit_pct = 0.0
    share = _remaining_leg_share(state)
    for phase, leg in zip(_iterate_phases(board, first), board.legs[first : waypoint + 1], strict=False):
        if phase is Phase.INSPECT:
            inspect_pct += share * leg.energy_pct
        elif phase in (Phase.TRANSIT, Phase.RETURN):
            transit_pct += share * leg.energy_pct
        share = 1.0
    return math.hypot(learned.inspect.sd * inspect_pct, learned.transit.sd * transit_pct)


def _iterate_phases(board: OnboardMission, first: int) -> Iterator[Phase]:
    return (point.phase for point in board.path.waypoints[first:])


def _remaining_leg_share(state: VehicleState) -> float:
    board, waypoint, fix = state.assignment.board, state.assignment.waypoint, state.motion.fix
    return 1.0 if board is None or fix is None or waypoint == 0 else remaining_leg_share(board, waypoint, fix)


def remaining_leg_share(board: OnboardMission, waypoint: int, fix: PositionFix) -> float:
    """Return how much of the leg to a waypoint lies before a vehicle at a place on it."""
    end, end_up_m = board.places_m[waypoint], board.path.waypoints[waypoint].alt_rel_m
    begin, begin_up_m = end, 0.0  # the climb from the pad
    if waypoint > 0:
        begin, begin_up_m = board.places_m[waypoint - 1], board.path.waypoints[waypoint - 1].alt_rel_m
    length, left = math.dist(begin, end), math.dist(fix.place_m, end)
    if length < UPRIGHT_M:
        length, left = abs(end_up_m - begin_up_m), abs(end_up_m - fix.alt_rel_m)
    return min(1.0, left / length) if length >= UPRIGHT_M else 1.0
