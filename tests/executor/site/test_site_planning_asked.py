"""What is looked at is what is flown: one default for all commands, plans that belong to their site, nothing hidden."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path

import pytest

from executor.adapters.solver import REPLAN_COST
from executor.cli.options import DEFAULT_REPLAN_COST
from executor.core.interface.codes import Severity
from executor.site.plan_summary import build_plan_checks, describe_left_over, describe_routes, summarise_plan
from executor.site.site_model import build_first_task
from executor.site.site_planning import DEFAULT, PlanSolver, check_plan_fits, describe_site_changes, plan_site
from missions import PlanFile, PlanFileError, read_plan, write_plan
from planner import Cost
from tests.executor.builders import ground_for, site_of
from tests.executor.cli.test_main import Place, place
from tests.missions.builders import line_east

__all__ = ["place"]

NAMES = ("uav1", "uav2")
GROUND = ground_for(site_of(NAMES), line_east(7))
PLAN = plan_site(GROUND, replace(DEFAULT, seconds=0.2))


@pytest.mark.parametrize("command", ["plan", "preflight", "fly"])
def test_every_command_plans_by_the_same_default(place: Place, command: str) -> None:
    place.site(extra="[flight]\nconnect_timeout_s = 0.1")
    options = ["--seconds", "1", *(["--run", place.path("run")] if command == "fly" else [])]
    code, _, err = place.run(command, place.path("site.toml"), *options)
    assert code in {0, 1, 2}  # nobody answers
    assert "planning 4 segments for 2 vehicles (window, 1 s)" in err


def test_a_re_plan_is_chosen_by_the_same_cost_as_a_plan_that_can_have_no_window() -> None:
    assert DEFAULT.adapt_to_task(build_first_task(GROUND)).cost is None
    assert DEFAULT.adapt_to_task(build_first_task(ground_for(site_of(("uav1",)), line_east(7)))).cost is REPLAN_COST
    assert DEFAULT_REPLAN_COST.value == REPLAN_COST.value


def test_the_same_options_give_the_same_plan(place: Place) -> None:
    place.site(extra="[flight]\nconnect_timeout_s = 0.1")
    place.run("plan", place.path("site.toml"), "-o", place.path("plan.json"))
    place.run("fly", place.path("site.toml"), "--run", place.path("run"))
    looked_at, flown = (json.loads(Path(place.path(name)).read_text()) for name in ("plan.json", "run/plan-000.json"))
    assert flown | {"seconds": 0} == looked_at | {"seconds": 0}


def test_a_plan_is_flown_as_it_is(place: Place) -> None:
    place.site(extra="[flight]\nconnect_timeout_s = 0.1")
    plan = place.planned()
    place.run("fly", place.path("site.toml"), "--plan", plan, "--run", place.path("run"))
    assert Path(place.path("run/plan-000.json")).read_bytes() == Path(plan).read_bytes()


@pytest.mark.parametrize("option", [("--cost", "minsum"), ("--seed", "2"), ("--all-vehicles",), ("--after", "run")])
@pytest.mark.parametrize("command", ["fly", "preflight"])
def test_options_of_a_new_plan_are_none_of_an_old_one(place: Place, command: str, option: tuple[str, ...]) -> None:
    reason = place.refused(command, place.path("site.toml"), "--plan", place.planned(), *option)
    assert reason == f"{option[0]}: expected none with --plan, which is flown unchanged"


CHANGED: dict[str, tuple[dict[str, Mapping[str, object]], str]] = {
    "height": ({"inspection": {"height_m": 20}}, "inspection.height_m is 20, the plan was made with 15"),
    "layers": ({"inspection": {"layer_m": 8}}, "inspection.layer_m is 8, the plan was made with 5"),
    "speed": ({"inspection": {"speed_m_s": 4}}, "travel.inspection_speed_m_s is 4, the plan was made with 3"),
    "wind": ({"inspection": {"wind_m_s": [3, 0]}}, "travel.wind is "),
    "battery": ({"energy": {"capacity_ah": 3.0}}, "travel.transit_pct_per_s is "),
}


@pytest.mark.parametrize(("tables", "expected"), CHANGED.values(), ids=CHANGED)
def test_a_plan_for_a_changed_site_is_refused(tables: dict[str, Mapping[str, object]], expected: str) -> None:
    other = ground_for(site_of(NAMES, "ardupilot", **tables), line_east(7))
    with pytest.raises(PlanFileError, match=r"^plan\.json: the site has changed: .*: plan again$") as refused:
        check_plan_fits(PLAN, other, "plan.json")
    assert expected in str(refused.value)
    assert "\n" not in str(refused.value)


def test_a_smaller_budget_is_a_change(place: Place) -> None:
    plan = place.planned()
    place.site(budget_pct=60)
    for command in ("fly", "preflight"):
        reason = place.refused(command, place.path("site.toml"), "--plan", plan)
        assert "vehicles.uav1.budget_pct is 60, the plan was made with 75" in reason
        assert "vehicles.uav2.budget_pct is 60" in reason


def test_a_plan_with_wrong_figures_is_not_flown(place: Place) -> None:
    plan = Path(place.planned())
    content = json.loads(plan.read_text())
    content["routes"][0]["duration_s"] -= 60.0
    plan.write_text(json.dumps(content))
    reason = place.refused("fly", place.path("site.toml"), "--plan", str(plan))
    assert "route of uav1: duration_s is " in reason
    assert reason.endswith("`faultline check` says more")


def test_a_plan_of_the_site_as_it_is_fits() -> None:
    assert describe_site_changes(PLAN, GROUND) == []
    check_plan_fits(PLAN, GROUND, "plan.json")
    check_plan_fits(replace(PLAN, inspection=None), GROUND, "plan.json")


def test_the_checklist_shows_what_is_asked() -> None:
    lines = build_plan_checks(PLAN, segments=6)
    assert [line.severity for line in lines] == [Severity.OK] * 4
    flown = [len(route.visits) for route in PLAN.plan.routes]
    assert [line.text.split(",")[0] for line in lines] == [
        f"uav1: {flown[0]} segments", f"uav2: {flown[1]} segments", "6 of 6 segments",
        "re-plan window 100 %: from 0 s the fleet can absorb the loss of any one vehicle",
    ]  # fmt: skip
    assert "longest route" in lines[2].text


def test_a_part_of_the_site_is_reported_as_one() -> None:
    (warning,) = (line for line in build_plan_checks(PLAN, segments=9) if line.severity is Severity.WARNING)
    assert warning.text == "it is about 6 of the site's 9 segments; the others are not flown"


def test_preflight_shows_the_plan(place: Place) -> None:
    place.site(extra="[flight]\nconnect_timeout_s = 0.1")
    code, out, _ = place.run("preflight", place.path("site.toml"), "--json")
    assert code == 1
    said = [check["text"] for check in json.loads(out)["checks"] if check["subject"] == "plan"]
    assert said[-2].startswith("4 of 4 segments, longest route ")
    assert said[-1].startswith("re-plan window 100 %: from 0 s the fleet ")


def poor(budgets: dict[str, float], step: int = 7) -> PlanFile:
    site = site_of(tuple(budgets))
    vehicles = tuple(table.model_copy(update={"budget_pct": budgets[table.name]}) for table in site.vehicle)
    ground = ground_for(site.model_copy(update={"vehicle": vehicles}), line_east(step))
    return plan_site(ground, replace(DEFAULT, seconds=0.2))


def test_what_is_left_over_is_named_with_its_reason() -> None:
    lines = describe_left_over(poor({"uav1": 8.5}))
    assert [line.split(":")[0] for line in lines] == [
        "left over, reachable, but no battery left after the other segments",
        "left over, out of range of every vehicle's budget",
    ]
    assert lines[1].endswith(": segment 5 (9.29 % of 8.5 %)")


def test_of_many_that_are_left_over_some_are_named() -> None:
    (line,) = describe_left_over(poor({"uav1": 0.1}, step=40), most=3)
    assert line.endswith("and 36 more")


def test_no_vehicle_flies() -> None:
    assert summarise_plan(poor({"uav1": 0.1})) == "none of 6 segments, no vehicle flies"


def test_a_vehicle_without_segments_stays_or_returns() -> None:
    plan = poor({"uav1": 0.1})
    assert list(describe_routes(plan)) == ["uav1: no segments, stays on the ground"]
    flying = replace(plan, vehicles=tuple(replace(vehicle, airborne=True) for vehicle in plan.vehicles))
    assert list(describe_routes(flying)) == ["uav1: no segments, returns"]


def test_a_re_plan_for_nothing_is_said_to_be_one() -> None:
    assert summarise_plan(replace(PLAN, segments=(), routes=())) == "no segment is open"


def test_a_proven_plan_says_how_good_it_is(tmp_path: Path) -> None:
    exact = replace(DEFAULT, cost=Cost.MINMAX, usual=False, solver=PlanSolver.EXACT, seconds=600.0)
    write_plan(tmp_path / "plan.json", plan_site(GROUND, exact))
    plan = read_plan(tmp_path / "plan.json")
    assert plan.cost.bound == pytest.approx(plan.cost.value)
    assert summarise_plan(plan).endswith(", chosen by minmax, proven: no plan is better")
    unfinished = replace(plan, cost=replace(plan.cost, bound=0.9 * plan.cost.value))
    assert summarise_plan(unfinished).endswith(", proven: no plan is more than 10.00 % better")
    assert "proven" not in summarise_plan(PLAN)


ORDERS: list[Callable[[str], list[str]]] = [
    lambda site: ["plan", site, "--json"],
    lambda site: ["plan", site, "--json", "--cost", "minsum"],
]


@pytest.mark.parametrize("order", ORDERS)
def test_a_plan_that_leaves_something_over_is_a_no(place: Place, order: Callable[[str], list[str]]) -> None:
    place.site(budget_pct=0.9)
    code, out, _ = place.run(*order(place.path("site.toml")), "--seconds", "0.2")
    answer = json.loads(out)
    assert code == 1
    assert answer["uncovered"] == [one["segment"] for one in answer["left_over"]]
