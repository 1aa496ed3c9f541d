"""Track a counter of consumed charge, and judge whether the reported percentage is derived from it.

ArduPilot's percentage is its counter divided by a capacity set by hand. PX4's is derived from the voltage, or mixed
from both; it saturates, wavers with the load and recovers after it. Changes of such a percentage say little about
consumption, and a capacity computed from both is meaningless.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace

from executor.core.battery.cusum import Drift

RISE_PCT = 2.0
"""Rise beyond rounding that shows a percentage is not counted: charge does not rise in flight."""
STRETCH_PCT = 5.0
"""Length of the stretches over which the percentage is compared with the counter; whole percents err by a fifth of
it."""
STRETCH_RATIO = 1.7
"""Ratio of charge between two stretches beyond rounding: the percentage does not follow the counter."""
SETTING_RATIO = 1.35
"""Ratio of the learned to the set capacity beyond which the percentage is not computed from the set one."""
MIN_ENDURANCE_H, MAX_ENDURANCE_H = 0.05, 2.0
"""Endurance of a full pack in any flight: three minutes of racing, two hours of the lightest on high-energy cells."""


WHOLE_PCT = 1.0
TRANSITION_S = 5.0
"""Longest interval between two reports, the second a percent lower, that locates the transition."""
CAPACITY_PCT = 3.0
"""Shortest distance between two percent transitions to derive a capacity; each is known to within a report."""
CALM_PCT = 0.5
AGREEMENT_PCT = 1.5
"""Largest disagreement: two rounding errors and a little more."""


@dataclass(frozen=True, slots=True)
class PercentTransition:
    """The moment when the percentage dropped by one: the remaining charge is then known exactly."""

    remaining_pct: float
    consumed_ah: float


@dataclass(frozen=True, slots=True)
class ChargeCounter:
    """The counter of consumed charge, where there is one."""

    consumed_ah: float | None = None
    at_s: float = 0.0
    modelled_pct: float = 0.0
    began_ah: float = 0.0
    """Its first value."""
    first: PercentTransition | None = None
    """First percent transition consistent with the counter."""
    last: PercentTransition | None = None
    capacity_ah: float | None = None
    """Capacity of the whole pack as the autopilot counts it, learned from both; None until enough charge was used."""
    began_s: float = 0.0
    set_ah: float | None = None
    """Capacity set by parameter."""
    mark: tuple[float, float] | None = None
    """(percentage, charge) at the start of the present stretch."""
    per_pct_ah: float | None = None
    """Charge per percent in the last stretch."""
    follows: bool = True
    """Whether the percentage follows the counter."""
    drift: Drift = field(default_factory=Drift)


def start_counter(
    charge: ChargeCounter, consumed_ah: float, reported_pct: float, modelled_pct: float, now_s: float
) -> ChargeCounter:
    """Return a counter starting here; whether the percentage follows it depends on the vehicle and is kept."""
    return ChargeCounter(
        consumed_ah, now_s, modelled_pct, began_ah=consumed_ah, capacity_ah=charge.set_ah, began_s=now_s,
        set_ah=charge.set_ah, mark=(reported_pct, consumed_ah), follows=charge.follows,
    )  # fmt: skip


def record_percent_transition(
    charge: ChargeCounter, end_pct: float, used_pct: float, elapsed_s: float, now_s: float
) -> ChargeCounter:
    """Return the counter after a report; one that is a percent lower than the last marks a transition.

    Whole percents err by one, but the transition between two is known to within the report interval.
    """
    if charge.consumed_ah is None or used_pct != WHOLE_PCT or elapsed_s > TRANSITION_S:
        return charge
    last = PercentTransition(end_pct, charge.consumed_ah)
    first, capacity_ah = charge.first or last, charge.capacity_ah
    given_pct = first.remaining_pct - last.remaining_pct
    # An actual drain must not be learned as a capacity.
    if given_pct >= CAPACITY_PCT and charge.drift.excess_pct <= CALM_PCT:
        learned_ah = 100.0 * (last.consumed_ah - first.consumed_ah) / given_pct
        capacity_ah = plausible_capacity_ah(charge, learned_ah, charge.consumed_ah, now_s)
    return replace(charge, first=first, last=last, capacity_ah=capacity_ah)


def counter_remaining_pct(charge: ChargeCounter, stands_for_pct: float) -> float | None:
    """Return the remaining charge by the counter, finer than whole percents; None if it disagrees."""
    if charge.capacity_ah is None or charge.consumed_ah is None or charge.last is None:
        return None
    left = charge.last.remaining_pct - 100.0 * (charge.consumed_ah - charge.last.consumed_ah) / charge.capacity_ah
    return left if abs(left - stands_for_pct) <= AGREEMENT_PCT else None


def compare_with_percentage(charge: ChargeCounter, reported_pct: float, *, rose_pct: float) -> ChargeCounter:
    """Compare a percentage with the counter, stretch by stretch."""
    if charge.consumed_ah is None or charge.mark is None or not charge.follows:
        return charge
    if rose_pct >= RISE_PCT:
        return replace(charge, follows=False)
    from_pct, from_ah = charge.mark
    if from_pct - reported_pct < STRETCH_PCT:
        return charge
    per_pct_ah = (charge.consumed_ah - from_ah) / (from_pct - reported_pct)
    last = charge.per_pct_ah
    like = last is None or last / STRETCH_RATIO <= per_pct_ah <= last * STRETCH_RATIO
    return replace(charge, mark=(reported_pct, charge.consumed_ah), per_pct_ah=per_pct_ah, follows=like)


def plausible_capacity_ah(charge: ChargeCounter, capacity_ah: float, consumed_ah: float, now_s: float) -> float | None:
    """Return a learned capacity if it is plausible.

    A counter that does not advance while the percentage falls counts nothing; a capacity unlike the set one is not the
    divisor of the percentage; and no pack lasts only seconds, or a day.
    """
    if capacity_ah <= 0.0 or not charge.follows:
        return None
    if charge.set_ah is not None and not charge.set_ah / SETTING_RATIO <= capacity_ah <= charge.set_ah * SETTING_RATIO:
        return None
    elapsed_h = (now_s - charge.began_s) / 3600.0
    mean_a = (consumed_ah - charge.began_ah) / elapsed_h if elapsed_h > 0 else 0.0
    return capacity_ah if MIN_ENDURANCE_H * mean_a <= capacity_ah <= MAX_ENDURANCE_H * mean_a else None
