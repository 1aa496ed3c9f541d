"""Record the flown legs of the mission on board, and predict the time and energy of those ahead.

A leg ends when the vehicle reports the next waypoint. As in a plan, the first one begins with motor start, and the last
one ends with motor stop on the ground. A boundary that was not received stays unknown. Undisturbed legs teach the
vehicle's pace: see `vehicle_learning`. The energy left and the energy needed are the figures behind every battery
decision.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace

from executor.core import vehicle_learning
from executor.core.battery import account
from executor.core.battery.kalman import Projection, project_remaining
from executor.core.context import Context, Scene, VehicleSetup
from executor.core.state import vehicle_parts
from executor.core.state.bases import settle_at_base
from executor.core.state.fleet_state import FleetState
from executor.core.state.vehicle_state import Stage, VehicleState
from executor.core.vehicle_learning import UNKNOWN, LearnedFactors
from missions import LegEstimate, Phase
from planner import CLIMB_SHARE_PER_M_S, segment_of

FAR_FACTOR, PLENTY_PCT = 3.0, 10.0
"""Multiple of the energy home, and battery left after it, beyond which the reserve is safe; consumption is known to a
third or better."""
VERTICAL_LEG_M = 1.0
"""Ground length below which a leg counts as vertical."""


def time_to_reach_s(state: VehicleState, waypoint: int) -> float:
    """Return the time to the end of a waypoint's leg at the vehicle's own pace; 0 if it has passed."""
    pace, ahead = state.assignment.pace, _iterate_legs_ahead(state, waypoint)
    return sum((pace.factor_of(phase) * (share * leg.duration_s) for phase, leg, share in ahead), 0.0)


def energy_to_reach_pct(state: VehicleState, waypoint: int) -> float:
    """Return the energy to the end of a waypoint's leg by the model, in percent of a full battery.

    It includes the vehicle's pace, as a slower vehicle draws power for longer, but not its consumption factor: that is
    learned from power at a velocity, and is applied on top.
    """
    pace, ahead = state.assignment.pace, _iterate_legs_ahead(state, waypoint)
    return sum((pace.factor_of(phase) * (share * leg.energy_pct) for phase, leg, share in ahead), 0.0)


def _iterate_legs_ahead(state: VehicleState, waypoint: int) -> Iterator[tuple[Phase, LegEstimate, float]]:
    """Yield the legs to the end of a waypoint's, each with its phase and its remaining share."""
    board, first, fix = state.assignment.board, state.assignment.waypoint, state.motion.fix
    if board is None or first > waypoint or first >= len(board.legs):
        return
    share = 1.0 if fix is None or first == 0 else remaining_leg_share(board, first, fix)
    for point, leg in zip(board.path.waypoints[first : waypoint + 1], board.legs[first : waypoint + 1], strict=False):
        yield point.phase, leg, share
        share = 1.0


def energy_to_finish_pct(state: VehicleState) -> float:
    """Return the expected energy to finish the mission on board, with the vehicle's learned consumption."""
    if state.assignment.board is None:
        return 0.0
    return energy_to_reach_pct(state, len(state.assignment.board.legs) - 1) * account.consumption_factor(
        state.power.battery
    )


def project_landing(context: Scene, state: VehicleState, setup: VehicleSetup) -> Projection | None:
    """Return the expected charge after the mission on board, or after a return if no mission is known.

    None while the battery has not reported, or the position is unknown.
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
    """Return the probability of landing with less than `floor_pct`; None if unknown."""
    known = state.power.battery
    if known.estimate is not None and state.assignment.board is None and state.motion.fix is not None:
        ahead_pct = FAR_FACTOR * known.estimate.factor * (energy_to_return_pct(context, state, setup) or 0.0)
        if known.estimate.remaining_pct - ahead_pct > floor_pct + PLENTY_PCT:
            return 0.0  # runs on every tick; usually far from the limit
    ahead = project_landing(context, state, setup)
    return None if ahead is None else ahead.chance_below(floor_pct)


def energy_to_return_pct(context: Scene, state: VehicleState, setup: VehicleSetup) -> float | None:
    """Return the modelled energy of an RTL from here; None without a position.

    As the autopilot flies it: climb to the RTL height, fly straight home at RTL speed, descend. A vehicle over its pad
    only descends.
    """
    fix = state.motion.fix
    if fix is None:
        return None
    performance, known = context.model_of(setup)
    pace = known.transit * state.assignment.pace.transit
    pads_m = setup.day_pads_m if setup.rallies else ()
    pad_m = min((setup.pad_m, *pads_m), key=lambda one: math.dist(one, fix.place_m))
    east_m, north_m = pad_m[0] - fix.place_m[0], pad_m[1] - fix.place_m[1]
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


def _pace_uncertainty_pct(state: VehicleState, setup: VehicleSetup, waypoint: int) -> float:
    """Return the uncertainty of the energy to the end of a waypoint's leg, from the uncertainty of its pace.

    One standard deviation; inspections and transits are learned from separate legs, and their errors are independent.
    """
    learned = state.assignment.learned or setup.start
    inspect_pct = transit_pct = 0.0
    for phase, leg, share in _iterate_legs_ahead(state, waypoint):
        if phase is Phase.INSPECT:
            inspect_pct += share * leg.energy_pct
        elif phase in (Phase.TRANSIT, Phase.RETURN):
            transit_pct += share * leg.energy_pct
    return math.hypot(learned.inspect.sd * inspect_pct, learned.transit.sd * transit_pct)


def remaining_leg_share(board: vehicle_parts.OnboardMission, waypoint: int, fix: vehicle_parts.PositionFix) -> float:
    """Return the share of the leg to a waypoint that is ahead of a position on it."""
    end, end_up_m = board.places_m[waypoint], board.path.waypoints[waypoint].alt_rel_m
    begin, begin_up_m = end, 0.0  # the climb from the pad
    if waypoint > 0:
        begin, begin_up_m = board.places_m[waypoint - 1], board.path.waypoints[waypoint - 1].alt_rel_m
    length, left = math.dist(begin, end), math.dist(fix.place_m, end)
    if length < VERTICAL_LEG_M:
        length, left = abs(end_up_m - begin_up_m), abs(end_up_m - fix.alt_rel_m)
    return min(1.0, left / length) if length >= VERTICAL_LEG_M else 1.0


_FLIES_MISSION = frozenset({Stage.STARTING, Stage.FLYING, Stage.PILOT})
REFILLED_PCT = 10.0
"""Largest recovery of a pack at rest."""


def track_legs(
    before: VehicleState, state: VehicleState, now_s: float, start: LearnedFactors = UNKNOWN
) -> VehicleState:
    """Return a vehicle after a message about its progress, with the legs that it begins and ends.

    Args:
        before: The vehicle before the message.
        state: The vehicle after it.
        now_s: Now.
        start: The learned factors before the flight.
    """
    assignment = state.assignment
    if assignment.board is None or state.stage not in _FLIES_MISSION:
        return state
    if assignment.leg_began is None:
        runs = state.armed or state.sortie.took_off
        first = assignment.waypoint == 0
        began = _build_leg_boundary(state, now_s)
        return replace(state, assignment=replace(assignment, leg_began=began)) if runs and first else state
    if not state.armed and not state.sortie.took_off:  # motors stopped before take-off: start over
        return replace(state, assignment=replace(assignment, leg_began=None))
    if assignment.waypoint != before.assignment.waypoint:
        return _end_legs(state, before.assignment.waypoint, assignment.waypoint, now_s, start)
    stands = state.telemetry.on_ground and not state.armed
    return end_landing_leg(state, now_s, start) if stands and state.sortie.took_off else state


def end_landing_leg(state: VehicleState, now_s: float, start: LearnedFactors = UNKNOWN) -> VehicleState:
    """Return a vehicle on the ground, with its landing leg ended if its mission led there."""
    assignment, leg = state.assignment, state.leg
    if assignment.board is None or assignment.leg_began is None or leg is None or leg.phase is not Phase.LAND:
        return state
    return _end_legs(state, assignment.waypoint, assignment.waypoint + 1, now_s, start)


def _build_leg_boundary(state: VehicleState, now_s: float) -> vehicle_parts.LegBoundary:
    battery, given_pct = state.power.battery, None
    if battery.estimate is not None and battery.first_pct is not None:
        given_pct = battery.earlier_pct + battery.first_pct - battery.estimate.remaining_pct
    return vehicle_parts.LegBoundary(now_s, given_pct, battery.modelled_pct)


def _end_legs(state: VehicleState, waypoint: int, goes_to: int, now_s: float, start: LearnedFactors) -> VehicleState:
    """Return a vehicle that has gone on from one waypoint to another, with the legs between them ended."""
    board, began = state.assignment.board, state.assignment.leg_began
    if board is None:
        return state
    end = _build_leg_boundary(state, now_s)
    flown: list[vehicle_parts.FlownLeg] = []
    # Of several at once only the first start and the last end are known.
    for leg in range(waypoint, min(goes_to, len(board.legs))):
        point = board.path.waypoints[leg]
        segment = None if point.visit is None else segment_of(board.visits[point.visit])
        ended = end if leg == goes_to - 1 else None
        flown.append(vehicle_parts.FlownLeg(board.revision, leg, point.phase, segment, board.legs[leg], began, ended))
        began = None
    lands = goes_to >= len(board.legs)
    assignment = replace(state.assignment, flown=(*state.assignment.flown, *flown), leg_began=None if lands else end)
    if len(flown) == 1:
        assignment = replace(assignment, learned=_learn_from_leg(state, flown[0], start))
    return replace(state, assignment=assignment)


def _learn_from_leg(state: VehicleState, leg: vehicle_parts.FlownLeg, start: LearnedFactors) -> LearnedFactors | None:
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
    """Return whether the vehicle has flown this mission undisturbed and with its link up since then."""
    return (
        state.stage in {Stage.STARTING, Stage.FLYING}
        and state.fault is None
        and state.custody.taken is None
        and state.orders.held_s is None
        and not state.assignment.carried.may_be_foreign()
        and find_last_disturbance_s(state) <= since_s
    )


def find_last_disturbance_s(state: VehicleState) -> float:
    """Return when a silence, a new mission, a change of mode, a hold or a slow leg last disturbed its flight."""
    link, orders = state.link, state.orders
    silent = max(link.excused_s, link.regained_s or float("-inf"))
    return max(
        silent, state.telemetry.mode_since_s, state.assignment.carried.ours_s, orders.hold_asked_s, orders.gave_way_s
    )


def begin_sortie(state: FleetState, vehicle: VehicleState, now_s: float) -> VehicleState:
    """Return a vehicle commanded to start; one that has not left its pad since begins the same sortie again."""
    turn, rest = vehicle.turn, vehicle.power.pack.rest
    before = turn.sorties
    if before and before[-1].ended_s is None and not vehicle.sortie.took_off:
        before = before[:-1]
    own = tuple(sorted(segment for segment, name in state.coverage.inspected.items() if name == vehicle.name))
    rest_v = None if rest is None else rest.voltage_v
    sortie = vehicle_parts.FlownSortie(
        len(before) + 1, turn.label, now_s, vehicle.power.battery.remaining_pct, rest_v, own
    )
    sortie = replace(sortie, base=turn.base, lands=turn.lands_at)
    return vehicle.with_turn(sorties=(*before, sortie))


def end_sortie(context: Context, vehicle: VehicleState, now_s: float) -> VehicleState:
    """Return a vehicle that has landed; a charge reported before a link gap is not the charge at landing."""
    turn = vehicle.turn
    if not turn.sorties or turn.sorties[-1].ended_s is not None or not vehicle.sortie.took_off:
        return vehicle
    power, sag = vehicle.power, vehicle.power.pack.sag
    # A refilled battery reports the voltage of what is, in effect, another pack.
    refilled = (power.battery.remaining_pct or 0.0) > (power.landed_pct or 0.0) + REFILLED_PCT
    vehicle = settle_at_base(context, vehicle)
    last = replace(
        turn.sorties[-1],
        lands=vehicle.turn.base,
        ended_s=now_s,
        ended_pct=power.landed_pct if is_charge_fresh(context, power, now_s) else None,
        end_v=None if refilled else power.volts.voltage_v if sag is None else sag.recovered_v,
        cells=power.volts.cells if power.volts.voltage_v is not None else None,
    )
    return vehicle.with_turn(sorties=(*turn.sorties[:-1], last))


def is_charge_fresh(context: Context, power: vehicle_parts.PowerState, now_s: float) -> bool:
    """Return whether the percentage was reported within `battery_stale_s`."""
    return now_s - power.battery.reported_s <= context.limits.battery_stale_s
