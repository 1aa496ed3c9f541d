"""How vehicles fly by their own parameters."""

from __future__ import annotations

import math

import pytest

from missions import ARDUPILOT, PX4, Dialect, apply_tunings


def test_what_is_set_on_board_shapes_the_flight() -> None:
    own = apply_tunings(ARDUPILOT.performance, ARDUPILOT.tunings, {"WPNAV_ACCEL": 100.0, "WPNAV_SPEED_DN": 300.0})
    assert own.level.acceleration_m_s2 == pytest.approx(1.0)
    assert (own.descent_m_s, own.land_fast_m_s) == pytest.approx((3.0, 3.0))
    assert own.climb_m_s == ARDUPILOT.performance.climb_m_s


def test_the_speed_of_its_return_is_that_of_waypoints_unless_it_has_one_of_its_own() -> None:
    given = {"WPNAV_SPEED": 600.0, "RTL_SPEED": 0.0}
    assert apply_tunings(ARDUPILOT.performance, ARDUPILOT.tunings, given).home_m_s == pytest.approx(6.0)
    given["RTL_SPEED"] = 400.0
    assert apply_tunings(ARDUPILOT.performance, ARDUPILOT.tunings, given).home_m_s == pytest.approx(4.0)


@pytest.mark.parametrize("value", [0.0, -1.0, math.nan, math.inf])
def test_what_makes_no_sense_is_taken_as_the_default(value: float) -> None:
    assert apply_tunings(PX4.performance, PX4.tunings, {"MPC_ACC_HOR": value, "SOMETHING": 3.0}) == PX4.performance


@pytest.mark.parametrize("dialect", [ARDUPILOT, PX4], ids=lambda dialect: dialect.name)
def test_the_defaults_change_nothing(dialect: Dialect) -> None:
    defaults = {tuning.parameter: tuning.default for tuning in dialect.tunings}
    assert apply_tunings(dialect.performance, dialect.tunings, defaults) == dialect.performance
