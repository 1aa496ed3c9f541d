"""What a battery has given, against what the flight should have cost."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from executor.core.battery import account
from executor.core.battery.account import FACTOR_RANGE, BatteryState, PercentRounding
from executor.core.battery.charge_counter import PercentTransition
from executor.core.inflight.faults import watchpoints
from executor.core.inflight.faults.watch_view import WatchView
from executor.core.interface.messages import Battery, SystemStatus
from executor.core.state.vehicle_state import Stage
from executor.core.telemetry.message_update import apply_message
from missions import dialect_for
from tests.executor.builders import fleet_of, vehicle, with_facts

FLEET = fleet_of()
RATE_PCT_S = 0.036
"""What the model says of a flight at inspection speed: about 46 minutes for a full battery."""


def reports(
    minutes: float, *, consumption: float = 1.0, period_s: float = 1.0, step_pct: float = 0.0, step_s: float = math.inf,
    drain: float = 1.0, drain_s: float = math.inf, quantum_pct: float = 1.0,
) -> Iterator[tuple[float, BatteryState]]:  # fmt: skip
    """Yield a battery after each of its reports; from `drain_s` on it drains faster, at `step_s` points are lost."""
    state, charge = BatteryState(), 100.0
    for index in range(round(minutes * 60 / period_s)):
        now_s = index * period_s
        if index:
            factor = consumption * (drain if now_s > drain_s else 1.0)
            charge -= RATE_PCT_S * period_s * factor
            charge -= step_pct if now_s - period_s < step_s <= now_s else 0.0
            state = account.add_modelled_use(state, RATE_PCT_S * period_s)
        reported = math.floor(charge / quantum_pct + 0.5) * quantum_pct
        state = account.apply_remaining_report(state, reported, 1, now_s)
        yield now_s, state


def first_failure_s(judge: object, history: Iterator[tuple[float, BatteryState]]) -> float | None:
    """Return when a watchpoint fails first."""
    assert callable(judge)
    for now_s, state in history:
        known = with_facts(vehicle(FLEET, stage=Stage.FLYING), battery=state)
        if judge(WatchView(FLEET.context, FLEET.context.vehicles["uav1"], known, False, now_s)):
            return now_s
    return None


@pytest.mark.parametrize("period_s", [1.0, 2.0])
@pytest.mark.parametrize("consumption", [0.8, 1.0, 1.3, 1.5])
def test_a_constant_wind_is_no_fault(consumption: float, period_s: float) -> None:
    for judge in (watchpoints.check_battery_step, watchpoints.check_battery_drain):
        assert first_failure_s(judge, reports(25, consumption=consumption, period_s=period_s)) is None


@pytest.mark.parametrize("consumption", [1.0, 1.3])
def test_the_factor_is_learned(consumption: float) -> None:
    *_, (_, state) = reports(25, consumption=consumption)
    assert account.consumption_factor(state) == pytest.approx(consumption, abs=0.06)


def test_a_factor_is_believed_slowly() -> None:
    """One whole percent early is no factor of two: the reports are quantised."""
    *_, (_, state) = reports(0.5, consumption=1.3)
    assert 0.8 < account.consumption_factor(state) < 1.35


def test_the_factor_stays_in_its_range() -> None:
    *_, (_, wasteful) = reports(25, consumption=4.0)
    *_, (_, thrifty) = reports(25, consumption=0.6)
    assert (account.consumption_factor(thrifty), account.consumption_factor(wasteful)) == FACTOR_RANGE


def test_nothing_is_learned_from_nothing() -> None:
    assert account.consumption_factor(BatteryState()) == 1.0
    assert account.excess_pct(BatteryState(), 90.0) == (0.0, 0.0)


@pytest.mark.parametrize("period_s", [1.0, 2.0])
def test_a_step_is_found_at_its_first_report(period_s: float) -> None:
    found_s = first_failure_s(watchpoints.check_battery_step, reports(10, step_pct=30, step_s=300.0, period_s=period_s))
    assert found_s is not None
    assert 300.0 <= found_s <= 300.0 + period_s


def test_a_step_that_falls_into_lost_reports_is_found_as_a_drain() -> None:
    heard = [one for one in reports(10, step_pct=30, step_s=300.0) if not 298 < one[0] < 310]
    state, history = BatteryState(), []
    for now_s, known in heard:
        state = account.apply_remaining_report(
            replace(state, modelled_pct=known.modelled_pct), known.remaining_pct or 0.0, 1, now_s
        )
        history.append((now_s, state))
    assert first_failure_s(watchpoints.check_battery_step, iter(history)) is None
    assert first_failure_s(watchpoints.check_battery_drain, iter(history)) == 310.0


@pytest.mark.parametrize("drain", [2.5, 3.0, 5.0])
def test_a_drain_is_found_within_its_window(drain: float) -> None:
    found_s = first_failure_s(watchpoints.check_battery_drain, reports(15, drain=drain, drain_s=300.0))
    assert found_s is not None
    assert 300.0 < found_s <= 300.0 + FLEET.context.limits.slow_window_s / 3


def test_a_drain_in_a_head_wind_is_found_too() -> None:
    found_s = first_failure_s(watchpoints.check_battery_drain, reports(15, consumption=1.3, drain=3.0, drain_s=300.0))
    assert found_s is not None
    assert 300.0 < found_s <= 400.0


@settings(max_examples=20)
@given(
    consumption=st.floats(0.75, 1.5),
    period_s=st.sampled_from([1.0, 2.0, 5.0]),
    quantum_pct=st.sampled_from([0.01, 1.0]),
)
def test_no_honest_battery_is_a_fault(consumption: float, period_s: float, quantum_pct: float) -> None:
    history = list(reports(20, consumption=consumption, period_s=period_s, quantum_pct=quantum_pct))
    for judge in (watchpoints.check_battery_step, watchpoints.check_battery_drain):
        assert first_failure_s(judge, iter(history)) is None


def charged(*percents: float | None) -> BatteryState:
    state = vehicle(FLEET)
    for index, percent in enumerate(percents):
        state = apply_message(FLEET.context, state, Battery(0, percent, None, None, None, 1, 0), float(index)).state
    return state.power.battery


def counted(minutes: float, *, cut_off: bool, factor: float = 1.0) -> Iterator[tuple[float, BatteryState]]:
    """Yield what is really left and a battery, after each report of whole percents beside a counter of charge."""
    state, left_pct, middle_pct = BatteryState(), 97.3, 0.5 if cut_off else 0.0
    for number in range(round(minutes * 30)):
        left_pct -= 2.0 * RATE_PCT_S * factor
        state = account.add_modelled_use(state, 2.0 * RATE_PCT_S)
        state = account.apply_consumed_report(state, round(5.0 * (100.0 - left_pct) / 100.0, 3), 2.0 * number)
        said = float(math.floor(left_pct) if cut_off else math.floor(left_pct + 0.5))
        state = account.apply_remaining_report(state, said, 1, 2.0 * number, middle_pct=middle_pct)
        yield left_pct, state


@pytest.mark.parametrize("factor", [0.85, 1.0, 1.2])
@pytest.mark.parametrize("cut_off", [False, True])
def test_a_counter_of_charge_tells_what_remains_within_a_percent(*, cut_off: bool, factor: float) -> None:
    history = list(counted(12.0, cut_off=cut_off, factor=factor))
    offs = [abs(left_pct - state.estimate.remaining_pct) for left_pct, state in history[-200:] if state.estimate]
    assert len(offs) == 200
    assert max(offs) < 0.2
    known = history[-1][1]
    assert known.charge.capacity_ah == pytest.approx(5.0, rel=0.02)
    assert account.consumption_factor(known) == pytest.approx(factor, abs=0.02)


def test_a_percentage_that_leaves_its_counter_is_believed_again_at_its_next_end() -> None:
    *_, (_, state) = counted(10.0, cut_off=False)
    assert state.remaining_pct is not None
    assert state.estimate is not None
    below_pct, consumed_ah = state.remaining_pct - 6.0, state.charge.consumed_ah
    jumped = account.apply_remaining_report(state, below_pct, 1, 602.0)
    assert jumped.estimate is not None
    assert jumped.estimate.remaining_pct == below_pct
    assert (jumped.charge.last, jumped.charge.capacity_ah) == (None, state.charge.capacity_ah)
    ended = account.apply_remaining_report(jumped, below_pct - 1.0, 1, 604.0)
    assert ended.charge.last == PercentTransition(below_pct - 0.5, consumed_ah or 0.0)


def test_what_is_cut_off_stands_for_half_a_percent_more_but_never_for_more_than_all() -> None:
    for reported_pct, middle_pct, expected_pct in ((60.0, 0.0, 60.0), (60.0, 0.5, 60.5), (100.0, 0.5, 100.0)):
        first = account.apply_remaining_report(BatteryState(), reported_pct, 1, 0.0, middle_pct=middle_pct)
        assert first.estimate is not None
        assert (first.remaining_pct, first.estimate.remaining_pct) == (reported_pct, expected_pct)
    for autopilot, expected_pct in (("ardupilot", 60.5), ("px4", 60.0)):
        fleet = fleet_of(autopilot=autopilot)
        report = Battery(0, 60.0, None, None, None, 1, 0)
        known = apply_message(fleet.context, vehicle(fleet), report, 0.0).state.power.battery.estimate
        assert known is not None
        assert known.remaining_pct == expected_pct


def test_px4_rounds_twice() -> None:
    """Between what is rounded and what is rounded up lie halves of a percent; other autopilots are not asked twice."""
    said: list[float | None] = []
    state = replace(vehicle(FLEET), name="uav1")
    setups = {**FLEET.context.vehicles, "uav1": replace(FLEET.context.vehicles["uav1"], dialect=dialect_for("px4"))}
    context = replace(FLEET.context, vehicles=setups)
    for second, charge in enumerate((96.3, 96.1, 95.9, 95.7, 95.4, 95.2)):
        rounded, ceiled = float(math.floor(charge + 0.5)), float(math.ceil(charge))
        state = apply_message(context, state, Battery(0, rounded, None, None, None, 1, 0), float(second)).state
        state = apply_message(context, state, SystemStatus(ceiled, None, 0, None), second + 0.5).state
        said.append(state.power.battery.remaining_pct)
    assert said == [96.25, 96.25, 95.75, 95.75, 95.25, 95.25]


@given(charge=st.floats(1.0, 99.0), before=st.floats(0.0, 1.0))
def test_two_roundings_are_never_farther_off_than_one(charge: float, before: float) -> None:
    earlier = charge + before
    known = PercentRounding(math.floor(charge + 0.5), 2.0, math.ceil(earlier), 1.0)
    assert abs(known.percent - charge) <= 1.0 + 1e-9
    assert PercentRounding(math.floor(charge + 0.5), 100.0, 0.0, 1.0).percent == math.floor(charge + 0.5)
    assert PercentRounding(0.0, 1.0, math.ceil(charge), 100.0).percent == math.ceil(charge)


def test_a_percent_that_jumps_up_is_another_pack() -> None:
    state = charged(60.0, 58.0, 100.0)
    assert (state.first_pct, state.remaining_pct) == (100.0, 100.0)
    assert state.least_pct == 58.0
    assert account.consumption_factor(state) == 1.0
    assert account.excess_pct(state, 90.0) == (0.0, 0.0)


def test_a_percent_that_rises_a_little_is_a_resting_voltage() -> None:
    state = charged(60.0, 55.0, 58.0)
    assert (state.first_pct, state.remaining_pct, state.least_pct) == (60.0, 58.0, 55.0)


def test_of_two_packs_the_emptier_one_counts() -> None:
    state = vehicle(FLEET)
    for at_s, (pack, percent) in enumerate([(0, 90.0), (1, 70.0), (0, 89.0), (1, 69.0), (0, 88.0)]):
        state = apply_message(FLEET.context, state, Battery(pack, percent, None, None, None, 1, 0), float(at_s)).state
    assert (state.power.battery.remaining_pct, state.power.battery.least_pct) == (69.0, 69.0)
    assert account.excess_pct(state.power.battery, 2.0) == (1.0, 0.0)


def test_an_unknown_percent_changes_nothing() -> None:
    assert charged(60.0, None) == charged(60.0)


def test_old_reports_are_forgotten_but_not_the_account() -> None:
    *_, (now_s, state) = reports(10)
    assert state.history[0].at_s >= now_s - account.HISTORY_S
    assert state.first_pct == 100.0


def test_the_system_status_stands_in_for_a_battery_that_does_not_report() -> None:
    """SYS_STATUS rounds another way, so it is asked only while there is no BATTERY_STATUS."""
    state = vehicle(FLEET)
    context = FLEET.context

    def status(percent: float | None, now_s: float) -> float | None:
        nonlocal state
        state = apply_message(context, state, SystemStatus(percent, None, 0, None), now_s).state
        return state.power.battery.remaining_pct

    assert status(None, 0.0) is None
    assert status(90.0, 1.0) == 90.0
    state = apply_message(context, state, Battery(0, 80.0, None, None, None, 1, 0), 2.0).state
    assert status(81.0, 3.0) == 80.0
    assert status(70.0, 2.0 + context.limits.battery_stale_s + 1.0) == 70.0


def test_what_was_given_is_known_after_the_battery_is_full_again() -> None:
    """PX4's simulated battery is, as soon as it disarms; another pack begins a new account."""
    state = BatteryState()
    for second, percent in enumerate((100.0, 95.0, 84.0, 100.0)):
        state = account.apply_remaining_report(state, percent, 1, float(second))
    assert state.given_pct == 16.0
    state = account.restart_account(state, 98.0, 1, 5.0)
    assert account.apply_remaining_report(state, 90.0, 1, 6.0).given_pct == 24.0
