"""Build each vehicle's offer to a re-plan: start, budget, hours, and the visits it carries."""

from __future__ import annotations

import math
from dataclasses import replace

from executor.core.battery import account
from executor.core.context import Context, RelaunchPolicy
from executor.core.interface.commands import Survivor
from executor.core.lines import operator
from executor.core.preflight.readiness import find_obstacles, is_heard
from executor.core.state import legs
from executor.core.state.fleet_state import FleetState
from executor.core.state.vehicle_parts import CLEARED_S, PLANNED_WITHIN_S, ModeCause
from executor.core.state.vehicle_position import has_fresh_heartbeat
from executor.core.state.vehicle_state import Stage, VehicleState, current_setup_of
from missions import Phase
from missions.autopilots.dialect import is_mission_mode
from missions.geometry import locate_on_leg
from planner import segment_of

QUANTUM_PCT = 1.0
"""Largest excess of a reported percentage, in whole percent."""
BESIDE_M = 5.0
"""Lateral distance beyond cut corners and position errors."""
_STAYS = frozenset({operator.TILTED, operator.BASE_CLOSED, operator.UNCLEARED})
"""Reasons to plan without a vehicle on the ground; its budget says how much its battery holds."""


def find_barred_segments(context: Context, fleet: FleetState, vehicle: VehicleState) -> frozenset[int]:
    """Return the segments that a vehicle cannot get.

    It has no camera for them, by site or day, or they are locked to another vehicle.
    """
    return find_blind_segments(context, vehicle) | find_locked_segments(context, fleet, vehicle)


def find_blind_segments(context: Context, vehicle: VehicleState) -> frozenset[int]:
    """Return the segments for which a vehicle has no camera, by site or day."""
    by_day = frozenset[int]() if context.day is None else context.day.barred.get(vehicle.name, frozenset())
    return context.setup.looks.find_barred_segments(vehicle.name, vehicle.payload.broken) | by_day


def find_locked_segments(context: Context, fleet: FleetState, vehicle: VehicleState) -> frozenset[int]:
    """Return the segments locked to another vehicle still in the plan; those on board already stay allowed."""
    if not context.pricing.locked:
        return frozenset()
    others = [other for other in fleet.vehicles.values() if other.name != vehicle.name]
    keepers = {other.name for other in others if not is_gone(context, other)}
    locked = frozenset(segment for segment, keeper in context.pricing.locked.items() if keeper in keepers)
    return locked - {segment_of(visit) for visit in vehicle.remaining_visits()}


def is_gone(context: Context, vehicle: VehicleState) -> bool:
    """Return whether a vehicle is lost or out of the plan: its locks are lifted."""
    taken, stays = vehicle.custody.taken, vehicle.stage is Stage.LANDED and context.fly_again is RelaunchPolicy.NEVER
    left = vehicle.stage in {Stage.RETURNING, Stage.DOWN, Stage.LOST} or (taken is not None and taken.given_away)
    return vehicle.is_pulled_out or left or stays


def is_out_of_plan(vehicle: VehicleState) -> bool:
    """Return whether a vehicle gets no segments until the crew, or the vehicle itself, changes that."""
    known = vehicle.assignment
    out = vehicle.is_pulled_out or known.stubborn or vehicle.orders.held_s is not None
    return out or known.carried.may_be_foreign() or vehicle.turn.asked_s is not None


def build_survivors(context: Context, state: FleetState, now_s: float) -> tuple[Survivor, ...]:
    """Return the offers of all vehicles to a re-plan, each within its hours."""
    offers = (build_survivor(context, state, vehicle, now_s) for vehicle in state.vehicles.values())
    return tuple(limit_to_hours(context, state, offer, now_s) for offer in offers if offer)


def build_survivor(context: Context, fleet: FleetState, state: VehicleState, now_s: float) -> Survivor | None:
    """Return a vehicle's offer to a re-plan; None if it cannot get a new mission now."""
    # A silent vehicle may be lost in a moment: its part would be planned twice.
    heard = is_heard(context, state, now_s) and not state.link.stale
    if is_out_of_plan(state) or not heard or state.power.battery.remaining_pct is None:
        return None
    if state.is_on_base:
        if find_obstacles(context, fleet, state, now_s, within_s=PLANNED_WITHIN_S).keys() & _STAYS:
            return None
        return build_pad_survivor(context, fleet, state)
    board, fix, setup = state.assignment.board, state.motion.fix, context.setup
    if state.stage not in {Stage.FLYING, Stage.STARTING} or board is None or fix is None:
        return None
    kept = _count_kept_waypoints(context, state) if _is_flying_mission(context, state, now_s) else None
    if kept is None:
        return None
    if kept > state.assignment.waypoint:
        place_m, alt_rel_m = board.places_m[kept - 1], board.path.waypoints[kept - 1].alt_rel_m
        spent_pct = legs.energy_to_reach_pct(state, kept - 1)
    else:
        # It flies on until the new mission is on board, and back again.
        on = min(1.0, context.horizon_s / legs.time_to_reach_s(state, kept))
        place_m, alt_rel_m, spent_pct = fix.place_m, fix.alt_rel_m, 2.0 * on * legs.energy_to_reach_pct(state, kept)
    spent_pct *= account.consumption_factor(state.power.battery)
    offer = _build_offer(context, fleet, state, place_m, spent_pct, airborne=True, kept=kept)
    facing_m = (0.0, 0.0)
    if kept > 1:  # along the last leg kept, or the one before a leg replaced in flight
        (east_m, north_m), before_m = board.places_m[kept - 1], board.places_m[kept - 2]
        facing_m = (east_m - before_m[0], north_m - before_m[1])
    low = kept > 0 and board.path.waypoints[kept - 1].below_m > 0
    # Flights are priced in the lowest layer.
    up_m = setup.up_m(state.name, alt_rel_m) - (0.0 if low else setup.layers.offset_m(state.name))
    return replace(offer, start_up_m=up_m, facing_m=facing_m, low=low)


def build_pad_survivor(context: Context, fleet: FleetState, state: VehicleState) -> Survivor:
    """Return the offer of a vehicle on the ground, once it may take off."""
    return _build_offer(context, fleet, state, (0.0, 0.0), 0.0, airborne=False, kept=0)


def is_offer_valid(vehicle: VehicleState, offer: Survivor) -> bool:
    """Return whether a vehicle has not flown past the start of its offer."""
    if vehicle.is_pulled_out or vehicle.orders.held_s is not None:
        return False
    if not offer.airborne:
        return vehicle.is_on_base
    if vehicle.custody.cause is not ModeCause.OURS:
        return False  # it has just left its mission, by a failsafe or a person
    board, waypoint = vehicle.assignment.board, vehicle.assignment.waypoint
    if board is None or vehicle.stage not in {Stage.FLYING, Stage.STARTING}:
        return False
    turns_back = waypoint == offer.kept and board.path.waypoints[waypoint].phase is Phase.RETURN
    return waypoint < offer.kept or turns_back


def _is_flying_mission(context: Context, state: VehicleState, now_s: float) -> bool:
    """Return whether an airborne vehicle reports mission mode; after an absence of ours it may not."""
    beat = state.telemetry.heartbeat
    if beat is None or not has_fresh_heartbeat(context, state, now_s):
        return False
    return state.stage is Stage.STARTING or is_mission_mode(context.vehicles[state.name].dialect, beat.custom_mode)


def _count_kept_waypoints(context: Context, state: VehicleState) -> int | None:
    """Return the waypoints to keep: the visit under way or ahead, and those begun before an upload ends.

    The current item is not replaced in flight: ArduPilot takes items one by one, and its index runs ahead if the
    current one is no waypoint any more. A return leg may be, as its replacement begins with a waypoint too; but a
    vehicle off that leg, as returned by its pilot, finishes it first.
    """
    board = state.assignment.board
    if board is None:
        return None
    waypoints = board.path.waypoints
    kept = state.assignment.waypoint
    while kept < len(waypoints):
        if waypoints[kept].phase in {Phase.TAKEOFF, Phase.TRANSIT, Phase.INSPECT}:
            # A visit under way is finished.
            while waypoints[kept].phase is not Phase.INSPECT:
                kept += 1
                if waypoints[kept].phase in {Phase.RETURN, Phase.LAND}:
                    break
            else:
                kept += 1
        if waypoints[kept].phase is Phase.LAND:
            return None
        homeward = waypoints[kept].phase is Phase.RETURN
        if legs.time_to_reach_s(state, kept if homeward else kept - 1) > context.horizon_s:
            return kept + 1 if kept == state.assignment.waypoint and _is_beside_leg(state) else kept
        if homeward:
            return None
    return None


def _is_beside_leg(state: VehicleState) -> bool:
    """Return whether a vehicle flies to its waypoint from off its mission's leg."""
    board, waypoint, fix = state.assignment.board, state.assignment.waypoint, state.motion.fix
    if board is None or fix is None or not 0 < waypoint < len(board.places_m):
        return False
    return locate_on_leg(board.places_m[waypoint - 1], board.places_m[waypoint], fix.place_m)[1] > BESIDE_M


def _build_offer(
    context: Context,
    fleet: FleetState,
    state: VehicleState,
    start_m: tuple[float, float],
    spent_pct: float,
    *,
    airborne: bool,
    kept: int,
) -> Survivor:
    setup = current_setup_of(context, state)
    remaining = state.power.battery.remaining_pct or 0.0
    # The reserve is never touched, so the rounded report is compared with that.
    left = min(
        remaining - QUANTUM_PCT - setup.reserve_pct,
        setup.budget_pct - account.draw_since_start_pct(state.power.battery),
    )
    budget = left - spent_pct
    tail, board = tuple[int, ...](), state.assignment.board
    if board is not None and airborne:
        ahead = {waypoint.visit for waypoint in board.path.waypoints[kept:]}
        tail = tuple(visit for index, visit in enumerate(board.visits) if index in ahead)
    barred = find_barred_segments(context, fleet, state)
    most = remaining - setup.reserve_pct - spent_pct
    return Survivor(
        state.name, start_m, max(0.0, budget), account.consumption_factor(state.power.battery), airborne, tail, kept,
        max(0.0, most), pace=state.assignment.pace, barred=tuple(sorted(barred)),
    )  # fmt: skip


def find_remaining_hours(
    context: Context, state: FleetState, name: str, now_s: float, *, ahead_s: float = 0.0
) -> tuple[float, float | None]:
    """Return how long a vehicle may fly, and when it may again.

    Hours that begin within `ahead_s` count as begun: a clearance may be that old at take-off.

    Returns:
        The seconds until its hours end, infinite without any, 0 outside them; and the seconds after launch at which
        its next ones begin, None if there are none.
    """
    day, launched_s = context.day, state.progress.launched_s
    if day is None:
        return math.inf, None
    flight_s, windows = now_s - (now_s if launched_s is None else launched_s), day.windows_s.get(name, ())
    left_s = max((end - flight_s for begin, end in windows if begin - ahead_s <= flight_s), default=0.0)
    return max(0.0, left_s), min((begin for begin, _ in windows if begin - ahead_s > flight_s), default=None)


def min_draw_pct(context: Context, seconds: float) -> float:
    """Return the least energy a flight of this time draws, in percent: a flight of that energy is no longer."""
    return seconds * min(context.draws_pct_s)


def limit_to_hours(context: Context, state: FleetState, offer: Survivor, now_s: float) -> Survivor:
    """Return an offer limited to the vehicle's hours.

    Visits it carries may continue if they end in time. A vehicle in the air may have been started for hours about to
    begin.
    """
    left_s, _ = find_remaining_hours(context, state, offer.vehicle, now_s, ahead_s=CLEARED_S if offer.airborne else 0.0)
    if math.isinf(left_s):
        return offer
    vehicle = state.vehicles[offer.vehicle]
    free_s = home_s = 0.0
    if offer.airborne and vehicle.assignment.board is not None:
        free_s = legs.time_to_reach_s(vehicle, offer.kept - 1)
        home_s = legs.time_to_reach_s(vehicle, len(vehicle.assignment.board.legs) - 1)
    most_pct = min_draw_pct(context, max(0.0, left_s - free_s))
    in_time = offer.airborne and home_s <= left_s
    return replace(
        offer,
        budget_pct=min(offer.budget_pct, most_pct),
        most_pct=offer.most_pct if in_time else min(offer.most_pct, most_pct),
    )
