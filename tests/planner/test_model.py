"""Instances: their matrices by hand and against the figures of the authors' solver, and what is refused."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from planner import (
    PRESETS,
    InstanceError,
    Route,
    Travel,
    Vehicle,
    build_instance,
    pct_per_s,
    route_duration_s,
    route_energy_pct,
    travel_for,
)
from planner.moves import Dynamics
from tests.planner.builders import UNIT, fleet, nechranice_ends_m, table_s

PAPER = Travel(5.0, 1.0, 1.0, 1.0)


@pytest.mark.parametrize(
    ("radius_m", "segments", "length_m", "dynamics_s", "paper_s"),
    [
        (500, 18, 3545.97, (4651.688, 5096.335), (4554.615, 4984.932)),
        (700, 33, 7473.64, (8943.176, 9947.418), (8770.430, 9751.359)),
        (1000, 48, 11402.45, (13278.578, 15042.477), (13032.585, 14755.293)),
        (1200, 56, 14160.90, (16522.469, 18585.714), (16232.429, 18257.686)),
        (2000, 81, 22341.07, (26310.038, 30287.730), (25877.773, 29804.878)),
    ],
)
def test_the_authors_check_values(
    radius_m: float, segments: int, length_m: float, dynamics_s: tuple[float, float], paper_s: tuple[float, float]
) -> None:
    ends = nechranice_ends_m(radius_m)
    assert len(ends) == segments
    forward = Route(0, tuple(2 * segment for segment in range(segments)))
    alternating = Route(0, tuple(2 * segment + segment % 2 for segment in range(segments)))
    for dynamics, expected in ((Dynamics(), dynamics_s), (None, paper_s)):
        travel = Travel(5.0, 1.0, 1.0, 1.0, dynamics)
        instance = build_instance(ends, (0.0, 0.0), fleet(1e9), travel)
        assert instance.value.sum() == pytest.approx(length_m, abs=0.005)
        for route, seconds in zip((forward, alternating), expected, strict=True):
            assert route_duration_s(instance, route) == pytest.approx(seconds, abs=0.001)
            assert route_energy_pct(instance, route) == pytest.approx(seconds, abs=0.001)  # 1 % a second


def test_one_segment_by_hand() -> None:
    # From (0, 0) 30 m to a, 40 m along to b, 50 m home; 5 m/s and 1 m/s; 0.1 and 0.2 % a second.
    travel = Travel(5.0, 1.0, 0.1, 0.2)
    vehicle = Vehicle("a", (0.0, 0.0), 100.0, consumption=2.0)
    instance = build_instance([[[30.0, 0.0], [30.0, 40.0]]], (0.0, 0.0), [vehicle], travel)
    assert instance.start_s[0].tolist() == [6 + 40, 10 + 40]
    assert instance.home_s[0].tolist() == [10, 6]
    assert instance.start_pct[0].tolist() == pytest.approx([2 * (0.6 + 8), 2 * (1.0 + 8)])
    assert instance.home_pct[0].tolist() == pytest.approx([2.0, 1.2])
    assert instance.depot_pct[0].tolist() == pytest.approx([0.6 + 8, 1.0 + 8])  # without the vehicle's own consumption
    assert instance.end_m.tolist() == [[30.0, 40.0, 0.0], [30.0, 0.0, 0.0]]
    assert instance.value.tolist() == [40.0]
    assert instance.idle_s.tolist() == [0.0]


def test_an_airborne_vehicle_pays_for_its_return() -> None:
    vehicles = [
        Vehicle("up", (30.0, 40.0), 100.0, consumption=2.0, airborne=True),
        Vehicle("down", (30.0, 40.0), 100.0),
    ]
    instance = build_instance(np.zeros((0, 2, 2)), (0.0, 0.0), vehicles, Travel(5.0, 1.0, 0.1, 0.2))
    assert instance.idle_s.tolist() == [10.0, 0.0]
    assert instance.idle_pct.tolist() == [2.0, 0.0]


def test_dynamics_of_one_segment_by_hand() -> None:
    # East 30 m: no turn, 30 / 5 + 5 / 2.5 = 8 s; then north: a quarter turn, 40 / 1 + 1 / 2.5 = 40.4 s.
    # From b home the way back is 50 m to the south-west.
    travel = Travel(5.0, 1.0, 1.0, 1.0, Dynamics())
    instance = build_instance([[[30.0, 0.0], [30.0, 40.0]]], (0.0, 0.0), fleet(1e3), travel)
    quarter = math.pi / 2
    assert instance.start_s[0, 0] == pytest.approx(8 + quarter + 40.4)
    turn_home = math.pi - math.atan2(30, 40)
    assert instance.home_s[0, 0] == pytest.approx(turn_home + 50 / 5 + 2)


def test_turns_are_never_more_than_half_a_circle() -> None:
    chance = np.random.default_rng(7)
    ends = chance.uniform(-100, 100, (12, 2, 2))
    slow = build_instance(ends, (0.0, 0.0), fleet(1.0), Travel(5.0, 1.0, 1.0, 1.0, Dynamics()))
    plain = build_instance(ends, (0.0, 0.0), fleet(1.0), PAPER)
    extra = table_s(slow) - table_s(plain) - 5.0 / 2.5 - 1.0 / 2.5
    assert extra.min() >= -1e-9
    assert extra.max() <= 2 * math.pi + 1e-9


def test_reversing_a_route_costs_the_same() -> None:
    chance = np.random.default_rng(11)
    instance = build_instance(chance.uniform(-100, 100, (6, 2, 2)), (3.0, 4.0), fleet(1.0, start_m=(3.0, 4.0)), PAPER)
    route = Route(0, (0, 5, 8, 3))
    back = Route(0, tuple(visit ^ 1 for visit in reversed(route.visits)))
    assert route_duration_s(instance, back) == pytest.approx(route_duration_s(instance, route))


def test_travel_takes_its_rates_from_the_drone() -> None:
    travel = travel_for(PRESETS["mavic2"], 5.0, 1.0)
    assert travel.transit_pct_per_s == pct_per_s(PRESETS["mavic2"], 5.0)
    assert travel.inspection_pct_per_s == pct_per_s(PRESETS["mavic2"], 1.0)


@pytest.mark.parametrize(
    ("ends", "landing", "message"),
    [
        (np.zeros((3, 2)), (0, 0), r"expected \(n, 2, 2\)"),
        (np.zeros((1, 2, 2)), (0, 0, 0), r"expected \(2,\)"),
        (np.full((1, 2, 2), np.nan), (0, 0), "NaN"),
        (np.zeros((1, 2, 2)), (np.inf, 0), "infinite"),
    ],
)
def test_points_that_are_none_are_refused(ends: Any, landing: Any, message: str) -> None:
    with pytest.raises(InstanceError, match=message):
        build_instance(ends, landing, fleet(1.0), UNIT)


def test_a_start_that_is_none_is_refused() -> None:
    with pytest.raises(InstanceError, match="start_m"):
        build_instance(np.zeros((1, 2, 2)), (0, 0), fleet(1.0, start_m=(math.nan, 0.0)), UNIT)


def test_an_empty_fleet_is_refused() -> None:
    with pytest.raises(InstanceError, match="at least one vehicle"):
        build_instance(np.zeros((1, 2, 2)), (0, 0), [], UNIT)


@pytest.mark.parametrize("vehicle", [Vehicle("a", (0, 0), math.nan), Vehicle("a", (0, 0), 1.0, consumption=0.0)])
def test_a_vehicle_without_sense_is_refused(vehicle: Vehicle) -> None:
    with pytest.raises(InstanceError, match="vehicle 'a'"):
        build_instance(np.zeros((1, 2, 2)), (0, 0), [vehicle], UNIT)


def test_speeds_and_rates_are_positive() -> None:
    with pytest.raises(InstanceError, match="inspection_speed_m_s is 0"):
        Travel(5.0, 0.0, 1.0, 1.0)
    with pytest.raises(InstanceError, match="yaw_rate_rad_s is -1"):
        Dynamics(yaw_rate_rad_s=-1.0)
