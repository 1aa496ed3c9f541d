"""The definition of the figures, by hand."""

from __future__ import annotations

import pytest

from planner import (
    Cost,
    Plan,
    PlanError,
    Route,
    completion_times_s,
    evaluate,
    route_duration_s,
    route_energy_pct,
)
from tests.planner.builders import line

# Segments 0-10, 10-20, 20-30 m east; out and back on visit 0 is 10 + 10, on visit 4 (segment 2) 20 + 10 + 30.
INSTANCE = line(3, 100.0, 50.0)
PLAN = Plan((Route(0, (0, 2)), Route(1, (4,))))  # energies 10 + 10 + 20 = 40 and 60


def test_times_and_energies_of_a_route() -> None:
    assert completion_times_s(INSTANCE, PLAN.routes[0]) == (10.0, 20.0)
    assert route_duration_s(INSTANCE, PLAN.routes[0]) == 40.0
    assert route_energy_pct(INSTANCE, PLAN.routes[1]) == 60.0


def test_a_route_without_a_visit_takes_nothing_on_the_ground() -> None:
    assert route_duration_s(INSTANCE, Route(0, ())) == 0.0
    assert route_energy_pct(INSTANCE, Route(0, ())) == 0.0


@pytest.mark.parametrize(
    ("cost", "value"),
    [
        (Cost.MINMAX, 60.0),
        (Cost.MINSUM, 40.0 + 60.0 + 1000 * 10.0),
        (Cost.MINCOMB, 40.0 + 60.0 + 1000 * 10.0 + 60.0 / 2),
    ],
)
def test_the_papers_cost_functions(cost: Cost, value: float) -> None:
    assert evaluate(INSTANCE, PLAN, cost).value == value


def test_all_figures_of_a_plan() -> None:
    evaluation = evaluate(INSTANCE, PLAN, Cost.MINMAX)
    assert evaluation.value == 60.0
    assert evaluation.durations_s == (40.0, 60.0)
    assert evaluation.energies_pct == (40.0, 60.0)
    assert evaluation.longest_route_s == 60.0
    assert evaluation.violations == ("b spends 60.000 % of its budget of 50.000 %",)


def test_what_is_wrong_is_reported() -> None:
    plan = Plan((Route(0, (0, 14)), Route(1, ())), uncovered=(9,))
    evaluation = evaluate(INSTANCE, plan, Cost.MINSUM)
    assert evaluation.energies_pct == (20.0, 0.0)
    assert evaluation.violations == (
        "segment 7 is not in the instance",
        "segment 9 is not in the instance",
        "segment 1 is neither visited nor named as uncovered",
        "segment 2 is neither visited nor named as uncovered",
    )


def test_named_as_uncovered_is_no_violation() -> None:
    assert evaluate(INSTANCE, Plan((Route(0, (0,)), Route(1, ())), (1, 2)), Cost.MINMAX).violations == ()


def test_a_plan_of_another_fleet_is_refused() -> None:
    with pytest.raises(PlanError, match="1 routes, the instance 2 vehicles"):
        evaluate(INSTANCE, Plan((Route(0, ()),)), Cost.MINSUM)
    with pytest.raises(PlanError, match="visit 6"):
        route_energy_pct(INSTANCE, Route(0, (6,)))
    with pytest.raises(PlanError, match="vehicle 2"):
        completion_times_s(INSTANCE, Route(2, ()))


def test_a_plan_visits_no_segment_twice() -> None:
    with pytest.raises(PlanError, match="twice"):
        Plan((Route(0, (0,)), Route(1, (1,))))
    with pytest.raises(PlanError, match="order of the vehicles"):
        Plan((Route(1, ()), Route(0, ())))
