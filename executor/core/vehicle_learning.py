"""Learn a vehicle's pace and consumption from its own flights, each with its uncertainty.

Each undisturbed leg is one observation. Its time relative to the model's, r = flown / planned, is normally distributed
about the vehicle's pace, with the variance

    R = (LEG_END_S / planned)^2 + scatter^2

as the end of a waypoint is known to a second, and no two legs are alike: turns and ramps are a larger part of a transit
than of an inspection. A scalar Kalman update (Welch & Bishop, "An Introduction to the Kalman Filter", 2006, without
process noise but with a lower bound on the variance) applies it:

    K = P / (P + R);  m' = m + K (r - m);  P' = max((1 - K) P, SMALLEST_SD^2)

The innovation is clipped at `OUTLIER_SD` standard deviations (Huber), so that one odd leg moves the mean little, and
the mean stays within `BOUNDS`. The lower bound keeps the estimate following a wind that turns.

Times and consumption count nothing twice: the battery model is driven by velocities, second by second
(`Scene.draw_pct_per_s`, `account.drawn`), so its factor is one of power, whatever the legs take. The energy of a leg
ahead is therefore the model's, times the pace (the power is drawn for longer), times the factor.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace

from executor.core.battery.kalman import ROUNDED_VAR, Prior
from missions import Pace, Performance, Phase

LEG_END_S = 1.0
SCATTER_INSPECT = 0.015
"""Standard deviation of an inspection leg's relative time; for whole routes in simulation it is 0.005 to 0.009."""
SCATTER_TRANSIT = 0.03
FIRST_SD = 0.07
"""Prior standard deviation: a vehicle that reaches a tenth less than the commanded speed takes that much longer for a
leg with its stops."""
SMALLEST_SD = 0.005
OUTLIER_SD = 2.5
BOUNDS = (0.7, 1.6)
FACTOR_BOUNDS = (0.5, 2.0)
"""Bounds on a consumption factor; beyond them is a fault, or a wrong data sheet."""
SHORTEST_LEG_S = 2.0
"""Shortest planned time of a leg that is used."""
POWER_SCATTER = 0.02
"""Standard deviation of the consumption between flights of one vehicle on one day."""
OTHER_DAY_SD = 0.03
"""Additional standard deviation on another day: air, payload, age of the pack."""


@dataclass(frozen=True, slots=True)
class PaceEstimate:
    """A factor on times, with its variance."""

    mean: float = 1.0
    var: float = FIRST_SD**2
    legs: int = 0
    """Legs it was learned from."""

    @property
    def sd(self) -> float:
        """Standard deviation."""
        return math.sqrt(self.var)


@dataclass(frozen=True, slots=True)
class LearnedFactors:
    """Factors learned from a vehicle's legs, relative to the models its flight began with."""

    inspect: PaceEstimate = field(default_factory=PaceEstimate)
    transit: PaceEstimate = field(default_factory=PaceEstimate)
    given_pct: float = 0.0
    """Battery charge used on the legs that count."""
    modelled_pct: float = 0.0
    """Modelled charge for the same legs at the velocities flown."""
    flown_s: float = 0.0
    """Their total time."""

    @property
    def pace(self) -> Pace:
        """Return the factors on legs ahead."""
        return Pace(self.inspect.mean, self.transit.mean)


@dataclass(frozen=True, slots=True)
class KnownVehicle:
    """A vehicle's factors from earlier flights, relative to the model of an unknown vehicle."""

    inspect: PaceEstimate
    transit: PaceEstimate
    consumption: Prior
    minutes: float
    """Flight minutes from which the consumption was learned."""
    autopilot: str
    drone: str
    performance: Performance | None = None
    """By its own parameters at that time."""

    @property
    def pace(self) -> Pace:
        """Return the factors on times."""
        return Pace(self.inspect.mean, self.transit.mean)

    @property
    def start(self) -> LearnedFactors:
        """Return the initial factors of a flight on another day, relative to these and less certain."""
        return LearnedFactors(_widen_for_another_day(self.inspect), _widen_for_another_day(self.transit))

    @property
    def prior(self) -> Prior:
        """Return the prior consumption on another day."""
        return Prior(self.consumption.factor, math.hypot(self.consumption.sd, OTHER_DAY_SD))


UNKNOWN = LearnedFactors()


def update_pace(
    known: PaceEstimate, flown_s: float, planned_s: float, scatter: float = SCATTER_INSPECT
) -> PaceEstimate:  # fmt: skip
    """Return an estimate after a leg.

    >>> after = update_pace(PaceEstimate(), 110.0, 100.0)
    >>> round(after.mean, 3), round(after.sd, 3), after.legs
    (1.094, 0.017, 1)
    """
    if planned_s < SHORTEST_LEG_S or flown_s <= 0.0:
        return known
    noise = (LEG_END_S / planned_s) ** 2 + scatter**2
    spread = known.var + noise
    most = OUTLIER_SD * math.sqrt(spread)
    innovation = min(most, max(-most, flown_s / planned_s - known.mean))
    gain = known.var / spread
    low, high = BOUNDS
    mean = min(high, max(low, known.mean + gain * innovation))
    return PaceEstimate(mean, max(SMALLEST_SD**2, (1.0 - gain) * known.var), known.legs + 1)


def learn_from_leg(known: LearnedFactors, phase: Phase, flown_s: float, planned_s: float) -> LearnedFactors:
    """Return the factors after a leg of a phase, flown undisturbed from end to end."""
    if phase is Phase.INSPECT:
        return replace(known, inspect=update_pace(known.inspect, flown_s, planned_s))
    if phase in (Phase.TRANSIT, Phase.RETURN):
        return replace(known, transit=update_pace(known.transit, flown_s, planned_s, SCATTER_TRANSIT))
    return known


def learn_from_energy(known: LearnedFactors, given_pct: float, modelled_pct: float, flown_s: float) -> LearnedFactors:
    """Return the factors with a leg's consumption; a leg in which the battery account was restarted has none."""
    if modelled_pct <= 0.0:
        return known
    return replace(
        known,
        given_pct=known.given_pct + given_pct,
        modelled_pct=known.modelled_pct + modelled_pct,
        flown_s=known.flown_s + flown_s,
    )


def estimate_consumption(known: LearnedFactors, prior: Prior) -> Prior:
    """Return the consumption after a flight: the prior combined with the ratio of charge used to charge modelled.

    Two readings in whole percent differ by their rounding; the rest is scatter between flights.

    >>> found = estimate_consumption(LearnedFactors(given_pct=46.0, modelled_pct=40.0, flown_s=600.0), Prior())
    >>> round(found.factor, 3), round(found.sd, 3)
    (1.145, 0.022)
    """
    if known.modelled_pct <= 0.0:
        return prior
    low, high = FACTOR_BOUNDS
    ratio = min(high, max(low, known.given_pct / known.modelled_pct))
    noise = 2.0 * ROUNDED_VAR / known.modelled_pct**2 + POWER_SCATTER**2
    gain = prior.sd**2 / (prior.sd**2 + noise)
    return Prior(prior.factor + gain * (ratio - prior.factor), math.sqrt((1.0 - gain) * prior.sd**2))


def update_known_vehicle(
    known: LearnedFactors, start: KnownVehicle | None, prior: Prior, *, autopilot: str, drone: str,
    performance: Performance,
    drained: bool,
) -> KnownVehicle:  # fmt: skip
    """Return a vehicle's factors after a flight, relative to the model of an unknown vehicle.

    Args:
        known: The factors learned in this flight.
        start: The factors the flight began with, if any.
        prior: The prior consumption at that time.
        autopilot: The vehicle's autopilot.
        drone: The drone of the energy model.
        performance: The performance its flight was priced with.
        drained: Whether its battery was found at fault: its consumption then says nothing.
    """
    minutes, before = (0.0, Pace()) if start is None else (start.minutes, start.pace)
    legs = (0, 0) if start is None else (start.inspect.legs, start.transit.legs)
    return KnownVehicle(
        _to_absolute(known.inspect, before.inspect, legs[0]),
        _to_absolute(known.transit, before.transit, legs[1]),
        prior if drained else estimate_consumption(known, prior),
        minutes if drained else minutes + known.flown_s / 60.0,
        autopilot,
        drone,
        performance,
    )


def _to_absolute(known: PaceEstimate, before: float, legs: int) -> PaceEstimate:
    low, high = BOUNDS
    mean = min(high, max(low, known.mean * before))
    return PaceEstimate(mean, known.var * before**2, legs + known.legs)


def _widen_for_another_day(known: PaceEstimate) -> PaceEstimate:
    sd = min(FIRST_SD, math.hypot(known.sd / known.mean, OTHER_DAY_SD))
    return PaceEstimate(1.0, sd**2)
