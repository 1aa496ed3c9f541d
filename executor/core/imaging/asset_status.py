"""What became of each asset: of those that ask for pictures where a site does, else of all segments."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from enum import Enum

from executor.core.context import Context
from executor.core.imaging.picture_proof import find_missed_segments
from executor.core.replanning.replan_cycle import find_left_over_segments
from executor.core.state.fleet_state import Coverage, FleetState

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
