"""Moves in tables and on demand, in wind, and of vehicles that fly at different speeds."""

from __future__ import annotations

import numpy as np
import pytest

from planner import (
    PRESETS,
    Cost,
    InstanceError,
    Iterations,
    MoveTables,
    Plan,
    Route,
    SteadyWind,
    Travel,
    Vehicle,
    build_instance,
    build_remaining_problem,
    evaluate,
    pct_per_s,
    route_energy_pct,
    solve,
    travel_for,
)
from planner.moves import Dynamics, MoveGeometry
from tests.planner.builders import fleet, table_pct, table_s

CALM = Travel(5.0, 1.0, 0.05, 0.06)
ENDS = np.random.default_rng(3).uniform(-300, 300, (9, 2, 2))


@pytest.mark.parametrize("travel", [CALM, Travel(5.0, 1.0, 0.05, 0.06, Dynamics())])
def test_moves_on_demand_equal_the_tables(travel: Travel) -> None:
    slow = Travel(2.0, 0.5, 0.07, 0.06, travel.dynamics)
    tables, geometry = (
        build_instance(ENDS, (1.0, 2.0), fleet(80.0, 80.0), [travel, slow], tables_up_to=limit) for limit in (100, 0)
    )
    assert isinstance(tables.moves, MoveTables)
    assert isinstance(geometry.moves, MoveGeometry)
    for profile in (0, 1):
        assert table_s(geometry, profile) == pytest.approx(table_s(tables, profile), rel=1e-12)
        assert table_pct(geometry, profile) == pytest.approx(table_pct(tables, profile), rel=1e-12)
    plan = Plan((Route(0, (0, 7, 4, 16)), Route(1, (2, 9, 10, 12, 15))))
    assert evaluate(geometry, plan, Cost.MINSUM) == evaluate(tables, plan, Cost.MINSUM)
    left, expected = (
        build_remaining_problem(geometry, plan, 0, 100.0).instance,
        build_remaining_problem(tables, plan, 0, 100.0).instance,
    )
    assert table_pct(left, 1) == pytest.approx(table_pct(expected, 1), rel=1e-12)


def test_wind_costs_energy_and_no_time() -> None:
    drone, ends = PRESETS["mavic2"], [[[100.0, 0.0], [200.0, 0.0]]]
    windy = build_instance(ends, (0.0, 0.0), fleet(90.0), travel_for(drone, 5.0, 1.0, wind_m_s=(3.0, 0.0)))
    calm = build_instance(ends, (0.0, 0.0), fleet(90.0), travel_for(drone, 5.0, 1.0))
    assert windy.start_s.tolist() == calm.start_s.tolist()
    # Out with the wind: 5 m/s over ground are 2 m/s through the air, 1 m/s is 2 m/s backwards. Home: 8 m/s.
    assert windy.start_pct[0, 0] == pytest.approx(20 * pct_per_s(drone, 2) + 100 * pct_per_s(drone, 2), rel=1e-4)
    assert windy.home_pct[0, 0] == pytest.approx(40 * pct_per_s(drone, 8), rel=1e-4)
    # The other direction inspects against the wind, at 4 m/s through the air.
    assert windy.start_pct[0, 1] == pytest.approx(40 * pct_per_s(drone, 2) + 100 * pct_per_s(drone, 4), rel=1e-4)


def test_in_wind_a_route_and_its_reverse_cost_different_energy() -> None:
    travel = travel_for(PRESETS["mavic2"], 5.0, 1.0, wind_m_s=(0.0, 4.0))
    instance = build_instance(ENDS, (0.0, 0.0), fleet(90.0), travel)
    route = (0, 5, 8, 3)
    there = route_energy_pct(instance, Route(0, route))
    back = route_energy_pct(instance, Route(0, tuple(visit ^ 1 for visit in reversed(route))))
    assert abs(there - back) > 0.01


def test_a_move_of_no_length_takes_nothing_in_wind() -> None:
    travel = travel_for(PRESETS["mavic2"], 5.0, 1.0, wind_m_s=(3.0, -2.0))
    instance = build_instance([[[0.0, 0.0], [0.0, 0.0]]], (0.0, 0.0), fleet(90.0), travel)
    assert table_pct(instance).max() == 0


def test_the_faster_vehicle_is_given_more() -> None:
    ends = [[[20.0 * number, 100.0], [20.0 * number + 20.0, 100.0]] for number in range(12)]
    vehicles = [Vehicle(name, (0.0, 0.0), 100.0) for name in ("slow", "fast")]
    travels = [Travel(5.0, 1.0, 0.1, 0.1), Travel(10.0, 3.0, 0.1, 0.1)]
    instance = build_instance(ends, (0.0, 0.0), vehicles, travels)
    result = solve(instance, cost=Cost.MINMAX, stop=Iterations(2000))
    slow, fast = (len(route.visits) for route in result.plan.routes)
    assert result.feasible
    assert fast > 2 * slow > 0
    assert result.evaluation == evaluate(instance, result.plan, Cost.MINMAX)


@pytest.mark.parametrize(
    ("curve", "expected"),
    [
        (((0.0, 1.0), (0.1,)), "as many rates"),
        (((0.0, 0.0), (0.1, 0.1)), "ascending"),
        (((0.0, 1.0), (0.1, 0.0)), "positive"),
    ],
)
def test_a_wind_needs_a_curve(curve: tuple[tuple[float, ...], tuple[float, ...]], expected: str) -> None:
    with pytest.raises(InstanceError, match=expected):
        SteadyWind(1.0, 1.0, *curve)


def test_travels_are_one_for_all_or_one_each() -> None:
    with pytest.raises(InstanceError, match="1 travels for 2 vehicles"):
        build_instance(ENDS, (0.0, 0.0), fleet(1.0, 1.0), [CALM])
