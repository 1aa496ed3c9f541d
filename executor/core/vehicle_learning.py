"""What a vehicle's own flight says of it: how long its legs take, and what it uses, each with its uncertainty.

Every leg that was flown undisturbed is one observation. The time: its share of the model's, r = flown / planned, is
normal about the vehicle's pace, with the variance

    R = (SEEN_S / planned)^2 + scatter^2

as a waypoint's end is known to a second and no two legs are alike: turns and ramps are more of a transit than of an
inspection. A scalar Kalman update (Welch & Bishop, "An
Introduction to the Kalman Filter", 2006, with no process noise but a floor under the variance) takes it in:

    K = P / (P + R);  m' = m + K (r - m);  P' = max((1 - K) P, LEAST_SD^2)

The innovation is cut off at `OUTLIER_SD` of its deviations (Huber), so that one strange leg moves little, and the mean
stays within `BOUNDS`. The floor keeps it following a wind that turns.

Times and consumption do not count anything twice: the battery's model is driven by velocities, second by second
(`Scene.draw_pct_per_s`, `account.drawn`), so its factor is one of power, whatever the legs take. Of a leg ahead the
energy is therefore the model's, times the pace (so much longer is the power drawn), times the factor.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace

from executor.core.battery.kalman import ROUNDED_VAR, Prior
from missions import Pace, Performance, Phase

SEEN_S = 1.0
SCATTER_INSPECT = 0.015
"""Of whole routes in simulation it is 0.005 to 0.009."""
SCATTER_TRANSIT = 0.03
FIRST_SD = 0.07
"""Who reaches a tenth less than the speed asked of it takes so much longer for a leg with its stops."""
LEAST_SD = 0.005
OUTLIER_SD = 2.5
BOUNDS = (0.7, 1.6)
FACTOR_BOUNDS = (0.5, 2.0)
"""Of a consumption: beyond it is no vehicle but a fault, or a wrong data sheet."""
SHORT_S = 2.0
"""A leg that is planned shorter says nothing."""
POWER_SCATTER = 0.02
"""Of a consumption between flights of one vehicle on one day."""
ANOTHER_DAY_SD = 0.03
"""What another day adds: air, load, the pack's age."""


@dataclass(frozen=True, slots=True)
class PaceEstimate:
    """A factor on times, and how sure it is."""

    mean: float = 1.0
    var: float = FIRST_SD**2
    legs: int = 0
    """It was learned from."""

    @property
    def sd(self) -> float:
        """Standard deviation."""
        return math.sqrt(self.var)


@dataclass(frozen=True, slots=True)
class LearnedFactors:
    """What one vehicle's legs have said so far, relative to the models that its flight began with."""

    inspect: PaceEstimate = field(default_factory=PaceEstimate)
    transit: PaceEstimate = field(default_factory=PaceEstimate)
    given_pct: float = 0.0
    """By its battery, on the legs that count."""
    modelled_pct: float = 0.0
    """By the energy model for the same legs at the velocities that were flown."""
    flown_s: float = 0.0
    """What they took."""

    @property
    def pace(self) -> Pace:
        """Return the factors on what is ahead."""
        return Pace(self.inspect.mean, self.transit.mean)


@dataclass(frozen=True, slots=True)
class KnownVehicle:
    """What is known of a vehicle from flights before, against the model of a vehicle that nobody knows."""

    inspect: PaceEstimate
    transit: PaceEstimate
    consumption: Prior
    minutes: float
    """In the air that the consumption was learned from."""
    autopilot: str
    drone: str
    performance: Performance | None = None
    """By its own parameters then."""

    @property
    def pace(self) -> Pace:
        """Return the factors on times."""
        return Pace(self.inspect.mean, self.transit.mean)

    @property
    def start(self) -> LearnedFactors:
        """Return what a flight on another day begins with: relative to this, it is not known whether it is the same."""
        return LearnedFactors(_widen_for_another_day(self.inspect), _widen_for_another_day(self.transit))

    @property
    def prior(self) -> Prior:
        """Return what is believed of the consumption on another day."""
        return Prior(self.consumption.factor, math.hypot(self.consumption.sd, ANOTHER_DAY_SD))


UNKNOWN = LearnedFactors()


def update_pace(
    known: PaceEstimate, flown_s: float, planned_s: float, scatter: float = SCATTER_INSPECT
) -> PaceEstimate:  # fmt: skip
    """Return an estimate after a leg.

    >>> after = update_pace(PaceEstimate(), 110.0, 100.0)
    >>> round(after.mean, 3), round(after.sd, 3), after.legs
    (1.094, 0.017, 1)
    """
    if planned_s < SHORT_S or flown_s <= 0.0:
        return known
    noise = (SEEN_S / planned_s) ** 2 + scatter**2
    spread = known.var + noise
    most = OUTLIER_SD * math.sqrt(spread)
    innovation = min(most, max(-most, flown_s / planned_s - known.mean))
    gain = known.var / spread
    low, high = BOUNDS
    mean = min(high, max(low, known.mean + gain * innovation))
    return PaceEstimate(mean, max(LEAST_SD**2, (1.0 - gain) * known.var), known.legs + 1)


def learn_from_leg(known: LearnedFactors, phase: Phase, flown_s: float, planned_s: float) -> LearnedFactors:
    """Return what is known after a leg of a phase that was flown from end to end, undisturbed."""
    if phase is Phase.INSPECT:
        return replace(known, inspect=update_pace(known.inspect, flown_s, planned_s))
    if phase in (Phase.TRANSIT, Phase.RETURN):
        return replace(known, transit=update_pace(known.transit, flown_s, planned_s, SCATTER_TRANSIT))
    return known


def learn_from_energy(known: LearnedFactors, given_pct: float, modelled_pct: float, flown_s: float) -> LearnedFactors:
    """Return what is known with what a leg used; what its battery counted anew within it says nothing."""
    if modelled_pct <= 0.0:
        return known
    return replace(
        known,
        given_pct=known.given_pct + given_pct,
        modelled_pct=known.modelled_pct + modelled_pct,
        flown_s=known.flown_s + flown_s,
    )


def estimate_consumption(known: LearnedFactors, prior: Prior) -> Prior:
    """Return the consumption after a flight: the prior beside what was given over what the model says.

    Two readings of whole percents are as far apart as their roundings allow; the rest is scatter of the flights.

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
    """Return what is known of a vehicle after a flight, against the model of a vehicle that nobody knows.

    Args:
        known: In its flight.
        start: What the flight began with, if anything.
        prior: What was believed of its consumption then.
        autopilot: Its own.
        drone: Of the energy model.
        performance: That its flight was priced with.
        drained: Whether its battery was found at fault: then what it used is no sign of what it uses.
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
    sd = min(FIRST_SD, math.hypot(known.sd / known.mean, ANOTHER_DAY_SD))
    return PaceEstimate(1.0, sd**2)
