"""What a site asks to be seen: who can give it, in the plan too, and what is refused by name."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import pytest

from executor.errors import SiteError
from executor.site import site_model, site_planning
from executor.site.site_model import SiteModel
from missions import SolverRecord, estimate, make_plan_file, read_plan, write_plan
from missions.inspection_height import find_low_segments, segment_distances_m
from planner import Cost, Plan, Route, route_duration_s, segment_of, solve
from planner.stop_rules import Iterations
from tests.executor.builders import ground_for, site_of
from tests.missions.builders import line_east, tall_line_east

Table = Mapping[str, object]
RGB: Table = {"name": "rgb", "id": 100}
FULL: Table = {"name": "rgb", "focal_mm": 24, "sensor_mm": [36, 24], "image_px": [8192, 5460]}
EVERY: Table = {"camera": "rgb", "every_m": 8}


def ground(cameras: Sequence[Table], looks: Sequence[Table], **tables: Mapping[str, object]) -> SiteModel:
    site = site_of(("uav1", "uav2"), camera=list(cameras), look=list(looks), **tables)  # type: ignore[arg-type]
    return ground_for(site, line_east(5))


@pytest.mark.parametrize(
    ("cameras", "looks", "said"),
    [
        ([RGB], [{"camera": "ir", "every_m": 8}], "look[0].camera: expected the name of a [[camera]], got 'ir'"),
        ([RGB, RGB], [EVERY], "camera[1].name: expected a name of its own"),
        ([{**RGB, "vehicles": ["uav7"]}], [EVERY], "camera[0].vehicles[0]: expected the name of a vehicle, got 'uav7'"),
        ([RGB], [{"camera": "rgb"}], "expected one of every_m and overlap_pct, got neither"),
        ([RGB], [{**EVERY, "take": "video"}], "every_m: expected none for a video"),
        ([RGB], [{**EVERY, "segments": ["V9*"]}], "look[0].segments: expected names of spans, nothing is called 'V9*'"),
        ([RGB], [{"camera": "rgb", "overlap_pct": 60}], "focal_mm and sensor_mm: expected both for a footprint"),
        ([RGB], [{"camera": "rgb", "every_m": 2}], "inspection.speed_m_s: expected at most 2.0, at which camera 'rgb'"),
        ([FULL], [{**EVERY, "sample_mm": 1}], "look[0].sample_mm: expected 3.8 or more"),
        ([RGB], [EVERY, {"camera": "rgb", "every_m": 9}], "expected one distance between pictures, got 8 and 9 m"),
        ([RGB], [{"camera": "rgb", "of": "pylons"}], "bearings_deg: expected two viewpoints or more"),
        (
            [RGB],
            [{"camera": "rgb", "of": "pylons", "bearings_deg": [60, 120], "pylons": ["no"]}],
            "look[0].pylons: expected names of pylons, nothing is called 'no'",
        ),
        (
            [{**RGB, "vehicles": ["uav1"]}, {"name": "ir", "vehicles": ["uav2"]}],
            [EVERY, {"camera": "ir", "take": "video"}],
            "expected a vehicle that carries camera 'ir' and 'rgb', none does",
        ),
    ],
)
def test_what_cannot_be_seen_is_one_line(cameras: list[Table], looks: list[Table], said: str) -> None:
    with pytest.raises(SiteError, match=re.escape(said)) as refused:
        ground(cameras, looks)
    assert "\n" not in str(refused.value)


def test_overlap_follows_from_the_lens_and_the_distance() -> None:
    [look] = ground([FULL], [{"camera": "rgb", "overlap_pct": 60}]).setup.looks.spans[0]
    assert look.every_m == 6.3  # 40 % of 24 mm at 24 mm from 15.8 m


def test_a_plan_assigns_spans_to_vehicles_with_the_camera_and_its_file_records_it(tmp_path: Path) -> None:
    made = ground([{**RGB, "vehicles": ["uav2"]}], [{**EVERY, "segments": ["segment 1", "segment 2"]}])
    task = site_model.build_first_task(made)
    plan = solve(task.instance, cost=Cost.MINMAX, stop=Iterations(2000), seed=1).plan
    assert plan.uncovered == ()
    seen = {segment_of(visit) for visit in plan.routes[0].visits}
    assert not seen & {1, 2}
    solved = SolverRecord(seed=1, solver="search", seconds=0.0)
    kept = make_plan_file(made.network, task, made.travel, plan, Cost.MINMAX, solved, inspection=made.inspection)
    write_plan(tmp_path / "plan.json", kept)
    assert read_plan(tmp_path / "plan.json").build_instance().start_pct.tolist() == task.instance.start_pct.tolist()


def test_a_pylon_takes_its_own_time() -> None:
    look = {"camera": "rgb", "of": "pylons", "bearings_deg": [45, 135], "both_sides": True, "hover_s": 10}
    made = ground([RGB], [{**look, "pylons": [line_east(5).pylons[2].id]}])
    assert [made.network.segment_name(segment) for segment in (3, 4)][1].startswith("pylon")
    task = site_model.build_first_task(made)
    [besides_s] = made.setup.looks.pylons
    assert besides_s == 4
    pricing = site_model.build_pricing(made)
    assert pricing.besides_s[4] > 30.0  # four times ten seconds, less the holds
    flown_s = task.instance.start_s[0]
    assert flown_s[8] > 40.0


@pytest.mark.parametrize("autopilot", ["ardupilot", "px4"])
def test_a_plan_knows_how_long_pylons_take_from_below_and_from_the_layer(autopilot: str) -> None:
    look = {"camera": "rgb", "of": "pylons", "bearings_deg": [60, 120], "both_sides": True, "distance_m": 14}
    tables: dict[str, Any] = {
        "camera": [RGB], "look": [{**look, "pylons": ["p1", "p3"], "heights_m": [2, -10]}],
        "inspection": {"same_distance": True},
    }  # fmt: skip
    made = ground_for(site_of(("uav1", "uav2"), autopilot, **tables), tall_line_east(5))
    first, second = made.setup.looks.pylons
    # The lower one flies along all of the line: the higher one's pylon is never free.
    routes = (Route(0, (0, 2, 4, 6, 2 * first)), Route(1, (2 * second,)))
    task = site_model.build_first_task(made)
    plan = Plan(routes)
    flown = site_model.adjust_task_to_layers(made, task, plan)
    paths = site_model.build_paths(made.setup, site_model.name_routes(made, flown, plan))
    assert first in find_low_segments(paths["uav1"], routes[0].visits)
    assert second not in find_low_segments(paths["uav2"], routes[1].visits)
    models = site_model.build_pricing(made).models
    for route, name in zip(routes, made.names, strict=True):
        planned_s = route_duration_s(flown.instance, route)
        assert planned_s == pytest.approx(estimate(paths[name], models[name]).duration_s, rel=0.02)
    pricing = site_model.build_pricing(made)
    assert pricing.in_layer_s[second] < pricing.besides_s[second] - 60.0
    kept = site_planning.build_site_plan_file(
        made, flown, plan, Cost.MINMAX, SolverRecord(seed=1, solver="search", seconds=0.0)
    )
    for route, kept_route, segment in zip(routes, kept.routes, (first, second), strict=True):
        by_mission_m = segment_distances_m(made.setup, paths[kept_route.vehicle], route.visits)[segment]
        (said_m,) = (visit.inspected_at_m for visit in kept_route.visits if visit.segment == segment)
        assert said_m == pytest.approx(by_mission_m)
