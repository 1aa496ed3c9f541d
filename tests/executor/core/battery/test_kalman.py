"""The filter: what it learns, how sure it is, and what it does not believe."""

from __future__ import annotations

import math
import random

import pytest

from executor.core.battery import kalman
from executor.core.battery.cusum import Drift, add_usage, is_drain
from executor.core.battery.kalman import BatteryEstimate, Prior, Projection
from executor.core.battery.voltage import VoltageReport, VoltageState, apply_voltage_report
from executor.core.fault_thresholds import Limits

RATE = 0.04


def flown(factor: float, seconds: int, period: int = 1) -> BatteryEstimate:
    charge, known = 100.0, kalman.initialise_estimate(100.0, Prior())
    for _ in range(0, seconds, period):
        charge -= RATE * period * factor
        known = kalman.predict_estimate(known, RATE * period, period)
        known = kalman.correct_with_report(known, round(charge), period)
    return known


@pytest.mark.parametrize("factor", [0.8, 1.0, 1.4])
def test_the_factor_is_learned_with_its_uncertainty(factor: float) -> None:
    early, late = flown(factor, 60), flown(factor, 1200)
    assert late.factor == pytest.approx(factor, abs=3 * late.factor_sd)
    assert late.factor_sd < early.factor_sd < Prior().sd + 0.1


def test_the_projection_is_less_sure_the_farther_it_goes() -> None:
    known = flown(1.0, 600)
    near, far = kalman.project_remaining(known, 5.0), kalman.project_remaining(known, 40.0)
    assert near.sd_pct < far.sd_pct
    assert far.mean_pct == pytest.approx(known.remaining_pct - 40.0 * known.factor)


def test_the_projection_means_what_it_says() -> None:
    """Of many flights about one in ten lands below the tenth percentile of its projection."""
    rng, below = random.Random(5), 0
    for _ in range(300):
        factor, charge, known = rng.gauss(1.0, 0.15), 100.0, kalman.initialise_estimate(100.0, Prior())
        for _ in range(300):
            charge -= RATE * factor
            known = kalman.correct_with_report(kalman.predict_estimate(known, RATE, 1.0), round(charge), 1.0)
        ahead = kalman.project_remaining(known, RATE * 600)
        below += ahead.chance_below(charge - RATE * 600 * factor) < 0.1
    assert 0 <= below / 300 < 0.2


def test_a_jump_says_nothing_of_the_consumption() -> None:
    known = flown(1.0, 600)
    after = kalman.correct_with_report(known, known.remaining_pct - 8.0, 1.0)
    assert after.factor == known.factor
    assert after.remaining_pct == pytest.approx(known.remaining_pct - 8.0)


def test_chances() -> None:
    assert Projection(20.0, 2.0).chance_below(14.0) == pytest.approx(0.00135, abs=1e-4)


def followed_by(*used: float, expected: float = 0.1) -> Drift:
    drift = Drift()
    for number, one in enumerate(used):
        drift = add_usage(
            drift, one, expected, slack_pct=0.25 * expected, elapsed_s=1.0, now_s=float(number), memory_s=90.0
        )  # fmt: skip
    return drift


def test_a_drain_continues_and_a_jump_does_not() -> None:
    assert is_drain(followed_by(*[0.5] * 10), 2.0, 8.0)
    assert not is_drain(followed_by(*[0.1] * 5, 4.0, *[0.1] * 5), 2.0, 8.0)
    assert not is_drain(followed_by(*[0.1] * 100), 2.0, 8.0)
    assert followed_by(0.5, 0.5).since_s == -1.0


def test_a_second_jump_soon_is_counted() -> None:
    twice = followed_by(4.0, *[0.1] * 5, 4.0)
    assert twice.excess_pct > 3.5


def test_two_jumps_running_are_one_fall() -> None:
    """Nothing is corrected twice running; both count then, and two reports are enough."""
    falls = followed_by(4.0, 4.0)
    assert falls.excess_pct > 7.0
    assert falls.reports == 2
    assert is_drain(falls, 2.0, 80.0)


LIMITS = Limits(voltage_step=0.05, voltage_step_blind=0.05, cell_low_v=3.1, cell_spread_v=0.2)


def volts(*reports: tuple[float, float | None], flying: bool = True) -> VoltageState:
    state = VoltageState()
    for second, (pack, current) in enumerate(reports):
        state = apply_voltage_report(state, VoltageReport(pack, current), LIMITS, float(second), flying=flying)
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
        state = apply_voltage_report(state, VoltageReport(sum(cells), 20.0, cells), LIMITS, float(second), flying=True)
    assert state.spread_v == pytest.approx(0.4)
    assert state.spread_since_s == 0.0
    assert state.cells == 3
    assert VoltageState(highest_v=13.05, voltage_v=13.05).cells == 3, "cells that are charged higher"


def test_after_a_jump_it_is_as_sure_as_after_the_first_report() -> None:
    first, known = kalman.initialise_estimate(92.0, Prior()), flown(1.0, 600)
    after = kalman.reset_remaining(known, 92.0)
    assert (after.remaining_pct, after.var_remaining, after.covariance) == (92.0, first.var_remaining, 0.0)
    assert after.var_factor == known.var_factor


def test_a_report_that_is_rounded_to_percents_may_be_off_by_half_of_one() -> None:
    """The variance of a number that lies anywhere within a percent is a twelfth."""
    assert kalman.initialise_estimate(90.0, Prior()).var_remaining == pytest.approx(1.0 / 12.0)


def test_a_counter_is_believed_more_than_percents() -> None:
    known = kalman.predict_estimate(flown(1.0, 60), 1.0, 25.0)
    by_counter = kalman.correct_with_counter(known, known.remaining_pct + 0.5)
    by_percent = kalman.correct_with_report(known, known.remaining_pct + 0.5, 1.0)
    assert known.remaining_pct < by_percent.remaining_pct < by_counter.remaining_pct <= known.remaining_pct + 0.5
    assert by_counter.var_remaining < by_percent.var_remaining <= known.var_remaining


@pytest.mark.parametrize("seconds", [1, 60, 600])
def test_the_estimate_stays_between_what_was_carried_on_and_what_was_reported(seconds: int) -> None:
    known = flown(1.2, seconds)
    for off in (-2.0, -0.5, 0.5, 2.0):
        after = kalman.correct_with_report(known, known.remaining_pct + off, 1.0)
        moved = after.remaining_pct - known.remaining_pct
        assert 0.0 < moved / off < 1.0
        assert after.var_remaining <= known.var_remaining
        # Less left than expected: it uses more than was believed.
        assert (after.factor - known.factor) * off <= 0.0


def test_a_wavering_battery_is_followed_less() -> None:
    known = flown(1.0, 60)
    steady, rough = (
        kalman.correct_with_report(known, known.remaining_pct - 1.0, 1.0, roughness) for roughness in (0.0, 3.0)
    )
    assert steady.remaining_pct < rough.remaining_pct < known.remaining_pct


def test_reports_in_quick_succession_say_the_same_twice() -> None:
    known = flown(1.0, 60)
    soon, late = (kalman.correct_with_report(known, known.remaining_pct - 1.0, since_s) for since_s in (0.5, 60.0))
    assert late.remaining_pct < soon.remaining_pct


def test_on_the_ground_the_factor_does_not_wander() -> None:
    known = flown(1.0, 60)
    waited = kalman.predict_estimate(known, 0.0, 600.0)
    assert (waited.remaining_pct, waited.factor, waited.var_factor) == (
        known.remaining_pct,
        known.factor,
        known.var_factor,
    )
    assert kalman.predict_estimate(known, 1e-9, 600.0).var_factor > known.var_factor


def test_what_is_flown_costs_what_the_factor_says() -> None:
    known = BatteryEstimate(80.0, 1.5, 0.1, 0.0, 0.04)
    after = kalman.predict_estimate(known, 10.0, 100.0)
    assert after.remaining_pct == pytest.approx(65.0)
    # A factor that is off by 0.2 makes 10 % wrong by 2 %, and a high one leaves less.
    assert after.var_remaining == pytest.approx(0.1 + 4.0, rel=0.2)
    assert after.covariance == pytest.approx(-0.4)


CELLS = [
    # reported volts, cells that say so themselves, least number in series, weakest
    (12.6, (), 3, 4.2),
    (13.2, (), 3, 4.4),
    (13.3, (), 4, 3.325),
    (4.0, (), 1, 4.0),
    (11.0, (3.8, 3.8, 3.4), 3, 3.4),
]


@pytest.mark.parametrize(("pack", "cells", "number", "weakest"), CELLS)
def test_the_weakest_cell(pack: float, cells: tuple[float, ...], number: int, weakest: float) -> None:
    state = apply_voltage_report(VoltageState(), VoltageReport(pack, 20.0, cells), LIMITS, 0.0, flying=True)
    assert state.cells == number
    assert state.weakest_v == pytest.approx(weakest)
    assert VoltageState().weakest_v is None
    assert VoltageState(cells_v=(3.8,)).spread_v == 0.0
    assert VoltageState(cells_v=(3.8, 3.6)).spread_v == pytest.approx(0.2)


def test_a_low_cell_is_low_since_it_fell_and_no_longer_once_it_is_not() -> None:
    state = volts((12.6, 30.0), (9.3, 30.0), (9.2, 30.0), (9.2, 30.0))
    assert state.low_since_s == 2.0, "3.1 V is not below 3.1 V"
    assert apply_voltage_report(state, VoltageReport(9.4, 30.0), LIMITS, 4.0, flying=True).low_since_s is None


def test_nothing_is_compared_until_the_take_off_has_settled() -> None:
    assert volts(*[(12.0, 30.0)] * 8).usual_v is None
    assert volts(*[(12.0, 30.0)] * 9).usual_v == 12.0


def test_a_step_that_stays_for_a_minute_is_the_new_usual() -> None:
    steady = [(12.0, 30.0)] * 30
    assert volts(*steady, *[(10.8, 30.0)] * 60).usual_v == pytest.approx(12.0)
    after = volts(*steady, *[(10.8, 30.0)] * 61)
    assert (after.usual_v, after.dropped_s) == (10.8, None)


def test_half_the_threshold_is_no_noise() -> None:
    steady = [(12.0, 30.0)] * 30
    assert volts(*steady, (11.71, 30.0)).dropped_s is None
    assert volts(*steady, (11.69, 30.0)).dropped_s == 30.0
    assert volts(*steady, (11.4, None)).drop == pytest.approx(0.05)


def test_the_usual_follows_within_twenty_seconds() -> None:
    after = volts(*[(12.0, 30.0)] * 30, *[(11.9, 30.0)] * 20)
    assert after.usual_v == pytest.approx(11.9 + 0.1 / math.e, abs=0.003)


def one(drift: Drift, used: float, now_s: float, *, expected: float = 0.0, elapsed_s: float = 1.0) -> Drift:
    return add_usage(drift, used, expected, slack_pct=0.0, elapsed_s=elapsed_s, now_s=now_s, memory_s=math.inf)


def test_a_jump_is_set_aside_with_its_time_and_its_size() -> None:
    told = one(Drift(), 3.5, 100.0, expected=0.5)
    assert (told.excess_pct, told.reports, told.jumped_s, told.jumped_pct) == (0.0, 0, 100.0, 3.0)


@pytest.mark.parametrize(
    ("used", "elapsed_s", "jumps"),
    [
        (2.0, 1.0, False),
        (2.1, 1.0, True),
        (7.0, 6.0, True),
        (7.0, 6.1, False),
        (4.0, 4.0, False),
        (4.1, 4.0, True),
    ],
)
def test_what_is_a_jump(used: float, elapsed_s: float, *, jumps: bool) -> None:
    told = one(Drift(), used, 100.0, elapsed_s=elapsed_s)
    assert (told.excess_pct == 0.0) is jumps
    assert (told.jumped_s == 100.0) is jumps


def test_two_jumps_running_are_summed_and_one_a_while_later_is_alone() -> None:
    first = one(Drift(), 4.0, 100.0)
    fall = one(first, 5.0, 102.0)
    assert (fall.excess_pct, fall.used_pct, fall.reports, fall.biggest_pct) == (9.0, 9.0, 2, 5.0)
    assert (fall.since_s, fall.jumped_s, fall.jumped_pct) == (100.0, 102.0, 0.0)
    alone = one(first, 5.0, 102.1)
    assert (alone.excess_pct, alone.used_pct, alone.reports, alone.biggest_pct) == (5.0, 5.0, 1, 5.0)
    assert alone.since_s == 101.1
    assert one(first, 5.0, 160.0).excess_pct == 5.0
    assert one(first, 5.0, 160.1).excess_pct == 0.0, "after a minute it is another one that is set aside"


def test_the_sum_keeps_what_it_is_made_of() -> None:
    told = one(one(Drift(), 1.0, 100.0, expected=0.25), 1.5, 101.0, expected=0.25)
    assert (told.excess_pct, told.used_pct, told.expected_pct) == (2.0, 2.5, 0.5)
    assert (told.reports, told.biggest_pct, told.since_s, told.duration_s(105.0)) == (2, 1.25, 99.0, 6.0)
    assert Drift().duration_s(105.0) == 0.0
    assert one(told, -2.0, 102.0) == Drift()
    assert one(told, -1.9, 102.0).excess_pct == pytest.approx(0.1)


def test_an_excess_is_forgotten_but_for_a_third() -> None:
    told = add_usage(Drift(3.0), 0.0, 0.0, slack_pct=0.0, elapsed_s=90.0, now_s=200.0, memory_s=90.0)
    assert told.excess_pct == pytest.approx(3.0 / math.e)


@pytest.mark.parametrize(
    ("excess", "biggest", "reports", "drain"),
    [
        (2.0, 0.8, 3, True),
        (1.9, 0.1, 9, False),
        (2.0, 0.9, 3, False),
        (2.0, 0.5, 2, False),
        (3.4, 1.0, 2, True),
        (3.3, 1.0, 2, False),
        (3.4, 1.0, 1, False),
        (8.0, 8.0, 1, True),
        (7.9, 7.9, 1, False),
    ],
)
def test_what_is_a_drain(excess: float, biggest: float, reports: int, *, drain: bool) -> None:
    told = Drift(excess_pct=excess, biggest_pct=biggest, reports=reports)
    assert is_drain(told, 2.0, 8.0) is drain


def test_a_landing_resets_the_usual_voltages() -> None:
    flown_v = volts(*[(12.0, 30.0)] * 30, (9.0, 30.0))
    assert flown_v.dropped_s is not None
    down = apply_voltage_report(flown_v, VoltageReport(9.0, 5.0), LIMITS, 31.0, flying=False)
    assert (down.usual_v, down.usual_a, down.drop, down.dropped_s, down.low_since_s, down.began_s) == (
        None, None, 0.0, None, None, None,
    )  # fmt: skip
    assert (down.highest_v, down.voltage_v) == (12.0, 9.0)
