"""The voltage of a pack under load: a step against what is usual, and cells near their end.

A pack's voltage falls slowly as it empties, by load, and at once when a cell or a connection fails. Half a minute of
flight says what is usual; what the present current explains by the pack's own resistance, which its take-off has shown
(`sag`), is taken out where the current is known. What is doubtful of that resistance speaks for the pack: a true step
comes with hardly more current, so that it costs little.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

from executor.core.battery.resting_voltage import least_cell_count
from executor.core.battery.voltage_sag import POLARISED, SagEstimate
from executor.core.limits import Limits

SETTLE_S = 8.0
"""After the take-off: until then the voltage falls by the load itself."""
USUAL_S = 20.0
SAG, WORST_SAG = 0.03, 0.09
"""Share of the voltage that hovering costs (12.6 to 12.26 V recorded), and that of a cold or aged pack: in proportion
the current explains, as long as no change of the load has shown the resistance."""
SURE = 0.5
"""A resistance whose deviation is a larger share of it is not known yet."""
DOUBT_SD = 2.0
MOST_LOAD = 8.0
"""Times the usual current that explain anything: full throttle with a thrust of four times the weight. More is a sensor
that is off."""
CALM = 0.5
"""Below this share of the threshold the usual voltage follows."""
GIVES_UP_S = 60.0
"""A step that lasts this long is the new usual."""


@dataclass(frozen=True, slots=True)
class VoltageState:
    """One vehicle's voltage since its last start."""

    reported_s: float = float("-inf")
    voltage_v: float | None = None
    highest_v: float = 0.0
    """Since it was first heard, which tells how many cells there are."""
    began_s: float | None = None
    """When it was first heard in the air."""
    usual_v: float | None = None
    usual_a: float | None = None
    usual_ohm: tuple[float, float] | None = None
    """What the load costs: at least, and at most."""
    expected_v: float | None = None
    """Under the present load."""
    drop: float = 0.0
    """Share of the usual voltage that is missing now, beyond what the current explains."""
    dropped_s: float | None = None
    """Since when the drop is no noise."""
    known_load: bool = False
    low_since_s: float | None = None
    """Since when a cell is near its end."""
    cells_v: tuple[float, ...] = ()
    set_cells: int | None = None
    """How many there are in series by a parameter, or by the site file."""
    spread_since_s: float | None = None
    """Since when one cell lies below the others."""

    @property
    def cells(self) -> int:
        """How many there are in series; at least, where nobody says it."""
        return len(self.cells_v) or self.set_cells or least_cell_count(self.highest_v)

    @property
    def weakest_v(self) -> float | None:
        """Voltage of the weakest cell, or of the mean one where they are not told apart."""
        if self.cells_v:
            return min(self.cells_v)
        return None if self.voltage_v is None else self.voltage_v / self.cells

    @property
    def spread_v(self) -> float:
        """How far the weakest cell lies below the mean of the others."""
        if len(self.cells_v) < 2:
            return 0.0
        weakest = min(self.cells_v)
        return (sum(self.cells_v) - weakest) / (len(self.cells_v) - 1) - weakest


@dataclass(frozen=True, slots=True)
class VoltageReport:
    """What a vehicle says of its voltage."""

    voltage_v: float
    current_a: float | None = None
    cells_v: tuple[float, ...] = ()


def apply_voltage_report(
    state: VoltageState, report: VoltageReport, limits: Limits, now_s: float, *, flying: bool,
    sag: SagEstimate | None = None
) -> VoltageState:  # fmt: skip
    """Take a report; `sag` is what was known of the pack before it."""
    elapsed_s = now_s - state.reported_s
    state = replace(
        state,
        reported_s=now_s,
        voltage_v=report.voltage_v,
        # Of two reports the lower one: a single spike of 13.4 V made a pack of three cells one of four.
        highest_v=max(state.highest_v, min(report.voltage_v, state.voltage_v or report.voltage_v)),
        cells_v=report.cells_v,
        known_load=report.current_a is not None and report.current_a > 0.0,
    )
    if not flying:
        return replace(
            state, began_s=None, usual_v=None, usual_a=None, usual_ohm=None, expected_v=None, drop=0.0, dropped_s=None,
            low_since_s=None, spread_since_s=None,
        )  # fmt: skip
    if state.began_s is None:
        state = replace(state, began_s=now_s)
    weakest = state.weakest_v
    low = weakest is not None and weakest < limits.cell_low_v
    state = replace(
        state,
        low_since_s=_track_onset(state.low_since_s, now_s, holds=low),
        spread_since_s=_track_onset(state.spread_since_s, now_s, holds=state.spread_v > limits.cell_spread_v),
    )
    if state.began_s is None or now_s - state.began_s < SETTLE_S:
        return state
    return _compare_with_usual(state, report, limits, now_s, elapsed_s, sag)


def _compare_with_usual(
    state: VoltageState, report: VoltageReport, limits: Limits, now_s: float, elapsed_s: float,
    sag: SagEstimate | None
) -> VoltageState:  # fmt: skip
    current = report.current_a if state.known_load else None
    if state.usual_v is None:
        return replace(state, usual_v=report.voltage_v, usual_a=current, usual_ohm=_ohm(state, report, sag))
    usual_v = expected_v = state.usual_v
    if current is not None and state.usual_a and state.usual_ohm is not None:
        more_a = min(current, MOST_LOAD * state.usual_a) - state.usual_a
        expected_v -= more_a * state.usual_ohm[more_a > 0]
    drop = (expected_v - report.voltage_v) / usual_v
    state = replace(state, drop=drop, expected_v=expected_v)
    step = limits.voltage_step if state.known_load else limits.voltage_step_blind
    dropped_s = _track_onset(state.dropped_s, now_s, holds=drop > CALM * step)
    if dropped_s is not None and now_s - dropped_s < GIVES_UP_S:
        return replace(state, dropped_s=dropped_s)
    follow = 1.0 - math.exp(-elapsed_s / USUAL_S) if dropped_s is None else 1.0
    usual_a = state.usual_a
    if current is not None:
        usual_a = current if usual_a is None else usual_a + (current - usual_a) * follow
    usual_v += (report.voltage_v - usual_v) * follow
    # While it is dropped the resistance stays what it was: a cell that fails must not become one.
    return replace(state, dropped_s=None, usual_v=usual_v, usual_a=usual_a, usual_ohm=_ohm(state, report, sag))


def _ohm(state: VoltageState, report: VoltageReport, sag: SagEstimate | None) -> tuple[float, float] | None:
    """Return between which resistances the pack's own lies; None where no current says anything."""
    if not state.known_load:
        return None
    if sag is not None and sag.ohm > 0 and sag.ohm_sd < SURE * sag.ohm:
        doubt_ohm = DOUBT_SD * sag.ohm_sd
        # Ions lag behind a load, and behind its end.
        return max(0.0, sag.ohm - doubt_ohm) * (1 - POLARISED), (sag.ohm + doubt_ohm) * (1 + POLARISED)
    usual_a = state.usual_a or report.current_a or 1.0
    return SAG * report.voltage_v / usual_a, WORST_SAG * report.voltage_v / usual_a


def _track_onset(since_s: float | None, now_s: float, *, holds: bool) -> float | None:
    if not holds:
        return None
    return now_s if since_s is None else since_s
