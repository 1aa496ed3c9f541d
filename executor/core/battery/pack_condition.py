"""Whether a pack is what its counter says: its voltage at rest against its percentage, and its earlier flights.

A pack that is labelled is known before it is under load. What its voltage said of its capacity over its last flights
counts as the more that the chemistries allow, so that nobody flies less for a curve that is not its own; a site that
names the chemistry leaves nothing open.
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
"""A pack with less than this over the reserve is not worth a take-off."""
SURE_SD_V = 0.03
"""Of a cell: a resting voltage in flight that is less sure says nothing; 10 mV are a percent, or more."""
AT_REST_V = 0.12
"""Of a cell, below the lower of the curves: half of what the two differ by, and a pack that has just been flown."""
IN_FLIGHT_V = 0.08
"""The same in flight, where the sag is taken out with its uncertainty, and what ions lag behind is given away."""
TIMES, TIMES_WARNED = 1.15, 1.1
"""By its voltage so many times as much was used as was counted, since it last rested, even in the chemistry that allows
more and with what ions lag behind given away: a pack at the end of its life has four fifths of its capacity, 1.25."""
USED_PCT, COUNTED_PCT = 20.0, 8.0
"""So much must be used, by the voltage and by the counter, before that says anything."""
RECOVERS_S = 60.0
"""After a load a voltage still rises for so long."""
LOW_PCT = 15.0
"""By its voltage, as a lithium polymer pack: it will be empty in minutes."""


@dataclass(frozen=True, slots=True)
class RestReading:
    """A pack at rest."""

    voltage_v: float
    claimed_pct: float
    """What was reported then."""
    at_s: float


@dataclass(frozen=True, slots=True)
class PackState:
    """What is known of a vehicle's pack besides what is left of it."""

    facts: PackFacts = NO_FACTS
    """By the vehicle's own parameters."""
    sag: SagEstimate | None = None
    """None where no current was reported."""
    rest: RestReading | None = None
    """When it rested last."""
    resting: bool = False
    loaded_s: float = float("-inf")
    """When it was under load last."""


@dataclass(frozen=True, slots=True)
class PackCondition:
    """A pack's resting voltage beside its percentage, at one moment."""

    cell_v: float
    """At rest."""
    claimed_pct: float
    held_pct: float
    """By its voltage; a lithium polymer pack where nobody says what it is."""
    short_v: float
    """How far a cell lies below what the percentage allows, in the chemistry that allows more if nobody says which."""
    times: float | None = None
    """By how much more was used since it rested than was counted, by the same lenience; None while that is unknown."""
    likely_times: float | None = None
    """The same without lenience: as a lithium polymer pack where nobody says what it is."""
    in_flight: bool = False

    @property
    def words(self) -> str:
        """As the crew reads it."""
        what = battery.PACK_AT_REST.format(cell_v=self.cell_v, held_pct=self.held_pct, claimed_pct=self.claimed_pct)
        if self.times is None or self.times < TIMES_WARNED:
            return what
        times, likely = f"{self.times:.1f}", f"{max(self.times, self.likely_times or 0.0):.1f}"
        much = times if likely == times else battery.FROM_TO.format(least=times, most=likely)
        return battery.PACK_GIVES_MORE.format(condition=what, times=much)

    @property
    def doubtful(self) -> bool:
        """Whether that is worth a word."""
        gives_more = self.in_flight and self.times is not None and self.times >= TIMES_WARNED
        return self.short_v >= (IN_FLIGHT_V if self.in_flight else AT_REST_V) or gives_more

    @property
    def falls_short(self) -> bool:
        """Whether it empties faster than it counts."""
        return self.in_flight and self.times is not None and self.times >= TIMES

    @property
    def nearly_empty(self) -> bool:
        """Whether it is at its end while its percentage is not."""
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
    """Take a voltage with what was reported beside it.

    Args:
        known: What was known.
        voltage_v: Of the whole pack.
        current_a: What it gave then.
        claimed_pct: What it was said to hold.
        now_s: The time.
        idle: Whether the vehicle's motors stand still.
        ohm: Its resistance by earlier flights, mean and standard deviation.
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
    """Return how a pack stands; None where its resting voltage, or its percentage, is not known.

    A pack that is known to hold less than is counted is held against what it has.
    """
    chemistry = facts.chemistry
    if claimed_pct is None:
        return None
    if known.resting and known.rest is not None:
        if known.rest.at_s - known.loaded_s < RECOVERS_S:
            return None
        return assess_resting_pack(known.rest.voltage_v, cells, facts, claimed_pct)
    sag = known.sag
    if sag is None or sag.rest_sd_v > SURE_SD_V * cells or now_s < sag.at_s:
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
    """Return how a pack of so many cells in series stood that rested with a voltage, and reported a percentage."""
    cell_v, chemistry = rest_v / cells, facts.chemistry
    return PackCondition(cell_v, claimed_pct, *_compare_voltage_with_percentage(cell_v, claimed_pct, chemistry, 0.0))


def _compare_voltage_with_percentage(
    cell_v: float, claimed_pct: float, chemistry: Chemistry | None, sure_v: float
) -> tuple[float, float]:
    """Return what a pack holds by its voltage, and how far a cell lies below what the percentage allows."""
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


RECENT = 5
"""Flights that say what a pack is now: it ages."""
LEAST_SHARE_SD = 0.03
"""Of a capacity by voltages: 10 mV of a cell are a percent, or more."""
OHM_SHARE_SD = 0.2
"""Of a resistance on another day: a pack of 10 degrees has half as much again as one of 25."""
FULL = 0.95
"""Of a capacity: a pack that has more is as it should be."""
LEAST_PCT = 1.0


@dataclass(frozen=True, slots=True)
class PackFlightRecord:
    """One flight of a pack; None where its log did not say."""

    capacity_ah: float | None
    """The most that its voltage allows."""
    ohm: float | None
    set_ah: float | None
    """What its autopilot counted by."""


@dataclass(frozen=True, slots=True)
class PackHistory:
    """A labelled pack."""

    label: str
    flights: int = 0
    capacity_ah: tuple[float, float] | None = None
    """Mean and standard deviation."""
    ohm: tuple[float, float] | None = None
    """The same of the whole pack."""
    set_ah: float | None = None
    """What its autopilot counted by last."""

    def share_of(self, capacity_ah: float | None) -> float:
        """Return how much of a capacity it has; 1 where nothing says that it has less."""
        if self.capacity_ah is None or not capacity_ah:
            return 1.0
        share = self.capacity_ah[0] / capacity_ah
        return share if share < FULL else 1.0

    def budget_pct(self, asked_pct: float, reserve_pct: float, planned_ah: float) -> float:
        """Return what a route may use of it, in percent of the capacity that is planned with."""
        return max(LEAST_PCT, min(asked_pct, 100.0 * self.share_of(planned_ah) - reserve_pct))

    def empty_reading_pct(self, planned_ah: float, *, counts: bool) -> float:
        """Return how much its autopilot will report when it is empty.

        Args:
            planned_ah: Capacity that is planned with; taken where no flight says what its autopilot counts by.
            counts: Whether an autopilot of which that is not known counts charge at all.
        """
        counted_ah = self.set_ah or (planned_ah if counts else None)
        return 100.0 * (1.0 - self.share_of(counted_ah))


def build_pack_history(label: str, flown: Sequence[PackFlightRecord]) -> PackHistory:
    """Return what a pack's flights say, given in their order."""
    last = flown[-RECENT:]
    capacities = [one.capacity_ah for one in last if one.capacity_ah is not None]
    ohms = [one.ohm for one in last if one.ohm is not None and one.ohm > 0]
    sets = [one.set_ah for one in last if one.set_ah]
    return PackHistory(
        label,
        len(flown),
        _estimate_mean_sd(capacities, LEAST_SHARE_SD),
        _estimate_mean_sd(ohms, OHM_SHARE_SD),
        sets[-1] if sets else None,
    )


def _estimate_mean_sd(values: Sequence[float], least_share: float) -> tuple[float, float] | None:
    if not values:
        return None
    middle = median(values)
    scatter = stdev(values) / math.sqrt(len(values)) if len(values) > 1 else 0.0
    return middle, max(scatter, least_share * middle)
