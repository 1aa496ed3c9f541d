"""Voltages in figures, report by report."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import pytest

from executor.core.battery import voltage
from executor.core.battery.voltage import SagEstimate, VoltageReport, VoltageState, update_sag
from executor.core.fault_thresholds import Limits
from tests.executor.core.steps import rounded

LIMITS = Limits(voltage_step=0.05, voltage_step_blind=0.05, cell_low_v=3.1, cell_spread_v=0.2)


def volted(
    *reports: tuple[float, float, float | None], flying: bool = True, cells_v: tuple[float, ...] = ()
) -> VoltageState:
    """Return a pack after reports of (seconds since the last, volts, amperes)."""
    state, now_s = VoltageState(), 100.0
    for elapsed_s, volts_v, current_a in reports:
        now_s += elapsed_s
        state = voltage.apply_voltage_report(
            state, VoltageReport(volts_v, current_a, cells_v), replace(LIMITS, cell_low_v=3.5), now_s, flying=flying
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
            usual_ohm=(0.04458, 0.13374),
            expected_v=14.9131,
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
                usual_ohm=(0.04389, 0.13167),
                expected_v=15.0,
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
                usual_ohm=(0.045, 0.135),
                expected_v=15.0,
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
        [0.0533333, -0.0366667, -0.126667, -0.216667, 0.0533333, 0.0533333],
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
                expected_v=15.0,
                drop=0.0666667,
                dropped_s=111.0,
            ),
            VoltageState(
                reported_s=171.0,
                voltage_v=14.0,
                highest_v=15.0,
                began_s=101.0,
                usual_v=14.0,
                expected_v=15.0,
                drop=0.0666667,
            ),
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
            usual_ohm=(0.03725, 0.11175),
            expected_v=14.767,
            drop=-0.00887338,
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
        "number of cells",
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


HOVERS_A, FULL_A = 20.0, 58.0


def flown(
    seconds: range, *, ohm: float = 0.05, lost_v: float = 0.0, load_a: float = HOVERS_A,
    state: VoltageState | None = None, known: SagEstimate | None = None,
) -> tuple[VoltageState, SagEstimate | None]:  # fmt: skip
    """Fly on with a pack of four cells, of which one may fail; its take-off has shown its resistance."""
    state = state or VoltageState()
    for second in seconds:
        flies = second >= 10
        current_a = load_a if flies else 0.5
        rest_v = 16.4 - 0.001 * second - lost_v
        report = VoltageReport(rest_v - ohm * current_a, current_a)
        state = voltage.apply_voltage_report(state, report, LIMITS, float(second), flying=flies, sag=known)
        known = update_sag(known, report.voltage_v, current_a, float(second))
    return state, known


@pytest.mark.parametrize("ohm", [0.01, 0.05, 0.09])
def test_full_throttle_is_what_the_packs_own_resistance_makes_of_it(ohm: float) -> None:
    state, known = flown(range(60), ohm=ohm)
    for _ in range(8):
        state, known = flown(range(60, 68), ohm=ohm, load_a=FULL_A, state=state, known=known)
        assert state.dropped_s is None, state


@pytest.mark.parametrize("ohm", [0.01, 0.05, 0.09])
@pytest.mark.parametrize("load_a", [HOVERS_A, 1.1 * HOVERS_A])
def test_a_cell_that_fails_is_no_load(ohm: float, load_a: float) -> None:
    """A cell that gives a volt less lets the motors draw more by the same share: that explains next to nothing."""
    state, known = flown(range(60), ohm=ohm)
    for second in range(60, 75):
        state, known = flown(range(second, second + 1), ohm=ohm, lost_v=1.4, load_a=load_a, state=state, known=known)
        assert state.drop > 0.05, second


def test_a_resistance_does_not_grow_by_what_a_failing_cell_takes() -> None:
    state, known = flown(range(60))
    before = state.usual_ohm
    assert before is not None
    assert before[0] < 0.05 < before[1]
    state, _ = flown(range(60, 90), lost_v=1.4, load_a=1.2 * HOVERS_A, state=state, known=known)
    assert state.usual_ohm == before
    assert state.dropped_s == 60.0


def test_where_no_load_has_changed_an_aged_pack_is_believed() -> None:
    """The first reports of a log that begins in the air say nothing of the resistance."""
    state = volted(*[(1.0, 15.0, 20.0)] * 20, (1.0, 13.7, 55.0))
    assert state.dropped_s is None
    assert volted(*[(1.0, 15.0, 20.0)] * 20, (1.0, 13.7, 21.0)).dropped_s is not None


def test_a_current_that_no_motor_draws_explains_no_more_than_full_throttle() -> None:
    steady = [(1.0, 15.0, 10.0)] * 20
    assert volted(*steady, (1.0, 5.0, 80.0)).drop == volted(*steady, (1.0, 5.0, 900.0)).drop
