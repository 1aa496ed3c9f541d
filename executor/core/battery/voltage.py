"""The voltage of a pack under load: a step against what is usual, and cells near their end.

A pack's voltage falls slowly as it empties, by load, and at once when a cell or a connection fails. Half a minute of
flight says what is usual; what the present current explains is taken out where the current is known.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

from executor.core.battery.resting import least_cells

SETTLE_S = 8.0
"""After the take-off: until then the voltage falls by the load itself."""
USUAL_S = 20.0
SAG = 0.03
"""Share of the voltage that hovering costs (12.6 to 12.26 V recorded): what the current explains is in proportion."""
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
        return len(self.cells_v) or self.set_cells or least_cells(self.highest_v)

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
class Report:
    """What a vehicle says of its voltage."""

    voltage_v: float
    current_a: float | None = None
    cells_v: tuple[float, ...] = ()


@dataclass(frozen=True, slots=True)
class Thresholds:
    """What is too much."""

    step: float
    low_v: float
    spread_v: float


def measured(state: VoltageState, report: Report, limits: Thresholds, now_s: float, *, flying: bool) -> VoltageState:
    """Take a report."""
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
        return replace(state, began_s=None, usual_v=None, usual_a=None, drop=0.0, dropped_s=None, low_since_s=None,
                       spread_since_s=None)  # fmt: skip
    if state.began_s is None:
        state = replace(state, began_s=now_s)
    weakest = state.weakest_v
    low = weakest is not None and weakest < limits.low_v
    state = replace(
        state,
        low_since_s=_since(state.low_since_s, now_s, holds=low),
        spread_since_s=_since(state.spread_since_s, now_s, holds=state.spread_v > limits.spread_v),
    )
    if state.began_s is None or now_s - state.began_s < SETTLE_S:
        return state
    return _compared(state, report, limits, now_s, elapsed_s)


def _compared(state: VoltageState, report: Report, limits: Thresholds, now_s: float, elapsed_s: float) -> VoltageState:
    current = report.current_a if state.known_load else None
    if state.usual_v is None:
        return replace(state, usual_v=report.voltage_v, usual_a=current)
    load = 1.0
    if current is not None and state.usual_a:
        load = min(3.0, current / state.usual_a)  # a sensor that is off explains only so much
    drop = 1.0 - report.voltage_v * (1.0 + SAG * (load - 1.0)) / state.usual_v
    dropped_s = _since(state.dropped_s, now_s, holds=drop > CALM * limits.step)
    if dropped_s is not None and now_s - dropped_s < GIVES_UP_S:
        return replace(state, drop=drop, dropped_s=dropped_s)
    follow = 1.0 - math.exp(-elapsed_s / USUAL_S) if dropped_s is None else 1.0
    usual_a = state.usual_a
    if current is not None:
        usual_a = current if usual_a is None else usual_a + (current - usual_a) * follow
    usual_v = state.usual_v + (report.voltage_v - state.usual_v) * follow
    return replace(state, drop=drop, dropped_s=None, usual_v=usual_v, usual_a=usual_a)


def _since(since_s: float | None, now_s: float, *, holds: bool) -> float | None:
    if not holds:
        return None
    return now_s if since_s is None else since_s
