"""Inspections in figures, position by position."""

from __future__ import annotations

from collections.abc import Callable

import pytest

from executor.core.state import inspection_proof
from executor.core.state.inspection_proof import InspectionRun, PositionSample, SegmentPass, Track, _RunStatistics
from tests.executor.core.steps import rounded

LINE = Track(3, (10.0, 20.0), (70.0, 100.0))


def on_line(along_m: float, beside_m: float) -> tuple[float, float]:
    return 10.0 + 0.6 * along_m - 0.8 * beside_m, 20.0 + 0.8 * along_m + 0.6 * beside_m


def along(*samples: tuple[float, float, float], speed_m_s: float = 5.0) -> list[object]:
    """Return what came of (seconds, metres along, metres beside), one after the other."""
    run, found = None, list[object]()
    for t_s, along_m, beside_m in samples:
        step = inspection_proof.advance_run(
            run, LINE, PositionSample(t_s, on_line(along_m, beside_m), speed_m_s), corridor_m=8.0, speed_m_s=5.0
        )
        run = step.run
        found.append(step.flown or step.broken or (None if run is None else (run.furthest_m, len(run.recent))))
    return found


ROWS: list[tuple[str, Callable[[], object], object]] = [
    (
        "an inspection",
        lambda: along(*[(float(t_s), 5.0 * t_s - 5.0, 1.0) for t_s in range(22)]),
        [
            (-5.0, 1),
            (0.0, 1),
            (5.0, 2),
            (10.0, 3),
            (15.0, 3),
            (20.0, 3),
            (25.0, 3),
            (30.0, 3),
            (35.0, 3),
            (40.0, 3),
            (45.0, 3),
            (50.0, 3),
            (55.0, 3),
            (60.0, 3),
            (65.0, 3),
            (70.0, 3),
            (75.0, 3),
            (80.0, 3),
            (85.0, 3),
            (90.0, 3),
            SegmentPass(mean_m_s=5.0, max_m_s=5.0, deviation_mean_m=1.0, deviation_max_m=1.0),
            None,
        ],
    ),
    ("an inspection that begins in the midst", lambda: along((0.0, 50.0, 0.0), (1.0, 55.0, 0.0)), [None, None]),
    (
        "an inspection that leaves the line",
        lambda: along((0.0, 0.0, 0.0), (2.0, 10.0, 7.9), (4.0, 20.0, 8.1)),
        [(0.0, 1), (10.0, 2), "8 m off the line"],
    ),
    (
        "an inspection with a gap",
        lambda: [
            along((0.0, 0.0, 0.0), (2.0, 10.0, 0.0), (2.0 + gap_s, 10.0 + 5.0 * gap_s, 0.0))[-1]
            for gap_s in (2.9, 3.0, 3.1, 5.0, 5.1)
        ],
        [(24.5, 2), (25.0, 2), (25.5, 2), (35.0, 2), "no position for 5.1 s"],
    ),
    (
        "an inspection that turns back",
        lambda: [
            along((0.0, 0.0, 0.0), (2.0, 10.0, 0.0), (4.0, 20.0, 0.0), (6.0, back_m, 0.0))[-1]
            for back_m in (12.1, 12.0, 11.9)
        ],
        [(20.0, 2), (20.0, 2), "turned back"],
    ),
    (
        "an inspection that is flown too fast",
        lambda: [
            along(*[(float(t_s), speed_m_s * t_s, 0.0) for t_s in range(12)])[-3:]
            for speed_m_s in (6.0, 6.4, 6.6, 7.5, 9.0)
        ],
        [
            [(54.0, 3), (60.0, 3), (66.0, 3)],
            [(57.6, 3), (64.0, 3), (70.4, 3)],
            [None, None, None],
            [None, None, None],
            [None, None, None],
        ],
    ),
    (
        "an inspection that waits at its first pylon",
        lambda: along((0.0, 0.0, 0.0), (5.0, 4.9, 0.0), (6.0, 10.0, 0.0)),
        [(0.0, 1), (4.9, 1), (10.0, 2)],
    ),
    (
        "position along a line",
        lambda: [
            (*LINE.locate(on_line(*place)), LINE.lateral_offset_m(on_line(*place)), LINE.length_m)
            for place in ((50.0, 3.0), (-4.0, 3.0), (112.0, -5.0), (0.0, 0.0))
        ],
        [(50.0, 3.0, 3.0, 100.0), (-4.0, 5.0, 3.0, 100.0), (112.0, 13.0, 5.0, 100.0), (0.0, 0.0, 0.0, 100.0)],
    ),
    (
        "an inspection whose speeds are not known",
        lambda: [
            along((0.0, 0.0, 0.0), *((4.0 * step, 20.0 * step, beside_m) for step in range(1, 6)))[-1]
            for beside_m in (0.0, 3.0)
        ],
        [
            SegmentPass(mean_m_s=5.0, max_m_s=5.0, deviation_mean_m=0.0, deviation_max_m=0.0),
            SegmentPass(mean_m_s=5.0, max_m_s=5.0, deviation_mean_m=2.5, deviation_max_m=3.0),
        ],
    ),
    ("an inspection of a moment", lambda: along((0.0, 0.0, 0.0), (0.0, 96.0, 0.0)), [(0.0, 1), "flown too fast"]),
    (
        "vehicles found on a line",
        lambda: inspection_proof.join_run(LINE, PositionSample(50.0, on_line(30.0, 2.0), 5.0), 5.0),
        InspectionRun(
            furthest_m=30.0,
            recent=((50.0, 30.0),),
            pace=_RunStatistics(
                began_s=44.0, began_m=0.0, fastest_m_s=5.0, aside_sum_m=2.0, aside_max_m=2.0, samples=1
            ),
        ),
    ),
]


@pytest.mark.parametrize(("what", "found", "expected"), ROWS, ids=[row[0] for row in ROWS])
def test_everything_that_comes_of_it(what: str, found: Callable[[], object], expected: object) -> None:
    assert rounded(found()) == expected
