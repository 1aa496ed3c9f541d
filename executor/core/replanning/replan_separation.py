"""Keep a re-plan's new flights separated from every path others may still fly, where vehicles leave their layers.

These paths are known: the rest of the missions on board, and the new ones. A re-plan keeps its new flights out of the
airspace in which another vehicle descends to the line, and lets a vehicle descend only where no other may be. Until a
lost vehicle must have left the line by its failsafe, or a returning one is seen in its layer, no vehicle gets a new
mission. A new mission that crosses the present one of a vehicle above waits until that vehicle has its own new one.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace

import numpy as np

from executor.core.context import Context, VehicleSetup
from executor.core.inflight.homing import is_on_mission
from executor.core.interface.commands import Survivor
from executor.core.replanning import survivors
from executor.core.state.fleet_state import FleetState, Replan
from executor.core.state.vehicle_state import Stage, VehicleState
from missions import FlightModel, FlightPath, FlightSetup, build_flight_path, continue_path, estimate
from missions.autopilots.dialect import is_home_mode
from missions.geometry import place_distances_m
from missions.inspection_height import (
    Airway,
    build_airway,
    build_wall_obstacles,
    check_inspection_airspace,
    find_low_segments,
    find_near_tracks,
    find_tracks_near_returns,
    select_low_segments,
)
from missions.pads import column_radius_m
from planner import segment_of

LAYER_MARGIN_M = 2.0
"""Distance below its layer within which a vehicle counts as in it."""
RTL_STOP_S = 5.0
"""Stop at the start of an RTL."""
DOWN_FACTOR, DOWN_MARGIN_S = 1.5, 60.0
"""Factor and margin on the remaining flight time after which a silent vehicle counts as down."""
CLIMB_TIMEOUT_S = 60.0
"""Time from the start of RTL after which a vehicle not seen in its layer may be anywhere on its path."""
ROUNDING_M = 0.05
"""Rounding margin by which new paths may come closer to others' parts of the line than at their selection."""

Routes = Mapping[str, tuple[int, ...]]
_ON_MISSION = frozenset({Stage.STARTING, Stage.FLYING})


def may_leave_layers(context: Context) -> bool:
    """Return whether vehicles leave their layers to inspect."""
    return context.setup.inspection.same_distance


def find_layer_bound_vehicles(vehicles: Mapping[str, VehicleSetup]) -> frozenset[str]:
    """Return the vehicles without a returning failsafe: once lost, they are not certain to have left the line."""
    return frozenset(name for name, vehicle in vehicles.items() if not vehicle.returns)


def is_line_occupied(context: Context, state: FleetState, now_s: float) -> bool:
    """Return whether a vehicle that has left its mission may still be on the line or climbing from it."""
    if not may_leave_layers(context):
        return False
    return any(_is_leaving_line(context, vehicle, now_s) for vehicle in state.vehicles.values())


def line_clear_time_s(setup: FlightSetup, model: FlightModel, name: str) -> float:
    """Return the time a vehicle takes from its stop on the line, or at a viewpoint, up to its layer."""
    return RTL_STOP_S + (setup.looks.deepest_m + setup.layers.offset_m(name)) / model.performance.climb_m_s


def _is_leaving_line(context: Context, vehicle: VehicleState, now_s: float) -> bool:
    if vehicle.stage not in {Stage.LOST, Stage.RETURNING}:
        return False
    since_s = vehicle.sortie.left_s or 0.0
    if vehicle.fault is not None:
        since_s = max(since_s, vehicle.fault.detected_s)
    rises_s = line_clear_time_s(context.setup, context.pricing.models[vehicle.name], vehicle.name)
    if now_s - since_s >= (rises_s if vehicle.stage is Stage.LOST else CLIMB_TIMEOUT_S):
        return False
    left = _find_remaining_airway(context, vehicle)
    if left is None or not left.has_wall.any():
        return False
    return vehicle.stage is Stage.LOST or is_on_mission(context, vehicle) or not _is_in_its_layer(context, vehicle)


def _has_left_mission(context: Context, vehicle: VehicleState) -> bool:
    """Return whether a vehicle has left its mission to return; one still on it has not received the command."""
    return vehicle.stage is Stage.LOST or (vehicle.stage is Stage.RETURNING and not is_on_mission(context, vehicle))


def _is_down_by_now(context: Context, vehicle: VehicleState, now_s: float) -> bool:
    """Return whether a silent vehicle must have landed, by its failsafe or at the end of its mission."""
    board, fault, fix = vehicle.assignment.board, vehicle.fault, vehicle.motion.fix
    lost = vehicle.stage is Stage.LOST and context.vehicles[vehicle.name].returns
    if not lost or board is None or fault is None or fix is None:
        return False
    pad, model = context.setup.pad_of(vehicle.name), context.pricing.models[vehicle.name]
    away_m, up_m = math.dist(fix.place_m, (pad.east_m, pad.north_m)), context.return_height_m(vehicle.name)
    home_s = sum(model.performance.return_s(away_m, up_m, up_m))
    rest_s = sum(leg.duration_s for leg in board.legs[vehicle.assignment.waypoint :])
    if vehicle.assignment.sent_path is not None:
        legs = estimate(vehicle.assignment.sent_path, model).legs
        rest_s = max(rest_s, sum(leg.duration_s for leg in legs[vehicle.assignment.waypoint :]))
    return now_s - fault.detected_s >= DOWN_FACTOR * max(home_s, rest_s) + DOWN_MARGIN_S


def _is_in_its_layer(context: Context, vehicle: VehicleState) -> bool:
    fix = vehicle.motion.fix
    if fix is None:
        return False
    layer_m = context.setup.layers.height_m(vehicle.name, *fix.place_m)
    return context.setup.up_m(vehicle.name, fix.alt_rel_m) >= layer_m - LAYER_MARGIN_M


def _find_return_airway(context: Context, vehicle: VehicleState, now_s: float) -> Airway | None:
    """Return the straight return path of a vehicle seen flying it; None if that is not certain."""
    beat, fix, setup = vehicle.telemetry.heartbeat, vehicle.motion.fix, context.setup
    if vehicle.stage is not Stage.RETURNING or beat is None or fix is None or not _is_in_its_layer(context, vehicle):
        return None
    returns = is_home_mode(context.vehicles[vehicle.name].dialect, beat.custom_mode)
    if not returns or vehicle.link.stale or now_s - fix.at_s >= context.limits.link_stale_s:
        return None
    pad = setup.pad_of(vehicle.name)
    ends_m = [(*fix.place_m, setup.up_m(vehicle.name, fix.alt_rel_m))]
    ends_m.append((pad.east_m, pad.north_m, setup.layers.height_m(vehicle.name, pad.east_m, pad.north_m)))
    return Airway(vehicle.name, np.array([ends_m]), np.zeros((1, 2)))


def _find_remaining_airway(context: Context, vehicle: VehicleState) -> Airway | None:
    """Return the path ahead on the missions a vehicle has, or may have, on board; None for one on the ground."""
    board, sent_path = vehicle.assignment.board, vehicle.assignment.sent_path
    if board is None or vehicle.is_at_rest:
        return None
    left = _build_airway_ahead(context, vehicle, board.path)
    return left if sent_path is None else _join_airways(left, _build_airway_ahead(context, vehicle, sent_path))


def _build_airway_ahead(context: Context, vehicle: VehicleState, path: FlightPath) -> Airway:
    """Return the rest of a path, with the leg that leads a vehicle off it back to it."""
    left, fix = build_airway(context.setup, path, vehicle.assignment.waypoint), vehicle.motion.fix
    flies = vehicle.stage in _ON_MISSION or vehicle.stage is Stage.LOST
    if fix is None or not flies or not len(left.legs_m):
        return left
    if place_distances_m(left.over_ground_m[:1], np.array([fix.place_m]))[0, 0] <= survivors.BESIDE_M:
        return left
    here_m = np.array([*fix.place_m, context.setup.up_m(vehicle.name, fix.alt_rel_m)])
    below_m = 0.0 if _is_in_its_layer(context, vehicle) else context.setup.layers.offset_m(vehicle.name)
    leg_m = np.array([[here_m, left.legs_m[0, 1]]])
    return _join_airways(left, Airway(vehicle.name, leg_m, np.array([[below_m, left.below_m[0, 1]]])))


def find_occupied_airways(
    context: Context, state: FleetState, offers: Iterable[Survivor], now_s: float
) -> list[Airway]:
    """Return the paths that a re-plan cannot change: of vehicles outside it, and what survivors finish first."""
    kept = {offer.vehicle: offer for offer in offers}
    found = []
    for vehicle in state.vehicles.values():
        left, board = _find_remaining_airway(context, vehicle), vehicle.assignment.board
        if left is None or board is None:
            continue
        offer = kept.get(vehicle.name)
        if offer is not None and vehicle.fault is None and vehicle.stage in _ON_MISSION:
            if offer.airborne:
                # A survivor that turns around while returning ends its present leg: a climb from the line to its end.
                waypoint = vehicle.assignment.waypoint
                begun = FlightPath(vehicle.name, board.path.waypoints[: max(offer.kept, waypoint + 1)])
                found.append(_build_airway_ahead(context, vehicle, begun))
        elif _is_down_by_now(context, vehicle, now_s):
            continue
        elif _has_left_mission(context, vehicle) and not _is_leaving_line(context, vehicle, now_s):
            # It returns in its layer, from an unknown position.
            home = _find_return_airway(context, vehicle, now_s)
            found.append(left.to_layer() if home is None else home)
        else:
            found.append(left)
    return found


def close_occupied_segments(
    context: Context, state: FleetState, offers: Sequence[Survivor], segments: Iterable[int], now_s: float
) -> tuple[Survivor, ...]:
    """Return offers with the segments barred by others' paths, and the obstacles to fly around."""
    if not may_leave_layers(context):
        return tuple(offers)
    taken = find_occupied_airways(context, state, offers, now_s)
    wanted = sorted(set(segments))
    return tuple(_close_for_offer(context.setup, offer, taken, wanted) for offer in offers)


def _close_for_offer(setup: FlightSetup, offer: Survivor, taken: Sequence[Airway], segments: Sequence[int]) -> Survivor:
    walls = build_wall_obstacles(setup, offer.vehicle, taken)
    if not walls:
        return offer
    lines_m = np.array([(wall.rings_m[0][0], wall.rings_m[0][-1]) for wall in walls])
    keep_m = column_radius_m(setup.inspection.layer_m) - ROUNDING_M
    tracks_m = setup.tracks_m[list(segments)]
    closed = find_near_tracks(tracks_m, lines_m, keep_m)
    if setup.layers.returns_in_layers:
        pad = setup.pad_of(offer.vehicle)
        pad_m = np.array([pad.east_m, pad.north_m])
        closed |= np.array(
            [find_tracks_near_returns(lines_m, track[np.newaxis], pad_m, keep_m).any() for track in tracks_m]
        )
    shut = {segment for segment, is_closed in zip(segments, closed.tolist(), strict=True) if is_closed}
    return replace(
        offer,
        barred=tuple(sorted({*offer.barred, *shut})),
        closed=tuple(replace(wall, keep_m=keep_m) for wall in walls),
    )


def build_closed_setup(context: Context, offers: Iterable[Survivor]) -> FlightSetup:
    """Return the flight setup for new missions, with each survivor's closed airspace."""
    closed = {offer.vehicle: offer.closed for offer in offers if offer.closed}
    return replace(context.setup, closed=closed) if closed else context.setup


def choose_low_segments(
    context: Context, state: FleetState, plan: Replan, routes: Routes, now_s: float
) -> dict[str, frozenset[int]]:
    """Return the segments of its new route that each survivor inspects below its layer."""
    setup, offers = build_closed_setup(context, plan.solve.survivors), plan.solve.survivors
    taken = find_occupied_airways(context, state, offers, now_s)
    begins_m: dict[str, tuple[float, float]] = {}
    for offer in offers:
        vehicle = state.vehicles[offer.vehicle]
        board, path = vehicle.assignment.board, build_new_path(setup, vehicle, offer, routes[offer.vehicle])
        if board is not None and offer.airborne:
            # The tail may be flown until the new mission is on board; uploads to vehicles below wait for that.
            tail = build_airway(setup, board.path, max(offer.kept, vehicle.assignment.waypoint))
            taken.append(replace(tail, for_now=True))
            if board.path.waypoints[offer.kept - 1].below_m > 0:
                begins_m[offer.vehicle] = board.places_m[offer.kept - 1]
            taken.append(_add_turning_legs(setup, vehicle, offer.kept, build_airway(setup, path, offer.kept)))
        else:
            taken.append(build_airway(setup, path))
    return select_low_segments(setup, routes, taken, find_layer_bound_vehicles(context.vehicles), begins_m)


def build_new_path(
    setup: FlightSetup,
    vehicle: VehicleState,
    offer: Survivor,
    visits: tuple[int, ...],
    low: frozenset[int] = frozenset(),
) -> FlightPath:
    """Return a survivor's whole new path; its new part is in the layer, except for the segments of `low`."""
    board = vehicle.assignment.board
    if not offer.airborne or board is None:
        return build_flight_path(setup, vehicle.name, visits, low)
    return continue_path(setup, board.path, offer.kept, visits, low, offer.start_m)


def _add_turning_legs(setup: FlightSetup, vehicle: VehicleState, kept: int, new: Airway) -> Airway:
    """Return new legs with the direct legs to them from any point of a return path that they cut short.

    The points are no farther apart than a layer, so that the gaps between the legs hold no other vehicle's airspace.
    """
    board, fix, waypoint = vehicle.assignment.board, vehicle.motion.fix, vehicle.assignment.waypoint
    if board is None or fix is None or waypoint != kept or not len(new.legs_m):
        return new
    here_m = np.array([*fix.place_m, setup.up_m(vehicle.name, fix.alt_rel_m)])
    home_m = build_airway(setup, board.path, waypoint).legs_m[0, 1] - here_m
    spread = math.ceil(float(np.linalg.norm(home_m)) / setup.inspection.layer_m) + 1
    begins_m = here_m + np.linspace(0.0, 1.0, spread)[:, np.newaxis] * home_m
    turns_m = np.stack((begins_m, np.broadcast_to(new.legs_m[0, 1], begins_m.shape)), axis=1)
    return _join_airways(new, Airway(vehicle.name, turns_m, np.zeros((spread, 2))))


def _join_airways(one: Airway, other: Airway) -> Airway:
    legs_m, below_m = np.concatenate((one.legs_m, other.legs_m)), np.concatenate((one.below_m, other.below_m))
    return replace(one, legs_m=legs_m, below_m=below_m)


def find_low_tail_segments(vehicle: VehicleState, offer: Survivor) -> frozenset[int]:
    """Return the segments of a survivor's tail that the mission on board inspects below its layer."""
    board = vehicle.assignment.board
    if board is None or not offer.airborne:
        return frozenset()
    return find_low_segments(board.path, board.visits) & {segment_of(visit) for visit in offer.tail}


def find_mission_conflicts(
    context: Context, state: FleetState, plan: Replan, name: str, path: FlightPath, now_s: float
) -> tuple[frozenset[str], list[str]]:
    """Return the vehicles for whose new missions this one has to wait, and in words the conflicts that rule it out."""
    offers = plan.solve.survivors
    offer = next((offer for offer in offers if offer.vehicle == name), None)
    new = build_airway(context.setup, path, 0 if offer is None else offer.kept)
    if offer is not None and offer.airborne:
        new = _add_turning_legs(context.setup, state.vehicles[name], offer.kept, new)
    waits, order = set(), context.setup.layers.vehicles
    for other in plan.pending - {name}:
        left = _find_remaining_airway(context, state.vehicles[other])
        above = order.index(other) > order.index(name)
        if left is not None and above and check_inspection_airspace(context.setup, [new, left]):
            waits.add(other)
    others = [one for one in find_occupied_airways(context, state, offers, now_s) if one.vehicle != name]
    gone = [_find_remaining_airway(context, state.vehicles[other]) for other in (*plan.failed, *plan.let_go)]
    others += [one for one in gone if one is not None and one.vehicle != name]
    return frozenset(waits), [line for one in others for line in check_inspection_airspace(context.setup, [new, one])]
