"""What a flight was, read off small arrays: batteries, tracks, inspections and what was given away."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from executor.analysis import flight_record as recorded
from executor.analysis.documents import FaultRow
from executor.analysis.flight_record import (
    FlightRecord,
    PlannedRoute,
    PlanRevision,
    SegmentRecord,
    VehicleRecord,
)
from executor.core.state.inspection_proof import PositionSample, Track
from executor.core.state.vehicle_state import FaultKind
from missions.geo import FloatArray
from tests.executor.core.steps import rounded
from tests.executor.core.vehicles import NOW_S

PACK = np.array([[0.0, 100.0], [10.0, 98.0], [20.0, 99.0], [30.0, 60.0], [40.0, 80.0], [50.0, 100.1], [60.0, 100.0]])
TRACK = np.array([[0.0, 0.0, 0.0, 0.0], [10.0, 0.0, 0.0, 1.0], [20.0, 30.0, 0.0, 1.1], [30.0, 60.0, 40.0, 20.0]])
NOTHING = np.empty((0, 4))


def vehicle_of(
    name: str = "uav1", battery: FloatArray = PACK, track: FloatArray = TRACK, **given: Any
) -> VehicleRecord:
    by_gps = np.zeros(len(track), dtype=np.bool_)
    record = VehicleRecord(name, 0, (0.0, 0.0), 75.0, 15.0, track, battery, None, track[:, 3], by_gps)
    return replace(record, **given)


def passing(*places: tuple[float, float, float]) -> FloatArray:
    """Return a track through (seconds, metres east, metres north)."""
    return np.array([(t_s, east_m, north_m, 20.0) for t_s, east_m, north_m in places])


def joins(after_s: float, *places: tuple[float, float, float]) -> float:
    return recorded.route_join_time_s(passing(*places) if places else NOTHING, (100.0, 0.0), after_s)


def inspected(*samples: tuple[float, float], speed_m_s: float = 5.0) -> float | None:
    """Return when a line of 100 m was flown by a vehicle that is at (its own seconds, metres along)."""
    line = Track(3, (0.0, 0.0), (100.0, 0.0))
    seen = ((boot_s + 1000.0, PositionSample(boot_s, (along_m, 1.0), speed_m_s)) for boot_s, along_m in samples)
    return recorded.inspection_time_s(seen, line, corridor_m=8.0, speed_m_s=5.0)


THERE = tuple((3.0 * step, 15.0 * step) for step in range(8))


def lost(name: str, at_s: float) -> VehicleRecord:
    return vehicle_of(
        name, fault=FaultRow(vehicle=name, kind=FaultKind.LINK, reason="why", detected_s=at_s, happened_s=None)
    )


def planned(number: int, decided_s: float, **routes: tuple[int, ...]) -> PlanRevision:
    return PlanRevision(
        number,
        decided_s,
        tuple(
            PlannedRoute(name, segments, (), ((0.0, 0.0), (50.0 + number, 9.0))) for name, segments in routes.items()
        ),
    )


def segment(number: int, by: str | None) -> SegmentRecord:
    return SegmentRecord(number, (0.0, 0.0), (1.0, 0.0), by, None if by is None else 5.0, "mast" if number == 2 else "")


FLIGHT = FlightRecord(
    (segment(1, "uav1"), segment(2, "uav2"), segment(3, None), segment(4, "uav3")),
    (lost("uav1", 60.0), lost("uav2", 40.0), vehicle_of("uav3")),
    (planned(0, 0.0, uav1=(1, 3), uav2=(2, 4)), planned(1, 60.0, uav1=(4,), uav3=(3,)), planned(2, 60.1, uav3=(2,))),
    (), 99.0, 0.0,
)  # fmt: skip


ROWS: list[tuple[str, Callable[[], object], object]] = [
    (
        "energy used from a battery",
        lambda: recorded.compute_used_pct(PACK).tolist(),
        [[0.0, 0.0], [10.0, 2.0], [20.0, 1.0], [30.0, 40.0], [40.0, 20.0], [50.0, 20.0], [60.0, 20.1]],
    ),
    (
        "a battery that is full again",
        lambda: [
            recorded.compute_used_pct(np.array([[0.0, 50.0], [1.0, percent], [2.0, percent - 5.0]])).tolist()[-1]
            for percent in (70.0, 70.1)
        ],
        [[2.0, -15.0], [2.0, 5.0]],
    ),
    (
        "energy used from a battery up to a time",
        lambda: [recorded.draw_at_pct(vehicle_of(), t_s) for t_s in (-5.0, 0.0, 5.0, 25.0, 99.0)],
        [0.0, 0.0, 1.0, 20.5, 20.1],
    ),
    ("a battery that never reported", lambda: recorded.draw_at_pct(vehicle_of(battery=np.empty((0, 2))), 5.0), 0.0),
    (
        "last position",
        lambda: [recorded.find_last_row(vehicle_of(), t_s) for t_s in (-0.1, 0.0, 19.9, 20.0, 99.0)],
        [None, 0, 1, 2, 3],
    ),
    (
        "time of take-off",
        lambda: [recorded.take_off_time_s(TRACK, after_s) for after_s in (0.0, 20.0, 20.1, 30.0, 30.1)],
        [20.0, 20.0, 30.0, 30.0, 30.1],
    ),
    (
        "time of joining a route",
        lambda: [
            joins(
                after_s,
                (0.0, 0.0, 0.0),
                (10.0, 91.0, 0.0),
                (20.0, 99.0, 0.0),
                (30.0, 105.0, 0.0),
                (40.0, 120.0, 0.0),
                (50.0, 100.0, 0.0),
            )
            for after_s in (0.0, 20.0, 20.1, 41.0)
        ],
        [20.0, 20.0, 30.0, 50.0],
    ),
    (
        "time of coming near enough to a route",
        lambda: [
            joins(0.0, (0.0, 0.0, 0.0), (10.0, 100.0, north_m), (20.0, 150.0, 50.0), (30.0, 100.0, 1.0))
            for north_m in (10.0, 10.1)
        ],
        [10.0, 30.0],
    ),
    (
        "time of joining a route it never comes near",
        lambda: joins(0.0, (0.0, 0.0, 0.0), (10.0, 70.0, 40.0), (20.0, 150.0, 5.0)),
        10.0,
    ),
    (
        "time of joining a route after the end of its record",
        lambda: [joins(5.0), joins(35.0, (0.0, 0.0, 0.0))],
        [5.0, 35.0],
    ),
    (
        "time of joining a route it was on from the start",
        lambda: joins(0.0, (0.0, 100.0, 0.0), (10.0, 200.0, 0.0)),
        0.0,
    ),
    ("time a line was flown", lambda: inspected(*THERE), NOW_S + 21.0),
    (
        "time a line was flown in the other direction",
        lambda: inspected(*((t_s, 100.0 - along_m) for t_s, along_m in THERE)),
        NOW_S + 21.0,
    ),
    ("a line not flown", lambda: inspected(*THERE[:6]), None),
    (
        "positions that were overtaken",
        lambda: [inspected(*THERE[:4], (9.0 - back_s, 60.0), *THERE[4:]) for back_s in (0.0, 5.0)],
        [NOW_S + 21.0, NOW_S + 21.0],
    ),
    (
        "positions after a clock began anew",
        lambda: [
            inspected(
                *((t_s + 100.0, along_m) for t_s, along_m in THERE[:4]),
                *((t_s + 109.0 - back_s, along_m) for t_s, along_m in THERE),
            )
            for back_s in (59.9, 60.0, 90.0)
        ],
        [None, None, None],
    ),
    (
        "segments given up",
        lambda: [(segment.id, left_by) for segment, left_by in recorded.find_abandoned_segments(FLIGHT)],
        [(4, "uav1")],
    ),
    (
        "vehicles lost",
        lambda: [(one.name, fault.detected_s) for one, fault in FLIGHT.losses],
        [("uav2", 40.0), ("uav1", 60.0)],
    ),
    ("segments left over", lambda: [one.display_name for one in FLIGHT.uncovered_segments], ["3"]),
    ("names of segments", lambda: [one.display_name for one in FLIGHT.segments], ["1", "mast", "3", "4"]),
    (
        "the longest route of the first plan",
        lambda: [FLIGHT.longest_route_s, replace(FLIGHT, revisions=(planned(0, 0.0),)).longest_route_s],
        [50.0, 0.0],
    ),
]


@pytest.mark.parametrize(("what", "found", "expected"), ROWS, ids=[row[0] for row in ROWS])
def test_everything_that_comes_of_it(what: str, found: Callable[[], object], expected: object) -> None:
    assert rounded(found()) == expected
