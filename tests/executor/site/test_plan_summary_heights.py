"""By which heights is flown, as the checklist, plans and the report say it."""

from __future__ import annotations

from pathlib import Path

import pytest

from executor.core.interface.codes import Check, CheckCode, Severity
from executor.core.preflight import mission_checks
from executor.errors import SiteError
from executor.simulated.simulated_fleet import build_demo_site
from executor.site import site_model
from executor.site.plan_summary import compute_planned_heights
from executor.site.site_file import check_site
from executor.site.site_planning import PlanRequest, plan_site
from missions import NetworkError, build_flight_path
from planner import Cost
from tests.executor.builders import fleet_of, ground_for, site_of
from tests.missions.builders import FLEET, default_setup, network_of

WANTED = PlanRequest(Cost.MINMAX, 0.05, 1, starts=1)


def test_the_checklist_says_over_what_and_how_high() -> None:
    setup = default_setup()
    paths = [build_flight_path(setup, name, range(2 * index, 66, 8)) for index, name in enumerate(FLEET)]
    [check] = mission_checks.check_flight_heights(setup, paths)
    assert check.severity is Severity.OK
    assert check.text.startswith("over the pylon tops, by 1")
    assert check.text.endswith(" m over the ground, RTL up to 115 m; ceiling 120 m")


def test_assumed_flat_ground_is_reported() -> None:
    fleet = fleet_of()
    paths = [board.path for board in fleet.boards.values() if board is not None]
    assert mission_checks.check_flight_heights(fleet.context.setup, paths, ("look here",)) == [
        Check(
            Severity.OK, "heights",
            "over the depot's ground, taken to be flat; 15 to 27 m over the ground, RTL up to 27 m; ceiling 120 m",
            CheckCode.HEIGHTS,
        ),
        Check(Severity.WARNING, "heights", "look here", CheckCode.HEIGHTS),
    ]  # fmt: skip


def test_over_the_ceiling_no_vehicle_flies() -> None:
    fleet = fleet_of(inspection={"ceiling_m": 20.0})
    paths = [board.path for board in fleet.boards.values() if board is not None]
    stops = [
        check.text
        for check in mission_checks.check_flight_heights(fleet.context.setup, paths)
        if check.severity is Severity.STOP
    ]
    assert [text.split(",")[0] for text in stops] == [
        "the mission of uav3 goes 27 m over the ground near segment 0",
        "the RTL of uav3 is level",
    ]


def test_a_plan_over_a_taller_line_that_crosses_is_refused() -> None:
    crossing = network_of(
        [(100.0, 0.0), (300.0, 0.0), (200.0, -100.0), (200.0, 100.0)],
        [(0, 1), (2, 3)],
        [(450.0, 12.0), (450.0, 12.0), (450.0, 50.0), (450.0, 50.0)],
    )
    ground = ground_for(site_of(("uav1",)), crossing)
    plan = plan_site(ground, WANTED)
    with pytest.raises(
        SiteError, match=r"^test network: heights: uav1 on leg \d \(inspect\) comes 23\.0 m below the top"
    ):
        compute_planned_heights(ground, [site_model.name_routes(ground, plan.build_task(), plan.plan)])


def test_the_report_has_the_figures() -> None:
    setup = default_setup()
    document = mission_checks.build_heights_document(setup, [build_flight_path(setup, "uav1", [0, 2])])
    assert document == {
        "over": "the pylon tops",
        "flat": False,
        "least_over_tops_m": pytest.approx(15.0, abs=0.5),
        "least_over_ground_m": pytest.approx(47.0, abs=3.0),
        "most_over_ground_m": pytest.approx(51.0, abs=3.0),
        "return_over_ground_m": 115.2,
        "ceiling_m": 120.0,
    }


def test_a_site_claims_that_its_ground_is_flat(tmp_path: Path) -> None:
    network = tmp_path / "line.geojson"
    network.write_text(
        '{"type": "FeatureCollection", "features": [{"type": "Feature", "properties": {"role": "depot"}, "geometry": '
        '{"type": "Point", "coordinates": [15.6, 49.6]}}, {"type": "Feature", "properties": {}, "geometry": '
        '{"type": "LineString", "coordinates": [[15.602, 49.6], [15.604, 49.6]]}}]}',
        encoding="utf-8",
    )

    def ground(*, flat: bool) -> site_model.SiteModel:
        content = build_demo_site(network=network, radius_m=700, vehicles=1, speedup=1, autopilot="px4", flat=flat)
        return site_model.load_site_model(check_site(content, "demo"), Path())

    assert ground(flat=True).inspection.flat
    with pytest.raises(NetworkError, match=r"line\.geojson: heights: expected elevation_m and height_m of every pylon"):
        ground(flat=False)
