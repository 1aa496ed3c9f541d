"""Decide when a vehicle that inspects from its layer can descend to inspection height, now or on a second pass.

A vehicle inspects from its layer where another vehicle's path was in the way. With each leg flown there is less of
these paths. As soon as a part of the line ahead of the vehicle is free, it gets a mission with the same visits and that
part at inspection height. Nothing depends on timing: until the new mission is on board, or if its upload fails, the
vehicle inspects from its layer.

A segment inspected from the layer counts. When the others have left, a vehicle that has done its part and is about to
return with enough battery inspects it again, lower. That is no re-plan: nothing is open, and any segment that becomes
open comes first. When all vehicles are down, one with enough battery may take off for it as for any other segment: on
the crew's include, or automatically where the site allows that.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterable, Iterator
from dataclasses import replace

from executor.core.context import Context
from executor.core.interface.commands import Say, Solve, Survivor
from executor.core.interface.events import NewRoute, SolveEnded
from executor.core.lines import replanning
from executor.core.replanning import replan_cycle, replan_separation, survivors
from executor.core.replanning.replan_cycle import format_segments
from executor.core.replanning.survivors import limit_to_hours
from executor.core.state.fleet_state import FleetState, Replan, Stepped
from executor.core.state.vehicle_state import Stage, VehicleState
from missions import estimate
from missions.inspection_height import must_leave_layer, visit_distances_m
from planner import is_reversed, segment_of, visit_of

EVALUATION_S = 1.0
VEHICLES_AT_ONCE, PAIRS_AT_ONCE = 3, 24
"""Vehicles evaluated at once, fewer in a large fleet, as each is checked against all others."""
LARGEST_LOSS = 0.05
"""Largest frame loss for an optional mission; its upload should not break off."""
_DOWN = frozenset({Stage.GROUND, Stage.LANDED, Stage.DOWN, Stage.LOST})
LARGEST_PASS = 5
"""Most segments in one second pass; others follow later."""
SPARE_PCT = 5.0
"""Battery kept beside the reserve, as a second pass is optional."""


def lower_one_vehicle(context: Context, state: FleetState, now_s: float) -> Stepped:
    """Assign a vehicle a mission closer to the line, if the airspace for one is free."""
    known, flies = state.replanning, state.progress.is_under_way and not state.progress.finished
    busy = known.is_changing or known.orphans_since_s is not None or state.listening.silent_since_s is not None
    if not replan_separation.may_leave_layers(context) or busy or not flies or now_s < known.wait_until_s:
        return state, ()
    looked = now_s < known.closer_s + EVALUATION_S and not is_fleet_down(state)
    if looked or replan_separation.is_line_occupied(context, state, now_s):
        return state, ()
    state = replace(state, replanning=replace(known, closer_s=now_s))
    most = max(1, min(VEHICLES_AT_ONCE, PAIRS_AT_ONCE // len(state.vehicles)))
    for offer in itertools.islice(_find_candidates(context, state, now_s), most):
        found = _lower_ahead(context, state, offer, now_s) or _reinspect(context, state, offer, now_s)
        if found is not None:
            return found
    return state, ()


def is_clearance_awaited(context: Context, state: FleetState, now_s: float) -> bool:
    """Return whether a vehicle was just cleared for a second pass, and others may be within a moment."""
    over = state.progress.recalled or now_s >= state.replanning.wait_until_s
    if over or not replan_separation.may_leave_layers(context):
        return False
    return any(
        vehicle.orders.cleared_s is not None and find_distant_segments(context, state, vehicle)
        for vehicle in state.vehicles.values()
        if survivors.build_survivor(context, state, vehicle, now_s) is not None
    )


def _find_candidates(context: Context, state: FleetState, now_s: float) -> Iterator[Survivor]:
    """Yield candidates for a lower mission or a second pass; the first one rotates every second."""
    names = list(state.vehicles)
    stays, first = replan_separation.find_layer_bound_vehicles(context.vehicles), int(now_s) % len(names)
    for name in (*names[first:], *names[:first]):
        vehicle = state.vehicles[name]
        lost = vehicle.link.quality.lost
        if vehicle.assignment.board is None or (lost is not None and lost > LARGEST_LOSS):
            continue
        ahead = () if name in stays else map(segment_of, vehicle.remaining_visits())
        lower = any(must_leave_layer(context.setup, name, segment) for segment in ahead)
        if not lower and not find_distant_segments(context, state, vehicle):
            continue
        offer = survivors.build_survivor(context, state, vehicle, now_s)
        if offer is None or not (offer.airborne or (context.day is None and is_fleet_down(state))):
            continue
        not_low = {segment_of(visit) for visit in offer.tail} - replan_separation.find_low_tail_segments(vehicle, offer)
        lower = name not in stays and any(must_leave_layer(context.setup, name, segment) for segment in not_low)
        if lower or has_done_its_part(state, vehicle, offer):
            yield limit_to_hours(context, state, offer, now_s)


def _lower_ahead(context: Context, state: FleetState, offer: Survivor, now_s: float) -> Stepped | None:
    """Return the step by which a vehicle descends for more of its remaining visits; None if it cannot."""
    vehicle = state.vehicles[offer.vehicle]
    before = replan_separation.find_low_tail_segments(vehicle, offer)
    if not offer.tail:
        return None
    plan = _build_plan(context, state, offer, offer.tail, now_s)
    low = _choose_low(context, state, plan, now_s)
    if not low > before or not _can_afford(context, vehicle, plan, low):
        return None
    said = replanning.LOWER.say(vehicle=offer.vehicle, segments=format_segments(context, low - before))
    return _assign_plan(context, state, plan, said, now_s)


def _reinspect(context: Context, state: FleetState, offer: Survivor, now_s: float) -> Stepped | None:
    """Return the step by which a vehicle that has done its part inspects more at the inspection height."""
    plan = plan_reinspection(context, state, offer, now_s)
    if plan is None:
        return None
    names = format_segments(context, frozenset(map(segment_of, plan.solve.given)) - set(map(segment_of, offer.tail)))
    line = replanning.AGAIN_ALOFT if offer.airborne else replanning.AGAIN_FROM_PAD
    return _assign_plan(context, state, plan, line.say(vehicle=offer.vehicle, segments=names), now_s)


def plan_reinspection(context: Context, state: FleetState, offer: Survivor, now_s: float) -> Replan | None:
    """Return the plan of a second pass of a vehicle that has done its part; None if there is none."""
    name, vehicle = offer.vehicle, state.vehicles[offer.vehicle]
    again = find_distant_segments(context, state, vehicle)
    if not again or not has_done_its_part(state, vehicle, offer):
        return None
    [kept] = replan_separation.close_occupied_segments(context, state, [offer], again, now_s)
    begin_m = offer.start_m
    if offer.tail:
        last = offer.tail[-1]
        begin_m = tuple(context.setup.tracks_m[segment_of(last)][0 if is_reversed(last) else 1].tolist())
    more = build_nearest_visits(context, begin_m, again - set(kept.barred))
    while more:
        plan = _build_plan(context, state, offer, (*offer.tail, *more), now_s)
        low = _choose_low(context, state, plan, now_s)
        stay = tuple(
            one for one in more if segment_of(one) in low or not must_leave_layer(context.setup, name, segment_of(one))
        )
        if stay != more:
            more = stay  # without one segment others may become possible, or no longer be
        elif _can_afford(context, vehicle, plan, low, SPARE_PCT):
            return plan
        else:
            more = more[:-1]
    return None


def _build_plan(context: Context, state: FleetState, offer: Survivor, visits: tuple[int, ...], now_s: float) -> Replan:
    [offer] = replan_separation.close_occupied_segments(context, state, [offer], map(segment_of, visits), now_s)
    revision = state.replanning.revision + 1
    solve = Solve(revision, tuple(sorted(map(segment_of, visits))), (offer,), "", given=visits)
    return Replan(solve, now_s, closer=True)


def _choose_low(context: Context, state: FleetState, plan: Replan, now_s: float) -> frozenset[int]:
    [offer] = plan.solve.survivors
    return replan_separation.choose_low_segments(context, state, plan, {offer.vehicle: plan.solve.given}, now_s)[
        offer.vehicle
    ]


def _assign_plan(context: Context, state: FleetState, plan: Replan, said: Say, now_s: float) -> Stepped:
    [offer], revision = plan.solve.survivors, plan.solve.revision
    plan = replace(plan, solve=replace(plan.solve, trigger=said.text))
    state = state.with_replanning(revision=revision, replan=plan)
    answer = SolveEnded(revision, (NewRoute(offer.vehicle, plan.solve.given),), (), 0.0, "")
    state, commands = replan_cycle.apply_solution(context, state, answer, now_s)
    return state, (said, *commands)


def _can_afford(
    context: Context, vehicle: VehicleState, plan: Replan, low: frozenset[int], spare_pct: float = 0.0
) -> bool:
    """Return whether the rest of a vehicle's budget covers the lower mission and the return."""
    [offer] = plan.solve.survivors
    setup, kept = replan_separation.build_closed_setup(context, (offer,)), offer.kept if offer.airborne else 0
    path = replan_separation.build_new_path(setup, vehicle, offer, plan.solve.given, low)
    if kept:  # from its position
        lat_deg, lon_deg = setup.frame.to_wgs84_deg(*offer.start_m)
        begin = replace(path.waypoints[kept - 1], lat_deg=lat_deg, lon_deg=lon_deg)
        path, kept = replace(path, waypoints=(begin, *path.waypoints[kept:])), 1
    legs = estimate(path, context.pricing.models[vehicle.name]).legs[kept:]
    phases = (point.phase for point in path.waypoints[kept:])
    needs_pct = sum(offer.pace.factor_of(phase) * leg.energy_pct for phase, leg in zip(phases, legs, strict=True))
    return offer.consumption * needs_pct + spare_pct <= offer.budget_pct


def has_done_its_part(state: FleetState, vehicle: VehicleState, offer: Survivor) -> bool:
    """Return whether all segments a vehicle would get again are inspected, and no sortie is planned for it."""
    return not vehicle.turn.ahead and all(segment_of(visit) in state.coverage.inspected for visit in offer.tail)


def is_fleet_down(state: FleetState) -> bool:
    """Return whether no vehicle is in the air or about to be, lost ones aside."""
    return all(vehicle.stage in _DOWN for vehicle in state.vehicles.values())


def find_distant_segments(context: Context, state: FleetState, vehicle: VehicleState) -> frozenset[int]:
    """Return the segments inspected from too far that a vehicle may be assigned once more.

    Without those on any mission, and those it was assigned before: they were not proven then, and may not be again.
    """
    coverage, asked_m = state.coverage, context.setup.inspection.height_m
    found = {segment for segment in coverage.inspected if coverage.is_nearer_than_counted(segment, asked_m)}
    if not found:
        return frozenset()
    for other in state.mission_vehicles():
        found -= {segment_of(visit) for visit in other.remaining_visits()}
    return frozenset(
        found - _find_tried_segments(context, state, vehicle) - survivors.find_barred_segments(context, state, vehicle)
    )


def _find_tried_segments(context: Context, state: FleetState, vehicle: VehicleState) -> set[int]:
    """Return the segments that the mission on board already visits from closer than they count."""
    board = vehicle.assignment.board
    if board is None:
        return set()
    at_m = visit_distances_m(context.setup, board.path, board.visits)
    segments = map(segment_of, board.visits)
    return {
        segment
        for segment, here_m in zip(segments, at_m, strict=True)
        if state.coverage.is_nearer_than_counted(segment, here_m)
    }


def build_nearest_visits(context: Context, begin_m: tuple[float, float], segments: Iterable[int]) -> tuple[int, ...]:
    """Return visits of the nearest segments, each time the nearest end of the nearest one.

    A segment locked to one direction is visited in that direction.
    """
    directions = context.pricing.directions
    left, here_m = set(segments), begin_m
    visits: list[int] = []
    while left and len(visits) < LARGEST_PASS:
        _, segment, backwards = min(
            (math.dist(here_m, end), segment, backwards)
            for segment in left
            for backwards, end in enumerate(context.setup.tracks_m[segment].tolist())
            if directions.get(segment, bool(backwards)) == bool(backwards)
        )
        visits.append(visit_of(segment, bool(backwards)))
        here_m = tuple(context.setup.tracks_m[segment][1 - backwards].tolist())
        left.remove(segment)
    return tuple(visits)
