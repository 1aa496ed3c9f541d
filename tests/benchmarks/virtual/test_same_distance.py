"""All vehicles at the requested distance, with losses: true separation and inspection height."""

from __future__ import annotations

import itertools
import json
import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

import pytest

from benchmarks.prediction import plan_with
from benchmarks.virtual_flight import FlightObservers, VirtualFlight, fly_virtual
from executor.simulated.simulated_fleet import SIMULATED_CEILING_M, build_demo_site
from executor.site import site_model
from executor.site.site_file import check_site
from executor.site.site_model import SiteModel
from missions import PlanFile
from missions.geometry import locate_on_leg
from simulator.fleet import SimulatedVehicle
from tests.missions.builders import FRAME

LAYER_M = 5.0
AIRBORNE_M = 1.0
OFF_M = 1.0
"""What an inspection's height may be off."""
SPAN_M = 60.0
WAYS = ((1.0, 0.0), (0.0, 1.0), (-1.0, 0.0))
SPANS = 4


def write_star(path: Path) -> Path:
    """Write three lines of four spans each, east, north and west of the depot."""
    features: list[dict[str, object]] = [
        {"type": "Feature", "geometry": {"type": "Point", "coordinates": [FRAME.lon_deg, FRAME.lat_deg]},
         "properties": {"role": "depot", "elevation_m": FRAME.alt_m}},
    ]  # fmt: skip
    for way, (east, north) in enumerate(WAYS):
        reach_m = [SPAN_M * (span + 1) for span in range(SPANS + 1)]
        places = [FRAME.to_wgs84_deg(east * far, north * far) for far in reach_m]
        points = [[round(lon, 7), round(lat, 7)] for lat, lon in places]
        features += [
            {"type": "Feature", "geometry": {"type": "Point", "coordinates": point},
             "properties": {"id": f"w{way}-{number}"}}
            for number, point in enumerate(points)
        ]  # fmt: skip
        line = {"type": "LineString", "coordinates": points}
        features.append({"type": "Feature", "geometry": line, "properties": {"id": f"line{way}"}})
    path.write_text(json.dumps({"type": "FeatureCollection", "features": features}), encoding="utf-8")
    return path


def ground(folder: Path, autopilot: str, *, same: bool = True) -> SiteModel:
    """Return three vehicles over it; the ground is as high as the depot's."""
    content = build_demo_site(
        network=write_star(folder / "star.geojson"), radius_m=1e6, vehicles=3, speedup=1.0, autopilot=autopilot,
        ports=range(20_000, 20_003),
    )  # fmt: skip
    content["inspection"] = {"ceiling_m": SIMULATED_CEILING_M, "heights": "flat", "same_distance": same}
    return site_model.load_site_model(check_site(content, "test"), folder)


@dataclass
class Seen:
    """Where vehicles truly were."""

    least_m: float = math.inf
    places_m: dict[str, list[tuple[float, float, float, float]]] = field(default_factory=dict)
    """East, north, up over the depot's ground, and the speed over ground."""


def own_ways(chosen: SiteModel) -> PlanFile:
    """Return a plan in which every vehicle has a line of its own."""
    return plan_with(
        chosen,
        {name: tuple(2 * SPANS * way + 2 * span for span in range(SPANS)) for way, name in enumerate(chosen.names)},
    )


def flown(chosen: SiteModel, plan: PlanFile, *faults: str) -> tuple[VirtualFlight, Seen]:
    """Fly it, and look at where everybody truly is ten times a second."""
    seen = Seen()

    def lived(vehicles: Mapping[str, SimulatedVehicle]) -> None:
        now = {}
        for name, vehicle in vehicles.items():
            body, pad = vehicle.autopilot.frame.body, chosen.setup.pad_of(name)
            speed = math.hypot(body.v_east_m_s, body.v_north_m_s)
            place = (pad.east_m + body.east_m, pad.north_m + body.north_m, body.up_m, speed)
            seen.places_m.setdefault(name, []).append(place)
            if body.up_m > AIRBORNE_M:
                now[name] = place
        for one, other in itertools.combinations(now.values(), 2):
            seen.least_m = min(seen.least_m, math.dist(one[:3], other[:3]))

    return fly_virtual(chosen, plan, faults=faults, seed=1, onlookers=FlightObservers(lived=lived)), seen


def heights_m(chosen: SiteModel, seen: Seen, vehicle: str, segment: int) -> list[float]:
    """Return at which heights a vehicle was where it flew along the middle of a segment at inspection speed."""
    begin, end = chosen.setup.tracks_m[segment].tolist()
    found = []
    for east, north, up, speed in seen.places_m[vehicle]:
        along, aside = locate_on_leg(tuple(begin), tuple(end), (east, north))
        length = math.dist(begin, end)
        if 0.3 * length < along < 0.7 * length and aside < 2.0 and 1.0 < speed < 1.3 * 3.0:
            found.append(up)
    return found


def judged(chosen: SiteModel, flight: VirtualFlight, seen: Seen) -> list[float]:
    """Hold a flight against the truth, and return at which distances its segments were inspected."""
    assert flight.ended
    assert seen.least_m >= LAYER_M
    told = {row.segment: row.inspected_at_m for row in flight.report.inspections}
    for row in flight.report.inspections:
        assert row.inspected_at_m is not None
        really_m = heights_m(chosen, seen, row.vehicle, row.segment)
        assert any(abs(up - row.inspected_at_m) <= OFF_M for up in really_m), (row.segment, row.vehicle)
    return [at_m for at_m in told.values() if at_m is not None]


@pytest.mark.parametrize("autopilot", ["ardupilot", "px4"])
def test_lines_of_their_own_are_all_inspected_as_asked(tmp_path: Path, autopilot: str) -> None:
    chosen = ground(tmp_path, autopilot)
    flight, seen = flown(chosen, own_ways(chosen))
    assert judged(chosen, flight, seen) == [15.0] * 3 * SPANS
    assert flight.report.finished
    (said,) = [check.text for check in flight.report.checks if check.subject == "distance"]
    assert said == "12 of 12 segments are inspected at the requested 15 m"


@pytest.mark.parametrize("autopilot", ["ardupilot", "px4"])
@pytest.mark.parametrize("lost", ["uav1", "uav3"])
def test_a_silent_vehicle_is_taken_over_from_without_a_meeting(tmp_path: Path, autopilot: str, lost: str) -> None:
    chosen = ground(tmp_path, autopilot)
    flight, seen = flown(chosen, own_ways(chosen), f"{lost}:silent@45%")
    judged(chosen, flight, seen)
    assert flight.report.finished
    assert [fault.vehicle for fault in flight.report.faults] == [lost]


@pytest.mark.parametrize("autopilot", ["ardupilot", "px4"])
def test_what_is_inspected_from_a_layer_is_flown_again_before_the_return(tmp_path: Path, autopilot: str) -> None:
    """uav1 begins beside the depot, at the end of a line of which the other half is uav2's."""
    chosen = ground(tmp_path, autopilot)
    plan = plan_with(chosen, {"uav1": (2, 0), "uav2": (4, 6), "uav3": (8,)})
    from_layers = {visit.segment for route in plan.routes for visit in route.visits if visit.inspected_at_m != 15.0}
    assert from_layers
    flight, seen = flown(chosen, plan)
    assert set(judged(chosen, flight, seen)) == {15.0}
    assert (flight.report.finished, flight.report.replans) == (True, ())
    again = [line.text for line in flight.state.crew.said if "at inspection height" in line.text]
    assert len(again) == 1
