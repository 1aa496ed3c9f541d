"""The battery agrees with the planner's energy model, and its figures with each other."""

from __future__ import annotations

import pytest

from planner.energy import PRESETS, endurance_s, pct_per_s, power_w, top_speed_m_s
from simulator.battery import Battery

DRONE = PRESETS["mavic3"]


def fly(battery: Battery, seconds: float, speed_m_s: float = 5.0, climb_m_s: float = 0.0) -> None:
    for _ in range(round(seconds / 0.05)):
        battery.step(0.05, motors=True, speed_m_s=speed_m_s, climb_m_s=climb_m_s)


def full(**changes: float) -> Battery:
    return Battery(DRONE, **{"charge_pct": 100.0, "health": 1.0, "consumption": 1.0, **changes})


@pytest.mark.parametrize("speed_m_s", [0.0, 1.0, 5.0, 12.0])
def test_level_flight_uses_what_the_planner_expects(speed_m_s: float) -> None:
    battery = full()
    fly(battery, 60, speed_m_s)
    assert 100 - battery.charge_pct == pytest.approx(60 * pct_per_s(DRONE, speed_m_s), rel=0.01)


def test_a_full_battery_lasts_as_long_as_the_model_says() -> None:
    battery = full()
    fly(battery, endurance_s(DRONE, 0.0) - 5, 0.0)
    assert not battery.is_empty
    fly(battery, 10, 0.0)
    assert battery.is_empty


@pytest.mark.parametrize(("changes", "factor"), [({"consumption": 1.3}, 1.3), ({"health": 0.8}, 1.25)])
def test_wind_and_wear_cost_in_proportion(changes: dict[str, float], factor: float) -> None:
    battery = full(**changes)
    fly(battery, 60)
    assert 100 - battery.charge_pct == pytest.approx(60 * factor * pct_per_s(DRONE, 5.0), rel=0.01)


def test_a_drain_fault_multiplies_current_and_loss() -> None:
    calm, drained = full(), full()
    drained.drain_factor = 3.0
    fly(calm, 10)
    fly(drained, 10)
    assert drained.current_a == pytest.approx(3 * calm.current_a)
    assert 100 - drained.charge_pct == pytest.approx(3 * (100 - calm.charge_pct))
    assert drained.voltage_v < calm.voltage_v


def test_the_coulomb_count_holds() -> None:
    battery = full(charge_pct=80.0)
    before_mah = battery.charge_pct / 100 * battery.capacity_mah
    fly(battery, 36)
    used_mah = before_mah - battery.charge_pct / 100 * battery.capacity_mah
    assert used_mah == pytest.approx(battery.current_a * 10, rel=1e-6)


def test_current_is_about_power_over_voltage() -> None:
    battery = full()
    fly(battery, 1, 0.0)
    assert battery.current_a == pytest.approx(power_w(DRONE, 0.0) / battery.voltage_v, rel=0.2)


def test_climbing_costs_a_tenth_more() -> None:
    level, climbing = full(), full()
    fly(level, 10, 0.0)
    fly(climbing, 10, 0.0, climb_m_s=2.5)
    assert climbing.current_a == pytest.approx(1.1 * level.current_a)


def test_voltage_falls_with_charge_and_sags_under_load() -> None:
    battery = full()
    assert battery.voltage_v == pytest.approx(4.2 * DRONE.cells)
    seen = []
    for _ in range(10):
        fly(battery, 60)
        seen.append(battery.voltage_v)
        assert battery.voltage_v < battery.rest_v
    assert seen == sorted(seen, reverse=True)
    battery.step(0.05, motors=False, speed_m_s=0, climb_m_s=0)
    assert battery.current_a == 0.0
    assert battery.voltage_v == battery.rest_v


def test_a_battery_step_is_points_at_once_and_never_below_nothing() -> None:
    battery = full()
    battery.remove_charge(30)
    assert battery.charge_pct == 70
    battery.remove_charge(90)
    assert battery.charge_pct == 0
    assert battery.is_empty


def test_faster_than_the_model_goes_costs_as_its_fastest() -> None:
    one, two = full(), full()
    fly(one, 1, top_speed_m_s(DRONE))
    fly(two, 1, top_speed_m_s(DRONE) + 15.0)
    assert one.current_a == two.current_a > 0
