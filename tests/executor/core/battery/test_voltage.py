"""Voltages in figures, report by report."""

from __future__ import annotations

from collections.abc import Callable

import pytest

from executor.core.battery import voltage
from executor.core.battery.voltage import Report, Thresholds, VoltageState
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
]


@pytest.mark.parametrize(("what", "found", "expected"), ROWS, ids=[row[0] for row in ROWS])
def test_everything_that_comes_of_it(what: str, found: Callable[[], object], expected: object) -> None:
    assert rounded(found()) == expected


def test_a_single_spike_makes_no_pack_of_more_cells() -> None:
    """Recorded: one report of 13.4 V at rest between hundreds of 12.2 V, and 3.04 V a cell ever since."""
    spiked = volted((1.0, 12.2, 0.4), (1.0, 13.4, 0.4), (1.0, 12.2, 0.4))
    assert spiked.cells == 3
    assert volted((1.0, 13.4, 0.4), (1.0, 13.4, 0.4)).cells == 4
