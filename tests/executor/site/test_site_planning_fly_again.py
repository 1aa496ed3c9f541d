"""A site whose vehicles do not fly again: its windows and re-plans do without those that have landed."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

from executor.site.site_planning import DEFAULT, plan_front, plan_site, preview_loss, to_plan_window
from missions import PlanFile, build_plan_document, check_plan, make_plan_file, read_plan, write_plan
from planner import Cost, Plan, Route, completion_times_s, replan_window
from tests.executor.builders import ground_for, site_of
from tests.missions.builders import line_east

NAMES = ("uav1", "uav2")
ASK, NEVER = (ground_for(site_of(NAMES, flight={"fly_again": again}), line_east(5)) for again in ("ask", "never"))


def uneven() -> PlanFile:
    """Return a plan of four segments by which uav1 is home before uav2 has done half of its work."""
    content = plan_site(NEVER, replace(DEFAULT, seconds=0.1))
    plan = Plan((Route(0, (0,)), Route(1, (7, 5, 3))))
    made = make_plan_file(
        content.build_network(), content.build_task(), content.travel, plan, Cost.MINMAX, content.solved
    )
    return replace(made, fly_again=False)


def test_a_plan_file_says_whether_they_do(tmp_path: Path) -> None:
    for ground, again in ((ASK, True), (NEVER, False)):
        content = plan_site(ground, replace(DEFAULT, seconds=0.1))
        assert content.fly_again is again
        assert build_plan_document(content)["fly_again"] is again
        write_plan(tmp_path / "plan.json", content)
        assert read_plan(tmp_path / "plan.json").fly_again is again


def test_a_landed_vehicle_takes_over_nothing() -> None:
    content = uneven()
    instance = content.build_instance()
    first_s, second_s, _ = completion_times_s(instance, content.plan.routes[1])
    at_s = max(content.durations_s[0] + 1.0, first_s)
    assert at_s < second_s
    for again in (True, False):
        flown = replace(content, fly_again=again)
        found, is_feasible = preview_loss(flown, "uav2", at_s, cost=Cost.MINMAX, seconds=0.1, seed=1)
        assert is_feasible is again
        assert found.fly_again is again
        assert len(found.segments) == 2


def test_a_window_is_smaller_without_them() -> None:
    content = uneven()
    windows = [replan_window(content.build_instance(), content.plan, fly_again=again) for again in (True, False)]
    assert windows[1].window_pct < windows[0].window_pct
    kept = replace(content, window=to_plan_window(windows[1], content.build_instance()))
    assert [line for line in check_plan(kept) if line.startswith("window")] == []
    [wrong] = [line for line in check_plan(replace(kept, fly_again=True)) if line.startswith("window.earliest_s")]
    assert "its content gives" in wrong


def test_plans_for_the_window_and_the_front_go_by_it(tmp_path: Path) -> None:
    wanted = replace(DEFAULT, cost=None, seconds=0.5)
    for content in (plan_site(NEVER, wanted), *plan_front(NEVER, wanted)):
        assert content.window is not None
        found = replan_window(content.build_instance(), content.plan, fly_again=False)
        assert content.window.earliest_s == found.earliest_s
        write_plan(tmp_path / "plan.json", content)
        assert json.loads((tmp_path / "plan.json").read_text())["fly_again"] is False
