"""What is looked at again by an operator's word: what is in doubt, or one span or pylon whatever is known of it."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import replace
from types import MappingProxyType
from typing import TypeVar

from executor.core.context import Context
from executor.core.intents import IntentReason
from executor.core.seeing import proof
from executor.core.state import Coverage, FleetState

T = TypeVar("T")


def in_doubt(context: Context, state: FleetState) -> frozenset[int]:
    """Return what counts by evidence alone, and what was flown and is not seen."""
    return state.coverage.unproven() | proof.missed(context, state)


def named(context: Context, asset: str) -> frozenset[int]:
    """Return the segments of this name that are to be inspected."""
    return frozenset(segment for segment in context.wanted if context.segment_name(segment) == asset)


def to_look_again(context: Context, state: FleetState, asset: str) -> frozenset[int]:
    """Return what an operator's word has flown again; nothing where that is open as it is.

    Args:
        context: The site and the plan.
        state: The fleet.
        asset: The name of one span or pylon; empty for all that is in doubt.
    """
    if not asset:
        return in_doubt(context, state)
    known = state.coverage
    done = set(known.inspected) | set(known.unseen) | known.given_up | proof.missed(context, state)
    return named(context, asset) & done


def not_again(context: Context, state: FleetState, asset: str) -> tuple[IntentReason, str] | None:
    """Return why nothing is looked at again; None where something is."""
    if to_look_again(context, state, asset):
        return None
    if not asset:
        return IntentReason.NOTHING_TO_PLAN, "every segment that counts was proven by positions"
    if not named(context, asset):
        return IntentReason.ASSET_UNKNOWN, f"there is no span or pylon {asset!r} in the plan"
    return IntentReason.ASSET_OPEN, f"{asset} is still to be flown"


def opened_again(coverage: Coverage, again: Collection[int], *, anew: bool) -> Coverage:
    """Return what is known of the line, with these open again.

    Args:
        coverage: What is known.
        again: What is looked at again.
        anew: Whether as if nobody had been there: no pictures are waited for, and no attempts counted.
    """
    counted = set(again) & set(coverage.inspected)
    return replace(
        coverage,
        inspected=_without(coverage.inspected, again),
        flown=_without(coverage.flown, again),
        inferred=coverage.inferred - frozenset(again),
        given_up=coverage.given_up - frozenset(again),
        caught=_without(coverage.caught, again),
        unseen=_without(coverage.unseen, again) if anew else coverage.unseen,
        attempts=_without(coverage.attempts, again) if anew else coverage.attempts,
        # What was missed once and seen later is not missed now: somebody wants it better.
        not_seen=tuple(one for one in coverage.not_seen if not anew or one.segment not in counted),
    )


def _without(known: Mapping[int, T], gone: Collection[int]) -> Mapping[int, T]:
    return MappingProxyType({segment: one for segment, one in known.items() if segment not in gone})
