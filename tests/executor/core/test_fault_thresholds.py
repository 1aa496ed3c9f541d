"""The default limits."""

from __future__ import annotations

from collections.abc import Callable

import pytest

from executor.core.fault_thresholds import Limits
from tests.executor.builders import flat
from tests.executor.core.steps import rounded

ROWS: list[tuple[str, Callable[[], object], object]] = [
    (
        "the limits",
        lambda: flat(Limits()),
        {
            "link_stale_s": 3.0,
            "sinks_m_s": 0.5,
            "drops_m_s": 1.8,
            "below_mission_m": 5.0,
            "below_target_m": 2.0,
            "lies_s": 8.0,
            "all_silent_s": 60.0,
            "battery_step_pct": 8.0,
            "battery_step_window_s": 6.0,
            "battery_excess_pct": 2.0,
            "battery_window_s": 90.0,
            "blind_excess_pct": 2.4,
            "blind_swing_pct_s": 0.06,
            "slow_excess_pct": 4.0,
            "slow_blind_pct": 5.5,
            "slow_slack": 0.2,
            "slow_window_s": 400.0,
            "charge_excess_pct": 1.0,
            "drain_slack": 0.25,
            "reserve_chance": 0.93,
            "reserve_clear_chance": 0.8,
            "reserve_warn_chance": 0.95,
            "reserve_slack_pct": 1.0,
            "voltage_step": 0.05,
            "voltage_step_blind": 0.065,
            "cell_low_v": 3.1,
            "cell_low_s": 10.0,
            "cell_spread_v": 0.2,
            "battery_stale_s": 7.0,
            "fall_m_s": 5.0,
            "off_pad_m": 15.0,
            "off_pad_up_m": 5.0,
            "at_rest_m_s": 1.0,
            "climbs_m_s": 0.3,
            "alarm_s": 15.0,
            "airborne_m": 2.0,
            "jump_m": 100.0,
            "jump_warn_m": 10.0,
            "heartbeat_stale_s": 3.5,
            "loss_window_s": 12.0,
            "loss_warn": 0.25,
            "stall_s": 90.0,
            "unplanned_stall_s": 240.0,
            "stall_m": 3.0,
            "tilt_deg": 75.0,
            "tilt_s": 3.0,
            "hangs_s": 20.0,
            "hangs_most_s": 150.0,
            "down_s": 30.0,
            "on_ground_s": 5.0,
            "pad_m": 6.0,
            "failsafe_hold_s": 15.0,
            "failsafe_late_s": 10.0,
        },
    ),
]


@pytest.mark.parametrize(("what", "found", "expected"), ROWS, ids=[row[0] for row in ROWS])
def test_everything_that_comes_of_it(what: str, found: Callable[[], object], expected: object) -> None:
    assert rounded(found()) == expected
