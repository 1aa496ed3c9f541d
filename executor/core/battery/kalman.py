"""Estimate a battery's charge and the vehicle's consumption: a Kalman filter over (remaining percent, factor).

Both unknowns are linear: a stretch of flight modelled at m percent takes factor * m from the remaining charge, and a
report is the remaining charge, rounded. Two states and one measurement need no matrix library, and a projection needs
their covariance: a factor learned too high goes with a charge estimated too high. A scale factor alone (its Bayesian
counterpart) would not give the uncertainty of the charge.

The factor is a random walk, as wind and load change in flight; gusts add to the consumption, in proportion to it. Both
are as small as flights of vehicles that differ from their models show (`faultline bench prediction`); the account
detects drains, by consumption that no wind explains.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

ROUNDED_VAR = 1.0 / 12.0
"""Variance of a report, in percent squared: both autopilots report whole percents."""
SAWTOOTH_S = 12.0
"""Duration of a whole percent in an ordinary flight (0.083 %/s in the recorded ones): reports closer together share one
rounding error, and count as one."""
FACTOR_WALK = 0.02
"""Relative change of the factor in `WALK_S`: a turning wind, a dropped load."""
WALK_S = 300.0
GUST_VAR = 0.002
"""Variance in percent squared for each percent used: gusts and climbs, 0.14 % over ten."""
MIN_VAR = 1e-4
COUNTED_VAR = 0.15**2
"""Variance of a charge counter, in percent squared: its own steps, and a capacity learned from whole percents."""
OUTLIER_SD = 2.5
"""Standard deviations beyond which, and beyond `OUTLIER_PCT`, an innovation is a re-estimated percentage that says
nothing about the factor. Real consumption shows in many small innovations."""
OUTLIER_PCT = 2.0


BAND_SD = 1.5
"""Standard deviations on each side of the mean that contain nine flights of ten: the errors have thinner tails than a
normal distribution, whose 1.645 contained 96 to 98 % in some tenths of a route (`faultline bench prediction
--varied`)."""


@dataclass(frozen=True, slots=True)
class Prior:
    """The prior of the factor."""

    factor: float = 1.0
    sd: float = 0.12
    """Standard deviation of the factor: 10 % between vehicles of one data sheet, 5 % between packs, 4 % for wind."""
    slack: float = 0.0
    """Share of the usual consumption by which a vehicle without a data sheet may vary between flights, as the cost of
    its speeds and climbs is unknown."""


@dataclass(frozen=True, slots=True)
class BatteryEstimate:
    """State and covariance."""

    remaining_pct: float
    factor: float
    var_remaining: float
    covariance: float
    var_factor: float

    @property
    def factor_sd(self) -> float:
        """Standard deviation of the factor."""
        return math.sqrt(self.var_factor)


@dataclass(frozen=True, slots=True)
class Projection:
    """The charge left after a stretch of flight, as a normal distribution."""

    mean_pct: float
    sd_pct: float

    @property
    def band_pct(self) -> float:
        """Half the width of the band around the mean that should contain nine flights of ten."""
        return BAND_SD * self.sd_pct

    def chance_below(self, floor_pct: float) -> float:
        """Return the probability that less than `floor_pct` is left.

        >>> Projection(15.0, 2.0).chance_below(15.0)
        0.5
        """
        return 0.5 * math.erfc((self.mean_pct - floor_pct) / (self.sd_pct * math.sqrt(2.0)))


def initialise_estimate(reported_pct: float, prior: Prior) -> BatteryEstimate:
    """Return the estimate from the first report."""
    return BatteryEstimate(reported_pct, prior.factor, ROUNDED_VAR, 0.0, prior.sd**2)


def predict_estimate(estimate: BatteryEstimate, modelled_pct: float, elapsed_s: float) -> BatteryEstimate:
    """Advance the estimate over a stretch modelled at `modelled_pct`."""
    walk = (FACTOR_WALK * estimate.factor) ** 2 * max(0.0, elapsed_s) / WALK_S if modelled_pct > 0 else 0.0
    gusts = GUST_VAR * estimate.factor * modelled_pct
    return BatteryEstimate(
        estimate.remaining_pct - estimate.factor * modelled_pct,
        estimate.factor,
        estimate.var_remaining
        - 2 * modelled_pct * estimate.covariance
        + modelled_pct**2 * estimate.var_factor
        + gusts
        + MIN_VAR * 0.01,
        estimate.covariance - modelled_pct * estimate.var_factor,
        estimate.var_factor + walk,
    )


def correct_with_report(
    estimate: BatteryEstimate, reported_pct: float, since_s: float, roughness_pct: float = 0.0
) -> BatteryEstimate:
    """Correct with a report of the remaining charge.

    Args:
        estimate: The estimate advanced to the report.
        reported_pct: The report, in whole percents.
        since_s: Time since the report before.
        roughness_pct: Observed fluctuation of the reports.
    """
    single = ROUNDED_VAR + roughness_pct**2 / 4
    innovation = reported_pct - estimate.remaining_pct
    if abs(innovation) > max(OUTLIER_PCT, OUTLIER_SD * math.sqrt(estimate.var_remaining + single)):
        return reset_remaining(estimate, reported_pct)
    return _apply_innovation(estimate, innovation, single * max(1.0, SAWTOOTH_S / max(since_s, 0.1)))


def correct_with_counter(estimate: BatteryEstimate, counted_pct: float) -> BatteryEstimate:
    """Correct with the remaining charge by the counter, which is not rounded."""
    innovation = counted_pct - estimate.remaining_pct
    if abs(innovation) > OUTLIER_PCT:
        return reset_remaining(estimate, counted_pct)
    return _apply_innovation(estimate, innovation, COUNTED_VAR)


def _apply_innovation(estimate: BatteryEstimate, innovation: float, noise: float) -> BatteryEstimate:
    spread = estimate.var_remaining + noise
    gain, gain_factor = estimate.var_remaining / spread, estimate.covariance / spread
    return BatteryEstimate(
        estimate.remaining_pct + gain * innovation,
        estimate.factor + gain_factor * innovation,
        max(MIN_VAR, (1 - gain) * estimate.var_remaining),
        (1 - gain) * estimate.covariance,
        max(MIN_VAR, estimate.var_factor - gain_factor * estimate.covariance),
    )


def reset_remaining(estimate: BatteryEstimate, reported_pct: float) -> BatteryEstimate:
    """Reset the charge after a report that no consumption explains; the factor stays."""
    return replace(estimate, remaining_pct=reported_pct, var_remaining=ROUNDED_VAR, covariance=0.0)


def project_remaining(estimate: BatteryEstimate, modelled_pct: float) -> Projection:
    """Return the charge left after a stretch modelled at `modelled_pct`."""
    ahead = predict_estimate(estimate, modelled_pct, 0.0)
    return Projection(ahead.remaining_pct, math.sqrt(max(ahead.var_remaining, MIN_VAR)))
