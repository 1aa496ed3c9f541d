"""What a labelled pack's earlier flights say of it."""

from __future__ import annotations

import pytest

from executor.core.battery.pack_condition import RECENT_FLIGHTS, PackFlightRecord, PackHistory, build_pack_history

WORN = build_pack_history("A7", [PackFlightRecord(3.5, 0.024, 5.0)] * 4)
PLANNED_AH = 5.0


def test_a_worn_pack_and_what_may_be_used_of_it() -> None:
    assert WORN.capacity_ah == pytest.approx((3.5, 0.105))
    assert WORN.ohm == pytest.approx((0.024, 0.0048))
    assert WORN.budget_pct(75.0, 15.0, PLANNED_AH) == pytest.approx(55.0)
    assert WORN.empty_reading_pct(PLANNED_AH, counts=True) == pytest.approx(30.0)


@pytest.mark.parametrize(
    ("set_ah", "counts", "empty_pct"),
    [
        (5.0, True, 30.0),
        (3.5, True, 0.0),  # its autopilot was told the truth
        (None, True, 30.0),
        (None, False, 0.0),  # its percentage is read off the voltage
    ],
)
def test_what_is_reported_of_an_empty_pack(set_ah: float | None, counts: bool, empty_pct: float) -> None:
    known = build_pack_history("A7", [PackFlightRecord(3.5, None, set_ah)])
    assert known.empty_reading_pct(PLANNED_AH, counts=counts) == pytest.approx(empty_pct)
    assert known.budget_pct(75.0, 15.0, PLANNED_AH) == pytest.approx(55.0)


@pytest.mark.parametrize("capacity_ah", [4.76, 5.0, 6.0, None])
def test_a_pack_that_is_as_it_should_be_changes_nothing(capacity_ah: float | None) -> None:
    known = build_pack_history("B1", [PackFlightRecord(capacity_ah, None, 5.0)])
    assert (known.budget_pct(75.0, 15.0, PLANNED_AH), known.empty_reading_pct(PLANNED_AH, counts=True)) == (75.0, 0.0)


def test_a_pack_at_its_end_has_hardly_a_budget() -> None:
    assert build_pack_history("C2", [PackFlightRecord(0.5, None, 5.0)]).budget_pct(75.0, 15.0, PLANNED_AH) == 1.0


def test_its_last_flights_count_and_one_strange_one_does_not() -> None:
    flights = [PackFlightRecord(5.0, 0.01, 5.0)] * 9 + [
        PackFlightRecord(one, 0.02, 5.0) for one in (3.5, 3.5, 9.0, 3.4, 3.6)
    ]
    known = build_pack_history("A7", flights)
    assert (known.flights, RECENT_FLIGHTS) == (14, 5)
    assert known.capacity_ah is not None
    assert known.capacity_ah[0] == 3.5
    assert known.capacity_ah[1] > 1.0


def test_a_pack_that_was_never_flown() -> None:
    assert build_pack_history("new", []) == PackHistory("new")
