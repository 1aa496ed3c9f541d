"""Which transfer is next, and when a radio is too full for a request."""

from __future__ import annotations

import math

import pytest

from executor.core.interface.messages import Radio
from executor.core.radio_budget import FULL_BUFFER_PCT
from executor.protocols.machine import RoundTrip
from executor.protocols.turns import (
    STALLED_S,
    Rank,
    Turn,
    count_at_once,
    find_most_ahead,
    find_wait_s,
    is_buffer_full,
    is_next,
)

SOON, LATER = Turn(Rank.IN_FLIGHT, 12.0, 3), Turn(Rank.IN_FLIGHT, 40.0, 1)
PARAMETERS, READING = Turn(Rank.BEFORE_FLIGHT, math.inf, 0), Turn(Rank.BESIDE, math.inf, 2)


def test_the_most_urgent_goes_first_and_the_longest_waiting_among_equals() -> None:
    waiting = [PARAMETERS, LATER, READING, SOON]
    assert sorted(waiting) == [SOON, LATER, PARAMETERS, READING]
    assert [is_next(one, waiting, (), 100.0, 1) for one in waiting] == [False, False, False, True]
    assert Turn(Rank.BEFORE_FLIGHT, math.inf, 0) < Turn(Rank.BEFORE_FLIGHT, math.inf, 1)


def test_one_transfer_at_a_time_unless_it_does_not_come_on() -> None:
    assert not is_next(SOON, [SOON], [100.0], 100.0 + STALLED_S - 0.1, 1)
    assert is_next(SOON, [SOON], [100.0], 100.0 + STALLED_S, 1)
    assert not is_next(SOON, [SOON], [100.0, 101.0], 100.0 + STALLED_S, 1)


def test_where_answers_are_far_there_are_two_or_three() -> None:
    trips = (RoundTrip(), *(RoundTrip(mean_s=mean_s) for mean_s in (0.3, 0.7, 1.7)))
    assert [count_at_once(trip, None) for trip in trips] == [1, 1, 2, 3]
    assert count_at_once(trips[-1], Radio(200, 200, 50, 50, 40)) == 2, "they wait behind our own bytes"
    assert is_next(SOON, [SOON, LATER], [100.0], 100.5, 2)
    assert not is_next(SOON, [SOON, LATER], [100.0, 100.2], 100.5, 2)


@pytest.mark.parametrize(("alone", "ahead"), [(False, [16, 6, 10]), (True, [16, 24, 24])])
def test_fewer_items_are_in_flight_where_several_transfers_share_a_radio(alone: bool, ahead: list[int]) -> None:
    """Over firmware that loses frames 12 items go up in a round; alone, a vehicle has all of it."""
    trips = (RoundTrip(mean_s=mean_s) for mean_s in (0.3, 0.7, 1.7))
    assert [find_most_ahead(trip, None, alone=alone) for trip in trips] == ahead


def test_it_is_checked_again_when_the_last_one_may_have_stalled() -> None:
    assert find_wait_s((), 100.0, 1) == 0.0
    assert find_wait_s((99.0, 99.5), 100.0, 1) == pytest.approx(STALLED_S - 0.5)
    assert find_wait_s((99.0, 99.5), 100.0, 2) == pytest.approx(STALLED_S - 1.0), "one of two is enough"


@pytest.mark.parametrize(
    ("free_pct", "age_s", "full"),
    [(FULL_BUFFER_PCT - 1, 0.5, True), (FULL_BUFFER_PCT, 0.5, False), (0, 3.0, False), (None, 0.0, False)],
)
def test_a_buffer_is_full_by_a_report_of_just_now(free_pct: int | None, age_s: float, *, full: bool) -> None:
    radio = Radio(200, 200, 50, 50, free_pct)
    assert is_buffer_full(radio, 100.0, 100.0 + age_s) is full
    assert not is_buffer_full(None, -math.inf, 100.0)
