"""A counter of consumed charge, and whether the percentage beside it is made of it.

ArduPilot's percentage is its counter divided by a capacity that somebody typed. PX4's is read off the voltage, or mixed
of both; it stands at its stop, wavers with the load and rises after it. What such a percentage does says little of what
is used, and the capacity that both seem to give says nothing.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace

from executor.core.battery.cusum import Drift

RISES_PCT = 2.0
"""A charge in flight does not rise: a percentage that does by more than roundings is read off something else."""
SEGMENT_PCT = 5.0
"""Stretches of the percentage in which it is set against the counter: whole percents err by a fifth of it."""
UNLIKE = 1.7
"""Times as much charge in one stretch as in the last one is no rounding: the percentage does not follow the counter."""
OFF_SETTING = 1.35
"""By so much the capacity that both counters give may differ from the one that is set; else it is not divided by it."""
LEAST_ENDURANCE_H, MOST_ENDURANCE_H = 0.05, 2.0
"""What a whole pack lasts in any flight: three minutes of a race, two hours of the lightest on cells of high energy."""


WHOLE_PCT = 1.0
END_S = 5.0
"""Between two reports of which the second is one percent less: later nobody knows when the percent ended."""
CAPACITY_PCT = 3.0
"""So far apart two ends of percents must be before charge can be set against them: each is known to a report."""
CALM_PCT = 0.5
AGREES_PCT = 1.5
"""Two roundings and a little."""


@dataclass(frozen=True, slots=True)
class PercentTransition:
    """The moment at which a whole percent went over into the next: then it is known exactly what remains."""

    remaining_pct: float
    consumed_ah: float


@dataclass(frozen=True, slots=True)
class ChargeCounter:
    """The counter of consumed charge, where there is one."""

    consumed_ah: float | None = None
    at_s: float = 0.0
    modelled_pct: float = 0.0
    began_ah: float = 0.0
    """What it said when it was first heard."""
    first: PercentTransition | None = None
    """The first end of a percent that fits the counter."""
    last: PercentTransition | None = None
    capacity_ah: float | None = None
    """Of the whole pack as the autopilot counts it, learned from both counters; None until enough was used."""
    began_s: float = 0.0
    set_ah: float | None = None
    """What its parameter says of the capacity."""
    mark: tuple[float, float] | None = None
    """(percentage, charge) where the present stretch began."""
    per_pct_ah: float | None = None
    """Charge by percent in the last stretch."""
    follows: bool = True
    """Whether the percentage follows the counter."""
    drift: Drift = field(default_factory=Drift)


def start_counter(
    charge: ChargeCounter, consumed_ah: float, reported_pct: float, modelled_pct: float, now_s: float
) -> ChargeCounter:
    """Return a counter that is read from here on; whether the percentage follows it is a matter of the vehicle."""
    return ChargeCounter(
        consumed_ah, now_s, modelled_pct, began_ah=consumed_ah, capacity_ah=charge.set_ah, began_s=now_s,
        set_ah=charge.set_ah, mark=(reported_pct, consumed_ah), follows=charge.follows,
    )  # fmt: skip


def record_percent_transition(
    charge: ChargeCounter, end_pct: float, used_pct: float, elapsed_s: float, now_s: float
) -> ChargeCounter:
    """Return the counter after a report; one that is a percent less than the one before tells where the percent ended.

    Whole percents err by one, but the moment in which one becomes the next is known to the time between two reports.
    """
    if charge.consumed_ah is None or used_pct != WHOLE_PCT or elapsed_s > END_S:
        return charge
    last = PercentTransition(end_pct, charge.consumed_ah)
    first, capacity_ah = charge.first or last, charge.capacity_ah
    given_pct = first.remaining_pct - last.remaining_pct
    # What drains the charge, and not what is said of it, must not become the capacity.
    if given_pct >= CAPACITY_PCT and charge.drift.excess_pct <= CALM_PCT:
        learned_ah = 100.0 * (last.consumed_ah - first.consumed_ah) / given_pct
        capacity_ah = plausible_capacity_ah(charge, learned_ah, charge.consumed_ah, now_s)
    return replace(charge, first=first, last=last, capacity_ah=capacity_ah)


def counter_remaining_pct(charge: ChargeCounter, stands_for_pct: float) -> float | None:
    """Return what the counter of charge says is left, finer than whole percents; None where the two do not agree."""
    if charge.capacity_ah is None or charge.consumed_ah is None or charge.last is None:
        return None
    left = charge.last.remaining_pct - 100.0 * (charge.consumed_ah - charge.last.consumed_ah) / charge.capacity_ah
    return left if abs(left - stands_for_pct) <= AGREES_PCT else None


def compare_with_percentage(charge: ChargeCounter, reported_pct: float, *, rose_pct: float) -> ChargeCounter:
    """Hold a percentage against the counter, stretch by stretch."""
    if charge.consumed_ah is None or charge.mark is None or not charge.follows:
        return charge
    if rose_pct >= RISES_PCT:
        return replace(charge, follows=False)
    from_pct, from_ah = charge.mark
    if from_pct - reported_pct < SEGMENT_PCT:
        return charge
    per_pct_ah = (charge.consumed_ah - from_ah) / (from_pct - reported_pct)
    last = charge.per_pct_ah
    like = last is None or last / UNLIKE <= per_pct_ah <= last * UNLIKE
    return replace(charge, mark=(reported_pct, charge.consumed_ah), per_pct_ah=per_pct_ah, follows=like)


def plausible_capacity_ah(charge: ChargeCounter, capacity_ah: float, consumed_ah: float, now_s: float) -> float | None:
    """Return a learned capacity, if it can be one.

    A counter that stands still while the percentage falls counts nothing; one that is divided by another capacity than
    the one that is set is not what the percentage is made of; and no pack lasts for seconds, or for a day.
    """
    if capacity_ah <= 0.0 or not charge.follows:
        return None
    if charge.set_ah is not None and not charge.set_ah / OFF_SETTING <= capacity_ah <= charge.set_ah * OFF_SETTING:
        return None
    elapsed_h = (now_s - charge.began_s) / 3600.0
    mean_a = (consumed_ah - charge.began_ah) / elapsed_h if elapsed_h > 0 else 0.0
    return capacity_ah if LEAST_ENDURANCE_H * mean_a <= capacity_ah <= MOST_ENDURANCE_H * mean_a else None
