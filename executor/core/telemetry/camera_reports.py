"""Fold camera messages into the state: each picture with the span it shows, or why it does not count.

A picture counts by its own position and direction: it lies inside the corridor around a span of its vehicle's mission
that requires this camera, it is sharp enough, and the camera points where it should. Missing numbers are kept, to be
requested again.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass, replace
from types import MappingProxyType

from executor.core.context import Context
from executor.core.interface.messages import CameraHeard, CameraStatus, GimbalAttitude, PayloadMessage, PictureTaken
from executor.core.lines import inspection
from executor.core.payload.camera_state import CameraRecord, Picture, WantedPicture, angle_between_deg, bearing_deg
from executor.core.state.fleet_state import FleetState
from executor.core.state.inspection_proof import END_TOLERANCE_M, SPEED_FACTOR, Track
from executor.core.state.vehicle_parts import OnboardMission
from executor.core.state.vehicle_position import is_dead_reckoning
from executor.core.state.vehicle_state import Stage, VehicleState
from missions import Phase, Waypoint
from missions.cameras import FIRST_COMPONENT, Camera, Capture, PictureProof, choose_picture_proof
from missions.inspection_height import visit_distances_m
from planner import is_reversed

MOST_WANTED = 50
"""Largest jump of the picture number; a larger one is a restarted count."""
BEGAN_ANEW = 20
"""Drop of the number that is a restarted count."""
GIMBAL_KNOWN_S = 3.0
ONE_PASS_S = 20.0
"""Longest time between two pictures of one viewpoint in one pass around its pylon."""
PICTURES = frozenset({Stage.STARTING, Stage.FLYING, Stage.PILOT, Stage.RETURNING})
"""Stages in which a picture may belong to a span; late reports arrive during the return."""


@dataclass(frozen=True, slots=True)
class _VisitSite:
    """The visit at a place."""

    visit: int
    track: Track
    capture: Capture | None
    """The required capture there."""
    along_m: float = 0.0
    """In the direction of the visit."""


def apply_payload_message(
    context: Context, state: FleetState, vehicle: VehicleState, message: PayloadMessage, now_s: float
) -> FleetState:
    """Apply one message of a camera or gimbal."""
    if not context.setup.looks:
        return state
    known = vehicle.payload
    match message:
        case GimbalAttitude():
            return state.put(replace(vehicle, payload=replace(known, gimbal=message, gimbal_s=now_s)))
        case CameraHeard(component):
            for camera in _cameras_of(context, vehicle.name):
                if camera.id == component:
                    memory = known.camera_of(camera.name, component)
                    known = known.with_camera(replace(memory, heard_s=now_s))
            return state.put(replace(vehicle, payload=known))
        case CameraStatus():
            return _apply_camera_status(context, state, vehicle, message, now_s)
        case PictureTaken():
            return _apply_picture(context, state, vehicle, message, now_s)


def _cameras_of(context: Context, name: str) -> list[Camera]:
    looks = context.setup.looks
    return [camera for camera in looks.cameras.values() if camera.name in looks.carriers.get(name, frozenset())]


def _apply_camera_status(
    context: Context, state: FleetState, vehicle: VehicleState, message: CameraStatus, now_s: float
) -> FleetState:
    camera = next((one for one in _cameras_of(context, vehicle.name) if one.id == message.component), None)
    if camera is None:
        return state
    memory = vehicle.payload.camera_of(camera.name, camera.id)
    last, wanted = _count_pictures(memory, message.images)
    # A camera without card reports is not counted: MAVSDK's reports 0 with each picture. A card full from the start
    # shows by its failed pictures.
    uncounted = message.free_mib == 0.0 and memory.free_mib is None
    memory = replace(
        memory,
        heard_s=now_s,
        films=memory.films if message.films is None else message.films,
        free_mib=memory.free_mib if message.free_mib is None or uncounted else message.free_mib,
        images=memory.images if message.images is None else message.images,
        last=last,
        wanted=wanted,
    )
    vehicle = replace(vehicle, payload=vehicle.payload.with_camera(memory))
    state = state.put(vehicle)
    fix = vehicle.motion.fix
    if not message.films or fix is None or is_dead_reckoning(vehicle):
        return state
    seen = _find_visit(context, vehicle, camera, fix.place_m, fix.alt_rel_m)
    if seen is None or seen.capture is None or not seen.capture.is_filming:
        return state
    return _record_coverage(context, state, vehicle, camera, seen)


def _count_pictures(memory: CameraRecord, images: int | None) -> tuple[int | None, tuple[WantedPicture, ...]]:
    """Return the highest picture number, and those to request, once a camera reports its count.

    Pictures are numbered from 0. The report of the newest may be in transit, unless the count is older.
    """
    last = memory.last
    if images is None:
        return last, memory.wanted
    newest = images - 1 if images == memory.images else images - 2
    if last is None:
        return images - 1, memory.wanted
    if not 0 < newest - last <= MOST_WANTED:
        return last, memory.wanted
    return newest, (*memory.wanted, *map(WantedPicture, range(last + 1, newest + 1)))


def _camera_of(context: Context, vehicle: VehicleState, message: PictureTaken) -> Camera | None:
    """Return the camera that a message is about; None if it proves nothing for any."""
    autopilot = context.vehicles[vehicle.name].dialect.name
    for camera in _cameras_of(context, vehicle.name):
        if message.source is not choose_picture_proof(camera, autopilot):
            continue
        if camera.id >= FIRST_COMPONENT:
            if message.component == camera.id:
                return camera
        elif message.camera in {0, camera.id} or camera.id == 0:
            return camera
    return None


def _apply_picture(
    context: Context, state: FleetState, vehicle: VehicleState, message: PictureTaken, now_s: float
) -> FleetState:
    camera = _camera_of(context, vehicle, message)
    if camera is None:
        return state
    memory = vehicle.payload.camera_of(camera.name, message.component)
    numbered = _record_number(memory, message.sequence)
    if numbered is None:
        return state  # already reported
    memory = replace(numbered, heard_s=now_s, left_behind=0)
    if not message.ok:
        memory = replace(memory, failures=memory.failures + 1)
        return state.put(replace(vehicle, payload=vehicle.payload.with_camera(memory)))
    memory = replace(memory, failures=0, picture_s=now_s)
    picture, seen = _place_picture(context, vehicle, camera, message, now_s)
    if picture is None:
        return state.put(replace(vehicle, payload=vehicle.payload.with_camera(memory)))
    if camera.gimbal and seen is not None and seen.capture is not None:
        is_beside = _aim_error_deg(message, picture, seen, seen.capture) > seen.capture.aim_deg
        memory = replace(memory, beside=memory.beside + 1 if is_beside else 0)
    payload = vehicle.payload.with_camera(memory)
    vehicle = replace(vehicle, payload=replace(payload, pictures=_add_picture(payload.pictures, picture)))
    state = state.put(vehicle)
    return state if picture.flaw or seen is None else _record_coverage(context, state, vehicle, camera, seen)


def _add_picture(pictures: tuple[Picture, ...], new: Picture) -> tuple[Picture, ...]:
    """Return pictures with one more: of two of one stop in one pass, the earlier was taken on the way there.

    After a new mission in mid-span, a distance trigger may still fire at the next pylon.
    """
    if not new.points or new.flaw:
        return (*pictures, new)
    found = list(pictures)
    for number, old in enumerate(pictures):
        same = (old.camera, old.segment, old.points, old.flaw) == (new.camera, new.segment, new.points, "")
        if same and abs(new.at_s - old.at_s) < ONE_PASS_S:
            why = inspection.TAKEN_AGAIN.format(later_s=abs(new.at_s - old.at_s))
            if old.at_s <= new.at_s:
                found[number] = replace(old, flaw=why)
            else:
                new = replace(new, flaw=why)
    return (*found, new)


def _record_number(memory: CameraRecord, sequence: int) -> CameraRecord | None:
    """Return the record after a picture number; None for a repeated one."""
    last = memory.last
    if last is None or sequence < last - BEGAN_ANEW or sequence > last + MOST_WANTED:
        return replace(memory, last=sequence, wanted=())
    if sequence > last:
        return replace(memory, last=sequence, wanted=(*memory.wanted, *map(WantedPicture, range(last + 1, sequence))))
    left = tuple(one for one in memory.wanted if one.sequence != sequence)
    return None if len(left) == len(memory.wanted) else replace(memory, wanted=left)


def _place_picture(
    context: Context, vehicle: VehicleState, camera: Camera, message: PictureTaken, now_s: float
) -> tuple[Picture | None, _VisitSite | None]:
    """Return a picture with its position, and its visit; None if its position is unknown."""
    fix = vehicle.motion.fix
    if fix is None:
        return None, None
    at_s = now_s
    if message.boot_s is not None and abs(message.boot_s - fix.boot_s) < LONGEST_S:
        at_s = min(now_s, fix.at_s + message.boot_s - fix.boot_s)
    place_m, alt_msl_m, alt_rel_m = fix.place_m, fix.alt_msl_m, fix.alt_rel_m
    if message.lat_deg is not None and message.lon_deg is not None:
        place_m = context.frame.to_local_m(message.lat_deg, message.lon_deg)
        alt_msl_m = alt_msl_m if message.alt_msl_m is None else message.alt_msl_m
        alt_rel_m = alt_rel_m if message.alt_rel_m is None else message.alt_rel_m
    elif abs(at_s - fix.at_s) < GIMBAL_KNOWN_S:
        (east_m, north_m), (east_m_s, north_m_s, _) = fix.place_m, fix.velocity_m_s
        place_m = (east_m + east_m_s * (at_s - fix.at_s), north_m + north_m_s * (at_s - fix.at_s))
    pitch_deg, yaw_deg = _find_camera_angles(vehicle, camera, message, now_s)
    seen = _find_visit(context, vehicle, camera, place_m, alt_rel_m)
    capture = None if seen is None else seen.capture
    if yaw_deg is None and capture is not None and capture.region is not None:
        yaw_deg = _heading_deg(vehicle, message)  # the camera is fixed to the nose
    lat_deg, lon_deg = context.frame.to_wgs84_deg(*place_m)
    speed_m_s = math.hypot(*fix.velocity_m_s[:2])
    picture = Picture(
        camera=camera.name,
        source=message.source,
        sequence=message.sequence,
        at_s=at_s,
        unix_s=message.unix_s,
        lat_deg=lat_deg,
        lon_deg=lon_deg,
        alt_msl_m=alt_msl_m,
        alt_rel_m=alt_rel_m,
        pitch_deg=pitch_deg,
        yaw_deg=yaw_deg,
        speed_m_s=speed_m_s,
        file=message.file,
        segment=None if seen is None else seen.track.segment,
        along_m=None if seen is None or seen.track.by_pictures else _distance_from_a_m(vehicle.assignment.board, seen),
        points=() if capture is None else capture.points,
    )
    return replace(
        picture, flaw=_find_flaw(context, message, picture, seen, capture, adrift=is_dead_reckoning(vehicle))
    ), seen


LONGEST_S = 3600.0


def _find_camera_angles(
    vehicle: VehicleState, camera: Camera, message: PictureTaken, now_s: float
) -> tuple[float | None, float | None]:
    """Return the camera's direction: by its own report, or its gimbal's and the vehicle's heading."""
    if message.source is PictureProof.CAPTURED and message.pitch_deg is not None:
        return message.pitch_deg, message.yaw_deg
    known = vehicle.payload
    fresh = known.gimbal_s is not None and now_s - known.gimbal_s <= GIMBAL_KNOWN_S
    if not camera.gimbal or known.gimbal is None or not fresh:
        return None, None
    if known.gimbal.from_north:
        return known.gimbal.pitch_deg, known.gimbal.yaw_deg
    heading_deg = _heading_deg(vehicle, message)
    return known.gimbal.pitch_deg, None if heading_deg is None else (heading_deg + known.gimbal.yaw_deg) % 360


def _find_visit(
    context: Context, vehicle: VehicleState, camera: Camera, place_m: tuple[float, float], alt_rel_m: float
) -> _VisitSite | None:
    """Return the visit at a place, of those flown or being flown that require a camera."""
    board, looks = vehicle.assignment.board, context.setup.looks
    if board is None or vehicle.stage not in PICTURES:
        return None
    reached = {point.visit for point in board.path.waypoints[: vehicle.assignment.waypoint + 1]} - {None}
    best: tuple[float, int, float] | None = None
    for visit in sorted((one for one in reached if one is not None), reverse=True):
        track = board.tracks[visit]
        if camera.name not in looks.cameras_for(track.segment):
            continue
        if track.by_pictures:
            stop = _find_viewpoint(board, visit, (*place_m, alt_rel_m))
            if stop is not None:
                return _VisitSite(visit, track, _capture_of(stop.captures, camera.name))
            continue
        along_m, _ = track.locate(place_m)
        beyond_m, aside_m = max(-along_m, along_m - track.length_m, 0.0), track.lateral_offset_m(place_m)
        if beyond_m > END_TOLERANCE_M or aside_m > context.corridor_m:
            continue
        if best is None or beyond_m + aside_m < best[0] - 1.0:
            best = (beyond_m + aside_m, visit, along_m)
    if best is None:
        return None
    _, visit, along_m = best
    inspects = (point for point in board.path.waypoints if point.visit == visit and point.phase is Phase.INSPECT)
    capture = next((_capture_of(point.captures, camera.name) for point in inspects), None)
    return _VisitSite(visit, board.tracks[visit], capture, along_m)


def _find_viewpoint(board: OnboardMission, visit: int, place_m: tuple[float, float, float]) -> Waypoint | None:
    """Return the waypoint at a place with viewpoints of a pylon; None if there is none."""
    near = [
        (apart_m, number)
        for number, point in enumerate(board.path.waypoints)
        if point.visit == visit
        and point.captures
        and (apart_m := math.dist((*board.places_m[number], point.alt_rel_m), place_m)) <= END_TOLERANCE_M
    ]
    return board.path.waypoints[min(near)[1]] if near else None


def _capture_of(captures: Iterable[Capture], camera: str) -> Capture | None:
    return next((one for one in captures if one.camera == camera), None)


def _find_flaw(
    context: Context, message: PictureTaken, picture: Picture, seen: _VisitSite | None, capture: Capture | None, *,
    adrift: bool,
) -> str:  # fmt: skip
    if adrift:
        return inspection.TAKEN_WITHOUT_FIX
    if seen is None or capture is None:
        return inspection.NOT_WANTED
    if picture.speed_m_s > SPEED_FACTOR * context.inspection_speed_m_s:
        return inspection.TAKEN_AT.format(speed_m_s=picture.speed_m_s)
    off_deg = _aim_error_deg(message, picture, seen, capture)
    return inspection.AIMED_BESIDE.format(off_deg=off_deg) if off_deg > capture.aim_deg else ""


def _aim_error_deg(message: PictureTaken, picture: Picture, seen: _VisitSite, capture: Capture) -> float:
    """Return a picture's aiming error, as far as known."""
    off_deg = 0.0
    if capture.pitch_deg is not None and capture.yaw_deg is not None and picture.pitch_deg is not None:
        nose_deg = 0.0 if capture.from_north else bearing_deg(seen.track.begin_m, seen.track.end_m)
        wanted_deg = (nose_deg + capture.yaw_deg) % 360
        yaw_deg = wanted_deg if picture.yaw_deg is None else picture.yaw_deg
        off_deg = angle_between_deg(picture.pitch_deg, yaw_deg, capture.pitch_deg, wanted_deg)
    elif message.source is PictureProof.FEEDBACK and message.roll_deg is not None and message.pitch_deg is not None:
        off_deg = max(abs(message.roll_deg), abs(message.pitch_deg))  # of the vehicle, which carries it level
    if capture.pitch_deg is None and capture.yaw_deg is not None and picture.yaw_deg is not None:
        off_deg = max(off_deg, angle_between_deg(0.0, picture.yaw_deg, 0.0, capture.yaw_deg))
    return off_deg


def _heading_deg(vehicle: VehicleState, message: PictureTaken) -> float | None:
    """Return a vehicle's heading: by its camera's report, or by its position's."""
    fix = vehicle.motion.fix
    return message.yaw_deg if message.yaw_deg is not None or fix is None else fix.heading_deg


def _distance_from_a_m(board: OnboardMission | None, seen: _VisitSite) -> float:
    backward = board is not None and is_reversed(board.visits[seen.visit])
    return seen.track.length_m - seen.along_m if backward else seen.along_m


def _record_coverage(
    context: Context, state: FleetState, vehicle: VehicleState, camera: Camera, seen: _VisitSite
) -> FleetState:
    segment, points = seen.track.segment, () if seen.capture is None else seen.capture.points
    places = map(float, points) if points else (round(_distance_from_a_m(vehicle.assignment.board, seen), 2),)
    here, coverage = tuple((camera.name, place) for place in places), state.coverage
    nearer = coverage.is_nearer_than_counted(segment, _inspection_distance_m(context, vehicle, seen))
    known = coverage.caught_nearer if nearer else coverage.caught
    caught = MappingProxyType({**known, segment: (*known.get(segment, ()), *here)})
    return state.with_coverage(caught_nearer=caught) if nearer else state.with_coverage(caught=caught)


def _inspection_distance_m(context: Context, vehicle: VehicleState, seen: _VisitSite) -> float | None:
    """Return the distance from which a visit inspects; None if every vehicle inspects in its layer."""
    board = vehicle.assignment.board
    if board is None or not context.setup.inspection.same_distance:
        return None
    return visit_distances_m(context.setup, board.path, board.visits)[seen.visit]
