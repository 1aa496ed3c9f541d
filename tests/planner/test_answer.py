"""Survivors fly on as planned until they have an answer to a loss: windows reckon with it."""

from __future__ import annotations

from dataclasses import replace

import pytest

from planner import (
    Cost,
    Instance,
    InstanceError,
    Iterations,
    Plan,
    Route,
    build_remaining_problem,
    evaluate,
    replan_window,
    solve,
    solve_window,
)
from planner.evaluate import RepairStatus
from planner.fleet_state import event_times_s
from planner.window import iterate_losses
from tests.planner.builders import fleet, line, random_instance

# Segments 0-10, 10-20, ... m east of the depot; a metre is a second is a percent.
PLAN = Plan((Route(0, (0, 2)), Route(1, (4, 6))))


def answered(instance: Instance, answer_s: float) -> Instance:
    return replace(instance, answer_s=answer_s)


def test_the_lost_one_stops_at_once_and_the_others_fly_on() -> None:
    left = build_remaining_problem(answered(line(4, 200.0, 200.0), 7.0), PLAN, 1, 5.0)
    # At 5 s uav1 is in its first visit, but at 12 s in its second one.
    assert left.survivors[0].completed == (0,)
    assert left.survivors[0].finishing == 2
    assert left.open_segments == (2, 3)
    assert left.instance.answer_s == 7.0
    without = build_remaining_problem(line(4, 200.0, 200.0), PLAN, 1, 5.0)
    assert (without.survivors[0].finishing, without.open_segments) == (0, (1, 2, 3))


def test_what_changes_later_for_survivors_counts_as_well() -> None:
    assert event_times_s(answered(line(4, 99.0, 99.0), 7.0), PLAN) == (0, 3, 10, 13, 20, 23, 30, 33, 40, 73, 80)


def test_a_window_is_never_larger_for_it() -> None:
    # Until 20 s uav1 is on its way out and may go on; at home it must begin anew.
    instance = line(4, 100.0, 90.0)
    at_once, later = (replan_window(answered(instance, answer_s), PLAN) for answer_s in (0.0, 15.0))
    assert later.earliest_s >= at_once.earliest_s


@pytest.mark.parametrize("answer_s", [0.0, 4.0, 40.0])
@pytest.mark.parametrize("seed", [1, 2, 3])
def test_every_re_plan_holds_by_the_definition(seed: int, answer_s: float) -> None:
    instance = answered(random_instance(seed, 8, fleet(400.0, 400.0, 400.0)), answer_s)
    plan = solve(instance, cost=Cost.MINMAX, stop=Iterations(500), seed=seed).plan
    rows = list(iterate_losses(instance, plan, effort=500))
    assert any(row.verdict is RepairStatus.FEASIBLE for row in rows)
    for row in rows:
        if row.plan is not None:
            # At any time of the interval, not just at its begin.
            for at_s in (row.from_s, (row.from_s + row.to_s) / 2):
                left = build_remaining_problem(instance, plan, row.vehicle, at_s)
                assert evaluate(left.instance, row.plan, Cost.MINSUM).violations == ()


def test_a_search_for_windows_finds_what_the_definition_says() -> None:
    instance = answered(random_instance(5, 10, fleet(600.0, 600.0, 600.0)), 20.0)
    found = solve_window(instance, stretch=0.1, stop=Iterations(4000), seed=1)
    assert found.window == replan_window(instance, found.plan)


def test_an_answer_takes_no_negative_time() -> None:
    with pytest.raises(InstanceError, match="answer_s is -1"):
        answered(line(2, 99.0), -1.0)
