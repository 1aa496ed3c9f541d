"""Days of sorties over a site with areas, viewpoints and the requested distance, as really flown."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator, Mapping
from functools import partial
from pathlib import Path

import pytest
import shapely
from shapely.geometry import Point, Polygon

from benchmarks.virtual_day import DayScenario, VirtualDay
from benchmarks.virtual_flight import FlightObservers, VirtualFlight, fly_virtual
from executor.adapters.run_directory import RunDirectory
from executor.analysis.documents import EarlierRow, list_inspected_segments, read_earlier_flights
from executor.flight.next_flight import select_next_day
from executor.simulated.simulated_fleet import SIMULATED_CEILING_M, build_demo_site
from executor.site import site_model
from executor.site.day_plans import build_day_problem, build_first_sorties_plan, solve_day
from executor.site.site_file import check_site
from executor.site.site_planning import PlanRequest
from missions import DayPlanFile, check_plan, write_plan
from simulator.fleet import SimulatedVehicle
from tests.benchmarks.virtual.test_same_distance import AIRBORNE_M, LAYER_M, write_star
from tests.missions.builders import FRAME

QUARRY = ((90.0, 90.0), (170.0, 90.0), (170.0, 170.0), (90.0, 170.0))
"""Between two lines: straight ways from one to the other lead through it."""
MARGIN_M, CUT_M = 10.0, 2.5
CROSSING = ((230.0, -20.0), (260.0, -20.0), (260.0, 20.0), (230.0, 20.0))
"""Over a span of the line to the east."""
WIDE = [{"name": "wide"}]
AROUND = [{"camera": "wide", "of": "pylons", "bearings_deg": [45, 135], "pylons": ["w1-2", "w2-3"]}]


@pytest.mark.parametrize("autopilot", ["ardupilot", "px4"])
@pytest.mark.parametrize("same", [False, True], ids=["layers", "asked distance"])
def test_a_day_keeps_out_of_areas_and_looks_at_pylons_sortie_by_sortie(
    tmp_path: Path, autopilot: str, *, same: bool
) -> None:
    content = build_demo_site(
        network=write_star(tmp_path / "star.geojson"), radius_m=1e6, vehicles=2, speedup=1.0, autopilot=autopilot,
        ports=range(20_000, 20_002),
    )  # fmt: skip
    content["inspection"] = {"ceiling_m": SIMULATED_CEILING_M, "heights": "flat", "same_distance": same}
    content |= {"energy": {"capacity_ah": 0.5}, "camera": WIDE, "look": AROUND,
                "day": {"begin": "08:00", "end": "12:00"}}  # fmt: skip
    content["area"] = [
        {"name": name, "polygon": [FRAME.to_wgs84_deg(*corner) for corner in ring], "margin_m": MARGIN_M}
        for name, ring in (("quarry", QUARRY), ("crossing", CROSSING))
    ]
    ground = site_model.load_site_model(check_site(content, "test"), tmp_path)
    day = solve_day(build_day_problem(ground), PlanRequest(None, 600.0, 1, iterations=500, starts=1))
    assert day.unreachable
    assert not day.plan.uncovered
    assert max(len(day.routes_of(name)) for name in day.names) >= 2
    shapes, least_m, apart_m = [Polygon(QUARRY), Polygon(CROSSING)], [math.inf], [math.inf]

    def lived(vehicles: Mapping[str, SimulatedVehicle]) -> None:
        flying = []
        for name, vehicle in vehicles.items():
            body, pad = vehicle.autopilot.frame.body, ground.setup.pad_of(name)
            at_m = (pad.east_m + body.east_m, pad.north_m + body.north_m)
            least_m.append(min(float(shapely.distance(Point(at_m), one)) for one in shapes))
            if body.up_m > AIRBORNE_M:
                flying.append((*at_m, body.up_m))
        apart_m.extend(math.dist(one, other) for one, other in itertools.combinations(flying, 2))

    numbers: Iterator[int] = itertools.count(1)
    flight = fly_virtual(
        ground, build_first_sorties_plan(day, ground), seed=1, onlookers=FlightObservers(lived=lived),
        make=partial(VirtualDay, DayScenario(day, lambda _: (f"P{next(numbers)}", 100.0))),
    )  # fmt: skip
    assert flight.ended
    assert list(flight.report.segments_uncovered) == [one.segment for one in day.unreachable]
    assert not flight.report.faults
    assert min(least_m) >= MARGIN_M - CUT_M
    assert min(apart_m) >= LAYER_M - 1.0
    flown = sum(truth.what == "took_off" for truth in flight.truths)
    assert flown == len(day.routes)


TWO_DAYS_END = "08:12"
"""So that one day does not do."""


def test_a_plan_of_two_days_is_finished_on_the_second_after_a_loss_on_the_first(tmp_path: Path) -> None:
    content = build_demo_site(
        network=write_star(tmp_path / "star.geojson"), radius_m=1e6, vehicles=2, speedup=1.0, autopilot="ardupilot",
        ports=range(20_000, 20_002),
    )  # fmt: skip
    content["inspection"] = {"ceiling_m": SIMULATED_CEILING_M, "heights": "flat"}
    content |= {"energy": {"capacity_ah": 0.5}, "day": {"begin": "08:00", "end": TWO_DAYS_END, "days": 2}}
    site = tmp_path / "site.toml"
    ground = site_model.load_site_model(check_site(content, "test"), tmp_path)
    plan = solve_day(build_day_problem(ground), PlanRequest(None, 600.0, 1, iterations=500, starts=1))
    assert not plan.plan.uncovered
    starts_s = [one.start_s for one in plan.routes]
    assert min(starts_s) < plan.days[0][1] <= plan.days[1][0] <= max(starts_s)

    def fly(day: DayPlanFile, run: Path, earlier: tuple[EarlierRow, ...], *losses: tuple[float, str]) -> VirtualFlight:
        """Fly a day of the plan, and keep of it what the next one reads."""
        numbers: Iterator[int] = itertools.count(1)
        first = build_first_sorties_plan(day, ground)
        scenario = DayScenario(day, lambda _: (f"P{next(numbers)}", 100.0), losses)
        flight = fly_virtual(ground, first, seed=1, make=partial(VirtualDay, scenario))
        run.mkdir()
        write_plan(RunDirectory(run).plan_path(0), first)
        write_plan(RunDirectory(run).day_plan, day)
        flight.report.model_copy(update={"earlier": earlier}).write(RunDirectory(run).report)
        return flight

    before = fly(plan, tmp_path / "one", (), (20.0, "uav1"))
    assert [fault.vehicle for fault in before.report.faults] == ["uav1"]
    done = set(list_inspected_segments(before.report))
    assert done
    assert before.report.segments_uncovered

    rest = select_next_day(plan, tmp_path / "one", ground, site)
    assert rest is not None
    assert rest.first_day == 2
    assert check_plan(rest) == []
    after = fly(rest, tmp_path / "two", read_earlier_flights(tmp_path / "one"))
    assert after.report.finished
    assert set(list_inspected_segments(after.report)) == {segment.id for segment in plan.segments} - done
    assert rest.plan.uncovered  # by the loss: given to those with budget to spare
    assert select_next_day(plan, tmp_path / "two", ground, site) is None
