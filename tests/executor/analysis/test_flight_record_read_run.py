"""A run directory read back: every figure of the flight in `flights` by hand."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from executor.analysis.flight_record import (
    PlannedRoute,
    compute_used_pct,
    draw_at_pct,
    find_abandoned_segments,
    find_last_row,
    inspection_time_s,
    read_run,
    route_join_time_s,
    take_off_time_s,
)
from executor.core.interface.commands import Level
from executor.core.state.inspection_proof import PositionSample, Track
from executor.core.state.vehicle_state import FaultKind
from executor.errors import LogError
from missions import write_plan
from tests.executor.flights import write_run
from tests.executor.site.two_bases import between_bases


def eastings_of(route: PlannedRoute) -> list[float]:
    """Return where a route starts, where each inspection begins and ends, and where the route ends."""
    starts, ends = ([leg[0] for leg in route.legs_m], [leg[-1] for leg in route.legs_m])
    assert starts[1:] == ends[:-1]
    return [east_m for east_m, _ in (*starts, ends[-1])]


def test_vehicle_and_time_of_each_inspection(tmp_path: Path) -> None:
    write_run(tmp_path)
    record = read_run(tmp_path)
    assert [segment.inspected_by for segment in record.segments] == ["uav2", "uav3", "uav1", "uav1", "uav1"]
    # A run counts from 5 m before the far pylon: up to a second before it is passed.
    inspected_s = [segment.inspected_s for segment in record.segments]
    assert inspected_s == [pytest.approx(t_s - 0.5, abs=0.51) for t_s in (30, 102, 120, 60, 80)]
    assert record.uncovered_segments == ()
    assert record.segments[0].a_m == pytest.approx((100.0, 0.0), abs=1e-3)
    assert record.segments[0].b_m == pytest.approx((200.0, 0.0), abs=1e-3)


def test_the_vehicles_as_they_were_heard(tmp_path: Path) -> None:
    write_run(tmp_path)
    one, two, three = read_run(tmp_path).vehicles
    assert [(v.name, v.layer, v.budget_pct, v.reserve_pct) for v in (one, two, three)] == [
        ("uav1", 0, 75.0, 15.0), ("uav2", 1, 75.0, 15.0), ("uav3", 2, 75.0, 15.0),
    ]  # fmt: skip
    assert one.track.shape == (151, 4)
    assert one.track[50] == pytest.approx([50.0, 450.0, 0.0, 30.0], abs=1e-3)
    assert one.battery.tolist() == [pytest.approx([10.0 * k, 100.0 - k]) for k in range(16)]
    assert two.fault is not None
    assert (two.fault.kind, two.fault.reason) == (FaultKind.LINK, "link lost for 10 s")
    assert (two.fault.detected_s, two.fault.happened_s) == (50.0, 40.0)
    assert (one.fault, three.fault) == (None, None)
    row = find_last_row(two, 50.0)
    assert row is not None
    assert two.track[row, 1:3] == pytest.approx([250.0, 0.0], abs=1e-3)
    assert three.pad_m == pytest.approx((0.0, 0.0), abs=1e-3)


def test_the_first_plan_begins_at_the_launch(tmp_path: Path) -> None:
    write_run(tmp_path)
    record = read_run(tmp_path)
    first = record.revisions[0]
    assert (first.number, first.decided_s) == (0, 0.0)
    one, two = first.routes
    assert (one.vehicle, one.segments) == ("uav1", (3, 4))
    assert np.array(one.energy) == pytest.approx(np.array([(0, 0), (60, 6), (80, 8), (140, 14)]), abs=1e-4)
    assert eastings_of(one) == pytest.approx([0, 400, 500, 500, 600, 0], abs=1e-3)
    assert (two.vehicle, two.segments) == ("uav2", (0, 1, 2))
    assert record.longest_route_s == pytest.approx(140.0, abs=1e-3)


def test_a_replan_begins_where_the_vehicles_took_it_up(tmp_path: Path) -> None:
    write_run(tmp_path)
    again = read_run(tmp_path).revisions[1]
    assert (again.number, again.decided_s) == (1, 51.0)
    one, three = again.routes
    # uav1 was at 500 m east after 60 s, with 6 % used; uav3 was seen in the air at 63 s, with 0.1 % used at most.
    assert np.array(one.energy) == pytest.approx(np.array([(60, 6), (80, 8), (120, 12), (150, 15)]), abs=1e-3)
    assert eastings_of(one) == pytest.approx([500, 500, 600, 400, 300, 0], abs=1e-3)
    assert [t_s for t_s, _ in three.energy] == pytest.approx([63, 103, 133], abs=1e-3)
    assert three.energy[0][1] == pytest.approx(0.0, abs=0.3)


def test_a_route_that_never_came_on_board_is_none(tmp_path: Path) -> None:
    write_run(tmp_path, finished=False)
    record = read_run(tmp_path)
    assert [route.vehicle for route in record.revisions[1].routes] == ["uav1"]
    assert [(segment.id, segment.inspected_s) for segment in record.uncovered_segments] == [(1, None)]


def test_what_the_lost_vehicle_left(tmp_path: Path) -> None:
    write_run(tmp_path)
    left = find_abandoned_segments(read_run(tmp_path))
    assert [(segment.id, left_by, segment.inspected_by) for segment, left_by in left] == [
        (1, "uav2", "uav3"), (2, "uav2", "uav1"),
    ]  # fmt: skip


def test_decisions_are_the_operators_lines(tmp_path: Path) -> None:
    write_run(tmp_path)
    decisions = read_run(tmp_path).decisions
    assert [(one.t_s, one.level, one.text) for one in decisions] == [
        (50.0, Level.FAULT, "uav2: lost, silent for 10 s <again>"),
        (150.0, Level.INFO, "uav1: landed with 85 %"),
    ]


@pytest.mark.parametrize("torn", ['{"t_s":210.0,"said":"uav3: lan', '{"t_s":210.0,"event":{"kind":"Tick"'])
def test_a_torn_last_line_is_passed_over(tmp_path: Path, torn: str) -> None:
    write_run(tmp_path)
    whole = read_run(tmp_path)
    with (tmp_path / "events.jsonl").open("a", encoding="utf-8") as file:
        file.write(torn)
    again = read_run(tmp_path)
    assert (again.segments, again.decisions) == (whole.segments, whole.decisions)


def test_a_run_without_a_report_is_refused(tmp_path: Path) -> None:
    write_run(tmp_path)
    (tmp_path / "report.json").unlink()
    with pytest.raises(LogError, match=r"report\.json: cannot be read"):
        read_run(tmp_path)


def test_a_report_of_another_kind_is_refused(tmp_path: Path) -> None:
    write_run(tmp_path)
    text = (tmp_path / "report.json").read_text(encoding="utf-8")
    (tmp_path / "report.json").write_text(text.replace("faultline-report/1", "faultline-report/9"), encoding="utf-8")
    with pytest.raises(
        LogError, match=r"report\.json: format: expected 'faultline-report/1', got 'faultline-report/9'"
    ):
        read_run(tmp_path)


def test_a_log_without_a_launch_is_refused(tmp_path: Path) -> None:
    write_run(tmp_path)
    head = (tmp_path / "events.jsonl").read_text(encoding="utf-8").splitlines(keepends=True)[0]
    (tmp_path / "events.jsonl").write_text(head, encoding="utf-8")
    with pytest.raises(LogError, match="nothing was launched"):
        read_run(tmp_path)


def test_a_restart_is_no_charge() -> None:
    def accounted(*reports: float) -> list[float]:
        seconds = np.arange(len(reports), dtype=np.float64)
        return compute_used_pct(np.column_stack((seconds, reports)))[:, 1].tolist()  # type: ignore[no-any-return]

    # From 70 to 100 is a restart, from 90 to 91 the same pack that recovers.
    assert accounted(99.0, 70.0, 100.0, 97.0) == [0.0, 29.0, 29.0, 32.0]
    assert accounted(99.0, 90.0, 91.0, 88.0) == [0.0, 9.0, 8.0, 11.0]


@given(st.lists(st.floats(0.0, 100.0), min_size=1, max_size=30))
def test_what_falls_steadily_is_used_in_full(reports: list[float]) -> None:
    falling = np.array(sorted(reports, reverse=True))
    account = compute_used_pct(np.column_stack((np.arange(len(falling), dtype=np.float64), falling)))
    assert account[-1, 1] == pytest.approx(falling[0] - falling[-1])
    assert np.all(np.diff(account[:, 1]) >= 0.0)


def test_used_between_two_reports(tmp_path: Path) -> None:
    write_run(tmp_path)
    one = read_run(tmp_path).vehicles[0]
    assert draw_at_pct(one, 65.0) == pytest.approx(6.5)
    assert draw_at_pct(one, 1000.0) == pytest.approx(15.0)


def _track(east_m: list[float], alt_m: float = 30.0) -> np.ndarray[tuple[int, int], np.dtype[np.float64]]:
    seconds = np.arange(len(east_m), dtype=np.float64)
    return np.column_stack((seconds, east_m, np.zeros(len(east_m)), np.full(len(east_m), alt_m)))


def test_a_route_is_joined_at_the_first_pass() -> None:
    there_and_back = _track([0.0, 20.0, 40.0, 20.0, 0.0, 20.0])
    assert route_join_time_s(there_and_back, (20.0, 0.0), 0.0) == 1.0
    assert route_join_time_s(there_and_back, (20.0, 0.0), 2.0) == 3.0
    assert route_join_time_s(there_and_back, (21.0, 0.0), 3.5) == 5.0


def test_a_route_that_is_never_joined_begins_at_the_nearest() -> None:
    assert route_join_time_s(_track([0.0, 20.0, 40.0, 20.0]), (80.0, 0.0), 0.0) == 2.0
    assert route_join_time_s(_track([0.0, 20.0]), (80.0, 0.0), 7.0) == 7.0


def test_taking_off_is_being_seen_in_the_air() -> None:
    track = _track([0.0, 0.0, 0.0])
    track[:, 3] = [0.0, 0.4, 5.0]
    assert take_off_time_s(track, 0.0) == 2.0
    assert take_off_time_s(track, 2.5) == 2.5


def test_a_segment_flown_too_fast_was_not_inspected() -> None:
    line = Track(0, (0.0, 0.0), (100.0, 0.0))

    def flown(speed_m_s: float) -> float | None:
        samples = [
            (second + 0.25, PositionSample(float(second), (100.0 - speed_m_s * second, 0.0))) for second in range(60)
        ]
        return inspection_time_s(samples, line, corridor_m=10.0, speed_m_s=5.0)

    # Backwards at 4 m/s: 96 m after 24 s are within the tolerance of 5 m.
    assert flown(4.0) == 24.25
    assert flown(8.0) is None


def test_a_position_that_was_overtaken_changes_nothing() -> None:
    line = Track(0, (0.0, 0.0), (100.0, 0.0))
    samples = [(float(second), PositionSample(float(second), (5.0 * second, 0.0))) for second in range(30)]
    late = [*samples[:10], (10.5, PositionSample(2.0, (10.0, 80.0))), *samples[10:]]
    assert inspection_time_s(late, line, corridor_m=10.0, speed_m_s=5.0) == 19.0


def test_a_day_has_all_its_sorties(tmp_path: Path) -> None:
    write_run(tmp_path)
    assert read_run(tmp_path).sorties == ()
    write_plan(tmp_path / "day-plan.json", between_bases()[1])
    record = read_run(tmp_path)
    out, back = record.sorties
    assert [(one.vehicle, one.segments) for one in (out, back)] == [
        ("uav1", (0, 1, 2, 3, 4, 5)), ("uav1", (11, 10, 9, 8, 7, 6))
    ]  # fmt: skip
    west, east = (out.legs_m[0][0], out.legs_m[-1][-1])
    assert (back.legs_m[0][0], back.legs_m[-1][-1]) == (east, west)
    assert east[0] - west[0] == pytest.approx(1300.0, abs=50.0)
    assert [len(one.legs_m) for one in (out, back)] == [13, 13]
    assert [one.energy[0] for one in (out, back)] == [(0.0, 0.0), (1800.0, 0.0)]
    assert record.planned_for == dict.fromkeys(range(12), "uav1")
    assert record.first_words == "first sorties"


def test_what_a_lost_vehicle_had_on_a_later_sortie_was_left_by_it(tmp_path: Path) -> None:
    write_run(tmp_path)
    record = read_run(tmp_path)
    first = record.revisions[0].routes
    later = replace(first[0], vehicle="uav2", segments=(3, 4))  # uav1 has inspected them
    day = replace(record, sorties=(*first[1:], later))
    assert [(one.id, name) for one, name in find_abandoned_segments(day)] == [
        (segment, "uav2") for segment in (1, 2, 3, 4)
    ]
