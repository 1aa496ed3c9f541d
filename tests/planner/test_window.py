"""The re-plan window by hand on a line of segments, and on the network of the paper."""

from __future__ import annotations

import pytest

from planner import (
    PRESETS,
    Cost,
    Instance,
    Iterations,
    Plan,
    PlanError,
    ReplanWindow,
    Route,
    Vehicle,
    build_instance,
    build_remaining_problem,
    evaluate,
    find_repairs_at,
    replan_window,
    solve,
    travel_for,
)
from planner.evaluate import CriticalLoss, RepairStatus
from planner.fleet_state import event_times_s
from planner.window import iterate_losses
from tests.planner.builders import UNIT, fleet, line, nechranice_ends_m

# Segments 0-10, 10-20, ... m east of the depot; a metre is a second is a percent.
# a: 0, 1 end at 10, 20 s, home at 40. b: 2, 3 end at 30, 40 s, home at 80.
PLAN = Plan((Route(0, (0, 2)), Route(1, (4, 6))))


def check_rows(instance: Instance, plan: Plan, *, fly_again: bool = True) -> None:
    """Hold every re-plan of the table against the definition."""
    for row in iterate_losses(instance, plan, fly_again=fly_again, effort=1_000):
        assert (row.plan is not None) == (row.verdict is RepairStatus.FEASIBLE)
        if row.plan is not None:
            left = build_remaining_problem(instance, plan, row.vehicle, row.from_s, fly_again=fly_again)
            evaluation = evaluate(left.instance, row.plan, Cost.MINSUM)
            assert row.plan.uncovered == ()
            assert evaluation.violations == ()


def test_events_are_completions_and_landings() -> None:
    assert event_times_s(line(4, 99.0, 99.0), PLAN) == (0, 10, 20, 30, 40, 80)


def test_events_at_the_same_time_are_one() -> None:
    nearly = 10.0 + 1e-10
    ends_m = [[[0.0, 0.0], [10.0, 0.0]], [[0.0, 0.0], [0.0, nearly]]]
    instance = build_instance(ends_m, (0.0, 0.0), fleet(99.0, 99.0), UNIT)
    assert event_times_s(instance, Plan((Route(0, (0,)), Route(1, (2,))))) == (0, 10, 20)


def test_a_generous_budget_gives_a_full_window() -> None:
    window = replan_window(line(4, 200.0, 200.0), PLAN)
    assert (window.window_pct, window.earliest_s, window.certified_earliest_s) == (100, 0, 0)
    assert window.longest_route_s == 80
    assert window.breaking is None


def test_the_loss_that_ends_the_window() -> None:
    # Lost in [30, 40), b leaves segment 3: it takes a 80 s there and back, from the depot, on top of its 40.
    # Lost before 30 s it leaves 2 as well, on the same way. Lost in [20, 30) b takes a 80 s: the same. Lost in
    # [10, 20) it is the same, a still on its way out: it would need 40 s more from 20 m east and 40 s home.
    instance = line(4, 119.0, 90.0)
    window = replan_window(instance, PLAN)
    assert window.breaking == CriticalLoss(vehicle=1, from_s=30, to_s=40)
    assert window.earliest_s == 40
    assert window.certified_earliest_s == 40
    assert window.window_pct == pytest.approx(50)
    rows = {(row.vehicle, row.from_s): row.verdict for row in iterate_losses(instance, PLAN)}
    assert rows == {
        (1, 40): RepairStatus.FEASIBLE,
        (1, 30): RepairStatus.IMPOSSIBLE,
        (0, 30): RepairStatus.FEASIBLE,
        (1, 20): RepairStatus.IMPOSSIBLE,
        (0, 20): RepairStatus.FEASIBLE,
        (1, 10): RepairStatus.FEASIBLE,  # a goes on from 20 m east: 80 s in all
        (0, 10): RepairStatus.FEASIBLE,  # b takes segment 1 on its way home
        (1, 0): RepairStatus.FEASIBLE,
        (0, 0): RepairStatus.FEASIBLE,
    }


def test_no_vehicle_flies_twice_where_it_is_not_allowed() -> None:
    instance = line(4, 200.0, 200.0)
    assert replan_window(instance, PLAN, fly_again=False).breaking == CriticalLoss(vehicle=1, from_s=30, to_s=40)
    check_rows(instance, PLAN, fly_again=False)


def test_vehicles_fly_again_unless_it_is_forbidden() -> None:
    instance = line(4, 200.0, 200.0)
    assert replan_window(instance, PLAN) == replan_window(instance, PLAN, fly_again=True)
    assert list(iterate_losses(instance, PLAN)) == list(iterate_losses(instance, PLAN, fly_again=True))
    grounded = {(row.vehicle, row.from_s): row.verdict for row in iterate_losses(instance, PLAN, fly_again=False)}
    assert grounded[1, 30] is not RepairStatus.FEASIBLE
    # Lost at 35 s, b leaves segment 3, and a is on its way home.
    assert len(find_repairs_at(instance, PLAN, 35.0)) == len(find_repairs_at(instance, PLAN, 35.0, fly_again=True)) == 2
    assert [left.lost for left, _ in find_repairs_at(instance, PLAN, 35.0, fly_again=False)] == [0]


def test_the_re_plans_of_a_time_are_those_of_its_interval() -> None:
    instance = line(4, 200.0, 200.0)
    for at_s, began_s, lost in [(0.0, 0.0, {0, 1}), (29.0, 20.0, {0, 1}), (30.0, 30.0, {0, 1}), (79.0, 40.0, {1})]:
        repairs = find_repairs_at(instance, PLAN, at_s)
        assert {left.lost for left, _ in repairs} == lost
        for found, plan in repairs:
            left = build_remaining_problem(instance, PLAN, found.lost, began_s)
            assert found.open_segments == left.open_segments
            assert evaluate(left.instance, plan, Cost.MINSUM).violations == ()
    assert find_repairs_at(instance, PLAN, 81.0) == ()


def test_the_shares_are_of_the_longest_route() -> None:
    window = ReplanWindow(30.0, 10.0, 40.0, None)
    assert (window.window_pct, window.certified_window_pct) == (25.0, 75.0)
    short = ReplanWindow(0.5, 0.25, 1.0, None)
    assert (short.window_pct, short.certified_window_pct) == (50.0, 75.0)
    assert ReplanWindow(0.0, 0.0, 0.0, None).window_pct == 100.0


def test_a_plan_that_leaves_everything_out_has_an_empty_window_without_a_time() -> None:
    window = replan_window(line(4, 80.0, 80.0), Plan((Route(0, ()), Route(1, ())), (0, 1, 2, 3)))
    assert window == ReplanWindow(0.0, 0.0, 0.0, CriticalLoss(0, 0.0, 0.0))


def test_a_spare_on_the_ground_repairs_what_others_cannot() -> None:
    plan = Plan((*PLAN.routes, Route(2, ())))
    assert replan_window(line(4, 80.0, 80.0, 80.0), plan).window_pct == 100
    assert replan_window(line(4, 80.0, 80.0, 79.0), plan).window_pct < 100
    assert {row.vehicle for row in iterate_losses(line(4, 80.0, 80.0, 80.0), plan)} == {
        0,
        1,
    }  # the spare is not flying


def test_a_plan_that_leaves_something_out_has_an_empty_window() -> None:
    window = replan_window(line(4, 80.0, 80.0), Plan((Route(0, (0, 2)), Route(1, (4,))), (3,)))
    assert (window.window_pct, window.earliest_s, window.certified_earliest_s) == (0, 60, 60)
    assert window.breaking == CriticalLoss(1, 40, 60)


def test_a_plan_beyond_its_budgets_has_an_empty_window() -> None:
    assert replan_window(line(4, 80.0, 79.0), PLAN).window_pct == 0


def test_nothing_to_do_is_a_full_window() -> None:
    idle = Plan((Route(0, ()), Route(1, ())))
    assert replan_window(line(0, 1.0, 1.0), idle) == ReplanWindow(0.0, 0.0, 0.0, None)
    assert replan_window(line(0, 1.0, 1.0), idle).window_pct == 100
    assert replan_window(line(0, 1.0, 1.0), idle).certified_window_pct == 100
    assert find_repairs_at(line(0, 1.0, 1.0), idle, 0.0) == ()
    assert list(iterate_losses(line(0, 1.0, 1.0), idle)) == []


def test_no_flying_vehicle_can_be_lost() -> None:
    idle = Plan((Route(0, ()), Route(1, ())), (0,))
    assert find_repairs_at(line(1, 99.0, 99.0), idle, 0.0) == ()
    assert list(iterate_losses(line(1, 99.0, 99.0), idle)) == []


def test_the_only_flying_vehicle_can_be_lost_if_it_has_no_segments() -> None:
    vehicles = [*fleet(200.0), Vehicle("b", (0.0, 10.0), 200.0, airborne=True)]
    instance = build_instance([[[0.0, 0.0], [10.0, 0.0]]], (0.0, 0.0), vehicles, UNIT)
    idle = Plan((Route(0, ()), Route(1, ())), (0,))
    [row] = iterate_losses(instance, idle)
    assert (row.vehicle, row.from_s, row.to_s, row.verdict) == (1, 0, 10, RepairStatus.FEASIBLE)
    assert [left.lost for left, _ in find_repairs_at(instance, idle, 5.0)] == [1]


def test_a_loss_on_a_line_of_one_segment_is_one() -> None:
    instance, plan = line(1, 99.0, 99.0), Plan((Route(0, (0,)), Route(1, ())))
    assert [(row.from_s, row.to_s) for row in iterate_losses(instance, plan)] == [(10, 20), (0, 10)]
    assert [left.open_segments for left, _ in find_repairs_at(instance, plan, 5.0)] == [(0,)]


def test_a_fleet_of_one_has_no_survivor() -> None:
    instance, plan = line(1, 99.0), Plan((Route(0, (0,)),))
    with pytest.raises(PlanError, match="when it is lost"):
        replan_window(instance, plan)
    with pytest.raises(PlanError, match="when it is lost"):
        iterate_losses(instance, plan)
    with pytest.raises(PlanError, match="when it is lost"):
        find_repairs_at(instance, plan, 5.0)


def test_the_re_plans_of_the_earliest_time_are_complete() -> None:
    instance = line(4, 119.0, 90.0)
    window = replan_window(instance, PLAN)
    repairs = find_repairs_at(instance, PLAN, window.earliest_s)
    assert [left.lost for left, _ in repairs] == [1]
    for left, plan in repairs:
        assert evaluate(left.instance, plan, Cost.MINSUM).violations == ()


def test_the_network_of_the_paper() -> None:
    ends = nechranice_ends_m(500)
    vehicles = [Vehicle(f"uav{number}", (0.0, 0.0), 55.5 / 0.82) for number in range(4)]
    instance = build_instance(ends, (0, 0), vehicles, travel_for(PRESETS["mavic2"], 5.0, 1.0))
    plans = {
        cost: solve(instance, cost=cost, stop=Iterations(5_000), all_vehicles=True).plan
        for cost in (Cost.MINMAX, Cost.MINCOMB)
    }
    windows = {cost: replan_window(instance, plan) for cost, plan in plans.items()}
    assert windows == {cost: replan_window(instance, plan) for cost, plan in plans.items()}
    assert windows[Cost.MINMAX].window_pct < 15 < windows[Cost.MINCOMB].window_pct
    for window in windows.values():
        assert window.certified_earliest_s <= window.earliest_s
    check_rows(instance, plans[Cost.MINCOMB])


def test_an_airborne_vehicle_without_a_visit_may_take_some() -> None:
    vehicles = [*fleet(200.0), Vehicle("b", (0.0, 10.0), 200.0, airborne=True)]
    instance = build_instance([[[0.0, 0.0], [10.0, 0.0]]], (0.0, 0.0), vehicles, UNIT)
    plan = Plan((Route(0, (0,)), Route(1, ())))
    assert replan_window(instance, plan).window_pct == 100
    check_rows(instance, plan)


def test_a_plan_of_another_instance_is_refused() -> None:
    instance, plan = line(1, 99.0, 99.0), Plan((Route(0, (99,)), Route(1, ())))
    for look in (replan_window, iterate_losses, lambda one, other: find_repairs_at(one, other, 5.0)):
        with pytest.raises(PlanError, match="99"):
            look(instance, plan)
