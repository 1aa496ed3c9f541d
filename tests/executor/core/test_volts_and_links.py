"""Voltages, links and inspections in figures, report by report."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import pytest

from executor.core import coverage, link_quality
from executor.core.battery import voltage
from executor.core.battery.voltage import Report, Thresholds, VoltageState
from executor.core.coverage import Run, Sample, SegmentPass, Track, _Pace
from executor.core.link_quality import LinkQuality
from executor.core.messages import Radio, Traffic
from tests.executor.core.steps import rounded


def volted(
    *reports: tuple[float, float, float | None], flying: bool = True, cells_v: tuple[float, ...] = ()
) -> VoltageState:
    """Return a pack after reports of (seconds since the last, volts, amperes)."""
    state, now_s = VoltageState(), 100.0
    for elapsed_s, volts_v, current_a in reports:
        now_s += elapsed_s
        state = voltage.measured(
            state, Report(volts_v, current_a, cells_v), Thresholds(0.05, 3.5, 0.2), now_s, flying=flying
        )
    return state


def linked(*counts: tuple[float, int, int]) -> LinkQuality:
    """Return a link after counts of (seconds since the last, frames that came, frames that did not)."""
    state, now_s = LinkQuality(), 100.0
    for elapsed_s, came, lost in counts:
        now_s += elapsed_s
        state = link_quality.with_traffic(state, Traffic(came, lost), now_s, 12.0)
    return state


LINE = Track(3, (10.0, 20.0), (70.0, 100.0))


def on_line(along_m: float, beside_m: float) -> tuple[float, float]:
    return 10.0 + 0.6 * along_m - 0.8 * beside_m, 20.0 + 0.8 * along_m + 0.6 * beside_m


def along(*samples: tuple[float, float, float], speed_m_s: float = 5.0) -> list[object]:
    """Return what came of (seconds, metres along, metres beside), one after the other."""
    run, found = None, list[object]()
    for t_s, along_m, beside_m in samples:
        step = coverage.follow(
            run, LINE, Sample(t_s, on_line(along_m, beside_m), speed_m_s), corridor_m=8.0, speed_m_s=5.0
        )
        run = step.run
        found.append(step.flown or step.broken or (None if run is None else (run.furthest_m, len(run.recent))))
    return found


def radio(**given: Any) -> Radio:
    return replace(Radio(80, 60, 20, 20, 90), **given)


ROWS: list[tuple[str, Callable[[], object], object]] = [
    (
        "a voltage under load",
        lambda: volted(*[(1.0, 15.0 - 0.01 * step, 10.0) for step in range(15)]),
        VoltageState(
            reported_s=115.0,
            voltage_v=14.86,
            highest_v=15.0,
            began_s=101.0,
            usual_v=14.9106,
            usual_a=10.0,
            drop=0.00356351,
            known_load=True,
        ),
    ),
    ("a voltage before it has settled", lambda: volted((1.0, 15.0, 10.0), (7.9, 15.0, 10.0)).usual_v, None),
    ("a voltage that has settled", lambda: volted((1.0, 15.0, 10.0), (8.0, 15.0, 10.0)).usual_v, 15.0),
    (
        "a voltage on the ground",
        lambda: volted((1.0, 15.0, 10.0), (9.0, 14.0, 10.0), flying=False),
        VoltageState(reported_s=110.0, voltage_v=14.0, highest_v=15.0, known_load=True),
    ),
    (
        "a voltage that drops",
        lambda: [volted((1.0, 15.0, 10.0), (9.0, 15.0, 10.0), (1.0, volts_v, 10.0)) for volts_v in (14.63, 14.62)],
        [
            VoltageState(
                reported_s=111.0,
                voltage_v=14.63,
                highest_v=15.0,
                began_s=101.0,
                usual_v=14.982,
                usual_a=10.0,
                drop=0.0246667,
                known_load=True,
            ),
            VoltageState(
                reported_s=111.0,
                voltage_v=14.62,
                highest_v=15.0,
                began_s=101.0,
                usual_v=15.0,
                usual_a=10.0,
                drop=0.0253333,
                dropped_s=111.0,
                known_load=True,
            ),
        ],
    ),
    (
        "a voltage that drops under a greater load",
        lambda: [
            volted((1.0, 15.0, 10.0), (9.0, 15.0, 10.0), (1.0, 14.2, current_a)).drop
            for current_a in (10.0, 20.0, 30.0, 40.0, 0.0, None)
        ],
        [0.0533333, 0.0249333, -0.00346667, -0.00346667, 0.0533333, 0.0533333],
    ),
    (
        "a voltage that stays low becomes usual",
        lambda: [
            volted((1.0, 15.0, None), (9.0, 15.0, None), (1.0, 14.0, None), (after_s, 14.0, None))
            for after_s in (59.9, 60.0)
        ],
        [
            VoltageState(
                reported_s=170.9,
                voltage_v=14.0,
                highest_v=15.0,
                began_s=101.0,
                usual_v=15.0,
                drop=0.0666667,
                dropped_s=111.0,
            ),
            VoltageState(reported_s=171.0, voltage_v=14.0, highest_v=15.0, began_s=101.0, usual_v=14.0, drop=0.0666667),
        ],
    ),
    (
        "a load that is known later",
        lambda: volted((1.0, 15.0, None), (9.0, 15.0, None), (2.0, 14.9, 12.0), (2.0, 14.9, 14.0)),
        VoltageState(
            reported_s=114.0,
            voltage_v=14.9,
            highest_v=15.0,
            began_s=101.0,
            usual_v=14.9819,
            usual_a=12.1903,
            drop=0.00106626,
            known_load=True,
        ),
    ),
    (
        "weak cells",
        lambda: [volted((1.0, volts_v, None), (2.0, volts_v, None)).low_since_s for volts_v in (14.1, 14.0, 13.9)],
        [None, None, 101.0],
    ),
    (
        "cells that are told apart",
        lambda: [
            (state.cells, state.weakest_v, state.spread_v, state.spread_since_s, state.low_since_s)
            for cells_v in ((3.9, 3.9, 3.6), (3.9, 3.9, 3.7), (3.4, 3.5), (3.4,))
            for state in (volted((1.0, sum(cells_v), None), cells_v=cells_v),)
        ],
        [(3, 3.6, 0.3, 101.0, None), (3, 3.7, 0.2, None, None), (2, 3.4, 0.1, None, 101.0), (1, 3.4, 0.0, None, 101.0)],
    ),
    (
        "how many cells there are",
        lambda: [VoltageState(highest_v=volts_v).cells for volts_v in (0.0, 4.4, 4.5, 16.8, 17.7)],
        [1, 1, 2, 4, 5],
    ),
    ("no voltage, no cell", lambda: VoltageState().weakest_v, None),
    (
        "a link that loses little",
        lambda: linked(*[(1.0, 10, 0)] * 5, (1.0, 10, 2)),
        LinkQuality(
            window=((101.0, 10, 0), (102.0, 10, 0), (103.0, 10, 0), (104.0, 10, 0), (105.0, 10, 0), (106.0, 10, 2)),
            lost=0.0322581,
            usual=0.000533179,
        ),
    ),
    (
        "a link that loses much for a while",
        lambda: linked(*[(1.0, 10, 0)] * 5, *[(10.0, 20, 20)] * 3),
        LinkQuality(window=((125.0, 20, 20), (135.0, 20, 20)), lost=0.5, usual=0.178401),
    ),
    (
        "a link that gets better",
        lambda: linked(*[(1.0, 10, 10)] * 5, *[(1.0, 40, 0)] * 2),
        LinkQuality(
            window=(
                (101.0, 10, 10),
                (102.0, 10, 10),
                (103.0, 10, 10),
                (104.0, 10, 10),
                (105.0, 10, 10),
                (106.0, 40, 0),
                (107.0, 40, 0),
            ),
            lost=0.277778,
            usual=0.277778,
        ),
    ),
    ("a link of few frames", lambda: [linked((1.0, 19, 0)).lost, linked((1.0, 19, 1)).lost], [None, 0.05]),
    (
        "what is counted of a link",
        lambda: [len(linked((1.0, 19, 0), (after_s, 1, 0)).window) for after_s in (11.9, 12.0)],
        [2, 1],
    ),
    (
        "how much worse a link is",
        lambda: [
            LinkQuality(lost=lost, usual=usual).worse
            for lost, usual in ((None, 0.1), (0.1, None), (0.3, 0.1), (0.1, 0.3), (1.0, 0.98))
        ],
        [0.0, 0.0, 0.222222, 0.0, 0.4],
    ),
    (
        "what a radio complains of",
        lambda: [
            LinkQuality(radio=one).weak
            for one in (
                None,
                radio(),
                radio(rssi=30),
                radio(rssi=29),
                radio(remote_rssi=29),
                radio(free_buffer_pct=20),
                radio(free_buffer_pct=19),
                radio(free_buffer_pct=None),
                radio(rssi=None, noise=None, remote_rssi=None, remote_noise=None),
            )
        ],
        [
            "",
            "",
            "",
            "radio signal 29 over noise 20 here",
            "radio signal 29 over noise 20 at the vehicle",
            "",
            "radio buffer 19 % free",
            "",
            "",
        ],
    ),
    (
        "a radio",
        lambda: link_quality.heard_radio(linked((1.0, 30, 1)), radio(), 130.0),
        LinkQuality(
            window=((101.0, 30, 1),),
            lost=0.0322581,
            usual=0.0322581,
            radio=Radio(rssi=80, remote_rssi=60, noise=20, remote_noise=20, free_buffer_pct=90),
            radio_s=130.0,
        ),
    ),
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
        [(0.0, 1), (10.0, 2), "8 m beside the line"],
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
        "where a place lies on a line",
        lambda: [
            (*LINE.locate(on_line(*place)), LINE.aside_m(on_line(*place)), LINE.length_m)
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
        "who is found on a line",
        lambda: coverage.run_joined(LINE, Sample(50.0, on_line(30.0, 2.0), 5.0), 5.0),
        Run(
            furthest_m=30.0,
            recent=((50.0, 30.0),),
            pace=_Pace(began_s=44.0, began_m=0.0, fastest_m_s=5.0, aside_sum_m=2.0, aside_max_m=2.0, samples=1),
        ),
    ),
]


@pytest.mark.parametrize(("what", "found", "expected"), ROWS, ids=[row[0] for row in ROWS])
def test_everything_that_comes_of_it(what: str, found: Callable[[], object], expected: object) -> None:
    assert rounded(found()) == expected
