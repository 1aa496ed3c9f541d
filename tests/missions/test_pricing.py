"""Networks as planning problems, and the way back from the problem's numbers."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from missions import Base, FlightModel, Performance, Pricing, Ramp, build_open_task, build_priced_instance
from missions.pricing import price_fleet
from planner import Plan, Route, SteadyWind, Vehicle, build_remaining_problem
from tests.missions.builders import depot_vehicle, line_east

QUICK = Ramp(1e6, 1e9)
MODEL = FlightModel(
    Performance(
        QUICK, QUICK, climb_m_s=2.0, descent_m_s=2.0, turn_s=0.0, turn_power=1.0, corner_s=0.0, corner_power=1.0,
        settle_s=0.5, accept_m=0.0, hold_s=1.0, spool_s=3.0,
        take_off_m_s=2.0, take_off_below_m=10.0, land_m_s=0.5, land_below_m=5.0, land_fast_m_s=2.0, touch_s=2.0,
        home_m_s=5.0, home_wait_s=0.0,
    ),
    SteadyWind(0.0, 0.0, (0.0, 100.0), (0.1, 0.1)), 10.0, 2.0,
)  # fmt: skip
"""At its speed at once; each stop takes 1.5 s; a second takes a tenth of a percent, and a metre of climb 0.004 %."""


def pricing(pylons: int = 4) -> Pricing:
    ends_m = line_east(pylons).ends_m
    tracks = [[[*a, 15.0], [*b, 15.0]] for a, b in ends_m.tolist()]
    names = ("uav1", "uav2")
    return Pricing(
        np.array(tracks), {name: Base((0.0, 0.0, 15.0), 20.0) for name in names}, dict.fromkeys(names, MODEL)
    )


def test_a_whole_network_starts_and_lands_on_the_pad() -> None:
    vehicles = [depot_vehicle("uav1", 80.0), depot_vehicle("uav2", 70.0, 1.1)]
    task = build_open_task(pricing(), range(3), vehicles)
    assert task.segment_ids == (0, 1, 2)
    # 3 s and 20 m up; 100 m to the first pylon and 100 m along the segment, with a stop at each end.
    out_s = 3.0 + 10.0 + 10.0 + 1.5 + 50.0 + 1.5
    assert task.instance.start_s[0, 0] == pytest.approx(out_s, abs=1e-3)
    # 200 m home and a stop; 15 m down at 2 m/s, 5 m at 0.5 m/s, 2 s to the motors' end.
    home_s = 20.0 + 0.5 + 7.5 + 10.0 + 2.0
    assert task.instance.home_s[0, 0] == pytest.approx(home_s, abs=1e-3)
    assert task.instance.start_pct[1, 0] == pytest.approx(1.1 * (0.1 * out_s + 20.0 * 0.004), abs=1e-3)
    assert task.instance.home_pct[1, 0] == pytest.approx(1.1 * 0.1 * home_s, abs=1e-3)
    assert task.instance.depot_s == pytest.approx(task.instance.start_s)
    # To the next segment, which begins where this one ends.
    assert task.instance.moves.seconds(0, 0, 2) == pytest.approx(50.0 + 1.5, abs=1e-3)
    assert task.instance.value == pytest.approx([100.0] * 3, abs=1e-6)


def test_what_is_open_is_planned_from_where_the_survivors_are() -> None:
    airborne = Vehicle("uav1", (300.0, 0.0), 40.0, airborne=True, start_up_m=5.0)
    task = build_open_task(pricing(), [2, 0, 2], [airborne, depot_vehicle("uav2", 70.0)])
    assert task.segment_ids == (0, 2)
    # Segment 2 from its a at 300 m: no transit.
    assert task.instance.start_s[0, 2] == pytest.approx(50.0 + 1.5, abs=1e-3)
    # Home from there: 300 m, and the landing.
    assert task.instance.idle_s == pytest.approx([30.0 + 0.5 + 7.5 + 10.0 + 2.0, 0.0], abs=1e-3)
    # 10 m up on the way.
    assert task.instance.idle_pct[0] == pytest.approx(0.1 * task.instance.idle_s[0] + 10.0 * 0.004, abs=1e-3)


def test_a_steep_way_takes_as_long_as_its_height() -> None:
    high = Vehicle("uav1", (100.0, 0.0), 40.0, airborne=True, start_up_m=315.0)
    task = build_open_task(pricing(), [1], [high])
    # 100 m over the ground take 10 s at 10 m/s; 300 m down at 2 m/s take 150 s.
    assert task.instance.start_s[0, 0] == pytest.approx(150.0 + 1.5 + 50.0 + 1.5, abs=1e-3)


def test_turning_on_the_spot_takes_its_time() -> None:
    turning = replace(MODEL, performance=replace(MODEL.performance, turn_s=2.0, turn_power=2.0))
    towards = pricing()
    task = build_open_task(
        replace(towards, models=dict.fromkeys(towards.models, turning)), range(3), [depot_vehicle("uav1", 80.0)]
    )
    # On along the line; back along it; from the pad, where nobody knows where it faces, to the first pylon and on.
    assert task.instance.moves.seconds(0, 0, 2) == pytest.approx(50.0 + 1.5, abs=1e-3)
    assert task.instance.moves.seconds(0, 2, 3) == pytest.approx(2.0 + 50.0 + 1.5, abs=1e-3)
    assert task.instance.start_s[0, 0] == pytest.approx(3.0 + 10.0 + 1.0 + 10.0 + 1.5 + 50.0 + 1.5, abs=1e-3)
    # Home from the line's end is back along it.
    assert task.instance.home_s[0, 0] == pytest.approx(2.0 + 20.0 + 0.5 + 7.5 + 10.0 + 2.0, abs=1e-3)


def test_the_rest_of_a_plan_is_priced_as_in_the_flight_that_continues() -> None:
    """What is left after a loss, written down and priced anew, takes what it takes in the flight that goes on."""
    turning = replace(MODEL, performance=replace(MODEL.performance, turn_s=2.0, turn_power=2.0))
    towards = replace(pricing(), models=dict.fromkeys(pricing().models, turning))
    vehicles = [depot_vehicle("uav1", 80.0), depot_vehicle("uav2", 70.0, 1.1)]
    plan = Plan((Route(0, (4,)), Route(1, (0, 2))))
    left = build_remaining_problem(build_priced_instance(towards, vehicles), plan, lost=0, at_s=20.0)
    assert left.instance.vehicles[0].facing_m == pytest.approx((100.0, 0.0), abs=1e-3)
    again = build_priced_instance(towards.select_segments(left.open_segments, ["uav2"]), left.instance.vehicles)
    for key in ("start_s", "start_pct", "home_s", "home_pct", "idle_s", "idle_pct", "depot_s", "depot_pct", "end_m"):
        assert getattr(again, key) == pytest.approx(getattr(left.instance, key), abs=1e-9), key


def test_many_segments_are_priced_when_they_are_asked_for() -> None:
    vehicles = [depot_vehicle("uav1", 80.0), depot_vehicle("uav2", 70.0, 1.1)]
    tables = build_priced_instance(pricing(6), vehicles)
    asked = price_fleet(pricing(6), ["uav1", "uav2"])[0]
    every = np.arange(10)
    assert asked.seconds(0, every[:, np.newaxis], every) == pytest.approx(
        tables.moves.seconds(0, every[:, np.newaxis], every)
    )
    assert asked.select_visits([3, 8]).pct(0, 0, 1) == pytest.approx(float(tables.moves.pct(0, 3, 8)))


def test_visits_go_both_ways_between_problem_and_network() -> None:
    task = build_open_task(pricing(5), [1, 3], [depot_vehicle("uav1", 80.0)])
    assert task.to_network([0, 3]) == (2, 7)
    assert task.from_network([2, 7]) == (0, 3)
    assert task.plan_to_network(Plan((Route(0, (3,)),), (0,))) == Plan((Route(0, (7,)),), (1,))
    with pytest.raises(KeyError):
        task.from_network([0])


def test_nothing_open_is_a_problem_without_segments() -> None:
    assert build_open_task(pricing(), [], [depot_vehicle("uav1", 80.0)]).instance.segments == 0


@pytest.mark.parametrize("segment", [-1, 3])
def test_an_unknown_segment_is_refused(segment: int) -> None:
    with pytest.raises(IndexError, match="expected below 3"):
        build_open_task(pricing(), [1, segment], [depot_vehicle("uav1", 80.0)])


@pytest.mark.parametrize("tables_up_to", [100, 0])
def test_what_a_visit_takes_besides_its_track_is_in_every_way_to_it(
    tables_up_to: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A pylon that is hovered at from its viewpoints: as a first visit, after another, and from the pad again."""
    monkeypatch.setattr("missions.pricing.TABLES_UP_TO", tables_up_to)
    plain, vehicles = pricing(), [depot_vehicle("uav1", 90.0)]
    longer = replace(plain, besides_s={1: 20.0})
    before, after = (build_priced_instance(one, vehicles) for one in (plain, longer))
    slower = np.array([0.0, 0.0, 20.0, 20.0, 0.0, 0.0])
    assert after.start_s[0] - before.start_s[0] == pytest.approx(slower)
    assert after.depot_s[0] - before.depot_s[0] == pytest.approx(slower)
    every = np.arange(6)
    moved = after.moves.seconds(0, np.zeros(6, dtype=np.int64), every) - before.moves.seconds(
        0, np.zeros(6, dtype=np.int64), every
    )
    assert moved == pytest.approx(slower)
    hover_pct = 20.0 * plain.models["uav1"].hover_pct_per_s
    assert after.start_pct[0] - before.start_pct[0] == pytest.approx(slower / 20.0 * hover_pct)
