"""What a loss leaves, by hand on a line of segments, and the plans that repair it."""

from __future__ import annotations

import pytest

from planner import (
    Cost,
    FirstFeasible,
    Iterations,
    Plan,
    PlanError,
    Route,
    Travel,
    Vehicle,
    build_instance,
    build_remaining_problem,
    combine_stop_rules,
    evaluate,
    replan,
    route_energy_pct,
    solve,
    warm_start,
)
from tests.planner.builders import UNIT, fleet, line, nechranice_ends_m, table_pct, table_s

# Segments 0-10, 10-20, ... m east of the depot; a metre is a second is a percent.
# a: 0, 1, 2 end at 10, 20, 30 s, home at 60. b: 3, 4 end at 40, 50 s, home at 100. c stays on the ground.
INSTANCE = line(5, 200.0, 200.0, 200.0)
PLAN = Plan((Route(0, (0, 2, 4)), Route(1, (6, 8)), Route(2, ())))


def test_a_loss_in_the_middle_of_a_visit() -> None:
    left = build_remaining_problem(INSTANCE, PLAN, lost=0, at_s=15.0)
    assert left.completed == (0,)
    assert left.open_segments == (1, 2, 4)  # a's second, under way, is open again; b finishes 3
    b, c = left.survivors
    assert (b.vehicle, b.completed, b.finishing, b.tail) == (1, (), 6, (8,))
    assert (b.free_s, b.spent_pct, b.budget_left_pct) == (40.0, 40.0, 160.0)
    assert (c.vehicle, c.completed, c.finishing, c.tail) == (2, (), None, ())
    assert (c.free_s, c.spent_pct, c.budget_left_pct) == (15.0, 0.0, 200.0)


def test_the_reduced_instance_starts_where_the_survivors_become_free() -> None:
    reduced = build_remaining_problem(INSTANCE, PLAN, lost=0, at_s=15.0).instance
    b, c = reduced.vehicles
    assert (b.name, b.start_m, b.airborne, b.budget_pct) == ("b", (40.0, 0.0), True, 160.0)
    assert (c.name, c.start_m, c.airborne, c.budget_pct) == ("c", (0.0, 0.0), False, 200.0)
    # Segments 1, 2 and 4 in both directions, from the end of visit 6 at 40 m east and from the depot.
    assert reduced.start_s.tolist() == [[40, 30, 30, 20, 10, 20], [20, 30, 30, 40, 50, 60]]
    assert reduced.start_pct.tolist() == reduced.start_s.tolist()
    assert reduced.home_s.tolist() == [[20, 10, 30, 20, 50, 40]] * 2
    assert reduced.idle_s.tolist() == [40.0, 0.0]
    assert reduced.idle_pct.tolist() == [40.0, 0.0]
    assert reduced.value.tolist() == [10.0] * 3


def test_the_reduced_instance_is_what_build_instance_makes_of_the_same_state() -> None:
    vehicles = [
        Vehicle(name, (0.0, 0.0), 300.0, consumption) for name, consumption in zip("abc", (1, 1.5, 2), strict=True)
    ]
    travel = Travel(4.0, 1.0, 0.5, 0.25)
    ends = [
        [[30.0, 10.0], [60.0, 50.0]],
        [[-20.0, 5.0], [-50.0, 45.0]],
        [[7.0, -3.0], [11.0, 90.0]],
        [[1.0, 2.0], [3.0, 4.0]],
    ]
    instance = build_instance(ends, (5.0, 5.0), vehicles, travel)
    plan = Plan((Route(0, (0,)), Route(1, (3, 4)), Route(2, (7,))))
    left = build_remaining_problem(instance, plan, lost=0, at_s=0.0)
    rebuilt = build_instance([ends[0], ends[2]], (5.0, 5.0), left.instance.vehicles, travel)
    assert table_s(left.instance) == pytest.approx(table_s(rebuilt))
    assert table_pct(left.instance) == pytest.approx(table_pct(rebuilt))
    for name in ("start_s", "home_s", "idle_s", "start_pct", "home_pct", "idle_pct", "depot_s", "depot_pct", "value",
                 "end_m"):  # fmt: skip
        assert getattr(left.instance, name) == pytest.approx(getattr(rebuilt, name)), name


def test_a_visit_that_ends_at_the_moment_of_the_loss_has_ended() -> None:
    left = build_remaining_problem(INSTANCE, PLAN, lost=0, at_s=20.0)
    assert left.completed == (0, 2)
    assert left.open_segments == (2, 4)


def test_a_visit_flown_to_is_finished_first() -> None:
    left = build_remaining_problem(INSTANCE, PLAN, lost=0, at_s=0.0)
    assert left.open_segments == (0, 1, 2, 4)
    assert left.survivors[0].finishing == 6


def test_a_returning_vehicle_flies_again_from_where_it_is() -> None:
    left = build_remaining_problem(INSTANCE, PLAN, lost=1, at_s=35.0)  # a has done its three and is home at 60
    a = left.survivors[0]
    assert (a.completed, a.finishing, a.free_s, a.spent_pct, a.budget_left_pct) == ((0, 2, 4), None, 60.0, 60.0, 140.0)
    assert left.instance.vehicles[0].airborne is False
    assert left.instance.start_s[0].tolist() == INSTANCE.depot_s[0, [6, 7, 8, 9]].tolist()
    landed = build_remaining_problem(INSTANCE, PLAN, lost=1, at_s=70.0).survivors[0]
    assert (landed.free_s, landed.spent_pct) == (70.0, 60.0)


def test_a_vehicle_that_must_not_fly_again_has_no_budget() -> None:
    left = build_remaining_problem(INSTANCE, PLAN, lost=1, at_s=35.0, fly_again=False)
    assert [survivor.budget_left_pct for survivor in left.survivors] == [0.0, 0.0]
    assert left.warm.uncovered == (0, 1)
    stopped = replan(left.instance, warm=left.warm, stop=FirstFeasible())
    assert not stopped.feasible
    assert stopped.iterations == 0


def test_the_warm_plan_keeps_tails_and_covers_what_is_open() -> None:
    left = build_remaining_problem(INSTANCE, PLAN, lost=0, at_s=15.0)
    assert left.warm.uncovered == ()
    covered = [left.original_visit(visit) >> 1 for route in left.warm.routes for visit in route.visits]
    assert sorted(covered) == [1, 2, 4]
    assert left.original_visit(left.warm.routes[0].visits[0]) == 8
    assert evaluate(left.instance, left.warm, Cost.MINSUM).violations == ()


def test_what_the_plan_left_uncovered_is_open() -> None:
    plan = Plan((Route(0, (0, 2)), Route(1, (6, 8)), Route(2, ())), uncovered=(2,))
    assert build_remaining_problem(INSTANCE, plan, lost=2, at_s=1000.0).open_segments == (2,)


def test_a_second_loss_during_the_repaired_flight() -> None:
    first = build_remaining_problem(INSTANCE, PLAN, lost=0, at_s=15.0)
    # b from 40 m takes 4 (to 50 m, 10 s) and flies home; c from the depot takes 1 and 2 (20, 30 s).
    plan = Plan((Route(0, (4,)), Route(1, (0, 2))))
    second = build_remaining_problem(first.instance, plan, lost=1, at_s=25.0)
    assert [first.open_segments[segment] for segment in second.open_segments] == [2]
    b = second.survivors[0]
    assert (b.completed, b.finishing, b.free_s, b.spent_pct, b.budget_left_pct) == ((4,), None, 60.0, 60.0, 100.0)
    assert second.instance.vehicles[0].start_m == (0.0, 0.0)
    assert second.instance.start_s[0].tolist() == [30.0, 40.0]


def test_an_airborne_survivor_without_a_visit_lands_first() -> None:
    vehicles = [Vehicle("a", (0.0, 0.0), 100.0), Vehicle("b", (30.0, 0.0), 100.0, airborne=True)]
    instance = build_instance([[[10.0, 0.0], [20.0, 0.0]]], (0.0, 0.0), vehicles, UNIT)
    left = build_remaining_problem(instance, Plan((Route(0, (0,)), Route(1, ()))), lost=0, at_s=5.0)
    b = left.survivors[0]
    assert (b.free_s, b.spent_pct, b.budget_left_pct) == (30.0, 30.0, 70.0)
    assert left.instance.vehicles[0].airborne is False
    assert left.instance.start_s[0].tolist() == [20.0, 30.0]


def test_nothing_is_left_when_the_lost_vehicle_had_done_its_part() -> None:
    left = build_remaining_problem(INSTANCE, PLAN, lost=0, at_s=55.0)
    assert left.open_segments == ()
    result = replan(left.instance, warm=left.warm, stop=Iterations(100))
    assert result.feasible
    assert left.warm == Plan((Route(0, ()), Route(1, ())))


@pytest.mark.parametrize(
    ("plan", "lost", "at_s", "message"),
    [
        (PLAN, 3, 0.0, "vehicle 3 is not in the plan of 3"),
        (PLAN, 0, -1.0, "expected zero or more"),
        (PLAN, 0, float("nan"), "expected zero or more"),
        (Plan((Route(0, (0,)),)), 0, 0.0, "1 routes for 3 vehicles"),
    ],
)
def test_a_loss_that_cannot_be_is_refused(plan: Plan, lost: int, at_s: float, message: str) -> None:
    with pytest.raises(PlanError, match=message):
        build_remaining_problem(INSTANCE, plan, lost, at_s)


def test_the_loss_of_the_only_vehicle_is_refused() -> None:
    with pytest.raises(PlanError, match="a is the only vehicle"):
        build_remaining_problem(line(1, 100.0), Plan((Route(0, (0,)),)), lost=0, at_s=1.0)


def test_a_tail_that_a_battery_no_longer_carries_is_cut() -> None:
    # Out to 50 m and back is 100 %, to 40 m 80 %; b has 30 % and takes what is near.
    plan = warm_start(line(5, 85.0, 30.0), [[0, 2, 4, 6, 8], []])
    assert plan.routes[0].visits == (0, 2, 4, 6)
    assert plan.uncovered == (4,)


@pytest.mark.parametrize(
    ("tails", "message"),
    [([[0]], "1 routes for 2"), ([[0], [1]], "twice"), ([[10], []], "visit 10 is not")],
)
def test_tails_of_another_instance_are_refused(tails: list[list[int]], message: str) -> None:
    with pytest.raises(PlanError, match=message):
        warm_start(line(5, 85.0, 30.0), tails)


def test_a_loss_on_the_papers_network_is_repaired_within_the_budgets() -> None:
    travel = Travel(5.0, 1.0, 1.0, 1.0)
    instance = build_instance(nechranice_ends_m(2000), (0.0, 0.0), fleet(*[7700.0] * 4), travel)
    flown = solve(instance, cost=Cost.MINCOMB, stop=Iterations(6000), all_vehicles=True)
    left = build_remaining_problem(instance, flown.plan, lost=2, at_s=0.6 * flown.evaluation.longest_route_s)
    repaired = replan(
        left.instance, warm=left.warm, stop=combine_stop_rules(FirstFeasible(), Iterations(20_000)), seed=1
    )
    assert repaired.feasible
    assert repaired.evaluation.violations == ()
    for survivor, route in zip(left.survivors, repaired.plan.routes, strict=True):
        spent = survivor.spent_pct + route_energy_pct(left.instance, route)
        assert spent <= instance.vehicles[survivor.vehicle].budget_pct + 1e-6
    inspected = {left.original_visit(visit) >> 1 for route in repaired.plan.routes for visit in route.visits}
    assert inspected == set(left.open_segments)


def test_a_hopeless_loss_ends_at_once_and_says_why() -> None:
    travel = Travel(5.0, 1.0, 1.0, 1.0)
    instance = build_instance(nechranice_ends_m(2000), (0.0, 0.0), fleet(*[7000.0] * 4), travel)
    flown = solve(instance, cost=Cost.MINSUM, stop=Iterations(4000))
    left = build_remaining_problem(instance, flown.plan, lost=0, at_s=0.0)
    result = replan(left.instance, warm=left.warm, stop=FirstFeasible())
    assert (result.iterations, result.stopped_by) == (0, "no feasible plan exists")
    assert result.impossible is not None
    assert result.plan.uncovered
    assert result.evaluation.violations == ()


# Segments 0-10, 10-20, ... m east of the depot; a metre is a second is a percent.
ROUTES = Plan((Route(0, (0, 2)), Route(1, (4, 6)), Route(2, ())))


@pytest.mark.parametrize(
    ("at_s", "completed", "finishing", "tail", "free_s", "spent_pct", "left_pct"),
    [
        (0.0, (), 0, (2,), 10.0, 10.0, 31.0),
        (9.9, (), 0, (2,), 10.0, 10.0, 31.0),
        (10.0, (0,), 2, (), 20.0, 20.0, 21.0),
        (20.0, (0, 2), None, (), 40.0, 40.0, 1.0),
        (50.0, (0, 2), None, (), 50.0, 40.0, 1.0),
    ],
)
def test_what_a_survivor_has_done_and_may_do(
    at_s: float, completed: tuple[int, ...], finishing: int | None, tail: tuple[int, ...], free_s: float,
    spent_pct: float, left_pct: float,
) -> None:  # fmt: skip
    left = build_remaining_problem(line(4, 41.0, 99.0, 70.0), ROUTES, 1, at_s)
    one, spare = left.survivors
    assert (one.completed, one.finishing, one.tail) == (completed, finishing, tail)
    assert (one.free_s, one.spent_pct, one.budget_left_pct) == (free_s, spent_pct, left_pct)
    assert (spare.completed, spare.finishing, spare.free_s, spare.budget_left_pct) == ((), None, at_s, 70.0)
    assert left.instance.idle_s.tolist()[1] == left.instance.idle_pct.tolist()[1] == 0.0
    assert left.instance.idle_s.tolist()[0] == (0.0 if finishing is None else 10.0 + 5.0 * finishing)


@pytest.mark.parametrize("at_s", [0.0, 15.0, 50.0])
def test_a_budget_that_is_overdrawn_leaves_nothing(at_s: float) -> None:
    left = build_remaining_problem(line(4, 5.0, 99.0, 70.0), ROUTES, 1, at_s)
    assert left.survivors[0].budget_left_pct == 0.0
