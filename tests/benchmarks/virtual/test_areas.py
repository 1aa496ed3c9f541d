"""Losses with an area between the survivors and what they take over: they keep out of it, by simulated truth."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from types import MappingProxyType

import pytest
import shapely
from shapely.geometry import Point, Polygon

from benchmarks.prediction import plan_with
from benchmarks.virtual_flight import FlightObservers, VirtualFlight, fly_virtual
from executor.core.interface.codes import CheckCode
from executor.simulated.simulated_fleet import SIMULATED_CEILING_M, build_demo_site
from executor.site import site_model
from executor.site.site_file import check_site
from executor.site.site_model import SiteModel
from executor.site.site_planning import PlanRequest, plan_site
from missions import PlanFile
from missions.area_rules import check_areas
from simulator.fleet import SimulatedVehicle
from tests.benchmarks.virtual.short_line import write_line
from tests.missions.builders import FRAME

CUT_M = 2.5
"""What GPS and corners that are cut take of a margin."""
MARGIN_M = 10.0
YARD = ((180.0, -80.0), (330.0, -80.0), (330.0, 14.0), (180.0, 14.0))
"""South of the line, where everybody who comes home from its far end would fly straight through."""
NO_MORE: Mapping[str, tuple[tuple[float, float], ...]] = MappingProxyType({})
FOREST = ((120.0, 75.0), (250.0, 45.0), (250.0, 160.0), (120.0, 160.0))


def ground(
    folder: Path, autopilot: str, *, areas: bool = True, more: Mapping[str, tuple[tuple[float, float], ...]] = NO_MORE
) -> SiteModel:
    """Return three vehicles over a line of ten spans of 40 m, with areas on both sides of it."""
    line = write_line(folder / "line.geojson")
    content = build_demo_site(
        network=line, radius_m=1e6, vehicles=3, speedup=1.0, autopilot=autopilot, ports=range(20_000, 20_003)
    )  # fmt: skip
    content["inspection"] = {"ceiling_m": SIMULATED_CEILING_M}
    if areas:
        content["area"] = [
            {"name": name, "polygon": [FRAME.to_wgs84_deg(*corner) for corner in ring], "margin_m": MARGIN_M}
            for name, ring in (("yard", YARD), ("forest", FOREST), *more.items())
        ]
    return site_model.load_site_model(check_site(content, "test"), folder)


def flown(chosen: SiteModel, *faults: str, plan: PlanFile | None = None) -> tuple[VirtualFlight, dict[str, float]]:
    """Return a flight, and how near each vehicle truly came to one of the two areas."""
    least_m: dict[str, float] = {}
    shapes = [Polygon(YARD), Polygon(FOREST)]

    def lived(vehicles: Mapping[str, SimulatedVehicle]) -> None:
        for name, vehicle in vehicles.items():
            body, pad = vehicle.autopilot.frame.body, chosen.setup.pad_of(name)
            place = Point(pad.east_m + body.east_m, pad.north_m + body.north_m)
            away_m = min(float(shapely.distance(place, one)) for one in shapes)
            least_m[name] = min(away_m, least_m.get(name, 1e9))

    plan = plan or plan_with(chosen, {"uav1": (0, 2), "uav2": (16, 14, 12, 10), "uav3": (18,)})
    return fly_virtual(chosen, plan, faults=faults, seed=1, onlookers=FlightObservers(lived=lived)), least_m


@pytest.mark.parametrize("autopilot", ["ardupilot", "px4"])
def test_survivors_keep_out_of_areas_after_a_loss(tmp_path: Path, autopilot: str) -> None:
    chosen = ground(tmp_path, autopilot)
    flight, least_m = flown(chosen, "uav2:crash@45%")
    assert flight.ended
    assert [fault.vehicle for fault in flight.report.faults] == ["uav2"]
    assert flight.report.replans
    assert flight.report.finished
    for name in ("uav1", "uav3"):
        assert least_m[name] >= MARGIN_M - CUT_M
        assert not flight.crafts[name].wrecked
        assert flight.crafts[name].from_pad_m < 1.0


@pytest.mark.parametrize("autopilot", ["ardupilot", "px4"])
def test_without_the_areas_the_same_flight_leads_through_them(tmp_path: Path, autopilot: str) -> None:
    _, least_m = flown(ground(tmp_path, autopilot, areas=False), "uav2:crash@45%")
    assert min(least_m["uav1"], least_m["uav3"]) == 0.0


@pytest.mark.parametrize("autopilot", ["ardupilot", "px4"])
def test_a_vehicle_given_rtl_flies_straight_and_the_crew_is_informed(tmp_path: Path, autopilot: str) -> None:
    flight, least_m = flown(ground(tmp_path, autopilot), "uav2:battery-step=30@45%")
    assert [fault.vehicle for fault in flight.report.faults] == ["uav2"]
    assert "uav2: RTL will cross no-fly area 'yard'" in [line.text for _, line in flight.said]
    # That is its autopilot's own flight, which knows of no area.
    assert least_m["uav2"] == 0.0
    assert min(least_m["uav1"], least_m["uav3"]) >= MARGIN_M - CUT_M


def test_the_checklist_lists_avoided_areas_and_rtls_through_them(tmp_path: Path) -> None:
    flight, _ = flown(ground(tmp_path, "px4"))
    lines = {row.text: row.severity.value for row in flight.report.checks if row.code == CheckCode.AREAS}
    assert lines["2 areas; every leg avoids them"] == "ok"
    [warning] = [text for text, severity in lines.items() if severity == "warning" and "uav3" in text]
    assert warning == "uav3: its own RTL from line.10 and on its way back crosses area 'yard'"
    paths = [board.path for board in flight.boards.values() if board is not None]
    assert check_areas(flight.context.setup, paths) == []


def test_what_lies_in_an_area_is_not_flown_and_the_report_says_why(tmp_path: Path) -> None:
    station = ((420.0, 0.0), (480.0, 0.0), (480.0, 60.0), (420.0, 60.0))
    chosen = ground(tmp_path, "px4", more={"station": station})
    flight, least_m = flown(chosen, plan=plan_site(chosen, PlanRequest(None, 0.2, 1, iterations=200, usual=True)))
    report = flight.report
    assert (report.segments_total, report.segments_inspected, report.finished) == (10, 9, False)
    assert (report.segments_uncovered, report.uncovered_names) == ((9,), ("line.10",))
    [row] = report.unreachable
    assert (row.segment, row.name, row.why) == (9, "line.10", "lies in area 'station'")
    assert min(least_m.values()) >= MARGIN_M - CUT_M
