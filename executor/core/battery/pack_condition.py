"""Judge whether a pack holds what its counter reports, by its rest voltage and its earlier flights.

A labelled pack is known before it is under load. The capacity by its voltage over its last flights is the highest that
the chemistries allow, so that a wrong discharge curve shortens no flight; a site that names the chemistry removes the
doubt.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from statistics import median, stdev

from executor.core.battery import voltage
from executor.core.battery.voltage import AT_REST_A, NO_FACTS, Chemistry, PackFacts, SagEstimate, update_sag
from executor.core.lines import battery

LEAST_SPARE_PCT = 5.0
"""Charge over the reserve below which a take-off is not worthwhile."""
REST_SD_V = 0.03
"""Standard deviation per cell above which a rest voltage in flight is too uncertain; 10 mV are a percent or more."""
AT_REST_V = 0.12
"""Shortfall of a cell below the lower curve at rest: half the difference of the two, for a pack that has just been
flown."""
IN_FLIGHT_V = 0.08
"""The same in flight, where the sag is removed with its uncertainty, and an allowance made for polarisation."""
FAULT_RATIO, WARNING_RATIO = 1.15, 1.1
"""Ratio of consumption by voltage to consumption counted since the last rest, in the more favourable chemistry and with
an allowance for polarisation: a pack at the end of its life has four fifths of its capacity, 1.25."""
USED_PCT, COUNTED_PCT = 20.0, 8.0
"""Consumption, by voltage and by counter, needed for that comparison."""
RECOVERY_S = 60.0
"""Recovery time of the voltage after a load."""
LOW_PCT = 15.0
"""Charge by voltage, as a lithium polymer pack, at which it is empty within minutes."""


@dataclass(frozen=True, slots=True)
class RestReading:
    """A pack at rest."""

    voltage_v: float
    claimed_pct: float
    """Percentage reported at that time."""
    at_s: float


@dataclass(frozen=True, slots=True)
class PackState:
    """The condition of a vehicle's pack, apart from its remaining charge."""

    facts: PackFacts = NO_FACTS
    """From the vehicle's own parameters."""
    sag: SagEstimate | None = None
    """None without a reported current."""
    rest: RestReading | None = None
    """Its last rest."""
    resting: bool = False
    loaded_s: float = float("-inf")
    """When it was last under load."""


@dataclass(frozen=True, slots=True)
class PackCondition:
    """The rest voltage and percentage of a pack at one moment."""

    cell_v: float
    """Cell voltage at rest."""
    claimed_pct: float
    held_pct: float
    """Charge by its voltage; as a lithium polymer pack if the chemistry is unknown."""
    short_v: float
    """Shortfall of a cell below the voltage its percentage allows, in the more favourable chemistry if unknown."""
    times: float | None = None
    """Ratio of consumption to count since its rest, with the same allowances; None if unknown."""
    likely_times: float | None = None
    """The same without allowances; as a lithium polymer pack if the chemistry is unknown."""
    in_flight: bool = False

    @property
    def words(self) -> str:
        """For the crew to read."""
        what = battery.PACK_AT_REST.format(cell_v=self.cell_v, held_pct=self.held_pct, claimed_pct=self.claimed_pct)
        if self.times is None or self.times < WARNING_RATIO:
            return what
        times, likely = f"{self.times:.1f}", f"{max(self.times, self.likely_times or 0.0):.1f}"
        much = times if likely == times else battery.FROM_TO.format(least=times, most=likely)
        return battery.PACK_GIVES_MORE.format(condition=what, times=much)

    @property
    def doubtful(self) -> bool:
        """Whether it is worth a warning."""
        gives_more = self.in_flight and self.times is not None and self.times >= WARNING_RATIO
        return self.short_v >= (IN_FLIGHT_V if self.in_flight else AT_REST_V) or gives_more

    @property
    def falls_short(self) -> bool:
        """Whether it empties faster than counted."""
        return self.in_flight and self.times is not None and self.times >= FAULT_RATIO

    @property
    def nearly_empty(self) -> bool:
        """Whether it is almost empty though its percentage is not."""
        return self.in_flight and self.short_v >= AT_REST_V and self.held_pct <= LOW_PCT


def apply_pack_voltage(
    known: PackState,
    voltage_v: float,
    current_a: float | None,
    claimed_pct: float | None,
    now_s: float,
    *,
    idle: bool,
    ohm: tuple[float, float] | None = None,
) -> PackState:
    """Apply a voltage, with the values reported beside it.

    Args:
        known: The state before.
        voltage_v: Voltage of the whole pack.
        current_a: Its current at that time.
        claimed_pct: Its reported percentage.
        now_s: The time.
        idle: Whether the vehicle's motors are off.
        ohm: Its resistance from earlier flights, mean and standard deviation.
    """
    sag = known.sag if current_a is None else update_sag(known.sag, voltage_v, current_a, now_s, ohm)
    rests = idle and (current_a is None or current_a <= AT_REST_A) and claimed_pct is not None
    if not rests or claimed_pct is None:
        loaded_s = known.loaded_s if idle and claimed_pct is None else now_s
        return replace(known, sag=sag, resting=False, loaded_s=loaded_s)
    return replace(known, sag=sag, rest=RestReading(voltage_v, claimed_pct, now_s), resting=True)


def assess_pack(
    known: PackState, cells: int, facts: PackFacts, claimed_pct: float | None, now_s: float
) -> PackCondition | None:  # fmt: skip
    """Return the condition of a pack; None if its rest voltage or percentage is unknown.

    A pack known to hold less than counted is compared with its real capacity.
    """
    chemistry = facts.chemistry
    if claimed_pct is None:
        return None
    if known.resting and known.rest is not None:
        if known.rest.at_s - known.loaded_s < RECOVERY_S:
            return None
        return assess_resting_pack(known.rest.voltage_v, cells, facts, claimed_pct)
    sag = known.sag
    if sag is None or sag.rest_sd_v > REST_SD_V * cells or now_s < sag.at_s:
        return None
    cell_v, sure_v = sag.recovered_v / cells, 2.0 * sag.rest_sd_v / cells
    honest_pct, rest, times, likely = facts.honest_pct(claimed_pct), known.rest, None, None
    if rest is not None:
        counted_pct, rest_cell_v = facts.honest_pct(rest.claimed_pct) - honest_pct, rest.voltage_v / cells
        times = _use_ratio(rest_cell_v, cell_v + sure_v / 2, counted_pct, chemistry)
        likely = _use_ratio(rest_cell_v, cell_v, counted_pct, chemistry or Chemistry.LIPO)
    held_pct, short_v = _compare_voltage_with_percentage(cell_v, honest_pct, chemistry, sure_v)
    return PackCondition(cell_v, claimed_pct, held_pct, short_v, times, likely, in_flight=True)


def assess_resting_pack(rest_v: float, cells: int, facts: PackFacts, claimed_pct: float) -> PackCondition:
    """Return the condition of a pack with this many cells in series, at a rest voltage and a reported percentage."""
    cell_v, chemistry = rest_v / cells, facts.chemistry
    return PackCondition(cell_v, claimed_pct, *_compare_voltage_with_percentage(cell_v, claimed_pct, chemistry, 0.0))


def _compare_voltage_with_percentage(
    cell_v: float, claimed_pct: float, chemistry: Chemistry | None, sure_v: float
) -> tuple[float, float]:
    """Return the charge of a pack by its voltage, and a cell's shortfall below what the percentage allows."""
    short_v = voltage.rest_cell_v(claimed_pct, chemistry) - cell_v - sure_v
    return voltage.rest_charge_pct(cell_v, chemistry or Chemistry.LIPO), short_v


def _use_ratio(rest_cell_v: float, cell_v: float, counted_pct: float, chemistry: Chemistry | None) -> float | None:
    if counted_pct < COUNTED_PCT:
        return None
    used = [
        voltage.rest_charge_pct(rest_cell_v, one) - voltage.rest_charge_pct(cell_v, one)
        for one in ((chemistry,) if chemistry is not None else Chemistry)
    ]
    return min(used) / counted_pct if min(used) >= USED_PCT else None


RECENT_FLIGHTS = 5
"""Number of recent flights used, as a pack ages."""
CAPACITY_SHARE_SD = 0.03
"""Smallest relative deviation of a capacity by voltage: 10 mV of a cell are a percent or more."""
OHM_SHARE_SD = 0.2
"""Relative deviation of a resistance on another day: at 10 degrees it is half as much again as at 25."""
SOUND_SHARE = 0.95
"""Share of a capacity from which a pack counts as sound."""
MIN_BUDGET_PCT = 1.0


@dataclass(frozen=True, slots=True)
class PackFlightRecord:
    """One flight of a pack; None for values not in its log."""

    capacity_ah: float | None
    """Highest capacity that its voltage allows."""
    ohm: float | None
    set_ah: float | None
    """Capacity that its autopilot counted with."""


@dataclass(frozen=True, slots=True)
class PackHistory:
    """The history of a labelled pack."""

    label: str
    flights: int = 0
    capacity_ah: tuple[float, float] | None = None
    """Mean and standard deviation."""
    ohm: tuple[float, float] | None = None
    """Resistance of the whole pack, mean and standard deviation."""
    set_ah: float | None = None
    """Capacity that its autopilot last counted with."""

    def share_of(self, capacity_ah: float | None) -> float:
        """Return the share of a capacity that it has; 1 without evidence of less."""
        if self.capacity_ah is None or not capacity_ah:
            return 1.0
        share = self.capacity_ah[0] / capacity_ah
        return share if share < SOUND_SHARE else 1.0

    def budget_pct(self, asked_pct: float, reserve_pct: float, planned_ah: float) -> float:
        """Return the percentage of the planned capacity that a route may use."""
        return max(MIN_BUDGET_PCT, min(asked_pct, 100.0 * self.share_of(planned_ah) - reserve_pct))

    def empty_reading_pct(self, planned_ah: float, *, counts: bool) -> float:
        """Return the percentage its autopilot will report when it is empty.

        Args:
            planned_ah: Planned capacity; used if no flight shows the one its autopilot counts with.
            counts: Whether the autopilot, if that is unknown, counts charge at all.
        """
        counted_ah = self.set_ah or (planned_ah if counts else None)
        return 100.0 * (1.0 - self.share_of(counted_ah))


def build_pack_history(label: str, flown: Sequence[PackFlightRecord]) -> PackHistory:
    """Return the history of a pack from its flights in order."""
    last = flown[-RECENT_FLIGHTS:]
    capacities = [one.capacity_ah for one in last if one.capacity_ah is not None]
    ohms = [one.ohm for one in last if one.ohm is not None and one.ohm > 0]
    sets = [one.set_ah for one in last if one.set_ah]
    return PackHistory(
        label,
        len(flown),
        _estimate_mean_sd(capacities, CAPACITY_SHARE_SD),
        _estimate_mean_sd(ohms, OHM_SHARE_SD),
        sets[-1] if sets else None,
    )


def _estimate_mean_sd(values: Sequence[float], least_share: float) -> tuple[float, float] | None:
    if not values:
        return None
    middle = median(values)
    scatter = stdev(values) / math.sqrt(len(values)) if len(values) > 1 else 0.0
    return middle, max(scatter, least_share * middle)
