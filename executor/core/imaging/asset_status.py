"""Track each asset: whether its pictures cover it, and second inspections that an operator requests by name.

Assets are the segments that require pictures if a site has any, else all segments. A text is an asset's name, which
several may share, as `pylon V101-4`; a number is its segment.

Flown is not seen: a flown asset waits for the reports of its pictures, and lost reports are requested again. An asset
they do not cover was flown but not seen, and is planned again like any open segment.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from enum import Enum
from types import MappingProxyType

from executor.core.context import Context
from executor.core.interface.commands import AskPicture, Command
from executor.core.interface.intents import Reason, fill_in
from executor.core.lines import operator, pictures
from executor.core.payload.camera_state import AwaitedPictures, WantedPicture
from executor.core.replanning.replan_cycle import find_left_over_segments
from executor.core.replanning.survivors import find_barred_segments
from executor.core.state.fleet_state import Coverage, FleetState, Stepped
from executor.core.state.inspection_proof import SegmentPass
from executor.core.state.vehicle_state import IN_THE_AIR, VehicleState
from missions import Phase
from missions.cameras import FIRST_COMPONENT, SpanCameraTask, Trigger
from missions.inspection_height import visit_distances_m
from planner import segment_of

COUNT_ROUNDING = 0.01
"""Rounding of the number of pictures: a track of 99.999 m has as many as one of 100 m."""
PICTURE_TIMEOUT_S = 8.0
"""Time to wait for picture reports after a span is flown; a lost one can be requested three times."""
REQUEST_INTERVAL_S = 2.0
MAX_REQUESTS = 8
"""Requests for a lost picture; with a fifth of all frames lost each way, three leave one picture in a hundred
unknown."""
REQUESTS_AT_ONCE = 5
"""Pictures requested at once."""
PICTURE_DELAY_M = 2.5
"""Distance by which a picture may be taken, or reported, late, including the error of two fixes."""
SPACING_FACTOR = 1.5
"""Largest gap between pictures, as a multiple of their spacing; a missing one leaves twice the spacing."""
FILM_REPORT_S = 3.0
"""Longest gap between reports of a filming camera, which come once a second and may be lost."""


class AssetState(Enum):
    """The state of an asset."""

    OPEN = "open"
    SEEN = "seen"
    """It counts, by its pictures, or by positions if it requires none."""
    INFERRED = "inferred"
    """It counts by evidence alone."""
    MISSED = "missed"
    """It was flown, and pictures are missing; it is flown again."""
    GIVEN_UP = "given_up"
    """It is no longer flown in this flight."""
    LEFT_OVER = "left_over"
    """It is left for the next flight."""


@dataclass(frozen=True, slots=True)
class AssetView:
    """An asset as displayed."""

    segment: int
    state: AssetState
    pictures: int
    """Number of the required pictures taken; a film is none."""
    asked: int
    """Number of pictures required; 0 where positions or a film prove it."""
    vehicle: str | None
    """The vehicle that has seen it, or flew it last; None if none."""


AskedPictures = Mapping[int, Mapping[str, int]]
"""By segment, the number of pictures required of each camera."""


def list_asked_pictures(context: Context) -> AskedPictures:
    """Return the assets to display, with the pictures each requires; constant during a flight."""
    looks = context.setup.looks
    wanted = context.wanted & {*looks.spans, *looks.pylons} if looks else context.wanted
    return {segment: _count_asked_pictures(context, segment) for segment in sorted(wanted)}


def build_asset_views(context: Context, state: FleetState, asked: AskedPictures) -> tuple[AssetView, ...]:
    """Return the state of each asset, in the order of their numbers."""
    gone, left = find_missed_segments(context, state), find_left_over_segments(state)
    flew = {**state.coverage.not_seen}
    flew |= {segment: waits.vehicle for segment, waits in state.coverage.unseen.items()}
    return tuple(
        AssetView(
            segment,
            _classify_asset(state.coverage, segment, gone, left),
            _count_pictures(state.coverage, segment, most),
            sum(most.values()),
            state.coverage.inspected.get(segment, flew.get(segment)),
        )
        for segment, most in asked.items()
    )


def _classify_asset(coverage: Coverage, segment: int, gone: frozenset[int], left: frozenset[int]) -> AssetState:
    if segment in coverage.inspected:
        return AssetState.INFERRED if segment in coverage.inferred else AssetState.SEEN
    if segment in coverage.given_up:
        return AssetState.GIVEN_UP
    if segment in gone:
        return AssetState.MISSED
    return AssetState.LEFT_OVER if segment in left else AssetState.OPEN


def _count_asked_pictures(context: Context, segment: int) -> dict[str, int]:
    looks = context.setup.looks
    pylon = looks.pylons.get(segment)
    if pylon is not None:
        return {pylon.camera: len(pylon.points)}
    begin_m, end_m = context.setup.tracks_m[segment]
    length_m = math.dist(begin_m, end_m)
    return {
        # The one at its start may be the last of the previous span.
        look.camera: max(1, math.floor(length_m / look.every_m + COUNT_ROUNDING))
        for look in looks.spans.get(segment, ())
        if look.every_m > 0
    }


def _count_pictures(coverage: Coverage, segment: int, asked: Mapping[str, int]) -> int:
    """Return the number of required pictures taken; a surplus of one camera does not replace another's."""
    caught = set(coverage.caught.get(segment, ()))
    return sum(min(most, sum(one == camera for one, _ in caught)) for camera, most in asked.items()) if caught else 0


def select_segments_to_reinspect(
    context: Context, state: FleetState, assets: Sequence[int | str]
) -> frozenset[int] | Reason:
    """Return the segments to inspect again, or why one asset cannot be; then none is."""
    # Segments for which no vehicle has a working camera.
    barred = [find_barred_segments(context, state, vehicle) for vehicle in state.vehicles.values()]
    blind = frozenset.intersection(*barred) if barred else frozenset[int]()
    again, coverage = set[int](), state.coverage
    for asset in assets:
        found = _segments_of(context, asset)
        if not found:
            unknown = operator.SEGMENT_UNKNOWN if isinstance(asset, int) else operator.ASSET_UNKNOWN
            return fill_in(unknown, asset=asset, last=len(context.setup.network.segments) - 1)
        flown = (found & context.wanted) - blind
        if not flown:
            return _object_to_segment(context, min(found))
        # Closed ones: they count, wait for pictures, or were given up.
        closed = flown & {*coverage.inspected, *coverage.unseen, *coverage.given_up}
        if not closed:
            return fill_in(operator.ASSET_OPEN, asset=context.segment_name(min(flown)))
        again |= closed
    return frozenset(again)


def reopen_segments(coverage: Coverage, again: frozenset[int]) -> Coverage:
    """Return the coverage with segments open as if never flown."""
    was_seen = again & set(coverage.inspected)
    return replace(
        discard_proof(coverage, again),
        unseen=MappingProxyType({one: waits for one, waits in coverage.unseen.items() if one not in again}),
        # A segment missed once and seen later is not missed: a better inspection is wanted.
        not_seen=MappingProxyType({one: by for one, by in coverage.not_seen.items() if one not in was_seen}),
        # It gets as many attempts as a segment never flown.
        attempts=MappingProxyType({one: tries for one, tries in coverage.attempts.items() if one not in again}),
    )


def discard_proof(coverage: Coverage, again: frozenset[int]) -> Coverage:
    """Return the coverage with segments not counting, and without their proof."""
    return replace(
        coverage,
        inspected=MappingProxyType({one: by for one, by in coverage.inspected.items() if one not in again}),
        flown=MappingProxyType({one: how for one, how in coverage.flown.items() if one not in again}),
        inferred=coverage.inferred - again,
        given_up=coverage.given_up - again,
        caught=MappingProxyType({one: seen for one, seen in coverage.caught.items() if one not in again}),
        caught_nearer=MappingProxyType({one: seen for one, seen in coverage.caught_nearer.items() if one not in again}),
    )


def _segments_of(context: Context, asset: int | str) -> frozenset[int]:
    count = len(context.setup.network.segments)
    if isinstance(asset, int):
        return frozenset({asset} & set(range(count)))
    return frozenset(segment for segment in range(count) if context.segment_name(segment) == asset)


def _object_to_segment(context: Context, segment: int) -> Reason:
    """Return why a segment is never flown."""
    name = context.segment_name(segment)
    why = next((one.why for one in context.unreachable if one.segment == segment), "")
    if why:
        return fill_in(operator.NEVER_FLOWN, asset=name, why=why)
    if segment not in context.wanted:
        return fill_in(operator.NOT_ASKED_FOR, asset=name)
    cameras = " and ".join(sorted(context.setup.looks.cameras_for(segment)))
    return fill_in(operator.NO_CAMERA, asset=name, cameras=cameras)


def requires_pictures(context: Context, segment: int) -> bool:
    """Return whether a segment requires pictures."""
    return segment in context.setup.looks.spans or segment in context.setup.looks.pylons


def record_flown_segments(
    context: Context, state: FleetState, vehicle: str, segments: Iterable[tuple[int, SegmentPass | None]], now_s: float
) -> FleetState:
    """Record flown segments: inspected, or waiting for their pictures.

    A segment that counts already keeps the closer of two inspections.
    """
    coverage = state.coverage
    inspected, passes, unseen = dict(coverage.inspected), dict(coverage.flown), dict(coverage.unseen)
    distances_m, by_mission_m = dict(coverage.inspected_at_m), _inspection_distances_m(context, state.vehicles[vehicle])
    again: set[int] = set()
    for segment, how in segments:
        at_m = by_mission_m.get(segment)
        if segment in inspected:
            if not coverage.is_nearer_than_counted(segment, at_m):
                continue
            if requires_pictures(context, segment):
                unseen[segment] = AwaitedPictures(vehicle, now_s, at_m)
                continue
            again.add(segment)
        if at_m is not None:
            distances_m[segment] = at_m
        if how is not None:
            passes[segment] = how
        if requires_pictures(context, segment):
            unseen[segment] = AwaitedPictures(vehicle, now_s)
        else:
            inspected[segment] = vehicle
    coverage = replace(
        coverage,
        inspected=MappingProxyType(inspected),
        flown=MappingProxyType(passes),
        inspected_at_m=MappingProxyType(distances_m),
        inferred=coverage.inferred - again,
        unseen=MappingProxyType(unseen) if unseen else coverage.unseen,
    )
    return replace(state, coverage=coverage)


def _inspection_distances_m(context: Context, vehicle: VehicleState) -> Mapping[int, float]:
    """Return the distances at which the mission on board inspects; empty if every vehicle inspects in its layer.

    For a segment that it visits again later, the distance of the first visit.
    """
    board, found = vehicle.assignment.board, dict[int, float]()
    if board is None or not context.setup.inspection.same_distance:
        return found
    come_to = {point.visit for point in board.path.waypoints[: vehicle.assignment.waypoint + 1]}
    for number, at_m in enumerate(visit_distances_m(context.setup, board.path, board.visits)):
        segment = segment_of(board.visits[number])
        if segment not in found or number in come_to:
            found[segment] = at_m
    return found


def record_passed_pylons(context: Context, state: FleetState, before: VehicleState, now_s: float) -> FleetState:
    """Record pylons as flown once the vehicle reports an item past their last viewpoint.

    Of viewpoints passed without contact, one counts as left without a picture.
    """
    vehicle = state.vehicles[before.name]
    board, was, now = vehicle.assignment.board, before.assignment.waypoint, vehicle.assignment.waypoint
    if not context.setup.looks.pylons or board is None or now <= was or before.assignment.board is not board:
        return state
    done = [
        (board.tracks[point.visit].segment, None)
        for point in board.path.waypoints[was:now]
        if point.phase is Phase.INSPECT and point.visit is not None and board.tracks[point.visit].by_pictures
    ]
    passed = {capture for point in board.path.waypoints[was:now] for capture in point.captures if capture.points}
    for camera, component in sorted({(one.camera, one.camera_id) for one in passed}):
        memory = vehicle.payload.camera_of(camera, component)
        memory = replace(memory, left_behind=memory.left_behind + 1)
        vehicle = replace(vehicle, payload=vehicle.payload.with_camera(memory))
    state = state.put(vehicle) if passed else state
    return record_flown_segments(context, state, vehicle.name, done, now_s) if done else state


def describe_unseen_parts(context: Context, segment: int, caught: Iterable[tuple[str, float]]) -> list[str]:
    """Return in words the parts of a segment that pictures do not show; empty if they show all."""
    pylon = context.setup.looks.pylons.get(segment)
    if pylon is not None:
        had = {int(at_m) for camera, at_m in caught if camera == pylon.camera}
        gone = [str(number + 1) for number in range(len(pylon.points)) if number not in had]
        missed = pictures.VIEWPOINTS_MISSED.format(camera=pylon.camera, viewpoints=", ".join(gone))
        return [missed] if gone else []
    begin_m, end_m = context.setup.tracks_m[segment]
    length_m = float(((end_m - begin_m) ** 2).sum() ** 0.5)
    words = []
    for look in context.setup.looks.spans.get(segment, ()):
        places = [at_m for camera, at_m in caught if camera == look.camera]
        stretches = find_unseen_stretches(length_m, places, max_picture_spacing_m(look, context.inspection_speed_m_s))
        if stretches:
            where = ", ".join(pictures.STRETCH.format(begin_m=begin_m, end_m=end_m) for begin_m, end_m in stretches)
            missed = pictures.STRETCHES_MISSED.format(camera=look.camera, stretches=where, length_m=length_m)
            words.append(missed)
    return words


def max_picture_spacing_m(look: SpanCameraTask, speed_m_s: float) -> float:
    """Return the largest distance between two adjacent pictures."""
    if look.trigger is Trigger.VIDEO:
        return FILM_REPORT_S * speed_m_s + PICTURE_DELAY_M
    return SPACING_FACTOR * look.every_m + PICTURE_DELAY_M


def find_unseen_stretches(length_m: float, seen_at_m: Iterable[float], most_m: float) -> list[tuple[float, float]]:
    """Return the stretches of a span that no picture shows, from a.

    Args:
        length_m: Length of the span's flight track.
        seen_at_m: Distances along it of the pictures that count.
        most_m: Largest distance between two of them, and of the first and last one from the ends.

    >>> find_unseen_stretches(40.0, [0.0, 10.0, 30.0, 40.0], 15.0)
    [(10.0, 30.0)]
    """
    places = sorted(min(max(at_m, 0.0), length_m) for at_m in seen_at_m)
    return [
        (before, after)
        for before, after in zip([0.0, *places], [*places, length_m], strict=True)
        if after - before > most_m
    ]


def find_missed_segments(context: Context, state: FleetState) -> frozenset[int]:
    """Return the segments flown and not seen, including those whose reports may still come."""
    waiting = {
        segment
        for segment in set(state.coverage.unseen) - set(state.coverage.inspected)
        if describe_unseen_parts(context, segment, state.coverage.caught.get(segment, ()))
    }
    return frozenset(waiting | set(state.coverage.not_seen) - set(state.coverage.inspected))


def judge_pictures(context: Context, state: FleetState, now_s: float) -> Stepped:
    """Request lost reports again, and judge flown segments."""
    if not context.setup.looks:
        return state, ()
    state, asked = _request_lost_pictures(state, now_s)
    commands: list[Command] = list(asked)
    for segment, waits in state.coverage.unseen.items():
        caught = state.coverage.caught if waits.nearer_m is None else state.coverage.caught_nearer
        why = describe_unseen_parts(context, segment, caught.get(segment, ()))
        if why and now_s - waits.since_s < PICTURE_TIMEOUT_S:
            continue
        unseen = {one: other for one, other in state.coverage.unseen.items() if one != segment}
        state = state.with_coverage(unseen=MappingProxyType(unseen))
        if waits.nearer_m is None:
            state, more = _judge_segment(context, state, segment, waits.vehicle, why)
        else:
            state, more = _judge_nearer_pictures(context, state, segment, waits.vehicle, waits.nearer_m, why)
        commands.extend(more)
    return state, tuple(commands)


def _judge_segment(context: Context, state: FleetState, segment: int, vehicle: str, why: list[str]) -> Stepped:
    coverage = state.coverage
    if not why:
        return state.with_coverage(inspected=MappingProxyType({**coverage.inspected, segment: vehicle})), ()
    passes = MappingProxyType({one: how for one, how in coverage.flown.items() if one != segment})
    not_seen = MappingProxyType({**coverage.not_seen, segment: vehicle})
    said = pictures.NOT_SEEN.say(vehicle=vehicle, segment=context.segment_name(segment), why="; ".join(why))
    return state.with_coverage(flown=passes, not_seen=not_seen), (said,)


def _judge_nearer_pictures(
    context: Context, state: FleetState, segment: int, vehicle: str, at_m: float, why: list[str]
) -> Stepped:
    """Judge a segment that counts already by its closer pictures, if they cover it."""
    coverage, name = state.coverage, context.segment_name(segment)
    others = {one: had for one, had in coverage.caught_nearer.items() if one != segment}
    state = state.with_coverage(caught_nearer=MappingProxyType(others))
    if why:  # no line for a segment reopened meanwhile
        said = pictures.COUNTS_AS_BEFORE.say(vehicle=vehicle, segment=name, why="; ".join(why))
        return state, (said,) if segment in coverage.inspected else ()
    return state.with_coverage(
        inspected=MappingProxyType({**coverage.inspected, segment: vehicle}),
        inspected_at_m=MappingProxyType({**coverage.inspected_at_m, segment: at_m}),
        caught=MappingProxyType({**coverage.caught, segment: coverage.caught_nearer.get(segment, ())}),
        inferred=coverage.inferred - {segment},
    ), ()


def _request_lost_pictures(state: FleetState, now_s: float) -> Stepped:
    commands: list[Command] = []
    for vehicle in state.vehicles.values():
        # An autopilot reports each picture once.
        cameras = [one for one in vehicle.payload.cameras if one.component >= FIRST_COMPONENT]
        payload = vehicle.payload
        for camera in cameras if vehicle.stage in IN_THE_AIR and not vehicle.link.stale else ():
            due = [one for one in camera.wanted if one.tries < MAX_REQUESTS and now_s - one.at_s >= REQUEST_INTERVAL_S][
                :REQUESTS_AT_ONCE
            ]
            if due:
                asked = {one.sequence: WantedPicture(one.sequence, one.tries + 1, now_s) for one in due}
                wanted = tuple(asked.get(one.sequence, one) for one in camera.wanted)
                payload = payload.with_camera(replace(camera, wanted=wanted))
                commands += [AskPicture(vehicle.name, camera.component, one.sequence) for one in due]
        if payload is not vehicle.payload:
            state = state.put(replace(vehicle, payload=payload))
    return state, tuple(commands)
