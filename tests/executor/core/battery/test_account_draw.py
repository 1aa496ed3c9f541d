"""What a battery has given, to less than a percent: budgets of 28 % are counted in it."""

from __future__ import annotations

import math

import pytest

from executor.core.battery import account
from executor.core.battery.account import BatteryState, draw_since_start_pct

CAPACITY_AH = 5.0
RATE_PCT_S = 0.05


def flown(until_s: int, *, cut_off: bool, counts: bool = True) -> tuple[BatteryState, float]:
    """Return the account of a flight from 100 % on, with a report every two seconds, and what it really gave."""
    state, given_pct = BatteryState(), 0.0
    for now_s in range(0, until_s, 2):
        given_pct = RATE_PCT_S * now_s
        left_pct = 100.0 - given_pct
        reported_pct = math.floor(left_pct + 1e-9) if cut_off else round(left_pct)
        if counts and now_s:
            state = account.apply_consumed_report(state, CAPACITY_AH * given_pct / 100.0, float(now_s))
        state = account.apply_remaining_report(state, float(reported_pct), 0, float(now_s))
        if now_s == 0 and counts:
            state = account.record_first_count(state, 0.0)
        state = account.add_modelled_use(state, 2 * RATE_PCT_S)
    return state, given_pct


@pytest.mark.parametrize("cut_off", [True, False], ids=["cut off", "rounded"])
@pytest.mark.parametrize("until_s", [200, 317, 333, 480])
def test_it_is_known_to_a_fifth_of_a_percent_however_percents_are_rounded(until_s: int, cut_off: bool) -> None:
    state, given_pct = flown(until_s, cut_off=cut_off)
    assert draw_since_start_pct(state) == pytest.approx(given_pct, abs=0.2)


def test_the_capacity_is_learned_from_step_to_step() -> None:
    state, _ = flown(400, cut_off=True)
    assert state.charge.capacity_ah == pytest.approx(CAPACITY_AH, rel=0.01)
    assert account.consumption_factor(state) == pytest.approx(1.0, abs=0.02)


def test_without_a_counter_it_is_what_the_filter_says() -> None:
    state, given_pct = flown(400, cut_off=False, counts=False)
    assert state.estimate is not None
    assert draw_since_start_pct(state) == 100.0 - state.estimate.remaining_pct == pytest.approx(given_pct, abs=0.5)


def test_nothing_is_spent_before_the_first_report() -> None:
    assert draw_since_start_pct(BatteryState()) == 0.0


def test_a_counter_that_started_again_does_not_count() -> None:
    state, _ = flown(400, cut_off=False)
    state = account.apply_consumed_report(state, 0.01, 401.0)
    assert state.estimate is not None
    assert draw_since_start_pct(state) == 100.0 - state.estimate.remaining_pct
