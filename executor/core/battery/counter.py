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


@dataclass(frozen=True, slots=True)
class Charge:
    """The counter of consumed charge, where there is one."""

    consumed_ah: float | None = None
    at_s: float = 0.0
    modelled_pct: float = 0.0
    began_ah: float = 0.0
    began_pct: float = 0.0
    """What the percentage was when the counter was first heard."""
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


def counted_from(charge: Charge, consumed_ah: float, reported_pct: float, modelled_pct: float, now_s: float) -> Charge:
    """Return a counter that is read from here on; whether the percentage follows it is a matter of the vehicle."""
    return Charge(
        consumed_ah, now_s, modelled_pct, consumed_ah, reported_pct, charge.set_ah, now_s, charge.set_ah,
        mark=(reported_pct, consumed_ah), follows=charge.follows,
    )  # fmt: skip


def set_against(charge: Charge, reported_pct: float, *, rose_pct: float) -> Charge:
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


def possible(charge: Charge, capacity_ah: float, consumed_ah: float, now_s: float) -> float | None:
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
