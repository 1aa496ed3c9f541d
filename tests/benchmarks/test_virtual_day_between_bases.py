"""Days with sorties from one base to another, as really flown on both simulated dialects."""

from __future__ import annotations

import itertools
import json
import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path
from typing import Any

import pytest

from benchmarks.virtual_day import DayScenario, VirtualDay
from benchmarks.virtual_flight import FlightObservers, VirtualFlight, fly_virtual
from executor.analysis.report import build_report
from executor.core import fleet_step
from executor.core.context import Context
from executor.core.ground.pack_count import count_packs
from executor.core.interface.events import Event
from executor.core.interface.intents import Action, Intent
from executor.core.state.fleet_state import FleetState
from executor.core.state.onboard_fence import build_first_fences
from executor.simulated.simulated_fleet import SIMULATED_CEILING_M, build_demo_site
from executor.site import site_model
from executor.site.day_plans import build_day_problem, build_first_sorties_plan, sorties_ahead_of
from executor.site.site_file import check_site
from executor.site.site_model import SiteModel
from missions import DayPlanFile, check_plan
from missions.pads import PAD_SPACING_M
from planner import Plan, Route, visit_of
from planner.sorties import Objective, evaluate_sorties
from simulator.config import AutopilotKind, SimVehicle
from simulator.fleet import SimulatedVehicle
from tests.missions.builders import FRAME

BOTH = pytest.mark.parametrize("autopilot", ["ardupilot", "px4"])
SPAN_M = 120.0
WEST_M, EAST_M = (0.0, -40.0), (1160.0, -40.0)
BEGINS_S = 8 * 3600.0
WEST, EAST = 0, 1
PACKS, RECHARGE_S = 3, 900.0
NEAR_M = 1.0
LOWER_M = 6.0
"""Heights count from another home in the east: what is set for RTL has to be another."""
THERE_AND_BACK = (
    ((WEST, (0, 1), EAST), (EAST, (7, 6), WEST)), ((WEST, (2, 3), EAST), (EAST, (5, 4), EAST)),
)  # fmt: skip


def ground_of(folder: Path, autopilot: str, **tables: object) -> SiteModel:
    """Return two vehicles at the western end of a line of eight spans, and a base at either end."""
    places = [FRAME.to_wgs84_deg(100.0 + SPAN_M * number, 40.0) for number in range(9)]
    points = [[round(lon_deg, 7), round(lat_deg, 7)] for lat_deg, lon_deg in places]
    features: list[dict[str, object]] = [
        {"type": "Feature", "geometry": {"type": "Point", "coordinates": point}, "properties": properties}
        for point, properties in (
            ([FRAME.lon_deg, FRAME.lat_deg], {"role": "depot", "elevation_m": FRAME.alt_m}),
            *((point, {"id": f"p{number}"}) for number, point in enumerate(points)),
        )
    ]  # fmt: skip
    line = {"type": "LineString", "coordinates": points}
    features.append({"type": "Feature", "geometry": line, "properties": {"id": "line"}})
    network = folder / "line.geojson"
    network.write_text(json.dumps({"type": "FeatureCollection", "features": features}), encoding="utf-8")
    content = build_demo_site(
        network=network, radius_m=1e6, vehicles=2, speedup=1.0, autopilot=autopilot, ports=range(20_000, 20_002)
    )
    content["inspection"] = {"ceiling_m": SIMULATED_CEILING_M, "heights": "flat"}
    bases = []
    for name, at_m, lower_m, own in (("west", WEST_M, 0.0, ["uav1", "uav2"]), ("east", EAST_M, LOWER_M, [])):
        lat_deg, lon_deg = FRAME.to_wgs84_deg(*at_m)
        bases.append({"name": name, "lat_deg": lat_deg, "lon_deg": lon_deg, "alt_m": FRAME.alt_m - lower_m,
                      "vehicles": own, "packs": PACKS, "recharge_s": RECHARGE_S, "turnaround_s": 120})  # fmt: skip
    day = {"begin": "08:00", "end": "12:00", "lands": "any"}
    content |= {"energy": {"capacity_ah": 1.0}, "base": bases, "day": day, "fence": {"enabled": True}, **tables}
    return site_model.load_site_model(check_site(content, "test"), folder)


def day_of(ground: SiteModel, *own: tuple[tuple[int, tuple[int, ...], int], ...]) -> DayPlanFile:
    """Return a day of sorties as (base, segments, landing base) of each vehicle, a quarter of an hour apart."""
    problem = build_day_problem(ground)
    routes = tuple(
        Route(row, tuple(visit_of(segment, reverse=base == EAST) for segment in segments), base, lands,
              BEGINS_S + 60.0 * row + 900.0 * number)
        for row, rows in enumerate(own)
        for number, (base, segments, lands) in enumerate(rows)
    )  # fmt: skip
    flown = {segment for rows in own for _, segments, _ in rows for segment in segments}
    plan = Plan(routes, tuple(one for one in range(8) if one not in flown))
    found = evaluate_sorties(problem.build_instance(), plan)
    day = replace(problem.with_plan(plan, found, Objective.FINISH), source="day.json")
    assert check_plan(day) == []
    return day


@dataclass
class Heard:
    """Everything that was applied, and where everybody stood whenever its motors were off."""

    events: list[tuple[Event, float]] = field(default_factory=list)
    stood_m: dict[str, list[tuple[float, float]]] = field(default_factory=dict)

    def applied(self, _: Context, event: Event, state: FleetState, now_s: float) -> None:
        self.events.append((event, now_s))

    def lived(self, vehicles: Mapping[str, SimulatedVehicle]) -> None:
        for name, vehicle in vehicles.items():
            frame, home = vehicle.autopilot.frame, vehicle.autopilot.home
            if frame.body.on_ground and not frame.armed:
                lat_e7, lon_e7 = home.lat_lon_e7(frame.body.east_m, frame.body.north_m)
                at_m = FRAME.to_local_m(lat_e7 * 1e-7, lon_e7 * 1e-7)
                stood = self.stood_m.setdefault(name, [at_m])
                if math.dist(stood[-1], at_m) > NEAR_M:
                    stood.append(at_m)


class Ordered(VirtualDay):
    """A day in which the operator brings a vehicle back."""

    def __init__(self, at_s: float, name: str, *more: Any) -> None:
        super().__init__(*more)
        self._wish: tuple[float, str] | None = (at_s, name)

    def _after_step(self, now_s: float) -> None:
        super()._after_step(now_s)
        if self._wish and self.flight is not None and self._launched_s and now_s - self._launched_s >= self._wish[0]:
            self.flight.submit_intent(Intent("back", Action.RETURN, self._wish[1], "page"))
            self._wish = None


def fly(ground: SiteModel, day: DayPlanFile, heard: Heard, *, make: Any = VirtualDay, **more: Any) -> VirtualFlight:
    numbers = itertools.count(1)
    scenario = DayScenario(day, lambda _: (f"P{next(numbers)}", 100.0), **more)
    looks = FlightObservers(applied=heard.applied, lived=heard.lived)
    plan = build_first_sorties_plan(day, ground)
    return fly_virtual(ground, plan, seed=1, craft=fly_on, onlookers=looks, make=partial(make, scenario))


def fly_on(vehicle: SimVehicle) -> SimVehicle:
    """Return a vehicle that goes on with its mission when nobody is heard."""
    failsafe = "FS_GCS_ENABLE" if vehicle.autopilot is AutopilotKind.ARDUPILOT else "NAV_DLL_ACT"
    return replace(vehicle, parameters={**vehicle.parameters, failsafe: 0.0})


def pad_m(ground: SiteModel, name: str, base: int) -> tuple[float, float]:
    pad = ground.setup.pad_of(name) if base == WEST else ground.day_pads[name]["east"]
    return pad.east_m, pad.north_m


def stood_at(ground: SiteModel, name: str, heard: Heard) -> list[int]:
    """Return at which bases a vehicle stood, one after the other, each time on its own pad."""
    found = []
    for at_m in heard.stood_m[name]:
        bases = [base for base in (WEST, EAST) if math.dist(at_m, pad_m(ground, name, base)) < NEAR_M]
        assert len(bases) == 1, (name, at_m)
        found += bases
    return found


@BOTH
def test_vehicles_fly_to_the_other_base_and_back_across_an_absence(tmp_path: Path, autopilot: str) -> None:
    ground, heard = ground_of(tmp_path, autopilot), Heard()
    places = [pad_m(ground, name, base) for name in ground.names for base in (WEST, EAST)]
    assert min(math.dist(*pair) for pair in itertools.combinations(places, 2)) >= PAD_SPACING_M
    day = day_of(ground, *THERE_AND_BACK)
    flight = fly(ground, day, heard, away_s=(100.0, 420.0))
    said = [line.text for _, line in flight.said]
    assert flight.ended, said
    assert flight.report.segments_uncovered == (), said
    assert not flight.report.faults, said
    assert not [line for line in said if "internal error" in line or "away from its pad" in line]
    assert [stood_at(ground, name, heard) for name in ground.names] == [[WEST, EAST, WEST], [WEST, EAST]]
    rows = {(row.vehicle, row.number): (row.base, row.lands) for row in flight.report.sorties}
    assert rows == {
        ("uav1", 1): ("west", "east"), ("uav2", 1): ("west", "east"),
        ("uav1", 2): ("east", "west"), ("uav2", 2): ("east", "east"),
    }  # fmt: skip
    assert any("as planned; it lands at base west" in line for line in said)
    assert sum("parameters set again after reboot: RTL_" in line for line in said) >= 2
    assert not [line for line in said if "parameters differ" in line]
    # Two packs left the west, and two the east; what landed is not charged again yet.
    ended_s = flight.launched_s + flight.flown_s
    stocks = [count_packs(flight.context, flight.state, name, ended_s) for name in ground.names]
    assert [stock and (stock.base, stock.charged) for stock in stocks] == [("west", 1), ("east", 1)]
    # Its events alone give the same flight.
    state = fleet_step.build_initial_state(
        flight.boards, fences=build_first_fences(flight.context, flight.boards), ahead=sorties_ahead_of(day)
    )
    for event, at_s in heard.events:
        state, _ = fleet_step.step(flight.context, state, event, at_s)
    assert state == flight.state
    again = build_report(flight.context, state, ended_s)
    assert (again.sorties, again.inspections) == (flight.report.sorties, flight.report.inspections)


@BOTH
@pytest.mark.parametrize(("at_s", "where"), [(60.0, WEST), (200.0, EAST)], ids=["near the first", "near the other"])
def test_a_recalled_vehicle_lands_on_the_nearest_of_its_pads(
    tmp_path: Path, autopilot: str, at_s: float, where: int
) -> None:
    ground, heard = ground_of(tmp_path, autopilot), Heard()
    day = day_of(ground, *THERE_AND_BACK)
    flight = fly(ground, day, heard, make=partial(Ordered, at_s, "uav1"))
    said = [line.text for _, line in flight.said]
    first = next(row for row in flight.report.sorties if row.vehicle == "uav1")
    assert (first.base, first.lands) == ("west", ("west", "east")[where]), said
    assert stood_at(ground, "uav1", heard)[-1] == where
    assert not flight.report.faults
    assert not [line for line in said if "internal error" in line or "away from its pad" in line]


@BOTH
def test_what_a_lost_vehicle_had_is_flown_from_the_base_where_the_other_stands(tmp_path: Path, autopilot: str) -> None:
    ground, heard = ground_of(tmp_path, autopilot), Heard()
    day = day_of(ground, ((WEST, (0, 1), EAST), (EAST, (7,), WEST)), ((WEST, (2, 3), EAST), (EAST, (6,), WEST)))
    flight = fly(ground, day, heard, losses=((150.0, "uav2"),))
    said = [line.text for _, line in flight.said]
    assert flight.ended, said
    assert [fault.vehicle for fault in flight.report.faults] == ["uav2"], said
    assert flight.report.segments_uncovered == (), said  # with what was in nobody's sorties from the beginning
    assert not [line for line in said if "internal error" in line or "away from its pad" in line]
    assert stood_at(ground, "uav1", heard)[1] == EAST
    assert flight.report.vehicles[0].landed


def test_a_vehicle_that_lands_where_it_takes_off_has_one_pad(tmp_path: Path) -> None:
    ground = ground_of(tmp_path, "px4")
    context = fly(ground, day_of(ground, ((WEST, (0,), WEST),), ()), Heard()).context
    assert context.day is not None
    assert not context.day.pads
    assert context.setup.day_pads == ()
