"""Who waits for whom climbs, and how near flying vehicles came to each other.

The way home of an autopilot's own begins with a climb through the layers above. Layers keep vehicles apart whatever
their timing; such a climb does not. It is seen, or it is known when a silent vehicle's failsafe begins it. Who would
fly into it on its mission flies slowly until it is over: the mode stays what it is, so that nothing has to be given
back, and a person who takes the vehicle finds nothing changed. Who cannot stop in time goes on. What gets lost on the
way is told again until it is seen to be done.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from operator import itemgetter

import numpy as np

from executor.core.context import Context
from executor.core.inflight.custody.mode_causes import is_under_foreign_control
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
"""As good as standing still; ArduPilot takes no speed below 0.2 (AC_WPNav.h, WPNAV_WP_SPEED_MIN)."""
BRAKES_M_S2 = 1.5
"""Both brake harder by their defaults: WPNAV_ACCEL and MPC_ACC_HOR are 2.5 and 3, and take a second to begin."""
TOLD_LATE_S = 1.5
"""From the decision until it begins to brake."""
SPARE_S = 3.0
"""It is told so much before it has to brake: one order in two may be lost."""
AROUND_M = 6.0
"""More than the spacing about a climb: what it drifts, and what positions are late."""
LOOK_S = 40.0
"""So far ahead a mission is looked at: a climb through all layers takes as long."""
STEP_S = 0.5
"""Between places on a way."""
FASTER, SLOWER, STOP_S = 0.8, 1.3, 5.0
"""Shares of the time that a way takes by its legs' speeds, and what a stop may take."""
RISES_FASTER, RISES_SLOWER = 1.25, 0.65
"""Shares of the climb of a vehicle's model."""
TURNS_S = 6.0
"""A return begins with a stop, and its climb with that."""
RISES_M = 2.0
"""Who is this near to the height of its return does not climb any more."""
FAILSAFE_S = 4.0
"""A failsafe may begin so much sooner or later: what was heard last from a vehicle is not the last that it heard."""
AGAIN_S = 1.5
"""After this an order that is not seen to be followed is given again."""
FOLLOWS_S = 5.0
"""So long braking takes."""
MOST_S = 75.0
"""Nobody waits for longer."""
PASSES_M = 4.0
"""Nearer to the end of its leg nobody is told the leg's speed: the next one begins with its own."""
SPENT_S = 12.0
"""Whether it is fast again is looked at for so long."""
CLIMBS_MOST_S = 120.0
"""After this a silent vehicle's climb is over, whatever it is like."""
_UP = IN_THE_AIR | {Stage.LOST}


@dataclass(frozen=True, slots=True)
class Climb:
    """A climb of somebody, under way or expected."""

    vehicle: str
    seen: bool
    places_m: FloatArray
    """(n, 2) places along which it may stand, east and north; two at least."""
    up_m: tuple[float, float]
    """Between which heights it begins, over the depot's ground."""
    top_m: float
    """Where it ends."""
    begins_s: tuple[float, float]
    rises_m_s: tuple[float, float]
    """The slowest and the fastest."""

    def window_s(self, up_m: FloatArray, spacing_m: float) -> tuple[FloatArray, FloatArray]:
        """Return from when until when it may be nearer to heights (m,) than the spacing; empty where it never is."""
        slowest, fastest = self.rises_m_s
        from_s = self.begins_s[0] + np.maximum(0.0, up_m - spacing_m - self.up_m[1]) / fastest
        to_s = self.begins_s[1] + np.maximum(0.0, up_m + spacing_m - self.up_m[0]) / slowest
        passed = (up_m < self.up_m[0] - spacing_m) | (up_m > self.top_m + spacing_m)
        return from_s, np.where(passed, -math.inf, to_s)


@dataclass(frozen=True, slots=True)
class PathAhead:
    """The way ahead of a vehicle, if it flew on as planned; every row is a place on it."""

    places_m: FloatArray
    """(m, 3) east, north, and height over the depot's ground."""
    soonest_s: FloatArray
    latest_s: FloatArray
    along_m: FloatArray
    """From where it is."""


def avoid_climbs(context: Context, state: FleetState, now_s: float) -> Stepped:
    """Slow down who would fly into a climb, and let fly on who waited for one."""
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
    waits = vehicle.orders.gives_way
    if not _is_on_our_mission(context, vehicle):
        # A change of mode makes both autopilots forget the speed that they were told.
        return (vehicle if waits is None else _set_yielding(vehicle, None, now_s)), ()
    if not (has_fresh_position(context, vehicle, now_s) and has_fresh_heartbeat(context, vehicle, now_s)):
        return vehicle, ()
    found = _find_first_conflict(context, vehicle, climbs, now_s)
    if waits is None or waits.over_s is not None:
        if found is None or not _must_brake(vehicle, found[1]):
            return (vehicle, ()) if waits is None else _restore_speed(vehicle, waits, now_s)
        line = speed.SLOWS if found[0].seen else speed.SLOWS_FOR_SILENT
        said = line.say(vehicle=vehicle.name, other=found[0].vehicle)
        return _set_yielding(vehicle, YieldState(now_s, now_s), now_s), (said, ChangeSpeed(vehicle.name, SLOW_M_S))
    if found is not None and now_s - waits.since_s < MOST_S:
        return _keep_slow(vehicle, waits, now_s)
    if _is_at_leg_end(vehicle):
        return vehicle, ()
    speed_m_s = _leg_speed_m_s(vehicle)
    after = _set_yielding(vehicle, replace(waits, over_s=now_s, told_s=now_s, leg=vehicle.assignment.waypoint), now_s)
    return after, (speed.FLIES_ON.say(vehicle=vehicle.name, speed_m_s=speed_m_s), ChangeSpeed(vehicle.name, speed_m_s))


def _keep_slow(vehicle: VehicleState, waits: YieldState, now_s: float) -> tuple[VehicleState, tuple[Command, ...]]:
    """Tell it again if it is seen to be fast: the order was lost, or its next leg began with a speed of its own."""
    patience_s = FOLLOWS_S if waits.followed else AGAIN_S
    slow = _speed_m_s(vehicle) < 2.0 * SLOW_M_S
    if slow or now_s - waits.told_s < patience_s:
        known = waits.followed or not slow
        return (vehicle if known else _set_yielding(vehicle, replace(waits, followed=True), now_s)), ()
    return _set_yielding(vehicle, replace(waits, told_s=now_s, followed=False), now_s), (
        ChangeSpeed(vehicle.name, SLOW_M_S),
    )


def _restore_speed(vehicle: VehicleState, waits: YieldState, now_s: float) -> tuple[VehicleState, tuple[Command, ...]]:
    """See to it that who waited is at its leg's speed again; every leg of another speed begins with its own."""
    speed_m_s = _leg_speed_m_s(vehicle)
    fast = _speed_m_s(vehicle) > 0.6 * speed_m_s
    if fast or vehicle.assignment.waypoint != waits.leg or now_s - (waits.over_s or now_s) > SPENT_S:
        return _set_yielding(vehicle, None, now_s), ()
    if now_s - waits.told_s < AGAIN_S or _is_at_leg_end(vehicle):
        return vehicle, ()
    return _set_yielding(vehicle, replace(waits, told_s=now_s), now_s), (ChangeSpeed(vehicle.name, speed_m_s),)


def _set_yielding(vehicle: VehicleState, waits: YieldState | None, now_s: float) -> VehicleState:
    return vehicle.with_orders(gives_way=waits, gave_way_s=now_s)


def _is_on_our_mission(context: Context, vehicle: VehicleState) -> bool:
    """Return whether it flies its mission, by nobody's will but ours, between its climb and its landing."""
    flies = vehicle.stage is Stage.FLYING and vehicle.orders.held_s is None and vehicle.fault is None
    leg = vehicle.leg
    level = leg is not None and leg.phase not in {Phase.TAKEOFF, Phase.LAND}
    ours = vehicle.custody.cause is ModeCause.OURS and not is_under_foreign_control(vehicle)
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
        board is None or fix is None or math.dist(fix.place_m, board.places_m[vehicle.assignment.waypoint]) < PASSES_M
    )


def _must_brake(vehicle: VehicleState, away_m: float) -> bool:
    """Return whether now is the time to brake for what is so far ahead; not if it is too late for that."""
    speed_m_s = _speed_m_s(vehicle)
    stops_m = speed_m_s * TOLD_LATE_S + speed_m_s**2 / (2.0 * BRAKES_M_S2)
    return stops_m - AROUND_M <= away_m <= stops_m + SPARE_S * speed_m_s


def _find_first_conflict(
    context: Context, vehicle: VehicleState, climbs: tuple[Climb, ...], now_s: float
) -> tuple[Climb, float] | None:
    """Return the first climb that it would fly into, and how far ahead that begins."""
    board = vehicle.assignment.board
    if board is None:
        return None
    others = [climb for climb in climbs if climb.vehicle != vehicle.name]
    ahead = _predict_path(context, vehicle, board, now_s + LOOK_S) if others else None
    if ahead is None:
        return None
    away_m = ((climb, _conflict_distance_m(ahead, climb, context.setup.inspection.layer_m)) for climb in others)
    return min(((climb, far_m) for climb, far_m in away_m if far_m is not None), key=itemgetter(1), default=None)


def _conflict_distance_m(ahead: PathAhead, climb: Climb, spacing_m: float) -> float | None:
    """Return how far ahead a way comes near to a climb, in place and in time; None if it does not."""
    parts_m = np.stack((climb.places_m[:-1], climb.places_m[1:]), axis=1)
    near = place_distances_m(parts_m, ahead.places_m[:, :2]).min(axis=1) < spacing_m + AROUND_M
    from_s, to_s = climb.window_s(ahead.places_m[:, 2], spacing_m)
    meets = near & (ahead.soonest_s <= to_s) & (ahead.latest_s >= from_s)
    return float(ahead.along_m[int(meets.argmax())]) if meets.any() else None


def _predict_path(context: Context, vehicle: VehicleState, board: OnboardMission, until_s: float) -> PathAhead | None:
    """Return its way ahead until its landing, or where it is at a time at the soonest; None where it has none."""
    fix, setup = vehicle.motion.fix, context.setup
    if fix is None:
        return None
    climb_m_s = context.pricing.models[vehicle.name].performance.climb_m_s
    place = np.array([*fix.place_m, setup.up_m(vehicle.name, fix.alt_rel_m)])
    at_s, late_s, along_m = fix.at_s, fix.at_s, 0.0
    rows: list[FloatArray] = []
    ways = zip(board.path.waypoints, board.places_m, strict=True)
    for waypoint, to_m in list(ways)[vehicle.assignment.waypoint :]:
        if waypoint.phase is Phase.LAND or at_s > until_s:
            break
        end = np.array([*to_m, setup.up_m(vehicle.name, waypoint.alt_rel_m)])
        length_m, rise_m = math.dist(place[:2], end[:2]), abs(float(end[2] - place[2]))
        takes_s = max(length_m / max(waypoint.speed_m_s, SLOW_M_S), rise_m / climb_m_s)
        share = np.linspace(0.0, 1.0, max(2, math.ceil(takes_s / STEP_S) + 1))
        flown = place + share[:, None] * (end - place)
        times_s = np.column_stack((at_s + FASTER * takes_s * share, late_s + SLOWER * takes_s * share))
        rows.append(np.column_stack((flown, times_s, along_m + length_m * share)))
        stays_s = STOP_S + waypoint.hover_s
        at_s, late_s, along_m = at_s + FASTER * takes_s, late_s + SLOWER * takes_s + stays_s, along_m + length_m
        place = end
    if not rows:
        return None
    table = np.concatenate(rows)
    return PathAhead(table[:, :3], table[:, 3], table[:, 4], table[:, 5])


def _find_climbs(context: Context, state: FleetState, now_s: float) -> Iterator[Climb]:
    for vehicle in state.vehicles.values():
        if vehicle.stage in _UP and vehicle.armed and vehicle.motion.fix is not None:
            climb = _observe_climb(context, vehicle) or _expect_climb(context, vehicle, now_s)
            if climb is not None:
                yield climb


def _return_top_m(context: Context, vehicle: VehicleState) -> float:
    """Return the height of its return over the depot's ground."""
    return context.setup.up_m(vehicle.name, context.return_height_m(vehicle.name))


def _climb_rates_m_s(context: Context, vehicle: VehicleState) -> tuple[float, float]:
    climb_m_s = context.pricing.models[vehicle.name].performance.climb_m_s
    return RISES_SLOWER * climb_m_s, RISES_FASTER * climb_m_s


def _observe_climb(context: Context, vehicle: VehicleState) -> Climb | None:
    """Return the climb of a vehicle that says that it comes home, or is told to; it stops first, and then rises.

    Who sinks is in its landing, and who stands over its pad is about to be.
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
    if lands_now or up_m > top_m - RISES_M:
        return None
    here = np.array(fix.place_m)
    velocity = np.array(fix.velocity_m_s[:2])
    stops = here + velocity * (float(np.hypot(*velocity)) / (2.0 * BRAKES_M_S2))
    begins_s = (fix.at_s, fix.at_s if rises else fix.at_s + TURNS_S)
    places = np.array([here, stops])
    return Climb(vehicle.name, True, places, (up_m, up_m), top_m, begins_s, _climb_rates_m_s(context, vehicle))


def _expect_climb(context: Context, vehicle: VehicleState, now_s: float) -> Climb | None:
    """Return the climb that a silent vehicle's own failsafe begins, somewhere along its mission."""
    setup, heard_s, board = context.vehicles[vehicle.name], vehicle.link.heard_s, vehicle.assignment.board
    if setup.failsafe_s is None or not setup.returns or heard_s is None or board is None:
        return None
    if now_s - heard_s < context.limits.link_stale_s or not is_on_mission(context, vehicle) or vehicle.leg is None:
        return None
    begins_s = (heard_s + setup.failsafe_s - FAILSAFE_S, heard_s + setup.failsafe_s + FAILSAFE_S)
    ahead = None if now_s > begins_s[1] + CLIMBS_MOST_S else _predict_path(context, vehicle, board, begins_s[1])
    if ahead is None:
        return None
    there = (ahead.soonest_s <= begins_s[1]) & (ahead.latest_s >= begins_s[0])
    if not there.any():
        return None
    places_m = ahead.places_m[there]
    places_m = np.concatenate((places_m, places_m[-1:]))
    up_m = (float(places_m[:, 2].min()), float(places_m[:, 2].max()))
    waits_s = (begins_s[0], begins_s[1] + TURNS_S)
    rises_m_s = _climb_rates_m_s(context, vehicle)
    return Climb(vehicle.name, False, places_m[:, :2], up_m, _return_top_m(context, vehicle), waits_s, rises_m_s)


FRESH_S = 1.5
"""Two positions no older than this say how far two vehicles are apart."""
RISES_MOST_M = 15.0
"""More than anybody rises or sinks in that time."""


def record_separation(context: Context, state: FleetState, vehicle: VehicleState, now_s: float) -> FleetState:
    """Take note of how near two vehicles came to each other, after a position of one of them; reckoned ones say not."""
    fix = vehicle.motion.fix
    high = context.limits.airborne_m
    if fix is None or fix.alt_rel_m < high or not vehicle.armed or fix.reckoned:
        return state
    least_m = state.progress.separation_m
    # Every position is held against every vehicle: the height alone settles nearly all of them.
    reach_m = math.inf if least_m is None else least_m + RISES_MOST_M
    for other in state.vehicles.values():
        seen = other.motion.fix
        if seen is None or abs(seen.alt_msl_m - fix.alt_msl_m) > reach_m:
            continue
        if other.name == vehicle.name or seen.alt_rel_m < high or not other.armed or seen.reckoned:
            continue
        age_s = now_s - seen.at_s
        if age_s > FRESH_S:
            continue
        east_m_s, north_m_s, up_m_s = seen.velocity_m_s
        higher_m = seen.alt_msl_m + up_m_s * age_s - fix.alt_msl_m
        east_m = seen.place_m[0] + east_m_s * age_s - fix.place_m[0]
        north_m = seen.place_m[1] + north_m_s * age_s - fix.place_m[1]
        apart_m = math.hypot(east_m, north_m, higher_m)
        if least_m is None or apart_m < least_m:
            least_m = apart_m
    return state if least_m == state.progress.separation_m else state.with_progress(separation_m=least_m)
