"""The legs of a mission on board: when each began and ended, what it took, and what those ahead will take.

A leg ends when the vehicle goes on to the next waypoint, by its own report. As in a plan, the first one begins with the
start of its motors, and the last one ends with their end on the ground. What is not heard, as in a silence, stays
unknown. What was flown undisturbed tells of the vehicle: see `vehicle_learning`. What is left to spend, and to do, are
the figures behind every battery decision.
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

FAR, PLENTY_PCT = 3.0, 10.0
"""With three times the way home and this much left there is no doubt: a factor is known to a third or better."""
UPRIGHT_M = 1.0
"""A leg that is shorter over the ground leads up or down."""


def time_to_reach_s(state: VehicleState, waypoint: int) -> float:
    """Return how long the vehicle needs until the end of a waypoint's leg at its own pace; 0 if it has passed."""
    pace, ahead = state.assignment.pace, _iterate_legs_ahead(state, waypoint)
    return sum((pace.factor_of(phase) * (share * leg.duration_s) for phase, leg, share in ahead), 0.0)


def energy_to_reach_pct(state: VehicleState, waypoint: int) -> float:
    """Return the energy of the same way by the model, in percent of a full battery.

    With its pace, as who takes longer draws its power for longer, but without its consumption: that is a factor of
    power, learned by velocities, and comes on top.
    """
    pace, ahead = state.assignment.pace, _iterate_legs_ahead(state, waypoint)
    return sum((pace.factor_of(phase) * (share * leg.energy_pct) for phase, leg, share in ahead), 0.0)


def _iterate_legs_ahead(state: VehicleState, waypoint: int) -> Iterator[tuple[Phase, LegEstimate, float]]:
    """Yield the legs until the end of a waypoint's, each with its phase and the share of it that is left."""
    board, first, fix = state.assignment.board, state.assignment.waypoint, state.motion.fix
    if board is None or first > waypoint or first >= len(board.legs):
        return
    share = 1.0 if fix is None or first == 0 else remaining_leg_share(board, first, fix)
    for point, leg in zip(board.path.waypoints[first : waypoint + 1], board.legs[first : waypoint + 1], strict=False):
        yield point.phase, leg, share
        share = 1.0


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
    """Return how far off the energy until the end of a waypoint's leg may be, as it is not known how long legs take.

    One standard deviation; what is not known of inspections and of transits is learned from legs of their own.
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
    """Return how much of the leg to a waypoint lies before a vehicle at a place on it."""
    end, end_up_m = board.places_m[waypoint], board.path.waypoints[waypoint].alt_rel_m
    begin, begin_up_m = end, 0.0  # the climb from the pad
    if waypoint > 0:
        begin, begin_up_m = board.places_m[waypoint - 1], board.path.waypoints[waypoint - 1].alt_rel_m
    length, left = math.dist(begin, end), math.dist(fix.place_m, end)
    if length < UPRIGHT_M:
        length, left = abs(end_up_m - begin_up_m), abs(end_up_m - fix.alt_rel_m)
    return min(1.0, left / length) if length >= UPRIGHT_M else 1.0


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


def _build_leg_boundary(state: VehicleState, now_s: float) -> vehicle_parts.LegBoundary:
    battery, given_pct = state.power.battery, None
    if battery.estimate is not None and battery.first_pct is not None:
        given_pct = battery.earlier_pct + battery.first_pct - battery.estimate.remaining_pct
    return vehicle_parts.LegBoundary(now_s, given_pct, battery.modelled_pct)


def _end_legs(state: VehicleState, waypoint: int, goes_to: int, now_s: float, start: LearnedFactors) -> VehicleState:
    """Return a vehicle that was on its way to one waypoint and is on its way to another one now."""
    board, began = state.assignment.board, state.assignment.leg_began
    if board is None:
        return state
    end = _build_leg_boundary(state, now_s)
    flown: list[vehicle_parts.FlownLeg] = []
    # Of several at once it is known when the first began and the last ended.
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
    rest_v = None if rest is None else rest.voltage_v
    sortie = vehicle_parts.FlownSortie(
        len(before) + 1, turn.label, now_s, vehicle.power.battery.remaining_pct, rest_v, own
    )
    sortie = replace(sortie, base=turn.base, lands=turn.lands_at)
    return vehicle.with_turn(sorties=(*before, sortie))


def end_sortie(context: Context, vehicle: VehicleState, now_s: float) -> VehicleState:
    """Return a vehicle that has landed; a charge reported before a link gap is not the charge at the landing."""
    turn = vehicle.turn
    if not turn.sorties or turn.sorties[-1].ended_s is not None or not vehicle.sortie.took_off:
        return vehicle
    power, sag = vehicle.power, vehicle.power.pack.sag
    # What its voltage says then is of another pack, in effect.
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
