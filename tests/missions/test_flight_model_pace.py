"""What a vehicle's pace makes of the times of its legs."""

from __future__ import annotations

from dataclasses import replace

import pytest

from missions import Pace, Phase, estimate
from tests.missions.test_flight_model_estimate import MODEL, OUT_AND_HOME


def test_take_offs_and_landings_are_as_the_model_has_them() -> None:
    assert [Pace(1.2, 1.1).factor_of(phase) for phase in Phase] == [1.0, 1.1, 1.2, 1.1, 1.0]


def test_legs_take_longer_and_use_more_by_what_they_are_for() -> None:
    slow = estimate(OUT_AND_HOME, replace(MODEL, pace=Pace(inspect=1.2, transit=1.1)))
    usual = estimate(OUT_AND_HOME, MODEL)
    for key in ("duration_s", "energy_pct"):
        ratios = [getattr(one, key) / getattr(other, key) for one, other in zip(slow.legs, usual.legs, strict=True)]
        assert ratios == pytest.approx([1.0, 1.1, 1.2, 1.1, 1.0])


def test_two_paces_make_one() -> None:
    both = Pace(1.2, 1.1).combine(Pace(0.5, 2.0))
    assert (both.inspect, both.transit) == pytest.approx((0.6, 2.2))
