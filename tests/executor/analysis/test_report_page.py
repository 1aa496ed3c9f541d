"""The page: what it says first, what it holds, and that nothing from outside becomes markup."""

from __future__ import annotations

import json
import re
from base64 import b64encode
from dataclasses import replace
from hashlib import sha256
from html.parser import HTMLParser
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from executor.adapters.templates import inline_script
from executor.analysis.documents import FlightReport, LastFix, LastPosition, LegRow, RadioRow, RouteRow, SortieRow
from executor.analysis.flight_record import DecisionLine, FlightRecord, PlanRevision, read_run
from executor.analysis.report_page import describe_outcome, render_report_page, write_report_page
from executor.core.interface.commands import Level
from tests.executor.flights import short_report, write_run

EMPTY = {"meta", "img"}
"""Elements without an end tag."""


class _Reader(HTMLParser):
    """Collects the tables' cells and the headings, and checks that every element is closed where it should be."""

    def __init__(self) -> None:
        super().__init__()
        self.open: list[str] = []
        self.tags: set[str] = set()
        self.texts: list[tuple[str, str]] = []
        self.links: list[str] = []
        self.classes: dict[str, str] = {}
        self.policies: list[str] = []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags.add(tag)
        self.links += [value or "" for name, value in attrs if name in {"src", "href"}]
        if tag not in EMPTY:
            self.open.append(tag)
        self.policies += [
            value or ""
            for name, value in attrs
            if name == "content" and ("http-equiv", "content-security-policy") in attrs
        ]
        kind = dict(attrs).get("class")
        if tag == "tr" and kind:
            self.classes[f"row {len(self.texts)}"] = kind

    def handle_endtag(self, tag: str) -> None:
        assert self.open.pop() == tag

    def handle_data(self, data: str) -> None:
        if data.strip():
            self.texts.append((self.open[-1], data))

    def of(self, tag: str) -> list[str]:
        return [text for inside, text in self.texts if inside == tag]


@pytest.fixture
def flight(tmp_path: Path) -> tuple[FlightRecord, FlightReport]:
    """Return record and report of the flight in `flights`."""
    report = write_run(tmp_path)
    return read_run(tmp_path), report


def _read(text: str) -> _Reader:
    reader = _Reader()
    reader.feed(text)
    reader.close()
    assert reader.open == []
    return reader


def test_the_outcome_comes_first(flight: tuple[FlightRecord, FlightReport]) -> None:
    record, report = flight
    reader = _read(render_report_page(record, report, {}))
    sentence = "All 5 segments were inspected in 2 min 30 s, although uav2 was lost; the others took over 2 of them."
    assert reader.of("title") == [sentence]
    assert reader.of("h1") == [sentence]
    assert reader.of("p")[0].startswith("3 vehicles; 1 re-plan; any two vehicles stayed at least 12.5 m apart; ")


def test_what_was_not_inspected_is_reported_first_too(tmp_path: Path) -> None:
    report = write_run(tmp_path, finished=False)
    record = read_run(tmp_path)
    assert (
        describe_outcome(record) == "1 of 5 segments was not inspected after uav2 was lost; the flight took 2 min 30 s."
    )
    assert "not inspected: 1." in _read(render_report_page(record, report, {})).of("p")[0]


def test_what_is_out_of_reach_is_not_put_down_to_the_vehicle_that_was_lost(
    flight: tuple[FlightRecord, FlightReport],
) -> None:
    record, _ = flight
    barred = replace(record, never=(("P7-P8", "lies in area 'wood'"),))
    assert describe_outcome(barred) == (
        "All 5 segments within reach were inspected in 2 min 30 s, although uav2 was lost; the others took over 2 of "
        "them; 1 more is out of reach."
    )


def test_a_quiet_flight_needs_few_words(flight: tuple[FlightRecord, FlightReport]) -> None:
    record, report = flight
    quiet = replace(record, vehicles=tuple(replace(vehicle, fault=None) for vehicle in record.vehicles), duration_s=42)
    assert describe_outcome(quiet) == "All 5 segments were inspected in 42 s."
    assert "Faults" not in _read(render_report_page(quiet, report, {})).of("h2")


def test_the_tables_hold_the_figures(flight: tuple[FlightRecord, FlightReport]) -> None:
    record, report = flight
    reader = _read(render_report_page(record, report, {}))
    assert reader.of("h2") == [
        "Faults", "Re-plans", "Vehicles", "Before the flight", "How the segments were flown", "Decisions", "Segments"
    ]  # fmt: skip
    cells = reader.of("td")
    rows = [
        ["uav2", "link", "link lost for 10 s", "T+0:40", "T+0:50", "10.0"],
        ["1", "uav2: link", "yes", "0.10", "9.00", "10.0", "1", "90.0", "none"],
        ["uav1", "landed", "yes", "2, 3, 4", "15.0", "85.0", "PX4", "1.17.0"],
        ["uav3", "warning", "no battery failsafe"],
        ["3", "uav1", "5.00", "5.30", "0.00", "0.25"],
        ["T+0:50", "fault", "uav2: lost, silent for 10 s <again>"],
    ]
    for row in rows:
        assert any(cells[at : at + len(row)] == row for at in range(len(cells)))
    assert list(reader.classes.values()) == ["warning", "fault"]
    segment = cells.index("0", cells.index("T+2:30"))
    assert cells[segment : segment + 4] == ["0", "100.0", "uav2", "uav2"]


def test_planned_and_flown_stand_beside_each_other(flight: tuple[FlightRecord, FlightReport]) -> None:
    record, report = flight
    legs = (
        LegRow(waypoint=0, phase="takeoff", planned_s=12.0, flown_s=13.5, planned_pct=0.4, flown_pct=0.5),
        LegRow(waypoint=1, phase="inspect", segment=3, planned_s=34.3, flown_s=None, planned_pct=1.2, flown_pct=None),
    )
    row = RouteRow(
        vehicle="uav1", revision=0, whole=True, began_s=3.0, ended_s=75.0, planned_s=60.0, flown_s=72.0,
        time_error_pct=20.0, planned_pct=2.0, flown_pct=2.5, energy_error_pct=25.0, legs=legs,
    )  # fmt: skip
    part = row.model_copy(update={"revision": 1, "whole": False, "legs": legs[:1], "flown_pct": None})
    text = render_report_page(record, report.model_copy(update={"routes": (row, part)}), {})
    reader = _read(text)
    assert reader.of("h2")[-3:] == ["Planned and flown", "Decisions", "Segments"]
    cells = reader.of("td")
    for wanted in (
        ["uav1", "0", "2", "1 min 0 s", "1 min 12 s", "20.0", "2.00", "2.50", "25.0"],
        ["uav1", "1", "1, not from take-off to landing", "1 min 0 s", "1 min 12 s", "20.0", "2.00", "unknown"],
        ["0.0", "takeoff", "12.0", "13.5", "0.40", "0.50"],
        ["0.1", "inspect", "3", "34.3", "unknown", "1.20", "unknown"],
    ):
        assert any(cells[at : at + len(wanted)] == wanted for at in range(len(cells)))
    assert reader.of("summary") == ["uav1: 3 legs, by mission and waypoint"]


def test_speeds_are_summed_up_in_a_sentence(flight: tuple[FlightRecord, FlightReport]) -> None:
    record, report = flight
    facts = _read(render_report_page(record, report, {})).of("p")[0]
    assert "flown at 5.00 m/s on average (5.00 m/s were requested), at most 5.40 m/s and at most 0.25 m off" in facts
    without = report.model_copy(update={"inspections": ()})
    assert "on average" not in _read(render_report_page(record, without, {})).of("p")[0]


def test_the_pictures_are_inside_the_file(flight: tuple[FlightRecord, FlightReport], tmp_path: Path) -> None:
    record, report = flight
    (tmp_path / "battery.png").write_bytes(b"picture")
    write_report_page(record, report, tmp_path / "report.html")
    reader = _read((tmp_path / "report.html").read_text(encoding="utf-8"))
    assert reader.links == ["data:image/png;base64,cGljdHVyZQ=="]
    assert reader.tags.isdisjoint({"link", "iframe", "object"})


def test_the_only_script_that_may_run_is_that_of_the_map(flight: tuple[FlightRecord, FlightReport]) -> None:
    reader = _read(render_report_page(*flight, {}))
    *data, script = reader.of("script")
    assert script == inline_script("report.js")
    assert re.findall(r"^(?:import|export)\b.*", script, re.MULTILINE) == []
    digest = b64encode(sha256(script.encode()).digest()).decode()
    (policy,) = reader.policies
    assert "default-src 'none'" in policy
    assert f"script-src 'sha256-{digest}'" in policy
    assert len(data) == 3
    assert all(json.loads(one) is None or isinstance(json.loads(one), dict) for one in data)


def test_names_that_end_the_data_stay_data(flight: tuple[FlightRecord, FlightReport]) -> None:
    record, report = flight
    evil = "</script><!--<script>\u2028\ud83d &amp; ]]>"
    named = tuple(replace(segment, name=evil) for segment in record.segments)
    text = render_report_page(replace(record, segments=named), report, {})
    data = json.loads(_read(text).of("script")[0])
    assert {one["name"] for one in data["segments"]} == {evil}
    assert text.count("<script") == 4


def test_nothing_from_outside_becomes_markup(flight: tuple[FlightRecord, FlightReport]) -> None:
    record, report = flight
    evil = """</td><script>alert("1 & 2")</script><img src='http://x/'>"""
    fault = record.vehicles[1].fault
    assert fault is not None
    lost = replace(record.vehicles[1], name=evil, fault=fault.model_copy(update={"reason": evil}))
    record = replace(record, vehicles=(lost,), decisions=(DecisionLine(1.0, Level.INFO, evil),))
    vehicle = report.vehicles[0].model_copy(update={"name": evil, "segments": (3,)})
    replan = report.replans[0].model_copy(update={"trigger": evil})
    names = {"segment_names": {"3": evil}, "inspections": (), "checks": ()}
    report = report.model_copy(update={"vehicles": (vehicle,), "replans": (replan,), **names})
    reader = _read(render_report_page(record, report, {evil: b""}))
    assert evil not in reader.of("script")
    assert len(reader.of("script")) == 4
    assert reader.links == ["data:image/png;base64,"]
    assert reader.of("td").count(evil) == 6
    assert evil in reader.of("h1")[0]


def test_a_vehicle_off_its_pad_can_be_found(flight: tuple[FlightRecord, FlightReport]) -> None:
    record, report = flight
    at = LastPosition(lat_deg=49.6012349, lon_deg=15.6, alt_rel_m=0.4, at_s=83.2, known="fix", accuracy_m=1.8)
    fix = LastFix(lat_deg=49.60123, lon_deg=15.6, alt_rel_m=22.0, ground_speed_m_s=3.0, at_s=20.0)
    reckoned = at.model_copy(update={"lat_deg": 49.605, "known": "reckoned", "accuracy_m": 441.0, "last_fix": fix})
    ends = [("landed", True, at), ("down", False, at), ("lost", False, reckoned)]
    vehicles = tuple(
        row.model_copy(update={"state": state, "landed": landed, "last_position": place})
        for row, (state, landed, place) in zip(report.vehicles, ends, strict=True)
    )
    reader = _read(render_report_page(record, report.model_copy(update={"vehicles": vehicles}), {}))
    assert "Not at home: where to look" in reader.of("h2")
    cells = reader.of("td")
    known = "49.60123, 15.60000 (GPS, 1.8 m)"
    first = cells.index(known)
    assert cells[first - 3 : first + 3] == ["uav2", "down: keep away", "the same", known, "0.40", "T+1:23"]
    assert cells.count(known) == 1
    assert cells[first + 3 : first + 7] == [
        "uav3",
        "lost",
        "49.60123, 15.60000, T+0:20, at 3 m/s",
        "49.605, 15.600 (reckoned without GPS, off by 441 m or more)",
    ]


def test_spans_are_called_by_their_names(flight: tuple[FlightRecord, FlightReport]) -> None:
    record, report = flight
    names = {str(segment.id): f"P{segment.id}-P{segment.id + 1}" for segment in record.segments}
    named = tuple(replace(segment, name=names[str(segment.id)]) for segment in record.segments)
    report = report.model_copy(update={"segment_names": names})
    cells = _read(render_report_page(replace(record, segments=named), report, {})).of("td")
    assert "P2-P3, P3-P4, P4-P5" in cells
    row = ["P0-P1", "100.0", "uav2", "uav2"]
    assert any(cells[at : at + 4] == row for at in range(len(cells)))


@given(st.text())
def test_any_text_comes_back_from_the_page_as_it_was(text: str) -> None:
    record = FlightRecord((), (), (PlanRevision(0, 0.0, ()),), (DecisionLine(0.0, Level.INFO, f"<{text}>"),), 0.0, 0.0)
    assert f"<{text}>".split() == "".join(_read(render_report_page(record, short_report([]), {})).of("td")[2:]).split()


def test_the_map_of_a_day_offers_the_plan_of_all_its_sorties(flight: tuple[FlightRecord, FlightReport]) -> None:
    record, report = flight
    assert _read(render_report_page(record, report, {})).of("option") == [
        "not shown",
        "first plan",
        "re-plan 1, T+0:51",
    ]
    first = record.revisions[0].routes
    later = replace(first[0], segments=(1, 2))
    day = replace(record, sorties=(*first, later))
    reader = _read(render_report_page(day, report, {}))
    assert reader.of("option") == ["not shown", "plan of the day", "re-plan 1, T+0:51"]
    plan = json.loads(reader.of("script")[0])["plans"][0]
    assert [one["vehicle"] for one in plan["routes"]] == ["uav1", "uav2", "uav1"]
    cells = reader.of("td")
    assert any(cells[at : at + 4] == ["1", "100.0", "uav1", "uav3"] for at in range(len(cells)))


def test_sorties_stand_with_their_packs_where_there_are_several(flight: tuple[FlightRecord, FlightReport]) -> None:
    record, report = flight
    assert "Sorties" not in render_report_page(record, report, {})
    assert "sorties" not in report.to_plain()
    row = SortieRow(
        vehicle="uav1", number=2, pack="P<7>", began_s=610.0, ended_s=None, began_pct=99.0, ended_pct=None, rest_v=16.7,
        segments=(0,),
    )  # fmt: skip
    text = render_report_page(record, report.model_copy(update={"sorties": (row,)}), {})
    assert "<h2>Sorties</h2>" in text
    assert "P&lt;7&gt;" in text


def test_what_a_radio_carried_is_reported(flight: tuple[FlightRecord, FlightReport]) -> None:
    record, report = flight
    row = RadioRow(
        vehicles=("uav1", "uav2"), bytes_s=840.0, most_bytes_s=1100.0, capacity_bytes_s=1200.0, round_trip_s=2.44,
        lost=0.031, congested_s=41.0, weak_s=0.0, positions_hz=1.0,
    )  # fmt: skip
    page = render_report_page(record, report.model_copy(update={"radios": (row,)}), {})
    assert (
        "radio of uav1, uav2: 0.8 of 1.2 kB/s on average, round trip at most 2.4 s, 3 % lost, congested for 41 s, "
        "positions at 1 Hz or more"
    ) in page
    assert "radio of" not in render_report_page(record, report, {})
