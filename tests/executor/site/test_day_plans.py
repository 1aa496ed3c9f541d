"""A day plan as it is flown: what flies first, what is ahead, the rules; what does not belong is refused."""

from __future__ import annotations

import itertools
import math
import re
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from executor.simulated.simulated_fleet import fleet_of
from executor.site.day_plans import (
    build_day_problem,
    build_day_rules,
    build_first_sorties_plan,
    describe_later_sorties,
    find_day_pads,
    find_later_segments,
    preview_day_loss,
    select_day,
    solve_day,
    sorties_ahead_of,
)
from executor.site.site_file import check_site
from executor.site.site_model import SiteModel
from executor.site.site_parts import find_base_pads
from executor.site.site_planning import PlanRequest
from missions import DayPlanFile, PlanFileError, check_plan, read_day_plan, write_plan
from planner import segment_of
from planner.sorties import LossWindow, Objective, evaluate_sorties
from tests.executor.builders import ground_for, site_of
from tests.executor.site.two_bases import HOURS, between_bases
from tests.missions.builders import FRAME, line_east

BATTERY = {"capacity_ah": 1.2}


def ground_of(**tables: Mapping[str, object]) -> SiteModel:
    return ground_for(site_of(("uav1", "uav2"), day=HOURS, energy=BATTERY, **tables), line_east(13))


@pytest.fixture(scope="module")
def ground() -> SiteModel:
    return ground_of()


@pytest.fixture(scope="module")
def day(ground: SiteModel) -> DayPlanFile:
    """A day of several sorties each."""
    found = solve_day(build_day_problem(ground), PlanRequest(None, 600.0, 1, iterations=2000, starts=1))
    assert not found.uncovered
    assert max(len(found.routes_of(name)) for name in found.names) >= 2
    return replace(found, source="day.json")


def test_the_first_sorties_are_the_plan_and_the_others_wait_behind_them(ground: SiteModel, day: DayPlanFile) -> None:
    plan, ahead = build_first_sorties_plan(day, ground), sorties_ahead_of(day)
    assert not [line for line in check_plan(plan, search_window=False) if "uncovered" in line]
    task = plan.build_task()
    routes = task.plan_to_network(plan.plan).routes
    for name, route in zip(ground.names, routes, strict=True):
        assert route.visits == (ahead[name][0].visits if ahead[name] else ())
    everything = [segment_of(visit) for own in ahead.values() for one in own for visit in one.visits]
    assert sorted(everything) == list(range(12))
    first = {segment_of(visit) for route in routes for visit in route.visits}
    assert find_later_segments(day) == set(range(12)) - first == {*plan.uncovered}
    assert min(one.start_s for own in ahead.values() for one in own) == 0.0
    assert [line.partition(":")[0] for line in describe_later_sorties(day)] == [
        name for name, own in ahead.items() if len(own) > 1
    ]


def test_the_days_clock_begins_with_its_first_take_off(ground: SiteModel, day: DayPlanFile) -> None:
    rules = build_day_rules(day)
    assert rules.bases == {"uav1": "depot", "uav2": "depot"}
    assert rules.stagger_s == 30.0
    assert rules.windows_s["uav1"] == ((0.0, 3600.0), (5400.0, 7200.0))
    assert rules.ends_s == 7200.0


def test_simulated_vehicles_stand_at_their_bases_in_the_morning() -> None:
    lat_deg, lon_deg = FRAME.to_wgs84_deg(600.0, 400.0)
    at_depot = {"name": "home", "lat_deg": FRAME.lat_deg, "lon_deg": FRAME.lon_deg, "vehicles": ["uav2"]}
    north = {"name": "north", "lat_deg": lat_deg, "lon_deg": lon_deg, "vehicles": ["uav1", "uav3"], "alt_m": 451.0}
    bases: dict[str, Any] = {"base": [at_depot, north]}
    site = site_of(("uav1", "uav2", "uav3"), day=HOURS, energy=BATTERY, **bases)
    ground = ground_for(site, line_east(13))
    assert set(find_base_pads(site, ground.network)) == {"uav1", "uav3"}
    stands = {name: ground.setup.pad_of(name) for name in ("uav1", "uav3")}
    places = [(pad.east_m, pad.north_m) for pad in stands.values()]
    assert all(math.dist(place, (600.0, 400.0)) < 40.0 for place in places)
    assert math.dist(*places) >= 12.0
    assert {pad.alt_m for pad in stands.values()} == {451.0}
    simulated = {
        one.name: one
        for one in fleet_of(ground, speedup=1.0, faults=(), seed=0, wind=1.0, failsafe=True).vehicles
    }  # fmt: skip
    for name, pad in {**stands, "uav2": ground.setup.pad_of("uav2")}.items():
        one = simulated[name]
        assert FRAME.to_local_m(one.home_lat_deg, one.home_lon_deg) == pytest.approx((pad.east_m, pad.north_m), abs=0.1)
        assert one.home_alt_m == pad.alt_m


def test_a_vehicle_with_its_own_pad_is_planned_from_there() -> None:
    lat_deg, lon_deg = FRAME.to_wgs84_deg(300.0, -200.0)
    hill: dict[str, Any] = {"name": "hill", "kind": "pad", "lat_deg": lat_deg, "lon_deg": lon_deg}
    site = site_of(("uav1", "uav2"), day=HOURS, energy=BATTERY)
    tables = site.model_dump(exclude_unset=True)
    first, second = tables["vehicle"]
    moved = check_site({**tables, "place": [hill], "vehicle": [{**first, "pad": "hill"}, second]}, "test")
    ground = ground_for(moved, line_east(13))
    day = solve_day(build_day_problem(ground), PlanRequest(None, 600.0, 1, iterations=200, starts=1))
    second_m = ground.setup.base_of("uav2").place_m[:2]
    assert [own.pads[0].place_m[:2] for own in day.vehicles] == [pytest.approx((300.0, -200.0), abs=0.01), second_m]
    build_first_sorties_plan(day, ground)
    assert "the pad of uav1 is elsewhere" in refused(replace(day, source="day.json"), ground_for(site, line_east(13)))


def test_what_a_camera_is_not_good_for_is_barred_in_flight_too() -> None:
    lines = line_east(13)
    names = [lines.segment_name(number) for number in range(12)]
    hours: dict[str, Any] = {**HOURS, "vehicle": [{"name": "uav2", "segments": names[:4]}]}
    ground = ground_for(site_of(("uav1", "uav2"), day=hours, energy=BATTERY), lines)
    found = solve_day(build_day_problem(ground, range(2, 12)), PlanRequest(None, 600.0, 1, iterations=200, starts=1))
    assert build_day_rules(found).barred == {"uav2": frozenset(range(4, 12))}


def test_a_day_of_other_speeds_is_planned_and_not_flown() -> None:
    hours: dict[str, Any] = {**HOURS, "vehicle": [{"name": "uav2", "speed_m_s": 4.0}]}
    ground = ground_for(site_of(("uav1", "uav2"), day=hours, energy=BATTERY), line_east(13))
    found = solve_day(build_day_problem(ground), PlanRequest(None, 600.0, 1, iterations=200, starts=1))
    said = refused(replace(found, source="day.json"), ground)
    assert "uav2: expected speed_m_s 3 of [inspection], at which all vehicles fly, got 4" in said


def test_until_when_each_vehicle_must_not_be_lost_is_kept(day: DayPlanFile, tmp_path: Path) -> None:
    kept = replace(day, windows=(LossWindow("uav1", 0.0, None), LossWindow("uav2", 31_000.0, 1)))
    write_plan(tmp_path / "day.json", kept)
    assert read_day_plan(tmp_path / "day.json") == kept


def refused(day: DayPlanFile, ground: SiteModel) -> str:
    with pytest.raises(PlanFileError) as error:
        build_first_sorties_plan(day, ground)
    text = str(error.value)
    assert "\n" not in text
    assert text.startswith("day.json: ")
    return text


def test_a_loss_leaves_what_has_landed_and_the_others_fly_what_was_on_board_and_what_was_to_come() -> None:
    _, day = between_bases()
    second = day.routes[1]
    after, is_complete = preview_day_loss(day, "uav1", second.start_s + 1.0, seed=1)
    assert is_complete
    assert after.routes_of("uav1") == day.routes[:1]
    taken = [visit.segment for one in after.routes_of("uav2") for visit in one.visits]
    assert sorted(taken) == sorted(visit.segment for visit in second.visits)
    assert min(one.start_s for one in after.routes_of("uav2")) >= second.start_s + 1.0
    assert check_plan(after) == []
    after, is_complete = preview_day_loss(day, "uav2", 0.0, seed=1)
    assert is_complete
    assert {visit.segment for one in after.routes for visit in one.visits} == set(range(12))
    with pytest.raises(PlanFileError, match="--lost: expected one of uav1, uav2, got uav9"):
        preview_day_loss(day, "uav9", 0.0, seed=1)


def test_locked_segments_of_a_lost_vehicle_are_flown_by_others() -> None:
    ground, day = between_bases(lock=[{"segments": ["segment 7"], "vehicle": "uav1"}])
    assert day.pricing.locked
    after, is_complete = preview_day_loss(day, "uav1", 0.0, seed=1)
    assert is_complete
    assert check_plan(after) == []
    assert ground.locked


def test_a_day_of_other_vehicles_is_refused(day: DayPlanFile) -> None:
    other = ground_for(site_of(("uav1", "uav3"), day=HOURS, energy=BATTERY), line_east(13))
    assert "vehicles: expected uav1, uav3 as in the site" in refused(day, other)


def test_a_day_of_another_line_is_refused(day: DayPlanFile) -> None:
    other = ground_for(site_of(("uav1", "uav2"), day=HOURS, energy=BATTERY), line_east(5))
    assert re.search("expected one of the site's 4 segments", refused(day, other))


def test_a_day_with_foreign_figures_is_refused(ground: SiteModel, day: DayPlanFile) -> None:
    wrong = replace(day, finish_s=1.0)
    assert "finish_s is 1, its content gives" in refused(wrong, ground)


def test_a_day_continues_with_what_another_one_left(ground: SiteModel) -> None:
    left = (2, 7, 9)
    found = solve_day(build_day_problem(ground, left), PlanRequest(None, 600.0, 1, iterations=500, starts=1))
    assert [segment.id for segment in found.segments] == list(left)
    flown = {segment_of(visit) for own in sorties_ahead_of(found).values() for one in own for visit in one.visits}
    assert flown == set(left)
    assert {segment.id for segment in build_first_sorties_plan(found, ground).segments} == set(left)


FENCED = {"fence": {"enabled": True}}


def test_a_day_between_bases_begins_and_ends_its_sorties_there() -> None:
    ground, day = between_bases(**FENCED)
    plan, ahead = build_first_sorties_plan(day, ground), sorties_ahead_of(day)
    assert [(one.base, one.lands) for one in ahead["uav1"]] == [("west", "east"), ("east", "west")]
    assert plan.pricing is not None
    assert plan.pricing.starts["uav1"].place_m[:2] == ground.setup.base_of("uav1").place_m[:2]
    east = ground.day_pads["uav1"]["east"]
    assert plan.pricing.bases["uav1"].place_m[:2] == (east.east_m, east.north_m)
    assert plan.routes[0].energy_pct == pytest.approx(day.routes[0].energy_pct)
    # Everybody has a pad of its own at each base.
    pads = [*ground.setup.pads, *(pad for own in ground.day_pads.values() for pad in own.values())]
    places = [(pad.east_m, pad.north_m) for pad in pads]
    assert len(places) == 4
    assert min(math.dist(one, other) for one, other in itertools.combinations(places, 2)) >= 12.0
    assert set(find_day_pads(day, ground, ground.setup)) == {"uav1"}


def test_a_sortie_that_could_not_return_to_its_begin_needs_rally_points() -> None:
    ground, day = between_bases(energy={"capacity_ah": 1.2})
    said = refused(day, ground)
    assert "sortie 1 of uav1 ends at base east: its own RTL ends where it took off" in said
    assert 'expected [fence] with enabled = true and rally = "pad"' in said
    build_first_sorties_plan(*between_bases(energy={"capacity_ah": 1.2}, **FENCED)[::-1])
    build_first_sorties_plan(*between_bases()[::-1])  # with so much to spare it could
    kept = between_bases(energy={"capacity_ah": 1.2}, fence={"enabled": True, "rally": "keep"})
    assert "its own RTL ends where it took off" in refused(*kept[::-1])


def test_a_sortie_to_another_base_is_refused_where_vehicles_come_down_to_the_line() -> None:
    ground, day = between_bases(inspection={"same_distance": True}, **FENCED)
    assert "sortie 1 of uav1 ends at base east: expected the base where it begins" in refused(day, ground)


def test_the_next_day_begins_where_the_one_before_ended() -> None:
    ground, day = between_bases(**FENCED)
    stands = [replace(own, base="east") if own.name == "uav1" else own for own in day.vehicles]
    moved = replace(day, vehicles=tuple(stands), routes=day.routes[1:], uncovered=tuple(range(6)))
    found = evaluate_sorties(moved.build_instance(), moved.plan)
    moved = replace(moved.with_plan(moved.plan, found, Objective.FINISH), source="day.json")
    assert "uav1: expected at base east, where it begins the day: name it there in [[base]]" in refused(moved, ground)
    days = replace(day, days=((28_800.0, 30_600.0), (30_600.0, 36_000.0)))
    rest = select_day(days, 1, set(range(6)), ["uav1", "uav2"])
    assert [own.base for own in rest.vehicles] == ["east", "west"]
    assert [(one.base, one.lands) for one in rest.routes] == [("east", "west")]
    again = select_day(replace(days, days=day.days), 0, set(range(6)), ["uav1", "uav2"])
    assert again.routes == ()  # what led to the other base is inspected, and not flown
