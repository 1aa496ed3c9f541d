"""One span that somebody wants to see again: it is open again, planned like anything else, and told why not."""

from __future__ import annotations

from dataclasses import replace
from types import MappingProxyType

from executor.core.coverage import SegmentPass
from executor.core.intents import Action, IntentReason, Outcome
from executor.core.payload.pictures import Unseen
from executor.core.seeing.again import opened_again
from executor.core.state import Coverage
from tests.executor.core.stories import EVERYTHING, under_way

HOW = SegmentPass(3.0, 3.1, 0.2, 0.5)


def test_one_span_that_counts_is_flown_again() -> None:
    flight = under_way()
    flight.run(lambda: 2 in flight.state.coverage.inspected)
    flight.pass_s(3.0)
    record = flight.ask(Action.PROVE, asset="segment 2")
    assert (record.outcome, record.text) == (Outcome.ACCEPTED, "segment 2 flown again")
    assert 2 not in flight.state.coverage.inspected
    flight.run(lambda: bool(flight.solves()))
    assert 2 in flight.solves()[0].open_segments
    assert flight.solves()[0].trigger == "page asks for another look"
    flight.finish()
    assert flight.outcome(record).outcome is Outcome.DONE
    assert set(flight.state.coverage.inspected) == EVERYTHING


def test_what_is_open_or_unknown_is_refused_and_changes_nothing() -> None:
    flight = under_way()
    before = flight.state.coverage
    open_ = flight.ask(Action.PROVE, asset="segment 2")
    unknown = flight.ask(Action.PROVE, asset="V7")
    assert (open_.code, open_.text) == (IntentReason.ASSET_OPEN, "segment 2 is still to be flown")
    assert (unknown.code, unknown.text) == (IntentReason.ASSET_UNKNOWN, "there is no span or pylon 'V7' in the plan")
    assert flight.state.coverage == before


def test_it_is_open_as_if_nobody_had_been_there() -> None:
    known = Coverage(
        inspected=MappingProxyType({1: "uav1", 2: "uav2"}),
        flown=MappingProxyType({1: HOW, 2: HOW}),
        attempts=MappingProxyType({1: 2, 2: 2}),
        inferred=frozenset({1, 2}),
        given_up=frozenset({1, 3}),
        caught=MappingProxyType({1: (("rgb", 1.0),), 2: (("rgb", 2.0),)}),
        unseen=MappingProxyType({1: Unseen("uav1", 5.0), 2: Unseen("uav2", 6.0)}),
    )
    anew = opened_again(known, {1}, anew=True)
    assert [set(one) for one in (anew.inspected, anew.flown, anew.caught, anew.inferred)] == [{2}] * 4
    assert [set(one) for one in (anew.given_up, anew.attempts, anew.unseen)] == [{3}, {2}, {2}]
    # For proof alone pictures are still waited for, and attempts go on counting.
    assert opened_again(known, {1}, anew=False) == replace(anew, attempts=known.attempts, unseen=known.unseen)
