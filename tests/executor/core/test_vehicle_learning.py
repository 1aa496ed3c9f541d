"""What legs say of a vehicle, in known numbers."""

from __future__ import annotations

import pytest

from executor.core import vehicle_learning
from executor.core.battery.kalman import Prior
from executor.core.vehicle_learning import BOUNDS, FIRST_SD, SMALLEST_SD, LearnedFactors, PaceEstimate, update_pace
from missions import Phase


def test_one_leg_in_known_numbers() -> None:
    after = update_pace(PaceEstimate(), 110.0, 100.0)
    gain = 0.0049 / (0.0049 + 0.0001 + 0.000225)
    assert after.mean == pytest.approx(1.0 + 0.1 * gain)
    assert after.var == pytest.approx(0.0049 * (1.0 - gain))
    # No two transits are alike: one says less.
    transit = vehicle_learning.learn_from_leg(LearnedFactors(), Phase.TRANSIT, 110.0, 100.0).transit
    assert transit.mean == pytest.approx(1.0 + 0.1 * 0.0049 / (0.0049 + 0.0001 + 0.0009))


def test_a_slow_vehicle_is_known_after_some_legs() -> None:
    known = LearnedFactors()
    for _ in range(10):
        known = vehicle_learning.learn_from_leg(known, Phase.INSPECT, 57.5, 50.0)
    assert known.inspect.mean == pytest.approx(1.15, abs=0.005)
    assert SMALLEST_SD <= known.inspect.sd < 0.02
    assert (known.inspect.legs, known.transit) == (10, PaceEstimate())


def test_an_outlier_moves_little_and_nothing_leaves_the_bounds() -> None:
    known = PaceEstimate(1.0, 0.02**2, 20)
    assert 1.0 < update_pace(known, 1000.0, 50.0).mean < 1.04
    slow = fast = PaceEstimate()
    for _ in range(200):
        slow, fast = update_pace(slow, 1000.0, 50.0), update_pace(fast, 1.0, 50.0)
    assert (fast.mean, slow.mean) == BOUNDS


@pytest.mark.parametrize(("flown_s", "planned_s"), [(10.0, 0.0), (10.0, 1.9), (0.0, 30.0), (-1.0, 30.0)])
def test_what_is_no_leg_says_nothing(flown_s: float, planned_s: float) -> None:
    assert update_pace(PaceEstimate(), flown_s, planned_s) == PaceEstimate()


def test_take_offs_and_landings_say_nothing_of_the_pace() -> None:
    for phase in (Phase.TAKEOFF, Phase.LAND):
        assert vehicle_learning.learn_from_leg(LearnedFactors(), phase, 60.0, 30.0) == LearnedFactors()


def test_consumption_is_as_sure_as_what_was_used_is_much() -> None:
    short = vehicle_learning.estimate_consumption(LearnedFactors(given_pct=2.3, modelled_pct=2.0), Prior())
    long = vehicle_learning.estimate_consumption(LearnedFactors(given_pct=46.0, modelled_pct=40.0), Prior())
    assert 1.0 < short.factor < long.factor < 1.15
    assert long.factor == pytest.approx(1.145, abs=0.001)
    assert SMALLEST_SD < long.sd < short.sd < Prior().sd
    assert vehicle_learning.estimate_consumption(LearnedFactors(), Prior(1.1, 0.05)) == Prior(1.1, 0.05)


def test_the_first_deviation_is_the_default() -> None:
    assert PaceEstimate().sd == pytest.approx(FIRST_SD)
