"""The pen-and-paper model against the figures that its authors print."""

from __future__ import annotations

import numpy as np
import pytest

from planner.energy import (
    PRESETS,
    Drone,
    endurance_s,
    endurance_speed_m_s,
    hover_power_w,
    induced_velocity_m_s,
    pct_per_s,
    power_w,
    range_speed_m_s,
    usable_wh,
)
from planner.errors import InstanceError

MAVIC_2 = PRESETS["mavic2"]
MAVIC_3 = PRESETS["mavic3"]


def test_mavic_3_is_the_papers_worked_example() -> None:
    slow, fast = endurance_speed_m_s(MAVIC_3), range_speed_m_s(MAVIC_3)
    assert induced_velocity_m_s(MAVIC_3) == pytest.approx(4.51, abs=0.015)
    assert power_w(MAVIC_3, slow) == pytest.approx(89.5, rel=0.003)
    assert power_w(MAVIC_3, fast) == pytest.approx(107.0, rel=0.003)
    cell_v = 3.7 * 4
    assert usable_wh(MAVIC_3, 89.5) / cell_v == pytest.approx(4.89, abs=0.005)
    assert usable_wh(MAVIC_3, 107.0) / cell_v == pytest.approx(4.88, abs=0.015)
    assert endurance_s(MAVIC_3, slow) == pytest.approx(2909, rel=0.003)
    assert endurance_s(MAVIC_3, fast) == pytest.approx(2429, rel=0.003)
    assert fast == pytest.approx(13.19, abs=0.005)
    assert fast * endurance_s(MAVIC_3, fast) == pytest.approx(32_100, rel=0.001)


def test_mavic_2_three_points() -> None:
    slow, fast = endurance_speed_m_s(MAVIC_2), range_speed_m_s(MAVIC_2)
    assert induced_velocity_m_s(MAVIC_2) == pytest.approx(4.895, abs=0.001)
    assert hover_power_w(MAVIC_2) == pytest.approx(107.5, abs=0.05)
    assert slow == pytest.approx(8.17, abs=0.005)
    assert power_w(MAVIC_2, slow) == pytest.approx(98.3, abs=0.05)
    assert endurance_s(MAVIC_2, slow) / 60 == pytest.approx(34.3, abs=0.05)
    assert fast == pytest.approx(14.01, abs=0.005)
    assert power_w(MAVIC_2, fast) == pytest.approx(117.4, abs=0.05)
    assert endurance_s(MAVIC_2, fast) / 60 == pytest.approx(28.6, abs=0.05)


def test_mavic_2_quartic() -> None:
    speeds = np.linspace(0, 17, 35)
    printed = 1 - 0.016665 * speeds + 0.00124673 * speeds**2 - 1.86575e-4 * speeds**3 + 1.541553e-5 * speeds**4
    ours = [power_w(MAVIC_2, float(speed)) / hover_power_w(MAVIC_2) for speed in speeds]
    np.testing.assert_allclose(ours, printed, rtol=1e-5)


@pytest.mark.parametrize(
    ("preset", "printed_min"),
    [("mavic2", 33), ("mavic3", 48), ("matrice200", 23), ("matrice600", 18), ("anafi-ai", 31), ("skydio2", 26)],
)
def test_printed_endurance_of_all_presets(preset: str, printed_min: float) -> None:
    drone = PRESETS[preset]
    ours_min = endurance_s(drone, endurance_speed_m_s(drone)) / 60
    assert -0.03 <= ours_min / printed_min - 1 <= 0.06


@pytest.mark.parametrize("preset", sorted(PRESETS))
def test_the_optima_are_optima_of_the_curve(preset: str) -> None:
    drone = PRESETS[preset]
    slow, fast = endurance_speed_m_s(drone), range_speed_m_s(drone)
    speeds = np.linspace(0.05, 1.2 * fast, 400)
    powers = np.array([power_w(drone, float(speed)) for speed in speeds])
    assert power_w(drone, slow) <= powers.min() * (1 + 1e-9)
    assert power_w(drone, fast) / fast <= (powers / speeds).min() * (1 + 1e-9)


def test_a_full_battery_is_a_hundred_percent() -> None:
    assert pct_per_s(MAVIC_2, 5.0) * endurance_s(MAVIC_2, 5.0) == pytest.approx(100)


def test_a_hard_drawn_pack_gives_less() -> None:
    assert usable_wh(MAVIC_2, 200) < usable_wh(MAVIC_2, 100) < 3.9 * 3.7 * 4


@pytest.mark.parametrize("speed_m_s", [-1.0, float("nan"), float("inf")])
def test_a_speed_that_is_none_is_refused(speed_m_s: float) -> None:
    with pytest.raises(InstanceError, match="expected zero or more"):
        power_w(MAVIC_2, speed_m_s)


def test_more_power_than_the_battery_has_is_refused() -> None:
    with pytest.raises(InstanceError, match="more than its battery can give"):
        usable_wh(MAVIC_2, 2500)


def test_a_drone_without_mass_is_refused() -> None:
    with pytest.raises(InstanceError, match="mass_kg is 0, expected a positive number"):
        Drone("balloon", 0, 4, 0.1, 4, 4, 0.02)
