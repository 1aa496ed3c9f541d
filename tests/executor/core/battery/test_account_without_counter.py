"""Percentages that are not what their counter counts, and stretches that say nothing of what is used."""

from __future__ import annotations

import pytest

from executor.core.battery import account
from executor.core.battery.account import MIN_FACTOR, BatteryState
from executor.core.battery.charge_counter import ChargeCounter
from executor.core.battery.kalman import Prior
from executor.core.fault_thresholds import Limits

RATE_PCT_S = 0.036
ANY = Prior(2.2, 0.8)
LIMITS = Limits()


def fed(state: BatteryState, percents: list[float], *, from_s: float, period_s: float = 1.0, ah_s: float | None = None,
        from_ah: float = 0.0) -> BatteryState:  # fmt: skip
    """Return a battery after reports, one a period; its counter runs by `ah_s` a second."""
    for index, percent in enumerate(percents):
        now_s = from_s + index * period_s
        state = account.add_modelled_use(state, RATE_PCT_S * period_s)
        if ah_s is not None:
            state = account.apply_consumed_report(state, from_ah + index * period_s * ah_s, now_s)
        state = account.apply_remaining_report(state, percent, 1, now_s, ANY)
    return state


def test_what_is_usual_is_unknown_while_a_percentage_stands_still() -> None:
    """Recorded: 100 % for 106 s in the air, then 3 % in 15 s, where 'nothing was usual'."""
    stood = fed(BatteryState(), [100.0] * 110, from_s=0.0, ah_s=0.003)
    assert stood.stood
    assert account.is_blind(stood)
    assert stood.usual == ANY.factor
    moved = fed(stood, [99.0, 98.0, 98.0, 97.0], from_s=110.0, period_s=5.0, ah_s=0.003, from_ah=0.33)
    assert moved.drift.excess_pct < LIMITS.blind_excess_pct
    assert account.has_running_counter(moved)


@pytest.mark.parametrize("per_report", [0.0, 0.01])
def test_no_vehicle_is_taken_to_fly_on_nothing(per_report: float) -> None:
    state = fed(BatteryState(), [90.0 - per_report * n for n in range(60)], from_s=0.0)
    assert state.usual >= MIN_FACTOR
    assert state.usual_long >= MIN_FACTOR


def test_a_percentage_that_does_not_follow_its_counter_is_blind() -> None:
    fast = fed(BatteryState(), [90.0 - 0.5 * n for n in range(13)], from_s=0.0, ah_s=0.02)
    assert not account.is_blind(fast)
    slow = fed(fast, [84.0 - 0.2 * n for n in range(40)], from_s=13.0, ah_s=0.02, from_ah=0.26)
    assert account.is_blind(slow)
    assert slow.charge.capacity_ah is None or not slow.charge.follows


def test_a_percentage_that_rises_in_flight_is_read_off_the_voltage() -> None:
    state = fed(BatteryState(), [80.0, 79.0, 78.0, 81.0], from_s=0.0, ah_s=0.003)
    assert account.is_blind(state)


def test_a_learned_capacity_stays_near_the_one_that_is_set() -> None:
    falling = [90.0 - n // 10 for n in range(80)]
    free = fed(BatteryState(), falling, from_s=0.0, ah_s=0.004)
    assert free.charge.capacity_ah == pytest.approx(4.0, rel=0.1)
    bound = fed(BatteryState(charge=ChargeCounter(set_ah=10.0)), falling, from_s=0.0, ah_s=0.004)
    assert bound.charge.capacity_ah is None  # its percentage is not this counter by this capacity
    fits = fed(BatteryState(charge=ChargeCounter(set_ah=4.2)), falling, from_s=0.0, ah_s=0.004)
    assert fits.charge.capacity_ah == pytest.approx(4.0, rel=0.1)


def test_no_pack_lasts_for_seconds() -> None:
    """A counter that jumps is no capacity."""
    state = fed(BatteryState(), [90.0] + [80.0] * 4, from_s=0.0, ah_s=0.0001)
    assert state.charge.capacity_ah is None


def test_a_second_flight_starts_with_the_factor_learned_before() -> None:
    first = fed(BatteryState(), [90.0 - 0.08 * n for n in range(200)], from_s=0.0, ah_s=0.003)
    assert not account.is_blind(first)
    anew = account.rebase_account(first, 84.0, 1, 300.0, ANY)
    assert anew.drift.excess_pct == 0.0
    assert anew.estimate is not None
    assert first.estimate is not None
    assert anew.estimate.factor == pytest.approx(first.estimate.factor)
    assert anew.given_pct == first.given_pct
    assert anew.charge.mark == (84.0, anew.charge.consumed_ah)
    blind = fed(BatteryState(), [90.0 - 0.08 * n for n in range(200)], from_s=0.0)
    again = account.rebase_account(blind, 84.0, 1, 300.0, ANY)
    assert again.estimate is not None
    assert again.estimate.factor == ANY.factor  # what a blind percentage taught is no knowledge


def test_what_a_stranger_uses_from_the_start_is_no_drain() -> None:
    """Recorded: 17 % in 78 s at a steady 25 A, where an aircraft that nobody knew was expected to use 8."""
    percents = [float(int(99.0 - 6.0 * RATE_PCT_S * n)) for n in range(240)]
    steady = [fed(BatteryState(), percents[:count], from_s=0.0) for count in (60, 90, 120, 150)]
    assert steady[-1].estimate is not None
    assert steady[-1].estimate.factor == pytest.approx(6.0, rel=0.1)
    assert max(one.slow.excess_pct for one in steady) < 0.5 * LIMITS.slow_blind_pct
    thirsty = [percents[149] - 12.0 * RATE_PCT_S * n for n in range(90)]
    later = fed(steady[-1], [float(int(one)) for one in thirsty], from_s=150.0)
    assert later.slow.excess_pct >= LIMITS.slow_blind_pct, "twice as much is one, once its usual is known"
