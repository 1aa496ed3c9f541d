"""The wait for an answer, from measured round trips (after RFC 6298)."""

from __future__ import annotations

import pytest

from executor.protocols.machine import RoundTrip


def test_the_first_answer_is_trusted_little_and_many_alike_much() -> None:
    trip = RoundTrip().record_round_trip(0.4)
    assert trip.waits_s == pytest.approx(0.4 + 2 * 0.2)
    for _ in range(20):
        trip = trip.record_round_trip(0.4)
    assert trip.waits_s == pytest.approx(0.4 + 0.1, abs=0.01)


def test_a_fast_link_is_not_asked_again_at_once() -> None:
    assert RoundTrip().record_round_trip(0.001).waits_s == 0.25


def test_without_an_answer_the_wait_doubles_up_to_a_limit() -> None:
    trip = RoundTrip(waits_s=1.0, most_s=3.0)
    assert trip.record_timeout().waits_s == 2.0
    assert trip.record_timeout().record_timeout().waits_s == 3.0
    assert trip.record_timeout().record_round_trip(0.1).waits_s == pytest.approx(0.25), (
        "an answer says how the link is now"
    )
