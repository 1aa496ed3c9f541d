"""Detect cameras and gimbals that do not work, report them, and return their vehicle or let it continue.

Each fault is a level, evaluated on every tick while a vehicle moves along a span that requires pictures.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace

from executor.core.context import Context
from executor.core.formatting import format_count
from executor.core.lines import pictures
from executor.core.payload.camera_state import CameraRecord
from executor.core.replanning.survivors import find_barred_segments
from executor.core.replanning.withdrawal import declare_fault, withdraw_vehicle
from executor.core.state.fleet_state import FleetState, Stepped, step_each
from executor.core.state.vehicle_state import Fault, FaultCode, FaultKind, Stage, VehicleState
from missions.cameras import FIRST_COMPONENT, Capture, Trigger
from planner import segment_of

CameraFinding = tuple[FaultCode, str]

MOVES = 0.5
"""Share of the inspection speed from which pictures are due."""
PICTURES_LATE = 4
"""Missing pictures in a row that are not lost reports, unless the link loses many."""
VIEWPOINTS_LATE = 6
"""The same for single pictures."""
RARE = 1e-5
"""Probability that a row of reports is lost by chance: rate of false alarms for a silent camera."""
MOST_LOST = 0.5
"""Largest frame loss that lengthens the row."""
LATEST_S = 8.0
"""Longest delay of a report: a camera reports once a second, and a lost report is requested three times in this
time."""
HEARD_S = 4.0
FAILURES = BESIDE = 3
LEAST_MIB = 1.0
OFF_S = 5.0
"""Time for a gimbal to turn."""
FRESH_S = 3.0


def check_cameras(context: Context, state: FleetState, now_s: float) -> Stepped:
    """Check the cameras of all vehicles on a span."""
    if not context.setup.looks:
        return state, ()
    return step_each(state, state.vehicles, lambda state, name: _check_vehicle_cameras(context, state, name, now_s))


def _check_vehicle_cameras(context: Context, state: FleetState, name: str, now_s: float) -> Stepped:
    vehicle = _track_camera_work(context, state.vehicles[name], now_s)
    state = state.put(vehicle)
    if not _is_on_leg(vehicle) or vehicle.fault is not None or vehicle.link.stale or vehicle.is_under_foreign_control:
        return state, ()
    for capture in () if vehicle.leg is None else vehicle.leg.captures:
        if capture.camera in vehicle.payload.broken:
            continue
        found = next(_find_camera_faults(context, vehicle, capture, now_s), None)
        if found is not None:
            return _report_broken_camera(context, state, vehicle, capture.camera, found, now_s)
    return state, ()


def _track_camera_work(context: Context, vehicle: VehicleState, now_s: float) -> VehicleState:
    """Return the vehicle with the start of its motion along the span, and of a wrong gimbal direction."""
    leg, fix, known = vehicle.leg, vehicle.motion.fix, vehicle.payload
    moves = fix is not None and math.hypot(*fix.velocity_m_s[:2]) >= MOVES * context.inspection_speed_m_s
    working = off_s = None
    if _is_on_leg(vehicle) and leg is not None and leg.captures and leg.visit is not None and moves:
        working = known.working if known.working is not None and known.working[0] == leg.visit else (leg.visit, now_s)
        if any(_is_gimbal_off(vehicle, capture, now_s) for capture in leg.captures):
            off_s = now_s if known.off_since_s is None else known.off_since_s
    if (working, off_s) == (known.working, known.off_since_s):
        return vehicle
    return replace(vehicle, payload=replace(known, working=working, off_since_s=off_s))


def _is_on_leg(vehicle: VehicleState) -> bool:
    """Return whether it flies a known leg of its mission; unknown during an upload."""
    return vehicle.stage is Stage.FLYING and vehicle.assignment.pending is None


def _is_gimbal_off(vehicle: VehicleState, capture: Capture, now_s: float) -> bool:
    known = vehicle.payload
    if capture.pitch_deg is None or known.gimbal is None or known.gimbal_s is None or now_s - known.gimbal_s > FRESH_S:
        return False
    if capture.region is not None:
        return known.gimbal.failed  # it tracks the target, and reaches that pitch where the picture is taken
    return known.gimbal.failed or abs(known.gimbal.pitch_deg - capture.pitch_deg) > capture.aim_deg


def _find_camera_faults(
    context: Context, vehicle: VehicleState, capture: Capture, now_s: float
) -> Iterator[CameraFinding]:
    known = vehicle.payload
    memory = known.camera_of(capture.camera, capture.camera_id)
    name = capture.camera
    if known.gimbal is not None and known.off_since_s is not None and now_s - known.off_since_s >= OFF_S:
        why = pictures.GIMBAL_FAILED if known.gimbal.failed else pictures.GIMBAL_POINTS
        yield FaultCode.GIMBAL_STUCK, why.format(pitch_deg=known.gimbal.pitch_deg, asked_deg=capture.pitch_deg)
    if memory.free_mib is not None and memory.free_mib < LEAST_MIB:
        yield FaultCode.CARD_FULL, pictures.CARD_FULL.format(camera=name)
    if memory.failures >= FAILURES:
        yield FaultCode.CARD_FULL, pictures.PICTURES_FAILED.format(camera=name, count=memory.failures)
    if capture.trigger is Trigger.ONCE:
        if memory.beside >= BESIDE:
            yield FaultCode.GIMBAL_STUCK, pictures.GIMBAL_ELSEWHERE.format(count=memory.beside)
        if memory.left_behind >= _count_misses_needed(vehicle, memory, VIEWPOINTS_LATE):
            missed = pictures.OF_VIEWPOINTS.format(count=memory.left_behind)
            yield _build_silence_finding(memory, name, missed, now_s)
    elif known.working is not None:
        row = _count_misses_needed(vehicle, memory, PICTURES_LATE)
        yield from _find_late_pictures(context, capture, memory, row, known.working[1], now_s)


def _count_misses_needed(vehicle: VehicleState, memory: CameraRecord, least: int) -> int:
    """Return the number of missing pictures that rules out lost reports; a MAVLink camera is asked again."""
    lost = vehicle.link.quality.lost or 0.0
    if memory.component >= FIRST_COMPONENT or lost <= 0.0:
        return least
    return max(least, math.ceil(math.log(RARE) / math.log(min(lost, MOST_LOST))))


def _find_late_pictures(
    context: Context, capture: Capture, memory: CameraRecord, row: int, since_s: float, now_s: float
) -> Iterator[CameraFinding]:
    """Yield the fault of a camera that should take a row of pictures, or film."""
    every_s = capture.every_m / context.inspection_speed_m_s
    late_s = LATEST_S if capture.is_filming else max(LATEST_S, row * every_s)
    last_s = since_s if memory.picture_s is None else max(since_s, memory.picture_s)
    if capture.is_filming and memory.films and memory.heard_s is not None:
        last_s = max(last_s, memory.heard_s)
    if now_s - last_s < late_s:
        return
    if capture.is_filming:
        yield FaultCode.CAMERA_SILENT, pictures.NOT_FILMED.format(camera=capture.camera, late_s=now_s - last_s)
    else:
        since = pictures.FOR_SECONDS.format(late_s=now_s - last_s)
        yield _build_silence_finding(memory, capture.camera, since, now_s)


def _build_silence_finding(memory: CameraRecord, camera: str, since: str, now_s: float) -> CameraFinding:
    present = memory.component >= FIRST_COMPONENT and memory.heard_s is not None and now_s - memory.heard_s <= HEARD_S
    if present:
        return FaultCode.CAMERA_MUTE, pictures.MUTE.format(camera=camera, since=since)
    return FaultCode.CAMERA_SILENT, pictures.SILENT.format(camera=camera, since=since)


def _report_broken_camera(
    context: Context, state: FleetState, vehicle: VehicleState, camera: str, found: CameraFinding, now_s: float
) -> Stepped:
    code, why = found
    vehicle = replace(vehicle, payload=replace(vehicle.payload, broken=vehicle.payload.broken | {camera}))
    if context.camera_home:
        return declare_fault(context, state.put(vehicle), vehicle, Fault(FaultKind.PAYLOAD, why, now_s, code))
    state = state.put(vehicle)
    blind = {segment_of(visit) for visit in vehicle.remaining_visits()} & find_barred_segments(context, state, vehicle)
    left = blind - set(state.coverage.inspected)
    what = pictures.TO_REASSIGN.format(segments=format_count(len(left), "segment")) if left else ""
    state, more = withdraw_vehicle(state, vehicle.name, f"{vehicle.name}: {why}", now_s)
    return state, (pictures.GOES_ON.say(vehicle=vehicle.name, why=why, left=what), *more)
