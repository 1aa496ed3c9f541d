"""Spans that the site file names: which are flown, who alone flies some, from which pylon on; and what is refused."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import pytest

from executor.errors import SiteError
from executor.site.day_plans import build_day_problem, build_first_sorties_plan, solve_day
from executor.site.plan_summary import build_plan_checks, describe_left_over, describe_site_choices
from executor.site.site_file import check_site
from executor.site.site_model import SiteModel, build_first_task, build_site_model
from executor.site.site_planning import DEFAULT, describe_site_changes, plan_site, preview_loss
from executor.site.span_names import SpanNames
from missions import Network, PlanFile, Segment, build_plan_document, check_plan
from planner import Cost
from tests.executor.builders import site_of
from tests.missions.builders import network_of

NAMES = ("uav1", "uav2")
PLACES = [(100.0 * number, 0.0) for number in range(1, 7)] + [(100.0 * number, 100.0) for number in range(1, 4)]
PAIRS = [(0, 1), (1, 2), (2, 3), (3, 4), (4, 5), (6, 7), (7, 8), (0, 6)]
LABELS = ("V1.1", "V1.2", "V1.3", "V1.4", "V1.5", "V2.1", "V2.2", "")


def network() -> Network:
    made = network_of(PLACES, PAIRS)
    return replace(made, segments=tuple(replace(one, label=LABELS[one.id]) for one in made.segments))


def site(**tables: Any) -> SiteModel:
    network_table = {"file": "line", **tables.pop("network", {})}
    content = site_of(NAMES).model_dump(exclude_none=True, mode="json") | tables | {"network": network_table}
    return build_site_model(check_site(content, "site.toml"), network())


def planned(ground: SiteModel, **wish: Any) -> PlanFile:
    return plan_site(ground, replace(DEFAULT, seconds=20.0, iterations=400, starts=1, **wish))


@pytest.mark.parametrize(
    ("entries", "spans"),
    [
        (["V1.2"], {1}),
        (["segment 7"], {7}),
        (["V1.2..V1.4"], {1, 2, 3}),
        (["V1.4 .. V1.2", "V2.1"], {1, 2, 3, 5}),
        (["V1.3..V1.3"], {2}),
        (["V2"], {5, 6}),
        (["V?.1"], {0, 5}),
        (["*"], set(range(8))),
    ],
)
def test_spans_are_named_by_names_ranges_lines_and_patterns(entries: list[str], spans: set[int]) -> None:
    assert SpanNames(network()).find(entries, "key") == spans


def test_a_name_comes_before_what_else_it_could_be() -> None:
    odd = network_of([(100.0, 0.0), (200.0, 0.0), (300.0, 0.0)], [(0, 1), (1, 2)])
    odd = replace(odd, segments=(Segment(0, 0, 1, "A..B"), Segment(1, 1, 2, "A[1]")))
    assert SpanNames(odd).find(["A..B", "A[1]"], "key") == {0, 1}


EXPECTED = "expected a span such as 'V1.1', a range FIRST..LAST of one line, a line or a pattern, got "


@pytest.mark.parametrize(
    ("tables", "words"),
    [
        ({"network": {"leave_out": ["V2.1", "V1.22"]}},
         f"network.leave_out[1]: {EXPECTED}'V1.22'; the nearest is 'V1.2'"),
        ({"network": {"only": ["\x1b[2J"]}}, f"network.only[0]: {EXPECTED}' [2J'"),
        ({"network": {"only": ["W*"]}}, f"network.only[0]: {EXPECTED}'W*'"),
        ({"network": {"only": ["V1.2..V1.9"]}}, f"network.only[0]: {EXPECTED}'V1.2..V1.9'; the nearest is 'V1.5'"),
        ({"network": {"only": ["V1.2..V2.2"]}}, f"network.only[0]: {EXPECTED}'V1.2..V2.2'"),
        ({"network": {"leave_out": ["*"]}}, "network.leave_out: expected a span that is left to fly, got none of 8"),
        ({"lock": [{"segments": ["V1.1"]}]},
         "site.toml: lock[0].vehicle: expected one of vehicle and from, got neither"),
        ({"lock": [{"segments": [], "vehicle": "uav1"}]}, "site.toml: lock[0].segments: expected at least one segment"),
        ({"lock": [{"segments": ["V1.1"], "vehicle": "uav9"}]},
         "site.toml: lock[0].vehicle: expected one of uav1, uav2, got 'uav9'"),
        ({"lock": [{"segments": ["V3"], "vehicle": "uav1"}]},
         f"lock[0].segments[0]: {EXPECTED}'V3'; the nearest is 'V1.3'"),
        ({"lock": [{"segments": ["V1"], "vehicle": "uav1"}, {"segments": ["V1.2"], "vehicle": "uav2"}]},
         "lock[1].vehicle: expected 'uav1' for V1.2, as lock[0] has it, got 'uav2'"),
        ({"lock": [{"segments": ["V1.2"], "from": "p1"}, {"segments": ["V1"], "vehicle": "uav1"},
                   {"segments": ["V1.2"], "vehicle": "uav2"}]},
         "lock[2].vehicle: expected 'uav1' for V1.2, as lock[1] has it, got 'uav2'"),
        ({"lock": [{"segments": ["V1.1"], "from": "p5"}]},
         "lock[0].from: expected a pylon at an end of its spans, p0, p1, got 'p5'; the nearest is 'p1'"),
        ({"lock": [{"segments": ["V1.1", "V1.3"], "from": "p0"}]},
         "lock[0].from: expected spans that hang together from p0 on, got V1.3"),
        ({"lock": [{"segments": ["V1.1"], "from": "p0"}, {"segments": ["V1"], "from": "p5"}]},
         "lock[1].from: expected the direction of lock[0] for V1.1, got the other one"),
        ({"lock": [{"segments": ["V1.1"], "begin": "p0"}]},
         "site.toml: lock[0].begin: unknown key; expected one that docs/reference/site-file.md names"),
    ],
)  # fmt: skip
def test_what_cannot_be_meant_is_refused_in_one_line(tables: dict[str, Any], words: str) -> None:
    with pytest.raises(SiteError) as refused:
        site(**tables)
    assert str(refused.value) == words


def test_spans_that_are_left_out_are_no_part_of_what_is_inspected_and_keep_the_others_numbers() -> None:
    ground = site(network={"only": ["V1", "V2"], "leave_out": ["V1.2..V1.3"]})
    assert ground.left_out == {1, 2, 7}
    plan = planned(ground)
    assert [segment.id for segment in plan.segments] == [0, 3, 4, 5, 6]
    assert plan.uncovered == ()
    assert check_plan(plan) == []
    assert [segment.id for segment in build_day_problem(ground).segments] == [0, 3, 4, 5, 6]
    # Also of what a flight left over, or somebody asks for, by number.
    assert build_first_task(ground, [0, 1, 2]).segment_ids == (0,)
    # The line is still there: whatever keeps clear of it does so as before.
    assert ground.setup.tracks_m.tolist() == site().setup.tracks_m.tolist()
    assert describe_site_choices(ground) == ["left out by the site: V1.2, V1.3, segment 7"]
    assert not [line for line in build_plan_checks(plan, 5) if "others are not flown" in line.text]


def test_a_plan_that_flies_what_is_left_out_since_is_planned_again() -> None:
    plan, ground = planned(site()), site(network={"leave_out": ["V1.2"]})
    assert describe_site_changes(plan, ground) == ["V1.2 is left out by the site"]
    assert describe_site_changes(planned(ground), ground) == []
    assert describe_site_changes(planned(ground), site()) == []  # a part of the site, as it always may be


LOCKS = [{"segments": ["V1.1..V1.2"], "vehicle": "uav2", "from": "p2"}, {"segments": ["V2"], "from": "p6"}]


def test_a_plan_says_and_keeps_the_locks_of_its_site() -> None:
    ground = site(lock=LOCKS)
    assert ground.locked == {0: "uav2", 1: "uav2"}
    assert ground.directions == {0: True, 1: True, 5: False, 6: False}
    for wish in ({}, {"cost": Cost.MINMAX, "usual": False}):
        plan = planned(ground, **wish)
        assert check_plan(plan) == []
        assert plan.uncovered == ()
        flown = {visit.segment: (route.vehicle, visit.reversed) for route in plan.routes for visit in route.visits}
        assert (flown[0], flown[1]) == (("uav2", True), ("uav2", True))
        assert (flown[5][1], flown[6][1]) == (False, False)
        model = build_plan_document(plan)["model"]
        assert model["locked"] == {"0": "uav2", "1": "uav2"}
        assert model["directions"] == {"0": True, "1": True, "5": False, "6": False}
    assert not {"locked", "directions"} & build_plan_document(planned(site()))["model"].keys()
    assert describe_site_choices(ground) == [
        "locked to uav2: V1.1, V1.2",
        "locked in direction: V1.1 from p1, V1.2 from p2, V2.1 from p6, V2.2 from p7",
    ]


def test_a_plan_that_breaks_its_locks_is_found_out() -> None:
    plan = planned(site())
    assert plan.pricing is not None
    mine = plan.routes[0].visits[0]
    name = plan.segments[plan.positions[mine.segment]].display_name
    own = replace(plan.pricing, locked={mine.segment: "uav2"}, directions={mine.segment: not mine.reversed})
    one, other = plan.segments[mine.segment].pylons[:: -1 if mine.reversed else 1]
    assert check_plan(replace(plan, pricing=own))[:2] == [
        f"{name} is flown by uav1, and locked to uav2",
        f"{name} is flown from {one}, and locked to begin at {other}",
    ]


def test_a_plan_of_other_locks_is_planned_again() -> None:
    plan = planned(site())
    assert describe_site_changes(plan, site(lock=[{"segments": ["V1.2"], "vehicle": "uav2"}])) == [
        "segments.1.locked is uav2, the plan was made with not known"
    ]
    assert describe_site_changes(planned(site(lock=LOCKS)), site(lock=LOCKS[:1])) == [
        "segments.5.reversed is not known, the plan was made with False",
        "segments.6.reversed is not known, the plan was made with False",
    ]


def test_a_lock_on_what_is_left_out_does_nothing() -> None:
    ground = site(network={"leave_out": ["V1.1"]}, lock=LOCKS[:1])
    assert (ground.locked, ground.directions) == ({1: "uav2"}, {1: True})


def test_a_lock_that_cannot_be_kept_leaves_its_span_over_in_words() -> None:
    content = site_of(NAMES).model_dump(exclude_none=True, mode="json")
    content["vehicle"][1]["budget_pct"] = 4.0
    content |= {"network": {"file": "line"}, "lock": [{"segments": ["V1.5"], "vehicle": "uav2"}]}
    ground = build_site_model(check_site(content, "site.toml"), network())
    plan = planned(ground)
    assert plan.uncovered == (4,)
    [line] = describe_left_over(plan)
    assert line.startswith("left over, locked to uav2: out of range of its budget: V1.5 (")
    day = solve_day(build_day_problem(ground), replace(DEFAULT, seconds=20.0, iterations=200, starts=1))
    assert day.uncovered == (4,)
    [line] = describe_left_over(day)
    assert line.startswith("left over, locked to uav2: out of reach of every base on one pack: V1.5 (")


def test_a_day_keeps_locks_and_its_first_flight_too() -> None:
    ground = site(lock=LOCKS)
    day = solve_day(build_day_problem(ground), replace(DEFAULT, seconds=20.0, iterations=400, starts=1))
    assert check_plan(day) == []
    assert day.uncovered == ()
    flown = {visit.segment: (route.vehicle, visit.reversed) for route in day.routes for visit in route.visits}
    assert (flown[0], flown[1]) == (("uav2", True), ("uav2", True))
    assert (flown[5][1], flown[6][1]) == (False, False)
    first = build_first_sorties_plan(day, ground)
    assert first.pricing is not None
    assert first.pricing.locked == {0: "uav2", 1: "uav2"}


def test_the_loss_of_a_vehicle_lifts_its_locks_and_no_direction() -> None:
    plan = planned(site(lock=[*LOCKS, {"segments": ["V1.5"], "vehicle": "uav1"}]))
    answer, complete = preview_loss(plan, "uav2", 0.0, cost=Cost.MINMAX, seconds=1.0, seed=1)
    assert complete
    assert check_plan(answer) == []
    assert answer.pricing is not None
    names = {segment.id: segment.name for segment in answer.segments}
    assert {names[number]: keeper for number, keeper in answer.pricing.locked.items()} == {"V1.5": "uav1"}
    flown = {names[visit.segment]: visit.reversed for route in answer.routes for visit in route.visits}
    assert {flown[name] for name in ("V1.1", "V1.2") if name in flown} <= {True}
    assert {flown[name] for name in ("V2.1", "V2.2") if name in flown} <= {False}


def test_what_a_camera_is_good_for_on_a_day_is_named_the_same_way() -> None:
    ground = site(day={"vehicle": [{"name": "uav2", "segments": ["V1.2..V1.4", "V2"]}]})
    assert build_day_problem(ground).pricing.barred == {"uav2": {0, 4, 7}}
    wrong = site(day={"vehicle": [{"name": "uav2", "segments": ["V1.1", "V7"]}]})
    with pytest.raises(SiteError) as refused:
        build_day_problem(wrong)
    assert str(refused.value) == f"day.vehicle[0].segments[1]: {EXPECTED}'V7'; the nearest is 'V2'"


CAMERA = {"name": "zoom", "focal_mm": 20.0, "sensor_mm": [20.0, 15.0], "image_px": [4000, 3000]}
PYLONS = {"camera": "zoom", "of": "pylons", "pylons": ["p0", "p5", "p8"], "bearings_deg": [60, 120]}


@pytest.mark.parametrize(
    ("wish", "flown"),
    [
        ({}, {"p0", "p5", "p8"}),
        ({"leave_out": ["V1.5"]}, {"p0", "p8"}),  # p5 carries nothing else
        ({"leave_out": ["pylon p0"]}, {"p5", "p8"}),
        ({"only": ["V2"]}, {"p8"}),
        ({"only": ["V2", "pylon p0"]}, {"p0", "p8"}),
        ({"only": ["V2"], "leave_out": ["pylon *"]}, set()),
    ],
)
def test_a_pylon_with_viewpoints_is_left_out_with_its_spans(wish: dict[str, Any], flown: set[str]) -> None:
    ground = site(network=wish, camera=[CAMERA], look=[PYLONS])
    names = {ground.network.segment_name(one) for one in build_first_task(ground).segment_ids}
    assert {name.removeprefix("pylon ") for name in names if name.startswith("pylon ")} == flown


def test_a_spare_of_a_day_has_nothing_locked_to_it() -> None:
    ground = site(lock=LOCKS, day={"vehicle": [{"name": "uav2", "spare": True}]})
    assert planned(ground).uncovered == ()  # a single flight has no spares
    with pytest.raises(SiteError) as refused:
        build_day_problem(ground)
    assert str(refused.value) == "lock[0].vehicle: expected one that is planned for, got 'uav2', a spare of [day]"
