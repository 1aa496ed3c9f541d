"""A time in which a vehicle, or nobody, was heard, or nobody listened: what was flown meanwhile, and how long one can.

The ground's own radio ends no flight. While nobody at all is heard nothing is held against anybody, until the battery
of each would be empty; a vehicle whose link is regained is taken up where it is, with what it flew.

A segment that was seen counts by its positions. Of one that nobody saw there is this evidence: the vehicle's own clock
ran on; it was on the mission that we know before and after; it is now where that mission leads in just that time; and
no segment can have been flown too fast without making it early. Then the segment counts, and is marked as inferred.
Anything that does not fit makes the whole time worth nothing, and the segments are flown again. It is one rule for a
gap in one vehicle's positions, for a silence of all, and for a flight that is taken up again.
"""

from __future__ import annotations

import math
from collections.abc import Collection
from dataclasses import dataclass, replace

import numpy as np

from executor.core.context import Context, Scene
from executor.core.imaging import asset_status
from executor.core.inflight.homing import is_on_mission
from executor.core.lines import inspection, resume
from executor.core.replanning.replan_cycle import format_segments
from executor.core.state.fleet_state import FleetState, Stepped
from executor.core.state.inspection_proof import GAP_S, NOISE_M, SPEED_FACTOR, InspectionRun, PositionSample, join_run
from executor.core.state.legs import remaining_leg_share
from executor.core.state.vehicle_parts import LastKnown, ModeCause, OnboardMission, PositionFix
from executor.core.state.vehicle_state import VehicleState, last_known_of
from missions import Pace, Phase
from missions.autopilots.dialect import is_home_mode, is_manual_mode, is_mission_mode
from missions.geometry import locate_on_leg
from planner import segment_of

CATCH_UP_S = 5.0
"""So long a vehicle whose link is regained has to say where it is, in which mode, on which item."""
ENDURES = 1.5
"""Nobody flies longer than this many times what the energy model makes of its battery."""
INDEX_S = 1.0
"""Between two reports of the index."""
ENERGY_TOLERANCE = 0.15
"""How far a landed vehicle's use may be from what its mission should have cost: take-off and descent are estimates."""
ENERGY_TOLERANCE_PCT = 2.0
"""Two reports, each rounded, and the level flight to the pad."""


def record_blackout(context: Scene, state: FleetState, now_s: float) -> Stepped:  # noqa: ARG001
    """Keep where all vehicles were when all links were lost: a run with such a gap proves nothing."""
    since_s = state.listening.silent_since_s
    if since_s is None or now_s - since_s < GAP_S:
        return state, ()
    for vehicle in state.vehicles.values():
        before = vehicle.assignment.before or last_known_of(vehicle, since_s)
        if before is not vehicle.assignment.before:
            state = state.put(vehicle.with_assignment(before=before, run=None))
    return state, ()


def max_remaining_flight_s(context: Scene, vehicle: VehicleState) -> float:
    """Return how long a vehicle can fly at most from when it was heard last."""
    percent = vehicle.power.battery.remaining_pct
    return ENDURES * (100.0 if percent is None else percent) / min(context.draws_pct_s)


def may_be_airborne(context: Scene, vehicle: VehicleState, now_s: float) -> bool:
    """Return whether a vehicle that is not heard may still be in the air."""
    return vehicle.link.spoke_s is not None and now_s - vehicle.link.spoke_s < max_remaining_flight_s(context, vehicle)


def recover_after_silence(context: Context, state: FleetState, vehicle: VehicleState, now_s: float) -> Stepped | None:
    """Take up a vehicle whose link, or position, is regained; None as long as it has not said enough."""
    before, board, fix = vehicle.assignment.before, vehicle.assignment.board, vehicle.motion.fix
    if before is None:
        return state, ()
    since_s = before.until_s
    asked = math.isinf(since_s)  # after a restart it was asked already
    if asked or fix is None or vehicle.link.heartbeat_s is None or board is None:
        return state.put(vehicle.with_assignment(before=None)), ()
    again_s = since_s if vehicle.link.regained_s is None else max(since_s, vehicle.link.regained_s)
    if vehicle.link.stale or (again_s <= since_s and fix.at_s <= since_s):
        return None
    said = fix.at_s > since_s and vehicle.link.heartbeat_s > since_s
    item = vehicle.telemetry.item_s is not None and vehicle.telemetry.item_s > since_s
    given = vehicle.assignment.pending is not None or vehicle.assignment.stubborn
    if given:  # what it carries now is known when that is over
        return state.put(_close_gap(vehicle, board)), ()
    if said and (item or not vehicle.armed or not is_on_mission(context, vehicle)):
        return catch_up_mission(context, state, vehicle, board, None)
    if now_s - again_s < CATCH_UP_S:
        return None
    return state.put(_close_gap(vehicle, board)), ()


def catch_up_mission(
    context: Context, state: FleetState, vehicle: VehicleState, board: OnboardMission, seq: int | None
) -> Stepped:
    """Take a vehicle on its mission for where it is now, with what it flew on its way there since `before`.

    It carries `board`, and flies to the item `seq`; None where its state has that.
    """
    waypoint = vehicle.assignment.waypoint
    if seq is not None and 0 <= seq < len(board.waypoint_of):
        waypoint = board.waypoint_of[seq] or waypoint
    found = infer_coverage(context, vehicle, board, waypoint)
    # What it began meanwhile at the first pylon, and was seen to begin, needs no evidence.
    joins = None if vehicle.assignment.run is not None else found.joins
    proven = {board.tracks[joins].segment} if joins is not None else set()
    vehicle = _close_gap(vehicle, board, {*found.segments, *proven}, told=bool(found.why_not))
    known = replace(vehicle.assignment, waypoint=waypoint)
    vehicle = replace(
        vehicle, assignment=known if joins is None else replace(known, run=found.run, run_visit=joins)
    ).with_sortie(took_off=vehicle.sortie.took_off or not vehicle.armed)
    state = state.put(vehicle)
    new = [segment for segment in found.segments if segment not in state.coverage.inspected]
    heard_s = vehicle.link.heard_s or 0.0
    state = asset_status.record_flown_segments(
        context, state, vehicle.name, [(segment, None) for segment in new], heard_s
    )
    inferred = state.coverage.inferred | {*new, *proven}
    state = state.with_coverage(inferred=inferred)
    if found.why_not:
        return state, (resume.NOT_COUNTED.say(vehicle=vehicle.name, why=found.why_not),)
    if not new:
        return state, ()
    names = format_segments(context, tuple(new))
    return state, (resume.INFERRED.say(vehicle=vehicle.name, segments=names),)


def _close_gap(
    vehicle: VehicleState, board: OnboardMission, counted: Collection[int] = (), *, told: bool = False
) -> VehicleState:
    """Return a vehicle whose gap is judged: the inspection that it broke is over, unless it is `counted` all the same.

    Why the others do not count may be `told` already.
    """
    known, before, fix = vehicle.assignment, vehicle.assignment.before, vehicle.motion.fix
    vehicle = vehicle.with_assignment(before=None)
    if before is None or before.run is None or before.run_visit is None or fix is None:
        return vehicle
    segment = board.tracks[before.run_visit].segment
    if segment in counted:
        return vehicle
    why = inspection.NO_POSITION.format(gap_s=fix.boot_s - before.fix.boot_s)
    owed = known.owed if told else (before.run_visit, why)
    return vehicle.with_assignment(runs_broken=(*known.runs_broken, (segment, why)), owed=owed)


@dataclass(frozen=True, slots=True)
class InferredCoverage:
    """What is taken to have been flown."""

    segments: tuple[int, ...] = ()
    """From end to end, in their order."""
    joins: int | None = None
    """The visit under way now, if its beginning is taken to have been flown as well."""
    run: InspectionRun | None = None
    """That visit's run."""
    why_not: str = ""
    """What does not fit, in words; empty if everything does."""


def infer_coverage(context: Context, state: VehicleState, board: OnboardMission, waypoint: int) -> InferredCoverage:
    """Return what a vehicle inspected between the last position before the silence and its newest one.

    Its link is regained, it was found to carry `board`, and is on the leg to a waypoint of that.
    """
    before, fix = state.assignment.before, state.motion.fix
    if before is None or fix is None or before.waypoint >= len(board.legs):
        return InferredCoverage()
    waits = not state.armed and state.orders.start_owed_s is not None  # it was not told to start yet
    ahead = board.path.waypoints[before.waypoint + 1 : (waypoint if state.armed else len(board.legs)) + 1]
    if waits or (before.run is None and not any(point.phase is Phase.INSPECT for point in ahead)):
        return InferredCoverage()
    if not context.infers:
        return InferredCoverage(why_not=resume.ASKS_FOR_PROOF)
    if fix.boot_s <= before.fix.boot_s:
        return InferredCoverage(why_not=resume.CLOCK_RESET)
    if before.fix.reckoned or fix.reckoned:
        return InferredCoverage(why_not=resume.DEAD_RECKONED)
    if not state.armed:
        return _infer_after_landing(context, state, before, fix, board)
    if why_not := _describe_deviation(context, state, before, fix, board, waypoint):
        return InferredCoverage(why_not=why_not)
    return _infer_in_flight(context, before, fix, board, waypoint, state.assignment.pace)


def _infer_in_flight(
    context: Context, before: LastKnown, fix: PositionFix, board: OnboardMission, waypoint: int, pace: Pace
) -> InferredCoverage:  # fmt: skip
    """Look at a vehicle in the air that is where its mission leads: whether it took the time for it."""
    elapsed_s = fix.boot_s - before.fix.boot_s
    visits = _select_passed_visits(before, board, waypoint)
    point, unbegun = board.path.waypoints[waypoint], waypoint == before.waypoint and before.run is None
    joins = None if point.phase is not Phase.INSPECT or unbegun else point.visit
    if not visits and joins is None:
        return InferredCoverage()
    expected_s = _estimate_rest(board, before.waypoint, before.fix, pace)[0]
    expected_s -= _estimate_rest(board, waypoint, fix, pace)[0]
    tolerance_s = _tolerance_s(context, board, (*visits, *(() if joins is None else (joins,))))
    early_s = tolerance_s
    if waypoint == before.waypoint:
        # A part of one segment between two known places: how fast it was flown is known as well, as it is by positions.
        # Its share of the segment's time is no measure: that has the hold in it, and the ramps at both ends.
        between_m = math.dist(before.fix.place_m, fix.place_m)
        early_s = expected_s - (between_m - NOISE_M) / (SPEED_FACTOR * context.inspection_speed_m_s)
    if not -early_s <= elapsed_s - expected_s <= tolerance_s:
        return InferredCoverage(why_not=resume.TOOK.format(elapsed_s=elapsed_s, expected_s=expected_s))
    segments = tuple(segment_of(board.visits[visit]) for visit in visits)
    if joins is None:
        return InferredCoverage(segments)
    sample = PositionSample(fix.boot_s, fix.place_m, math.hypot(*fix.velocity_m_s[:2]))
    return InferredCoverage(segments, joins, join_run(board.tracks[joins], sample, context.inspection_speed_m_s))


def _describe_deviation(
    context: Context, state: VehicleState, before: LastKnown, fix: PositionFix, board: OnboardMission, waypoint: int
) -> str:
    if not is_mission_mode(context.vehicles[state.name].dialect, state.mode):
        return resume.NOT_ON_MISSION
    if waypoint < before.waypoint:
        return resume.WENT_BACK
    if state.telemetry.mode_since_s > before.fix.at_s:
        return resume.MODE_CHANGED
    away_m = _lateral_offset_m(board, waypoint, fix.place_m)
    return _describe_interference(state, before.fix.at_s) or (
        resume.OFF_TRACK.format(away_m=away_m) if away_m > context.corridor_m else ""
    )


def _describe_interference(state: VehicleState, since_s: float) -> str:
    """Return what else happened to a vehicle than that it flew its mission; empty if nothing did."""
    if state.custody.taken is not None or state.custody.cause is ModeCause.PERSON:
        return resume.IN_OTHER_HANDS
    if state.assignment.carried.may_be_foreign():
        return resume.FOREIGN_MISSION
    return resume.JUMPED if state.motion.jump[1] > since_s else ""


def _infer_after_landing(
    context: Context, state: VehicleState, before: LastKnown, fix: PositionFix, board: OnboardMission
) -> InferredCoverage:
    """Look at a vehicle that is on the ground again: when it landed nobody knows, but what it used tells how far."""
    elapsed_s = fix.boot_s - before.fix.boot_s
    if why_not := _describe_other_landing(context, state, before, fix):
        return InferredCoverage(why_not=why_not)
    expected_s, modelled_pct = _estimate_rest(board, before.waypoint, before.fix, state.assignment.pace)
    visits = _select_passed_visits(before, board, len(board.legs))
    if elapsed_s < expected_s - _tolerance_s(context, board, visits):
        return InferredCoverage(why_not=resume.TOO_SHORT.format(elapsed_s=elapsed_s, expected_s=expected_s))
    if before.remaining_pct is None or state.power.battery.remaining_pct is None:
        return InferredCoverage(why_not=resume.USE_UNKNOWN)
    expected_pct = before.factor * modelled_pct
    used_pct = before.remaining_pct - state.power.battery.remaining_pct
    if abs(used_pct - expected_pct) > max(ENERGY_TOLERANCE_PCT, ENERGY_TOLERANCE * expected_pct):
        return InferredCoverage(why_not=resume.USED.format(used_pct=used_pct, expected_pct=expected_pct))
    return InferredCoverage(tuple(segment_of(board.visits[visit]) for visit in visits))


def _describe_other_landing(context: Context, state: VehicleState, before: LastKnown, fix: PositionFix) -> str:
    """Return how else than by its mission a vehicle may have come to the ground; empty if there is no other way."""
    setup = context.vehicles[state.name]
    if setup.pad_distance_m(fix.place_m) > context.limits.off_pad_m:
        return resume.OFF_PAD
    if state.mode is None or is_home_mode(setup.dialect, state.mode):
        return resume.CAME_HOME
    if is_manual_mode(setup.dialect, state.mode):
        return resume.PILOT_LANDED
    if setup.failsafe_s is not None and fix.boot_s - before.fix.boot_s >= setup.failsafe_s:
        # PX4 goes back to its mission mode once it has disarmed, however it came home.
        return resume.FAILSAFE_LANDED
    return _describe_interference(state, before.fix.at_s)


def _select_passed_visits(before: LastKnown, board: OnboardMission, waypoint: int) -> tuple[int, ...]:
    """Return the visits that end before the leg under way, without one whose beginning is known not to count."""
    begun = None if before.run is None else before.run_visit
    return tuple(
        point.visit
        for index, point in enumerate(board.path.waypoints[before.waypoint : waypoint])
        if point.phase is Phase.INSPECT and point.visit is not None and (index > 0 or point.visit == begun)
    )


def _tolerance_s(context: Context, board: OnboardMission, visits: tuple[int, ...]) -> float:
    """Return how far a time may be off: less than any one of the segments flown too fast would make it.

    Their holds, and what it takes to reach their speed and to lose it, are as long at any speed, or longer.
    """
    shortest_m = min((board.tracks[visit].length_m for visit in visits), default=0.0)
    performance = context.pricing.models[board.path.vehicle].performance
    usual_s, fast_s = performance.level.rest_s(
        np.full(2, shortest_m), context.inspection_speed_m_s * np.array((1.0, SPEED_FACTOR))
    )
    # A stop at either end of the time has no place that tells how much of it is over.
    return max(performance.settle_s + performance.hold_s + INDEX_S, float(usual_s - fast_s))


def _estimate_rest(board: OnboardMission, waypoint: int, fix: PositionFix, pace: Pace) -> tuple[float, float]:
    """Return how long the rest of a mission takes from a place on one of its legs, and what it costs in percent."""
    points, legs = board.path.waypoints[waypoint:], board.legs[waypoint:]
    factors = [pace.factor_of(point.phase) for point in points]
    factors[0] *= remaining_leg_share(board, waypoint, fix)
    paced = list(zip(factors, legs, strict=True))
    return sum(factor * leg.duration_s for factor, leg in paced), sum(factor * leg.energy_pct for factor, leg in paced)


def _lateral_offset_m(board: OnboardMission, waypoint: int, place_m: tuple[float, float]) -> float:
    """Return how far beside the leg to a waypoint a place lies."""
    return locate_on_leg(board.places_m[max(0, waypoint - 1)], board.places_m[waypoint], place_m)[1]
