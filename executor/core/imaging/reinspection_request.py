"""Looking again at assets that an operator names: which segments they are, whether anybody can, and what is open then.

An asset is named as everywhere: a text is its name, which `pylon V101-4` may share with others, a number its segment.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from types import MappingProxyType

from executor.core.context import Context
from executor.core.interface.intents import IntentReason
from executor.core.replanning.survivors import find_barred_segments
from executor.core.state.fleet_state import Coverage, FleetState
from executor.core.state.inspection_run import SegmentPass

Objection = tuple[IntentReason, str]


def select_segments_to_reinspect(
    context: Context, state: FleetState, assets: Sequence[int | str]
) -> frozenset[int] | Objection:
    """Return the segments that are looked at again, or why one of the assets cannot be: nothing is done by halves."""
    # What no vehicle has a camera for that works.
    barred = [find_barred_segments(context, vehicle) for vehicle in state.vehicles.values()]
    blind = frozenset.intersection(*barred) if barred else frozenset[int]()
    again, coverage = set[int](), state.coverage
    for asset in assets:
        found = _segments_of(context, asset)
        if not found:
            return IntentReason.ASSET_UNKNOWN, _describe_unknown_asset(context, asset)
        flown = (found & context.wanted) - blind
        if not flown:
            return IntentReason.ASSET_NEVER_FLOWN, _describe_never_flown(context, min(found))
        # What nobody is to fly: it counts, its pictures are waited for, or it was given up.
        closed = flown & {*coverage.inspected, *coverage.unseen, *coverage.given_up}
        if not closed:
            return IntentReason.ASSET_OPEN, f"{context.segment_name(min(flown))} is open already"
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


def _describe_unknown_asset(context: Context, asset: int | str) -> str:
    if isinstance(asset, int):
        return f"there is no segment {asset}: expected 0 to {len(context.setup.network.segments) - 1}"
    return f"there is no asset {asset!r}: expected its name as the page and the plan have it, or its segment's number"


def _describe_never_flown(context: Context, segment: int) -> str:
    name = context.segment_name(segment)
    why = next((one.why for one in context.unreachable if one.segment == segment), "")
    if why:
        return f"{name} is never flown: it {why}"
    if segment not in context.wanted:
        return f"{name} is never flown: it is no part of this flight"
    cameras = " and ".join(sorted(context.setup.looks.cameras_for(segment)))
    return f"{name} is never flown: no vehicle has a camera {cameras} that works"
