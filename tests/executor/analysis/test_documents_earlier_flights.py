"""One report over several flights, of which each flies what those before it left."""

from __future__ import annotations

from pathlib import Path

import pytest

from executor.analysis.documents import AskedVehicles, EarlierRow, describe_total_inspected, read_earlier_flights
from executor.analysis.flight_record import read_run
from executor.analysis.report import build_report, build_vehicle_answers
from executor.analysis.report_page import render_report_page
from executor.errors import LogError
from tests.executor.core.stories import FLEET, under_way
from tests.executor.flights import short_report, write_run

MONDAY = EarlierRow(run="monday", segments=(7, 8), sorties=12, duration_s=9000.0, faults=())


def test_each_flight_is_named_with_what_it_came_to(tmp_path: Path) -> None:
    run = tmp_path / "tuesday"
    run.mkdir()
    flown = write_run(run, finished=False)
    tuesday = EarlierRow(run="tuesday", segments=(0, 2, 3, 4), sorties=3, duration_s=150.0, faults=("uav2",))
    assert read_earlier_flights(run) == (tuesday,)
    report = flown.model_copy(update={"earlier": (MONDAY,)})
    report.write(run / "report.json")
    assert read_earlier_flights(run) == (MONDAY, tuesday)
    assert describe_total_inspected(report) == "with 1 flight before it 6 of 7 segments are inspected"
    shown = render_report_page(read_run(run), report, {})
    assert "Flights before this one" in shown
    assert "<td>monday</td>" in shown
    assert "with 1 flight before it 6 of 7 segments are inspected" in shown


def test_the_first_flight_says_nothing_of_others(tmp_path: Path) -> None:
    report = write_run(tmp_path)
    assert describe_total_inspected(report) == ""
    assert "Flights before this one" not in render_report_page(read_run(tmp_path), report, {})
    assert "earlier" not in report.to_plain()


def test_without_its_report_a_flight_is_none_before_another(tmp_path: Path) -> None:
    with pytest.raises(LogError, match=r"report.json: cannot be read"):
        read_earlier_flights(tmp_path)


def test_earlier_results_are_kept_for_a_resumed_flight() -> None:
    flight = under_way()
    said = build_vehicle_answers(FLEET.context, {}, earlier=(MONDAY,))
    for known in (said, AskedVehicles.model_validate(said.to_plain())):
        assert build_report(FLEET.context, flight.state, flight.now_s, said=known).earlier == (MONDAY,)
    assert short_report([]).earlier == ()
