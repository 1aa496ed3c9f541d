"""Whether a pack is what its counter says: its resting voltage, before arming and in flight, against its percentage."""

from __future__ import annotations

from dataclasses import dataclass, replace

from executor.core.battery import resting_voltage as resting
from executor.core.battery.resting_voltage import NO_FACTS, Chemistry, PackFacts
from executor.core.battery.voltage_sag import AT_REST_A, SagEstimate, update_sag

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
        what = f"rests at {self.cell_v:.2f} V a cell, about {self.held_pct:.0f} %, and reports {self.claimed_pct:.0f} %"
        if self.times is None or self.times < TIMES_WARNED:
            return what
        times, likely = f"{self.times:.1f}", f"{max(self.times, self.likely_times or 0.0):.1f}"
        much = times if likely == times else f"{times} to {likely}"
        return f"{what}: since it took off it has given {much} times what is counted"

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
        rest_cell_v = known.rest.voltage_v / cells
        return PackCondition(
            rest_cell_v, claimed_pct, *_compare_voltage_with_percentage(rest_cell_v, claimed_pct, chemistry, 0.0)
        )
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


def is_doubtful_at_rest(rest_v: float, cells: int, facts: PackFacts, claimed_pct: float) -> bool:
    """Return whether a pack that rested held less than it reported, as `PackCondition.doubtful` has it.

    Args:
        rest_v: Of the whole pack.
        cells: In series.
        facts: What is said of it.
        claimed_pct: What it reported then.
    """
    cell_v = rest_v / cells
    return PackCondition(
        cell_v, claimed_pct, *_compare_voltage_with_percentage(cell_v, claimed_pct, facts.chemistry, 0.0)
    ).doubtful


def _compare_voltage_with_percentage(
    cell_v: float, claimed_pct: float, chemistry: Chemistry | None, sure_v: float
) -> tuple[float, float]:
    """Return what a pack holds by its voltage, and how far a cell lies below what the percentage allows."""
    short_v = resting.rest_cell_v(claimed_pct, chemistry) - cell_v - sure_v
    return resting.rest_charge_pct(cell_v, chemistry or Chemistry.LIPO), short_v


def _use_ratio(rest_cell_v: float, cell_v: float, counted_pct: float, chemistry: Chemistry | None) -> float | None:
    if counted_pct < COUNTED_PCT:
        return None
    used = [
        resting.rest_charge_pct(rest_cell_v, one) - resting.rest_charge_pct(cell_v, one)
        for one in ((chemistry,) if chemistry is not None else Chemistry)
    ]
    return min(used) / counted_pct if min(used) >= USED_PCT else None
