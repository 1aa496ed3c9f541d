"""The missions on board, and when another plan is better."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import pytest

from planner import (
    Instance,
    Plan,
    PlanError,
    Route,
    Travel,
    Vehicle,
    build_instance,
    build_onboard_plan,
    evaluate,
    grant_onboard_budgets,
    rate_plan,
    route_energy_pct,
    select_best_plan,
)
from planner.evaluate import Cost
from planner.replan import PlanRating, is_better_rating

PLAIN = PlanRating(3, 300.0, 1, 100.0, 50.0, 60.0, 30.0)
"""Three segments of 100 m and one to spare, within 60 s and 30 %."""


def line(*budgets_pct: float) -> Instance:
    """Four segments of 10 m due east of the depot, 1 m/s and 1 % a second; all vehicles start at the depot."""
    ends_m = [[[10.0 * (number + 1), 0.0], [10.0 * (number + 2), 0.0]] for number in range(4)]
    vehicles = [Vehicle(f"uav{number}", (0.0, 0.0), budget) for number, budget in enumerate(budgets_pct, start=1)]
    return build_instance(ends_m, (0.0, 0.0), vehicles, Travel(1.0, 1.0, 1.0, 1.0))


def test_what_is_carried_is_the_plan_as_long_as_budgets_last() -> None:
    instance = line(60.0, 80.0)
    carried = build_onboard_plan(instance, [(0, 2), (4,)])
    assert carried.plan == Plan((Route(0, (0, 2)), Route(1, (4,))), (3,))
    assert carried.short == ()


def test_a_budget_that_does_not_last_ends_a_route_with_the_last_visit_that_it_pays_home() -> None:
    """To the end of segment 1 and home it takes 60 s, of segment 2 80 s."""
    carried = build_onboard_plan(line(79.9, 100.0), [(0, 2, 4), (6,)])
    assert carried.plan == Plan((Route(0, (0, 2)), Route(1, (6,))), (2,))
    assert carried.short == (0,)


def test_only_visits_of_the_instance_are_carried() -> None:
    with pytest.raises(PlanError, match="a segment occurs twice"):
        build_onboard_plan(line(60.0, 60.0), [(0,), (1,)])


@pytest.mark.parametrize(("most_pct", "budget_pct"), [(85.0, 80.0), (80.0, 80.0), (79.0, 70.0), (0.0, 70.0)])
def test_a_mission_over_budget_may_continue_as_long_as_the_battery_lasts(most_pct: float, budget_pct: float) -> None:
    """Its route takes 80 %."""
    instance = grant_onboard_budgets(line(70.0, 90.0), [(0, 2, 4), ()], [most_pct, 100.0])
    assert [vehicle.budget_pct for vehicle in instance.vehicles] == [budget_pct, 90.0]
    assert route_energy_pct(instance, Route(0, (0, 2, 4))) == 80.0


def test_the_worth_of_a_plan_counts_what_is_to_spare_apart() -> None:
    instance = line(100.0, 100.0)
    found = rate_plan(instance, Plan((Route(0, (0, 2, 4)), Route(1, ())), (3,)), {2, 3})
    assert found == PlanRating(2, 20.0, 1, 10.0, 5.0, 80.0, 80.0)


ROWS: list[tuple[str, Callable[[PlanRating], PlanRating], bool]] = [
    ("the same", lambda one: one, False),
    ("one more segment", lambda one: replace(one, segments=4, value=400.0, longest_s=99.0, spare_segments=0), True),
    ("one more segment, but a shorter length in total", lambda one: replace(one, segments=4, value=299.0), False),
    (
        "as many segments, and a much longer length in total",
        lambda one: replace(one, value=351.0, longest_s=99.0),
        True,
    ),
    (
        "as many segments, and a slightly longer length in total",
        lambda one: replace(one, value=350.0, longest_s=60.0),
        False,
    ),
    ("one segment fewer, but a longer length in total", lambda one: replace(one, segments=2, value=900.0), False),
    ("one more spare segment", lambda one: replace(one, spare_segments=2, spare_value=150.0, longest_s=99.0), True),
    ("one spare segment fewer", lambda one: replace(one, spare_segments=0, spare_value=0.0, longest_s=1.0), False),
    ("a shorter longest route", lambda one: replace(one, longest_s=54.9), True),
    ("a longest route as short", lambda one: replace(one, longest_s=55.0), False),
    ("a shorter longest route that uses more", lambda one: replace(one, longest_s=40.0, largest_pct=30.1), False),
]


@pytest.mark.parametrize(("what", "change", "expected"), ROWS, ids=[row[0] for row in ROWS])
def test_more_covered_is_better_then_a_shorter_longest_route(
    what: str, change: Callable[[PlanRating], PlanRating], expected: bool
) -> None:
    assert is_better_rating(change(PLAIN), PLAIN) is expected, what


def test_what_is_carried_stands_unless_another_plan_is_better() -> None:
    instance = line(100.0, 100.0)
    carried = build_onboard_plan(instance, [(0, 2), (4,)]).plan
    worse = Plan((Route(0, (0, 2, 4)), Route(1, ())), (3,))
    more = Plan((Route(0, (0, 2)), Route(1, (4, 6))))
    assert select_best_plan(instance, carried, [worse]) is carried
    assert select_best_plan(instance, carried, [worse, more]) is more
    assert evaluate(instance, more, Cost.MINMAX).violations == ()
