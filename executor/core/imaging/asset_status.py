"""What became of each asset, and looking again at those that an operator names.

Assets are those that ask for pictures where a site has any, else all segments. One is named as everywhere: a text is
its name, which `pylon V101-4` may share with others, a number its segment.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from enum import Enum
from types import MappingProxyType

from executor.core.context import Context
from executor.core.imaging.picture_proof import find_missed_segments
from executor.core.interface.intents import Reason, fill_in
from executor.core.lines import operator
from executor.core.replanning.replan_cycle import find_left_over_segments
from executor.core.replanning.survivors import find_barred_segments
from executor.core.state.fleet_state import Coverage, FleetState
from executor.core.state.inspection_run import SegmentPass

ROUNDED = 0.01
"""Of the distance between two pictures: a track of 99.999 m has room for as many as one of 100 m."""


class AssetState(Enum):
    """What became of an asset."""

    OPEN = "open"
    SEEN = "seen"
    """It counts: by its pictures, or by positions where it asks for none."""
    INFERRED = "inferred"
    """It counts by evidence alone."""
    MISSED = "missed"
    """It was flown, and pictures of it are missing; it is flown again."""
    GIVEN_UP = "given_up"
    """Nobody flies it any more in this flight."""
    LEFT_OVER = "left_over"
    """It is the next sortie's."""


@dataclass(frozen=True, slots=True)
class AssetView:
    """One asset."""

    segment: int
    state: AssetState
    pictures: int
    """How many there are of those that it asks for; a film is none."""
    asked: int
    """How many pictures it asks for; 0 where positions or a film prove it."""
    vehicle: str | None
    """Who has seen it, or flew it last; None where nobody did."""


AskedPictures = Mapping[int, Mapping[str, int]]
"""By segment: how many pictures it asks of each camera."""


def list_asked_pictures(context: Context) -> AskedPictures:
    """Return the assets that there are to show, with what each asks for; the same during a whole flight."""
    looks = context.setup.looks
    wanted = context.wanted & {*looks.spans, *looks.pylons} if looks else context.wanted
    return {segment: _count_asked_pictures(context, segment) for segment in sorted(wanted)}


def build_asset_views(context: Context, state: FleetState, asked: AskedPictures) -> tuple[AssetView, ...]:
    """Return what became of each of them, by their numbers."""
    gone, left = find_missed_segments(context, state), find_left_over_segments(state)
    flew = {one.segment: one.vehicle for one in state.coverage.not_seen}
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
    """Return how many pictures a segment asks of each camera."""
    looks = context.setup.looks
    pylon = looks.pylons.get(segment)
    if pylon is not None:
        return {pylon.camera: len(pylon.points)}
    begin_m, end_m = context.setup.tracks_m[segment]
    length_m = math.dist(begin_m, end_m)
    return {
        # The one at its beginning may be the last of the span before.
        look.camera: max(1, math.floor(length_m / look.every_m + ROUNDED))
        for look in looks.spans.get(segment, ())
        if look.every_m > 0
    }


def _count_pictures(coverage: Coverage, segment: int, asked: Mapping[str, int]) -> int:
    """Return how many of them there are: more of one camera do not stand for those that another lacks."""
    caught = set(coverage.caught.get(segment, ()))
    return sum(min(most, sum(one == camera for one, _ in caught)) for camera, most in asked.items()) if caught else 0


def select_segments_to_reinspect(
    context: Context, state: FleetState, assets: Sequence[int | str]
) -> frozenset[int] | Reason:
    """Return the segments that are looked at again, or why one of the assets cannot be: nothing is done by halves."""
    # What no vehicle has a camera for that works.
    barred = [find_barred_segments(context, vehicle) for vehicle in state.vehicles.values()]
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
        # What nobody is to fly: it counts, its pictures are waited for, or it was given up.
        closed = flown & {*coverage.inspected, *coverage.unseen, *coverage.given_up}
        if not closed:
            return fill_in(operator.ASSET_OPEN, asset=context.segment_name(min(flown)))
        again |= closed
    return frozenset(again)


def reopen_segments(coverage: Coverage, again: frozenset[int]) -> Coverage:
    """Return the coverage in which segments are open as if nobody had flown them."""
    was_seen = again & set(coverage.inspected)
    return replace(
        discard_proof(coverage, again),
        unseen=MappingProxyType({one: waits for one, waits in coverage.unseen.items() if one not in again}),
        # What was missed once and seen later is not missed now: somebody wants it better.
        not_seen=tuple(one for one in coverage.not_seen if one.segment not in was_seen),
        # It gets as many tries as anything that was never flown.
        attempts=MappingProxyType({one: tries for one, tries in coverage.attempts.items() if one not in again}),
    )


def discard_proof(coverage: Coverage, again: frozenset[int]) -> Coverage:
    """Return the coverage in which segments do not count, and what proved them does not either."""
    inspected: dict[int, str] = {one: by for one, by in coverage.inspected.items() if one not in again}
    flown: dict[int, SegmentPass] = {one: how for one, how in coverage.flown.items() if one not in again}
    return replace(
        coverage,
        inspected=MappingProxyType(inspected),
        flown=MappingProxyType(flown),
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
