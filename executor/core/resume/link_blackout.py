"""Infer the segments flown during a time without contact, and how long a vehicle can have stayed in the air.

The ground station's own radio ends no flight. While no vehicle is received, none is declared lost until its battery
would be empty; a vehicle whose link is regained resumes where it is, with the segments it flew.

Observed segments count by their positions. For an unobserved one the evidence is: the vehicle's clock advanced; it was
on the same known mission before and after; it is now where that mission leads in just that time; and no segment can
have been flown too fast without making it early. Then the segment counts, marked as inferred. If anything does not fit,
nothing of that time counts, and the segments are flown again. The same rule covers a gap in one vehicle's positions, a
silence of all, and a resumed flight.
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

REPORT_TIMEOUT_S = 5.0
"""Time a vehicle has after its link is regained to report position, mode and item."""
ENDURANCE_FACTOR = 1.5
"""Bound on the endurance, as a factor on the energy model's."""
INDEX_INTERVAL_S = 1.0
"""Interval of the index reports."""
ENERGY_TOLERANCE = 0.15
"""Relative tolerance of a landed vehicle's consumption; take-off and descent are estimates."""
ENERGY_TOLERANCE_PCT = 2.0
"""Absolute tolerance: two rounded reports, and the level flight to the pad."""


def record_blackout(context: Scene, state: FleetState, now_s: float) -> Stepped:  # noqa: ARG001
    """Save the progress of all vehicles when all links are lost: a run across such a gap proves nothing."""
    since_s = state.listening.silent_since_s
    if since_s is None or now_s - since_s < GAP_S:
        return state, ()
    for vehicle in state.vehicles.values():
        before = vehicle.assignment.before or last_known_of(vehicle, since_s)
        if before is not vehicle.assignment.before:
            state = state.put(vehicle.with_assignment(before=before, run=None))
    return state, ()


def max_remaining_flight_s(context: Scene, vehicle: VehicleState) -> float:
    """Return the longest possible flight time since a vehicle was last received."""
    percent = vehicle.power.battery.remaining_pct
    return ENDURANCE_FACTOR * (100.0 if percent is None else percent) / min(context.draws_pct_s)


def may_be_airborne(context: Scene, vehicle: VehicleState, now_s: float) -> bool:
    """Return whether a vehicle without contact may still be in the air."""
    return vehicle.link.spoke_s is not None and now_s - vehicle.link.spoke_s < max_remaining_flight_s(context, vehicle)


def recover_after_silence(context: Context, state: FleetState, vehicle: VehicleState, now_s: float) -> Stepped | None:
    """Resume a vehicle whose link or position is regained; None until it has reported enough."""
    before, board, fix = vehicle.assignment.before, vehicle.assignment.board, vehicle.motion.fix
    if before is None:
        return state, ()
    since_s = before.until_s
    asked = math.isinf(since_s)  # after a restart it was read already
    if asked or fix is None or vehicle.link.heartbeat_s is None or board is None:
        return state.put(vehicle.with_assignment(before=None)), ()
    again_s = since_s if vehicle.link.regained_s is None else max(since_s, vehicle.link.regained_s)
    if vehicle.link.stale or (again_s <= since_s and fix.at_s <= since_s):
        return None
    said = fix.at_s > since_s and vehicle.link.heartbeat_s > since_s
    item = vehicle.telemetry.item_s is not None and vehicle.telemetry.item_s > since_s
    given = vehicle.assignment.pending is not None or vehicle.assignment.stubborn
    if given:  # its mission is known once that ends
        return state.put(_close_gap(vehicle, board)), ()
    if said and (item or not vehicle.armed or not is_on_mission(context, vehicle)):
        return catch_up_mission(context, state, vehicle, board, None)
    if now_s - again_s < REPORT_TIMEOUT_S:
        return None
    return state.put(_close_gap(vehicle, board)), ()


def catch_up_mission(
    context: Context, state: FleetState, vehicle: VehicleState, board: OnboardMission, seq: int | None
) -> Stepped:
    """Resume a vehicle on its mission at its present position, with the segments flown since `before`.

    It carries `board` and flies to item `seq`; None if its state already has that.
    """
    waypoint = vehicle.assignment.waypoint
    if seq is not None and 0 <= seq < len(board.waypoint_of):
        waypoint = board.waypoint_of[seq] or waypoint
    found = infer_coverage(context, vehicle, board, waypoint)
    # A run that began meanwhile at the first pylon, and was observed to begin, needs no inference.
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
    """Return a vehicle with its gap judged: the run it interrupted is broken, unless its segment is `counted`.

    With `told` the reason for the others has been reported already.
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
    """The segments inferred as flown."""

    segments: tuple[int, ...] = ()
    """From end to end, in order."""
    joins: int | None = None
    """The visit under way, if its beginning is inferred too."""
    run: InspectionRun | None = None
    """The run of that visit."""
    why_not: str = ""
    """What does not fit, in words; empty if all does."""


def infer_coverage(context: Context, state: VehicleState, board: OnboardMission, waypoint: int) -> InferredCoverage:
    """Return the segments inspected between the last position before the silence and the newest one.

    Its link is regained, it was found to carry `board`, and it is on the leg to one of its waypoints.
    """
    before, fix = state.assignment.before, state.motion.fix
    if before is None or fix is None or before.waypoint >= len(board.legs):
        return InferredCoverage()
    waits = not state.armed and state.orders.start_owed_s is not None  # not yet commanded to start
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
    """Compare the time a vehicle in the air took to its position on the mission with the model's."""
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
        # Part of one segment between two known positions: its speed is known as well as by a run. Its share of the
        # segment's time is no measure, as that includes the hold and the ramps at both ends.
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
    """Return in words what else happened to a vehicle than its mission; empty if nothing."""
    if state.custody.taken is not None or state.custody.cause is ModeCause.PERSON:
        return resume.IN_OTHER_HANDS
    if state.assignment.carried.may_be_foreign():
        return resume.FOREIGN_MISSION
    return resume.JUMPED if state.motion.jump[1] > since_s else ""


def _infer_after_landing(
    context: Context, state: VehicleState, before: LastKnown, fix: PositionFix, board: OnboardMission
) -> InferredCoverage:
    """Judge a landed vehicle by its consumption; the time of its landing is unknown."""
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
    """Return in words how a vehicle may have landed other than by its mission; empty if in no other way."""
    setup = context.vehicles[state.name]
    if setup.pad_distance_m(fix.place_m) > context.limits.off_pad_m:
        return resume.OFF_PAD
    if state.mode is None or is_home_mode(setup.dialect, state.mode):
        return resume.CAME_HOME
    if is_manual_mode(setup.dialect, state.mode):
        return resume.PILOT_LANDED
    if setup.failsafe_s is not None and fix.boot_s - before.fix.boot_s >= setup.failsafe_s:
        # PX4 returns to mission mode once disarmed, however it landed.
        return resume.FAILSAFE_LANDED
    return _describe_interference(state, before.fix.at_s)


def _select_passed_visits(before: LastKnown, board: OnboardMission, waypoint: int) -> tuple[int, ...]:
    """Return the visits that end before the present leg, without one whose start is known not to count."""
    begun = None if before.run is None else before.run_visit
    return tuple(
        point.visit
        for index, point in enumerate(board.path.waypoints[before.waypoint : waypoint])
        if point.phase is Phase.INSPECT and point.visit is not None and (index > 0 or point.visit == begun)
    )


def _tolerance_s(context: Context, board: OnboardMission, visits: tuple[int, ...]) -> float:
    """Return the time tolerance: less than any of the segments flown too fast would save.

    Holds, acceleration and deceleration take at least as long at any speed.
    """
    shortest_m = min((board.tracks[visit].length_m for visit in visits), default=0.0)
    performance = context.pricing.models[board.path.vehicle].performance
    usual_s, fast_s = performance.level.rest_s(
        np.full(2, shortest_m), context.inspection_speed_m_s * np.array((1.0, SPEED_FACTOR))
    )
    # A stop at either end of the time has no position that shows how much of it has passed.
    return max(performance.settle_s + performance.hold_s + INDEX_INTERVAL_S, float(usual_s - fast_s))


def _estimate_rest(board: OnboardMission, waypoint: int, fix: PositionFix, pace: Pace) -> tuple[float, float]:
    """Return the time of the rest of a mission from a position on one of its legs, and its energy in percent."""
    points, legs = board.path.waypoints[waypoint:], board.legs[waypoint:]
    factors = [pace.factor_of(point.phase) for point in points]
    factors[0] *= remaining_leg_share(board, waypoint, fix)
    paced = list(zip(factors, legs, strict=True))
    return sum(factor * leg.duration_s for factor, leg in paced), sum(factor * leg.energy_pct for factor, leg in paced)


def _lateral_offset_m(board: OnboardMission, waypoint: int, place_m: tuple[float, float]) -> float:
    """Return the lateral distance of a place from the leg to a waypoint."""
    return locate_on_leg(board.places_m[max(0, waypoint - 1)], board.places_m[waypoint], place_m)[1]
