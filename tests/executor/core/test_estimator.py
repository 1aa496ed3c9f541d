"""The filter: what it learns, how sure it is, and what it does not believe."""

from __future__ import annotations

import random

import pytest

from executor.core import estimator
from executor.core.drift import Drift, exceeds, followed
from executor.core.estimator import Estimate, Prior, Projection
from executor.core.voltage import Report, Thresholds, VoltageState, measured

RATE = 0.04


def flown(factor: float, seconds: int, period: int = 1) -> Estimate:
    charge, known = 100.0, estimator.begun(100.0, Prior())
    for _ in range(0, seconds, period):
        charge -= RATE * period * factor
        known = estimator.flown(known, RATE * period, period)
        known = estimator.corrected(known, round(charge), period)
    return known


@pytest.mark.parametrize("factor", [0.8, 1.0, 1.4])
def test_the_factor_is_learned_with_its_uncertainty(factor: float) -> None:
    early, late = flown(factor, 60), flown(factor, 1200)
    assert late.factor == pytest.approx(factor, abs=3 * late.factor_sd)
    assert late.factor_sd < early.factor_sd < Prior().sd + 0.1


def test_the_projection_is_less_sure_the_farther_it_goes() -> None:
    known = flown(1.0, 600)
    near, far = estimator.projected(known, 5.0), estimator.projected(known, 40.0)
    assert near.sd_pct < far.sd_pct
    assert far.mean_pct == pytest.approx(known.remaining_pct - 40.0 * known.factor)


def test_the_projection_means_what_it_says() -> None:
    """Of many flights about one in ten lands below the tenth percentile of its projection."""
    rng, below = random.Random(5), 0
    for _ in range(300):
        factor, charge, known = rng.gauss(1.0, 0.15), 100.0, estimator.begun(100.0, Prior())
        for _ in range(300):
            charge -= RATE * factor
            known = estimator.corrected(estimator.flown(known, RATE, 1.0), round(charge), 1.0)
        ahead = estimator.projected(known, RATE * 600)
        below += ahead.chance_below(charge - RATE * 600 * factor) < 0.1
    assert 0 <= below / 300 < 0.2


def test_a_jump_says_nothing_of_the_consumption() -> None:
    known = flown(1.0, 600)
    after = estimator.corrected(known, known.remaining_pct - 8.0, 1.0)
    assert after.factor == known.factor
    assert after.remaining_pct == pytest.approx(known.remaining_pct - 8.0)


def test_chances() -> None:
    assert Projection(20.0, 2.0).chance_below(14.0) == pytest.approx(0.00135, abs=1e-4)


def followed_by(*used: float, expected: float = 0.1) -> Drift:
    drift = Drift()
    for number, one in enumerate(used):
        drift = followed(
            drift, one, expected, slack_pct=0.25 * expected, elapsed_s=1.0, now_s=float(number), memory_s=90.0
        )  # fmt: skip
    return drift


def test_a_drain_goes_on_and_a_jump_does_not() -> None:
    assert exceeds(followed_by(*[0.5] * 10), 2.0, 8.0)
    assert not exceeds(followed_by(*[0.1] * 5, 4.0, *[0.1] * 5), 2.0, 8.0)
    assert not exceeds(followed_by(*[0.1] * 100), 2.0, 8.0)
    assert followed_by(0.5, 0.5).since_s == -1.0


def test_a_second_jump_soon_is_counted() -> None:
    twice = followed_by(4.0, *[0.1] * 5, 4.0)
    assert twice.excess_pct > 3.5


def test_two_jumps_running_are_one_fall() -> None:
    """Nothing is corrected twice running; both count then, and two reports are enough."""
    falls = followed_by(4.0, 4.0)
    assert falls.excess_pct > 7.0
    assert falls.reports == 2
    assert exceeds(falls, 2.0, 80.0)


LIMITS = Thresholds(step=0.05, low_v=3.1, spread_v=0.2)


def volts(*reports: tuple[float, float | None], flying: bool = True) -> VoltageState:
    state = VoltageState()
    for second, (pack, current) in enumerate(reports):
        state = measured(state, Report(pack, current), LIMITS, float(second), flying=flying)
    return state


def test_a_load_explains_a_voltage() -> None:
    climbs = volts(*[(12.0, 30.0)] * 30, *[(11.65, 60.0)] * 3)
    assert climbs.drop < 0.01
    steps = volts(*[(12.0, 30.0)] * 30, *[(10.6, 32.0)] * 3)
    assert steps.drop > 0.05
    assert steps.dropped_s == 30.0


def test_a_voltage_falls_slowly_by_itself() -> None:
    empties = volts(*[(12.6 - 0.004 * second, 30.0) for second in range(300)])
    assert empties.dropped_s is None


def test_on_the_ground_nothing_is_usual() -> None:
    assert volts(*[(12.6, 0.0)] * 30, flying=False).usual_v is None


def test_cells() -> None:
    state = VoltageState()
    for second in range(20):
        cells = (3.8, 3.8, 3.4)
        state = measured(state, Report(sum(cells), 20.0, cells), LIMITS, float(second), flying=True)
    assert state.spread_v == pytest.approx(0.4)
    assert state.spread_since_s == 0.0
    assert state.cells == 3
    assert VoltageState(highest_v=13.05, voltage_v=13.05).cells == 3, "cells that are charged higher"
