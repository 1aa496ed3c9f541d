"""Decide which vehicle yields to another's RTL climb, and record the closest approach of vehicles in flight.

RTL begins with a climb through the layers above, the one move that layers do not separate. The climb is observed, or
predicted from a silent vehicle's failsafe. A vehicle whose mission leads into it slows down until the climb is over.
Its mode stays unchanged, so there is nothing to restore and a pilot who takes over finds the vehicle as usual. A
vehicle that cannot stop in time continues. Speed commands are resent until the vehicle is seen to follow.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from operator import itemgetter

import numpy as np

from executor.core.context import Context
from executor.core.inflight.homing import SINKS_M_S, is_coming_home, is_on_mission
from executor.core.interface.commands import ChangeSpeed, Command
from executor.core.lines import speed
from executor.core.state.fleet_state import FleetState, Stepped
from executor.core.state.vehicle_parts import ModeCause, OnboardMission, YieldState
from executor.core.state.vehicle_position import has_fresh_heartbeat, has_fresh_position
from executor.core.state.vehicle_state import IN_THE_AIR, Stage, VehicleState
from missions import Phase
from missions.geo import FloatArray
from missions.geometry import place_distances_m

SLOW_M_S = 0.5
"""Speed of a yielding vehicle, close to a stop; ArduPilot accepts no less than 0.2 (AC_WPNav.h, WPNAV_WP_SPEED_MIN)."""
BRAKING_M_S2 = 1.5
"""Assumed deceleration; the defaults WPNAV_ACCEL (2.5) and MPC_ACC_HOR (3) brake harder, after about a second."""
COMMAND_DELAY_S = 1.5
"""Time from the decision until the vehicle begins to brake."""
COMMAND_MARGIN_S = 3.0
"""Margin between sending the speed command and the latest braking point; every second command may be lost."""
CLEARANCE_M = 6.0
"""Horizontal margin around a climb beyond the layer spacing, for drift and late positions."""
LOOKAHEAD_S = 40.0
"""Lookahead along a mission; a climb through all layers takes about as long."""
SAMPLE_STEP_S = 0.5
"""Time between two samples of a predicted path."""
LEG_TIME_SHORTEST, LEG_TIME_LONGEST, WAYPOINT_STOP_S = 0.8, 1.3, 5.0
"""Bounds on the flight time of a leg, as factors of length over speed, and the longest stop at its waypoint."""
CLIMB_RATE_FASTEST, CLIMB_RATE_SLOWEST = 1.25, 0.65
"""Bounds on the climb rate, as factors of the modelled one."""
RTL_STOP_S = 6.0
"""Longest time from the start of RTL to the start of its climb; the vehicle stops first."""
TOP_MARGIN_M = 2.0
"""Distance below the RTL height from which the climb counts as finished."""
FAILSAFE_JITTER_S = 4.0
"""Uncertainty of the failsafe's start: the last message received is not the last HEARTBEAT that the vehicle
received."""
RESEND_S = 1.5
"""Resend interval for a command whose effect has not been seen."""
BRAKING_S = 5.0
"""Longest time to brake."""
LONGEST_YIELD_S = 75.0
"""Longest time a vehicle yields."""
LEG_END_M = 4.0
"""Distance to the end of a leg below which its speed is not restored; the next leg sets its own."""
RESTORE_TIMEOUT_S = 12.0
"""Longest time to watch for the speed to be restored."""
LONGEST_CLIMB_S = 120.0
"""Longest climb assumed for a silent vehicle."""
_MAY_CLIMB = IN_THE_AIR | {Stage.LOST}


@dataclass(frozen=True, slots=True)
class Climb:
    """The climb of a vehicle, observed or predicted."""

    vehicle: str
    seen: bool
    places_m: FloatArray
    """(n, 2) east and north along which it may take place; at least two rows."""
    up_m: tuple[float, float]
    """Lowest and highest start, over the depot's ground."""
    top_m: float
    """Height at which it ends."""
    begins_s: tuple[float, float]
    climb_rates_m_s: tuple[float, float]
    """The slowest and the fastest."""

    def window_s(self, up_m: FloatArray, spacing_m: float) -> tuple[FloatArray, FloatArray]:
        """Return the earliest and latest time within `spacing_m` of each height (m,); empty where there is none."""
        slowest, fastest = self.climb_rates_m_s
        from_s = self.begins_s[0] + np.maximum(0.0, up_m - spacing_m - self.up_m[1]) / fastest
        to_s = self.begins_s[1] + np.maximum(0.0, up_m + spacing_m - self.up_m[0]) / slowest
        passed = (up_m < self.up_m[0] - spacing_m) | (up_m > self.top_m + spacing_m)
        return from_s, np.where(passed, -math.inf, to_s)


@dataclass(frozen=True, slots=True)
class PathAhead:
    """The predicted path of a vehicle on its mission, one sample a row."""

    places_m: FloatArray
    """(m, 3) east, north, and height over the depot's ground."""
    soonest_s: FloatArray
    latest_s: FloatArray
    along_m: FloatArray
    """Distance from the vehicle."""


def avoid_climbs(context: Context, state: FleetState, now_s: float) -> Stepped:
    """Slow down vehicles that would fly into a climb; restore the speed of those that yielded."""
    climbs = tuple(_find_climbs(context, state, now_s))
    commands: list[Command] = []
    for vehicle in tuple(state.vehicles.values()):
        if vehicle.orders.gives_way is None and not climbs:
            continue
        after, more = _update_yielding(context, vehicle, climbs, now_s)
        state = state if after is vehicle else state.put(after)
        commands.extend(more)
    return state, tuple(commands)


def _update_yielding(
    context: Context, vehicle: VehicleState, climbs: tuple[Climb, ...], now_s: float
) -> tuple[VehicleState, tuple[Command, ...]]:
    yielding = vehicle.orders.gives_way
    if not _is_on_our_mission(context, vehicle):
        # Both autopilots drop a commanded speed when the mode changes.
        return (vehicle if yielding is None else _set_yielding(vehicle, None, now_s)), ()
    if not (has_fresh_position(context, vehicle, now_s) and has_fresh_heartbeat(context, vehicle, now_s)):
        return vehicle, ()
    found = _find_first_conflict(context, vehicle, climbs, now_s)
    if yielding is None or yielding.over_s is not None:
        if found is None or not _must_brake(vehicle, found[1]):
            return (vehicle, ()) if yielding is None else _restore_speed(vehicle, yielding, now_s)
        line = speed.SLOWS if found[0].seen else speed.SLOWS_FOR_SILENT
        said = line.say(vehicle=vehicle.name, other=found[0].vehicle)
        return _set_yielding(vehicle, YieldState(now_s, now_s), now_s), (said, ChangeSpeed(vehicle.name, SLOW_M_S))
    if found is not None and now_s - yielding.since_s < LONGEST_YIELD_S:
        return _keep_slow(vehicle, yielding, now_s)
    if _is_at_leg_end(vehicle):
        return vehicle, ()
    speed_m_s = _leg_speed_m_s(vehicle)
    after = _set_yielding(
        vehicle, replace(yielding, over_s=now_s, told_s=now_s, leg=vehicle.assignment.waypoint), now_s
    )
    return after, (speed.FLIES_ON.say(vehicle=vehicle.name, speed_m_s=speed_m_s), ChangeSpeed(vehicle.name, speed_m_s))


def _keep_slow(vehicle: VehicleState, yielding: YieldState, now_s: float) -> tuple[VehicleState, tuple[Command, ...]]:
    """Resend the slow speed if the vehicle is fast: the command was lost, or the next leg set its own speed."""
    patience_s = BRAKING_S if yielding.followed else RESEND_S
    slow = _speed_m_s(vehicle) < 2.0 * SLOW_M_S
    if slow or now_s - yielding.told_s < patience_s:
        known = yielding.followed or not slow
        return (vehicle if known else _set_yielding(vehicle, replace(yielding, followed=True), now_s)), ()
    return _set_yielding(vehicle, replace(yielding, told_s=now_s, followed=False), now_s), (
        ChangeSpeed(vehicle.name, SLOW_M_S),
    )


def _restore_speed(
    vehicle: VehicleState, yielding: YieldState, now_s: float
) -> tuple[VehicleState, tuple[Command, ...]]:
    """Resend the leg's speed until the vehicle flies it; a next leg with another speed sets it by itself."""
    speed_m_s = _leg_speed_m_s(vehicle)
    fast = _speed_m_s(vehicle) > 0.6 * speed_m_s
    if fast or vehicle.assignment.waypoint != yielding.leg or now_s - (yielding.over_s or now_s) > RESTORE_TIMEOUT_S:
        return _set_yielding(vehicle, None, now_s), ()
    if now_s - yielding.told_s < RESEND_S or _is_at_leg_end(vehicle):
        return vehicle, ()
    return _set_yielding(vehicle, replace(yielding, told_s=now_s), now_s), (ChangeSpeed(vehicle.name, speed_m_s),)


def _set_yielding(vehicle: VehicleState, yielding: YieldState | None, now_s: float) -> VehicleState:
    return vehicle.with_orders(gives_way=yielding, gave_way_s=now_s)


def _is_on_our_mission(context: Context, vehicle: VehicleState) -> bool:
    """Return whether the vehicle flies our mission under our control, between its climb and its landing."""
    flies = vehicle.stage is Stage.FLYING and vehicle.orders.held_s is None and vehicle.fault is None
    leg = vehicle.leg
    level = leg is not None and leg.phase not in {Phase.TAKEOFF, Phase.LAND}
    ours = vehicle.custody.cause is ModeCause.OURS and not vehicle.is_under_foreign_control
    carries_ours = not vehicle.assignment.carried.may_be_foreign()
    return flies and level and ours and carries_ours and is_on_mission(context, vehicle)


def _speed_m_s(vehicle: VehicleState) -> float:
    fix = vehicle.motion.fix
    return 0.0 if fix is None else math.hypot(*fix.velocity_m_s[:2])


def _leg_speed_m_s(vehicle: VehicleState) -> float:
    return vehicle.leg.speed_m_s if vehicle.leg is not None else 0.0


def _is_at_leg_end(vehicle: VehicleState) -> bool:
    board, fix = vehicle.assignment.board, vehicle.motion.fix
    return (
        board is None or fix is None or math.dist(fix.place_m, board.places_m[vehicle.assignment.waypoint]) < LEG_END_M
    )


def _must_brake(vehicle: VehicleState, away_m: float) -> bool:
    """Return whether to brake now for a conflict at this distance; False if it is too late to stop."""
    speed_m_s = _speed_m_s(vehicle)
    stops_m = speed_m_s * COMMAND_DELAY_S + speed_m_s**2 / (2.0 * BRAKING_M_S2)
    return stops_m - CLEARANCE_M <= away_m <= stops_m + COMMAND_MARGIN_S * speed_m_s


def _find_first_conflict(
    context: Context, vehicle: VehicleState, climbs: tuple[Climb, ...], now_s: float
) -> tuple[Climb, float] | None:
    """Return the first climb on the vehicle's path, and the distance to it."""
    board = vehicle.assignment.board
    if board is None:
        return None
    others = [climb for climb in climbs if climb.vehicle != vehicle.name]
    ahead = _predict_path(context, vehicle, board, now_s + LOOKAHEAD_S) if others else None
    if ahead is None:
        return None
    away_m = ((climb, _conflict_distance_m(ahead, climb, context.setup.inspection.layer_m)) for climb in others)
    return min(((climb, far_m) for climb, far_m in away_m if far_m is not None), key=itemgetter(1), default=None)


def _conflict_distance_m(ahead: PathAhead, climb: Climb, spacing_m: float) -> float | None:
    """Return the distance along a path at which it conflicts with a climb in place and time; None if it does not."""
    parts_m = np.stack((climb.places_m[:-1], climb.places_m[1:]), axis=1)
    near = place_distances_m(parts_m, ahead.places_m[:, :2]).min(axis=1) < spacing_m + CLEARANCE_M
    from_s, to_s = climb.window_s(ahead.places_m[:, 2], spacing_m)
    meets = near & (ahead.soonest_s <= to_s) & (ahead.latest_s >= from_s)
    return float(ahead.along_m[int(meets.argmax())]) if meets.any() else None


def _predict_path(context: Context, vehicle: VehicleState, board: OnboardMission, until_s: float) -> PathAhead | None:
    """Return the path up to the landing, or up to `until_s` at its earliest; None if it has no samples."""
    fix, setup = vehicle.motion.fix, context.setup
    if fix is None:
        return None
    climb_m_s = context.pricing.models[vehicle.name].performance.climb_m_s
    place = np.array([*fix.place_m, setup.up_m(vehicle.name, fix.alt_rel_m)])
    at_s, late_s, along_m = fix.at_s, fix.at_s, 0.0
    rows: list[FloatArray] = []
    legs = zip(board.path.waypoints, board.places_m, strict=True)
    for waypoint, to_m in list(legs)[vehicle.assignment.waypoint :]:
        if waypoint.phase is Phase.LAND or at_s > until_s:
            break
        end = np.array([*to_m, setup.up_m(vehicle.name, waypoint.alt_rel_m)])
        length_m, rise_m = math.dist(place[:2], end[:2]), abs(float(end[2] - place[2]))
        takes_s = max(length_m / max(waypoint.speed_m_s, SLOW_M_S), rise_m / climb_m_s)
        share = np.linspace(0.0, 1.0, max(2, math.ceil(takes_s / SAMPLE_STEP_S) + 1))
        flown = place + share[:, None] * (end - place)
        times_s = np.column_stack(
            (at_s + LEG_TIME_SHORTEST * takes_s * share, late_s + LEG_TIME_LONGEST * takes_s * share)
        )
        rows.append(np.column_stack((flown, times_s, along_m + length_m * share)))
        stays_s = WAYPOINT_STOP_S + waypoint.hover_s
        at_s, late_s, along_m = (
            at_s + LEG_TIME_SHORTEST * takes_s,
            late_s + LEG_TIME_LONGEST * takes_s + stays_s,
            along_m + length_m,
        )
        place = end
    if not rows:
        return None
    table = np.concatenate(rows)
    return PathAhead(table[:, :3], table[:, 3], table[:, 4], table[:, 5])


def _find_climbs(context: Context, state: FleetState, now_s: float) -> Iterator[Climb]:
    for vehicle in state.vehicles.values():
        if vehicle.stage in _MAY_CLIMB and vehicle.armed and vehicle.motion.fix is not None:
            climb = _observe_climb(context, vehicle) or _expect_climb(context, vehicle, now_s)
            if climb is not None:
                yield climb


def _return_top_m(context: Context, vehicle: VehicleState) -> float:
    """Return the RTL height over the depot's ground."""
    return context.setup.up_m(vehicle.name, context.return_height_m(vehicle.name))


def _climb_rates_m_s(context: Context, vehicle: VehicleState) -> tuple[float, float]:
    climb_m_s = context.pricing.models[vehicle.name].performance.climb_m_s
    return CLIMB_RATE_SLOWEST * climb_m_s, CLIMB_RATE_FASTEST * climb_m_s


def _observe_climb(context: Context, vehicle: VehicleState) -> Climb | None:
    """Return the climb of a vehicle that reports RTL, or was commanded to return; it stops first, then climbs.

    A descending vehicle is landing; one over its pad is about to.
    """
    fix, lands = vehicle.motion.fix, context.vehicles[vehicle.name].dialect.modes.land.custom_mode
    told = vehicle.stage is Stage.RETURNING and vehicle.orders.errand is not None and not vehicle.orders.lands
    returns = vehicle.mode != lands and is_coming_home(context, vehicle)
    if fix is None or not (told or returns) or fix.alt_rel_m < context.limits.airborne_m:
        return None
    up_m, top_m = context.setup.up_m(vehicle.name, fix.alt_rel_m), _return_top_m(context, vehicle)
    up_m_s, away_m = fix.velocity_m_s[2], context.vehicles[vehicle.name].pad_distance_m(fix.place_m)
    rises = up_m_s > context.limits.climbs_m_s
    lands_now = up_m_s < -SINKS_M_S or (not rises and away_m <= context.limits.pad_m)
    if lands_now or up_m > top_m - TOP_MARGIN_M:
        return None
    here = np.array(fix.place_m)
    velocity = np.array(fix.velocity_m_s[:2])
    stops = here + velocity * (float(np.hypot(*velocity)) / (2.0 * BRAKING_M_S2))
    begins_s = (fix.at_s, fix.at_s if rises else fix.at_s + RTL_STOP_S)
    places = np.array([here, stops])
    return Climb(vehicle.name, True, places, (up_m, up_m), top_m, begins_s, _climb_rates_m_s(context, vehicle))


def _expect_climb(context: Context, vehicle: VehicleState, now_s: float) -> Climb | None:
    """Return the climb that a silent vehicle's failsafe will begin, somewhere along its mission."""
    setup, heard_s, board = context.vehicles[vehicle.name], vehicle.link.heard_s, vehicle.assignment.board
    if setup.failsafe_s is None or not setup.returns or heard_s is None or board is None:
        return None
    if now_s - heard_s < context.limits.link_stale_s or not is_on_mission(context, vehicle) or vehicle.leg is None:
        return None
    begins_s = (heard_s + setup.failsafe_s - FAILSAFE_JITTER_S, heard_s + setup.failsafe_s + FAILSAFE_JITTER_S)
    ahead = None if now_s > begins_s[1] + LONGEST_CLIMB_S else _predict_path(context, vehicle, board, begins_s[1])
    if ahead is None:
        return None
    there = (ahead.soonest_s <= begins_s[1]) & (ahead.latest_s >= begins_s[0])
    if not there.any():
        return None
    places_m = ahead.places_m[there]
    places_m = np.concatenate((places_m, places_m[-1:]))
    up_m = (float(places_m[:, 2].min()), float(places_m[:, 2].max()))
    waits_s = (begins_s[0], begins_s[1] + RTL_STOP_S)
    climb_rates_m_s = _climb_rates_m_s(context, vehicle)
    return Climb(vehicle.name, False, places_m[:, :2], up_m, _return_top_m(context, vehicle), waits_s, climb_rates_m_s)


POSITION_AGE_S = 1.5
"""Largest age of a position that counts for the separation of two vehicles."""
HEIGHT_CHANGE_M = 15.0
"""Largest height change of a vehicle within that time."""


def record_separation(context: Context, state: FleetState, vehicle: VehicleState, now_s: float) -> FleetState:
    """Update the closest approach after a position of one vehicle; dead-reckoned positions do not count."""
    fix = vehicle.motion.fix
    high = context.limits.airborne_m
    if fix is None or fix.alt_rel_m < high or not vehicle.armed or fix.reckoned:
        return state
    least_m = state.progress.separation_m
    # Runs for every position and every vehicle: height alone rules out nearly all pairs.
    reach_m = math.inf if least_m is None else least_m + HEIGHT_CHANGE_M
    for other in state.vehicles.values():
        seen = other.motion.fix
        if seen is None or abs(seen.alt_msl_m - fix.alt_msl_m) > reach_m:
            continue
        if other.name == vehicle.name or seen.alt_rel_m < high or not other.armed or seen.reckoned:
            continue
        age_s = now_s - seen.at_s
        if age_s > POSITION_AGE_S:
            continue
        east_m_s, north_m_s, up_m_s = seen.velocity_m_s
        higher_m = seen.alt_msl_m + up_m_s * age_s - fix.alt_msl_m
        east_m = seen.place_m[0] + east_m_s * age_s - fix.place_m[0]
        north_m = seen.place_m[1] + north_m_s * age_s - fix.place_m[1]
        apart_m = math.hypot(east_m, north_m, higher_m)
        if least_m is None or apart_m < least_m:
            least_m = apart_m
    return state if least_m == state.progress.separation_m else state.with_progress(separation_m=least_m)
