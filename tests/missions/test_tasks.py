"""Networks as planning problems, and the way back from the problem's numbers."""

from __future__ import annotations

import pytest

from missions import open_task
from planner import Plan, Route, Travel, Vehicle
from tests.missions.builders import depot_vehicle, line_east, whole_task

TRAVEL = Travel(transit_speed_m_s=10.0, inspection_speed_m_s=2.0, transit_pct_per_s=0.1, inspection_pct_per_s=0.2)


def test_a_whole_network_starts_and_lands_at_the_depot() -> None:
    task = whole_task(line_east(), [depot_vehicle("uav1", 80.0), depot_vehicle("uav2", 70.0, 1.1)], TRAVEL)
    assert task.segment_ids == (0, 1, 2)
    assert [vehicle.start_m for vehicle in task.instance.vehicles] == [(0.0, 0.0), (0.0, 0.0)]
    # 100 m to the first pylon, 100 m along the segment, 200 m home.
    assert task.instance.start_s[0, 0] == pytest.approx(10.0 + 50.0, abs=1e-6)
    assert task.instance.home_s[0, 0] == pytest.approx(20.0, abs=1e-6)
    assert task.instance.start_pct[1, 0] == pytest.approx(1.1 * (10.0 * 0.1 + 50.0 * 0.2), abs=1e-6)
    assert task.instance.value == pytest.approx([100.0] * 3, abs=1e-6)


def test_what_is_open_is_planned_from_where_the_survivors_are() -> None:
    airborne = Vehicle("uav1", (300.0, 0.0), 40.0, airborne=True)
    task = open_task(line_east(), [2, 0, 2], [airborne, depot_vehicle("uav2", 70.0)], TRAVEL)
    assert task.segment_ids == (0, 2)
    # Segment 2 from its a at 300 m: no transit.
    assert task.instance.start_s[0, 2] == pytest.approx(50.0, abs=1e-6)
    assert task.instance.idle_s == pytest.approx([30.0, 0.0], abs=1e-6)


def test_visits_go_both_ways_between_problem_and_network() -> None:
    task = open_task(line_east(5), [1, 3], [depot_vehicle("uav1", 80.0)], TRAVEL)
    assert task.to_network([0, 3]) == (2, 7)
    assert task.from_network([2, 7]) == (0, 3)
    assert task.plan_to_network(Plan((Route(0, (3,)),), (0,))) == Plan((Route(0, (7,)),), (1,))
    with pytest.raises(KeyError):
        task.from_network([0])


def test_nothing_open_is_a_problem_without_segments() -> None:
    assert open_task(line_east(), [], [depot_vehicle("uav1", 80.0)], TRAVEL).instance.segments == 0


@pytest.mark.parametrize("segment", [-1, 3])
def test_an_unknown_segment_is_refused(segment: int) -> None:
    with pytest.raises(IndexError, match="expected below 3"):
        open_task(line_east(), [1, segment], [depot_vehicle("uav1", 80.0)], TRAVEL)
