"""The prediction bench on two short routes, and what it makes of figures known beforehand."""

from __future__ import annotations

import json
from dataclasses import asdict, replace
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from benchmarks import prediction
from benchmarks.commands import cli
from benchmarks.errors import BenchError
from benchmarks.prediction import Figures, Flown, FlownRoute, RouteCase, cases, phases, prediction_errors, sum_by_phase
from benchmarks.predictionpage import keep_prediction, prediction_document, report_prediction
from benchmarks.virtual_site import AMPLE_AH, build_virtual_site
from executor.analysis.documents import LegRow, RouteRow
from simulator.truth import Truth
from tests.benchmarks.virtual.short_line import write_line
from tests.executor.flights import write_run


def route_of(time_s: float, energy_pct: float | None, autopilot: str = "px4") -> FlownRoute:
    """Return a route that was planned with 100 s and 10 %."""
    figures = Figures(100.0, time_s, 10.0, energy_pct)
    return FlownRoute("flight 0", "uav1", autopilot, 9, 0.0, 0.0, figures, {"land": figures})


def test_routes_are_drawn_as_asked() -> None:
    drawn = cases(100, 1, ["ardupilot", "px4"], [None])
    sizes = [size for case in drawn for size in case.sizes]
    assert len(sizes) == 100
    assert (min(sizes), max(sizes)) == (5, 40)
    assert {len(case.sizes) for case in drawn} == {1, 2, 3, 4}
    assert {case.autopilot for case in drawn} == {"ardupilot", "px4"}
    assert cases(100, 1, ["ardupilot", "px4"], [None]) == drawn != cases(100, 2, ["ardupilot", "px4"], [None])


def test_hills_leave_the_depot_where_it_is_and_rise_as_high_as_asked() -> None:
    ground = build_virtual_site(None, None, 2, "px4")
    hills = prediction.with_hills(ground.network, 40.0, np.random.default_rng(1))
    assert hills.frame == ground.network.frame
    rises = [
        (after.elevation_m or 0.0) - (before.elevation_m or 0.0)
        for before, after in zip(ground.network.pylons, hills.pylons, strict=True)
    ]
    assert -1.0 < min(rises) < max(rises) < 41.0
    assert max(rises) > 15.0


def test_routes_share_nothing_and_have_their_sizes() -> None:
    ground = build_virtual_site(None, None, 3, "px4", capacity_ah=AMPLE_AH)
    routes = prediction.random_routes(ground, (5, 12, 40), np.random.default_rng(2))
    assert [len(visits) for visits in routes.values()] == [5, 12, 40]
    segments = [visit >> 1 for visits in routes.values() for visit in visits]
    assert len(set(segments)) == len(segments)


def test_a_network_that_is_too_small_is_refused(tmp_path: Path) -> None:
    line = write_line(tmp_path / "line.geojson", 5)
    with pytest.raises(BenchError, match=r"line\.geojson: expected 10 segments or more for 2 routes"):
        prediction.fly_case(RouteCase(0, 1, "px4", line, (5, 5)))


@pytest.fixture(scope="module")
def flown(tmp_path_factory: pytest.TempPathFactory) -> Flown:
    line = write_line(tmp_path_factory.mktemp("line") / "line.geojson")
    return prediction.fly_case(RouteCase(3, 1, "ardupilot", line, (5, 5)))


def test_two_routes_are_flown_and_held_against_their_plans(flown: Flown) -> None:
    assert flown.wrong == ""
    assert [(route.vehicle, route.segments) for route in flown.routes] == [("uav1", 5), ("uav2", 5)]
    for route in flown.routes:
        figures = route.figures
        assert figures.planned_s > 5 * 40.0 / 3.0
        assert abs(figures.time_error_pct) < 20.0
        assert figures.energy_error_pct is not None
        assert abs(figures.energy_error_pct) < 30.0
        # What the ground station heard of the legs adds up to what was.
        assert set(route.phases) == {"takeoff", "transit", "inspect", "return", "land"}
        assert sum(phase.flown_s for phase in route.phases.values()) == pytest.approx(figures.flown_s, abs=3.0)
        assert sum(phase.planned_s for phase in route.phases.values()) == pytest.approx(figures.planned_s, abs=1.0)


def test_the_same_case_gives_the_same_figures(flown: Flown, tmp_path: Path) -> None:
    line = write_line(tmp_path / "line.geojson")
    assert prediction.fly_case(RouteCase(3, 1, "ardupilot", line, (5, 5))).routes == flown.routes
    assert prediction.fly_case(RouteCase(4, 1, "ardupilot", line, (5, 5))).routes != flown.routes


def test_the_median_is_of_the_sizes_of_errors() -> None:
    found = prediction_errors([route_of(90.0, 10.5), route_of(104.0, 9.9), route_of(102.0, None)])
    assert found == {
        "routes": 3,
        "time_error_pct": {"median": 4.0, "max": 10.0, "median_signed": 2.0},
        "energy_error_pct": {"median": 3.0, "max": 5.0, "median_signed": 2.0},
        "plan_file": None,
    }
    assert prediction_errors([])["time_error_pct"] is None
    route = replace(route_of(90.0, 10.5), plan_file=Figures(80.0, 90.0, 8.4, 10.5))
    errors = prediction_errors([route])["plan_file"]
    assert errors["time_error_pct"] == {"median": 12.5, "max": 12.5, "median_signed": 12.5}
    assert errors["energy_error_pct"]["max"] == 25.0


def test_legs_of_a_kind_are_summed_where_they_were_heard() -> None:
    legs = tuple(
        LegRow(waypoint=number, phase=phase, planned_s=10.0, flown_s=flown_s, planned_pct=1.0, flown_pct=flown_pct)
        for number, (phase, flown_s, flown_pct) in enumerate(
            [("transit", 11.0, 1.0), ("transit", 12.0, 1.5), ("transit", None, None), ("land", 9.0, None)]
        )
    )
    route = RouteRow(
        vehicle="uav1", revision=0, whole=True, began_s=0.0, ended_s=40.0, planned_s=40.0, flown_s=40.0,
        time_error_pct=0.0, planned_pct=4.0, flown_pct=None, energy_error_pct=None, legs=legs,
    )  # fmt: skip
    assert sum_by_phase(route) == {"transit": Figures(20.0, 23.0, 2.0, 2.5), "land": Figures(10.0, 9.0, 1.0, None)}
    summed = phases([route_of(90.0, 10.5), route_of(120.0, 9.5)])
    assert summed == {"land": {"planned_s": 200.0, "flown_s": 210.0, "time_error_pct": 5.0, "energy_error_pct": 0.0}}


def test_a_flight_that_was_not_nominal_is_reported_and_not_counted(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    flights = [Flown((route_of(104.0, 10.5),), 100.0, 2.0), Flown((), 50.0, 1.0, "uav2: falls")]
    content = prediction_document(flights[0].routes, "faultline bench", seed=1, flights=flights, networks=["line"])
    assert (content["routes"], content["not_nominal"], content["flown_s_per_s"]) == (1, ["uav2: falls"], 50.0)
    assert content["time_error_pct"]["median"] == 4.0
    keep_prediction(content, tmp_path)
    assert json.loads((tmp_path / "prediction.json").read_text()) == content
    page = (tmp_path / "prediction.md").read_text()
    assert "| time, px4 | 4.00 | 4.00 | 4.00 |" in page
    assert "**1 flights were not nominal, and are not counted: uav2: falls.**" in page
    report_prediction(content).show()
    assert "not nominal, not counted: uav2: falls" in capsys.readouterr().out


def test_recorded_flights_need_a_whole_route(tmp_path: Path) -> None:
    report = write_run(tmp_path)
    legs = (LegRow(waypoint=0, phase="inspect", planned_s=10.0, flown_s=11.0, planned_pct=1.0, flown_pct=1.0),)
    whole = RouteRow(
        vehicle="uav1", revision=0, whole=True, began_s=0.0, ended_s=11.0, planned_s=10.0, flown_s=11.0,
        time_error_pct=10.0, planned_pct=1.0, flown_pct=1.0, energy_error_pct=0.0, legs=legs,
    )  # fmt: skip
    part = whole.model_copy(update={"vehicle": "uav2", "whole": False})
    report.model_copy(update={"routes": (whole, part)}).write(tmp_path / "report.json")
    done = CliRunner().invoke(cli, ["prediction", "--run", str(tmp_path), "--json"])
    assert done.exit_code == 0, done.output
    content = json.loads(done.stdout)
    assert [row["vehicle"] for row in content["rows"]] == ["uav1"]
    assert content["time_error_pct"] == {"median": 10.0, "max": 10.0, "median_signed": 10.0}
    assert content["energy_error_pct"]["max"] == 0.0
    truths = [Truth("uav1", what, 0.0, 0.0, charge_pct=pct) for what, pct in (("armed", 99.5), ("disarmed", 98.4))]
    (tmp_path / "truth.jsonl").write_text("".join(json.dumps(asdict(one)) + "\n" for one in truths))
    [route] = prediction.read_recorded_routes([tmp_path])
    assert route.figures.energy_error_pct == pytest.approx(10.0)
    report.model_copy(update={"routes": (part,)}).write(tmp_path / "report.json")
    with pytest.raises(BenchError, match="--run: expected a flight in which a vehicle flew its mission"):
        prediction.read_recorded_routes([tmp_path])
