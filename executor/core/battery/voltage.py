"""Model a pack's voltage at rest, in flight without its load, and under load.

A charge counter knows the charge that flowed, not what was there: it starts at 100 % with any pack, and divides by a
capacity set by hand. The rest voltage knows the charge, within the difference between the two chemistries' curves. A
larger contradiction means that the counter is wrong.

In flight a Kalman filter over (rest voltage, resistance) finds it: voltage = rest voltage - current * resistance. It is
recursive least squares over reported pairs, with a rest voltage that may fall as the pack empties: a load step -
take-off, a climb, a gust - shows the resistance, the time between them the rest voltage, each with its uncertainty.
Without a current there is no estimate in flight.

Under load a voltage falls slowly as the pack empties, with the load, and at once when a cell or a connection fails.
Half a minute of flight shows the usual voltage; where the current is known, the drop it explains by the resistance
measured at take-off is removed. Doubt about the resistance counts in the pack's favour: a true step comes with hardly
more current, so it costs little sensitivity.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from enum import Enum
from types import MappingProxyType

import numpy as np

from executor.core.fault_thresholds import Limits

CHARGE_PCT = (0.0, 5.0, 10.0, 15.0, 20.0, 30.0, 40.0, 50.0, 60.0, 70.0, 80.0, 90.0, 100.0)


class Chemistry(Enum):
    """Chemistry of a cell."""

    LIPO = "lipo"
    LI_ION = "li-ion"


REST_CELL_V: Mapping[Chemistry, tuple[float, ...]] = MappingProxyType({
    # Lithium polymer (cobalt oxide), the usual published table for hobby packs.
    Chemistry.LIPO: (3.27, 3.61, 3.69, 3.71, 3.73, 3.77, 3.80, 3.84, 3.87, 3.95, 4.02, 4.11, 4.20),
    # Nickel-manganese-cobalt 21700, approximately the LG M50 of Chen et al. 2020, J. Electrochem. Soc. 167 080534; not
    # taken from its data point by point, so no result may rely on better than 0.05 V.
    Chemistry.LI_ION: (2.80, 3.13, 3.27, 3.35, 3.43, 3.53, 3.61, 3.68, 3.78, 3.87, 3.95, 4.06, 4.18),
})  # fmt: skip
"""Open-circuit voltage of a cell at `CHARGE_PCT`, at room temperature."""
FULL_CELL_V = 4.4
"""Highest cell voltage; a pack has at least as many cells as its highest voltage needs, which avoids false low-cell
alarms."""
CHARGED_CELL_V = 4.2
"""Cell voltage in a parameter for a full pack."""
CELL_TOLERANCE = 0.12
"""Tolerance of that parameter around a whole number of cells."""
MAX_CELLS = 24
MAH = 1000.0


@dataclass(frozen=True, slots=True)
class PackFacts:
    """Facts of a pack from the site file or the vehicle's parameters; None where unknown."""

    cells: int | None = None
    """Number of cells in series."""
    chemistry: Chemistry | None = None
    capacity_ah: float | None = None
    """Capacity by which its autopilot divides the charge."""
    share: float = 1.0
    """Share of it that the pack has, by its earlier flights."""
    ohm: tuple[float, float] | None = None
    """Resistance by earlier flights: mean and standard deviation."""

    def honest_pct(self, claimed_pct: float) -> float:
        """Return the real percentage of a pack of its share, where its counter, which started full, reports another.

        >>> PackFacts(share=0.7).honest_pct(30.0), PackFacts(share=0.7).honest_pct(100.0)
        (0.0, 100.0)
        """
        return max(0.0, 100.0 - (100.0 - claimed_pct) / self.share)

    def override_with(self, other: PackFacts) -> PackFacts:
        """Return these facts overridden with those of `other`."""
        return PackFacts(
            other.cells or self.cells, other.chemistry or self.chemistry, other.capacity_ah or self.capacity_ah,
            min(other.share, self.share), other.ohm or self.ohm,
        )  # fmt: skip


NO_FACTS = PackFacts()
_CAPACITIES = frozenset({"BATT_CAPACITY", "BAT1_CAPACITY", "BAT_CAPACITY"})
_CELLS = frozenset({"BAT1_N_CELLS", "BAT_N_CELLS"})
FULL_PACK = "MOT_BAT_VOLT_MAX"
"""ArduPilot's parameter for the full pack's voltage, which scales its thrust: 4.2 V times the cells."""
PARAMETERS = ("BATT_CAPACITY", FULL_PACK, "BAT1_CAPACITY", "BAT1_N_CELLS")
"""Parameters read before a flight."""


def apply_pack_parameter(facts: PackFacts, name: str, value: float) -> PackFacts:
    """Apply a parameter of the vehicle.

    >>> apply_pack_parameter(NO_FACTS, "BATT_CAPACITY", 5100.0).capacity_ah
    5.1
    >>> apply_pack_parameter(NO_FACTS, "MOT_BAT_VOLT_MAX", 12.6).cells
    3
    """
    if name in _CAPACITIES:
        return replace(facts, capacity_ah=value / MAH if value > 0 else None)
    if name in _CELLS:
        return replace(facts, cells=round(value) if 0 < value <= MAX_CELLS else None)
    if name == FULL_PACK and value > 0:
        cells = value / CHARGED_CELL_V
        near = abs(cells - round(cells)) <= CELL_TOLERANCE and 1 <= round(cells) <= MAX_CELLS
        return replace(facts, cells=round(cells)) if near else facts
    return facts


def least_cell_count(highest_v: float) -> int:
    """Return the smallest number of cells of a pack.

    >>> least_cell_count(12.6), least_cell_count(16.8), least_cell_count(25.2)
    (3, 4, 6)
    """
    return max(1, math.ceil(highest_v / FULL_CELL_V))


def rest_charge_pct(cell_v: float, chemistry: Chemistry | None) -> float:
    """Return the charge of a resting cell; the higher of the two if the chemistry is unknown.

    >>> round(rest_charge_pct(3.70, Chemistry.LIPO)), round(rest_charge_pct(3.70, None))
    (13, 52)
    """
    if chemistry is None:
        return max(rest_charge_pct(cell_v, one) for one in Chemistry)
    return float(np.interp(cell_v, REST_CELL_V[chemistry], CHARGE_PCT))


def rest_cell_v(charge_pct: float, chemistry: Chemistry | None) -> float:
    """Return the rest voltage of a cell; the lower of the two if the chemistry is unknown."""
    if chemistry is None:
        return min(rest_cell_v(charge_pct, one) for one in Chemistry)
    return float(np.interp(charge_pct, CHARGE_PCT, REST_CELL_V[chemistry]))


NOISE = 0.004
"""Relative standard deviation of a voltage: converter steps, and a current that lags behind it."""
REST_WALK = 0.0008
"""Relative walk of the rest voltage in a second: 0.08 %/s of charge at 10 mV per cell and percent."""
FIRST_OHM, FIRST_OHM_SD = 0.0, 0.1
"""Resistance before any load step, per volt of the pack and ten amperes: from zero to a pack at the end of its life."""
OHM_WALK = 0.1
"""Relative change of the resistance in `OHM_WALK_S`."""
OHM_WALK_S = 300.0
POLARISATION = 0.25
"""Share of the ohmic sag that polarisation adds within a minute and the rest voltage does not have. A resting cell
recovers it in minutes (recorded: 0.03 to 0.06 V per cell after 13 A from 5.1 Ah)."""
GAP_S = 30.0
"""Silence after which the rest voltage is estimated again."""
AT_REST_A = 1.5
"""Largest current of the avionics alone; more, on the ground or in the air, is a load."""


@dataclass(frozen=True, slots=True)
class SagEstimate:
    """State and covariance."""

    rest_v: float
    ohm: float
    var_v: float
    covariance: float
    var_ohm: float
    at_s: float
    current_a: float = 0.0
    """Current at its last report."""

    @property
    def rest_sd_v(self) -> float:
        """Standard deviation of the resting voltage."""
        return math.sqrt(max(0.0, self.var_v))

    @property
    def ohm_sd(self) -> float:
        """Standard deviation of the resistance."""
        return math.sqrt(max(0.0, self.var_ohm))

    @property
    def recovered_v(self) -> float:
        """Voltage after minutes at rest."""
        return self.rest_v + POLARISATION * max(0.0, self.ohm) * self.current_a


def update_sag(
    known: SagEstimate | None, voltage_v: float, current_a: float, now_s: float, ohm: tuple[float, float] | None = None
) -> SagEstimate:
    """Apply a voltage with the current measured with it; `ohm` is the resistance known before."""
    noise = (NOISE * voltage_v) ** 2
    if known is None or now_s - known.at_s > GAP_S or now_s < known.at_s:
        wide_ohm = FIRST_OHM_SD * voltage_v / 10.0
        first = SagEstimate(voltage_v, FIRST_OHM, (0.2 * voltage_v) ** 2, 0.0, wide_ohm**2, now_s)
        if known is None and ohm is not None:
            first = replace(first, ohm=ohm[0], var_ohm=min(wide_ohm, ohm[1]) ** 2)
        if known is not None:  # the resistance is still that of the pack, unless it was changed
            first = replace(first, ohm=known.ohm, var_ohm=known.var_ohm + (OHM_WALK * known.ohm) ** 2)
        return _correct_sag(first, voltage_v, current_a, noise, now_s)
    elapsed_s = now_s - known.at_s
    ahead = replace(
        known,
        var_v=known.var_v + (REST_WALK * voltage_v) ** 2 * elapsed_s,
        var_ohm=known.var_ohm + (OHM_WALK * known.ohm) ** 2 * elapsed_s / OHM_WALK_S,
    )
    return _correct_sag(ahead, voltage_v, current_a, noise, now_s)


def _correct_sag(ahead: SagEstimate, voltage_v: float, current_a: float, noise: float, now_s: float) -> SagEstimate:
    innovation = voltage_v - (ahead.rest_v - current_a * ahead.ohm)
    of_v = ahead.var_v - current_a * ahead.covariance
    of_ohm = ahead.covariance - current_a * ahead.var_ohm
    spread = of_v - current_a * of_ohm + noise
    return SagEstimate(
        ahead.rest_v + of_v / spread * innovation,
        ahead.ohm + of_ohm / spread * innovation,
        ahead.var_v - of_v * of_v / spread,
        ahead.covariance - of_v * of_ohm / spread,
        ahead.var_ohm - of_ohm * of_ohm / spread,
        now_s,
        current_a,
    )


SETTLE_S = 8.0
"""Time after take-off in which the voltage falls through the load itself."""
USUAL_S = 20.0
HOVER_SAG, WORST_HOVER_SAG = 0.03, 0.09
"""Share of the voltage that hovering costs (12.6 to 12.26 V recorded), and that of a cold or aged pack; the current
explains in proportion, until a load change has shown the resistance."""
KNOWN_OHM_SHARE = 0.5
"""Relative deviation above which a resistance counts as unknown."""
DOUBT_SD = 2.0
MAX_LOAD = 8.0
"""Largest multiple of the usual current that explains a drop: full throttle at a thrust of four times the weight. More
is a sensor error."""
CALM = 0.5
"""Share of the threshold below which the usual voltage follows."""
NEW_USUAL_S = 60.0
"""Duration after which a step becomes the new usual voltage."""


@dataclass(frozen=True, slots=True)
class VoltageState:
    """A vehicle's voltage since its last start."""

    reported_s: float = float("-inf")
    voltage_v: float | None = None
    highest_v: float = 0.0
    """Highest voltage since contact, which shows the number of cells."""
    began_s: float | None = None
    """When it was first received in the air."""
    usual_v: float | None = None
    usual_a: float | None = None
    usual_ohm: tuple[float, float] | None = None
    """Lower and upper bound of the resistance."""
    expected_v: float | None = None
    """Expected voltage under the present load."""
    drop: float = 0.0
    """Share of the usual voltage missing now, beyond what the current explains."""
    dropped_s: float | None = None
    """Since when the drop exceeds noise."""
    known_load: bool = False
    low_since_s: float | None = None
    """Since when a cell is almost empty."""
    cells_v: tuple[float, ...] = ()
    set_cells: int | None = None
    """Number of cells in series by parameter or site file."""
    spread_since_s: float | None = None
    """Since when one cell is below the others."""

    @property
    def cells(self) -> int:
        """Number of cells in series; the smallest possible one if unknown."""
        return len(self.cells_v) or self.set_cells or least_cell_count(self.highest_v)

    @property
    def weakest_v(self) -> float | None:
        """Voltage of the weakest cell, or the mean if cells are not measured."""
        if self.cells_v:
            return min(self.cells_v)
        return None if self.voltage_v is None else self.voltage_v / self.cells

    @property
    def spread_v(self) -> float:
        """Distance of the weakest cell below the mean of the others."""
        if len(self.cells_v) < 2:
            return 0.0
        weakest = min(self.cells_v)
        return (sum(self.cells_v) - weakest) / (len(self.cells_v) - 1) - weakest


@dataclass(frozen=True, slots=True)
class VoltageReport:
    """A vehicle's voltage report."""

    voltage_v: float
    current_a: float | None = None
    cells_v: tuple[float, ...] = ()


def apply_voltage_report(
    state: VoltageState, report: VoltageReport, limits: Limits, now_s: float, *, flying: bool,
    sag: SagEstimate | None = None
) -> VoltageState:  # fmt: skip
    """Apply a report; `sag` is the pack's estimate before it."""
    elapsed_s = now_s - state.reported_s
    state = replace(
        state,
        reported_s=now_s,
        voltage_v=report.voltage_v,
        # The lower of two reports: a single spike of 13.4 V turned a pack of three cells into one of four.
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
        more_a = min(current, MAX_LOAD * state.usual_a) - state.usual_a
        expected_v -= more_a * state.usual_ohm[more_a > 0]
    drop = (expected_v - report.voltage_v) / usual_v
    state = replace(state, drop=drop, expected_v=expected_v)
    step = limits.voltage_step if state.known_load else limits.voltage_step_blind
    dropped_s = _track_onset(state.dropped_s, now_s, holds=drop > CALM * step)
    if dropped_s is not None and now_s - dropped_s < NEW_USUAL_S:
        return replace(state, dropped_s=dropped_s)
    follow = 1.0 - math.exp(-elapsed_s / USUAL_S) if dropped_s is None else 1.0
    usual_a = state.usual_a
    if current is not None:
        usual_a = current if usual_a is None else usual_a + (current - usual_a) * follow
    usual_v += (report.voltage_v - usual_v) * follow
    # During a drop the resistance stays unchanged: a failing cell must not be learned as resistance.
    return replace(state, dropped_s=None, usual_v=usual_v, usual_a=usual_a, usual_ohm=_ohm(state, report, sag))


def _ohm(state: VoltageState, report: VoltageReport, sag: SagEstimate | None) -> tuple[float, float] | None:
    """Return the bounds of the pack's resistance; None without a current."""
    if not state.known_load:
        return None
    if sag is not None and sag.ohm > 0 and sag.ohm_sd < KNOWN_OHM_SHARE * sag.ohm:
        doubt_ohm = DOUBT_SD * sag.ohm_sd
        # Polarisation lags behind a load, and behind its end.
        return max(0.0, sag.ohm - doubt_ohm) * (1 - POLARISATION), (sag.ohm + doubt_ohm) * (1 + POLARISATION)
    usual_a = state.usual_a or report.current_a or 1.0
    return HOVER_SAG * report.voltage_v / usual_a, WORST_HOVER_SAG * report.voltage_v / usual_a


def _track_onset(since_s: float | None, now_s: float, *, holds: bool) -> float | None:
    if not holds:
        return None
    return now_s if since_s is None else since_s
