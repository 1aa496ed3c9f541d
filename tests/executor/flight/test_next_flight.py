"""The next flight plans the segments that a flight left over."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from executor.analysis.documents import FlightReport
from executor.analysis.report import build_report
from executor.core import fleet_step
from executor.core.replanning import replan_cycle
from executor.errors import LogError
from executor.flight.next_flight import describe_next_flight, plan_next_flight, read_segments_left
from executor.site import site_model, site_planning
from executor.site.site_model import SiteModel
from missions import Network, PlanFile, PlanFileError, read_plan, write_plan
from planner import segment_of
from tests.executor.builders import ground_for, site_of, with_facts
from tests.executor.flights import short_report
from tests.missions.builders import line_east, network_of

NAMES = ("uav1", "uav2", "uav3")


@pytest.fixture
def ground() -> SiteModel:
    return ground_for(site_of(NAMES), line_east(7))


def line(step_m: float) -> Network:
    """Return a line due east of six segments of a length."""
    return network_of([(step_m * number, 0.0) for number in range(1, 8)], [(index, index + 1) for index in range(6)])


def segments_of(plan: PlanFile) -> list[int]:
    return sorted(plan.segments[segment_of(visit)].id for route in plan.plan.routes for visit in route.visits)


def test_segments_left_over_are_planned_for_healthy_vehicles(ground: SiteModel) -> None:
    plan = plan_next_flight(ground, short_report([2, 4, 5], "uav2"), seed=1)
    assert plan is not None
    assert [vehicle.name for vehicle in plan.vehicles] == ["uav1", "uav3"]
    assert segments_of(plan) == [2, 4, 5]
    assert "for uav1, uav3 with full batteries" in describe_next_flight(plan, Path("next.json"))


def test_what_is_beyond_the_budgets_is_named(ground: SiteModel) -> None:
    poor = ground_for(site_of(NAMES), line(4000.0))
    plan = plan_next_flight(poor, short_report([0, 5]), seed=1)
    assert plan is not None
    _, left = describe_next_flight(plan, Path("next.json")).splitlines()
    assert left == (
        "left over, out of range of every vehicle's budget: segment 0 (101.95 % of 75 %), segment 5 (273.50 % of 75 %)"
    )


@pytest.mark.parametrize("case", [short_report([]), short_report([], "uav1"), short_report([1], *NAMES)])
def test_nothing_left_over_or_no_vehicle_to_fly_it(ground: SiteModel, case: FlightReport) -> None:
    assert plan_next_flight(ground, case, seed=1) is None


def test_it_fits_a_site_without_the_lost_vehicle(ground: SiteModel, tmp_path: Path) -> None:
    plan = plan_next_flight(ground, short_report([2, 4], "uav2"), seed=1)
    assert plan is not None
    write_plan(tmp_path / "next.json", plan)
    kept = read_plan(tmp_path / "next.json")
    site_planning.check_plan_fits(kept, ground_for(site_of(("uav1", "uav3")), line_east(7)), "next.json")
    with pytest.raises(PlanFileError, match=r"next.json: vehicles: expected uav1, uav2, uav3, got uav1, uav3"):
        site_planning.check_plan_fits(kept, ground, "next.json")
    with pytest.raises(PlanFileError, match=r"segment 4: expected one of the site's 3 segments"):
        site_planning.check_plan_fits(kept, ground_for(site_of(("uav1", "uav3")), line_east(4)), "next.json")


def test_a_flight_is_for_the_segments_of_its_plan(ground: SiteModel) -> None:
    plan = plan_next_flight(ground, short_report([2, 4, 5]), seed=1)
    assert plan is not None
    context = site_model.build_context(ground, ground.setup, plan.build_task())
    before = fleet_step.build_initial_state(dict.fromkeys(NAMES))
    assert context.segments == 3
    assert replan_cycle.find_orphan_segments(context, before) == {2, 4, 5}
    flown = build_report(context, with_facts(before, inspected={4: "uav1"}), 100.0)
    assert (flown.segments_total, flown.segments_inspected) == (3, 1)
    assert (flown.segments_uncovered, flown.finished) == ((2, 5), False)


def test_the_flight_of_another_line_is_refused(ground: SiteModel, tmp_path: Path) -> None:
    plan = plan_next_flight(ground, short_report([2, 4]), seed=1)
    assert plan is not None
    write_plan(tmp_path / "plan-000.json", plan)
    short_report([4]).write(tmp_path / "report.json")
    assert read_segments_left(tmp_path, ground) == (4,)
    with pytest.raises(PlanFileError, match=r"segment 2: expected where the site's segment 2 is, got .* m beside it"):
        read_segments_left(tmp_path, ground_for(site_of(NAMES), line(120.0)))


@pytest.mark.parametrize(
    ("content", "why"),
    [
        (None, "report.json: cannot be read: No such file or directory; expected the report of a flight"),
        ("{}", "report.json: format: expected this key, but it is missing"),
        (json.dumps(short_report([]).to_plain()), "report.json: segments_uncovered: nothing is left over"),
    ],
)
def test_a_report_that_says_nothing_is_refused(
    ground: SiteModel, tmp_path: Path, content: str | None, why: str
) -> None:
    if content is not None:
        (tmp_path / "report.json").write_text(content)
    with pytest.raises(LogError, match=why):
        read_segments_left(tmp_path, ground)
